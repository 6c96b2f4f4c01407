/* Special registers: MRS, MSR and CPS, and the registers as the owner reads and writes them, by Unicorn's numbers.
 *
 * Source: ARMv7-M Architecture Reference Manual B1.4, B5.2.2 and B5.2.3; PM0056 2.1.3 (BASEPRI has its upper four bits).
 */
#include <string.h>

#include "operations.h"

enum { PRIVILEGED_ONLY = 5, MAIN_SP = 8, PROCESS_SP, PRIMASK = 16, BASEPRI, BASEPRI_MAX, FAULTMASK, CONTROL };
enum { NPRIV = 1, SPSEL = 2, BASEPRI_BITS = 0xF0, FLAGS_MASK = 8, FAULT_FLAG = 1, PRIMASK_FLAG = 2 };
#define FLAG_BITS 0xF8000000u
/* Of arm.h. */
enum { UC_CPSR = 3, UC_LR = 10, UC_PC, UC_SP, UC_R0 = 66, UC_R12 = 78, UC_IPSR = 114, UC_MSP, UC_PSP, UC_CONTROL, UC_XPSR = 120,
       UC_PRIMASK = 123, UC_BASEPRI, UC_FAULTMASK = 126 };

static bool is_privileged(const struct interpreter *s) { return s->is.ipsr || !(s->is.control & NPRIV); }
static bool uses_process_sp(const struct interpreter *s) { return !s->is.ipsr && s->is.control & SPSEL; }

/* Sets IPSR and CONTROL, and R13 to the stack pointer that they choose. */
static void choose_sp(struct interpreter *s, uint32_t ipsr, uint32_t control)
{
    const bool before = uses_process_sp(s);
    s->is.ipsr = ipsr;
    s->is.control = control;
    if (uses_process_sp(s) != before) {
        const uint32_t sp = s->is.r[SP];
        s->is.r[SP] = s->is.other_sp;
        s->is.other_sp = sp;
    }
}

static uint32_t *stack_pointer(struct interpreter *s, bool is_process)
{
    return is_process == uses_process_sp(s) ? &s->is.r[SP] : &s->is.other_sp;
}

uint32_t interpreter_flags(const struct interpreter *s)
{
    const struct registers *is = &s->is;
    return (uint32_t)(is->nz < 0) << 31 | (uint32_t)((uint32_t)is->nz == 0) << 30 | is->c << 29 | is->v >> 31 << 28 | is->q << 27;
}

void interpreter_set_flags(struct interpreter *s, uint32_t bits)
{
    s->is.nz = (bits >> 31 ? INT64_MIN : 0) | !(bits >> 30 & 1);
    s->is.c = bits >> 29 & 1;
    s->is.v = bits << 3;
    s->is.q = bits >> 27 & 1;
}

/* ITSTATE in an xPSR or CPSR: bits 1:0 at 25, 7:2 at 10. */
static uint32_t it_bits(const struct interpreter *s) { return (s->is.it_state & 3) << 25 | (s->is.it_state >> 2) << 10; }
static uint32_t it_of(uint32_t bits) { return (bits >> 25 & 3) | (bits >> 10 & 0x3F) << 2; }

static uint32_t read_special(struct interpreter *s, uint32_t number)
{
    if (number < MAIN_SP) { /* bit 0: with IPSR, bit 2: without the flags; EPSR reads 0 */
        return (number & 1 ? s->is.ipsr : 0) | (number & 4 ? 0 : interpreter_flags(s));
    }
    if (number == CONTROL) {
        return s->is.control;
    }
    if (!is_privileged(s)) {
        return 0;
    }
    switch (number) {
    case MAIN_SP: return *stack_pointer(s, false);
    case PROCESS_SP: return *stack_pointer(s, true);
    case PRIMASK: return s->is.primask;
    case BASEPRI:
    case BASEPRI_MAX: return s->is.basepri;
    case FAULTMASK: return s->is.faultmask;
    default: return 0;
    }
}

void interpreter_mrs(struct interpreter *s, const struct op *op) { R(d) = read_special(s, op->imm); }

/* `imm`: the number below, the mask above. */
void interpreter_msr(struct interpreter *s, const struct op *op)
{
    const uint32_t number = op->imm & 0xFF, mask = op->imm >> 8, value = R(n), masked = value & BASEPRI_BITS;
    if (number < MAIN_SP) {
        if (!(number & 4) && mask & FLAGS_MASK >> 2) {
            interpreter_set_flags(s, value);
        }
        return;
    }
    if (!is_privileged(s)) {
        return;
    }
    switch (number) {
    case MAIN_SP: *stack_pointer(s, false) = value & ~3u; break;
    case PROCESS_SP: *stack_pointer(s, true) = value & ~3u; break;
    case PRIMASK: s->is.primask = value & 1; break;
    case BASEPRI: s->is.basepri = masked; break;
    case BASEPRI_MAX:
        if (masked && (masked < s->is.basepri || !s->is.basepri)) {
            s->is.basepri = masked;
        }
        break;
    case FAULTMASK: s->is.faultmask = value & 1; break;
    case CONTROL: /* SPSEL is taken in thread mode alone */
        choose_sp(s, s->is.ipsr, s->is.ipsr ? (value & NPRIV) | (s->is.control & SPSEL) : value & (NPRIV | SPSEL));
        break;
    default: break;
    }
}

