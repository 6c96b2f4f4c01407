"""Events in words: which of a row of events a line takes, and what is said of a line that means none."""

from collections.abc import Sequence

import pytest

from p2os.protocol.commands import pulse, vel
from robot_bench.events.kinds import (
    CanTransfer,
    Contact,
    Event,
    Fault,
    I2cTransfer,
    Note,
    Packet,
    PinEdge,
    Pose,
    Ranges,
    SpiTransfer,
    Text,
    Verdict,
    WorldChange,
)
from robot_bench.events.selection import SELECTORS, bus_of, select
from simbase.errors import UsageError
from tests.robot_bench.recording.records import S, pose

MS = S // 1000


def at(t: int, x_m: float = 0.0, y_m: float = 0.0, left: int = 0, right: int = 0) -> Pose:
    place = pose(t, round(x_m * 1e6), round(y_m * 1e6), left=left)
    return Pose(**{name: getattr(place, name) for name in place.__slots__} | {"right": right})


def i2c(**changes: object) -> I2cTransfer:
    given = {"t": 1, "bus": "i2c1", "begun": 0, "address": 0x3C, "is_read": False, "data": b"\x10\x20",
             "answered": True, "acknowledged": 2, "end": "stop"}  # fmt: skip
    return I2cTransfer(**given | changes)  # type: ignore[arg-type]


def can(**changes: object) -> CanTransfer:
    given = {"t": 1, "bus": "can", "begun": 0, "identifier": 0x123, "is_extended": False, "is_remote": False, "dlc": 2,
             "data": b"\x10\x20", "is_own": False}  # fmt: skip
    return CanTransfer(**given | changes)  # type: ignore[arg-type]


def text(*lines: bytes, port: str = "usart1") -> list[Event]:
    return [Text(t=n, data=line, port=port) for n, line in enumerate(lines)]


EDGES = [
    PinEdge(t=n, wire=wire, level=level)
    for n, (wire, level) in enumerate((("DD1", True), ("DD1", False), ("DD2", True), ("DD1", True)))
]
WAY = [at(0), at(1, 1.0), at(2, 1.0, 0.5), at(3, 2.0, 0.5), at(4, 1.0, 0.5)]
SPEEDS = [at(0), at(1, left=5000), at(2, left=5001), at(3, right=-6000), at(4, right=-5000), at(5, right=-5001)]
I2C = [i2c(), i2c(address=0x3D), i2c(is_read=True), i2c(answered=False), i2c(acknowledged=1), i2c(bus="i2c2"),
       i2c(data=b"\x20\x10"), i2c(is_read=True, acknowledged=1), i2c(end="lost"), i2c(end="cut"),
       i2c(end="more")]  # fmt: skip
SPI = [SpiTransfer(t=1, bus=bus, begun=0, ended=1, from_master=ours, from_slave=theirs)
       for bus, ours, theirs in (("spi1", b"\x01\x9f\x00", b"\xff" * 3), ("spi1", b"\x9f\x01", b"\x9f\x00"),
                                 ("spi2", b"\x9f\x00", b""))]  # fmt: skip
CAN = [can(), can(is_own=True), can(identifier=0x124), can(error="damaged"), can(data=b"\x10"), can(data=b"\x20\x10")]
RANGES = [Ranges(t=n, mm=(mm, 300)) for n, mm in enumerate((500, 400, 399, 399, 401, 100))]
NOTES = [Note(t=1, who="adapter", what="driving", detail="now"), Note(t=1, who="adapter", what="drive"),
         Note(t=1, who="body", what="driving")]  # fmt: skip
FAULTS = [Fault(t=1, op="inject", words="stop-button"), Fault(t=1, op="clear", words="stop-button"),
          Fault(t=1, op="died", words="HardFault"), Fault(t=1, op="inject", words="sonar-stuck 3")]  # fmt: skip
THINGS = [WorldChange(t=1, op=op, name=name) for op, name in (("move", "post"), ("place", "box"), ("remove", "post"))]
HITS = [Contact(t=1, what=what, x_m=0.0, y_m=0.0) for what in ("'post'", "something", "'posts'")]
VEL, PULSE = (one.to_frame().to_bytes() for one in (vel(100), pulse()))
PACKETS = [Packet(t=1, direction="c2r", data=VEL[:5]), Packet(t=2, direction="r2c", data=PULSE),
           Packet(t=3, direction="c2r", data=VEL[5:] + PULSE), Packet(t=4, direction="c2r", data=PULSE)]  # fmt: skip
