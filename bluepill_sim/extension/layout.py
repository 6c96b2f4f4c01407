"""The structs that C and Python share, declared once.

`tools/generate_chip.py` writes them as `source/fabric/layout.h`; `structure` makes the ctypes class of the same
fields. Both sides keep the natural alignment of the machine, and `library.py` refuses a library whose sizes are others.

Invariant: a struct holds numbers and arrays of them, no pointers: what it holds can be saved as bytes.
"""

import ctypes
from dataclasses import dataclass
from functools import cache
from struct import Struct as Packing
from typing import Any

#: How many ports the chip has, and pins each port.
PORTS, PINS = 5, 16
#: Alternate functions that may drive a pin, at most.
SOURCES = 64
#: How many of the last rows are kept with or without a recorder; a power of 2.
LAST_ROWS = 32
#: Channels of an ADC that lead to pins: PA0 to PA7, PB0, PB1.
ANALOG_PINS = 10
#: Exceptions of the architecture that a chip of the family can have.
EXCEPTIONS = 76
#: Characters that wait in C to arrive at a USART; the others wait in Python.
RECEIVED = 256
#: Levels that the outside puts on pins later: more than a step of a robot brings.
LATER_INPUTS = 1024
#: No instruction stands at an odd address, so a run never ends there; the page is the scratch page, which executes.
NOWHERE = 0x9FFF_FFFF
#: A page of the library's TLB; where the copies of pages that the FPB remaps stand for the library: chosen, below the
#: scratch page. The program finds nothing there.
VIEW_BYTES, VIEWS_BASE = 0x400, 0x9FFF_8000
VIEWS_BYTES = 16 * VIEW_BYTES


@dataclass(frozen=True, slots=True)
class Field:
    """One member of a struct."""

    name: str
    #: "u8", "u16", "u32", "u64", "i32", or the name of a struct above.
    kind: str
    #: None: no array.
    count: int | None = None
    doc: str = ""


@dataclass(frozen=True, slots=True)
class Struct:
    """One struct, with what C says of it."""

    name: str
    doc: str
    fields: tuple[Field, ...]


def _fields(kind: str, *names: str) -> tuple[Field, ...]:
    return tuple(Field(name, kind) for name in names)


