/* The outputs of a timer: OCxREF, polarity, dead time, idle states, and what the pins show of them.
 *
 * While the counter goes its laps by CK_INT, what PWM and toggling make is a wave, which costs nothing until somebody
 * looks; everything else is a level, set anew by the event that changes it.
 *
 * Source: RM0008 14.3.9 to 14.3.13, tables 83 and 84; 15.3.8, 15.3.9.
 * Invariant: `outputs` has what the pins were last told.
 */
#include "tim.h"

static const struct shape low = {.kind = SHOWS_LOW}, high = {.kind = SHOWS_HIGH}, nothing = {.kind = SHOWS_NOTHING};

static struct shape level(bool is_high) { return is_high ? high : low; }

static struct shape wave(uint64_t period, uint64_t ones, uint64_t rises)
{
    return (struct shape){.kind = SHOWS_WAVE, .period = period, .high = ones, .edge = within(rises, period)};
}

static bool level_at(const struct shape *shape, uint64_t tick)
{
    if (shape->kind != SHOWS_WAVE) {
        return shape->kind == SHOWS_HIGH;
    }
    return (tick % shape->period + shape->period - shape->edge) % shape->period < shape->high;
}

static struct shape inverted(struct shape shape, bool is_wanted)
{
    if (!is_wanted) {
        return shape;
    }
    return shape.kind == SHOWS_WAVE ? wave(shape.period, shape.period - shape.high, shape.edge + shape.high)
                                    : level(shape.kind == SHOWS_LOW);
}

/* The tick of the last edge of a wave at or before a tick. */
static uint64_t last_edge(const struct shape *shape, uint64_t tick)
{
    const uint64_t since = (tick % shape->period + shape->period - shape->edge) % shape->period;
    return tick - (since < shape->high ? since : since - shape->high);
}

static uint64_t next_edge(const struct shape *shape, uint64_t tick)
{
    const uint64_t since = (tick % shape->period + shape->period - shape->edge) % shape->period;
    return tick + (since < shape->high ? shape->high : shape->period) - since;
}

/* DTG in ticks (RM0008 14.4.18). */
static uint64_t dead_time(const struct device *device)
{
    const uint32_t dtg = device->words[BDTR] & DTG, steps = dtg & 31, divider = 1u << (device->words[CR1] >> CKD_AT & 3);
    const uint32_t time = dtg < 128 ? dtg : dtg < 192 ? 2 * (64 + (dtg & 63)) : (dtg < 224 ? 8 : 16) * (32 + steps);
    return (uint64_t)time * (divider > 4 ? 4 : divider);
}

/* Until when the dead time of a new wave may count from another edge than the wave has: it was not there before. */
static uint64_t young_until(const struct device *device, uint32_t channel)
{
    const struct tim *tim = tim_of(device);
    const uint64_t last = tim->born[channel] > tim->edge_at[channel] ? tim->born[channel] : tim->edge_at[channel];
    return earlier(last + dead_time(device), tim->turns_at[channel]);
}

/* Rising edges come `ticks` later; of a level that has been there since `edge_at`. */
static struct shape delayed(struct shape shape, uint64_t ticks, uint64_t edge_at, uint64_t now)
{
    if (shape.kind == SHOWS_WAVE) {
        return shape.high > ticks ? wave(shape.period, shape.high - ticks, shape.edge + ticks) : low;
    }
    return shape.kind == SHOWS_HIGH && now < edge_at + ticks ? low : shape;
}

bool reference(const struct device *device, uint32_t channel)
{
    const struct tim *tim = tim_of(device);
    if (tim->cleared >> channel & 1) {
        return false;
    }
    if (mode_of(device, channel) < PWM1) {
        return tim->latched >> channel & 1;
    }
    struct lap lap = lap_of(&tim->ramp);
    if (!lap.period) { /* centre-aligned, and ARR is 0 */
        return (tim->ccr[channel] != 0) == (mode_of(device, channel) == PWM1);
    }
    find_active(device, channel, &lap);
    return (lap.phase + lap.period - lap.first % lap.period) % lap.period < lap.active;
}

