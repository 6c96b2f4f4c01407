/* Loops that wait: for a flag of a peripheral, a pin, a word that an interrupt sets, the end of a delay.
 *
 * A round of blocks that finds registers and SRAM as they were one round before does the same again, until an event:
 * what it reads are memory, and registers that only events change. So its time can pass at once. From time to time,
 * the more rarely the longer it was in vain, a block's start is taken for that of such a round: twice it has to come
 * with the same registers, and the second time with the same SRAM. A round does not count where something was written
 * to a peripheral, where a value was read that may be a clock, or that Python has answered, and where priorities or
 * masks may have changed. A register that is read many times in a row has a round looked for at once. Where a loop of
 * one block does nothing but read a register, as native/polling.py says, the round that leaves it is worked out: of a
 * counter that is known to be a ramp of time, or of a register that only events change, at the next of them.
 */
#include <stdlib.h>
#include <string.h>

#include "core.h"

/* A round has no more blocks than rows are kept of. */
enum { MOST_BLOCKS = LAST_ROWS };

static void read_all(struct core *core, uint32_t registers[16])
{
    static const int numbers[16] = {REG_R0,     REG_R0 + 1, REG_R0 + 2, REG_R0 + 3, REG_R0 + 4,  REG_R0 + 5,
                                    REG_R0 + 6, REG_R0 + 7, REG_R0 + 8, REG_R0 + 9, REG_R0 + 10, REG_R0 + 11,
                                    REG_R12,    REG_SP,     REG_LR,     REG_XPSR};
    read_registers(core, numbers, registers, 16);
}

/* Looks the later again, the more often it was in vain. */
static void give_up(struct core *core)
{
    struct waiting *waiting = &core->waiting;
    waiting->phase = NOT_LOOKING;
    waiting->interval = waiting->interval < MOST_INTERVAL ? 2 * waiting->interval : MOST_INTERVAL;
    waiting->next = core->shared.cycle + waiting->interval;
}

/* Has the run that begins look for a loop that waits, when it is time to. */
void look_later(struct core *core)
{
    struct waiting *waiting = &core->waiting;
    struct shared *s = &core->shared;
    if (waiting->phase != NOT_LOOKING) {
        give_up(core); /* an event came first: where events come so often, there is no time to let pass */
    }
    /* That it is far ahead means that a state of an earlier time was restored. */
    if (waiting->next < s->cycle + LEAST_INTERVAL || waiting->next > s->cycle + MOST_INTERVAL) {
        waiting->next = s->cycle + LEAST_INTERVAL;
    }
    if (core->records == NULL && waiting->next < s->stop_at) {
        s->stop_at = waiting->next;
    }
}

/* Has the running block be the last before a look: it polls a register. */
void look_now(struct core *core)
{
    struct waiting *waiting = &core->waiting;
    struct shared *s = &core->shared;
    if (waiting->phase == NOT_LOOKING && core->records == NULL && s->stop_at > s->cycle) {
        waiting->next = s->stop_at = s->cycle;
    }
}

/* Lets the time of rounds pass that are as the last one was. The rows of the last ones are kept. */
static void repeat(struct core *core, uint64_t stop)
{
    struct shared *s = &core->shared;
    const uint64_t length = s->cycle - core->waiting.cycle, rounds = (stop - s->cycle - 1) / length;
    struct record round[MOST_BLOCKS];
    const uint32_t blocks = core->waiting.blocks;
    for (uint32_t n = 0; n < blocks; ++n) {
        round[n] = s->last[(s->logged - blocks + n) % LAST_ROWS];
    }
    const uint64_t kept = (LAST_ROWS + blocks - 1) / blocks;
    for (uint64_t k = rounds > kept ? rounds - kept + 1 : 1; k <= rounds; ++k) {
        for (uint32_t n = 0; n < blocks; ++n) {
            record_at(core, round[n].cycle + k * length, round[n].address, 0);
        }
    }
    s->cycle += rounds * length;
}

