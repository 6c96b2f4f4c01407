/* Runs blocks: threaded dispatch from micro-operation to micro-operation, and from block to block.
 *
 * Each micro-operation holds the address of its code (a label as a value: GCC and Clang), or, compiled with
 * INTERPRETER_PORTABLE or by another compiler, its number goes through a switch.
 * Source: ARMv7-M Architecture Reference Manual B1.4.7, A2.3.1 (how the PC is written).
 */
#include "micro.h"
#include "operations.h"

#if defined(__GNUC__) && !defined(INTERPRETER_PORTABLE)
#define CODE_AT(number) at_##number:
#define DISPATCH() goto *op->handler
#else
#define CODE_AT(number) case number:
#define DISPATCH() goto dispatch
#endif

/* GCC packs the flags into a vector before it stores them, which takes longer than their stores. */
#if defined(__GNUC__) && !defined(__clang__)
#define PLAIN_CODE __attribute__((optimize("no-tree-slp-vectorize", "no-gcse", "no-crossjumping")))
#else
#define PLAIN_CODE
#endif

enum { FIRST_MAGIC = 0xFF };

/* From here on the core is inside this block, unless that is the rest of another one. */
static void stand_inside(struct interpreter *s, const struct block *block)
{
    if (s->is.block_start == 0) {
        s->is.block_start = block->start;
        s->is.block_end = block->end;
    }
}

/* The block at an address, or its part up to where the owner has it end, entered: the hook has been called and lets the run
 * go on. Null: the run ends. `link`: of the block before, by the way that led here, or null; `is_inside`: the core is inside
 * a block. */
static __attribute__((noinline)) struct block *enter(struct interpreter *s, struct block **link, bool is_inside)
{
    if (!is_inside) {
        s->is.block_start = 0;
    }
    do {
        struct block *block = interpreter_block(s, s->is.pc);
        if (block == NULL) {
            return NULL;
        }
        s->has_jumped = s->cut_at = 0;
        interpreter_call_block(s, block);
        if (s->stops) {
            return NULL;
        }
        if (!s->has_jumped) {
            if (link != NULL && block->row != NULL) {
                *link = block;
            }
            if (s->cut_at) {
                stand_inside(s, block);
                block = interpreter_part(s, block, s->cut_at);
            } else {
                s->is.block_start = 0;
            }
            return block;
        }
        link = NULL;
    } while (true);
}

/* As the owner would, at the start of a block that takes no attention; false: it has to. */
static inline __attribute__((always_inline)) bool passes(struct shared *shared, void **row, const struct block *from,
                                                         unsigned way, const struct block *to)
{
    if (UNLIKELY(to == NULL)) {
        return false;
    }
    const uint64_t cycle = shared->cycle + from->costs[way];
    if (UNLIKELY(cycle + to->span >= shared->stop_at)) {
        return false;
    }
    shared->cycle = cycle;
    *from->ways |= (uint8_t)(1u << (to->start != from->end));
    *row = to->row;
    shared->last[shared->logged++ % LAST_ROWS] = (struct record){cycle, to->start, 0};
    return true;
}

/* Whether a branch to an address is an exception return, which ends the run. */
static bool returns(struct interpreter *s, uint32_t target)
{
    if (s->is.ipsr == 0 || target >> 24 != FIRST_MAGIC) {
        return false;
    }
    s->is.pc = target & ~1u;
    s->is.it_state = 0;
    interpreter_call_interrupt(s, BY_RETURN);
    return true;
}

/* The known block at an address in flash; null: it has to be looked for. */
static inline struct block *known(struct interpreter *s, uint32_t address)
{
    struct block *block = *interpreter_slot(s, address);
    return block != NULL && block->start == address && block->row != NULL ? block : NULL;
}

/* What is left of the instruction whose access was made, and then the way to where the owner has the core go on. */
static __attribute__((noinline)) const struct op *rest(struct interpreter *s, const struct block *block, const struct op *op,
                                                       const void *const *handlers)
{
    uint32_t count = 0;
    while (op + count + 1 < block->ops + block->count && op[count + 1].pc == op->pc) {
        s->tail[count] = op[count + 1];
        ++count;
    }
    s->tail[count] = *op;
    s->tail[count].number = OP_LEAVE;
    s->tail[count].imm = s->leaves_to;
    for (uint32_t n = 0; n <= count; ++n) {
        s->tail[n].code = s->tail[n].number;
        s->tail[n].handler = handlers == NULL ? NULL : handlers[s->tail[n].number];
    }
    s->leaves_to = 0;
    return s->tail;
}

