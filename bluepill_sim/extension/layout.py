"""The structs that C and Python share, declared once.

`tools/generators/chip.py` writes them as `source/fabric/layout.h`; `structure` makes the ctypes class of the same
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
class StructMember:
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
    fields: tuple[StructMember, ...]


def _fields(kind: str, *names: str) -> tuple[StructMember, ...]:
    return tuple(StructMember(name, kind) for name in names)


RECORD = Struct(
    "record",
    "A block that began, an exception that was entered (its number) or left (-1).",
    (StructMember("cycle", "u64"), StructMember("address", "u32"), StructMember("kind", "i32")),
)
INSTRUCTION = Struct(
    "instruction",
    "An instruction of a block: where it starts in time, and which memory it reaches for.",
    (
        StructMember("address", "u32"),
        StructMember("cycle", "u32"),
        StructMember("offset", "i32"),
        StructMember("kind", "u8", doc="0: no access of interest, 1: load, 2: store"),
        *_fields("u8", "bytes", "base"),
        StructMember("index", "u8", doc="255: none"),
        StructMember("shift", "u8"),
        StructMember("count", "u8", doc="words of a multiple transfer, else 1"),
        StructMember("gives_up", "u8", doc="an exception that comes in it leaves it undone"),
        StructMember("padding", "u8"),
    ),
)
MEASURED = Struct(
    "measured",
    "An instruction as the models of time and of faults need it, and when in its block it begins.",
    (
        StructMember("address", "u32"),
        StructMember("destination", "u32", doc="of a direct branch"),
        StructMember("cycle", "u32", doc="from the start of its block"),
        StructMember("kind", "u8", doc="`enum kind`"),
        StructMember("bytes", "u8"),
        StructMember("count", "u8", doc="registers that a multiple transfer moves"),
        StructMember("loads_pc", "u8", doc="it writes the PC although its kind does not say so"),
        StructMember("base", "u8", doc="register of an access, or the divisor of a division; 255: does not matter"),
        StructMember("index", "u8", doc="255: none"),
        StructMember("target", "u8", doc="register that a load fills; 255: none"),
        *_fields("u8", "has_destination"),
        StructMember("always_branches", "u8", doc="a direct branch, but for an IT before it"),
        StructMember("sets_it", "u8", doc="what an IT makes of ITSTATE"),
        StructMember("it_state", "u8", doc="before it, by an IT of its block"),
        StructMember("gives_up", "u8", doc="an exception that comes in it leaves it undone"),
    ),
)
BLOCK_COST = Struct(
    "block_cost",
    "What a block costs in cycles: where it goes on at its end, and elsewhere.",
    (*_fields("u32", "straight", "taken", "count"), StructMember("flags", "u32", doc="`enum row_flag`")),
)
RAMP = Struct(
    "ramp",
    "A counter that follows from the time: `source/fabric/ramp.c`.",
    (
        StructMember("base", "u64", doc="when it had `value`, in the units of its owner,"),
        StructMember("value", "u32"),
        StructMember("divider", "u32", doc="so many of which make it count once;"),
        StructMember("top", "u32", doc="its limit: 0 and this are neighbours"),
        *_fields("u8", "runs", "falls"),
        StructMember("mirrors", "u8", doc="it turns round at both"),
        StructMember("padding", "u8"),
    ),
)
TICKS = Struct(
    "ticks",
    "A clock that is counted from where the core's was last changed.",
    (
        StructMember("ns", "u64", doc="when"),
        StructMember("tick", "u64", doc="begins; each one after it at floor(n * 10**9 / hz) ns"),
        StructMember("hz", "u32"),
        StructMember("padding", "u32"),
    ),
)
STEP = Struct(
    "step",
    "What one instruction of a polling loop makes of the value that it has read.",
    (
        *_fields("u8", "operation", "is_register", "is_flags_only", "padding"),
        StructMember("operand", "u32", doc="or its register"),
    ),
)
LOOP = Struct(
    "loop",
    "A block that reads one word, computes with it and what never changes, and goes round while a condition holds.",
    (
        StructMember("read_cycle", "u32", doc="from the start of the block"),
        StructMember("offset", "u32"),
        *_fields("u8", "base", "condition", "count", "padding"),
        StructMember("steps", "step", 6),
    ),
)
FAULT = Struct(
    "fault",
    "A HardFault that was entered here, for Python to report: the core as it was before.",
    (
        *_fields("u64", "ns", "logged"),
        StructMember("kind", "u32", doc="number of its halt"),
        *_fields("u32", "pc", "address", "has_address", "exception_number"),
        StructMember("vector", "u32", doc="of the handler that ran"),
        StructMember("registers", "u32", 16, "R0 to R12, SP, LR, xPSR"),
        StructMember("last_ns", "u64", doc="when its handler last came back to it with nothing changed,"),
        StructMember("round_ns", "u64", doc="how long that took,"),
        StructMember("returns", "u32", doc="and how often"),
        StructMember("is_other", "u32", doc="another one came before it in this run"),
        StructMember("last", "record", LAST_ROWS),
    ),
)
SHARED = Struct(
    "shared",
    "The state of one core.",
    (
        *_fields("u64", "cycle", "stop_at", "access_cycle", "last_sleep_cycle", "tick_next"),
        *(StructMember(name, "u64", 2, "a bit an exception") for name in ("pending", "active", "held")),
        *_fields("u64", "enabled", "levels"),
        *_fields("u32", "access_pc", "in_access", "pc", "is_thumb", "mask_stop", "attention"),
        *_fields("u32", "halt_kind", "halt_pc", "halt_address", "halt_has_address", "run_from", "uses_exclusive"),
        *_fields("u32", "exception_number", "sleep", "event_register", "vector_table", "scr", "ccr"),
        *_fields("u32", "tick_control", "tick_count_flag"),
        *_fields("u32", "traps_division", "grouping", "it_state", "is_python"),
        StructMember("is_first", "u32", doc="the recorder has not had a row yet"),
        StructMember("raised_pc", "u32", doc="the access that raised the last exception: its instruction,"),
        StructMember("raised_cycle", "u64", doc="and when its block began"),
        StructMember("priorities", "u8", EXCEPTIONS, "one an exception"),
        StructMember("priorities_end", "u8", 4),
        *(StructMember(name, "u64", doc="set by Python before the first run") for name in ("sram", "flash")),
        *_fields("u32", "sram_base", "sram_bytes", "flash_base", "flash_bytes", "scratch", "padding"),
        StructMember(
            "exact_stops", "u64", doc="how often a run was stopped to learn which instruction makes an access"
        ),
        StructMember("logged", "u64", doc="rows so far: the next one goes to `last` at this, modulo its size"),
        *_fields("u32", "shcsr", "cfsr", "hfsr", "mmfar", "bfar", "demcr", "dbgmcu_cr"),
        *_fields("u32", "dfsr", "actlr", "dwt_control", "fp_control", "fp_remap"),
        *_fields("u32", "itm_enables", "itm_privileges", "itm_control", "itm_is_open"),
        *_fields("u32", "tpiu_size", "tpiu_prescaler", "tpiu_protocol", "tpiu_formatter"),
        StructMember("dwt_counts", "u32", 5, "CPICNT, EXCCNT, SLEEPCNT, LSUCNT, FOLDCNT: they only store"),
        *(StructMember(name, "u32", 4) for name in ("dwt_comp", "dwt_mask", "dwt_function")),
        StructMember("fp_comp", "u32", 8, "six of instructions, two of literals"),
        StructMember("tick", "ramp", doc="SysTick's counter: its limit is the reload value"),
        StructMember("cyccnt", "ramp"),
        StructMember("hears_ticks", "u32", doc="Python wants to know when SysTick is set"),
        StructMember("has_debugger", "u32", doc="Python sees to BKPT and HardFaults"),
        StructMember("knows_masked_svc", "u32", doc="Python was notified of an SVC that its priority does not allow"),
        StructMember("has_fault", "u32", doc="`fault` waits for Python"),
        StructMember("waits", "u32", doc="the block ends before its next access: the flash cannot give more code now"),
        StructMember("waits_end", "u32"),
        StructMember(
            "bus_error_cycle", "u64", doc="when the error of a buffered store comes; all ones: none is on its way"
        ),
        *_fields("u32", "bus_error_pc", "bus_error_address"),
        StructMember("fault", "fault"),
        StructMember("last", "record", LAST_ROWS),
    ),
)
PORT = Struct(
    "port",
    "The pins of one port, a bit each. RM0008 9.1, table 20.",
    (
        *_fields("u32", "bonded", "board_up", "board_down"),
        StructMember("outside", "u32", doc="driven from outside,"),
        StructMember("outside_high", "u32", doc="to 1,"),
        StructMember("outside_weak", "u32", doc="by a resistor"),
        *_fields("u32", "rail", "rail_high"),
        StructMember("bus_low", "u32", doc="held low by a part on a bus, whose bits somebody looks at"),
        StructMember("odr", "u32", doc="what GPIO has configured: the data bits,"),
        StructMember("output", "u32", doc="general-purpose outputs,"),
        StructMember("alternate", "u32", doc="outputs of an alternate function,"),
        StructMember("open_drain", "u32", doc="those of both that cannot drive high,"),
        *_fields("u32", "pulled", "analog"),
        StructMember("offered", "u32", doc="some alternate function offers a level,"),
        StructMember("offered_high", "u32", doc="which is 1"),
        StructMember("waving", "u32", doc="or a wave"),
        StructMember("held", "u32", doc="kept off GPIO, and what drives then"),
        *_fields("u32", "hold_low", "hold_high", "hold_up", "hold_down"),
        StructMember("low", "u32", doc="what the chip itself drives"),
        *_fields("u32", "high", "up", "down"),
        StructMember("level", "u32", doc="on the wire; a floating wire is low"),
        StructMember("input", "u32", doc="what the digital input reads"),
        *_fields("u32", "floating", "fighting", "shorted"),
        StructMember(
            "shown", "u32", doc="pins that show a wave: what stands above of them is as of their last edge made"
        ),
        StructMember("modes", "u8", PINS, "index in `PinMode`"),
        StructMember(
            "sources", "u64", PINS, "the alternate functions that offer a level, a bit each; the lowest drives"
        ),
        StructMember("source_levels", "u64", PINS),
    ),
)
USART = Struct(
    "usart",
    "What a USART holds beyond its registers. RM0008 27.3.",
    (
        StructMember("tx_base_ns", "u64", doc="start of the run of characters,"),
        StructMember("tx_half_bits", "u64", doc="and half-bits from there to the end of the present one"),
        *_fields("u64", "tx_due_ns", "rx_base_ns", "rx_half_bits", "rx_due_ns", "idle_due_ns", "bit_due_ns"),
        StructMember("bit_half_bits", "u64", doc="half-bits up to the next bit on the TX pin"),
        StructMember("clock_hz", "u32", doc="the PCLK that the deadlines were worked out with"),
        StructMember("was_enabled", "u32", doc="whether transmission was on at the last write of a control register"),
        StructMember("rate_pc", "u32", doc="the instruction that has set the speed"),
        StructMember("judged_hz", "u32", doc="the speed that was judged last"),
        *_fields("u32", "judged_brr", "source"),
        StructMember("tx_pin", "u32", doc="16 times the port, and the pin"),
        *_fields("u32", "rx_pin", "rx_first", "rx_count"),
        *_fields("u32", "cts_pin", "rts_pin"),
        StructMember("rts", "u32", doc="the level that nRTS was last given"),
        StructMember("rx_waits", "u32", doc="the far end waits for nRTS"),
        StructMember(
            "bits", "u32", doc="bits of a character to come on the TX pin, and a mark above them; 0: nobody looks"
        ),
        StructMember("rx_more", "u32", doc="Python has more characters to come"),
        StructMember("ck_due_ns", "u64", doc="the next edge of the clock on CK,"),
        StructMember("ck_half_bits", "u64", doc="and half-bits up to it"),
        StructMember("ck_edges", "u32", doc="edges to come; 0: nobody looks"),
        *_fields("u32", "ck_pin"),
        StructMember("ck", "u32", doc="the level that CK was last given"),
        StructMember("ck_count", "u32", doc="bits of RX that edges of a character have taken,"),
        StructMember("ck_word", "u32", doc="and they"),
        *_fields("u32", "ck_end"),
        StructMember("rx", "u32", RECEIVED, "what DR will read, and above it the flags of SR"),
    ),
)
#: chosen: bytes that a part on an SPI may say ahead.
AHEAD_BYTES = 256
SPI = Struct(
    "spi",
    "What an SPI holds beyond its registers. RM0008 25.3.",
    (
        StructMember("base_ns", "u64", doc="start of the run of words,"),
        StructMember("ticks", "u64", doc="and ticks of `rate_hz` from there to the end of the present one"),
        StructMember("word_ns", "u64", doc="when the present word began,"),
        StructMember(
            "word_at_ticks", "u64", doc="and how many ticks from `base_ns` that was, for who looks at its bits"
        ),
        StructMember("clock_hz", "u32", doc="PCLK"),
        StructMember("rate_hz", "u32", doc="PCLK, or the clock of a master outside"),
        StructMember("shift", "u32", doc="what is in the shift register; 0: nothing"),
        *_fields("u32", "tdr", "rdr"),
        StructMember("seen", "u32", doc="flags of which half of the clearing sequence was seen"),
        StructMember("source", "u32", doc="its first alternate function; MISO, MOSI, NSS and SCK follow each other,"),
        StructMember("pins", "u32", 4, "and so do these: 16 times the port, and the pin"),
        StructMember("offered", "u32", 4, "the levels that they were last given"),
        StructMember("selects", "u32", PORTS, "pins that select parts"),
        StructMember("is_looped", "u32", doc="MISO is tied to MOSI"),
        StructMember("selected", "u32", doc="parts that are selected"),
        StructMember("far", "u32", doc="the word that a master outside sends; 0: none"),
        StructMember("wants_words", "u32", doc="somebody has subscribed to words"),
        StructMember("ahead_count", "u32", doc="how many bytes the part has said ahead,"),
        StructMember("ahead_at", "u32", doc="and how many of them have gone over;"),
        StructMember("ahead_cr1", "u32", doc="they hold while this is CR1,"),
        StructMember("ahead_sent", "u32", doc="and while this is sent: above 0xFF whatever is"),
        StructMember("ahead", "u8", AHEAD_BYTES),
        StructMember("is_stopped", "u32", doc="its clock stands still"),
        StructMember("halves", "u32", doc="half-bits of the word that is shown on the pins,"),
        StructMember("half_ticks", "u32", doc="what each of them lasts,"),
        StructMember("half", "u32", doc="and the next one; 0: nobody looks"),
    ),
)
I2C = Struct(
    "i2c",
    "What an I2C holds beyond its registers. RM0008 26.3.",
    (
        StructMember("base_ns", "u64", doc="start of the run of bits,"),
        StructMember("ticks", "u64", doc="and ticks of `rate_hz` from there to the end of what is under way"),
        StructMember("due_ns", "u64", doc="which is this; all ones: nothing is"),
        StructMember("timeout_ns", "u64", doc="when SCL will have been low for too long"),
        StructMember("clock_hz", "u32", doc="PCLK1"),
        StructMember("rate_hz", "u32", doc="PCLK1, or the bits a second of a master outside"),
        *_fields("u32", "phase", "shift", "tdr", "rdr"),
        StructMember("received", "u32", doc="a byte behind the one in DR; 0: none"),
        StructMember("next_ack", "u32", doc="ACK as it was when the byte before ended, for POS"),
        *_fields("u32", "was_refused", "has_sent", "is_second", "is_pec", "is_lost", "is_late", "is_own"),
        StructMember("far", "u32", doc="what a master outside does next; 0: nothing"),
        StructMember("far_waits", "u32", doc="it will, once the bus is free"),
        StructMember("header", "u32", doc="the 10-bit header that it has sent matched"),
        StructMember("lines", "u32", doc="lines that are low: SCL, SDA, SMBA"),
        StructMember("source", "u32", doc="its first alternate function; SCL and SDA follow each other, then SMBA"),
        *_fields("u32", "smba_source", "has_parts"),
        StructMember("pins", "u32", 3, "SCL, SDA, SMBA: 16 times the port, and the pin"),
        StructMember("offered", "u32", 3, "the levels that they were last given"),
        StructMember("counter", "u32", doc="address of CNDTR of the DMA channel that it receives by"),
        StructMember("far_hz", "u32", doc="bits a second of a master outside"),
        StructMember("is_stopped", "u32", doc="1: its clock stands still; 2: that of the timeout does"),
        StructMember("wants_words", "u32", doc="somebody has subscribed to what is on the bus"),
        StructMember("stopped_ns", "u64", doc="since when: times of what comes meanwhile are this one"),
        StructMember(
            "answer", "u32", doc="what the part made of the byte that is sent, before its acknowledge; 0: not asked yet"
        ),
        StructMember("incoming", "u32", doc="the byte that a part sends"),
        StructMember("show", "u32", doc="1 + the next step of what is shown on the pins; 0: nobody looks"),
        StructMember("show_ns", "u64", doc="when that is due"),
        StructMember("shown_from", "u64", doc="ticks from `base_ns` to the begin of what is shown"),
    ),
)
EXTI = Struct(
    "exti", "What EXTI holds beyond its registers.", (StructMember("levels", "u32"), StructMember("routes", "u8", PINS))
)
DMA = Struct(
    "dma",
    "What a DMA controller holds beyond its registers. RM0008 13.3.",
    (
        StructMember("base_ns", "u64", doc="start of the transfers that follow each other without a gap,"),
        StructMember("cycles", "u64", doc="and cycles of HCLK from there to the end of the one under way"),
        *_fields("u32", "hz", "apb1_cycles", "apb2_cycles"),
        StructMember("current", "u32", doc="1 + the channel whose transfer is under way; 0: none"),
        StructMember("ready", "u32", doc="channels that are enabled and have something left,"),
        StructMember("unasked", "u32", doc="those that need no request,"),
        StructMember("lines", "u32", doc="those whose request is high,"),
        StructMember("latched", "u32", doc="and those of which a request has come"),
        *(StructMember(name, "u32", 7) for name in ("peripheral", "memory", "reload")),
        StructMember("padding", "u32"),
    ),
)
SIGNAL = Struct(
    "signal",
    "Volts on a pin, from outside: `bluepill_sim/fabric/signals.py`.",
    (
        StructMember("start_ns", "u64", doc="when it began,"),
        StructMember("phase_ns", "u64", doc="at this place of its period"),
        StructMember("period_ns", "u64"),
        StructMember("interval_ns", "u64", doc="between two samples; of a square wave, how long it is high"),
        *_fields("i32", "low_uv", "high_uv"),
        StructMember("shape", "u32", doc="0: none, the pin has its logic level"),
        StructMember("is_repeated", "u32"),
        StructMember("count", "u32", doc="samples, which stand elsewhere"),
        StructMember("padding", "u32"),
    ),
)
ANALOG = Struct(
    "analog",
    "The analog side of a chip.",
    (
        StructMember("vdda_uv", "u32"),
        StructMember("temperature_mc", "i32", doc="of the chip, in thousandths of a degree Celsius"),
        StructMember("signals", "signal", ANALOG_PINS),
    ),
)
ADC = Struct(
    "adc",
    "What an ADC holds beyond its registers. RM0008 11.3.",
    (
        StructMember("base_ns", "u64", doc="start of the run of conversions,"),
        StructMember("cycles", "u64", doc="and cycles of PCLK2 from there to the end of the present one"),
        *_fields("u64", "sample_ns", "end_ns"),
        StructMember("ready_ns", "u64", doc="no conversion begins earlier"),
        StructMember("calibrated_ns", "u64", doc="when CAL and RSTCAL fall"),
        StructMember("hz", "u32", doc="PCLK2,"),
        StructMember("divider", "u32", doc="and what ADCCLK is divided by"),
        StructMember("number", "u32", doc="1 or 2"),
        StructMember(
            "remapped", "u32", doc="bit 0: the regular group's EXTI trigger is TIM8's, bit 1: the injected one's"
        ),
        StructMember("state", "u32", doc="which group is being converted"),
        *_fields("u32", "channel", "has_sample", "sample"),
        StructMember("regular_at", "u32", doc="rank in the sequence,"),
        StructMember("regular_left", "u32", doc="and conversions that are left of this trigger"),
        StructMember("regular_waits", "u32", doc="for the end of the injected group"),
        *_fields("u32", "injected_at", "injected_left"),
        StructMember("is_automatic", "u32", doc="the injected group follows the regular one"),
        StructMember("turns", "u32", doc="triggers that alternate, modulo 2"),
        StructMember("is_stopped", "u32", doc="its clock stands still: Stop mode"),
        StructMember("warned", "u32", 6, "by question: channels that were warned of"),
    ),
)
GPIO = Struct(
    "gpio",
    "Which port a GPIO is, and what is known of its pins, a bit each. RM0008 9.2.",
    (
        StructMember("port", "u32"),
        StructMember("base", "u32", doc="the address of its registers"),
        StructMember("locked", "u32", doc="configuration frozen until reset"),
        StructMember("intended", "u32", doc="made floating inputs on purpose, and where"),
        StructMember("claimed", "u32", doc="configured while they belong to another, and where"),
        *_fields("u32", "warned", "reported"),
        StructMember("intended_pc", "u32", PINS),
        StructMember("claimed_pc", "u32", PINS),
    ),
)
AFIO = Struct(
    "afio",
    "Which pins AFIO keeps from GPIO, a bit each. RM0008 9.3.",
    (StructMember("held", "u32", PORTS), StructMember("swj_cfg", "u32", doc="which cannot be read")),
)
CLOCKS = Struct(
    "clocks",
    "The clock tree's outputs: `bluepill_sim/fabric/clocks.py`.",
    (
        *_fields("u32", "sysclk_hz", "hclk_hz", "pclk1_hz", "pclk2_hz"),
        StructMember("timer1_hz", "u32", doc="of TIM2 to TIM7"),
        StructMember("timer2_hz", "u32", doc="of TIM1 and TIM8"),
        StructMember("usb_hz", "u32", doc="0 while the PLL is off"),
        StructMember("adc_divider", "u32", doc="what PCLK2 is divided by for the ADCs"),
        *_fields("u32", "lsi_hz"),
        StructMember("rtcclk_hz", "u32", doc="0: it stands still"),
        *_fields("u32", "rtc_calibration", "rtc_seconds_shown", "flash_wait_states", "flash_prefetch"),
    ),
)
RCC = Struct(
    "rcc",
    "What RCC holds beyond its registers. RM0008 7.2.",
    (
        StructMember("ready_at", "u64", 5, "when HSI, HSE, PLL, LSE and LSI get ready that are starting"),
        StructMember("python_ns", "u64", doc="when Python next acts"),
        StructMember("watches_gates", "u32", doc="Python is notified of each write of a clock gate"),
        StructMember("shows_clock", "u32", doc="Python has put a clock on MCO's pin"),
        StructMember("hse_hz", "u32", doc="the crystal; 0: there is none"),
        StructMember("crystal_works", "u32"),
        StructMember("keeps_lsi", "u32", doc="IWDG does"),
        StructMember("hsi_hz", "u32", doc="as it is trimmed"),
        StructMember("pll_hz", "u32", doc="whether or not it runs"),
        StructMember("padding", "u32"),
    ),
)
FILTER = Struct(
    "filter",
    "A digital filter of an input. RM0008 14.4.7, IC1F.",
    (
        StructMember("sampled", "u64", doc="the tick up to which samples were taken"),
        StructMember("raw", "u8", doc="the level in front of it,"),
        StructMember("out", "u8", doc="and behind"),
        StructMember("count", "u8", doc="samples so far that differ from `out`"),
        StructMember("padding", "u8"),
        StructMember("period", "u32", doc="ticks from sample to sample,"),
        StructMember("length", "u32", doc="so many of which change `out`; 0: it passes everything"),
        StructMember("end", "u32"),
    ),
)
SHAPE = Struct(
    "shape",
    "What an output of a timer shows: a level, a wave, or nothing.",
    (
        StructMember("period", "u64", doc="in ticks,"),
        StructMember("high", "u64", doc="of which it is so many at 1"),
        StructMember("edge", "u64", doc="a tick of a rising edge, modulo the period"),
        StructMember("kind", "u32", doc="nothing, low, high, a wave (`tim.h`)"),
        StructMember("padding", "u32"),
    ),
)
TIM = Struct(
    "tim",
    "What a timer holds beyond its registers. RM0008 14, 15.",
    (
        StructMember("ramp", "ramp", doc="CNT, in ticks"),
        StructMember("ticks", "ticks", doc="of CK_INT"),
        StructMember("at", "u64", doc="the tick up to which all is worked out"),
        StructMember("idle_at", "u64", doc="the tick at which outputs go to OISx; all ones: none is to come"),
        StructMember(
            "edge_at", "u64", 3, "the tick at which OC1REF to OC3REF last changed before they were what they are now,"
        ),
        StructMember("shaped_at", "u64", 3, "since when they are that,"),
        StructMember(
            "written_at", "u64", doc="when a register was written last: the references of that tick came before"
        ),
        StructMember("starts", "u64", doc="the first tick that its own clock may count: one after CEN"),
        StructMember("born", "u64", 3, "of a wave the tick of its last edge before, which there was not,"),
        StructMember("turns_at", "u64", 3, "and of the first that there is"),
        StructMember("filters", "filter", 5, "TI1 to TI4, ETR"),
        StructMember("outputs", "shape", 7, "CH1 to CH4, CH1N to CH3N"),
        StructMember("references", "shape", 3, "OC1REF to OC3REF, for the dead time"),
        StructMember("base", "u32", doc="the address of its registers"),
        *_fields("u32", "psc", "arr"),
        StructMember("ccr", "u32", 4, "active registers, behind the preload registers"),
        StructMember("ccer", "u32", doc="the same of CCPC"),
        StructMember("ccmr", "u32", 2),
        StructMember("repetitions", "u32", doc="overflows before the next update event"),
        StructMember("psc_count", "u32", doc="of the prescaler while no clock of its own drives it"),
        StructMember("captures", "u8", 4, "events in the prescaler of an input"),
        StructMember("latched", "u32", doc="OCxREF where it does not follow from CNT, a bit each"),
        StructMember("cleared", "u32", doc="OCxREF that ETRF has cleared"),
        StructMember("armed", "u32", doc="flags of SR whose rising is an event, because the program looks for them"),
        StructMember("itr", "u32", doc="levels of the internal triggers"),
        *_fields("u8", "trgi", "trgo", "in_break"),
        StructMember("is_busy", "u8", doc="what it puts out may come back to it: pulses are not taken,"),
        StructMember("late_at", "u64", doc="and levels at this tick, the next one; 0: none has come back"),
        StructMember("pulses", "u32", doc="outputs that give a pulse at the end of what happens now"),
        StructMember("listening", "u32", doc="bits of `pins` that are listened to,"),
        StructMember("hears", "u32", doc="and of the internal triggers"),
        *_fields("u32", "etr_was", "etr_edges"),
        StructMember("burst_index", "u32", doc="the next register of a burst,"),
        StructMember("burst_left", "u32", doc="transfers that are still to be asked for,"),
        StructMember("burst_output", "u32", doc="by this output"),
        StructMember("lock", "u32", doc="LOCK, once it was written"),
        StructMember("is_advanced", "u32", doc="it is TIM1"),
        StructMember("is_stopped", "u32", doc="its clock stands still"),
        StructMember("padding", "u32"),
        StructMember("pins", "u8", 9, "CH1 to CH4, CH1N to CH3N, ETR, BKIN"),
        StructMember("sources", "u8", 7, "the alternate functions of the first seven"),
    ),
)
WAVE = Struct(
    "wave",
    "A level that goes up every `period` ticks, and down `high` ticks later.",
    (
        StructMember("ns", "u64", doc="when tick 0 begins; tick n begins floor(n * 10**9 / hz) ns later"),
        StructMember("at", "u64", doc="ticks from a rising edge to tick 0, less than the period"),
        StructMember("period", "u64", doc="in ticks; 0: there is no wave"),
        StructMember("high", "u64", doc="of them at level 1, more than 0 and less than the period"),
        StructMember("hz", "u32", doc="ticks a second: the clock of who makes it"),
        StructMember("pin", "u32", doc="on which it is offered"),
        StructMember("padding", "u64"),
    ),
)
EDGE = Struct(
    "edge",
    "A change of a pin, for who has subscribed: `bluepill_sim/fabric/subscriptions.py`.",
    (StructMember("ns", "u64"), *_fields("u8", "pin", "drive", "wire", "kind"), StructMember("zero", "u32")),
)
INPUT_ROWS = Struct(
    "inputs",
    "Levels that the outside puts on pins later: a ring, oldest first.",
    (*_fields("u32", "first", "count"), StructMember("padding", "u64"), StructMember("rows", "edge", LATER_INPUTS)),
)
LATENCY = Struct(
    "latency",
    "Interrupts that are put off by drawn cycles: how often one was, and until when those that are held wait.",
    (
        *_fields("u64", "seed", "count"),
        StructMember("until", "u64", doc="how many are put off as they are drawn; those behind them come at once,"),
        StructMember("last", "u32", doc="but for the first of these, which is put off by so many cycles"),
        StructMember("most", "u32", doc="cycles that may be drawn"),
        StructMember("due", "u64", EXCEPTIONS, "ns"),
    ),
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
        StructMember("rows", "edge", CAN_BITS_ROWS),
    ),
)
SENT = Struct(
    "sent",
    "A word that has gone out, when, and how: clock and divider, and what else its device says of its format.",
    (StructMember("ns", "u64"), *_fields("u32", "word", "clock_hz", "brr", "format")),
)

#: All of them; one that holds another comes behind it.
STRUCTS = (
    RECORD, INSTRUCTION, MEASURED, BLOCK_COST, RAMP, TICKS, STEP, LOOP, FAULT, SHARED, PORT, USART, EXTI, DMA, SIGNAL,
    ANALOG, ADC, GPIO, AFIO, CLOCKS, RCC, FILTER, SHAPE, TIM, SPI, I2C, WAVE, EDGE, INPUT_ROWS, LATENCY, CAN_BITS, SENT,
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
        "/* The structs that C and Python share: made by tools/generators/chip.py from extension/layout.py. */",
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
