/* Entering basic blocks: charge the one that has ended, end the run or go on. */
#include <stdlib.h>
#include <string.h>

#include "core.h"

static uint32_t flash_slot(uint32_t address) { return address >> 1 & (FLASH_SLOTS - 1); }

static struct row **slot(struct core *core, uint32_t address)
{
    const struct shared *s = &core->shared;
    if (address - s->flash_base < s->flash_bytes || address < s->flash_bytes) {
        return &core->flash_rows[flash_slot(address)];
    }
    if (address - s->sram_base < 2 * SRAM_SLOTS) {
        return &core->sram_rows[(address - s->sram_base) >> 1];
    }
    return &core->other_row;
}

static struct row *find(struct core *core, uint32_t address)
{
    struct row *row = *slot(core, address);
    return row != NULL && row->start == address ? row : NULL;
}

void end_run(struct core *core, uint32_t kind, uint32_t pc)
{
    if (core->shared.halt_kind != HALT_FROZEN) {
        core->shared.halt_kind = kind;
        core->shared.halt_pc = pc;
    }
    core->api.stop(core->unicorn);
}

static void stop_at_boundary(struct core *core, uint32_t address)
{
    core->block = &core->none;
    end_run(core, HALT_BOUNDARY, address);
}

void core_flush(struct core *core)
{
    if (core->record_count) {
        const uint32_t count = core->record_count;
        core->record_count = 0;
        leave_ahead(core->fabric);
        core->calls.recorded(core->records, count);
    }
}

/* Passes a row on to Python, when there are enough of them. */
static void pass_on(struct core *core, const struct record *row)
{
    core->shared.is_first = 0;
    core->records[core->record_count++] = *row;
    if (core->record_count == core->record_room) {
        core_flush(core);
    }
}

/* Keeps a row, and passes it on if a recorder is attached. */
static inline void log_row(struct core *core, uint64_t cycle, uint32_t address, int32_t kind)
{
    const struct record row = {cycle, address, kind};
    core->shared.last[core->shared.logged++ % LAST_ROWS] = row;
    if (UNLIKELY(core->records != NULL)) {
        pass_on(core, &row);
    }
}

void record_at(struct core *core, uint64_t cycle, uint32_t address, int32_t kind) { log_row(core, cycle, address, kind); }

void record(struct core *core, uint32_t address, int32_t kind) { log_row(core, core->shared.cycle, address, kind); }

/* Logs a branch to itself: once, however long it spins; as `BlockLog.add_spin`. */
static void log_spin(struct core *core, uint32_t address)
{
    const struct shared *s = &core->shared;
    const struct record *last = &s->last[(s->logged - 1) % LAST_ROWS];
    if (!s->logged || last->kind != 0 || last->address != address) {
        record(core, address, 0);
    } else if (core->records != NULL && s->is_first) {
        const struct record row = {s->cycle, address, 0};
        pass_on(core, &row);
    }
}

/* Has a block that may unmask what waits be looked at behind its end. */
static void unmask(struct core *core, const struct row *row)
{
    if (row->flags & ROW_CHANGES_MASKS && core->shared.mask_stop) {
        core->shared.stop_at = 0;
    }
}

/* A block that is new, stands in writable memory, or needs attention. */
static void enter_special(struct core *core, uint32_t address, uint32_t size, struct row *row)
{
    struct shared *s = &core->shared;
    if (core->is_scratch) {
        return;
    }
    if (row != NULL && row->flags & ROW_WRITABLE && memcmp(row->host, row->code, row->compared) != 0) {
        row = NULL;
    }
    core->waiting.has_acted |= row == NULL || row->flags & (ROW_CHANGES_MASKS | ROW_SENDS_EVENT);
    if (row == NULL) {
        leave_ahead(core->fabric);
        core->calls.unknown_block(address, size);
        row = find(core, address);
        if (s->halt_kind != HALT_NONE || row == NULL) {
            if (s->halt_kind == HALT_NONE) {
                s->halt_kind = HALT_FAILED;
            }
            core->block = &core->none;
            end_run(core, s->halt_kind, address);
            return;
        }
    }
    if (row->flags & ROW_SELF_LOOP && row == core->block) {
        /* It has gone round once: nothing but an interrupt ends it, so go round until the time is up. */
        const uint64_t left = next_stop(core) - s->cycle;
        s->cycle += (left + row->costs[1] - 1) / row->costs[1] * row->costs[1];
        stop_at_boundary(core, address);
        return;
    }
    begin_block(core, row);
    unmask(core, row);
    if (row->flags & ROW_SENDS_EVENT) {
        s->event_register = 1;
    }
    if (row->flags & ROW_SELF_LOOP) {
        log_spin(core, address);
    } else {
        record(core, address, 0);
    }
}

