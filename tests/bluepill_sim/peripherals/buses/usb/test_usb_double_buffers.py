"""Double-buffered bulk endpoints: who has which buffer when, against an oracle from the manual; and a whole session.

Source: RM0008 23.4.3 and table 171: DTOG says which buffer the device uses; from the end of the first transaction after
DBL_BUF was set, an endpoint whose DTOG and SW_BUF are alike says NAK where STAT is VALID.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from bluepill_sim import BluePill
from bluepill_sim.fabric.usb_bus import BusState, Token, Transaction, UsbResponse
from tests.bluepill_sim.conftest import FakeChip
from tests.bluepill_sim.peripherals.buses.usb.test_usb_registers import (
    ACK,
    BULK,
    CONTROL,
    CTR_RX,
    CTR_TX,
    DISABLED,
    DTOG_RX,
    DTOG_TX,
    FRES,
    INTERRUPT,
    KIND,
    NAK,
    RESET_NS,
    SAYS_NAK,
    SAYS_STALL,
    STALL,
    VALID,
    put,
    rx,
    send,
    set_up,
    stored,
    tx,
)

#: Where the two buffers of endpoint 1 are (`set_up`), and the words of their counts.
BUFFERS, COUNTS = (192, 256), ("USB.PMA_00A", "USB.PMA_00E")


class DoubleBuffers(RuleBasedStateMachine):
    """Endpoint 1 in one direction, as the program and the host use it."""

    IS_IN = True

    def __init__(self) -> None:
        super().__init__()
        self.chip = chip = FakeChip()
        self.usb = set_up(chip)
        self.toggle, self.software = (DTOG_TX, DTOG_RX) if self.IS_IN else (DTOG_RX, DTOG_TX)
        self.done = CTR_TX if self.IS_IN else CTR_RX
        self.kind, self.has_two, self.stat, self.device, self.program = BULK, False, DISABLED, 0, 0
        #: Whether a transaction has ended since there were two buffers; whether one has since its flag was cleared.
        self.takes_turns = self.is_done = False
        for name, address in zip(COUNTS, BUFFERS, strict=True):
            put(chip, address, b"%3d" % address)
            chip.write(name, 3 if self.IS_IN else 1 << 15 | 1 << 10)
        self.sent = 0
        self.write(0)

    def in_place(self, stat: int) -> int:
        return tx(stat) if self.IS_IN else rx(stat)

    def word(self) -> int:
        toggles = self.toggle * self.device | self.software * self.program
        flags = self.done * self.is_done | KIND * self.has_two
        return toggles | flags | self.in_place(self.stat) | self.kind << 9 | 1

    def write(self, toggles: int) -> None:
        """Write what changes these toggles, and all else as it shall be; flags are kept by 1."""
        self.chip.write("USB.EP1R", toggles | CTR_RX | CTR_TX | self.kind << 9 | KIND * self.has_two | 1)
        if not (self.kind == BULK and self.has_two):
            self.takes_turns = False

    @rule(stat=st.sampled_from([DISABLED, STALL, NAK, VALID]))
    def set_stat(self, stat: int) -> None:
        self.write(self.in_place(stat ^ self.stat))
        self.stat = stat

    @rule()
    def start(self) -> None:
        """In one write, as after a reset."""
        self.kind, self.has_two = BULK, True
        self.set_stat(VALID)

    @rule()
    def free_buffer(self) -> None:
        self.program ^= 1
        self.write(self.software)

    @rule()
    def clear_halt(self) -> None:
        """As a driver does: DATA0 next, and VALID."""
        toggles = self.toggle * self.device | self.in_place(self.stat ^ VALID)
        self.device, self.stat = 0, VALID
        self.write(toggles)

    @rule(wanted=st.booleans())
    def set_dbl_buf(self, wanted: bool) -> None:
        self.has_two = wanted
        self.write(0)

    @rule(kind=st.sampled_from([BULK, BULK, INTERRUPT]))
    def set_kind(self, kind: int) -> None:
        self.kind = kind
        self.write(0)

    @rule()
    def acknowledge(self) -> None:
        self.chip.write("USB.EP1R", (CTR_RX | CTR_TX) & ~self.done | self.kind << 9 | KIND * self.has_two | 1)
        self.is_done = False

    @rule(is_fres=st.booleans(), has_two=st.booleans())
    def reset_bus(self, is_fres: bool, has_two: bool) -> None:
        if is_fres:
            self.chip.write("USB.CNTR", FRES)
            self.chip.write("USB.CNTR", 0)
        else:
            self.usb.bus_changed(BusState.RESET, self.chip.now_ns, 0)
            self.chip.advance(self.chip.now_ns + RESET_NS)
            self.usb.bus_changed(BusState.IDLE, self.chip.now_ns, 0)
        assert self.chip.read("USB.EP1R") == self.done * self.is_done, "what is not acknowledged outlives it"
        self.chip.write("USB.ISTR", 0)
        self.chip.write("USB.DADDR", 0x85)
        self.kind, self.has_two, self.stat, self.device, self.program = BULK, has_two, DISABLED, 0, 0
        self.takes_turns = False
        self.write(0)

    @rule()
    def setup(self) -> None:
        """No control endpoint hears it."""
        if self.stat == DISABLED or not self.IS_IN:
            assert send(self.usb, Token.SETUP, 1, 0, bytes(8)) is None

    def expected(self) -> UsbResponse | None:
        if self.stat != VALID:
            return {STALL: SAYS_STALL, NAK: SAYS_NAK}.get(self.stat)
        return SAYS_NAK if self.takes_turns and self.device == self.program else ACK

    def ended(self) -> None:
        self.device ^= 1
        self.is_done = True
        if self.kind == BULK and self.has_two:
            self.takes_turns = True
        else:
            self.stat = NAK

    @invariant()
    def word_is_as_written(self) -> None:
        assert self.chip.read("USB.EP1R") == self.word()
        assert self.usb.would_nak(1, is_in=self.IS_IN) is (self.expected() == SAYS_NAK)


class DoubleIn(DoubleBuffers):
    @rule(is_acknowledged=st.booleans())
    def ask(self, is_acknowledged: bool) -> None:
        found = self.usb.begin(Transaction(Token.IN, 5, 1))
        used = BUFFERS[self.device if self.kind == BULK and self.has_two else 0]
        expected = self.expected()
        assert found == (UsbResponse(None, self.device, b"%3d" % used) if expected == ACK else expected)
        if expected == ACK and is_acknowledged:
            self.usb.end(Transaction(Token.IN, 5, 1))
            self.ended()


class DoubleOut(DoubleBuffers):
    IS_IN = False

    @rule(is_again=st.booleans())
    def give(self, is_again: bool) -> None:
        """Data, or the same as before once more: their PID is then the last one's."""
        self.sent = (self.sent + 1) % 1000
        expected = self.expected()
        used = BUFFERS[self.device if self.kind == BULK and self.has_two else 1]
        before = [stored(self.chip, address, 3) for address in BUFFERS]
        assert send(self.usb, Token.OUT, 1, self.device ^ is_again, b"%03d" % self.sent) == expected
        if expected == ACK and not is_again:
            before[BUFFERS.index(used)] = b"%03d" % self.sent
            self.ended()
        assert [stored(self.chip, address, 3) for address in BUFFERS] == before

    @precondition(lambda self: self.stat == VALID and self.kind == BULK and self.has_two)
    @rule()
    def give_rightly(self) -> None:
        self.give(is_again=False)


