/* The structs that C and Python share: made by tools/generators/chip.py from extension/layout.py. */
#ifndef BLUEPILL_LAYOUT_H
#define BLUEPILL_LAYOUT_H

#include <stdint.h>

#define PORTS 5
#define PINS 16
#define SOURCES 64
#define LAST_ROWS 32
#define RECEIVED 256
#define ANALOG_PINS 10
#define LATER_INPUTS 1024
#define NOWHERE 0x9fffffffu
#define VIEW_BYTES 0x400u
#define VIEWS_BASE 0x9fff8000u
#define VIEWS_BYTES 0x4000u

/* A block that began, an exception that was entered (its number) or left (-1). */
struct record {
    uint64_t cycle;
    uint32_t address;
    int32_t kind;
};
_Static_assert(sizeof(struct record) == 16, "record");

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
    uint8_t gives_up; /* an exception that comes in it leaves it undone */
    uint8_t padding;
};
_Static_assert(sizeof(struct instruction) == 20, "instruction");

/* An instruction as the models of time and of faults need it, and when in its block it begins. */
struct measured {
    uint32_t address;
    uint32_t destination; /* of a direct branch */
    uint32_t cycle; /* from the start of its block */
    uint8_t kind; /* `enum kind` */
    uint8_t bytes;
    uint8_t count; /* registers that a multiple transfer moves */
    uint8_t loads_pc; /* it writes the PC although its kind does not say so */
    uint8_t base; /* register of an access, or the divisor of a division; 255: does not matter */
    uint8_t index; /* 255: none */
    uint8_t target; /* register that a load fills; 255: none */
    uint8_t has_destination;
    uint8_t always_branches; /* a direct branch, but for an IT before it */
    uint8_t sets_it; /* what an IT makes of ITSTATE */
    uint8_t it_state; /* before it, by an IT of its block */
    uint8_t gives_up; /* an exception that comes in it leaves it undone */
};
_Static_assert(sizeof(struct measured) == 24, "measured");

/* What a block costs in cycles: where it goes on at its end, and elsewhere. */
struct block_cost {
    uint32_t straight;
    uint32_t taken;
    uint32_t count;
    uint32_t flags; /* `enum row_flag` */
};
_Static_assert(sizeof(struct block_cost) == 16, "block_cost");

/* A counter that follows from the time: `source/fabric/ramp.c`. */
struct ramp {
    uint64_t base; /* when it had `value`, in the units of its owner, */
    uint32_t value;
    uint32_t divider; /* so many of which make it count once; */
    uint32_t top; /* its limit: 0 and this are neighbours */
    uint8_t runs;
    uint8_t falls;
    uint8_t mirrors; /* it turns round at both */
    uint8_t padding;
};
_Static_assert(sizeof(struct ramp) == 24, "ramp");

/* A clock that is counted from where the core's was last changed. */
struct ticks {
    uint64_t ns; /* when */
    uint64_t tick; /* begins; each one after it at floor(n * 10**9 / hz) ns */
    uint32_t hz;
    uint32_t padding;
};
_Static_assert(sizeof(struct ticks) == 24, "ticks");

/* What one instruction of a polling loop makes of the value that it has read. */
struct step {
    uint8_t operation;
    uint8_t is_register;
    uint8_t is_flags_only;
    uint8_t padding;
    uint32_t operand; /* or its register */
};
_Static_assert(sizeof(struct step) == 8, "step");

/* A block that reads one word, computes with it and what never changes, and goes round while a condition holds. */
struct loop {
    uint32_t read_cycle; /* from the start of the block */
    uint32_t offset;
    uint8_t base;
    uint8_t condition;
    uint8_t count;
    uint8_t padding;
    struct step steps[6];
};
_Static_assert(sizeof(struct loop) == 60, "loop");

