/* SPI1 at 18 MHz by DMA1 from a buffer to another, and 64 bytes of I2C1 at 400 kHz by DMA1 with LAST, round and round. */
#include "console.h"

struct channel { volatile uint32_t CCR, CNDTR, CPAR, CMAR, gap; };
struct dma { volatile uint32_t ISR, IFCR; struct channel channel[7]; };
#define DMA1 ((struct dma *)0x40020000u)
#define NVIC_ICPR ((volatile uint32_t *)0xE000E280u)
enum { EN = 1, TCIE = 2, FROM_MEMORY = 1 << 4, MINC = 1 << 7 };

static uint8_t sent[1024], got[1024], bytes[64];

static void go(uint32_t channel, volatile uint32_t *at, void *memory, uint32_t count, uint32_t how)
{
    struct channel *one = &DMA1->channel[channel - 1];
    one->CCR = 0;
    one->CPAR = (uint32_t)at;
    one->CMAR = (uint32_t)memory;
    one->CNDTR = count;
    one->CCR = how | TCIE | EN;
}

/* Sleeps until a transfer is complete; its interrupt only wakes. */
static void wait(uint32_t channel)
{
    while (!(DMA1->ISR & 2u << 4 * (channel - 1))) {
        wait_for_interrupt();
        NVIC_ICPR[0] = 1u << (10 + channel);
    }
    DMA1->IFCR = 15u << 4 * (channel - 1);
    NVIC_ICPR[0] = 1u << (10 + channel);
}

static void spi_round(void)
{
    go(2, &SPI1->DR, got, sizeof got, MINC);
    go(3, &SPI1->DR, sent, sizeof sent, MINC | FROM_MEMORY);
    SPI1->CR2 = 3;
    wait(2);
    wait(3);
    SPI1->CR2 = 0;
}

static void address(uint32_t byte)
{
    I2C1->CR1 |= 1u << 8;
    while (!(I2C1->SR1 & 1u)) {
    }
    I2C1->DR = byte;
    while (!(I2C1->SR1 & 2u)) {
    }
}

static void i2c_round(void)
{
    address(0xA0);
    (void)I2C1->SR2;
    I2C1->DR = 0;
    while (!(I2C1->SR1 & 4u)) {
    }
    I2C1->CR1 |= 1u << 10;
    go(7, &I2C1->DR, bytes, sizeof bytes, MINC);
    I2C1->CR2 |= 3u << 11;
    address(0xA1);
    (void)I2C1->SR2;
    wait(7);
    I2C1->CR1 |= 1u << 9;
    while (I2C1->CR1 & 1u << 9) {
    }
    I2C1->CR2 &= ~(3u << 11);
}

int main(void)
{
    console_start();
    interrupts_off();
    NVIC_ISER[0] = 0x7Fu << 11;
    RCC->AHBENR |= 1u;
    RCC->APB2ENR |= 1u << 12;
    RCC->APB1ENR |= 1u << 21;
    GPIOA->CRL = (GPIOA->CRL & 0x000FFFFFu) | 0xB4B00000u;
    GPIOB->CRL = (GPIOB->CRL & 0x00FFFFFFu) | 0xFF000000u;
    SPI1->CR1 = 1u << 2 | 1u << 3 | 3u << 8 | 1u << 6;
    I2C1->CR2 = 36;
    I2C1->CCR = 1u << 15 | 30;
    I2C1->TRISE = 11;
    I2C1->CR1 = 1;
    for (uint32_t n = 0; n < sizeof sent; ++n) {
        sent[n] = (uint8_t)(n * 11u);
    }
    spi_round();
    uint32_t wrong = 0;
    for (uint32_t n = 0; n < sizeof sent; ++n) {
        wrong += got[n] != sent[n];
    }
    say("spi ");
    say_hex(wrong, 3);
    i2c_round();
    say("\ni2c ");
    for (uint32_t n = 0; n < sizeof bytes; ++n) {
        put((char)bytes[n]);
    }
    say("\nend\n");
    const int is_i2c = (GPIOB->IDR & 1u) != 0;
    for (;;) {
        if (is_i2c) {
            i2c_round();
        } else {
            spi_round();
        }
    }
}
