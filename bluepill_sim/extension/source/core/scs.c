/* The private peripheral bus: SCB, NVIC, SysTick, DWT, FPB, ITM, TPIU, DEMCR, DBGMCU: what is read there, what a store does.
 *
 * Registers that store stand in one table; the others are below it. Whoever makes an access has brought SysTick to its
 * time and acts on the answer: bluepill_sim/core/system_control.py, and access.c where the native core runs.
 * Source: ARMv7-M Architecture Reference Manual B3.2 to B3.4 and C1; PM0056 chapter 4; RM0008 31.6 for DBGMCU, 31.17 for
 * TPIU.
 */
#include <stddef.h>
#include <string.h>

#include "../fabric/fabric.h"
#include "system.h"

enum { NMI = 2, MEM_MANAGE = 4, PENDSV = 14, SYSTICK = 15, FIRST_IRQ = 16, IRQ_COUNT = 43 };
/* The upper four bits of a priority exist (PM0056 2.3.5). */
enum { PRIORITY_BITS = 0xF0 };
#define IRQS ((UINT64_C(1) << IRQ_COUNT) - 1)

enum {
    DWT_CTRL = 0xE0001000, DWT_CYCCNT = 0xE0001004,
    STK_CTRL = 0xE000E010, STK_CALIB = 0xE000E01C,
    NVIC_ISER = 0xE000E100, NVIC_IPR = 0xE000E400, NVIC_IPR_END = 0xE000E4F0,
    SCB_ICSR = 0xE000ED04, SCB_AIRCR = 0xE000ED0C, SCB_CCR = 0xE000ED14, SCB_SHPR1 = 0xE000ED18, SCB_SHPR3 = 0xE000ED20,
    SCB_SHCSR = 0xE000ED24, SCB_CFSR = 0xE000ED28, SCB_HFSR = 0xE000ED2C, DEMCR = 0xE000EDFC, STIR = 0xE000EF00
};
/* What a debugger has on the chip, and firmware as well. */
enum { ITM_LAR = 0xE0000FB0, ITM_LSR = 0xE0000FB4, FP_CTRL = 0xE0002000, FP_REMAP = 0xE0002004 };
/* Each on a page of its own. */
enum { ITM = 0xE0000, DWT = 0xE0001, FPB = 0xE0002, TPIU = 0xE0040 };
#define ITM_KEY 0xC5ACCE55u
enum { ITMENA = 1, FP_KEY = 2, FP_ENABLE = 1, FP_NUMBERS = 2 << 8 | 6 << 4, FP_IN_SRAM = 1 << 29 };
#define MATCHED (1u << 24)
#define MON_PEND (1u << 17)
enum { DEBUG_MONITOR = 12 };
/* The arrays of the NVIC's words of lines, 128 bytes each; each has 8 words, of which the chip has 2. */
enum { ENABLE, DISABLE, PEND, UNPEND, ACTIVE, LINE_ARRAYS };

#define VECTKEY 0x05FAu
#define VECTKEY_READ (0xFA05u << 16)
enum { SYSRESETREQ = 1 << 2, DEBUGGERS = 1 << 1 | 1 << 0 };
#define NMIPENDSET (1u << 31)
#define PENDSVSET (1u << 28)
#define PENDSVCLR (1u << 27)
#define PENDSTSET (1u << 26)
#define PENDSTCLR (1u << 25)
#define RETTOBASE (1u << 11)
#define ISRPENDING (1u << 22)
#define TRCENA (1u << 24)
#define CYCCNTENA 1u
/* Four comparators, cycle counter present. */
#define DWT_CTRL_FIXED 0x40000000u

/* A register that stores: what of a word written it takes, and what a 1 clears; without a field it reads `fixed`. */
struct storing {
    uint32_t address, fixed, takes, clears;
    uint16_t field;
    uint8_t is_read_only;
};
#define AT(name) offsetof(struct shared, name)
#define WORD 0xFFFFFFFFu

