"""The USB device by its registers: toggles, transactions, frames and their absence, clocks, pins."""

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.fabric.usb_bus import BusState, Handshake, Token, Transaction, UsbResponse

CTR_RX, DTOG_RX, SETUP, KIND, CTR_TX, DTOG_TX = (1 << n for n in (15, 14, 11, 8, 7, 6))
DISABLED, STALL, NAK, VALID = range(4)
BULK, CONTROL, ISOCHRONOUS, INTERRUPT = range(4)
CTR, PMAOVR, ERR, WKUP, SUSP, RESET, SOF, ESOF, DIR = (1 << n for n in (15, 14, 13, 12, 11, 10, 9, 8, 4))
RESUME, FSUSP, LP_MODE, PDWN, FRES = (1 << n for n in (4, 3, 2, 1, 0))
HP, LP, MS = 19, 20, 1_000_000
RESET_NS = 2_500
ACK, SAYS_NAK, SAYS_STALL = (UsbResponse(one) for one in (Handshake.ACK, Handshake.NAK, Handshake.STALL))
QUICK = settings(max_examples=25)
Chips = Callable[[], Any]


def rx(stat: int) -> int:
    return stat << 12


def tx(stat: int) -> int:
    return stat << 4


def set_up(chip: Any, mask: int = 0) -> Any:
    """USB on at 48 MHz, address 5, pulled up, with these interrupts; each endpoint has two buffers of 64 bytes."""
    chip.run_at_72_mhz()
    chip.pins["PA12"].drive(1, is_weak=True)
    usb = chip.parts.by_name["USB"]
    chip.write("USB.CNTR", FRES)
    chip.write("USB.CNTR", mask)
    chip.write("USB.ISTR", 0)
    chip.write("USB.DADDR", 0x85)
    for n in range(3):
        for word, value in enumerate((64 + 128 * n, 0, 128 + 128 * n, 1 << 15 | 1 << 10)):
            chip.write(f"USB.PMA_{8 * n + 2 * word:03X}", value)
    return usb


def endpoint(chip: Any, n: int, kind: int, *, stat: int, flags: int = 0) -> None:
    """Set an endpoint from 0, with its number as its address."""
    now = chip.read(f"USB.EP{n}R")
    chip.write(f"USB.EP{n}R", (now & 0x7070) ^ (stat | flags & 0x4040) | kind << 9 | flags & KIND | n)
    assert chip.read(f"USB.EP{n}R") == stat | kind << 9 | flags | n


def send(usb: Any, token: Token, n: int, pid: int = 0, data: bytes = b"") -> UsbResponse | None:
    """A transaction from its begin to its end, as the host makes it."""
    one = Transaction(token, 5, n, pid, data)
    answer: UsbResponse | None = usb.begin(one)
    if answer is not None and answer.handshake in {None, Handshake.ACK}:
        usb.end(one)
    return answer


def stored(chip: Any, address: int, count: int) -> bytes:
    words = [chip.read(f"USB.PMA_{address + n:03X}") for n in range(0, count, 2)]
    return b"".join(word.to_bytes(2, "little") for word in words)[:count]


def put(chip: Any, address: int, data: bytes) -> None:
    padded = data + b"\0"
    for n in range(0, len(data), 2):
        chip.write(f"USB.PMA_{address + n:03X}", int.from_bytes(padded[n : n + 2], "little"))


@QUICK
@given(st.lists(st.integers(0, 0xFFFF), min_size=1, max_size=8), st.sampled_from(["EP0R", "EP3R", "EP7R"]))
def test_a_write_turns_toggles_over_clears_flags_by_0_and_stores_the_rest(
    make_fake_chip: Chips, written: list[int], name: str
) -> None:
    chip = make_fake_chip()
    usb = chip.parts.by_name["USB"]
    index = int(name[2])
    usb.words[index] = expected = 0x8880 | index
    for word in written:
        chip.write(f"USB.{name}", word)
        kept = expected & SETUP | (expected ^ word) & 0x7070 | expected & word & (CTR_RX | CTR_TX)
        expected = kept | word & 0x070F
        assert chip.read(f"USB.{name}") == expected
    assert usb.words[ISTR_INDEX] & CTR == CTR * bool(expected & (CTR_RX | CTR_TX))


ISTR_INDEX = 17


