/* Inputs to come: levels that the outside puts on pins later, each at its time, so that nobody has to stop the chip for them.
 *
 * Rows of `struct edge`, oldest first: `drive` is what the outside then does, an index of `PinDrive` (never nothing).
 * Invariant: the event of this device is due at the first row's time, exactly while there is one.
 */
#include "fabric.h"

/* Indices of `PinDrive`. */
enum { OUTSIDE_HIGH = 2, OUTSIDE_PULLS_UP, OUTSIDE_PULLS_DOWN };

static struct edge *row_at(struct inputs *inputs, uint32_t n) { return &inputs->rows[(inputs->first + n) % LATER_INPUTS]; }

static void schedule_first(struct device *device)
{
    struct inputs *inputs = device->state;
    schedule(device, inputs->count ? row_at(inputs, 0)->ns : NO_TIME);
}

static void event(struct device *device, uint64_t ns)
{
    struct inputs *inputs = device->state;
    while (inputs->count && row_at(inputs, 0)->ns <= ns) {
        const struct edge row = *row_at(inputs, 0);
        struct port *port = &device->fabric->ports[row.pin / PINS];
        const uint32_t bit = 1u << row.pin % PINS;
        const bool is_high = row.drive == OUTSIDE_HIGH || row.drive == OUTSIDE_PULLS_UP;
        const bool is_weak = row.drive == OUTSIDE_PULLS_UP || row.drive == OUTSIDE_PULLS_DOWN;
        inputs->first = (inputs->first + 1) % LATER_INPUTS;
        --inputs->count;
        port->outside |= bit;
        port->outside_high = is_high ? port->outside_high | bit : port->outside_high & ~bit;
        port->outside_weak = is_weak ? port->outside_weak | bit : port->outside_weak & ~bit;
        pins_changed(device->fabric, row.pin / PINS);
    }
    schedule_first(device);
}

/* Takes rows in any order; one of the past comes now. False: there is no room, and none is taken. */
bool fabric_put_inputs(struct fabric *fabric, uint32_t slot, const struct edge *rows, uint32_t count)
{
    struct device *device = &fabric->devices[slot];
    struct inputs *inputs = device->state;
    const uint64_t now = now_ns(fabric);
    if (count > LATER_INPUTS - inputs->count) {
        return false;
    }
    for (uint32_t n = 0; n < count; ++n) {
        struct edge row = rows[n];
        row.ns = row.ns < now ? now : row.ns;
        uint32_t place = inputs->count++;
        for (; place && row_at(inputs, place - 1)->ns > row.ns; --place) {
            *row_at(inputs, place) = *row_at(inputs, place - 1);
        }
        *row_at(inputs, place) = row;
    }
    schedule_first(device);
    return true;
}

/* Goes on with rows that were put back. */
static uint32_t command(struct device *device, uint32_t what, uint32_t one, uint32_t other)
{
    (void)what;
    (void)one;
    (void)other;
    schedule_first(device);
    return 0;
}

DEVICE_KIND(inputs_kind) = {.name = "inputs", .event = event, .command = command};
