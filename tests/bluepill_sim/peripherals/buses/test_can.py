"""bxCAN: the length of frames, mailboxes, filters, FIFOs, errors, modes; and a network of chips and nodes."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim import BluePill
from bluepill_sim.fabric.can_network import stuffed_bits
from bluepill_sim.parts import CanFrame, CanNetwork, CanNode

INRQ, SLEEP, TXFP, RFLM, NART, AWUM, ABOM, TTCM, RESET = (1 << n for n in (0, 1, 2, 3, 4, 5, 6, 7, 15))
INAK, SLAK, ERRI, WKUI, SLAKI = (1 << n for n in range(5))
RQCP, TXOK, ALST, TERR, ABRQ = (1 << n for n in (0, 1, 2, 3, 7))
FULL, FOVR, RFOM = (1 << n for n in (3, 4, 5))
TMEIE, FMPIE0, FFIE0, FOVIE0, FMPIE1, EWGIE, EPVIE, BOFIE, LECIE, ERRIE, WKUIE = (
    1 << n for n in (0, 1, 2, 3, 4, 8, 9, 10, 11, 15, 16)
)
EWGF, EPVF, BOFF = 1, 2, 4
LOOP, SILENT = 1 << 30, 1 << 31
#: 8 MHz / (2 * (1 + 5 + 2)) = 500 kbit/s: a bit is 2 us.
TIMING, BIT_NS = 1 | 4 << 16 | 1 << 20, 2000
QUICK = settings(max_examples=60)
Chips = Callable[[], Any]


def set_up(chip: Any, mode: int = 0, control: int = 0, *, is_open: bool = True) -> None:
    """CAN on PA11 and PA12, on the bus, with a filter that lets all in; time 0 is when it has synchronised."""
    chip.write("GPIOA.CRH", 0x444B_4444)
    chip.write("CAN.MCR", INRQ | control)
    chip.write("CAN.BTR", TIMING | mode)
    if is_open:
        chip.write("CAN.FMR", 1)
        chip.write("CAN.FS1R", 1)
        chip.write("CAN.FA1R", 1)
        chip.write("CAN.FMR", 0)
    chip.write("CAN.MCR", control)
    chip.advance(chip.now_ns + 11 * BIT_NS)
    assert not chip.read("CAN.MSR") & (INAK | SLAK)


def network(chip: Any, *nodes: CanNode) -> CanNetwork:
    one = CanNetwork()
    chip.parts.by_name["CAN"].attach(one)
    for node in nodes:
        one.join(node)
    return one


def send(chip: Any, identifier: int, data: bytes = b"", mailbox: int = 0, *, flags: int = 0, control: int = 0) -> None:
    """Fill a mailbox and ask for it."""
    padded = data.ljust(8, b"\0")
    chip.write(f"CAN.TDT{mailbox}R", len(data) | control)
    chip.write(f"CAN.TDL{mailbox}R", int.from_bytes(padded[:4], "little"))
    chip.write(f"CAN.TDH{mailbox}R", int.from_bytes(padded[4:], "little"))
    chip.write(f"CAN.TI{mailbox}R", (identifier << 3 if flags & 4 else identifier << 21) | flags | 1)


def span_ns(frame: CanFrame) -> int:
    """From its start to the end of EOF."""
    return (stuffed_bits(frame) + 10) * BIT_NS


def standard_bits(frame: CanFrame) -> str:
    """The manual's way, as text: fields, CRC by long division, a stuff bit behind five alike."""
    identifier, remote = frame.identifier, int(frame.is_remote)
    if frame.is_extended:
        text = f"0{identifier >> 18:011b}11{identifier & 0x3FFFF:018b}{remote}00{frame.dlc:04b}"
    else:
        text = f"0{identifier:011b}{remote}00{frame.dlc:04b}"
    text += "".join(f"{byte:08b}" for byte in frame.data)
    number = int(text, 2) << 15
    for place in range(number.bit_length() - 1, 14, -1):
        if number >> place & 1:
            number ^= 0xC599 << place - 15
    text += f"{number:015b}"
    made, n = "", 0
    while n < len(text):
        made += text[n]
        if len(made) >= 5 and made[-5:] in {"00000", "11111"} and len(set(made[-5:])) == 1:
            run = len(made) - len(made.rstrip(made[-1]))
            if run == 5:
                made += "1" if made[-1] == "0" else "0"
        n += 1
    return made


