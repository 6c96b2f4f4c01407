/* Lowers instructions to micro-operations: one for most, more where an operand is shifted, a base written back, or R15 is
 * read or written.
 *
 * Micro-operations know R15 as any register: before one that reads it, it is set to what a read of the PC gives, and behind
 * one that has written it, the block ends with a jump there. R13 keeps its two lowest bits clear.
 * What the manual leaves open (UNPREDICTABLE) is done as Unicorn and QEMU do; docs/core.md lists it.
 * Source: ARMv7-M Architecture Reference Manual A5.3.2 (ThumbExpandImm), A7.7.
 */
#include "lower.h"

enum { LSL_TYPE, LSR_TYPE, ASR_TYPE, ROR_TYPE };
enum way { CONSTANT, OF_REGISTER, WITH_FLAGS, SHIFTED_REGISTER = 4 };
enum { NO_REGISTER = 255, WORD_BYTES = 4 };

/* The second operand: a constant, or a register. */
struct operand {
    enum way way;
    uint32_t m, imm;
};

static struct operand constant(uint32_t imm) { return (struct operand){.way = CONSTANT, .imm = imm}; }
static struct operand of_register(uint32_t m) { return (struct operand){.way = OF_REGISTER, .m = m}; }

void interpreter_emit(struct builder *to, const struct emitted *one)
{
    to->ops[to->count++] = (struct op){.number = one->number, .d = (uint8_t)one->d, .n = (uint8_t)one->n, .m = (uint8_t)one->m,
                                       .a = (uint8_t)one->a, .imm = one->imm, .pc = to->pc, .it = to->it, .after = to->after};
}

static int32_t sign_extended(uint32_t value, unsigned bits) { return (int32_t)(value << (32 - bits)) >> (32 - bits); }

static enum outcome undefined(struct builder *to)
{
    emit(to, OP_UDF);
    return ENDS_BLOCK;
}

/* What a read of the PC gives. */
static uint32_t read_pc(const struct builder *to) { return to->pc + 4; }
static uint32_t aligned_pc(const struct builder *to) { return read_pc(to) / WORD_BYTES * WORD_BYTES; }

/* Before what reads these registers: R15 is one of them. */
static void reads(struct builder *to, uint32_t first, uint32_t second)
{
    if (first == PC || second == PC) {
        emit(to, OP_MOV_I, .d = PC, .imm = read_pc(to));
    }
}

/* Behind what has written a register by data processing. */
static enum outcome wrote(struct builder *to, uint32_t d)
{
    if (d == SP) {
        emit(to, OP_ALIGN_SP, .d = SP);
    }
    if (d != PC) {
        return GOES_ON;
    }
    emit(to, OP_JUMP, .d = PC);
    return ENDS_BLOCK;
}

/* Behind what has loaded a register: a load of the PC exchanges. */
static enum outcome loaded(struct builder *to, uint32_t t)
{
    if (t == SP) {
        emit(to, OP_ALIGN_SP, .d = SP);
    }
    if (t != PC) {
        return GOES_ON;
    }
    emit(to, OP_BX, .d = PC);
    return ENDS_BLOCK;
}

/* Shifts R(m) by a constant into a scratch register; returns the register where it is. */
static uint32_t shifted(struct builder *to, uint32_t type, uint32_t amount, uint32_t m, bool sets_carry)
{
    static const enum micro plain[] = {OP_LSL_I, OP_LSR_I, OP_ASR_I, OP_ROR_I};
    static const enum micro with_carry[] = {OP_LSL_IC, OP_LSR_IC, OP_ASR_IC, OP_ROR_IC};
    if (type == LSL_TYPE && amount == 0) {
        return m;
    }
    if (type == ROR_TYPE && amount == 0) {
        emit(to, sets_carry ? OP_RRX_IC : OP_RRX_I, .d = SHIFTED, .m = m);
    } else if (amount == 0 && !sets_carry) { /* by 32 */
        if (type == LSR_TYPE) {
            emit(to, OP_MOV_I, .d = SHIFTED);
        } else {
            emit(to, OP_ASR_I, .d = SHIFTED, .m = m, .imm = 31);
        }
    } else {
        emit(to, (sets_carry ? with_carry : plain)[type], .d = SHIFTED, .m = m, .imm = amount ? amount : 32);
    }
    return SHIFTED;
}

