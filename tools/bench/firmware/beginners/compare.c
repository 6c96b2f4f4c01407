/* Stores a new duty as fast as it can into a channel of TIM3 that makes PWM at 20 kHz on PA6.
 *
 * BENCH_AT_ONCE: without preload, so that each store counts at once.
 */
#include "board.h"
#include "f103.h"
#include "f103_timers.h"

volatile uint32_t bench_rounds;

int main(void)
{
    clock_start();
    RCC->APB2ENR |= RCC_APB2ENR_IOPAEN;
    RCC->APB1ENR |= RCC_APB1ENR_TIM3EN;
    GPIOA->CRL = (GPIOA->CRL & ~(0xFu << 24)) | GPIO_ALTERNATE_PUSH_PULL_2MHZ << 24;
    TIM3->ARR = 3599;
#ifdef BENCH_AT_ONCE
    TIM3->CCMR1 = 6u << 4;
#else
    TIM3->CCMR1 = TIM_CCMR_PWM1_FIRST;
#endif
    TIM3->CCER = TIM_CCER_CC1E;
    TIM3->EGR = TIM_EGR_UG;
    TIM3->CR1 = TIM_CR1_CEN | TIM_CR1_ARPE;
    for (;;) {
        TIM3->CCR1 = bench_rounds++ & 2047u;
    }
}
