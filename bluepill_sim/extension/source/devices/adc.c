/* ADC1 and ADC2: conversions of pins, in groups and sequences.
 *
 * Theory of operation. One conversion is under way, of the regular or of the injected group; it samples at `sample_ns`
 * and ends at `end_ns`, whole cycles of PCLK2 from the start of its run. What follows it is decided at its end. A
 * continuous conversion whose flags stand already changes nothing but the data registers, so it has no events: `settle`
 * makes up for them when somebody looks. In the dual modes ADC1 is the master, and both have events.
 * Its inputs are the triggers by EXTSEL, then those by JEXTSEL.
 * Source: RM0008 11.
 * Invariant: `settle` up to a time leaves what it would if each conversion had been made at its own.
 */
#include "../fabric/fabric.h"
#include "../registers/adc.h"

/* Values of EXTSEL and JEXTSEL. */
enum { BY_SOFTWARE = 7, BY_EXTI = 6, TRIGGERS = 7 };
enum { IDLE, REGULAR, INJECTED };
/* Of the dual modes: what ADC2 does with ADC1. */
enum { WITH_REGULAR = 1, WITH_INJECTED = 2, FAST = 4, SLOW = 8, ALTERNATE = 16 };
static const uint8_t dual_modes[16] = {
    0, WITH_REGULAR | WITH_INJECTED, WITH_REGULAR | ALTERNATE, WITH_INJECTED | FAST, WITH_INJECTED | SLOW,
    WITH_INJECTED, WITH_REGULAR, FAST, SLOW, ALTERNATE};
/* Sampling times by SMP, and what follows them, in halves of a cycle of ADCCLK. */
static const uint16_t sampling_halves[8] = {3, 15, 27, 57, 83, 111, 143, 479};
enum { CONVERTING_HALVES = 25 };
/* In cycles of ADCCLK: RM0008 11.9.3, 11.9.4; DS5319 table 46; the last is chosen. */
enum { FAST_DELAY = 7, SLOW_DELAY = 14, CALIBRATION = 83, RESET_CALIBRATION = 4 };
/* tSTAB, DS5319 table 46. */
enum { STABILIZATION_NS = 1000, MOST_HZ = 14000000, RESOLUTION = 4096 };
/* Channels without a pin, and their volts: DS5319 tables 46 and 50. */
enum { PIN_CHANNELS = 10, TEMPERATURE = 16, REFERENCE = 17, REFERENCE_UV = 1200000, V25_UV = 1430000, V25_MC = 25000 };
/* Microvolts by so many thousandths of a degree. */
enum { SLOPE_UV = 43, SLOPE_MC = 10 };
static void reschedule(struct device *device);
static void settle(struct device *device, uint64_t until);

static struct device *other_of(const struct device *device)
{
    struct fabric *fabric = device->fabric;
    for (uint32_t n = 0; n < fabric->slot_count; ++n) {
        if (fabric->devices[n].kind == device->kind && n != device->slot) {
            return &fabric->devices[n];
        }
    }
    return NULL;
}

static bool is_master(const struct device *device) { return ((const struct adc *)device->state)->number == 1; }

static uint32_t dual_mode(const struct device *device)
{
    const struct device *master = is_master(device) ? device : other_of(device);
    return master == NULL ? 0 : dual_modes[master->words[CR1] >> DUALMOD_AT & 15];
}

static void update_irq(struct device *device)
{
    const uint32_t flags = device->words[SR], control = device->words[CR1];
    output_set(device, IRQ,
               (flags & EOC && control & EOCIE) || (flags & JEOC && control & JEOCIE) || (flags & AWD && control & AWDIE));
}

/* The groups. */

static uint32_t regular_length(const struct device *device)
{
    return device->words[CR1] & SCAN ? (device->words[SQR1] >> 20 & 15) + 1 : 1;
}

static uint32_t injected_length(const struct device *device)
{
    return device->words[CR1] & SCAN ? (device->words[JSQR] >> 20 & 3) + 1 : 1;
}

static uint32_t regular_channel(const struct device *device, uint32_t rank)
{
    return device->words[SQR3 - rank / 6] >> 5 * (rank % 6) & 31;
}

/* The sequence ends with JSQ4, however short it is. */
static uint32_t injected_channel(const struct device *device, uint32_t rank)
{
    const uint32_t word = device->words[JSQR];
    return word >> 5 * (3 - (word >> 20 & 3) + rank) & 31;
}

