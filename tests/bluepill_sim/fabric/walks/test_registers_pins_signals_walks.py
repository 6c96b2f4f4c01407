"""Registers, pins and signals, and the chip's page: every table, bound and refusal, as approved."""

import random
from collections.abc import Callable, Iterator
from typing import Any

from bluepill_sim import stm32f103
from bluepill_sim.fabric.line_speed import USUAL_BAUDS, heard, is_usual, nearest_usual
from bluepill_sim.fabric.pins import (
    ALTERNATE_FUNCTIONS,
    Pin,
    PinBank,
    PinDrive,
    PinMode,
    Subscription,
    contention,
    floating_inputs,
    overvoltage,
    short_circuit,
)
from bluepill_sim.fabric.registers import (
    BitField,
    Register,
    RegisterView,
    bits,
    fields_of,
    indices,
    masks,
    numbered,
)
from bluepill_sim.fabric.signals import Oscillation, Samples, Waveform, to_uv
from bluepill_sim.fabric.subscriptions import EDGE, Of
from bluepill_sim.stm32f103 import PERIPHERALS, line_of, make_pins, name_at
from tests.bluepill_sim.conftest import FakeChip
from tests.bluepill_sim.fabric.test_pins import Ports
from tests.tools.suite.approved import Trace, judge_of, said, tried

WORD = 0xFFFF_FFFF
#: Declarations of a register, most of them wrong.
DECLARED: tuple[dict[str, Any], ...] = (
    {},
    {"offset": 2},
    {"offset": 4, "reset": 5, "readable": 4},
    {"readable": 1 << 32},
    {"readable": WORD, "reset": WORD},
    {"reset": 1 << 32},
    {"writable": -2},
    {"write_one_to_clear": 1},
    {"writable": 0, "write_one_to_clear": 1, "write_zero_to_clear": 1},
    {"writable": 0, "write_one_to_clear": 1, "write_zero_to_clear": 2},
    {"triggers": 1},
    {"readable": 0, "writable": 2, "triggers": 1},
    {"readable": 2, "writable": 0, "triggers": 2},
    {"mask": 0xFF},
    {"mask": 0xFF, "readable": 1},
    {"on_read": "look"},
    {"on_read": "look", "on_write": "act"},
    {"on_read": "look", "writable": 0},
    {"on_read": "native"},
    {"fields": "A 3:0, B 4"},
    {"fields": "A 0:3"},
    {"fields": "A 32"},
    {"fields": "A 31"},
    {"fields": "A 3:0, B 3"},
    {"fields": "A 3, A 4"},
    {"fields": "A"},
    {"fields": "A 3:0", "readable": 0x1F},
    {"fields": "A 3:0", "writable": 0x1F, "readable": 0xF},
    {"fields": "A 3:0", "writable": 0, "write_one_to_clear": 0x10},
    {"fields": "A 3:0", "writable": 0, "write_zero_to_clear": 0x10},
    {"fields": "A 3:0", "triggers": 0x10},
)


def declarations(draw: random.Random) -> Iterator[str]:
    for given in DECLARED:
        yield tried(lambda each: said(Register(name="R", **{"offset": 0, **each})), given)
    # Of two faults, which one is named first.
    for one in DECLARED:
        yield "".join(
            tried(lambda each: said(Register(name="R", **{"offset": 0, **each})), one | two) for two in DECLARED
        )
    for _ in range(60):
        writable = draw.getrandbits(8)
        one = draw.getrandbits(8) & ~writable
        zero = draw.getrandbits(8) & ~writable & ~one
        readable = draw.getrandbits(8)
        triggers = draw.getrandbits(8) & ~(writable | one | zero | readable)
        register = Register(
            name="R",
            offset=0,
            readable=readable,
            writable=writable,
            write_one_to_clear=one,
            write_zero_to_clear=zero,
            triggers=triggers,
            on_write=draw.choice((None, "act")),
            on_read=None,
        )
        words = [draw.getrandbits(8) for _ in range(4)]
        access = [register.access(BitField("F", high, low)) for high, low in ((0, 0), (3, 0), (7, 4), (7, 0), (9, 8))]
        stored = [
            (register.stored_after(a & readable, b), register.widen(a & readable, b, lanes))
            for a in words
            for b in words
            for lanes in (0xFF, 0xFF00)
        ]
        yield said([register.setting, register.masks, access, stored])
    reads = Register(name="R", offset=0, readable=0, writable=0, on_read="look")
    yield said([reads.access(BitField("F", 3, 0)), BitField("F", 7, 4).of(0x1234), bits(0, (7, 4), (31, 31)), bits()])
    yield said(
        [numbered("MRn", (1, 0)), numbered("CNFn", (9, 8), 2, 8), numbered("n", ()), fields_of("B 4, A 3:0, C 31:5")]
    )
    yield tried(masks, "CKD 9:8, ARPE 7", "ARPE CKD") + tried(masks, "CKD 9:8", "X")
    yield tried(indices, (reads, Register(name="S", offset=8)), "S R") + tried(indices, (reads,), "T")
    view = RegisterView("R", 4, 0x12, (("A", 1), ("B", 0), ("C", 2)))
    yield said([str(view), view["C"], str(RegisterView("R", 4, 0, (("A", 0),))), tried(lambda: view["D"])])


