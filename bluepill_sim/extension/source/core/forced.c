/* Which bits of a register a store sets whatever was there: Python finds it from the code, once for each set of values
 * that it looks at (`core/forced_bits.py`).
 *
 * Invariant: what is kept is of code in flash, which is forgotten with its blocks.
 */
#include <string.h>

#include "core.h"

static const uint8_t *sram_word(const struct shared *s, uint32_t address)
{
    return address - s->sram_base <= s->sram_bytes - 4 ? (const uint8_t *)(uintptr_t)s->sram + (address - s->sram_base) : NULL;
}

static bool holds(struct core *core, const struct forced *one)
{
    for (uint32_t n = 0; n < one->seen[0]; ++n) {
        const uint32_t place = one->seen[1 + 2 * n];
        uint32_t value;
        if (place < 16) {
            value = read_register(core, general((uint8_t)place));
        } else {
            memcpy(&value, sram_word(&core->shared, place), sizeof value);
        }
        if (value != one->seen[2 + 2 * n]) {
            return false;
        }
    }
    return true;
}

static bool can_be_kept(const struct core *core, const struct forced *one)
{
    for (uint32_t n = 0; n < one->seen[0] && one->seen[0] <= MOST_SEEN; ++n) {
        if (one->seen[1 + 2 * n] >= 16 && sram_word(&core->shared, one->seen[1 + 2 * n]) == NULL) {
            return false;
        }
    }
    return one->seen[0] <= MOST_SEEN;
}

uint32_t core_forced(void *user, uint32_t address)
{
    struct core *core = user;
    const struct shared *s = &core->shared;
    const uint32_t pc = s->access_pc, start = core->block->start, set = (pc >> 1) % FORCED_SETS;
    const bool is_known = !s->is_python && s->in_access && core->block != &core->none && pc - s->sram_base >= s->sram_bytes;
    for (uint32_t n = 0; is_known && n < FORCED_WAYS; ++n) {
        const struct forced *one = &core->forced[set][n];
        if (one->pc == pc && one->start == start && one->address == address && holds(core, one)) {
            return one->bits;
        }
    }
    struct forced found = {.pc = pc, .start = start, .address = address, .seen = {UINT32_MAX}};
    leave_ahead(core->fabric);
    found.bits = core->fabric->calls.forced(address, found.seen);
    if (is_known && can_be_kept(core, &found)) {
        core->forced[set][core->forced_next[set]++ % FORCED_WAYS] = found;
    }
    return found.bits;
}
