"""Single bits on CAN_TX and CAN_RX while somebody looks: decoded by the standard, they are the frames of the bus."""

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.fabric.subscriptions import EDGE, FLOATING, LOW, Of
from bluepill_sim.parts import CanFrame, CanNode
from tests.bluepill_sim.peripherals.buses.test_can import (
    BIT_NS,
    FRAMES,
    LOOP,
    SILENT,
    TERR,
    TXOK,
    network,
    send,
    set_up,
    span_ns,
    standard_bits,
)

QUICK = settings(max_examples=40)
TX, RX = "PA12", "PA11"


class Line:
    """Who looks at a pin."""

    def __init__(self, chip: Any, name: str) -> None:
        self._rows: list[bytes] = []
        self.subscription = chip.pins.subscribe_pins([name], self._rows.append, of=Of.WIRE)

    @property
    def edges(self) -> list[tuple[int, int]]:
        rows = EDGE.iter_unpack(b"".join(self._rows))
        return [(row[0], 0 if row[3] == LOW else 1) for row in rows if row[3] != FLOATING]

    def bits(self, until_ns: int, bit_ns: int = BIT_NS) -> list[int]:
        """The line in the midst of each bit from its first fall on."""
        edges = self.edges
        start_ns = next((ns for ns, level in edges if level == 0), until_ns)
        samples = range(start_ns + bit_ns // 2, until_ns, bit_ns)
        return [[level for ns, level in edges if ns <= at_ns][-1] for at_ns in samples]


def taken(bits: list[int]) -> tuple[CanFrame, int, list[int]]:
    """Read a frame (ISO 11898-1, 10): return it, its acknowledge, and the bits behind that. Its CRC is right."""
    at, run, last = 0, 0, 2
    plain: list[int] = []

    def read(count: int) -> int:
        nonlocal at, run, last
        value = 0
        for _ in range(count):
            if run == 5:
                assert bits[at] != last, "a stuff bit is missing"
                run, last, at = 1, bits[at], at + 1
            bit = bits[at]
            run, last, at = run + 1 if bit == last else 1, bit, at + 1
            plain.append(bit)
            value = value << 1 | bit
        return value

    assert read(1) == 0, "SOF"
    identifier, remote, is_extended = read(11), read(1), read(1)
    if is_extended:
        assert remote == 1, "SRR"
        identifier = identifier << 18 | read(18)
        remote = read(1)
        assert read(2) == 0, "r1, r0"
    else:
        assert read(1) == 0, "r0"
    dlc = read(4)
    data = b"" if remote else bytes(read(8) for _ in range(min(dlc, 8)))
    number = int("".join(map(str, plain)), 2) << 15
    for place in range(number.bit_length() - 1, 14, -1):
        number ^= 0xC599 << place - 15 if number >> place & 1 else 0
    assert read(15) == number, "the CRC"
    if run == 5:
        assert bits[at] != last
        at += 1
    assert bits[at] == 1, "its delimiter"
    frame = CanFrame(
        identifier=identifier, data=data, is_extended=bool(is_extended), is_remote=bool(remote),
        remote_bytes=dlc if remote else 0,
    )  # fmt: skip
    return frame, bits[at + 1], bits[at + 2 :]


def fill(chip: Any, frame: CanFrame) -> None:
    flags = (4 if frame.is_extended else 0) | (2 if frame.is_remote else 0)
    send(chip, frame.identifier, bytes(frame.remote_bytes) if frame.is_remote else frame.data, flags=flags)


@QUICK
@given(FRAMES)
def test_the_bits_of_an_own_frame_are_on_both_lines_with_their_acknowledge(
    make_fake_chip: Any, frame: CanFrame
) -> None:
    chip = make_fake_chip()
    node = CanNode()
    network(chip, node)
    set_up(chip)
    tx, rx, start_ns = Line(chip, TX), Line(chip, RX), chip.now_ns
    fill(chip, frame)
    chip.advance(start_ns + span_ns(frame) + 20 * BIT_NS)
    end_ns = start_ns + span_ns(frame)
    assert [one for _, one in node.received] == [frame]
    assert tx.edges[0] == rx.edges[0] == (start_ns, 0)
    sent, acknowledge, tail = taken(rx.bits(end_ns))
    assert (sent, acknowledge, tail) == (frame, 0, [1] * 8)
    own, acknowledge, tail = taken(tx.bits(end_ns))
    assert (own, acknowledge, tail) == (frame, 1, [1] * 8)
    assert (chip.pins[TX].level, chip.pins[RX].level) == (True, True)


@QUICK
@given(FRAMES, st.booleans())
def test_of_another_node_the_chip_puts_the_acknowledge_on_the_line(
    make_fake_chip: Any, frame: CanFrame, is_silent: bool
) -> None:
    chip = make_fake_chip()
    node = CanNode()
    other = CanNode()
    bus = network(chip, node, other)
    set_up(chip, SILENT if is_silent else 0)
    tx, rx, start_ns = Line(chip, TX), Line(chip, RX), chip.now_ns
    node.send(frame, start_ns + 12_345)
    end_ns = start_ns + 12_345 + span_ns(frame)
    chip.advance(end_ns + 3 * BIT_NS)
    assert bus.next_ns is None
    assert taken(rx.bits(end_ns))[:2] == (frame, 0)
    assert tx.edges == [] if is_silent else [level for _, level in tx.edges] == [0, 1]
    if not is_silent:
        assert [end_ns - ns for ns, _ in tx.edges] == [9 * BIT_NS, 8 * BIT_NS]


@QUICK
@given(
    st.builds(CanFrame, identifier=st.integers(0, 0x7FF), data=st.binary(max_size=2)),
    st.builds(CanFrame, identifier=st.integers(0, 0x7FF), data=st.binary(max_size=2)),
)
def test_who_loses_the_arbitration_is_silent_from_the_bit_at_which_it_loses(
    make_fake_chip: Any, own: CanFrame, other: CanFrame
) -> None:
    if own.identifier <= other.identifier:
        own, other = other, own
    if own.identifier == other.identifier:
        return
    chip = make_fake_chip()
    node = CanNode()
    network(chip, node)
    set_up(chip)
    tx, rx, start_ns = Line(chip, TX), Line(chip, RX), chip.now_ns
    node.send(other, start_ns)
    fill(chip, own)
    end_ns = start_ns + span_ns(other)
    chip.advance(end_ns)
    assert taken(rx.bits(end_ns))[0] == other
    dominant = [n for n, bit in enumerate(tx.bits(end_ns)) if bit == 0]
    bus, mine = rx.bits(end_ns), tx.bits(end_ns)
    lost = next(n for n, (one, all_) in enumerate(zip(mine, bus, strict=True)) if one != all_)
    frames = zip(standard_bits(own), standard_bits(other), strict=False)
    assert lost == next(n for n, (one, winner) in enumerate(frames) if one != winner)
    assert mine[:lost] == bus[:lost]
    assert [n for n in dominant if n >= lost] == [len(bus) - 9], "its acknowledge alone"
    chip.advance(end_ns + 3 * BIT_NS + span_ns(own) + BIT_NS)
    assert [one for _, one in node.received] == [own]


@pytest.mark.parametrize(("is_damaged", "error"), [(True, TERR), (False, TERR)])
def test_a_frame_that_fails_is_followed_by_a_flag_of_six_dominant_bits(
    fake_chip: Any, is_damaged: bool, error: int
) -> None:
    node = CanNode(is_silent=not is_damaged)
    bus = network(fake_chip, node)
    set_up(fake_chip, control=1 << 4)
    if is_damaged:
        bus.damage()
    rx, start_ns = Line(fake_chip, RX), fake_chip.now_ns
    send(fake_chip, 0x123, b"\x55")
    end_ns = start_ns + 200 * BIT_NS
    fake_chip.advance(end_ns)
    frame, acknowledge, tail = taken(rx.bits(end_ns))
    assert (frame, acknowledge) == (CanFrame(identifier=0x123, data=b"\x55"), 1)
    assert tail[:7] == [0] * 6 + [1]
    assert all(tail[6:])
    assert fake_chip.read("CAN.TSR") & error


@pytest.mark.parametrize(("mode", "shows"), [(LOOP, True), (LOOP | SILENT, False)])
def test_a_loop_back_frame_is_seen_on_tx_and_on_no_rx(fake_chip: Any, mode: int, shows: bool) -> None:
    set_up(fake_chip, mode)
    tx, rx, start_ns = Line(fake_chip, TX), Line(fake_chip, RX), fake_chip.now_ns
    send(fake_chip, 0x7FF, b"\x00")
    end_ns = start_ns + 100 * BIT_NS
    fake_chip.advance(end_ns)
    assert bool(tx.edges) is shows
    assert not shows or taken(tx.bits(end_ns))[:2] == (CanFrame(identifier=0x7FF, data=b"\x00"), 1)
    assert rx.edges == []


def test_what_a_frame_does_is_the_same_whether_or_not_somebody_looks(make_fake_chip: Any) -> None:
    found = []
    for looks in (False, True):
        chip = make_fake_chip()
        heard: list[Any] = []
        node = CanNode(lambda _frame, at_ns, heard=heard: heard.append(at_ns))
        network(chip, node)
        set_up(chip)
        chip.parts.by_name["CAN"].subscribe(heard.extend)
        lines = [Line(chip, TX), Line(chip, RX)] if looks else []
        start_ns = chip.now_ns
        send(chip, 0x100, b"ab")
        node.send(CanFrame(identifier=0x80), start_ns)
        chip.advance(start_ns + 40 * BIT_NS)
        if lines:
            lines[0].subscription.close()
        chip.advance(start_ns + 300 * BIT_NS)
        state = (
            chip.read("CAN.TSR"),
            chip.read("CAN.RF0R"),
            heard,
            node.received,
            chip.pins[TX].level,
            chip.pins[RX].level,
        )
        found.append(state)
    assert found[0] == found[1]
    assert found[0][0] & TXOK


def test_a_chip_that_is_reset_goes_on_with_the_frames_of_others(fake_chip: Any) -> None:
    node, other = CanNode(), CanNode()
    network(fake_chip, node, other)
    set_up(fake_chip)
    rx, start_ns, frame = Line(fake_chip, RX), fake_chip.now_ns, CanFrame(identifier=0x2A5, data=b"\x0f")
    node.send(frame, start_ns + 7 * BIT_NS)
    fake_chip.parts.by_name["CAN"].reset()
    end_ns = start_ns + 7 * BIT_NS + span_ns(frame)
    fake_chip.advance(end_ns + BIT_NS)
    assert [one for _, one in other.received] == [frame]
    assert [level for _, level in rx.edges][::2] == [0] * (len(rx.edges) // 2)
    assert rx.edges[0] == (start_ns + 7 * BIT_NS, 0)


@QUICK
@given(st.integers(0, 400))
def test_a_chip_that_comes_late_is_never_due_when_it_has_just_acted(make_fake_chip: Any, late_bits: int) -> None:
    chip = make_fake_chip()
    node = CanNode(is_silent=True)
    network(chip, node)
    set_up(chip, SILENT)
    Line(chip, RX)
    can = chip.parts.by_name["CAN"]
    node.send(CanFrame(identifier=0x101, data=b"\x01"), chip.now_ns)  # again and again, as nobody acknowledges
    can.due_ns = None
    chip.advance(chip.now_ns + late_bits * BIT_NS + 1)
    can.advance_to(chip.now_ns)
    assert can.due_ns is not None
    assert can.due_ns > chip.now_ns
