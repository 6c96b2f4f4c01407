/* The core: one idea in several files, which call each other and share `struct core`.
 *
 * A slice goes from block boundary to block boundary (`run.c`). Entering a block charges the one before it (`blocks.c`);
 * within it an access to I/O is told apart from all others (`access.c`), to a register of a device or of the core itself
 * (`scs.c`). At a boundary, or right before an access, an exception may be entered or left (`exceptions.c`), a fault be
 * taken (`faults.c`), or a loop that waits be worked out (`polling.c`); each of these leads to the next block. So none of
 * the seven works, or can be read, without the others. What needs no other stands beside them: `forced.c`, `host.c`,
 * `latency.c`, `systick.c`, `tlb.c`.
 *
 * `struct core` begins with what Python sees, `struct shared`.
 */
#ifndef BLUEPILL_CORE_H
#define BLUEPILL_CORE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "../fabric/fabric.h"
#include "../interpreter/registers.h"
#include "system.h"

#define NEVER (UINT64_C(1) << 62)
/* ITSTATE in the CPSR, and the exception number of interrupt line 0. */
#define IT_BITS 0x0600FC00u
enum { ENTRY_CYCLES = 12, EXIT_CYCLES = 12, TAIL_CHAIN_CYCLES = 6 };
#define FIRST_IRQ 16

/* Why a run ended; the order is that of bluepill_sim/native/state.py. */
enum halt {
    HALT_BOUNDARY,
    HALT_EXCEPTION_RETURN,
    HALT_SUPERVISOR_CALL,
    HALT_BKPT,
    HALT_WAIT_INTERRUPT,
    HALT_WAIT_EVENT,
    HALT_UNDEFINED,
    HALT_NO_COPROCESSOR,
    HALT_INVALID_STATE,
    HALT_READ_ERROR,
    HALT_WRITE_ERROR,
    HALT_FETCH_ERROR,
    HALT_EXECUTE_NEVER,
    HALT_DIVIDE_BY_ZERO,
    HALT_UNALIGNED,
    /* For Python alone: an exception is to be entered that this core leaves to it; a callback failed;
     * blocks have to be translated again; a hook froze the state; the library came back without a reason. */
    HALT_DELIVER,
    HALT_FAILED,
    HALT_STALE,
    HALT_FROZEN,
    HALT_UNEXPLAINED,
    HALT_NONE
};

/* What a block needs beyond adding up its cycles, and how it ends. */
enum row_flag {
    ROW_CHANGES_MASKS = 1,
    ROW_SENDS_EVENT = 2,
    ROW_SELF_LOOP = 4,
    ROW_WRITABLE = 8,
    ROW_ATTENTION = 15,
    ROW_ENDS_IN_WFI = 16,
    ROW_ENDS_IN_WFE = 32,
    ROW_ENDS_IN_YIELD = 64,
    /* Hooks note the PC of each access. */
    ROW_NOTED = 128,
    /* Two of its accesses may be mistaken for each other. */
    ROW_AMBIGUOUS = 256
};

struct row {
    uint32_t start, end;
    uint32_t costs[2]; /* in cycles, where it goes on at its end, and elsewhere */
    /* Where nothing but the time need be looked at when it is entered: its start; else an address where no block is. */
    uint32_t plain_start;
    uint32_t flags, count;
    uint8_t *ways;       /* which of its two ways were ever gone: bit 0 on at its end, bit 1 elsewhere */
    uint64_t passed[2]; /* its costs, or more than any time where what comes after it has to be looked at */
    const uint8_t *host; /* of code that may change: where it, or the FPB's table, stands now, */
    uint8_t *code;       /* what that was when it was measured, */
    uint32_t compared;   /* and how many bytes of it */
    struct row *next;    /* in the list of all rows, or of dropped ones */
    struct loop *loop;   /* where it is one that may poll a counter */
    uint64_t span;       /* what is due in more cycles than these comes behind it */
    struct row *whole, *rests; /* of the rest of a block: the row of all of it; and of that one its rests */
    uint32_t moved;      /* of a rest: words that its first instruction, LDM or STM, has moved already */
    struct instruction instructions[];
};

/* The functions of Unicorn that this core calls. */
struct unicorn_api {
    int (*start)(void *, uint64_t, uint64_t, uint64_t, size_t);
    int (*stop)(void *);
    int (*read_register)(void *, int, void *);
    int (*read_registers)(void *, const int *, void **, int);
    int (*write_registers)(void *, const int *, void *const *, int);
    int (*write_register)(void *, int, const void *);
};

