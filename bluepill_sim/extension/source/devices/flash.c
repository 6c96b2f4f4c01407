/* FLASH: wait states and prefetch; and the part of its registers that drivers write for each halfword: PG of CR, and the
 * flags of SR.
 *
 * All else is Python's: `peripherals/flash.py`.
 * Invariant: Python is notified of each write after which anything is to be done.
 */
#include "../fabric/fabric.h"
#include "../registers/flash.h"

static void set_access(struct device *device, uint32_t wait_states, bool has_prefetch)
{
    struct clocks *clocks = device->fabric->clocks;
    if (clocks->flash_wait_states != wait_states || clocks->flash_prefetch != has_prefetch) {
        clocks->flash_wait_states = wait_states;
        clocks->flash_prefetch = has_prefetch;
        ask_about(device, ACCESS);
    }
}

static void write_access(struct device *device, uint32_t written)
{
    const uint32_t latency = (written & LATENCY) >> LATENCY_AT;
    if (latency > 2) {
        ask(device, RESERVED, latency);
    }
    device->words[ACR] = (device->words[ACR] & ~(uint32_t)PRFTBS) | (written & PRFTBE ? PRFTBS : 0);
    set_access(device, latency, written & PRFTBE);
}

static void write(struct device *device, uint32_t index, uint32_t written, uint32_t previous)
{
    const uint32_t *words = device->words, control = words[CR];
    if (index == ACR) {
        write_access(device, written);
        return;
    }
    const bool changes_pg_alone = index == CR && !((control ^ previous) & ~(uint32_t)PG) && !(control & (STRT | LOCK)) && !(words[SR] & BSY);
    const bool clears_flags_alone = index == SR && !(control & (ERRIE | EOPIE));
    if (!changes_pg_alone && !clears_flags_alone) {
        ask(device, WRITTEN, index << 16 | previous);
    }
}

static uint32_t command(struct device *device, uint32_t what, uint32_t one, uint32_t other)
{
    if (what == RESET) {
        set_access(device, 0, true);
    }
    return obey_listen(device, what, one, other);
}

DEVICE_KIND(flash_kind) = {.name = "flash", .write = write, .line = hand_on_line, .pins = hand_on_pins, .command = command};