/* OCxREF as a wave, where it is one. */
static struct shape reference_shape(const struct device *device, uint32_t channel)
{
    const struct tim *tim = tim_of(device);
    const struct ramp *ramp = &tim->ramp;
    const uint32_t mode = mode_of(device, channel);
    if (!ramp->runs || tim->at < ramp->base || tim->cleared >> channel & 1 || (mode < PWM1 && mode != TOGGLE)) {
        return level(reference(device, channel));
    }
    struct lap lap = lap_of(ramp);
    const uint64_t period = lap.period * ramp->divider;
    if (mode != TOGGLE) {
        find_active(device, channel, &lap);
        if (!lap.active || lap.active == lap.period) {
            return level(reference(device, channel));
        }
        const uint64_t since = distance(within(lap.first, lap.period), within(lap.phase, lap.period), lap.period);
        return wave(period, lap.active * ramp->divider, ramp->base + period - since * ramp->divider);
    }
    const bool is_high = reference(device, channel);
    uint64_t phases[2];
    const uint32_t count = match_phases(device, tim->ccr[channel], true, phases);
    if (!count) {
        return level(is_high);
    }
    if (count == 1) {
        const uint64_t next = tick_after(tim, counts_until(&lap, phases[0]));
        return wave(2 * period, period, is_high ? next + period : next);
    }
    const uint64_t one = counts_until(&lap, phases[0]), other = counts_until(&lap, phases[1]);
    const uint64_t next = earlier(one, other), gap = (one > other ? one - other : other - one);
    return is_high ? wave(period, (lap.period - gap) * ramp->divider, tick_after(tim, next + gap))
                   : wave(period, gap * ramp->divider, tick_after(tim, next));
}

static bool idle_level(const struct device *device, uint32_t output)
{
    const uint32_t ois = device->words[CR2] >> OIS_AT;
    return output < PIN_COMPLEMENT ? ois >> 2 * output & 1 : ois >> (2 * (output - PIN_COMPLEMENT) + 1) & 1;
}

/* With MOE 0: the inactive level, then that of OISx, unless both of a pair would be active. */
static struct shape idle(const struct device *device, uint32_t channel, bool is_complement)
{
    const struct tim *tim = tim_of(device);
    const bool one = idle_level(device, channel) != is_inverted(device, channel);
    const bool other = channel < PAIRS && idle_level(device, PIN_COMPLEMENT + channel) != (tim->ccer >> 4 * channel >> 3 & 1);
    const bool inactive = is_complement ? tim->ccer >> 4 * channel >> 3 & 1 : is_inverted(device, channel);
    const uint32_t enables = tim->ccer >> 4 * channel & (channel < PAIRS ? 5 : 1);
    if (!(device->words[BDTR] & OSSI) || !enables) {
        return nothing;
    }
    if (tim->at < tim->idle_at || (one && other)) {
        return level(inactive);
    }
    return level(idle_level(device, is_complement ? PIN_COMPLEMENT + channel : channel));
}

/* What a channel's output shows (RM0008 table 83). */
static struct shape output_shape(const struct device *device, uint32_t channel, bool is_complement)
{
    const struct tim *tim = tim_of(device);
    const uint32_t bits = tim->ccer >> 4 * channel;
    const bool is_one_on = bits & 1, is_other_on = channel < PAIRS && tim->is_advanced && bits & 4;
    const bool is_on = is_complement ? is_other_on : is_one_on, is_partner_on = is_complement ? is_one_on : is_other_on;
    const bool is_inverse = bits & (is_complement ? 8 : 2);
    if (is_input(device, channel)) {
        return nothing;
    }
    if (tim->is_advanced && !(device->words[BDTR] & MOE)) {
        return idle(device, channel, is_complement);
    }
    if (!is_on) {
        return is_partner_on && device->words[BDTR] & OSSR ? level(is_inverse) : nothing;
    }
    struct shape shape = reference_shape(device, channel);
    if (is_partner_on) {
        if (tim->at < young_until(device, channel)) {
            shape = level(reference(device, channel));
        }
        shape = delayed(inverted(shape, is_complement), dead_time(device), tim->edge_at[channel], tim->at);
    }
    return inverted(shape, is_inverse);
}

static bool is_same(const struct shape *one, const struct shape *other)
{
    return one->kind == other->kind &&
           (one->kind != SHOWS_WAVE ||
            (one->period == other->period && one->high == other->high && one->edge == other->edge));
}

static void show(struct device *device, uint32_t output, struct shape shape)
{
    struct tim *tim = tim_of(device);
    if (tim->is_stopped && shape.kind == SHOWS_WAVE) {
        shape = level(level_at(&shape, tim->at));
    }
    if (is_same(&tim->outputs[output], &shape)) {
        return;
    }
    tim->outputs[output] = shape;
    struct fabric *fabric = device->fabric;
    const uint32_t pin = tim->pins[output], source = tim->sources[output];
    if (shape.kind == SHOWS_WAVE) {
        const uint64_t position = distance(shape.edge, tick_now(device) % shape.period, shape.period);
        wave_set(fabric, pin, source, tim->ticks.hz, shape.period, shape.high, position);
    } else {
        offer(fabric, pin, source, shape.kind == SHOWS_NOTHING ? FLOATING : shape.kind == SHOWS_HIGH ? HIGH : LOW);
    }
}