@QUICK
@given(st.integers(0, 0x7F00 >> 8), st.integers(0, 0xFFFF))
def test_istr_clears_by_0_and_cannot_be_set(make_fake_chip: Chips, flags: int, written: int) -> None:
    chip = make_fake_chip()
    usb = chip.parts.by_name["USB"]
    usb.words[ISTR_INDEX] = flags << 8 & 0x7F00
    chip.write("USB.ISTR", written)
    assert chip.read("USB.ISTR") == flags << 8 & 0x7F00 & written


@pytest.mark.parametrize("kind", [BULK, CONTROL, INTERRUPT])
@pytest.mark.parametrize("stat", [DISABLED, STALL, NAK, VALID])
def test_stat_decides_the_answer(fake_chip: Any, kind: int, stat: int) -> None:
    usb = set_up(fake_chip)
    answers = {DISABLED: None, STALL: SAYS_STALL, NAK: SAYS_NAK}
    endpoint(fake_chip, 1, kind, stat=rx(stat))
    before = fake_chip.read("USB.EP1R")
    assert send(usb, Token.OUT, 1, 0, b"abc") == answers.get(stat, ACK)
    if stat == VALID:
        assert fake_chip.read("USB.EP1R") == before & ~rx(3) | rx(NAK) | CTR_RX | DTOG_RX
        assert stored(fake_chip, 256, 3) == b"abc"
        assert fake_chip.read("USB.PMA_00E") == 1 << 15 | 1 << 10 | 3
    else:
        assert fake_chip.read("USB.EP1R") == before
    endpoint(fake_chip, 2, kind, stat=tx(stat))
    put(fake_chip, 320, b"hello")
    fake_chip.write("USB.PMA_012", 5)
    before = fake_chip.read("USB.EP2R")
    assert send(usb, Token.IN, 2) == answers.get(stat, UsbResponse(None, 0, b"hello"))
    expected = before & ~tx(3) | tx(NAK) | CTR_TX | DTOG_TX if stat == VALID else before
    assert fake_chip.read("USB.EP2R") == expected


@pytest.mark.parametrize("stat", [STALL, NAK, VALID])
def test_a_control_endpoint_never_refuses_setup(fake_chip: Any, stat: int) -> None:
    usb = set_up(fake_chip, CTR)
    endpoint(fake_chip, 0, CONTROL, stat=rx(stat) | tx(stat), flags=DTOG_RX)
    assert send(usb, Token.SETUP, 0, 0, bytes(range(8))) == ACK
    assert fake_chip.read("USB.EP0R") == CTR_RX | DTOG_RX | rx(NAK) | SETUP | CONTROL << 9 | DTOG_TX | tx(NAK)
    assert stored(fake_chip, 128, 8) == bytes(range(8))
    assert fake_chip.read("USB.ISTR") & (CTR | DIR | 15) == CTR | DIR
    assert (fake_chip.irqs[LP], fake_chip.irqs[HP]) == (True, False)


def test_setup_before_the_last_is_acknowledged_is_not_heard(fake_chip: Any) -> None:
    usb = set_up(fake_chip)
    endpoint(fake_chip, 0, CONTROL, stat=rx(VALID))
    assert send(usb, Token.SETUP, 0, 0, bytes(8)) == ACK
    assert send(usb, Token.SETUP, 0, 0, b"\1" * 8) is None
    assert stored(fake_chip, 128, 8) == bytes(8)
    fake_chip.write("USB.EP0R", CONTROL << 9)
    assert send(usb, Token.SETUP, 0, 0, b"\1" * 8) == ACK
    assert send(usb, Token.SETUP, 1, 0, bytes(8)) is None, "no control endpoint"


def test_the_setup_flag_is_frozen_while_ctr_rx_stands(fake_chip: Any) -> None:
    usb = set_up(fake_chip)
    endpoint(fake_chip, 0, CONTROL, stat=rx(VALID))
    send(usb, Token.SETUP, 0, 0, bytes(8))
    fake_chip.write("USB.EP0R", CONTROL << 9 | CTR_RX | rx(VALID ^ NAK))
    assert send(usb, Token.OUT, 0, 1, b"x") == ACK
    assert fake_chip.read("USB.EP0R") & SETUP
    fake_chip.write("USB.EP0R", CONTROL << 9 | rx(VALID ^ NAK))
    assert send(usb, Token.OUT, 0, 0, b"x") == ACK
    assert not fake_chip.read("USB.EP0R") & SETUP