def page(draw: random.Random) -> Iterator[str]:
    for name in [
        "FLASH_BASE",
        "FLASH_BYTES",
        "FLASH_BYTES_FITTED",
        "SRAM_BASE",
        "SRAM_BYTES",
        "SYSTEM_MEMORY_BASE",
        "FLASH_SIZE_REGISTER",
        "UNIQUE_ID_REGISTER",
        "OPTION_BYTES_BASE",
        "PERIPHERAL_BASE",
        "PERIPHERAL_END",
        "IRQ_COUNT",
        "BASES",
        "CLOCK_GATES",
        "WIRING",
    ]:
        yield f"{name} {said(getattr(stm32f103, name))}"
    for name, value in sorted(vars(stm32f103).items()):
        if name.isupper() and isinstance(value, frozenset | dict | tuple | int) and name != "PERIPHERALS":
            yield f"{name} {said(sorted(value, key=str) if isinstance(value, frozenset) else value)}"
    yield said([name for _, name in PERIPHERALS])
    edges = sorted(
        {
            base + n
            for base in stm32f103.BASES.values()
            for n in (-1, 0, 0x3FF, 0x400, 0x7FF, 0x800, 0x1FFF, 0x2000, 0x3_FFFF, 0x4_0000)
        }
        | {0, 0x3FFF_FFFF}
    )
    yield said([(f"{at:x}", name_at(at)) for at in edges])
    yield said([(output, tried(line_of, output)) for output in (*stm32f103.WIRING, "USART9.irq", "USART1.none")])
    edges = [base + n for base in (0, 8, 0x0800_0000, 0x2000_0000) for n in (-1, 0, 0x4FFF, 0x5000, 0x1_FFFF, 0x2_0000)]
    yield said(
        [
            (
                stm32f103.is_in_sram(at),
                stm32f103.may_hold_code(at),
                stm32f103.may_hold_code(at, 0),
                stm32f103.without_alias(at),
            )
            for at in edges
        ]
    )


def views(draw: random.Random) -> Iterator[str]:
    chip = FakeChip()
    for name, part in chip.parts.by_name.items():
        kind = type(part)
        about = [name, part.base, part.place, part.slot, part.due_ns, part.clock_name(), part.clock_hz(), kind.hidden()]
        yield said([*about, [kind.latch_of(one) for one in kind.REGISTERS]])
        for one in part.view().values():
            yield f"{one.name} {one.address:x} {one} {said(one.fields)}"
        offsets = (0, 1, 2, 4, 0x14, 0x3C, 0x80, 0x3FC)
        yield said(
            [
                (part.has_register(at), part.changes_reset_value(at, 0xFF), part.changes_reset_value(at, 0))
                for at in offsets
            ]
        )
        yield said([tried(part.read, at, size) for at, size in ((0, 4), (0, 2), (2, 2), (1, 1), (3, 1), (0x3F8, 4))])
        for at, size, value in ((0x3F8, 4, 1), (0, 1, 0x41), (4, 2, 0xFFFF), (6, 2, 0x101)):
            tried(part.write, at, size, value)
        yield said([part.look(0), part.look(4), sorted(part.duplicated), [*part.words[:4]], len(part.held)])
        part.reset()
        yield said([[*part.words[:6]], sorted(chip.warnings.items())])
        chip.warnings.clear()


def pin_seen(bank: PinBank, name: str) -> str:
    pin = bank[name]
    return said(
        [
            name,
            pin.level,
            pin.input,
            pin.output,
            pin.mode,
            pin.driven,
            pin.is_floating,
            pin.is_contended,
            pin.rail,
            pin.function,
            pin.holder,
            pin.wave,
            pin.board_pull,
            pin.has_volts,
            pin.volts,
            pin.is_watched,
        ]
    )


