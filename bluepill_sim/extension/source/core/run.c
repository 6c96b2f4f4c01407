/* Slices: from boundary to boundary until the time is up, an event comes, or Python must decide. */
#include <stdlib.h>
#include <string.h>

#include "core.h"

enum { FOR_INTERRUPT = 1, FOR_EVENT = 2, SLEEPDEEP = 4 };
#define FIRST_EXCEPTION_RETURN 0xFFFFFFE0u
/* UC_ERR_EXCEPTION: the TLB denied a fetch. */
#define DENIED 21

void *allocate(struct core *core, size_t bytes)
{
    struct allocation *one = calloc(1, sizeof *one + bytes);
    if (one == NULL) {
        return NULL;
    }
    one->next = core->allocations;
    core->allocations = one;
    return one->data;
}

size_t core_shared_bytes(void) { return sizeof(struct shared); }

struct core *core_new(void *unicorn, const struct unicorn_api *api, const struct callbacks *calls)
{
    struct core *core = calloc(1, sizeof *core);
    if (core != NULL) {
        core->unicorn = unicorn;
        core->api = *api;
        core->calls = *calls;
        core->none.start = core->none.end = UINT32_MAX;
        core->none.ways = &core->ways[FLASH_SLOTS];
        core->block = &core->none;
        core->waiting.interval = LEAST_INTERVAL;
        system_init(&core->shared);
    }
    return core;
}

void core_forget_rows(struct core *core);

void core_free(struct core *core)
{
    core_forget_rows(core);
    free_dropped(core);
    free(core->records);
    free(core->waiting.memory);
    while (core->allocations != NULL) {
        struct allocation *one = core->allocations;
        core->allocations = one->next;
        free(one);
    }
    free(core);
}

void core_set_page(struct core *core, uint32_t number, uint32_t *words, uint32_t count, const uint32_t *gate,
                   uint32_t gate_mask, const uint16_t *behaviour, const uint32_t (*masks)[MASKS], uint32_t slot)
{
    core->pages[number] = (struct page){.words = words, .gate = gate, .gate_mask = gate_mask, .count = count,
                                        .behaviour = behaviour, .masks = masks,
                                        .device = &core->fabric->devices[slot]};
}

/* The core stands at a boundary. */
static void settle_at(struct core *core, uint32_t pc)
{
    core->block = &core->none;
    core->shared.pc = pc;
    core->shared.is_thumb = read_register(core, REG_XPSR) >> 24 & 1;
}

/* Charges what of the running block has been run when the core stands at `pc`. */
static void charge(struct core *core, uint32_t pc)
{
    const struct row *row = core->block;
    if (row != &core->none) {
        /* The refill of an exception return is part of the exception's exit. */
        core->shared.cycle += pc >= FIRST_EXCEPTION_RETURN ? row->costs[0] : cycles_until(row, pc);
    }
    core->block = &core->none;
    core->shared.pc = pc;
}

static void settle(struct core *core, uint32_t pc)
{
    charge(core, pc);
    settle_at(core, pc);
}

/* The cycle at which SysTick or the fabric's queue next acts. */
uint64_t core_next_event(const struct core *core)
{
    const uint64_t tick = core->shared.tick_next, other = core->fabric->next_cycle;
    return tick < other ? tick : other;
}

/* Forgets what was known of the block and of the mode that were left. */
static void start_anew(struct core *core)
{
    core->shared.run_from = core->shared.pc;
    core->io_next = core->skipped_count = 0;
    core->located.cycle = NO_TIME;
    core->privilege = PRIVILEGE_UNKNOWN;
}

/* When the run has to end, or something is due. */
uint64_t stop_of(const struct core *core)
{
    const uint64_t event = core_next_event(core);
    return event < core->limit ? event : core->limit;
}

/* Where an exception was entered or left within a hook: goes on at `pc`, without an end of Unicorn's run unless something
 * else comes first. Unicorn goes to an address that a hook sets; in the hook of a block it does by the function for one
 * register alone, whose mark would stay set in another hook.
 */
static void go_elsewhere(struct core *core, bool is_in_block)
{
    struct shared *s = &core->shared;
    const uint64_t stop = stop_of(core);
    if (s->attention || s->sleep || !s->is_thumb || (s->it_state && core->interpreter == NULL) || s->pc >= FIRST_EXCEPTION_RETURN || s->cycle >= stop ||
        is_interrupted(core)) {
        core->is_elsewhere = 1;
        end_run(core, HALT_BOUNDARY, s->pc);
        return;
    }
    uint64_t high;
    s->mask_stop = deliverable(s, &high) || high;
    s->stop_at = stop;
    look_later(core);
    start_anew(core);
    static const int number = REG_PC;
    uint32_t pc = s->pc | 1;
    if (is_in_block && core->interpreter == NULL) {
        core->api.write_register(core->unicorn, REG_PC, &pc);
    } else {
        write_registers(core, &number, &pc, 1);
    }
}

/* Whether the run can go on elsewhere: what clears a reservation is a run of its own. */
static bool may_turn(const struct core *core)
{
    const struct shared *s = &core->shared;
    return !s->uses_exclusive && !s->attention && s->halt_kind == HALT_NONE && !core->is_scratch &&
           !waits_for_python(core->fabric, s->cycle + ENTRY_CYCLES);
}

