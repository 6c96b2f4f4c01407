"""A run with pins driven by a list (`--drive`), and what the commands print of a run on stderr.

Invariant: the same list gives the same run, whatever the slices.
"""

import re
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from bluepill_sim.board import BluePill, WaitError
from bluepill_sim.core.halts import ChipReached
from bluepill_sim.errors import BluePillError
from bluepill_sim.fabric.pins import Pin
from bluepill_sim.fabric.signals import to_uv
from bluepill_sim.parts.usb import HostState
from bluepill_sim.program.last_blocks import TITLE
from bluepill_sim.spans import to_nanos
from simbase.timing import NS_PER_S, Nanos, Reason

#: What a level's word does to a pin; "gnd" and "3v3" are solder bridges.
_LEVELS: dict[str, Callable[[Pin], None]] = {
    "0": lambda pin: pin.drive(0),
    "1": lambda pin: pin.drive(1),
    "low": lambda pin: pin.drive(0),
    "high": lambda pin: pin.drive(1),
    "z": lambda pin: pin.drive(None),
    "gnd": lambda pin: pin.short("GND"),
    "3v3": lambda pin: pin.short("3V3"),
}
_HINT = "PIN=LEVEL@TIME with a level of 0, 1, z, GND, 3V3 or volts, such as PA6=1@3.5s or PA0=1.65V"
#: Volts as they are typed, in lower case.
_VOLTS = re.compile(r"(-?\d+(?:\.\d+)?)v")


class OverBudgetError(BluePillError):
    """A run took longer than it may."""

    exit_code = 1


@dataclass(frozen=True, slots=True)
class PinChange:
    """A level put on a pin from outside, at a time."""

    at_ns: Nanos
    pin: str
    #: One of the words that `--drive` knows, or volts such as "1.65v".
    level: str

    def act(self, board: BluePill) -> None:
        """Put the level on the pin, in place of volts before it."""
        pin = board.pin(self.pin)
        if self.level not in _LEVELS:
            pin.set_volts(float(self.level[:-1]))
            return
        if pin.has_volts:
            pin.set_volts(None)
        _LEVELS[self.level](pin)


def parse_changes(texts: Sequence[str], board: BluePill) -> list[PinChange]:
    """Return what `--drive` asks for, by time.

    Raises:
        BluePillError: one is not understood, or names a pin that has no leg.
    """
    changes = []
    for text in texts:
        name, _, rest = text.partition("=")
        level, _, at = rest.partition("@")
        if level.lower() not in _LEVELS and not _is_volts(level.lower()):
            raise BluePillError(f"--drive {text!r} is not understood", hint=_HINT)
        try:
            is_bonded = board.pin(name.upper()).is_bonded
        except KeyError:
            is_bonded = False
        if not is_bonded:
            raise BluePillError(f"--drive {text!r}: the chip has no leg {name.upper()}", hint=_HINT)
        changes.append(PinChange(to_nanos(at) if at else 0, name.upper(), level.lower()))
    return sorted(changes, key=lambda change: change.at_ns)


@dataclass(frozen=True, slots=True)
class SentText:
    """Characters that USART1 receives from a time on."""

    at_ns: Nanos
    data: bytes

    def act(self, board: BluePill) -> None:
        """Have the receiver take the characters."""
        board.usart1.receive(self.data)


def parse_texts(texts: Sequence[str]) -> list[SentText]:
    r"""Return what `--send` asks for, by time; `\n`, `\r`, `\t`, `\xHH` and `\\` are read as in C.

    Raises:
        BluePillError: one is not understood.
    """
    found = []
    for text in texts:
        words, _, at = text.rpartition("@")
        try:
            data = words.encode("latin-1").decode("unicode_escape").encode("latin-1")
        except UnicodeError:
            data = b""
        if not data:
            raise BluePillError(f"--send {text!r} is not understood", hint=r"TEXT@TIME, such as 'ping\n@500ms'")
        found.append(SentText(to_nanos(at), data))
    return sorted(found, key=lambda sent: sent.at_ns)


