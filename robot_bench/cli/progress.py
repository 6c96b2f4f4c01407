"""The progress line of a run, and signals that wait for a good moment.

On a terminal: virtual time, speed-up and what the robot is doing, on stderr.
Elsewhere: nothing. A signal ends the run between two slices, so that the robot
is stopped and the run folder complete.
"""

import contextlib
import sys
from collections.abc import Callable, Iterator
from types import TracebackType
from typing import Self

from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, Task, TextColumn
from rich.text import Text

from p2os.cli.console import ReadableConsole
from p2os.transport.wall_clock import wall_clock
from robot_bench import run
from simbase.command_line.signals import postponed
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

#: chosen: smooth to the eye, and no load.
REFRESH_NS: Nanos = 100 * NS_PER_MS


class _SpeedColumn(ProgressColumn):
    """Virtual seconds a wall second."""

    def render(self, task: Task) -> Text:
        """Return the speed-up so far."""
        elapsed = task.elapsed or 0.0
        return Text(f"{task.completed / elapsed:5.1f}×" if elapsed > 0 else "")


class RunDisplay:
    """Shows progress while a run goes on, and turns a signal into an orderly end."""

    def __init__(self, *, is_shown: bool | None = None) -> None:
        self._is_shown = sys.stderr.isatty() if is_shown is None else is_shown
        self._signals = postponed()
        self._next_refresh: Nanos = 0
        self._bar = Progress(
            TextColumn("{task.fields[time]}"), BarColumn(), _SpeedColumn(),
            TextColumn("{task.fields[doing]}", markup=False),
            console=ReadableConsole(stderr=True), transient=True, auto_refresh=False, disable=not self._is_shown,
        )  # fmt: skip
        self._task = self._bar.add_task("run", total=None, time="", doing="")

    def __enter__(self) -> Self:
        self._signals.__enter__()
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()
        self._signals.__exit__(kind, error, trace)

    def update(self, progress: "run.RunProgress") -> None:
        """Show where the run stands; called between two slices.

        Raises:
            KeyboardInterrupt: As `raise_if_interrupted`.
        """
        self.raise_if_interrupted()
        if not self._is_shown:
            return
        now = wall_clock()
        if now < self._next_refresh:
            return
        self._next_refresh = now + REFRESH_NS
        end_s = progress.duration_ns / NS_PER_S
        self._bar.update(
            self._task, total=end_s, completed=progress.now / NS_PER_S,
            time=f"{progress.now / NS_PER_S:6.1f} of {end_s:.0f} s", doing=progress.doing(), refresh=True,
        )  # fmt: skip

    def raise_if_interrupted(self) -> None:
        """Let a signal that waits end the run now: no slice is under way.

        Raises:
            KeyboardInterrupt: One does; its argument is the signal's name.
        """
        self._signals.raise_due()


@contextlib.contextmanager
def counting_bar(what: str, count: int) -> Iterator[Callable[[int, str], None]]:
    """Show on a terminal how many of something are done, and a word on them; yield what is told of both."""
    bar = Progress(
        TextColumn(what), BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[said]}", markup=False),
        console=ReadableConsole(stderr=True), transient=True, auto_refresh=False, disable=not sys.stderr.isatty(),
    )  # fmt: skip
    with bar:
        task = bar.add_task("", total=count, said="")
        bar.refresh()
        yield lambda done, said: bar.update(task, completed=done, said=said, refresh=True)


@contextlib.contextmanager
def runs_bar(count: int) -> Iterator[Callable[..., None]]:
    """Show on a terminal how many runs have ended; yield what is told of each."""
    done = failed = 0

    def advance(*, passed: bool = True) -> None:
        nonlocal done, failed
        done, failed = done + 1, failed + (not passed)
        tell(done, f"{failed} failed" if failed else "")

    with counting_bar("runs", count) as tell:
        yield advance