/* The constant that twelve bits stand for; `carry`: what becomes of C, or -1 where it stays. */
static uint32_t expanded(uint32_t bits, int *carry)
{
    const uint32_t byte = bits & 0xFF;
    *carry = -1;
    if (bits >> 10 == 0) {
        static const uint32_t repeated[] = {1, 0x00010001, 0x01000100, 0x01010101};
        return byte * repeated[bits >> 8 & 3];
    }
    const uint32_t value = (0x80u | (bits & 0x7F)) << (32 - (bits >> 7));
    *carry = (int)(value >> 31);
    return value;
}

/* Data processing of R(n) and a second operand. `number` is the first of the four ways. */
static enum outcome data(struct builder *to, enum micro number, const struct decoded *one, struct operand by)
{
    reads(to, one->n, by.m);
    emit(to, number + by.way + (one->s ? WITH_FLAGS : 0), .d = one->d, .n = one->n, .m = by.m, .imm = by.imm);
    return wrote(to, one->d);
}

/* What only sets flags: `number` is the first of two ways. */
static enum outcome compare(struct builder *to, enum micro number, const struct decoded *one, struct operand by)
{
    reads(to, one->n, by.m);
    emit(to, number + by.way, .n = one->n, .m = by.m, .imm = by.imm);
    return GOES_ON;
}

static enum outcome move(struct builder *to, enum micro number, const struct decoded *one, struct operand by)
{
    if (by.m == SHIFTED && !one->s) {
        to->ops[to->count - 1].d = (uint8_t)one->d; /* what shifts it may as well put it there */
        return wrote(to, one->d);
    }
    reads(to, by.m, NO_REGISTER);
    emit(to, number + by.way + (one->s ? WITH_FLAGS : 0), .d = one->d, .m = by.m, .imm = by.imm);
    return wrote(to, one->d);
}

static enum outcome move_not(struct builder *to, enum micro number, const struct decoded *one, struct operand by)
{
    if (by.way == CONSTANT) {
        return move(to, OP_MOV_I, one, constant(~by.imm));
    }
    emit(to, one->s ? OP_MVN_RS : number, .d = one->d, .m = by.m);
    return wrote(to, one->d);
}

/* Of the shifter's carry: lost, C where flags are set, or C in any case. */
enum carry { IS_LOST, WITH_S, IS_C };
/* Whether a micro-operation without flags shifts its register itself. */
enum shifter { TWO_STEPS, ONE_STEP };

/* The instructions that come with a modified immediate and with a shifted register. */
struct data_row {
    enum operation with_constant, with_register;
    enum outcome (*lower)(struct builder *, enum micro, const struct decoded *, struct operand);
    enum micro number;
    enum carry carry;
    enum shifter shifter;
};

/* A shifted register as operand by the same micro-operation; false: that takes two. */
static bool shifts_itself(struct builder *to, const struct data_row *row, const struct decoded *one, enum outcome *outcome)
{
    if (row->shifter != ONE_STEP || one->s || !one->i || one->h == ROR_TYPE) {
        return false;
    }
    reads(to, one->n, one->m);
    emit(to, row->number + SHIFTED_REGISTER + one->h, .d = one->d, .n = one->n, .m = one->m, .imm = one->i);
    *outcome = wrote(to, one->d);
    return true;
}

static const struct data_row data_rows[] = {
    {TST_I, TST_R, compare, OP_TST_I, IS_C, TWO_STEPS},
    {TEQ_I, TEQ_R, compare, OP_TEQ_I, IS_C, TWO_STEPS},
    {CMP_I, CMP_R, compare, OP_CMP_I, IS_LOST, TWO_STEPS},
    {CMN_I, CMN_R, compare, OP_CMN_I, IS_LOST, TWO_STEPS},
    {AND_I, AND_R, data, OP_AND_I, WITH_S, ONE_STEP},
    {BIC_I, BIC_R, data, OP_BIC_I, WITH_S, ONE_STEP},
    {ORR_I, ORR_R, data, OP_ORR_I, WITH_S, ONE_STEP},
    {ORN_I, ORN_R, data, OP_ORN_I, WITH_S, TWO_STEPS},
    {EOR_I, EOR_R, data, OP_EOR_I, WITH_S, ONE_STEP},
    {ADD_I, ADD_R, data, OP_ADD_I, IS_LOST, ONE_STEP},
    {SUB_I, SUB_R, data, OP_SUB_I, IS_LOST, ONE_STEP},
    {RSB_I, RSB_R, data, OP_RSB_I, IS_LOST, ONE_STEP},
    {ADC_I, ADC_R, data, OP_ADC_I, IS_LOST, TWO_STEPS},
    {SBC_I, SBC_R, data, OP_SBC_I, IS_LOST, TWO_STEPS},
    {MOV_I, MOV_R, move, OP_MOV_I, WITH_S, TWO_STEPS},
    {MVN_I, MVN_R, move_not, OP_MVN_R, WITH_S, TWO_STEPS},
};