/* Ends the run at an instruction, by a number of Unicorn's, or as undefined. */
static __attribute__((noinline)) void end_by(struct interpreter *s, const struct op *op)
{
    stand_at(s, op);
    switch (op->number) {
    case OP_SVC:
        s->is.pc = op->imm;
        s->is.it_state = op->after;
        interpreter_call_interrupt(s, BY_SVC);
        break;
    case OP_BKPT: interpreter_call_interrupt(s, BY_BKPT); break;
    case OP_NO_COPROCESSOR: interpreter_call_interrupt(s, BY_COPROCESSOR); break;
    case OP_WAIT:
        s->is.pc = op->imm;
        s->is.it_state = op->after;
        s->stops = 1;
        break;
    case OP_HINT: /* WFE and YIELD, which Unicorn takes for undefined, with the PC past them */
        s->is.pc = op->imm;
        s->is.it_state = op->after;
        interpreter_call_invalid(s);
        break;
    default:
        s->error = s->is.is_thumb ? NO_ERROR : DENIED_FETCH;
        interpreter_call_invalid(s);
    }
}

#define CODE(number) CODE_AT(number)
#define HANDLER(name) CODE(OP_##name)
/* Whether the instruction was done, with its operands as they are or as what was done last has left them: always, but of
 * accesses. */
#define ALWAYS_DONE(name)                                                                                               \
    AT_ONCE bool is_done_##name(GIVEN)                                                                                  \
    {                                                                                                                   \
        do_##name(s, op, x, y, last);                                                                                   \
        return true;                                                                                                    \
    }
#define MAY_BE_DONE(name)                                                                                               \
    AT_ONCE bool is_done_##name(GIVEN) { return do_##name(s, op, x, y, last); }
#define DONE_BY_N(name)                                                                                                 \
    AT_ONCE bool is_done_##name##_BY_N(GIVEN) { return is_done_##name(s, op, *last, y, last); }
#define DONE_BY_M(name)                                                                                                 \
    AT_ONCE bool is_done_##name##_BY_M(GIVEN) { return is_done_##name(s, op, x, *last, last); }
STRAIGHT(ALWAYS_DONE)
ACCESSING(MAY_BE_DONE)
CHAINED_BY_N(DONE_BY_N)
CHAINED_BY_M(DONE_BY_M)

#define GO_ON(count)                                                                                                    \
    do {                                                                                                                \
        op += (count);                                                                                                  \
        DISPATCH();                                                                                                     \
    } while (0)
#define TAKE(way, address)                                                                                              \
    do {                                                                                                                \
        struct block *const to = block->links[way];                                                                     \
        if (LIKELY(passes(shared, row, block, way, to))) {                                                                        \
            block = to;                                                                                                 \
            op = block->ops;                                                                                            \
            DISPATCH();                                                                                                 \
        }                                                                                                               \
        s->is.pc = (address);                                                                                           \
        s->is.it_state = op->after;                                                                                     \
        if ((block = enter(s, &block->links[way], block->is_part)) == NULL) {                                           \
            return NULL;                                                                                                \
        }                                                                                                               \
        op = block->ops;                                                                                                \
        DISPATCH();                                                                                                     \
    } while (0)
#define JUMP_TO(target)                                                                                                 \
    do {                                                                                                                \
        const uint32_t there = (target);                                                                                \
        const unsigned way = there != block->end;                                                                       \
        struct block *const to = known(s, there);                                                                       \
        if (LIKELY(passes(shared, row, block, way, to))) {                                                                        \
            block = to;                                                                                                 \
            op = block->ops;                                                                                            \
            DISPATCH();                                                                                                 \
        }                                                                                                               \
        s->is.pc = there;                                                                                               \
        s->is.it_state = op->after;                                                                                     \
        if ((block = enter(s, NULL, false)) == NULL) {                                                                  \
            return NULL;                                                                                                \
        }                                                                                                               \
        op = block->ops;                                                                                                \
        DISPATCH();                                                                                                     \
    } while (0)
#define BRANCH_IF(condition)                                                                                            \
    do {                                                                                                                \
        if (condition) {                                                                                                \
            TAKE(1, block->target);                                                                                     \
        }                                                                                                               \
        TAKE(0, block->end);                                                                                            \
    } while (0)
