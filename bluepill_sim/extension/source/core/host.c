/* What the fabric needs of the core: `struct host`. */
#include "core.h"

static uint64_t cycle(void *user)
{
    struct core *core = user;
    const struct shared *s = &core->shared;
    return s->in_access ? s->access_cycle : s->is_python ? core->calls.access_cycle() : s->cycle;
}

static uint32_t pc(void *user)
{
    struct core *core = user;
    const struct shared *s = &core->shared;
    return s->in_access ? s->access_pc : s->is_python ? core->calls.access_pc() : s->pc;
}

static void end_slice(void *user)
{
    struct shared *s = &((struct core *)user)->shared;
    s->stop_at = 0;
    s->attention = 1;
}

static void due(void *user, uint64_t at)
{
    struct shared *s = &((struct core *)user)->shared;
    if (at < s->stop_at) {
        s->stop_at = at;
    }
}

static void signal(void *user) { ((struct core *)user)->shared.event_register = 1; }

static uint32_t set_irq(void *user, uint32_t irq, uint32_t level)
{
    struct core *core = user;
    struct shared *s = &core->shared;
    const uint64_t line = UINT64_C(1) << irq;
    if (!level) {
        s->levels &= ~line;
    } else if (!(s->levels & line)) {
        s->levels |= line;
        pend_late(core, irq + FIRST_IRQ, core->latency == NULL ? 0 : cycle_at(core->fabric, now_ns(core->fabric)));
        pending_changed(core, pc(core));
    }
    return s->enabled >> irq & 1;
}

static bool write_register_of(struct page *page, uint32_t index, struct bus_access *access)
{
    const uint32_t behaviour = page->behaviour[index];
    if (!(behaviour & (WRITES_PLAIN | WRITES_NATIVE))) {
        return false;
    }
    if (access->bytes != 4) { /* the APB bridge duplicates what is narrower: RM0008 13.3.4 */
        if (!(behaviour & DUPLICATES)) {
            return false;
        }
        access->word = (access->word & (access->bytes == 1 ? 0xFF : 0xFFFF)) * (access->bytes == 1 ? 0x01010101u : 0x10001u);
    }
    leave_for_store(page->device, index);
    const uint32_t previous = store(page, index, access->word);
    if (behaviour & WRITES_NATIVE) {
        page->device->kind->write(page->device, index, access->word, previous);
    }
    return true;
}

static bool read_register_of(struct page *page, uint32_t index, struct bus_access *access)
{
    const uint32_t behaviour = page->behaviour[index];
    if (!(behaviour & (READS_PLAIN | READS_NATIVE))) {
        return false;
    }
    const uint32_t word = behaviour & READS_NATIVE ? page->device->kind->read(page->device, index) : page->words[index];
    if (behaviour >> LATCH_SHIFT) {
        page->words[behaviour >> LATCH_SHIFT] = word;
    }
    access->word = access->bytes == 4 ? word : word >> (access->address & 3) * 8 & ((1u << access->bytes * 8) - 1);
    return true;
}

/* A register of a device in C, for a bus master; false where Python has to answer, as `open_page` of access.c. */
static bool registers(void *user, struct bus_access *access)
{
    struct core *core = user;
    const uint32_t offset = access->address - PERIPHERALS, index = (offset & ((1u << PAGE_SHIFT) - 1)) >> 2;
    struct page *page = &core->pages[offset >> PAGE_SHIFT];
    if (index >= page->count || page->device->kind == NULL) {
        return false;
    }
    if (!has_clock(page)) {
        access->is_error = true;
        return true;
    }
    const uint64_t now = now_ns(core->fabric);
    if (UNLIKELY(core->fabric->slots[page->device->slot].ns <= now)) {
        fabric_catch_up(core->fabric, page->device->slot, now);
    }
    return access->is_write ? write_register_of(page, index, access) : read_register_of(page, index, access);
}

static bool holds_code(void *user, uint32_t address, uint32_t bytes)
{
    const struct core *core = user;
    const uint32_t at = (address - core->shared.sram_base) / CODE_BYTES;
    (void)bytes; /* aligned: within one place */
    return core->code_places[at / 8] >> at % 8 & 1;
}

enum { DWT_CYCCNT = 0xE0001004, STK_VAL = 0xE000E018 };

static uint64_t asleep_until(void *user)
{
    struct core *core = user;
    const struct shared *s = &core->shared;
    if (s->is_python || !s->sleep || wakes(core)) {
        return 0;
    }
    return s->tick_next < core->limit ? s->tick_next : core->limit;
}

/* Puts the core under a fabric. */
void core_join(struct core *core, struct fabric *fabric)
{
    core->fabric = fabric;
    fabric->host = (struct host){.user = core, .cycle = cycle, .boundary = &core->shared.cycle, .set_irq = set_irq,
                                 .end_slice = end_slice, .due = due, .pc = pc, .signal = signal,
                                 .registers = registers, .holds_code = holds_code,
                                 .asleep_until = asleep_until, .forced = core_forced};
    add_counter(fabric, DWT_CYCCNT, &core->shared.cyccnt, NULL);
    add_counter(fabric, STK_VAL, &core->shared.tick, NULL);
}
