"""Parts attached by any words, what is refused, deadlines in order, and the bus of the peripherals, as approved."""

import ctypes
import random
import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

from bluepill_sim.fabric.can_network import CanNetwork
from bluepill_sim.memory.bus import ALIAS_BYTES, PERIPHERAL_BYTES, UNCLOCKED_NS, PeripheralBus, SramBitBand
from bluepill_sim.parts.attached import AttachedParts, PartError, Use, buses_of, words_of
from bluepill_sim.parts.registry import GROUP, PARTS, PartSpec, _converted, build, parse_part, part_class
from bluepill_sim.stm32f103 import BASES, PERIPHERAL_BASE
from tests.bluepill_sim.conftest import FakeChip
from tests.tools.suite.approved import Trace, judge_of, said, tried

WORDS = (
    "",
    ",",
    "ssd1306",
    "SSD1306,on=I2C1",
    "ssd1306,on=I2C1,address=0x3D,height=32",
    "ssd1306,address=61",
    "ssd1306,address=6x",
    "ssd1306,height=33",
    "ssd1306,colour=1",
    "ssd1306,on",
    "ssd1306,=1",
    "ssd1306,on=I2C1,on=I2C2",
    "ssd1307",
    "leds,led0=PB13,led7=pa1,is_active_low=yes",
    "leds,is_active_low=maybe",
    "leds,is_active_low=0",
    "button,out=PB12,presses_s=0.07+1.5,held_s=0.01",
    "button,presses_s=",
    "button,seed=1.5",
    "potentiometer,position=half",
    "potentiometer,position=2",
    "sd-card,image=FOLDER/none.img",
    "sd-card,image=FOLDER",
    "sd-card,image=FOLDER/card.img,save=1",
    "sd-card,size_mb=0",
    "w25q16,contents=FOLDER/card.img",
    "24c02,contents=FOLDER/none",
    "gps,start=noon",
    "servo,signal=PA0,name=arm,least_us=900",
    "can-node,data=zz",
    "hc-sr04,distance_m=-1",
    "ws2812,select=PA4,on=SPI1",
    "./none.py:Thing",
    "none:Thing",
)


def specs(draw: random.Random) -> Iterator[str]:
    yield said(
        [
            GROUP,
            {name: (row.target, row.what) for name, row in PARTS.items()},
            [part_class(name).__name__ for name in PARTS],
        ]
    )
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "card.img").write_bytes(bytes(512 * 1024))
        for words in WORDS:
            made = tried(lambda each: built(parse_part(each)), words.replace("FOLDER", folder))
            yield f"{words}: {made.replace(folder, '…')}"
        for name in ("card.img", "../x", "/etc/passwd", "none"):
            spec = PartSpec(kind="w25q16", settings=(("contents", name),), folder=folder)
            yield f"{name} {tried(built, spec).replace(folder, '…')}"
    for wanted in (bool, int, float, str, tuple[float, ...], list[int], int | None, tuple[str, ...]):
        for value in (
            True,
            False,
            0,
            1,
            1.5,
            "1",
            "0x10",
            "-3",
            "1.5",
            "yes",
            "No",
            "true",
            "x",
            "1+2",
            [1, 2],
            (0.5,),
            ["a"],
            None,
        ):
            yield f"{wanted} {value!r}: {tried(lambda *each: repr(_converted(*each, 'p: k', '')), value, wanted)}"


def built(spec: PartSpec) -> str:
    try:
        wiring = build(spec)
    except PartError as error:
        return f"{error} ({error.hint})"
    tells = wiring.part.words() if hasattr(wiring.part, "words") else ""
    return said([spec, wiring.name, wiring.on, wiring.select, dict(wiring.pins), type(wiring.part).__name__, tells])