/* Notes when OCxREF last changed, where it becomes another wave or level: the dead time counts from there. */
static void note_edge(struct device *device, uint32_t channel)
{
    struct tim *tim = tim_of(device);
    const struct shape was = tim->references[channel], shape = reference_shape(device, channel);
    if (is_same(&was, &shape)) {
        return;
    }
    const bool is_noted = tim->shaped_at[channel] == tim->at || tim->written_at == tim->at;
    const uint64_t before = is_noted ? tim->at : tim->at - 1;
    if (level_at(&was, before) != reference(device, channel)) {
        tim->edge_at[channel] = tim->at;
    } else if (was.kind == SHOWS_WAVE && last_edge(&was, before) > tim->shaped_at[channel]) {
        tim->edge_at[channel] = last_edge(&was, before);
    }
    tim->born[channel] = shape.kind == SHOWS_WAVE ? last_edge(&shape, tim->at) : 0;
    tim->turns_at[channel] = shape.kind == SHOWS_WAVE ? next_edge(&shape, tim->at) : 0;
    tim->shaped_at[channel] = tim->at;
    tim->references[channel] = shape;
}

/* What a register's write finds: OCxREF has come to its tick, and changes anew where the write makes it. */
void note_references(struct device *device)
{
    struct tim *tim = tim_of(device);
    for (uint32_t n = 0; n < PAIRS && tim->is_advanced; ++n) {
        note_edge(device, n);
    }
    tim->written_at = tim->at;
}

void show_outputs(struct device *device)
{
    struct tim *tim = tim_of(device);
    const uint32_t before = tim->cleared;
    for (uint32_t n = 0; n < CHANNELS; ++n) { /* OCxCE */
        const bool is_cleared = !is_input(device, n) && ccmr_of(device, n) & 0x80;
        tim->cleared = is_cleared ? tim->cleared | (uint32_t)etrf(device) << n : tim->cleared & ~(1u << n);
    }
    tim->latched &= ~(tim->cleared & ~before);
    for (uint32_t n = 0; n < PAIRS && tim->is_advanced; ++n) {
        note_edge(device, n);
    }
    for (uint32_t n = 0; n < CHANNELS; ++n) {
        show(device, n, output_shape(device, n, false));
    }
    for (uint32_t n = 0; n < PAIRS && tim->is_advanced; ++n) {
        show(device, PIN_COMPLEMENT + n, output_shape(device, n, true));
    }
}

void show_duty(struct device *device, uint32_t channel, uint32_t ccr)
{
    struct tim *tim = tim_of(device);
    struct shape *shown = &tim->outputs[channel];
    struct lap was = lap_of(&tim->ramp), is = was;
    find_active(device, channel, &was);
    tim->ccr[channel] = ccr;
    find_active(device, channel, &is);
    const uint64_t divider = tim->ramp.divider, ones = is.active * divider;
    const uint64_t later = divider * distance(within(was.first, was.period), within(is.first, is.period), is.period);
    if (shown->kind == SHOWS_WAVE && shown->period == is.period * divider && shown->high == was.active * divider &&
        !is_inverted(device, channel) && is.active && is.active < is.period &&
        wave_change(device->fabric, tim->pins[channel], tim->sources[channel], &tim->ticks, ones, later)) {
        shown->high = ones;
        shown->edge = within(shown->edge + later, shown->period);
        return;
    }
    show(device, channel, output_shape(device, channel, false));
}

uint64_t next_output_stop(const struct device *device)
{
    const struct tim *tim = tim_of(device);
    uint64_t first = tim->idle_at > tim->at ? tim->idle_at : NO_TIME;
    if (!tim->is_advanced) {
        return NO_TIME;
    }
    for (uint32_t n = 0; n < PAIRS; ++n) {
        const uint64_t ends = tim->edge_at[n] + dead_time(device), matures = young_until(device, n);
        if ((tim->ccer >> 4 * n & 5) == 5) {
            first = ends > tim->at ? earlier(first, ends) : first;
            first = matures > tim->at ? earlier(first, matures) : first;
        }
    }
    return first;
}

void set_moe(struct device *device, bool is_on)
{
    struct tim *tim = tim_of(device);
    if (is_on) {
        device->words[BDTR] |= MOE;
    } else if (device->words[BDTR] & MOE) {
        device->words[BDTR] &= ~(uint32_t)MOE;
        tim->idle_at = tim->at + dead_time(device);
    }
}

void forget_outputs(struct device *device)
{
    for (uint32_t n = 0; n < sizeof tim_of(device)->outputs / sizeof(struct shape); ++n) {
        tim_of(device)->outputs[n].kind = SHOWS_UNKNOWN;
    }
}
