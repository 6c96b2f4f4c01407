/* Waves: a pin that goes up and down by itself, as arithmetic.
 *
 * Theory of operation. An alternate function offers a wave in place of a level. Its time is counted in ticks of the clock of
 * who makes it, tied to nanoseconds where the core's clock was last changed: then a period is a whole number (20 kHz of
 * 72 MHz: 3600), an edge is where a count of that clock puts it, and nothing is accumulated. Whoever makes the wave sets
 * it anew when its clock changes.
 * What a pin shows is worked out for both levels of the wave (`shown`); a level at a time is one division. Edges are made
 *   - at their time, by the queue, for devices that listen to the pin and subscribers whose slice they end;
 *   - in bulk, when rows are put or taken, for all other subscribers but those that take waves as they are.
 * Nobody listens, nothing is spent.
 *
 * Invariant: a port's struct has pins that show a wave as of the last edge that was made at its time; whoever wants them
 * as they are now asks `port_input` or `fabric_look`.
 */
#include <string.h>

#include "fabric.h"

enum { EDGE_ROW, WAVE_ROW };

static struct ticks ticks_of(const struct wave *wave) { return (struct ticks){.ns = wave->ns, .hz = wave->hz}; }

static uint64_t wave_tick(const struct wave *wave, uint64_t ns)
{
    const struct ticks ticks = ticks_of(wave);
    return tick_at(&ticks, ns);
}

static uint64_t wave_ns(const struct wave *wave, uint64_t tick)
{
    const struct ticks ticks = ticks_of(wave);
    return ns_of_tick(&ticks, tick);
}

static uint64_t position(const struct wave *wave, uint64_t tick) { return (wave->at + tick) % wave->period; }

static bool wave_level(const struct wave *wave, uint64_t ns) { return position(wave, wave_tick(wave, ns)) < wave->high; }

/* The tick of the first edge after a tick. */
static uint64_t next_edge(const struct wave *wave, uint64_t tick)
{
    const uint64_t at = position(wave, tick);
    return tick + (at < wave->high ? wave->high : wave->period) - at;
}

static uint64_t next_edge_ns(const struct wave *wave, uint64_t ns)
{
    return wave_ns(wave, next_edge(wave, wave_tick(wave, ns)));
}

/* The wave that drives a pin which shows one. */
static const struct wave *wave_of(const struct fabric *fabric, const struct port *port, uint32_t at)
{
    return &fabric->waves[__builtin_ctzll(port->sources[at])];
}

void sample_waves(const struct fabric *fabric, struct port *port, uint32_t pins, uint64_t ns)
{
    for (uint32_t left = pins; left; left &= left - 1) {
        const uint32_t bit = left & -left;
        const bool level = wave_level(wave_of(fabric, port, (uint32_t)__builtin_ctz(left)), ns);
        port->offered_high = level ? port->offered_high | bit : port->offered_high & ~bit;
    }
}

uint32_t port_input(struct fabric *fabric, uint32_t number)
{
    const struct port *port = port_now(fabric, number);
    if (!port->shown) {
        return port->input;
    }
    struct port now = *port;
    sample_waves(fabric, &now, now.shown, now_ns(fabric));
    work_out(&now);
    return now.input;
}

/* A port as it is now. */
void fabric_look(struct fabric *fabric, uint32_t number, struct port *now)
{
    *now = fabric->ports[number];
    sample_waves(fabric, now, now->shown, now_ns(fabric));
    work_out(now);
}

/* Works a port out for both levels of its waves; what is electrically wrong in one of them is wrong. */
static void work_out_both(struct port *port, struct port *low, struct port *high)
{
    *low = *high = *port;
    low->offered_high &= ~port->shown;
    high->offered_high |= port->shown;
    work_out(low);
    work_out(high);
    port->fighting |= (low->fighting | high->fighting) & port->shown;
    port->shorted |= (low->shorted | high->shorted) & port->shown;
}

static bool wants(const struct subscriber *subscriber, const struct shown *shown, uint32_t pin)
{
    const uint32_t bit = 1u << pin % PINS;
    return (subscriber->drive[pin / PINS] & bit && shown->drive[0] != shown->drive[1]) ||
           (subscriber->wire[pin / PINS] & bit && shown->wire[0] != shown->wire[1]);
}

