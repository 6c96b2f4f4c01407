/* Sends a frame at 500 kbit/s that nobody acknowledges: bxCAN tries again without end.
 *
 * BENCH_MBIT: at 1 Mbit/s. BENCH_ABORT: as a driver with a timeout, which gives each frame up after 10 ms.
 */
#include "board.h"
#include "f103.h"

struct can { volatile uint32_t MCR, MSR, TSR, RF0R, RF1R, IER, ESR, BTR; };
struct mailbox { volatile uint32_t TIR, TDTR, TDLR, TDHR; };
#define CAN ((struct can *)0x40006400u)
#define MAILBOX ((struct mailbox *)0x40006580u)

enum { INRQ = 1, SLEEP = 2, ABRQ = 1 << 7, RQCP = 1 };

volatile uint32_t bench_rounds;

static void send(void)
{
    MAILBOX->TDTR = 8;
    MAILBOX->TDLR = bench_rounds;
    MAILBOX->TDHR = 0x55AA00FFu;
    MAILBOX->TIR = 0x123u << 21 | 1u;
}

int main(void)
{
    clock_start();
    RCC->APB2ENR |= RCC_APB2ENR_IOPAEN;
    RCC->APB1ENR |= 1u << 25;
    GPIOA->CRH = (GPIOA->CRH & ~0xFF000u) | 0xB8000u;
    GPIOA->ODR = 1u << 11;
    CAN->MCR = INRQ;
    while (!(CAN->MSR & INRQ)) {
    }
#ifdef BENCH_MBIT
    CAN->BTR = 1u << 24 | 4u << 20 | 5u << 16 | 2u; /* 36 MHz / 3 / 12 */
#else
    CAN->BTR = 1u << 24 | 4u << 20 | 5u << 16 | 5u;
#endif
    CAN->MCR = 0;
    while (CAN->MSR & INRQ) {
    }
    for (;;) {
        send();
        for (uint32_t n = 0; !(CAN->TSR & RQCP); ++n) {
#ifdef BENCH_ABORT
            if (n == 40000) {
                CAN->TSR = ABRQ;
            }
#endif
            ++bench_rounds;
        }
    }
}
