/* Turns a pin over by its bit-band alias, as the macros of many boards' examples do. */
#include "board.h"
#include "f103.h"

#define ALIAS(address, bit) (*(volatile uint32_t *)(0x42000000u + ((address) - 0x40000000u) * 32u + (bit) * 4u))
#define PA0_OUT ALIAS((uint32_t)&GPIOA->ODR, 0)
#define PA4_IN ALIAS((uint32_t)&GPIOA->IDR, 4)

volatile uint32_t bench_rounds;

int main(void)
{
    clock_start();
    RCC->APB2ENR |= RCC_APB2ENR_IOPAEN;
    GPIOA->CRL = (GPIOA->CRL & ~0xFu) | GPIO_OUTPUT_PUSH_PULL_2MHZ;
    for (;;) {
        PA0_OUT = !PA4_IN;
        PA0_OUT = 0;
        ++bench_rounds;
    }
}
