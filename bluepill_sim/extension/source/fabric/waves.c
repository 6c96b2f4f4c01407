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
#include "waves.h"

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

void schedule_edges(struct fabric *fabric)
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

/* Tells a subscriber what a pin shows from now on; `before` is what it has shown up to now. */
static void tell(struct fabric *fabric, struct subscriber *subscriber, uint32_t pin, const struct edge *before)
{
    const struct shown *shown = &fabric->shown[pin];
    const uint64_t ns = before->ns;
    if (subscriber->takes_waves && shown->is_wave) {
        put_wave(fabric, subscriber, pin, ns);
        return;
    }
    const bool level = shown->is_wave && wave_level(&shown->wave, ns);
    const struct edge row = {.ns = ns, .pin = (uint8_t)pin, .drive = shown->drive[level], .wire = shown->wire[level]};
    const uint32_t bit = 1u << pin % PINS;
    if (subscriber->takes_waves || (subscriber->drive[pin / PINS] & bit && row.drive != before->drive) ||
        (subscriber->wire[pin / PINS] & bit && row.wire != before->wire)) {
        put_row(fabric, subscriber, &row);
    }
    if (shown->is_wave && wants(subscriber, shown, pin)) {
        expand(fabric, subscriber, pin, ns);
    }
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

void tell_all(struct fabric *fabric, uint32_t pin, const uint8_t drive[2], const uint8_t wire[2], uint64_t ns)
{
    for (uint32_t n = 0; n < fabric->subscribers_end; ++n) {
        struct subscriber *one = &fabric->subscribers[n];
        if (has_subscribed(one, pin)) {
            const bool level = stop_expanding(one, pin);
            const struct edge before = {.ns = ns, .drive = drive[level], .wire = wire[level]};
            tell(fabric, one, pin, &before);
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
            const struct edge before = {.ns = ns, .drive = shown->drive[level], .wire = shown->wire[level]};
            tell(fabric, subscriber, pin, &before);
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

struct device_kind waves_kind = {.name = "waves", .event = event};
