/* A port: what its pins drive, what is on their wires and what their inputs read follows from who drives them.
 *
 * A pin has one driver inside (GPIO, an alternate function, or a fixed function that holds it) and one outside, hard
 * or through a resistor. A wire that is fought over is low, as in simbase/wire.py.
 * Source: RM0008 9.1, table 20.
 * Invariant: everything from `low` on in `struct port` follows from what stands before it.
 */
#include "fabric.h"
#include "waves.h"

/* Indices of `PinDrive`. */
enum { DRIVES_NOTHING, DRIVES_LOW, DRIVES_HIGH, PULLS_UP, PULLS_DOWN };

uint8_t drive_of(const struct port *port, uint32_t bit)
{
    return port->low & bit    ? DRIVES_LOW
           : port->high & bit ? DRIVES_HIGH
           : port->up & bit   ? PULLS_UP
           : port->down & bit ? PULLS_DOWN
                              : DRIVES_NOTHING;
}

uint8_t wire_of(const struct port *port, uint32_t bit)
{
    return port->floating & bit ? FLOATING : port->level & bit ? HIGH : LOW;
}

void work_out(struct port *port)
{
    const uint32_t free = ~port->held;
    const uint32_t offered = port->alternate & port->offered;
    port->high = ((((port->output & port->odr) | (offered & port->offered_high)) & ~port->open_drain & free) | port->hold_high);
    port->low = ((((port->output & ~port->odr) | (offered & ~port->offered_high)) & free) | port->hold_low);
    port->up = (port->pulled & port->odr & free) | port->hold_up;
    port->down = (port->pulled & ~port->odr & free) | port->hold_down;
    const uint32_t strong = port->low | port->high;
    const uint32_t hard = port->outside & ~port->outside_weak;
    const uint32_t driven = port->high & (~hard | port->outside_high);
    const uint32_t undriven = (port->outside & port->outside_high) |
                              (~port->outside & (port->up | (~port->down & port->board_up)));
    port->level = ((port->rail & port->rail_high) | (~port->rail & ((strong & driven) | (~strong & undriven)))) & ~port->bus_low;
    port->floating = 0xFFFF & ~(strong | port->up | port->down | port->outside | port->rail | port->board_up | port->board_down | port->bus_low);
    port->input = port->level & ((~port->analog & free) | port->hold_up | port->hold_down);
    port->fighting = ~port->rail & strong & hard & (port->high ^ port->outside_high);
    port->shorted = port->rail & strong & (port->high ^ port->rail_high);
}

void work_out_both(struct port *port, struct port *low, struct port *high)
{
    *low = *high = *port;
    low->offered_high &= ~port->shown;
    high->offered_high |= port->shown;
    work_out(low);
    work_out(high);
    port->fighting |= (low->fighting | high->fighting) & port->shown;
    port->shorted |= (low->shorted | high->shorted) & port->shown;
}

const struct wave *wave_of(const struct fabric *fabric, const struct port *port, uint32_t at)
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

void note_output(struct fabric *fabric)
{
    fabric->last_output = fabric->host.boundary != NULL ? *fabric->host.boundary : fabric->host.cycle(fabric->host.user);
    if (UNLIKELY(fabric->event_ns != NO_TIME)) {
        fabric->last_output = NO_TIME;
        fabric->last_output_ns = fabric->event_ns;
    }
}

void tell_listeners(struct fabric *fabric, uint32_t number, uint32_t changed)
{
    for (uint32_t n = 0; n < fabric->listener_count; ++n) {
        struct pin_listener *one = &fabric->listeners[n];
        if (changed & one->pins[number]) {
            one->device->kind->pins(one->device, number, changed & one->pins[number]);
        }
    }
}