FRAMES = st.one_of(
    st.builds(CanFrame, identifier=st.integers(0, 0x7FF), data=st.binary(max_size=8)),
    st.builds(
        CanFrame, identifier=st.integers(0, (1 << 29) - 1), data=st.binary(max_size=8), is_extended=st.just(True)
    ),
    st.builds(
        CanFrame, identifier=st.integers(0, 0x7FF), is_remote=st.just(True), remote_bytes=st.integers(0, 8)
    ),
)  # fmt: skip


@settings(max_examples=200)
@given(FRAMES)
def test_a_frame_is_as_long_as_its_bits(frame: CanFrame) -> None:
    assert stuffed_bits(frame) == len(standard_bits(frame))


@pytest.mark.parametrize("settings_", [{"identifier": 0x800}, {"identifier": 1, "data": bytes(9)}, {"identifier": -1},
                                       {"identifier": 1, "is_remote": True, "data": b"1"}])  # fmt: skip
def test_a_frame_that_cannot_be_is_refused(settings_: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="CAN"):
        CanFrame(**settings_)


def test_leaving_initialisation_takes_eleven_bits(fake_chip: Any) -> None:
    assert fake_chip.read("CAN.MSR") & (INAK | SLAK) == SLAK
    fake_chip.write("CAN.MCR", INRQ)
    assert fake_chip.read("CAN.MSR") & (INAK | SLAK) == INAK
    fake_chip.write("CAN.BTR", TIMING)
    fake_chip.write("CAN.MCR", 0)
    start_ns = fake_chip.now_ns
    fake_chip.advance(start_ns + 11 * BIT_NS - 1)
    assert fake_chip.read("CAN.MSR") & INAK
    fake_chip.advance(start_ns + 11 * BIT_NS)
    assert not fake_chip.read("CAN.MSR") & INAK
    fake_chip.write("CAN.BTR", 0)
    assert fake_chip.read("CAN.BTR") == TIMING, "written in initialisation only"


def test_a_bus_held_dominant_keeps_it_in_initialisation(fake_chip: Any) -> None:
    fake_chip.write("CAN.MCR", INRQ)
    fake_chip.pins["PA11"].drive(0)
    fake_chip.write("CAN.MCR", 0)
    fake_chip.advance(10**6)
    assert fake_chip.read("CAN.MSR") & INAK
    fake_chip.pins["PA11"].drive(1)
    fake_chip.advance(2 * 10**6)
    assert not fake_chip.read("CAN.MSR") & INAK


def test_a_frame_is_sent_at_its_last_bit_and_heard_by_all(fake_chip: Any) -> None:
    node, other = CanNode(), CanNode()
    network(fake_chip, node, other)
    set_up(fake_chip)
    fake_chip.write("CAN.IER", TMEIE)
    frame = CanFrame(identifier=0x123, data=b"\x01\x02\x03")
    start_ns = fake_chip.now_ns
    send(fake_chip, 0x123, b"\x01\x02\x03")
    assert not fake_chip.read("CAN.TSR") >> 26 & 1
    fake_chip.advance(start_ns + span_ns(frame) - 1)
    assert not fake_chip.read("CAN.TSR") & RQCP
    fake_chip.advance(start_ns + span_ns(frame))
    assert fake_chip.read("CAN.TSR") == 0x1C00_0000 | RQCP | TXOK
    assert fake_chip.irqs[19]
    assert node.received == other.received == [(start_ns + span_ns(frame), frame)]
    fake_chip.write("CAN.TSR", RQCP)
    assert fake_chip.read("CAN.TSR") == 0x1C00_0000
    assert not fake_chip.irqs[19]
    assert not fake_chip.read("CAN.TI0R") & 1


@pytest.mark.parametrize(("control", "order"), [(0, [0x100, 0x200, 0x300]), (TXFP, [0x300, 0x100, 0x200])])
def test_mailboxes_go_by_identifier_or_by_request(fake_chip: Any, control: int, order: list[int]) -> None:
    node = CanNode()
    network(fake_chip, node)
    set_up(fake_chip, control=control)
    node.send(CanFrame(identifier=0x000))
    for mailbox, identifier in enumerate((0x300, 0x100, 0x200)):
        send(fake_chip, identifier, mailbox=mailbox)
    assert fake_chip.read("CAN.TSR") >> 26 & 7 == 0
    assert fake_chip.read("CAN.TSR") >> 29 == 1 << order.index(0x200) % 3 if control else True
    fake_chip.advance(fake_chip.now_ns + 10**6)
    assert [frame.identifier for _, frame in node.received] == order


