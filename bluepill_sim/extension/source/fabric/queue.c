/* The queue of events: when each device next acts by itself, in nanoseconds, and the first of these times in cycles.
 *
 * Invariant: an event is acted on at the first block boundary at or after its time, before the core goes on; those of
 * one time in the order of their slots.
 */
#include "fabric.h"

/* The first cycle that begins at or after a time within the second that was worked out last. */
static uint64_t cycle_within(const struct time_base *time, uint64_t ns)
{
    return time->second_cycle + ((ns - time->second_ns) * time->hz + NS_PER_S - 1) / NS_PER_S;
}

uint64_t cycle_at(struct fabric *fabric, uint64_t ns)
{
    struct time_base *time = &fabric->time;
    if (ns - time->second_ns < NS_PER_S) {
        return cycle_within(time, ns);
    }
    if (ns == NO_TIME) {
        return NO_TIME;
    }
    if (ns <= time->ns) {
        const __uint128_t back = (__uint128_t)(time->ns - ns) * time->hz / NS_PER_S;
        return back > time->cycle ? 0 : time->cycle - (uint64_t)back;
    }
    const uint64_t seconds = (ns - time->ns) / NS_PER_S;
    if (seconds > time->most_s) {
        return NO_TIME / 4;
    }
    time->second_ns = time->ns + seconds * NS_PER_S;
    time->second_cycle = time->cycle + seconds * time->hz;
    return cycle_within(time, ns);
}

static void find_first(struct fabric *fabric)
{
    fabric->next_cycle = fabric->ordered ? fabric->slots[fabric->order[0]].cycle : NO_TIME;
}

/* Takes a slot out of the order, where its event was; and puts it where its event is. */
static void put_in_order(struct fabric *fabric, uint32_t number, uint64_t before)
{
    const struct slot *slots = fabric->slots;
    uint8_t *order = fabric->order;
    const uint64_t ns = slots[number].ns;
    uint32_t at = 0;
    if (fabric->ordered == 1 && order[0] == number && before != NO_TIME) {
        fabric->ordered = ns != NO_TIME;
        return;
    }
    if (before != NO_TIME) {
        while (order[at] != number) {
            ++at;
        }
        --fabric->ordered;
    } else {
        at = fabric->ordered;
    }
    for (; at < fabric->ordered && (slots[order[at + 1]].ns < ns || (slots[order[at + 1]].ns == ns && order[at + 1] < number)); ++at) {
        order[at] = order[at + 1];
    }
    if (ns == NO_TIME) {
        return; /* behind all: every other one came before it */
    }
    for (; at > 0 && (slots[order[at - 1]].ns > ns || (slots[order[at - 1]].ns == ns && order[at - 1] > number)); --at) {
        order[at] = order[at - 1];
    }
    order[at] = (uint8_t)number;
    ++fabric->ordered;
}

void fabric_schedule(struct fabric *fabric, uint32_t number, uint64_t ns)
{
    struct slot *slot = &fabric->slots[number];
    const uint64_t before = slot->ns;
    if (before == ns) {
        return;
    }
    slot->ns = ns;
    slot->cycle = cycle_at(fabric, ns);
    put_in_order(fabric, number, before);
    if (fabric->event_ns != NO_TIME) {
        return; /* the first one is found behind the events */
    }
    find_first(fabric);
    if (slot->cycle != NO_TIME) {
        fabric->host.due(fabric->host.user, slot->cycle);
    }
}

void schedule(struct device *device, uint64_t ns) { fabric_schedule(device->fabric, device->slot, ns); }

uint64_t fabric_due(const struct fabric *fabric, uint32_t number) { return fabric->slots[number].ns; }

/* The first time of all; NO_TIME for none. */
uint64_t fabric_next_ns(const struct fabric *fabric)
{
    return fabric->ordered ? fabric->slots[fabric->order[0]].ns : NO_TIME;
}

uint64_t settled_ns(struct fabric *fabric)
{
    const uint64_t now = now_ns(fabric), due = fabric_next_ns(fabric);
    return due <= now && due ? due - 1 : now;
}

uint64_t quiet_ns(const struct device *device)
{
    const struct fabric *fabric = device->fabric;
    const uint64_t cycle = fabric->host.asleep_until == NULL ? 0 : fabric->host.asleep_until(fabric->host.user);
    const uint64_t first = cycle > fabric->time.cycle ? ns_of(fabric, cycle) : 0;
    for (uint32_t n = 0; n < fabric->ordered; ++n) {
        if (fabric->order[n] != device->slot) {
            const uint64_t ns = fabric->slots[fabric->order[n]].ns;
            return ns < first ? ns : first;
        }
    }
    return first;
}

bool waits_for_python(const struct fabric *fabric, uint64_t cycle)
{
    for (uint32_t n = 0; n < fabric->ordered && fabric->slots[fabric->order[n]].cycle <= cycle; ++n) {
        if (fabric->slots[fabric->order[n]].event == NULL) {
            return true;
        }
    }
    return false;
}

static void act(struct fabric *fabric, struct slot *slot)
{
    slot->is_acting = 1;
    if (slot->event == NULL) {
        leave_ahead(fabric);
        fabric->calls.event((uint32_t)(slot - fabric->slots), slot->ns);
    } else {
        slot->event(slot->device, slot->ns);
    }
    slot->is_acting = 0;
}

/* The first slot from number `first` on that has its event at a time and does not act; SLOTS for none. */
static uint32_t due_from(const struct fabric *fabric, uint32_t first, uint64_t ns)
{
    for (uint32_t n = 0; n < fabric->ordered && fabric->slots[fabric->order[n]].ns <= ns; ++n) {
        const uint32_t number = fabric->order[n];
        if (number >= first && fabric->slots[number].ns == ns && !fabric->slots[number].is_acting) {
            return number;
        }
    }
    return SLOTS;
}

/* Acts on all events of the first time. */
static void act_on_first(struct fabric *fabric)
{
    const uint64_t due = fabric_next_ns(fabric);
    fabric->event_ns = due;
    for (uint32_t n = due_from(fabric, 0, due); n < SLOTS; n = due_from(fabric, n + 1, due)) {
        act(fabric, &fabric->slots[n]);
        if (fabric->slots[n].ns <= due) { /* what has acted is done; Python checks its own */
            fabric_schedule(fabric, n, NO_TIME);
        }
    }
}

void run_events(struct fabric *fabric, uint64_t until_ns)
{
    const uint64_t before = fabric->event_ns;
    while (fabric->ordered && fabric_next_ns(fabric) <= until_ns) {
        act_on_first(fabric);
    }
    fabric->event_ns = before;
    find_first(fabric);
}

void run_due(struct fabric *fabric, uint64_t cycle)
{
    const uint64_t before = fabric->event_ns;
    while (fabric->ordered && fabric->slots[fabric->order[0]].cycle <= cycle) {
        act_on_first(fabric);
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
    fabric->time = (struct time_base){ns, cycle, hz, NO_TIME / 8 / hz, ns, cycle, cycle, ns};
    for (uint32_t n = 0; n < fabric->ordered; ++n) {
        struct slot *slot = &fabric->slots[fabric->order[n]];
        slot->cycle = cycle_at(fabric, slot->ns);
    }
    find_first(fabric);
}