/* What Python is asked: each is void where Python keeps an exception for later. */
struct callbacks {
    void (*unknown_block)(uint32_t address, uint32_t size);
    uint32_t (*read)(uint32_t region, uint32_t offset, uint32_t size);
    void (*write)(uint32_t region, uint32_t offset, uint32_t size, uint32_t value);
    void (*trapped)(uint32_t kind, uint32_t pc, uint32_t address);
    void (*recorded)(const struct record *rows, uint32_t count);
    /* Of the access that is made while Python enters the blocks. */
    uint64_t (*access_cycle)(void);
    uint32_t (*access_pc)(void);
    /* An access that the memory's protection forbids: whether it may pass. */
    bool (*bad_access)(uint32_t kind, uint32_t address, uint32_t size, uint64_t value);
    /* A store to read-only memory in a run that goes on to a cycle: whether it is made now, with all that follows from it
     * up to the next instruction. */
    bool (*write_at_once)(uint32_t address, uint32_t size, uint64_t stop);
};

#define FLASH_SLOTS 65536
#define SRAM_SLOTS 10240
#define PAGE_SHIFT 10
#define PAGES 144

/* Of each word: the bits that a write keeps, takes, clears by 1, clears by 0; and those that set what a reset leaves at 0. */
enum { SETS = 4, MASKS };
enum { PAGE_WORDS = 1 << (PAGE_SHIFT - 2) };

/* A page of peripheral registers, as declared; `words` is null where Python decides everything. */
struct page {
    uint32_t *words;
    const uint32_t *gate;
    uint32_t gate_mask;
    uint32_t count;
    const uint16_t *behaviour; /* of each word: bits of enum behaviour */
    const uint32_t (*masks)[MASKS]; /* of each word: see `store` and SETS */
    struct device *device;          /* without a kind it is Python's */
    /* Up to which cycle Python need not be notified of reads without a clock, 0 for none, while that tie of cycles and time
     * holds; NO_TIME: it has warned of one. And whether it has warned of a write. */
    uint64_t quiet_until, quiet_cycle;
    uint32_t quiet_hz, ignores_writes;
    uint32_t duplicated[PAGE_WORDS / 32]; /* the words of which Python has warned that narrow writes are duplicated */
};

/* Whether what is on a page has its clock, or needs none. */
static inline bool has_clock(const struct page *page) { return page->gate == NULL || *page->gate & page->gate_mask; }

/* The word that latches what is read stands above the bits; 0 for none. */
enum behaviour { READS_PLAIN = 1, WRITES_PLAIN = 2, READS_NATIVE = 4, WRITES_NATIVE = 8, BYTE_LANES = 16, DUPLICATES = 32, IS_REGISTER = 64, LATCH_SHIFT = 7 };

/* What a register holds after a write. */
static inline uint32_t stored_after(const struct page *page, uint32_t index, uint32_t written)
{
    const uint32_t *mask = page->masks[index];
    return (page->words[index] & mask[0] & ~(written & mask[2]) & (written | ~mask[3])) | (written & mask[1]);
}

/* Stores a word in a register as its masks say; returns what stood there. */
static inline uint32_t store(struct page *page, uint32_t index, uint32_t written)
{
    const uint32_t previous = page->words[index];
    page->words[index] = stored_after(page, index, written);
    return previous;
}

/* Memory that is freed with the core. */
struct allocation {
    struct allocation *next;
    max_align_t data[];
};

/* An access that was answered here without asking which instruction made it. */
struct skipped {
    uint32_t address;
    uint8_t bytes, is_write;
};
#define SKIPPED 8

/* What is known for sure of the block that began at `cycle`: its instruction `n` makes the next accesses, at most
 * `words` of them, from `address` on (or wherever the first one is).
 */
struct located {
    uint64_t cycle;
    uint32_t n, words, address;
    uint32_t is_anywhere;
};

/* Words that read a constant and ignore writes, as Python has said after its first warning; by a hash of the address. */
#define CONSTANTS 1024
struct constants {
    uint32_t count;
    uint32_t addresses[CONSTANTS]; /* 0: free */
};

/* Cycles between two looks for a loop that waits. Chosen: looking costs less than 1 % of the longest interval. */
enum { LEAST_INTERVAL = 64, MOST_INTERVAL = 1 << 16 };
/* Chosen: a register that is read so often in a row is polled. Comparing the SRAM takes as long as some more reads. */
enum { POLLS = 12 };