uint32_t cycles_until(const struct row *row, uint32_t address)
{
    if (address == row->end) {
        return row->costs[0];
    }
    const struct instruction *one = instruction_at(row, address);
    return one == NULL ? row->costs[1] : one->cycle;
}

/* What is left of a block when the core stands inside it, or before an LDM or STM of which so many words are moved; null
 * without memory for it. */
static struct row *rest_of(struct row *whole, uint32_t address, uint32_t moved)
{
    for (struct row *row = whole->rests; row != NULL; row = row->next) {
        if (row->start == address && row->moved == moved) {
            return row;
        }
    }
    const struct instruction *first = instruction_at(whole, address);
    const uint32_t count = first == NULL ? 0 : whole->count - (uint32_t)(first - whole->instructions);
    struct row *row = count ? malloc(sizeof *row + count * sizeof *first) : NULL;
    if (row != NULL) {
        const uint32_t done = first->cycle + moved;
        *row = (struct row){.start = address, .end = whole->end, .plain_start = NOWHERE, .flags = whole->flags, .count = count,
                            .costs = {whole->costs[0] - done, whole->costs[1] - done},
                            .passed = {NEVER, NEVER}, .span = whole->span - done, .whole = whole,
                            .ways = whole->ways, .moved = moved,
                            .next = whole->rests};
        memcpy(row->instructions, first, count * sizeof *first);
        for (uint32_t n = 0; n < count; ++n) {
            row->instructions[n].cycle -= n ? done : first->cycle;
        }
        whole->rests = row;
    }
    return row;
}

/* The row of the block inside which the interpreter stands, which no run has entered yet; null: it cannot be measured. */
static struct row *row_around(struct core *core)
{
    const struct registers *is = &core->interpreter->is;
    struct row *row = find(core, is->block_start);
    if (row == NULL) {
        core->calls.unknown_block(is->block_start, is->block_end - is->block_start);
        row = find(core, is->block_start);
    }
    return row;
}

/* Finds out whether a block may be entered without a closer look. */
static void find_plain(const struct core *core, struct row *row)
{
    const bool is_plain = !(row->flags & ROW_ATTENTION) && row->loop == NULL && core->records == NULL;
    row->plain_start = is_plain ? row->start : NOWHERE;
}

static void forget_known(struct core *core)
{
    if (core->interpreter != NULL) {
        interpreter_forget_rows(core->interpreter);
    }
}

/* Records from now on, `room` rows before Python is called; 0: no more. Returns false without memory for it. */
bool core_start_recording(struct core *core, uint32_t room)
{
    free(core->records);
    core->records = room ? malloc(room * sizeof *core->records) : NULL;
    core->record_room = room;
    core->record_count = 0;
    core->shared.is_first = 1;
    forget_known(core);
    for (struct row *row = core->all; row != NULL; row = row->next) {
        find_plain(core, row);
    }
    return !room || core->records != NULL;
}

/* After an MSR, which ends its block: clears what Unicorn keeps of it and the chip does not have. */
static RARELY void trim_registers(struct core *core)
{
    static const int numbers[3] = {REG_BASEPRI, REG_MSP, REG_PSP};
    static const uint32_t kept[3] = {0xF0, ~3u, ~3u};
    core->privilege = PRIVILEGE_UNKNOWN;
    for (int n = 0; n < 3; ++n) {
        uint32_t value = read_register(core, numbers[n]);
        if (value & ~kept[n]) {
            value &= kept[n];
            write_registers(core, &numbers[n], &value, 1);
        }
    }
}

