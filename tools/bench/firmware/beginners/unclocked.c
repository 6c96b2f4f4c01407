/* Waits for a bit of a peripheral whose clock was never switched on, with a timeout that counts on the stack, over and over.
 *
 * BENCH_REGISTER is the address; BENCH_8_MHZ leaves the clock as it is after a reset.
 */
#include "board.h"
#include "f103.h"

volatile uint32_t bench_rounds;

int main(void)
{
#ifndef BENCH_8_MHZ
    clock_start();
#endif
    for (;;) {
        volatile uint32_t left = 1000;
        while (!(*(volatile uint32_t *)BENCH_REGISTER & 1u) && --left) {
        }
        ++bench_rounds;
    }
}