/* Whether it is one of them, lowered then. */
static bool lower_data(struct builder *to, const struct decoded *one, enum outcome *outcome)
{
    for (size_t n = 0; n < sizeof data_rows / sizeof data_rows[0]; ++n) {
        const struct data_row *row = &data_rows[n];
        const bool sets_carry = row->carry == IS_C || (row->carry == WITH_S && one->s);
        if (one->operation == row->with_constant) {
            int carry;
            const uint32_t value = expanded(one->i, &carry);
            if (sets_carry && carry >= 0) {
                emit(to, OP_SET_C, .imm = (uint32_t)carry);
            }
            *outcome = row->lower(to, row->number, one, constant(value));
            return true;
        }
        if (one->operation == row->with_register) {
            if (shifts_itself(to, row, one, outcome)) {
                return true;
            }
            reads(to, one->m, NO_REGISTER);
            *outcome = row->lower(to, row->number, one, of_register(shifted(to, one->h, one->i, one->m, sets_carry)));
            return true;
        }
    }
    return false;
}

/* Single loads and stores. */
struct access_row {
    enum operation of_constant, of_register, unprivileged, indexed, negative, literal, narrow_constant, narrow_register;
    enum micro number; /* of a constant; of a register the next one */
    uint32_t bytes;
    bool is_load;
};

static const struct access_row access_rows[] = {
    {LDR_I, LDR_R, LDRT, LDR_X, LDR_N, LDR_LITERAL, LDR_I5, LDR_RT1, OP_LDR_I, 4, true},
    {LDRH_I, LDRH_R, LDRHT, LDRH_X, LDRH_N, LDRH_LITERAL, LDRH_I5, LDRH_RT1, OP_LDRH_I, 2, true},
    {LDRB_I, LDRB_R, LDRBT, LDRB_X, LDRB_N, LDRB_LITERAL, LDRB_I5, LDRB_RT1, OP_LDRB_I, 1, true},
    {LDRSH_I, LDRSH_R, LDRSHT, LDRSH_X, LDRSH_N, LDRSH_LITERAL, UNDEFINED, LDRSH_RT1, OP_LDRSH_I, 2, true},
    {LDRSB_I, LDRSB_R, LDRSBT, LDRSB_X, LDRSB_N, LDRSB_LITERAL, UNDEFINED, LDRSB_RT1, OP_LDRSB_I, 1, true},
    {STR_I, STR_R, STRT, STR_X, STR_N, UNDEFINED, STR_I5, STR_RT1, OP_STR_I, 4, false},
    {STRH_I, STRH_R, STRHT, STRH_X, STRH_N, UNDEFINED, STRH_I5, STRH_RT1, OP_STRH_I, 2, false},
    {STRB_I, STRB_R, STRBT, STRB_X, STRB_N, UNDEFINED, STRB_I5, STRB_RT1, OP_STRB_I, 1, false},
};

/* Of R(n) + offset; the base becomes R(n) + `change`. */
static enum outcome access_constant(struct builder *to, const struct access_row *row, const struct decoded *one,
                                    uint32_t offset, uint32_t change)
{
    reads(to, one->n, row->is_load ? NO_REGISTER : one->t);
    const bool goes_back = change && one->n != PC && !(row->is_load && one->t == one->n);
    const bool jumps = row->is_load && one->t == PC; /* the base is written first */
    emit(to, row->number, .d = jumps ? SHIFTED : one->t, .n = one->n, .imm = offset);
    if (goes_back) {
        emit(to, OP_ADD_I, .d = one->n, .n = one->n, .imm = change);
        wrote(to, one->n);
    }
    if (jumps) {
        emit(to, OP_BX, .d = SHIFTED);
        return ENDS_BLOCK;
    }
    return row->is_load ? loaded(to, one->t) : GOES_ON;
}

static enum outcome access_register(struct builder *to, const struct access_row *row, const struct decoded *one, uint32_t by)
{
    reads(to, one->n, one->m);
    if (!row->is_load) {
        reads(to, one->t, NO_REGISTER);
    }
    emit(to, row->number + 1, .d = one->t, .n = one->n, .m = one->m, .a = by);
    return row->is_load ? loaded(to, one->t) : GOES_ON;
}