static bool has_subscribed(const struct subscriber *subscriber, uint32_t pin)
{
    return (subscriber->drive[pin / PINS] | subscriber->wire[pin / PINS]) >> pin % PINS & 1;
}

/* The next time at which edges must be made. */
static void schedule_edges(struct fabric *fabric)
{
    uint64_t due = NO_TIME;
    for (uint32_t number = 0; number < PORTS; ++number) {
        for (uint32_t left = fabric->ports[number].shown; left; left &= left - 1) {
            const struct shown *one = &fabric->shown[PINS * number + (uint32_t)__builtin_ctz(left)];
            due = one->is_made && one->next_ns < due ? one->next_ns : due;
        }
    }
    for (uint32_t n = 0; n < fabric->subscribers_end; ++n) { /* before more rows wait than may */
        const struct subscriber *one = &fabric->subscribers[n];
        uint64_t edges_a_second = 0;
        for (uint32_t k = 0; k < one->expanded_count; ++k) {
            const struct wave *wave = &fabric->shown[one->expanded[k].pin].wave;
            edges_a_second += 2 * (wave->hz / wave->period + 1);
        }
        if (edges_a_second) {
            const uint64_t full = one->expanded_ns + MOST_ROWS * NS_PER_S / edges_a_second + 1;
            due = full < due ? full : due;
        }
    }
    schedule(&fabric->devices[0], due);
}

void make_edges_where_wanted(struct fabric *fabric)
{
    for (uint32_t number = 0; number < PORTS; ++number) {
        struct port *port = &fabric->ports[number];
        uint32_t wanted = fabric->listened[number];
        for (uint32_t n = 0; port->shown && n < fabric->subscribers_end; ++n) {
            const struct subscriber *one = &fabric->subscribers[n];
            wanted |= one->stop[number] & (one->drive[number] | one->wire[number]);
        }
        for (uint32_t left = port->shown; left; left &= left - 1) {
            const uint32_t at = (uint32_t)__builtin_ctz(left);
            struct shown *one = &fabric->shown[PINS * number + at];
            const bool was_made = one->is_made;
            one->is_made = one->is_wave && wanted >> at & 1; /* a state that is being put back is not shown yet */
            if (one->is_made && !was_made) {
                struct port low, high;
                const uint64_t ns = now_ns(fabric);
                one->next_ns = next_edge_ns(&one->wave, ns);
                sample_waves(fabric, port, 1u << at, ns);
                work_out(port);
                work_out_both(port, &low, &high);
            }
        }
    }
    schedule_edges(fabric);
}

static void expand(struct fabric *fabric, struct subscriber *subscriber, uint32_t pin, uint64_t ns)
{
    const struct shown *shown = &fabric->shown[pin];
    if (!subscriber->expanded_count) {
        subscriber->expanded_ns = ns;
    }
    struct expanded *one = &subscriber->expanded[subscriber->expanded_count++];
    const uint64_t tick = wave_tick(&shown->wave, ns);
    one->pin = (uint8_t)pin;
    one->level = position(&shown->wave, tick) < shown->wave.high;
    one->tick = next_edge(&shown->wave, tick);
    one->next_ns = wave_ns(&shown->wave, one->tick);
}

static RARELY void make_rows(struct fabric *fabric, struct subscriber *subscriber, uint64_t until_ns)
{
    for (;;) {
        struct expanded *first = &subscriber->expanded[0];
        for (uint32_t n = 1; n < subscriber->expanded_count; ++n) {
            struct expanded *one = &subscriber->expanded[n];
            if (one->next_ns < first->next_ns || (one->next_ns == first->next_ns && one->pin < first->pin)) {
                first = one;
            }
        }
        if (first->next_ns > until_ns) {
            break;
        }
        const struct shown *shown = &fabric->shown[first->pin];
        const struct wave *wave = &shown->wave;
        first->level ^= 1;
        const struct edge row = {.ns = first->next_ns, .pin = first->pin, .drive = shown->drive[first->level],
                                 .wire = shown->wire[first->level]};
        first->tick += first->level ? wave->high : wave->period - wave->high;
        first->next_ns = wave_ns(wave, first->tick);
        put_row(fabric, subscriber, &row);
    }
    if (subscriber->expanded_ns < until_ns) {
        subscriber->expanded_ns = until_ns;
    }
}

