/* Transmit, polled and by interrupt. */
#include "hal.h"

#define USART_SR_TXE (1u << 7)
#define USART_SR_TC (1u << 6)
#define USART_CR1_UE (1u << 13)
#define USART_CR1_TXEIE (1u << 7)
#define USART_CR1_TCIE (1u << 6)
#define USART_CR1_TE (1u << 3)

static HAL_StatusTypeDef wait_on_flag(UART_HandleTypeDef *huart, uint32_t flag, uint32_t tickstart, uint32_t timeout)
{
    while ((huart->Instance->SR & flag) == 0u) {
        if (timeout != HAL_MAX_DELAY && HAL_GetTick() - tickstart > timeout) {
            huart->gState = HAL_UART_STATE_READY;
            return HAL_TIMEOUT;
        }
    }
    return HAL_OK;
}

HAL_StatusTypeDef HAL_UART_Init(UART_HandleTypeDef *huart)
{
    if (huart == NULL) {
        return HAL_ERROR;
    }
    if (huart->gState == HAL_UART_STATE_RESET) {
        HAL_UART_MspInit(huart);
    }
    CLEAR_BIT(huart->Instance->CR1, USART_CR1_UE);
    MODIFY_REG(huart->Instance->CR2, 0x3u << 12, 0u);
    MODIFY_REG(huart->Instance->CR1, 0x160Cu, USART_CR1_TE);
    CLEAR_BIT(huart->Instance->CR3, 0x300u);
    /* Mantissa and fraction of PCLK2 / (16 x baud), in hundredths as the library does. */
    uint32_t pclk = HAL_RCC_GetPCLK2Freq();
    uint32_t hundredths = pclk / 4u * 25u / huart->BaudRate;
    uint32_t mantissa = hundredths / 100u;
    uint32_t fraction = ((hundredths - mantissa * 100u) * 16u + 50u) / 100u;
    huart->Instance->BRR = (mantissa << 4) + fraction;
    SET_BIT(huart->Instance->CR1, USART_CR1_UE);
    huart->gState = HAL_UART_STATE_READY;
    return HAL_OK;
}

HAL_StatusTypeDef HAL_UART_Transmit(UART_HandleTypeDef *huart, const uint8_t *data, uint16_t size, uint32_t timeout)
{
    if (huart->gState != HAL_UART_STATE_READY) {
        return HAL_BUSY;
    }
    if (data == NULL || size == 0u) {
        return HAL_ERROR;
    }
    huart->gState = HAL_UART_STATE_BUSY_TX;
    uint32_t tickstart = HAL_GetTick();
    while (size-- > 0u) {
        if (wait_on_flag(huart, USART_SR_TXE, tickstart, timeout) != HAL_OK) {
            return HAL_TIMEOUT;
        }
        huart->Instance->DR = *data++;
    }
    if (wait_on_flag(huart, USART_SR_TC, tickstart, timeout) != HAL_OK) {
        return HAL_TIMEOUT;
    }
    huart->gState = HAL_UART_STATE_READY;
    return HAL_OK;
}

HAL_StatusTypeDef HAL_UART_Transmit_IT(UART_HandleTypeDef *huart, const uint8_t *data, uint16_t size)
{
    if (huart->gState != HAL_UART_STATE_READY) {
        return HAL_BUSY;
    }
    if (data == NULL || size == 0u) {
        return HAL_ERROR;
    }
    huart->pTxBuffPtr = data;
    huart->TxXferCount = size;
    huart->gState = HAL_UART_STATE_BUSY_TX;
    SET_BIT(huart->Instance->CR1, USART_CR1_TXEIE);
    return HAL_OK;
}

void HAL_UART_IRQHandler(UART_HandleTypeDef *huart)
{
    uint32_t isrflags = huart->Instance->SR;
    uint32_t cr1its = huart->Instance->CR1;
    if ((isrflags & USART_SR_TXE) != 0u && (cr1its & USART_CR1_TXEIE) != 0u) {
        huart->Instance->DR = *huart->pTxBuffPtr++;
        if (--huart->TxXferCount == 0u) {
            CLEAR_BIT(huart->Instance->CR1, USART_CR1_TXEIE);
            SET_BIT(huart->Instance->CR1, USART_CR1_TCIE);
        }
        return;
    }
    if ((isrflags & USART_SR_TC) != 0u && (cr1its & USART_CR1_TCIE) != 0u) {
        CLEAR_BIT(huart->Instance->CR1, USART_CR1_TCIE);
        huart->gState = HAL_UART_STATE_READY;
        HAL_UART_TxCpltCallback(huart);
    }
}

__weak void HAL_UART_MspInit(UART_HandleTypeDef *huart)
{
    UNUSED(huart);
}

__weak void HAL_UART_TxCpltCallback(UART_HandleTypeDef *huart)
{
    UNUSED(huart);
}