/* A HardFault that was entered here, for Python to report: the core as it was before. */
struct fault {
    uint64_t ns;
    uint64_t logged;
    uint32_t kind; /* number of its halt */
    uint32_t pc;
    uint32_t address;
    uint32_t has_address;
    uint32_t exception_number;
    uint32_t vector; /* of the handler that ran */
    uint32_t registers[16]; /* R0 to R12, SP, LR, xPSR */
    uint64_t last_ns; /* when its handler last came back to it with nothing changed, */
    uint64_t round_ns; /* how long that took, */
    uint32_t returns; /* and how often */
    uint32_t is_other; /* another one came before it in this run */
    struct record last[32];
};
_Static_assert(sizeof(struct fault) == 640, "fault");

/* The state of one core. */
struct shared {
    uint64_t cycle;
    uint64_t stop_at;
    uint64_t access_cycle;
    uint64_t last_sleep_cycle;
    uint64_t tick_next;
    uint64_t pending[2]; /* a bit an exception */
    uint64_t active[2]; /* a bit an exception */
    uint64_t held[2]; /* a bit an exception */
    uint64_t enabled;
    uint64_t levels;
    uint32_t access_pc;
    uint32_t in_access;
    uint32_t pc;
    uint32_t is_thumb;
    uint32_t mask_stop;
    uint32_t attention;
    uint32_t halt_kind;
    uint32_t halt_pc;
    uint32_t halt_address;
    uint32_t halt_has_address;
    uint32_t run_from;
    uint32_t uses_exclusive;
    uint32_t exception_number;
    uint32_t sleep;
    uint32_t event_register;
    uint32_t vector_table;
    uint32_t scr;
    uint32_t ccr;
    uint32_t tick_control;
    uint32_t tick_count_flag;
    uint32_t traps_division;
    uint32_t grouping;
    uint32_t it_state;
    uint32_t is_python;
    uint32_t is_first; /* the recorder has not had a row yet */
    uint32_t raised_pc; /* the access that raised the last exception: its instruction, */
    uint64_t raised_cycle; /* and when its block began */
    uint8_t priorities[76]; /* one an exception */
    uint8_t priorities_end[4];
    uint64_t sram; /* set by Python before the first run */
    uint64_t flash; /* set by Python before the first run */
    uint32_t sram_base;
    uint32_t sram_bytes;
    uint32_t flash_base;
    uint32_t flash_bytes;
    uint32_t scratch;
    uint32_t padding;
    uint64_t exact_stops; /* how often a run was stopped to learn which instruction makes an access */
    uint64_t logged; /* rows so far: the next one goes to `last` at this, modulo its size */
    uint32_t shcsr;
    uint32_t cfsr;
    uint32_t hfsr;
    uint32_t mmfar;
    uint32_t bfar;
    uint32_t demcr;
    uint32_t dbgmcu_cr;
    uint32_t dfsr;
    uint32_t actlr;
    uint32_t dwt_control;
    uint32_t fp_control;
    uint32_t fp_remap;
    uint32_t itm_enables;
    uint32_t itm_privileges;
    uint32_t itm_control;
    uint32_t itm_is_open;
    uint32_t tpiu_size;
    uint32_t tpiu_prescaler;
    uint32_t tpiu_protocol;
    uint32_t tpiu_formatter;
    uint32_t dwt_counts[5]; /* CPICNT, EXCCNT, SLEEPCNT, LSUCNT, FOLDCNT: they only store */
    uint32_t dwt_comp[4];
    uint32_t dwt_mask[4];
    uint32_t dwt_function[4];
    uint32_t fp_comp[8]; /* six of instructions, two of literals */
    struct ramp tick; /* SysTick's counter: its limit is the reload value */
    struct ramp cyccnt;
    uint32_t hears_ticks; /* Python wants to know when SysTick is set */
    uint32_t has_debugger; /* Python sees to BKPT and HardFaults */
    uint32_t knows_masked_svc; /* Python was notified of an SVC that its priority does not allow */
    uint32_t has_fault; /* `fault` waits for Python */
    uint32_t waits; /* the block ends before its next access: the flash cannot give more code now */
    uint32_t waits_end;
    uint64_t bus_error_cycle; /* when the error of a buffered store comes; all ones: none is on its way */
    uint32_t bus_error_pc;
    uint32_t bus_error_address;
    struct fault fault;
    struct record last[32];
};
_Static_assert(sizeof(struct shared) == 1776, "shared");

