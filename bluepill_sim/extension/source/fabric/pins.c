/* Pins: who has to know when the pins of a port change, how GPIO configures them, and who listens or is subscribed.
 *
 * `port.c` works out what they are.
 */
#include <stdlib.h>
#include <string.h>

#include "fabric.h"

enum { IS_FIGHTING, IS_SHORTED };

static RARELY void tell_subscribers(struct fabric *fabric, uint32_t number, uint32_t drives, uint32_t wires)
{
    const struct port *port = &fabric->ports[number];
    const uint64_t ns = now_ns(fabric);
    bool ends_slice = false;
    for (uint32_t n = 0; n < fabric->subscribers_end; ++n) {
        struct subscriber *one = &fabric->subscribers[n];
        const uint32_t wanted = (drives & one->drive[number]) | (wires & one->wire[number]);
        for (uint32_t left = wanted; left; left &= left - 1) {
            const uint32_t bit = left & -left;
            const struct edge row = {.ns = ns, .pin = (uint8_t)(PINS * number + (uint32_t)__builtin_ctz(left)),
                                     .drive = drive_of(port, bit), .wire = wire_of(port, bit)};
            expand_waves(fabric, one, ns);
            put_row(fabric, one, &row);
        }
        ends_slice |= (wanted & one->stop[number]) != 0;
    }
    if (ends_slice) {
        fabric->wants_stop = 1;
        fabric->host.end_slice(fabric->host.user);
    }
}

static RARELY void tell_trouble(struct fabric *fabric, uint32_t number, uint32_t pins, uint32_t what)
{
    leave_ahead(fabric);
    for (uint32_t left = pins; left; left &= left - 1) {
        fabric->calls.electrical(PINS * number + (uint32_t)__builtin_ctz(left), what);
    }
}

void pins_changed(struct fabric *fabric, uint32_t number)
{
    struct port *port = &fabric->ports[number];
    if (UNLIKELY(fabric->ahead.device != NULL)) {
        make_edges_ahead(fabric, fabric->ahead.number == number);
    }
    const struct port before = *port;
    port->shown = port->waving & port->alternate & ~port->held;
    const uint32_t waves = port->shown | before.shown;
    if (UNLIKELY(port->shown & ~before.shown)) {
        sample_waves(fabric, port, port->shown & ~before.shown, now_ns(fabric));
    }
    work_out(port);
    const uint32_t changed_waves = UNLIKELY(waves) ? show_waves(fabric, number, &before) : 0;
    const uint32_t inputs = before.input ^ port->input;
    const uint32_t drives = (before.low ^ port->low) | (before.high ^ port->high) | (before.up ^ port->up) |
                            (before.down ^ port->down);
    const uint32_t wires = (before.level ^ port->level) | (before.floating ^ port->floating);
    if ((drives & ~waves) | changed_waves) {
        note_output(fabric);
    }
    if (UNLIKELY((drives | wires) & ~waves & fabric->subscribed[number])) {
        tell_subscribers(fabric, number, drives & ~waves, wires & ~waves);
    }
    const uint32_t heard = inputs | (port->held & (before.level ^ port->level)); /* who holds a pin may listen to its wire */
    if (UNLIKELY(heard & fabric->listened[number])) {
        tell_listeners(fabric, number, heard);
    }
    if (UNLIKELY(port->fighting & ~before.fighting)) {
        tell_trouble(fabric, number, port->fighting & ~before.fighting, IS_FIGHTING);
    }
    if (UNLIKELY(port->shorted & ~before.shorted)) {
        tell_trouble(fabric, number, port->shorted & ~before.shorted, IS_SHORTED);
    }
}

void fabric_pins_changed(struct fabric *fabric, uint32_t number) { pins_changed(fabric, number); }

static void put_bit(uint32_t *word, uint32_t bit, bool is_set) { *word = is_set ? *word | bit : *word & ~bit; }

void configure_pin(struct fabric *fabric, uint32_t pin, uint32_t mode, bool is_high)
{
    struct port *port = &fabric->ports[pin / PINS];
    const uint32_t bit = 1u << pin % PINS;
    port->modes[pin % PINS] = (uint8_t)mode;
    put_bit(&port->odr, bit, is_high);
    put_bit(&port->output, bit, mode == PIN_PUSH_PULL || mode == PIN_OPEN_DRAIN);
    put_bit(&port->alternate, bit, mode == PIN_ALTERNATE || mode == PIN_ALTERNATE_OPEN_DRAIN);
    put_bit(&port->open_drain, bit, mode == PIN_OPEN_DRAIN || mode == PIN_ALTERNATE_OPEN_DRAIN);
    put_bit(&port->pulled, bit, mode == PIN_PULLED);
    put_bit(&port->analog, bit, mode == PIN_ANALOG);
    pins_changed(fabric, pin / PINS);
}

