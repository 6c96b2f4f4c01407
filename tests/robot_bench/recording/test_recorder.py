"""The recorder tells every wire's level at time 0 and each change of it once, whatever the order of telling."""

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.peripherals.i2c import I2cStep, I2cSymbol
from bluepill_sim.peripherals.spi import SpiWord
from p2os.errors import LocalProtocolError
from robot_bench.events.kinds import I2cTransfer, SpiTransfer, Text
from robot_bench.recording.recorder import LONGEST_TEXT, Recorder
from robot_bench.recording.run_record import record_of
from robot_bench.recording.trace import TraceWriter
from robot_bench.recording.transfers import I2cTransfers, SpiTransfers
from robot_bench.wires.nets import Harness, Net, Strength

NETS = ("DD1", "DD2")
END = 12

#: (ns, net, owner, level, strength): what one owner does to one wire.
drives = st.tuples(
    st.integers(0, 3) | st.integers(0, END),
    st.sampled_from(NETS),
    st.sampled_from(("board", "sensor", "bluepill")),
    st.booleans(),
    st.sampled_from(Strength),
)
Reported = list[tuple[str, int, int]]


def reported(trace: TraceWriter) -> Reported:
    """Return (net, ns, level) of each recorded level, sorted by net and time."""
    pins = record_of(trace.text.splitlines(keepends=True)).pins
    return sorted((net, at, level) for net, edges in pins.items() for at, level in edges)


def settled(idle: bool, wanted: list[tuple[int, str, str, bool, Strength]]) -> Reported:
    """Return what the wires do when every drive is known beforehand."""
    harness = Harness(Net(name, idle=idle) for name in NETS)
    for at, net, owner, level, strength in wanted:
        harness[net].drive(owner, level, strength, at)
    found: Reported = []
    for name in NETS:
        levels = [int(harness[name].level(at)) for at in range(END + 1)]
        found.append((name, 0, levels[0]))
        found += [(name, at, levels[at]) for at in range(1, END + 1) if levels[at] != levels[at - 1]]
    return sorted(found)


@given(idle=st.booleans(), wanted=st.lists(drives, max_size=24), data=st.data())
def test_every_wire_is_reported_as_if_all_had_been_known_beforehand(
    idle: bool, wanted: list[tuple[int, str, str, bool, Strength]], data: st.DataObject
) -> None:
    wanted.sort(key=lambda drive: drive[0])
    before = data.draw(st.integers(0, sum(at == 0 for at, *_ in wanted)), label="driven before the recorder starts")
    trace = TraceWriter()
    harness = Harness(Net(name, idle=idle) for name in NETS)
    recorder = Recorder(trace, harness, body=None, sample_ns=data.draw(st.integers(1, 5), label="sample_ns"))
    for place, (at, net, owner, level, strength) in enumerate(wanted):
        if place == before:
            recorder.start()
        if place >= before and data.draw(st.booleans(), label="pass"):
            recorder.advance_to(at)
        harness[net].drive(owner, level, strength, at)
    if before == len(wanted):
        recorder.start()
    recorder.finish(END)
    assert reported(trace) == settled(idle, wanted)


def test_a_sensor_that_first_drives_at_time_0_is_recorded_as_it_is_and_not_as_its_pull() -> None:
    trace, harness = TraceWriter(), Harness([Net("DD3")])
    harness["DD3"].drive("board", True, Strength.PULL, 0)
    recorder = Recorder(trace, harness, body=None)
    recorder.start()
    recorder.advance_to(0)
    harness["DD3"].drive("sensor", False, Strength.PUSH_PULL, 0)
    recorder.finish(10)
    assert reported(trace) == [("DD3", 0, 0)]


def test_a_run_that_ends_at_time_0_has_every_level() -> None:
    trace, harness = TraceWriter(), Harness([Net("DD1"), Net("DD2", idle=True)])
    recorder = Recorder(trace, harness, body=None)
    recorder.start()
    recorder.finish(0)
    assert reported(trace) == [("DD1", 0, 0), ("DD2", 0, 1)]


def test_a_drive_at_an_instant_whose_edges_were_reported_is_a_bug_and_not_lost() -> None:
    net = Net("DD1")
    net.edges_until(5)
    with pytest.raises(LocalProtocolError, match="sensor drives DD1 at 5 ns after its edges up to 5 ns were reported"):
        net.drive("sensor", True, Strength.PUSH_PULL, 5)
    net.drive("sensor", True, Strength.PUSH_PULL, 6)
    assert net.edges_until(6) == [(6, True)]


WORDS = st.lists(st.sampled_from([10, 65, 66, 0x10A, 0x1FF]), max_size=200)


@given(words=WORDS, cuts=st.lists(st.integers(0, 200), max_size=6))
@settings(max_examples=60)
def test_characters_in_any_portions_make_the_lines_that_they_make_one_by_one(words: list[int], cuts: list[int]) -> None:
    rows = [(word, 100 + 7 * n) for n, word in enumerate(words)]
    texts: list[Text] = []
    recorder = Recorder(TraceWriter(), Harness([]), body=None)
    recorder.events.subscribe(texts.append, Text)
    for first, last in pairwise([0, *sorted(cuts), len(rows)]):
        recorder.usart(rows[first:last])
    recorder.events.release(10**6)
    expected, line = [], bytearray()
    for word, at in rows:
        line.append(word & 0xFF)
        if word == 10 or len(line) == LONGEST_TEXT:
            expected.append(Text(t=at, data=bytes(line)))
            line.clear()
    assert texts == expected
    assert recorder.unfinished_text == line


#: Where something comes from, and what.
SENT = st.lists(st.tuples(st.sampled_from(["usart1", "usart2", "usb", "spi1", "i2c1"]), st.sampled_from([10, 65, 66])))


@given(sent=SENT, passes=st.sets(st.integers(0, 30)))
@settings(max_examples=60)
def test_a_run_that_ends_anywhere_has_all_that_came_before(sent: list[tuple[str, int]], passes: set[int]) -> None:
    """Lines without an end, words of an SPI before the pause, and bytes of an I2C before the STOP."""
    recorder = Recorder(TraceWriter(), Harness([]), body=None)
    recorded = {name: bytearray() for name in ("usart1", "usart2", "usb", "spi1", "i2c1")}
    recorder.events.subscribe(lambda event: recorded[event.port].extend(event.data), Text)
    recorder.events.subscribe(lambda event: recorded[event.bus].extend(event.from_master), SpiTransfer)
    recorder.events.subscribe(lambda event: recorded[event.bus].extend(event.data), I2cTransfer)
    spi, i2c = SpiTransfers("spi1", recorder.events.publish), I2cTransfers("i2c1", recorder.events.publish)
    recorder.transfers |= {"spi1": spi, "i2c1": i2c}
    i2c.take([I2cSymbol(1, I2cStep.START, 0, False), I2cSymbol(2, I2cStep.BYTE, 0xA0, True)])
    at = 10
    for number, (name, word) in enumerate(sent):
        at += 20_000
        if name == "spi1":
            spi.take([SpiWord(at, word, 0, 8, 1_000)])
        elif name == "i2c1":
            i2c.take([I2cSymbol(at, I2cStep.BYTE, word, True)])
        else:
            recorder.usart([(word, at)], name)
        if number in passes:
            recorder.advance_to(at + 1)
    recorder.finish(at + 1)
    assert recorded == {name: bytes(word for place, word in sent if place == name) for name in recorded}