class Timed:
    """A part with deadlines of its own."""

    PINS: ClassVar[dict[str, Use]] = {"out": Use.HELD, "seen": Use.HEARD, "now": Use.WATCHED}

    def __init__(self, times: list[int | None], lines: list[str], *, stands: bool = False) -> None:
        self.times, self.lines, self.stands = times, lines, stands

    def plug(self, socket: Any) -> None:
        self.socket = socket
        if self.stands is None:
            raise ValueError("no")

    def next_deadline(self) -> int | None:
        return self.times[0] if self.times else None

    def advance_to(self, now_ns: int) -> None:
        self.lines.append(f"{self.socket.name} at {now_ns}")
        self.socket.note(now_ns, "acts", "so")
        if not self.stands:
            self.times.pop(0)

    def changed(self, rows: object) -> None:
        self.lines.append(said(rows))


class OnBus:
    """What hangs on buses, by the methods that it has."""

    def __init__(self, *methods: str, lines: list[str]) -> None:
        for name in methods:
            setattr(self, name, lambda *given, name=name: lines.append(f"{name} {len(given)}"))

    def words(self) -> str:
        return "on a bus"


class Board:
    """As much of a board as parts need."""

    def __init__(self, chip: FakeChip, lines: list[str]) -> None:
        self.now_ns, self.lines, self.chip, self.network = 7, lines, chip, None
        self.serial_ports = {
            "usart1": SimpleNamespace(subscribe=lambda _sink, ends_slice: lines.append(f"subscribed {ends_slice}"))
        }

    def spi(self, name: str, _device: object = None, *, select: str | None = None) -> object:
        self.lines.append(f"spi {name} {select}")
        return SimpleNamespace(name=name)

    def i2c(self, name: str, _device: object = None) -> None:
        self.lines.append(f"i2c {name}")

    def can(self, network: CanNetwork | None = None) -> object:
        self.network = network or self.network
        return SimpleNamespace(joined=self.network)

    def pin(self, name: str) -> Any:
        return self.chip.pins[name]


def attaching(draw: random.Random) -> Iterator[str]:
    chip, lines = FakeChip(), list[str]()
    board: Any = Board(chip, lines)
    parts = AttachedParts(lambda message: lines.append(f"warned {message}"), lambda: lines.append("ends the run"))
    parts.note_sinks.append(lambda *note: lines.append(said(note)))
    buses = [
        OnBus(*methods, lines=lines)
        for methods in (("exchange",), ("start",), ("sent",), ("join",), ("exchange", "start", "sent", "join"), ())
    ]
    yield said([buses_of(one) for one in buses])
    for _ in range(170):
        part: Any = draw.choice((*buses, *buses, Timed([], lines), Timed([5, None], lines)))
        on = draw.choice((None, None, "SPI1", "spi2", "I2C1", "USART1", "USART4", "CAN", "X1", "1"))
        its_pins = ({}, {"out": "pa0"}, {"seen": "PB9", "now": "PA1"}, {"none": "PA0"}, {"out": "PD5"}, {"out": "PZ9"})
        given = {
            "name": draw.choice((*("", "a", "b", "c") * 4, ".hidden", "a/b", "bad\n")),
            "on": on,
            "select": draw.choice((None, None, None, "PA4")),
            "pins": draw.choice(its_pins if isinstance(part, Timed) or draw.random() < 0.1 else ({},)),
        }
        found = tried(parts.attach, board, chip.pins, part, given["name"], on, given["select"], given["pins"])
        yield said(
            [
                type(part).__name__,
                given,
                found,
                lines,
                [*parts.by_name][-2:],
                len(parts._unhung),
                len(parts._timed),
                parts.has_deadlines,
            ]
        )
        lines.clear()
    yield said([sorted(set(words_of(parts.by_name)))[:3]])
    yield from acting(draw)