/* `imm`: flags, and above them whether they are set. */
void interpreter_cps(struct interpreter *s, const struct op *op)
{
    const uint32_t is_set = op->imm >> 2;
    if (is_privileged(s)) {
        s->is.primask = op->imm & PRIMASK_FLAG ? is_set : s->is.primask;
        s->is.faultmask = op->imm & FAULT_FLAG ? is_set : s->is.faultmask;
    }
}

static uint32_t get(struct interpreter *s, int number)
{
    if (number >= UC_R0 && number <= UC_R12) {
        return s->is.r[number - UC_R0];
    }
    switch (number) {
    case UC_SP: return s->is.r[SP];
    case UC_LR: return s->is.r[LR];
    case UC_PC: return s->is.pc;
    case UC_CPSR: return interpreter_flags(s) | it_bits(s) | s->is.is_thumb << 5;
    case UC_XPSR: return interpreter_flags(s) | it_bits(s) | s->is.is_thumb << 24 | s->is.ipsr;
    case UC_IPSR: return s->is.ipsr;
    case UC_MSP: return *stack_pointer(s, false);
    case UC_PSP: return *stack_pointer(s, true);
    case UC_CONTROL: return s->is.control;
    case UC_PRIMASK: return s->is.primask;
    case UC_BASEPRI: return s->is.basepri;
    case UC_FAULTMASK: return s->is.faultmask;
    default: return 0;
    }
}

static void put(struct interpreter *s, int number, uint32_t value)
{
    if (number >= UC_R0 && number <= UC_R12) {
        s->is.r[number - UC_R0] = value;
        return;
    }
    switch (number) {
    case UC_SP: s->is.r[SP] = value & ~3u; break;
    case UC_LR: s->is.r[LR] = value; break;
    case UC_PC:
        s->is.pc = value & ~1u;
        s->is.is_thumb = value & 1;
        s->is.block_start = 0;
        s->has_jumped = 1;
        break;
    case UC_CPSR:
        interpreter_set_flags(s, value);
        s->is.it_state = it_of(value);
        s->is.is_thumb = value >> 5 & 1;
        break;
    case UC_XPSR: interpreter_set_flags(s, value); break;
    case UC_IPSR: choose_sp(s, value & 0x1FF, s->is.control); break;
    case UC_MSP: *stack_pointer(s, false) = value & ~3u; break;
    case UC_PSP: *stack_pointer(s, true) = value & ~3u; break;
    case UC_CONTROL:
        choose_sp(s, s->is.ipsr, s->is.ipsr ? (value & NPRIV) | (s->is.control & SPSEL) : value & (NPRIV | SPSEL));
        break;
    case UC_PRIMASK: s->is.primask = value & 1; break;
    case UC_BASEPRI: s->is.basepri = value & BASEPRI_BITS; break;
    case UC_FAULTMASK: s->is.faultmask = value & 1; break;
    default: break;
    }
}

/* As uc_reg_read and its neighbours. */
int interpreter_reg_read(void *user, int number, void *value)
{
    *(uint32_t *)value = get(user, number);
    return NO_ERROR;
}

int interpreter_reg_write(void *user, int number, const void *value)
{
    put(user, number, *(const uint32_t *)value);
    return NO_ERROR;
}

int interpreter_reg_read_batch(void *user, const int *numbers, void **values, int count)
{
    for (int n = 0; n < count; ++n) {
        *(uint32_t *)values[n] = get(user, numbers[n]);
    }
    return NO_ERROR;
}

int interpreter_reg_write_batch(void *user, const int *numbers, void *const *values, int count)
{
    for (int n = 0; n < count; ++n) {
        put(user, numbers[n], *(const uint32_t *)values[n]);
    }
    return NO_ERROR;
}

size_t interpreter_context_bytes(void) { return sizeof(struct registers); }

/* All registers, for a snapshot: flags as they read, scratch words as 0. */
void interpreter_save(struct interpreter *s, void *to)
{
    interpreter_set_flags(s, interpreter_flags(s));
    struct registers copy = s->is;
    memset(&copy.r[PC], 0, (REGISTERS - PC) * sizeof copy.r[0]);
    if (!stands_inside(s, s->is.pc)) {
        copy.block_start = copy.block_end = 0;
    }
    memcpy(to, &copy, sizeof copy);
}

void interpreter_restore(struct interpreter *s, const void *from) { memcpy(&s->is, from, sizeof s->is); }
