/* SysTick: the 24-bit down counter of the core; times are in core cycles.
 *
 * It costs nothing between two wraps. The reference clock is HCLK / 8, as an STM32F103 wires it (RM0008 7.2, clock
 * tree). Source: ARMv7-M Architecture Reference Manual B3.3.
 */
#include "../fabric/fabric.h"
#include "system.h"

enum { CTRL, LOAD, VAL, CALIB };
enum { ENABLE = 1, TICKINT = 2, CLKSOURCE = 4, CONTROL_BITS = 7, COUNTFLAG = 1 << 16, COUNTER_BITS = 0xFFFFFF };
/* 9000 ticks of HCLK / 8 at 72 MHz are 1 ms (PM0056 4.5.4). */
#define CALIBRATION (0x40000000u | 9000)
#define REFERENCE_DIVIDER 8

/* Acts on every wrap up to and including `now`; whether that makes the exception pending. */
bool systick_advance(struct shared *s, uint64_t now)
{
    const uint64_t due = s->tick_next;
    if (due == NO_TIME || now < due) {
        return false;
    }
    s->tick_count_flag = 1;
    s->tick.value = 0;
    if (s->tick.top == 0) { /* a reload value of 0 stops the counter at its next wrap */
        s->tick.base = due;
        s->tick_next = NO_TIME;
    } else {
        const uint64_t period = ((uint64_t)s->tick.top + 1) * s->tick.divider;
        s->tick.base = due + (now - due) / period * period;
        s->tick_next = s->tick.base + period;
    }
    return s->tick_control & TICKINT;
}

/* Reading CTRL clears COUNTFLAG. */
uint32_t systick_read(struct shared *s, uint32_t word, uint64_t now)
{
    if (word == CTRL) {
        const uint32_t value = s->tick_control | (s->tick_count_flag ? COUNTFLAG : 0);
        s->tick_count_flag = 0;
        return value;
    }
    return word == LOAD ? s->tick.top : word == VAL ? ramp_at(&s->tick, now) : CALIBRATION;
}

void systick_write(struct shared *s, uint32_t word, uint32_t value, uint64_t now)
{
    if (word == CALIB) {
        return;
    }
    if (word == VAL) { /* any value clears the counter and COUNTFLAG, and causes no exception */
        s->tick.value = 0;
        s->tick.base = now;
        s->tick_count_flag = 0;
    } else {
        ramp_rebase(&s->tick, now);
    }
    if (word == LOAD) { /* the running count goes on to 0 first */
        s->tick.top = value & COUNTER_BITS;
    } else if (word == CTRL) {
        s->tick_control = value & CONTROL_BITS;
        s->tick.divider = value & CLKSOURCE ? 1 : REFERENCE_DIVIDER;
        s->tick.runs = value & ENABLE;
    }
    s->tick_next = s->tick.runs && (s->tick.value || s->tick.top) ? ramp_zero(&s->tick) : NO_TIME;
}
