/* The counter of a timer: laps, update events, compare matches, and when the next of them comes that somebody sees.
 *
 * CNT is a ramp of ticks. A lap is what repeats: up or down a period of ARR + 1 counts, centre-aligned one of 2 ARR. What
 * happens within any number of counts is worked out by the phases of a lap, so that a timer at which nobody looks costs
 * nothing. A counter that stands beyond ARR goes on to 65535, or down to ARR, before its laps begin.
 *
 * Source: RM0008 14.3.1 to 14.3.3, 14.3.8, 14.3.10, 15.3.1, 15.3.2.
 * Invariant: `ramp` has the counter at its last count at or before `at`.
 */
#include "tim.h"

enum { LAST = 0xFFFF };

static bool is_centred(const struct device *device) { return device->words[CR1] & CMS && !is_encoder(device); }

/* Whether the counter stands beyond ARR, on its way to the laps. */
static bool is_beyond(const struct tim *tim) { return tim->ramp.top != tim->arr; }

void place(struct device *device, uint32_t count, bool falls)
{
    struct tim *tim = tim_of(device);
    struct ramp *ramp = &tim->ramp;
    const bool is_beyond = count > tim->arr, mirrors = is_centred(device);
    if (mirrors && count == 0) {
        falls = false;
    } else if (mirrors && count == tim->arr) {
        falls = true;
    }
    ramp->value = count;
    ramp->falls = falls;
    ramp->mirrors = mirrors && !is_beyond;
    ramp->top = is_beyond ? LAST : tim->arr;
}

static bool has_own_clock(const struct device *device)
{
    return slave_mode(device) == SLAVE_CLOCK || is_encoder(device) || device->words[SMCR] & ECE;
}

static bool is_enabled(const struct device *device)
{
    const struct tim *tim = tim_of(device);
    return device->words[CR1] & CEN && tim->arr && (slave_mode(device) != SLAVE_GATED || tim->trgi);
}

void set_running(struct device *device)
{
    struct tim *tim = tim_of(device);
    struct ramp *ramp = &tim->ramp;
    const bool runs = is_enabled(device) && !has_own_clock(device);
    if (runs && !ramp->runs) { /* a clock after CEN (RM0008 15.3.1) */
        tim->starts = tim->at + 1;
        ramp->base = tim->starts - tim->psc_count;
    } else if (!runs && ramp->runs && tim->at >= tim->starts) {
        tim->psc_count = (uint32_t)((tim->at - ramp->base) % ramp->divider);
    }
    ramp->runs = runs;
}

struct lap lap_of(const struct ramp *ramp)
{
    const uint64_t top = ramp->top, value = ramp->value;
    if (ramp->mirrors) {
        return (struct lap){.period = 2 * top, .phase = ramp->falls ? 2 * top - value : value};
    }
    return (struct lap){.period = top + 1, .phase = ramp->falls ? top - value : value};
}

static void go_to_phase(struct ramp *ramp, uint64_t phase)
{
    const uint64_t top = ramp->top;
    if (ramp->mirrors) {
        ramp->falls = phase >= top;
        ramp->value = (uint32_t)(phase <= top ? phase : 2 * top - phase);
    } else {
        ramp->value = (uint32_t)(ramp->falls ? top - phase : phase);
    }
}

uint64_t counts_until(const struct lap *lap, uint64_t phase)
{
    const uint64_t counts = (phase + lap->period - lap->phase) % lap->period;
    return counts ? counts : lap->period;
}

static uint64_t arrivals(const struct lap *lap, uint64_t phase, uint64_t counts)
{
    const uint64_t first = counts_until(lap, phase);
    return counts < first ? 0 : 1 + (counts - first) / lap->period;
}