RECORD = Struct(
    "record",
    "A block that began, an exception that was entered (its number) or left (-1).",
    (Field("cycle", "u64"), Field("address", "u32"), Field("kind", "i32")),
)
INSTRUCTION = Struct(
    "instruction",
    "An instruction of a block: where it starts in time, and which memory it reaches for.",
    (
        Field("address", "u32"),
        Field("cycle", "u32"),
        Field("offset", "i32"),
        Field("kind", "u8", doc="0: no access of interest, 1: load, 2: store"),
        *_fields("u8", "bytes", "base"),
        Field("index", "u8", doc="255: none"),
        Field("shift", "u8"),
        Field("count", "u8", doc="words of a multiple transfer, else 1"),
        Field("padding", "u8", 2),
    ),
)
RAMP = Struct(
    "ramp",
    "A counter that follows from the time: `source/fabric/ramp.c`.",
    (
        Field("base", "u64", doc="when it had `value`, in the units of its owner,"),
        Field("value", "u32"),
        Field("divider", "u32", doc="so many of which make it count once;"),
        Field("top", "u32", doc="its limit: 0 and this are neighbours"),
        *_fields("u8", "runs", "falls"),
        Field("mirrors", "u8", doc="it turns round at both"),
        Field("padding", "u8"),
    ),
)
TICKS = Struct(
    "ticks",
    "A clock that is counted from where the core's was last changed.",
    (
        Field("ns", "u64", doc="when"),
        Field("tick", "u64", doc="begins; each one after it at floor(n * 10**9 / hz) ns"),
        Field("hz", "u32"),
        Field("padding", "u32"),
    ),
)
STEP = Struct(
    "step",
    "What one instruction of a polling loop makes of the value that it has read.",
    (
        *_fields("u8", "operation", "is_register", "is_flags_only", "padding"),
        Field("operand", "u32", doc="or its register"),
    ),
)
LOOP = Struct(
    "loop",
    "A block that reads one word, computes with it and what never changes, and goes round while a condition holds.",
    (
        Field("read_cycle", "u32", doc="from the start of the block"),
        Field("offset", "u32"),
        *_fields("u8", "base", "condition", "count", "padding"),
        Field("steps", "step", 6),
    ),
)
FAULT = Struct(
    "fault",
    "A HardFault that was entered here, for Python to report: the core as it was before.",
    (
        *_fields("u64", "ns", "logged"),
        Field("kind", "u32", doc="number of its halt"),
        *_fields("u32", "pc", "address", "has_address", "exception_number"),
        Field("vector", "u32", doc="of the handler that ran"),
        Field("registers", "u32", 16, "R0 to R12, SP, LR, xPSR"),
        Field("last_ns", "u64", doc="when its handler last came back to it with nothing changed,"),
        Field("round_ns", "u64", doc="how long that took,"),
        Field("returns", "u32", doc="and how often"),
        Field("is_other", "u32", doc="another one came before it in this run"),
        Field("last", "record", LAST_ROWS),
    ),
)
SHARED = Struct(
    "shared",
    "The state of one core.",
    (
        *_fields("u64", "cycle", "stop_at", "access_cycle", "last_sleep_cycle", "tick_next"),
        *(Field(name, "u64", 2, "a bit an exception") for name in ("pending", "active")),
        *_fields("u64", "enabled", "levels"),
        *_fields("u32", "access_pc", "in_access", "pc", "is_thumb", "mask_stop", "attention"),
        *_fields("u32", "halt_kind", "halt_pc", "halt_address", "halt_has_address", "run_from", "uses_exclusive"),
        *_fields("u32", "exception_number", "sleep", "event_register", "vector_table", "scr", "ccr"),
        *_fields("u32", "tick_control", "tick_count_flag"),
        *_fields("u32", "traps_division", "grouping", "it_state", "is_python"),
        Field("is_first", "u32", doc="the recorder has not had a row yet"),
        Field("raised_pc", "u32", doc="the access that raised the last exception: its instruction,"),
        Field("raised_cycle", "u64", doc="and when its block began"),
        Field("priorities", "u8", EXCEPTIONS, "one an exception"),
        Field("priorities_end", "u8", 4),
        *(Field(name, "u64", doc="set by Python before the first run") for name in ("sram", "flash")),
        *_fields("u32", "sram_base", "sram_bytes", "flash_base", "flash_bytes", "scratch", "padding"),
        Field("exact_stops", "u64", doc="how often a run was stopped to learn which instruction makes an access"),
        Field("logged", "u64", doc="rows so far: the next one goes to `last` at this, modulo its size"),
        *_fields("u32", "shcsr", "cfsr", "hfsr", "mmfar", "bfar", "demcr", "dbgmcu_cr"),
        *_fields("u32", "dfsr", "actlr", "dwt_control", "fp_control", "fp_remap"),
        *_fields("u32", "itm_enables", "itm_privileges", "itm_control", "itm_is_open"),
        *_fields("u32", "tpiu_size", "tpiu_prescaler", "tpiu_protocol", "tpiu_formatter"),
        Field("dwt_counts", "u32", 5, "CPICNT, EXCCNT, SLEEPCNT, LSUCNT, FOLDCNT: they only store"),
        *(Field(name, "u32", 4) for name in ("dwt_comp", "dwt_mask", "dwt_function")),
        Field("fp_comp", "u32", 8, "six of instructions, two of literals"),
        Field("tick", "ramp", doc="SysTick's counter: its limit is the reload value"),
        Field("cyccnt", "ramp"),
        Field("hears_ticks", "u32", doc="Python wants to know when SysTick is set"),
        Field("has_debugger", "u32", doc="Python sees to BKPT and HardFaults"),
        Field("knows_masked_svc", "u32", doc="Python was notified of an SVC that its priority does not allow"),
        Field("has_fault", "u32", doc="`fault` waits for Python"),
        Field("waits", "u32", doc="the block ends before its next access: the flash cannot give more code now"),
        Field("waits_end", "u32"),
        Field("bus_error_cycle", "u64", doc="when the error of a buffered store comes; all ones: none is on its way"),
        *_fields("u32", "bus_error_pc", "bus_error_address"),
        Field("fault", "fault"),
        Field("last", "record", LAST_ROWS),
    ),
)
PORT = Struct(
    "port",
    "The pins of one port, a bit each. RM0008 9.1, table 20.",
    (
        *_fields("u32", "bonded", "board_up", "board_down"),
        Field("outside", "u32", doc="driven from outside,"),
        Field("outside_high", "u32", doc="to 1,"),
        Field("outside_weak", "u32", doc="by a resistor"),
        *_fields("u32", "rail", "rail_high"),
        Field("bus_low", "u32", doc="held low by a part on a bus, whose bits somebody looks at"),
        Field("odr", "u32", doc="what GPIO has configured: the data bits,"),
        Field("output", "u32", doc="general-purpose outputs,"),
        Field("alternate", "u32", doc="outputs of an alternate function,"),
        Field("open_drain", "u32", doc="those of both that cannot drive high,"),
        *_fields("u32", "pulled", "analog"),
        Field("offered", "u32", doc="some alternate function offers a level,"),
        Field("offered_high", "u32", doc="which is 1"),
        Field("waving", "u32", doc="or a wave"),
        Field("held", "u32", doc="kept off GPIO, and what drives then"),
        *_fields("u32", "hold_low", "hold_high", "hold_up", "hold_down"),
        Field("low", "u32", doc="what the chip itself drives"),
        *_fields("u32", "high", "up", "down"),
        Field("level", "u32", doc="on the wire; a floating wire is low"),
        Field("input", "u32", doc="what the digital input reads"),
        *_fields("u32", "floating", "fighting", "shorted"),
        Field("shown", "u32", doc="pins that show a wave: what stands above of them is as of their last edge made"),
        Field("modes", "u8", PINS, "index in `PinMode`"),
        Field("sources", "u64", PINS, "the alternate functions that offer a level, a bit each; the lowest drives"),
        Field("source_levels", "u64", PINS),
    ),
)
USART = Struct(
    "usart",
    "What a USART holds beyond its registers. RM0008 27.3.",
    (
        Field("tx_base_ns", "u64", doc="start of the run of characters,"),
        Field("tx_half_bits", "u64", doc="and half-bits from there to the end of the present one"),
        *_fields("u64", "tx_due_ns", "rx_base_ns", "rx_half_bits", "rx_due_ns", "idle_due_ns", "bit_due_ns"),
        Field("bit_half_bits", "u64", doc="half-bits up to the next bit on the TX pin"),
        Field("clock_hz", "u32", doc="the PCLK that the deadlines were worked out with"),
        Field("was_enabled", "u32", doc="whether transmission was on at the last write of a control register"),
        Field("rate_pc", "u32", doc="the instruction that has set the speed"),
        Field("judged_hz", "u32", doc="the speed that was judged last"),
        *_fields("u32", "judged_brr", "source"),
        Field("tx_pin", "u32", doc="16 times the port, and the pin"),
        *_fields("u32", "rx_pin", "rx_first", "rx_count"),
        *_fields("u32", "cts_pin", "rts_pin"),
        Field("rts", "u32", doc="the level that nRTS was last given"),
        Field("rx_waits", "u32", doc="the far end waits for nRTS"),
        Field("bits", "u32", doc="bits of a character to come on the TX pin, and a mark above them; 0: nobody looks"),
        Field("rx_more", "u32", doc="Python has more characters to come"),
        Field("ck_due_ns", "u64", doc="the next edge of the clock on CK,"),
        Field("ck_half_bits", "u64", doc="and half-bits up to it"),
        Field("ck_edges", "u32", doc="edges to come; 0: nobody looks"),
        *_fields("u32", "ck_pin"),
        Field("ck", "u32", doc="the level that CK was last given"),
        Field("ck_count", "u32", doc="bits of RX that edges of a character have taken,"),
        Field("ck_word", "u32", doc="and they"),
        *_fields("u32", "ck_end"),
        Field("rx", "u32", RECEIVED, "what DR will read, and above it the flags of SR"),
    ),
)
#: chosen: bytes that a part on an SPI may say ahead.
AHEAD_BYTES = 256
SPI = Struct(
    "spi",
    "What an SPI holds beyond its registers. RM0008 25.3.",
    (
        Field("base_ns", "u64", doc="start of the run of words,"),
        Field("ticks", "u64", doc="and ticks of `rate_hz` from there to the end of the present one"),
        Field("word_ns", "u64", doc="when the present word began,"),
        Field("word_at_ticks", "u64", doc="and how many ticks from `base_ns` that was, for who looks at its bits"),
        Field("clock_hz", "u32", doc="PCLK"),
        Field("rate_hz", "u32", doc="PCLK, or the clock of a master outside"),
        Field("shift", "u32", doc="what is in the shift register; 0: nothing"),
        *_fields("u32", "tdr", "rdr"),
        Field("seen", "u32", doc="flags of which half of the clearing sequence was seen"),
        Field("source", "u32", doc="its first alternate function; MISO, MOSI, NSS and SCK follow each other,"),
        Field("pins", "u32", 4, "and so do these: 16 times the port, and the pin"),
        Field("offered", "u32", 4, "the levels that they were last given"),
        Field("selects", "u32", PORTS, "pins that select parts"),
        Field("is_looped", "u32", doc="MISO is tied to MOSI"),
        Field("selected", "u32", doc="parts that are selected"),
        Field("far", "u32", doc="the word that a master outside sends; 0: none"),
        Field("wants_words", "u32", doc="somebody has subscribed to words"),
        Field("ahead_count", "u32", doc="how many bytes the part has said ahead,"),
        Field("ahead_at", "u32", doc="and how many of them have gone over;"),
        Field("ahead_cr1", "u32", doc="they hold while this is CR1,"),
        Field("ahead_sent", "u32", doc="and while this is sent: above 0xFF whatever is"),
        Field("ahead", "u8", AHEAD_BYTES),
        Field("is_stopped", "u32", doc="its clock stands still"),
        Field("halves", "u32", doc="half-bits of the word that is shown on the pins,"),
        Field("half_ticks", "u32", doc="what each of them lasts,"),
        Field("half", "u32", doc="and the next one; 0: nobody looks"),
    ),
)
I2C = Struct(
    "i2c",
    "What an I2C holds beyond its registers. RM0008 26.3.",
    (
        Field("base_ns", "u64", doc="start of the run of bits,"),
        Field("ticks", "u64", doc="and ticks of `rate_hz` from there to the end of what is under way"),
        Field("due_ns", "u64", doc="which is this; all ones: nothing is"),
        Field("timeout_ns", "u64", doc="when SCL will have been low for too long"),
        Field("clock_hz", "u32", doc="PCLK1"),
        Field("rate_hz", "u32", doc="PCLK1, or the bits a second of a master outside"),
        *_fields("u32", "phase", "shift", "tdr", "rdr"),
        Field("received", "u32", doc="a byte behind the one in DR; 0: none"),
        Field("next_ack", "u32", doc="ACK as it was when the byte before ended, for POS"),
        *_fields("u32", "was_refused", "has_sent", "is_second", "is_pec", "is_lost", "is_late", "is_own"),
        Field("far", "u32", doc="what a master outside does next; 0: nothing"),
        Field("far_waits", "u32", doc="it will, once the bus is free"),
        Field("header", "u32", doc="the 10-bit header that it has sent matched"),
        Field("lines", "u32", doc="lines that are low: SCL, SDA, SMBA"),
        Field("source", "u32", doc="its first alternate function; SCL and SDA follow each other, then SMBA"),
        *_fields("u32", "smba_source", "has_parts"),
        Field("pins", "u32", 3, "SCL, SDA, SMBA: 16 times the port, and the pin"),
        Field("offered", "u32", 3, "the levels that they were last given"),
        Field("counter", "u32", doc="address of CNDTR of the DMA channel that it receives by"),
        Field("far_hz", "u32", doc="bits a second of a master outside"),
        Field("is_stopped", "u32", doc="1: its clock stands still; 2: that of the timeout does"),
        Field("wants_words", "u32", doc="somebody has subscribed to what is on the bus"),
        Field("stopped_ns", "u64", doc="since when: times of what comes meanwhile are this one"),
        Field(
            "answer", "u32", doc="what the part made of the byte that is sent, before its acknowledge; 0: not asked yet"
        ),
        Field("incoming", "u32", doc="the byte that a part sends"),
        Field("show", "u32", doc="1 + the next step of what is shown on the pins; 0: nobody looks"),
        Field("show_ns", "u64", doc="when that is due"),
        Field("shown_from", "u64", doc="ticks from `base_ns` to the begin of what is shown"),
    ),
)
EXTI = Struct("exti", "What EXTI holds beyond its registers.", (Field("levels", "u32"), Field("routes", "u8", PINS)))
DMA = Struct(
    "dma",
    "What a DMA controller holds beyond its registers. RM0008 13.3.",
    (
        Field("base_ns", "u64", doc="start of the transfers that follow each other without a gap,"),
        Field("cycles", "u64", doc="and cycles of HCLK from there to the end of the one under way"),
        *_fields("u32", "hz", "apb1_cycles", "apb2_cycles"),
        Field("current", "u32", doc="1 + the channel whose transfer is under way; 0: none"),
        Field("ready", "u32", doc="channels that are enabled and have something left,"),
        Field("unasked", "u32", doc="those that need no request,"),
        Field("lines", "u32", doc="those whose request is high,"),
        Field("latched", "u32", doc="and those of which a request has come"),
        *(Field(name, "u32", 7) for name in ("peripheral", "memory", "reload")),
        Field("padding", "u32"),
    ),
)
SIGNAL = Struct(
    "signal",
    "Volts on a pin, from outside: `bluepill_sim/fabric/signals.py`.",
    (
        Field("start_ns", "u64", doc="when it began,"),
        Field("phase_ns", "u64", doc="at this place of its period"),
        Field("period_ns", "u64"),
        Field("interval_ns", "u64", doc="between two samples; of a square wave, how long it is high"),
        *_fields("i32", "low_uv", "high_uv"),
        Field("shape", "u32", doc="0: none, the pin has its logic level"),
        Field("is_repeated", "u32"),
        Field("count", "u32", doc="samples, which stand elsewhere"),
        Field("padding", "u32"),
    ),
)
ANALOG = Struct(
    "analog",
    "The analog side of a chip.",
    (
        Field("vdda_uv", "u32"),
        Field("temperature_mc", "i32", doc="of the chip, in thousandths of a degree Celsius"),
        Field("signals", "signal", ANALOG_PINS),
    ),
)
ADC = Struct(
    "adc",
    "What an ADC holds beyond its registers. RM0008 11.3.",
    (
        Field("base_ns", "u64", doc="start of the run of conversions,"),
        Field("cycles", "u64", doc="and cycles of PCLK2 from there to the end of the present one"),
        *_fields("u64", "sample_ns", "end_ns"),
        Field("ready_ns", "u64", doc="no conversion begins earlier"),
        Field("calibrated_ns", "u64", doc="when CAL and RSTCAL fall"),
        Field("hz", "u32", doc="PCLK2,"),
        Field("divider", "u32", doc="and what ADCCLK is divided by"),
        Field("number", "u32", doc="1 or 2"),
        Field("remapped", "u32", doc="bit 0: the regular group's EXTI trigger is TIM8's, bit 1: the injected one's"),
        Field("state", "u32", doc="which group is being converted"),
        *_fields("u32", "channel", "has_sample", "sample"),
        Field("regular_at", "u32", doc="rank in the sequence,"),
        Field("regular_left", "u32", doc="and conversions that are left of this trigger"),
        Field("regular_waits", "u32", doc="for the end of the injected group"),
        *_fields("u32", "injected_at", "injected_left"),
        Field("is_automatic", "u32", doc="the injected group follows the regular one"),
        Field("turns", "u32", doc="triggers that alternate, modulo 2"),
        Field("is_stopped", "u32", doc="its clock stands still: Stop mode"),
        Field("warned", "u32", 6, "by question: channels that were warned of"),
    ),
)
GPIO = Struct(
    "gpio",
    "Which port a GPIO is, and what is known of its pins, a bit each. RM0008 9.2.",
    (
        Field("port", "u32"),
        Field("base", "u32", doc="the address of its registers"),
        Field("locked", "u32", doc="configuration frozen until reset"),
        Field("intended", "u32", doc="made floating inputs on purpose, and where"),
        Field("claimed", "u32", doc="configured while they belong to another, and where"),
        *_fields("u32", "warned", "reported"),
        Field("intended_pc", "u32", PINS),
        Field("claimed_pc", "u32", PINS),
    ),
)
RCC = Struct("rcc", "What RCC tells Python of.", (Field("watches_gates", "u32", doc="each write of a clock gate"),))
FILTER = Struct(
    "filter",
    "A digital filter of an input. RM0008 14.4.7, IC1F.",
    (
        Field("sampled", "u64", doc="the tick up to which samples were taken"),
        Field("raw", "u8", doc="the level in front of it,"),
        Field("out", "u8", doc="and behind"),
        Field("count", "u8", doc="samples so far that differ from `out`"),
        Field("padding", "u8"),
        Field("period", "u32", doc="ticks from sample to sample,"),
        Field("length", "u32", doc="so many of which change `out`; 0: it passes everything"),
        Field("end", "u32"),
    ),
)
SHAPE = Struct(
    "shape",
    "What an output of a timer shows: a level, a wave, or nothing.",
    (
        Field("period", "u64", doc="in ticks,"),
        Field("high", "u64", doc="of which it is so many at 1"),
        Field("edge", "u64", doc="a tick of a rising edge, modulo the period"),
        Field("kind", "u32", doc="nothing, low, high, a wave (`tim.h`)"),
        Field("padding", "u32"),
    ),
)
TIM = Struct(
    "tim",
    "What a timer holds beyond its registers. RM0008 14, 15.",
    (
        Field("ramp", "ramp", doc="CNT, in ticks"),
        Field("ticks", "ticks", doc="of CK_INT"),
        Field("at", "u64", doc="the tick up to which all is worked out"),
        Field("idle_at", "u64", doc="the tick at which outputs go to OISx; all ones: none is to come"),
        Field(
            "edge_at", "u64", 3, "the tick at which OC1REF to OC3REF last changed before they were what they are now,"
        ),
        Field("shaped_at", "u64", 3, "since when they are that,"),
        Field("written_at", "u64", doc="when a register was written last: the references of that tick came before"),
        Field("starts", "u64", doc="the first tick that its own clock may count: one after CEN"),
        Field("born", "u64", 3, "of a wave the tick of its last edge before, which there was not,"),
        Field("turns_at", "u64", 3, "and of the first that there is"),
        Field("filters", "filter", 5, "TI1 to TI4, ETR"),
        Field("outputs", "shape", 7, "CH1 to CH4, CH1N to CH3N"),
        Field("references", "shape", 3, "OC1REF to OC3REF, for the dead time"),
        Field("base", "u32", doc="the address of its registers"),
        *_fields("u32", "psc", "arr"),
        Field("ccr", "u32", 4, "active registers, behind the preload registers"),
        Field("ccer", "u32", doc="the same of CCPC"),
        Field("ccmr", "u32", 2),
        Field("repetitions", "u32", doc="overflows before the next update event"),
        Field("psc_count", "u32", doc="of the prescaler while no clock of its own drives it"),
        Field("captures", "u8", 4, "events in the prescaler of an input"),
        Field("latched", "u32", doc="OCxREF where it does not follow from CNT, a bit each"),
        Field("cleared", "u32", doc="OCxREF that ETRF has cleared"),
        Field("armed", "u32", doc="flags of SR whose rising is an event, because the program looks for them"),
        Field("itr", "u32", doc="levels of the internal triggers"),
        *_fields("u8", "trgi", "trgo", "in_break"),
        Field("is_busy", "u8", doc="what it puts out may come back to it: pulses are not taken,"),
        Field("late_at", "u64", doc="and levels at this tick, the next one; 0: none has come back"),
        Field("pulses", "u32", doc="outputs that give a pulse at the end of what happens now"),
        Field("listening", "u32", doc="bits of `pins` that are listened to,"),
        Field("hears", "u32", doc="and of the internal triggers"),
        *_fields("u32", "etr_was", "etr_edges"),
        Field("burst_index", "u32", doc="the next register of a burst,"),
        Field("burst_left", "u32", doc="transfers that are still to be asked for,"),
        Field("burst_output", "u32", doc="by this output"),
        Field("lock", "u32", doc="LOCK, once it was written"),
        Field("is_advanced", "u32", doc="it is TIM1"),
        Field("is_stopped", "u32", doc="its clock stands still"),
        Field("padding", "u32"),
        Field("pins", "u8", 9, "CH1 to CH4, CH1N to CH3N, ETR, BKIN"),
        Field("sources", "u8", 7, "the alternate functions of the first seven"),
    ),
)
WAVE = Struct(
    "wave",
    "A level that goes up every `period` ticks, and down `high` ticks later.",
    (
        Field("ns", "u64", doc="when tick 0 begins; tick n begins floor(n * 10**9 / hz) ns later"),
        Field("at", "u64", doc="ticks from a rising edge to tick 0, less than the period"),
        Field("period", "u64", doc="in ticks; 0: there is no wave"),
        Field("high", "u64", doc="of them at level 1, more than 0 and less than the period"),
        Field("hz", "u32", doc="ticks a second: the clock of who makes it"),
        Field("pin", "u32", doc="on which it is offered"),
        Field("padding", "u64"),
    ),
)
EDGE = Struct(
    "edge",
    "A change of a pin, for who has subscribed: `bluepill_sim/fabric/subscriptions.py`.",
    (Field("ns", "u64"), *_fields("u8", "pin", "drive", "wire", "kind"), Field("zero", "u32")),
)
INPUT_ROWS = Struct(
    "inputs",
    "Levels that the outside puts on pins later: a ring, oldest first.",
    (*_fields("u32", "first", "count"), Field("padding", "u64"), Field("rows", "edge", LATER_INPUTS)),
)
#: More than a frame has bits, from its start to behind its error flag.
CAN_BITS_ROWS = 192
CAN_BITS = Struct(
    "can_bits",
    "Levels of CAN's pins to come: rows whose drive is TX, whose wire is RX and whose time counts from `shown_ns`, "
    "those from `first` on; and a frame that is tried over and over: the phase of the try that begins at `start_ns`.",
    (
        *_fields("u32", "first", "count", "tx_pin", "source", "rx_pin", "is_offered", "tx", "phase"),
        *_fields("u64", "shown_ns", "start_ns", "decided_ns", "end_ns", "period_ns", "padding"),
        Field("rows", "edge", CAN_BITS_ROWS),
    ),
)
SENT = Struct(
    "sent",
    "A word that has gone out, when, and how: clock and divider, and what else its device says of its format.",
    (Field("ns", "u64"), *_fields("u32", "word", "clock_hz", "brr", "format")),
)