static enum outcome literal(struct builder *to, enum micro number, uint32_t t, uint32_t address)
{
    if (number == OP_LDR_I) {
        emit(to, OP_LDR_LITERAL, .d = t, .imm = address);
    } else {
        emit(to, OP_MOV_I, .d = ADDRESS, .imm = address);
        emit(to, number, .d = t, .n = ADDRESS);
    }
    return loaded(to, t);
}

static bool lower_access(struct builder *to, const struct decoded *one, enum outcome *outcome)
{
    const enum operation what = one->operation;
    for (size_t n = 0; n < sizeof access_rows / sizeof access_rows[0] && what != UNDEFINED; ++n) {
        const struct access_row *row = &access_rows[n];
        const uint32_t offset = one->u ? one->i : 0u - one->i;
        if (what == row->of_constant || what == row->unprivileged) {
            *outcome = access_constant(to, row, one, one->i, 0);
        } else if (what == row->negative) {
            *outcome = access_constant(to, row, one, 0u - one->i, 0);
        } else if (what == row->indexed) {
            *outcome = access_constant(to, row, one, one->p ? offset : 0, offset);
        } else if (what == row->of_register) {
            *outcome = access_register(to, row, one, one->i);
        } else if (what == row->narrow_constant) {
            *outcome = access_constant(to, row, one, one->i * row->bytes, 0);
        } else if (what == row->narrow_register) {
            *outcome = access_register(to, row, one, 0);
        } else if (what == row->literal) {
            *outcome = literal(to, row->number, one->t, aligned_pc(to) + offset);
        } else {
            continue;
        }
        return true;
    }
    return false;
}

/* Two words, R(t) and R(a), of R(n) + offset; where the base is written back, it becomes R(n) + `change`. */
static enum outcome dual(struct builder *to, const struct decoded *one, bool is_load, bool goes_back, bool is_post)
{
    const uint32_t change = one->u ? 4 * one->i : 0u - 4 * one->i;
    uint32_t base = one->n;
    if (base == PC) {
        emit(to, OP_MOV_I, .d = ADDRESS, .imm = aligned_pc(to));
        base = ADDRESS;
    } else if (goes_back || (is_load && (one->t == base || one->a == base))) {
        emit(to, OP_MOV_R, .d = ADDRESS, .m = base);
        base = ADDRESS;
    }
    if (!is_load) {
        reads(to, one->t, one->a);
    }
    emit(to, is_load ? OP_LDRD : OP_STRD, .d = one->t, .n = base, .a = one->a, .imm = is_post ? 0 : change);
    if (goes_back) {
        emit(to, OP_ADD_I, .d = one->n, .n = ADDRESS, .imm = change);
        if (one->n == PC) {
            return wrote(to, PC);
        }
    }
    if (!is_load) {
        return GOES_ON;
    }
    if (one->t == SP || one->a == SP) {
        emit(to, OP_ALIGN_SP, .d = SP);
    }
    return wrote(to, one->t == PC || one->a == PC ? PC : NO_REGISTER);
}

/* Several words from R(n) on (`is_before`: up to it); `change`: whether the base is written back. One that goes on behind an
 * exception is the rest of it, from the old base, which a store has to put back. */
static enum outcome multiple(struct builder *to, bool is_load, uint32_t n, uint32_t list, bool is_before, bool change)
{
    const uint32_t before = list & ((1u << to->next) - 1);
    const int count = __builtin_popcount(list), step = is_before ? -count : count, moved = __builtin_popcount(before);
    if (moved && change && !is_load) {
        emit(to, OP_ADD_I, .d = n, .n = n, .imm = 0u - 4 * (uint32_t)step);
    }
    const uint32_t first = (uint32_t)((is_before ? -count : 0) + moved) & 0xFF;
    emit(to, is_load ? OP_LDM : OP_STM, .n = n, .a = (uint32_t)(change ? step : 0), .imm = (list & ~before) | first << 16);
    to->moved += (uint8_t)moved;
    if (!is_load) {
        return GOES_ON;
    }
    if (list >> SP & 1) {
        emit(to, OP_ALIGN_SP, .d = SP);
    }
    return loaded(to, list >> PC & 1 ? PC : NO_REGISTER);
}

