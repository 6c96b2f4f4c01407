/* The inputs of a timer: filters, captures, triggers and the slave modes, the encoder, the break.
 *
 * Pins are listened to only where something follows from them. A filter takes its samples as arithmetic; the sample that
 * lets an edge through is an event. Nothing is delayed by synchronisers.
 *
 * Source: RM0008 14.3.4 to 14.3.7, 14.3.12, 14.3.16 to 14.3.20; 15.3.3 to 15.3.6, 15.3.12 to 15.3.15, table 87.
 * Invariant: `raw` of an input that is listened to is the level of its pin, or of the pins that it is made of.
 */
#include "tim.h"

/* ICxF and ETF: samples that agree, and the division of the sampling clock; the first three sample with CK_INT. */
static const struct {
    uint8_t length, division;
} filter_modes[16] = {{0, 1}, {2, 1}, {4, 1}, {8, 1}, {6, 2}, {8, 2}, {6, 4}, {8, 4},
                      {6, 8}, {8, 8}, {5, 16}, {6, 16}, {8, 16}, {5, 32}, {6, 32}, {8, 32}};
enum { FIRST_DTS = 4 };

static uint32_t selection(const struct device *device) { return bits_of(device, SMCR, TS_AT, 7); }

static bool is_channel_on(const struct device *device, uint32_t channel, uint32_t source)
{
    return is_on(device, channel) && (ccmr_of(device, channel) & 3) == source;
}

static bool uses_trc(const struct device *device)
{
    bool does = false;
    for (uint32_t n = 0; n < CHANNELS; ++n) {
        does |= is_channel_on(device, n, 3);
    }
    return does;
}

static bool uses_trigger(const struct device *device)
{
    const uint32_t mode = slave_mode(device), both = CCPC | CCUS;
    return mode >= SLAVE_RESET || (mode != SLAVE_OFF && selection(device) < TRIGGER_ED) || uses_trc(device) ||
           (device->words[CR2] & both) == both;
}

bool hears_line(const struct device *device, uint32_t input)
{
    if (input == CSS) {
        return device->words[BDTR] & BKE;
    }
    return selection(device) == input && uses_trigger(device);
}

/* Break. */

bool is_break_active(const struct device *device)
{
    const uint32_t pin = tim_of(device)->pins[PIN_BKIN], bdtr = device->words[BDTR];
    const uint32_t is_high = port_now(device->fabric, pin / PINS)->input >> pin % PINS & 1;
    return bdtr & BKE && is_high == (bdtr & BKP) / BKP;
}

void trigger_break(struct device *device)
{
    device->words[SR] |= BIF;
    set_moe(device, false);
}

void check_break(struct device *device)
{
    struct tim *tim = tim_of(device);
    const bool is_active = tim->is_advanced && is_break_active(device);
    if (is_active) {
        trigger_break(device);
    }
    tim->in_break = is_active;
}

/* Captures. */

void capture(struct device *device, uint32_t channel)
{
    struct tim *tim = tim_of(device);
    const uint32_t flag = CC1IF << channel;
    tim->ccr[channel] = device->words[CCR1 + channel] = tim->ramp.value;
    if (device->words[SR] & flag) {
        device->words[SR] |= flag << OVER;
    }
    channel_event(device, channel);
}

static void capture_edge(struct device *device, uint32_t channel)
{
    struct tim *tim = tim_of(device);
    if (++tim->captures[channel] >> (ccmr_of(device, channel) >> 2 & 3)) {
        tim->captures[channel] = 0;
        capture(device, channel);
    }
}

/* Triggers. */

static void raise_trigger(struct device *device)
{
    device->words[SR] |= TIF;
    if (device->words[DIER] & TIF << DMA_AT) {
        request(device, TRIG_DMA);
    }
}

void trigger_event(struct device *device) { raise_trigger(device); }

static uint32_t mix(uint32_t present, uint32_t wanted, uint32_t mask) { return (wanted & ~mask) | (present & mask); }