/* The pins of one port, a bit each. RM0008 9.1, table 20. */
struct port {
    uint32_t bonded;
    uint32_t board_up;
    uint32_t board_down;
    uint32_t outside; /* driven from outside, */
    uint32_t outside_high; /* to 1, */
    uint32_t outside_weak; /* by a resistor */
    uint32_t rail;
    uint32_t rail_high;
    uint32_t bus_low; /* held low by a part on a bus, whose bits somebody looks at */
    uint32_t odr; /* what GPIO has configured: the data bits, */
    uint32_t output; /* general-purpose outputs, */
    uint32_t alternate; /* outputs of an alternate function, */
    uint32_t open_drain; /* those of both that cannot drive high, */
    uint32_t pulled;
    uint32_t analog;
    uint32_t offered; /* some alternate function offers a level, */
    uint32_t offered_high; /* which is 1 */
    uint32_t waving; /* or a wave */
    uint32_t held; /* kept off GPIO, and what drives then */
    uint32_t hold_low;
    uint32_t hold_high;
    uint32_t hold_up;
    uint32_t hold_down;
    uint32_t low; /* what the chip itself drives */
    uint32_t high;
    uint32_t up;
    uint32_t down;
    uint32_t level; /* on the wire; a floating wire is low */
    uint32_t input; /* what the digital input reads */
    uint32_t floating;
    uint32_t fighting;
    uint32_t shorted;
    uint32_t shown; /* pins that show a wave: what stands above of them is as of their last edge made */
    uint8_t modes[16]; /* index in `PinMode` */
    uint64_t sources[16]; /* the alternate functions that offer a level, a bit each; the lowest drives */
    uint64_t source_levels[16];
};
_Static_assert(sizeof(struct port) == 408, "port");

/* What a USART holds beyond its registers. RM0008 27.3. */
struct usart {
    uint64_t tx_base_ns; /* start of the run of characters, */
    uint64_t tx_half_bits; /* and half-bits from there to the end of the present one */
    uint64_t tx_due_ns;
    uint64_t rx_base_ns;
    uint64_t rx_half_bits;
    uint64_t rx_due_ns;
    uint64_t idle_due_ns;
    uint64_t bit_due_ns;
    uint64_t bit_half_bits; /* half-bits up to the next bit on the TX pin */
    uint32_t clock_hz; /* the PCLK that the deadlines were worked out with */
    uint32_t was_enabled; /* whether transmission was on at the last write of a control register */
    uint32_t rate_pc; /* the instruction that has set the speed */
    uint32_t judged_hz; /* the speed that was judged last */
    uint32_t judged_brr;
    uint32_t source;
    uint32_t tx_pin; /* 16 times the port, and the pin */
    uint32_t rx_pin;
    uint32_t rx_first;
    uint32_t rx_count;
    uint32_t cts_pin;
    uint32_t rts_pin;
    uint32_t rts; /* the level that nRTS was last given */
    uint32_t rx_waits; /* the far end waits for nRTS */
    uint32_t bits; /* bits of a character to come on the TX pin, and a mark above them; 0: nobody looks */
    uint32_t rx_more; /* Python has more characters to come */
    uint64_t ck_due_ns; /* the next edge of the clock on CK, */
    uint64_t ck_half_bits; /* and half-bits up to it */
    uint32_t ck_edges; /* edges to come; 0: nobody looks */
    uint32_t ck_pin;
    uint32_t ck; /* the level that CK was last given */
    uint32_t ck_count; /* bits of RX that edges of a character have taken, */
    uint32_t ck_word; /* and they */
    uint32_t ck_end;
    uint32_t rx[256]; /* what DR will read, and above it the flags of SR */
};
_Static_assert(sizeof(struct usart) == 1200, "usart");

/* What EXTI holds beyond its registers. */
struct exti {
    uint32_t levels;
    uint8_t routes[16];
};
_Static_assert(sizeof(struct exti) == 20, "exti");

