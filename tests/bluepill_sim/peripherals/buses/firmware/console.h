/* 72 MHz, and text on USART1: what the programs of this folder share. */
#ifndef CONSOLE_H
#define CONSOLE_H

#include "board.h"
#include "f103.h"

struct spi { volatile uint32_t CR1, CR2, SR, DR, CRCPR, RXCRCR, TXCRCR; };
struct i2c { volatile uint32_t CR1, CR2, OAR1, OAR2, DR, SR1, SR2, CCR, TRISE; };

#define SPI1 ((struct spi *)0x40013000u)
#define I2C1 ((struct i2c *)0x40005400u)

static inline void console_start(void)
{
    clock_start();
    RCC->APB2ENR |= RCC_APB2ENR_AFIOEN | RCC_APB2ENR_IOPAEN | RCC_APB2ENR_IOPBEN | RCC_APB2ENR_USART1EN;
    GPIOA->CRH = (GPIOA->CRH & ~0xF0u) | GPIO_ALTERNATE_PUSH_PULL_2MHZ << 4;
    USART1->BRR = HCLK_HZ / 1000000u;
    USART1->CR1 = USART_CR1_UE | USART_CR1_TE;
}

static inline void put(char letter)
{
    while (!(USART1->SR & USART_SR_TXE)) {
    }
    USART1->DR = (uint32_t)letter;
}

static inline void say(const char *text)
{
    while (*text) {
        put(*text++);
    }
}

static inline void say_hex(uint32_t word, int digits)
{
    while (digits--) {
        put("0123456789abcdef"[word >> 4 * digits & 15]);
    }
}

#endif
