/* Accesses to peripherals: which instruction makes them, and whether C or Python answers.
 *
 * Unicorn does not bring the PC up to date for an access to I/O, but all other
 * registers are. So the accessing instruction is found by working out which of
 * the block's loads or stores, from the last one found on, reaches the address
 * with the registers as they are. In some blocks that could be mistaken (one
 * base register, the same offset, and the base changed in between): where two of
 * their instructions reach the address, the access is not made, and the run is
 * stopped there. Unicorn then leaves the PC at the accessing instruction, with
 * nothing of it done, and the run goes on from it inside the block. Within an IT
 * block Unicorn does not stop: such blocks have hooks that note the PC instead,
 * see `native/engine.py`.
 */
#include <string.h>

#include "core.h"

struct region_user {
    struct core *core;
    uint32_t number;
    uint32_t base;
};

/* An unaligned access is made in at most so many. */
enum { PARTS = 16 };

enum { SCS = 0xE000E000, DEMCR = 0xE000EDFC, STK_CTRL = 0xE000E010, SCB_AIRCR = 0xE000ED0C, SCB_CCR = 0xE000ED14, STIR = 0xE000EF00 };
#define IN_PAGE ((1u << PAGE_SHIFT) - 1)

/* What Unicorn hands back at each access of a region; it is freed with the core. */
struct region_user *core_region(struct core *core, uint32_t number, uint32_t base)
{
    struct region_user *region = allocate(core, sizeof *region);
    if (region != NULL) {
        *region = (struct region_user){core, number, base};
    }
    return region;
}

/* Which regions are registers, their bits, those of SRAM, and the system control space. */
void core_set_regions(struct core *core, uint32_t paged, uint32_t bits, uint32_t sram_bits, uint32_t system)
{
    core->paged_region = paged;
    core->bits_region = bits;
    core->sram_bits_region = sram_bits;
    core->system_region = system;
}

/* A hook of each access in blocks where the instruction cannot be told from the registers. */
void core_on_note(void *unicorn, uint64_t address, uint32_t size, void *user)
{
    (void)unicorn;
    (void)size;
    ((struct core *)user)->noted = (uint32_t)address;
}

int general(uint8_t number)
{
    return number < 13 ? REG_R0 + number : number == 13 ? REG_SP : number == 14 ? REG_LR : REG_PC;
}

static bool reaches(struct core *core, const struct instruction *one, uint32_t address)
{
    uint32_t at = read_register(core, general(one->base)) + (uint32_t)one->offset;
    if (one->index != 255) {
        at += read_register(core, general(one->index)) << one->shift;
    }
    return address - at < (uint32_t)one->bytes * one->count;
}

/* The first instruction from `n` on that makes accesses of this kind and width; `count` of the row for none. */
static uint32_t fitting(const struct row *row, uint32_t n, bool is_write, uint32_t bytes)
{
    while (n < row->count && (row->instructions[n].kind != (is_write ? 2 : 1) || row->instructions[n].bytes != bytes)) {
        ++n;
    }
    return n;
}

/* The instruction that makes an access: the only one of its kind that is left, or the first that reaches there. */
static uint32_t find_access(struct core *core, uint32_t address, bool is_write, uint32_t bytes)
{
    const struct row *row = core->block;
    uint32_t n = fitting(row, core->io_next, is_write, bytes);
    if (n < row->count && fitting(row, n + 1, is_write, bytes) < row->count) {
        while (n < row->count && !reaches(core, &row->instructions[n], address)) {
            n = fitting(row, n + 1, is_write, bytes);
        }
    }
    return n;
}

static void pass(struct core *core, uint32_t n)
{
    core->io_next = core->block->instructions[n].count > 1 ? n : n + 1;
}

/* Notes an access whose instruction is not looked for now, so that the next one of the block is not taken for it. */
void skip(struct core *core, uint32_t address, bool is_write, uint32_t bytes)
{
    if (UNLIKELY(core->block->flags & ROW_AMBIGUOUS)) {
        return; /* later, with other registers, it could not be told: the next one has to be looked for from the start */
    }
    if (UNLIKELY(core->skipped_count == SKIPPED)) {
        resolve(core, address, is_write, bytes);
    } else {
        core->skipped[core->skipped_count++] = (struct skipped){address, (uint8_t)bytes, is_write};
    }
}

