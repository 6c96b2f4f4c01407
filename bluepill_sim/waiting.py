"""Running a board until something is so.

A condition in words is met at the border of the very block that makes it true,
whatever the caller's slices; a condition in Python is looked at in steps.

    pin PA4 high | pin PA4 low | pin PA4 changes     the level on the wire
    usart1 sends TEXT                                characters that go out from now on
    asleep | awake | fault                           what the core is doing

Invariant: a wait leaves the board's watches and listeners as it found them.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from bluepill_sim.durations import Span, to_nanos
from bluepill_sim.errors import BluePillError
from bluepill_sim.serial_port import SerialPort
from bluepill_sim.sight.last_blocks import title_of
from bluepill_sim.timing import NS_PER_MS, NS_PER_S, Nanos, Reached, Reason

if TYPE_CHECKING:
    from bluepill_sim.board import BluePill

#: How often a condition without an event of its own is looked at. chosen: finer than anything a person waits for.
STEP_NS: Nanos = 1 * NS_PER_MS
#: Characters of a port's last words that a message shows.
_SHOWN = 60

#: Tells whether the board is where one wants it.
Predicate = Callable[["BluePill"], bool]
Condition = str | Predicate

_HINT = 'such as "pin PA4 high", "usart1 sends ready", "asleep", "fault", or a function of the board'


class WaitError(BluePillError):
    """What was waited for did not come."""

    exit_code = 1


def run_for(board: "BluePill", span: Span) -> Reached:
    """Run for a span of virtual time, past the edges of watched pins; a halt ends it."""
    return run_to(board, board.now_ns + to_nanos(span))


def run_to(board: "BluePill", end_ns: Nanos) -> Reached:
    """Run to a point in virtual time, past the edges of watched pins; a halt ends it."""
    while True:
        reached = board.advance_to(end_ns)
        if reached.reason is not Reason.EDGE:
            return reached


def until(
    board: "BluePill", condition: Condition, timeout: Span, advance: Callable[[Nanos], Reached] | None = None
) -> Nanos:
    """Run until a condition holds; return when that was.

    Args:
        board: what runs.
        condition: words of this module's text, or a function of the board, looked at each millisecond.
        timeout: the longest wait, in virtual time.
        advance: brings the board to a time, or less far; None is the board's own.

    Raises:
        WaitError: the time is over, or the core halted for good; its notes show what ran last.
        BluePillError: the words are not understood.
    """
    advance = advance or board.advance_to
    end_ns = board.now_ns + to_nanos(timeout)
    with _watch(board, condition) as (holds, step_ns):
        while not holds():
            if board.now_ns >= end_ns:
                raise _given_up(
                    board, f"not seen within {to_nanos(timeout) / NS_PER_S:g} s: {_name(condition)}; {_state(board)}"
                )
            limit = end_ns if step_ns is None else min(end_ns, board.now_ns + step_ns)
            if advance(limit).reason is Reason.HALT and not holds():
                raise _given_up(board, f"the core halted before: {_name(condition)}; {_state(board)}")
        return board.now_ns


def wait_for_bytes(board: "BluePill", port: SerialPort, pattern: bytes, within: Span) -> None:
    """Run until `pattern` is in what `port` has sent and nobody has taken.

    Raises:
        WaitError: it did not come in time.
        BluePillError: the pattern is empty.
    """
    if not pattern:
        raise BluePillError("an empty pattern is always there", hint="expect at least one byte")
    end_ns = board.now_ns + to_nanos(within)
    with _stop_at_words(board, port):
        while pattern not in port.unread:
            reached = board.advance_to(end_ns)
            if reached.reason is Reason.HALT or (board.now_ns >= end_ns and pattern not in port.unread):
                last = bytes(port.unread[-_SHOWN:])
                raise _given_up(
                    board,
                    f"{port.name} did not send {pattern!r} within {to_nanos(within) / NS_PER_S:g} s; "
                    f"it sent {last!r}; {_state(board)}",
                )


@contextmanager
def _watch(board: "BluePill", condition: Condition) -> "Iterator[tuple[Callable[[], bool], Nanos | None]]":
    """Have the board stop where a condition may have become true; yields (holds, step)."""
    if callable(condition):
        yield (lambda: condition(board)), STEP_NS
        return
    words = condition.split(maxsplit=2)
    match [word.lower() for word in words[:2]]:
        case ["pin", name] if len(words) == 3:
            with _stop_at_pin(board, name.upper(), words[2].lower()) as holds:
                yield holds, None
        case [port, "sends"] if len(words) == 3 and port in board.serial_ports:
            sent, text = bytearray(), words[2].encode()
            with _stop_at_words(board, board.serial_ports[port], sent):
                yield (lambda: text in sent), None
        case [state] if state in _STATES:
            yield (lambda: _STATES[state](board)), STEP_NS
        case _:
            raise BluePillError(f"{condition!r} is not understood", hint=_HINT)


_STATES: dict[str, Predicate] = {
    "asleep": lambda board: board.is_asleep,
    "awake": lambda board: not board.is_asleep,
    "fault": lambda board: board.fault is not None,
}


@contextmanager
def _stop_at_pin(board: "BluePill", name: str, what: str) -> Iterator[Callable[[], bool]]:
    try:
        pin = board.pin(name)
    except KeyError:
        raise BluePillError(f"no such pin: {name}", hint="PA0 to PA15, PB0 to PB15, PC13 to PC15") from None
    before = pin.level
    tests: dict[str, Callable[[], bool]] = {
        "high": lambda: pin.level,
        "low": lambda: not pin.level,
        "changes": lambda: pin.level is not before,
    }
    if what not in tests:
        raise BluePillError(f"a pin is high, low, or changes; it cannot be {what!r}", hint=_HINT)
    was_watched = pin.is_watched
    pin.watch(True)
    try:
        yield tests[what]
    finally:
        pin.watch(was_watched)


@contextmanager
def _stop_at_words(board: "BluePill", port: SerialPort, sent: bytearray | None = None) -> Iterator[None]:
    """End the board's slice after each word that a port sends, and note the words in `sent`."""

    def stop(word: int, _at_ns: Nanos) -> None:
        if sent is not None:
            sent.append(word & 0xFF)
        board.request_stop()

    port.listeners.append(stop)
    try:
        yield
    finally:
        port.listeners.remove(stop)


def _name(condition: Condition) -> str:
    return condition if isinstance(condition, str) else getattr(condition, "__name__", "the condition")


def _given_up(board: "BluePill", message: str) -> WaitError:
    """Return the error of a wait; pytest and tracebacks show its note, one line for a person does not."""
    error = WaitError(message)
    lines = board.last_blocks()
    if lines:
        error.add_note("\n".join([title_of(len(lines)), *lines]))
    return error


def _state(board: "BluePill") -> str:
    if board.fault is not None:
        return f"{board.fault}"
    doing = "asleep at" if board.is_asleep else "at"
    return f"t = {board.now_ns / NS_PER_S:.6f} s, {doing} {board.where()}"
