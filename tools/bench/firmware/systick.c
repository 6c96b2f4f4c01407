/* Sleeps between SysTicks of 1 kHz at 72 MHz. */
#include "board.h"
#include "f103.h"

volatile uint32_t bench_rounds;

void SysTick_Handler(void);
void SysTick_Handler(void) { ++bench_rounds; }

int main(void)
{
    clock_start();
    SYSTICK->LOAD = HCLK_HZ / 1000u - 1u;
    SYSTICK->VAL = 0;
    SYSTICK->CTRL = SYSTICK_CTRL_ENABLE | SYSTICK_CTRL_TICKINT | SYSTICK_CTRL_CLKSOURCE_CORE;
    for (;;) {
        wait_for_interrupt();
    }
}
