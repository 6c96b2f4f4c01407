/* A device that runs ahead of its edges: those of a word that it sends follow from where the word began.
 *
 * Theory of operation. Such edges change nothing inside the chip while no device listens to their pins and no subscriber's
 * slice ends at them. So no event comes for each: the device waits for the end of its word alone, and its kind's `show`
 * makes all that are due at once, before anything looks at the port, changes it, or puts a row that is later. What the
 * pins show at either level is worked out once, when the word begins: a pin does not hang on the others of its port.
 * Who looks at the port, or changes it, and whatever calls Python ends it (`leave_ahead`): from then on the device has an
 * event for each edge. One device runs ahead at a time, so that rows come in order.
 *
 * Invariant: Python never runs, and no state is kept, while a device is ahead of its edges.
 */
#include "fabric.h"

/* Up to when events would have come: an event's own time, or the boundary. */
static uint64_t acted_ns(const struct fabric *fabric)
{
    return fabric->event_ns != NO_TIME ? fabric->event_ns : ns_of(fabric, *fabric->host.boundary);
}

void make_edges_ahead(struct fabric *fabric, bool is_left)
{
    struct device *device = fabric->ahead.device;
    if (is_left) {
        fabric->ahead.device = NULL;
    }
    device->kind->show(device, acted_ns(fabric));
}

static bool ends_slice(const struct fabric *fabric, uint32_t number, uint32_t pins)
{
    for (uint32_t n = 0; n < fabric->subscribers_end; ++n) {
        const struct subscriber *one = &fabric->subscribers[n];
        if (one->stop[number] & (one->drive[number] | one->wire[number]) & pins) {
            return true;
        }
    }
    return false;
}

bool run_ahead(struct device *device, uint32_t number, uint32_t pins)
{
    struct fabric *fabric = device->fabric;
    struct ahead *ahead = &fabric->ahead;
    const struct port *port = &fabric->ports[number];
    if (!fabric->may_run_ahead || ahead->device != NULL || fabric->listened[number] & pins || port->waving & pins ||
        ends_slice(fabric, number, pins)) {
        return false;
    }
    ahead->low = ahead->high = *port;
    ahead->low.offered_high &= ~pins;
    ahead->high.offered_high |= pins;
    work_out(&ahead->low);
    work_out(&ahead->high);
    const struct port *low = &ahead->low, *high = &ahead->high;
    if ((low->fighting | low->shorted | high->fighting | high->shorted) & pins) {
        return false;
    }
    ahead->device = device;
    ahead->number = number;
    ahead->pins = pins;
    ahead->drives = (low->low ^ high->low) | (low->high ^ high->high) | (low->up ^ high->up) | (low->down ^ high->down);
    ahead->wires = (low->level ^ high->level) | (low->floating ^ high->floating);
    ahead->boundary = fabric->event_ns == NO_TIME ? *fabric->host.boundary : NO_TIME;
    return true;
}

void put_ahead(struct fabric *fabric, uint32_t bit, bool level, uint64_t ns, bool is_first)
{
    const struct ahead *ahead = &fabric->ahead;
    const struct port *port = level ? &ahead->high : &ahead->low;
    const struct edge row = {.ns = ns, .pin = (uint8_t)(PINS * ahead->number + (uint32_t)__builtin_ctz(bit)),
                             .drive = drive_of(port, bit), .wire = wire_of(port, bit)};
    if (ahead->drives & bit) {
        fabric->last_output = is_first ? ahead->boundary : NO_TIME;
        fabric->last_output_ns = ns;
    }
    for (uint32_t n = 0; n < fabric->subscribers_end; ++n) {
        struct subscriber *one = &fabric->subscribers[n];
        if (bit & ((ahead->drives & one->drive[ahead->number]) | (ahead->wires & one->wire[ahead->number]))) {
            expand_waves(fabric, one, ns);
            put_row(fabric, one, &row);
        }
    }
}

static void take(uint32_t *to, uint32_t from, uint32_t bit) { *to = (*to & ~bit) | (from & bit); }

void come_to(struct fabric *fabric, uint32_t bit, uint32_t source, bool level)
{
    const struct ahead *ahead = &fabric->ahead;
    const struct port *is = level ? &ahead->high : &ahead->low;
    struct port *port = &fabric->ports[ahead->number];
    const uint32_t at = (uint32_t)__builtin_ctz(bit);
    const uint64_t mask = UINT64_C(1) << source;
    port->source_levels[at] = level ? port->source_levels[at] | mask : port->source_levels[at] & ~mask;
    if ((port->sources[at] & -port->sources[at]) == mask) { /* somebody may just have taken the pin */
        port->offered_high = level ? port->offered_high | bit : port->offered_high & ~bit;
    }
    take(&port->low, is->low, bit);
    take(&port->high, is->high, bit);
    take(&port->up, is->up, bit);
    take(&port->down, is->down, bit);
    take(&port->level, is->level, bit);
    take(&port->floating, is->floating, bit);
    take(&port->input, is->input, bit);
}