static void set_access(struct core *core, uint32_t n)
{
    const struct instruction *one = &core->block->instructions[n];
    core->shared.access_cycle = core->shared.cycle + one->cycle;
    core->shared.access_pc = one->address;
    pass(core, n);
}

/* The first instruction from `n` on that may make the access; `count` of the row for none. */
static uint32_t reaching(struct core *core, uint32_t n, uint32_t address, bool is_write, uint32_t bytes)
{
    const struct row *row = core->block;
    do {
        n = fitting(row, n, is_write, bytes);
    } while (n < row->count && !reaches(core, &row->instructions[n], address) && ++n);
    return n;
}

/* `resolve` where accesses may be mistaken: false where the run is to be stopped to learn it. */
static bool resolve_ambiguous(struct core *core, uint32_t address, bool is_write, uint32_t bytes)
{
    struct located *located = &core->located;
    const struct row *row = core->block;
    if (located->cycle != core->shared.cycle || !located->words ||
        (address != located->address && !located->is_anywhere)) {
        const uint32_t n = reaching(core, core->io_next, address, is_write, bytes);
        if (n == row->count) { /* half of an unaligned access */
            return true;
        }
        if (reaching(core, n + 1, address, is_write, bytes) < row->count) {
            core->is_stopping = 1;
            core->api.stop(core->unicorn);
            return false;
        }
        *located = (struct located){.cycle = core->shared.cycle, .n = n, .words = row->instructions[n].count};
    }
    --located->words;
    located->address = address + 4;
    located->is_anywhere &= located->words >= PARTS;
    set_access(core, located->n);
    return true;
}

/* Prepares the run that goes on at the access that it was stopped at. */
void go_on_at_access(struct core *core, uint32_t pc)
{
    struct shared *s = &core->shared;
    struct row *row = core->block;
    uint32_t n = 0;
    while (n + 1 < row->count && row->instructions[n].address != pc) {
        ++n;
    }
    /* A second time at one instruction: the parts of an unaligned access, the first of which were made already. */
    const bool is_again = core->located.cycle == s->cycle && core->located.n == n;
    core->is_stopping = 0;
    core->located = (struct located){
        .cycle = s->cycle, .n = n, .words = is_again ? 2 * PARTS : row->instructions[n].count, .is_anywhere = 1};
    core->resumed = row;
    core->resumed_stop_at = s->stop_at;
    core->block = &core->none;
    s->stop_at = 0; /* so that the start of this run, which is no boundary, is looked at */
    ++s->exact_stops;
}

/* Works out which instruction of the block makes an access, and with it when.
 * Returns false where the access is not to be made, because it comes again.
 */
bool resolve(struct core *core, uint32_t address, bool is_write, uint32_t bytes)
{
    struct shared *s = &core->shared;
    const struct row *row = core->block;
    s->access_cycle = s->cycle;
    s->access_pc = row->start;
    if (row == &core->none) {
        s->access_pc = s->pc;
        return true;
    }
    if (row->flags & ROW_AMBIGUOUS) {
        return resolve_ambiguous(core, address, is_write, bytes);
    }
    if (row->flags & ROW_NOTED) {
        const struct instruction *noted = instruction_at(row, core->noted);
        if (noted != NULL) {
            s->access_cycle = s->cycle + noted->cycle;
            s->access_pc = noted->address;
        }
        return true;
    }
    for (uint32_t k = 0; k < core->skipped_count; ++k) {
        const struct skipped *one = &core->skipped[k];
        const uint32_t n = find_access(core, one->address, one->is_write, one->bytes);
        if (n < row->count) {
            pass(core, n);
        }
    }
    core->skipped_count = 0;
    uint32_t found = find_access(core, address, is_write, bytes);
    if (found == row->count) {
        found = fitting(row, core->io_next, is_write, bytes);
    }
    if (found < row->count) {
        set_access(core, found);
    }
    return true;
}

static bool is_over(const struct core *core)
{
    return core->shared.cycle + core->block->costs[0] >= next_stop(core);
}

