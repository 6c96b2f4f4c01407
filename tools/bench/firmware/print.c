/* Computes at 72 MHz, and streams characters at 115200 baud, one an interrupt, unless the USART is left off. */
#include "board.h"
#include "f103.h"

/* Read at run time: both programs have the same instructions at the same addresses, which decide what a round costs. */
#ifdef BENCH_NO_USART
static const volatile uint32_t is_on = 0;
#else
static const volatile uint32_t is_on = 1;
#endif

volatile uint32_t bench_rounds;
static volatile uint32_t sent;

void USART1_IRQHandler(void);
void USART1_IRQHandler(void)
{
    USART1->DR = (uint8_t)(sent % 32u == 31u ? '\n' : 'a' + sent % 26u);
    ++sent;
}

int main(void)
{
    clock_start();
    if (is_on) {
        RCC->APB2ENR |= RCC_APB2ENR_USART1EN | RCC_APB2ENR_IOPAEN;
        GPIOA->CRH = (GPIOA->CRH & ~0xF0u) | GPIO_ALTERNATE_PUSH_PULL_2MHZ << 4;
        USART1->BRR = HCLK_HZ / 115200u;
        NVIC_ISER[USART1_IRQ / 32u] = 1u << USART1_IRQ % 32u;
        USART1->CR1 = USART_CR1_UE | USART_CR1_TE | USART_CR1_TXEIE;
    }
    uint32_t state = 1;
    for (;;) {
        for (uint32_t round = 0; round < 64; ++round) {
            state = state * 1664525u + 1013904223u;
            state ^= state >> 13;
        }
        bench_rounds = state;
    }
}
