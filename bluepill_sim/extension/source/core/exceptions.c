/* Exceptions of the ordinary kind: entry, return, tail-chaining, SysTick, sleep.
 *
 * What is out of the ordinary (a frame outside SRAM, a vector outside the
 * flash, a lockup) is left to bluepill_sim/core/processor.py, before
 * anything has changed. Faults are faults.c. Source: ARMv7-M Architecture Reference Manual B1.5.
 */
#include <string.h>

#include "core.h"

enum { FRAME_BYTES = 32 };
enum { NMI = 2, HARD_FAULT = 3, SVCALL = 11, DEBUG_MONITOR = 12, SYSTICK = 15, THREAD_PRIORITY = 256 };
enum { MON_STEP = 1 << 18 };
enum { SLEEPONEXIT = 2, SLEEPDEEP = 4, SEVONPEND = 16, STKALIGN = 1 << 9 };
enum { AWAKE, FOR_INTERRUPT, FOR_EVENT };

#define T_BIT (1u << 24)
#define ALIGN_BIT (1u << 9)
#define FLAG_BITS 0xF8000000u
#define CPSR_T (1u << 5)
#define TO_HANDLER 0xFFFFFFF0u
#define TO_THREAD_MSP 0xFFFFFFF8u
#define TO_THREAD_PSP 0xFFFFFFFCu

uint64_t deliverable(const struct shared *s, uint64_t *high)
{
    *high = s->pending[1] & ~s->held[1] & (s->enabled >> (64 - FIRST_IRQ));
    return s->pending[0] & ~s->held[0] & (s->enabled << FIRST_IRQ | ((1u << FIRST_IRQ) - 1));
}

static int priority_of(const struct shared *s, unsigned number)
{
    return number == NMI ? -2 : number == HARD_FAULT ? -1 : s->priorities[number];
}

static int group(const struct shared *s, int priority)
{
    return priority < 0 || priority >= THREAD_PRIORITY ? priority : priority & ~(int)((2u << s->grouping) - 1);
}

/* The enabled pending exception of the highest priority, the lowest number among equals; 0: none. */
unsigned first_pending(const struct shared *s)
{
    uint64_t words[2];
    words[0] = deliverable(s, &words[1]);
    unsigned best = 0;
    int best_priority = 1 << 10;
    for (unsigned word = 0; word < 2; ++word) {
        for (uint64_t left = words[word]; left; left &= left - 1) {
            const unsigned number = 64 * word + (unsigned)__builtin_ctzll(left);
            const int priority = priority_of(s, number);
            if (priority < best_priority) {
                best = number;
                best_priority = priority;
            }
        }
    }
    return best;
}

static int active_priority(const struct shared *s)
{
    int best = THREAD_PRIORITY;
    for (unsigned word = 0; word < 2; ++word) {
        for (uint64_t left = s->active[word]; left; left &= left - 1) {
            const int one = group(s, priority_of(s, 64 * word + (unsigned)__builtin_ctzll(left)));
            best = one < best ? one : best;
        }
    }
    return best;
}

static int execution_priority(struct core *core, bool ignores_primask)
{
    const struct shared *s = &core->shared;
    static const int numbers[3] = {REG_PRIMASK, REG_BASEPRI, REG_FAULTMASK};
    uint32_t masks[3];
    read_registers(core, numbers, masks, 3);
    int priority = active_priority(s);
    /* Unicorn keeps the low bits of BASEPRI that an STM32F103 does not have. */
    const int base = (int)(masks[1] & 0xF0);
    if (base && group(s, base) < priority) {
        priority = group(s, base);
    }
    if (masks[0] & 1 && !ignores_primask && priority > 0) {
        priority = 0;
    }
    if (masks[2] & 1 && priority > -1) {
        priority = -1;
    }
    return priority;
}

bool can_preempt(struct core *core, unsigned number, bool ignores_primask)
{
    return group(&core->shared, priority_of(&core->shared, number)) < execution_priority(core, ignores_primask);
}

static uint32_t *sram_at(const struct core *core, uint32_t address, uint32_t bytes)
{
    const struct shared *s = &core->shared;
    const uint32_t offset = address - s->sram_base;
    return offset < s->sram_bytes && s->sram_bytes - offset >= bytes && !(address & 3)
               ? (uint32_t *)(uintptr_t)(s->sram + offset)
               : NULL;
}

