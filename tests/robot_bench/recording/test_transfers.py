"""Buses recorded on request: what they carry comes as events, whatever the slices, and nothing else changes."""

import json
import pickle
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bluepill_sim.peripherals.i2c import I2cStep, I2cSymbol
from bluepill_sim.peripherals.spi import SpiWord
from p2os.errors import ScenarioError
from robot_bench.bench import Bench
from robot_bench.events.codec import events_of
from robot_bench.events.kinds import CanTransfer, Event, I2cTransfer, SpiTransfer, Text
from robot_bench.events.selection import select
from robot_bench.firmware.build import HERE as FIRMWARE
from robot_bench.recording.transfers import MOST_BYTES, PAUSE_NS, I2cTransfers, SpiTransfers
from robot_bench.scenario.loading import load_scenario
from simbase.errors import UsageError

PARTS = Path(__file__).parents[2] / "bluepill_sim" / "firmware" / "parts.elf"
#: A robot on pins that the program's parts do not need.
SCENARIO = f"""
firmware = "{PARTS}"
world = "arena"
robot = "rover"
body = "kinematic"
duration_s = 0.1

[pins]
left_in1 = "PC13"
left_in2 = "PC14"
left_pwm = "PB0"
right_in1 = "PC15"
right_in2 = "PB2"
right_pwm = "PB5"
left_a = "PB3"
left_b = "PB4"
right_a = "PA15"
right_b = "PB15"
distance_front = "PA2"
distance_left = "PA3"
distance_right = "PA1"
battery = "PB1"
bumper_front = "PA10"
""" + "".join(
    f"[[part]]\n{keys}\n"
    for keys in (
        'kind = "ssd1306"\non = "I2C1"', 'kind = "mpu6050"\non = "I2C1"', 'kind = "24c02"\non = "I2C1"',
        'kind = "sd-card"\non = "SPI1"\nselect = "PA4"', 'kind = "hc-sr04"\ntrig = "PB8"\necho = "PB9"',
        'kind = "can-node"\non = "CAN"\nperiod_ms = 90\ndata = "0A"',
    )
)  # fmt: skip
ALL = 'record = ["spi1", "i2c1", "can"]\n'
WORD_NS = 1_000


def spi_events(words: list[SpiWord], cuts: dict[int, int]) -> list[Event]:
    """What is told of words, which come in pieces; all that is told must not have been handed on already."""
    reported: list[Event] = []
    released = -1

    def tell(event: Event) -> None:
        assert event.t > released
        reported.append(event)

    transfers = SpiTransfers("spi1", tell)
    for number, word in enumerate(words):
        if number in cuts:
            transfers.release(cuts[number] + word.ended_ns - word.span_ns)
            released = cuts[number] + word.ended_ns - word.span_ns
        transfers.take([word])
    released = -1
    transfers.release(10**12, is_end=True)
    return reported


def words_after(gaps: list[int], bits: int = 8) -> list[SpiWord]:
    ended, words = 0, []
    for number, gap in enumerate(gaps):
        ended += gap + WORD_NS
        words.append(SpiWord(ended, number & 0xFF, ~number & 0xFF, bits, WORD_NS))
    return words


@given(
    st.lists(st.sampled_from([0, 100, PAUSE_NS - 1, PAUSE_NS, PAUSE_NS + 1, 10**6]), min_size=1, max_size=30),
    #: Before which word what was handed on, and how long after its first bit.
    st.dictionaries(st.integers(0, 29), st.sampled_from([0, 1, WORD_NS - 1])),
)
def test_words_of_an_spi_are_parted_by_pauses_alone(gaps: list[int], cuts: dict[int, int]) -> None:
    words = words_after(gaps)
    reported = spi_events(words, cuts)
    assert reported == spi_events(words, {})
    assert len(reported) == 1 + sum(gap > PAUSE_NS for gap in gaps[1:])
    sent = b"".join(event.from_master for event in reported if isinstance(event, SpiTransfer))
    assert sent == bytes(word.from_master for word in words)
    for event in reported:
        assert isinstance(event, SpiTransfer)
        assert event.t == event.ended + PAUSE_NS + WORD_NS