def moves_of(
    draw: random.Random, pin: Pin, bank: PinBank, watch: Subscription, now_ns: int
) -> dict[str, Callable[[], object]]:
    """Return what can be done with a pin."""
    source = draw.choice(("USART1_TX", "TIM2_CH1", "I2C1_SDA", "CAN_TX"))
    return {
        "drive": lambda: pin.drive(
            draw.choice((None, 0, 1, True, False)),
            volts=draw.choice((None, None, 5.0, 3.65, 3.66)),
            is_weak=draw.random() < 0.3,
        ),
        "later": lambda: pin.drive_later(
            [(now_ns + draw.choice((0, 5, 500)), draw.choice((0, 1))) for _ in range(2)],
            is_weak=draw.random() < 0.3,
        ),
        "volts": lambda: pin.set_volts(
            draw.choice(
                (
                    None,
                    0.0,
                    1.6499,
                    1.65,
                    3.3,
                    5.0,
                    1000.0,
                    Oscillation(shape=Waveform.SINE, low_v=0, high_v=4.0, period_ns=100),
                )
            )
        ),
        "short": lambda: pin.short(draw.choice((None, None, "GND", "3V3", "5V"))),
        "pull": lambda: setattr(pin, "board_pull", draw.choice((PinDrive.NONE, PinDrive.PULL_UP, PinDrive.PULL_DOWN))),
        "configure": lambda: pin.configure(draw.choice(tuple(PinMode)), draw.random() < 0.5),
        "hold": lambda: pin.hold("JTDO", draw.choice(tuple(PinDrive))),
        "release": pin.release,
        "connect": lambda: pin.connect(source, draw.random() < 0.5),
        "disconnect": lambda: pin.disconnect(source),
        "wave": lambda: pin.offer_wave(source, 1_000_000, 10, draw.choice((0, 3, 10)), draw.choice((0, 5))),
        "low": lambda: pin.hold_low(draw.random() < 0.5),
        "carries": lambda: pin.carries(source),
        "slices": lambda: setattr(watch, "ends_slice", frozenset(draw.choice(((), ("PA0",), ("PB9",))))),
        "route": bank.route_changed,
    }


def pins(draw: random.Random) -> Iterator[str]:
    ports = FakeChip()
    bank = PinBank(ports, frozenset({"PA0", "PA1", "PA8", "PB1", "PB2", "PB9", "PC13"}), frozenset({"PA8", "PB9"}))
    names, rows = ("PA0", "PA1", "PA8", "PB1", "PB2", "PB9", "PC13", "PD0"), list[tuple[Any, ...]]()
    bank.release_listeners.append(lambda pin: rows.append(("released", pin.name)))
    bank.route_listeners.append(lambda: rows.append(("route",)))
    watch = bank.subscribe_pins(
        ("PA0", "PB9", "PC13"), lambda data: rows.extend(EDGE.iter_unpack(data)), of=Of.WIRE, ends_slice=("PB9",)
    )
    for step in range(420):
        pin = bank[draw.choice(names)]
        ports.now_ns += draw.choice((0, 10, 1000))
        moves = moves_of(draw, pin, bank, watch, ports.now_ns)
        name = draw.choice(tuple(moves))
        line = f"{name} {pin.name} {tried(moves[name])}"
        bank.deliver()
        yield f"{line} {pin_seen(bank, pin.name)} {said(rows)} {said(ports.warnings)} {ports.stops}"
        rows.clear()
        ports.warnings.clear()
        if step % 40 == 39:
            for each in names:
                yield pin_seen(bank, each)
    watch.close()
    yield said([bank[name].is_watched for name in names])
    for name in ("PA0", "PA8", "PB9"):
        for mode in (PinMode.FLOATING, PinMode.PULLED, PinMode.PUSH_PULL):
            bank[name].release()
            bank[name].configure(mode, True)
            yield said(
                [overvoltage(bank[name], volts) for volts in (3.3, 3.65, 3.66, 5.0)]
                + [contention(bank[name]), short_circuit(bank[name])]
            )
    yield said(
        [
            floating_inputs(["PA0"]),
            floating_inputs(["PA0", "PB1"]),
            tried(bank.masks, ("PA0", "PC13")),
            tried(bank.masks, ("PZ0",)),
            len(list(bank)),
        ]
    )
    yield said(
        [
            ALTERNATE_FUNCTIONS,
            [(pin.name, pin.index, pin.is_bonded, pin.is_five_volt_tolerant, pin._channel) for pin in make_pins(ports)],
        ]
    )
    yield said(
        [(one, one.value, one.level, one.is_strong) for one in PinDrive]
        + [(one, one.value, one.drives) for one in PinMode]
    )


