/* The latency of interrupts, varied: each comes a drawn number of cycles later than it may, for who looks for races.
 *
 * What is put off is pending (NVIC_ISPR shows it, and may clear it), but is not taken before its time. The n-th draw hangs on
 * the seed and n alone, so that two runs are one until the first draw in which they differ. SVC, PendSV, faults and what a
 * program sets in NVIC_ISPR come as ever: the program itself says when.
 * Invariant: the event of this device is due at the earliest time of those that are held, exactly while there is one.
 */
#include "core.h"

/* The finaliser of SplitMix64 (Steele, Lea, Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014). */
static uint64_t mixed(uint64_t value)
{
    value = (value ^ value >> 30) * UINT64_C(0xBF58476D1CE4E5B9);
    value = (value ^ value >> 27) * UINT64_C(0x94D049BB133111EB);
    return value ^ value >> 31;
}

static uint64_t next_draw(struct latency *latency)
{
    const uint64_t n = latency->count++;
    if (n >= latency->until) {
        return n == latency->until ? latency->last : 0;
    }
    return mixed(latency->seed + (n + 1) * UINT64_C(0x9E3779B97F4A7C15)) % ((uint64_t)latency->most + 1);
}

static void schedule_first(struct core *core)
{
    const struct shared *s = &core->shared;
    uint64_t first = NO_TIME;
    for (uint32_t word = 0; word < 2; ++word) {
        for (uint64_t left = s->held[word]; left; left &= left - 1) {
            const uint64_t due = core->latency->due[64 * word + (uint32_t)__builtin_ctzll(left)];
            first = due < first ? due : first;
        }
    }
    fabric_schedule(core->fabric, core->latency_slot, first);
}

static void event(struct device *device, uint64_t ns)
{
    struct core *core = device->fabric->host.user;
    struct shared *s = &core->shared;
    for (uint32_t word = 0; word < 2; ++word) {
        for (uint64_t left = s->held[word]; left; left &= left - 1) {
            if (core->latency->due[64 * word + (uint32_t)__builtin_ctzll(left)] <= ns) {
                s->held[word] &= ~(left & -left);
            }
        }
    }
    schedule_first(core);
    s->stop_at = 0; /* at a boundary: what is pending is looked at anew */
}

/* Goes on with what was put back. */
static uint32_t command(struct device *device, uint32_t what, uint32_t one, uint32_t other)
{
    (void)what;
    (void)one;
    (void)other;
    schedule_first(device->fabric->host.user);
    return 0;
}

DEVICE_KIND(latency_kind) = {.name = "latency", .event = event, .command = command};

/* Has an interrupt that has just become pending, and might be taken from a cycle on, taken as much later as is drawn. */
void put_off(struct core *core, unsigned number, uint64_t cycle)
{
    const uint64_t cycles = next_draw(core->latency);
    if (cycles) {
        core->latency->due[number] = ns_of(core->fabric, cycle + cycles);
        core->shared.held[number >> 6] |= UINT64_C(1) << (number & 63);
        schedule_first(core);
    }
}

/* Has interrupts put off from now on, by a device in a slot of the queue. */
void core_vary_latency(struct core *core, uint32_t slot, struct latency *latency)
{
    core->latency = latency;
    core->latency_slot = slot;
}
