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
        pend(core, irq + FIRST_IRQ);
        pending_changed(core, pc(core));
    }
    return s->enabled >> irq & 1;
}

/* Puts the core under a fabric. */
void core_join(struct core *core, struct fabric *fabric)
{
    core->fabric = fabric;
    fabric->host = (struct host){.user = core, .cycle = cycle, .boundary = &core->shared.cycle, .set_irq = set_irq,
                                 .end_slice = end_slice, .due = due, .pc = pc, .signal = signal};
}