static uint32_t halves_of(const struct device *device, uint32_t channel)
{
    const uint32_t word = device->words[channel < 10 ? SMPR2 : SMPR1];
    return sampling_halves[channel < 18 ? word >> 3 * (channel % 10) & 7 : 0] + CONVERTING_HALVES;
}

/* Time. */

static uint64_t run_ns(const struct adc *adc)
{
    return adc->base_ns + adc->cycles / adc->hz * NS_PER_S + adc->cycles % adc->hz * NS_PER_S / adc->hz;
}

static uint32_t switching_cycles(const struct adc *adc) { return adc->divider == 2 ? 2 : 1; } /* RM0008 11.3.9 */

/* Volts. */

static int64_t input_uv(const struct device *device, uint32_t channel, uint64_t ns)
{
    struct fabric *fabric = device->fabric;
    if (channel < PIN_CHANNELS) {
        return channel_uv(fabric, channel, ns);
    }
    if (!is_master(device) || !(device->words[CR2] & TSVREFE)) {
        return 0;
    }
    const int64_t over_mc = fabric->analog->temperature_mc - V25_MC;
    return channel == TEMPERATURE ? V25_UV - over_mc * SLOPE_UV / SLOPE_MC : channel == REFERENCE ? REFERENCE_UV : 0;
}

static uint32_t convert(const struct device *device, uint32_t channel, uint64_t ns)
{
    const int64_t full = device->fabric->analog->vdda_uv, uv = input_uv(device, channel, ns);
    const int64_t code = uv <= 0 ? 0 : (uv * RESOLUTION + full / 2) / full;
    return code < RESOLUTION ? (uint32_t)code : RESOLUTION - 1;
}

static void warn_once(struct device *device, uint32_t what, uint32_t channel)
{
    struct adc *adc = device->state;
    if (!(adc->warned[what] >> channel & 1)) {
        adc->warned[what] |= 1u << channel;
        ask(device, what, channel);
    }
}

static void check(struct device *device, uint32_t channel)
{
    const struct adc *adc = device->state;
    if (adc->hz > MOST_HZ * adc->divider) {
        warn_once(device, TOO_FAST, 0);
    }
    if (channel < PIN_CHANNELS) {
        if (!(device->fabric->ports[channel / 8].analog >> channel % 8 & 1)) {
            warn_once(device, NOT_ANALOG, channel);
        }
    } else if (channel < TEMPERATURE || channel > REFERENCE || !is_master(device)) {
        warn_once(device, NO_PIN, channel);
    } else if (!(device->words[CR2] & TSVREFE)) {
        warn_once(device, NOT_ENABLED, channel);
    }
}

/* Conversions. */

/* Begins the next one of a group, so many cycles of ADCCLK after the end of the one before. */
static void begin(struct device *device, uint32_t state, uint32_t delay)
{
    struct adc *adc = device->state;
    adc->state = state;
    adc->channel =
        state == REGULAR ? regular_channel(device, adc->regular_at) : injected_channel(device, adc->injected_at);
    adc->has_sample = false;
    const uint64_t sampling = halves_of(device, adc->channel) - CONVERTING_HALVES;
    adc->cycles += (uint64_t)delay * adc->divider + sampling * adc->divider / 2;
    adc->sample_ns = run_ns(adc);
    adc->cycles += CONVERTING_HALVES * (uint64_t)adc->divider / 2;
    adc->end_ns = run_ns(adc);
    device->words[SR] |= state == REGULAR ? STRT : JSTRT;
    check(device, adc->channel);
}

static void begin_at(struct device *device, uint32_t state, uint64_t ns, uint32_t delay)
{
    struct adc *adc = device->state;
    adc->base_ns = ns > adc->ready_ns ? ns : adc->ready_ns;
    adc->cycles = 0;
    begin(device, state, delay);
}

static void stop(struct adc *adc)
{
    adc->state = IDLE;
    adc->end_ns = NO_TIME;
}

static void watch(struct device *device, uint32_t enable, uint32_t channel, uint32_t code)
{
    const uint32_t control = device->words[CR1];
    const bool is_watched = control & enable && (!(control & AWDSGL) || (control & AWDCH) == channel);
    if (is_watched && (code > device->words[HTR] || code < device->words[LTR])) {
        device->words[SR] |= AWD;
    }
}