uint32_t match_phases(const struct device *device, uint32_t value, bool is_output, uint64_t phases[2])
{
    const struct ramp *ramp = &tim_of(device)->ramp;
    const uint64_t top = ramp->top;
    const uint32_t directions = is_output ? 3 : device->words[CR1] >> 5 & 3; /* CMS: 1 down, 2 up, 3 both */
    if (value > top) { /* the flag rises with the overflow (RM0008 15.4.5) */
        phases[0] = ramp->mirrors ? top : 0;
        return is_output ? 0 : 1;
    }
    if (!ramp->mirrors) {
        phases[0] = ramp->falls ? top - value : value;
        return 1;
    }
    if (value == 0 || value == top || directions != 3) { /* where it turns round, it does so for either direction */
        phases[0] = value == 0 || value == top || directions == 2 ? value : 2 * top - value;
        return 1;
    }
    phases[0] = value;
    phases[1] = 2 * top - value;
    return 2;
}

void find_active(const struct device *device, uint32_t channel, struct lap *lap)
{
    const struct tim *tim = tim_of(device);
    const struct ramp *ramp = &tim->ramp;
    const uint64_t top = ramp->top, value = tim->ccr[channel], period = lap->period;
    if (ramp->mirrors) {
        lap->active = value < top ? 2 * value : period;
        lap->first = value < top ? period - value : 0;
    } else if (ramp->falls) { /* while CNT <= CCR */
        lap->active = value < top ? value + 1 : period;
        lap->first = value < top ? top - value : 0;
    } else { /* while CNT < CCR */
        lap->active = value < period ? value : period;
        lap->first = 0;
    }
    if (mode_of(device, channel) == PWM2) {
        lap->first += lap->active;
        lap->active = period - lap->active;
    }
}

/* Takes as many overflows; returns whether there was an update event among them. */
static bool repeat(struct device *device, uint64_t overflows)
{
    struct tim *tim = tim_of(device);
    if (overflows <= tim->repetitions) {
        tim->repetitions -= (uint32_t)overflows;
        return false;
    }
    const uint64_t length = (uint64_t)device->words[RCR] + 1;
    tim->repetitions = (uint32_t)(length - 1 - (overflows - tim->repetitions - 1) % length);
    return true;
}

uint32_t count_on(struct device *device, uint64_t counts)
{
    struct tim *tim = tim_of(device);
    const struct lap lap = lap_of(&tim->ramp);
    const bool was_beyond = is_beyond(tim);
    const uint64_t overflows =
        was_beyond ? 0 : arrivals(&lap, 0, counts) + (tim->ramp.mirrors ? arrivals(&lap, tim->ramp.top, counts) : 0);
    uint32_t happened = overflows && repeat(device, overflows) ? OVERFLOWED : 0;
    /* What an update event loads is compared in its own tick, in place of what it replaces. Nobody leaps beyond that. */
    const bool loads = happened && !(device->words[CR1] & UDIS);
    const bool is_at_top = tim->ramp.mirrors ? (lap.phase + counts) % lap.period == tim->ramp.top : tim->ramp.falls;
    const uint32_t left = is_at_top ? tim->ramp.top : 0, landed = is_at_top ? device->words[ARR] : 0;
    for (uint32_t n = 0; n < CHANNELS; ++n) {
        if (is_input(device, n)) {
            continue;
        }
        uint64_t phases[2], flagged = 0, matches = 0;
        for (uint32_t k = match_phases(device, tim->ccr[n], false, phases); k--;) {
            flagged += arrivals(&lap, phases[k], counts);
        }
        for (uint32_t k = match_phases(device, tim->ccr[n], true, phases); k--;) {
            matches += arrivals(&lap, phases[k], counts);
        }
        if (loads && (tim->ccr[n] != device->words[CCR1 + n] || left != landed)) {
            const int more = (device->words[CCR1 + n] == landed) - (tim->ccr[n] == left);
            flagged += (uint64_t)more;
            matches += (uint64_t)more;
        }
        happened |= flagged ? MATCHED << n : 0;
        const uint32_t mode = mode_of(device, n), bit = 1u << n;
        if (matches && mode == SET_ON_MATCH) {
            tim->latched |= bit;
        } else if (matches && mode == CLEAR_ON_MATCH) {
            tim->latched &= ~bit;
        } else if (matches & 1 && mode == TOGGLE) {
            tim->latched ^= bit;
        }
    }
    go_to_phase(&tim->ramp, (lap.phase + counts) % lap.period);
    if (was_beyond && tim->ramp.value <= tim->arr) {
        place(device, tim->ramp.value, tim->ramp.falls);
    }
    return happened;
}