/* What is looked for: a round of blocks that leaves everything as it was (polling.c). */
struct waiting {
    enum { NOT_LOOKING, FIRST_ROUND, SECOND_ROUND } phase;
    uint32_t address, blocks; /* where the round began, and blocks since, that one among them */
    uint32_t has_acted;       /* an access since may have changed something, or depends on the time */
    uint64_t cycle;           /* at which the round began */
    uint32_t polled, polls;   /* the register that was read last, and how often in a row */
    uint64_t next, interval;  /* when to look next, and how long after that if it is in vain */
    uint32_t registers[16];
    uint8_t *memory; /* the SRAM as it was; null: it was not needed yet */
};

/* What a store forces in a register, as Python has found it: it holds while the words that it hangs on are the same. */
enum { FORCED_SETS = 16, FORCED_WAYS = 8 };
struct forced {
    uint32_t pc, start, address, bits, seen[SEEN_WORDS];
};

/* Where in SRAM code was translated from, in places of some bytes; never fewer than there are. */
enum { CODE_BYTES = 32, CODE_PLACES = 2 * SRAM_SLOTS / CODE_BYTES };

/* What ends a run for a fault raises, and which status bits it sets; 0: it is none. */
struct fault_row {
    uint32_t exception, cfsr, hfsr;
};

/* A page that fetches and loads find elsewhere: what the FPB remaps. */
struct view {
    uint32_t page, code, data;
};
enum { VIEWS = 8 };

struct core {
    struct shared shared;
    void *unicorn;
    struct interpreter *interpreter; /* what runs instructions in its place; null: nothing does */
    bool is_exact; /* what is due is acted on before the first instruction that begins then, not at the end of its block */
    struct unicorn_api api;
    struct callbacks calls;
    struct row *block;
    uint32_t io_next;       /* the first instruction of the block that may make the next access */
    uint32_t skipped_count; /* accesses since that are not yet counted in it */
    struct skipped skipped[SKIPPED];
    struct located located;
    uint64_t within;        /* an exception that comes now does so this many cycles behind the beginning of an instruction */
    uint32_t is_elsewhere; /* the run ended with an exception that was entered or left: `pc` and all that is known is right */
    uint32_t is_stopping; /* at an access that is not made: the run goes on from its instruction */
    struct row *resumed;  /* the block within which it goes on */
    uint64_t resumed_stop_at;
    struct row none;
    struct row *flash_rows[FLASH_SLOTS];
    struct row *sram_rows[SRAM_SLOTS];
    /* Of each place in flash where a block ends, as of `row.ways`; never taken back. The last: of all other places. */
    uint8_t ways[FLASH_SLOTS + 1];
    struct row *other_row; /* of code that is neither in flash nor in SRAM: the last one */
    struct row *all, *dropped;
    struct page pages[PAGES];
    struct fabric *fabric;
    uint32_t is_scratch;
    uint32_t noted;
    /* The regions of I/O by their numbers: registers, the bits of these, the bits of SRAM, the system control space. */
    uint32_t paged_region, bits_region, sram_bits_region, system_region;
    struct constants constants;
    enum { PRIVILEGE_UNKNOWN, PRIVILEGED, UNPRIVILEGED } privilege; /* of a thread, since the last MSR */
    struct allocation *allocations;
    struct record *records;
    uint32_t record_count, record_room;
    struct waiting waiting;
    uint64_t limit; /* of the run */
    uint8_t code_places[CODE_PLACES / 8];
    struct forced forced[FORCED_SETS][FORCED_WAYS]; /* by the place of the store; `pc` is 0 of one that is free */
    uint8_t forced_next[FORCED_SETS];
    struct fault_row faults[HALT_NONE]; /* by kind of halt */
    struct view views[VIEWS];
    uint32_t view_count;
    struct latency *latency; /* null: no interrupt is put off */
    uint32_t latency_slot;
};

/* ITSTATE in a CPSR or xPSR: its bits 1:0 at 25, 7:2 at 10. */
static inline uint32_t it_state_of(uint32_t bits) { return (bits >> 25 & 3) | (bits >> 10 & 0x3F) << 2; }

static inline void begin_block(struct core *core, struct row *row)
{
    core->block = row;
    core->io_next = core->skipped_count = 0;
}

