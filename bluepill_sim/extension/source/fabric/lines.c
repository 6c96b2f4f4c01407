/* Lines: one bit each from outputs of devices to inputs of others; the first ones are interrupts.
 *
 * Which outputs are on which line, and which inputs hang on it, is a table on the chip's page (`stm32f103.py`).
 * Invariant: a line is 1 exactly while one of its outputs is.
 */
#include <string.h>

#include "fabric.h"

/* Subscribers see lines as pins behind the last one; what a pin drives is here whether the interrupt is enabled. */
static RARELY void tell_subscribers(struct fabric *fabric, uint32_t number, bool level, bool is_enabled)
{
    const struct edge row = {.ns = now_ns(fabric), .pin = (uint8_t)(PORTS * PINS + number), .drive = is_enabled, .wire = level};
    show_ahead(fabric);
    for (uint32_t n = 0; n < SUBSCRIBERS; ++n) {
        if (fabric->subscribers[n].lines[number / 64] >> number % 64 & 1) {
            put_row(fabric, &fabric->subscribers[n], &row);
        }
    }
}

static void drive(struct fabric *fabric, uint32_t number, uint32_t driver, bool level)
{
    if (number >= LINES) {
        return;
    }
    struct line *line = &fabric->lines[number];
    const uint8_t before = line->high, bit = (uint8_t)(1 << driver);
    line->high = level ? before | bit : before & ~bit;
    if (!before == !line->high) {
        return;
    }
    uint32_t is_enabled = 0;
    if (number < IRQ_LINES_END) {
        is_enabled = fabric->host.set_irq(fabric->host.user, number, level);
    }
    if (UNLIKELY(fabric->subscribed_lines[number / 64] >> number % 64 & 1)) {
        tell_subscribers(fabric, number, level, is_enabled);
    }
    for (uint32_t n = 0; n < line->sink_count; ++n) {
        struct device *device = line->sinks[n].device;
        device->kind->line(device, line->sinks[n].input, level);
    }
}

void output_set(struct device *device, uint32_t output, bool level)
{
    drive(device->fabric, device->outputs[output], device->drivers[output], level);
}

bool is_heard(const struct device *device, uint32_t output)
{
    const struct fabric *fabric = device->fabric;
    const uint32_t number = device->outputs[output];
    if (number >= LINES) {
        return false;
    }
    const struct line *line = &fabric->lines[number];
    bool is_heard = number < IRQ_LINES_END || fabric->subscribed_lines[number / 64] >> number % 64 & 1;
    for (uint32_t n = 0; n < line->sink_count; ++n) {
        const struct sink *sink = &line->sinks[n];
        is_heard |= sink->device->kind->hears == NULL || sink->device->kind->hears(sink->device, sink->input);
    }
    return is_heard;
}

void hearing_changed(struct device *device)
{
    for (uint32_t word = 0; word < SLOTS / 64; ++word) {
        for (uint64_t left = device->heard[word]; left; left &= left - 1) {
            fabric_command(device->fabric, 64 * word + (uint32_t)__builtin_ctzll(left), HEARD, 0, 0);
        }
    }
}

static void note_heard(struct device *device, uint32_t slot) { device->heard[slot / 64] |= UINT64_C(1) << slot % 64; }

void fabric_set_output(struct fabric *fabric, uint32_t slot, uint32_t output, bool level)
{
    output_set(&fabric->devices[slot], output, level);
}

/* As the first output on the line. */
void fabric_set_line(struct fabric *fabric, uint32_t number, bool level) { drive(fabric, number, 0, level); }

/* The outputs on a line that are 1, a bit each. */
uint32_t fabric_line(const struct fabric *fabric, uint32_t number) { return fabric->lines[number].high; }

/* Takes them without a word to anyone: a state is put back. */
void fabric_restore_line(struct fabric *fabric, uint32_t number, uint32_t high) { fabric->lines[number].high = (uint8_t)high; }

/* Puts an output of a device on a line; false: there is no room. */
bool fabric_put_output(struct fabric *fabric, uint32_t slot, uint32_t output, uint32_t number)
{
    struct line *line = &fabric->lines[number];
    if (number >= LINES || output >= OUTPUTS || line->driver_count == 8 * sizeof line->high) {
        return false;
    }
    fabric->devices[slot].outputs[output] = (uint8_t)number;
    fabric->devices[slot].drivers[output] = line->driver_count++;
    for (uint32_t n = 0; n < line->sink_count; ++n) {
        note_heard(line->sinks[n].device, slot);
    }
    return true;
}

/* Hangs an input of a device on a line; false: there is no room. */
bool fabric_wire(struct fabric *fabric, uint32_t number, uint32_t slot, uint32_t input)
{
    struct line *line = &fabric->lines[number];
    if (number >= LINES || line->sink_count == SINKS || fabric->slots[slot].device == NULL) {
        return false;
    }
    line->sinks[line->sink_count++] = (struct sink){fabric->slots[slot].device, input};
    for (uint32_t n = 0; n < fabric->slot_count; ++n) {
        if (memchr(fabric->devices[n].outputs, (int)number, OUTPUTS) != NULL) {
            note_heard(fabric->slots[slot].device, n);
        }
    }
    return true;
}