/* The handler of an exception; 0 where Python has to look. */
uint32_t vector(const struct core *core, unsigned number)
{
    const struct shared *s = &core->shared;
    const uint32_t address = s->vector_table + 4 * number;
    const uint8_t *host;
    if (address - s->flash_base < s->flash_bytes - 3) {
        host = (const uint8_t *)(uintptr_t)s->flash + (address - s->flash_base);
    } else if (address < s->flash_bytes - 3) {
        host = (const uint8_t *)(uintptr_t)s->flash + address;
    } else {
        host = (const uint8_t *)sram_at(core, address, 4);
        if (host == NULL) {
            return 0;
        }
    }
    uint32_t word;
    memcpy(&word, host, sizeof word);
    return word;
}

/* Whether `vector` finds every vector itself. */
static bool has_vectors(const struct core *core)
{
    const struct shared *s = &core->shared;
    const uint32_t bytes = 4 * (FIRST_IRQ + 64);
    return s->vector_table - s->flash_base < s->flash_bytes - bytes || s->vector_table < s->flash_bytes - bytes ||
           sram_at(core, s->vector_table, bytes) != NULL;
}

static void set_bit(uint64_t *words, unsigned number) { words[number >> 6] |= UINT64_C(1) << (number & 63); }
static void clear_bit(uint64_t *words, unsigned number) { words[number >> 6] &= ~(UINT64_C(1) << (number & 63)); }

static void start_handler(struct core *core, unsigned number, uint32_t handler, uint32_t sp, uint32_t link,
                          uint32_t cpsr)
{
    struct shared *s = &core->shared;
    clear_bit(s->pending, number);
    set_bit(s->active, number);
    s->exception_number = number;
    s->event_register = 1;
    s->sleep = AWAKE;
    static const int numbers[4] = {REG_SP, REG_IPSR, REG_CPSR, REG_LR};
    uint32_t values[4] = {sp, number, (cpsr & ~IT_BITS) | CPSR_T, link};
    write_registers(core, numbers, values, 4);
    core_clear_exclusive(core);
    s->pc = handler & ~1u;
    s->is_thumb = handler & 1;
    s->it_state = 0;
}

static void act_on_due(struct core *core)
{
    struct shared *s = &core->shared;
    if (s->cycle >= s->tick_next && systick_advance(s, s->cycle)) {
        pend_tick(core);
    }
    if (s->cycle >= core->fabric->next_cycle) {
        run_events(core->fabric, ns_of(core->fabric, s->cycle));
    }
}

/* The exception that is to be taken now; 0: none is. */
static unsigned taken_now(struct core *core)
{
    const unsigned number = first_pending(&core->shared);
    return number && can_preempt(core, number, false) ? number : 0;
}

/* Where it is exact: the exception that comes while the frame is read, for which that is given up (TRM 5.6); time goes on to
 * when it comes. 0: none does. */
static unsigned coming_on_return(struct core *core)
{
    struct shared *s = &core->shared;
    const uint64_t began = s->cycle, end = began + EXIT_CYCLES;
    for (uint64_t next; core->is_exact && (next = core_next_event(core)) < end && !waits_for_python(core->fabric, next);) {
        s->cycle = next;
        act_on_due(core);
        const unsigned number = taken_now(core);
        if (number) {
            return number;
        }
    }
    s->cycle = began;
    return 0;
}

/* Acts on what comes while the frame is written; returns the exception whose handler starts: one that comes late and has
 * a higher priority, while the other stays pending (ARM B1.5.9). */
static unsigned latest(struct core *core, unsigned number)
{
    struct shared *s = &core->shared;
    act_on_due(core);
    const unsigned first = first_pending(s);
    if (!first || group(s, priority_of(s, first)) >= group(s, priority_of(s, number)) || !vector(core, first)) {
        return number;
    }
    set_bit(s->pending, number);
    return first;
}

/* The exception comes in the midst of an instruction: where that is an LDM or STM, it goes on behind it with the words that
 * are not moved yet. Chosen: the first one takes two cycles, each other one. Not so where the frame is a fault. */
static void leave_undone(struct core *core)
{
    const uint32_t room = FRAME_BYTES + 4 + 4 * 16, sp = read_register(core, REG_SP);
    if (core->within > 1 && sram_at(core, sp - room, room) != NULL) {
        interpreter_move_some(core->interpreter, (uint32_t)core->within - 1);
    }
}

