/* What each micro-operation does that goes on to the next one: data processing, and accesses that end at a fault.
 *
 * `x` is R(n) and `y` is R(m), which the caller has read, or knows from what was done last; R(d) is written, R(a) is read,
 * `imm` is a constant. What writes R(d) leaves it in `last`, too. Operations whose name ends in S set flags. Those that
 * return a bool make accesses: false where the instruction has not been done, and the run ends, or where it has been and the
 * core does not go on to the next one.
 * Source: ARMv7-M Architecture Reference Manual A2.2.1 (AddWithCarry, shifts), A7.7.
 */
#ifndef BLUEPILL_OPERATIONS_H
#define BLUEPILL_OPERATIONS_H

#include <string.h>

#include "interpreter.h"

#define R(f) s->is.r[op->f]
/* Not all of them use each of these. */
#define GIVEN                                                                                                           \
    __attribute__((unused)) struct interpreter *s, __attribute__((unused)) const struct op *op,                         \
        __attribute__((unused)) uint32_t x, __attribute__((unused)) uint32_t y, __attribute__((unused)) uint32_t *last
#define AT_ONCE static inline __attribute__((always_inline))
#define DOES(name) AT_ONCE void do_##name(GIVEN)
#define ACCESSES(name) AT_ONCE bool do_##name(GIVEN)
#define PUT(value) (*last = R(d) = (value))

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

DOES(NOP) {}

/* Moves. */
DOES(MOV_I) { PUT(op->imm); }
DOES(MOV_R) { PUT(y); }
DOES(MOV_IS) { set_nz(s, PUT(op->imm)); }
DOES(MOV_RS) { set_nz(s, PUT(y)); }
DOES(MVN_R) { PUT(~y); }
DOES(MVN_RS) { set_nz(s, PUT(~y)); }
DOES(MOVT) { PUT((R(d) & 0xFFFF) | op->imm); }
DOES(SET_C) { s->is.c = op->imm; }
DOES(ALIGN_SP) { R(d) &= ~3u; }