/* What comes behind the last conversion of the regular group. */
static void end_regular_group(struct device *device)
{
    struct adc *adc = device->state;
    const uint32_t mode = dual_mode(device);
    adc->regular_at = 0;
    if (device->words[CR1] & JAUTO) {
        adc->injected_at = 0;
        adc->injected_left = injected_length(device);
        adc->is_automatic = true;
        begin(device, INJECTED, switching_cycles(adc));
    } else if (mode & SLOW) { /* each ADC anew 28 cycles after its start */
        const uint32_t halves = halves_of(device, adc->channel);
        adc->regular_left = regular_length(device);
        begin(device, REGULAR, halves < 4 * SLOW_DELAY ? (4 * SLOW_DELAY - halves) / 2 : 0);
    } else if ((device->words[CR2] & CONT) && !(device->words[CR1] & DISCEN)) {
        adc->regular_left = regular_length(device);
        begin(device, REGULAR, 0);
    } else {
        stop(adc);
    }
}

static void end_regular(struct device *device, uint32_t code)
{
    struct adc *adc = device->state;
    const bool is_last = adc->regular_at + 1 >= regular_length(device);
    device->words[DR] = device->words[CR2] & ALIGN ? code << 4 : code;
    watch(device, AWDEN, adc->channel, code);
    if (is_last || device->words[CR1] & DISCEN) {
        device->words[SR] |= EOC;
    }
    if (is_master(device) && device->words[CR2] & CR2_DMA) {
        output_set(device, OUTPUT_DMA, true);
    }
    adc->regular_left -= adc->regular_left > 0;
    if (is_last) {
        end_regular_group(device);
    } else if (++adc->regular_at, adc->regular_left) {
        begin(device, REGULAR, 0);
    } else {
        stop(adc);
    }
}

static void end_injected(struct device *device, uint32_t code)
{
    struct adc *adc = device->state;
    const bool is_last = adc->injected_at + 1 >= injected_length(device), was_automatic = adc->is_automatic;
    const int32_t result = (int32_t)code - (int32_t)device->words[JOFR1 + adc->injected_at];
    device->words[JDR1 + adc->injected_at] = (uint32_t)(device->words[CR2] & ALIGN ? result * 8 : result) & 0xFFFF;
    watch(device, JAWDEN, adc->channel, code);
    if (is_last) {
        device->words[SR] |= JEOC | EOC;
    }
    adc->injected_at = is_last ? 0 : adc->injected_at + 1;
    if (!is_last && --adc->injected_left) {
        begin(device, INJECTED, 0);
        return;
    }
    adc->is_automatic = false;
    if (adc->regular_waits) {
        adc->regular_waits = false;
        begin(device, REGULAR, was_automatic ? switching_cycles(adc) : 0);
    } else if (was_automatic && device->words[CR2] & CONT && !(device->words[CR1] & DISCEN)) {
        adc->regular_left = regular_length(device);
        begin(device, REGULAR, switching_cycles(adc));
    } else {
        stop(adc);
    }
}

static void finish(struct device *device)
{
    struct adc *adc = device->state;
    const uint32_t code = adc->has_sample ? adc->sample : convert(device, adc->channel, adc->sample_ns);
    if (adc->state == REGULAR) {
        end_regular(device, code);
    } else {
        end_injected(device, code);
    }
}

/* Whether the conversions that come change nothing but data. */
static bool is_unseen(const struct device *device)
{
    const struct adc *adc = device->state;
    const uint32_t control = device->words[CR1], flags = device->words[SR];
    const uint32_t wanted = EOC | STRT | (control & JAUTO ? JEOC | JSTRT : 0) | (control & (AWDEN | JAWDEN) ? AWD : 0);
    return adc->state != IDLE && (device->words[CR2] & CONT) && !(control & DISCEN) && (flags & wanted) == wanted &&
           !(is_master(device) && device->words[CR2] & CR2_DMA) && !dual_mode(device) && !adc->regular_waits &&
           (adc->state == REGULAR || adc->is_automatic);
}

/* Cycles of PCLK2 of one round of a continuous conversion. */
static uint64_t round_cycles(const struct device *device)
{
    const struct adc *adc = device->state;
    uint64_t halves = 0;
    for (uint32_t n = 0; n < regular_length(device); ++n) {
        halves += halves_of(device, regular_channel(device, n));
    }
    if (device->words[CR1] & JAUTO) {
        halves += 4 * switching_cycles(adc);
        for (uint32_t n = 0; n < injected_length(device); ++n) {
            halves += halves_of(device, injected_channel(device, n));
        }
    }
    return halves * adc->divider / 2;
}

