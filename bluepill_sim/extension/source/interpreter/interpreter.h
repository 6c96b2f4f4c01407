/* A Cortex-M3's instructions, run without translating them to the host's: one idea in several files, which call each
 * other and share `struct interpreter`.
 *
 * Theory of operation. Code is decoded a basic block at a time (`decode.c`, by the one table of encodings) and lowered to
 * micro-operations (`lower.c`), which `execute.c` runs by threaded dispatch. A block ends at a branch, at what may change
 * masks or the pipeline (CPS, MSR, ISB), at what ends a run, and at the end of its kilobyte, as Unicorn's do; at each
 * block's start, and nowhere else, the owner's block hook is called. The owner may have a block end before any of its
 * instructions, or, by an access to I/O, behind the one that made it: what comes then is inside that block, and its hook is
 * called there as well. What the owner sees are functions with the
 * signatures of Unicorn's (`struct unicorn_api` of core.h and the hooks), so that either engine stands under the same core.
 *
 * Not here: time, exceptions, priorities, peripherals. Source: ARMv7-M Architecture Reference Manual.
 * Invariant: while no block runs, `pc`, `is_thumb` and `it_state` tell where the next one begins.
 */
#ifndef BLUEPILL_INTERPRETER_H
#define BLUEPILL_INTERPRETER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "../fabric/layout.h"

#ifndef LIKELY
#define LIKELY(x) __builtin_expect(!!(x), 1)
#define UNLIKELY(x) __builtin_expect(!!(x), 0)
#endif

enum { SP = 13, LR = 14, PC = 15 };
/* Behind the sixteen registers: what an instruction of several micro-operations keeps for itself. */
enum { SHIFTED = 16, ADDRESS, REGISTERS };

/* Unicorn's numbers: kinds of accesses, of hooks, of what an instruction ends a run with, and errors (unicorn.h). */
enum { ON_READ = 16, ON_WRITE = 17, ON_FETCH = 18 };
enum { BAD_READ = 19, BAD_WRITE, BAD_FETCH, PROTECTED_WRITE, PROTECTED_READ };
enum { HOOK_INTERRUPT = 1, HOOK_INSTRUCTION = 4, HOOK_BLOCK = 8, HOOK_BAD_ACCESS = 0x3F0, HOOK_ACCESS = 0xC00,
       HOOK_INVALID = 0x4000, HOOK_PAGE = 0x20000 };
enum { BY_SVC = 2, BY_ABORT = 3, BY_ALIGNMENT = 4, BY_BKPT = 7, BY_RETURN = 8, BY_COPROCESSOR = 17 };
enum { NO_ERROR = 0, NOT_READABLE = 6, NOT_WRITABLE = 7, NOT_FETCHABLE = 8, READ_ONLY = 12, EXECUTE_ONLY, DENIED_FETCH = 21 };

struct interpreter;

/* A micro-operation; which of its fields hold what, `operations.h` says of each. */
struct op {
    const void *handler;
    uint32_t imm;
    uint8_t d, n, m, a;
    uint32_t pc;     /* of its instruction */
    uint16_t number, code; /* of enum micro: its own, and that of what runs it, alone or with the next one */
    uint8_t it, after;     /* ITSTATE before its instruction, and after it */
};

/* A basic block: its ways out are 0, straight on, and 1, to the target of a branch that says where it goes. */
struct block {
    uint32_t start, end, target;
    uint8_t it, is_thumb, is_writable;
    uint8_t is_part;         /* behind its end the core is inside the block that it is a part of */
    uint8_t moved;           /* words that its first instruction has moved before an exception, and does not any more */
    struct block *links[2];
    /* What the owner knows it by where it takes no attention, and what its ways out cost. */
    void *row;
    uint64_t costs[2], span; /* and in more cycles than these a stop comes behind it */
    uint8_t *ways;           /* where it notes which of them were ever gone, a bit each */
    struct block *next;      /* of all, or of dropped ones */
    struct block *odd;       /* of those that no table has */
    uint8_t *code;           /* of writable memory: what it was decoded from */
    uint32_t count;
    struct op ops[];
};

/* Where the owner keeps time and the last rows, and the row of the block that runs: the interpreter charges the block
 * before, and keeps a row, at the start of one that takes no attention. Null pointers: it never does. */
struct clock {
    struct shared *shared;
    void **row;
};

struct region {
    uint32_t first, last;
    uint8_t *host; /* null of I/O */
    bool is_readable, is_writable;
    uint64_t (*read)(void *, uint64_t, unsigned, void *);
    void (*write)(void *, uint64_t, unsigned, uint64_t, void *);
    void *user;
};

struct hook {
    uint32_t kind, first, last;
    size_t number;
    void *call, *user;
};

/* `uc_tlb_entry` of unicorn.h. */
struct page_entry {
    uint64_t address;
    int may;
};

enum { REGIONS = 64, HOOKS = 512, CODE_SLOTS = 1 << 16, PAGE_BYTES = 1 << 10, PART_SLOTS = 1 << 10 };
/* Chosen: more micro-operations than an instruction and what is put around it ever need. */
enum { MOST_OPS_EACH = 16 };

/* What a snapshot holds. */
struct registers {
    uint32_t r[REGISTERS];
    int64_t nz;       /* N: it is negative; Z: its lower half is 0, so that both may be set */
    uint32_t c, v, q; /* C, Q: 0 or 1; V: bit 31 */
    uint32_t pc, is_thumb;
    uint32_t it_state; /* or ICI: the next register of an LDM or STM in bits 7:4, and bits 3:0 are 0 */
    uint32_t ipsr, control, primask, basepri, faultmask;
    uint32_t other_sp; /* MSP or PSP, whichever R13 is not */
    uint32_t has_exclusive, exclusive_address, exclusive_value;
    uint32_t block_start, block_end; /* of the block inside which the core stands; 0: it stands at the start of one */
};

