/* TIM1 and TIM2 to TIM4: what their registers do, and when.
 *
 * Theory of operation. Nothing counts by ticking. The counter is a ramp of ticks of CK_INT (`tim_counter.c`), outputs
 * are waves or levels (`tim_outputs.c`), inputs are edges (`tim_inputs.c`). `at` is the tick up to which everything is
 * worked out; `synchronize` brings it forward, over any number of laps at once where nobody sees what happens in them,
 * else from one stop to the next. The next stop is the device's event in the queue, so what is seen comes at its time.
 * What is seen: an interrupt, a request of DMA, TRGO and compare events that somebody hears, preload registers that wait
 * for their update event, a level that no wave shows, and flags of SR once the program looks for them: so a loop that
 * polls SR waits for an event, and a timer whose flags nobody reads costs nothing.
 * Pulses are given at the end, when the state is whole, since they may come back by a chain of timers.
 * Where the clock stands still (Stop, DBGMCU_CR), `ticks` begins at the end of all time: so each look finds the tick of
 * then, outputs are the levels of then, and what comes to inputs waits; only the break acts, which needs no clock.
 *
 * Source: RM0008 14.3, 14.4, 15.3, 15.4.
 * Invariant: words and struct are as of `at`, but for CNT, DIR and flags of SR, which are worked out when they are read.
 */
#include <string.h>

#include "tim.h"

/* Ticks are counted from here on, so that the base of a prescaler may lie before the first. */
#define FIRST_TICK (UINT64_C(1) << 32)
enum { LOCKED = 1 << 8, OIS = 0x7F00, LEVEL_1 = AOE | BKP | BKE | DTG, LEVEL_2 = OSSR | OSSI };

uint64_t tick_now(const struct device *device) { return tick_at(&tim_of(device)->ticks, now_ns(device->fabric)); }

void pulse(struct device *device, uint32_t output)
{
    if (is_heard(device, output)) {
        tim_of(device)->pulses |= 1u << output;
    }
}

void request(struct device *device, uint32_t output)
{
    struct tim *tim = tim_of(device);
    const uint32_t more = bits_of(device, DCR, 8, 31);
    if (more) {
        tim->burst_index = 0;
        tim->burst_left = more;
        tim->burst_output = output;
    }
    pulse(device, output);
}

static uint64_t next_stop(const struct device *device)
{
    const uint64_t late_at = tim_of(device)->late_at;
    const uint64_t first = earlier(earlier(next_count_stop(device), next_filter_stop(device)), next_output_stop(device));
    return late_at ? earlier(first, late_at) : first;
}

static void leap(struct device *device, uint64_t tick)
{
    struct tim *tim = tim_of(device);
    struct ramp *ramp = &tim->ramp;
    uint32_t happened = 0;
    if (ramp->runs && tick >= ramp->base + ramp->divider) {
        const uint64_t counts = (tick - ramp->base) / ramp->divider;
        happened = count_on(device, counts);
        ramp->base += counts * ramp->divider;
    }
    tim->at = tick;
    take_events(device, happened);
}

void synchronize(struct device *device, uint64_t tick)
{
    uint64_t stop;
    while ((stop = next_stop(device)) <= tick) {
        leap(device, stop);
        flip_filters(device);
        take_late_levels(device);
        refresh(device);
    }
    if (tick > tim_of(device)->at) {
        leap(device, tick);
    }
}

static void update_irqs(struct device *device)
{
    const uint32_t active = device->words[SR] & device->words[DIER] & INTERRUPTS;
    if (!tim_of(device)->is_advanced) {
        output_set(device, IRQ, active != 0);
        return;
    }
    output_set(device, BRK_IRQ, (active & BIF) != 0);
    output_set(device, UP_IRQ, (active & UIF) != 0);
    output_set(device, TRG_COM_IRQ, (active & (TIF | COMIF)) != 0);
    output_set(device, CC_IRQ, (active & CCIFS) != 0);
}