/* Exchanges: the lowest bit of the target is the T bit. */
#define EXCHANGE(value)                                                                                                 \
    do {                                                                                                                \
        const uint32_t target = (value);                                                                                \
        if (UNLIKELY(returns(s, target))) {                                                                             \
            goto ended;                                                                                                 \
        }                                                                                                               \
        if (UNLIKELY(!(target & 1))) {                                                                                  \
            s->is.is_thumb = 0;                                                                                         \
            s->is.pc = target;                                                                                          \
            s->is.it_state = 0;                                                                                         \
            goto again;                                                                                                 \
        }                                                                                                               \
        JUMP_TO(target & ~1u);                                                                                          \
    } while (0)

#define DO(name)                                                                                                        \
    if (UNLIKELY(!is_done_##name(s, op, R(n), R(m), &last))) {                                                                             \
        goto ended;                                                                                                     \
    }
#define ALONE(name)                                                                                                     \
    HANDLER(name)                                                                                                       \
    DO(name)                                                                                                            \
    GO_ON(1);
#define ALONE_BY_N(name) ALONE(name##_BY_N)
#define ALONE_BY_M(name) ALONE(name##_BY_M)
#define IN_PAIR(first, second)                                                                                          \
    CODE(PAIR(first, second))                                                                                           \
    DO(first)                                                                                                           \
    ++op;                                                                                                               \
    DO(second)                                                                                                          \
    GO_ON(1);
#define IN_TRIPLE(first, second, third)                                                                                 \
    CODE(TRIPLE(first, second, third))                                                                                  \
    DO(first)                                                                                                           \
    ++op;                                                                                                               \
    DO(second)                                                                                                          \
    ++op;                                                                                                               \
    DO(third)                                                                                                           \
    GO_ON(1);
#define BOTH_BEFORE_BRANCH(first, second, third)                                                                        \
    CODE(TRIPLE(first, second, third))                                                                                  \
    DO(first)                                                                                                           \
    ++op;                                                                                                               \
    DO(second)                                                                                                          \
    ++op;                                                                                                               \
    BRANCH_IF(MEETS_##third);
#define BEFORE_BRANCH(first, second)                                                                                    \
    CODE(PAIR(first, second))                                                                                           \
    DO(first)                                                                                                           \
    ++op;                                                                                                               \
    BRANCH_IF(MEETS_##second);

#define N_SET (s->is.nz < 0)
#define V_SET (s->is.v >> 31)
#define Z_SET ((uint32_t)s->is.nz == 0)
#define IS_LESS (N_SET != V_SET)
#define BY_CONDITIONS(X)                                                                                                \
    X(EQ, Z_SET) X(NE, !Z_SET) X(CS, s->is.c) X(CC, !s->is.c) X(MI, N_SET) X(PL, !N_SET) X(VS, V_SET) X(VC, !V_SET)     \
    X(HI, s->is.c && !Z_SET) X(LS, !s->is.c || Z_SET) X(GE, !IS_LESS) X(LT, IS_LESS)                                    \
    X(GT, !Z_SET && !IS_LESS) X(LE, Z_SET || IS_LESS)
#define MEETS_B_EQ Z_SET
#define MEETS_B_NE !Z_SET
#define MEETS_B_CS s->is.c
#define MEETS_B_CC !s->is.c
#define MEETS_B_MI N_SET
#define MEETS_B_PL !N_SET
#define MEETS_B_HI s->is.c && !Z_SET
#define MEETS_B_LS !s->is.c || Z_SET
#define MEETS_B_GE !IS_LESS
#define MEETS_B_LT IS_LESS
#define MEETS_B_GT !Z_SET && !IS_LESS
#define MEETS_B_LE Z_SET || IS_LESS
#define MEETS_CBZ R(n) == 0
#define MEETS_CBNZ R(n) != 0
#define SKIPS(name, condition)                                                                                          \
    HANDLER(SKIP_##name)                                                                                                \
    GO_ON((condition) ? 1 : 1 + op->imm);
#define BRANCHES(name, condition)                                                                                       \
    HANDLER(B_##name)                                                                                                   \
    BRANCH_IF(condition);

/* Runs from a block on that has been entered until a hook or an instruction ends the run. Without an interpreter: returns
 * what `handler` of each micro-operation is, null where they are not used. */
PLAIN_CODE const void *const *interpreter_execute(struct interpreter *s, struct block *block)
{
#if defined(__GNUC__) && !defined(INTERPRETER_PORTABLE)
#define HANDLERS handlers
#define LABEL(number) &&at_##number,
#define LABELS(number) LABEL(number)
#define ADDRESS_OF(name) LABELS(OP_##name)
#define ADDRESS_BY_N(name) LABELS(OP_##name##_BY_N)
#define ADDRESS_BY_M(name) LABELS(OP_##name##_BY_M)
#define ADDRESS_OF_TRIPLE(first, second, third) LABELS(TRIPLE(first, second, third))
#define ADDRESS_OF_PAIR(first, second) LABELS(PAIR(first, second))
    static const void *const handlers[CODE_COUNT] = {
        STRAIGHT(ADDRESS_OF) ACCESSING(ADDRESS_OF) ENDING(ADDRESS_OF)
        [MICRO_COUNT] = CHAINED_BY_N(ADDRESS_BY_N) CHAINED_BY_M(ADDRESS_BY_M)
        PAIRS(ADDRESS_OF_PAIR) BRANCHING_PAIRS(ADDRESS_OF_PAIR)
        TRIPLES(ADDRESS_OF_TRIPLE) BRANCHING_TRIPLES(ADDRESS_OF_TRIPLE)
    };
    if (s == NULL) {
        return handlers;
    }
#else
#define HANDLERS NULL
    if (s == NULL) {
        return NULL;
    }
#endif
    struct shared *const shared = s->clock.shared;
    void **const row = s->clock.row;
    uint32_t last = 0; /* what was put into a register last */
    bool is_inside = s->is.block_start != 0;
    const struct op *op;
    if (block == NULL) {
        goto again;
    }
    op = block->ops;
    DISPATCH();

#if !defined(__GNUC__) || defined(INTERPRETER_PORTABLE)
dispatch:
    switch ((enum micro)op->code) {
#endif
        STRAIGHT(ALONE)
        ACCESSING(ALONE)
        CHAINED_BY_N(ALONE_BY_N)
        CHAINED_BY_M(ALONE_BY_M)
        PAIRS(IN_PAIR)
        BRANCHING_PAIRS(BEFORE_BRANCH)
        TRIPLES(IN_TRIPLE)
        BRANCHING_TRIPLES(BOTH_BEFORE_BRANCH)
        BY_CONDITIONS(SKIPS)
        BY_CONDITIONS(BRANCHES)
        HANDLER(HOOK)
        if (!interpreter_call_instruction(s, op)) {
            goto ended;
        }
        GO_ON(1);
        HANDLER(STRAIGHT_ON)
        TAKE(0, block->end);
        HANDLER(B)
        TAKE(1, block->target);
        HANDLER(CBZ)
        BRANCH_IF(R(n) == 0);
        HANDLER(CBNZ)
        BRANCH_IF(R(n) != 0);
        HANDLER(JUMP)
        JUMP_TO(R(d) & ~1u);
        HANDLER(TABLE_JUMP)
        JUMP_TO(op->imm + 2 * R(d));
        HANDLER(BX)
        EXCHANGE(R(d));
        HANDLER(BLX)
        {
            const uint32_t called = R(d);
            s->is.r[LR] = op->imm;
            EXCHANGE(called);
        }
        HANDLER(LEAVE)
        s->is.pc = op->imm;
        s->is.it_state = op->after;
        stand_inside(s, block);
        is_inside = true;
        goto again;
        HANDLER(SVC)
        HANDLER(BKPT)
        HANDLER(UDF)
        HANDLER(NO_COPROCESSOR)
        HANDLER(WAIT)
        HANDLER(HINT)
        end_by(s, op);
        goto ended;
#if !defined(__GNUC__) || defined(INTERPRETER_PORTABLE)
    case CODE_COUNT: return NULL;
    }
#endif

ended:
    /* A hook has said what becomes of the run: it ends, or goes on where the PC now is. */
    if (s->stops) {
        return NULL;
    }
    if (s->leaves_to) {
        op = rest(s, block, op, HANDLERS);
        DISPATCH();
    }
again:
    if ((block = enter(s, NULL, is_inside)) == NULL) {
        return NULL;
    }
    is_inside = false;
    op = block->ops;
    DISPATCH();
}