/* The start of a block where another round begins: whether it is a waiting one. */
static bool is_same_round(struct core *core)
{
    struct waiting *waiting = &core->waiting;
    const struct shared *s = &core->shared;
    const uint8_t *memory = (const uint8_t *)(uintptr_t)s->sram;
    uint32_t registers[16];
    read_all(core, registers);
    if (memcmp(registers, waiting->registers, sizeof registers) != 0) {
        return false;
    }
    if (waiting->phase == SECOND_ROUND) {
        return memcmp(memory, waiting->memory, s->sram_bytes) == 0;
    }
    if (waiting->memory == NULL && (waiting->memory = malloc(s->sram_bytes)) == NULL) {
        return false;
    }
    memcpy(waiting->memory, memory, s->sram_bytes);
    return true;
}

/* At a boundary at or after `stop_at`: looks for a loop that waits, and lets its time pass; false: it is not for that
 * that the boundary is looked at.
 */
bool looks_for_waiting(struct core *core, uint32_t address)
{
    struct waiting *waiting = &core->waiting;
    struct shared *s = &core->shared;
    const uint64_t stop = next_stop(core);
    if (s->attention || s->halt_kind != HALT_NONE || s->cycle >= stop || core->is_scratch || core->records != NULL) {
        return false;
    }
    const bool is_begin = waiting->phase == NOT_LOOKING, is_round = waiting->address == address;
    s->stop_at = 1; /* each block is looked at */
    if (is_begin) {
        waiting->address = address;
        read_all(core, waiting->registers);
    } else if (waiting->has_acted || waiting->blocks == MOST_BLOCKS || (is_round && !is_same_round(core))) {
        give_up(core);
        s->stop_at = waiting->next < stop ? waiting->next : stop;
        return true;
    } else if (!is_round) {
        ++waiting->blocks;
        return true;
    } else if (waiting->phase == SECOND_ROUND) {
        repeat(core, stop);
        waiting->phase = NOT_LOOKING;
        waiting->interval = LEAST_INTERVAL;
        s->stop_at = stop;
        return true;
    }
    ++waiting->phase;
    waiting->blocks = 1;
    waiting->has_acted = 0;
    waiting->cycle = s->cycle;
    return true;
}

/* How many rounds begin before the run has to end, without the last of them: what is due by then may be seen by that
 * round's own read.
 */
static uint64_t rounds_left(const struct core *core, const struct row *row)
{
    return (next_stop(core) - core->shared.cycle - 1) / row->costs[1];
}

/* Lets the time of some rounds of a block pass. The rows of the last ones are kept. */
void wait_on(struct core *core, const struct row *row, uint64_t rounds)
{
    struct shared *s = &core->shared;
    core->waiting.has_acted |= rounds != 0;
    for (uint64_t n = rounds > LAST_ROWS ? rounds - LAST_ROWS : 1; n <= rounds; ++n) {
        record_at(core, s->cycle + n * row->costs[1], row->start, 0);
    }
    s->cycle += rounds * row->costs[1];
}

enum operation { ADD, SUBTRACT, SUBTRACT_FROM, SHIFT_LEFT, SHIFT_RIGHT, AND };

/* N, Z, C and V of the last step; shifts and AND have no use of C and V here. */
struct flags {
    bool n, z, c, v;
};

static struct flags run_steps(const struct loop *loop, const uint32_t *operands, uint32_t x)
{
    struct flags flags = {0};
    for (uint32_t k = 0; k < loop->count; ++k) {
        const struct step *step = &loop->steps[k];
        const uint32_t operation = step->operation, y = operands[k];
        uint32_t result;
        if (operation == ADD) {
            result = x + y;
            flags.c = result < x;
            flags.v = (~(x ^ y) & (x ^ result)) >> 31;
        } else if (operation == SUBTRACT || operation == SUBTRACT_FROM) {
            const uint32_t from = operation == SUBTRACT ? x : y, what = operation == SUBTRACT ? y : x;
            result = from - what;
            flags.c = from >= what;
            flags.v = ((from ^ what) & (from ^ result)) >> 31;
        } else {
            result = operation == SHIFT_LEFT ? x << y : operation == SHIFT_RIGHT ? x >> y : x & y;
        }
        flags.n = result >> 31;
        flags.z = result == 0;
        x = step->is_flags_only ? x : result;
    }
    return flags;
}

