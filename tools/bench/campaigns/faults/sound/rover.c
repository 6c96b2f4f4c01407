/* robot_bench/firmware/rover.c, which says what it does, in another form: the way is a table of legs, a wheel carries
 * its side, its controller and what is reported of it, and one loop walks the table. */
#include <stdbool.h>
#include <stddef.h>

#include "rover_board.h"
#include "uart.h"

enum { EDGES_PER_M = 7992, LEG = EDGES_PER_M * 6 / 10, CORNER = 1004 };
enum { CRUISE = EDGES_PER_M * 3 / 10, TURN = EDGES_PER_M * 15 / 100, RAMP = 5, CREEP = 40 };
enum { FRICTION_MV = 280, BEHIND_MV = 32, LEAST_BATTERY_MV = 6000, NEAR_MV = 1300, CLEAR_MV = 1100 };
enum { REPORT_TICKS = 500, READY_TICKS = 100 };

struct wheel {
    enum rover_side side;
    int32_t goal, milli, speed; /* edges, thousandths of an edge, edges a second */
    int32_t reported;
};

struct leg {
    int32_t left, right, fastest;
    bool stops; /* for what is ahead */
};

static struct wheel left = {.side = LEFT}, right = {.side = RIGHT};
static struct wheel *const both[] = {&left, &right};
static const struct leg square[] = {{LEG, LEG, CRUISE, true}, {-CORNER, CORNER, TURN, false}};

static int32_t battery_mv(void)
{
    return (int32_t)(4 * rover_millivolts(BATTERY));
}

static int32_t least_of(int32_t one, int32_t other)
{
    return one < other ? one : other;
}

static int32_t greatest_of(int32_t one, int32_t other)
{
    return one > other ? one : other;
}

/* The speed of the next tick with so far to go, both counted towards the goal. */
static int32_t next_speed(int32_t speed, int32_t distance, int32_t fastest)
{
    bool must_slow = speed > fastest || distance <= speed * speed / (2 * RAMP);
    if (must_slow) {
        return greatest_of(speed - RAMP, least_of(fastest, CREEP));
    }
    return speed <= fastest - RAMP ? speed + RAMP : speed;
}

static void advance(struct wheel *wheel, int32_t fastest)
{
    int32_t to_go = wheel->goal * 1000 - wheel->milli;
    bool is_back = to_go < 0;
    int32_t distance = is_back ? -to_go : to_go, speed = is_back ? -wheel->speed : wheel->speed;
    if (speed <= CREEP && distance <= CREEP) {
        wheel->speed = 0;
        wheel->milli = wheel->goal * 1000;
        return;
    }
    speed = next_speed(speed, distance, fastest);
    wheel->speed = is_back ? -speed : speed;
    wheel->milli += wheel->speed;
}

static void drive(const struct wheel *wheel, int32_t battery)
{
    int32_t friction = wheel->speed == 0 ? 0 : wheel->speed < 0 ? -FRICTION_MV : FRICTION_MV;
    int32_t behind = wheel->milli / 1000 - rover_counts(wheel->side);
    int32_t wanted_mv = wheel->speed * 13 / 8 + friction + BEHIND_MV * behind;
    rover_drive(wheel->side, wanted_mv * PWM_PERIOD / battery);
}

static bool is_there(const struct wheel *wheel)
{
    return wheel->speed == 0 && wheel->milli == wheel->goal * 1000;
}

static bool is_blocked(void)
{
    static uint32_t limit_mv = NEAR_MV;
    bool is_near = rover_millivolts(FRONT) > limit_mv;
    if (is_near != (limit_mv == CLEAR_MV)) {
        limit_mv = is_near ? CLEAR_MV : NEAR_MV;
        uart_text(is_near ? "rover: blocked\n" : "rover: clear\n");
    }
    return is_near;
}

static void tell_speed(const char *name, struct wheel *wheel)
{
    int32_t now = rover_counts(wheel->side);
    uart_text(name);
    uart_number((now - wheel->reported) * (int32_t)(TICKS_PER_S / REPORT_TICKS) * 1000 / EDGES_PER_M);
    wheel->reported = now;
}

static void tell_battery(const char *before)
{
    uart_text(before);
    uart_number(battery_mv());
    uart_text(" mV\n");
}

static void tick(int32_t fastest)
{
    int32_t battery = greatest_of(battery_mv(), LEAST_BATTERY_MV);
    for (size_t n = 0; n < SIDES; n++) {
        advance(both[n], fastest);
        drive(both[n], battery);
    }
}

static void carry_out(const struct leg *leg)
{
    static unsigned until_report = REPORT_TICKS;
    left.goal += leg->left;
    right.goal += leg->right;
    do {
        rover_wait();
        tick(leg->stops && is_blocked() ? 0 : leg->fastest);
        if (--until_report == 0) {
            until_report = REPORT_TICKS;
            tell_speed("rover: left ", &left);
            tell_speed(" right ", &right);
            tell_battery(" mm/s, ");
        }
    } while (!is_there(&left) || !is_there(&right));
}

int main(void)
{
    rover_start();
    for (int n = READY_TICKS; n > 0; n--) {
        rover_wait();
    }
    tell_battery("rover: ready, ");
    for (int32_t corner = 1; corner <= 4; corner++) {
        for (size_t n = 0; n < sizeof square / sizeof *square; n++) {
            carry_out(&square[n]);
        }
        uart_text("rover: corner ");
        uart_number(corner);
        uart_text("\n");
    }
    uart_text("rover: done\n");
    while (true) {
        rover_wait();
        tick(0);
    }
}