/* Takes an SVC, or the return from an exception, within the hook that tells of it; false: the run ends for it. */
static bool turns(struct core *core, uint32_t kind, uint32_t pc)
{
    if (kind != HALT_EXCEPTION_RETURN && kind != HALT_SUPERVISOR_CALL) {
        return false;
    }
    charge(core, pc);
    core->shared.is_thumb = 1; /* an instruction has been run */
    if (!may_turn(core) || !(kind == HALT_EXCEPTION_RETURN ? leave(core, pc) : supervisor_call(core, pc))) {
        return false;
    }
    go_elsewhere(core, false);
    return true;
}

static uint32_t kind_of_denied_fetch(uint32_t pc)
{
    return pc >= FIRST_EXCEPTION_RETURN ? HALT_EXCEPTION_RETURN : HALT_EXECUTE_NEVER;
}

/* Unicorn's own numbers of what ends a run; 3 and 8 are told apart by the PC. */
void core_on_interrupt(void *unicorn, uint32_t number, void *user)
{
    (void)unicorn;
    struct core *core = user;
    const uint32_t pc = read_register(core, REG_PC);
    uint32_t kind = HALT_UNDEFINED;
    switch (number) {
    case 2: kind = HALT_SUPERVISOR_CALL; break;
    case 3:
    case 8: kind = kind_of_denied_fetch(pc); break;
    case 4: kind = HALT_UNALIGNED; break;
    case 7: kind = HALT_BKPT; break;
    case 17: kind = HALT_NO_COPROCESSOR; break;
    default: break;
    }
    if (!turns(core, kind, pc)) {
        end_run(core, kind, pc);
    }
}

/* Unicorn takes WFE and YIELD for undefined, with the PC already past them; the rest stands at the PC. */
bool core_on_invalid(void *unicorn, void *user)
{
    (void)unicorn;
    struct core *core = user;
    const uint32_t pc = read_register(core, REG_PC);
    const uint32_t ends = pc == core->block->end ? core->block->flags : 0;
    if (ends & ROW_ENDS_IN_YIELD) {
        return true;
    }
    if (ends & ROW_ENDS_IN_WFE) {
        end_run(core, HALT_WAIT_EVENT, pc);
    } else {
        end_run(core, read_register(core, REG_XPSR) & 1u << 24 ? HALT_UNDEFINED : HALT_INVALID_STATE, pc);
    }
    return true;
}

struct trap {
    struct core *core;
    uint32_t address, number, kind;
};

/* What Unicorn hands back before the instruction at `address`, which looks at a register. */
struct trap *core_trap(struct core *core, uint32_t address, uint32_t number, uint32_t kind)
{
    struct trap *trap = allocate(core, sizeof *trap);
    if (trap != NULL) {
        *trap = (struct trap){core, address, number, kind};
    }
    return trap;
}

/* Before an instruction that may trap: a division, or a transfer that must be aligned. */
void core_on_trap(void *unicorn, uint64_t address, uint32_t size, void *user)
{
    (void)unicorn;
    (void)address;
    (void)size;
    const struct trap *trap = user;
    struct core *core = trap->core;
    const uint32_t value = read_register(core, (int)trap->number);
    if (trap->kind == HALT_UNALIGNED ? (value & 3) != 0 : core->shared.traps_division && value == 0) {
        leave_ahead(core->fabric);
        core->calls.trapped(trap->kind, trap->address, value);
    }
}

/* Breaks the exclusive reservation, by CLREX and WFI on the scratch page. */
void core_clear_exclusive(struct core *core)
{
    if (core->shared.uses_exclusive) {
        core->is_scratch = 1;
        const uint64_t cycle = core->shared.cycle, stop_at = core->shared.stop_at;
        core->shared.stop_at = NEVER;
        core->block = &core->none;
        core->api.start(core->unicorn, core->shared.scratch | 1, NOWHERE, 0, 0);
        core->shared.cycle = cycle;
        core->shared.stop_at = stop_at;
        core->is_scratch = 0;
    }
}

/* Runs to the first boundary at or after `stop_at`, or to what ends the run before; returns why. */
static uint32_t run_slice(struct core *core)
{
    struct shared *s = &core->shared;
    s->halt_kind = HALT_NONE;
    s->halt_has_address = 0;
    s->run_from = s->pc;
    if (s->pc >= FIRST_EXCEPTION_RETURN) { /* from a vector or a stacked PC: an address, and nothing executes there */
        s->halt_pc = s->pc;
        return s->halt_kind = HALT_EXECUTE_NEVER;
    }
    start_anew(core);
    int error = core->api.start(core->unicorn, s->pc | s->is_thumb, NOWHERE, 0, 0);
    while (core->is_stopping) {
        const uint32_t pc = read_register(core, REG_PC);
        go_on_at_access(core, pc);
        error = core->api.start(core->unicorn, pc | 1, NOWHERE, 0, 0);
    }
    if (core->is_elsewhere) {
        core->is_elsewhere = 0;
        return s->halt_kind;
    }
    if (s->halt_kind == HALT_NONE) {
        const uint32_t pc = read_register(core, REG_PC);
        s->halt_pc = pc;
        s->halt_kind = error == DENIED ? kind_of_denied_fetch(pc)
                       : error == 0 && core->block->flags & ROW_ENDS_IN_WFI && pc == core->block->end
                           ? HALT_WAIT_INTERRUPT
                           : HALT_UNEXPLAINED;
        s->halt_address = (uint32_t)error;
    }
    if (s->halt_kind != HALT_FROZEN) {
        s->it_state = core->is_exact && s->halt_kind == HALT_BOUNDARY ? it_state_of(read_register(core, REG_CPSR)) : 0;
        settle(core, s->halt_pc);
    }
    return s->halt_kind;
}