def test_data_that_came_before_are_acknowledged_and_dropped(fake_chip: Any) -> None:
    usb = set_up(fake_chip)
    endpoint(fake_chip, 1, BULK, stat=rx(VALID))
    assert send(usb, Token.OUT, 1, 1, b"old") == ACK
    assert fake_chip.read("USB.EP1R") == rx(VALID) | 1
    assert stored(fake_chip, 256, 3) == bytes(3)


@pytest.mark.parametrize(("blocks", "room"), [(1 << 10, 2), (31 << 10, 62), (1 << 15, 32), (1 << 15 | 1 << 10, 64)])
def test_data_longer_than_the_buffer_are_stalled(fake_chip: Any, blocks: int, room: int) -> None:
    usb = set_up(fake_chip)
    endpoint(fake_chip, 1, BULK, stat=rx(VALID))
    fake_chip.write("USB.PMA_00E", blocks)
    before = fake_chip.read("USB.EP1R")
    assert send(usb, Token.OUT, 1, 0, bytes(room + 1)) == SAYS_STALL
    assert fake_chip.read("USB.EP1R") == before
    assert send(usb, Token.OUT, 1, 0, b"\x55" * room) == ACK
    assert fake_chip.read("USB.PMA_00E") == blocks | room
    assert stored(fake_chip, 256, room + 2) == b"\x55" * room + bytes(2)


def test_status_out_takes_no_data(fake_chip: Any) -> None:
    usb = set_up(fake_chip)
    endpoint(fake_chip, 0, CONTROL, stat=rx(VALID), flags=KIND)
    assert send(usb, Token.OUT, 0, 0, b"x") == SAYS_STALL
    assert send(usb, Token.OUT, 0, 0, b"") == ACK


@pytest.mark.parametrize("is_in", [False, True])
def test_double_buffers_of_a_bulk_endpoint_take_turns(fake_chip: Any, is_in: bool) -> None:
    """The device has the buffer that DTOG says, the program that of SW_BUF; where they are the same it says NAK."""
    usb = set_up(fake_chip, CTR)
    own, software = (DTOG_TX, DTOG_RX) if is_in else (DTOG_RX, DTOG_TX)
    stat, token = (tx(VALID), Token.IN) if is_in else (rx(VALID), Token.OUT)
    endpoint(fake_chip, 1, BULK, stat=stat, flags=KIND | software)
    for address in (192, 256):
        put(fake_chip, address, b"%3d" % address)
    fake_chip.write("USB.PMA_00A", 3 if is_in else 1 << 15 | 1 << 10)
    fake_chip.write("USB.PMA_00E", 3 if is_in else 1 << 15 | 1 << 10)
    for turn in range(4):
        address = (192, 256)[turn % 2]
        answer = send(usb, token, 1, turn % 2, b"" if is_in else b"%03d" % turn)
        assert answer == (UsbResponse(None, turn % 2, b"%3d" % address) if is_in else ACK)
        assert is_in or stored(fake_chip, address, 3) == b"%03d" % turn
        word = fake_chip.read("USB.EP1R")
        assert bool(word & own) == bool(word & software)
        assert word & stat == stat, "it stays valid"
        assert (fake_chip.irqs[HP], fake_chip.irqs[LP]) == (True, True)
        assert send(usb, token, 1, 1 - turn % 2, b"") == SAYS_NAK
        fake_chip.write("USB.EP1R", BULK << 9 | KIND | 1 | software)
        assert not fake_chip.irqs[HP]


def test_isochronous_data_have_no_handshake_and_two_buffers(fake_chip: Any) -> None:
    usb = set_up(fake_chip)
    fake_chip.write("USB.PMA_00A", 1 << 15 | 1 << 10)
    endpoint(fake_chip, 1, ISOCHRONOUS, stat=rx(VALID))
    for turn in range(3):
        assert send(usb, Token.OUT, 1, 0, b"%d" % turn) == UsbResponse(None)
    assert (stored(fake_chip, 192, 1), stored(fake_chip, 256, 1)) == (b"2", b"1")
    assert fake_chip.read("USB.EP1R") & rx(3) == rx(VALID)