/* The 32-bit ones: what the manual leaves open of them is undefined. */
static enum outcome wide_multiple(struct builder *to, const struct decoded *one, bool is_load, bool is_before)
{
    if (one->n == PC || __builtin_popcount(one->r) < 2 || (one->w && one->r >> one->n & 1)) {
        return undefined(to);
    }
    if (!is_load) {
        reads(to, one->r >> PC & 1 ? PC : NO_REGISTER, NO_REGISTER);
    }
    return multiple(to, is_load, one->n, one->r, is_before, one->w);
}

static enum outcome exclusive(struct builder *to, const struct decoded *one, bool is_load, uint32_t bytes)
{
    const bool is_open = one->n == PC || one->t == PC || one->t == SP;
    if (is_open || (!is_load && (one->d == PC || one->d == SP || one->d == one->n || one->d == one->t))) {
        return undefined(to);
    }
    emit(to, is_load ? OP_LDREX : OP_STREX, .d = is_load ? one->t : one->d, .n = one->n, .m = one->t, .a = bytes,
         .imm = 4 * one->i);
    return GOES_ON;
}

/* Branches. */
static enum outcome branch(struct builder *to, enum micro number, uint32_t offset)
{
    const uint32_t target = read_pc(to) + offset;
    if (target == to->end) { /* either way goes straight on, which costs alike */
        emit(to, OP_STRAIGHT_ON);
    } else {
        to->target = target;
        emit(to, number);
    }
    return ENDS_BLOCK;
}

static enum outcome compare_and_branch(struct builder *to, enum micro number, const struct decoded *one)
{
    const enum outcome outcome = branch(to, number, one->i << 1);
    to->ops[to->count - 1].n = (uint8_t)one->n;
    return outcome;
}

/* The 25 bits of B.W and BL: I1 and I2 are J1 and J2, turned over where S is clear. */
static uint32_t far_offset(const struct decoded *one)
{
    const uint32_t sign = one->s, turned = sign ? one->j : ~one->j & 3;
    return (uint32_t)sign_extended(sign << 23 | turned << 21 | one->i, 24) << 1;
}

static uint32_t near_offset(const struct decoded *one)
{
    const uint32_t j1 = one->j >> 1, j2 = one->j & 1;
    return (uint32_t)sign_extended(one->s << 19 | j2 << 18 | j1 << 17 | one->i, 20) << 1;
}

/* An address near the instruction; a write of the PC by it exchanges. */
static enum outcome near_address(struct builder *to, const struct decoded *one, uint32_t address)
{
    emit(to, OP_MOV_I, .d = one->d, .imm = address);
    return loaded(to, one->d);
}

/* A 16-bit data-processing instruction of R(d) and R(m) sets flags outside IT blocks alone. */
static enum outcome low(struct builder *to, enum micro number, struct decoded *one)
{
    one->s = !to->it;
    one->n = one->d;
    return data(to, number, one, of_register(one->m));
}

static enum outcome low_constant(struct builder *to, enum micro number, struct decoded *one, uint32_t n)
{
    one->s = !to->it;
    one->n = n;
    return data(to, number, one, constant(one->i));
}

/* A 16-bit shift by a constant; 0 stands for 32, but of LSL for none. */
static enum outcome shift(struct builder *to, uint32_t type, const struct decoded *one)
{
    static const enum micro with_flags[] = {OP_LSL_IS, OP_LSR_IS, OP_ASR_IS};
    if (type == LSL_TYPE && !one->i) {
        emit(to, to->it ? OP_MOV_R : OP_MOV_RS, .d = one->d, .m = one->m);
    } else if (!to->it) {
        emit(to, with_flags[type], .d = one->d, .m = one->m, .imm = one->i ? one->i : 32);
    } else {
        return move(to, OP_MOV_I, one, of_register(shifted(to, type, one->i, one->m, false)));
    }
    return GOES_ON;
}

static enum outcome shift_by_register(struct builder *to, uint32_t type, const struct decoded *one, uint32_t n, bool sets)
{
    static const enum micro plain[] = {OP_LSL_R, OP_LSR_R, OP_ASR_R, OP_ROR_R};
    static const enum micro with_flags[] = {OP_LSL_RS, OP_LSR_RS, OP_ASR_RS, OP_ROR_RS};
    reads(to, n, one->m);
    emit(to, (sets ? with_flags : plain)[type], .d = one->d, .n = n, .m = one->m);
    return wrote(to, one->d);
}

static enum outcome simple(struct builder *to, enum micro number, const struct decoded *one)
{
    reads(to, one->n, one->m);
    emit(to, number, .d = one->d, .n = one->n, .m = one->m, .a = one->a);
    return wrote(to, one->d);
}

