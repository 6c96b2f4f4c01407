/* The decisions of `dodge`: eight booleans and two encoder counts in, two motor codes out.
 *
 * Pure logic without hardware or clock: one call is one tick of 10 ms. The same
 * file runs on the chip and, compiled for the host, in tests. dodge_fsm.c holds
 * the theory of operation.
 */
#ifndef DODGE_FSM_H
#define DODGE_FSM_H

#include <stdint.h>

#define DODGE_SENSORS 8

enum dodge_state {
    DODGE_CRUISE,     /* straight on */
    DODGE_VEER_LEFT,  /* forward on an arc, away from something on the right */
    DODGE_VEER_RIGHT, /* forward on an arc, away from something on the left */
    DODGE_TURN_LEFT,  /* on the spot, committed to this side until the way ahead is clear */
    DODGE_TURN_RIGHT,
    DODGE_BACK_OUT, /* straight back over ground just driven */
    DODGE_STATES
};

extern const char *const dodge_state_names[DODGE_STATES];

/* "Way" is the sum of both wheels' encoder steps, "twist" right minus left. */
struct dodge {
    enum dodge_state state;
    uint8_t seen;                         /* the sensors as the machine takes them, bit 0 = leftmost */
    uint8_t unseen_ticks[DODGE_SENSORS];  /* how long each has been clear again */
    uint32_t state_ticks;                 /* in this state */
    int turn_side;                        /* of this or the last turn: +1 left, -1 right */
    int least_twist;                      /* what this turn takes at least */
    unsigned turns;                       /* begun so far */
    int futile_turns;                     /* turns in a row with hardly any way between them */
    int straight_ticks;                   /* how long both wheels have had one forward code */
    int32_t turn_twist;                   /* twist at which the turn began */
    int32_t turn_way;                     /* way at which the last turn ended */
    int32_t gap_way;                      /* way driven in this passage with something close on both sides */
    int32_t last_way;                     /* way at the tick before */
    int32_t ground_way;                   /* way at which the straight ground behind the robot begins */
    int32_t back_way;                     /* way at which backing ends */
};

struct dodge_command {
    int8_t left, right; /* motor codes, 62.5 mm/s a step */
};

void dodge_start(struct dodge *dodge);

/* One tick: `sensors` bit 0 = DD1 (leftmost) to bit 7 = DD8, 1 = obstacle; steps are signed encoder counts. */
struct dodge_command dodge_tick(struct dodge *dodge, uint8_t sensors, int32_t left_steps, int32_t right_steps);

#endif