/* What a DMA controller holds beyond its registers. RM0008 13.3. */
struct dma {
    uint64_t base_ns; /* start of the transfers that follow each other without a gap, */
    uint64_t cycles; /* and cycles of HCLK from there to the end of the one under way */
    uint32_t hz;
    uint32_t apb1_cycles;
    uint32_t apb2_cycles;
    uint32_t current; /* 1 + the channel whose transfer is under way; 0: none */
    uint32_t ready; /* channels that are enabled and have something left, */
    uint32_t unasked; /* those that need no request, */
    uint32_t lines; /* those whose request is high, */
    uint32_t latched; /* and those of which a request has come */
    uint32_t peripheral[7];
    uint32_t memory[7];
    uint32_t reload[7];
    uint32_t padding;
};
_Static_assert(sizeof(struct dma) == 136, "dma");

/* Volts on a pin, from outside: `bluepill_sim/fabric/signals.py`. */
struct signal {
    uint64_t start_ns; /* when it began, */
    uint64_t phase_ns; /* at this place of its period */
    uint64_t period_ns;
    uint64_t interval_ns; /* between two samples; of a square wave, how long it is high */
    int32_t low_uv;
    int32_t high_uv;
    uint32_t shape; /* 0: none, the pin has its logic level */
    uint32_t is_repeated;
    uint32_t count; /* samples, which stand elsewhere */
    uint32_t padding;
};
_Static_assert(sizeof(struct signal) == 56, "signal");

/* The analog side of a chip. */
struct analog {
    uint32_t vdda_uv;
    int32_t temperature_mc; /* of the chip, in thousandths of a degree Celsius */
    struct signal signals[10];
};
_Static_assert(sizeof(struct analog) == 568, "analog");

/* What an ADC holds beyond its registers. RM0008 11.3. */
struct adc {
    uint64_t base_ns; /* start of the run of conversions, */
    uint64_t cycles; /* and cycles of PCLK2 from there to the end of the present one */
    uint64_t sample_ns;
    uint64_t end_ns;
    uint64_t ready_ns; /* no conversion begins earlier */
    uint64_t calibrated_ns; /* when CAL and RSTCAL fall */
    uint32_t hz; /* PCLK2, */
    uint32_t divider; /* and what ADCCLK is divided by */
    uint32_t number; /* 1 or 2 */
    uint32_t remapped; /* bit 0: the regular group's EXTI trigger is TIM8's, bit 1: the injected one's */
    uint32_t state; /* which group is being converted */
    uint32_t channel;
    uint32_t has_sample;
    uint32_t sample;
    uint32_t regular_at; /* rank in the sequence, */
    uint32_t regular_left; /* and conversions that are left of this trigger */
    uint32_t regular_waits; /* for the end of the injected group */
    uint32_t injected_at;
    uint32_t injected_left;
    uint32_t is_automatic; /* the injected group follows the regular one */
    uint32_t turns; /* triggers that alternate, modulo 2 */
    uint32_t is_stopped; /* its clock stands still: Stop mode */
    uint32_t warned[6]; /* by question: channels that were warned of */
};
_Static_assert(sizeof(struct adc) == 136, "adc");

/* Which port a GPIO is, and what is known of its pins, a bit each. RM0008 9.2. */
struct gpio {
    uint32_t port;
    uint32_t base; /* the address of its registers */
    uint32_t locked; /* configuration frozen until reset */
    uint32_t intended; /* made floating inputs on purpose, and where */
    uint32_t claimed; /* configured while they belong to another, and where */
    uint32_t warned;
    uint32_t reported;
    uint32_t intended_pc[16];
    uint32_t claimed_pc[16];
};
_Static_assert(sizeof(struct gpio) == 156, "gpio");

/* Which pins AFIO keeps from GPIO, a bit each. RM0008 9.3. */
struct afio {
    uint32_t held[5];
    uint32_t swj_cfg; /* which cannot be read */
};
_Static_assert(sizeof(struct afio) == 24, "afio");

