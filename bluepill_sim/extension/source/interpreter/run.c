/* An interpreter as a whole: made, run, asked to stop. */
#include <stdlib.h>

#include "interpreter.h"

struct interpreter *interpreter_new(void)
{
    struct interpreter *s = calloc(1, sizeof *s);
    if (s != NULL) {
        s->is.nz = s->is.is_thumb = 1;
    }
    return s;
}

void interpreter_free(struct interpreter *s)
{
    interpreter_drop(s, 0, UINT64_MAX);
    interpreter_free_dropped(s);
    free(s);
}

/* As uc_emu_start: runs until something ends it; returns the error. */
int interpreter_emu_start(void *user, uint64_t begin, uint64_t until, uint64_t timeout, size_t count)
{
    struct interpreter *s = user;
    (void)until; /* Unicorn's: it is never reached, */
    (void)timeout;
    (void)count; /* and there is no limit */
    if (s->depth == 0) {
        interpreter_free_dropped(s);
    }
    ++s->depth;
    const uint32_t pc = (uint32_t)begin & ~1u;
    if (pc != s->is.pc || !stands_inside(s, pc)) {
        s->is.block_start = 0; /* it is elsewhere than where the core stood inside a block */
    }
    s->is.pc = pc;
    s->is.is_thumb = begin & 1;
    s->stops = s->leaves_to = 0;
    s->error = NO_ERROR;
    interpreter_execute(s, NULL);
    --s->depth;
    return s->error;
}

/* As uc_emu_stop. */
int interpreter_emu_stop(void *user)
{
    ((struct interpreter *)user)->stops = 1;
    return NO_ERROR;
}

/* Has the owner told where it keeps the time, the block that runs, and the rows of the last blocks. */
void interpreter_set_clock(struct interpreter *s, const struct clock *clock) { s->clock = *clock; }

void interpreter_set_trap(struct interpreter *s, void (*trapped)(void *, bool, uint32_t, uint32_t), void *user)
{
    s->trapped = trapped;
    s->trap_user = user;
}

void interpreter_set_noted(struct interpreter *s, uint32_t *noted) { s->noted = noted; }
