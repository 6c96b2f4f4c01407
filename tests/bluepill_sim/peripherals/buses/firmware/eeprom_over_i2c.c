/* Drives a 24C02 on I2C1 (PB6, PB7) at 400 kHz by the sequences of RM0008 26.3.3, and prints what it sees. */
#include "console.h"

enum { SB = 1, ADDR = 2, BTF = 4, RXNE = 1 << 6, TXE = 1 << 7, AF = 1 << 10 };
enum { PE = 1, START = 1 << 8, STOP = 1 << 9, ACK = 1 << 10, POS = 1 << 11 };

static void stop(void)
{
    I2C1->CR1 |= STOP;
    while (I2C1->CR1 & STOP) {
    }
}

/* Whether the part acknowledges; ADDR is left as it is. */
static int call(uint32_t byte)
{
    I2C1->CR1 |= START;
    while (!(I2C1->SR1 & SB)) {
    }
    I2C1->DR = byte;
    uint32_t status;
    while (!((status = I2C1->SR1) & (ADDR | AF))) {
    }
    if (status & AF) {
        I2C1->SR1 = ~(uint32_t)AF;
        stop();
        return 0;
    }
    return 1;
}

static void clear_addr(void)
{
    (void)I2C1->SR1;
    (void)I2C1->SR2;
}

static void send(uint32_t byte)
{
    while (!(I2C1->SR1 & TXE)) {
    }
    I2C1->DR = byte;
}

static uint32_t write_page(uint32_t at, const char *text, uint32_t count)
{
    uint32_t polls = 0;
    while (!call(0xA0)) {
        ++polls;
    }
    clear_addr();
    send(at);
    for (uint32_t n = 0; n < count; ++n) {
        send((uint8_t)text[n]);
    }
    while (!(I2C1->SR1 & BTF)) {
    }
    stop();
    return polls;
}

static uint32_t receive(void)
{
    while (!(I2C1->SR1 & RXNE)) {
    }
    return I2C1->DR;
}

static void read(uint32_t at, uint8_t *to, uint32_t count)
{
    while (!call(0xA0)) {
    }
    clear_addr();
    send(at);
    while (!(I2C1->SR1 & BTF)) {
    }
    I2C1->CR1 |= ACK;
    if (count == 2) {
        I2C1->CR1 |= POS;
    }
    (void)call(0xA1);
    if (count == 1) {
        I2C1->CR1 &= ~(uint32_t)ACK;
        clear_addr();
        I2C1->CR1 |= STOP;
        to[0] = (uint8_t)receive();
    } else if (count == 2) {
        I2C1->CR1 &= ~(uint32_t)ACK;
        clear_addr();
        while (!(I2C1->SR1 & BTF)) {
        }
        I2C1->CR1 |= STOP;
        to[0] = (uint8_t)I2C1->DR;
        to[1] = (uint8_t)I2C1->DR;
    } else {
        clear_addr();
        for (uint32_t n = 0; n < count; ++n) {
            if (n == count - 3) { /* two behind it: data N-2 in DR, N-1 in the shift register */
                while (!(I2C1->SR1 & BTF)) {
                }
                I2C1->CR1 &= ~(uint32_t)ACK;
                to[n++] = (uint8_t)I2C1->DR;
                while (!(I2C1->SR1 & BTF)) {
                }
                I2C1->CR1 |= STOP;
                to[n++] = (uint8_t)I2C1->DR;
            }
            to[n] = (uint8_t)receive();
        }
    }
    while (I2C1->CR1 & STOP) {
    }
    I2C1->CR1 &= ~(uint32_t)POS;
}

int main(void)
{
    uint8_t bytes[20];
    console_start();
    RCC->APB1ENR |= 1u << 21;
    GPIOB->CRL = (GPIOB->CRL & 0x00FFFFFFu) | 0xFF000000u;
    I2C1->CR2 = 36;
    I2C1->CCR = 1u << 15 | 30;
    I2C1->TRISE = 11;
    I2C1->CR1 = PE;
    say("scan");
    for (uint32_t at = 8; at < 0x78; ++at) {
        if (call(at << 1)) {
            clear_addr();
            stop();
            say(" ");
            say_hex(at, 2);
        }
    }
    say("\nwrite ");
    say(write_page(0x20, "abcdefgh", 8) == 0 ? "at once" : "waited");
    say(write_page(0x2C, "0123456789", 10) > 10 ? " waited" : " at once");
    static const uint32_t counts[] = {1, 2, 3, 16};
    for (uint32_t k = 0; k < 4; ++k) {
        read(0x20, bytes, counts[k]);
        say("\nread ");
        for (uint32_t n = 0; n < counts[k]; ++n) {
            put((char)(bytes[n] < 127 ? bytes[n] : '.'));
        }
    }
    say("\nend\n");
    for (;;) {
    }
}