/* ARMv7-M A7.3, table A7-1. */
static bool holds(uint32_t condition, struct flags f)
{
    const bool ways[7] = {f.z, f.c, f.n, f.v, f.c && !f.z, f.n == f.v, !f.z && f.n == f.v};
    return ways[condition >> 1] != (condition & 1);
}

/* The ramp that a register reads; null: it reads none, or not now. */
static const struct counter *counter_at(struct core *core, uint32_t address)
{
    const struct fabric *fabric = core->fabric;
    for (uint32_t n = 0; n < fabric->counter_count; ++n) {
        const struct counter *one = &fabric->counters[n];
        if (one->address == address) {
            return one->ticks == NULL || has_clock(&core->pages[(address - PERIPHERALS) >> PAGE_SHIFT]) ? one : NULL;
        }
    }
    return NULL;
}

/* Cycles of the core a tick: a clock of the chip is the core's, divided by a power of 2. 0: it is tied to another time. */
static uint64_t cycles_a_tick(const struct fabric *fabric, const struct ticks *ticks)
{
    return ticks == NULL ? 1 : ticks->ns == fabric->time.ns && fabric->time.hz % ticks->hz == 0 ? fabric->time.hz / ticks->hz : 0;
}

/* What a counter reads at a cycle, and the first cycle after it at which it may read another word. */
static uint32_t count_at(const struct fabric *fabric, const struct counter *counter, uint64_t cycle, uint64_t *changes)
{
    const struct ramp *ramp = counter->ramp;
    const struct ticks *ticks = counter->ticks;
    const uint64_t unit = cycles_a_tick(fabric, ticks);
    const uint64_t start = ticks == NULL ? 0 : fabric->time.cycle, first = ticks == NULL ? 0 : ticks->tick;
    *changes = cycle + 1;
    if (!unit) {
        return ramp_at(ramp, tick_at(ticks, ns_of(fabric, cycle)));
    }
    const uint64_t tick = first + (cycle - start) / unit;
    if (!ramp->runs) {
        *changes = NO_TIME;
    } else if (tick >= ramp->base) {
        *changes = start + unit * (ramp->base + ((tick - ramp->base) / ramp->divider + 1) * ramp->divider - first);
    }
    return ramp_at(ramp, tick);
}

/* How many of the next rounds of such a loop go round again, of those that end before the run does: each round but the
 * last leaves nothing that the next one does not overwrite. The value of a counter follows from the time; that of any other
 * register only events change, and they and the read of the round before have done so. `is_first`: an event may have
 * come since that read, so one has to be made before.
 */
uint64_t rounds_of_loop(struct core *core, const struct row *row, bool is_first)
{
    const struct loop *loop = row->loop;
    const struct shared *s = &core->shared;
    const uint32_t address = read_register(core, REG_R0 + loop->base) + loop->offset;
    const uint64_t left = s->stop_at ? rounds_left(core, row) : 0, first = s->cycle + loop->read_cycle, cost = row->costs[1];
    if (!left) {
        return 0;
    }
    const struct counter *counter = counter_at(core, address);
    uint32_t word = 0;
    if (counter == NULL && (is_first || !read_again(core, address, &word))) {
        return 0;
    }
    uint32_t operands[sizeof loop->steps / sizeof *loop->steps];
    for (uint32_t k = 0; k < loop->count; ++k) {
        const struct step *step = &loop->steps[k];
        operands[k] = step->is_register ? read_register(core, REG_R0 + (int)step->operand) : step->operand;
    }
    uint64_t n = 0, changes;
    if (counter == NULL) {
        return holds(loop->condition, run_steps(loop, operands, word)) ? left : 0;
    }
    while (n < left && holds(loop->condition, run_steps(loop, operands, count_at(core->fabric, counter, first + n * cost, &changes)))) {
        if (changes == NO_TIME) {
            return left;
        }
        n = (changes - first + cost - 1) / cost;
    }
    return n < left ? n : left;
}
