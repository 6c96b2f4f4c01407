/* Hooks: whom the interpreter tells of blocks, instructions, accesses, and of what it cannot do; as Unicorn's. */
#include <string.h>

#include "interpreter.h"

static bool concerns(const struct hook *hook, uint32_t kind, uint32_t address)
{
    return hook->kind == kind && (hook->first > hook->last || (address >= hook->first && address <= hook->last));
}

void interpreter_call_block(struct interpreter *s, struct block *block)
{
    s->entering = block;
    for (uint32_t n = 0; n < s->hook_count && !s->stops; ++n) {
        const struct hook *hook = &s->hooks[n];
        if (hook->kind == HOOK_BLOCK) {
            void (*const call)(void *, uint64_t, uint32_t, void *) = hook->call;
            call(s, block->start, block->end - block->start, hook->user);
        }
    }
    s->entering = NULL;
}

/* Of these two a hook has to decide what becomes of the run: without one, or where none asks for its end and the PC stays,
 * it goes on where the PC is. */
void interpreter_call_interrupt(struct interpreter *s, uint32_t number)
{
    bool is_heard = false;
    for (uint32_t n = 0; n < s->hook_count && !s->stops; ++n) {
        const struct hook *hook = &s->hooks[n];
        if (hook->kind == HOOK_INTERRUPT) {
            void (*const call)(void *, uint32_t, void *) = hook->call;
            call(s, number, hook->user);
            is_heard = true;
        }
    }
    if (!is_heard) {
        s->error = DENIED_FETCH;
        s->stops = 1;
    }
}

void interpreter_call_invalid(struct interpreter *s)
{
    bool goes_on = false;
    for (uint32_t n = 0; n < s->hook_count && !goes_on; ++n) {
        const struct hook *hook = &s->hooks[n];
        if (hook->kind == HOOK_INVALID) {
            bool (*const call)(void *, void *) = hook->call;
            goes_on = call(s, hook->user);
        }
    }
    if (!goes_on) {
        s->error = DENIED_FETCH;
        s->stops = 1;
    }
}

bool interpreter_is_hooked(const struct interpreter *s, uint32_t pc)
{
    for (uint32_t n = 0; n < s->hook_count && s->instruction_hooks; ++n) {
        if (concerns(&s->hooks[n], HOOK_INSTRUCTION, pc)) {
            return true;
        }
    }
    return false;
}

/* False where the run ends before the instruction. */
bool interpreter_call_instruction(struct interpreter *s, const struct op *op)
{
    stand_at(s, op);
    for (uint32_t n = 0; n < s->hook_count && !s->stops; ++n) {
        const struct hook *hook = &s->hooks[n];
        if (concerns(hook, HOOK_INSTRUCTION, op->pc)) {
            void (*const call)(void *, uint64_t, uint32_t, void *) = hook->call;
            call(s, op->pc, op->imm, hook->user);
        }
    }
    return !s->stops;
}

void interpreter_call_access(struct interpreter *s, int kind, uint32_t address, uint32_t bytes, uint32_t value)
{
    for (uint32_t n = 0; n < s->hook_count && !s->stops; ++n) {
        const struct hook *hook = &s->hooks[n];
        if (concerns(hook, HOOK_ACCESS, address)) {
            bool (*const call)(void *, int, uint64_t, int, int64_t, void *) = hook->call;
            call(s, kind, address, (int)bytes, value, hook->user);
        }
    }
}

bool interpreter_call_bad_access(struct interpreter *s, int kind, uint32_t address, uint32_t bytes, uint32_t value)
{
    bool passes = false;
    for (uint32_t n = 0; n < s->hook_count && !passes; ++n) {
        const struct hook *hook = &s->hooks[n];
        if (concerns(hook, HOOK_BAD_ACCESS, address)) {
            bool (*const call)(void *, int, uint64_t, int, int64_t, void *) = hook->call;
            passes = call(s, kind, address, (int)bytes, value, hook->user);
        }
    }
    return passes;
}

static void count(struct interpreter *s)
{
    s->instruction_hooks = s->access_hooks = 0;
    for (uint32_t n = 0; n < s->hook_count; ++n) {
        s->instruction_hooks += s->hooks[n].kind == HOOK_INSTRUCTION;
        s->access_hooks += s->hooks[n].kind == HOOK_ACCESS;
    }
    interpreter_choose_ways(s);
}

/* As uc_hook_add and uc_hook_del; 0: there is no room for another. */
size_t interpreter_hook(struct interpreter *s, uint32_t kind, void *call, void *user, uint64_t first, uint64_t last)
{
    if (s->hook_count == HOOKS) {
        return 0;
    }
    s->hooks[s->hook_count++] = (struct hook){kind, (uint32_t)first, (uint32_t)last, ++s->hook_numbers, call, user};
    count(s);
    return s->hook_numbers;
}

void interpreter_unhook(struct interpreter *s, size_t number)
{
    for (uint32_t n = 0; n < s->hook_count; ++n) {
        if (s->hooks[n].number == number) {
            --s->hook_count;
            memmove(&s->hooks[n], &s->hooks[n + 1], (s->hook_count - n) * sizeof s->hooks[0]);
            break;
        }
    }
    count(s);
}
