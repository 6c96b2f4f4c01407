/* Toggles PB8, where the bench has no wire, as fast as it can at 8 MHz; or sleeps for ever. */
#include "f103.h"

volatile uint32_t bench_rounds;

int main(void)
{
#ifndef BENCH_ASLEEP
    RCC->APB2ENR |= RCC_APB2ENR_IOPBEN;
    GPIOB->CRH = (GPIOB->CRH & ~0xFu) | GPIO_OUTPUT_PUSH_PULL_2MHZ;
    for (;;) {
        GPIOB->BSRR = 1u << 8;
        GPIOB->BSRR = 1u << 24;
        ++bench_rounds;
    }
#else
    for (;;) {
        wait_for_interrupt();
    }
#endif
}
