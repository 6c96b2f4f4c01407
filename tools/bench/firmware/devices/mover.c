/* A test device, no firmware: moves a word from a register to SRAM, a million times a second of its clock. */
#include "../../../../bluepill_sim/extension/source/fabric/fabric.h"

enum { FROM, TO, COUNT, ERRORS, BASE_LOW, BASE_HIGH, MOVED };
enum { RATE_HZ = 1000000 };

/* The next one, from the time of the start: nothing is accumulated. */
static void go_on(struct device *device)
{
    const uint64_t base = device->words[BASE_LOW] | (uint64_t)device->words[BASE_HIGH] << 32;
    schedule(device, base + (device->words[MOVED] + UINT64_C(1)) * (NS_PER_S / RATE_HZ));
}

static void event(struct device *device, uint64_t ns)
{
    uint32_t *words = device->words, word;
    (void)ns;
    const uint32_t to = words[TO] + 4 * (words[MOVED] % words[COUNT]);
    if (!bus_read(device, words[FROM], 4, &word) || !bus_write(device, to, 4, word)) {
        ++words[ERRORS];
    }
    ++words[MOVED];
    go_on(device);
}

static void write(struct device *device, uint32_t index, uint32_t written, uint32_t previous)
{
    (void)index; /* COUNT: how many words there is room for; it starts */
    (void)written;
    (void)previous;
    const uint64_t now = now_ns(device->fabric);
    device->words[BASE_LOW] = (uint32_t)now;
    device->words[BASE_HIGH] = (uint32_t)(now >> 32);
    device->words[MOVED] = device->words[ERRORS] = 0;
    go_on(device);
}

DEVICE_KIND(mover_kind) = {.name = "mover", .write = write, .event = event};