/* Logic: of a constant or a register, without flags and with N and Z. */
#define LOGIC(name, value)                                                                                              \
    DOES(name##_I) { y = op->imm; PUT(value); }                                              \
    DOES(name##_R) { PUT(value); }                                                 \
    DOES(name##_IS) { y = op->imm; set_nz(s, PUT(value)); }                                  \
    DOES(name##_RS) { set_nz(s, PUT(value)); }
LOGIC(AND, x & y)
LOGIC(BIC, x & ~y)
LOGIC(ORR, x | y)
LOGIC(ORN, x | ~y)
LOGIC(EOR, x ^ y)
DOES(TST_I) { set_nz(s, x & op->imm); }
DOES(TST_R) { set_nz(s, x & y); }
DOES(TEQ_I) { set_nz(s, x ^ op->imm); }
DOES(TEQ_R) { set_nz(s, x ^ y); }

/* Sums and differences. */
#define SUM(name, value, with_flags)                                                                                    \
    DOES(name##_I) { y = op->imm; PUT(value); }                                              \
    DOES(name##_R) { PUT(value); }                                                 \
    DOES(name##_IS) { y = op->imm; PUT(with_flags); }                                        \
    DOES(name##_RS) { PUT(with_flags); }
SUM(ADD, x + y, add_with_flags(s, x, y))
SUM(SUB, x - y, subtract_with_flags(s, x, y))
SUM(RSB, y - x, subtract_with_flags(s, y, x))
SUM(ADC, x + y + s->is.c, add_with_carry(s, x, y))
SUM(SBC, x + ~y + s->is.c, add_with_carry(s, x, ~y))
/* The same of a register that is shifted by a constant, `imm`: 1 to 31. */
#define SHIFTED_WAYS(name, value)                                                                                       \
    DOES(name##_LSL) { y = y << op->imm; PUT(value); }                                    \
    DOES(name##_LSR) { y = y >> op->imm; PUT(value); }                                    \
    DOES(name##_ASR) { y = asr(y, op->imm); PUT(value); }
SHIFTED_WAYS(AND, x & y)
SHIFTED_WAYS(BIC, x & ~y)
SHIFTED_WAYS(ORR, x | y)
SHIFTED_WAYS(EOR, x ^ y)
SHIFTED_WAYS(ADD, x + y)
SHIFTED_WAYS(SUB, x - y)
SHIFTED_WAYS(RSB, y - x)
DOES(CMP_I) { subtract_with_flags(s, x, op->imm); }
DOES(CMP_R) { subtract_with_flags(s, x, y); }
DOES(CMN_I) { add_with_flags(s, x, op->imm); }
DOES(CMN_R) { add_with_flags(s, x, y); }

/* Shifts by a constant, `imm`: 1 to 31 without flags, 1 to 32 with the carry alone (C) or with N and Z too (S). */
DOES(LSL_I) { PUT(y << op->imm); }
DOES(LSR_I) { PUT(y >> op->imm); }
DOES(ASR_I) { PUT(asr(y, op->imm)); }
DOES(ROR_I) { PUT(ror(y, op->imm)); }
DOES(RRX_I) { PUT(y >> 1 | s->is.c << 31); }
DOES(LSL_IC)
{
    const uint64_t wide = (uint64_t)y << op->imm;
    s->is.c = (uint32_t)(wide >> 32) & 1;
    PUT((uint32_t)wide);
}
DOES(LSR_IC)
{
    const uint64_t wide = y;
    s->is.c = (uint32_t)(wide >> (op->imm - 1)) & 1;
    PUT((uint32_t)(wide >> op->imm));
}
DOES(ASR_IC)
{
    const int64_t wide = (int32_t)y;
    s->is.c = (uint32_t)(wide >> (op->imm - 1)) & 1;
    PUT((uint32_t)(wide >> op->imm));
}
DOES(ROR_IC)
{
    PUT(ror(y, op->imm));
    s->is.c = *last >> 31;
}
DOES(RRX_IC)
{
    PUT(y >> 1 | s->is.c << 31);
    s->is.c = y & 1;
}
DOES(LSL_IS) { do_LSL_IC(s, op, x, y, last); set_nz(s, *last); }
DOES(LSR_IS) { do_LSR_IC(s, op, x, y, last); set_nz(s, *last); }
DOES(ASR_IS) { do_ASR_IC(s, op, x, y, last); set_nz(s, *last); }

/* Shifts of x by the lowest byte of y. */
DOES(LSL_R) { const uint32_t by = y & 0xFF; PUT(by > 31 ? 0 : x << by); }
DOES(LSR_R) { const uint32_t by = y & 0xFF; PUT(by > 31 ? 0 : x >> by); }
DOES(ASR_R) { const uint32_t by = y & 0xFF; PUT(asr(x, by > 31 ? 31 : by)); }
DOES(ROR_R) { PUT(ror(x, y)); }
DOES(LSL_RS)
{
    const uint32_t by = y & 0xFF;
    if (by) {
        s->is.c = by > 32 ? 0 : x >> (32 - by) & 1;
    }
    set_nz(s, PUT(by > 31 ? 0 : x << by));
}
DOES(LSR_RS)
{
    const uint32_t by = y & 0xFF;
    if (by) {
        s->is.c = by > 32 ? 0 : x >> (by - 1) & 1;
    }
    set_nz(s, PUT(by > 31 ? 0 : x >> by));
}
DOES(ASR_RS)
{
    const uint32_t by = y & 0xFF;
    if (by) {
        s->is.c = asr(x, by > 31 ? 31 : by - 1) & 1;
    }
    set_nz(s, PUT(asr(x, by > 31 ? 31 : by)));
}
DOES(ROR_RS)
{
    const uint32_t by = y & 0xFF;
    x = ror(x, by);
    if (by) {
        s->is.c = x >> 31;
    }
    set_nz(s, PUT(x));
}

/* Multiply and divide; R(a) is added to, or holds the upper half. */
DOES(MUL) { PUT(x * y); }
DOES(MUL_S) { set_nz(s, PUT(x * y)); }
DOES(MLA) { PUT(R(a) + x * y); }
DOES(MLS) { PUT(R(a) - x * y); }

static inline void put_long(struct interpreter *s, const struct op *op, uint64_t value)
{
    R(d) = (uint32_t)value;
    R(a) = (uint32_t)(value >> 32);
}

static inline uint64_t signed_product(uint32_t x, uint32_t y) { return (uint64_t)((int64_t)(int32_t)x * (int32_t)y); }
static inline uint64_t long_of(const struct interpreter *s, const struct op *op) { return (uint64_t)R(a) << 32 | R(d); }
DOES(SMULL) { put_long(s, op, signed_product(x, y)); }
DOES(UMULL) { put_long(s, op, (uint64_t)x * y); }
DOES(SMLAL) { put_long(s, op, long_of(s, op) + signed_product(x, y)); }
DOES(UMLAL) { put_long(s, op, long_of(s, op) + (uint64_t)x * y); }
ACCESSES(UDIV)
{
    if (UNLIKELY(y == 0)) {
        if (interpreter_is_trapped(s, op, false, 0)) {
            return false;
        }
        PUT(0);
        return true;
    }
    PUT(x / y);
    return true;
}
ACCESSES(SDIV)
{
    const int32_t dividend = (int32_t)x, divisor = (int32_t)y;
    if (UNLIKELY(divisor == 0 && interpreter_is_trapped(s, op, false, 0))) {
        return false;
    }
    PUT(divisor == 0 ? 0 : divisor == -1 ? 0u - x : (uint32_t)(dividend / divisor));
    return true;
}

/* Extend, reverse, count. */
DOES(SXTB) { PUT((uint32_t)(int8_t)y); }
DOES(SXTH) { PUT((uint32_t)(int16_t)y); }
DOES(UXTB) { PUT((uint8_t)y); }
DOES(UXTH) { PUT((uint16_t)y); }
DOES(REV) { PUT(__builtin_bswap32(y)); }
DOES(REV16) { PUT((y >> 8 & 0x00FF00FF) | (y & 0x00FF00FF) << 8); }
DOES(REVSH) { PUT((uint32_t)(int16_t)__builtin_bswap16((uint16_t)y)); }
DOES(CLZ) { PUT(y ? (uint32_t)__builtin_clz(y) : 32); }
DOES(RBIT)
{
    x = y;
    x = (x >> 1 & 0x55555555) | (x & 0x55555555) << 1;
    x = (x >> 2 & 0x33333333) | (x & 0x33333333) << 2;
    x = (x >> 4 & 0x0F0F0F0F) | (x & 0x0F0F0F0F) << 4;
    PUT(__builtin_bswap32(x));
}

/* Bit fields: `imm` is the mask of the field, in place for BFI, at bit 0 for UBFX; `a` is its lowest bit. */
DOES(UBFX) { PUT(x >> op->a & op->imm); }
/* `imm` bits stand above the field. */
DOES(SBFX) { PUT(asr(x << op->imm, op->a)); }
DOES(BFI) { PUT((R(d) & ~op->imm) | (x << op->a & op->imm)); }

/* Saturate to the largest number `imm`, and to its complement, or 0. */
static inline uint32_t saturated(struct interpreter *s, uint32_t x, int32_t least, int32_t most)
{
    const int32_t value = (int32_t)x;
    const int32_t inside = value > most ? most : value < least ? least : value;
    s->is.q |= inside != value;
    return (uint32_t)inside;
}

DOES(SSAT) { PUT(saturated(s, x, ~(int32_t)op->imm, (int32_t)op->imm)); }
DOES(USAT) { PUT(saturated(s, x, 0, (int32_t)op->imm)); }

/* Special registers. */
DOES(MRS) { interpreter_mrs(s, op); }
DOES(MSR) { interpreter_msr(s, op); }
DOES(CPS) { interpreter_cps(s, op); }
DOES(CLREX)
{
    s->is.has_exclusive = 0;
}

/* Loads to R(d), stores of R(d): at x + imm, or at x + (y << a). */
#define ADDRESS_I (x + op->imm)
#define ADDRESS_R (x + (y << op->a))

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
        const uint32_t address = ADDRESS_##way, at = address - s->sram_base;                                     \
        if (LIKELY(at < s->sram_words_end)) {                                                                           \
            unsigned_type found;                                                                                        \
            memcpy(&found, s->sram + at, sizeof found);                                                                 \
            PUT((uint32_t)(type)found);                                                                                 \
            return true;                                                                                                \
        }                                                                                                               \
        uint32_t word;                                                                                                  \
        if (!interpreter_load(s, op, address, sizeof(type), &word)) {                                                   \
            return false;                                                                                               \
        }                                                                                                               \
        PUT((uint32_t)(type)word);                                                                                      \
        return !s->leaves_to;                                                                                           \
    }
#define STORE(name, way, type)                                                                                          \
    ACCESSES(name##_##way)                                                                                              \
    {                                                                                                                   \
        const uint32_t address = ADDRESS_##way, at = address - s->sram_base;                                     \
        const type value = (type)R(d);                                                                                  \
        if (LIKELY(at < s->sram_words_end)) {                                                                           \
            memcpy(s->sram + at, &value, sizeof value);                                                                 \
            return true;                                                                                                \
        }                                                                                                               \
        return interpreter_store(s, op, address, sizeof value, value) && !s->leaves_to;                                 \
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
    uint32_t word;
    if (LIKELY(at < s->flash_words_end)) {
        memcpy(&word, s->flash + at, sizeof word);
    } else if (!interpreter_load(s, op, op->imm, 4, &word)) {
        return false;
    }
    PUT(word);
    return true;
}

/* Transfers of several words from a base that has to be aligned. */
AT_ONCE bool is_misaligned(struct interpreter *s, const struct op *op, uint32_t base)
{
    return UNLIKELY(base & 3) && interpreter_is_trapped(s, op, true, base);
}

/* Two words at x + imm, of R(d) and R(a). */
ACCESSES(LDRD)
{
    const uint32_t address = x + op->imm;
    if (is_misaligned(s, op, x)) {
        return false;
    }
    return load_word(s, op, address, &R(d)) && load_word(s, op, address + 4, &R(a)) && !s->leaves_to;
}
ACCESSES(STRD)
{
    const uint32_t address = x + op->imm;
    if (is_misaligned(s, op, x)) {
        return false;
    }
    return store_word(s, op, address, R(d)) && store_word(s, op, address + 4, R(a)) && !s->leaves_to;
}

/* Several words: `imm` is the list of registers below, and what is added to x above, in words and signed; x becomes
 * its old value and `a`, in words and signed, where that is not 0. Of LDM, R(d) is loaded for x if that is in the list:
 * the base stays as it is until all words are there. */
static inline uint32_t words(uint8_t count) { return 4 * (uint32_t)(int8_t)count; }
ACCESSES(LDM)
{
    uint32_t address = x + words((uint8_t)(op->imm >> 16)), base = x + words(op->a);
    if (is_misaligned(s, op, x)) {
        return false;
    }
    for (uint32_t left = op->imm & 0xFFFF; left; left &= left - 1, address += 4) {
        const uint32_t number = (uint32_t)__builtin_ctz(left);
        if (!load_word(s, op, address, number == op->n ? &base : &s->is.r[number])) {
            return false;
        }
    }
    s->is.r[op->n] = base;
    return !s->leaves_to;
}
ACCESSES(STM)
{
    uint32_t address = x + words((uint8_t)(op->imm >> 16));
    if (is_misaligned(s, op, x)) {
        return false;
    }
    for (uint32_t left = op->imm & 0xFFFF; left; left &= left - 1, address += 4) {
        if (!store_word(s, op, address, s->is.r[__builtin_ctz(left)])) {
            return false;
        }
    }
    s->is.r[op->n] = x + words(op->a);
    return !s->leaves_to;
}

/* Exclusive accesses of `a` bytes at x + imm: a store is made if the last LDREX was of that address, and memory still
 * holds what that has read; y is stored, and R(d) tells. */
ACCESSES(LDREX)
{
    const uint32_t address = x + op->imm;
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
    s->is.exclusive_value = PUT(value);
    return !s->leaves_to;
}
ACCESSES(STREX)
{
    const uint32_t address = x + op->imm;
    uint32_t value = 1;
    const bool is_same = s->is.has_exclusive && s->is.exclusive_address == address;
    if (is_same && address & (op->a - 1u)) { /* after an LDREX of another width */
        stand_at(s, op);
        interpreter_call_interrupt(s, BY_ALIGNMENT);
        return false;
    }
    if (is_same && !interpreter_load(s, op, address, op->a, &value)) {
        return false;
    }
    const bool is_made = is_same && value == s->is.exclusive_value;
    if (is_made && !interpreter_store(s, op, address, op->a, y)) {
        return false;
    }
    s->is.has_exclusive = 0;
    PUT(!is_made);
    return !s->leaves_to;
}

/* The halfword or byte of a table branch: at x + (y << a), of a + 1 bytes. */
ACCESSES(TABLE)
{
    return interpreter_load(s, op, ADDRESS_R, op->a + 1u, &R(d)) && !s->leaves_to; /* R(d): a scratch register */
}

#endif
