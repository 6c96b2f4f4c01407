/* Writes and reads bytes by SPI1, its flags polled, with a select line around each group of eight.
 *
 * BENCH_BYTES: DR is accessed as a byte, as ST's newer drivers do. BENCH_DIVIDER: BR of CR1, 0 for 36 MHz.
 */
#include "board.h"
#include "f103.h"

#ifndef BENCH_DIVIDER
#define BENCH_DIVIDER 2
#endif

struct spi { volatile uint32_t CR1, CR2, SR, DR; };
#define SPI1 ((struct spi *)0x40013000u)
#ifdef BENCH_BYTES
#define DATA (*(volatile uint8_t *)&SPI1->DR)
#else
#define DATA SPI1->DR
#endif

enum { RXNE = 1 << 0, TXE = 1 << 1, BSY = 1 << 7 };

volatile uint32_t bench_rounds;

static uint32_t exchange(uint8_t byte)
{
    while (!(SPI1->SR & TXE)) {
    }
    DATA = byte;
    while (!(SPI1->SR & RXNE)) {
    }
    return DATA;
}

int main(void)
{
    static volatile uint8_t received[8];
    clock_start();
    RCC->APB2ENR |= RCC_APB2ENR_IOPAEN | 1u << 12;
    GPIOA->ODR = 1u << 4;
    GPIOA->CRL = (GPIOA->CRL & 0x0000FFFFu) | 0xB8B30000u; /* NSS an output, SCK and MOSI, MISO with a pull */
    SPI1->CR1 = 1u << 2 | BENCH_DIVIDER << 3 | 1u << 6 | 1u << 8 | 1u << 9;
    for (;;) {
        GPIOA->BSRR = 1u << 20;
        for (uint32_t n = 0; n < sizeof received; ++n) {
            received[n] = (uint8_t)exchange((uint8_t)(bench_rounds + n));
        }
        while (SPI1->SR & BSY) {
        }
        GPIOA->BSRR = 1u << 4;
        ++bench_rounds;
    }
}