/* The clock tree's outputs: `bluepill_sim/fabric/clocks.py`. */
struct clocks {
    uint32_t sysclk_hz;
    uint32_t hclk_hz;
    uint32_t pclk1_hz;
    uint32_t pclk2_hz;
    uint32_t timer1_hz; /* of TIM2 to TIM7 */
    uint32_t timer2_hz; /* of TIM1 and TIM8 */
    uint32_t usb_hz; /* 0 while the PLL is off */
    uint32_t adc_divider; /* what PCLK2 is divided by for the ADCs */
    uint32_t lsi_hz;
    uint32_t rtcclk_hz; /* 0: it stands still */
    uint32_t rtc_calibration;
    uint32_t rtc_seconds_shown;
    uint32_t flash_wait_states;
    uint32_t flash_prefetch;
};
_Static_assert(sizeof(struct clocks) == 56, "clocks");

/* What RCC holds beyond its registers. RM0008 7.2. */
struct rcc {
    uint64_t ready_at[5]; /* when HSI, HSE, PLL, LSE and LSI get ready that are starting */
    uint64_t python_ns; /* when Python next acts */
    uint32_t watches_gates; /* Python is notified of each write of a clock gate */
    uint32_t shows_clock; /* Python has put a clock on MCO's pin */
    uint32_t hse_hz; /* the crystal; 0: there is none */
    uint32_t crystal_works;
    uint32_t keeps_lsi; /* IWDG does */
    uint32_t hsi_hz; /* as it is trimmed */
    uint32_t pll_hz; /* whether or not it runs */
    uint32_t padding;
};
_Static_assert(sizeof(struct rcc) == 80, "rcc");

/* A digital filter of an input. RM0008 14.4.7, IC1F. */
struct filter {
    uint64_t sampled; /* the tick up to which samples were taken */
    uint8_t raw; /* the level in front of it, */
    uint8_t out; /* and behind */
    uint8_t count; /* samples so far that differ from `out` */
    uint8_t padding;
    uint32_t period; /* ticks from sample to sample, */
    uint32_t length; /* so many of which change `out`; 0: it passes everything */
    uint32_t end;
};
_Static_assert(sizeof(struct filter) == 24, "filter");

/* What an output of a timer shows: a level, a wave, or nothing. */
struct shape {
    uint64_t period; /* in ticks, */
    uint64_t high; /* of which it is so many at 1 */
    uint64_t edge; /* a tick of a rising edge, modulo the period */
    uint32_t kind; /* nothing, low, high, a wave (`tim.h`) */
    uint32_t padding;
};
_Static_assert(sizeof(struct shape) == 32, "shape");

/* What a timer holds beyond its registers. RM0008 14, 15. */
struct tim {
    struct ramp ramp; /* CNT, in ticks */
    struct ticks ticks; /* of CK_INT */
    uint64_t at; /* the tick up to which all is worked out */
    uint64_t idle_at; /* the tick at which outputs go to OISx; all ones: none is to come */
    uint64_t edge_at[3]; /* the tick at which OC1REF to OC3REF last changed before they were what they are now, */
    uint64_t shaped_at[3]; /* since when they are that, */
    uint64_t written_at; /* when a register was written last: the references of that tick came before */
    uint64_t starts; /* the first tick that its own clock may count: one after CEN */
    uint64_t born[3]; /* of a wave the tick of its last edge before, which there was not, */
    uint64_t turns_at[3]; /* and of the first that there is */
    struct filter filters[5]; /* TI1 to TI4, ETR */
    struct shape outputs[7]; /* CH1 to CH4, CH1N to CH3N */
    struct shape references[3]; /* OC1REF to OC3REF, for the dead time */
    uint32_t base; /* the address of its registers */
    uint32_t psc;
    uint32_t arr;
    uint32_t ccr[4]; /* active registers, behind the preload registers */
    uint32_t ccer; /* the same of CCPC */
    uint32_t ccmr[2];
    uint32_t repetitions; /* overflows before the next update event */
    uint32_t psc_count; /* of the prescaler while no clock of its own drives it */
    uint8_t captures[4]; /* events in the prescaler of an input */
    uint32_t latched; /* OCxREF where it does not follow from CNT, a bit each */
    uint32_t cleared; /* OCxREF that ETRF has cleared */
    uint32_t armed; /* flags of SR whose rising is an event, because the program looks for them */
    uint32_t itr; /* levels of the internal triggers */
    uint8_t trgi;
    uint8_t trgo;
    uint8_t in_break;
    uint8_t is_busy; /* what it puts out may come back to it: pulses are not taken, */
    uint64_t late_at; /* and levels at this tick, the next one; 0: none has come back */
    uint32_t pulses; /* outputs that give a pulse at the end of what happens now */
    uint32_t listening; /* bits of `pins` that are listened to, */
    uint32_t hears; /* and of the internal triggers */
    uint32_t etr_was;
    uint32_t etr_edges;
    uint32_t burst_index; /* the next register of a burst, */
    uint32_t burst_left; /* transfers that are still to be asked for, */
    uint32_t burst_output; /* by this output */
    uint32_t lock; /* LOCK, once it was written */
    uint32_t is_advanced; /* it is TIM1 */
    uint32_t is_stopped; /* its clock stands still */
    uint32_t padding;
    uint8_t pins[9]; /* CH1 to CH4, CH1N to CH3N, ETR, BKIN */
    uint8_t sources[7]; /* the alternate functions of the first seven */
};
_Static_assert(sizeof(struct tim) == 760, "tim");