void expand_waves(struct fabric *fabric, struct subscriber *subscriber, uint64_t until_ns)
{
    if (UNLIKELY(subscriber->expanded_count)) {
        make_rows(fabric, subscriber, until_ns);
    }
}

uint64_t settled_ns(struct fabric *fabric)
{
    const uint64_t now = now_ns(fabric), due = fabric_next_ns(fabric);
    return due <= now && due ? due - 1 : now;
}

static void put_wave(struct fabric *fabric, struct subscriber *subscriber, uint32_t pin, uint64_t ns)
{
    const struct shown *shown = &fabric->shown[pin];
    struct edge rows[1 + sizeof shown->wave / sizeof(struct edge)];
    rows[0] = (struct edge){.ns = ns, .pin = (uint8_t)pin, .drive = (uint8_t)(shown->drive[0] | shown->drive[1] << 4),
                              .wire = (uint8_t)(shown->wire[0] | shown->wire[1] << 4), .kind = WAVE_ROW};
    memcpy(&rows[1], &shown->wave, sizeof shown->wave);
    put_rows(fabric, subscriber, rows, sizeof rows / sizeof *rows);
}

/* Tells a subscriber what a pin shows from now on; `told` is what it has shown up to now. */
static void tell(struct fabric *fabric, struct subscriber *subscriber, uint32_t pin, const struct edge *told)
{
    const struct shown *shown = &fabric->shown[pin];
    const uint64_t ns = told->ns;
    if (subscriber->takes_waves && shown->is_wave) {
        put_wave(fabric, subscriber, pin, ns);
        return;
    }
    const bool level = shown->is_wave && wave_level(&shown->wave, ns);
    const struct edge row = {.ns = ns, .pin = (uint8_t)pin, .drive = shown->drive[level], .wire = shown->wire[level]};
    const uint32_t bit = 1u << pin % PINS;
    if (subscriber->takes_waves || (subscriber->drive[pin / PINS] & bit && row.drive != told->drive) ||
        (subscriber->wire[pin / PINS] & bit && row.wire != told->wire)) {
        put_row(fabric, subscriber, &row);
    }
    if (shown->is_wave && wants(subscriber, shown, pin)) {
        expand(fabric, subscriber, pin, ns);
    }
}

/* Takes an entry away; returns the level that the wave had there. */
static bool stop_expanding(struct subscriber *subscriber, uint32_t pin)
{
    for (uint32_t n = 0; n < subscriber->expanded_count; ++n) {
        if (subscriber->expanded[n].pin == pin) {
            const bool level = subscriber->expanded[n].level;
            subscriber->expanded[n] = subscriber->expanded[--subscriber->expanded_count];
            return level;
        }
    }
    return false;
}

static struct shown showing(const struct fabric *fabric, const struct port *port, const struct port *low,
                            const struct port *high, uint32_t at)
{
    const uint32_t bit = 1u << at;
    const bool is_wave = (port->shown & bit) != 0;
    struct shown shown;
    memset(&shown, 0, sizeof shown);
    shown.is_wave = is_wave;
    shown.drive[0] = drive_of(is_wave ? low : port, bit);
    shown.wire[0] = wire_of(is_wave ? low : port, bit);
    if (is_wave) {
        shown.wave = *wave_of(fabric, port, at);
        shown.drive[1] = drive_of(high, bit);
        shown.wire[1] = wire_of(high, bit);
    }
    return shown;
}

static bool is_same(const struct shown *one, const struct shown *other)
{
    return one->is_wave == other->is_wave && memcmp(one->drive, other->drive, sizeof one->drive) == 0 &&
           memcmp(one->wire, other->wire, sizeof one->wire) == 0 && memcmp(&one->wave, &other->wave, sizeof one->wave) == 0;
}

/* Makes the edges that subscribers have waiting of what is about to be another wave. */
static void expand_all(struct fabric *fabric, uint64_t ns)
{
    for (uint32_t n = 0; n < fabric->subscribers_end; ++n) {
        expand_waves(fabric, &fabric->subscribers[n], ns);
    }
}

