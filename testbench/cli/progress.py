"""The progress line of a run, and Ctrl-C that waits for a good moment.

On a terminal: virtual time, speed-up and what the robot is doing, on stderr.
Elsewhere: nothing. The first Ctrl-C ends the run between two slices, so that
the robot is stopped and the run folder complete; the second one at once.
"""

import signal
import sys
import time
from types import FrameType, TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn
from rich.text import Text

from p2os.timing import NS_PER_S
from testbench import run

#: chosen: smooth to the eye, and no load.
REFRESH_S = 0.1


class _SpeedColumn(ProgressColumn):
    """Virtual seconds a wall second."""

    def render(self, task: Task) -> Text:
        """Return the speed-up so far."""
        elapsed = task.elapsed or 0.0
        return Text(f"{task.completed / elapsed:5.1f}×" if elapsed > 0 else "")


class RunDisplay:
    """Shows progress while a run goes on, and turns Ctrl-C into an orderly end."""

    def __init__(self, *, is_shown: bool | None = None) -> None:
        self._is_shown = sys.stderr.isatty() if is_shown is None else is_shown
        self._is_interrupted = False
        self._next_refresh = 0.0
        self._bar = Progress(
            TextColumn("{task.fields[time]}"), BarColumn(), _SpeedColumn(), TextColumn("{task.fields[doing]}"),
            console=Console(stderr=True), transient=True, auto_refresh=False, disable=not self._is_shown,
        )  # fmt: skip
        self._task = self._bar.add_task("run", total=None, time="", doing="")
        self._old_handler: object = None

    def __enter__(self) -> Self:
        self._old_handler = signal.signal(signal.SIGINT, self._interrupt)
        self._bar.start()
        return self

    def __exit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        self._bar.stop()
        signal.signal(signal.SIGINT, self._old_handler)  # type: ignore[arg-type] # what signal itself returned

    def update(self, progress: "run.Progress") -> None:
        """Show where the run stands; called between two slices.

        Raises:
            KeyboardInterrupt: Ctrl-C was pressed.
        """
        if self._is_interrupted:
            raise KeyboardInterrupt
        if not self._is_shown:
            return
        now_s = time.monotonic()
        if now_s < self._next_refresh:
            return
        self._next_refresh = now_s + REFRESH_S
        end_s = progress.duration_ns / NS_PER_S
        self._bar.update(
            self._task, total=end_s, completed=progress.now / NS_PER_S,
            time=f"{progress.now / NS_PER_S:6.1f} of {end_s:.0f} s", doing=progress.doing(), refresh=True,
        )  # fmt: skip

    def _interrupt(self, _number: int, _frame: FrameType | None) -> None:
        if self._is_interrupted:
            raise KeyboardInterrupt
        self._is_interrupted = True