SETTINGS = settings(max_examples=40, stateful_step_count=30)
TestDoubleIn, TestDoubleOut = (pytest.mark.slow(one.TestCase) for one in (DoubleIn, DoubleOut))
TestDoubleIn.settings = TestDoubleOut.settings = SETTINGS


@pytest.mark.parametrize("is_in", [True, False])
@pytest.mark.parametrize("dtog", [0, 1])
def test_the_first_transaction_goes_by_stat_alone_and_the_second_by_the_buffers(
    fake_chip: Any, is_in: bool, dtog: int
) -> None:
    """A program that fills both buffers leaves DTOG and SW_BUF alike, and sets STAT once: two packets go, then NAK."""
    usb = set_up(fake_chip)
    token, stat = (Token.IN, tx(VALID)) if is_in else (Token.OUT, rx(VALID))
    for name, address in zip(COUNTS, BUFFERS, strict=True):
        put(fake_chip, address, b"%3d" % address)
        fake_chip.write(name, 3 if is_in else 1 << 15 | 1 << 10)
    fake_chip.write("USB.EP1R", BULK << 9 | KIND | 1 | stat | (DTOG_RX | DTOG_TX) * dtog)
    for pid in (dtog, 1 - dtog):
        answer = send(usb, token, 1, pid, b"" if is_in else b"%03d" % pid)
        assert answer == (UsbResponse(None, pid, b"%3d" % BUFFERS[pid]) if is_in else ACK)
        assert fake_chip.read("USB.EP1R") & stat == stat
        if not is_in:
            assert stored(fake_chip, BUFFERS[pid], 3) == b"%03d" % pid
    assert send(usb, token, 1, dtog) == SAYS_NAK
    fake_chip.write("USB.EP1R", BULK << 9 | 1)
    fake_chip.write("USB.EP1R", BULK << 9 | KIND | 1)
    assert send(usb, token, 1, dtog, b"") == (UsbResponse(None, dtog, b"%3d" % BUFFERS[dtog]) if is_in else ACK), "anew"