@pytest.mark.parametrize(("count", "lengths"), [
    (MOST_BYTES - 1, [MOST_BYTES - 1]), (MOST_BYTES, [MOST_BYTES]), (MOST_BYTES + 1, [MOST_BYTES, 1]),
])  # fmt: skip
def test_a_long_transfer_of_an_spi_comes_in_pieces(count: int, lengths: list[int]) -> None:
    reported = spi_events(words_after([0] * count), {})
    assert [len(event.from_slave) for event in reported if isinstance(event, SpiTransfer)] == lengths


def test_words_of_sixteen_bits_are_two_bytes_and_begin_a_transfer_of_their_own() -> None:
    words = [SpiWord(1_000, 0x12, 0x34, 8, WORD_NS), SpiWord(2_000, 0x1234, 0x5678, 16, WORD_NS)]
    reported = [event for event in spi_events(words, {}) if isinstance(event, SpiTransfer)]
    assert [(event.from_master, event.from_slave, event.bits) for event in reported] == [
        (b"\x12", b"\x34", 8), (b"\x12\x34", b"\x56\x78", 16),
    ]  # fmt: skip


#: Address, whether it is read, the data, which byte is the first that is refused, what ends it.
calls = st.lists(
    st.tuples(
        st.integers(0, 0x3FF).filter(lambda address: address & 0x78 != 0x78 or address > 0x7F),
        st.booleans(), st.binary(max_size=5), st.integers(0, 5), st.sampled_from(["stop", "restart", "lost", "cut"]),
    ),
    min_size=1, max_size=6,
)  # fmt: skip


@given(calls)
def test_conditions_and_bytes_of_an_i2c_are_put_together(rows: list[tuple[int, bool, bytes, int, str]]) -> None:
    symbols: list[I2cSymbol] = []
    expected: list[tuple[Any, ...]] = []
    ended = 0

    def put(step: I2cStep, byte: int = 0, acknowledged: bool = True) -> int:
        nonlocal ended
        ended += 1000
        symbols.append(I2cSymbol(ended, step, byte, acknowledged))
        return ended

    for number, (address, is_read, data, accepted, end) in enumerate(rows):
        begun = put(I2cStep.START)
        header = 0xF0 | address >> 7 & 6 if address > 0x7F else address << 1
        if address > 0x7F:
            put(I2cStep.BYTE, header)
            put(I2cStep.BYTE, address & 0xFF)
            if is_read:
                expected.append((begun, address, False, b"", 0, "restart"))
                begun = put(I2cStep.START)
        if address <= 0x7F or is_read:
            put(I2cStep.BYTE, header | is_read)
        for n, byte in enumerate(data):
            put(I2cStep.BYTE, byte, n < accepted)
        is_last = number + 1 == len(rows)
        if end != "restart":
            put({"stop": I2cStep.STOP, "lost": I2cStep.LOST, "cut": I2cStep.CUT}[end])
        expected.append(
            (begun, address, is_read, data, min(accepted, len(data)), "more" if is_last and end == "restart" else end)
        )
    reported: list[Event] = []
    transfers = I2cTransfers("i2c2", reported.append)
    for symbol in symbols:
        transfers.take([symbol])
    transfers.release(10**9, is_end=True)
    found = [event for event in reported if isinstance(event, I2cTransfer)]
    assert [(e.begun, e.address, e.is_read, e.data, e.acknowledged, e.end) for e in found] == expected
    assert all(event.answered and event.bus == "i2c2" for event in found)


def test_an_address_that_nobody_answers_is_told_so() -> None:
    reported: list[Event] = []
    rows = [(10, I2cStep.START, 0, False), (20, I2cStep.BYTE, 0xA1, False), (30, I2cStep.STOP, 0, False)]
    I2cTransfers("i2c1", reported.append).take([I2cSymbol(*row) for row in rows])
    assert reported == [I2cTransfer(t=30, bus="i2c1", begun=10, address=0x50, is_read=True, data=b"", answered=False,
                                acknowledged=0, end="stop")]  # fmt: skip
    assert [select(words).takes(reported[0]) for words in ("i2c1 fails", "i2c2 fails", "i2c1 reads 0x50")] == [
        True,
        False,
        False,
    ]


