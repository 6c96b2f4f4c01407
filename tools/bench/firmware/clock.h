/* 72 MHz from the crystal by the PLL, two wait states, prefetch on. */
#ifndef BENCH_CLOCK_H
#define BENCH_CLOCK_H

#include "../../robot_bench/firmware/f103.h"

#define BENCH_HCLK_HZ 72000000u

static inline void clock_start(void)
#ifdef BENCH_NO_CLOCK
{
}
#else
{
    FLASH->ACR = FLASH_ACR_PRFTBE | FLASH_ACR_LATENCY_2;
    RCC->CR |= RCC_CR_HSEON;
    while (!(RCC->CR & RCC_CR_HSERDY)) {
    }
    RCC->CFGR = RCC_CFGR_PLLSRC_HSE | RCC_CFGR_PLLMUL9 | RCC_CFGR_PPRE1_DIV2;
    RCC->CR |= RCC_CR_PLLON;
    while (!(RCC->CR & RCC_CR_PLLRDY)) {
    }
    RCC->CFGR |= RCC_CFGR_SW_PLL;
    while ((RCC->CFGR & RCC_CFGR_SWS_MASK) != RCC_CFGR_SWS_PLL) {
    }
}
#endif

#endif