def acting(draw: random.Random) -> Iterator[str]:
    chip, lines = FakeChip(), list[str]()
    board: Any = Board(chip, lines)
    for stands in (False, True):
        parts = AttachedParts(lambda _: None, lambda: lines.append("ends the run"))
        yield said([parts.has_deadlines, parts.next_deadline(), tried(parts.act, 5)])
        for times in ([3, 9, None], [3, 4], [None], [20]):
            parts.attach(
                board,
                chip.pins,
                Timed([*times], lines, stands=stands and times[0] == 20),
                "t",
                None,
                None,
                {"out": "PA0"},
            )
        for now in (0, 2, 3, 8, 9, 19, 20, 21):
            yield said([now, parts.next_deadline(), tried(parts.act, now), lines])
            lines.clear()
        socket = parts.by_name["t"].socket
        socket.warn("w")
        socket.deadline_changed()
        yield said(
            [
                socket.has("out"),
                socket.has("x"),
                tried(socket.pin, "x"),
                socket.pin("out").name,
                socket.now_ns,
                socket.name,
                lines,
                socket.surroundings.range_m(0, 0, 0, 0, 3.0),
            ]
        )
    refused = Timed([], lines, stands=None)  # type: ignore[arg-type]
    yield tried(parts.attach, board, chip.pins, refused, "r", None, None, {"out": "PA0"})
    chip.pins["PA1"].drive(True)
    chip.pins["PB9"].drive(True)
    parts.attach(board, chip.pins, Timed([], lines), "h", None, None, {"seen": "PB9", "now": "PA1"})
    for level in (False, True):
        chip.now_ns += 10
        chip.pins["PB9"].drive(level)
        chip.pins["PA1"].drive(level)
        chip.pins.deliver()
        yield said([lines, chip.stops])


class BusEngine:
    """Writes down what the bus says to what runs the instructions."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def __getattr__(self, name: str) -> Any:
        return lambda *given, **named: self.lines.append(f"{name} {[hex(one) for one in given]} {named}")


def buses(draw: random.Random) -> Iterator[str]:
    chip: Any = FakeChip()
    chip.engine = BusEngine()
    bus = PeripheralBus(chip.parts.by_name, chip.parts.rcc, chip)
    names = ("GPIOA", "TIM2", "RCC", "USART1", "CAN", "USB", "PWR", "TIM5", "FLASH", "CRC", "IWDG")
    for _ in range(420):
        name, at = draw.choice(names), draw.choice((0, 2, 4, 8, 0xC, 0x10, 0x14, 0x18, 0x1C, 0x3C, 0x3F8))
        offset, size = BASES[name] - PERIPHERAL_BASE + at, draw.choice((4, 4, 2)) if at % 4 == 0 else 2
        chip.now_ns += draw.choice((0, 10, UNCLOCKED_NS - 10, UNCLOCKED_NS))
        what = draw.choice(("read", "read", "write", "write", "reach", "read_bit", "write_bit", "gates"))
        value = draw.choice((0, 1, 0x5A, 0xFFFF, 0x4444_4444)) & (1 << 8 * size) - 1
        match what:
            case "read":
                found: object = bus.read(offset, size)
            case "write":
                found = bus.write(offset, size, value)
            case "reach":
                found = bus.reach(offset, size, draw.choice((None, value)))
            case "read_bit":
                found = bus.read_bit((offset & ~3) * ALIAS_BYTES + 4 * draw.randrange(32), 4)
            case "write_bit":
                found = bus.write_bit((offset & ~3) * ALIAS_BYTES + 4 * draw.randrange(32), 4, value)
            case _:
                found = chip.write(
                    draw.choice(("RCC.APB2ENR", "RCC.APB1ENR", "RCC.AHBENR")), draw.choice((0, 0xFFFF_FFFF, 4, 0x14))
                )
        yield said(
            [
                what,
                f"{name}+{at:x}",
                size,
                value,
                found,
                chip.engine.lines,
                sorted(chip.warnings.items()),
                bus.snapshot(),
            ]
        )
        chip.engine.lines.clear()
        if draw.random() < 0.3:
            chip.warnings.clear()
    yield said(
        [
            PERIPHERAL_BYTES,
            tried(bus.read, PERIPHERAL_BYTES - 4, 4),
            tried(bus.write, 0x1_0000 - 4, 4, 5),
            chip.warnings,
        ]
    )
    sram = ctypes.create_string_buffer(16)
    band = SramBitBand(sram)
    for _ in range(40):
        offset = draw.randrange(16 * ALIAS_BYTES) & ~3
        band.write_bit(offset, 4, draw.choice((0, 1, 2, 3)))
        yield said([offset, band.read_bit(offset, 4), sram.raw.hex()])


TRACES: dict[str, Trace] = {"specs": specs, "attaching": attaching, "buses": buses}
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