void fabric_configure_pin(struct fabric *fabric, uint32_t pin, uint32_t mode, bool is_high)
{
    configure_pin(fabric, pin, mode, is_high);
}

/* Has a device notified of changes of these pins' inputs, in place of those before. */
void listen_to_pins(struct device *device, uint32_t port, uint32_t pins)
{
    struct fabric *fabric = device->fabric;
    uint32_t n = 0;
    port_now(fabric, port);
    while (n < fabric->listener_count && fabric->listeners[n].device != device) {
        ++n;
    }
    if (n == fabric->listener_count && !pins) {
        return;
    }
    if (n == fabric->listener_count) {
        fabric->listeners[fabric->listener_count++].device = device;
    }
    fabric->listeners[n].pins[port] = pins;
    fabric->listened[port] = 0;
    for (n = 0; n < fabric->listener_count; ++n) {
        fabric->listened[port] |= fabric->listeners[n].pins[port];
    }
    make_edges_where_wanted(fabric);
}

/* Subscriptions. */

static void sum_up(struct fabric *fabric)
{
    fabric->subscribers_end = 0;
    for (uint32_t n = 0; n < SUBSCRIBERS; ++n) {
        fabric->subscribers_end = fabric->subscribers[n].is_used ? n + 1 : fabric->subscribers_end;
    }
    for (uint32_t port = 0; port < PORTS; ++port) {
        fabric->subscribed[port] = 0;
        for (uint32_t n = 0; n < SUBSCRIBERS; ++n) {
            fabric->subscribed[port] |= fabric->subscribers[n].drive[port] | fabric->subscribers[n].wire[port];
        }
    }
    fabric->watches_lines = 0;
    for (uint32_t word = 0; word < LINE_WORDS; ++word) {
        fabric->subscribed_lines[word] = 0;
        for (uint32_t n = 0; n < SUBSCRIBERS; ++n) {
            fabric->subscribed_lines[word] |= fabric->subscribers[n].lines[word];
        }
        fabric->watches_lines |= fabric->subscribed_lines[word] != 0;
    }
}

/* Subscribes to pins and lines, by masks; returns the subscriber's number, -1 where there is no room. */
int32_t fabric_subscribe(struct fabric *fabric, const uint32_t *drive, const uint32_t *wire, const uint32_t *stop,
                         const uint64_t *lines, bool takes_waves)
{
    for (int32_t n = 0; n < SUBSCRIBERS; ++n) {
        struct subscriber *one = &fabric->subscribers[n];
        if (!one->is_used) {
            one->is_used = 1;
            memcpy(one->drive, drive, sizeof one->drive);
            memcpy(one->wire, wire, sizeof one->wire);
            memcpy(one->stop, stop, sizeof one->stop);
            memcpy(one->lines, lines, sizeof one->lines);
            one->takes_waves = takes_waves;
            sum_up(fabric);
            show_to(fabric, one);
            return n;
        }
    }
    return -1;
}

/* Whether somebody is subscribed to a pin. */
bool fabric_is_watched(const struct fabric *fabric, uint32_t pin) { return fabric->subscribed[pin / PINS] >> pin % PINS & 1; }

void fabric_stop_at(struct fabric *fabric, uint32_t number, const uint32_t *stop)
{
    memcpy(fabric->subscribers[number].stop, stop, sizeof fabric->subscribers[number].stop);
    make_edges_where_wanted(fabric);
}

void fabric_unsubscribe(struct fabric *fabric, uint32_t number)
{
    struct subscriber *one = &fabric->subscribers[number];
    free(one->rows);
    *one = (struct subscriber){0};
    sum_up(fabric);
    make_edges_where_wanted(fabric);
}

size_t fabric_row_count(struct fabric *fabric, uint32_t number)
{
    expand_waves(fabric, &fabric->subscribers[number], settled_ns(fabric));
    return fabric->subscribers[number].count;
}