/* Enters a block that may be the first, an unusual one, or too late. */
static __attribute__((noinline)) void enter_block(struct core *core, uint32_t address, uint32_t size)
{
    const struct row *before = core->block;
    bool has_looked = false;
    core->shared.cycle += before->costs[address != before->end];
    *before->ways |= (uint8_t)(1u << (address != before->end));
    if (UNLIKELY(before->flags & ROW_CHANGES_MASKS)) {
        trim_registers(core);
    }
    if (UNLIKELY(core->shared.cycle >= core->shared.stop_at)) {
        if (core->resumed != NULL) { /* no boundary: it goes on inside its block */
            core->block = core->resumed;
            core->shared.stop_at = core->resumed_stop_at;
            core->resumed = NULL;
            return;
        }
        const enum way way = looks_for_waiting(core, address) ? GOES_ON : goes_on(core, address);
        if (way == ENDS) {
            stop_at_boundary(core, address);
        }
        if (way != GOES_ON) {
            return;
        }
        has_looked = true;
    }
    struct row *row = find(core, address);
    if (UNLIKELY(row == NULL || row->flags & ROW_ATTENTION)) {
        enter_special(core, address, size, row);
        return;
    }
    begin_block(core, row);
    record(core, address, 0);
    if (UNLIKELY(row == before) && row->loop != NULL && core->records == NULL) {
        wait_on(core, row, rounds_of_loop(core, row, has_looked));
    }
}

void core_on_block(void *unicorn, uint64_t at, uint32_t size, void *user)
{
    (void)unicorn;
    struct core *core = user;
    const struct row *before = core->block;
    const uint32_t address = (uint32_t)at;
    struct row *row = core->flash_rows[flash_slot(address)];
    const uint64_t cycle = core->shared.cycle + before->passed[address != before->end];
    if (UNLIKELY(row == NULL || row->plain_start != address || cycle >= core->shared.stop_at)) {
        enter_block(core, address, size);
        return;
    }
    core->shared.cycle = cycle;
    *before->ways |= (uint8_t)(1u << (address != before->end));
    begin_block(core, row);
    core->shared.last[core->shared.logged++ % LAST_ROWS] = (struct record){cycle, address, 0};
}

/* The core is inside a block: acts on what is due, and goes on with the rest of it. */
static void enter_rest(struct core *core, uint32_t address, uint32_t size)
{
    struct shared *s = &core->shared;
    struct row *row = core->block;
    if (row == &core->none) {
        row = row_around(core);
    } else {
        s->cycle += cycles_until(row, address);
        row = row->whole != NULL ? row->whole : row;
    }
    if (!s->stop_at || s->attention || s->cycle >= stop_of(core)) {
        const enum way way = goes_on(core, address);
        if (way == ENDS) {
            stop_at_boundary(core, address);
        }
        if (way != GOES_ON) {
            return;
        }
    }
    struct row *rest = row == NULL ? NULL : rest_of(row, address, 0);
    if (rest != NULL) {
        begin_block(core, rest);
        unmask(core, rest);
        return;
    }
    core->block = &core->none;
    if (s->halt_kind != HALT_NONE) {
        end_run(core, s->halt_kind, address);
    } else { /* the code is another by now */
        core->interpreter->is.block_start = 0;
        enter_block(core, address, size);
    }
}

/* The instruction of a block that runs when so many cycles are left until something is due, and its end. */
static uint32_t running_at(const struct row *row, uint64_t left, uint64_t *end)
{
    uint32_t n = row->count - 1;
    *end = row->costs[0];
    for (; n && row->instructions[n].cycle >= left; --n) {
        *end = row->instructions[n].cycle;
    }
    return n;
}

/* Whether an instruction of the block may be left undone for what is due in so many cycles, which come in its midst. */
static bool gives_up(const struct core *core, const struct row *row, uint64_t due, uint32_t *number)
{
    if (due >= row->costs[0]) {
        return false;
    }
    uint64_t end;
    *number = running_at(row, due, &end);
    return row->instructions[*number].gives_up && due < end && !waits_for_python(core->fabric, core->shared.cycle + due);
}

/* Acts on what is due in the midst of the instruction that begins now; the run's limit does not count, or it would depend on
 * it whether the instruction is left undone. Where no exception comes of it, the instruction is run as if nothing were. */
