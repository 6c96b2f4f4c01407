/* A chip without Python: what stands in its place where the emulator runs in a browser.
 *
 * The chip itself is made by the calls that Python makes (`image.py`), replayed; what it then runs is C alone. What C would
 * ask Python for is answered here as far as start-up code needs it. All else is named to the page, by `page_notice`, and
 * reads 0.
 * Invariant: an access that is named is one that Python would have answered in another way, or warned of.
 */
#include <string.h>

#include "../../../extension/source/core/core.h"
#include "../../../extension/source/interpreter/interpreter.h"
#include "../../../extension/source/interpreter/encodings.h"

/* What else the library has for Python. */
struct core *core_new(void *unicorn, const struct unicorn_api *api, const struct callbacks *calls);
uint32_t core_run(struct core *made, uint64_t limit);
bool core_add_row(struct core *made, uint32_t start, uint32_t end, uint32_t straight, uint32_t taken, uint32_t flags,
                  const struct instruction *instructions, uint32_t count, const uint8_t *host, uint32_t compared);
void core_forget_rows(struct core *made);
void core_forget_range(struct core *made, uint32_t first, uint32_t end);
void core_declare_unclocked(struct core *made, uint32_t address, bool is_write, uint64_t until_ns);
void core_declare_duplicated(struct core *made, uint32_t address);
void core_on_known_block(void *interpreter, uint64_t at, uint32_t size, void *user);
void core_on_interrupt(void *unicorn, uint32_t number, void *user);
bool core_on_invalid(void *unicorn, void *user);
bool core_on_bad_access(void *unicorn, int kind, uint64_t address, int size, int64_t value, void *user);
struct tlb_entry;
bool core_on_tlb_fill(void *unicorn, uint64_t address, int access, struct tlb_entry *entry, void *user);
uint64_t core_read_io(void *unicorn, uint64_t at, unsigned size, void *user);
void core_write_io(void *unicorn, uint64_t at, unsigned size, uint64_t value, void *user);
void measure_block(const uint8_t *code, uint32_t bytes, uint32_t start, uint32_t waits, bool prefetches, struct measured *rows,
                   struct block_cost *cost);
struct fabric *fabric_new(const struct fabric_calls *calls, struct port *ports, struct wave *waves);
void fabric_set_time(struct fabric *made, uint64_t ns, uint64_t cycle, uint32_t hz);
void fabric_schedule(struct fabric *made, uint32_t slot, uint64_t ns);
bool fabric_take_stop(struct fabric *made);
void fabric_clocks_changed(struct fabric *made);
int interpreter_emu_start(void *user, uint64_t begin, uint64_t until, uint64_t timeout, size_t count);
int interpreter_emu_stop(void *user);
int interpreter_reg_read(void *user, int number, void *value);
int interpreter_reg_write(void *user, int number, const void *value);
int interpreter_reg_read_batch(void *user, const int *numbers, void **values, int count);
int interpreter_reg_write_batch(void *user, const int *numbers, void *const *values, int count);

/* What the page is notified of, with up to three numbers and the instruction. */
enum notice {
    NOTICE_READ,       /* of a register that only Python has: address */
    NOTICE_WRITE,      /* likewise: address, value */
    NOTICE_NO_CLOCK,   /* an access to a peripheral without its clock: address */
    NOTICE_DUPLICATED, /* a narrow write to a register of an APB: address */
    NOTICE_ASKED,      /* what a device would warn of, or have answered: slot, question, value */
    NOTICE_PIN,        /* a pin fights (0) or is shorted (1): pin, that */
    NOTICE_STORE,      /* a store that fails, or to flash: address, value */
    NOTICE_RESET,      /* a reset is asked for */
    NOTICE_SLEEP,      /* Stop or Standby would begin */
    NOTICE_TRAP,       /* CCR would have more trap than C looks for */
    NOTICE_FAULT,      /* the core has stopped: kind of halt, address */
};

/* The page's half, in JavaScript. */
__attribute__((import_module("page"), import_name("notice"))) void page_notice(uint32_t what, uint32_t one, uint32_t two, uint32_t three, uint32_t pc);
__attribute__((import_module("page"), import_name("deliver"))) void page_deliver(uint32_t slot);

