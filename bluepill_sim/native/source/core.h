/* The state of one native core, shared with Python: the struct begins with what both sides see.
 *
 * Invariant: `Shared` has the layout of bluepill_sim/native/state.py, whose
 * size is checked against `core_shared_bytes` when the library is loaded.
 */
#ifndef BLUEPILL_CORE_H
#define BLUEPILL_CORE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define NEVER (UINT64_C(1) << 62)
#define NO_TIME UINT64_MAX
#define NS_PER_S UINT64_C(1000000000)
/* ITSTATE in the CPSR, and the exception number of interrupt line 0. */
#define IT_BITS 0x0600FC00u
#define FIRST_IRQ 16
#define UNLIKELY(x) __builtin_expect(!!(x), 0)
/* Kept out of its callers, which stay short enough to need no stack. */
#define RARELY __attribute__((noinline, cold))

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
    /* It stores nothing: the same registers before it twice running are the same for ever. */
    ROW_READS = 256,
    /* Two of its accesses may be mistaken for each other. */
    ROW_AMBIGUOUS = 512
};

/* An instruction of a block: where it starts in time, and which memory it reaches for. */
struct instruction {
    uint32_t address;
    uint32_t cycle;
    int32_t offset;
    uint8_t kind; /* 0: no access of interest, 1: load, 2: store */
    uint8_t bytes;
    uint8_t base;
    uint8_t index; /* 255: none */
    uint8_t shift;
    uint8_t count; /* words of a multiple transfer, else 1 */
    uint8_t padding[2];
};

struct row {
    uint32_t start, end, straight, taken, flags, count;
    const uint8_t *host; /* of code in writable memory: where it stands now */
    uint8_t *code;       /* and what it was when it was measured */
    struct row *next;    /* in the list of all rows, or of dropped ones */
    struct instruction instructions[];
};

/* A block that began, an exception that was entered (its number) or left (-1). */
struct record {
    uint64_t cycle;
    uint32_t address;
    int32_t kind;
};

/* How many of them are kept with or without a recorder; a power of 2. */
#define LAST_ROWS 32

struct shared {
    uint64_t cycle, stop_at, access_cycle, last_sleep_cycle;
    uint64_t tick_base, tick_next;
    uint64_t pending[2], active[2], enabled, levels;
    uint32_t access_pc, in_access;
    uint32_t pc, is_thumb;
    uint32_t mask_stop, attention;
    uint32_t halt_kind, halt_pc, halt_address, halt_has_address;
    uint32_t run_from, uses_exclusive;
    uint32_t exception_number, sleep, event_register, vector_table, scr, ccr;
    uint32_t tick_control, tick_reload, tick_value, tick_count_flag;
    uint32_t traps_division, grouping;
    uint32_t it_state, is_python;
    uint32_t dirty; /* what C has changed since Python looked: numbers of pins, or STREAMS_DIRTY */
    uint32_t is_first; /* the recorder has not had a row yet */
    uint64_t last_pin_cycle; /* the start of the block that last switched a pin silently */
    uint8_t priorities[80];
    /* Set by Python before the first run. */
    uint64_t sram, flash;
    uint32_t sram_base, sram_bytes, flash_base, flash_bytes;
    uint32_t scratch;
    uint32_t has_irq_listeners; /* the interrupt lines have listeners */
    uint64_t exact_stops; /* how often a run was stopped to learn which instruction makes an access */
    uint64_t logged; /* rows so far: the next one goes to `last` at this, modulo its size */
    struct record last[LAST_ROWS];
};

/* The functions of Unicorn that this core calls. */
struct unicorn_api {
    int (*start)(void *, uint64_t, uint64_t, uint64_t, size_t);
    int (*stop)(void *);
    int (*read_register)(void *, int, void *);
    int (*read_registers)(void *, const int *, void **, int);
    int (*write_registers)(void *, const int *, void *const *, int);
};

/* What Python is asked: each is void where Python keeps an exception for later. */
struct callbacks {
    void (*unknown_block)(uint32_t address, uint32_t size);
    uint32_t (*read)(uint32_t region, uint32_t offset, uint32_t size);
    void (*write)(uint32_t region, uint32_t offset, uint32_t size, uint32_t value);
    void (*trapped)(uint32_t kind, uint32_t pc, uint32_t address);
    void (*recorded)(const struct record *rows, uint32_t count);
};

#define FLASH_SLOTS 65536
#define SRAM_SLOTS 10240
#define PAGE_SHIFT 10
#define PAGES 144

/* A page of peripheral registers, as declared; `words` is null where Python decides everything. */
struct page {
    uint32_t *words;
    const uint32_t *gate;
    uint32_t gate_mask;
    uint32_t count;
    const uint8_t *behaviour; /* of each word: bits of enum behaviour */
    const uint32_t (*masks)[4];
    struct port *port;
    uint32_t irq;
};

/* The word that latches what is read stands above the bits; 0 for none. */
enum behaviour { READS_PLAIN = 1, WRITES_PLAIN = 2, USART_DATA = 4, LATCH_SHIFT = 4 };

/* Memory that is freed with the core. */
struct allocation {
    struct allocation *next;
    max_align_t data[];
};

