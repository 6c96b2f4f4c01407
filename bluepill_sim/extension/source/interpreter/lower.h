/* What decoding and lowering share: an instruction by the table of encodings, and the micro-operations of a block. */
#ifndef BLUEPILL_LOWER_H
#define BLUEPILL_LOWER_H

#include "encodings.h"
#include "interpreter.h"
#include "micro.h"

/* An instruction, its fields by their letters in the table of encodings. */
struct decoded {
    enum operation operation;
    uint32_t d, n, m, t, a, i, j, h, b, s, p, u, w, c, r;
};

/* How a block goes on behind an instruction. */
enum outcome { GOES_ON, ENDS_BLOCK };

struct builder {
    struct op *ops;
    uint32_t count, target;
    uint32_t pc, end;   /* of the instruction, and the address after it */
    uint8_t it, after;  /* ITSTATE before and after it */
    uint8_t next;       /* the register with which an LDM or STM goes on; 0: it begins */
    uint8_t moved;      /* so many registers of its list come before that; 0 of all instructions behind the first */
    bool has_target;
};

/* A micro-operation, as `struct op` has it. */
struct emitted {
    enum micro number;
    uint32_t d, n, m, a, imm;
};

/* For who looks at the tables, in Python. */
void interpreter_take_apart(uint32_t word, bool is_wide, struct decoded *one);
size_t interpreter_look(struct interpreter *s, const uint8_t *code, uint32_t bytes, uint16_t (*seen)[2], size_t room);

#pragma GCC visibility push(hidden)
/* Adds an instruction's micro-operations. */
enum outcome interpreter_lower(struct builder *to, const struct decoded *one);
/* Makes them fewer, and gives each its code. */
void interpreter_tidy(struct builder *to);
void interpreter_emit(struct builder *to, const struct emitted *one);
#pragma GCC visibility pop

/* Adds one micro-operation: its number, and by their names the operands that it has. */
#define emit(to, ...) interpreter_emit((to), &(struct emitted){.number = __VA_ARGS__})

#endif