def test_the_lowest_identifier_wins_the_bus_and_the_others_follow(fake_chip: Any) -> None:
    node, ear = CanNode(), CanNode()
    network(fake_chip, node, ear)
    set_up(fake_chip)
    node.send(CanFrame(identifier=0x101))
    node.send(CanFrame(identifier=0x101 << 18, is_extended=True))
    send(fake_chip, 0x101, b"x")
    send(fake_chip, 0x100, mailbox=1)
    fake_chip.advance(fake_chip.now_ns + 2 * 10**6)
    heard = [(frame.identifier, frame.data, frame.is_extended) for _, frame in ear.received]
    assert [row[0] for row in heard] == [0x100, 0x101, 0x101, 0x101 << 18]
    assert heard[-1][2], "a standard one beats an extended one of its identifier"
    ends = [at_ns for at_ns, _ in ear.received]
    frames = [frame for _, frame in ear.received]
    for (end_ns, later_ns), frame in zip(pairwise(ends), frames[1:], strict=True):
        assert later_ns - end_ns == 3 * BIT_NS + span_ns(frame), "three bits stand between"


@pytest.mark.parametrize("control", [NART, 0])
def test_a_lost_arbitration_ends_a_request_only_without_retransmission(fake_chip: Any, control: int) -> None:
    node = CanNode()
    network(fake_chip, node)
    set_up(fake_chip, control=control)
    node.send(CanFrame(identifier=1))
    send(fake_chip, 2)
    fake_chip.advance(fake_chip.now_ns + 30 * BIT_NS)
    assert bool(fake_chip.read("CAN.TSR") & (RQCP | ALST) == RQCP | ALST) is bool(control)
    fake_chip.advance(fake_chip.now_ns + 10**6)
    assert [frame.identifier for _, frame in node.received] == ([] if control else [2])


def test_a_request_that_waits_can_be_taken_back_and_one_on_the_bus_cannot(fake_chip: Any) -> None:
    node = CanNode()
    network(fake_chip, node)
    set_up(fake_chip)
    send(fake_chip, 1)
    send(fake_chip, 2, mailbox=1)
    fake_chip.advance(fake_chip.now_ns + 30 * BIT_NS)
    fake_chip.write("CAN.TSR", ABRQ | ABRQ << 8)
    assert fake_chip.read("CAN.TSR") & 0x8383 == RQCP << 8 | ABRQ, "what waits goes at once"
    fake_chip.advance(fake_chip.now_ns + 10**6)
    assert [frame.identifier for _, frame in node.received] == [1]
    assert fake_chip.read("CAN.TSR") & 0x8383 == RQCP << 8 | RQCP | TXOK


@pytest.mark.parametrize("register", ["TI1R", "TDT1R", "TDL1R", "TDH1R"])
def test_a_mailbox_is_written_only_while_it_is_empty(fake_chip: Any, register: str) -> None:
    network(fake_chip, CanNode())
    set_up(fake_chip)
    send(fake_chip, 5, b"12345678", mailbox=1)
    before = fake_chip.read(f"CAN.{register}")
    fake_chip.write(f"CAN.{register}", 0)
    assert fake_chip.read(f"CAN.{register}") == before
    assert "CAN:mailbox" in fake_chip.warnings
    fake_chip.advance(fake_chip.now_ns + 10**6)
    fake_chip.write(f"CAN.{register}", 0)
    assert fake_chip.read(f"CAN.{register}") & 0xFFFF == 0


def receive(chip: Any, node: CanNode, *frames: CanFrame) -> None:
    for frame in frames:
        node.send(frame)
    chip.advance(chip.now_ns + len(frames) * 200 * BIT_NS)