/* Finds the accessing instruction for Python, unless Python itself runs the blocks and knows it; false: not now. */
static bool begin_access(struct core *core, uint32_t address, bool is_write, uint32_t size)
{
    if (!core->shared.is_python) {
        if (!resolve(core, address, is_write, size)) {
            return false;
        }
        core->shared.in_access = 1;
    }
    return true;
}

static RARELY uint32_t ask_read(const struct region_user *region, uint32_t offset, uint32_t size)
{
    struct core *core = region->core;
    core->waiting.has_acted = 1;
    if (!begin_access(core, region->base + offset, false, size)) {
        return 0;
    }
    leave_ahead(core->fabric);
    const uint32_t word = core->calls.read(region->number, offset, size);
    core->shared.in_access = 0;
    return word;
}

static RARELY void ask_write(const struct region_user *region, uint32_t offset, uint32_t size, uint32_t value)
{
    struct core *core = region->core;
    if (!begin_access(core, region->base + offset, true, size)) {
        return;
    }
    leave_ahead(core->fabric);
    core->calls.write(region->number, offset, size, value);
    core->shared.in_access = 0;
}

/* Whether a device may have to act before the running block ends. */
static bool is_due(const struct core *core, const struct page *page)
{
    return core->fabric->slots[page->device->slot].cycle <= core->shared.cycle + core->block->costs[0];
}

/* Whether an access is made here: where a hook has ended the run it is not made, and where a request that may interrupt
 * came before, or the core has to wait, Python ends the block.
 */
static bool may_access(struct core *core)
{
    const struct shared *s = &core->shared;
    return !s->is_python && s->halt_kind == HALT_NONE && (s->stop_at || !(s->waits || is_interrupted(core)));
}

/* The page of a register that may be answered here: it has a clock, and Python need not act first. `is_late`: its
 * device has to be brought to the time of the access. */
static struct page *open_page(struct core *core, uint32_t offset, bool *is_late)
{
    *is_late = false;
    if (core->shared.is_python || offset >> PAGE_SHIFT >= PAGES) {
        return NULL;
    }
    struct page *page = &core->pages[offset >> PAGE_SHIFT];
    if ((offset & IN_PAGE) >> 2 >= page->count || !has_clock(page)) {
        return NULL;
    }
    if (UNLIKELY(is_over(core))) {
        core->waiting.has_acted = 1;
        *is_late = is_due(core, page);
        return may_access(core) && (!*is_late || page->device->kind != NULL) ? page : NULL;
    }
    return page;
}

/* Finds the accessing instruction, and brings the device to its time; false: not now, the access comes again. */
static bool catch_up(struct core *core, const struct page *page, uint32_t address, bool is_write, uint32_t size)
{
    if (!begin_access(core, address, is_write, size)) {
        return false;
    }
    fabric_catch_up(core->fabric, page->device->slot, now_ns(core->fabric));
    return true;
}

/* Has Python not notified again of accesses to a peripheral while it has no clock: of reads up to a time (NO_TIME: of
 * none), or of writes.
 */
void core_declare_unclocked(struct core *core, uint32_t address, bool is_write, uint64_t until_ns)
{
    struct page *page = &core->pages[(address - PERIPHERALS) >> PAGE_SHIFT];
    if (is_write) {
        page->ignores_writes = 1;
        return;
    }
    page->quiet_until = until_ns == NO_TIME ? NO_TIME : cycle_at(core->fabric, until_ns);
    page->quiet_cycle = core->fabric->time.cycle;
    page->quiet_hz = core->fabric->time.hz;
}

void core_forget_unclocked(struct core *core)
{
    for (uint32_t n = 0; n < PAGES; ++n) {
        core->pages[n].quiet_until = core->pages[n].ignores_writes = 0;
    }
}

/* Whether a read finds no clock, and Python need not be notified of it. Only once it has warned may the time of a loop that
 * reads there pass at once: that it waits for so long is what is warned of.
 */
