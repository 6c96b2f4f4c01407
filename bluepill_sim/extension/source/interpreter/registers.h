/* The registers of the interpreter as the owner reads and writes them, by Unicorn's numbers: inline, since with numbers that
 * are known a compiler leaves nothing of the choice, and an exception reads and writes some thirty.
 *
 * Source: ARMv7-M Architecture Reference Manual B1.4; PM0056 2.1.3 (BASEPRI has its upper four bits).
 */
#ifndef BLUEPILL_REGISTERS_H
#define BLUEPILL_REGISTERS_H

#include "interpreter.h"

enum { NPRIV = 1, SPSEL = 2, BASEPRI_BITS = 0xF0 };
/* Register numbers of Unicorn 2 (arm.h). */
enum {
    REG_CPSR = 3,
    REG_LR = 10,
    REG_PC,
    REG_SP,
    REG_R0 = 66,
    REG_R12 = 78,
    REG_IPSR = 114,
    REG_MSP,
    REG_PSP,
    REG_CONTROL,
    REG_XPSR = 120,
    REG_PRIMASK = 123,
    REG_BASEPRI,
    REG_FAULTMASK = 126
};

static inline bool uses_process_sp(const struct interpreter *s) { return !s->is.ipsr && s->is.control & SPSEL; }

/* Sets IPSR and CONTROL, and R13 to the stack pointer that they choose. */
static inline void choose_sp(struct interpreter *s, uint32_t ipsr, uint32_t control)
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

static inline uint32_t *stack_pointer(struct interpreter *s, bool is_process)
{
    return is_process == uses_process_sp(s) ? &s->is.r[SP] : &s->is.other_sp;
}

static inline uint32_t interpreter_flags(const struct interpreter *s)
{
    const struct registers *is = &s->is;
    return (uint32_t)(is->nz < 0) << 31 | (uint32_t)((uint32_t)is->nz == 0) << 30 | is->c << 29 | is->v >> 31 << 28 | is->q << 27;
}

static inline void interpreter_set_flags(struct interpreter *s, uint32_t bits)
{
    s->is.nz = (bits >> 31 ? INT64_MIN : 0) | !(bits >> 30 & 1);
    s->is.c = bits >> 29 & 1;
    s->is.v = bits << 3;
    s->is.q = bits >> 27 & 1;
}

/* ITSTATE in an xPSR or CPSR: bits 1:0 at 25, 7:2 at 10. */
static inline uint32_t it_bits(const struct interpreter *s) { return (s->is.it_state & 3) << 25 | (s->is.it_state >> 2) << 10; }
static inline uint32_t it_of(uint32_t bits) { return (bits >> 25 & 3) | (bits >> 10 & 0x3F) << 2; }

static inline __attribute__((always_inline)) uint32_t interpreter_get(struct interpreter *s, int number)
{
    if (number >= REG_R0 && number <= REG_R12) {
        return s->is.r[number - REG_R0];
    }
    switch (number) {
    case REG_SP: return s->is.r[SP];
    case REG_LR: return s->is.r[LR];
    case REG_PC: return s->is.pc;
    case REG_IPSR: return s->is.ipsr;
    case REG_CONTROL: return s->is.control;
    case REG_PRIMASK: return s->is.primask;
    case REG_BASEPRI: return s->is.basepri;
    case REG_FAULTMASK: return s->is.faultmask;
    case REG_CPSR: return interpreter_flags(s) | it_bits(s) | s->is.is_thumb << 5;
    case REG_XPSR: return interpreter_flags(s) | it_bits(s) | s->is.is_thumb << 24 | s->is.ipsr;
    case REG_MSP: return *stack_pointer(s, false);
    case REG_PSP: return *stack_pointer(s, true);
    default: return 0;
    }
}

static inline __attribute__((always_inline)) void interpreter_put(struct interpreter *s, int number, uint32_t value)
{
    if (number >= REG_R0 && number <= REG_R12) {
        s->is.r[number - REG_R0] = value;
        return;
    }
    switch (number) {
    case REG_SP: s->is.r[SP] = value & ~3u; break;
    case REG_LR: s->is.r[LR] = value; break;
    case REG_PC:
        s->is.pc = value & ~1u;
        s->is.is_thumb = value & 1;
        s->is.block_start = 0;
        s->has_jumped = 1;
        break;
    case REG_CPSR:
        interpreter_set_flags(s, value);
        s->is.it_state = it_of(value);
        s->is.is_thumb = value >> 5 & 1;
        break;
    case REG_XPSR: interpreter_set_flags(s, value); break;
    case REG_IPSR: choose_sp(s, value & 0x1FF, s->is.control); break;
    case REG_MSP: *stack_pointer(s, false) = value & ~3u; break;
    case REG_PSP: *stack_pointer(s, true) = value & ~3u; break;
    case REG_CONTROL:
        choose_sp(s, s->is.ipsr, s->is.ipsr ? (value & NPRIV) | (s->is.control & SPSEL) : value & (NPRIV | SPSEL));
        break;
    case REG_PRIMASK: s->is.primask = value & 1; break;
    case REG_BASEPRI: s->is.basepri = value & BASEPRI_BITS; break;
    case REG_FAULTMASK: s->is.faultmask = value & 1; break;
    default: break;
    }
}

#endif
