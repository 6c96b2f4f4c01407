/* Initialisation, tick and delay. */
#include "hal.h"

__IO uint32_t uwTick;

HAL_StatusTypeDef HAL_Init(void)
{
    SET_BIT(FLASH->ACR, 1u << 4); /* prefetch */
    HAL_NVIC_SetPriorityGrouping(NVIC_PRIORITYGROUP_4);
    if (HAL_InitTick(TICK_INT_PRIORITY) != HAL_OK) {
        return HAL_ERROR;
    }
    HAL_MspInit();
    return HAL_OK;
}

__weak HAL_StatusTypeDef HAL_InitTick(uint32_t TickPriority)
{
    uint32_t ticks = SystemCoreClock / 1000u;
    if (ticks - 1u > 0xFFFFFFu || TickPriority > 15u) {
        return HAL_ERROR;
    }
    SysTick->LOAD = ticks - 1u;
    SysTick->VAL = 0u;
    SysTick->CTRL = 0x7u; /* core clock, interrupt, on */
    HAL_NVIC_SetPriority(SysTick_IRQn, TickPriority);
    return HAL_OK;
}

__weak void HAL_MspInit(void)
{
}

__weak void HAL_IncTick(void)
{
    uwTick += 1u;
}

__weak uint32_t HAL_GetTick(void)
{
    return uwTick;
}

__weak void HAL_Delay(uint32_t Delay)
{
    uint32_t tickstart = HAL_GetTick();
    uint32_t wait = Delay;
    if (wait < HAL_MAX_DELAY) {
        wait += 1u; /* at least the time asked for */
    }
    while (HAL_GetTick() - tickstart < wait) {
    }
}