static bool reads_nothing(struct core *core, uint32_t offset)
{
    if (offset >> PAGE_SHIFT >= PAGES) {
        return false;
    }
    const struct page *page = &core->pages[offset >> PAGE_SHIFT];
    if (has_clock(page) || core->shared.cycle + core->block->costs[0] >= page->quiet_until || !may_access(core)) {
        return false;
    }
    if (page->quiet_until == NO_TIME) {
        return true;
    }
    core->waiting.has_acted = 1;
    return page->quiet_cycle == core->fabric->time.cycle && page->quiet_hz == core->fabric->time.hz;
}

/* The same of a write. One that sets nothing that a reset would leave at 0 is never reported. */
static bool writes_nothing(struct core *core, uint32_t offset, uint32_t value)
{
    if (offset >> PAGE_SHIFT >= PAGES) {
        return false;
    }
    const struct page *page = &core->pages[offset >> PAGE_SHIFT];
    const uint32_t index = (offset & IN_PAGE) >> 2;
    if (has_clock(page) || !may_access(core)) {
        return false;
    }
    return page->ignores_writes || (index < page->count && page->behaviour[index] & IS_REGISTER &&
                                    !(value << 8 * (offset & 3) & page->masks[index][SETS]));
}

/* Whether an access has to know its time. */
static bool read_needs_time(const struct page *page, uint32_t index)
{
    const struct device *device = page->device;
    const struct device_kind *kind = device->kind;
    return page->behaviour[index] & READS_NATIVE &&
           (kind->needs_time == NULL || kind->needs_time(device, index, false) || device->fabric->watches_lines);
}

static bool write_needs_time(const struct page *page, uint32_t index, uint32_t written)
{
    const struct device *device = page->device;
    const struct device_kind *kind = device->kind;
    if (!(page->behaviour[index] & WRITES_NATIVE)) {
        return false;
    }
    return (kind->store_needs_time != NULL ? kind->store_needs_time(device, index, written)
                                           : kind->needs_time == NULL || kind->needs_time(device, index, true)) ||
           device->fabric->watches_lines;
}

static uint32_t read_now(struct page *page, uint32_t index)
{
    if (page->behaviour[index] & READS_NATIVE) {
        return page->device->kind->read(page->device, index);
    }
    const uint32_t latch = page->behaviour[index] >> LATCH_SHIFT, word = page->words[index];
    if (latch) {
        page->words[latch] = word;
    }
    return word;
}

/* Reads a register that only stores, or of a device in C; 0 where the access comes again. */
static uint32_t read_page(struct core *core, struct page *page, uint32_t index, uint32_t address, uint32_t size, bool is_late)
{
    if (!is_late && !read_needs_time(page, index)) {
        const uint32_t word = read_now(page, index);
        struct waiting *waiting = &core->waiting;
        waiting->polls = waiting->polled == address ? waiting->polls + 1 : 0;
        waiting->polled = address;
        if (UNLIKELY(waiting->polls == POLLS)) {
            look_now(core);
        }
        skip(core, address, false, size);
        return word;
    }
    core->waiting.has_acted = 1;
    if (is_late ? !catch_up(core, page, address, false, size) : !begin_access(core, address, false, size)) {
        return 0;
    }
    const uint32_t word = read_now(page, index);
    core->shared.in_access = 0;
    return word;
}

/* Reads a register that only events change, for a loop that has read it a round before; false: it is none. */
bool read_again(struct core *core, uint32_t address, uint32_t *word)
{
    const uint32_t offset = address - PERIPHERALS, index = (offset & IN_PAGE) >> 2;
    if (offset >> PAGE_SHIFT >= PAGES || !may_access(core)) {
        return false;
    }
    struct page *page = &core->pages[offset >> PAGE_SHIFT];
    if (index >= page->count || !has_clock(page) || !(page->behaviour[index] & (READS_PLAIN | READS_NATIVE)) ||
        read_needs_time(page, index)) {
        return false;
    }
    *word = read_now(page, index);
    return true;
}

static void write_page(struct core *core, struct page *page, uint32_t index, uint32_t address, uint32_t size,
                       uint32_t written, bool is_late)
{
    const bool needs_time = is_late || write_needs_time(page, index, written);
    if (needs_time &&
        (is_late ? !catch_up(core, page, address, true, size) : !begin_access(core, address, true, size))) {
        return;
    }
    leave_for_store(page->device, index);
    const uint32_t previous = store(page, index, written);
    if (page->behaviour[index] & WRITES_NATIVE) {
        page->device->kind->write(page->device, index, written, previous);
    }
    if (needs_time) {
        core->shared.in_access = 0;
    } else {
        skip(core, address, true, size);
    }
}