VERDICTS = [Verdict(t=1, goal="a", met=met, says="") for met in (True, False)]
ROWS: list[tuple[str, Sequence[Event], list[int]]] = [
    ("pin DD1 high", EDGES, [0, 3]),
    ("pin DD1 low", EDGES, [1]),
    ("pin DD1 changes", EDGES, [1, 3]),
    ("pin DD2 changes", EDGES, [2]),
    ("usart1 sends go", text(b"let go\n", b"stop\n", b"g", b"o\n", b"go\n", b"go", b" on\n", b"go"), [0, 3, 4, 5, 7]),
    ("usart1 sends go", text(b"go\n", port="usart2"), []),
    ("usart2 sends go on", text(b"go\r\n", b"go on\r\n", port="usart2"), [1]),
    ("usart1 matches ^go( on)?$", text(b"go\r\n", b"go on\n", b"let go\n", b"\xff\n"), [0, 1]),
    ("usb sends x", text(b"x\n", port="usb"), [0]),
    ("i2c1 writes 0x3c", I2C, [0, 4, 6, 8, 9, 10]),
    ("i2c1 writes 60 10 20", I2C, [0, 4, 8, 9, 10]),
    ("i2c1 reads 0x3c", I2C, [2, 7]),
    ("i2c1 fails", I2C, [3, 4, 8, 9]),
    ("i2c2 writes 0x3c", I2C, [5]),
    ("spi1 sends 9f 00", SPI, [0]),
    ("spi1 gets 9F00", SPI, [1]),
    ("spi2 sends 00", SPI, [2]),
    ("can hears 0x123", CAN, [0, 4, 5]),
    ("can hears 0x123 10 20", CAN, [0]),
    ("can sends 0x123", CAN, [1]),
    ("can fails", CAN, [3]),
    ("contact", HITS, [0, 1, 2]),
    ("contact post", HITS, [0]),
    ("robot near 1 0.5 0.25", WAY, [2, 4]),
    ("robot near 1 0 0.5", WAY, [1, 4]),
    ("robot within 0.5 0.5 1 1", WAY, [2, 4]),
    ("robot within -1 0 1 0.4", WAY, [0]),
    ("robot drives 1.5", WAY, [2]),
    ("robot drives 1.6", WAY, [3]),
    ("robot drives 3.5", WAY, [4]),
    ("robot moves", SPEEDS, [2, 5]),
    ("robot stops", SPEEDS, [4]),
    ("time 0", [at(0), at(1)], [0]),
    ("time 0.5", [at(0), at(S // 2 - 1), at(S // 2), at(S)], [2]),
    ("sonar 1 below 0.4", RANGES, [2, 5]),
    ("sonar 2 below 0.4", RANGES, [0]),
    ("sonar 3 below 0.4", RANGES, []),
    ("note adapter", NOTES, [0, 1]),
    ("note adapter driving", NOTES, [0]),
    ("note adapter driving now", NOTES, [0]),
    ("note adapter driving no way", NOTES, []),
    ("fault", FAULTS, [0, 2, 3]),
    ("fault stop", FAULTS, [0]),
    ("thing post", THINGS, [0, 2]),
    ("packet", PACKETS, [1, 2, 3]),
    ("packet vel", PACKETS, [2]),
    ("packet PULSE", PACKETS, [2, 3]),
    ("goal met", VERDICTS, [0]),
    ("goal missed", VERDICTS, [1]),
]


@pytest.mark.parametrize(("words", "events", "taken"), ROWS, ids=[row[0] for row in ROWS])
def test_a_line_takes_the_events_that_it_means(words: str, events: Sequence[Event], taken: list[int]) -> None:
    selector, copy = select(words), select(words)
    found = []
    for place, event in enumerate(events):
        assert isinstance(event, selector.kinds)
        is_taken = selector.takes(event)
        copy.restore(selector.snapshot())  # what it has seen is all that counts
        selector, copy = copy, select(words)
        found += [place] * is_taken
    assert found == taken
    assert selector.words == words
    stranger = at(0) if Pose not in selector.kinds else EDGES[0]
    assert words.startswith("time") or not selector.takes(stranger)


def test_each_first_word_is_tried() -> None:
    assert {words.split()[0] for words, _, _ in ROWS} >= SELECTORS.keys() - {"usart3"}
    assert [select(f"{bus} fails").wires for bus in ("i2c1", "can")] == [None, None]
    assert select("pin PA4 high").wires == select("pin DD1 high").wires == ("DD1",)
    assert select("pin A high", {"A": "led"}).wires == ("led",)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("", "no events '' (hint: events: pin PB12 high; usart1 sends TEXT; usart2 sends TEXT; usart3 sends TEXT; "),
        ("", "usb sends TEXT; i2c1 writes 0x3c; i2c2 writes 0x3c; spi1 sends 9f 00; spi2 sends 9f 00; can hears 0x123"),
        ("usart2 says x", "(hint: such as usart2 sends TEXT)"),
        ("i2c2 writes", "(hint: such as i2c2 writes 0x3c)"),
        ("spi2 sends", "(hint: such as spi2 sends 9f 00)"),
        ("", "0x123; contact [NAME]; robot near X Y RADIUS; time 5.0; sonar 3 below 0.4; note adapter driving; fault"),
        ("", "driving; fault [WORDS]; thing NAME; packet PULSE; goal missed)"),
        ("pins DD1 high", "no events 'pins DD1 high' (hint: did you mean 'pin'?)"),
        ("pin DD1", "events 'pin DD1' are not understood: a pin, and high, low or changes"),
        ("pin DD1", "changes (hint: such as pin PB12 high)"),
        ("pin DD1 up", "a pin, and high, low or changes"),
        ("pin DD1 high now", "a pin, and high, low or changes"),
        ("pin PZ9 high", "there is no wire 'PZ9'"),
        ("usart1 says x", "sends TEXT, or matches REGEX (hint: such as usart1 sends TEXT)"),
        ("usart1 sends", "sends TEXT, or matches REGEX"),
        ("usart1 matches (", "are not understood: missing ), unterminated subpattern"),
        ("i2c1 writes", "writes NUMBER [HEX], reads NUMBER [HEX], fails (hint: such as i2c1 writes 0x3c)"),
        ("i2c1 writes 0x400", "writes NUMBER [HEX], reads"),
        ("i2c1 writes -1", "writes NUMBER [HEX], reads"),
        ("i2c1 fails 3", "writes NUMBER [HEX], reads"),
        ("i2c1 reads 0x10 1", "'1' is no bytes in hex"),
        ("spi1 sends", "sends HEX, or gets HEX (hint: such as spi1 sends 9f 00)"),
        ("spi1 takes 00", "sends HEX, or gets HEX"),
        ("can hears 0x20000000", "sends NUMBER [HEX], hears NUMBER [HEX], fails (hint: such as can hears 0x123)"),
        ("robot", "near X Y RADIUS, within X Y X Y, drives METRES, moves, or stops"),
        ("robot", "stops (hint: such as robot near X Y RADIUS)"),
        ("robot near 1 2", "near X Y RADIUS, within"),
        ("robot near 1 2 0", "0 m are never come to: above 0"),
        ("robot near nan 2 1", "nan is no number of metres"),
        ("robot within 1 2 0 3", "least x and y, then the greatest"),
        ("robot within 1 2 2 1", "least x and y, then the greatest"),
        ("robot drives 0", "0 m are never come to: above 0"),
        ("robot moves 1", "near X Y RADIUS, within"),
        ("time -0.1", "seconds from the beginning (hint: such as time 5.0)"),
        ("time 1e9", "seconds from the beginning"),
        ("sonar 0 below 1", "a sonar from 1 on, below, and metres (hint: such as sonar 3 below 0.4)"),
        ("sonar x below 1", "a sonar from 1 on"),
        ("sonar 1 above 1", "a sonar from 1 on"),
        ("sonar 1 below", "a sonar from 1 on"),
        ("note", "who notes it, and what (hint: such as note adapter driving)"),
        ("thing", "the name of a thing (hint: such as thing NAME)"),
        ("goal", "met, or missed (hint: such as goal missed)"),
    ],
)  # fmt: skip
def test_a_line_that_means_nothing_is_refused_with_how_it_is_written(words: str, says: str) -> None:
    with pytest.raises(UsageError) as caught:
        select(words)
    assert says in f"{caught.value} (hint: {caught.value.hint})"


@pytest.mark.parametrize(
    "words", ["i2c1 writes 0x3ff", "can hears 0x1fffffff", "robot within 1 2 1 2", "time 999999999"]
)
def test_the_greatest_that_counts_is_taken(words: str) -> None:
    assert select(words).words == words


@pytest.mark.parametrize(("words", "bus"), [("can fails", "can"), ("usb", "usb"), ("pin can high", ""), ("", "")])
def test_what_has_to_be_recorded_is_told_by_the_first_word(words: str, bus: str) -> None:
    assert bus_of(words) == bus