/* TRGO where it is a level. */
static bool trgo_level(const struct device *device)
{
    const uint32_t mode = master_mode(device);
    if (mode == MASTER_ENABLE) {
        return device->words[CR1] & CEN && (slave_mode(device) != SLAVE_GATED || tim_of(device)->trgi);
    }
    return mode >= MASTER_REFERENCE && reference(device, mode - MASTER_REFERENCE);
}

static void give_pulses(struct device *device)
{
    struct tim *tim = tim_of(device);
    const bool trgo = trgo_level(device);
    if (trgo != tim->trgo) {
        tim->trgo = trgo;
        output_set(device, TRGO, trgo);
    }
    while (tim->pulses) {
        const uint32_t output = (uint32_t)__builtin_ctz(tim->pulses);
        tim->pulses &= tim->pulses - 1;
        if (output != TRGO || !trgo) {
            output_set(device, output, true);
            output_set(device, output, false);
        }
    }
}

void refresh(struct device *device)
{
    struct tim *tim = tim_of(device);
    if (tim->is_busy) { /* what it puts out has come back, by a bus master say: the rest follows a tick later */
        tim->late_at = tim->at + 1;
        return;
    }
    tim->is_busy = true;
    show_outputs(device);
    update_irqs(device);
    give_pulses(device);
    tim->is_busy = false;
    const uint64_t stop = tim->is_stopped ? NO_TIME : next_stop(device);
    schedule(device, stop == NO_TIME ? NO_TIME : ns_of_tick(&tim->ticks, stop));
}

static void event(struct device *device, uint64_t ns)
{
    synchronize(device, tick_at(&tim_of(device)->ticks, ns));
    refresh(device);
}

/* Flags that rise without an event. */
static uint32_t lazy_flags(const struct device *device)
{
    uint32_t flags = UIF;
    for (uint32_t n = 0; n < CHANNELS; ++n) {
        flags |= is_input(device, n) ? 0 : CC1IF << n;
    }
    return flags & ~device->words[SR] & ~tim_of(device)->armed;
}

static uint32_t direction(const struct device *device, uint64_t tick)
{
    const struct ramp *ramp = &tim_of(device)->ramp;
    if (!ramp->mirrors || !ramp->runs || tick < ramp->base) {
        return ramp->falls ? DIR : 0;
    }
    const struct lap lap = lap_of(ramp);
    return (lap.phase + (tick - ramp->base) / ramp->divider) % lap.period >= ramp->top ? DIR : 0;
}

static uint32_t read_cr1(const struct device *device, uint64_t tick)
{
    return (device->words[CR1] & ~(uint32_t)DIR) | direction(device, tick);
}

static uint32_t burst(struct device *device, bool is_write, uint32_t word)
{
    struct tim *tim = tim_of(device);
    const uint32_t index = bits_of(device, DCR, 0, 31) + tim->burst_index;
    tim->burst_index = tim->burst_index < bits_of(device, DCR, 8, 31) ? tim->burst_index + 1 : 0;
    uint32_t answer = 0;
    if (index < DMAR && is_write) {
        bus_write(device, tim->base + 4 * index, 4, word);
    } else if (index < DMAR) {
        bus_read(device, tim->base + 4 * index, 4, &answer);
    }
    if (tim->burst_left) { /* the next transfer is asked for */
        --tim->burst_left;
        pulse(device, tim->burst_output);
    }
    refresh(device);
    return answer;
}

static bool needs_time(const struct device *device, uint32_t index, bool is_write)
{
    if (is_write) {
        return true;
    }
    return index == CNT || index == DMAR || (index == CR1 && tim_of(device)->ramp.mirrors) ||
           (index == SR && lazy_flags(device));
}

/* Whether a store changes a CCRx that waited for the update event already, and waits on: but for its word nothing does.
 * That event is one in the queue, so all that came before the store has been done.
 */
static bool waits_on(const struct device *device, uint32_t index, uint32_t before, uint32_t after)
{
    const struct tim *tim = tim_of(device);
    if (index < CCR1 || index > CCR4 || is_input(device, index - CCR1) || !is_preloaded(device, index - CCR1)) {
        return false;
    }
    const uint32_t active = tim->ccr[index - CCR1];
    return tim->ramp.runs && !tim->is_stopped && before != active && after != active;
}

