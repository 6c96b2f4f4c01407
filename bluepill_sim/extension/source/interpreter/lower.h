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

#pragma GCC visibility push(hidden)
/* Adds an instruction's micro-operations. */
enum outcome interpreter_lower(struct builder *to, const struct decoded *one);
/* Makes them fewer, and gives each its code. */
void interpreter_tidy(struct builder *to);
struct op *interpreter_emit(struct builder *to, enum micro number, uint32_t d, uint32_t n, uint32_t m, uint32_t imm);
#pragma GCC visibility pop

#endif