def test_isochronous_data_that_the_host_asks_for_are_always_data0(fake_chip: Any) -> None:
    """Of the two buffers one is sent and then the other, and DTOG tells which; no toggle is on the wire."""
    usb = set_up(fake_chip)
    for address, data in ((192, b"one"), (256, b"other")):
        put(fake_chip, address, data)
    fake_chip.write("USB.PMA_00A", 5)
    for place, count in ((0x008, 192), (0x00A, 3), (0x00C, 256), (0x00E, 5)):
        fake_chip.write(f"USB.PMA_{place:03X}", count)
    endpoint(fake_chip, 1, ISOCHRONOUS, stat=tx(VALID))
    sent = [send(usb, Token.IN, 1) for _ in range(3)]
    assert sent == [UsbResponse(None, 0, data) for data in (b"one", b"other", b"one")]


def test_an_urgent_endpoint_is_shown_before_the_others(fake_chip: Any) -> None:
    usb = set_up(fake_chip, CTR)
    endpoint(fake_chip, 1, BULK, stat=rx(VALID))
    endpoint(fake_chip, 2, ISOCHRONOUS, stat=tx(VALID))
    send(usb, Token.OUT, 1, 0, b"x")
    assert fake_chip.read("USB.ISTR") & (CTR | DIR | 15) == CTR | DIR | 1
    send(usb, Token.IN, 2)
    assert fake_chip.read("USB.ISTR") & (CTR | DIR | 15) == CTR | 2
    fake_chip.write("USB.EP2R", ISOCHRONOUS << 9 | 2)
    assert fake_chip.read("USB.ISTR") & (CTR | DIR | 15) == CTR | DIR | 1
    fake_chip.write("USB.EP1R", 1)
    assert not fake_chip.read("USB.ISTR") & (CTR | DIR | 15)


def test_another_address_a_disabled_function_and_damaged_packets_get_no_answer(fake_chip: Any) -> None:
    usb = set_up(fake_chip)
    endpoint(fake_chip, 0, CONTROL, stat=rx(VALID) | tx(VALID))
    assert usb.begin(Transaction(Token.IN, 6, 0)) is None
    assert not fake_chip.read("USB.ISTR") & ERR
    assert usb.begin(Transaction(Token.OUT, 5, 0, 0, b"x", is_damaged=True)) is None
    assert fake_chip.read("USB.ISTR") & ERR
    fake_chip.write("USB.DADDR", 5)
    assert usb.begin(Transaction(Token.IN, 5, 0)) is None
    fake_chip.write("USB.DADDR", 0x85)
    assert usb.begin(Transaction(Token.IN, 5, 0)) is not None
    fake_chip.write("USB.CNTR", PDWN)
    assert usb.begin(Transaction(Token.IN, 5, 0)) is None


def test_a_bus_reset_clears_address_and_endpoints_but_not_what_waits(fake_chip: Any) -> None:
    usb = set_up(fake_chip, RESET)
    endpoint(fake_chip, 1, BULK, stat=rx(VALID))
    send(usb, Token.OUT, 1, 0, b"x")
    start_ns = fake_chip.now_ns
    usb.bus_changed(BusState.RESET, start_ns, 0)
    fake_chip.advance(start_ns + 2_499)
    assert not fake_chip.read("USB.ISTR") & RESET
    fake_chip.advance(start_ns + 2_500)
    assert fake_chip.read("USB.ISTR") & RESET
    assert fake_chip.irqs[LP]
    assert (fake_chip.read("USB.EP1R"), fake_chip.read("USB.DADDR")) == (CTR_RX, 0)
    assert fake_chip.read("USB.FNR") & 3 << 14 == 0
    fake_chip.write("USB.DADDR", 0x80)
    endpoint(fake_chip, 0, CONTROL, stat=rx(VALID))
    assert usb.begin(Transaction(Token.SETUP, 0, 0, 0, bytes(8))) is None, "deaf while RESET stands"
    fake_chip.write("USB.ISTR", 0xFFFF & ~RESET)
    assert usb.begin(Transaction(Token.SETUP, 0, 0, 0, bytes(8))) == ACK


def test_frames_raise_sof_each_millisecond_and_count(fake_chip: Any) -> None:
    usb = set_up(fake_chip, SOF)
    start_ns = fake_chip.now_ns
    usb.bus_changed(BusState.FRAMES, start_ns, 2046)
    for n in range(1, 5):
        fake_chip.advance(start_ns + n * MS - 1)
        assert not fake_chip.read("USB.ISTR") & SOF
        fake_chip.advance(start_ns + n * MS)
        assert fake_chip.read("USB.ISTR") & SOF
        assert fake_chip.irqs[LP]
        assert fake_chip.read("USB.FNR") == 1 << 15 | 1 << 13 | (2046 + n) % 2048
        fake_chip.write("USB.ISTR", 0xFFFF & ~SOF)
        assert not fake_chip.irqs[LP]


