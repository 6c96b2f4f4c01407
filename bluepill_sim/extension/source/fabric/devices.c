/* The kinds of devices that are written in C, and how Python reaches them. */
#include <stdlib.h>
#include <string.h>

#include "fabric.h"

static const struct device_kind *kinds;

void add_kind(struct device_kind *kind)
{
    kind->next = kinds;
    kinds = kind;
}

struct fabric *fabric_new(const struct fabric_calls *calls, struct port *ports, struct wave *waves)
{
    struct fabric *fabric = calloc(1, sizeof *fabric);
    if (fabric != NULL) {
        fabric->calls = *calls;
        fabric->ports = ports;
        fabric->waves = waves;
        fabric->master = SLOTS;
        fabric->event_ns = fabric->next_cycle = fabric->last_output = NO_TIME;
        fabric->time.hz = NS_PER_S;
        fabric->time.most_s = NO_TIME / 8 / NS_PER_S;
        for (uint32_t n = 0; n < SLOTS; ++n) {
            fabric->slots[n].ns = fabric->slots[n].cycle = NO_TIME;
            memset(fabric->devices[n].outputs, NO_LINE, sizeof fabric->devices[n].outputs);
            fabric->devices[n].fabric = fabric;
            fabric->devices[n].slot = n;
        }
        fabric->devices[0].kind = &waves_kind; /* the first slot is that of the pins */
        fabric->slots[0].device = &fabric->devices[0];
        fabric->slots[0].event = waves_kind.event;
        fabric->slot_count = 1;
    }
    return fabric;
}

void fabric_free(struct fabric *fabric)
{
    for (uint32_t n = 0; n < SUBSCRIBERS; ++n) {
        free(fabric->subscribers[n].rows);
    }
    for (uint32_t n = 0; n < SLOTS; ++n) {
        free(fabric->devices[n].words_out);
    }
    free(fabric);
}

void fabric_set_clocks(struct fabric *fabric, struct clocks *clocks) { fabric->clocks = clocks; }

/* Says which of the clocks a device counts, by its place in the struct. */
void fabric_set_clock(struct fabric *fabric, uint32_t slot, uint32_t offset)
{
    fabric->devices[slot].clock = 1 + offset / sizeof(uint32_t);
}

/* Tells every device that counts a clock what its frequency is now. */
void fabric_clocks_changed(struct fabric *fabric)
{
    const struct clocks *clocks = fabric->clocks;
    for (uint32_t n = 0; n < fabric->slot_count; ++n) {
        if (fabric->devices[n].clock) {
            fabric_command(fabric, n, CLOCK, ((const uint32_t *)clocks)[fabric->devices[n].clock - 1], clocks->adc_divider);
        }
    }
}

void fabric_set_host(struct fabric *fabric, const struct host *host) { fabric->host = *host; }

/* Takes a slot of the queue; -1 where there is none left. */
int32_t fabric_add_slot(struct fabric *fabric)
{
    return fabric->slot_count < SLOTS ? (int32_t)fabric->slot_count++ : -1;
}

/* Puts a device of a kind into a slot; false: there is no such kind. */
bool fabric_add_device(struct fabric *fabric, uint32_t slot, const char *name, uint32_t *words, void *state)
{
    for (const struct device_kind *kind = kinds; kind != NULL; kind = kind->next) {
        if (strcmp(kind->name, name) == 0) {
            struct device *device = &fabric->devices[slot];
            device->kind = kind;
            device->words = words;
            device->state = state;
            fabric->slots[slot].device = device;
            fabric->slots[slot].event = kind->event;
            return true;
        }
    }
    return false;
}

/* Says which bit of RCC's enable and reset registers is a device's. */
void fabric_set_gate(struct fabric *fabric, uint32_t slot, uint32_t number, uint32_t bit)
{
    fabric->gated[number][bit] = (uint8_t)slot;
}

