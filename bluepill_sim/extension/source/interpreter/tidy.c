/* Makes a block's micro-operations fewer: flags that the block itself overwrites before anything can see them are not set,
 * and sequences that are common are run by one piece of code.
 *
 * Flags are seen by branches, skips and special registers, at a block's end, and wherever a run may end inside the block:
 * at accesses and hooks. Source of the sequences: counted over the programs of tools/bench and the example programs.
 */
#include "lower.h"

enum { NZ = 1, CARRY = 2, OVERFLOW = 4, ALL_FLAGS = 7 };
enum { BY_SHIFT = 32 };

/* What a micro-operation does with flags, and what does the same without setting any. */
struct effect {
    enum micro number, plain;
    uint8_t sets, reads, may_set; /* `may_set`: sometimes, beside what it always sets */
};

#define SETS(name, without, flags, ...) {OP_##name, OP_##without, .sets = flags, __VA_ARGS__},
#define SETS_BOTH(name, ...) SETS(name##_IS, name##_I, __VA_ARGS__) SETS(name##_RS, name##_R, __VA_ARGS__)
#define READS(name) {OP_##name, OP_##name, .reads = CARRY},
#define LOGICAL(name) SETS_BOTH(name, NZ)
#define ARITHMETIC(name) SETS_BOTH(name, ALL_FLAGS)
#define WITH_CARRY(name) SETS_BOTH(name, ALL_FLAGS, .reads = CARRY) READS(name##_I) READS(name##_R)
#define ONLY_FLAGS(name, flags) SETS(name##_I, NOP, flags) SETS(name##_R, NOP, flags)
#define SHIFT(name)                                                                                                     \
    SETS(name##_IC, name##_I, CARRY) SETS(name##_IS, name##_I, NZ | CARRY) SETS(name##_RS, name##_R, NZ, .may_set = CARRY)

static const struct effect effects[] = {
    LOGICAL(MOV) LOGICAL(AND) LOGICAL(BIC) LOGICAL(ORR) LOGICAL(ORN) LOGICAL(EOR)
    ARITHMETIC(ADD) ARITHMETIC(SUB) ARITHMETIC(RSB) WITH_CARRY(ADC) WITH_CARRY(SBC)
    ONLY_FLAGS(TST, NZ) ONLY_FLAGS(TEQ, NZ) ONLY_FLAGS(CMP, ALL_FLAGS) ONLY_FLAGS(CMN, ALL_FLAGS)
    SHIFT(LSL) SHIFT(LSR) SHIFT(ASR)
    SETS(MVN_RS, MVN_R, NZ) SETS(MUL_S, MUL, NZ) SETS(SET_C, NOP, CARRY) SETS(ROR_IC, ROR_I, CARRY)
    SETS(ROR_RS, ROR_R, NZ, .may_set = CARRY) SETS(RRX_IC, RRX_I, CARRY, .reads = CARRY) READS(RRX_I)
};

static const struct effect *effect_of(enum micro number)
{
    for (size_t n = 0; n < sizeof effects / sizeof effects[0]; ++n) {
        if (effects[n].number == number) {
            return &effects[n];
        }
    }
    return NULL;
}

/* Whether flags are seen there, whatever they are. */
static bool sees_flags(enum micro number)
{
    return number >= OP_LDR_I || number == OP_MRS || number == OP_MSR;
}

static void leave_flags_alone(struct builder *to)
{
    uint32_t seen = ALL_FLAGS;
    for (uint32_t n = to->count; n-- > 0;) {
        struct op *op = &to->ops[n];
        const struct effect *effect = effect_of(op->number);
        if (effect == NULL) {
            seen = sees_flags(op->number) ? ALL_FLAGS : seen;
            continue;
        }
        const bool is_whole = op->imm < BY_SHIFT || effect->plain < OP_LSL_I || effect->plain > OP_ASR_I;
        if (!(seen & (uint32_t)(effect->sets | effect->may_set)) && is_whole) {
            op->number = effect->plain;
        } else {
            seen &= ~(uint32_t)effect->sets;
        }
        seen |= effect->reads;
    }
}

static bool may_skip(const struct builder *to)
{
    for (uint32_t n = 0; n < to->count; ++n) {
        if (to->ops[n].number >= OP_SKIP_EQ && to->ops[n].number <= OP_SKIP_LE) {
            return true;
        }
    }
    return false;
}

static void take_out_nothing(struct builder *to)
{
    uint32_t kept = 0;
    for (uint32_t n = 0; n < to->count; ++n) {
        if (to->ops[n].number != OP_NOP) {
            to->ops[kept++] = to->ops[n];
        }
    }
    to->count = kept;
}

/* Whether it puts what the next one finds as done last into R(d). */
static bool leaves_result(enum micro number)
{
    const bool is_flags = (number >= OP_TST_I && number <= OP_CMN_R) || number == OP_SET_C;
    const bool is_long = number >= OP_SMULL && number <= OP_UMLAL;
    const bool is_other = number == OP_NOP || number == OP_ALIGN_SP || number >= OP_MRS;
    const bool is_load = (number >= OP_LDR_I && number <= OP_LDRSB_R) || number == OP_LDR_LITERAL;
    return is_load || !(is_flags || is_long || is_other);
}

#define BY_N_CODE(name) [OP_##name] = OP_##name##_BY_N,
#define BY_M_CODE(name) [OP_##name] = OP_##name##_BY_M,
/* By the number of a micro-operation: its code where it reads what was done last; 0: there is none. */
static const uint16_t by_n[MICRO_COUNT] = {CHAINED_BY_N(BY_N_CODE)}, by_m[MICRO_COUNT] = {CHAINED_BY_M(BY_M_CODE)};

/* The code of a micro-operation behind another one, whose result it may read. */
static uint16_t code_behind(const struct op *before, const struct op *op)
{
    const bool has_result = before != NULL && leaves_result(before->number);
    if (has_result && before->d == op->n && by_n[op->number]) {
        return by_n[op->number];
    }
    return has_result && before->d == op->m && by_m[op->number] ? by_m[op->number] : op->number;
}

enum { ANYTHING = UINT16_MAX };
#define PAIR_ROW(first, second) {OP_##first, OP_##second, ANYTHING, PAIR(first, second)},
#define TRIPLE_ROW(first, second, third) {OP_##first, OP_##second, OP_##third, TRIPLE(first, second, third)},
/* The longer ones first: the first that fits is taken. */
static const struct sequence {
    uint16_t first, second, third, code;
} sequences[] = {
    BRANCHING_TRIPLES(TRIPLE_ROW) TRIPLES(TRIPLE_ROW) BRANCHING_PAIRS(PAIR_ROW) PAIRS(PAIR_ROW)
    {.first = ANYTHING}, /* of no micro-operation: there may be no other */
};

/* The code that runs a micro-operation together with the next ones, where there is such; so many are `left`. */
static uint16_t code_with_next(const struct op *op, uint32_t left)
{
    for (size_t n = 0; n < sizeof sequences / sizeof sequences[0] && left > 1; ++n) {
        const struct sequence *one = &sequences[n];
        if (one->first == op[0].code && one->second == op[1].code &&
            (one->third == ANYTHING || (left > 2 && one->third == op[2].code))) {
            return one->code;
        }
    }
    return op->code;
}

/* Tidies a block, and gives each micro-operation its code. Where something may be skipped, nothing is taken out, since the
 * skip counts it, and what was done last is not known. */
void interpreter_tidy(struct builder *to)
{
    const bool is_straight = !may_skip(to);
    leave_flags_alone(to);
    if (is_straight) {
        take_out_nothing(to);
    }
    for (uint32_t n = 0; n < to->count; ++n) {
        to->ops[n].code = code_behind(is_straight && n ? &to->ops[n - 1] : NULL, &to->ops[n]);
    }
    const void *const *handlers = interpreter_execute(NULL, NULL);
    for (uint32_t n = 0; n < to->count; ++n) {
        struct op *op = &to->ops[n];
        op->code = code_with_next(op, to->count - n);
        op->handler = handlers == NULL ? NULL : handlers[op->code];
    }
}
