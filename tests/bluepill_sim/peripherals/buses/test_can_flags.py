"""bxCAN: what clears each flag, which enable each cause has, what a stamp needs, and what a reset forgets."""

from typing import Any

import pytest

from bluepill_sim.parts import CanFrame, CanNode
from bluepill_sim.peripherals.can import (
    ALST,
    BOFIE,
    EPVIE,
    ERRI,
    ERRIE,
    EWGIE,
    INAK,
    LECIE,
    NART,
    RESET,
    RQCP,
    SLAK,
    TERR,
    TMEIE,
    TTCM,
    TXOK,
)  # fmt: skip
from tests.bluepill_sim.peripherals.buses.test_can import BIT_NS, FMPIE0, network, receive, send, set_up


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