/* Tells those who have subscribed to a pin what it shows from now on; up to now it was this at either level. */
static void tell_all(struct fabric *fabric, uint32_t pin, const uint8_t drive[2], const uint8_t wire[2], uint64_t ns)
{
    for (uint32_t n = 0; n < fabric->subscribers_end; ++n) {
        struct subscriber *one = &fabric->subscribers[n];
        if (has_subscribed(one, pin)) {
            const bool level = stop_expanding(one, pin);
            const struct edge told = {.ns = ns, .drive = drive[level], .wire = wire[level]};
            tell(fabric, one, pin, &told);
        }
    }
}

RARELY uint32_t show_waves(struct fabric *fabric, uint32_t number, const struct port *before)
{
    struct port *port = &fabric->ports[number], low, high;
    const uint64_t ns = now_ns(fabric);
    uint32_t changed = 0;
    work_out_both(port, &low, &high);
    for (uint32_t left = port->shown | before->shown; left; left &= left - 1) {
        const uint32_t at = (uint32_t)__builtin_ctz(left), pin = PINS * number + at;
        const struct shown is = showing(fabric, port, &low, &high, at);
        if (is_same(&fabric->shown[pin], &is)) {
            continue;
        }
        changed |= 1u << at;
        const struct shown was = fabric->shown[pin];
        const uint8_t drive = drive_of(before, 1u << at), wire = wire_of(before, 1u << at);
        const uint8_t drives[2] = {was.is_wave ? was.drive[0] : drive, was.is_wave ? was.drive[1] : drive};
        const uint8_t wires[2] = {was.is_wave ? was.wire[0] : wire, was.is_wave ? was.wire[1] : wire};
        expand_all(fabric, ns);
        fabric->shown[pin] = is;
        tell_all(fabric, pin, drives, wires, ns);
    }
    if (changed) {
        make_edges_where_wanted(fabric);
    }
    return changed;
}

void show_to(struct fabric *fabric, struct subscriber *subscriber)
{
    const uint64_t ns = now_ns(fabric);
    for (uint32_t pin = 0; pin < PORTS * PINS; ++pin) {
        const struct shown *shown = &fabric->shown[pin];
        if (shown->is_wave && has_subscribed(subscriber, pin)) {
            const bool level = wave_level(&shown->wave, ns);
            const struct edge told = {.ns = ns, .drive = shown->drive[level], .wire = shown->wire[level]};
            tell(fabric, subscriber, pin, &told);
        }
    }
    make_edges_where_wanted(fabric);
}

/* A state was put back: what the pins show follows from it. */
void fabric_resume(struct fabric *fabric)
{
    for (uint32_t n = 0; n < fabric->subscribers_end; ++n) {
        fabric->subscribers[n].expanded_count = 0;
    }
    const uint64_t ns = now_ns(fabric);
    for (uint32_t number = 0; number < PORTS; ++number) {
        struct port *port = &fabric->ports[number], low, high;
        sample_waves(fabric, port, port->shown, ns);
        work_out(port);
        work_out_both(port, &low, &high);
        for (uint32_t at = 0; at < PINS; ++at) {
            fabric->shown[PINS * number + at] = showing(fabric, port, &low, &high, at);
        }
    }
    for (uint32_t n = 0; n < fabric->subscribers_end; ++n) {
        show_to(fabric, &fabric->subscribers[n]);
    }
    make_edges_where_wanted(fabric);
}

/* Edges that are due at a time. */
static void event(struct device *device, uint64_t ns)
{
    struct fabric *fabric = device->fabric;
    for (uint32_t number = 0; number < PORTS; ++number) {
        struct port *port = &fabric->ports[number], low, high;
        uint32_t due = 0;
        for (uint32_t left = port->shown; left; left &= left - 1) {
            struct shown *one = &fabric->shown[PINS * number + (uint32_t)__builtin_ctz(left)];
            if (one->is_made && one->next_ns <= ns) {
                due |= left & -left;
                one->next_ns = next_edge_ns(&one->wave, ns);
            }
        }
        if (!due) {
            continue;
        }
        const uint32_t before = port->input;
        sample_waves(fabric, port, due, ns);
        work_out(port);
        work_out_both(port, &low, &high);
        if ((before ^ port->input) & fabric->listened[number]) {
            tell_listeners(fabric, number, before ^ port->input);
        }
        for (uint32_t n = 0; n < fabric->subscribers_end; ++n) {
            const struct subscriber *one = &fabric->subscribers[n];
            for (uint32_t left = due & one->stop[number]; left; left &= left - 1) {
                const uint32_t pin = PINS * number + (uint32_t)__builtin_ctz(left);
                if (wants(one, &fabric->shown[pin], pin)) {
                    fabric->wants_stop = 1;
                    fabric->host.end_slice(fabric->host.user);
                }
            }
        }
    }
    for (uint32_t n = 0; n < fabric->subscribers_end; ++n) {
        expand_waves(fabric, &fabric->subscribers[n], ns);
    }
    schedule_edges(fabric);
}