def bench_of(folder: Path, head: str = "", tail: str = "") -> Bench:
    path = folder / "buses.toml"
    path.write_text(head + SCENARIO + tail)
    return Bench(load_scenario(str(path)))


GOALS = "".join(
    f'[[goal]]\nkind = "{kind}"\nevent = "{words}"\n'
    for kind, words in (
        ("happens", "i2c1 writes 0x3c 00 ae"), ("happens", "i2c1 reads 0x68 68"), ("never", "i2c1 fails"),
        ("happens", "spi1 gets 01 aa"), ("happens", "can hears 0x123 0a"), ("happens", "can sends 0x321 ef be"),
        ("never", "can fails"),
    )
)  # fmt: skip


def test_transfers_are_events_of_the_run_and_change_nothing_else_of_it(tmp_path: Path) -> None:
    plain, heard = bench_of(tmp_path), bench_of(tmp_path, ALL, GOALS)
    plain.run_until("0.1 s")
    heard.run_until("0.05 s")
    other = pickle.loads(pickle.dumps(heard))  # noqa: S301  # its own
    forked = heard.fork()
    forked.run_until("0.1 s")
    for slice_ms in range(51, 101):
        heard.run_until(f"{slice_ms} ms")
    other.run_until("0.1 s")
    lines, same, again, without = (list(bench.trace.lines()) for bench in (heard, other, forked, plain))
    buses = {"spi", "i2c", "can"}
    assert lines == same == again
    of_buses = [line for line in lines if json.loads(line)["k"] in buses]
    assert {json.loads(line)["k"] for line in of_buses} == buses
    assert [line for line in lines if json.loads(line)["k"] not in {*buses, "meta", "verdict"}] == [
        line for line in without if json.loads(line)["k"] not in {"meta", "verdict"}
    ]
    reported = [event for event in events_of(lines) if isinstance(event, SpiTransfer | I2cTransfer | CanTransfer)]
    assert reported == heard.record().transfers
    written = [event.data for event in reported if isinstance(event, I2cTransfer)]
    frame = b"".join(data[1:] for data in written if data[:1] == b"\x40")
    assert len(frame) == 1024  # the picture of 128 x 64 points
    assert not heard.judge().missed


def test_text_of_a_usb_device_is_text_of_the_port_usb(tmp_path: Path) -> None:
    path = tmp_path / "echo.toml"
    path.write_text(
        f'firmware = "{FIRMWARE / "usb_echo.elf"}"\nworld = "arena"\nbody = "kinematic"\nmode = "direct"\n'
        'duration_s = 2.0\nrecord = "usb"\n[[goal]]\nkind = "happens"\nevent = "usb sends HELLO"\n'
    )
    bench = Bench(load_scenario(str(path)))
    board: Any = bench.parts.chip
    board.usb_serial.receive(b"hello\n")
    bench.run_until("usb sends HELLO")
    bench.run_until("2 s")
    texts = [event for event in events_of(bench.trace.lines()) if isinstance(event, Text)]
    assert [(text.port, text.data) for text in texts] == [("usb", b"HELLO\n")]
    assert not bench.judge().missed


def test_what_is_not_recorded_cannot_be_waited_for(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"\[\[goal\]\] 1: event: i2c1 is not recorded"):
        bench_of(tmp_path, "", GOALS)
    with pytest.raises(ScenarioError, match="there is no bus 'i2c3'"):
        bench_of(tmp_path, 'record = "i2c3"\n')
    bench = bench_of(tmp_path)
    with pytest.raises(UsageError, match="spi1 is not recorded"):
        bench.run_until("spi1 sends 9f")
    with pytest.raises(UsageError, match="there is no bus 'spi9'"):
        bench.scenario.with_options(record="spi9,i2c1")
    assert bench.scenario.with_options(record="can, i2c1").record == ("i2c1", "can")


@pytest.mark.parametrize("words", [
    "i2c1", "i2c1 writes", "i2c1 writes 0x400", "i2c1 writes 0x3c zz", "i2c1 fails 3", "spi1 sends", "spi1 sends zz",
    "can hears 0x20000000", "can shouts 1", "usb",
])  # fmt: skip
def test_words_that_mean_no_transfer_are_refused(words: str) -> None:
    with pytest.raises(UsageError, match="are not understood"):
        select(words)