def test_which_endpoints_take_turns_outlives_a_snapshot_and_not_a_reset(fake_chip: Any) -> None:
    usb = set_up(fake_chip)
    fake_chip.write("USB.EP1R", BULK << 9 | KIND | 1 | tx(VALID))
    before = usb.snapshot()
    send(usb, Token.IN, 1)
    send(usb, Token.IN, 1)
    after = usb.snapshot()
    assert send(usb, Token.IN, 1) == SAYS_NAK
    usb.restore(before)
    assert send(usb, Token.IN, 1) == UsbResponse(None, 0, b"")
    usb.restore(after)
    assert send(usb, Token.IN, 1) == SAYS_NAK
    usb.reset()
    set_up(fake_chip)
    fake_chip.write("USB.EP1R", BULK << 9 | KIND | 1 | tx(VALID))
    assert send(usb, Token.IN, 1) == UsbResponse(None, 0, b"")


def test_a_control_endpoint_takes_no_turns(fake_chip: Any) -> None:
    usb = set_up(fake_chip)
    fake_chip.write("USB.EP0R", CONTROL << 9 | KIND | tx(VALID) | rx(VALID))
    assert send(usb, Token.SETUP, 0, 0, bytes(8)) == ACK
    fake_chip.write("USB.EP0R", CONTROL << 9 | KIND | tx(NAK ^ VALID) | rx(NAK ^ VALID))
    assert fake_chip.read("USB.EP0R") & (DTOG_RX | DTOG_TX) == DTOG_RX | DTOG_TX
    assert send(usb, Token.IN, 0) == UsbResponse(None, 1, b"")


def test_a_host_finishes_a_session_with_a_program_that_fills_both_buffers_first(
    program: Callable[[str], Path], watchdog: None
) -> None:
    board = BluePill(program("usb_double"))
    board.usb.wait_configured()
    line = board.usb_serial
    text = b"".join(b"line %03d of a session over two buffers\n" % n for n in range(20)) + b"and its end\n"
    line.receive(text[:64])
    board.run_for("5 ms")
    assert not line.received_bytes, "it starts with two packets"
    line.receive(text[64:])
    assert line.expect(text.upper(), within="100 ms") == text.upper()
    for n in range(5):
        line.receive(b"then short ones, %d" % n)
        assert line.expect(b"THEN SHORT ONES, %d" % n, within="10 ms")
