/* Decodes a basic block: each instruction by the table of encodings, up to what ends the block.
 *
 * A block ends where Unicorn's does: at a branch, at an instruction that ends a run or may change masks or the pipeline,
 * and before the instruction that would begin in another kilobyte, or reach into it.
 * Source: ARMv7-M Architecture Reference Manual A5.1 (the first halfword tells the size), A7.3.2 (IT).
 */
#include <stdlib.h>
#include <string.h>

#include "lower.h"

enum { FIRST_WIDE = 0xE800, NARROW_BYTES = 2, ARM_STATE_BYTES = 4, ALWAYS = 14 };
enum { MOST_OPS = PAGE_BYTES / NARROW_BYTES * MOST_OPS_EACH };

static uint32_t halfword(const uint8_t *code) { return code[0] | (uint32_t)code[1] << 8; }

/* The encoding of an instruction; null: it is undefined. */
const struct encoding *interpreter_row_of(uint32_t word, bool is_wide)
{
    const struct encoding *rows = is_wide ? wide : narrow;
    const size_t count = is_wide ? sizeof wide / sizeof wide[0] : sizeof narrow / sizeof narrow[0];
    for (size_t n = 0; n < count; ++n) {
        if ((word & rows[n].mask) == rows[n].value) {
            return rows[n].operation == UNDEFINED ? NULL : &rows[n];
        }
    }
    return NULL;
}

/* Takes an instruction apart. */
void interpreter_take_apart(uint32_t word, bool is_wide, struct decoded *one)
{
    *one = (struct decoded){.operation = UNDEFINED};
    const struct encoding *row = interpreter_row_of(word, is_wide);
    if (row != NULL) {
        one->operation = row->operation;
        extract(row, word, one);
    }
}

static uint8_t advanced(uint32_t it) { return (uint8_t)(it & 7 ? (it & 0xE0) | (it << 1 & 0x1F) : 0); }

/* Adds one instruction; whether the block ends behind it. */
static enum outcome add(struct interpreter *s, struct builder *to, uint32_t word, bool is_wide)
{
    struct decoded one;
    interpreter_take_apart(word, is_wide, &one);
    to->after = advanced(to->it);
    const uint32_t condition = to->it ? to->it >> 4 : ALWAYS;
    struct op *const skip = condition < ALWAYS && one.operation != BKPT ? &to->ops[to->count] : NULL; /* BKPT is never conditional */
    if (skip != NULL) {
        emit(to, OP_SKIP_EQ + condition);
    }
    if (interpreter_is_hooked(s, to->pc)) {
        emit(to, OP_HOOK, .imm = to->end - to->pc);
    }
    const enum outcome outcome = interpreter_lower(to, &one);
    if (one.operation == IT) {
        to->after = (uint8_t)one.i;
    }
    if (skip != NULL) {
        skip->imm = (uint32_t)(&to->ops[to->count] - skip) - 1;
        if (outcome == ENDS_BLOCK) {
            emit(to, OP_STRAIGHT_ON);
        }
    }
    return outcome;
}

/* Whether a block is over before the instruction at `at`: it is in another page, or its second half is. */
static bool leaves_page(uint32_t page, uint32_t at, const uint8_t *code)
{
    const uint32_t in_page = at - page;
    return in_page >= PAGE_BYTES || (in_page == PAGE_BYTES - NARROW_BYTES && halfword(code) >= FIRST_WIDE);
}

/* Decodes the block at an address, of which so many bytes are there; null: not even one instruction is. */
struct block *interpreter_decode(struct interpreter *s, uint32_t address, const uint8_t *code, uint32_t bytes)
{
    struct builder to = {.ops = malloc(MOST_OPS * sizeof *to.ops), .pc = address};
    if (is_continued(s->is.it_state)) {
        to.next = (uint8_t)(s->is.it_state >> 4);
    } else {
        to.it = (uint8_t)s->is.it_state;
    }
    if (to.ops == NULL) {
        return NULL;
    }
    enum outcome outcome = GOES_ON;
    uint32_t done = 0;
    if (!s->is.is_thumb) { /* nothing executes in ARM state: B1.5.6, INVSTATE */
        emit(&to, OP_UDF);
        done = ARM_STATE_BYTES;
        outcome = ENDS_BLOCK;
    }
    const uint32_t page = address & ~(uint32_t)(PAGE_BYTES - 1);
    while (outcome == GOES_ON && bytes - done >= NARROW_BYTES) {
        const uint32_t first = halfword(code + done);
        const bool is_wide = first >= FIRST_WIDE;
        const uint32_t size = is_wide ? 2 * NARROW_BYTES : NARROW_BYTES;
        if (bytes - done < size) {
            break;
        }
        to.pc = address + done;
        to.end = to.pc + size;
        outcome = add(s, &to, is_wide ? first << 16 | halfword(code + done + 2) : first, is_wide);
        to.it = to.after;
        to.next = 0;
        done = to.end - address;
        if (outcome == GOES_ON && (bytes - done < NARROW_BYTES || leaves_page(page, to.end, code + done))) {
            emit(&to, OP_STRAIGHT_ON);
            outcome = ENDS_BLOCK;
        }
    }
    interpreter_tidy(&to);
    struct block *block = to.count ? malloc(sizeof *block + to.count * sizeof *to.ops) : NULL;
    if (block != NULL) {
        *block = (struct block){.start = address, .end = address + done, .target = to.target, .it = (uint8_t)s->is.it_state,
                                .is_thumb = (uint8_t)s->is.is_thumb, .moved = to.moved, .count = to.count};
        memcpy(block->ops, to.ops, to.count * sizeof *to.ops);
    }
    free(to.ops);
    return block;
}

/* What the block of some code is made into: the number and the code of each micro-operation; returns how many there are. */
size_t interpreter_look(struct interpreter *s, const uint8_t *code, uint32_t bytes, uint16_t (*seen)[2], size_t room)
{
    struct block *block = interpreter_decode(s, 0, code, bytes);
    const size_t count = block == NULL ? 0 : block->count;
    for (size_t n = 0; n < count && n < room; ++n) {
        seen[n][0] = block->ops[n].number;
        seen[n][1] = block->ops[n].code;
    }
    free(block);
    return count;
}