bool is_privileged(struct core *core)
{
    if (core->shared.exception_number) {
        return true;
    }
    if (core->privilege == PRIVILEGE_UNKNOWN) {
        core->privilege = read_register(core, REG_CONTROL) & 1 ? UNPRIVILEGED : PRIVILEGED;
    }
    return core->privilege == PRIVILEGED;
}

/* Acts on the wraps of SysTick up to an access. */
static void bring_systick(struct core *core, uint64_t now)
{
    struct shared *s = &core->shared;
    if (now >= s->tick_next && systick_advance(s, now)) {
        pend_tick(core);
        pending_changed(core, s->access_pc);
    }
}

/* Reads the system control space; false: that is Python's. `word` is all ones more to the left if it comes again. */
static bool read_system(struct core *core, uint32_t address, uint32_t size, uint32_t *word)
{
    struct shared *s = &core->shared;
    const uint32_t at = address & ~3u;
    if (!may_access(core) || !is_privileged(core) || !system_has(at)) {
        return false;
    }
    if (!system_needs_time(at)) {
        skip(core, address, false, size);
        system_read(s, at, 0, word);
        return true;
    }
    if (!begin_access(core, address, false, size)) {
        return true;
    }
    bring_systick(core, s->access_cycle);
    const uint32_t flag = s->tick_count_flag;
    system_read(s, at, s->access_cycle, word);
    core->shared.in_access = 0;
    /* What moves with the time, or was changed by the read, is another value at the next one. */
    core->waiting.has_acted |= at != STK_CTRL || flag;
    return true;
}

/* Stores to the system control space; false: that is Python's. */
static bool write_system(struct core *core, uint32_t address, uint32_t size, uint32_t value)
{
    struct shared *s = &core->shared;
    const uint32_t at = address & ~3u;
    const uint32_t mask = (size == 4 ? UINT32_MAX : (1u << 8 * size) - 1) << 8 * (address & 3);
    const bool is_systick = at - STK_CTRL <= 8;
    if (!may_access(core) || !is_privileged(core) || at == SCB_AIRCR || at == SCB_CCR ||
        at < SCS || at == DEMCR ||
        !(system_has(at) || at == STIR) ||
        (is_systick && s->hears_ticks)) {
        return false;
    }
    if (!begin_access(core, address, true, size)) {
        return true;
    }
    bring_systick(core, s->access_cycle);
    if (system_write(s, at, value << 8 * (address & 3), mask, s->access_cycle) & SYSTEM_WRITTEN) {
        pending_changed(core, s->access_pc);
    }
    core->shared.in_access = 0;
    if (s->tick_next < s->stop_at) {
        s->stop_at = s->tick_next;
    }
    return true;
}

static uint32_t *constant_slot(struct core *core, uint32_t address)
{
    uint32_t n = (address >> 2) * 2654435761u >> 22;
    while (core->constants.addresses[n] && core->constants.addresses[n] != address) {
        n = (n + 1) % CONSTANTS;
    }
    return &core->constants.addresses[n];
}

/* From now on a word of I/O reads 0, and ignores writes, without Python being asked. */
void core_declare_zero(struct core *core, uint32_t address)
{
    uint32_t *slot = constant_slot(core, address & ~3u);
    if (*slot == 0 && core->constants.count < CONSTANTS / 2) {
        *slot = address & ~3u;
        ++core->constants.count;
    }
}

void core_forget_zeros(struct core *core)
{
    core->constants = (struct constants){0};
    core_forget_unclocked(core);
    for (uint32_t n = 0; n < PAGES; ++n) {
        memset(core->pages[n].duplicated, 0, sizeof core->pages[n].duplicated);
    }
}

