"""A host and a CDC program: enumeration, its failures at every transaction, data, suspend, snapshots."""

from collections.abc import Callable
from contextlib import suppress

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim import BluePill
from bluepill_sim.fabric.usb_bus import Handshake, Token, Transaction, UsbResponse, transaction_ns
from bluepill_sim.parts.usb import HostState, UsbRequestError
from bluepill_sim.parts.usb.descriptors import DescriptorError, parse_configuration, parse_device, parse_string
from bluepill_sim.parts.usb.host import HEAD_NS, RECOVERY_NS, RESET_NS, STATUS_NS
from simbase.timing import NS_PER_MS
from tests.tools.examples import EXAMPLES

Boards = Callable[[], BluePill]
Row = tuple[int, Transaction, UsbResponse | None]
#: Transactions up to the one after which the device is configured, and the first line.
ENUMERATION = 31


def watch(board: BluePill) -> list[Row]:
    rows: list[Row] = []
    board.usb.subscribe_transactions(lambda ns, one, answer: rows.append((ns, one, answer)))
    return rows


def echoes(board: BluePill, text: bytes = b"hello\n") -> bool:
    board.usb_serial.receive(text)
    return board.usb_serial.expect(text.upper()).endswith(text.upper())


def test_a_host_finds_the_device_and_talks_to_it(board: BluePill) -> None:
    rows = watch(board)
    device = board.usb.wait_configured()
    assert str(device) == "1209:0001 p2os, echo"
    assert device.configuration is not None
    assert [hex(one.address) for one in device.configuration.endpoints] == ["0x81", "0x2", "0x82"]
    assert [one.token for _, one, _ in rows[:3]] == [Token.SETUP, Token.IN, Token.OUT]
    assert len(rows) == board.usb.transactions == ENUMERATION
    assert echoes(board)
    assert board.usb.transfer(0xA1, 0x21, length=7) == (115_200).to_bytes(4, "little") + b"\0\0\x08"
    assert board.warnings == []


def test_nobody_is_there_until_the_cable_is_plugged_in(boards: Boards) -> None:
    board = boards()
    board.run_for("300 ms")
    assert (board.usb.state, board.usb.transactions, board.pin("PA12").level) == (HostState.UNPLUGGED, 0, True)
    with pytest.raises(UsbRequestError, match="not configured: unplugged"):
        board.usb.transfer(0x80, 6, 0x100, length=18)


def test_the_times_of_the_port_are_those_of_a_host(boards: Boards) -> None:
    """100 ms of debouncing, 50 of reset, 10 to recover; the request begins in the next frame."""
    board = boards()
    board.run_for("10 ms")
    rows = watch(board)
    plugged_ns = board.now_ns
    board.usb.plug()
    board.usb.wait_configured()
    first_ns = rows[0][0]
    assert first_ns - plugged_ns == 161 * NS_PER_MS + 3_250  # and the packet of SOF
    assert rows[2][0] - rows[0][0] < NS_PER_MS, "its stages follow in one frame"


def test_a_device_that_polls_has_time_before_the_status_stage_and_before_the_second_reset(boards: Boards) -> None:
    """Else it meets the end of the data together with the status, and the status together with the reset."""
    board = boards()
    board.usb.plug()
    rows = watch(board)
    board.usb.wait_configured()
    (data_ns, data, answer), (status_ns, status, _) = rows[1:3]
    assert (data.token, status.token) == (Token.IN, Token.OUT)
    assert answer is not None
    assert status_ns - data_ns == STATUS_NS + transaction_ns(len(answer.data))
    done_ns = status_ns + transaction_ns(0)
    assert HEAD_NS + RESET_NS + RECOVERY_NS < rows[3][0] - done_ns <= HEAD_NS + RESET_NS + RECOVERY_NS + 2 * NS_PER_MS


