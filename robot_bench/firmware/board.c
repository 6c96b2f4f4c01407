/* Start-up of the board: pins first, so that the wires are right before anything else happens. */
#include "board.h"

#include "f103.h"
#include "pins.h"
#include "tick.h"
#include "uart.h"

/* 8 MHz crystal x 9 = 72 MHz; APB1 may run at 36 MHz at most (RM0008 7.2).
 * A board without its crystal waits here for ever, with the motors at 0. */
void clock_start(void)
{
    RCC->CR |= RCC_CR_HSEON;
    while (!(RCC->CR & RCC_CR_HSERDY)) {
    }
    /* Two wait states above 48 MHz (PM0075 3.1). */
    FLASH->ACR = FLASH_ACR_PRFTBE | FLASH_ACR_LATENCY_2;
    RCC->CFGR = RCC_CFGR_PLLSRC_HSE | RCC_CFGR_PLLMUL9 | RCC_CFGR_PPRE1_DIV2;
    RCC->CR |= RCC_CR_PLLON;
    while (!(RCC->CR & RCC_CR_PLLRDY)) {
    }
    RCC->CFGR |= RCC_CFGR_SW_PLL;
    while ((RCC->CFGR & RCC_CFGR_SWS_MASK) != RCC_CFGR_SWS_PLL) {
    }
}

void board_start(void)
{
    pins_start();
    clock_start();
    tick_start();
    uart_start();
}

void board_wait_for_link(void)
{
    tick_sleep(LINK_WAIT_S * TICKS_PER_S);
}