/* What an SPI holds beyond its registers. RM0008 25.3. */
struct spi {
    uint64_t base_ns; /* start of the run of words, */
    uint64_t ticks; /* and ticks of `rate_hz` from there to the end of the present one */
    uint64_t word_ns; /* when the present word began, */
    uint64_t word_at_ticks; /* and how many ticks from `base_ns` that was, for who looks at its bits */
    uint32_t clock_hz; /* PCLK */
    uint32_t rate_hz; /* PCLK, or the clock of a master outside */
    uint32_t shift; /* what is in the shift register; 0: nothing */
    uint32_t tdr;
    uint32_t rdr;
    uint32_t seen; /* flags of which half of the clearing sequence was seen */
    uint32_t source; /* its first alternate function; MISO, MOSI, NSS and SCK follow each other, */
    uint32_t pins[4]; /* and so do these: 16 times the port, and the pin */
    uint32_t offered[4]; /* the levels that they were last given */
    uint32_t selects[5]; /* pins that select parts */
    uint32_t is_looped; /* MISO is tied to MOSI */
    uint32_t selected; /* parts that are selected */
    uint32_t far; /* the word that a master outside sends; 0: none */
    uint32_t wants_words; /* somebody has subscribed to words */
    uint32_t ahead_count; /* how many bytes the part has said ahead, */
    uint32_t ahead_at; /* and how many of them have gone over; */
    uint32_t ahead_cr1; /* they hold while this is CR1, */
    uint32_t ahead_sent; /* and while this is sent: above 0xFF whatever is */
    uint8_t ahead[256];
    uint32_t is_stopped; /* its clock stands still */
    uint32_t halves; /* half-bits of the word that is shown on the pins, */
    uint32_t half_ticks; /* what each of them lasts, */
    uint32_t half; /* and the next one; 0: nobody looks */
};
_Static_assert(sizeof(struct spi) == 416, "spi");

