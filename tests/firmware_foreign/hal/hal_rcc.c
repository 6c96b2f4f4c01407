/* Oscillators, PLL, buses. The switches of CR are reached through the bit-band alias. */
#include "hal.h"

#define CR_HSEON 16u
#define CR_HSERDY 17u
#define CR_PLLON 24u
#define CR_PLLRDY 25u
#define HSE_TIMEOUT_VALUE 100u
#define PLL_TIMEOUT_VALUE 2u
#define CLOCKSWITCH_TIMEOUT_VALUE 5000u
#define HSI_VALUE 8000000u
#define HSE_VALUE 8000000u

#define RCC_CR_BIT(bit) BIT_BAND(&RCC->CR, bit)

uint32_t SystemCoreClock = HSI_VALUE;

static HAL_StatusTypeDef wait_for_bit(uint32_t bit, FlagStatus wanted, uint32_t timeout)
{
    uint32_t tickstart = HAL_GetTick();
    while (RCC_CR_BIT(bit) != (uint32_t)wanted) {
        if (HAL_GetTick() - tickstart > timeout) {
            return HAL_TIMEOUT;
        }
    }
    return HAL_OK;
}

HAL_StatusTypeDef HAL_RCC_OscConfig(const RCC_OscInitTypeDef *init)
{
    if (init == NULL) {
        return HAL_ERROR;
    }
    if (init->HSEState == ENABLE) {
        SET_BIT(RCC->CR, 1u << CR_HSEON);
        if (wait_for_bit(CR_HSERDY, SET, HSE_TIMEOUT_VALUE) != HAL_OK) {
            return HAL_TIMEOUT;
        }
    }
    if (init->PLL.State == ENABLE) {
        RCC_CR_BIT(CR_PLLON) = DISABLE;
        if (wait_for_bit(CR_PLLRDY, RESET, PLL_TIMEOUT_VALUE) != HAL_OK) {
            return HAL_TIMEOUT;
        }
        CLEAR_BIT(RCC->CFGR, 1u << 17); /* HSE undivided */
        MODIFY_REG(RCC->CFGR, (1u << 16) | (0xFu << 18), (1u << 16) | init->PLL.PLLMUL);
        RCC_CR_BIT(CR_PLLON) = ENABLE;
        if (wait_for_bit(CR_PLLRDY, SET, PLL_TIMEOUT_VALUE) != HAL_OK) {
            return HAL_TIMEOUT;
        }
    }
    return HAL_OK;
}

HAL_StatusTypeDef HAL_RCC_ClockConfig(const RCC_ClkInitTypeDef *init, uint32_t latency)
{
    if (latency > (FLASH->ACR & 0x7u)) {
        MODIFY_REG(FLASH->ACR, 0x7u, latency);
        if ((FLASH->ACR & 0x7u) != latency) {
            return HAL_ERROR;
        }
    }
    /* The slowest buses first, so that no divider is too small on the way. */
    MODIFY_REG(RCC->CFGR, 0x7u << 8, 0x7u << 8);
    MODIFY_REG(RCC->CFGR, 0x7u << 11, 0x7u << 11);
    MODIFY_REG(RCC->CFGR, 0xFu << 4, init->AHBCLKDivider << 4);
    if (RCC_CR_BIT(CR_PLLRDY) == RESET) {
        return HAL_ERROR;
    }
    MODIFY_REG(RCC->CFGR, 0x3u, 0x2u);
    uint32_t tickstart = HAL_GetTick();
    while ((RCC->CFGR & 0xCu) != 0x8u) {
        if (HAL_GetTick() - tickstart > CLOCKSWITCH_TIMEOUT_VALUE) {
            return HAL_TIMEOUT;
        }
    }
    MODIFY_REG(RCC->CFGR, 0x7u << 8, init->APB1CLKDivider << 8);
    MODIFY_REG(RCC->CFGR, 0x7u << 11, init->APB2CLKDivider << 11);
    SystemCoreClock = HAL_RCC_GetSysClockFreq();
    return HAL_InitTick(TICK_INT_PRIORITY);
}

uint32_t HAL_RCC_GetSysClockFreq(void)
{
    uint32_t cfgr = RCC->CFGR;
    uint32_t multiplier = ((cfgr >> 18) & 0xFu) + 2u;
    switch (cfgr & 0xCu) {
    case 0x8u:
        if ((cfgr & (1u << 16)) == 0u) {
            return HSI_VALUE / 2u * multiplier;
        }
        return (cfgr & (1u << 17) ? HSE_VALUE / 2u : HSE_VALUE) * multiplier;
    case 0x4u:
        return HSE_VALUE;
    default:
        return HSI_VALUE;
    }
}

uint32_t HAL_RCC_GetPCLK2Freq(void)
{
    static const uint8_t APBPrescTable[8] = {0, 0, 0, 0, 1, 2, 3, 4};
    return SystemCoreClock >> APBPrescTable[(RCC->CFGR >> 11) & 0x7u];
}

void __HAL_RCC_APB2_CLK_ENABLE(uint32_t mask)
{
    __IO uint32_t tmpreg;
    SET_BIT(RCC->APB2ENR, mask);
    tmpreg = READ_BIT(RCC->APB2ENR, mask); /* a delay after the clock came on */
    UNUSED(tmpreg);
}
