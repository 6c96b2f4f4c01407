/* encoders: drives a square with the wheel encoders as its only measure.
 *
 * Theory of operation. Legs end when the sum of both wheels' ways reaches its
 * target, corners when their difference does. Targets grow from the start of the
 * square and are never reset, so that what one corner turns too far the next one
 * turns less. A step is 64.8 mm, 10 degrees of a corner: too coarse alone. At an
 * edge the place of a wheel is known exactly, and between edges it is the last
 * edge plus commanded speed times time, never beyond the step the encoder names.
 */
#include "board.h"
#include "odometer.h"
#include "pins.h"
#include "tick.h"
#include "uart.h"

#define LEGS 4
#define LEG_SPEED 2              /* chosen: 125 mm/s */
#define CORNER_SPEED 1           /* chosen: slow, 20 degrees/s, for precision */
#define SETTLE_TICKS TICKS_PER_S /* line and ramp take 0.7 s at most from LEG_SPEED */

/* Ways are in micrometres. */
#define LEG_UM (8 * STEP_UM)        /* one turn of the wheels */
#define CORNER_DIFFERENCE_UM 560774 /* a track of 357 mm x pi/2: what the wheels differ by over 90 degrees */
#define SPEED_UM_PER_TICK 625       /* 62.5 mm/s a motor step */

struct place {
    int32_t steps;  /* the step it was in at the last tick */
    int32_t way_um; /* estimate */
};

static struct odometer odometer;
static struct place left, right;

static void estimate(struct place *place, const struct wheel *wheel, int speed)
{
    int32_t floor_um = wheel->steps * STEP_UM;
    if (wheel->steps != place->steps) {
        place->way_um = wheel->moved > 0 ? floor_um : floor_um + STEP_UM - 1;
        place->steps = wheel->steps;
    } else {
        place->way_um += speed * SPEED_UM_PER_TICK;
        if (place->way_um < floor_um) {
            place->way_um = floor_um;
        } else if (place->way_um >= floor_um + STEP_UM) {
            place->way_um = floor_um + STEP_UM - 1;
        }
    }
}

static void run_tick(int left_speed, int right_speed)
{
    tick_sleep(1);
    odometer_update(&odometer);
    estimate(&left, &odometer.left, left_speed);
    estimate(&right, &odometer.right, right_speed);
}

static void print_counts(const char *title)
{
    uart_text(title);
    uart_text(" left=");
    uart_number(odometer.left.steps);
    uart_text(" right=");
    uart_number(odometer.right.steps);
    uart_text("\n");
}

static void stop_and_report(void)
{
    pins_motors(0, 0);
    for (unsigned i = 0; i < SETTLE_TICKS; i++) {
        run_tick(0, 0);
    }
    print_counts("encoder");
}

int main(void)
{
    board_start();
    uart_text("encoders: ready\n");
    board_wait_for_link();
    odometer_start(&odometer);
    for (int leg = 1; leg <= LEGS; leg++) {
        pins_motors(LEG_SPEED, LEG_SPEED);
        while (left.way_um + right.way_um < 2 * LEG_UM * leg) {
            run_tick(LEG_SPEED, LEG_SPEED);
        }
        stop_and_report();
        pins_motors(-CORNER_SPEED, CORNER_SPEED);
        while (right.way_um - left.way_um < CORNER_DIFFERENCE_UM * leg) {
            run_tick(-CORNER_SPEED, CORNER_SPEED);
        }
        stop_and_report();
    }
    print_counts("encoders: done");
    for (;;) {
        tick_sleep(TICKS_PER_S);
    }
}