/* An edge of outputs that this core has switched: pins of a port, and the levels of all of it after. */
struct pin_row {
    uint64_t cycle;
    uint16_t port, changed, levels, padding;
};

/* Room for what is recorded before Python takes it over; a block never adds more than the slack. */
#define PIN_ROWS 32768
#define PIN_SLACK 1024

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

/* A character that has gone out, at the end of its stop bit. */
struct sent {
    uint64_t ns;
    uint32_t word, padding;
};

#define STREAMS 3
#define SENT 1024
#define STREAMS_DIRTY (1u << 31)

/* A transmission of a USART while this core has it: `bluepill_sim/native/streams.py` knows the layout. */
struct stream {
    uint32_t *words;
    uint64_t base_ns, half_bits; /* of the end of the present character; no half-bits: Python has it */
    uint64_t due_ns, due_cycle;
    uint32_t irq, frame_half_bits, clock_hz, sent_count;
    struct sent sent[SENT];
};

/* Where cycles and nanoseconds are tied together. */
struct time_base {
    uint64_t base_ns, base_cycle;
    uint32_t frequency_hz;
};

/* A loop that waits for something: its state at its start, one round ago. */
struct polling {
    const struct row *row;
    uint64_t cycle;
    int32_t rounds;
    uint32_t asked; /* Python has answered since */
    uint32_t registers[16];
};

/* One GPIO port whose plain outputs are switched here. */
struct port {
    uint32_t simple;  /* pins whose output this core may switch alone */
    uint32_t changed; /* pins it has switched since Python looked */
};

struct core {
    struct shared shared;
    void *unicorn;
    struct unicorn_api api;
    struct callbacks calls;
    struct row *block;
    uint32_t io_next;       /* the first instruction of the block that may make the next access */
    uint32_t skipped_count; /* accesses since that are not yet counted in it */
    struct skipped skipped[SKIPPED];
    struct located located;
    uint32_t is_stopping; /* at an access that is not made: the run goes on from its instruction */
    struct row *resumed;  /* the block within which it goes on */
    uint64_t resumed_stop_at;
    struct row none;
    struct row *flash_rows[FLASH_SLOTS];
    struct row *sram_rows[SRAM_SLOTS];
    struct row *other_row; /* of code that is neither in flash nor in SRAM: the last one */
    struct row *all, *dropped;
    struct page pages[PAGES];
    struct port ports[8];
    uint32_t is_scratch;
    uint32_t noted;
    uint32_t paged_region;
    struct allocation *allocations;
    struct record *records;
    uint32_t record_count, record_room;
    struct pin_row *pin_rows; /* null: pins are not recorded */
    uint32_t pin_count;
    struct stream streams[STREAMS];
    uint64_t stream_next; /* the cycle at which the first of them ends a character */
    struct time_base time;
    struct polling polling;
};

static inline void begin_block(struct core *core, struct row *row)
{
    core->block = row;
    core->io_next = core->skipped_count = 0;
}

/* For this library alone: such calls need no table. */
#pragma GCC visibility push(hidden)
/* blocks.c */
void end_run(struct core *core, uint32_t kind, uint32_t pc);
void free_dropped(struct core *core);
const struct instruction *instruction_at(const struct row *row, uint32_t address);
void record(struct core *core, uint32_t address, int32_t kind);
void core_flush(struct core *core);
void record_at(struct core *core, uint64_t cycle, uint32_t address, int32_t kind);
/* polling.c */
bool polls_unchanged(struct core *core, const struct row *row);
void wait_on(struct core *core, const struct row *row);
/* gpio.c */
bool write_port(struct core *core, struct page *page, uint32_t index, uint32_t value, uint32_t address);
/* usart.c */
bool write_usart_data(struct core *core, const struct page *page, uint32_t value);
bool read_usart_data(struct core *core, const struct page *page, uint32_t *word);
/* streams.c */
void end_characters(struct core *core);
/* access.c */
void go_on_at_access(struct core *core, uint32_t pc);
bool resolve(struct core *core, uint32_t address, bool is_write, uint32_t bytes);
void skip(struct core *core, uint32_t address, bool is_write, uint32_t bytes);
/* run.c */
void *allocate(struct core *core, size_t bytes);
uint32_t read_register(struct core *core, int number);
/* exceptions.c */
uint64_t deliverable(const struct core *core, uint64_t *high);
bool wakes(struct core *core);
int deliver(struct core *core);
bool leave(struct core *core, uint32_t exc_return);
bool supervisor_call(struct core *core, uint32_t pc);
void pend(struct core *core, unsigned number);
void tick(struct core *core);
#pragma GCC visibility pop
/* run.c, for Python as well. */
void core_clear_exclusive(struct core *core);

/* Register numbers of Unicorn 2 (arm.h). */
enum {
    REG_CPSR = 3,
    REG_LR = 10,
    REG_PC = 11,
    REG_SP = 12,
    REG_R0 = 66,
    REG_R12 = 78,
    REG_IPSR = 114,
    REG_MSP = 115,
    REG_PSP = 116,
    REG_CONTROL = 117,
    REG_XPSR = 120,
    REG_PRIMASK = 123,
    REG_BASEPRI = 124,
    REG_FAULTMASK = 126
};

#endif
