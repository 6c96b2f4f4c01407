"""Running a board until something is so, and talking to it."""

import re

import pytest

from bluepill_sim import BluePill, BluePillError, WaitError
from bluepill_sim.board import _has_line
from bluepill_sim.spans import to_nanos
from simbase.timing import Reason
from tests.bluepill_sim.machine import listen
from tests.tools.examples import EXAMPLES

SENSORS = str(EXAMPLES / "sensors.elf")


@pytest.fixture
def board() -> BluePill:
    return BluePill(SENSORS)


@pytest.mark.parametrize(
    ("text", "ns"),
    [("10ms", 10_000_000), ("1.5 s", 1_500_000_000), ("250us", 250_000), ("250 µs", 250_000), ("3ns", 3),
     ("2min", 120 * 10**9), ("0.1ms", 100_000), (7, 7)],
)  # fmt: skip
def test_a_span_is_a_number_with_its_unit(text: str | int, ns: int) -> None:
    assert to_nanos(text) == ns


@pytest.mark.parametrize("text", ["10", "ms", "-1ms", "1 fortnight", "", "99999999999999999999s", -1, True, 1.5, None])
def test_what_is_no_span_is_refused(text: object) -> None:
    with pytest.raises(BluePillError):
        to_nanos(text)  # type: ignore[arg-type] # on purpose


def test_a_line_is_looked_for_beyond_an_empty_one_and_what_does_not_match_is_dropped() -> None:
    sent = bytearray(b"\nstarting\r\nready\r\nrea")
    assert _has_line(sent, re.compile("^ready$"))
    assert sent == b"ready\r\nrea"
    assert not _has_line(sent, re.compile("^rea$"))
    assert sent == b"rea"


def test_run_for_goes_past_the_edges_of_watched_pins(board: BluePill) -> None:
    board.subscribe_pins(["PB12"], lambda _rows: None, ends_slice=["PB12"])
    board.run_for("10ms")
    assert 10_000_000 <= board.now_ns < 10_100_000
    assert board.pin("PB12").level


def test_until_a_pin_stops_at_the_block_that_drives_it(board: BluePill) -> None:
    edges: list[tuple[str, str, int]] = []
    listen(board, edges)
    at = board.until("pin PB12 high", timeout="10ms")
    assert at - edges[-1][2] < 1_000, "within one basic block"
    assert edges[-1][:2] == ("PB12", "high")
    assert board.advance_to(board.now_ns + 5_000_000).reason is Reason.DEADLINE, "nothing ends slices any more"


def test_expect_takes_what_was_sent_up_to_the_pattern(board: BluePill) -> None:
    assert board.usart1.expect(b"sens", within="10ms") == b"sens"
    assert board.usart1.expect(b"ready\n", within="10ms") == b"ors: ready\n"
    board.run_for("3.2s")
    board.pin("PA6").drive(1)
    assert board.usart1.expect(b"on", within="1s").endswith(b"sensor 3 on")


def test_expect_ends_at_the_stop_bit_of_the_last_character(board: BluePill) -> None:
    sent = []
    board.usart1.subscribe(lambda rows: sent.extend((chr(word), at) for word, at in rows))
    board.usart1.expect(b"y", within="10ms")
    assert sent[-1][0] == "y"
    assert board.now_ns - sent[-1][1] < 10_000


def test_what_does_not_come_is_reported_with_the_place(board: BluePill) -> None:
    with pytest.raises(
        WaitError, match=r"did not send b'nothing' within 0.01 s; it sent b'.*ready\\n'; t = 0.01.* asleep"
    ):
        board.usart1.expect(b"nothing", within="10ms")
    with pytest.raises(WaitError, match=r"not seen within 0.001 s: pin PA4 high"):
        board.until("pin PA4 high", timeout="1ms")


@pytest.mark.parametrize(
    "words",
    [
        "pin PA4",
        "pin XX9 high",
        "pin PA4 purple",
        "usart9 sends x",
        "tea",
        "usart1 sends",
        "usart1 matches (",
        "usart1 matches",
    ],
)
def test_words_that_mean_nothing_are_refused(board: BluePill, words: str) -> None:
    with pytest.raises(BluePillError) as caught:
        board.until(words, timeout="1ms")
    assert caught.value.hint


def test_an_empty_pattern_is_refused(board: BluePill) -> None:
    board.run_for("1ms")
    with pytest.raises(BluePillError):
        board.until("usart1 sends  ", timeout="1ms")


def test_a_line_that_matches_is_whole(board: BluePill) -> None:
    sent = bytearray()
    board.usart1.subscribe(lambda rows: sent.extend(word for word, _ in rows))
    board.until("usart1 matches ready$", timeout="10ms")
    board.run_for("1us")
    assert sent.endswith(b"ready\n")
    with pytest.raises(WaitError):
        board.until("usart1 matches ^ready", timeout="10ms")


def test_a_condition_may_be_a_function_of_the_board(board: BluePill) -> None:
    board.until(lambda chip: chip.hclk_hz == 72_000_000, timeout="10ms")
    assert board.until("asleep", timeout="10ms") < 20_000_000
    assert board.until("usart1 sends ready", timeout="10ms") < 20_000_000


def test_restore_puts_back_what_nobody_has_taken(board: BluePill) -> None:
    board.run_for("5ms")
    saved = board.snapshot()
    first = board.usart1.expect(b"ready")
    board.restore(saved)
    assert board.usart1.expect(b"ready") == first
