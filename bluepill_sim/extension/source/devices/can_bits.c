/* The bits of a frame on CAN's pins: levels of TX and RX, each at its time, so that nobody has to be asked for each; and
 * a frame that is tried again and again, each try as the one before: nobody acknowledges, and the error counters stand.
 *
 * What the bits are is worked out when a frame begins (`peripherals/can.py`); nothing in the chip follows from them.
 * Of tries Python says when it has seen that one leaves everything as the one before has. From then on a try changes
 * nothing but the time, until somebody acts on CAN (Python takes the tries back at their phase), or it loses its pin.
 * Invariant: the event of this device is due at the first row's time or that of the next phase, exactly while there is one.
 */
#include "../fabric/fabric.h"

/* Shows what is due, and comes back for the rest; shows the levels `one` (TX) and `other` (RX) now. */
enum { GO_ON = OWN_COMMANDS, SHOW };
/* Told to Python: what decides about the next try has changed. */
enum { CHANGED = OWN_ANSWERS };
/* What comes next of a try: its start, the time when the network decides it, its end. */
enum { IS_SINGLE, TO_START, TO_DECIDE, TO_END };

static void show(struct device *device, uint32_t tx, uint32_t rx)
{
    struct can_bits *bits = device->state;
    struct fabric *fabric = device->fabric;
    struct port *port = &fabric->ports[bits->rx_pin / PINS];
    const uint32_t bit = 1u << bits->rx_pin % PINS, held = rx ? port->bus_low & ~bit : port->bus_low | bit;
    if (tx != bits->tx) {
        bits->tx = tx;
        if (bits->is_offered) {
            offer(fabric, bits->tx_pin, bits->source, tx ? HIGH : LOW);
        }
    }
    if (held != port->bus_low) {
        port->bus_low = held;
        pins_changed(fabric, bits->rx_pin / PINS);
    }
}

/* Whether the bus has the transmitter on its pin. */
static bool is_wired(const struct fabric *fabric, const struct can_bits *bits)
{
    const struct port *port = &fabric->ports[bits->tx_pin / PINS];
    const uint32_t at = bits->tx_pin % PINS;
    const uint64_t sources = port->sources[at];
    return (port->alternate & ~port->held) >> at & 1 && (sources & -sources) == UINT64_C(1) << bits->source;
}

static uint64_t phase_ns(const struct can_bits *bits)
{
    switch (bits->phase) {
    case TO_START:
        return bits->start_ns;
    case TO_DECIDE:
        return bits->start_ns + bits->decided_ns;
    case TO_END:
        return bits->start_ns + bits->end_ns;
    default:
        return NO_TIME;
    }
}

static uint64_t row_ns(const struct can_bits *bits)
{
    return bits->first < bits->count ? bits->shown_ns + bits->rows[bits->first].ns : NO_TIME;
}

/* Has the bits of the try that begins shown, if somebody looks. */
static void begin_to_show(const struct fabric *fabric, struct can_bits *bits)
{
    if (fabric_is_watched(fabric, bits->tx_pin) || fabric_is_watched(fabric, bits->rx_pin)) {
        bits->shown_ns = bits->start_ns;
        bits->first = 0;
    }
}

static void next_phase(struct device *device)
{
    struct can_bits *bits = device->state;
    if (!is_wired(device->fabric, bits)) {
        ask_about(device, CHANGED);
        return;
    }
    if (bits->phase == TO_START) {
        begin_to_show(device->fabric, bits);
    } else if (bits->phase == TO_END) {
        bits->start_ns += bits->period_ns;
    }
    bits->phase = bits->phase == TO_END ? TO_START : bits->phase + 1;
}

static void event(struct device *device, uint64_t ns)
{
    struct can_bits *bits = device->state;
    if (phase_ns(bits) <= ns) {
        next_phase(device);
    }
    while (row_ns(bits) <= ns) {
        const struct edge *row = &bits->rows[bits->first++];
        show(device, row->drive, row->wire);
    }
    const uint64_t row = row_ns(bits), phase = phase_ns(bits);
    schedule(device, row < phase ? row : phase);
}

static uint32_t command(struct device *device, uint32_t what, uint32_t one, uint32_t other)
{
    if (what == GO_ON) {
        event(device, now_ns(device->fabric));
    } else if (what == SHOW) {
        show(device, one, other);
    }
    return 0;
}

DEVICE_KIND(can_bits_kind) = {.name = "can_bits", .event = event, .command = command};