static bool store_needs_time(const struct device *device, uint32_t index, uint32_t written)
{
    return !waits_on(device, index, device->words[index], written & 0xFFFF);
}

static uint32_t read(struct device *device, uint32_t index)
{
    struct tim *tim = tim_of(device);
    if (index == CNT) {
        return ramp_at(&tim->ramp, tick_now(device));
    }
    if (index == CR1) {
        return read_cr1(device, tim->ramp.mirrors ? tick_now(device) : 0);
    }
    if (index == SR) {
        if (lazy_flags(device)) {
            synchronize(device, tick_now(device));
            tim->armed |= lazy_flags(device);
            refresh(device);
        }
        return device->words[SR];
    }
    if (index == DMAR) {
        synchronize(device, tick_now(device));
        return burst(device, false, 0);
    }
    const uint32_t word = device->words[index]; /* CCRx */
    if (is_input(device, index - CCR1) && device->words[SR] & CC1IF << (index - CCR1)) {
        device->words[SR] &= ~(CC1IF << (index - CCR1));
        update_irqs(device);
    }
    return word;
}

/* What LOCK and the state of a channel keep from being changed (RM0008 14.4.18, LOCK; 14.4.7, CC1S). */
static uint32_t kept_bits(const struct device *device, uint32_t index)
{
    const uint32_t lock = tim_of(device)->lock & 3;
    uint32_t kept = 0;
    if (index == CR2) {
        return lock >= 1 ? OIS : 0;
    }
    if (index == BDTR) {
        const uint32_t levels = tim_of(device)->lock & LOCKED ? 3 << LOCK_AT : 0;
        return levels | (lock >= 1 ? LEVEL_1 : 0) | (lock >= 2 ? LEVEL_2 : 0);
    }
    for (uint32_t n = 0; n < CHANNELS; ++n) {
        const bool is_locked = !is_input(device, n);
        if (index == CCER) {
            kept |= lock >= 2 && is_locked ? 0xAu << 4 * n : 0;
        } else if (index == CCMR1 + n / 2) {
            const uint32_t selects = device->words[CCER] >> 4 * n & 1 ? 3 : 0;
            kept |= (selects | (lock >= 3 && is_locked ? 0x78u : 0)) << 8 * (n % 2);
        }
    }
    return kept;
}

static void generate(struct device *device, uint32_t events)
{
    for (uint32_t n = 0; n < CHANNELS; ++n) {
        if (events & CC1IF << n) {
            if (is_input(device, n)) {
                capture(device, n);
            } else {
                channel_event(device, n);
            }
        }
    }
    if (events & UIF) {
        reinitialize(device);
    }
    if (events & TIF) {
        trigger_event(device);
    }
    if (events & COMIF && tim_of(device)->is_advanced) {
        commutation_event(device);
    }
    if (events & BIF && tim_of(device)->is_advanced) {
        trigger_break(device);
    }
}

static void write_control(struct device *device, uint32_t previous)
{
    struct tim *tim = tim_of(device);
    const bool is_free = !(device->words[CR1] & CMS) && !is_encoder(device);
    const bool falls = is_free ? (device->words[CR1] & DIR) != 0 : tim->ramp.falls;
    (void)previous;
    if (!(device->words[CR1] & ARPE)) {
        tim->arr = device->words[ARR];
    }
    place(device, tim->ramp.value, falls);
    set_running(device);
    set_filters(device);
}

static void write_bdtr(struct device *device, uint32_t previous)
{
    struct tim *tim = tim_of(device);
    const uint32_t written = device->words[BDTR];
    if (!(tim->lock & LOCKED)) {
        tim->lock = LOCKED | (written >> LOCK_AT & 3);
    }
    device->words[BDTR] = (written & ~(uint32_t)MOE) | (previous & MOE);
    listen(device, false);
    set_moe(device, written & MOE && !is_break_active(device));
    if (is_break_active(device) != tim->in_break) {
        check_break(device);
    }
}

