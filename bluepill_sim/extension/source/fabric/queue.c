/* The queue of events: when each device next acts by itself, in nanoseconds, and the first of these times in cycles.
 *
 * Invariant: an event is acted on at the first block boundary at or after its time, before the core goes on; those of
 * one time in the order of their slots.
 */
#include "fabric.h"

static uint64_t cycle_at(const struct fabric *fabric, uint64_t ns)
{
    const struct time_base *time = &fabric->time;
    if (ns == NO_TIME) {
        return NO_TIME;
    }
    if (ns <= time->ns) {
        const __uint128_t back = (__uint128_t)(time->ns - ns) * time->hz / NS_PER_S;
        return back > time->cycle ? 0 : time->cycle - (uint64_t)back;
    }
    const uint64_t span = ns - time->ns, seconds = span / NS_PER_S;
    if (seconds > NO_TIME / 8 / time->hz) {
        return NO_TIME / 4;
    }
    return time->cycle + seconds * time->hz + (span % NS_PER_S * time->hz + NS_PER_S - 1) / NS_PER_S;
}

static void find_first(struct fabric *fabric)
{
    uint64_t first = NO_TIME;
    for (uint32_t n = 0; n < fabric->slot_count; ++n) {
        if (fabric->slots[n].cycle < first) {
            first = fabric->slots[n].cycle;
        }
    }
    fabric->next_cycle = first;
}

void fabric_schedule(struct fabric *fabric, uint32_t number, uint64_t ns)
{
    struct slot *slot = &fabric->slots[number];
    const uint64_t before = slot->cycle;
    if (slot->ns == ns) {
        return;
    }
    slot->ns = ns;
    slot->cycle = cycle_at(fabric, ns);
    if (slot->cycle <= fabric->next_cycle) {
        fabric->next_cycle = slot->cycle;
    } else if (before == fabric->next_cycle && fabric->event_ns == NO_TIME) { /* else once, behind the events */
        find_first(fabric);
    }
    if (fabric->event_ns == NO_TIME && slot->cycle != NO_TIME) {
        fabric->host.due(fabric->host.user, slot->cycle);
    }
}

void schedule(struct device *device, uint64_t ns) { fabric_schedule(device->fabric, device->slot, ns); }

uint64_t fabric_due(const struct fabric *fabric, uint32_t number) { return fabric->slots[number].ns; }

/* The first time of all; NO_TIME for none. */
uint64_t fabric_next_ns(const struct fabric *fabric)
{
    uint64_t first = NO_TIME;
    for (uint32_t n = 0; n < fabric->slot_count; ++n) {
        if (fabric->slots[n].ns < first) {
            first = fabric->slots[n].ns;
        }
    }
    return first;
}

uint64_t quiet_ns(const struct device *device)
{
    const struct fabric *fabric = device->fabric;
    const uint64_t cycle = fabric->host.asleep_until == NULL ? 0 : fabric->host.asleep_until(fabric->host.user);
    uint64_t first = cycle > fabric->time.cycle ? ns_of(fabric, cycle) : 0;
    for (uint32_t n = 0; n < fabric->slot_count; ++n) {
        if (n != device->slot && fabric->slots[n].ns < first) {
            first = fabric->slots[n].ns;
        }
    }
    return first;
}

static void act(struct fabric *fabric, struct slot *slot)
{
    struct device *device = slot->device;
    slot->is_acting = 1;
    if (device == NULL || device->kind->event == NULL) {
        fabric->calls.event((uint32_t)(slot - fabric->slots), slot->ns);
    } else {
        device->kind->event(device, slot->ns);
    }
    slot->is_acting = 0;
}

void run_events(struct fabric *fabric, uint64_t until_ns)
{
    const uint64_t before = fabric->event_ns;
    uint64_t due;
    while ((due = fabric_next_ns(fabric)) != NO_TIME && due <= until_ns) {
        fabric->event_ns = due;
        for (uint32_t n = 0; n < fabric->slot_count; ++n) {
            if (fabric->slots[n].ns == due && !fabric->slots[n].is_acting) {
                act(fabric, &fabric->slots[n]);
                if (fabric->slots[n].ns <= due) { /* what has acted is done; Python checks its own */
                    fabric_schedule(fabric, n, NO_TIME);
                }
            }
        }
    }
    fabric->event_ns = before;
    find_first(fabric);
}

void fabric_run_events(struct fabric *fabric, uint64_t until_ns) { run_events(fabric, until_ns); }

/* Brings one device to a time: before an access, a register never reads older than the instruction that asks. */
void fabric_catch_up(struct fabric *fabric, uint32_t number, uint64_t until_ns)
{
    struct slot *slot = &fabric->slots[number];
    while (slot->ns != NO_TIME && slot->ns <= until_ns && !slot->is_acting) { /* its own event may reach its own registers by the bus */
        const uint64_t before = fabric->event_ns, due = slot->ns;
        fabric->event_ns = due;
        act(fabric, slot);
        if (slot->ns <= due) {
            fabric_schedule(fabric, number, NO_TIME);
        }
        fabric->event_ns = before;
        find_first(fabric);
    }
}

/* When the chip last changed what it drives, in ns; 0 for never. */
uint64_t fabric_last_output(const struct fabric *fabric)
{
    return fabric->last_output == NO_TIME ? fabric->last_output_ns : ns_of(fabric, fabric->last_output);
}

void fabric_forget_output(struct fabric *fabric)
{
    fabric->last_output = NO_TIME;
    fabric->last_output_ns = 0;
}

void fabric_set_time(struct fabric *fabric, uint64_t ns, uint64_t cycle, uint32_t hz)
{
    fabric->last_output_ns = fabric_last_output(fabric);
    fabric->last_output = NO_TIME;
    fabric->time = (struct time_base){ns, cycle, hz};
    for (uint32_t n = 0; n < fabric->slot_count; ++n) {
        fabric->slots[n].cycle = cycle_at(fabric, fabric->slots[n].ns);
    }
    find_first(fabric);
}