def signals(draw: random.Random) -> Iterator[str]:
    for volts in (0.0, -999.999, 999.999999, 1000.0, -1000.0, float("nan"), float("inf"), 1.2345674, 1.2345675):
        yield tried(to_uv, volts)
    for given in (
        {},
        {"period_ns": 0},
        {"period_ns": 1},
        {"phase_ns": -1},
        {"phase_ns": 99},
        {"phase_ns": 100},
        {"high_ns": -1},
        {"high_ns": 0},
        {"high_ns": 100},
        {"high_ns": 101},
        {"low_v": 1000.0},
        {"high_v": -1000.0},
        {"low_v": 5.0},
    ):
        yield tried(
            lambda each: (
                said(
                    one := Oscillation(
                        **{"shape": Waveform.SQUARE, "low_v": 0.5, "high_v": 3.0, "period_ns": 100, **each}
                    )
                )
                + f" {one.most_v}"
            ),
            given,
        )
    for given in ({}, {"volts": ()}, {"interval_ns": 0}, {"interval_ns": 1}, {"volts": (1.0, 1000.0)}):
        yield tried(
            lambda each: (
                said(one := Samples(**{"volts": (1.0, 2.5, -1.0), "interval_ns": 10, **each})) + f" {one.most_v}"
            ),
            given,
        )
    ports = Ports()
    bank = PinBank(ports, frozenset({"PA0", "PB1", "PC13"}))
    kinds = [
        Oscillation(shape=shape, low_v=0.5, high_v=3.0, period_ns=100, phase_ns=phase, high_ns=high)
        for shape in Waveform
        for phase in (0, 30)
        for high in (None, 0, 70, 100)
    ]
    kinds += [
        Samples(volts=(1.0, 2.0, -0.5), interval_ns=10, is_repeated=again, is_held=held)
        for again in (False, True)
        for held in (False, True)
    ]
    for signal in (*kinds, 1.25, None):
        ports.now_ns = 1000
        bank["PA0"].set_volts(signal)
        found = []
        for ns in (0, 1, 9, 10, 15, 25, 29, 30, 31, 49, 50, 69, 70, 75, 99, 100, 130):
            ports.now_ns = 1000 + ns
            found.append(bank["PA0"].volts)
        yield said([type(signal).__name__, found, bank["PA0"].has_volts, bank["PA0"].level])
    yield (
        tried(bank["PC13"].set_volts, kinds[0])
        + tried(bank["PA1"].set_volts, kinds[0])
        + tried(bank["PC13"].set_volts, 3.0)
        + said(ports.warnings)
    )


def speeds(draw: random.Random) -> Iterator[str]:
    yield said(
        [
            (baud, nearest_usual(baud), is_usual(baud))
            for usual in USUAL_BAUDS
            for baud in (usual * 979 // 1000, usual * 98 // 100, usual, usual * 102 // 100, usual * 1021 // 1000)
        ]
    )
    yield said([(baud, nearest_usual(baud)) for baud in (1, 299, 424, 425, 10_000_000)])
    for _ in range(160):
        data_bits = draw.choice((7, 8, 9))
        words = [
            draw.choice((0, 0x55, 0xFF, draw.getrandbits(data_bits))) & (1 << data_bits) - 1
            for _ in range(draw.choice((1, 2, 4)))
        ]
        numerator, denominator = draw.choice(
            (
                (1, 1),
                (100, 104),
                (104, 100),
                (95, 100),
                (105, 100),
                (1, 2),
                (2, 1),
                (12, 100),
                (9, 1),
                (106, 100),
                (94, 100),
            )
        )
        stop = draw.choice((1, 2, 3, 4))
        yield said(
            [words, data_bits, numerator, denominator, stop, [*heard(words, data_bits, numerator, denominator, stop)]]
        )


TRACES: dict[str, Trace] = {
    "declarations": declarations,
    "page": page,
    "views": views,
    "pins": pins,
    "signals": signals,
    "speeds": speeds,
}
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