static void take(struct device *device, uint32_t index, uint32_t written, uint32_t previous)
{
    struct tim *tim = tim_of(device);
    uint32_t *words = device->words;
    switch (index) {
    case CR1: write_control(device, previous); break;
    case SMCR:
        place(device, tim->ramp.value, tim->ramp.falls);
        if (!is_encoder(device) && !(words[CR1] & CMS)) {
            words[CR1] = read_cr1(device, tim->at);
        }
        set_filters(device);
        break;
    case SR:
        words[SR] = previous & (written | ~(uint32_t)FLAGS);
        words[SR] |= tim->in_break ? BIF : 0;
        break;
    case EGR:
        words[EGR] = 0;
        generate(device, written);
        break;
    case CR2:
    case CCMR1:
    case CCMR2:
    case CCER:
        take_modes(device, false);
        set_filters(device);
        break;
    case CNT: place(device, written & 0xFFFF, tim->ramp.falls); break;
    case ARR:
        if (!(words[CR1] & ARPE)) {
            tim->arr = words[ARR];
            place(device, tim->ramp.value, tim->ramp.falls);
            set_running(device);
        }
        break;
    case BDTR: write_bdtr(device, previous); break;
    case DCR: tim->burst_index = tim->burst_left = 0; break;
    case DMAR: burst(device, true, written); break;
    default: break;
    }
    if (index >= CCR1 && index <= CCR4 && is_input(device, index - CCR1)) { /* read only */
        words[index] = previous;
    } else if (index >= CCR1 && index <= CCR4 && !is_preloaded(device, index - CCR1)) {
        tim->ccr[index - CCR1] = words[index];
    }
}

/* Whether a store to a CCRx changes its wave alone: nobody sees a match, the flag of one is up already, so that the
 * matches since the last look change nothing, and all stops are as they were.
 */
static bool changes_wave_alone(const struct device *device, uint32_t index)
{
    const struct tim *tim = tim_of(device);
    if (index < CCR1 || index > CCR4 || tim->is_advanced || tim->is_busy || tim->is_stopped || !tim->ramp.runs) {
        return false;
    }
    const uint32_t n = index - CCR1;
    return !is_input(device, n) && !is_preloaded(device, n) && mode_of(device, n) >= PWM1 && !tim->cleared &&
           tim->at >= tim->ramp.base && device->words[SR] & CC1IF << n && !sees_channel(device, n) &&
           due_ns(device) > now_ns(device->fabric);
}

static void write(struct device *device, uint32_t index, uint32_t written, uint32_t previous)
{
    uint32_t *words = device->words;
    if (waits_on(device, index, previous, words[index])) {
        return;
    }
    if (changes_wave_alone(device, index)) {
        show_duty(device, index - CCR1, words[index]);
        return;
    }
    const uint32_t stored = words[index], kept = kept_bits(device, index);
    words[index] = previous;
    synchronize(device, tick_now(device));
    note_references(device);
    previous = words[index];
    words[index] = (stored & ~kept) | (previous & kept);
    take(device, index, written, previous);
    if (index == CR2 || index == SMCR || index == CCMR1 || index == CCMR2 || index == CCER || index == BDTR) {
        listen(device, false);
        take_levels(device);
        look_at_trigger(device);
    }
    refresh(device);
}

/* A register as a read would find it now; nothing changes. */
static uint32_t settled(struct device *device, uint32_t index)
{
    struct tim *tim = tim_of(device);
    const uint64_t tick = tick_now(device);
    if (index == CNT) {
        return ramp_at(&tim->ramp, tick);
    }
    if (index == CR1) {
        return read_cr1(device, tick);
    }
    if (index != SR) {
        return device->words[index];
    }
    const struct tim before = *tim;
    uint32_t words[REGISTERS];
    memcpy(words, device->words, sizeof words);
    leap(device, tick);
    const uint32_t status = device->words[SR];
    *tim = before;
    memcpy(device->words, words, sizeof words);
    return status;
}

