/* What a basic block costs on a Cortex-M3, in cycles, and when in it each instruction begins.
 *
 * Costs are those of the Cortex-M3 Technical Reference Manual (r1p1, chapter 18), by the class of each instruction in the
 * table of encodings, with the data-dependent ones at a stated value between their bounds. Flash wait states follow a model
 * of the prefetch buffer that is ours and not measured on silicon: two 8-byte lines, the next line being read while the
 * present one runs.
 *
 * This is not a disassembler and not an executor: it sorts each encoding into a class, and names the registers that matter
 * for pipelining and for traps. Source of the encodings: ARMv7-M Architecture Reference Manual A5, A7.
 * Invariant: a block's cost depends on its bytes, its address, the wait states and the prefetch setting, and on nothing else.
 */
#include "core.h"

#include "../interpreter/encodings.h"

/* No such register. Bytes that one access to the flash delivers (RM0008 3.3.3: 64-bit lines). */
enum { NONE = 255, LINE_BYTES = 8 };
enum { FIRST_WIDE = 0xE800, REGISTER_SP = 13, REGISTER_PC = 15 };

static uint32_t sign_extended(uint32_t value, uint32_t bits) { return value >> (bits - 1) ? value - (1u << bits) : value; }

static uint32_t narrow_displacement(uint32_t word)
{
    if ((word & 0xF500) == 0xB100) {
        return (word >> 3 & 0x1F) << 1 | (word >> 9 & 1) << 6;
    }
    return 2 * ((word & 0xF000) == 0xD000 ? sign_extended(word & 0xFF, 8) : sign_extended(word & 0x7FF, 11));
}

static uint32_t wide_displacement(uint32_t word)
{
    const uint32_t first = word >> 16, second = word & 0xFFFF, sign = first >> 10 & 1, j1 = second >> 13 & 1, j2 = second >> 11 & 1;
    if (second & 0x1000) { /* B.W and BL: 25 bits */
        const uint32_t i1 = !(j1 ^ sign), i2 = !(j2 ^ sign);
        return sign_extended(sign << 24 | i1 << 23 | i2 << 22 | (first & 0x3FF) << 12 | (second & 0x7FF) << 1, 25);
    }
    return sign_extended(sign << 20 | j2 << 19 | j1 << 18 | (first & 0x3F) << 12 | (second & 0x7FF) << 1, 21);
}

static void branch(struct measured *to, uint32_t displacement, bool is_always)
{
    to->destination = to->address + 4 + displacement;
    to->has_destination = 1;
    to->always_branches = is_always;
}

static void take_narrow(struct measured *to, uint32_t word)
{
    switch (to->kind) {
    case KIND_LOAD_LITERAL:
        to->base = REGISTER_PC;
        to->target = word >> 8 & 7;
        break;
    case KIND_LOAD:
    case KIND_STORE:
    case KIND_STORE_INDEXED:
        if ((word & 0xF000) == 0x9000) {
            to->base = REGISTER_SP;
            to->target = word >> 8 & 7;
            break;
        }
        to->base = word >> 3 & 7;
        to->index = (word & 0xF000) == 0x5000 ? word >> 6 & 7 : NONE;
        to->target = word & 7;
        break;
    case KIND_LOAD_MULTIPLE:
    case KIND_STORE_MULTIPLE:
        if ((word & 0xF000) == 0xB000) { /* POP, PUSH */
            to->count = (uint8_t)__builtin_popcount(word & 0x1FF);
            to->loads_pc = to->kind == KIND_LOAD_MULTIPLE && word & 0x100;
            to->base = REGISTER_SP;
            break;
        }
        to->count = (uint8_t)__builtin_popcount(word & 0xFF);
        to->base = word >> 8 & 7;
        break;
    case KIND_BRANCH: branch(to, narrow_displacement(word), word >> 11 == 0x1C); break;
    case KIND_IF_THEN: to->sets_it = (uint8_t)word; break;
    default: break;
    }
}

static void take_wide(struct measured *to, uint32_t word)
{
    const uint8_t base = word >> 16 & 15, target = word >> 12 & 15;
    switch (to->kind) {
    case KIND_LOAD_MULTIPLE:
    case KIND_STORE_MULTIPLE:
        to->count = (uint8_t)__builtin_popcount(word & 0xFFFF);
        to->loads_pc = to->kind == KIND_LOAD_MULTIPLE && word & 1u << REGISTER_PC;
        to->base = base;
        break;
    case KIND_LOAD_DUAL:
    case KIND_STORE_DUAL:
    case KIND_TABLE_BRANCH: /* three cycles for the load and the addition */
        to->count = 2;
        to->base = base;
        break;
    case KIND_LOAD:
    case KIND_LOAD_LITERAL:
    case KIND_LOAD_PC:
    case KIND_STORE:
    case KIND_STORE_INDEXED:
        to->base = base;
        to->index = base != REGISTER_PC && !(word & 0x00800800) ? word & 15 : NONE;
        to->target = target;
        if (target == REGISTER_PC && (to->kind == KIND_LOAD || to->kind == KIND_LOAD_LITERAL)) {
            to->kind = KIND_LOAD_PC;
        }
        break;
    case KIND_DIVIDE: to->base = word & 15; break;
    case KIND_EXCLUSIVE: to->base = base; break;
    case KIND_BRANCH:
    case KIND_CALL: branch(to, wide_displacement(word), word & 1 << 12); break;
    default: break;
    }
}

static uint8_t advanced(uint8_t it) { return (uint8_t)(it & 7 ? (it & 0xE0) | (it << 1 & 0x1F) : 0); }

