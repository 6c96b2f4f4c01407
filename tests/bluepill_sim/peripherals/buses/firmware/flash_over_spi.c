/* Drives a 25-series flash on SPI1 (select PA4) at 18 MHz, and prints what it sees. */
#include "console.h"

static uint8_t page[256];

static uint8_t exchange(uint8_t byte)
{
    while (!(SPI1->SR & 2u)) {
    }
    SPI1->DR = byte;
    while (!(SPI1->SR & 1u)) {
    }
    return (uint8_t)SPI1->DR;
}

static void begin(uint8_t command)
{
    GPIOA->BSRR = 1u << (4 + 16);
    (void)exchange(command);
}

static void end(void)
{
    while (SPI1->SR & 0x80u) {
    }
    GPIOA->BSRR = 1u << 4;
}

static void address(uint32_t at)
{
    (void)exchange((uint8_t)(at >> 16));
    (void)exchange((uint8_t)(at >> 8));
    (void)exchange((uint8_t)at);
}

static uint8_t status(void)
{
    begin(0x05);
    const uint8_t is = exchange(0);
    end();
    return is;
}

static void enable(void)
{
    begin(0x06);
    end();
}

void SysTick_Handler(void);
void SysTick_Handler(void) {}

/* Polls without a pause, or each millisecond. */
static uint32_t wait(int sleeps)
{
    uint32_t polls = 0;
    while (status() & 1u) {
        ++polls;
        if (sleeps) {
            wait_for_interrupt();
        }
    }
    return polls;
}

int main(void)
{
    console_start();
    RCC->APB2ENR |= 1u << 12;
    SYSTICK->LOAD = 72000u - 1;
    SYSTICK->CTRL = SYSTICK_CTRL_ENABLE | SYSTICK_CTRL_TICKINT | SYSTICK_CTRL_CLKSOURCE_CORE;
    GPIOA->BSRR = 1u << 4;
    GPIOA->CRL = (GPIOA->CRL & 0x0000FFFFu) | 0xB4B30000u;
    SPI1->CR1 = 1u << 2 | 1u << 3 | 3u << 8 | 1u << 6;
    begin(0x9F);
    say("id ");
    for (int n = 0; n < 3; ++n) {
        say_hex(exchange(0), 2);
    }
    end();
    say("\nstatus ");
    say_hex(status(), 2);
    enable();
    say_hex(status(), 2);
    begin(0x20);
    address(0x1000);
    end();
    say("\nerase ");
    say(wait(1) > 40 ? "waited" : "at once");
    enable();
    begin(0x02);
    address(0x10F0);
    for (uint32_t n = 0; n < 32; ++n) {
        (void)exchange((uint8_t)(n * 7u));
    }
    end();
    say("\nprogram ");
    say(wait(0) > 5 ? "waited" : "at once");
    begin(0x03);
    address(0x1000);
    for (int n = 0; n < 256; ++n) {
        page[n] = exchange(0);
    }
    end();
    say("\nread ");
    for (int n = 0; n < 17; ++n) {
        say_hex(page[n], 2);
    }
    say(" ");
    for (int n = 0xF0; n < 256; ++n) {
        say_hex(page[n], 2);
    }
    say("\nend\n");
    for (;;) {
    }
}
