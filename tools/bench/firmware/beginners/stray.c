/* Accesses that reach no register, or not as they are meant, over and over: BENCH_STRAY says which. */
#include "board.h"
#include "f103.h"

volatile uint32_t bench_rounds;

#define WORD(address) (*(volatile uint32_t *)(address))
#define HALF(address) (*(volatile uint16_t *)(address))
#define BYTE(address) (*(volatile uint8_t *)(address))

int main(void)
{
    clock_start();
    RCC->APB2ENR |= RCC_APB2ENR_IOPAEN;
    for (;;) {
#if BENCH_STRAY == 1 /* written where a peripheral has no register */
        WORD(0x40010850u) = bench_rounds;
#elif BENCH_STRAY == 2 /* read there */
        (void)WORD(0x40010850u);
#elif BENCH_STRAY == 3 /* written where nothing is */
        WORD(0x40015000u) = bench_rounds;
#elif BENCH_STRAY == 4 /* written to a peripheral without its clock */
        WORD(0x40010C0Cu) = bench_rounds;
#elif BENCH_STRAY == 5 /* the same of what a reset leaves */
        WORD(0x40010C0Cu) = 0;
#elif BENCH_STRAY == 6 /* a byte written to a register of 16 bits */
        BYTE(0x4001080Cu) = (uint8_t)bench_rounds;
#elif BENCH_STRAY == 7 /* a halfword written to a register of 32 bits */
        HALF(0x40010810u) = (uint16_t)bench_rounds;
#elif BENCH_STRAY == 8 /* a register that only reads, written */
        WORD(0x40010808u) = bench_rounds;
#elif BENCH_STRAY == 9 /* flash written without PG */
        WORD(0x0800FC00u) = bench_rounds;
#elif BENCH_STRAY == 10 /* what is not modelled of the core */
        WORD(0xE000ED88u + 0x100u) = bench_rounds;
#elif BENCH_STRAY == 11 /* a word that stands across two registers */
        (void)WORD(0x40010806u);
#elif BENCH_STRAY == 12 /* by the alias of a bit, without a clock */
        (void)WORD(0x42000000u + 0x10C08u * 32u);
#elif BENCH_STRAY == 13 /* RCC's CR read-modify-written */
        RCC->CR |= RCC_CR_HSEON;
#elif BENCH_STRAY == 14 /* a DMA1 without its clock */
        WORD(0x40020004u) = bench_rounds;
#elif BENCH_STRAY == 15 /* RTC or BKP without DBP */
        WORD(0x40006C04u) = bench_rounds;
#elif BENCH_STRAY == 16 /* USART's DR without TE */
        WORD(0x40013804u) = bench_rounds;
#endif
        ++bench_rounds;
    }
}
