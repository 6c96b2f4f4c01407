/* The difference of two codes, modulo eight, is the movement in between. */
#include "odometer.h"

#include "pins.h"

static void start(struct wheel *wheel, uint8_t code)
{
    wheel->steps = 0;
    wheel->moved = 0;
    wheel->code = code;
}

static void update(struct wheel *wheel, uint8_t code)
{
    int difference = (code - wheel->code + STEPS_PER_TURN / 2 + STEPS_PER_TURN) % STEPS_PER_TURN - STEPS_PER_TURN / 2;
    wheel->code = code;
    wheel->steps += difference;
    if (difference != 0) {
        wheel->moved = difference > 0 ? 1 : -1;
    }
}

void odometer_start(struct odometer *odometer)
{
    start(&odometer->left, pins_left_encoder());
    start(&odometer->right, pins_right_encoder());
}

void odometer_update(struct odometer *odometer)
{
    update(&odometer->left, pins_left_encoder());
    update(&odometer->right, pins_right_encoder());
}