static enum way act_within(struct core *core, uint64_t due)
{
    struct shared *s = &core->shared;
    struct row *row = core->block;
    const uint64_t began = s->cycle, limit = core->limit;
    s->cycle += due;
    core->limit = NEVER;
    core->within = due;
    const enum way way = goes_on(core, row->start);
    core->within = 0;
    core->limit = limit;
    s->stop_at = s->stop_at < limit ? s->stop_at : limit;
    if (way != ELSEWHERE) {
        s->cycle = began;
        begin_block(core, row);
    }
    return way;
}

/* Has the block that is entered end before the first of its instructions that begins when something is due, or later; and
 * before one that would run then and may be left undone for an exception. */
static void cut(struct core *core)
{
    struct shared *s = &core->shared;
    const struct row *row = core->block;
    uint64_t left = stop_of(core) - s->cycle, end;
    uint32_t number;
    while (gives_up(core, row, core_next_event(core) - s->cycle, &number)) {
        if (number) {
            left = left < row->instructions[number].cycle ? left : row->instructions[number].cycle;
            break;
        }
        const enum way way = act_within(core, core_next_event(core) - s->cycle);
        if (way == ELSEWHERE) {
            return;
        }
        left = stop_of(core) - s->cycle;
        if (way == ENDS) {
            s->stop_at = 0;
            left = 1;
            break;
        }
    }
    if (row->span < left && row->whole == NULL) {
        return;
    }
    const uint32_t last = running_at(row, left, &end);
    core->interpreter->cut_at = last + 1 < row->count ? row->instructions[last + 1].address : row->end;
    if (core->interpreter->cut_at == row->end && row->whole == NULL) {
        core->interpreter->cut_at = 0;
    }
}

/* Behind an access that was made: has the core go on inside the block where something may be due before its end. */
void leave_in_time(struct core *core)
{
    const struct shared *s = &core->shared;
    const struct row *row = core->block;
    if (!core->is_exact || s->is_python || (s->stop_at && s->cycle + row->span < stop_of(core))) {
        return;
    }
    const struct instruction *made = instruction_at(row, core->noted);
    if (made != NULL && made + 1 < row->instructions + row->count) {
        core->interpreter->leaves_to = made[1].address;
    }
}

/* The same where the interpreter runs the blocks: it gets those that it may enter itself. */
void core_on_known_block(void *interpreter, uint64_t at, uint32_t size, void *user)
{
    struct core *core = user;
    if (core->interpreter->is.block_start) {
        enter_rest(core, (uint32_t)at, size);
    } else {
        core_on_block(interpreter, at, size, user);
        const uint32_t moved = core->interpreter->entering->moved;
        if (UNLIKELY(moved) && core->block->start == (uint32_t)at) {
            struct row *rest = rest_of(core->block, core->block->start, moved);
            begin_block(core, rest == NULL ? core->block : rest);
        }
    }
    struct row *row = core->block;
    if (row->plain_start == (uint32_t)at) {
        interpreter_know(interpreter, row, row->passed[0], row->passed[1], core->is_exact ? row->span : 0, row->ways);
    }
    if (core->is_exact && row != &core->none) {
        cut(core);
    }
}

/* Before a division by 0, or a transfer of several words that is not aligned. */
static void on_trap(void *user, bool is_alignment, uint32_t pc, uint32_t value)
{
    struct core *core = user;
    if (is_alignment || core->shared.traps_division) {
        leave_ahead(core->fabric);
        core->calls.trapped(is_alignment ? HALT_UNALIGNED : HALT_DIVIDE_BY_ZERO, pc, value);
    }
}

/* Has the interpreter run instructions in Unicorn's place, and what is due come at the instruction or behind its block. */
void core_use_interpreter(struct core *core, struct interpreter *interpreter, bool is_exact)
{
    core->is_exact = is_exact;
    core->interpreter = interpreter;
    interpreter_set_clock(interpreter, &(struct clock){&core->shared, (void **)&core->block});
    interpreter_set_noted(interpreter, &core->noted);
    interpreter_set_trap(interpreter, on_trap, core);
}

