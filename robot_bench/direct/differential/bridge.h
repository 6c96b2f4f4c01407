/* What a bridge's pin does, and a bridge; native.py has the same structs. */
#ifndef DIFFERENTIAL_BRIDGE_H
#define DIFFERENTIAL_BRIDGE_H

#include <stdint.h>

enum { MOST_PINS = 3, COMBINATIONS = 1 << MOST_PINS };
enum { FORWARD, REVERSE, BRAKE, OFF, ACTIONS };

/* A wave (`Wave` of the chip's subscriptions), or with no period a level, which is `high`. */
struct output {
    int64_t ns, at, period, high, ticks_hz;
};

/* What a pin does from a time on. */
struct change {
    int64_t from_ns, pin;
    struct output output;
};

struct bridge {
    int64_t pins, dead_ns;
    /* By the levels of the pins, the first as bit 0. */
    int64_t does[COMBINATIONS];
    struct output now[MOST_PINS];
    /* Parts of the last span: forward, reverse, brake. */
    double shares[OFF];
};

#endif