def test_a_fifo_holds_three_and_then_overwrites_or_locks(make_fake_chip: Chips) -> None:
    for control, kept in ((0, [1, 2, 5]), (RFLM, [1, 2, 3])):
        chip, node = make_fake_chip(), CanNode()
        network(chip, node)
        set_up(chip, control=control)
        chip.write("CAN.IER", FMPIE0)
        receive(chip, node, *(CanFrame(identifier=n) for n in (1, 2)))
        assert (chip.read("CAN.RF0R"), chip.irqs[20]) == (2, True)
        receive(chip, node, CanFrame(identifier=3))
        assert chip.read("CAN.RF0R") == 3 | FULL
        receive(chip, node, *(CanFrame(identifier=n) for n in (4, 5)))
        assert chip.read("CAN.RF0R") == 3 | FULL | FOVR
        got = []
        for left in (2, 1, 0):
            got.append(chip.read("CAN.RI0R") >> 21)
            chip.write("CAN.RF0R", RFOM)
            assert chip.read("CAN.RF0R") & 3 == left
        assert got == kept
        assert not chip.irqs[20]
        chip.write("CAN.RF0R", FULL | FOVR)
        assert chip.read("CAN.RF0R") == 0


def test_what_is_received_stands_in_the_registers(fake_chip: Any) -> None:
    node = CanNode()
    network(fake_chip, node)
    set_up(fake_chip, control=TTCM)
    receive(fake_chip, node, CanFrame(identifier=0x1ABCDEF0, data=b"\x11\x22\x33\x44\x55", is_extended=True))
    assert fake_chip.read("CAN.RI0R") == 0x1ABCDEF0 << 3 | 4
    assert fake_chip.read("CAN.RDT0R") & 0xFFFF == 5
    assert (fake_chip.read("CAN.RDL0R"), fake_chip.read("CAN.RDH0R")) == (0x4433_2211, 0x55)
    start_bit = fake_chip.read("CAN.RDT0R") >> 16
    fake_chip.write("CAN.RF0R", RFOM)
    receive(fake_chip, node, CanFrame(identifier=1, is_remote=True, remote_bytes=8))
    assert fake_chip.read("CAN.RI0R") == 1 << 21 | 2
    assert fake_chip.read("CAN.RDT0R") & 15 == 8
    assert (fake_chip.read("CAN.RDT0R") >> 16) - start_bit == 200, "stamps count bits"


# A plain model of the filters: each as text with don't-care places.


def passes(frame: CanFrame, word: int, mask: int, *, is_wide: bool) -> bool:
    base = frame.identifier >> 18 if frame.is_extended else frame.identifier
    low = frame.identifier & 0x3FFFF if frame.is_extended else 0
    text = f"{base:011b}"
    if is_wide:
        text += f"{low:018b}{int(frame.is_extended)}{int(frame.is_remote)}"
        return all(not int(m) or t == w for t, w, m in zip(text, f"{word:032b}", f"{mask:032b}", strict=False))
    text += f"{int(frame.is_remote)}{int(frame.is_extended)}{low >> 15:03b}"
    return all(not int(m) or t == w for t, w, m in zip(text, f"{word:016b}", f"{mask:016b}", strict=True))


BANKS = st.lists(
    st.tuples(st.booleans(), st.booleans(), st.booleans(), st.booleans(), st.integers(0, 5), st.integers(0, 5)),
    min_size=14, max_size=14,
)  # fmt: skip


@QUICK
@given(BANKS, st.lists(FRAMES, min_size=1, max_size=3), st.data())
def test_filters_are_those_of_a_plain_model(
    make_fake_chip: Chips, banks: list[tuple[bool, bool, bool, bool, int, int]], frames: list[CanFrame], data: Any
) -> None:
    chip, node = make_fake_chip(), CanNode()
    network(chip, node)
    set_up(chip, is_open=False)
    chip.write("CAN.FMR", 1)
    rules: list[tuple[int, int, int, int]] = []  # wide before narrow, list before mask, number, FIFO
    numbers = [0, 0]
    words = []
    for is_wide, is_list, is_active, fifo, _, _ in banks:
        del is_active, fifo
        pool = [wide(frame) if is_wide else narrow(frame) for frame in frames]
        words.append([data.draw(st.sampled_from([*pool, 0, 0xFFFF_FFFF if is_list else 0])) for _ in range(2)])
    for n, one in enumerate(words):
        for k in range(2):
            chip.write(f"CAN.F{n}R{k + 1}", one[k])
    for name, place in (("FS1R", 0), ("FM1R", 1), ("FA1R", 2), ("FFA1R", 3)):
        chip.write(f"CAN.{name}", sum(int(bank[place]) << n for n, bank in enumerate(banks)))
    chip.write("CAN.FMR", 0)
    frame = frames[0]
    for (is_wide, is_list, is_active, fifo, _, _), (one, two) in zip(banks, words, strict=True):
        if is_wide:
            tests = [(one, 0xFFFF_FFFE), (two, 0xFFFF_FFFE)] if is_list else [(one, two)]
        else:
            parts = [one & 0xFFFF, one >> 16, two & 0xFFFF, two >> 16]
            tests = [(part, 0xFFFF) for part in parts] if is_list else [(parts[0], parts[1]), (parts[2], parts[3])]
        for word, mask in tests:
            if is_active and passes(frame, word, mask, is_wide=is_wide):
                rules.append((not is_wide, not is_list, numbers[fifo], int(fifo)))
            numbers[fifo] += 1
    receive(chip, node, frame)
    counts = [chip.read(f"CAN.RF{n}R") & 3 for n in range(2)]
    if not rules:
        assert counts == [0, 0]
        return
    _, _, number, fifo_number = min(rules)
    assert counts == [1 - fifo_number, fifo_number]
    assert chip.read(f"CAN.RDT{fifo_number}R") >> 8 & 0xFF == number