/* Returns false without memory for it. `instructions` has `count` rows, the costs are those of block_cost.py. */
bool core_add_row(struct core *core, uint32_t start, uint32_t end, uint32_t straight, uint32_t taken, uint32_t flags,
                  const struct instruction *instructions, uint32_t count, const uint8_t *host, uint32_t compared)
{
    struct row **at = slot(core, start);
    const size_t list = count * sizeof *instructions;
    struct row *row = malloc(sizeof *row + list);
    uint8_t *code = host == NULL ? NULL : malloc(compared);
    if (row == NULL || (host != NULL && code == NULL)) {
        free(row);
        free(code);
        return false;
    }
    const bool is_looked_after = flags & ROW_CHANGES_MASKS;
    const bool is_in_flash = at >= core->flash_rows && at < core->flash_rows + FLASH_SLOTS;
    *row = (struct row){.start = start, .end = end, .costs = {straight, taken},
                        .ways = &core->ways[is_in_flash ? flash_slot(end) : FLASH_SLOTS],
                        .passed = {is_looked_after ? NEVER : straight, is_looked_after ? NEVER : taken},
                        .flags = flags, .count = count, .host = host, .code = code, .compared = compared,
                        .next = core->all};
    const struct instruction *last = &instructions[count - 1];
    row->span = !count ? 0 : last->gives_up ? straight - 1 : last->cycle;
    find_plain(core, row);
    memcpy(row->instructions, instructions, list);
    if (host != NULL) {
        memcpy(code, host, compared);
    }
    if (start - core->shared.sram_base < core->shared.sram_bytes) {
        const uint32_t first = (start - core->shared.sram_base) / CODE_BYTES, last = (end - 1 - core->shared.sram_base) / CODE_BYTES;
        for (uint32_t n = first; n <= last && n < CODE_PLACES; ++n) {
            core->code_places[n / 8] |= (uint8_t)(1 << n % 8);
        }
    }
    core->all = row;
    *at = row;
    return true;
}

/* Says of a known block that it is a loop that may poll a counter. Returns false without memory for it. */
bool core_set_loop(struct core *core, uint32_t start, const struct loop *loop)
{
    struct row *row = find(core, start);
    row->loop = malloc(sizeof *row->loop);
    if (row->loop != NULL) {
        *row->loop = *loop;
        find_plain(core, row);
    }
    return row->loop != NULL;
}

/* Measure blocks again when they are next entered of which something stands from `first` up to before `end`; the one that
 * runs keeps its costs. */
void core_forget_range(struct core *core, uint32_t first, uint32_t end)
{
    memset(core->forced, 0, sizeof core->forced);
    forget_known(core);
    for (struct row **at = &core->all; *at != NULL;) {
        struct row *row = *at;
        if (row->start >= end || row->end <= first) {
            at = &row->next;
            continue;
        }
        struct row **place = slot(core, row->start);
        *place = *place == row ? NULL : *place;
        *at = row->next;
        row->next = core->dropped;
        core->dropped = row;
    }
}

/* Of each half-word of flash: see `core.ways`. */
const uint8_t *core_ways(const struct core *core) { return core->ways; }

void core_forget_rows(struct core *core) { core_forget_range(core, 0, UINT32_MAX); }

void free_dropped(struct core *core)
{
    while (core->dropped != NULL) {
        struct row *row = core->dropped;
        core->dropped = row->next;
        free(row->code);
        free(row->loop);
        while (row->rests != NULL) {
            struct row *rest = row->rests;
            row->rests = rest->next;
            free(rest);
        }
        free(row);
    }
}

const struct instruction *instruction_at(const struct row *row, uint32_t address)
{
    for (uint32_t n = 0; n < row->count; ++n) {
        if (row->instructions[n].address == address) {
            return &row->instructions[n];
        }
    }
    return NULL;
}

/* Start of the block that runs, or of whose rest does; all ones for none. */
uint32_t core_block_start(const struct core *core)
{
    return core->block->whole != NULL ? core->block->whole->start : core->block->start;
}

/* And where it runs from. */
uint32_t core_block_from(const struct core *core) { return core->block->start; }

/* Start of the block inside which the core stands between two runs; all ones where that is at the start of one. */
uint32_t core_block_around(const struct core *core)
{
    const struct registers *is = core->interpreter == NULL ? NULL : &core->interpreter->is;
    return is != NULL && is->pc == core->shared.pc && stands_inside(core->interpreter, is->pc) ? is->block_start : UINT32_MAX;
}

void core_leave_block(struct core *core) { core->block = &core->none; }
