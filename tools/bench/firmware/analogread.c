/* Reads two analog pins as Arduino cores on ST's HAL do: each reading switches the ADC on, sets it up, calibrates, converts
 * once, polls, and resets it again. */
#include "board.h"
#include "f103_analog.h"

volatile uint32_t bench_rounds, bench_sum;

static __attribute__((noinline)) void enable_clock(uint32_t bit)
{
    RCC->APB2ENR |= bit;
    volatile uint32_t seen = RCC->APB2ENR & bit; /* as __HAL_RCC_…_CLK_ENABLE: a read behind it */
    (void)seen;
}

static __attribute__((noinline)) void stop_conversion(void)
{
    if (ADC1->CR2 & ADC_CR2_ADON) {
        ADC1->CR2 &= ~ADC_CR2_ADON;
        while (ADC1->CR2 & ADC_CR2_ADON) {
        }
    }
}

static __attribute__((noinline)) void switch_on(void)
{
    if (!(ADC1->CR2 & ADC_CR2_ADON)) {
        ADC1->CR2 |= ADC_CR2_ADON;
        for (volatile uint32_t n = HCLK_HZ / 1000000u; n; --n) {
        }
        while (!(ADC1->CR2 & ADC_CR2_ADON)) {
        }
    }
}

static __attribute__((noinline)) uint32_t analog_read(uint32_t channel)
{
    enable_clock(RCC_APB2ENR_ADC1EN);
    enable_clock(RCC_APB2ENR_IOPAEN);
    enable_clock(RCC_APB2ENR_AFIOEN);
    GPIOA->CRL &= ~(0xFu << 4u * channel);
    stop_conversion();
    ADC1->CR2 = (ADC1->CR2 & ~(ADC_CR2_CONT | 7u << 17 | 1u << 11)) | ADC_CR2_EXTSEL_SWSTART;
    ADC1->CR1 &= ~(ADC_CR1_SCAN | 1u << 11 | 7u << 13);
    ADC1->SQR1 &= ~(15u << 20);
    ADC1->SQR3 = (ADC1->SQR3 & ~31u) | channel;
    ADC1->SMPR2 = (ADC1->SMPR2 & ~(7u << 3u * channel)) | ADC_SAMPLE_71_5 << 3u * channel;
    stop_conversion();
    switch_on();
    ADC1->CR2 |= ADC_CR2_RSTCAL;
    while (ADC1->CR2 & ADC_CR2_RSTCAL) {
    }
    switch_on();
    ADC1->CR2 |= ADC_CR2_CAL;
    while (ADC1->CR2 & ADC_CR2_CAL) {
    }
    switch_on();
    ADC1->SR = ~2u;
    ADC1->CR2 |= ADC_CR2_EXTTRIG | ADC_CR2_SWSTART;
    while (!(ADC1->SR & 2u)) {
    }
    ADC1->SR = ~(2u | 16u);
    const uint32_t value = ADC1->DR;
    stop_conversion();
    ADC1->SR = ~(1u | 2u | 16u);
    ADC1->CR1 &= ~(ADC_CR1_SCAN | 0xFFu << 13);
    RCC->APB2RSTR |= RCC_APB2ENR_ADC1EN;
    RCC->APB2RSTR &= ~RCC_APB2ENR_ADC1EN;
    RCC->APB2ENR &= ~RCC_APB2ENR_ADC1EN;
    return value;
}

int main(void)
{
    clock_start();
    RCC->CFGR |= RCC_CFGR_ADCPRE_DIV6;
    for (;;) {
        bench_sum += analog_read(0);
        bench_sum += analog_read(1);
        bench_rounds += 2;
    }
}