void take_modes(struct device *device, bool is_commutation)
{
    /* CCxE, CCxNE and OCxM of the channels with two outputs (RM0008 14.4.2, CCPC). */
    enum { ENABLES = 0x555, MODES_1 = 0x7070, MODES_2 = 0x70 };
    struct tim *tim = tim_of(device);
    const bool waits = device->words[CR2] & CCPC && !is_commutation;
    bool before[CHANNELS];
    uint32_t modes[CHANNELS];
    for (uint32_t n = 0; n < CHANNELS; ++n) {
        before[n] = reference(device, n);
        modes[n] = mode_of(device, n);
    }
    tim->ccer = mix(tim->ccer, device->words[CCER], waits ? ENABLES : 0);
    tim->ccmr[0] = mix(tim->ccmr[0], device->words[CCMR1], waits ? MODES_1 : 0);
    tim->ccmr[1] = mix(tim->ccmr[1], device->words[CCMR2], waits ? MODES_2 : 0);
    for (uint32_t n = 0; n < CHANNELS; ++n) {
        const uint32_t mode = mode_of(device, n), bit = 1u << n;
        if (mode != modes[n]) {
            const bool is_high = mode == FORCE_HIGH || (mode != FORCE_LOW && before[n]);
            tim->latched = is_high ? tim->latched | bit : tim->latched & ~bit;
        }
        if (!is_on(device, n)) { /* also resets the prescaler of an input (RM0008 15.4.7, IC1PSC) */
            tim->captures[n] = 0;
        }
        if (!is_input(device, n) && !is_preloaded(device, n)) {
            tim->ccr[n] = device->words[CCR1 + n];
        }
    }
}

void commutation_event(struct device *device)
{
    take_modes(device, true);
    device->words[SR] |= COMIF;
    if (device->words[DIER] & COMIF << DMA_AT) {
        request(device, COM_DMA);
    }
}

static void trigger_rises(struct device *device)
{
    const uint32_t mode = slave_mode(device), both = CCPC | CCUS;
    for (uint32_t n = 0; n < CHANNELS && selection(device) <= TRIGGER_ED; ++n) {
        if (is_channel_on(device, n, 3)) {
            capture_edge(device, n);
        }
    }
    if (mode == SLAVE_RESET) {
        reinitialize(device);
    } else if (mode == SLAVE_TRIGGER) {
        device->words[CR1] |= CEN;
        set_running(device);
    } else if (mode == SLAVE_CLOCK && !(device->words[SMCR] & ECE)) {
        count_edge(device);
    }
    if (mode != SLAVE_OFF) {
        raise_trigger(device);
    }
    if (tim_of(device)->is_advanced && (device->words[CR2] & both) == both) {
        commutation_event(device);
    }
}

/* The trigger's level now; TI1F_ED has none. */
static bool trigger_level(const struct device *device)
{
    const struct tim *tim = tim_of(device);
    switch (selection(device)) {
    case TRIGGER_ED: return false;
    case TRIGGER_TI1: return tim->filters[0].out != is_inverted(device, 0);
    case TRIGGER_TI2: return tim->filters[1].out != is_inverted(device, 1);
    case TRIGGER_ETRF: return etrf(device);
    default: return tim->itr >> selection(device) & 1;
    }
}

static void take_trigger(struct device *device)
{
    struct tim *tim = tim_of(device);
    const bool is_high = trigger_level(device);
    if (is_high == tim->trgi || !uses_trigger(device)) {
        tim->trgi = is_high;
        return;
    }
    tim->trgi = is_high;
    if (slave_mode(device) == SLAVE_GATED) {
        raise_trigger(device);
        set_running(device);
    } else if (is_high) {
        trigger_rises(device);
    }
}

void look_at_trigger(struct device *device)
{
    struct tim *tim = tim_of(device);
    const uint32_t hears = uses_trigger(device) && selection(device) < TRIGGER_ED ? 1u << selection(device) : 0;
    if (hears != tim->hears) {
        const uint8_t was_busy = tim->is_busy;
        tim->hears = hears;
        tim->is_busy = true; /* a level that is there already is no edge */
        hearing_changed(device);
        tim->is_busy = was_busy;
    }
    tim->trgi = trigger_level(device);
    set_running(device);
}

void take_line(struct device *device, uint32_t input, bool level)
{
    struct tim *tim = tim_of(device);
    if (input == CSS) {
        synchronize(device, tick_now(device));
        if (level && device->words[BDTR] & BKE) {
            trigger_break(device);
        }
        refresh(device);
        return;
    }
    tim->itr = level ? tim->itr | 1u << input : tim->itr & ~(1u << input);
    if (tim->is_busy || tim->is_stopped) { /* its own pulses have come back: silicon takes some clocks for that */
        return;
    }
    fabric_catch_up(device->fabric, device->slot, now_ns(device->fabric));
    synchronize(device, tick_now(device));
    take_trigger(device);
    refresh(device);
}

/* The encoder. */

/* An edge of TI1 or TI2 (RM0008 table 87): an input that rises while the other is high, or falls while that is low,
 * counts down on TI1 and up on TI2. */
