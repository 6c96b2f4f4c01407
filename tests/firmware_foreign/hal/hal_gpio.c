/* Pins by masks. */
#include "hal.h"

void HAL_GPIO_Init(GPIO_TypeDef *GPIOx, const GPIO_InitTypeDef *init)
{
    for (uint32_t position = 0u; (init->Pin >> position) != 0u; position++) {
        uint32_t iocurrent = init->Pin & (1u << position);
        if (iocurrent == 0u) {
            continue;
        }
        uint32_t config;
        switch (init->Mode) {
        case GPIO_MODE_OUTPUT_PP:
            config = init->Speed;
            break;
        case GPIO_MODE_AF_PP:
            config = init->Speed + 0x8u;
            break;
        default:
            if (init->Pull == GPIO_NOPULL) {
                config = 0x4u;
            } else {
                config = 0x8u;
                if (init->Pull == GPIO_PULLUP) {
                    GPIOx->BSRR = iocurrent;
                } else {
                    GPIOx->BRR = iocurrent;
                }
            }
            break;
        }
        __IO uint32_t *configregister = position < 8u ? &GPIOx->CRL : &GPIOx->CRH;
        uint32_t registeroffset = (position & 7u) << 2;
        MODIFY_REG(*configregister, 0xFu << registeroffset, config << registeroffset);
    }
}

GPIO_PinState HAL_GPIO_ReadPin(GPIO_TypeDef *GPIOx, uint16_t pin)
{
    return (GPIOx->IDR & pin) != 0u ? GPIO_PIN_SET : GPIO_PIN_RESET;
}

void HAL_GPIO_WritePin(GPIO_TypeDef *GPIOx, uint16_t pin, GPIO_PinState state)
{
    if (state != GPIO_PIN_RESET) {
        GPIOx->BSRR = pin;
    } else {
        GPIOx->BSRR = (uint32_t)pin << 16;
    }
}

void __HAL_AFIO_REMAP_SWJ_NOJTAG(void)
{
    uint32_t tmpreg = AFIO->MAPR;
    tmpreg &= ~(0x7u << 24);
    tmpreg |= 0x2u << 24;
    AFIO->MAPR = tmpreg;
}
