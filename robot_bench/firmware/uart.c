/* USART1 transmit ring: the main program writes `head`, the interrupt `tail`. */
#include "uart.h"

#include "board.h"
#include "f103.h"

#define RING 256u /* power of two; chosen: the longest burst of lines is under 200 characters */
#define TX_PIN 9u /* PA9 */

static char ring[RING];
static volatile uint32_t head;
static volatile uint32_t tail;

void USART1_IRQHandler(void);
void USART1_IRQHandler(void)
{
    if (head == tail) {
        USART1->CR1 = USART1->CR1 & ~USART_CR1_TXEIE; /* nothing left: TXE stays high and would call for ever */
        return;
    }
    if (USART1->SR & USART_SR_TXE) {
        uint32_t at = tail;
        USART1->DR = (uint8_t)ring[at % RING];
        tail = at + 1;
    }
}

void uart_start(void)
{
    RCC->APB2ENR |= RCC_APB2ENR_USART1EN;
    (void)RCC->APB2ENR;
    uint32_t shift = 4u * (TX_PIN - 8u);
    GPIOA->CRH = (GPIOA->CRH & ~(0xFu << shift)) | GPIO_ALTERNATE_PUSH_PULL_2MHZ << shift;
    USART1->BRR = HCLK_HZ / UART_BAUD; /* PCLK2 = HCLK; 625 exactly */
    USART1->CR1 = USART_CR1_UE | USART_CR1_TE;
    NVIC_ISER[USART1_IRQ / 32u] = 1u << USART1_IRQ % 32u;
}

static void put(char character)
{
    interrupts_off();
    while (head - tail == RING) {
        wait_for_interrupt();
        interrupts_on();
        interrupts_off();
    }
    ring[head % RING] = character;
    head = head + 1;
    USART1->CR1 = USART1->CR1 | USART_CR1_TXEIE;
    interrupts_on();
}

void uart_text(const char *text)
{
    while (*text != '\0') {
        put(*text++);
    }
}

void uart_number(int32_t number)
{
    char digits[12];
    unsigned at = sizeof digits;
    /* Unsigned arithmetic, so that the most negative number has its magnitude too. */
    uint32_t magnitude = number < 0 ? 0u - (uint32_t)number : (uint32_t)number;
    digits[--at] = '\0';
    do {
        digits[--at] = (char)('0' + magnitude % 10u);
        magnitude /= 10u;
    } while (magnitude != 0);
    if (number < 0) {
        digits[--at] = '-';
    }
    uart_text(&digits[at]);
}