void count_edge(struct device *device)
{
    struct tim *tim = tim_of(device);
    if (!is_enabled(device) || ++tim->psc_count < tim->ramp.divider) {
        return;
    }
    tim->psc_count = 0;
    take_events(device, count_on(device, 1));
}

void take_events(struct device *device, uint32_t happened)
{
    for (uint32_t n = 0; happened && n < CHANNELS; ++n) {
        if (happened & MATCHED << n) {
            channel_event(device, n);
        }
    }
    if (happened & OVERFLOWED) {
        update_event(device, true);
    }
}

void update_event(struct device *device, bool is_by_counter)
{
    struct tim *tim = tim_of(device);
    uint32_t *words = device->words;
    if (words[CR1] & UDIS) {
        return;
    }
    const uint32_t landed = tim->ramp.falls && tim->ramp.value == tim->ramp.top ? words[ARR] : tim->ramp.value;
    tim->arr = words[ARR];
    tim->psc = words[PSC];
    tim->ramp.divider = tim->psc + 1;
    for (uint32_t n = 0; n < CHANNELS; ++n) {
        if (!is_input(device, n)) {
            tim->ccr[n] = words[CCR1 + n];
        }
    }
    if (!etrf(device)) {
        tim->cleared = 0;
    }
    if (tim->is_advanced && words[BDTR] & AOE && !tim->in_break && !(words[BDTR] & MOE)) {
        set_moe(device, true);
    }
    if (is_by_counter || !(words[CR1] & URS)) {
        words[SR] |= UIF;
        tim->armed &= ~(uint32_t)UIF;
        if (words[DIER] & UIF << DMA_AT) {
            request(device, UP_DMA);
        }
        for (uint32_t n = 0; n < CHANNELS; ++n) {
            if (words[CR2] & CCDS && words[DIER] & CC1IF << (DMA_AT + n)) {
                request(device, CC1_DMA + n);
            }
        }
    }
    if (master_mode(device) == MASTER_UPDATE) {
        pulse(device, TRGO);
    }
    if (words[CR1] & OPM) {
        words[CR1] &= ~(uint32_t)CEN;
    }
    place(device, is_by_counter ? landed : tim->ramp.value, tim->ramp.falls);
    set_running(device);
}

void reinitialize(struct device *device)
{
    struct tim *tim = tim_of(device);
    tim->psc_count = 0;
    if (tim->ramp.runs) {
        tim->ramp.base = tim->at < tim->starts ? tim->starts : tim->at;
    }
    tim->repetitions = device->words[RCR];
    update_event(device, false);
    place(device, tim->ramp.falls && !is_centred(device) ? tim->arr : 0, tim->ramp.falls);
    if (master_mode(device) == MASTER_RESET) {
        pulse(device, TRGO);
    }
}

void channel_event(struct device *device, uint32_t channel)
{
    struct tim *tim = tim_of(device);
    uint32_t *words = device->words;
    words[SR] |= CC1IF << channel;
    tim->armed &= ~(CC1IF << channel);
    if (words[DIER] & CC1IF << (DMA_AT + channel) && !(words[CR2] & CCDS)) {
        request(device, CC1_DMA + channel);
    }
    if (channel == 0 && master_mode(device) == MASTER_COMPARE) {
        pulse(device, TRGO);
    }
    pulse(device, CC1 + channel);
}

/* Whether a flag that rises is seen: it interrupts, or the program looks for it. */
static bool is_flag_seen(const struct device *device, uint32_t flag)
{
    return flag & ~device->words[SR] & (device->words[DIER] | tim_of(device)->armed);
}

static bool is_request_seen(const struct device *device, uint32_t flag, uint32_t output)
{
    return device->words[DIER] & flag << DMA_AT && is_heard(device, output);
}

static bool has_preloads(const struct device *device)
{
    const struct tim *tim = tim_of(device);
    bool has = tim->arr != device->words[ARR] || tim->psc != device->words[PSC];
    for (uint32_t n = 0; n < CHANNELS; ++n) {
        has |= !is_input(device, n) && tim->ccr[n] != device->words[CCR1 + n];
    }
    return has;
}