/* Takes a straight run of code apart; returns how many instructions it has. There is room for one each two bytes. */
uint32_t measure_decode(const uint8_t *code, uint32_t bytes, uint32_t address, struct measured *rows)
{
    uint32_t count = 0, at = 0;
    uint8_t it = 0;
    while (at + 2 <= bytes) {
        const uint32_t first = code[at] | (uint32_t)code[at + 1] << 8;
        const bool is_wide = first >= FIRST_WIDE && at + 4 <= bytes;
        const uint32_t word = is_wide ? first << 16 | code[at + 2] | (uint32_t)code[at + 3] << 8 : first;
        struct measured *to = &rows[count++];
        const struct encoding *row = interpreter_row_of(word, is_wide);
        *to = (struct measured){.address = address + at, .kind = row == NULL ? KIND_PLAIN : row->kind, .bytes = is_wide ? 4 : 2,
                                .base = NONE, .index = NONE, .target = NONE, .it_state = it};
        if (is_wide) {
            take_wide(to, word);
        } else {
            take_narrow(to, word);
        }
        to->gives_up = kind_gives_up[to->kind];
        it = to->kind == KIND_IF_THEN ? to->sets_it : advanced(it);
        at += to->bytes;
    }
    return count;
}

/* Cycles of an instruction without refill and wait states. TRM 18.3: an access right after a load overlaps it, unless its
 * address needs the value loaded. */
static uint32_t cycles_of(const struct measured *one, const struct measured *before)
{
    const uint32_t cycles = kind_cycles[one->kind] + one->count;
    const bool follows_load = before != NULL && (before->kind == KIND_LOAD || before->kind == KIND_LOAD_LITERAL);
    const bool may_overlap = one->kind == KIND_LOAD || one->kind == KIND_LOAD_LITERAL || one->kind == KIND_STORE_INDEXED;
    return cycles - (follows_load && may_overlap && before->target != one->base && before->target != one->index);
}

/* The two-line prefetch buffer between flash and core: when the present line arrived, and when its first instruction began. */
struct fetch {
    uint32_t line, ready, entered;
};

/* When an instruction can begin, if the core is ready for it at `clock`. */
static uint32_t fetched(struct fetch *fetch, const struct measured *one, uint32_t clock, uint32_t wait_states, bool has_prefetch)
{
    const uint32_t last = (one->address + one->bytes - 1) / LINE_BYTES;
    while (wait_states && fetch->line < last) {
        ++fetch->line;
        if (has_prefetch) {
            fetch->ready = (fetch->ready > fetch->entered ? fetch->ready : fetch->entered) + 1 + wait_states;
            clock = clock > fetch->ready ? clock : fetch->ready;
        } else {
            clock += wait_states;
        }
        fetch->entered = clock;
    }
    return clock;
}

/* What leaving the block by a branch costs beyond its straight cycles. */
static uint32_t refill_of(const struct measured *last, uint32_t wait_states)
{
    const uint32_t refill = last->kind == KIND_LOAD_MULTIPLE && !last->loads_pc ? 0 : kind_refill[last->kind];
    const bool is_near = last->has_destination && last->destination / LINE_BYTES == last->address / LINE_BYTES;
    return refill + (is_near ? 0 : wait_states); /* where it is near, the line is still in the buffer */
}

static uint32_t flags_of(const struct measured *rows, uint32_t count, uint32_t start)
{
    const struct measured *last = &rows[count - 1];
    uint32_t flags = count == 1 && last->has_destination && last->destination == start ? ROW_SELF_LOOP : 0;
    for (uint32_t n = 0; n < count; ++n) {
        flags |= rows[n].kind == KIND_MASK_CHANGE ? ROW_CHANGES_MASKS : rows[n].kind == KIND_SEND_EVENT ? ROW_SENDS_EVENT : 0;
    }
    return flags | (last->kind == KIND_WAIT_INTERRUPT ? ROW_ENDS_IN_WFI : last->kind == KIND_WAIT_EVENT ? ROW_ENDS_IN_WFE
                    : last->kind == KIND_YIELD        ? ROW_ENDS_IN_YIELD : 0);
}

/* Measures the block of these bytes, whole instructions. `wait_states`: 0 to 2 for flash, 0 for code in SRAM;
 * `has_prefetch`: FLASH_ACR PRFTBE. */
void measure_block(const uint8_t *code, uint32_t bytes, uint32_t start, uint32_t wait_states, bool has_prefetch,
                   struct measured *rows, struct block_cost *cost)
{
    const uint32_t count = measure_decode(code, bytes, start, rows);
    *cost = (struct block_cost){.count = count};
    if (!count) {
        return;
    }
    struct fetch fetch = {.line = start / LINE_BYTES};
    uint32_t clock = 0;
    for (uint32_t n = 0; n < count; ++n) {
        clock = rows[n].cycle = fetched(&fetch, &rows[n], clock, wait_states, has_prefetch);
        clock += cycles_of(&rows[n], n ? &rows[n - 1] : NULL) + (rows[n].kind == KIND_LOAD_LITERAL ? wait_states : 0);
    }
    const struct measured *last = &rows[count - 1];
    /* A branch to the very next instruction refills the pipeline as any other. */
    const bool always_goes = last->always_branches && last->destination == start + bytes && !last->it_state;
    cost->taken = clock + refill_of(last, wait_states);
    cost->straight = always_goes ? cost->taken : clock;
    cost->flags = flags_of(rows, count, start);
}
