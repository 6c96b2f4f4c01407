/* rover: a square with legs of 0.6 m at 0.3 m/s, by speed control at 1 kHz.
 *
 * Theory of operation
 *
 * Each wheel follows a point that runs ahead of it along its way, with a ramp. A wheel's volts are what turns the motor
 * at the point's speed, and a share of how far it is behind. They are made by PWM out of the battery's, which are
 * measured: the lower the battery, the larger the duty.
 *
 * Something nearer than about 20 cm ahead stops the point, until it is gone.
 */
#include <stdbool.h>

#include "rover_board.h"
#include "uart.h"

/* 1632 edges a turn of a wheel of 65 mm: 7992 a metre. */
#define EDGES_PER_M 7992
#define LEG (EDGES_PER_M * 6 / 10)
#define CORNER 1004 /* a quarter of a turn on a track of 160 mm: 125.7 mm of each rim */
#define CORNERS 4
/* Edges a second, and a second more each tick. */
#define CRUISE (EDGES_PER_M * 3 / 10)
#define TURN (EDGES_PER_M * 15 / 100)
#define RAMP 5
#define CREEP 40

/* Millivolts an edge a second (13/8), against friction, and an edge behind. */
#define SPEED_MV(edges) ((edges) * 13 / 8)
#define FRICTION_MV 280
#define BEHIND_MV 32
#define BATTERY_TIMES 4    /* 30 kOhm over 10 kOhm */
#define LEAST_BATTERY_MV 6000u
#define NEAR_MV 1300u      /* GP2Y0A21YK at 20 cm */
#define CLEAR_MV 1100u     /* and at 25 cm */
#define REPORT_TICKS 500u
#define READY_TICKS 100u

/* One wheel's way: where the point is, in thousandths of an edge, and how fast, in edges a second. */
struct wheel {
    int32_t goal, point_milli, speed;
};

static struct wheel wheels[SIDES];

/* Moves the point on by a tick: no faster than it can still stop at its goal, and slowly over the last of the way. */
static void advance(struct wheel *wheel, int32_t fastest)
{
    int32_t left_milli = wheel->goal * 1000 - wheel->point_milli;
    int32_t sign = left_milli < 0 ? -1 : 1, distance_milli = left_milli * sign, speed = wheel->speed * sign;
    if (distance_milli <= CREEP && speed <= CREEP) {
        wheel->point_milli += left_milli;
        wheel->speed = 0;
        return;
    }
    /* RAMP less a tick, it stops within speed * speed / (2 * RAMP) thousandths of an edge. */
    if (speed > fastest || speed * speed / (2 * RAMP) >= distance_milli) {
        int32_t least = fastest < CREEP ? fastest : CREEP;
        speed = speed - RAMP > least ? speed - RAMP : least;
    } else if (speed + RAMP <= fastest) {
        speed += RAMP;
    }
    wheel->speed = sign * speed;
    wheel->point_milli += wheel->speed;
}

static void control(int32_t fastest)
{
    uint32_t battery_mv = rover_millivolts(BATTERY) * BATTERY_TIMES;
    battery_mv = battery_mv < LEAST_BATTERY_MV ? LEAST_BATTERY_MV : battery_mv;
    for (unsigned side = 0; side < SIDES; side++) {
        struct wheel *wheel = &wheels[side];
        advance(wheel, fastest);
        int32_t behind = wheel->point_milli / 1000 - rover_counts((enum rover_side)side);
        int32_t sign = wheel->speed > 0 ? 1 : wheel->speed < 0 ? -1 : 0;
        int32_t volts_mv = SPEED_MV(wheel->speed) + sign * FRICTION_MV + behind * BEHIND_MV;
        rover_drive((enum rover_side)side, volts_mv * PWM_PERIOD / (int32_t)battery_mv);
    }
}

static bool has_arrived(void)
{
    for (unsigned side = 0; side < SIDES; side++) {
        const struct wheel *wheel = &wheels[side];
        if (wheel->speed != 0 || wheel->point_milli != wheel->goal * 1000) {
            return false;
        }
    }
    return true;
}

/* Stops ahead of things, with a hysteresis. */
static bool is_blocked(void)
{
    static bool was_blocked;
    uint32_t front_mv = rover_millivolts(FRONT);
    bool now = front_mv > (was_blocked ? CLEAR_MV : NEAR_MV);
    if (now != was_blocked) {
        uart_text(now ? "rover: blocked\n" : "rover: clear\n");
    }
    was_blocked = now;
    return now;
}

static void report(void)
{
    static int32_t before[SIDES];
    uart_text("rover:");
    for (unsigned side = 0; side < SIDES; side++) {
        int32_t counted = rover_counts((enum rover_side)side);
        int32_t edges_a_second = (counted - before[side]) * (int32_t)(TICKS_PER_S / REPORT_TICKS);
        uart_text(side == LEFT ? " left " : " right ");
        uart_number(edges_a_second * 1000 / EDGES_PER_M);
        before[side] = counted;
    }
    uart_text(" mm/s, ");
    uart_number((int32_t)(rover_millivolts(BATTERY) * BATTERY_TIMES));
    uart_text(" mV\n");
}

/* Drives both wheels on by so many edges. */
static void go(int32_t left, int32_t right, int32_t fastest)
{
    static uint32_t ticks;
    bool is_forward = left > 0 && right > 0;
    wheels[LEFT].goal += left;
    wheels[RIGHT].goal += right;
    do {
        rover_wait();
        control(is_forward && is_blocked() ? 0 : fastest);
        if (++ticks % REPORT_TICKS == 0) {
            report();
        }
    } while (!has_arrived());
}

int main(void)
{
    rover_start();
    for (unsigned n = 0; n < READY_TICKS; n++) {
        rover_wait();
    }
    uart_text("rover: ready, ");
    uart_number((int32_t)(rover_millivolts(BATTERY) * BATTERY_TIMES));
    uart_text(" mV\n");
    for (int32_t corner = 1; corner <= CORNERS; corner++) {
        go(LEG, LEG, CRUISE);
        go(-CORNER, CORNER, TURN);
        uart_text("rover: corner ");
        uart_number(corner);
        uart_text("\n");
    }
    uart_text("rover: done\n");
    for (;;) {
        rover_wait();
        control(0);
    }
}