#define FIXED(at, word) {.address = (at), .fixed = (word), .is_read_only = true}
#define TAKES(at, bits, place) {.address = (at), .takes = (bits), .field = (place)}
#define CLEARS(at, place) {.address = (at), .clears = WORD, .field = (place)}

static const struct storing storing[] = {
    FIXED(0xE000E004, 1),                             /* ICTR: 33 to 64 lines */
    TAKES(0xE000E008, 7, AT(actlr)),                  /* ACTLR: DISFOLD, DISDEFWBUF, DISMCYCINT */
    FIXED(0xE000ED00, 0x411FC231),                    /* CPUID: Cortex-M3 r1p1 (PM0056 4.4.1) */
    TAKES(0xE000ED08, 0x3FFFFF80, AT(vector_table)),  /* VTOR (PM0056 4.4.4) */
    TAKES(0xE000ED10, 0x16, AT(scr)),
    TAKES(SCB_CCR, 0x31B, AT(ccr)),
    CLEARS(SCB_CFSR, AT(cfsr)),
    CLEARS(SCB_HFSR, AT(hfsr)),
    CLEARS(0xE000ED30, AT(dfsr)),
    TAKES(0xE000ED34, WORD, AT(mmfar)),
    TAKES(0xE000ED38, WORD, AT(bfar)),
    FIXED(0xE000ED3C, 0), /* AFSR */
    FIXED(0xE000ED90, 0), /* MPU_TYPE: no regions; its other registers ignore writes */
    FIXED(0xE000ED94, 0), FIXED(0xE000ED98, 0), FIXED(0xE000ED9C, 0), FIXED(0xE000EDA0, 0), FIXED(0xE000EDA4, 0),
    FIXED(0xE000EDA8, 0), FIXED(0xE000EDAC, 0), FIXED(0xE000EDB0, 0), FIXED(0xE000EDB4, 0), FIXED(0xE000EDB8, 0),
    FIXED(0xE000EDF0, 0), /* DHCSR: no debugger */
    TAKES(DEMCR, 0x010D07F1, AT(demcr)),
    FIXED(0xE0042000, 0x20036410), /* DBGMCU_IDCODE: medium density, revision "X" (RM0008 31.6.1) */
    TAKES(0xE0042004, WORD, AT(dbgmcu_cr)),
};

/* Those of ITM, DWT, FPB and TPIU. Chosen: the counters but CYCCNT only store. */
#define COUNT(n) TAKES(0xE0001008 + 4 * (n), 0xFF, AT(dwt_counts) + 4 * (n))
#define COMPARATOR(n, function)                                                                                        \
    TAKES(0xE0001020 + 16 * (n), WORD, AT(dwt_comp) + 4 * (n)), TAKES(0xE0001024 + 16 * (n), 0x1F, AT(dwt_mask) + 4 * (n)), \
        TAKES(0xE0001028 + 16 * (n), function, AT(dwt_function) + 4 * (n))
#define INSTRUCTION(n) TAKES(0xE0002008 + 4 * (n), 0xDFFFFFFD, AT(fp_comp) + 4 * (n))
#define LITERAL(n) TAKES(0xE0002008 + 4 * (n), 0x1FFFFFFD, AT(fp_comp) + 4 * (n))

static const struct storing of_debug[] = {
    TAKES(0xE0000E00, WORD, AT(itm_enables)),     /* TER */
    TAKES(0xE0000E40, 0xF, AT(itm_privileges)),   /* TPR */
    TAKES(0xE0000E80, 0x7F031F, AT(itm_control)), /* TCR */
    COUNT(0), COUNT(1), COUNT(2), COUNT(3), COUNT(4),
    FIXED(0xE000101C, 0), /* PCSR: a debugger's */
    COMPARATOR(0, 0xFFDAF), COMPARATOR(1, 0xFFD2F), COMPARATOR(2, 0x2F), COMPARATOR(3, 0x2F),
    INSTRUCTION(0), INSTRUCTION(1), INSTRUCTION(2), INSTRUCTION(3), INSTRUCTION(4), INSTRUCTION(5), LITERAL(6), LITERAL(7),
    FIXED(0xE0040000, 0xB),                        /* SSPSR: 1, 2 or 4 pins */
    TAKES(0xE0040004, 0xF, AT(tpiu_size)),         /* CSPSR */
    TAKES(0xE0040010, 0x1FFF, AT(tpiu_prescaler)), /* ACPR */
    TAKES(0xE00400F0, 3, AT(tpiu_protocol)),       /* SPPR */
    FIXED(0xE0040300, 8),                          /* FFSR: the formatter cannot be stopped */
    /* FFCR */
    {.address = 0xE0040304, .fixed = 0x100, .takes = 2, .field = AT(tpiu_formatter)},
    FIXED(0xE0040FC8, 0xCA1), /* DEVID */
};