/* Why a run has ended. */
enum { RUN_AT_TIME, RUN_WANTED, RUN_STOPPED };
enum { MOST_INSTRUCTIONS = 1024 / 2, SYSTICK = 15 };
#define SYSTEM_BASE 0xE0000000u
/* chosen, as `memory/bus.py` has it: reading a peripheral without its clock for so long is no de-initialization. */
enum { UNCLOCKED_NS = 1000000 };

static struct core *core;
static struct fabric *fabric;
/* The chip is being made: what is asked then is replayed too. */
static bool is_made, has_stopped;
static uint32_t wait_states, has_prefetch;
static uint64_t unclocked_since[PAGES];

static uint32_t here(void) { return core->shared.in_access ? core->shared.access_pc : core->shared.pc; }

static void notify(enum notice what, uint32_t one, uint32_t two, uint32_t three)
{
    if (is_made) {
        page_notice(what, one, two, three, here());
    }
}

static void stop(void)
{
    has_stopped = true;
    core->shared.stop_at = 0;
    core->shared.attention = 1;
}

/* Blocks. */

static void unknown_block(uint32_t address, uint32_t size)
{
    static struct measured rows[MOST_INSTRUCTIONS];
    static struct instruction instructions[MOST_INSTRUCTIONS];
    struct shared *s = &core->shared;
    struct block_cost cost;
    const bool is_sram = address - s->sram_base < s->sram_bytes;
    const uint8_t *flash = (const uint8_t *)(uintptr_t)s->flash, *sram = (const uint8_t *)(uintptr_t)s->sram;
    const uint8_t *code = is_sram ? sram + (address - s->sram_base)
                          : address - s->flash_base < s->flash_bytes ? flash + (address - s->flash_base)
                          : address < s->flash_bytes                ? flash + address : NULL;
    if (code == NULL) { /* system memory has no code in it */
        s->halt_kind = HALT_FAILED;
        return;
    }
    measure_block(code, size, address, is_sram ? 0 : wait_states, is_sram || has_prefetch, rows, &cost);
    for (uint32_t n = 0; n < cost.count; ++n) {
        instructions[n] = (struct instruction){.address = rows[n].address, .cycle = rows[n].cycle, .gives_up = rows[n].gives_up};
        s->uses_exclusive |= rows[n].kind == KIND_EXCLUSIVE;
    }
    const uint32_t flags = cost.flags | ROW_NOTED | (is_sram ? ROW_WRITABLE : 0);
    if (!core_add_row(core, address, address + size, cost.straight, cost.taken, flags, instructions, cost.count,
                      is_sram ? code : NULL, is_sram ? size : 0)) {
        s->halt_kind = HALT_FAILED;
    }
}

/* Registers that C knows, where the core itself leaves them to Python: the run is about to end, or somebody must be notified. */

static struct page *page_at(uint32_t offset)
{
    struct page *page = offset >> PAGE_SHIFT < PAGES ? &core->pages[offset >> PAGE_SHIFT] : NULL;
    return page == NULL || page->words == NULL ? NULL : page;
}

/* Whether the run ends before an access, as at a boundary, where an exception comes before it; as
 * `Engine._is_interrupted_here`. */
static bool is_denied(void)
{
    struct shared *s = &core->shared;
    if (has_stopped) {
        return true;
    }
    if (s->stop_at || core->block == &core->none || !is_interrupted(core) ||
        (s->cycle == s->raised_cycle && s->access_pc == s->raised_pc) || s->access_pc == core->block->start) {
        return false;
    }
    s->halt_kind = HALT_FROZEN;
    s->halt_pc = s->access_pc;
    core->api.stop(core->unicorn);
    return true;
}

/* Whether a page has its clock; names an access that finds none, a read only when it goes on for a while. */
static bool is_clocked(const struct page *page, uint32_t offset, bool is_write, uint32_t value)
{
    const uint32_t number = offset >> PAGE_SHIFT, index = (offset & ((1u << PAGE_SHIFT) - 1)) >> 2, address = PERIPHERALS + offset;
    if (has_clock(page)) {
        return true;
    }
    if (is_write) {
        if (index >= page->count || value << 8 * (offset & 3) & page->masks[index][SETS]) {
            notify(NOTICE_NO_CLOCK, address, is_write, value);
            core_declare_unclocked(core, address, true, 0);
        }
        return false;
    }
    unclocked_since[number] = unclocked_since[number] ? unclocked_since[number] : now_ns(fabric);
    const bool is_over = now_ns(fabric) >= unclocked_since[number] + UNCLOCKED_NS;
    if (is_over) {
        notify(NOTICE_NO_CLOCK, address, is_write, 0);
    }
    core_declare_unclocked(core, address, false, is_over ? NO_TIME : unclocked_since[number] + UNCLOCKED_NS);
    return false;
}