/* Has a pin that shows a wave, and goes on showing it, follow what has become of that; false: more than it may change. */
static bool follow_wave(struct fabric *fabric, uint32_t pin, uint32_t source, bool level, uint64_t now)
{
    struct port *port = &fabric->ports[pin / PINS];
    struct shown *shown = &fabric->shown[pin];
    const struct wave *wave = &fabric->waves[source];
    const uint32_t at = pin % PINS, bit = 1u << at;
    const uint64_t mask = UINT64_C(1) << source;
    if (!(port->shown & bit) || !shown->is_wave || shown->is_made || (port->sources[at] & -port->sources[at]) != mask ||
        (port->fighting | port->shorted) & bit || fabric->ahead.device != NULL) {
        return false;
    }
    port->source_levels[at] = level ? port->source_levels[at] | mask : port->source_levels[at] & ~mask;
    if (!(port->offered_high & bit) == level) {
        const uint32_t fighting = port->fighting & port->shown, shorted = port->shorted & port->shown;
        port->offered_high ^= bit;
        work_out(port);
        port->fighting |= fighting;
        port->shorted |= shorted;
    }
    if (shown->wave.high == wave->high && shown->wave.at == wave->at && memcmp(&shown->wave, wave, sizeof *wave) == 0) {
        return true;
    }
    note_output(fabric);
    expand_all(fabric, now);
    shown->wave = *wave;
    tell_all(fabric, pin, shown->drive, shown->wire, now);
    for (uint32_t n = 0; n < fabric->subscribers_end; ++n) {
        if (fabric->subscribers[n].expanded_count) {
            schedule_edges(fabric);
            break;
        }
    }
    return true;
}

bool wave_change(struct fabric *fabric, uint32_t pin, uint32_t source, const struct ticks *ticks, uint64_t high, uint64_t later)
{
    struct wave *wave = &fabric->waves[source];
    if (!wave->period || wave->pin != pin || wave->ns != ticks->ns || wave->hz != ticks->hz || wave->ns != fabric->time.ns) {
        return false;
    }
    const uint64_t now = now_ns(fabric);
    if (now < wave->ns || (wave->high == high && !later)) {
        return now >= wave->ns;
    }
    wave->high = high;
    wave->at = distance(later, wave->at, wave->period);
    const bool level = wave_level(wave, now);
    if (!follow_wave(fabric, pin, source, level, now)) {
        take_offer(fabric, pin, source, level);
    }
    return true;
}

void wave_set(struct fabric *fabric, uint32_t pin, uint32_t source, uint32_t hz, uint64_t period, uint64_t high,
              uint64_t at)
{
    struct wave *wave = &fabric->waves[source];
    if (wave->period && wave->pin != pin) {
        offer(fabric, wave->pin, source, FLOATING);
    }
    if (!high || high >= period) {
        offer(fabric, pin, source, high != 0);
        return;
    }
    const bool was_offered = wave->period != 0;
    const uint64_t now = now_ns(fabric), ns = now < fabric->time.ns ? now : fabric->time.ns;
    *wave = (struct wave){.ns = ns, .period = period, .high = high, .hz = hz, .pin = pin};
    at = within(at, period);
    wave->at = distance(wave_tick(wave, now) % period, at, period);
    if (!was_offered || !follow_wave(fabric, pin, source, at < high, now)) {
        take_offer(fabric, pin, source, at < high);
    }
}

void fabric_set_wave(struct fabric *fabric, uint32_t pin, uint32_t source, uint32_t hz, uint64_t period, uint64_t high,
                     uint64_t at)
{
    wave_set(fabric, pin, source, hz, period, high, at);
}

struct device_kind waves_kind = {.name = "waves", .event = event};
