/* Exchanges 32 bytes by SPI1 at 18 MHz and two channels of DMA, whose flags it polls, as drivers without interrupts do. */
#include "board.h"
#include "f103_analog.h"

#define SPI1 ((struct spi *)0x40013000u)
struct spi { volatile uint32_t CR1, CR2, SR, DR; };

#define RCC_APB2ENR_SPI1EN (1u << 12)
#define SPI_CR1_MASTER (1u << 2 | 1u << 3 | 1u << 6 | 1u << 8 | 1u << 9) /* PCLK2 / 4; SSM and SSI */
#define SPI_CR2_DMA (3u << 0)
#define SPI_SR_BSY (1u << 7)
#define RECEIVE 2u
#define SEND 3u
#define BYTES 32u

volatile uint32_t bench_rounds;
static uint8_t sent[BYTES], received[BYTES];

static void set_up(uint32_t number, const uint8_t *buffer, uint32_t direction)
{
    struct dma_channel *channel = DMA_CHANNEL(number);
    channel->CCR = 0;
    channel->CPAR = (uint32_t)&SPI1->DR;
    channel->CMAR = (uint32_t)buffer;
    channel->CNDTR = BYTES;
    channel->CCR = DMA_CCR_MINC | direction | DMA_CCR_EN;
}

int main(void)
{
    clock_start();
    RCC->AHBENR |= RCC_AHBENR_DMA1EN;
    RCC->APB2ENR |= RCC_APB2ENR_IOPAEN | RCC_APB2ENR_SPI1EN;
    GPIOA->CRL = (GPIOA->CRL & 0x000FFFFFu) | 0xB8B00000u; /* SCK and MOSI; MISO with a pull */
    SPI1->CR1 = SPI_CR1_MASTER;
    SPI1->CR2 = SPI_CR2_DMA;
    for (;;) {
        DMA1->IFCR = DMA_TCIF(RECEIVE) | DMA_TCIF(SEND);
        set_up(RECEIVE, received, 0);
        set_up(SEND, sent, DMA_CCR_DIR_TO_PERIPHERAL);
        while (!(DMA1->ISR & DMA_TCIF(RECEIVE))) {
        }
        while (SPI1->SR & SPI_SR_BSY) {
        }
        ++bench_rounds;
    }
}