class Schedule:
    """A board, and what happens at its pins."""

    def __init__(
        self,
        board: BluePill,
        changes: Sequence[PinChange],
        advance: Callable[[Nanos], ChipReached] | None = None,
        *,
        texts: Sequence[SentText] = (),
    ) -> None:
        """Plan changes.

        Args:
            board: the board.
            changes: by time.
            advance: brings the board to a time, or less far; None is the board's own.
            texts: what USART1 receives, by time.
        """
        self._board = board
        both: list[PinChange | SentText] = [*changes, *texts]
        both.sort(key=_time_of)
        self._left = both[::-1]
        self._advance = advance or board.advance_to

    def advance_to(self, limit_ns: Nanos) -> ChipReached:
        """Bring the board to a time, or less far, and put what is due by then on its pins."""
        self._act(self._board.now_ns)
        due_ns = self._left[-1].at_ns if self._left else limit_ns
        reached = self._advance(min(limit_ns, due_ns))
        self._act(self._board.now_ns)
        return reached

    def run_to(self, end_ns: Nanos) -> ChipReached:
        """Run to a time, past edges; a halt for good ends it."""
        self._act(self._board.now_ns)
        while self._board.now_ns < end_ns:
            reached = self.advance_to(end_ns)
            if reached.reason is Reason.HALT:
                return reached
        return ChipReached(self._board.now_ns)

    def _act(self, now_ns: Nanos) -> None:
        while self._left and self._left[-1].at_ns <= now_ns:
            self._left.pop().act(self._board)


def _time_of(change: PinChange | SentText) -> Nanos:
    return change.at_ns


def _is_volts(level: str) -> bool:
    """Tell whether a level is volts that a pin may have."""
    found = _VOLTS.fullmatch(level)
    try:
        return found is not None and to_uv(float(found[1])) is not None
    except ValueError:
        return False


def run_driven(board: BluePill, end_ns: Nanos, changes: Sequence[PinChange]) -> ChipReached:
    """Run to a time and put the changes on the pins at theirs; a halt for good ends it."""
    with showing_where_it_hangs(board):
        return Schedule(board, changes).run_to(end_ns)


@contextmanager
def showing_where_it_hangs(board: BluePill) -> Iterator[None]:
    """Print where a run had come to when Ctrl-C or an error ends it; what ran last, where that may be the cause."""
    try:
        yield
    except (KeyboardInterrupt, BluePillError) as error:
        is_given_up = isinstance(error, (OverBudgetError, WaitError))
        if not print_fault(board) and (is_given_up or board.activity.is_quiet(board.now_ns)):
            print_last_blocks(board)
        print_status(f"ended at {summary(board)}")
        raise


def print_status(line: str) -> None:
    """Print a line that is not the result, on stderr."""
    sys.stderr.write(f"{line}\n")
    sys.stderr.flush()


def warn_on_stderr(board: BluePill) -> None:
    """Print each warning as it comes."""
    board.subscribe_warnings(lambda text: print_status(f"warning: {text} (t = {board.now_ns / NS_PER_S:.6f} s)"))


def summary(board: BluePill) -> str:
    """Return where a run has come to, in one line; a second one tells of faults and resets."""
    doing = "asleep at" if board.is_asleep else "at"
    if board.is_asleep and board.next_deadline() is None:
        doing = "asleep, and nothing on the chip is due to wake it, at"
    count = len(board.warnings)
    warned = f", {count} warning{'s' if count != 1 else ''}" if count else ""
    verdict = f"\n{board.verdict}" if board.verdict and (board.resets or not board.has_died) else ""
    reached = f"{board.now_ns / NS_PER_S:.6f} s of virtual time, {board.cycle} cycles, {doing} {board.where()}"
    return f"{reached}{warned}{_line_speeds(board)}{verdict}"


def _line_speeds(board: BluePill) -> str:
    """Return a line for each USART that has sent: how much, and how fast; and one of what is plugged in at USB."""
    lines = []
    for name, port in board.serial_ports.items():
        speeds = [f"{count} characters at {baud} bit/s" for baud, count in port.speeds.items()]
        far = "" if port.far_baud is None else f"; the far end is at {port.far_baud} bit/s"
        if speeds:
            lines.append(f"\n{name} sent {', '.join(speeds)}{far}")
    if board.usb.state is not HostState.UNPLUGGED:
        line = board.usb_serial
        carried = f", {line.received_bytes} bytes from it, {line.sent_bytes} to it" if board.usb.serial_in else ""
        lines.append(f"\nusb: {board.usb.describe()}{carried}")
    return "".join(lines)


def print_fault(board: BluePill) -> bool:
    """Print last blocks, registers and, as the last line, why a firmware died; return whether it did."""
    if not board.has_died:
        return False
    print_last_blocks(board)
    if board.fault is None:
        print_status(f"fault: {board.reset_row}")
        return True
    for line in board.fault.register_dump.splitlines():
        print_status(f"  {line}")
    print_status(f"fault: {board.fault}")
    return True


def print_last_blocks(board: BluePill) -> None:
    """Print what a board ran last."""
    for line in (TITLE, *board.last_blocks()):
        print_status(line)
