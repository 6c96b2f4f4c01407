/* Memory: where an address is, and the accesses that are not made at once: peripherals, flash, watched and failed ones.
 *
 * An access that is not aligned is made by the bus in parts: a load as two aligned ones, a store byte by byte. Source: ARMv7-M Architecture Reference Manual A3.2.1; unicorn.h and softmmu of Unicorn 2.1.
 */
#include <string.h>

#include "interpreter.h"
#include "micro.h"

enum { MAY_READ = 1, MAY_WRITE = 2, WORD_BYTES = 4, FLASH_BASE = 0x08000000 };

static bool contains(const struct region *region, uint32_t address)
{
    return address >= region->first && address <= region->last;
}

struct region *interpreter_region(struct interpreter *s, uint32_t address)
{
    for (uint32_t n = s->region_count; n-- > 0;) { /* what was mapped last hides what is below */
        if (contains(&s->regions[n], address)) {
            return &s->regions[n];
        }
    }
    return NULL;
}

/* Where an address is found by what the page hook says; `is_denied`: nothing may be done there. */
uint32_t interpreter_page(struct interpreter *s, uint32_t address, int access, bool *is_denied)
{
    *is_denied = false;
    for (uint32_t n = 0; n < s->hook_count; ++n) {
        const struct hook *hook = &s->hooks[n];
        if (hook->kind == HOOK_PAGE) {
            struct page_entry entry = {address, 0};
            bool (*const call)(void *, uint64_t, int, struct page_entry *, void *) = hook->call;
            const uint32_t in_page = address & (PAGE_BYTES - 1);
            *is_denied = !call(s, address - in_page, access, &entry, hook->user);
            return (uint32_t)entry.address + in_page;
        }
    }
    return address;
}

static uint32_t load_bytes(const uint8_t *from, uint32_t bytes)
{
    uint32_t value = 0;
    memcpy(&value, from, bytes); /* little-endian, as the host */
    return value;
}

/* Ends the run for an access that fails, or lets it pass where a hook says so: the region to make it in, or null. */
static struct region *fails(struct interpreter *s, const struct op *op, int kind, uint32_t address, uint32_t bytes,
                            uint32_t value, int error)
{
    stand_at(s, op);
    const bool passes = interpreter_call_bad_access(s, kind, address, bytes, value);
    struct region *region = passes ? interpreter_region(s, address) : NULL;
    if (region == NULL) {
        s->error = error;
        s->stops = 1;
    }
    return region;
}

static void tell(struct interpreter *s, const struct op *op)
{
    stand_at(s, op);
    if (s->noted != NULL) {
        *s->noted = op->pc;
    }
}

static struct region *io_region(struct interpreter *s, uint32_t address)
{
    if (s->last_io == NULL || !contains(s->last_io, address)) {
        struct region *region = interpreter_region(s, address);
        if (region == NULL || region->host != NULL) {
            return region;
        }
        s->last_io = region;
    }
    return s->last_io;
}

/* An aligned load. */
static bool load_part(struct interpreter *s, const struct op *op, uint32_t address, uint32_t bytes, uint32_t *value)
{
    uint32_t place = address;
    if (s->finds_pages) {
        bool is_denied;
        place = interpreter_page(s, address, ON_READ, &is_denied);
    }
    struct region *region = io_region(s, place);
    if (region == NULL) {
        region = fails(s, op, BAD_READ, address, bytes, 0, NOT_READABLE);
    } else if (!region->is_readable) {
        region = fails(s, op, PROTECTED_READ, address, bytes, 0, EXECUTE_ONLY);
    }
    if (region == NULL) {
        return false;
    }
    if (region->host != NULL) {
        *value = load_bytes(region->host + (place - region->first), bytes);
        return true;
    }
    tell(s, op);
    *value = (uint32_t)region->read(s, place - region->first, bytes, region->user);
    return !s->stops;
}

/* Whether the run ends before an instruction that the owner has trap. */
bool interpreter_is_trapped(struct interpreter *s, const struct op *op, bool is_alignment, uint32_t value)
{
    if (s->trapped != NULL) {
        stand_at(s, op);
        s->trapped(s->trap_user, is_alignment, op->pc, value);
    }
    return s->stops;
}

