/* Loops of one block that wait: for a flag of a peripheral, a pin, a word that an interrupt sets.
 *
 * A block that stores nothing and finds the same registers at its start as one
 * round before does the same again, until an event that ends the run: what it
 * reads are memory and registers that only events change. If Python has
 * answered one of its reads, what was read may have been a clock, and it goes on
 * round by round.
 */
#include <string.h>

#include "core.h"

/* Chosen: rounds before the registers are looked at, which costs as much as some rounds do. */
enum { FIRST_LOOK = 6, NEXT_LOOK = 64 };

static void look(struct core *core, uint32_t registers[16])
{
    static const int numbers[16] = {REG_R0,     REG_R0 + 1, REG_R0 + 2, REG_R0 + 3, REG_R0 + 4,  REG_R0 + 5,
                                    REG_R0 + 6, REG_R0 + 7, REG_R0 + 8, REG_R0 + 9, REG_R0 + 10, REG_R0 + 11,
                                    REG_R12,    REG_SP,     REG_LR,     REG_XPSR};
    void *at[16];
    for (int n = 0; n < 16; ++n) {
        at[n] = &registers[n];
    }
    core->api.read_registers(core->unicorn, numbers, at, 16);
}

/* Called when a block is entered right after itself. */
bool polls_unchanged(struct core *core, const struct row *row)
{
    struct polling *polling = &core->polling;
    if (polling->row != row) {
        polling->row = row;
        polling->rounds = 0;
    }
    if (++polling->rounds < FIRST_LOOK || core->records != NULL) {
        return false;
    }
    uint32_t registers[16];
    look(core, registers);
    const bool is_same = polling->rounds > FIRST_LOOK && !polling->asked &&
                         core->shared.cycle == polling->cycle + row->costs[1] &&
                         memcmp(registers, polling->registers, sizeof registers) == 0;
    if (polling->rounds > FIRST_LOOK) {
        polling->rounds = is_same ? 0 : -NEXT_LOOK;
    }
    memcpy(polling->registers, registers, sizeof registers);
    polling->cycle = core->shared.cycle;
    polling->asked = 0;
    return is_same;
}

/* Lets the time pass up to the round within which the run has to end, and which is to be run: what is due by then
 * may be seen by that round's own read. The rows of the last rounds are kept.
 */
void wait_on(struct core *core, const struct row *row)
{
    struct shared *s = &core->shared;
    const uint64_t rounds = (s->stop_at - s->cycle - 1) / row->costs[1];
    for (uint64_t n = rounds > LAST_ROWS ? rounds - LAST_ROWS : 1; n <= rounds; ++n) {
        record_at(core, s->cycle + n * row->costs[1], row->start, 0);
    }
    s->cycle += rounds * row->costs[1];
}
