/* Outputs of a GPIO port whose edges have no listener: the data registers and the pins' own levels.
 *
 * Python says which pins are so simple that a change of their ODR bit changes
 * nothing but the level that IDR reads; it takes the changes over before it
 * looks at a pin. A tool that records the pins takes the rows over in bulk. Source: RM0008 9.2.
 */
#include <stdlib.h>

#include "core.h"

enum { IDR = 2, ODR = 3, BSRR = 4, BRR = 5 };

static void record_pins(struct core *core, const struct page *page, uint32_t changed)
{
    struct shared *s = &core->shared;
    core->pin_rows[core->pin_count++] = (struct pin_row){
        s->access_cycle, (uint16_t)(page->port - core->ports), (uint16_t)changed, (uint16_t)page->words[ODR], 0};
    if (core->pin_count > PIN_ROWS - PIN_SLACK) {
        s->stop_at = 0;
        s->attention = 1;
    }
}

bool write_port(struct core *core, struct page *page, uint32_t index, uint32_t value, uint32_t address)
{
    const uint32_t before = page->words[ODR];
    uint32_t after;
    if (index == BSRR) {
        /* A set wins over a reset of the same bit (RM0008 9.2.5). */
        after = (before & ~(value >> 16)) | (value & 0xFFFF);
    } else if (index == BRR) {
        after = before & ~(value & 0xFFFF);
    } else if (index == ODR) {
        after = value & 0xFFFF;
    } else {
        return false;
    }
    const uint32_t changed = before ^ after;
    if (changed & ~page->port->simple) {
        return false;
    }
    if (changed) {
        if (core->pin_rows != NULL && !resolve(core, address, true, 4)) {
            return true;
        }
        core->shared.last_pin_cycle = core->shared.cycle;
        page->words[ODR] = after;
        page->words[IDR] = (page->words[IDR] & ~changed) | (after & changed);
        page->port->changed |= changed;
        core->shared.dirty |= changed;
        if (core->pin_rows != NULL) {
            record_pins(core, page, changed);
            return true;
        }
    }
    skip(core, address, true, 4);
    return true;
}

/* Keeps the edges of these outputs from now on, or no longer; false without memory for it. */
bool core_record_pins(struct core *core, bool wanted)
{
    free(core->pin_rows);
    core->pin_rows = wanted ? malloc(PIN_ROWS * sizeof *core->pin_rows) : NULL;
    core->pin_count = 0;
    return !wanted || core->pin_rows != NULL;
}

/* Forgets the rows that have been taken over. */
void core_drop_pins(struct core *core) { core->pin_count = 0; }