bool interpreter_load(struct interpreter *s, const struct op *op, uint32_t address, uint32_t bytes, uint32_t *value)
{
    const uint32_t low = address & (bytes - 1);
    const uint32_t in_flash = address - s->flash_base;
    if (in_flash < s->flash_words_end) {
        *value = load_bytes(s->flash + in_flash, bytes);
        return true;
    }
    if (s->access_hooks) {
        stand_at(s, op);
        interpreter_call_access(s, ON_READ, address, bytes, 0);
        if (s->stops) {
            return false;
        }
    }
    /* What is nowhere fails as a whole. */
    if (!low || interpreter_region(s, address) == NULL) {
        return load_part(s, op, address, bytes, value);
    }
    uint32_t first, second;
    if (!load_part(s, op, address - low, bytes, &first) || !load_part(s, op, address - low + bytes, bytes, &second)) {
        return false;
    }
    const uint64_t both = (uint64_t)second << 8 * bytes | first, mask = bytes == WORD_BYTES ? UINT32_MAX : 0xFFFF;
    *value = (uint32_t)(both >> 8 * low & mask);
    return true;
}

static bool store_part(struct interpreter *s, const struct op *op, uint32_t address, uint32_t bytes, uint32_t value)
{
    struct region *region = io_region(s, address);
    if (region == NULL) {
        region = fails(s, op, BAD_WRITE, address, bytes, value, NOT_WRITABLE);
    } else if (region->host != NULL && !region->is_writable) {
        region = fails(s, op, PROTECTED_WRITE, address, bytes, value, READ_ONLY);
    }
    if (region == NULL) {
        return false;
    }
    if (region->host != NULL) {
        memcpy(region->host + (address - region->first), &value, bytes);
        return true;
    }
    tell(s, op);
    region->write(s, address - region->first, bytes, value, region->user);
    return !s->stops;
}

bool interpreter_store(struct interpreter *s, const struct op *op, uint32_t address, uint32_t bytes, uint32_t value)
{
    value &= bytes == WORD_BYTES ? UINT32_MAX : (1u << 8 * bytes) - 1;
    if (s->access_hooks) {
        stand_at(s, op);
        interpreter_call_access(s, ON_WRITE, address, bytes, value);
        if (s->stops) {
            return false;
        }
    }
    const struct region *region = interpreter_region(s, address);
    const bool fails_whole = region == NULL || (region->host != NULL && !region->is_writable);
    if (!(address & (bytes - 1)) || fails_whole) {
        return store_part(s, op, address, bytes, value);
    }
    for (uint32_t n = 0; n < bytes; ++n) {
        if (!store_part(s, op, address + n, 1, value >> 8 * n & 0xFF)) {
            return false;
        }
    }
    return true;
}

/* So many bytes of a region may begin an access of a word. */
static uint32_t words_end(const struct region *region) { return region->last - region->first + 2 - WORD_BYTES; }

/* Finds out what loads and stores may do at once: nothing is to hear of them, and every page is where it is. */
void interpreter_choose_ways(struct interpreter *s)
{
    s->sram_words_end = s->flash_words_end = 0;
    s->sram = s->flash = NULL;
    for (uint32_t n = 0; n < s->region_count && !s->access_hooks && !s->finds_pages; ++n) {
        struct region *region = &s->regions[n];
        if (region->host != NULL && region->is_writable && s->sram == NULL) {
            s->sram = region->host;
            s->sram_base = region->first;
            s->sram_words_end = words_end(region);
        } else if (!region->is_writable && region->first == FLASH_BASE) {
            s->flash = region->host;
            s->flash_base = region->first;
            s->flash_words_end = words_end(region);
        }
    }
}

static int add_region(struct interpreter *s, struct region region)
{
    if (s->region_count == REGIONS) {
        return NOT_WRITABLE;
    }
    s->regions[s->region_count++] = region;
    s->last_io = NULL;
    interpreter_choose_ways(s);
    return NO_ERROR;
}

