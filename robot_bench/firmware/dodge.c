/* dodge: roams without touching anything; dodge_fsm.c decides, this file carries it out.
 *
 * Each transition is a line: "dodge: CRUISE -> TURN_LEFT 00110000", with the
 * sensors as the machine takes them, DD1 (leftmost) first.
 */
#include "board.h"
#include "dodge_fsm.h"
#include "odometer.h"
#include "pins.h"
#include "tick.h"
#include "uart.h"

static void print_transition(enum dodge_state from, const struct dodge *dodge)
{
    char sensors[] = " 00000000\n";
    for (unsigned i = 0; i < DODGE_SENSORS; i++) {
        sensors[1 + i] = dodge->seen >> i & 1 ? '1' : '0';
    }
    uart_text("dodge: ");
    uart_text(dodge_state_names[from]);
    uart_text(" -> ");
    uart_text(dodge_state_names[dodge->state]);
    uart_text(sensors);
}

int main(void)
{
    static struct odometer odometer;
    static struct dodge dodge;

    board_start();
    uart_text("dodge: ready\n");
    board_wait_for_link();
    odometer_start(&odometer);
    dodge_start(&dodge);
    uart_text("dodge: ");
    uart_text(dodge_state_names[dodge.state]);
    uart_text("\n");
    for (uint32_t due = tick_now();; tick_wait_until(++due)) {
        enum dodge_state before = dodge.state;
        odometer_update(&odometer);
        struct dodge_command command = dodge_tick(&dodge, pins_distances(), odometer.left.steps, odometer.right.steps);
        pins_motors(command.left, command.right);
        if (dodge.state != before) {
            print_transition(before, &dodge);
        }
    }
}