/* Passes over the rounds of which nothing is left to see; the last one is made. */
static void skip_rounds(struct device *device, uint64_t until)
{
    struct adc *adc = device->state;
    const uint64_t round = round_cycles(device);
    const uint64_t behind = (uint64_t)((__uint128_t)(until - adc->end_ns) * adc->hz / NS_PER_S);
    if (behind > 2 * round) {
        adc->cycles += (behind / round - 1) * round;
        adc->has_sample = false;
        const uint64_t end = adc->cycles;
        adc->end_ns = run_ns(adc);
        adc->cycles -= CONVERTING_HALVES * (uint64_t)adc->divider / 2;
        adc->sample_ns = run_ns(adc);
        adc->cycles = end;
    }
}

/* Makes the conversions that have ended by a time. */
static void settle(struct device *device, uint64_t until)
{
    struct adc *adc = device->state;
    if (adc->is_stopped) {
        return;
    }
    if (adc->calibrated_ns <= until) {
        adc->calibrated_ns = NO_TIME;
        device->words[CR2] &= ~(uint32_t)(CAL | RSTCAL);
    }
    if (adc->end_ns > until) {
        return;
    }
    if (is_unseen(device)) {
        skip_rounds(device, until);
    }
    while (adc->end_ns <= until) {
        finish(device);
    }
    update_irq(device);
}

static void reschedule(struct device *device)
{
    const struct adc *adc = device->state;
    const uint64_t end = is_unseen(device) ? NO_TIME : adc->end_ns;
    schedule(device, adc->is_stopped ? NO_TIME : end < adc->calibrated_ns ? end : adc->calibrated_ns);
}

static void event(struct device *device, uint64_t ns)
{
    settle(device, ns);
    reschedule(device);
}

/* Triggers. */

static void start_regular(struct device *device, uint64_t ns, uint32_t delay)
{
    struct adc *adc = device->state;
    if (!(device->words[CR2] & ADON)) {
        return;
    }
    settle(device, ns);
    if (adc->state == REGULAR || adc->regular_waits) {
        return; /* chosen: a trigger while the group is converted is ignored */
    }
    const uint32_t length = regular_length(device), at_once = (device->words[CR1] >> DISCNUM_AT & 7) + 1;
    const bool is_in_parts = device->words[CR1] & DISCEN;
    adc->regular_at = is_in_parts && adc->regular_at < length ? adc->regular_at : 0;
    adc->regular_left = is_in_parts && at_once < length - adc->regular_at ? at_once : length - adc->regular_at;
    if (adc->state == INJECTED) {
        adc->regular_waits = true;
        device->words[SR] |= STRT;
    } else {
        begin_at(device, REGULAR, ns, delay);
    }
    reschedule(device);
}

static void start_injected(struct device *device, uint64_t ns)
{
    struct adc *adc = device->state;
    if (!(device->words[CR2] & ADON)) {
        return;
    }
    settle(device, ns);
    if (adc->state == INJECTED || device->words[CR1] & JAUTO) {
        return; /* chosen, as above; with JAUTO the triggers must be off (RM0008 11.3.9) */
    }
    const uint32_t length = injected_length(device);
    const bool is_in_parts = device->words[CR1] & JDISCEN;
    adc->regular_waits |= adc->state == REGULAR; /* what was under way is reset, and made anew behind it */
    adc->injected_at = is_in_parts && adc->injected_at < length ? adc->injected_at : 0;
    adc->injected_left = is_in_parts ? 1 : length;
    begin_at(device, INJECTED, ns, 0);
    reschedule(device);
}

static void trigger_regular(struct device *device, uint64_t ns)
{
    const uint32_t mode = is_master(device) ? dual_mode(device) : 0;
    if (mode & (WITH_REGULAR | FAST | SLOW)) {
        start_regular(other_of(device), ns, 0);
    }
    start_regular(device, ns, mode & FAST ? FAST_DELAY : mode & SLOW ? SLOW_DELAY : 0);
}

static void trigger_injected(struct device *device, uint64_t ns)
{
    struct adc *adc = device->state;
    const uint32_t mode = is_master(device) ? dual_mode(device) : 0;
    if (mode & ALTERNATE) {
        adc->turns ^= 1;
        start_injected(adc->turns ? device : other_of(device), ns);
        return;
    }
    if (mode & WITH_INJECTED) {
        start_injected(other_of(device), ns);
    }
    start_injected(device, ns);
}

