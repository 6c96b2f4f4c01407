"""bxCAN: what clears each flag, which enable each cause has, what a stamp needs, and what a reset forgets."""

from typing import Any

import pytest

from bluepill_sim.parts import CanFrame, CanNode
from bluepill_sim.peripherals.can import (
    ABRQ,
    ALST,
    AWUM,
    BOFIE,
    EPVF,
    EPVIE,
    ERRI,
    ERRIE,
    EWGF,
    EWGIE,
    FOVR,
    FULL,
    INAK,
    INRQ,
    LECIE,
    NART,
    RESET,
    RFOM,
    RQCP,
    SLAK,
    SLEEP,
    TERR,
    TMEIE,
    TTCM,
    TXOK,
    WKUI,
    WKUIE,
)
from tests.bluepill_sim.peripherals.buses.test_can import (
    BIT_NS,
    FMPIE0,
    LOOP,
    TIMING,
    network,
    receive,
    send,
    set_up,
    span_ns,
)


@pytest.mark.parametrize("mailbox", range(3))
@pytest.mark.parametrize("flag", [TXOK, ALST, TERR])
@pytest.mark.parametrize("is_asked", [False, True])
def test_flags_of_a_mailbox_go_with_its_rqcp_and_with_its_next_request(
    fake_chip: Any, mailbox: int, flag: int, is_asked: bool
) -> None:
    node = CanNode()
    one = network(fake_chip, node)
    set_up(fake_chip, control=NART)
    if flag == TERR:
        one.damage()
    if flag == ALST:
        node.send(CanFrame(identifier=1))
    send(fake_chip, 2, mailbox=mailbox)
    fake_chip.advance(fake_chip.now_ns + 10**6)
    send(fake_chip, 3, mailbox=(mailbox + 1) % 3)
    fake_chip.advance(fake_chip.now_ns + 10**6)
    own, other = (RQCP | flag) << 8 * mailbox, (RQCP | TXOK) << 8 * ((mailbox + 1) % 3)
    assert fake_chip.read("CAN.TSR") & 0xFF_FFFF == own | other
    fake_chip.write("CAN.TSR", (TXOK | ALST | TERR) << 8 * mailbox)
    assert fake_chip.read("CAN.TSR") & 0xFF_FFFF == own | other
    assert not fake_chip.read(f"CAN.TI{mailbox}R") & 1
    if is_asked:
        send(fake_chip, 4, mailbox=mailbox)
    else:
        fake_chip.write("CAN.TSR", RQCP << 8 * mailbox)
    assert fake_chip.read("CAN.TSR") & 0xFF_FFFF == other


@pytest.mark.parametrize(("enable", "count"), [(LECIE, 8), (EWGIE, 96), (EPVIE, 128), (BOFIE, 255), (0, 256)])
def test_each_enable_of_an_error_raises_erri_at_its_own_count(fake_chip: Any, enable: int, count: int) -> None:
    one = network(fake_chip, CanNode())
    set_up(fake_chip)
    fake_chip.write("CAN.IER", ERRIE | enable)
    one.damage(32)
    send(fake_chip, 1)
    for _ in range(3_000):
        fake_chip.advance(fake_chip.now_ns + BIT_NS)
        if fake_chip.read("CAN.MSR") & ERRI:
            break
    found = fake_chip.read("CAN.ESR") >> 16 & 0xFF
    assert (found, fake_chip.irqs[22]) == (min(count, 255), enable != 0)
    fake_chip.write("CAN.IER", enable)
    assert not fake_chip.irqs[22]


@pytest.mark.parametrize(
    ("control", "tgt", "size", "is_stamped"),
    [(TTCM, 1, 8, True), (0, 1, 8, False), (TTCM, 0, 8, False), (TTCM, 1, 7, False)],
)
def test_the_time_goes_out_only_with_ttcm_tgt_and_eight_bytes(
    fake_chip: Any, control: int, tgt: int, size: int, is_stamped: bool
) -> None:
    node = CanNode()
    network(fake_chip, node)
    set_up(fake_chip, control=control)
    fake_chip.advance(fake_chip.now_ns + 300 * BIT_NS)
    send(fake_chip, 1, b"abcdefgh"[:size], control=tgt << 8)
    fake_chip.advance(fake_chip.now_ns + 10**6)
    ((_, frame),) = node.received
    assert frame.data == (b"abcdef" + (300).to_bytes(2, "little") if is_stamped else b"abcdefgh"[:size])