#: All of them; one that holds another comes behind it.
STRUCTS = (
    RECORD, INSTRUCTION, RAMP, TICKS, STEP, LOOP, FAULT, SHARED, PORT, USART, EXTI, DMA, SIGNAL, ANALOG, ADC, GPIO, RCC,
    FILTER, SHAPE, TIM, SPI, I2C, WAVE, EDGE, INPUT_ROWS, CAN_BITS, SENT,
)  # fmt: skip

_KINDS: dict[str, Any] = {
    "u8": ctypes.c_uint8, "u16": ctypes.c_uint16, "u32": ctypes.c_uint32, "u64": ctypes.c_uint64, "i32": ctypes.c_int32,
}  # fmt: skip


#: The letters of the module `struct`.
_LETTERS = {"u8": "B", "u16": "H", "u32": "I", "u64": "Q", "i32": "i"}


@cache
def structure(struct: Struct) -> type[ctypes.Structure]:
    """Return the ctypes class of a struct."""
    rows = []
    for field in struct.fields:
        inner = _KINDS.get(field.kind) or structure(next(one for one in STRUCTS if one.name == field.kind))
        rows.append((field.name, inner if field.count is None else inner * field.count))
    return type(struct.name, (ctypes.Structure,), {"_fields_": rows, "__doc__": struct.doc})