static void reset(struct device *device)
{
    struct tim *tim = tim_of(device);
    const struct tim was = *tim;
    memset(tim, 0, sizeof *tim);
    tim->ticks = (struct ticks){.ns = device->fabric->time.ns, .tick = FIRST_TICK, .hz = was.ticks.hz};
    tim->at = FIRST_TICK;
    tim->base = was.base;
    tim->is_advanced = was.is_advanced;
    tim->trgo = was.trgo;
    tim->itr = was.itr;
    tim->listening = was.listening;
    tim->hears = was.hears;
    memcpy(tim->pins, was.pins, sizeof tim->pins);
    memcpy(tim->sources, was.sources, sizeof tim->sources);
    tim->arr = device->words[ARR];
    tim->ramp = (struct ramp){.base = tim->at, .divider = 1, .top = tim->arr};
    set_filters(device);
    listen(device, false);
    look_at_trigger(device);
    forget_outputs(device);
    refresh(device);
}

/* Goes on with the same count at another speed, from where the core does. */
static void set_clock(struct device *device, uint32_t hz)
{
    struct tim *tim = tim_of(device);
    const struct fabric *fabric = device->fabric;
    const uint64_t now = now_ns(device->fabric), ns = now > fabric->time.ns ? now : fabric->time.ns;
    if (tim->ticks.hz) {
        synchronize(device, tick_at(&tim->ticks, ns));
    } else {
        tim->at = FIRST_TICK;
    }
    tim->ticks = (struct ticks){.ns = tim->is_stopped ? NO_TIME : ns, .hz = hz, .tick = tim->at};
    forget_outputs(device);
}

static void stop_clock(struct device *device)
{
    struct tim *tim = tim_of(device);
    synchronize(device, tick_now(device));
    tim->is_stopped = true;
    tim->ticks.ns = NO_TIME;
    tim->ticks.tick = tim->at;
}

/* Goes on with the tick that was under way, on the grid that all clocks have since the core's was last changed. */
static void resume_clock(struct device *device)
{
    struct tim *tim = tim_of(device);
    const struct fabric *fabric = device->fabric;
    if (!tim->is_stopped) {
        return;
    }
    const struct ticks grid = {.ns = fabric->time.ns, .hz = tim->ticks.hz};
    tim->is_stopped = false;
    tim->ticks.ns = grid.ns;
    tim->ticks.tick = tim->at - tick_at(&grid, now_ns(device->fabric));
    take_what_waits(device);
}

static uint32_t command(struct device *device, uint32_t what, uint32_t one, uint32_t other)
{
    struct tim *tim = tim_of(device);
    switch (what) {
    case SETTLE: return settled(device, one);
    case RESET: reset(device); return 0;
    case CLOCK: set_clock(device, one); break;
    case STOPPED: stop_clock(device); break;
    case RESUMED: resume_clock(device); break;
    case MOVE:
        if (tim->pins[one] != other && one < PIN_ETR) {
            offer(device->fabric, tim->pins[one], tim->sources[one], FLOATING);
            tim->outputs[one].kind = SHOWS_UNKNOWN;
        }
        tim->pins[one] = (uint8_t)other;
        return 0;
    case ROUTE: /* the levels of the other pins are taken as they are */
        synchronize(device, tick_now(device));
        tim->listening = 0;
        listen(device, false);
        check_break(device);
        break;
    case HEARD:
        if (!tim->ramp.runs) {
            return 0; /* nothing comes by itself */
        }
        synchronize(device, tick_now(device));
        break;
    case RESUME: listen(device, true); return 0;
    case INTRODUCE: add_counter(device->fabric, tim->base + 4 * CNT, &tim->ramp, &tim->ticks); return 0;
    default: return 0;
    }
    refresh(device);
    return 0;
}

DEVICE_KIND(tim_kind) = {.name = "tim", .needs_time = needs_time, .store_needs_time = store_needs_time, .read = read, .write = write, .event = event,
                         .hears = hears_line, .line = take_line, .pins = take_pins, .command = command};