def test_a_reset_by_its_bit_forgets_messages_requests_and_errors(fake_chip: Any) -> None:
    node = CanNode()
    one = network(fake_chip, node)
    set_up(fake_chip)
    fake_chip.write("CAN.IER", TMEIE | FMPIE0)
    receive(fake_chip, node, CanFrame(identifier=7), CanFrame(identifier=8))
    one.damage(2)
    send(fake_chip, 1)
    fake_chip.advance(fake_chip.now_ns + 10**6)
    assert fake_chip.read("CAN.ESR")
    assert fake_chip.irqs[19]
    assert fake_chip.irqs[20]
    node.received.clear()
    send(fake_chip, 2)
    fake_chip.write("CAN.MCR", RESET)
    assert (fake_chip.read("CAN.RF0R"), fake_chip.read("CAN.ESR"), fake_chip.read("CAN.TSR")) == (0, 0, 0x1C00_0000)
    assert not fake_chip.irqs[19] | fake_chip.irqs[20]
    assert fake_chip.read("CAN.MSR") & (INAK | SLAK) == SLAK
    set_up(fake_chip)
    receive(fake_chip, node, CanFrame(identifier=9))
    assert (fake_chip.read("CAN.RF0R"), fake_chip.read("CAN.RI0R") >> 21) == (1, 9)
    send(fake_chip, 3, mailbox=1)
    fake_chip.advance(fake_chip.now_ns + 10**6)
    assert [frame.identifier for _, frame in node.received] == [3]
    assert fake_chip.read("CAN.ESR") == 0


@pytest.mark.parametrize("bits", [0, 1, 5, 12, 20, 40])
def test_an_abort_leaves_the_frame_on_the_bus_in_any_of_its_bits(fake_chip: Any, bits: int) -> None:
    node = CanNode()
    network(fake_chip, node)
    set_up(fake_chip)
    send(fake_chip, 1, mailbox=1)
    send(fake_chip, 2, mailbox=2)
    fake_chip.advance(fake_chip.now_ns + bits * BIT_NS + 1)
    fake_chip.write("CAN.TSR", ABRQ << 8 | ABRQ << 16)
    assert fake_chip.read("CAN.TSR") & 0xFF_FFFF == RQCP << 16 | ABRQ << 8
    fake_chip.advance(fake_chip.now_ns + 10**6)
    assert fake_chip.read("CAN.TSR") & 0xFF_FFFF == RQCP << 16 | (RQCP | TXOK) << 8
    assert [frame.identifier for _, frame in node.received] == [1]


def test_an_abort_between_two_frames_takes_the_next_one_back(fake_chip: Any) -> None:
    node = CanNode()
    network(fake_chip, node)
    set_up(fake_chip)
    start_ns = fake_chip.now_ns
    send(fake_chip, 1)
    send(fake_chip, 2, mailbox=1)
    fake_chip.advance(start_ns + span_ns(CanFrame(identifier=1)) + BIT_NS)
    fake_chip.write("CAN.TSR", ABRQ << 8)
    assert fake_chip.read("CAN.TSR") & 0xFF_FFFF == RQCP << 8 | RQCP | TXOK
    fake_chip.advance(start_ns + 10**6)
    assert [frame.identifier for _, frame in node.received] == [1]


@pytest.mark.parametrize("mode", [INRQ, SLEEP])
def test_what_waits_for_the_bus_waits_for_the_mode_too(fake_chip: Any, mode: int) -> None:
    node, ear = CanNode(), CanNode()
    network(fake_chip, node, ear)
    set_up(fake_chip)
    node.send(CanFrame(identifier=1))
    send(fake_chip, 2)
    fake_chip.advance(fake_chip.now_ns + 20 * BIT_NS)
    fake_chip.write("CAN.MCR", mode)
    fake_chip.advance(fake_chip.now_ns + 10**6)
    assert [frame.identifier for _, frame in ear.received] == [1]
    fake_chip.write("CAN.MCR", 0)
    fake_chip.advance(fake_chip.now_ns + 10**6)
    assert [frame.identifier for _, frame in ear.received] == [1, 2]


@pytest.mark.parametrize(("mode", "is_wired"), [(0, True), (0, False), (LOOP, True), (LOOP, False)])
def test_only_a_chip_that_wants_a_bus_and_has_none_is_warned_of(fake_chip: Any, mode: int, is_wired: bool) -> None:
    if is_wired:
        set_up(fake_chip, mode)
    else:
        fake_chip.write("CAN.MCR", INRQ)
        fake_chip.write("CAN.BTR", TIMING | mode)
        fake_chip.write("CAN.MCR", 0)
        fake_chip.advance(fake_chip.now_ns + 11 * BIT_NS)
    assert ("CAN:pins" in fake_chip.warnings) is (not mode and not is_wired)


