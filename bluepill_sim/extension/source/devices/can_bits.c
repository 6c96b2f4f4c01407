/* The bits of a frame on CAN's pins: levels of TX and RX, each at its time, so that nobody has to be asked for each.
 *
 * What they are is worked out when a frame begins (`peripherals/can.py`); nothing in the chip follows from them.
 * Invariant: the event of this device is due at the first row's time, exactly while there is one.
 */
#include "../fabric/fabric.h"

/* Shows what is due, and comes back for the rest; shows the levels `one` (TX) and `other` (RX) now. */
enum { GO_ON = OWN_COMMANDS, SHOW };

static void show(struct device *device, uint32_t tx, uint32_t rx)
{
    struct can_bits *bits = device->state;
    struct fabric *fabric = device->fabric;
    struct port *port = &fabric->ports[bits->rx_pin / PINS];
    const uint32_t bit = 1u << bits->rx_pin % PINS, held = rx ? port->bus_low & ~bit : port->bus_low | bit;
    bits->tx = tx;
    if (bits->is_offered) {
        offer(fabric, bits->tx_pin, bits->source, tx ? HIGH : LOW);
    }
    if (held != port->bus_low) {
        port->bus_low = held;
        pins_changed(fabric, bits->rx_pin / PINS);
    }
}

static void event(struct device *device, uint64_t ns)
{
    struct can_bits *bits = device->state;
    while (bits->first < bits->count && bits->rows[bits->first].ns <= ns) {
        const struct edge *row = &bits->rows[bits->first++];
        show(device, row->drive, row->wire);
    }
    schedule(device, bits->first < bits->count ? bits->rows[bits->first].ns : NO_TIME);
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