static bool is_zero(struct core *core, const struct region_user *region, uint32_t offset)
{
    if (!core->constants.count || !*constant_slot(core, (region->base + offset) & ~3u) || !may_access(core)) {
        return false;
    }
    if (region->number == core->paged_region) {
        return offset >> PAGE_SHIFT >= PAGES || has_clock(&core->pages[offset >> PAGE_SHIFT]);
    }
    return is_privileged(core);
}

/* From now on writes of a byte or halfword to a register are duplicated over its word without Python being asked. */
void core_declare_duplicated(struct core *core, uint32_t address)
{
    struct page *page = &core->pages[(address - PERIPHERALS) >> PAGE_SHIFT];
    const uint32_t index = (address & IN_PAGE) >> 2;
    page->duplicated[index / 32] |= 1u << index % 32;
}

/* Finds the word that a peripheral sees of a write of a byte or halfword; false: that is Python's, to warn of it. */
static bool widen(const struct page *page, uint32_t index, uint32_t offset, uint32_t size, uint32_t *written)
{
    const uint32_t *mask = page->masks[index], shift = 8 * (offset & 3), ones = (1u << 8 * size) - 1;
    const uint32_t value = *written & ones, untouched = (page->words[index] & mask[1]) | mask[3];
    const uint32_t in_lanes = value << shift | (untouched & ~(ones << shift));
    const uint32_t duplicated = value * (size == 1 ? 0x01010101u : 0x10001u);
    if (page->behaviour[index] & BYTE_LANES) {
        *written = in_lanes;
        return true;
    }
    *written = duplicated;
    return stored_after(page, index, duplicated) == stored_after(page, index, in_lanes) ||
           page->duplicated[index / 32] >> index % 32 & 1;
}

/* The word of the registers that an access to the bits' region reaches, and the bit in it. */
static uint32_t word_of(uint32_t offset) { return offset >> 5 & ~3u; }
static uint32_t bit_of(uint32_t offset) { return offset >> 2 & 31; }

/* Reads a register's word for an access at an address of one's choice; false: that is Python's. */
static bool read_register_word(struct core *core, uint32_t offset, uint32_t address, uint32_t size, uint32_t *word)
{
    const uint32_t index = (offset & IN_PAGE) >> 2;
    bool is_late;
    struct page *page = open_page(core, offset, &is_late);
    if (UNLIKELY(core->is_stopping)) { /* the other half of an unaligned access */
        return true;
    }
    if (page != NULL && page->behaviour[index] & (READS_PLAIN | READS_NATIVE)) {
        *word = read_page(core, page, index, address, size, is_late);
        return true;
    }
    if (reads_nothing(core, offset)) {
        skip(core, address, false, size);
        return true;
    }
    return false;
}

/* The bus matrix reads the word, changes the bit, writes the word; false: that is Python's. */
static bool write_register_bit(struct core *core, uint32_t offset, uint32_t bit, uint32_t address, uint32_t size, bool is_high)
{
    const uint32_t index = (offset & IN_PAGE) >> 2;
    bool is_late;
    struct page *page = open_page(core, offset, &is_late);
    if (page == NULL || !(page->behaviour[index] & (READS_PLAIN | READS_NATIVE)) ||
        !(page->behaviour[index] & (WRITES_PLAIN | WRITES_NATIVE))) {
        return false;
    }
    if (is_late ? !catch_up(core, page, address, true, size) : !begin_access(core, address, true, size)) {
        return true;
    }
    const uint32_t word = read_now(page, index), written = is_high ? word | 1u << bit : word & ~(1u << bit);
    leave_for_store(page->device, index);
    const uint32_t previous = store(page, index, written);
    if (page->behaviour[index] & WRITES_NATIVE) {
        page->device->kind->write(page->device, index, written, previous);
    }
    core->shared.in_access = 0;
    return true;
}

static uint8_t *sram_byte(struct core *core, uint32_t offset)
{
    return (uint8_t *)(uintptr_t)core->shared.sram + (offset >> 5);
}

