/* codes: every pair of motor codes, each held for HOLD_TICKS, then changes from end to end.
 *
 * The pairs follow each other in a line that goes to and fro, so that one wheel changes by one step at
 * a time and has come to its speed long before the end. Each line that is printed tells, at the end of
 * its pair, how far the wheels have turned by the encoder pins since the start, in eighths of a turn.
 * It looks at no input besides, so its pins change at the same virtual times wherever it runs.
 */
#include "board.h"
#include "odometer.h"
#include "pins.h"
#include "tick.h"
#include "uart.h"

#define HOLD_TICKS (1u * TICKS_PER_S)
#define SPAN (MOTOR_MAX - MOTOR_MIN + 1)
/* Longer than the slowest ramp: 437.5 mm/s of change at 300 mm/s^2 takes 1.5 s. */
#define CHANGE_TICKS (3u * TICKS_PER_S)

static struct odometer odometer;
static uint32_t due;

static void hold(int left, int right, uint32_t ticks)
{
    pins_motors(left, right);
    for (uint32_t i = 0; i < ticks; i++) {
        tick_wait_until(++due);
        odometer_update(&odometer);
    }
    uart_text("codes: ");
    uart_number(left);
    uart_text(" ");
    uart_number(right);
    uart_text(" at ");
    uart_number(odometer.left.steps);
    uart_text(" ");
    uart_number(odometer.right.steps);
    uart_text("\n");
}

int main(void)
{
    static const int changes[][2] = {
        {3, 3}, {-4, -4}, {3, 3}, {0, 0}, {3, -4}, {-4, 3}, {0, 0},
    };

    board_start();
    uart_text("codes: ready\n");
    board_wait_for_link();
    odometer_start(&odometer);
    due = tick_now();
    for (int row = 0; row < SPAN; row++) {
        for (int i = 0; i < SPAN; i++) {
            hold(MOTOR_MIN + row, row % 2 == 0 ? MOTOR_MIN + i : MOTOR_MAX - i, HOLD_TICKS);
        }
    }
    for (unsigned i = 0; i < sizeof changes / sizeof changes[0]; i++) {
        hold(changes[i][0], changes[i][1], CHANGE_TICKS);
    }
    uart_text("codes: done\n");
    for (;;) {
        tick_sleep(TICKS_PER_S);
    }
}
