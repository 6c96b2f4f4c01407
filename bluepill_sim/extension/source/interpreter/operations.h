/* What each micro-operation does that goes on to the next one: data processing, and accesses that end at a fault.
 *
 * R(d) is written; R(n), R(m) and R(a) are read; `imm` is a constant. Operations whose name ends in S set flags. Those that
 * return a bool make accesses: false where the instruction has not been done, and the run ends.
 * Source: ARMv7-M Architecture Reference Manual A2.2.1 (AddWithCarry, shifts), A7.7.
 */
#ifndef BLUEPILL_OPERATIONS_H
#define BLUEPILL_OPERATIONS_H

#include <string.h>

#include "interpreter.h"

#define R(f) s->is.r[op->f]
#define DOES(name) static inline __attribute__((always_inline)) void do_##name(struct interpreter *s, const struct op *op)
#define ACCESSES(name) static inline __attribute__((always_inline)) bool do_##name(struct interpreter *s, const struct op *op)

static inline void set_nz(struct interpreter *s, uint32_t value) { s->is.nz = (int32_t)value; }

static inline uint32_t add_with_flags(struct interpreter *s, uint32_t x, uint32_t y)
{
    const uint32_t sum = x + y;
    set_nz(s, sum);
    s->is.c = sum < x;
    s->is.v = ~(x ^ y) & (x ^ sum);
    return sum;
}

static inline uint32_t subtract_with_flags(struct interpreter *s, uint32_t x, uint32_t y)
{
    const uint32_t difference = x - y;
    set_nz(s, difference);
    s->is.c = x >= y;
    s->is.v = (x ^ y) & (x ^ difference);
    return difference;
}

static inline uint32_t add_with_carry(struct interpreter *s, uint32_t x, uint32_t y)
{
    const uint64_t wide = (uint64_t)x + y + s->is.c;
    const uint32_t sum = (uint32_t)wide;
    set_nz(s, sum);
    s->is.c = (uint32_t)(wide >> 32);
    s->is.v = ~(x ^ y) & (x ^ sum);
    return sum;
}

/* Arithmetic shift; a right shift of a negative number is arithmetic with every compiler that builds this. */
static inline uint32_t asr(uint32_t x, uint32_t by) { return (uint32_t)((int32_t)x >> by); }
static inline uint32_t ror(uint32_t x, uint32_t by) { return x >> (by & 31) | x << (-by & 31); }

DOES(NOP)
{
    (void)s;
    (void)op;
}

/* Moves. */
DOES(MOV_I) { R(d) = op->imm; }
DOES(MOV_R) { R(d) = R(m); }
DOES(MOV_IS) { set_nz(s, R(d) = op->imm); }
DOES(MOV_RS) { set_nz(s, R(d) = R(m)); }
DOES(MVN_R) { R(d) = ~R(m); }
DOES(MVN_RS) { set_nz(s, R(d) = ~R(m)); }
DOES(MOVT) { R(d) = (R(d) & 0xFFFF) | op->imm; }
DOES(SET_C) { s->is.c = op->imm; }
DOES(ALIGN_SP) { R(d) &= ~3u; }