def test_frames_that_nobody_looks_at_have_no_events(fake_chip: Any) -> None:
    usb = set_up(fake_chip)
    usb.bus_changed(BusState.FRAMES, fake_chip.now_ns, 0)
    fake_chip.advance(fake_chip.now_ns + MS)
    assert fake_chip.read("USB.ISTR") & SOF
    assert usb.due_ns is None


def test_without_frames_esof_comes_each_millisecond_and_susp_after_three(fake_chip: Any) -> None:
    usb = set_up(fake_chip, SUSP)
    start_ns = fake_chip.now_ns
    usb.bus_changed(BusState.FRAMES, start_ns, 0)
    fake_chip.advance(start_ns + 10 * MS + 300)
    fake_chip.write("USB.ISTR", 0)
    usb.bus_changed(BusState.IDLE, fake_chip.now_ns, 0)
    quiet_ns = start_ns + 10 * MS
    for n in (1, 2, 3):
        fake_chip.advance(quiet_ns + n * MS - 1)
        assert not fake_chip.read("USB.ISTR") & (ESOF | SUSP)
        fake_chip.advance(quiet_ns + n * MS)
        assert fake_chip.read("USB.ISTR") & (ESOF | SUSP) == ESOF | SUSP * (n == 3)
        assert fake_chip.read("USB.FNR") >> 11 & 3 == n
        fake_chip.write("USB.ISTR", 0xFFFF & ~ESOF)
    fake_chip.write("USB.CNTR", SUSP | FSUSP)
    fake_chip.write("USB.ISTR", 0)
    fake_chip.advance(quiet_ns + 100 * MS)
    assert not fake_chip.read("USB.ISTR") & (ESOF | SUSP)


def test_a_resume_wakes_a_suspended_device_and_exti_18(fake_chip: Any) -> None:
    usb = set_up(fake_chip, WKUP)
    fake_chip.write("EXTI.IMR", 1 << 18)
    fake_chip.write("EXTI.RTSR", 1 << 18)
    usb.bus_changed(BusState.RESUME, fake_chip.now_ns, 0)
    assert not fake_chip.read("USB.ISTR") & WKUP, "it was not suspended"
    usb.bus_changed(BusState.IDLE, fake_chip.now_ns, 0)
    fake_chip.write("USB.CNTR", WKUP | FSUSP | LP_MODE)
    usb.bus_changed(BusState.RESUME, fake_chip.now_ns, 0)
    assert fake_chip.read("USB.ISTR") & WKUP
    assert fake_chip.read("USB.FNR") & 3 << 14 == 1 << 14
    assert (fake_chip.irqs[LP], fake_chip.irqs[42]) == (True, True)
    assert fake_chip.read("USB.CNTR") & (FSUSP | LP_MODE) == FSUSP


@pytest.mark.parametrize("state", [BusState.RESUME, BusState.RESET])
@pytest.mark.parametrize("is_suspended", [True, False])
def test_a_stopped_clock_counts_no_frames_and_what_wakes_does(
    fake_chip: Any, state: BusState, is_suspended: bool
) -> None:
    usb = set_up(fake_chip, WKUP)
    fake_chip.write("EXTI.IMR", 1 << 18)
    fake_chip.write("EXTI.RTSR", 1 << 18)
    usb.bus_changed(BusState.FRAMES, fake_chip.now_ns, 0)
    fake_chip.write("USB.CNTR", WKUP | SUSP | ESOF | (FSUSP if is_suspended else 0))
    fake_chip.write("USB.ISTR", 0)
    usb.clock_stopped()
    fake_chip.advance(fake_chip.now_ns + 5 * MS)
    usb.bus_changed(BusState.IDLE, fake_chip.now_ns, 0)
    fake_chip.advance(fake_chip.now_ns + 5 * MS)
    assert fake_chip.read("USB.ISTR") == 0, "neither SOF nor ESOF nor SUSP"
    usb.bus_changed(state, fake_chip.now_ns, 0)
    fake_chip.advance(fake_chip.now_ns + MS)
    assert fake_chip.read("USB.ISTR") == (WKUP if is_suspended else 0)
    assert fake_chip.irqs[42] is is_suspended
    usb.clock_resumed(11 * MS)
    resumed_ns = fake_chip.now_ns
    if state is BusState.RESET:
        fake_chip.advance(resumed_ns + RESET_NS - 1)
        assert not fake_chip.read("USB.ISTR") & RESET
        fake_chip.advance(resumed_ns + RESET_NS)
        assert fake_chip.read("USB.ISTR") & RESET
    usb.bus_changed(BusState.FRAMES, fake_chip.now_ns, 0)
    fake_chip.advance(fake_chip.now_ns + MS)
    assert fake_chip.read("USB.ISTR") & SOF


