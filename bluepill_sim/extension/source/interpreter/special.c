/* Special registers: MRS, MSR and CPS, and all registers for the owner.
 *
 * Source: ARMv7-M Architecture Reference Manual B1.4, B5.2.2 and B5.2.3; PM0056 2.1.3 (BASEPRI has its upper four bits).
 */
#include <string.h>

#include "interpreter.h"
#include "registers.h"

enum { MAIN_SP = 8, PROCESS_SP, PRIMASK = 16, BASEPRI, BASEPRI_MAX, FAULTMASK, CONTROL };
enum { FLAGS_MASK = 8, FAULT_FLAG = 1, PRIMASK_FLAG = 2 };

static bool is_privileged(const struct interpreter *s) { return s->is.ipsr || !(s->is.control & NPRIV); }

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

void interpreter_mrs(struct interpreter *s, const struct op *op) { s->is.r[op->d] = read_special(s, op->imm); }

/* `imm`: the number below, the mask above. */
void interpreter_msr(struct interpreter *s, const struct op *op)
{
    const uint32_t number = op->imm & 0xFF, mask = op->imm >> 8, value = s->is.r[op->n], masked = value & BASEPRI_BITS;
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

/* As uc_reg_read and its neighbours. */
int interpreter_reg_read(void *user, int number, void *value)
{
    *(uint32_t *)value = interpreter_get(user, number);
    return NO_ERROR;
}

int interpreter_reg_write(void *user, int number, const void *value)
{
    interpreter_put(user, number, *(const uint32_t *)value);
    return NO_ERROR;
}

int interpreter_reg_read_batch(void *user, const int *numbers, void **values, int count)
{
    for (int n = 0; n < count; ++n) {
        *(uint32_t *)values[n] = interpreter_get(user, numbers[n]);
    }
    return NO_ERROR;
}

int interpreter_reg_write_batch(void *user, const int *numbers, void *const *values, int count)
{
    for (int n = 0; n < count; ++n) {
        interpreter_put(user, numbers[n], *(const uint32_t *)values[n]);
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
