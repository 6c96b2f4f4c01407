/* Outputs of a GPIO port that nobody watches: the data registers and the pins' own levels.
 *
 * Python says which pins are so simple that a change of their ODR bit changes
 * nothing but the level that IDR reads; it takes the changes over before it
 * looks at a pin. Source: RM0008 9.2.
 */
#include "core.h"

enum { IDR = 2, ODR = 3, BSRR = 4, BRR = 5 };

bool write_port(struct core *core, struct page *page, uint32_t index, uint32_t value)
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
    if (!changed) {
        return true;
    }
    core->shared.last_pin_cycle = core->shared.cycle;
    page->words[ODR] = after;
    page->words[IDR] = (page->words[IDR] & ~changed) | (after & changed);
    page->port->changed |= changed;
    core->shared.pins_changed |= changed;
    return true;
}