static enum outcome extend(struct builder *to, enum micro number, const struct decoded *one)
{
    reads(to, one->m, NO_REGISTER);
    uint32_t from = one->m;
    if (one->i) {
        emit(to, OP_ROR_I, .d = SHIFTED, .m = from, .imm = 8 * one->i);
        from = SHIFTED;
    }
    emit(to, number, .d = one->d, .m = from);
    return wrote(to, one->d);
}

/* MUL, MLA, MLS and the long ones: the registers of a sum may be R15, too. */
static enum outcome multiply(struct builder *to, enum micro number, const struct decoded *one, bool is_long)
{
    reads(to, one->a, one->d == PC && is_long ? PC : NO_REGISTER);
    const enum outcome outcome = simple(to, number, one);
    return is_long && outcome == GOES_ON ? wrote(to, one->a) : outcome;
}

static enum outcome bit_field(struct builder *to, const struct decoded *one)
{
    const uint32_t low = one->i, last = one->b;
    const bool is_extract = one->operation == SBFX || one->operation == UBFX;
    if (is_extract ? low + last > 31 : last < low) {
        return undefined(to);
    }
    reads(to, one->n, one->d);
    const uint32_t ones = UINT32_MAX >> (31 - (is_extract ? last : last - low));
    switch (one->operation) {
    case SBFX: emit(to, OP_SBFX, .d = one->d, .n = one->n, .a = 31 - last, .imm = 31 - low - last); break;
    case UBFX: emit(to, OP_UBFX, .d = one->d, .n = one->n, .a = low, .imm = ones); break;
    case BFC: emit(to, OP_BIC_I, .d = one->d, .n = one->d, .imm = ones << low); break;
    default: emit(to, OP_BFI, .d = one->d, .n = one->n, .a = low, .imm = ones << low);
    }
    return wrote(to, one->d);
}

static enum outcome saturate(struct builder *to, const struct decoded *one)
{
    reads(to, one->n, NO_REGISTER);
    const uint32_t from = shifted(to, one->h ? ASR_TYPE : LSL_TYPE, one->i, one->n, false);
    emit(to, one->operation == SSAT ? OP_SSAT : OP_USAT, .d = one->d, .n = from, .imm = (1u << one->b) - 1);
    return wrote(to, one->d);
}

static enum outcome table_branch(struct builder *to, const struct decoded *one, uint32_t by)
{
    reads(to, one->n, one->m);
    emit(to, OP_TABLE, .d = SHIFTED, .n = one->n, .m = one->m, .a = by);
    emit(to, OP_TABLE_JUMP, .d = SHIFTED, .imm = read_pc(to));
    return ENDS_BLOCK;
}

/* What ends the block because masks or the pipeline may be others behind it. */
static enum outcome ends_behind(struct builder *to)
{
    emit(to, OP_STRAIGHT_ON);
    return ENDS_BLOCK;
}

static enum outcome ends_run(struct builder *to, enum micro number)
{
    emit(to, number, .imm = to->end);
    return ENDS_BLOCK;
}