static const struct storing *found_in(const struct storing *rows, size_t count, uint32_t address)
{
    for (size_t n = 0; n < count; ++n) {
        if (rows[n].address == address) {
            return &rows[n];
        }
    }
    return NULL;
}

static uint32_t page_of(uint32_t address) { return address >> 12; }

static bool is_trace(uint32_t address) { return page_of(address) == ITM || page_of(address) == TPIU; }

/* The ITM's ports: the first 128 bytes of it. */
static bool is_stimulus(uint32_t address) { return address >> 7 == ITM << 5; }
static uint32_t port_of(uint32_t address) { return address >> 2 & 31; }

static bool is_systick(uint32_t address) { return address >> 4 == STK_CTRL >> 4; }

/* What changes which instructions and accesses are looked out for. */
static bool is_look_out(uint32_t address)
{
    return (page_of(address) == DWT && address >> 5 != DWT << 7) || page_of(address) == FPB || address == DEMCR;
}

static const struct storing *storing_at(uint32_t address)
{
    return page_of(address) <= FPB || page_of(address) == TPIU
               ? found_in(of_debug, sizeof of_debug / sizeof *of_debug, address)
               : found_in(storing, sizeof storing / sizeof *storing, address);
}

static uint32_t *field_of(struct shared *s, const struct storing *row)
{
    return (uint32_t *)(void *)((char *)s + row->field);
}

/* SHCSR: the bit of each exception that is active, and pending. */
struct state_bit {
    uint8_t number, bit;
};
static const struct state_bit active_bits[] = {{4, 0}, {5, 1}, {6, 3}, {11, 7}, {DEBUG_MONITOR, 8}, {14, 10}, {15, 11}};
static const struct state_bit pending_bits[] = {{6, 12}, {4, 13}, {5, 14}, {11, 15}};
#define SHCSR_ENABLES (7u << 16)

/* 32 lines of a mask over exceptions. */
static uint32_t lines_of(const uint64_t *words, uint32_t word)
{
    return (uint32_t)(word ? words[0] >> (FIRST_IRQ + 32) | words[1] << (32 - FIRST_IRQ) : words[0] >> FIRST_IRQ);
}

static uint64_t *word_of(uint64_t *words, unsigned number) { return &words[number >> 6]; }
static uint64_t bit_of(unsigned number) { return UINT64_C(1) << (number & 63); }

static bool is_line_array(uint32_t address) { return address - NVIC_ISER < 0x80 * LINE_ARRAYS && (address & 0x7F) < 0x20; }

static uint32_t read_lines(const struct shared *s, uint32_t address)
{
    const uint32_t array = (address - NVIC_ISER) >> 7, word = (address & 0x1F) >> 2;
    if (word > 1) { /* for more lines than the chip has (ARM B3.4.3); ST's code writes it */
        return 0;
    }
    if (array < PEND) {
        return (uint32_t)(s->enabled >> 32 * word);
    }
    return lines_of(array == ACTIVE ? s->active : s->pending, word);
}

