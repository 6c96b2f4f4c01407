"""A firmware that is served at the speed of the clock, and its own host, a program of others, that talks to it.

A serial port, the one of a USB device too, is a pseudo-terminal; CAN is a datagram socket (docs/bluepill.md). What
the host prints must match, it must end with its code, and pins of the board must have as many edges as it commanded.
"""

import os
import re
import subprocess
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from bluepill_sim import BluePill
from bluepill_sim.cli.can_socket import CanSocket
from bluepill_sim.cli.console import PtyConsole, connect
from bluepill_sim.cli.parts import attach_parts
from bluepill_sim.fabric.can_network import CanNetwork
from bluepill_sim.fabric.subscriptions import HIGH, Of, read_rows
from simbase.timing import NS_PER_MS, NS_PER_S
from tools.foreign.row import RowError, RowPlace

#: chosen: what was typed reaches the board so often.
_SLICE_NS = 2 * NS_PER_MS
#: chosen: by so much virtual time may hurry after the clock.
_MADE_UP_NS = 50 * NS_PER_MS
#: chosen: of what a host said last so much is shown, and a USB device may take so long to be there.
_SHOWN_CHARACTERS = 160
_USB_S = 5


@dataclass(frozen=True, kw_only=True)
class CountedEdges:
    """How many rising edges a pin must have had.

    Args:
        pin: Such as "PB0".
        least: At least so many.
        most: At most so many; None: as many as `least`.
        since: They are counted from the first rise of this pin on; empty: from the beginning.
        is_final: They are counted while the last host runs, and not before.
    """

    pin: str
    least: int
    most: int | None = None
    since: str = ""
    is_final: bool = False


@dataclass(frozen=True, kw_only=True)
class SwitchedAxis:
    """A motor's axis with a switch at its lower end, which pulls a pin up; it begins above it.

    Args:
        step: The pin whose rises are steps.
        direction: The pin that is high for steps upwards.
        switch: The pin that the switch pulls up.
        above: Steps from where it begins down to the switch.
    """

    step: str
    direction: str
    switch: str
    above: int


@dataclass(frozen=True, kw_only=True)
class Hosted:
    """Serves an image and runs its host beside it.

    Args:
        image: The firmware, a file of the cache.
        hosts: Commands, run one after the other. {line} is the terminal of `port`, {can} the path of the CAN's
            socket; {cache} and {scratch} are folders, {NAME} a file of `host_files`.
        hears: Regular expressions that what the hosts print must match, in this order; the first group of each that has
            one is reported.
        port: "usart1" to "usart3", "usb", or "can".
        host_needs: What has to be there for the hosts.
        files: Written into the scratch folder before: name and text.
        edges: What must be seen at pins.
        axes: What its motors move.
        environment: Variables of the hosts.
        attach: Parts, as `p2os mcu run --attach` has them.
        drive: Levels of pins by name before it begins.
        codes: Exit codes of the hosts that are right.
        hosts_s: Seconds of the clock that each host may take.
    """

    image: str
    hosts: tuple[tuple[str, ...], ...]
    hears: tuple[str, ...] = ()
    port: str = "usart1"
    host_needs: tuple[str, ...] = ()
    files: tuple[tuple[str, str], ...] = ()
    edges: tuple[CountedEdges, ...] = ()
    axes: tuple[SwitchedAxis, ...] = ()
    environment: tuple[tuple[str, str], ...] = ()
    attach: tuple[str, ...] = ()
    drive: tuple[tuple[str, int], ...] = ()
    codes: frozenset[int] = frozenset({0})
    hosts_s: float = 60.0

    @property
    def needs(self) -> tuple[str, ...]:
        """The image, and the hosts."""
        return (self.image, *self.host_needs)

    def run(self, place: RowPlace) -> str:
        """Return what the host printed that matters, and the edges that were counted."""
        board = BluePill(place.path(self.image))
        attach_parts(board, [place.filled(text) for text in self.attach])
        for pin, level in self.drive:
            board.pin(pin).drive(level)
        counted = Counter[str]()
        for wanted in self.edges:
            _count(board, wanted, counted)
        for axis in self.axes:
            _move(board, axis)
        values, carry = self._open(board, place)
        for name, text in self.files:
            (place.scratch / name).write_text(place.filled(text, **values))
        served = _Served(board, carry)
        try:
            printed = "".join(self._host(served, place, words, values) for words in self.hosts[:-1])
            for wanted in self.edges:
                counted[wanted.pin] *= not wanted.is_final
            printed += self._host(served, place, self.hosts[-1], values)
        except RowError:
            for log in sorted(place.scratch.glob("*.log")):  # for the row's own log
                print(f"{log.name}:\n{log.read_text(errors='replace')}")
            raise
        heard = self._heard(printed, board)
        for wanted in self.edges:
            count, most = counted[wanted.pin], wanted.least if wanted.most is None else wanted.most
            if not wanted.least <= count <= most:
                raise RowError(f"{count} edges at {wanted.pin}, {wanted.least} to {most} must be; {'; '.join(heard)}")
            heard.append(f"{count} edges at {wanted.pin}")
        return "; ".join(heard)

    def _open(self, board: BluePill, place: RowPlace) -> tuple[dict[str, str], Callable[[], None]]:
        """Open the port's far end; return the values of commands, and what carries between two runs of the board."""
        if self.port == "can":
            network = CanNetwork()
            board.can(network)
            path = place.scratch / "can"
            return {"can": str(path)}, CanSocket(f"unix:{path}", network).carry
        console = PtyConsole()
        if self.port == "usb":
            board.usb.plug()
            return {"line": console.description}, connect(console, board.usb_serial)
        return {"line": console.description}, connect(console, board.serial_ports[self.port])

    def _host(self, served: "_Served", place: RowPlace, words: tuple[str, ...], values: dict[str, str]) -> str:
        if self.port == "usb":
            served.wait(lambda: served.board.usb.state.value == "configured", _USB_S, "its USB was not configured")
        environment = {**os.environ, **{name: place.filled(text, **values) for name, text in self.environment}}
        output = place.scratch / "output"
        with output.open("wb") as stream:
            host = subprocess.Popen(
                [place.filled(word, **values) for word in words], stdin=subprocess.DEVNULL, stdout=stream,
                stderr=subprocess.STDOUT, cwd=place.scratch, env=environment,
            )  # fmt: skip
            served.wait(lambda: host.poll() is not None, self.hosts_s, f"{words[0]} did not end", output)
        printed = output.read_text(errors="replace")
        print(printed)
        if host.returncode not in self.codes:
            logs = "".join(log.read_text(errors="replace") for log in sorted(place.scratch.glob("*.log")))
            said = (printed.strip() or logs.strip())[-_SHOWN_CHARACTERS:]
            name = next(word for word in words if not word.startswith("-") and "/python" not in word)
            raise RowError(f"{Path(name).name} ended with {host.returncode}: {said!r}")
        return printed

    def _heard(self, printed: str, board: BluePill) -> list[str]:
        at, heard = 0, []
        for pattern in self.hears:
            found = re.compile(pattern, re.DOTALL).search(printed, at)
            if found is None:
                verdict = f"; {board.verdict}" if board.verdict else ""
                raise RowError(f"the host did not print {pattern!r}: {printed.strip()[-_SHOWN_CHARACTERS:]!r}{verdict}")
            at = found.end()
            if found.re.groups:
                heard.append(" ".join(found[1].split()))
        return heard