enum outcome interpreter_lower(struct builder *to, const struct decoded *given)
{
    struct decoded copy = *given, *one = &copy;
    enum outcome outcome;
    if (lower_data(to, one, &outcome) || lower_access(to, one, &outcome)) {
        return outcome;
    }
    switch (one->operation) {
    /* 16 bits: data. */
    case MOVS_T2: one->i = 0; return shift(to, LSL_TYPE, one);
    case LSL_T1: return shift(to, LSL_TYPE, one);
    case LSR_T1: return shift(to, LSR_TYPE, one);
    case ASR_T1: return shift(to, ASR_TYPE, one);
    case ADD_R3: one->s = !to->it; return data(to, OP_ADD_I, one, of_register(one->m));
    case SUB_R3: one->s = !to->it; return data(to, OP_SUB_I, one, of_register(one->m));
    case ADD_I3: return low_constant(to, OP_ADD_I, one, one->n);
    case SUB_I3: return low_constant(to, OP_SUB_I, one, one->n);
    case MOV_I8: one->s = !to->it; return move(to, OP_MOV_I, one, constant(one->i));
    case CMP_I8: one->n = one->d; return compare(to, OP_CMP_I, one, constant(one->i));
    case ADD_I8: return low_constant(to, OP_ADD_I, one, one->d);
    case SUB_I8: return low_constant(to, OP_SUB_I, one, one->d);
    case AND_T1: return low(to, OP_AND_I, one);
    case EOR_T1: return low(to, OP_EOR_I, one);
    case ADC_T1: return low(to, OP_ADC_I, one);
    case SBC_T1: return low(to, OP_SBC_I, one);
    case ORR_T1: return low(to, OP_ORR_I, one);
    case BIC_T1: return low(to, OP_BIC_I, one);
    case LSL_RT1: return shift_by_register(to, LSL_TYPE, one, one->d, !to->it);
    case LSR_RT1: return shift_by_register(to, LSR_TYPE, one, one->d, !to->it);
    case ASR_RT1: return shift_by_register(to, ASR_TYPE, one, one->d, !to->it);
    case ROR_RT1: return shift_by_register(to, ROR_TYPE, one, one->d, !to->it);
    case TST_T1: one->n = one->d; return compare(to, OP_TST_I, one, of_register(one->m));
    case CMP_T1: one->n = one->d; return compare(to, OP_CMP_I, one, of_register(one->m));
    case CMN_T1: one->n = one->d; return compare(to, OP_CMN_I, one, of_register(one->m));
    case RSB_T1: one->i = 0; return low_constant(to, OP_RSB_I, one, one->n);
    case MVN_T1: one->s = !to->it; return move_not(to, OP_MVN_R, one, of_register(one->m));
    case MUL_T1: emit(to, to->it ? OP_MUL : OP_MUL_S, .d = one->d, .n = one->d, .m = one->m); return GOES_ON;
    case ADD_T2: one->n = one->d; return data(to, OP_ADD_I, one, of_register(one->m));
    case ADD_PC: one->d = one->n = PC; return data(to, OP_ADD_I, one, of_register(one->m));
    case MOV_T1: return move(to, OP_MOV_I, one, of_register(one->m));
    case MOV_PC: one->d = PC; return move(to, OP_MOV_I, one, of_register(one->m));
    case ADR_T1: return near_address(to, one, aligned_pc(to) + 4 * one->i);
    case ADD_SP_T1: one->n = SP; return data(to, OP_ADD_I, one, constant(4 * one->i));
    case ADD_SP_T2: emit(to, OP_ADD_I, .d = SP, .n = SP, .imm = 4 * one->i); return GOES_ON;
    case SUB_SP_T1: emit(to, OP_SUB_I, .d = SP, .n = SP, .imm = 4 * one->i); return GOES_ON;
    case SXTH_T1:
    case SXTH: return extend(to, OP_SXTH, one);
    case SXTB_T1:
    case SXTB: return extend(to, OP_SXTB, one);
    case UXTH_T1:
    case UXTH: return extend(to, OP_UXTH, one);
    case UXTB_T1:
    case UXTB: return extend(to, OP_UXTB, one);
    case REV: return simple(to, OP_REV, one);
    case REV16: return simple(to, OP_REV16, one);
    case REVSH: return simple(to, OP_REVSH, one);
    case RBIT: return simple(to, OP_RBIT, one);
    case CLZ: return simple(to, OP_CLZ, one);

    /* 16 bits: memory. */
    case LDR_LITERAL_T1: return literal(to, OP_LDR_I, one->t, aligned_pc(to) + 4 * one->i);
    case STR_SP: emit(to, OP_STR_I, .d = one->t, .n = SP, .imm = 4 * one->i); return GOES_ON;
    case LDR_SP: emit(to, OP_LDR_I, .d = one->t, .n = SP, .imm = 4 * one->i); return GOES_ON;
    case PUSH:
        return one->r ? multiple(to, false, SP, (one->r & 0xFF) | one->r >> 8 << LR, true, true) : undefined(to);
    case POP: return one->r ? multiple(to, true, SP, (one->r & 0xFF) | one->r >> 8 << PC, false, true) : undefined(to);
    case STM_T1: return one->r ? multiple(to, false, one->n, one->r, false, true) : undefined(to);
    case LDM_T1: return one->r ? multiple(to, true, one->n, one->r, false, !(one->r >> one->n & 1)) : undefined(to);

    /* 32 bits: memory. */
    case STM_IA: return wide_multiple(to, one, false, false);
    case LDM_IA: return wide_multiple(to, one, true, false);
    case STM_DB: return wide_multiple(to, one, false, true);
    case LDM_DB: return wide_multiple(to, one, true, true);
    case STRD_POST: return dual(to, one, false, true, true);
    case LDRD_POST: return dual(to, one, true, true, true);
    case STRD: return dual(to, one, false, one->w, false);
    case LDRD: return dual(to, one, true, one->w, false);
    case STREX: return exclusive(to, one, false, 4);
    case LDREX: return exclusive(to, one, true, 4);
    case STREXB: return exclusive(to, one, false, 1);
    case LDREXB: return exclusive(to, one, true, 1);
    case STREXH: return exclusive(to, one, false, 2);
    case LDREXH: return exclusive(to, one, true, 2);

    /* 32 bits: data. */
    case ADR_ADD: return near_address(to, one, aligned_pc(to) + one->i);
    case ADR_SUB: return near_address(to, one, aligned_pc(to) - one->i);
    case ADDW: return data(to, OP_ADD_I, one, constant(one->i));
    case SUBW: return data(to, OP_SUB_I, one, constant(one->i));
    case MOVW: return move(to, OP_MOV_I, one, constant(one->j << 12 | one->i));
    case MOVT:
        reads(to, one->d, NO_REGISTER);
        emit(to, OP_MOVT, .d = one->d, .imm = (one->j << 12 | one->i) << 16);
        return wrote(to, one->d);
    case SSAT:
    case USAT: return saturate(to, one);
    case SBFX:
    case UBFX:
    case BFC:
    case BFI: return bit_field(to, one);
    case LSL: return shift_by_register(to, LSL_TYPE, one, one->n, one->s);
    case LSR: return shift_by_register(to, LSR_TYPE, one, one->n, one->s);
    case ASR: return shift_by_register(to, ASR_TYPE, one, one->n, one->s);
    case ROR: return shift_by_register(to, ROR_TYPE, one, one->n, one->s);
    case MUL: return multiply(to, OP_MUL, one, false);
    case MLA: return multiply(to, OP_MLA, one, false);
    case MLS: return multiply(to, OP_MLS, one, false);
    case SMULL: return multiply(to, OP_SMULL, one, true);
    case UMULL: return multiply(to, OP_UMULL, one, true);
    case SMLAL: return multiply(to, OP_SMLAL, one, true);
    case UMLAL: return multiply(to, OP_UMLAL, one, true);
    case SDIV: return simple(to, OP_SDIV, one);
    case UDIV: return simple(to, OP_UDIV, one);

    /* Branches. */
    case B_T1: return branch(to, OP_B_EQ + one->c, (uint32_t)sign_extended(one->i, 8) << 1);
    case B_T2: return branch(to, OP_B, (uint32_t)sign_extended(one->i, 11) << 1);
    case B_T3: return branch(to, OP_B_EQ + one->c, near_offset(one));
    case B_T4: return branch(to, OP_B, far_offset(one));
    case BL: emit(to, OP_MOV_I, .d = LR, .imm = to->end | 1); return branch(to, OP_B, far_offset(one));
    case CBZ: return compare_and_branch(to, OP_CBZ, one);
    case CBNZ: return compare_and_branch(to, OP_CBNZ, one);
    case BX: reads(to, one->m, NO_REGISTER); emit(to, OP_BX, .d = one->m); return ENDS_BLOCK;
    case BLX: reads(to, one->m, NO_REGISTER); emit(to, OP_BLX, .d = one->m, .imm = to->end | 1); return ENDS_BLOCK;
    case TBB: return table_branch(to, one, 0);
    case TBH: return table_branch(to, one, 1);

    /* What stands alone. */
    case MRS: emit(to, OP_MRS, .d = one->d, .imm = one->i); return wrote(to, one->d);
    case MSR: reads(to, one->n, NO_REGISTER); emit(to, OP_MSR, .n = one->n, .imm = one->b << 8 | one->i); return ends_behind(to);
    case CPS: emit(to, OP_CPS, .imm = one->u << 2 | one->i); return ends_behind(to);
    case ISB: return ends_behind(to);
    case CLREX: emit(to, OP_CLREX); return GOES_ON;
    case DSB:
    case DMB:
    case SEV:
    case NOP: emit(to, OP_NOP); return GOES_ON;
    case IT: return GOES_ON;
    case YIELD:
    case WFE: return ends_run(to, OP_HINT);
    case WFI: return ends_run(to, OP_WAIT);
    case SVC: return ends_run(to, OP_SVC);
    case BKPT: return ends_run(to, OP_BKPT);
    case NO_COPROCESSOR: return ends_run(to, OP_NO_COPROCESSOR);
    default: return undefined(to);
    }
}
