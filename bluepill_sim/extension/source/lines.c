/* Lines: one bit each from an output of a device to inputs of others; the first ones are interrupts.
 *
 * Which output is on which line, and which inputs hang on it, is a table on the chip's page (`stm32f103.py`).
 */
#include "fabric.h"

/* Subscribers see lines as pins behind the last one; what a pin drives is here whether the interrupt is enabled. */
static RARELY void tell_subscribers(struct fabric *fabric, uint32_t number, bool level, bool is_enabled)
{
    const struct edge row = {.ns = now_ns(fabric), .pin = (uint8_t)(PORTS * PINS + number), .drive = is_enabled, .wire = level};
    for (uint32_t n = 0; n < SUBSCRIBERS; ++n) {
        if (fabric->subscribers[n].lines[number / 64] >> number % 64 & 1) {
            put_row(fabric, &fabric->subscribers[n], &row);
        }
    }
}

void line_set(struct fabric *fabric, uint32_t number, bool level)
{
    if (number >= LINES || fabric->lines[number].level == level) {
        return;
    }
    struct line *line = &fabric->lines[number];
    line->level = level;
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

void fabric_set_line(struct fabric *fabric, uint32_t number, bool level) { line_set(fabric, number, level); }

bool fabric_line(const struct fabric *fabric, uint32_t number) { return fabric->lines[number].level; }

/* Takes a level without a word to anyone: a state is put back. */
void fabric_restore_line(struct fabric *fabric, uint32_t number, bool level) { fabric->lines[number].level = level; }

/* Hangs an input of a device on a line; false: there is no room. */
bool fabric_wire(struct fabric *fabric, uint32_t number, uint32_t slot, uint32_t input)
{
    struct line *line = &fabric->lines[number];
    if (number >= LINES || line->sink_count == SINKS || fabric->slots[slot].device == NULL) {
        return false;
    }
    line->sinks[line->sink_count++] = (struct sink){fabric->slots[slot].device, input};
    return true;
}