static void write_lines(struct shared *s, uint32_t address, uint32_t value)
{
    const uint32_t array = (address - NVIC_ISER) >> 7, word = (address & 0x1F) >> 2;
    if (word > 1) {
        return;
    }
    uint64_t lines = ((uint64_t)value << 32 * word) & IRQS;
    if (array == ENABLE) {
        s->enabled |= lines;
    } else if (array == DISABLE) {
        s->enabled &= ~lines;
    } else if (array == PEND) {
        s->pending[0] |= lines << FIRST_IRQ;
        s->pending[1] |= lines >> (64 - FIRST_IRQ);
    } else { /* a line that is still high keeps its own, unless it is served */
        lines &= ~(s->levels & ~(s->active[0] >> FIRST_IRQ | s->active[1] << (64 - FIRST_IRQ)));
        s->pending[0] &= ~(lines << FIRST_IRQ);
        s->pending[1] &= ~(lines >> (64 - FIRST_IRQ));
    }
}

/* The first of the four exceptions whose priorities stand in a word; 0 for none. */
static unsigned priorities_at(uint32_t address)
{
    if (address - SCB_SHPR1 <= SCB_SHPR3 - SCB_SHPR1) {
        return MEM_MANAGE + (address - SCB_SHPR1);
    }
    return address - NVIC_IPR < IRQ_COUNT ? FIRST_IRQ + (address - NVIC_IPR) : 0;
}

static bool is_beyond_priorities(uint32_t address)
{
    return address - NVIC_IPR < NVIC_IPR_END - NVIC_IPR && address - NVIC_IPR >= IRQ_COUNT;
}

static uint32_t read_icsr(const struct shared *s)
{
    uint32_t value = s->exception_number | first_pending(s) << 12;
    if (__builtin_popcountll(s->active[0]) + __builtin_popcountll(s->active[1]) <= 1) {
        value |= RETTOBASE;
    }
    if (s->pending[0] >> FIRST_IRQ || s->pending[1]) {
        value |= ISRPENDING;
    }
    value |= s->pending[0] & bit_of(NMI) ? NMIPENDSET : 0;
    value |= s->pending[0] & bit_of(PENDSV) ? PENDSVSET : 0;
    return value | (s->pending[0] & bit_of(SYSTICK) ? PENDSTSET : 0);
}

static void write_icsr(struct shared *s, uint32_t value)
{
    s->pending[0] |= (value & NMIPENDSET ? bit_of(NMI) : 0) | (value & PENDSVSET ? bit_of(PENDSV) : 0) |
                     (value & PENDSTSET ? bit_of(SYSTICK) : 0);
    s->pending[0] &= ~((value & PENDSVCLR ? bit_of(PENDSV) : 0) | (value & PENDSTCLR ? bit_of(SYSTICK) : 0));
}

static uint32_t read_shcsr(const struct shared *s)
{
    uint32_t value = s->shcsr;
    for (size_t n = 0; n < sizeof active_bits / sizeof *active_bits; ++n) {
        value |= (uint32_t)(s->active[0] >> active_bits[n].number & 1) << active_bits[n].bit;
    }
    for (size_t n = 0; n < sizeof pending_bits / sizeof *pending_bits; ++n) {
        value |= (uint32_t)(s->pending[0] >> pending_bits[n].number & 1) << pending_bits[n].bit;
    }
    return value;
}

static uint32_t write_aircr(struct shared *s, uint32_t value)
{
    if (value >> 16 != VECTKEY) {
        return 0;
    }
    s->grouping = value >> 8 & 7;
    return (value & SYSRESETREQ ? SYSTEM_RESET : 0) | (value & DEBUGGERS ? SYSTEM_DEBUGGER : 0);
}

/* Starts or stops CYCCNT at its present value. */
static void set_counting(struct shared *s, bool on, uint64_t now)
{
    ramp_rebase(&s->cyccnt, now);
    s->cyccnt.runs = on;
}

bool system_needs_time(uint32_t address)
{
    return address == STK_CTRL || address == STK_CTRL + 8 || address == DWT_CYCCNT;
}

bool system_has(uint32_t address)
{
    return is_stimulus(address) || address == ITM_LAR || address == ITM_LSR || address == FP_CTRL || address == FP_REMAP ||
           storing_at(address) != NULL || address == DWT_CTRL || address == DWT_CYCCNT ||
           is_systick(address) || is_line_array(address) || priorities_at(address) ||
           is_beyond_priorities(address) || address == SCB_ICSR || address == SCB_AIRCR || address == SCB_SHCSR;
}