static void take_quadrature(struct device *device, uint32_t input)
{
    const struct tim *tim = tim_of(device);
    const bool one = tim->filters[0].out != is_inverted(device, 0), other = tim->filters[1].out != is_inverted(device, 1);
    place(device, tim->ramp.value, (one == other) == (input == 0)); /* DIR follows the edges of both */
    if (slave_mode(device) != (input == 0 ? ENCODER_TI2 : ENCODER_TI1)) {
        count_edge(device);
    }
}

static void input_changed(struct device *device, uint32_t input)
{
    const bool is_high = tim_of(device)->filters[input].out;
    if (input == ETR) {
        if (device->words[SMCR] & ECE && is_high) {
            count_edge(device);
        }
        take_trigger(device);
        return;
    }
    for (uint32_t k = 0; k < 2; ++k) { /* before a trigger resets the counter */
        const uint32_t channel = input ^ k;
        if (is_channel_on(device, channel, 1 + k) && is_high != is_inverted(device, channel)) {
            capture_edge(device, channel);
        }
    }
    if (is_encoder(device) && input < 2) {
        take_quadrature(device, input);
    }
    if (selection(device) == TRIGGER_ED && input == 0 && uses_trigger(device)) {
        trigger_rises(device);
    } else {
        take_trigger(device);
    }
}

/* Filters. */

/* The tick of the sample that lets the level through, if it stays. */
static uint64_t flips_at(const struct filter *filter)
{
    return (filter->sampled / filter->period + filter->length - filter->count) * filter->period;
}

static bool is_waiting(const struct filter *filter) { return filter->length && filter->raw != filter->out; }

static void take_samples(struct filter *filter, uint64_t tick)
{
    if (is_waiting(filter)) {
        filter->count = (uint8_t)(filter->count + tick / filter->period - filter->sampled / filter->period);
    } else {
        filter->count = 0;
    }
    filter->sampled = tick;
}

static void set_raw(struct device *device, uint32_t input, bool level)
{
    struct filter *filter = &tim_of(device)->filters[input];
    if (filter->raw == level) {
        return;
    }
    if (filter->length) {
        take_samples(filter, tim_of(device)->at);
    }
    filter->raw = level;
    if (!filter->length) {
        filter->out = level;
        input_changed(device, input);
    } else if (filter->raw == filter->out) {
        filter->count = 0;
    }
}

uint64_t next_filter_stop(const struct device *device)
{
    uint64_t first = NO_TIME;
    for (uint32_t n = 0; n < INPUTS; ++n) {
        const struct filter *filter = &tim_of(device)->filters[n];
        first = is_waiting(filter) ? earlier(first, flips_at(filter)) : first;
    }
    return first;
}

void flip_filters(struct device *device)
{
    for (uint32_t n = 0; n < INPUTS; ++n) {
        struct filter *filter = &tim_of(device)->filters[n];
        if (is_waiting(filter) && flips_at(filter) <= tim_of(device)->at) {
            filter->out = filter->raw;
            filter->count = 0;
            filter->sampled = tim_of(device)->at;
            input_changed(device, n);
        }
    }
}

void set_filters(struct device *device)
{
    struct tim *tim = tim_of(device);
    const uint32_t ckd = device->words[CR1] >> CKD_AT & 3;
    for (uint32_t n = 0; n < INPUTS; ++n) {
        const uint32_t mode = n == ETR               ? bits_of(device, SMCR, ETF_AT, 15)
                              : is_input(device, n) ? ccmr_of(device, n) >> 4
                                                    : 0;
        struct filter *filter = &tim->filters[n];
        const uint32_t length = filter_modes[mode].length;
        const uint32_t period = filter_modes[mode].division << (mode < FIRST_DTS ? 0 : ckd > 2 ? 2 : ckd);
        if (filter->length == length && filter->period == period) {
            continue;
        }
        filter->sampled = tim->at;
        filter->count = 0;
        filter->length = length;
        filter->period = period;
        if (!length && filter->raw != filter->out) {
            filter->out = filter->raw;
            input_changed(device, n);
        }
    }
}

/* Pins. */

static bool pin_level(const struct device *device, uint32_t which)
{
    const uint32_t pin = tim_of(device)->pins[which];
    return port_now(device->fabric, pin / PINS)->input >> pin % PINS & 1;
}