static void fall_asleep(struct core *core, uint32_t what)
{
    struct shared *s = &core->shared;
    s->last_sleep_cycle = s->cycle;
    if (what == FOR_EVENT && s->event_register) {
        s->event_register = 0;
        return;
    }
    s->sleep = what;
}

/* At a boundary within a run: acts on what is due, takes the interrupt that comes of it, and tells whether the run goes on:
 * nothing is for Python, and the time is not up. */
enum way goes_on(struct core *core, uint32_t address)
{
    struct shared *s = &core->shared;
    struct fabric *fabric = core->fabric;
    const bool is_tick = s->cycle >= s->tick_next;
    if (!s->stop_at || s->attention || s->cycle >= core->limit || (!is_tick && s->cycle < fabric->next_cycle) ||
        core->is_scratch || waits_for_python(fabric, s->cycle)) {
        return ENDS;
    }
    core->block = &core->none;
    s->pc = address;
    if (is_tick && systick_advance(s, s->cycle)) {
        pend_tick(core);
    }
    if (s->cycle >= fabric->next_cycle) {
        run_due(fabric, s->cycle);
    }
    uint64_t high;
    const bool is_pending = (s->pending[0] | s->pending[1]) && (deliverable(s, &high) || high);
    if (is_pending) {
        settle_at(core, address); /* asks Unicorn: not at each deadline */
        const int entered = may_turn(core) ? deliver(core) : -1;
        if (entered > 0) {
            go_elsewhere(core, true);
            return ELSEWHERE;
        }
        if (entered < 0) {
            return ENDS;
        }
        s->stop_at = NEVER; /* what is pending has to wait */
    }
    const uint64_t stop = stop_of(core);
    if (!s->stop_at || s->attention || s->halt_kind != HALT_NONE || s->cycle >= stop) {
        return ENDS;
    }
    s->mask_stop = is_pending;
    s->stop_at = stop;
    look_later(core);
    return GOES_ON;
}

static uint32_t run(struct core *core, uint64_t limit)
{
    struct shared *s = &core->shared;
    free_dropped(core);
    s->attention = 0;
    core->limit = limit;
    for (;;) {
        if (s->cycle >= s->tick_next && systick_advance(s, s->cycle)) {
            pend_tick(core);
        }
        if (s->cycle >= core->fabric->next_cycle) {
            run_due(core->fabric, s->cycle);
        }
        if (s->attention || s->cycle >= limit) {
            return HALT_BOUNDARY;
        }
        const uint64_t stop = stop_of(core);
        if (s->sleep && !wakes(core)) {
            if (s->cycle < stop) {
                s->cycle = stop;
            }
            continue;
        }
        if (s->pending[0] | s->pending[1]) {
            const int entered = deliver(core);
            if (entered < 0) {
                return HALT_DELIVER;
            }
            if (entered) {
                continue;
            }
            uint64_t high;
            s->mask_stop = deliverable(s, &high) || high;
        } else {
            s->mask_stop = 0;
        }
        s->stop_at = stop;
        look_later(core);
        const uint32_t kind = run_slice(core);
        if ((kind == HALT_WAIT_INTERRUPT || kind == HALT_WAIT_EVENT) && s->scr & SLEEPDEEP) {
            return kind; /* the clocks may stop */
        }
        switch (kind) {
        case HALT_BOUNDARY: break;
        case HALT_WAIT_INTERRUPT: fall_asleep(core, FOR_INTERRUPT); break;
        case HALT_WAIT_EVENT: fall_asleep(core, FOR_EVENT); break;
        case HALT_EXCEPTION_RETURN:
            if (!leave(core, s->halt_pc)) {
                return kind;
            }
            break;
        case HALT_SUPERVISOR_CALL:
            if (!supervisor_call(core, s->halt_pc) && !take_fault(core, kind)) {
                return kind;
            }
            break;
        default:
            if (!take_fault(core, kind)) {
                return kind;
            }
        }
    }
}

/* Goes on to the first boundary at or after `limit`; returns why it ended, HALT_BOUNDARY at a boundary or when asked to. */
uint32_t core_run(struct core *core, uint64_t limit)
{
    core->fabric->may_run_ahead = true;
    const uint32_t kind = run(core, limit);
    leave_ahead(core->fabric);
    core->fabric->may_run_ahead = false;
    core_flush(core);
    return kind;
}
