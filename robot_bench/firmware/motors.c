/* motors: both wheels 0, +3, -4, 0, each held for HOLD_S.
 *
 * Open loop: it looks at no input, so the same edges must come out at the same
 * virtual times whatever is at the other end of the wires.
 */
#include "board.h"
#include "pins.h"
#include "tick.h"
#include "uart.h"

/* 3 s and a tick, so that 3 s are kept between the pins' edges, which come some instructions after the tick.
 * Longer than the slowest ramp: 437.5 mm/s of change at 300 mm/s^2 takes 1.5 s. */
#define HOLD_TICKS (3u * TICKS_PER_S + 1u)

int main(void)
{
    static const int codes[] = {0, 3, -4, 0};

    board_start();
    uart_text("motors: ready\n");
    board_wait_for_link();
    for (unsigned i = 0; i < sizeof codes / sizeof codes[0]; i++) {
        pins_motors(codes[i], codes[i]);
        uart_text("motors: ");
        uart_number(codes[i]);
        uart_text("\n");
        tick_sleep(HOLD_TICKS);
    }
    uart_text("motors: done\n");
    for (;;) {
        tick_sleep(TICKS_PER_S);
    }
}