/* What an I2C holds beyond its registers. RM0008 26.3. */
struct i2c {
    uint64_t base_ns; /* start of the run of bits, */
    uint64_t ticks; /* and ticks of `rate_hz` from there to the end of what is under way */
    uint64_t due_ns; /* which is this; all ones: nothing is */
    uint64_t timeout_ns; /* when SCL will have been low for too long */
    uint32_t clock_hz; /* PCLK1 */
    uint32_t rate_hz; /* PCLK1, or the bits a second of a master outside */
    uint32_t phase;
    uint32_t shift;
    uint32_t tdr;
    uint32_t rdr;
    uint32_t received; /* a byte behind the one in DR; 0: none */
    uint32_t next_ack; /* ACK as it was when the byte before ended, for POS */
    uint32_t was_refused;
    uint32_t has_sent;
    uint32_t is_second;
    uint32_t is_pec;
    uint32_t is_lost;
    uint32_t is_late;
    uint32_t is_own;
    uint32_t far; /* what a master outside does next; 0: nothing */
    uint32_t far_waits; /* it will, once the bus is free */
    uint32_t header; /* the 10-bit header that it has sent matched */
    uint32_t lines; /* lines that are low: SCL, SDA, SMBA */
    uint32_t source; /* its first alternate function; SCL and SDA follow each other, then SMBA */
    uint32_t smba_source;
    uint32_t has_parts;
    uint32_t pins[3]; /* SCL, SDA, SMBA: 16 times the port, and the pin */
    uint32_t offered[3]; /* the levels that they were last given */
    uint32_t counter; /* address of CNDTR of the DMA channel that it receives by */
    uint32_t far_hz; /* bits a second of a master outside */
    uint32_t is_stopped; /* 1: its clock stands still; 2: that of the timeout does */
    uint32_t wants_words; /* somebody has subscribed to what is on the bus */
    uint64_t stopped_ns; /* since when: times of what comes meanwhile are this one */
    uint32_t answer; /* what the part made of the byte that is sent, before its acknowledge; 0: not asked yet */
    uint32_t incoming; /* the byte that a part sends */
    uint32_t show; /* 1 + the next step of what is shown on the pins; 0: nobody looks */
    uint64_t show_ns; /* when that is due */
    uint64_t shown_from; /* ticks from `base_ns` to the begin of what is shown */
};
_Static_assert(sizeof(struct i2c) == 200, "i2c");

/* A level that goes up every `period` ticks, and down `high` ticks later. */
struct wave {
    uint64_t ns; /* when tick 0 begins; tick n begins floor(n * 10**9 / hz) ns later */
    uint64_t at; /* ticks from a rising edge to tick 0, less than the period */
    uint64_t period; /* in ticks; 0: there is no wave */
    uint64_t high; /* of them at level 1, more than 0 and less than the period */
    uint32_t hz; /* ticks a second: the clock of who makes it */
    uint32_t pin; /* on which it is offered */
    uint64_t padding;
};
_Static_assert(sizeof(struct wave) == 48, "wave");

/* A change of a pin, for who has subscribed: `bluepill_sim/fabric/subscriptions.py`. */
struct edge {
    uint64_t ns;
    uint8_t pin;
    uint8_t drive;
    uint8_t wire;
    uint8_t kind;
    uint32_t zero;
};
_Static_assert(sizeof(struct edge) == 16, "edge");

/* Levels that the outside puts on pins later: a ring, oldest first. */
struct inputs {
    uint32_t first;
    uint32_t count;
    uint64_t padding;
    struct edge rows[1024];
};
_Static_assert(sizeof(struct inputs) == 16400, "inputs");

/* Interrupts that are put off by drawn cycles: how often one was, and until when those that are held wait. */
struct latency {
    uint64_t seed;
    uint64_t count;
    uint64_t until; /* how many are put off as they are drawn; those behind them come at once, */
    uint32_t last; /* but for the first of these, which is put off by so many cycles */
    uint32_t most; /* cycles that may be drawn */
    uint64_t due[76]; /* ns */
};
_Static_assert(sizeof(struct latency) == 640, "latency");

/* Levels of CAN's pins to come: rows whose drive is TX, whose wire is RX and whose time counts from `shown_ns`, those from `first` on; and a frame that is tried over and over: the phase of the try that begins at `start_ns`. */
struct can_bits {
    uint32_t first;
    uint32_t count;
    uint32_t tx_pin;
    uint32_t source;
    uint32_t rx_pin;
    uint32_t is_offered;
    uint32_t tx;
    uint32_t phase;
    uint64_t shown_ns;
    uint64_t start_ns;
    uint64_t decided_ns;
    uint64_t end_ns;
    uint64_t period_ns;
    uint64_t padding;
    struct edge rows[192];
};
_Static_assert(sizeof(struct can_bits) == 3152, "can_bits");

/* A word that has gone out, when, and how: clock and divider, and what else its device says of its format. */
struct sent {
    uint64_t ns;
    uint32_t word;
    uint32_t clock_hz;
    uint32_t brr;
    uint32_t format;
};
_Static_assert(sizeof(struct sent) == 24, "sent");

#endif
