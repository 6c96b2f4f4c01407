/* Pages as Unicorn's software TLB is to see them: every address stands for itself.
 *
 * Unicorn looks at each store to a page that may hold code, so SRAM is declared
 * as data until code is fetched from it: stores to data run in translated code.
 * Source: ARMv7-M ARM B3.1, table B3-1 (which regions never execute).
 */
#include "core.h"

enum { MAY_READ = 1, MAY_WRITE = 2, MAY_EXECUTE = 4, READ = 16, FETCH = 18 };

/* `uc_tlb_entry` of unicorn.h. */
struct tlb_entry {
    uint64_t address;
    int may;
};

static bool never_executes(uint32_t address)
{
    return (address >= 0x40000000 && address < 0x60000000) || address >= 0xA0000000;
}

/* Unicorn has brought the core up to date, and by that set ITSTATE, which translated code keeps clear. */
static void clear_it_state(struct core *core)
{
    const int number = REG_CPSR;
    uint32_t state = read_register(core, REG_CPSR);
    if (state & IT_BITS) {
        state &= ~IT_BITS;
        void *const value = &state;
        core->api.write_registers(core->unicorn, &number, &value, 1);
    }
}

/* Says which pages fetches and loads find elsewhere: page, and where each does. */
void core_set_views(struct core *core, const uint32_t (*rows)[3], uint32_t count)
{
    core->view_count = count;
    for (uint32_t n = 0; n < count; ++n) {
        core->views[n] = (struct view){rows[n][0], rows[n][1], rows[n][2]};
    }
}

static const struct view *view_of(const struct core *core, uint32_t page)
{
    for (uint32_t n = 0; n < core->view_count; ++n) {
        if (core->views[n].page == page) {
            return &core->views[n];
        }
    }
    return NULL;
}

/* False where nothing executes: the run ends with an exception of the library. */
bool core_on_tlb_fill(void *unicorn, uint64_t address, int access, struct tlb_entry *entry, void *user)
{
    (void)unicorn;
    struct core *core = user;
    const uint32_t page = (uint32_t)address;
    const struct view *view = view_of(core, page & ~(VIEW_BYTES - 1));
    entry->address = page - VIEWS_BASE < VIEWS_BYTES ? page - VIEWS_BYTES : page;
    if (view != NULL) {
        if (access != FETCH) {
            clear_it_state(core);
        }
        entry->address = access == FETCH ? view->code : access == READ ? view->data : page;
        entry->may = access == FETCH ? MAY_EXECUTE : access == READ ? MAY_READ : MAY_WRITE;
        return true;
    }
    entry->may = MAY_READ | MAY_WRITE;
    if (access != FETCH) {
        clear_it_state(core);
        if (page - core->shared.sram_base >= core->shared.sram_bytes && !never_executes(page)) {
            entry->may |= MAY_EXECUTE;
        }
        return true;
    }
    entry->may |= MAY_EXECUTE;
    return !never_executes(page);
}