/* Logic: of a constant or a register, without flags and with N and Z. */
#define LOGIC(name, value)                                                                                              \
    DOES(name##_I) { const uint32_t x = R(n), y = op->imm; R(d) = value; }                                              \
    DOES(name##_R) { const uint32_t x = R(n), y = R(m); R(d) = value; }                                                 \
    DOES(name##_IS) { const uint32_t x = R(n), y = op->imm; set_nz(s, R(d) = value); }                                  \
    DOES(name##_RS) { const uint32_t x = R(n), y = R(m); set_nz(s, R(d) = value); }
LOGIC(AND, x & y)
LOGIC(BIC, x & ~y)
LOGIC(ORR, x | y)
LOGIC(ORN, x | ~y)
LOGIC(EOR, x ^ y)
DOES(TST_I) { set_nz(s, R(n) & op->imm); }
DOES(TST_R) { set_nz(s, R(n) & R(m)); }
DOES(TEQ_I) { set_nz(s, R(n) ^ op->imm); }
DOES(TEQ_R) { set_nz(s, R(n) ^ R(m)); }

/* Sums and differences. */
#define SUM(name, value, with_flags)                                                                                    \
    DOES(name##_I) { const uint32_t x = R(n), y = op->imm; R(d) = value; }                                              \
    DOES(name##_R) { const uint32_t x = R(n), y = R(m); R(d) = value; }                                                 \
    DOES(name##_IS) { const uint32_t x = R(n), y = op->imm; R(d) = with_flags; }                                        \
    DOES(name##_RS) { const uint32_t x = R(n), y = R(m); R(d) = with_flags; }
SUM(ADD, x + y, add_with_flags(s, x, y))
SUM(SUB, x - y, subtract_with_flags(s, x, y))
SUM(RSB, y - x, subtract_with_flags(s, y, x))
SUM(ADC, x + y + s->is.c, add_with_carry(s, x, y))
SUM(SBC, x + ~y + s->is.c, add_with_carry(s, x, ~y))
DOES(CMP_I) { subtract_with_flags(s, R(n), op->imm); }
DOES(CMP_R) { subtract_with_flags(s, R(n), R(m)); }
DOES(CMN_I) { add_with_flags(s, R(n), op->imm); }
DOES(CMN_R) { add_with_flags(s, R(n), R(m)); }

/* Shifts by a constant, `imm`: 1 to 31 without flags, 1 to 32 with the carry alone (C) or with N and Z too (S). */
DOES(LSL_I) { R(d) = R(m) << op->imm; }
DOES(LSR_I) { R(d) = R(m) >> op->imm; }
DOES(ASR_I) { R(d) = asr(R(m), op->imm); }
DOES(ROR_I) { R(d) = ror(R(m), op->imm); }
DOES(RRX_I) { R(d) = R(m) >> 1 | s->is.c << 31; }
DOES(LSL_IC)
{
    const uint64_t wide = (uint64_t)R(m) << op->imm;
    s->is.c = (uint32_t)(wide >> 32) & 1;
    R(d) = (uint32_t)wide;
}
DOES(LSR_IC)
{
    const uint64_t wide = R(m);
    s->is.c = (uint32_t)(wide >> (op->imm - 1)) & 1;
    R(d) = (uint32_t)(wide >> op->imm);
}
DOES(ASR_IC)
{
    const int64_t wide = (int32_t)R(m);
    s->is.c = (uint32_t)(wide >> (op->imm - 1)) & 1;
    R(d) = (uint32_t)(wide >> op->imm);
}
DOES(ROR_IC)
{
    R(d) = ror(R(m), op->imm);
    s->is.c = R(d) >> 31;
}
DOES(RRX_IC)
{
    const uint32_t x = R(m);
    R(d) = x >> 1 | s->is.c << 31;
    s->is.c = x & 1;
}
DOES(LSL_IS) { do_LSL_IC(s, op); set_nz(s, R(d)); }
DOES(LSR_IS) { do_LSR_IC(s, op); set_nz(s, R(d)); }
DOES(ASR_IS) { do_ASR_IC(s, op); set_nz(s, R(d)); }

/* Shifts of R(n) by the lowest byte of R(m). */
DOES(LSL_R) { const uint32_t by = R(m) & 0xFF; R(d) = by > 31 ? 0 : R(n) << by; }
DOES(LSR_R) { const uint32_t by = R(m) & 0xFF; R(d) = by > 31 ? 0 : R(n) >> by; }
DOES(ASR_R) { const uint32_t by = R(m) & 0xFF; R(d) = asr(R(n), by > 31 ? 31 : by); }
DOES(ROR_R) { R(d) = ror(R(n), R(m)); }
DOES(LSL_RS)
{
    const uint32_t by = R(m) & 0xFF, x = R(n);
    if (by) {
        s->is.c = by > 32 ? 0 : x >> (32 - by) & 1;
    }
    set_nz(s, R(d) = by > 31 ? 0 : x << by);
}
DOES(LSR_RS)
{
    const uint32_t by = R(m) & 0xFF, x = R(n);
    if (by) {
        s->is.c = by > 32 ? 0 : x >> (by - 1) & 1;
    }
    set_nz(s, R(d) = by > 31 ? 0 : x >> by);
}
DOES(ASR_RS)
{
    const uint32_t by = R(m) & 0xFF, x = R(n);
    if (by) {
        s->is.c = asr(x, by > 31 ? 31 : by - 1) & 1;
    }
    set_nz(s, R(d) = asr(x, by > 31 ? 31 : by));
}
DOES(ROR_RS)
{
    const uint32_t by = R(m) & 0xFF, x = ror(R(n), by);
    if (by) {
        s->is.c = x >> 31;
    }
    set_nz(s, R(d) = x);
}

/* Multiply and divide; R(a) is added to, or holds the upper half. */
DOES(MUL) { R(d) = R(n) * R(m); }
DOES(MUL_S) { set_nz(s, R(d) = R(n) * R(m)); }
DOES(MLA) { R(d) = R(a) + R(n) * R(m); }
DOES(MLS) { R(d) = R(a) - R(n) * R(m); }

static inline void put_long(struct interpreter *s, const struct op *op, uint64_t value)
{
    R(d) = (uint32_t)value;
    R(a) = (uint32_t)(value >> 32);
}

static inline uint64_t signed_product(uint32_t x, uint32_t y) { return (uint64_t)((int64_t)(int32_t)x * (int32_t)y); }
static inline uint64_t long_of(const struct interpreter *s, const struct op *op) { return (uint64_t)R(a) << 32 | R(d); }
DOES(SMULL) { put_long(s, op, signed_product(R(n), R(m))); }
DOES(UMULL) { put_long(s, op, (uint64_t)R(n) * R(m)); }
DOES(SMLAL) { put_long(s, op, long_of(s, op) + signed_product(R(n), R(m))); }
DOES(UMLAL) { put_long(s, op, long_of(s, op) + (uint64_t)R(n) * R(m)); }
ACCESSES(UDIV)
{
    if (UNLIKELY(R(m) == 0)) {
        if (interpreter_is_trapped(s, op, false, 0)) {
            return false;
        }
        R(d) = 0;
        return true;
    }
    R(d) = R(n) / R(m);
    return true;
}
ACCESSES(SDIV)
{
    const int32_t x = (int32_t)R(n), y = (int32_t)R(m);
    if (UNLIKELY(y == 0 && interpreter_is_trapped(s, op, false, 0))) {
        return false;
    }
    R(d) = y == 0 ? 0 : y == -1 ? 0u - (uint32_t)x : (uint32_t)(x / y);
    return true;
}

/* Extend, reverse, count. */
DOES(SXTB) { R(d) = (uint32_t)(int8_t)R(m); }
DOES(SXTH) { R(d) = (uint32_t)(int16_t)R(m); }
DOES(UXTB) { R(d) = (uint8_t)R(m); }
DOES(UXTH) { R(d) = (uint16_t)R(m); }
DOES(REV) { R(d) = __builtin_bswap32(R(m)); }
DOES(REV16) { const uint32_t x = R(m); R(d) = (x >> 8 & 0x00FF00FF) | (x & 0x00FF00FF) << 8; }
DOES(REVSH) { R(d) = (uint32_t)(int16_t)__builtin_bswap16((uint16_t)R(m)); }
DOES(CLZ) { R(d) = R(m) ? (uint32_t)__builtin_clz(R(m)) : 32; }
DOES(RBIT)
{
    uint32_t x = R(m);
    x = (x >> 1 & 0x55555555) | (x & 0x55555555) << 1;
    x = (x >> 2 & 0x33333333) | (x & 0x33333333) << 2;
    x = (x >> 4 & 0x0F0F0F0F) | (x & 0x0F0F0F0F) << 4;
    R(d) = __builtin_bswap32(x);
}

/* Bit fields: `imm` is the mask of the field, in place for BFI, at bit 0 for UBFX; `a` is its lowest bit. */
DOES(UBFX) { R(d) = R(n) >> op->a & op->imm; }
/* `imm` bits stand above the field. */
DOES(SBFX) { R(d) = asr(R(n) << op->imm, op->a); }
DOES(BFI) { R(d) = (R(d) & ~op->imm) | (R(n) << op->a & op->imm); }

/* Saturate to the largest number `imm`, and to its complement, or 0. */
static inline uint32_t saturated(struct interpreter *s, uint32_t x, int32_t least, int32_t most)
{
    const int32_t value = (int32_t)x;
    const int32_t inside = value > most ? most : value < least ? least : value;
    s->is.q |= inside != value;
    return (uint32_t)inside;
}

DOES(SSAT) { R(d) = saturated(s, R(n), ~(int32_t)op->imm, (int32_t)op->imm); }
DOES(USAT) { R(d) = saturated(s, R(n), 0, (int32_t)op->imm); }

/* Special registers. */
DOES(MRS) { interpreter_mrs(s, op); }
DOES(MSR) { interpreter_msr(s, op); }
DOES(CPS) { interpreter_cps(s, op); }
DOES(CLREX)
{
    (void)op;
    s->is.has_exclusive = 0;
}

/* Loads to R(d), stores of R(d): at R(n) + imm, or at R(n) + (R(m) << a). */
static inline uint32_t address_I(const struct interpreter *s, const struct op *op) { return R(n) + op->imm; }
static inline uint32_t address_R(const struct interpreter *s, const struct op *op) { return R(n) + (R(m) << op->a); }

static inline bool load_word(struct interpreter *s, const struct op *op, uint32_t address, uint32_t *word)
{
    const uint32_t at = address - s->sram_base;
    if (LIKELY(at < s->sram_words_end)) {
        memcpy(word, s->sram + at, sizeof *word);
        return true;
    }
    return interpreter_load(s, op, address, 4, word);
}

static inline bool store_word(struct interpreter *s, const struct op *op, uint32_t address, uint32_t word)
{
    const uint32_t at = address - s->sram_base;
    if (LIKELY(at < s->sram_words_end)) {
        memcpy(s->sram + at, &word, sizeof word);
        return true;
    }
    return interpreter_store(s, op, address, 4, word);
}

#define LOAD(name, way, type, unsigned_type)                                                                            \
    ACCESSES(name##_##way)                                                                                              \
    {                                                                                                                   \
        const uint32_t address = address_##way(s, op), at = address - s->sram_base;                                     \
        unsigned_type found;                                                                                            \
        if (LIKELY(at < s->sram_words_end)) {                                                                           \
            memcpy(&found, s->sram + at, sizeof found);                                                                 \
        } else {                                                                                                        \
            uint32_t word;                                                                                              \
            if (!interpreter_load(s, op, address, sizeof found, &word)) {                                               \
                return false;                                                                                           \
            }                                                                                                           \
            found = (unsigned_type)word;                                                                                \
        }                                                                                                               \
        R(d) = (uint32_t)(type)found;                                                                                   \
        return true;                                                                                                    \
    }
#define STORE(name, way, type)                                                                                          \
    ACCESSES(name##_##way)                                                                                              \
    {                                                                                                                   \
        const uint32_t address = address_##way(s, op), at = address - s->sram_base;                                     \
        const type value = (type)R(d);                                                                                  \
        if (LIKELY(at < s->sram_words_end)) {                                                                           \
            memcpy(s->sram + at, &value, sizeof value);                                                                 \
            return true;                                                                                                \
        }                                                                                                               \
        return interpreter_store(s, op, address, sizeof value, value);                                                  \
    }
LOAD(LDR, I, uint32_t, uint32_t)
LOAD(LDR, R, uint32_t, uint32_t)
LOAD(LDRH, I, uint16_t, uint16_t)
LOAD(LDRH, R, uint16_t, uint16_t)
LOAD(LDRB, I, uint8_t, uint8_t)
LOAD(LDRB, R, uint8_t, uint8_t)
LOAD(LDRSH, I, int16_t, uint16_t)
LOAD(LDRSH, R, int16_t, uint16_t)
LOAD(LDRSB, I, int8_t, uint8_t)
LOAD(LDRSB, R, int8_t, uint8_t)
STORE(STR, I, uint32_t)
STORE(STR, R, uint32_t)
STORE(STRH, I, uint16_t)
STORE(STRH, R, uint16_t)
STORE(STRB, I, uint8_t)
STORE(STRB, R, uint8_t)

/* A word that stands at `imm`, mostly in flash. */
ACCESSES(LDR_LITERAL)
{
    const uint32_t at = op->imm - s->flash_base;
    if (LIKELY(at < s->flash_words_end)) {
        memcpy(&R(d), s->flash + at, sizeof R(d));
        return true;
    }
    return interpreter_load(s, op, op->imm, 4, &R(d));
}

/* Transfers of several words from a base that has to be aligned: `m` tells whether that is looked at. */
static inline bool is_misaligned(struct interpreter *s, const struct op *op)
{
    return UNLIKELY(R(n) & 3 && op->m) && interpreter_is_trapped(s, op, true, R(n));
}

/* Two words at R(n) + imm, of R(d) and R(a). */
ACCESSES(LDRD)
{
    const uint32_t address = R(n) + op->imm;
    if (is_misaligned(s, op)) {
        return false;
    }
    return load_word(s, op, address, &R(d)) && load_word(s, op, address + 4, &R(a));
}
ACCESSES(STRD)
{
    const uint32_t address = R(n) + op->imm;
    if (is_misaligned(s, op)) {
        return false;
    }
    return store_word(s, op, address, R(d)) && store_word(s, op, address + 4, R(a));
}

/* Several words: `imm` is the list of registers below, and what is added to R(n) above, in words and signed; R(n) becomes
 * its old value and `a`, in words and signed, where that is not 0. Of LDM, R(d) is loaded for R(n) if that is in the list:
 * the base stays as it is until all words are there. */
static inline uint32_t words(uint8_t count) { return 4 * (uint32_t)(int8_t)count; }
ACCESSES(LDM)
{
    uint32_t address = R(n) + words((uint8_t)(op->imm >> 16)), base = R(n) + words(op->a);
    if (is_misaligned(s, op)) {
        return false;
    }
    for (uint32_t left = op->imm & 0xFFFF; left; left &= left - 1, address += 4) {
        const uint32_t number = (uint32_t)__builtin_ctz(left);
        if (!load_word(s, op, address, number == op->n ? &base : &s->is.r[number])) {
            return false;
        }
    }
    R(n) = base;
    return true;
}
ACCESSES(STM)
{
    uint32_t address = R(n) + words((uint8_t)(op->imm >> 16));
    if (is_misaligned(s, op)) {
        return false;
    }
    for (uint32_t left = op->imm & 0xFFFF; left; left &= left - 1, address += 4) {
        if (!store_word(s, op, address, s->is.r[__builtin_ctz(left)])) {
            return false;
        }
    }
    R(n) += words(op->a);
    return true;
}

/* Exclusive accesses of `a` bytes at R(n) + imm: a store is made if the last LDREX was of that address, and memory still
 * holds what that has read; R(m) is stored, and R(d) tells. */
ACCESSES(LDREX)
{
    const uint32_t address = R(n) + op->imm;
    uint32_t value;
    if (address & (op->a - 1u)) {
        stand_at(s, op);
        interpreter_call_interrupt(s, BY_ALIGNMENT);
        return false;
    }
    if (!interpreter_load(s, op, address, op->a, &value)) {
        return false;
    }
    s->is.has_exclusive = 1;
    s->is.exclusive_address = address;
    s->is.exclusive_value = R(d) = value;
    return true;
}
ACCESSES(STREX)
{
    const uint32_t address = R(n) + op->imm;
    uint32_t value = 1;
    const bool is_same = s->is.has_exclusive && s->is.exclusive_address == address;
    if (is_same && !interpreter_load(s, op, address, op->a, &value)) {
        return false;
    }
    const bool is_made = is_same && value == s->is.exclusive_value;
    if (is_made && !interpreter_store(s, op, address, op->a, R(m))) {
        return false;
    }
    s->is.has_exclusive = 0;
    R(d) = !is_made;
    return true;
}

/* The halfword or byte of a table branch: at R(n) + (R(m) << a), of a + 1 bytes. */
ACCESSES(TABLE)
{
    return interpreter_load(s, op, address_R(s, op), op->a + 1u, &R(d));
}

#endif
