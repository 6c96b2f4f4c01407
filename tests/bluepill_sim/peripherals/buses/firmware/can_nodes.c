/* A CAN node at 500 kbit/s: 0x200 plus the level of PB0; sends a count each 2 ms, prints what it hears by interrupt. */
#include "console.h"

struct can {
    volatile uint32_t MCR, MSR, TSR, RF0R, RF1R, IER, ESR, BTR;
    uint32_t gap[88];
    struct { volatile uint32_t TIR, TDTR, TDLR, TDHR; } tx[3];
    struct { volatile uint32_t RIR, RDTR, RDLR, RDHR; } rx[2];
    uint32_t gap2[12];
    volatile uint32_t FMR, FM1R, gap3, FS1R, gap4, FFA1R, gap5, FA1R, gap6[8], FR[28];
};
#define CAN ((struct can *)0x40006400u)

void SysTick_Handler(void);
static volatile uint32_t ticks;
void SysTick_Handler(void) { ++ticks; }

int main(void)
{
    console_start();
    RCC->APB1ENR |= 1u << 25;
    GPIOB->ODR = 0;
    GPIOA->CRH = (GPIOA->CRH & 0xFFF00FFFu) | 0x000B4000u;
    CAN->MCR = 1u | 1u << 6;
    while (!(CAN->MSR & 1u)) {
    }
    CAN->BTR = (4u - 1) | 12u << 16 | 3u << 20; /* 36 MHz / 4 / 18 */
    CAN->FMR |= 1u;
    CAN->FS1R = 1;
    CAN->FR[0] = 0x200u << 21;
    CAN->FR[1] = 0x7FEu << 21;
    CAN->FA1R = 1;
    CAN->FMR &= ~1u;
    CAN->MCR = 1u << 6;
    while (CAN->MSR & 1u) {
    }
    SYSTICK->LOAD = 72000u - 1;
    SYSTICK->CTRL = SYSTICK_CTRL_ENABLE | SYSTICK_CTRL_TICKINT | SYSTICK_CTRL_CLKSOURCE_CORE;
    say("on\n");
    const uint32_t own = 0x200u + (GPIOB->IDR & 1u);
    uint32_t count = 0, next = 2;
    for (;;) {
        if (ticks >= next) {
            next += 2;
            CAN->tx[0].TDTR = 1;
            CAN->tx[0].TDLR = ++count;
            CAN->tx[0].TIR = own << 21 | 1u;
        }
        if (CAN->RF0R & 3u) {
            say("heard ");
            say_hex(CAN->rx[0].RIR >> 21, 3);
            say(" ");
            say_hex(CAN->rx[0].RDLR & 0xFFu, 2);
            say("\n");
            CAN->RF0R = 1u << 5;
        }
    }
}
