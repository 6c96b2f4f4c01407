/* Counts the two absolute 3-bit wheel encoders into signed numbers of steps. */
#ifndef ODOMETER_H
#define ODOMETER_H

#include <stdint.h>

#define STEPS_PER_TURN 8
#define STEP_UM 64795 /* a wheel of 165 mm: x pi / 8 */

struct wheel {
    int32_t steps; /* since odometer_start, forward positive */
    int8_t moved;  /* direction of the last step: +1, -1, 0 before any */
    uint8_t code;  /* last code read */
};

struct odometer {
    struct wheel left, right;
};

/* Takes the codes as they are for zero steps. */
void odometer_start(struct odometer *odometer);

/* To be called each tick: a wheel may turn less than half a turn between two
 * calls (one step takes 259 ms at top speed). */
void odometer_update(struct odometer *odometer);

#endif
