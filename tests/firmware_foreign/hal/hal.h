/* A small hardware abstraction layer in the manner of vendor libraries: handles,
 * status codes, weak callbacks, time-outs in ticks of 1 ms. */
#ifndef HAL_H
#define HAL_H

#include <stddef.h>
#include <stdint.h>

#define __IO volatile
#define __weak __attribute__((weak))
#define UNUSED(x) ((void)(x))

/* ---- registers (RM0008, PM0056) ------------------------------------------------ */
typedef struct { __IO uint32_t CR, CFGR, CIR, APB2RSTR, APB1RSTR, AHBENR, APB2ENR, APB1ENR, BDCR, CSR; } RCC_TypeDef;
typedef struct { __IO uint32_t ACR, KEYR, OPTKEYR, SR, CR, AR, RESERVED, OBR, WRPR; } FLASH_TypeDef;
typedef struct { __IO uint32_t CRL, CRH, IDR, ODR, BSRR, BRR, LCKR; } GPIO_TypeDef;
typedef struct { __IO uint32_t EVCR, MAPR, EXTICR[4], RESERVED, MAPR2; } AFIO_TypeDef;
typedef struct { __IO uint32_t SR, DR, BRR, CR1, CR2, CR3, GTPR; } USART_TypeDef;
typedef struct { __IO uint32_t CTRL, LOAD, VAL, CALIB; } SysTick_TypeDef;
typedef struct { __IO uint32_t CPUID, ICSR, VTOR, AIRCR, SCR, CCR; __IO uint8_t SHP[12]; __IO uint32_t SHCSR; } SCB_TypeDef;

#define PERIPH_BASE 0x40000000u
#define PERIPH_BB_BASE 0x42000000u
#define RCC ((RCC_TypeDef *)0x40021000u)
#define FLASH ((FLASH_TypeDef *)0x40022000u)
#define GPIOA ((GPIO_TypeDef *)0x40010800u)
#define GPIOB ((GPIO_TypeDef *)0x40010C00u)
#define GPIOC ((GPIO_TypeDef *)0x40011000u)
#define AFIO ((AFIO_TypeDef *)0x40010000u)
#define USART1 ((USART_TypeDef *)0x40013800u)
#define SysTick ((SysTick_TypeDef *)0xE000E010u)
#define SCB ((SCB_TypeDef *)0xE000ED00u)
#define NVIC_ISER ((__IO uint32_t *)0xE000E100u)
#define NVIC_IP ((__IO uint8_t *)0xE000E400u)

#define SET_BIT(REG, BIT) ((REG) |= (BIT))
#define CLEAR_BIT(REG, BIT) ((REG) &= ~(BIT))
#define READ_BIT(REG, BIT) ((REG) & (BIT))
#define MODIFY_REG(REG, CLEARMASK, SETMASK) ((REG) = (((REG) & ~(CLEARMASK)) | (SETMASK)))

/* The alias word of bit `bit` of the peripheral register at `address`. */
#define BIT_BAND(address, bit) \
    (*(__IO uint32_t *)(PERIPH_BB_BASE + ((uint32_t)(address) - PERIPH_BASE) * 32u + (uint32_t)(bit) * 4u))

/* ---- common types ---------------------------------------------------------------- */
typedef enum { HAL_OK = 0x00, HAL_ERROR = 0x01, HAL_BUSY = 0x02, HAL_TIMEOUT = 0x03 } HAL_StatusTypeDef;
typedef enum { RESET = 0, SET = 1 } FlagStatus;
typedef enum { DISABLE = 0, ENABLE = 1 } FunctionalState;
#define HAL_MAX_DELAY 0xFFFFFFFFu

extern uint32_t SystemCoreClock;
extern __IO uint32_t uwTick;

/* ---- core (hal.c, hal_cortex.c) ------------------------------------------------- */
#define TICK_INT_PRIORITY 15u
#define NVIC_PRIORITYGROUP_4 0x3u