static uint32_t read_register_at(uint32_t offset, uint32_t size)
{
    struct page *page = page_at(offset);
    const uint32_t index = (offset & ((1u << PAGE_SHIFT) - 1)) >> 2;
    if (page != NULL && !is_clocked(page, offset, false, 0)) {
        return 0;
    }
    if (page == NULL || index >= page->count || !(page->behaviour[index] & (READS_PLAIN | READS_NATIVE)) ||
        !(page->behaviour[index] & IS_REGISTER)) {
        notify(NOTICE_READ, PERIPHERALS + offset, size, 0);
        return 0;
    }
    fabric_catch_up(fabric, page->device->slot, now_ns(fabric));
    const uint32_t word = page->behaviour[index] & READS_NATIVE ? page->device->kind->read(page->device, index) : page->words[index];
    if (page->behaviour[index] >> LATCH_SHIFT) {
        page->words[page->behaviour[index] >> LATCH_SHIFT] = word;
    }
    return size == 4 ? word : word >> (offset & 3) * 8 & ((1u << size * 8) - 1);
}

static void write_register_at(uint32_t offset, uint32_t size, uint32_t value)
{
    struct page *page = page_at(offset);
    const uint32_t index = (offset & ((1u << PAGE_SHIFT) - 1)) >> 2, address = PERIPHERALS + offset;
    if (page != NULL && !is_clocked(page, offset, true, value)) {
        return;
    }
    if (page == NULL || index >= page->count || !(page->behaviour[index] & (WRITES_PLAIN | WRITES_NATIVE)) ||
        !(page->behaviour[index] & IS_REGISTER)) {
        notify(NOTICE_WRITE, address, value, size);
        return;
    }
    fabric_catch_up(fabric, page->device->slot, now_ns(fabric));
    if (size != 4) {
        const uint32_t *mask = page->masks[index], shift = 8 * (offset & 3), ones = (1u << 8 * size) - 1;
        const uint32_t untouched = (page->words[index] & mask[1]) | mask[3];
        const uint32_t in_lanes = (value & ones) << shift | (untouched & ~(ones << shift));
        value = page->behaviour[index] & BYTE_LANES ? in_lanes : (value & ones) * (size == 1 ? 0x01010101u : 0x10001u);
        if (stored_after(page, index, value) != stored_after(page, index, in_lanes)) {
            notify(NOTICE_DUPLICATED, address, size, 0);
            core_declare_duplicated(core, address);
        }
    }
    leave_for_store(page->device, index);
    const uint32_t previous = store(page, index, value);
    if (page->behaviour[index] & WRITES_NATIVE) {
        page->device->kind->write(page->device, index, value, previous);
    }
}

static void act_on(uint32_t answer)
{
    if (answer & SYSTEM_TICKED) {
        pend(core, SYSTICK);
    }
    if (answer & SYSTEM_RESET) {
        notify(NOTICE_RESET, 0, 0, 0);
        stop();
    }
    if (answer & SYSTEM_TRAPS) {
        core->shared.traps_division = core->shared.ccr >> 4 & 1;
        if (core->shared.ccr >> 3 & 1) {
            notify(NOTICE_TRAP, core->shared.ccr, 0, 0);
        }
    }
    if (answer & SYSTEM_WRITTEN) {
        pending_changed(core, here());
        core->shared.stop_at = 0;
        core->shared.attention = 1;
    }
}

static uint32_t read_system_at(uint32_t address, uint32_t size)
{
    uint32_t word = 0;
    const uint32_t answer = system_read(&core->shared, address & ~3u, core->shared.access_cycle, &word);
    if (!answer || !is_privileged(core)) {
        notify(NOTICE_READ, address, size, 0);
    }
    act_on(answer & ~(uint32_t)SYSTEM_WRITTEN);
    return word >> 8 * (address & 3) & (size == 4 ? UINT32_MAX : (1u << 8 * size) - 1);
}

