/* One thing over and over at 72 MHz: BENCH_SVC, BENCH_UDF (handled), or the polling of BENCH_COUNTFLAG, BENCH_UNMODELLED
 * or, by a store, BENCH_BSRR of a pin that is an input. */
#include "board.h"
#include "f103.h"

/* Where a larger chip has its DAC. */
#define UNMODELLED (*(volatile uint32_t *)0x40007400u)
enum { COUNTFLAG = 1 << 16 };

volatile uint32_t bench_rounds;

void SVC_Handler(void);
void SVC_Handler(void) {}

/* Goes on behind the instruction: the seventh word of the frame. */
void HardFault_Handler(void);
__attribute__((naked)) void HardFault_Handler(void)
{
    __asm volatile("ldr r0, [sp, #24]\n adds r0, #2\n str r0, [sp, #24]\n bx lr");
}

static inline void once(void)
{
#if defined BENCH_SVC
    __asm volatile("svc 0" ::: "memory");
#elif defined BENCH_UDF
    __asm volatile("udf 0" ::: "r0", "memory");
#elif defined BENCH_COUNTFLAG
    while (!(SYSTICK->CTRL & COUNTFLAG)) {
    }
#elif defined BENCH_UNMODELLED
    (void)UNMODELLED;
#elif defined BENCH_BSRR
    GPIOB->BSRR = 1u << 8;
#endif
}

int main(void)
{
    clock_start();
    RCC->APB2ENR |= RCC_APB2ENR_IOPBEN;
    SYSTICK->LOAD = HCLK_HZ / 1000u - 1u;
    SYSTICK->VAL = 0;
    SYSTICK->CTRL = SYSTICK_CTRL_ENABLE | SYSTICK_CTRL_CLKSOURCE_CORE;
    for (;;) {
        once();
        ++bench_rounds;
    }
}