/* Reads a word; `now` is the cycle of the reading instruction. */
uint32_t system_read(struct shared *s, uint32_t address, uint64_t now, uint32_t *word)
{
    uint32_t answer = SYSTEM_KNOWN;
    *word = 0;
    if (is_systick(address)) {
        answer |= system_needs_time(address) && systick_advance(s, now) ? SYSTEM_TICKED : 0;
        *word = systick_read(s, (address - STK_CTRL) >> 2, now);
        return answer;
    }
    if (is_line_array(address)) {
        *word = read_lines(s, address);
        return answer;
    }
    const unsigned first = priorities_at(address);
    if (first) {
        memcpy(word, &s->priorities[first], sizeof *word);
        return answer;
    }
    if (is_trace(address) && !(s->demcr & TRCENA)) {
        return answer;
    }
    if (is_stimulus(address)) { /* chosen: there is always room for the next one */
        *word = s->itm_control & ITMENA && s->itm_enables >> port_of(address) & 1;
        return answer;
    }
    switch (address) {
    case ITM_LAR: return answer;
    case ITM_LSR: *word = s->itm_is_open ? 1 : 3; return answer;
    case FP_CTRL: *word = FP_NUMBERS | s->fp_control; return answer;
    case FP_REMAP: *word = FP_IN_SRAM | s->fp_remap; return answer;
    case DWT_CTRL: *word = DWT_CTRL_FIXED | s->dwt_control | (s->cyccnt.runs ? CYCCNTENA : 0); return answer;
    case DWT_CYCCNT: *word = ramp_at(&s->cyccnt, now); return answer;
    case SCB_ICSR: *word = read_icsr(s); return answer;
    case SCB_AIRCR: *word = VECTKEY_READ | s->grouping << 8; return answer;
    case SCB_SHCSR: *word = read_shcsr(s); return answer;
    default: break;
    }
    const struct storing *row = storing_at(address);
    if (row == NULL) {
        return is_beyond_priorities(address) ? answer : 0;
    }
    *word = row->fixed | (row->field ? *field_of(s, row) : 0);
    if (address == DEMCR) {
        *word |= s->pending[0] & bit_of(DEBUG_MONITOR) ? MON_PEND : 0;
    } else if (row->field - AT(dwt_function) < sizeof s->dwt_function) {
        *field_of(s, row) &= ~MATCHED;
    }
    return answer;
}

/* Whether a 0 written changes nothing, so that a narrow store needs no merging. */
static bool takes_ones(uint32_t address)
{
    return (is_line_array(address) && (address & 0x1F) < 8) || address == SCB_ICSR || address == SCB_CFSR ||
           address == SCB_HFSR || address == 0xE000ED30 || is_stimulus(address);
}