/* Whether the master triggers this group of ADC2. */
static bool is_led(const struct device *device, bool is_injected)
{
    const uint32_t mode = is_master(device) ? 0 : dual_mode(device);
    return mode & (is_injected ? WITH_INJECTED | ALTERNATE : WITH_REGULAR | FAST | SLOW);
}

/* The inputs that a word of CR2 chooses and enables, one of each group at most. */
static uint32_t chosen(uint32_t control)
{
    const uint32_t regular = control >> EXTSEL_AT & 7, injected = control >> JEXTSEL_AT & 7;
    return (control & EXTTRIG && regular < TRIGGERS ? 1u << regular : 0) |
           (control & JEXTTRIG && injected < TRIGGERS ? 1u << (TRIGGERS + injected) : 0);
}

/* Whether the trigger of an input is chosen and enabled. */
static bool hears(const struct device *device, uint32_t input)
{
    const struct adc *adc = device->state;
    const bool is_other = input % TRIGGERS == BY_EXTI && adc->remapped >> (input / TRIGGERS) & 1; /* TIM8's, which is not there */
    return chosen(device->words[CR2]) >> input & 1 && !is_other;
}

static void line(struct device *device, uint32_t input, bool level)
{
    const bool is_injected = input >= TRIGGERS;
    if (!level || !hears(device, input) || is_led(device, is_injected)) {
        return;
    }
    if (is_injected) {
        trigger_injected(device, now_ns(device->fabric));
    } else {
        trigger_regular(device, now_ns(device->fabric));
    }
}

/* Registers. */

static void switch_off(struct device *device)
{
    struct adc *adc = device->state;
    stop(adc);
    adc->regular_at = adc->injected_at = adc->regular_waits = adc->is_automatic = adc->turns = 0;
    output_set(device, OUTPUT_DMA, false);
}

static void calibrate(struct device *device, uint32_t control, uint64_t now)
{
    struct adc *adc = device->state;
    const uint64_t cycles = (control & CAL ? CALIBRATION : 0) + (control & RSTCAL ? RESET_CALIBRATION : 0);
    adc->calibrated_ns = now + cycles * adc->divider * NS_PER_S / adc->hz;
    adc->ready_ns = adc->calibrated_ns > adc->ready_ns ? adc->calibrated_ns : adc->ready_ns;
    if (!(control & ADON)) {
        warn_once(device, CAL_OFF, 0);
    }
}

static void write_control(struct device *device, uint32_t written, uint32_t previous, uint64_t now)
{
    struct adc *adc = device->state;
    uint32_t *words = device->words;
    words[CR2] |= previous & (CAL | RSTCAL); /* only the hardware clears them */
    const uint32_t control = words[CR2], fresh = control & ~previous & (CAL | RSTCAL);
    if (fresh) {
        calibrate(device, control, now);
    }
    if (!(control & ADON)) {
        switch_off(device);
        return;
    }
    if (!(control & CR2_DMA)) {
        output_set(device, OUTPUT_DMA, false);
    }
    if (!(previous & ADON)) {
        const uint64_t stable = now + STABILIZATION_NS;
        adc->ready_ns = stable > adc->ready_ns ? stable : adc->ready_ns;
        return;
    }
    const bool is_started = (written & SWSTART && control & EXTTRIG && (control >> EXTSEL_AT & 7) == BY_SOFTWARE) ||
                            (control == previous && !(written & (SWSTART | JSWSTART)));
    if (is_started && !is_led(device, false)) {
        trigger_regular(device, now);
    }
    if (written & JSWSTART && control & JEXTTRIG && (control >> JEXTSEL_AT & 7) == BY_SOFTWARE &&
        !is_led(device, true)) {
        trigger_injected(device, now);
    }
}

/* A sequence that is changed while it is converted begins anew (RM0008 11.3.3). */
static void restart(struct device *device, uint32_t index, uint64_t now)
{
    struct adc *adc = device->state;
    if (index == JSQR && adc->state == INJECTED) {
        adc->injected_at = 0;
        adc->injected_left = device->words[CR1] & JDISCEN ? 1 : injected_length(device);
        begin_at(device, INJECTED, now, 0);
    } else if (index != JSQR && (adc->state == REGULAR || adc->regular_waits)) {
        const uint32_t length = regular_length(device), at_once = (device->words[CR1] >> DISCNUM_AT & 7) + 1;
        adc->regular_at = 0;
        adc->regular_left = device->words[CR1] & DISCEN && at_once < length ? at_once : length;
        if (adc->state == REGULAR) {
            begin_at(device, REGULAR, now, 0);
        }
    }
}