def test_fres_is_a_reset_of_the_bus(fake_chip: Any) -> None:
    usb = set_up(fake_chip)
    endpoint(fake_chip, 1, BULK, stat=rx(VALID))
    fake_chip.write("USB.CNTR", FRES)
    assert (fake_chip.read("USB.EP1R"), fake_chip.read("USB.DADDR")) == (0, 0)
    assert fake_chip.read("USB.ISTR") & RESET
    assert usb.begin(Transaction(Token.IN, 0, 0)) is None


@pytest.mark.parametrize(("divider", "hears"), [(0, True), (1 << 22, False)])
def test_another_clock_than_48_mhz_is_warned_of_and_deaf(fake_chip: Any, divider: int, hears: bool) -> None:
    usb = fake_chip.parts.by_name["USB"]
    fake_chip.run_at_72_mhz()
    fake_chip.write("RCC.CFGR", fake_chip.read("RCC.CFGR") | divider)
    fake_chip.write("USB.CNTR", 0)
    fake_chip.write("USB.ISTR", 0)
    fake_chip.write("USB.DADDR", 0x80)
    endpoint(fake_chip, 0, CONTROL, stat=rx(VALID))
    assert (usb.begin(Transaction(Token.SETUP, 0, 0, 0, bytes(8))) is not None) is hears
    assert ("USB:clock" in fake_chip.warnings) is not hears
    assert hears or "72000000 Hz and must be 48000000 Hz" in fake_chip.warnings["USB:clock"]


def test_usb_and_can_that_are_both_on_are_warned_of_once(fake_chip: Any) -> None:
    set_up(fake_chip)
    fake_chip.write("CAN.MCR", 1)
    assert "USB:CAN" not in fake_chip.warnings
    fake_chip.write("CAN.BTR", 1 << 30 | 1)
    fake_chip.write("CAN.MCR", 0)
    fake_chip.advance(fake_chip.now_ns + MS)
    assert "one memory of 512 bytes" in fake_chip.warnings["USB:CAN"]


def test_the_transceiver_takes_its_pins_and_gives_them_back(fake_chip: Any) -> None:
    fake_chip.write("GPIOA.CRH", 0x4442_4444)  # PA12 a low output
    pin = fake_chip.pins["PA12"]
    set_up(fake_chip)
    usb = fake_chip.parts.by_name["USB"]
    assert (pin.holder, usb.is_attached) == ("USBDP", True)
    fake_chip.write("USB.CNTR", PDWN)
    assert (pin.holder, usb.is_attached) == (None, False)


def test_a_reset_forgets_the_registers_and_keeps_the_packets(fake_chip: Any) -> None:
    usb = set_up(fake_chip)
    put(fake_chip, 0x1FE, b"ab")
    endpoint(fake_chip, 1, BULK, stat=rx(VALID))
    usb.reset()
    assert (fake_chip.read("USB.CNTR"), fake_chip.read("USB.EP1R")) == (3, 0)
    assert stored(fake_chip, 0x1FE, 2) == b"ab"
    assert fake_chip.pins["PA12"].holder is None


@QUICK
@given(st.binary(min_size=1, max_size=64), st.integers(0, 0x1C0).map(lambda n: n & ~1))
def test_what_is_received_can_be_sent_back_from_where_it_is(make_fake_chip: Chips, data: bytes, address: int) -> None:
    chip = make_fake_chip()
    usb = set_up(chip)
    chip.write("USB.BTABLE", 0x1E0)
    for word, value in enumerate((address, len(data), address, 1 << 15 | 1 << 10)):
        chip.write(f"USB.PMA_{0x1E8 + 2 * word:03X}", value)
    endpoint(chip, 1, BULK, stat=rx(VALID) | tx(VALID))
    assert send(usb, Token.OUT, 1, 0, data) == ACK
    if address + len(data) <= 0x1E8:
        assert send(usb, Token.IN, 1) == UsbResponse(None, 0, data)