@pytest.mark.parametrize("fifo", [0, 1])
def test_each_fifo_is_released_by_its_own_register_and_interrupts_by_its_own_enables(fake_chip: Any, fifo: int) -> None:
    node = CanNode()
    network(fake_chip, node)
    set_up(fake_chip)
    fake_chip.write("CAN.FMR", 1)
    fake_chip.write("CAN.FFA1R", fifo)
    fake_chip.write("CAN.FMR", 0)
    own, other = f"CAN.RF{fifo}R", f"CAN.RF{1 - fifo}R"
    for count, pending in enumerate((1, 2, 3 | FULL, 3 | FULL | FOVR), start=1):
        receive(fake_chip, node, CanFrame(identifier=count, data=bytes((count,))))
        assert (fake_chip.read(own), fake_chip.read(other)) == (pending, 0)
    for enable in range(6):
        fake_chip.write("CAN.IER", 1 << enable + 1)
        assert (fake_chip.irqs[20], fake_chip.irqs[21]) == (enable // 3 == fifo == 0, enable // 3 == fifo == 1)
    fake_chip.write(other, RFOM)
    for count, left in ((1, 2), (2, 1), (4, 0)):
        assert (fake_chip.read(f"CAN.RI{fifo}R") >> 21, fake_chip.read(f"CAN.RDL{fifo}R")) == (count, count)
        fake_chip.write(own, RFOM | FULL | FOVR)
        assert fake_chip.read(own) == left
    fake_chip.write(own, RFOM)
    assert fake_chip.read(own) == 0


def test_a_frame_is_stamped_with_the_bits_since_initialisation(fake_chip: Any) -> None:
    node = CanNode()
    network(fake_chip, node)
    set_up(fake_chip, control=TTCM)
    for bits, low in ((300, 300), (70_000, 70_000 & 0xFFFF)):
        fake_chip.advance(11 * BIT_NS + bits * BIT_NS)
        node.send(CanFrame(identifier=1, data=b"ab"))
        fake_chip.advance(fake_chip.now_ns + 200 * BIT_NS)
        assert fake_chip.read("CAN.RDT0R") == low << 16 | 2
        fake_chip.write("CAN.RF0R", RFOM)


def test_a_passive_receiver_that_hears_a_good_frame_counts_from_120(fake_chip: Any) -> None:
    node = CanNode()
    one = network(fake_chip, node)
    set_up(fake_chip)
    one.damage(130)
    node.send(CanFrame(identifier=1))
    while fake_chip.read("CAN.ESR") >> 24 < 130:
        fake_chip.advance(fake_chip.now_ns + 50 * BIT_NS)
        assert fake_chip.now_ns < 10**8
    assert fake_chip.read("CAN.ESR") & EPVF
    fake_chip.advance(fake_chip.now_ns + 200 * BIT_NS)
    assert fake_chip.read("CAN.ESR") == 120 << 24 | EWGF
    receive(fake_chip, node, CanFrame(identifier=1))
    assert fake_chip.read("CAN.ESR") >> 24 == 119


@pytest.mark.parametrize("control", [0, AWUM])
def test_awum_leaves_sleep_eleven_bits_behind_the_frame(fake_chip: Any, control: int) -> None:
    node = CanNode()
    network(fake_chip, node)
    set_up(fake_chip, control=control)
    fake_chip.write("CAN.MCR", SLEEP | control)
    fake_chip.write("CAN.IER", WKUIE)
    node.send(CanFrame(identifier=1))
    while not fake_chip.read("CAN.MSR") & WKUI:
        fake_chip.advance(fake_chip.now_ns + BIT_NS)
        assert fake_chip.now_ns < 10**7
    assert fake_chip.irqs[22]
    assert bool(fake_chip.read("CAN.MCR") & SLEEP) is not bool(control)
    fake_chip.advance(fake_chip.now_ns + 9 * BIT_NS)
    assert fake_chip.read("CAN.MSR") & SLAK
    fake_chip.advance(fake_chip.now_ns + 3 * BIT_NS)
    assert bool(fake_chip.read("CAN.MSR") & SLAK) is not bool(control)
    fake_chip.write("CAN.MSR", WKUI)
    assert not fake_chip.irqs[22]
