/* Blocks that are kept: found by their address, forgotten when code changes, known to the owner.
 *
 * Blocks of flash stand in a table; those of other memory, and those that begin inside an IT block or not in Thumb state,
 * in a list; parts of blocks, which serve once or seldom, in a table
 * by their places, unless they are of writable memory. Code in writable memory is compared with what it was each time that its block is entered.
 * Invariant: a link leads to a block that the owner knows, and such a one is of flash, in Thumb state, outside IT.
 */
#include <stdlib.h>
#include <string.h>

#include "interpreter.h"

enum { ALONE_BYTES = 4 };
#define NEVER_PASSED (UINT64_C(1) << 62)

static bool is_other(const struct block *block)
{
    return block->is_writable || block->it || !block->is_thumb;
}

static struct block *odd_block(const struct interpreter *s, uint32_t address)
{
    for (struct block *block = s->odd; block != NULL; block = block->odd) {
        if (block->start == address && block->it == s->is.it_state && block->is_thumb == s->is.is_thumb) {
            return block;
        }
    }
    return NULL;
}

static void forget_links(struct interpreter *s)
{
    for (struct block *block = s->all; block != NULL; block = block->next) {
        block->links[0] = block->links[1] = NULL;
    }
}

/* What is not known costs more than any time, so that its end is the owner's. */
static void forget(struct block *block)
{
    block->row = NULL;
    block->costs[0] = block->costs[1] = NEVER_PASSED;
    block->links[0] = block->links[1] = NULL;
}

static struct block **part_slot(struct interpreter *s, uint32_t start, uint32_t end)
{
    return &s->parts[(start >> 1 ^ end << 3 ^ s->is.it_state) % PART_SLOTS];
}

static void drop_part(struct interpreter *s, struct block **at)
{
    (*at)->next = s->dropped;
    s->dropped = *at;
    *at = NULL;
}

/* Drops the blocks of which something stands from `first` up to before `end`: they live until no run is in them. */
void interpreter_drop(struct interpreter *s, uint64_t first, uint64_t end)
{
    for (struct block **at = &s->all; *at != NULL;) {
        struct block *block = *at;
        if (block->start >= end || block->end <= first) {
            at = &block->next;
            continue;
        }
        if (is_other(block)) {
            struct block **before = &s->odd;
            while (*before != block) {
                before = &(*before)->odd;
            }
            *before = block->odd;
        } else if (*interpreter_slot(s, block->start) == block) {
            *interpreter_slot(s, block->start) = NULL;
        }
        *at = block->next;
        block->next = s->dropped;
        forget(block);
        s->dropped = block;
    }
    forget_links(s);
    for (uint32_t n = 0; n < PART_SLOTS; ++n) {
        if (s->parts[n] != NULL && s->parts[n]->start < end && s->parts[n]->end > first) {
            drop_part(s, &s->parts[n]);
        }
    }
}

void interpreter_free_dropped(struct interpreter *s)
{
    while (s->dropped != NULL) {
        struct block *block = s->dropped;
        s->dropped = block->next;
        free(block->code);
        free(block);
    }
}

/* Ends the run at a fetch that fails: a hook gets what is not there. */
static void not_fetched(struct interpreter *s, uint32_t address)
{
    if (!interpreter_call_bad_access(s, BAD_FETCH, address, ALONE_BYTES, 0)) {
        s->error = NOT_FETCHABLE;
        s->stops = 1;
    }
}

static struct block *keep(struct interpreter *s, struct block *block, bool is_writable, const uint8_t *code)
{
    forget(block);
    block->is_writable = is_writable;
    if (is_writable && (block->code = malloc(block->end - block->start)) != NULL) {
        memcpy(block->code, code, block->end - block->start);
    }
    if (is_other(block)) {
        block->odd = s->odd;
        s->odd = block;
    } else {
        struct block **const at = interpreter_slot(s, block->start);
        if (*at != NULL) { /* the flash stands at two addresses: one place for both */
            interpreter_drop(s, (*at)->start, (*at)->start + 1);
        }
        *at = block;
    }
    block->next = s->all;
    s->all = block;
    return block;
}