HAL_StatusTypeDef HAL_Init(void);
HAL_StatusTypeDef HAL_InitTick(uint32_t TickPriority);
void HAL_MspInit(void);
void HAL_IncTick(void);
uint32_t HAL_GetTick(void);
void HAL_Delay(uint32_t Delay);
void HAL_NVIC_SetPriorityGrouping(uint32_t PriorityGroup);
void HAL_NVIC_SetPriority(int32_t IRQn, uint32_t Priority);
void HAL_NVIC_EnableIRQ(int32_t IRQn);
#define SysTick_IRQn (-1)
#define USART1_IRQn 37

/* ---- RCC ---------------------------------------------------------------------- */
typedef struct { FunctionalState State; uint32_t PLLMUL; } RCC_PLLInitTypeDef;
typedef struct { FunctionalState HSEState; RCC_PLLInitTypeDef PLL; } RCC_OscInitTypeDef;
typedef struct { uint32_t AHBCLKDivider, APB1CLKDivider, APB2CLKDivider; } RCC_ClkInitTypeDef;
#define RCC_PLL_MUL9 (7u << 18)
#define RCC_SYSCLK_DIV1 0u
#define RCC_HCLK_DIV1 0u
#define RCC_HCLK_DIV2 4u
#define FLASH_LATENCY_2 2u

HAL_StatusTypeDef HAL_RCC_OscConfig(const RCC_OscInitTypeDef *init);
HAL_StatusTypeDef HAL_RCC_ClockConfig(const RCC_ClkInitTypeDef *init, uint32_t latency);
uint32_t HAL_RCC_GetSysClockFreq(void);
uint32_t HAL_RCC_GetPCLK2Freq(void);
void __HAL_RCC_APB2_CLK_ENABLE(uint32_t mask);
#define RCC_APB2ENR_AFIOEN 0x0001u
#define RCC_APB2ENR_IOPAEN 0x0004u
#define RCC_APB2ENR_IOPBEN 0x0008u
#define RCC_APB2ENR_IOPCEN 0x0010u
#define RCC_APB2ENR_USART1EN 0x4000u

/* ---- GPIO --------------------------------------------------------------------- */
typedef struct { uint32_t Pin, Mode, Pull, Speed; } GPIO_InitTypeDef;
typedef enum { GPIO_PIN_RESET = 0, GPIO_PIN_SET } GPIO_PinState;
#define GPIO_PIN(n) (1u << (n))
#define GPIO_MODE_INPUT 0x0u
#define GPIO_MODE_OUTPUT_PP 0x1u
#define GPIO_MODE_AF_PP 0x2u
#define GPIO_NOPULL 0x0u
#define GPIO_PULLUP 0x1u
#define GPIO_PULLDOWN 0x2u
#define GPIO_SPEED_FREQ_LOW 0x2u
#define GPIO_SPEED_FREQ_HIGH 0x3u

void HAL_GPIO_Init(GPIO_TypeDef *GPIOx, const GPIO_InitTypeDef *init);
GPIO_PinState HAL_GPIO_ReadPin(GPIO_TypeDef *GPIOx, uint16_t pin);
void HAL_GPIO_WritePin(GPIO_TypeDef *GPIOx, uint16_t pin, GPIO_PinState state);
void __HAL_AFIO_REMAP_SWJ_NOJTAG(void);

/* ---- UART --------------------------------------------------------------------- */
typedef enum { HAL_UART_STATE_RESET, HAL_UART_STATE_READY, HAL_UART_STATE_BUSY_TX } HAL_UART_StateTypeDef;
typedef struct {
    USART_TypeDef *Instance;
    uint32_t BaudRate;
    const uint8_t *pTxBuffPtr;
    __IO uint16_t TxXferCount;
    __IO HAL_UART_StateTypeDef gState;
} UART_HandleTypeDef;

HAL_StatusTypeDef HAL_UART_Init(UART_HandleTypeDef *huart);
void HAL_UART_MspInit(UART_HandleTypeDef *huart);
HAL_StatusTypeDef HAL_UART_Transmit(UART_HandleTypeDef *huart, const uint8_t *data, uint16_t size, uint32_t timeout);
HAL_StatusTypeDef HAL_UART_Transmit_IT(UART_HandleTypeDef *huart, const uint8_t *data, uint16_t size);
void HAL_UART_IRQHandler(UART_HandleTypeDef *huart);
void HAL_UART_TxCpltCallback(UART_HandleTypeDef *huart);

#endif