bool enter(struct core *core, unsigned number, uint32_t return_address)
{
    struct shared *s = &core->shared;
    const uint32_t handler = vector(core, number);
    if (handler == 0) {
        return false;
    }
    leave_undone(core);
    static const int numbers[10] = {REG_R0,     REG_R0 + 1, REG_R0 + 2, REG_R0 + 3,  REG_R12,
                                    REG_LR,     REG_XPSR,   REG_SP,     REG_CONTROL, REG_CPSR};
    uint32_t value[10];
    read_registers(core, numbers, value, 10);
    const uint32_t control = value[8], cpsr = value[9];
    uint32_t frame_at = value[7] - FRAME_BYTES;
    uint32_t xpsr = (value[6] & ~(T_BIT | ALIGN_BIT)) | (s->is_thumb ? T_BIT : 0) | s->exception_number;
    if (s->ccr & STKALIGN && frame_at & 4) {
        frame_at -= 4;
        xpsr |= ALIGN_BIT;
    }
    uint32_t *frame = sram_at(core, frame_at, FRAME_BYTES);
    if (frame == NULL) {
        return false;
    }
    const uint32_t words[8] = {value[0], value[1], value[2], value[3], value[4], value[5], return_address, xpsr};
    memcpy(frame, words, sizeof words);
    const uint32_t exc_return = s->exception_number ? TO_HANDLER : control & SPSEL ? TO_THREAD_PSP : TO_THREAD_MSP;
    const uint64_t began = s->cycle;
    s->cycle += ENTRY_CYCLES;
    const unsigned taken = latest(core, number);
    record_at(core, began, return_address, (int32_t)taken);
    start_handler(core, taken, taken == number ? handler : vector(core, taken), frame_at, exc_return | 1, cpsr);
    return true;
}

/* 1: an exception was entered; 0: none may be; -1: Python has to. */
int deliver(struct core *core)
{
    const unsigned number = taken_now(core);
    if (!number) {
        return 0;
    }
    if (number == HARD_FAULT) { /* of a buffered store: Python reports it */
        return -1;
    }
    return enter(core, number, core->shared.pc) ? 1 : -1;
}

bool supervisor_call(struct core *core, uint32_t pc)
{
    return can_preempt(core, SVCALL, false) && enter(core, SVCALL, pc);
}