/* Nothing executes there, whatever is mapped (ARM B3.1, table B3-1); an owner with a page hook says so itself. */
static bool never_executes(uint32_t address)
{
    return (address >= 0x40000000 && address < 0x60000000) || address >= 0xA0000000;
}

/* Where the code at an address stands, and in which memory; null: the run ends. */
static const uint8_t *code_at(struct interpreter *s, uint32_t address, const struct region **region, uint32_t *bytes)
{
    bool is_denied;
    const uint32_t place = interpreter_page(s, address, ON_FETCH, &is_denied);
    if (is_denied) {
        s->error = DENIED_FETCH;
        s->stops = 1;
        return NULL;
    }
    if (never_executes(place)) {
        interpreter_call_interrupt(s, BY_ABORT);
        return NULL;
    }
    *region = interpreter_region(s, place);
    if (*region == NULL || (*region)->host == NULL) {
        not_fetched(s, address);
        return NULL;
    }
    *bytes = (*region)->last - place + 1;
    return (*region)->host + (place - (*region)->first);
}

static struct block *decoded(struct interpreter *s, uint32_t address, const uint8_t *code, uint32_t bytes)
{
    struct block *block = interpreter_decode(s, address, code, bytes);
    if (block == NULL) { /* memory ends in the midst of its first instruction */
        not_fetched(s, address + bytes);
    }
    return block;
}

/* Tells whether other code stands there now; also where there was no memory for what stood there. */
static bool has_changed(const struct block *block, const uint8_t *code)
{
    return block->code == NULL || memcmp(block->code, code, block->end - block->start) != 0;
}

/* The block where the core stands, decoded if it is new or has changed; null: the run ends. */
struct block *interpreter_block(struct interpreter *s, uint32_t address)
{
    struct block *block = s->is.it_state || !s->is.is_thumb ? NULL : *interpreter_slot(s, address);
    if (block != NULL && block->start == address) {
        return block;
    }
    const struct region *region;
    uint32_t bytes;
    const uint8_t *code = code_at(s, address, &region, &bytes);
    if (code == NULL) {
        return NULL;
    }
    block = odd_block(s, address);
    if (block != NULL && block->is_writable && has_changed(block, code)) {
        interpreter_drop(s, block->start, block->end);
        block = NULL;
    }
    if (block == NULL && (block = decoded(s, address, code, bytes)) != NULL) {
        keep(s, block, region->is_writable, code);
    }
    return block;
}

/* What stands of a block up to before `end`, or all of it, to be run once: the owner does not know it. Null: the run ends. */
struct block *interpreter_part(struct interpreter *s, const struct block *whole, uint32_t end)
{
    struct block **const at = part_slot(s, whole->start, end), *part = *at;
    if (part != NULL && part->start == whole->start && part->end == end && part->it == whole->it && !part->is_writable) {
        return part;
    }
    const struct region *region;
    uint32_t bytes;
    const uint8_t *code = code_at(s, whole->start, &region, &bytes);
    part = code == NULL ? NULL : decoded(s, whole->start, code, end - whole->start);
    if (part != NULL) {
        forget(part);
        part->is_part = end != whole->end;
        part->is_writable = region->is_writable;
        if (*at != NULL) {
            drop_part(s, at);
        }
        *at = part;
    }
    return part;
}

/* The owner says of the block whose hook runs that it takes no attention, and what its ways out and its last instruction
 * cost (`span`: 0 where a block once begun is run to its end), and where ways that were gone are noted. */
void interpreter_know(struct interpreter *s, void *row, uint64_t straight, uint64_t taken, uint64_t span, uint8_t *ways)
{
    struct block *block = s->entering;
    if (block != NULL && !is_other(block)) {
        block->row = row;
        block->costs[0] = straight;
        block->costs[1] = taken;
        block->span = span;
        block->ways = ways;
    }
}

void interpreter_forget_rows(struct interpreter *s)
{
    for (struct block *block = s->all; block != NULL; block = block->next) {
        forget(block);
    }
    for (struct block *block = s->dropped; block != NULL; block = block->next) {
        forget(block);
    }
}