static void write(struct device *device, uint32_t index, uint32_t written, uint32_t previous)
{
    struct adc *adc = device->state;
    const uint64_t now = now_ns(device->fabric);
    const uint32_t stored = device->words[index];
    struct device *other = is_master(device) && index == CR1 ? other_of(device) : NULL;
    device->words[index] = previous; /* what was converted by now, was converted with it */
    settle(device, now);
    if (other != NULL) {
        settle(other, now);
    }
    device->words[index] = stored;
    if (index == CR2) {
        write_control(device, written, previous, now);
    } else if (other != NULL) {
        adc->turns = dual_modes[stored >> DUALMOD_AT & 15] == dual_modes[previous >> DUALMOD_AT & 15] ? adc->turns : 0;
        reschedule(other);
    } else if (index >= SQR1 && index <= JSQR && stored != previous) {
        restart(device, index, now);
    }
    update_irq(device);
    reschedule(device);
    if (index == CR2 && chosen(stored) != chosen(previous)) {
        hearing_changed(device);
    }
}

/* The one whose conversions this one's DR holds too, in its upper half; NULL where there is none. */
static struct device *second_of(const struct device *device, uint32_t index)
{
    return index == DR && is_master(device) && dual_mode(device) ? other_of(device) : NULL;
}

/* What a read finds, without what it causes. */
static uint32_t look(struct device *device, uint32_t index)
{
    if (is_unseen(device)) {
        settle(device, now_ns(device->fabric));
    }
    const struct device *second = second_of(device, index);
    return device->words[index] | (second == NULL ? 0 : second->words[DR] << 16);
}

static uint32_t read(struct device *device, uint32_t index)
{
    struct device *second = second_of(device, index);
    if (second != NULL) { /* whose conversion may have ended in this very nanosecond */
        settle(second, now_ns(device->fabric));
        reschedule(second);
    }
    const uint32_t found = look(device, index);
    if (index == DR) {
        device->words[SR] &= ~(uint32_t)EOC;
        update_irq(device);
        output_set(device, OUTPUT_DMA, false);
        reschedule(device);
    }
    return found;
}

static bool needs_time(const struct device *device, uint32_t index, bool is_write)
{
    return is_write || is_unseen(device) || (index == DR && dual_mode(device));
}

/* Samples what is due, with the volts of before. */
static void take_sample(struct device *device, uint64_t now)
{
    struct adc *adc = device->state;
    settle(device, now);
    if (adc->state != IDLE && !adc->is_stopped && !adc->has_sample && adc->sample_ns <= now) {
        adc->sample = convert(device, adc->channel, adc->sample_ns);
        adc->has_sample = true;
    }
}

/* Goes on from where the clock stood still. */
static void resume(struct adc *adc, uint64_t span)
{
    adc->is_stopped = false;
    adc->base_ns += span;
    adc->ready_ns += span;
    adc->sample_ns += span;
    adc->end_ns += adc->end_ns == NO_TIME ? 0 : span;
    adc->calibrated_ns += adc->calibrated_ns == NO_TIME ? 0 : span;
}

static uint32_t command(struct device *device, uint32_t what, uint32_t one, uint32_t other)
{
    struct adc *adc = device->state;
    const uint64_t now = now_ns(device->fabric);
    if (what == RESET) {
        *adc = (struct adc){.number = adc->number, .hz = adc->hz, .divider = adc->divider, .remapped = adc->remapped,
                            .end_ns = NO_TIME, .calibrated_ns = NO_TIME};
        output_set(device, OUTPUT_DMA, false);
        update_irq(device);
    } else if (what == CLOCK) { /* what is under way ends when it would have */
        settle(device, now);
        if (adc->state != IDLE && (one != adc->hz || other != adc->divider)) {
            adc->base_ns = adc->end_ns;
            adc->cycles = 0;
        }
        adc->hz = one;
        adc->divider = other;
    } else if (what == SETTLE) {
        return look(device, one);
    } else if (what == INPUTS_CHANGE) {
        take_sample(device, now);
    } else if (what == STOPPED) {
        take_sample(device, now);
        adc->is_stopped = true;
    } else if (what == RESUMED) {
        resume(adc, (uint64_t)other << 32 | one);
    }
    reschedule(device);
    return 0;
}

DEVICE_KIND(adc_kind) = {.name = "adc", .needs_time = needs_time, .read = read, .write = write,
                         .event = event, .hears = hears, .line = line, .command = command};