/* Returns from the handler that runs; false: Python has to, and nothing has changed. */
bool leave(struct core *core, uint32_t exc_return)
{
    struct shared *s = &core->shared;
    const unsigned number = s->exception_number;
    const bool to_thread = exc_return == TO_THREAD_MSP || exc_return == TO_THREAD_PSP;
    uint64_t left[2] = {s->active[0], s->active[1]};
    clear_bit(left, number);
    const bool is_last = !left[0] && !left[1];
    if (!number || !(to_thread || exc_return == TO_HANDLER) || to_thread != is_last) {
        return false;
    }
    /* A handler's SP is MSP. */
    static const int numbers[5] = {REG_CONTROL, REG_CPSR, REG_FAULTMASK, REG_SP, REG_PSP};
    uint32_t value[5];
    const bool uses_psp = exc_return == TO_THREAD_PSP;
    read_registers(core, numbers, value, 5);
    const uint32_t control = value[0], cpsr = value[1], msp = value[3], from = value[uses_psp ? 4 : 3];
    uint32_t *frame = sram_at(core, from, FRAME_BYTES);
    const bool may_stop = to_thread && s->scr & SLEEPONEXIT && s->scr & SLEEPDEEP;
    const bool steps = number == DEBUG_MONITOR && s->demcr & MON_STEP;
    const bool is_reported = s->pending[0] >> HARD_FAULT & 1;
    if (frame == NULL || value[2] || may_stop || steps || is_reported || !has_vectors(core)) {
        return false;
    }
    const uint32_t xpsr = frame[7];
    if (to_thread != ((xpsr & 0x1FF) == 0)) {
        return false;
    }
    clear_bit(s->active, number);
    if (number >= FIRST_IRQ && s->levels >> (number - FIRST_IRQ) & 1) {
        set_bit(s->pending, number);
    }
    s->event_register = 1;
    core_clear_exclusive(core);
    unsigned following = taken_now(core);
    if (!following) {
        following = coming_on_return(core);
    }
    if (following) {
        const uint64_t began = s->cycle;
        s->cycle += TAIL_CHAIN_CYCLES;
        following = core->is_exact ? latest(core, following) : following;
        record_at(core, began, exc_return | 1, -1);
        record_at(core, began, exc_return | 1, (int32_t)following);
        start_handler(core, following, vector(core, following), msp, exc_return | 1, cpsr);
        return true;
    }
    s->exception_number = xpsr & 0x1FF;
    const uint32_t select = uses_psp ? SPSEL : 0;
    const uint32_t sp = from + FRAME_BYTES + (xpsr & ALIGN_BIT ? 4 : 0);
    const uint32_t kept = FLAG_BITS | IT_BITS;
    /* CONTROL thrice: nPRIV would forbid the next writes, SPSEL is only taken in thread mode, nPRIV comes last. Each
     * costs as much as five others, and mostly it is what it was.
     */
    static const int to[12] = {REG_CONTROL, REG_IPSR,   REG_CONTROL, REG_SP,  REG_R0, REG_R0 + 1,
                               REG_R0 + 2,  REG_R0 + 3, REG_R12,     REG_LR,  REG_CONTROL, REG_CPSR};
    static const int to_same[9] = {REG_IPSR,   REG_SP,  REG_R0, REG_R0 + 1, REG_R0 + 2,
                                   REG_R0 + 3, REG_R12, REG_LR, REG_CPSR};
    const uint32_t pc = frame[6], number_after = s->exception_number, cpsr_after = (cpsr & ~kept) | (xpsr & kept) | CPSR_T;
    if (control == select) {
        uint32_t values[9] = {number_after, sp, frame[0], frame[1], frame[2], frame[3], frame[4], frame[5], cpsr_after};
        write_registers(core, to_same, values, 9);
    } else {
        uint32_t values[12] = {0,        number_after, select,   sp,       frame[0], frame[1],
                               frame[2], frame[3],     frame[4], frame[5], (control & NPRIV) | select, cpsr_after};
        write_registers(core, to, values, 12);
    }
    s->pc = pc & ~1u;
    s->is_thumb = (xpsr & T_BIT) != 0;
    s->it_state = it_state_of(xpsr);
    record(core, s->pc, -1);
    if (to_thread && s->scr & SLEEPONEXIT) {
        s->last_sleep_cycle = s->cycle;
        s->sleep = FOR_INTERRUPT;
    }
    s->cycle += EXIT_CYCLES;
    return true;
}

/* Wakes the core if there is reason to; returns whether it is awake. */
bool wakes(struct core *core)
{
    struct shared *s = &core->shared;
    const unsigned number = first_pending(s);
    /* An exception that PRIMASK alone holds back wakes WFI, but not WFE. */
    if (number && can_preempt(core, number, s->sleep == FOR_INTERRUPT)) {
        s->sleep = AWAKE;
    }
    if (s->sleep == FOR_EVENT && s->event_register) {
        s->event_register = 0;
        s->sleep = AWAKE;
    }
    return s->sleep == AWAKE;
}

/* Makes an exception pending, at a boundary. */
void pend(struct core *core, unsigned number)
{
    set_bit(core->shared.pending, number);
    if (core->shared.scr & SEVONPEND) {
        core->shared.event_register = 1;
    }
}

/* The same of an interrupt of a device that came at a cycle: where its latency is varied it is taken later. */
void pend_late(struct core *core, unsigned number, uint64_t cycle)
{
    const bool is_new = !(core->shared.pending[number >> 6] >> (number & 63) & 1);
    pend(core, number);
    if (core->latency != NULL && is_new) {
        put_off(core, number, cycle);
    }
}

/* And of SysTick, which has just come to 0. */
void pend_tick(struct core *core) { pend_late(core, SYSTICK, core->shared.tick.base); }

/* An access has changed what is pending, enabled or its priority: as `Processor.pending_changed`. */
void pending_changed(struct core *core, uint32_t pc)
{
    struct shared *s = &core->shared;
    uint64_t high;
    if (s->scr & SEVONPEND && (s->pending[0] | s->pending[1])) {
        s->event_register = 1;
    }
    if (deliverable(s, &high) || high) {
        s->raised_cycle = s->cycle;
        s->raised_pc = pc;
        s->stop_at = 0;
    }
}

/* Whether an exception is pending that may interrupt what runs. */
bool is_interrupted(struct core *core)
{
    return taken_now(core) != 0;
}