static void write_system_at(uint32_t address, uint32_t size, uint32_t value)
{
    const uint32_t shift = 8 * (address & 3), mask = (size == 4 ? UINT32_MAX : (1u << 8 * size) - 1) << shift;
    const uint32_t answer = system_write(&core->shared, address & ~3u, value << shift & mask, mask, core->shared.access_cycle);
    if (!answer || answer & (SYSTEM_STIMULUS | SYSTEM_LOOK_OUT) || !is_privileged(core)) {
        notify(NOTICE_WRITE, address, value, size);
    }
    act_on(answer);
}

static uint32_t read(uint32_t region, uint32_t offset, uint32_t size)
{
    if (is_denied()) {
        return 0;
    }
    if (region == core->bits_region) {
        return read_register_at(offset >> 5 & ~3u, 4) >> (offset >> 2 & 31) & 1;
    }
    if (region == core->sram_bits_region) {
        return ((uint8_t *)(uintptr_t)core->shared.sram)[offset >> 5] >> (offset >> 2 & 7) & 1;
    }
    return region == core->system_region ? read_system_at(SYSTEM_BASE + offset, size) : read_register_at(offset, size);
}

static void write(uint32_t region, uint32_t offset, uint32_t size, uint32_t value)
{
    if (is_denied()) {
        return;
    }
    if (region == core->bits_region) {
        const uint32_t word = read_register_at(offset >> 5 & ~3u, 4), bit = 1u << (offset >> 2 & 31);
        write_register_at(offset >> 5 & ~3u, 4, value & 1 ? word | bit : word & ~bit);
    } else if (region == core->sram_bits_region) {
        uint8_t *byte = (uint8_t *)(uintptr_t)core->shared.sram + (offset >> 5), bit = (uint8_t)(1 << (offset >> 2 & 7));
        *byte = value & 1 ? *byte | bit : *byte & (uint8_t)~bit;
    } else if (region == core->system_region) {
        write_system_at(SYSTEM_BASE + offset, size, value);
    } else {
        write_register_at(offset, size, value);
    }
}

/* A division by 0 or an unaligned transfer: the run ends before it. */
static void trapped(uint32_t kind, uint32_t pc, uint32_t address)
{
    struct shared *s = &core->shared;
    s->halt_kind = kind;
    s->halt_pc = pc;
    s->halt_address = address;
    s->halt_has_address = kind == HALT_UNALIGNED;
    core->api.stop(core->unicorn);
}

static bool bad_access(uint32_t kind, uint32_t address, uint32_t size, uint64_t value)
{
    (void)kind;
    (void)size;
    notify(NOTICE_STORE, address, (uint32_t)value, 0);
    stop();
    core->api.stop(core->unicorn);
    return false;
}

static bool write_at_once(uint32_t address, uint32_t size, uint64_t until)
{
    (void)address;
    (void)size;
    (void)until;
    return false;
}

static void recorded(const struct record *rows, uint32_t count)
{
    (void)rows;
    (void)count;
}

static uint64_t cycle_reached(void) { return core->shared.cycle; }
static uint32_t pc_reached(void) { return core->shared.pc; }

/* What the fabric asks. */

/* Goes on at the frequency and the wait states that the clocks say now; as `Chip.clock_changed`. */
static void clocks_changed(void)
{
    const struct clocks *clocks = fabric->clocks;
    const uint64_t cycle = fabric->host.cycle(fabric->host.user);
    fabric_set_time(fabric, ns_of(fabric, cycle), cycle, clocks->hclk_hz);
    if (clocks->flash_wait_states != wait_states || clocks->flash_prefetch != has_prefetch) {
        wait_states = clocks->flash_wait_states;
        has_prefetch = clocks->flash_prefetch;
        core_forget_rows(core);
    }
    fabric_clocks_changed(fabric);
    fabric->host.end_slice(fabric->host.user);
}

static void event(uint32_t slot, uint64_t ns)
{
    (void)ns; /* of a device in Python: it only warns */
    fabric_schedule(fabric, slot, NO_TIME);
}

static uint32_t asked(uint32_t slot, uint32_t what, uint32_t value)
{
    if (!is_made) {
        return 0;
    }
    page_notice(NOTICE_ASKED, slot, what, value, here());
    return 0;
}

static void electrical(uint32_t pin, uint32_t what) { notify(NOTICE_PIN, pin, what, 0); }

static uint64_t bus(uint32_t is_write, uint32_t address, uint32_t bytes, uint32_t word)
{
    (void)bytes;
    notify(is_write ? NOTICE_WRITE : NOTICE_READ, address, word, 0);
    return NO_TIME;
}

