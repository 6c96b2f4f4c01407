/* The registers of an STM32F103 that these programs use, and no others.
 *
 * Names and offsets are those of the reference manual RM0008 (RCC: 7.3, FLASH:
 * 3.3.3 and PM0075, GPIO: 9.2, AFIO: 9.4, USART: 27.6) and of the Cortex-M3
 * programming manual PM0056 (SysTick: 4.5, NVIC: 4.3).
 */
#ifndef F103_H
#define F103_H

#include <stdint.h>

struct rcc { volatile uint32_t CR, CFGR, CIR, APB2RSTR, APB1RSTR, AHBENR, APB2ENR, APB1ENR, BDCR, CSR; };
struct flash { volatile uint32_t ACR; };
struct gpio { volatile uint32_t CRL, CRH, IDR, ODR, BSRR, BRR, LCKR; };
struct afio { volatile uint32_t EVCR, MAPR, EXTICR1, EXTICR2, EXTICR3, EXTICR4; };
struct usart { volatile uint32_t SR, DR, BRR, CR1, CR2, CR3, GTPR; };
struct systick { volatile uint32_t CTRL, LOAD, VAL, CALIB; };

#define RCC ((struct rcc *)0x40021000u)
#define FLASH ((struct flash *)0x40022000u)
#define GPIOA ((struct gpio *)0x40010800u)
#define GPIOB ((struct gpio *)0x40010C00u)
#define GPIOC ((struct gpio *)0x40011000u)
#define AFIO ((struct afio *)0x40010000u)
#define USART1 ((struct usart *)0x40013800u)
#define SYSTICK ((struct systick *)0xE000E010u)
#define NVIC_ISER ((volatile uint32_t *)0xE000E100u)

#define RCC_CR_HSEON (1u << 16)
#define RCC_CR_HSERDY (1u << 17)
#define RCC_CR_PLLON (1u << 24)
#define RCC_CR_PLLRDY (1u << 25)
#define RCC_CFGR_SW_MASK (3u << 0)
#define RCC_CFGR_SW_PLL (2u << 0)
#define RCC_CFGR_SWS_MASK (3u << 2)
#define RCC_CFGR_SWS_PLL (2u << 2)
#define RCC_CFGR_PPRE1_DIV2 (4u << 8)
#define RCC_CFGR_PLLSRC_HSE (1u << 16)
#define RCC_CFGR_PLLMUL9 (7u << 18)
#define RCC_APB2ENR_AFIOEN (1u << 0)
#define RCC_APB2ENR_IOPAEN (1u << 2)
#define RCC_APB2ENR_IOPBEN (1u << 3)
#define RCC_APB2ENR_IOPCEN (1u << 4)
#define RCC_APB2ENR_USART1EN (1u << 14)

#define FLASH_ACR_LATENCY_2 (2u << 0)
#define FLASH_ACR_PRFTBE (1u << 4)

/* One nibble of CRL or CRH a pin: CNF above MODE. */
#define GPIO_INPUT_FLOATING 0x4u
#define GPIO_OUTPUT_PUSH_PULL_2MHZ 0x2u
#define GPIO_ALTERNATE_PUSH_PULL_2MHZ 0xAu

#define AFIO_MAPR_SWJ_CFG_JTAG_OFF (2u << 24)

#define USART_SR_TXE (1u << 7)
#define USART_CR1_TE (1u << 3)
#define USART_CR1_TXEIE (1u << 7)
#define USART_CR1_UE (1u << 13)
#define USART1_IRQ 37u

#define SYSTICK_CTRL_ENABLE (1u << 0)
#define SYSTICK_CTRL_TICKINT (1u << 1)
#define SYSTICK_CTRL_CLKSOURCE_CORE (1u << 2)

static inline void interrupts_off(void) { __asm__ volatile("cpsid i" ::: "memory"); }
/* The barrier lets a pending interrupt in before the next instruction. */
static inline void interrupts_on(void) { __asm__ volatile("cpsie i\n\tisb" ::: "memory"); }
static inline void wait_for_interrupt(void) { __asm__ volatile("dsb\n\twfi" ::: "memory"); }

#endif