/* Registers by Unicorn's numbers. */
enum { MOST_REGISTERS = 16 };
static inline __attribute__((always_inline)) void read_registers(struct core *core, const int *numbers, uint32_t *values, int count)
{
    if (core->interpreter != NULL) {
#pragma GCC unroll 16
        for (int n = 0; n < count; ++n) {
            values[n] = interpreter_get(core->interpreter, numbers[n]);
        }
        return;
    }
    void *at[MOST_REGISTERS];
    for (int n = 0; n < count; ++n) {
        at[n] = &values[n];
    }
    core->api.read_registers(core->unicorn, numbers, at, count);
}

static inline __attribute__((always_inline)) void write_registers(struct core *core, const int *numbers, uint32_t *values, int count)
{
    if (core->interpreter != NULL) {
#pragma GCC unroll 16
        for (int n = 0; n < count; ++n) {
            interpreter_put(core->interpreter, numbers[n], values[n]);
        }
        return;
    }
    void *at[MOST_REGISTERS];
    for (int n = 0; n < count; ++n) {
        at[n] = &values[n];
    }
    core->api.write_registers(core->unicorn, numbers, at, count);
}

static inline uint32_t read_register(struct core *core, int number)
{
    uint32_t value;
    if (core->interpreter != NULL) {
        return interpreter_get(core->interpreter, number);
    }
    core->api.read_register(core->unicorn, number, &value);
    return value;
}

/* For this library alone: such calls need no table. */
#pragma GCC visibility push(hidden)
/* blocks.c */
void end_run(struct core *core, uint32_t kind, uint32_t pc);
void free_dropped(struct core *core);
uint32_t cycles_until(const struct row *row, uint32_t address);
void leave_in_time(struct core *core);
const struct instruction *instruction_at(const struct row *row, uint32_t address);
void record(struct core *core, uint32_t address, int32_t kind);
void core_flush(struct core *core);
void record_at(struct core *core, uint64_t cycle, uint32_t address, int32_t kind);
/* polling.c */
void look_later(struct core *core);
void look_now(struct core *core);
bool read_again(struct core *core, uint32_t address, uint32_t *word);
bool looks_for_waiting(struct core *core, uint32_t address);
void wait_on(struct core *core, const struct row *row, uint64_t rounds);
uint64_t rounds_of_loop(struct core *core, const struct row *row, bool is_first);
/* forced.c */
uint32_t core_forced(void *user, uint32_t address);
/* access.c */
int general(uint8_t number);
void go_on_at_access(struct core *core, uint32_t pc);
bool is_privileged(struct core *core);
bool resolve(struct core *core, uint32_t address, bool is_write, uint32_t bytes);
void skip(struct core *core, uint32_t address, bool is_write, uint32_t bytes);
/* run.c */
/* What becomes of the run at a boundary: it ends, goes on, or goes on elsewhere, or has ended there. */
enum way { ENDS, GOES_ON, ELSEWHERE };
enum way goes_on(struct core *core, uint32_t address);
void *allocate(struct core *core, size_t bytes);
uint64_t stop_of(const struct core *core);
/* exceptions.c */
uint64_t deliverable(const struct shared *s, uint64_t *high);
bool wakes(struct core *core);
int deliver(struct core *core);
bool leave(struct core *core, uint32_t exc_return);
bool supervisor_call(struct core *core, uint32_t pc);
void pend(struct core *core, unsigned number);
void pend_late(struct core *core, unsigned number, uint64_t cycle);
void pend_tick(struct core *core);
void pending_changed(struct core *core, uint32_t pc);
bool is_interrupted(struct core *core);
bool can_preempt(struct core *core, unsigned number, bool ignores_primask);
bool enter(struct core *core, unsigned number, uint32_t return_address);
uint32_t vector(const struct core *core, unsigned number);
/* latency.c */
void put_off(struct core *core, unsigned number, uint64_t cycle);
/* faults.c */
bool take_fault(struct core *core, uint32_t kind);
#pragma GCC visibility pop
/* run.c, for Python as well. */
uint64_t core_next_event(const struct core *core);
/* When the run has to end or an event is due: `stop_at` may be earlier, to look for a loop that waits. */
static inline uint64_t next_stop(const struct core *core)
{
    const uint64_t event = core_next_event(core);
    return !core->shared.stop_at ? 0 : event < core->limit ? event : core->limit;
}
void core_clear_exclusive(struct core *core);

#endif