/* As uc_mem_map_ptr, uc_mmio_map and uc_mem_unmap. */
int interpreter_map(struct interpreter *s, uint64_t address, size_t bytes, uint32_t may, void *host)
{
    const uint32_t first = (uint32_t)address;
    return add_region(s, (struct region){.first = first, .last = first + (uint32_t)(bytes - 1), .host = host,
                                         .is_readable = may & MAY_READ, .is_writable = may & MAY_WRITE});
}

int interpreter_map_io(struct interpreter *s, uint64_t address, size_t bytes, void *read, void *read_user, void *write,
                       void *write_user)
{
    const uint32_t first = (uint32_t)address;
    (void)write_user; /* the same */
    return add_region(s, (struct region){.first = first, .last = first + (uint32_t)(bytes - 1), .read = read, .write = write,
                                         .is_readable = true, .user = read_user});
}

int interpreter_unmap(struct interpreter *s, uint64_t address, size_t bytes)
{
    (void)bytes;
    for (uint32_t n = s->region_count; n-- > 0;) {
        if (s->regions[n].first == (uint32_t)address) {
            --s->region_count;
            memmove(&s->regions[n], &s->regions[n + 1], (s->region_count - n) * sizeof s->regions[0]);
            break;
        }
    }
    s->last_io = NULL;
    interpreter_choose_ways(s);
    return NO_ERROR;
}

/* Has loads ask the page hook where their pages are, or not. */
void interpreter_find_pages(struct interpreter *s, bool is_wanted)
{
    s->finds_pages = is_wanted;
    interpreter_choose_ways(s);
}

/* The LDM or STM with which a block begins; null: it does with another instruction, or under IT. */
static const struct op *first_multiple(const struct block *block)
{
    const struct op *op = block->ops;
    op += block->moved && op->number == OP_ADD_I; /* puts the base back */
    return op->number == OP_LDM || op->number == OP_STM ? op : NULL;
}

/* A word of plain memory; null: it is none, or cannot be written. */
static uint8_t *word_at(const struct interpreter *s, uint32_t address, bool is_load)
{
    if (address - s->sram_base < s->sram_words_end) {
        return s->sram + (address - s->sram_base);
    }
    return is_load && address - s->flash_base < s->flash_words_end ? s->flash + (address - s->flash_base) : NULL;
}

/* An exception comes in the midst of the LDM or STM with which the block that is entered begins: moves the words up to then,
 * and leaves ICI and the base as the handler finds them. Where none is, the instruction begins anew.
 *
 * It does so under IT, and in front of a base that it would load (TRM r2p0 3.9.1). Chosen: a store whose base is in its
 * list does, and what moves no plain memory, or is watched. A store writes its base back before, so that the words pushed
 * are not below the stack; a load does behind its last word, so that neither are those to be popped. */
void interpreter_move_some(struct interpreter *s, uint32_t most)
{
    const struct op *op = first_multiple(s->entering);
    if (op == NULL || s->access_hooks || s->entering->it & 15) {
        return;
    }
    const bool is_load = op->number == OP_LDM, is_put_back = op != s->entering->ops;
    const uint32_t own = op->imm >> op->n & 1, base = s->is.r[op->n] + (is_put_back ? s->entering->ops[0].imm : 0);
    uint32_t address = base + 4 * (uint32_t)(int8_t)(op->imm >> 16), left = op->imm & 0xFFFF, count = 0;
    if (base & 3 || (own && !is_load && op->a)) {
        return;
    }
    for (; count < most && left & (left - 1); left &= left - 1, address += 4, ++count) {
        const uint32_t number = (uint32_t)__builtin_ctz(left);
        uint8_t *word = word_at(s, address, is_load);
        if (word == NULL || (is_load && number == op->n)) {
            break;
        }
        memcpy(is_load ? (uint8_t *)&s->is.r[number] : word, is_load ? word : (uint8_t *)&s->is.r[number], sizeof s->is.r[number]);
    }
    if (count) {
        s->is.r[op->n] = is_load ? s->is.r[op->n] : base + 4 * (uint32_t)(int8_t)op->a;
        s->is.it_state = (uint32_t)__builtin_ctz(left) << 4;
    }
}