/* Says what the registers of a device are after a reset: indices and words; and whether that is all, but for its RESET. */
void fabric_set_initial(struct fabric *fabric, uint32_t slot, const uint32_t (*initial)[2], uint32_t count, bool resets_alone)
{
    struct device *device = &fabric->devices[slot];
    device->initial = initial;
    device->initial_count = count;
    device->resets_alone = resets_alone;
}

void reset_device(struct device *device)
{
    leave_ahead(device->fabric);
    schedule(device, NO_TIME);
    for (uint32_t n = 0; n < device->initial_count; ++n) {
        device->words[device->initial[n][0]] = device->initial[n][1];
    }
    fabric_command(device->fabric, device->slot, RESET, 0, 0);
}

void fabric_reset_device(struct fabric *fabric, uint32_t slot) { reset_device(&fabric->devices[slot]); }

uint32_t fabric_read(struct fabric *fabric, uint32_t slot, uint32_t index)
{
    struct device *device = &fabric->devices[slot];
    return device->kind->read(device, index);
}

void fabric_write(struct fabric *fabric, uint32_t slot, uint32_t index, uint32_t written, uint32_t previous)
{
    struct device *device = &fabric->devices[slot];
    device->kind->write(device, index, written, previous);
}

uint32_t fabric_command(struct fabric *fabric, uint32_t slot, uint32_t what, uint32_t one, uint32_t other)
{
    struct device *device = &fabric->devices[slot];
    return device->kind == NULL || device->kind->command == NULL ? 0 : device->kind->command(device, what, one, other);
}

void add_counter(struct fabric *fabric, uint32_t address, const struct ramp *ramp, const struct ticks *ticks)
{
    if (fabric->counter_count < COUNTERS) { /* without room, such loops run round by round */
        fabric->counters[fabric->counter_count++] = (struct counter){address, ramp, ticks};
    }
}

/* The time of the event that is acted on; NO_TIME for none. */
uint64_t fabric_event_ns(const struct fabric *fabric) { return fabric->event_ns; }

/* Whether a subscriber wants the slice to end; it is forgotten. */
bool fabric_take_stop(struct fabric *fabric)
{
    const bool wants_stop = fabric->wants_stop;
    fabric->wants_stop = 0;
    return wants_stop;
}

void fabric_end_slice(struct fabric *fabric) { fabric->host.end_slice(fabric->host.user); }

/* Whether anything waits for Python. */
bool fabric_has_news(struct fabric *fabric)
{
    size_t count = 0;
    const uint64_t settled = settled_ns(fabric);
    for (uint32_t n = 0; n < SUBSCRIBERS; ++n) {
        expand_waves(fabric, &fabric->subscribers[n], settled);
        count += fabric->subscribers[n].count;
    }
    for (uint32_t n = 0; n < fabric->slot_count; ++n) {
        count += fabric->devices[n].word_count;
    }
    return count != 0;
}

/* Words that a device has sent. */

/* Whether each word ends the slice. */
void fabric_stop_at_words(struct fabric *fabric, uint32_t slot, bool wanted) { fabric->devices[slot].ends_slice = wanted; }

void send_word(struct device *device, const struct sent *row)
{
    struct fabric *fabric = device->fabric;
    if (device->words_out == NULL) {
        device->words_out = malloc(WORDS * sizeof *device->words_out);
        if (device->words_out == NULL) {
            fabric->calls.no_memory();
            return;
        }
    }
    if (device->word_count == WORDS) {
        leave_ahead(fabric);
        fabric->calls.deliver(device->slot);
    }
    device->words_out[device->word_count++] = *row;
    if (device->ends_slice) {
        fabric->wants_stop = 1;
    }
    if (device->ends_slice || device->word_count >= WORDS / 2) {
        fabric->host.end_slice(fabric->host.user);
    }
}

uint32_t fabric_word_count(const struct fabric *fabric, uint32_t slot) { return fabric->devices[slot].word_count; }

/* The words of a device, which the caller has then: they stand until the chip goes on. */
const struct sent *fabric_take_words(struct fabric *fabric, uint32_t slot)
{
    fabric->devices[slot].word_count = 0;
    return fabric->devices[slot].words_out;
}