def wide(frame: CanFrame) -> int:
    return (frame.identifier << 3 | 4 if frame.is_extended else frame.identifier << 21) | int(frame.is_remote) << 1


def narrow(frame: CanFrame) -> int:
    base = frame.identifier >> 18 if frame.is_extended else frame.identifier
    low = frame.identifier >> 15 & 7 if frame.is_extended else 0
    return (base << 5 | int(frame.is_remote) << 4 | int(frame.is_extended) << 3 | low) * 0x1_0001


def test_modes_of_filters_need_finit(fake_chip: Any) -> None:
    fake_chip.write("CAN.FMR", 0)
    fake_chip.write("CAN.FM1R", 5)
    assert fake_chip.read("CAN.FM1R") == 0
    assert "CAN:finit" in fake_chip.warnings


@pytest.mark.parametrize("half", [0, 1, 26, 27])
def test_a_bank_that_is_on_is_written_only_while_filters_are_initialised(fake_chip: Any, half: int) -> None:
    bank = f"CAN.F{half // 2}R{half % 2 + 1}"
    fake_chip.write("CAN.FMR", 0)
    fake_chip.write(bank, 1)
    fake_chip.write("CAN.FA1R", 1 << half // 2)
    fake_chip.write(bank, 2)
    assert fake_chip.read(bank) == 1
    assert "CAN:bank" in fake_chip.warnings
    fake_chip.write("CAN.F5R1", 3)
    assert fake_chip.read("CAN.F5R1") == 3, "that one is off"
    fake_chip.write("CAN.FMR", 1)
    fake_chip.write(bank, 4)
    assert fake_chip.read(bank) == 4


# Modes.


def test_loop_back_needs_nobody_and_leaves_the_bus_alone(fake_chip: Any) -> None:
    node = CanNode()
    network(fake_chip, node)
    set_up(fake_chip, LOOP)
    send(fake_chip, 0x77, b"ab")
    fake_chip.advance(fake_chip.now_ns + span_ns(CanFrame(identifier=0x77, data=b"ab")))
    assert fake_chip.read("CAN.TSR") & (RQCP | TXOK) == RQCP | TXOK
    assert fake_chip.read("CAN.RI0R") == 0x77 << 21
    assert node.received == []


def test_a_frame_has_one_stamp_where_it_is_sent_and_where_it_is_received(fake_chip: Any) -> None:
    set_up(fake_chip, LOOP, TTCM)
    fake_chip.advance(fake_chip.now_ns + 1_000_000)
    frame = CanFrame(identifier=0x77, data=b"ab")
    send(fake_chip, frame.identifier, frame.data)
    fake_chip.advance(fake_chip.now_ns + span_ns(frame))
    stamp = fake_chip.read("CAN.TDT0R") >> 16
    assert stamp == fake_chip.read("CAN.RDT0R") >> 16 > 0
    assert fake_chip.read("CAN.TDT0R") & 0xFFFF == len(frame.data)


def test_a_silent_chip_hears_and_neither_acknowledges_nor_sends(fake_chip: Any) -> None:
    node, other = CanNode(), CanNode()
    one = network(fake_chip, node)
    set_up(fake_chip, SILENT)
    node.send(CanFrame(identifier=5))
    send(fake_chip, 1)
    fake_chip.advance(fake_chip.now_ns + 10**6)
    assert node.errors > 1
    assert node.received == []
    assert fake_chip.read("CAN.RF0R") == 0
    one.join(other)
    fake_chip.advance(fake_chip.now_ns + 10**6)
    assert fake_chip.read("CAN.RF0R") & 3 == 1
    assert other.received[0][1].identifier == 5


def test_a_chip_alone_becomes_passive_and_never_goes_off(fake_chip: Any) -> None:
    set_up(fake_chip)
    fake_chip.write("CAN.IER", ERRIE | EWGIE | EPVIE)
    send(fake_chip, 1)
    steps = []
    for _ in range(30):
        fake_chip.advance(fake_chip.now_ns + 60 * BIT_NS)
        steps.append(fake_chip.read("CAN.ESR"))
        if steps[-1] & EWGF and len([s for s in steps if s & EWGF]) == 1:
            assert steps[-1] >> 16 & 0xFF == 96
            assert fake_chip.irqs[22]
            fake_chip.write("CAN.MSR", ERRI)
            assert not fake_chip.irqs[22]
    assert steps[-1] == 128 << 16 | 3 << 4 | EPVF | EWGF
    assert fake_chip.irqs[22]
    node = CanNode()
    network(fake_chip, node)
    fake_chip.write("CAN.MCR", INRQ)
    fake_chip.write("CAN.MCR", 0)
    fake_chip.advance(fake_chip.now_ns + 10**6)
    assert [frame.identifier for _, frame in node.received] == [1]
    assert fake_chip.read("CAN.ESR") == 127 << 16 | EWGF


@pytest.mark.parametrize("is_automatic", [True, False])
def test_bus_off_lasts_128_times_eleven_bits(fake_chip: Any, is_automatic: bool) -> None:
    node = CanNode()
    one = network(fake_chip, node)
    set_up(fake_chip, control=ABOM if is_automatic else 0)
    fake_chip.write("CAN.IER", ERRIE | BOFIE)
    one.damage(32)
    send(fake_chip, 1)
    while not fake_chip.read("CAN.ESR") & BOFF:
        fake_chip.advance(fake_chip.now_ns + BIT_NS)
        assert fake_chip.now_ns < 10**8
    off_ns = fake_chip.now_ns
    assert fake_chip.irqs[22]
    assert fake_chip.read("CAN.ESR") >> 16 & 0xFF == 255
    if not is_automatic:
        fake_chip.advance(off_ns + 10 * 128 * 11 * BIT_NS)
        assert fake_chip.read("CAN.ESR") & BOFF, "the software has to pass through initialisation"
        fake_chip.write("CAN.MCR", INRQ)
        fake_chip.write("CAN.MCR", 0)
        off_ns = fake_chip.now_ns + 11 * BIT_NS
    fake_chip.advance(off_ns + 128 * 11 * BIT_NS - BIT_NS)
    assert fake_chip.read("CAN.ESR") & BOFF
    assert node.received == []
    fake_chip.advance(off_ns + 128 * 11 * BIT_NS)
    assert fake_chip.read("CAN.ESR") == 0
    fake_chip.advance(fake_chip.now_ns + 200 * BIT_NS)
    assert [frame.identifier for _, frame in node.received] == [1]


def test_errors_count_up_by_eight_and_by_one_and_down_by_one(fake_chip: Any) -> None:
    node = CanNode()
    one = network(fake_chip, node)
    set_up(fake_chip)
    one.damage(2)
    send(fake_chip, 1)
    fake_chip.advance(fake_chip.now_ns + 10**6)
    assert fake_chip.read("CAN.ESR") == 15 << 16, "twice eight, and one less"
    one.damage(2)
    node.send(CanFrame(identifier=9))
    fake_chip.advance(fake_chip.now_ns + 10**6)
    assert fake_chip.read("CAN.ESR") == 15 << 16 | 1 << 24


def test_another_bit_rate_destroys_frames(make_fake_chip: Chips) -> None:
    one, two = make_fake_chip(), make_fake_chip()
    bus = CanNetwork()
    for chip, timing in ((one, TIMING), (two, TIMING + 1)):
        chip.parts.by_name["CAN"].attach(bus)
        set_up(chip)
        chip.write("CAN.MCR", INRQ)
        chip.write("CAN.BTR", timing)
        chip.write("CAN.MCR", NART)
        chip.advance(chip.now_ns + 20 * BIT_NS)
    send(one, 1)
    one.advance(one.now_ns + 10**6)
    assert one.read("CAN.TSR") & (RQCP | TXOK | TERR) == RQCP | TERR


def test_sleep_ends_by_request_and_with_awum_by_traffic(fake_chip: Any) -> None:
    node, other = CanNode(), CanNode()
    network(fake_chip, node, other)
    set_up(fake_chip)
    fake_chip.write("CAN.IER", WKUIE)
    fake_chip.write("CAN.MCR", SLEEP | AWUM)
    assert fake_chip.read("CAN.MSR") & SLAK
    receive(fake_chip, node, CanFrame(identifier=1))
    assert fake_chip.read("CAN.MSR") & (SLAK | WKUI) == WKUI
    assert fake_chip.irqs[22]
    assert not fake_chip.read("CAN.MCR") & SLEEP
    assert fake_chip.read("CAN.RF0R") == 0, "the frame that wakes is lost"
    receive(fake_chip, node, CanFrame(identifier=2))
    assert fake_chip.read("CAN.RF0R") == 1
    fake_chip.write("CAN.MCR", RESET)
    assert fake_chip.read("CAN.MSR") & SLAK


def test_a_chip_whose_pins_are_not_on_the_bus_is_warned_of(fake_chip: Any) -> None:
    node = CanNode()
    network(fake_chip, node)
    set_up(fake_chip)
    fake_chip.write("GPIOA.CRH", 0x4444_4444)
    fake_chip.write("CAN.MCR", INRQ)
    fake_chip.write("CAN.MCR", 0)
    send(fake_chip, 1)
    fake_chip.advance(fake_chip.now_ns + 10**6)
    assert node.received == []
    assert "PA12" in fake_chip.warnings["CAN:pins"]


def test_the_remap_moves_it_to_pb8_and_pb9(fake_chip: Any) -> None:
    node = CanNode()
    network(fake_chip, node)
    fake_chip.write("AFIO.MAPR", 2 << 13)
    fake_chip.write("GPIOB.CRH", 0x4444_44B4)
    set_up(fake_chip)
    send(fake_chip, 1)
    fake_chip.advance(fake_chip.now_ns + 10**6)
    assert len(node.received) == 1


@QUICK
@given(st.lists(st.tuples(st.sampled_from(["MCR", "MSR", "TSR", "RF0R", "RF1R", "IER", "ESR", "BTR", "TI0R", "TDT0R",
                                           "TI1R", "TI2R", "FMR", "FA1R", "FS1R", "F0R1"]), st.integers(0, 0xFFFF_FFFF),
                          st.integers(0, 10**6)), max_size=20))  # fmt: skip
def test_whatever_is_written_flags_and_interrupts_agree(
    make_fake_chip: Chips, writes: list[tuple[str, int, int]]
) -> None:
    chip, node = make_fake_chip(), CanNode()
    network(chip, node)
    set_up(chip)
    node.send(CanFrame(identifier=3))
    for name, value, wait in writes:
        chip.write(f"CAN.{name}", value)
        chip.advance(chip.now_ns + wait)
        tsr, ier = chip.read("CAN.TSR"), chip.read("CAN.IER")
        assert chip.irqs[19] is bool(ier & TMEIE and tsr & 0x01_0101)
        for n in range(2):
            fifo = chip.read(f"CAN.RF{n}R")
            assert chip.irqs[20 + n] is bool(
                ier >> 3 * n + 1 & (bool(fifo & 3) | bool(fifo & FULL) * 2 | bool(fifo & FOVR) * 4)
            )
        for n in range(3):
            assert (tsr >> 26 + n & 1) != (chip.read(f"CAN.TI{n}R") & 1), "a mailbox is empty or asked for"


@pytest.mark.parametrize("bits", [1, 5, 8, 19, 21, 60])
def test_what_is_asked_for_right_behind_a_reset_goes_out(fake_chip: Any, bits: int) -> None:
    node = CanNode()
    one = network(fake_chip, node)
    set_up(fake_chip)
    send(fake_chip, 0x123, b"ab")
    fake_chip.advance(fake_chip.now_ns + bits * BIT_NS)
    fake_chip.write("CAN.MCR", RESET)
    set_up(fake_chip)
    asked_ns = fake_chip.now_ns
    send(fake_chip, 0x321, b"cd")
    fake_chip.advance(asked_ns + 1_000_000)
    end_ns, frame = node.received[-1]
    assert frame.identifier == 0x321
    assert end_ns >= asked_ns + span_ns(frame), "not before it was asked for"
    assert one.start_ns is None


@QUICK
@given(st.integers(0, 300 * BIT_NS))
def test_a_snapshot_within_a_frame_goes_on_alike(make_fake_chip: Chips, at: int) -> None:
    chip, node = make_fake_chip(), CanNode()
    network(chip, node)
    set_up(chip)
    start_ns = chip.now_ns
    send(chip, 0x10, b"abc")
    node.send(CanFrame(identifier=0x20, data=b"def"))
    chip.advance(start_ns + at)
    part, now_ns = chip.parts.by_name["CAN"], chip.now_ns
    saved = part.snapshot()
    ends = []
    for _ in range(2):
        chip.advance(start_ns + 10**6)
        ends.append((part.snapshot(), tuple(node.received)))
        chip.now_ns = now_ns
        part.restore(saved)
    assert ends[0] == ends[1]
    assert len(ends[0][1]) == 1


def test_two_boards_and_a_node_agree_whatever_the_order_of_the_boards(
    program: Callable[[str], object], watchdog: None
) -> None:
    heard = []
    for order in (1, -1):
        bus, node = CanNetwork(), CanNode()
        bus.join(node)
        boards = [BluePill(program("can_nodes")) for _ in range(2)]  # type: ignore[arg-type]
        for number, board in enumerate(boards):
            board.can(bus)
            board.pin("PB0").drive(number)
        bus.run(boards[::order], 12_000_000)
        assert bus.late == 0
        said = [board.usart1.read().decode().splitlines()[:3] for board in boards]
        assert [sorted(lines) for lines in said] == [
            ["heard 201 01", "heard 201 02", "on"],
            ["heard 200 01", "heard 200 02", "on"],
        ]
        heard.append(sorted((at_ns, frame.identifier, frame.data) for at_ns, frame in node.received))
        assert [board.warnings for board in boards] == [[], []]
    assert len(heard[0]) >= 8
    assert [row[1:] for row in heard[0]] == [row[1:] for row in heard[1]]
    assert [row[0] for row in heard[0]] == [row[0] for row in heard[1]]


def test_initialisation_may_be_asked_for_before_sleep_is_cleared(fake_chip: Any) -> None:
    fake_chip.write("CAN.MCR", SLEEP | INRQ)
    assert fake_chip.read("CAN.MSR") & 3 == 1, "INAK without SLAK"
    fake_chip.write("CAN.MCR", INRQ)
    assert fake_chip.read("CAN.MSR") & 3 == 1


def test_can_has_its_pin_while_it_is_awake_and_leaves_it_to_usart1_before(fake_chip: Any) -> None:
    pin = fake_chip.pins["PA12"]
    fake_chip.write("GPIOA.CRH", 0x444B_4444)
    fake_chip.write("USART1.CR3", 1 << 8)  # RTSE
    fake_chip.write("USART1.CR1", 1 << 13)
    assert (pin.function, pin.level) == ("USART1_RTS", False)
    set_up(fake_chip)
    assert (pin.function, pin.level) == ("CAN_TX", True)
    fake_chip.write("CAN.MCR", SLEEP)
    assert (pin.function, pin.level) == ("USART1_RTS", False)
    fake_chip.write("CAN.MCR", INRQ)
    assert pin.function == "CAN_TX"
    fake_chip.write("CAN.MCR", RESET)
    assert pin.function == "USART1_RTS"


def test_can_that_leaves_sleep_has_its_pin_after_eleven_bits(fake_chip: Any) -> None:
    set_up(fake_chip)
    fake_chip.write("CAN.MCR", SLEEP)
    start_ns, pin = fake_chip.now_ns, fake_chip.pins["PA12"]
    fake_chip.write("CAN.MCR", 0)
    fake_chip.advance(start_ns + 11 * BIT_NS - 1)
    assert pin.function != "CAN_TX"
    fake_chip.advance(start_ns + 11 * BIT_NS)
    assert pin.function == "CAN_TX"
    send(fake_chip, 0x123)
    assert fake_chip.parts.by_name["CAN"].is_on
