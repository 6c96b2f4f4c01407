/* A program as `-O0` makes it: hundreds of blocks whose loads follow pointers through one register.
 *
 * In `ldr r3, [r3]; ldr r3, [r3]` either may be what reaches a peripheral. The
 * start-up calls fifty drivers that reach one through a handle, some twice in a
 * block; the loop after it works on SRAM alone and then switches two pins.
 */
#include <stdint.h>

#include "f103.h"

struct driver {
    struct gpio *port;
    struct usart *usart;
    uint32_t mask, state;
    struct driver *next;
};

static struct driver drivers[4];
static volatile uint32_t checksum;

/* What of a port's configuration is read here decides nothing but `state`. */
#define DRIVER(n)                                                             \
    static void configure_##n(struct driver *driver)                          \
    {                                                                         \
        driver->state = driver->port->CRL + driver->port->CRL;                \
        driver->port->CRL = 0x44444422u;                                      \
        if (driver->next->state > driver->state) {                            \
            driver->next->port->BSRR = driver->mask << 16;                    \
            driver->port->BSRR = driver->mask;                                \
        }                                                                     \
        driver->next->next->state += driver->next->state + (n);               \
        if ((driver->usart->SR & USART_SR_TXE) != 0) {                        \
            driver->usart->DR = (driver->next->next->state & 15u) + 'a';      \
            driver->port->BSRR = driver->next->mask;                          \
            driver->port->BSRR = driver->next->mask << 16;                    \
        }                                                                     \
        driver->next->next->next->state ^= driver->next->state;               \
        for (uint32_t bit = 0; bit < 3; ++bit) {                              \
            checksum += driver->next->next->state >> bit;                     \
        }                                                                     \
    }
#define CALL(n) configure_##n(&drivers[(n) & 3]);
#define TEN(what, n) what(n##0) what(n##1) what(n##2) what(n##3) what(n##4) what(n##5) what(n##6) what(n##7) what(n##8) what(n##9)
#define ALL(what) TEN(what, 1) TEN(what, 2) TEN(what, 3) TEN(what, 4) TEN(what, 5)

ALL(DRIVER)

static uint32_t work(struct driver *driver, uint32_t rounds)
{
    volatile uint32_t left = rounds;
    while (left > 0) {
        driver->next->next->state += driver->next->state ^ left;
        if ((driver->next->next->next->state & 1u) != 0) {
            driver->next->state = driver->next->next->state >> 3;
        } else {
            driver->state -= driver->next->next->next->state;
        }
        left = left - 1;
    }
    return driver->next->state;
}

int main(void)
{
    RCC->APB2ENR = RCC_APB2ENR_IOPAEN | RCC_APB2ENR_IOPBEN | RCC_APB2ENR_USART1EN;
    GPIOA->CRH = 0x444444B4u;
    USART1->BRR = 69; /* 8 MHz / 115200 */
    USART1->CR1 = USART_CR1_UE | USART_CR1_TE;
    for (uint32_t n = 0; n < 4; ++n) {
        drivers[n].port = (n & 1u) != 0 ? GPIOA : GPIOB;
        drivers[n].usart = USART1;
        drivers[n].mask = 1u << (n & 1u);
        drivers[n].state = n;
        drivers[n].next = &drivers[(n + 1) & 3u];
    }
    for (;;) {
        ALL(CALL)
        checksum += work(drivers, 20000);
    }
}