struct interpreter {
    struct registers is;
    /* The memory that loads and stores find at once: so many bytes that may begin an access of a word, 0 for none. */
    uint8_t *sram;
    uint32_t sram_base, sram_words_end;
    uint8_t *flash;
    uint32_t flash_base, flash_words_end;
    /* Of the run: a hook has asked for its end, or written the PC; what the library's error is. */
    uint32_t stops, has_jumped;
    /* Where the owner has the block end that is entered, and where the core goes on behind the access that is made; 0: it
     * has no such wish. */
    uint32_t cut_at, leaves_to;
    int error;
    uint32_t depth;
    struct clock clock;
    struct block *entering; /* the one whose hook is called */
    uint32_t *noted;        /* where the owner wants the PC of each access to I/O */
    /* Called before a division by 0 and a transfer of several words that is not aligned; the owner may end the run. */
    void (*trapped)(void *user, bool is_alignment, uint32_t pc, uint32_t value);
    void *trap_user;
    struct region regions[REGIONS];
    uint32_t region_count;
    struct region *last_io;
    struct hook hooks[HOOKS];
    uint32_t hook_count;
    size_t hook_numbers;
    uint32_t instruction_hooks, access_hooks; /* how many there are */
    bool finds_pages;                         /* loads ask the page hook */
    struct block *blocks[CODE_SLOTS];         /* of the flash, by the place of their starts */
    struct block *odd, *all, *dropped;
    struct block *parts[PART_SLOTS]; /* by their places */
    struct op tail[MOST_OPS_EACH + 1]; /* the rest of an instruction, behind its access */
};

/* Calls of this library alone. */
#pragma GCC visibility push(hidden)
/* blocks.c */
struct block *interpreter_block(struct interpreter *s, uint32_t address);
struct block *interpreter_part(struct interpreter *s, const struct block *whole, uint32_t end);
void interpreter_free_dropped(struct interpreter *s);
/* decode.c */
struct block *interpreter_decode(struct interpreter *s, uint32_t address, const uint8_t *code, uint32_t bytes);
/* execute.c */
const void *const *interpreter_execute(struct interpreter *s, struct block *block);
/* memory.c */
struct region *interpreter_region(struct interpreter *s, uint32_t address);
bool interpreter_load(struct interpreter *s, const struct op *op, uint32_t address, uint32_t bytes, uint32_t *value);
bool interpreter_store(struct interpreter *s, const struct op *op, uint32_t address, uint32_t bytes, uint32_t value);
bool interpreter_is_trapped(struct interpreter *s, const struct op *op, bool is_alignment, uint32_t value);
uint32_t interpreter_page(struct interpreter *s, uint32_t address, int access, bool *is_denied);
void interpreter_move_some(struct interpreter *s, uint32_t most);
void interpreter_choose_ways(struct interpreter *s);
/* hooks.c */
void interpreter_call_block(struct interpreter *s, struct block *block);
void interpreter_call_interrupt(struct interpreter *s, uint32_t number);
void interpreter_call_invalid(struct interpreter *s);
bool interpreter_call_instruction(struct interpreter *s, const struct op *op);
bool interpreter_is_hooked(const struct interpreter *s, uint32_t pc);
void interpreter_call_access(struct interpreter *s, int kind, uint32_t address, uint32_t bytes, uint32_t value);
bool interpreter_call_bad_access(struct interpreter *s, int kind, uint32_t address, uint32_t bytes, uint32_t value);
/* special.c */
void interpreter_mrs(struct interpreter *s, const struct op *op);
void interpreter_msr(struct interpreter *s, const struct op *op);
void interpreter_cps(struct interpreter *s, const struct op *op);
/* For the owner in this library: blocks.c, run.c. */
void interpreter_know(struct interpreter *s, void *row, uint64_t straight, uint64_t taken, uint64_t span, uint8_t *ways);
void interpreter_forget_rows(struct interpreter *s);
void interpreter_set_clock(struct interpreter *s, const struct clock *clock);
void interpreter_set_noted(struct interpreter *s, uint32_t *noted);
/* The encoding of an instruction; null: it is undefined. */
const struct encoding *interpreter_row_of(uint32_t word, bool is_wide);
#pragma GCC visibility pop
/* run.c and blocks.c, for Python as well. */
void interpreter_set_trap(struct interpreter *s, void (*trapped)(void *, bool, uint32_t, uint32_t), void *user);
void interpreter_drop(struct interpreter *s, uint64_t first, uint64_t end);

/* Whether an address is inside the block of which the core has run a part. */
static inline bool stands_inside(const struct interpreter *s, uint32_t pc)
{
    return s->is.block_start && pc > s->is.block_start && pc < s->is.block_end;
}

/* Where a block of flash is found by its address. */
static inline struct block **interpreter_slot(struct interpreter *s, uint32_t address)
{
    return &s->blocks[address >> 1 & (CODE_SLOTS - 1)];
}

/* Whether an ITSTATE is none, but ICI (ARM B1.4.2). */
static inline bool is_continued(uint32_t it_state) { return it_state && !(it_state & 15); }

/* The core stands before an instruction: for a hook, a fault or the end of a run. */
static inline void stand_at(struct interpreter *s, const struct op *op)
{
    s->is.pc = op->pc;
    s->is.it_state = op->it;
}

#endif
