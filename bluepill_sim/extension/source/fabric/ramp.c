/* Counters that follow from the time: (value, time) of the last change, a divider, a limit and a direction.
 *
 * One costs nothing while it counts. Times are of whatever unit its owner counts in: SysTick and CYCCNT in cycles,
 * a timer in ticks of its clock.
 * Invariant: what it reads depends on the struct and the time alone, so that any two reads agree.
 */
#include "fabric.h"

uint32_t ramp_at(const struct ramp *ramp, uint64_t now)
{
    if (!ramp->runs || now < ramp->base) {
        return ramp->value;
    }
    const uint64_t ticks = (now - ramp->base) / ramp->divider, period = (uint64_t)ramp->top + 1;
    if (ramp->mirrors) {
        const uint64_t there = ramp->top, at = ((ramp->falls ? 2 * there - ramp->value : ramp->value) + ticks) % (2 * there);
        return (uint32_t)(at <= there ? at : 2 * there - at);
    }
    if (ramp->falls) {
        return (uint32_t)(ticks <= ramp->value ? ramp->value - ticks : ramp->top - (ticks - ramp->value - 1) % period);
    }
    return (uint32_t)((ramp->value + ticks) % period);
}

void ramp_rebase(struct ramp *ramp, uint64_t now)
{
    ramp->value = ramp_at(ramp, now);
    ramp->base = ramp->runs ? now - (now - ramp->base) % ramp->divider : now;
}

uint64_t ramp_zero(const struct ramp *ramp)
{
    return ramp->base + (ramp->value ? ramp->value : (uint64_t)ramp->top + 1) * ramp->divider;
}