static bool is_update_seen(const struct device *device)
{
    const struct tim *tim = tim_of(device);
    const uint32_t *words = device->words;
    if (words[CR1] & UDIS) {
        return false;
    }
    bool is_seen = has_preloads(device) || words[CR1] & OPM || is_flag_seen(device, UIF) || tim->cleared ||
                   is_request_seen(device, UIF, UP_DMA) || (master_mode(device) == MASTER_UPDATE && is_heard(device, TRGO)) ||
                   (tim->is_advanced && (words[BDTR] & (AOE | MOE)) == AOE);
    for (uint32_t n = 0; n < CHANNELS && words[CR2] & CCDS; ++n) {
        is_seen |= is_request_seen(device, CC1IF << n, CC1_DMA + n);
    }
    return is_seen;
}

static bool is_match_seen(const struct device *device, uint32_t channel)
{
    return is_flag_seen(device, CC1IF << channel) ||
           (!(device->words[CR2] & CCDS) && is_request_seen(device, CC1IF << channel, CC1_DMA + channel)) ||
           (channel == 0 && master_mode(device) == MASTER_COMPARE && is_heard(device, TRGO)) ||
           is_heard(device, CC1 + channel);
}

bool sees_channel(const struct device *device, uint32_t channel)
{
    return is_match_seen(device, channel) || master_mode(device) == MASTER_REFERENCE + channel;
}

/* Whether a match changes OCxREF in a way that no wave shows. */
static bool is_change_seen(const struct device *device, uint32_t channel, bool is_trigger)
{
    const uint32_t mode = mode_of(device, channel), latched = tim_of(device)->latched >> channel & 1;
    return (mode == SET_ON_MATCH && !latched) || (mode == CLEAR_ON_MATCH && latched) || (mode == TOGGLE && is_trigger);
}

static uint64_t counts_to_channel(const struct device *device, uint32_t channel, struct lap lap)
{
    const struct tim *tim = tim_of(device);
    uint64_t phases[2], first = NO_TIME;
    const bool is_trigger = master_mode(device) == MASTER_REFERENCE + channel && is_heard(device, TRGO);
    if (is_match_seen(device, channel)) {
        for (uint32_t k = match_phases(device, tim->ccr[channel], false, phases); k--;) {
            first = earlier(first, counts_until(&lap, phases[k]));
        }
    }
    if (is_change_seen(device, channel, is_trigger)) {
        for (uint32_t k = match_phases(device, tim->ccr[channel], true, phases); k--;) {
            first = earlier(first, counts_until(&lap, phases[k]));
        }
    }
    if (is_trigger && mode_of(device, channel) >= PWM1) {
        find_active(device, channel, &lap);
        if (lap.active && lap.active < lap.period) {
            first = earlier(first, counts_until(&lap, lap.first % lap.period));
            first = earlier(first, counts_until(&lap, (lap.first + lap.active) % lap.period));
        }
    }
    return first;
}

uint64_t next_count_stop(const struct device *device)
{
    const struct tim *tim = tim_of(device);
    const struct ramp *ramp = &tim->ramp;
    if (!ramp->runs) {
        return NO_TIME;
    }
    if (tim->at < ramp->base) { /* the prescaler starts: outputs may show waves from there on */
        return ramp->base;
    }
    const struct lap lap = lap_of(ramp);
    uint64_t first = NO_TIME;
    if (is_beyond(tim)) {
        first = counts_until(&lap, ramp->falls ? LAST - tim->arr : 0);
    } else if (is_update_seen(device)) {
        const uint64_t overflow = counts_until(&lap, 0);
        first = ramp->mirrors ? earlier(overflow, counts_until(&lap, ramp->top)) + (uint64_t)tim->repetitions * ramp->top
                              : overflow + tim->repetitions * lap.period;
    }
    for (uint32_t n = 0; n < CHANNELS; ++n) {
        if (!is_input(device, n)) {
            first = earlier(first, counts_to_channel(device, n, lap));
        }
    }
    return first == NO_TIME ? NO_TIME : tick_after(tim, first);
}