static void code_written(uint32_t address, uint32_t bytes)
{
    core_forget_range(core, address, address + bytes);
    interpreter_drop(core->interpreter, address, address + bytes);
}

static uint32_t forced(uint32_t address, uint32_t *seen)
{
    (void)address;
    *seen = 0;
    return 0;
}

static void no_memory(void) { stop(); }

/* What the page calls. */

#define EXPORTED __attribute__((visibility("default"), used))

EXPORTED struct core *page_core_new(struct interpreter *interpreter)
{
    const struct unicorn_api api = {interpreter_emu_start, interpreter_emu_stop, interpreter_reg_read,
                                    interpreter_reg_read_batch, interpreter_reg_write_batch, interpreter_reg_write};
    const struct callbacks calls = {unknown_block, read, write, trapped, recorded, cycle_reached, pc_reached, bad_access, write_at_once};
    return core = core_new(interpreter, &api, &calls);
}

EXPORTED struct fabric *page_fabric_new(struct port *ports, struct wave *waves)
{
    const struct fabric_calls calls = {event, asked, electrical, page_deliver, bus, code_written, forced, no_memory};
    return fabric = fabric_new(&calls, ports, waves);
}

/* Functions that Python hands to C by their addresses. */
EXPORTED void *page_function(const char *name)
{
    static const struct {
        const char *name;
        void (*function)(void);
    } functions[] = {
#define ROW(name) {#name, (void (*)(void))name}
        ROW(core_on_known_block), ROW(core_on_interrupt), ROW(core_on_invalid), ROW(core_on_bad_access),
        ROW(core_on_tlb_fill), ROW(core_read_io), ROW(core_write_io),
    };
    for (uint32_t n = 0; n < sizeof functions / sizeof *functions; ++n) {
        if (strcmp(functions[n].name, name) == 0) {
            return (void *)(uintptr_t)functions[n].function;
        }
    }
    return NULL;
}

/* The chip is made, and stands before its program's reset: what it does from here on is its own. */
EXPORTED void page_boot(uint32_t stack, uint32_t entry, uint32_t vector_table)
{
    struct shared *s = &core->shared;
    interpreter_put(core->interpreter, REG_SP, stack);
    s->vector_table = vector_table;
    s->pc = entry & ~1u;
    s->is_thumb = entry & 1;
    wait_states = fabric->clocks->flash_wait_states;
    has_prefetch = fabric->clocks->flash_prefetch;
    is_made = true;
}

EXPORTED void page_clocks_changed(void) { clocks_changed(); }
EXPORTED uint64_t page_cycle(void) { return core->shared.cycle; }
EXPORTED uint64_t page_now_ns(void) { return ns_of(fabric, core->shared.cycle); }
EXPORTED uint32_t page_hz(void) { return fabric->clocks->hclk_hz; }
EXPORTED uint32_t page_pc(void) { return core->shared.pc; }
EXPORTED const struct shared *page_shared(void) { return &core->shared; }

/* Puts the core before the access that was not made. */
static void thaw(void)
{
    struct shared *s = &core->shared;
    s->it_state = it_state_of(read_register(core, REG_CPSR));
    s->cycle += cycles_until(core->block, s->halt_pc);
    core->block = &core->none;
    s->pc = s->halt_pc;
    s->is_thumb = 1;
}

/* Runs to the first boundary at or after a time, or to what stops the chip before; returns why it has ended. */
EXPORTED uint32_t page_run(uint64_t limit_ns)
{
    struct shared *s = &core->shared;
    core_run(core, s->cycle); /* what is due at the time reached comes first */
    while (!has_stopped) {
        if (fabric_take_stop(fabric)) {
            return RUN_WANTED;
        }
        if (ns_of(fabric, s->cycle) >= limit_ns) {
            return RUN_AT_TIME;
        }
        const uint32_t kind = core_run(core, cycle_at(fabric, limit_ns));
        if (kind == HALT_FROZEN) {
            thaw();
        } else if (kind == HALT_WAIT_INTERRUPT || kind == HALT_WAIT_EVENT) {
            notify(NOTICE_SLEEP, 0, 0, 0);
            has_stopped = true;
        } else if (kind != HALT_BOUNDARY && !has_stopped) {
            notify(NOTICE_FAULT, kind, s->halt_pc, s->halt_has_address ? s->halt_address : 0);
            has_stopped = true;
        }
    }
    return RUN_STOPPED;
}
