/* Streams characters at 115200 baud, one an interrupt. */
#include "board.h"
#include "f103.h"

volatile uint32_t bench_rounds;

void USART1_IRQHandler(void);
void USART1_IRQHandler(void)
{
    if (USART1->SR & USART_SR_TXE) {
        USART1->DR = (uint8_t)('a' + bench_rounds % 26u);
        ++bench_rounds;
    }
}

int main(void)
{
    clock_start();
    RCC->APB2ENR |= RCC_APB2ENR_USART1EN | RCC_APB2ENR_IOPAEN;
    GPIOA->CRH = (GPIOA->CRH & ~0xF0u) | GPIO_ALTERNATE_PUSH_PULL_2MHZ << 4;
    USART1->BRR = HCLK_HZ / 115200u;
    NVIC_ISER[USART1_IRQ / 32u] = 1u << USART1_IRQ % 32u;
    USART1->CR1 = USART_CR1_UE | USART_CR1_TE | USART_CR1_TXEIE;
    for (;;) {
        wait_for_interrupt();
    }
}
