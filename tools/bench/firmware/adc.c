/* Asleep between SysTicks, while circular DMA takes what ADC1 converts: one channel without a pause, at 857 kS/s with
 * 72 MHz or 1 MS/s with 56 MHz (BENCH_56_MHZ); or eight channels each 10 kHz (BENCH_EIGHT), started by SysTick or by
 * TRGO of TIM3 (BENCH_TRGO). */
#include "board.h"
#include "f103_analog.h"
#include "f103_timers.h"

#define ROUNDS 64u
#ifdef BENCH_EIGHT
#define CHANNELS 8u
#define SAMPLING_HZ 10000u
#else
#define CHANNELS 1u
#endif
#if defined(BENCH_EIGHT) && !defined(BENCH_TRGO)
#define TICK_HZ SAMPLING_HZ
#else
#define TICK_HZ 1000u
#endif
#ifdef BENCH_TRGO
#define STARTED_BY (4u << 17) /* EXTSEL: TIM3 TRGO */
#else
#define STARTED_BY ADC_CR2_EXTSEL_SWSTART
#endif

volatile uint32_t bench_rounds;
volatile uint16_t bench_samples[ROUNDS * CHANNELS];

void SysTick_Handler(void);
void SysTick_Handler(void)
{
    ++bench_rounds;
#if defined(BENCH_EIGHT) && !defined(BENCH_TRGO)
    ADC1->CR2 |= ADC_CR2_SWSTART;
#endif
}

#ifdef BENCH_TRGO
static void timer_start(void)
{
    RCC->APB1ENR |= RCC_APB1ENR_TIM3EN;
    TIM3->ARR = HCLK_HZ / SAMPLING_HZ - 1u;
    TIM3->CR2 = 2u << 4; /* TRGO with each update event */
    TIM3->CR1 = TIM_CR1_CEN;
}
#endif

static void adc_start(void)
{
    RCC->AHBENR |= RCC_AHBENR_DMA1EN;
    RCC->APB2ENR |= RCC_APB2ENR_IOPAEN | RCC_APB2ENR_ADC1EN;
    GPIOA->CRL = 0; /* analog, all of them */
    DMA_CHANNEL(DMA_ADC1)->CPAR = (uint32_t)&ADC1->DR;
    DMA_CHANNEL(DMA_ADC1)->CMAR = (uint32_t)bench_samples;
    DMA_CHANNEL(DMA_ADC1)->CNDTR = ROUNDS * CHANNELS;
    DMA_CHANNEL(DMA_ADC1)->CCR = DMA_CCR_EN | DMA_CCR_CIRC | DMA_CCR_MINC | DMA_CCR_PSIZE_16 | DMA_CCR_MSIZE_16;
    ADC1->SQR1 = (CHANNELS - 1u) << 20;
    ADC1->SQR3 = 0u | 1u << 5 | 2u << 10 | 3u << 15 | 4u << 20 | 5u << 25;
    ADC1->SQR2 = 6u | 7u << 5;
    ADC1->CR1 = CHANNELS > 1u ? ADC_CR1_SCAN : 0u;
    ADC1->CR2 = ADC_CR2_ADON | ADC_CR2_DMA | ADC_CR2_EXTTRIG | STARTED_BY | (CHANNELS == 1u ? ADC_CR2_CONT : 0u);
#ifndef BENCH_EIGHT
    ADC1->CR2 |= ADC_CR2_SWSTART;
#endif
}

int main(void)
{
    clock_start();
#ifdef BENCH_56_MHZ
    RCC->CFGR &= ~RCC_CFGR_SW_MASK;
    RCC->CR &= ~RCC_CR_PLLON;
    RCC->CFGR = RCC_CFGR_PLLSRC_HSE | 5u << 18 | RCC_CFGR_PPRE1_DIV2 | RCC_CFGR_ADCPRE_DIV4; /* 8 MHz x 7; 14 MHz */
    RCC->CR |= RCC_CR_PLLON;
    while (!(RCC->CR & RCC_CR_PLLRDY)) {
    }
    RCC->CFGR |= RCC_CFGR_SW_PLL;
    SYSTICK->LOAD = 56000000u / TICK_HZ - 1u;
#else
    RCC->CFGR |= RCC_CFGR_ADCPRE_DIV6;
    SYSTICK->LOAD = HCLK_HZ / TICK_HZ - 1u;
#endif
    adc_start();
#ifdef BENCH_TRGO
    timer_start();
#endif
    SYSTICK->VAL = 0;
    SYSTICK->CTRL = SYSTICK_CTRL_ENABLE | SYSTICK_CTRL_TICKINT | SYSTICK_CTRL_CLKSOURCE_CORE;
    for (;;) {
        wait_for_interrupt();
    }
}