@cache
def packing(struct: Struct) -> Packing:
    """Return how rows of a struct without arrays lie in bytes, which `iter_unpack` reads faster than ctypes does."""
    made = Packing("=" + "".join(_LETTERS[field.kind] for field in struct.fields))
    if made.size != ctypes.sizeof(structure(struct)):
        raise ValueError(f"{struct.name} has gaps: name them")
    return made


def header() -> str:
    """Return the structs as a C header."""
    lines = [
        "/* The structs that C and Python share: made by tools/generate_chip.py from extension/layout.py. */",
        "#ifndef BLUEPILL_LAYOUT_H",
        "#define BLUEPILL_LAYOUT_H",
        "",
        "#include <stdint.h>",
        "",
        *(f"#define {name} {value}" for name, value in _CONSTANTS.items()),
        *(f"#define {name} {value:#x}u" for name, value in _ADDRESSES.items()),
    ]
    for struct in STRUCTS:
        lines += ["", f"/* {struct.doc} */", f"struct {struct.name} {{"]
        for field in struct.fields:
            count = "" if field.count is None else f"[{field.count}]"
            comment = f" /* {field.doc} */" if field.doc else ""
            lines.append(f"    {_C_KINDS.get(field.kind, f'struct {field.kind}')} {field.name}{count};{comment}")
        lines += ["};", f'_Static_assert(sizeof(struct {struct.name}) == {_size(struct)}, "{struct.name}");']
    return "\n".join([*lines, "", "#endif", ""])


def _size(struct: Struct) -> int:
    return ctypes.sizeof(structure(struct))


_CONSTANTS = {"PORTS": PORTS, "PINS": PINS, "SOURCES": SOURCES, "LAST_ROWS": LAST_ROWS, "RECEIVED": RECEIVED,
    "ANALOG_PINS": ANALOG_PINS, "LATER_INPUTS": LATER_INPUTS,
}  # fmt: skip
_ADDRESSES = {"NOWHERE": NOWHERE, "VIEW_BYTES": VIEW_BYTES, "VIEWS_BASE": VIEWS_BASE, "VIEWS_BYTES": VIEWS_BYTES}
_C_KINDS = {"u8": "uint8_t", "u16": "uint16_t", "u32": "uint32_t", "u64": "uint64_t", "i32": "int32_t"}
