/* Drives forward, turns on the spot and stops, written as a generated project is:
 * SystemClock_Config, MX_..._Init, Error_Handler, and a main with a loop. */
#include "hal/hal.h"

static UART_HandleTypeDef huart1;
static volatile uint32_t lines_sent;

static void Error_Handler(void);

static void SystemClock_Config(void)
{
    RCC_OscInitTypeDef RCC_OscInitStruct = {0};
    RCC_ClkInitTypeDef RCC_ClkInitStruct = {0};

    RCC_OscInitStruct.HSEState = ENABLE;
    RCC_OscInitStruct.PLL.State = ENABLE;
    RCC_OscInitStruct.PLL.PLLMUL = RCC_PLL_MUL9;
    if (HAL_RCC_OscConfig(&RCC_OscInitStruct) != HAL_OK) {
        Error_Handler();
    }
    RCC_ClkInitStruct.AHBCLKDivider = RCC_SYSCLK_DIV1;
    RCC_ClkInitStruct.APB1CLKDivider = RCC_HCLK_DIV2;
    RCC_ClkInitStruct.APB2CLKDivider = RCC_HCLK_DIV1;
    if (HAL_RCC_ClockConfig(&RCC_ClkInitStruct, FLASH_LATENCY_2) != HAL_OK) {
        Error_Handler();
    }
}

static void MX_GPIO_Init(void)
{
    GPIO_InitTypeDef GPIO_InitStruct = {0};

    __HAL_RCC_APB2_CLK_ENABLE(RCC_APB2ENR_IOPCEN);
    __HAL_RCC_APB2_CLK_ENABLE(RCC_APB2ENR_IOPAEN);
    __HAL_RCC_APB2_CLK_ENABLE(RCC_APB2ENR_IOPBEN);

    HAL_GPIO_WritePin(GPIOA, GPIO_PIN(1) | GPIO_PIN(2) | GPIO_PIN(3), GPIO_PIN_RESET);
    HAL_GPIO_WritePin(GPIOB, GPIO_PIN(5) | GPIO_PIN(6) | GPIO_PIN(7) | GPIO_PIN(13), GPIO_PIN_RESET);
    HAL_GPIO_WritePin(GPIOB, GPIO_PIN(12), GPIO_PIN_SET); /* p2dx_con */

    GPIO_InitStruct.Mode = GPIO_MODE_OUTPUT_PP;
    GPIO_InitStruct.Pull = GPIO_NOPULL;
    GPIO_InitStruct.Speed = GPIO_SPEED_FREQ_LOW;
    GPIO_InitStruct.Pin = GPIO_PIN(1) | GPIO_PIN(2) | GPIO_PIN(3);
    HAL_GPIO_Init(GPIOA, &GPIO_InitStruct);
    GPIO_InitStruct.Pin = GPIO_PIN(5) | GPIO_PIN(6) | GPIO_PIN(7) | GPIO_PIN(12) | GPIO_PIN(13);
    HAL_GPIO_Init(GPIOB, &GPIO_InitStruct);

    GPIO_InitStruct.Mode = GPIO_MODE_INPUT;
    GPIO_InitStruct.Pull = GPIO_PULLDOWN;
    GPIO_InitStruct.Pin = GPIO_PIN(4) | GPIO_PIN(5) | GPIO_PIN(6) | GPIO_PIN(7);
    HAL_GPIO_Init(GPIOA, &GPIO_InitStruct);
    GPIO_InitStruct.Pin = GPIO_PIN(0) | GPIO_PIN(1) | GPIO_PIN(10) | GPIO_PIN(11);
    HAL_GPIO_Init(GPIOB, &GPIO_InitStruct);
}

static void MX_USART1_UART_Init(void)
{
    huart1.Instance = USART1;
    huart1.BaudRate = 115200;
    if (HAL_UART_Init(&huart1) != HAL_OK) {
        Error_Handler();
    }
}

/* The vendor's weak functions, replaced as a user replaces them. */
void HAL_MspInit(void)
{
    __HAL_RCC_APB2_CLK_ENABLE(RCC_APB2ENR_AFIOEN);
    __HAL_AFIO_REMAP_SWJ_NOJTAG();
}

void HAL_UART_MspInit(UART_HandleTypeDef *huart)
{
    GPIO_InitTypeDef GPIO_InitStruct = {0};
    UNUSED(huart);
    __HAL_RCC_APB2_CLK_ENABLE(RCC_APB2ENR_USART1EN);
    GPIO_InitStruct.Pin = GPIO_PIN(9);
    GPIO_InitStruct.Mode = GPIO_MODE_AF_PP;
    GPIO_InitStruct.Speed = GPIO_SPEED_FREQ_HIGH;
    HAL_GPIO_Init(GPIOA, &GPIO_InitStruct);
    HAL_NVIC_SetPriority(USART1_IRQn, 5u);
    HAL_NVIC_EnableIRQ(USART1_IRQn);
}

void HAL_UART_TxCpltCallback(UART_HandleTypeDef *huart)
{
    UNUSED(huart);
    lines_sent++;
}

/* Sleeps between ticks: a test would take long over the vendor's busy loop. */
void HAL_Delay(uint32_t Delay)
{
    uint32_t tickstart = HAL_GetTick();
    while (HAL_GetTick() - tickstart < Delay + 1u) {
        __asm__ volatile("wfi");
    }
}

void SysTick_Handler(void);
void SysTick_Handler(void)
{
    HAL_IncTick();
}

void USART1_IRQHandler(void);
void USART1_IRQHandler(void)
{
    HAL_UART_IRQHandler(&huart1);
}

#define SAY(text) say(text, sizeof(text) - 1u)

static void say(const char *line, size_t length)
{
    uint32_t sent = lines_sent;
    if (HAL_UART_Transmit_IT(&huart1, (const uint8_t *)line, (uint16_t)length) != HAL_OK) {
        Error_Handler();
    }
    while (lines_sent == sent) {
        __asm__ volatile("wfi");
    }
}

static void write_motor_pin(GPIO_TypeDef *port, uint32_t pin, int code, uint32_t bit)
{
    HAL_GPIO_WritePin(port, (uint16_t)GPIO_PIN(pin), (code >> bit) & 1 ? GPIO_PIN_SET : GPIO_PIN_RESET);
}

/* One pin after the other, as students write it: the adapter must not take the codes in between. */
static void set_motors(int left, int right)
{
    for (uint32_t bit = 0; bit < 3u; bit++) {
        write_motor_pin(GPIOB, 7u - bit, left, bit);
        write_motor_pin(GPIOA, 1u + bit, right, bit);
    }
}

int main(void)
{
    static const char ready[] = "foreign: ready\n";

    HAL_Init();
    SystemClock_Config();
    MX_GPIO_Init();
    MX_USART1_UART_Init();
    if (HAL_UART_Transmit(&huart1, (const uint8_t *)ready, sizeof ready - 1u, 100u) != HAL_OK) {
        Error_Handler();
    }
    /* A short busy wait, so that polling the tick is met too. */
    for (uint32_t start = HAL_GetTick(); HAL_GetTick() - start < 20u;) {
    }
    HAL_Delay(2980u);

    SAY("foreign: forward\n");
    set_motors(2, 2);
    HAL_Delay(2000u);
    SAY("foreign: turn\n");
    set_motors(-2, 2);
    HAL_Delay(1500u);
    set_motors(0, 0);
    SAY("foreign: stop\n");
    for (;;) {
        HAL_Delay(1000u);
    }
}

static void Error_Handler(void)
{
    __asm__ volatile("cpsid i");
    for (;;) {
    }
}
