/* The registers of the timers that these programs use: RM0008 14.4 and 15.4. */
#ifndef F103_TIMERS_H
#define F103_TIMERS_H

#include <stdint.h>

struct tim {
    volatile uint32_t CR1, CR2, SMCR, DIER, SR, EGR, CCMR1, CCMR2, CCER, CNT, PSC, ARR, RCR, CCR1, CCR2, CCR3, CCR4, BDTR;
};

#define TIM1 ((struct tim *)0x40012C00u)
#define TIM2 ((struct tim *)0x40000000u)
#define TIM3 ((struct tim *)0x40000400u)
#define TIM4 ((struct tim *)0x40000800u)

#define RCC_APB2ENR_TIM1EN (1u << 11)
#define RCC_APB1ENR_TIM2EN (1u << 0)
#define RCC_APB1ENR_TIM3EN (1u << 1)
#define RCC_APB1ENR_TIM4EN (1u << 2)

#define TIM_CR1_CEN (1u << 0)
#define TIM_CR1_ARPE (1u << 7)
#define TIM_SMCR_SMS_ENCODER3 (3u << 0)
#define TIM_EGR_UG (1u << 0)
/* PWM mode 1 with preload, of the first and of the second channel of a CCMR. */
#define TIM_CCMR_PWM1_FIRST (6u << 4 | 1u << 3)
#define TIM_CCMR_PWM1_SECOND (TIM_CCMR_PWM1_FIRST << 8)
/* Both channels of CCMR1 are inputs on their own pins, filtered over 8 cycles. */
#define TIM_CCMR1_INPUTS (1u << 0 | 3u << 4 | 1u << 8 | 3u << 12)
#define TIM_CCER_CC1E (1u << 0)
#define TIM_CCER_CC2E (1u << 4)
#define TIM_CCER_CC4E (1u << 12)
#define TIM_BDTR_MOE (1u << 15)

#endif
