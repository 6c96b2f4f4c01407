/* Runs blocks: threaded dispatch from micro-operation to micro-operation, and from block to block.
 *
 * Each micro-operation holds the address of its code (a label as a value: GCC and Clang), or, compiled with
 * INTERPRETER_PORTABLE or by another compiler, its number goes through a switch.
 * Source: ARMv7-M Architecture Reference Manual B1.4.7, A2.3.1 (how the PC is written).
 */
#include "micro.h"
#include "operations.h"

#if defined(__GNUC__) && !defined(INTERPRETER_PORTABLE)
#define HANDLER(name) at_##name:
#define DISPATCH() goto *op->handler
#else
#define HANDLER(name) case OP_##name:
#define DISPATCH() goto dispatch
#endif

enum { FIRST_MAGIC = 0xFF };

/* The block at an address, entered: the hook has been called and lets the run go on. Null: the run ends. */
static __attribute__((noinline)) struct block *enter(struct interpreter *s, struct block *from, unsigned way)
{
    do {
        struct block *block = interpreter_block(s, s->is.pc);
        if (block == NULL) {
            return NULL;
        }
        if (from != NULL && !block->is_writable && block->is_thumb && !block->it) {
            from->links[way] = block;
        }
        from = NULL;
        s->has_jumped = 0;
        interpreter_call_block(s, block);
        if (s->stops) {
            return NULL;
        }
        if (!s->has_jumped) {
            s->is.it_state = 0;
            return block;
        }
    } while (true);
}

/* As the owner would, at the start of a block that takes no attention; false: it has to. */
static inline bool passes(struct interpreter *s, const struct block *from, unsigned way, const struct block *to)
{
    const struct clock *clock = &s->clock;
    if (UNLIKELY(to == NULL || to->row == NULL || *clock->row != from->row)) {
        return false;
    }
    const uint64_t cycle = *clock->cycle + from->costs[way];
    if (UNLIKELY(cycle >= *clock->stop_at)) {
        return false;
    }
    *clock->cycle = cycle;
    *clock->row = to->row;
    clock->last[(*clock->logged)++ % LAST_ROWS] = (struct record){cycle, to->start, 0};
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
static inline struct block *known(const struct interpreter *s, uint32_t address)
{
    struct block *block = s->blocks[address >> 1 & (CODE_SLOTS - 1)];
    return block != NULL && block->start == address ? block : NULL;
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

#define GO_ON(count)                                                                                                    \
    do {                                                                                                                \
        op += (count);                                                                                                  \
        DISPATCH();                                                                                                     \
    } while (0)
#define TAKE(way, address)                                                                                              \
    do {                                                                                                                \
        struct block *const to = block->links[way];                                                                     \
        if (LIKELY(passes(s, block, way, to))) {                                                                        \
            block = to;                                                                                                 \
            op = block->ops;                                                                                            \
            DISPATCH();                                                                                                 \
        }                                                                                                               \
        s->is.pc = (address);                                                                                           \
        s->is.it_state = op->after;                                                                                     \
        if ((block = enter(s, block, way)) == NULL) {                                                                   \
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
        if (LIKELY(passes(s, block, way, to))) {                                                                        \
            block = to;                                                                                                 \
            op = block->ops;                                                                                            \
            DISPATCH();                                                                                                 \
        }                                                                                                               \
        s->is.pc = there;                                                                                               \
        s->is.it_state = op->after;                                                                                     \
        if ((block = enter(s, NULL, way)) == NULL) {                                                                    \
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

#define GOES_ON(name)                                                                                                   \
    HANDLER(name)                                                                                                       \
    do_##name(s, op);                                                                                                   \
    GO_ON(1);
#define MAY_FAIL(name)                                                                                                  \
    HANDLER(name)                                                                                                       \
    if (UNLIKELY(!do_##name(s, op))) {                                                                                  \
        goto ended;                                                                                                     \
    }                                                                                                                   \
    GO_ON(1);

#define N_SET (s->is.n >> 31)
#define V_SET (s->is.v >> 31)
#define Z_SET (s->is.z == 0)
#define IS_LESS ((int32_t)(s->is.n ^ s->is.v) < 0)
#define BY_CONDITIONS(X)                                                                                                \
    X(EQ, Z_SET) X(NE, !Z_SET) X(CS, s->is.c) X(CC, !s->is.c) X(MI, N_SET) X(PL, !N_SET) X(VS, V_SET) X(VC, !V_SET)     \
    X(HI, s->is.c && !Z_SET) X(LS, !s->is.c || Z_SET) X(GE, !IS_LESS) X(LT, IS_LESS)                                    \
    X(GT, !Z_SET && !IS_LESS) X(LE, Z_SET || IS_LESS)
#define SKIPS(name, condition)                                                                                          \
    HANDLER(SKIP_##name)                                                                                                \
    GO_ON((condition) ? 1 : 1 + op->imm);
#define BRANCHES(name, condition)                                                                                       \
    HANDLER(B_##name)                                                                                                   \
    BRANCH_IF(condition);

/* Runs from a block on that has been entered until a hook or an instruction ends the run. Without an interpreter: returns
 * what `handler` of each micro-operation is, null where they are not used. */
const void *const *interpreter_execute(struct interpreter *s, struct block *block)
{
#if defined(__GNUC__) && !defined(INTERPRETER_PORTABLE)
#define ADDRESS_OF(name) &&at_##name,
    static const void *const handlers[MICRO_COUNT] = {STRAIGHT(ADDRESS_OF) ACCESSING(ADDRESS_OF) ENDING(ADDRESS_OF)};
    if (s == NULL) {
        return handlers;
    }
#else
    if (s == NULL) {
        return NULL;
    }
#endif
    const struct op *op;
    if (block == NULL) {
        goto again;
    }
    op = block->ops;
    DISPATCH();

#if !defined(__GNUC__) || defined(INTERPRETER_PORTABLE)
dispatch:
    switch ((enum micro)op->number) {
#endif
        STRAIGHT(GOES_ON)
        ACCESSING(MAY_FAIL)
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
        HANDLER(SVC)
        HANDLER(BKPT)
        HANDLER(UDF)
        HANDLER(NO_COPROCESSOR)
        HANDLER(WAIT)
        HANDLER(HINT)
        end_by(s, op);
        goto ended;
#if !defined(__GNUC__) || defined(INTERPRETER_PORTABLE)
    case MICRO_COUNT: return NULL;
    }
#endif

ended:
    /* A hook has said what becomes of the run: it ends, or goes on where the PC now is. */
    if (s->stops) {
        return NULL;
    }
again:
    if ((block = enter(s, NULL, 0)) == NULL) {
        return NULL;
    }
    op = block->ops;
    DISPATCH();
}