def _count(board: BluePill, wanted: CountedEdges, counted: Counter[str]) -> None:
    begun = not wanted.since

    def sink(rows: bytes) -> None:
        nonlocal begun
        for _, pin, _, wire, _ in read_rows(rows):
            if pin == mark:
                begun = begun or wire == HIGH
            elif begun and wire == HIGH:
                counted[wanted.pin] += 1

    mark = board.pin(wanted.since).index if wanted.since else -1
    board.subscribe_pins([wanted.pin, *([wanted.since] if wanted.since else [])], sink, of=Of.WIRE)


def _move(board: BluePill, axis: SwitchedAxis) -> None:
    """Let an axis follow its steps; its switch closes at the end of the slice in which it is reached."""
    at, is_up = axis.above, False
    step, switch = board.pin(axis.step).index, board.pin(axis.switch)
    switch.drive(0)

    def sink(rows: bytes) -> None:
        nonlocal at, is_up
        for _, pin, _, wire, _ in read_rows(rows):
            if pin != step:
                is_up = wire == HIGH
            elif wire == HIGH:
                at += 1 if is_up else -1
        switch.drive(int(at <= 0))

    board.subscribe_pins([axis.step, axis.direction], sink, of=Of.WIRE)


class _Served:
    """A board that keeps to the clock while something is waited for."""

    def __init__(self, board: BluePill, carry: Callable[[], None]) -> None:
        self.board, self._carry = board, carry
        self._start_ns = time.monotonic_ns()

    def wait(self, until: Callable[[], bool], longest_s: float, what: str, output: Path | None = None) -> None:
        """Run until something is so.

        Raises:
            RowError: it took too long, or the firmware has died.
        """
        board, end = self.board, time.monotonic() + longest_s
        while not until():
            self._carry()
            board.advance_to(board.now_ns + _SLICE_NS)
            ahead_ns = self._start_ns + board.now_ns - time.monotonic_ns()
            if ahead_ns > 0:
                time.sleep(ahead_ns / NS_PER_S)
            elif ahead_ns < -_MADE_UP_NS:  # a machine that was busy elsewhere kept the host waiting too
                self._start_ns -= ahead_ns + _MADE_UP_NS
            if time.monotonic() > end or board.has_died:
                said = "" if output is None else output.read_text(errors="replace").strip()[-_SHOWN_CHARACTERS:]
                why = board.verdict if board.has_died else f"within {longest_s:g} s"
                raise RowError(f"{what}: {why}, {board.where()}; {said!r}")