/* The bits of SRAM and of registers by their aliases (RM0008 3.3.2). */
static uint64_t read_alias(const struct region_user *region, uint32_t offset, uint32_t size)
{
    struct core *core = region->core;
    uint32_t word = 0;
    if (region->number == core->sram_bits_region && may_access(core)) {
        skip(core, region->base + offset, false, size);
        return *sram_byte(core, offset) >> (offset >> 2 & 7) & 1;
    }
    if (region->number == core->bits_region &&
        read_register_word(core, word_of(offset), region->base + offset, size, &word)) {
        return word >> bit_of(offset) & 1;
    }
    return ask_read(region, offset, size);
}

static void write_alias(const struct region_user *region, uint32_t offset, uint32_t size, uint32_t value)
{
    struct core *core = region->core;
    const uint32_t address = region->base + offset, word = word_of(offset), bit = bit_of(offset);
    if (region->number == core->sram_bits_region && may_access(core)) {
        uint8_t *byte = sram_byte(core, offset);
        const uint32_t mask = 1u << (offset >> 2 & 7);
        skip(core, address, true, size);
        *byte = (uint8_t)(value & 1 ? *byte | mask : *byte & ~mask);
    } else if (region->number == core->bits_region &&
               write_register_bit(core, word, bit, address, size, value & 1)) {
    } else if (region->number == core->bits_region && reads_nothing(core, word) &&
               writes_nothing(core, word, (value & 1) << bit)) {
        skip(core, address, true, size);
    } else {
        ask_write(region, offset, size, value);
    }
}

static bool is_alias(const struct region_user *region)
{
    return region->number == region->core->bits_region || region->number == region->core->sram_bits_region;
}

static uint64_t read_io(const struct region_user *region, uint64_t at, unsigned size)
{
    struct core *core = region->core;
    const uint32_t offset = (uint32_t)at, address = region->base + offset;
    uint32_t word = 0;
    if (UNLIKELY(core->is_stopping)) {
        return 0;
    }
    if (region->number == core->paged_region) {
        if (!read_register_word(core, offset, address, size, &word)) {
            if (!is_zero(core, region, offset)) {
                return ask_read(region, offset, size);
            }
            skip(core, address, false, size);
        }
    } else if (is_alias(region)) {
        return read_alias(region, offset, size);
    } else if (region->number == core->system_region && read_system(core, address, size, &word)) {
    } else if (is_zero(core, region, offset)) {
        skip(core, address, false, size);
    } else {
        return ask_read(region, offset, size);
    }
    return word >> (offset & 3) * 8; /* the core takes as many bits as it has asked for */
}

uint64_t core_read_io(void *unicorn, uint64_t at, unsigned size, void *user)
{
    (void)unicorn;
    const struct region_user *region = user;
    const uint64_t word = read_io(region, at, size);
    leave_in_time(region->core);
    return word;
}

/* Stores to a register; false: that is Python's. */
static bool write_register_word(struct core *core, uint32_t offset, uint32_t address, uint32_t size, uint32_t written)
{
    const uint32_t index = (offset & IN_PAGE) >> 2;
    bool is_late;
    struct page *page = open_page(core, offset, &is_late);
    if (page == NULL) {
        if (!writes_nothing(core, offset, written)) {
            return false;
        }
        skip(core, address, true, size);
        return true;
    }
    if (!(page->behaviour[index] & (WRITES_PLAIN | WRITES_NATIVE)) ||
        (size != 4 && (is_late || !widen(page, index, offset, size, &written)))) {
        return false;
    }
    write_page(core, page, index, address, size, written, is_late);
    return true;
}

void core_write_io(void *unicorn, uint64_t at, unsigned size, uint64_t value, void *user)
{
    (void)unicorn;
    const struct region_user *region = user;
    struct core *core = region->core;
    const uint32_t offset = (uint32_t)at, address = region->base + offset, written = (uint32_t)value;
    if (UNLIKELY(core->is_stopping)) {
        return;
    }
    core->waiting.has_acted = 1;
    core->waiting.polled = 0;
    if (is_alias(region)) {
        write_alias(region, offset, size, written);
    } else if (region->number == core->paged_region && write_register_word(core, offset, address, size, written)) {
    } else if (region->number == core->system_region && write_system(core, address, size, written)) {
    } else if (is_zero(core, region, offset)) {
        skip(core, address, true, size);
    } else {
        ask_write(region, offset, size, written);
    }
    leave_in_time(core);
}