/* Takes a store of the bytes in `mask`. */
uint32_t system_write(struct shared *s, uint32_t address, uint32_t value, uint32_t mask, uint64_t now)
{
    uint32_t answer = SYSTEM_KNOWN | SYSTEM_WRITTEN;
    value &= mask;
    if (mask != WORD && !takes_ones(address)) {
        uint32_t before;
        answer |= system_read(s, address, now, &before) & SYSTEM_TICKED;
        value |= before & ~mask;
    }
    if (is_systick(address)) {
        if (address == STK_CALIB) {
            return SYSTEM_KNOWN;
        }
        answer |= systick_advance(s, now) ? SYSTEM_TICKED : 0;
        systick_write(s, (address - STK_CTRL) >> 2, value, now);
        return answer;
    }
    if (is_line_array(address)) {
        if (address - NVIC_ISER >= 0x80 * ACTIVE && (address & 0x1F) < 8) {
            return SYSTEM_KNOWN;
        }
        write_lines(s, address, value);
        return answer;
    }
    const unsigned first = priorities_at(address);
    if (first) {
        value &= PRIORITY_BITS * 0x01010101u;
        memcpy(&s->priorities[first], &value, sizeof value);
        return answer;
    }
    if (is_trace(address) && (!(s->demcr & TRCENA) || (!is_stimulus(address) && address < ITM_LAR && !s->itm_is_open))) {
        return SYSTEM_KNOWN;
    }
    if (is_stimulus(address)) {
        return s->itm_control & ITMENA && s->itm_enables >> port_of(address) & 1 ? SYSTEM_KNOWN | SYSTEM_STIMULUS : SYSTEM_KNOWN;
    }
    if (is_look_out(address) || (s->dwt_function[0] && (address == DWT_CTRL || address == DWT_CYCCNT))) {
        answer |= SYSTEM_LOOK_OUT;
    }
    switch (address) {
    case ITM_LAR: s->itm_is_open = value == ITM_KEY; return answer;
    case FP_CTRL: s->fp_control = value & FP_KEY ? value & FP_ENABLE : s->fp_control; return answer;
    case FP_REMAP: s->fp_remap = value & 0x1FFFFFE0; return answer;
    case DWT_CTRL:
        s->dwt_control = value & 0x7F1FFE;
        set_counting(s, value & CYCCNTENA && s->demcr & TRCENA, now);
        return answer;
    case DWT_CYCCNT:
        s->cyccnt.value = value;
        s->cyccnt.base = now;
        return answer;
    case SCB_ICSR: write_icsr(s, value); return answer;
    case SCB_AIRCR: return answer | write_aircr(s, value);
    case SCB_SHCSR: s->shcsr = value & SHCSR_ENABLES; return answer;
    case STIR: /* an interrupt by its number; one that the chip does not have is ignored */
        if ((value & 0x1FF) < IRQ_COUNT) {
            *word_of(s->pending, FIRST_IRQ + (value & 0x1FF)) |= bit_of(FIRST_IRQ + (value & 0x1FF));
        }
        return answer;
    default: break;
    }
    const struct storing *row = storing_at(address);
    if (row == NULL) {
        return is_beyond_priorities(address) ? answer : 0;
    }
    if (row->is_read_only) {
        return SYSTEM_KNOWN;
    }
    if (row->field) {
        uint32_t *field = field_of(s, row);
        *field = row->clears ? *field & ~(value & row->clears) : value & row->takes;
    }
    if (address == DEMCR) { /* MON_PEND is the pending state itself */
        s->pending[0] = value & MON_PEND ? s->pending[0] | bit_of(DEBUG_MONITOR) : s->pending[0] & ~bit_of(DEBUG_MONITOR);
        if (!(value & TRCENA)) {
            set_counting(s, false, now);
        }
    }
    return answer | (address == SCB_CCR ? SYSTEM_TRAPS : 0);
}

void system_init(struct shared *s)
{
    s->last_sleep_cycle = s->tick_next = s->raised_cycle = s->bus_error_cycle = NO_TIME;
    s->tick = (struct ramp){.divider = 1, .falls = 1};
    s->cyccnt = (struct ramp){.divider = 1, .top = WORD};
    system_power_up(s);
}

void system_power_up(struct shared *s)
{
    s->demcr = s->dbgmcu_cr = s->dfsr = s->dwt_control = s->fp_control = s->fp_remap = 0;
    s->itm_enables = s->itm_privileges = s->itm_control = s->itm_is_open = s->tpiu_prescaler = 0;
    s->tpiu_size = s->tpiu_protocol = 1;
    s->tpiu_formatter = 2;
    memset(s->dwt_counts, 0, sizeof s->dwt_counts);
    memset(s->dwt_comp, 0, sizeof s->dwt_comp);
    memset(s->dwt_mask, 0, sizeof s->dwt_mask);
    memset(s->dwt_function, 0, sizeof s->dwt_function);
    memset(s->fp_comp, 0, sizeof s->fp_comp);
}

void system_reset(struct shared *s)
{
    s->actlr = 0;
    s->tick_control = s->tick_count_flag = 0;
    s->tick_next = NO_TIME;
    s->tick = (struct ramp){.divider = 1, .falls = 1};
    s->cyccnt = (struct ramp){.divider = 1, .top = WORD};
}
