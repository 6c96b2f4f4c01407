/* Faults of the ordinary kind: the access that is one, and the entry of its exception or of HardFault.
 *
 * Lockups, and what exceptions.c leaves to Python, are bluepill_sim/core/processor.py's, before anything has changed. A
 * HardFault that is entered here is kept for Python, which reports the last one when the run has ended: nobody could
 * have asked before. Source: ARMv7-M Architecture Reference Manual B1.5.14, B3.2.15 to B3.2.18.
 */
#include <string.h>

#include "core.h"

enum { HARD_FAULT = 3, DISDEFWBUF = 2 };
#define MEMFAULTENA (1u << 16)
#define FORCED (1u << 30)
#define MON_EN (1u << 16)
#define DFSR_BKPT 2
/* Kinds of accesses (unicorn.h). */
enum { WRITE_UNMAPPED = 20, FETCH_UNMAPPED = 21, WRITE_PROTECTED = 22, FETCH_PROTECTED = 24 };

/* Says what a kind of halt raises: the rows of bluepill_sim/core/faults.py. */
void core_set_fault(struct core *core, uint32_t kind, uint32_t exception, uint32_t cfsr, uint32_t hfsr)
{
    core->faults[kind] = (struct fault_row){exception, cfsr, hfsr};
}

/* Whether a store to flash is made without ending the run, and the core has waited for what it begins. */
static bool may_write_at_once(struct core *core, int kind)
{
    const struct shared *s = &core->shared;
    return kind == WRITE_PROTECTED && !s->is_python && s->halt_kind == HALT_NONE && s->stop_at && !core->view_count &&
           core->records == NULL && core->block != &core->none && !(core->block->flags & (ROW_AMBIGUOUS | ROW_NOTED)) &&
           !(read_register(core, REG_CPSR) & IT_BITS);
}

/* An access to nothing, or against the protection: false ends the run at its instruction. */
bool core_on_bad_access(void *unicorn, int kind, uint64_t address, int size, int64_t value, void *user)
{
    (void)unicorn;
    struct core *core = user;
    struct shared *s = &core->shared;
    const bool is_buffered = kind == WRITE_UNMAPPED && !(s->actlr & DISDEFWBUF);
    leave_ahead(core->fabric);
    if (may_write_at_once(core, kind) && core->calls.write_at_once((uint32_t)address, (uint32_t)size, next_stop(core))) {
        core->waiting.has_acted = 1;
        return true;
    }
    if (s->is_python || is_buffered || kind == WRITE_PROTECTED || kind == FETCH_PROTECTED) {
        return core->calls.bad_access((uint32_t)kind, (uint32_t)address, (uint32_t)size, (uint64_t)value);
    }
    if (s->halt_kind != HALT_FROZEN) {
        s->halt_kind = kind == WRITE_UNMAPPED ? HALT_WRITE_ERROR : kind == FETCH_UNMAPPED ? HALT_FETCH_ERROR : HALT_READ_ERROR;
        s->halt_pc = read_register(core, REG_PC);
        s->halt_address = (uint32_t)address;
        s->halt_has_address = 1;
    }
    return false;
}

/* Returns what Python reports of a HardFault that is about to be entered. */
static struct fault look(struct core *core, uint32_t kind)
{
    static const int numbers[16] = {REG_R0,     REG_R0 + 1, REG_R0 + 2, REG_R0 + 3, REG_R0 + 4,  REG_R0 + 5,
                                    REG_R0 + 6, REG_R0 + 7, REG_R0 + 8, REG_R0 + 9, REG_R0 + 10, REG_R0 + 11,
                                    REG_R12,    REG_SP,     REG_LR,     REG_XPSR};
    const struct shared *s = &core->shared;
    const uint64_t now_ns = ns_of(core->fabric, s->cycle);
    struct fault seen = {
        .ns = now_ns,
        .last_ns = now_ns,
        .kind = kind,
        .pc = s->halt_pc,
        .address = s->halt_address,
        .has_address = s->halt_has_address,
        .exception_number = s->exception_number,
        .vector = s->exception_number ? vector(core, s->exception_number) : 0,
        .logged = s->logged,
    };
    read_registers(core, numbers, seen.registers, 16);
    memcpy(seen.last, s->last, sizeof seen.last);
    return seen;
}

/* Keeps it; or counts it, where nothing has changed since the one that is kept. */
static void keep(struct shared *s, const struct fault *seen)
{
    struct fault *fault = &s->fault;
    if (s->has_fault && fault->kind == seen->kind && fault->pc == seen->pc &&
        !memcmp(fault->registers, seen->registers, sizeof seen->registers)) {
        fault->returns++;
        fault->round_ns = seen->ns - fault->last_ns;
        fault->last_ns = seen->ns;
        return;
    }
    *fault = *seen;
    fault->is_other = s->has_fault;
    s->has_fault = 1;
}

/* Enters the exception of what has ended the run; false: Python has to, or it is none, and nothing has changed. */
bool take_fault(struct core *core, uint32_t kind)
{
    struct shared *s = &core->shared;
    const struct fault_row *row = &core->faults[kind];
    if (s->attention) {
        return false; /* what Python was asked for in this block may come first: a reset */
    }
    if (!row->exception || (kind == HALT_BKPT && (s->has_debugger || s->demcr & MON_EN)) || (kind == HALT_SUPERVISOR_CALL && !s->knows_masked_svc)) {
        return false;
    }
    uint32_t number = row->exception, forced = 0;
    const bool is_enabled = number == HARD_FAULT || s->shcsr & MEMFAULTENA << (number - 4);
    if (!is_enabled || !can_preempt(core, number, false)) {
        number = HARD_FAULT;
        forced = FORCED;
    }
    if (number == HARD_FAULT) {
        if (s->has_debugger || !can_preempt(core, number, false)) {
            return false;
        }
    }
    const bool is_reported = number == HARD_FAULT && kind != HALT_SUPERVISOR_CALL;
    struct fault seen = {0};
    if (is_reported) {
        seen = look(core, kind);
    }
    if (!enter(core, number, s->halt_pc)) {
        return false;
    }
    s->dfsr |= kind == HALT_BKPT ? DFSR_BKPT : 0;
    s->cfsr |= row->cfsr;
    s->hfsr |= row->hfsr | forced;
    if (s->halt_has_address && (kind == HALT_READ_ERROR || kind == HALT_WRITE_ERROR)) {
        s->bfar = s->halt_address;
    }
    if (is_reported) {
        keep(s, &seen);
    }
    return true;
}
