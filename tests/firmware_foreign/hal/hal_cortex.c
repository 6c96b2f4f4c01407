/* NVIC and system handler priorities. */
#include "hal.h"

void HAL_NVIC_SetPriorityGrouping(uint32_t PriorityGroup)
{
    uint32_t value = SCB->AIRCR;
    value &= ~(0xFFFF0000u | 0x700u);
    SCB->AIRCR = value | 0x05FA0000u | (PriorityGroup << 8);
}

void HAL_NVIC_SetPriority(int32_t IRQn, uint32_t Priority)
{
    uint8_t value = (uint8_t)(Priority << 4);
    if (IRQn >= 0) {
        NVIC_IP[IRQn] = value;
    } else {
        SCB->SHP[((uint32_t)IRQn & 0xFu) - 4u] = value;
    }
}

void HAL_NVIC_EnableIRQ(int32_t IRQn)
{
    NVIC_ISER[(uint32_t)IRQn >> 5] = 1u << ((uint32_t)IRQn & 0x1Fu);
}