@pytest.mark.parametrize("core", ["native", "python"])
def test_the_same_program_has_the_same_transactions_in_any_slices(
    boards: Boards, core: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def run(step_ns: int) -> list[Row]:
        board = boards()
        rows = watch(board)
        board.usb.plug()
        board.usb_serial.receive(b"abc" * 50)
        while board.now_ns < 260 * NS_PER_MS:
            board.advance_to(board.now_ns + step_ns)
        return rows

    whole = run(260 * NS_PER_MS)
    monkeypatch.setenv("P2OS_CORE", core)
    assert run(3_700_001) == whole
    assert len(whole) > ENUMERATION


def test_a_snapshot_in_the_midst_of_an_enumeration_goes_on_alike(boards: Boards) -> None:
    board = boards()
    rows = watch(board)
    board.usb.plug()
    board.run_for("222 ms")
    saved, count = board.snapshot(), len(rows)
    assert 0 < count < ENUMERATION
    other = boards()
    other_rows = watch(other)
    other.restore(saved)
    for one in (board, other):
        one.usb.wait_configured()
        assert echoes(one)
    assert other_rows == rows[count:]


def test_the_cable_pulled_at_each_transaction_leaves_a_device_that_can_be_found_again(boards: Boards) -> None:
    board = boards()
    board.usb.plug()
    rows: list[int] = []

    def stop(at_ns: int, _one: Transaction, _answer: UsbResponse | None) -> None:
        rows.append(at_ns)
        board.request_stop()

    board.usb.subscribe_transactions(stop)
    moments = []
    while len(rows) < ENUMERATION:
        seen = len(rows)
        board.advance_to(board.now_ns + NS_PER_MS)
        if len(rows) > seen:
            moments.append(board.snapshot())
    assert len(moments) >= ENUMERATION - 2, "a block of the program may be longer than one"
    for moment in moments:
        board.restore(moment)
        board.usb.unplug()
        board.run_for("5 ms")
        board.usb.wait_configured()
        assert echoes(board)


def test_a_bus_reset_in_the_midst_of_data_enumerates_anew(boards: Boards) -> None:
    board = boards()
    board.usb.wait_configured()
    board.usb_serial.receive(bytes(1000))
    board.run_for("500 us")
    board.usb.reset()
    assert board.usb.state is HostState.ENUMERATING
    board.usb.wait_configured()
    board.usb_serial.read()
    assert echoes(board)


@pytest.mark.parametrize("what", ["to device", "to host", "ack"])
@pytest.mark.parametrize("places", [range(0, 37, 7), pytest.param(range(37), marks=pytest.mark.soak)], ids=len)
def test_a_packet_lost_in_any_transaction_is_made_up_for(boards: Boards, what: str, places: range) -> None:
    """Those of the enumeration, and of the echo behind it."""
    board = boards()
    board.usb.plug()
    fresh = board.snapshot()
    for n in places:
        board.restore(fresh)
        board.usb_serial.unread.clear()
        board.usb.damage(what, after=n)
        board.usb.wait_configured()
        assert echoes(board, b"the quick brown fox jumps over the lazy dog. " * 3)
        assert board.usb_serial.unread == b"", "nothing comes twice"


def test_three_lost_in_a_row_end_the_attempt_and_the_next_one_works(boards: Boards) -> None:
    board = boards()
    board.usb.plug()
    board.usb.damage("to device", 3)
    board.run_for("164 ms")
    assert board.usb.state is HostState.ENUMERATING
    assert board.usb.reason == "head of the device descriptor: does not answer"
    board.usb.wait_configured()
    assert board.usb.transactions == ENUMERATION + 3


def test_requests_that_the_device_does_not_know_stall_and_the_next_one_works(boards: Boards) -> None:
    board = boards()
    board.usb.wait_configured()
    for kind, request, value in ((0xC0, 0x55, 0), (0x80, 6, 0x0900), (0x40, 0xFF, 7), (0x80, 6, 0x0309)):
        with pytest.raises(UsbRequestError, match="stalled"):
            board.usb.transfer(kind, request, value, length=8)
        assert board.usb.transfer(0x80, 6, 0x0100, length=18)[:2] == b"\x12\x01"


@settings(max_examples=20)
@given(requests=st.lists(st.binary(min_size=8, max_size=8), min_size=1, max_size=5))
def test_requests_of_any_bytes_do_the_device_no_harm(configured: BluePill, requests: list[bytes]) -> None:
    board = configured
    saved = board.snapshot()
    try:
        for one in requests:
            length = int.from_bytes(one[6:8], "little") % 200
            kind, request = one[0], one[1]
            if (kind, request) in {(0, 5), (0, 9)}:
                continue  # an address or a configuration of its own
            try:
                words = int.from_bytes(one[2:4], "little"), int.from_bytes(one[4:6], "little")
                is_in = kind & 0x80
                board.usb.transfer(
                    kind, request, *words, b"" if is_in else bytes(length % 65), length=length if is_in else 0,
                    within="6 s",
                )  # fmt: skip
            except UsbRequestError:
                pass
        assert board.usb.transfer(0x80, 6, 0x0100, length=18)[:2] == b"\x12\x01"
        assert board.fault is None
    finally:
        board.restore(saved)


@pytest.fixture(scope="module")
def configured() -> BluePill:
    board = BluePill(str(EXAMPLES / "usb_echo.elf"))
    board.usb.wait_configured()
    return board


def test_a_full_pipe_makes_the_host_wait_and_loses_nothing(boards: Boards) -> None:
    board = boards()
    board.usb.wait_configured()
    data = bytes(range(97, 123)) * 400
    start_ns = board.now_ns
    board.usb_serial.receive(data)
    got = b""
    while len(got) < len(data):
        board.run_for("1 ms")
        got += board.usb_serial.read()
    assert got == data.upper()
    packets = -(-len(data) // 64)
    assert board.now_ns - start_ns > 2 * packets * transaction_ns(64) - NS_PER_MS


def test_a_pull_up_that_goes_is_a_device_that_has_gone(boards: Boards) -> None:
    board = boards()
    board.usb.wait_configured()
    board.pin("PA12").short("GND")
    board.run_for("1 ms")
    assert board.usb.state is HostState.WAITING
    assert board.usb.device is None
    board.pin("PA12").short(None)
    board.usb.wait_configured()
    assert echoes(board)


def test_a_reset_that_the_host_does_not_see_makes_the_device_deaf(boards: Boards) -> None:
    """The 1.5 kOhm of the board stay: only a program that pulls PA12 down is found again."""
    board = boards()
    board.usb.wait_configured()
    board.reset()
    board.usb_serial.receive(b"x")
    board.run_for("100 ms")
    assert board.usb.halted(0x02) == "does not answer"
    board.pin("PB0").drive(0)
    board.reset()
    board.run_for("50 ms")
    assert board.usb.state in {HostState.WAITING, HostState.DEBOUNCING}
    board.usb.wait_configured()
    assert echoes(board)


def test_an_endpoint_that_has_halted_goes_on_when_it_is_cleared(boards: Boards) -> None:
    board = boards()
    board.usb.wait_configured()
    board.usb.damage("to device", 3)
    board.usb_serial.receive(b"lost\n")
    board.run_for("20 ms")
    assert board.usb.halted(0x02) == "does not answer"
    board.usb.clear_halt(0x02)
    assert board.usb.halted(0x02) == ""
    board.usb_serial.receive(b"found\n")
    assert board.usb_serial.expect(b"FOUND\n", within="100 ms")


def test_a_suspended_bus_is_still_and_goes_on(boards: Boards) -> None:
    board = boards()
    board.usb.wait_configured()
    board.usb.suspend()
    board.usb_serial.receive(b"later")
    count = board.usb.transactions
    board.run_for("100 ms")
    assert board.usb.transactions == count
    assert board.registers("USB")["ISTR"]["SUSP"] == 1
    board.usb.resume()
    assert board.usb_serial.expect(b"LATER") == b"LATER"


def test_a_device_without_a_program_for_it_fails_in_one_line(boards: Boards) -> None:
    del boards  # for its watchdog
    board = BluePill(str(EXAMPLES / "motors.elf"))
    with pytest.raises(UsbRequestError, match="it is failed: head of the device descriptor: does not answer"):
        board.usb.wait_configured("5 s")


def test_an_endpoint_that_is_not_there_is_named_with_those_that_are(configured: BluePill) -> None:
    with pytest.raises(UsbRequestError, match="no endpoint 0x03; it has 0x81, 0x02, 0x82"):
        configured.usb.write(3, b"x")
    with pytest.raises(ValueError, match="no packet 'all'"):
        configured.usb.damage("all")


GOOD = bytes.fromhex("090220000101008032 09040000020a000000 0705020240 0000 0705820240 0000".replace(" ", ""))


@settings(max_examples=300)
@given(st.one_of(st.binary(max_size=80), st.binary(max_size=40).map(lambda tail: GOOD[:18] + tail)))
def test_descriptors_of_any_bytes_are_described_or_refused(data: bytes) -> None:
    for parse in (parse_device, parse_configuration, parse_string):
        with suppress(DescriptorError):  # and nothing else
            parse(data)


def test_a_configuration_is_read_with_the_first_setting_of_each_interface() -> None:
    found = parse_configuration(GOOD)
    assert [(one.address, one.packet_bytes) for one in found.endpoints] == [(2, 64), (0x82, 64)]
    more = GOOD + bytes.fromhex("09040001010a000000") + bytes.fromhex("07050302400000")
    more = more[:2] + len(more).to_bytes(2, "little") + more[4:]
    assert parse_configuration(more) == found
    for cut in range(len(GOOD)):
        shorter = GOOD[:2] + cut.to_bytes(2, "little") + GOOD[4:cut]
        with suppress(DescriptorError):
            assert len(parse_configuration(shorter).endpoints) < 2


def test_a_transaction_lasts_as_long_as_its_bits() -> None:
    """35 of the token, 35 + 8 n of data, 19 of the handshake, 4 behind each, at 12 Mbit/s."""
    assert transaction_ns(64) == -(-(35 + 4 + 35 + 512 + 4 + 19 + 4) * 1000 // 12)
    assert 1_000_000 // transaction_ns(64) == 19
    assert UsbResponse(Handshake.ACK).data == b""
