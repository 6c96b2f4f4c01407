/* sensors: prints which of the eight distance sensors see an obstacle, and moves
 * forward only while one of them does. */
#include "board.h"
#include "pins.h"
#include "tick.h"
#include "uart.h"

#define SPEED 2          /* chosen: 125 mm/s, stops within 30 mm */
#define DEBOUNCE_TICKS 2 /* a change counts when two samples in a row show it */
#define SENSORS 8u

int main(void)
{
    uint8_t seen = 0, candidate = 0;
    unsigned agreed = 0;

    board_start();
    uart_text("sensors: ready\n");
    board_wait_for_link();
    for (uint32_t due = tick_now();; tick_wait_until(++due)) {
        uint8_t sample = pins_distances();
        agreed = sample == candidate ? agreed + 1 : 1;
        candidate = sample;
        if (agreed < DEBOUNCE_TICKS || candidate == seen) {
            continue;
        }
        for (unsigned i = 0; i < SENSORS; i++) {
            if ((seen ^ candidate) >> i & 1u) {
                uart_text("sensor ");
                uart_number((int32_t)i + 1);
                uart_text(candidate >> i & 1u ? " on\n" : " off\n");
            }
        }
        seen = candidate;
        pins_motors(seen ? SPEED : 0, seen ? SPEED : 0);
    }
}