/* The level in front of the filter of an input; ETR behind its polarity and prescaler. */
static bool raw_level(struct device *device, uint32_t input)
{
    struct tim *tim = tim_of(device);
    if (input == 0 && device->words[CR2] & TI1S) {
        return pin_level(device, 0) ^ pin_level(device, 1) ^ pin_level(device, 2);
    }
    if (input != ETR) {
        return pin_level(device, input);
    }
    const bool is_high = pin_level(device, PIN_ETR) != (device->words[SMCR] / ETP & 1);
    const uint32_t division = bits_of(device, SMCR, ETPS_AT, 3);
    if (!division) {
        tim->etr_was = is_high;
        return is_high;
    }
    tim->etr_edges += is_high && !tim->etr_was;
    tim->etr_was = is_high;
    return tim->etr_edges >> (division - 1) & 1;
}

void take_levels(struct device *device)
{
    for (uint32_t n = 0; n < INPUTS; ++n) {
        if (tim_of(device)->listening >> (n == ETR ? (uint32_t)PIN_ETR : n) & 1) {
            set_raw(device, n, raw_level(device, n));
        }
    }
}

static void take_all_levels(struct device *device)
{
    const struct tim *tim = tim_of(device);
    if (tim->listening >> PIN_BKIN & 1 && is_break_active(device) != tim->in_break) {
        check_break(device);
    }
    if (!tim->is_stopped) {
        take_levels(device);
    }
}

void take_what_waits(struct device *device)
{
    take_all_levels(device);
    take_trigger(device);
}

void take_pins(struct device *device, uint32_t port, uint32_t changed)
{
    struct tim *tim = tim_of(device);
    (void)port;
    (void)changed;
    if (tim->is_busy) { /* an output of its own leads here: else the two could chase each other within a tick */
        tim->late_at = tim->at + 1;
        return;
    }
    fabric_catch_up(device->fabric, device->slot, now_ns(device->fabric));
    synchronize(device, tick_now(device));
    take_all_levels(device);
    refresh(device);
}

void take_late_levels(struct device *device)
{
    struct tim *tim = tim_of(device);
    if (tim->late_at && tim->at >= tim->late_at) {
        tim->late_at = 0;
        take_all_levels(device);
    }
}

/* The inputs from which something follows, as bits of `pins`. */
static uint32_t wanted_pins(const struct device *device)
{
    const uint32_t *words = device->words;
    const bool is_used = uses_trigger(device);
    uint32_t wanted = is_encoder(device) ? 3 : 0;
    for (uint32_t n = 0; n < CHANNELS; ++n) {
        wanted |= is_channel_on(device, n, 1) ? 1u << n : 0;
        wanted |= is_channel_on(device, n, 2) ? 1u << (n ^ 1) : 0;
        wanted |= !is_input(device, n) && ccmr_of(device, n) & 0x80 ? 1u << PIN_ETR : 0;
    }
    if (is_used) {
        const uint32_t by[8] = {[TRIGGER_ED] = 1 << 0, [TRIGGER_TI1] = 1 << 0, [TRIGGER_TI2] = 1 << 1, [TRIGGER_ETRF] = 1 << PIN_ETR};
        wanted |= by[selection(device)];
    }
    wanted |= words[SMCR] & ECE ? 1u << PIN_ETR : 0;
    wanted |= wanted & 1 && words[CR2] & TI1S ? 7 : 0;
    wanted |= tim_of(device)->is_advanced && words[BDTR] & BKE ? 1u << PIN_BKIN : 0;
    return wanted;
}

void listen(struct device *device, bool is_restored)
{
    struct tim *tim = tim_of(device);
    const uint32_t wanted = wanted_pins(device), fresh = wanted & ~tim->listening;
    if (wanted == tim->listening && !is_restored) {
        return;
    }
    uint32_t masks[PORTS] = {0};
    for (uint32_t n = 0; n < PIN_COUNT; ++n) {
        masks[tim->pins[n] / PINS] |= (wanted >> n & 1) << tim->pins[n] % PINS;
    }
    for (uint32_t port = 0; port < PORTS; ++port) {
        listen_to_pins(device, port, masks[port]);
    }
    tim->listening = wanted;
    for (uint32_t n = 0; n < INPUTS && !is_restored; ++n) { /* what was there before is no edge */
        if (fresh >> (n == ETR ? (uint32_t)PIN_ETR : n) & 1) {
            struct filter *filter = &tim->filters[n];
            filter->raw = filter->out = raw_level(device, n);
            filter->count = 0;
            filter->sampled = tim->at;
        }
    }
    if (!is_restored) {
        tim->trgi = trigger_level(device);
    }
}
