"""What a server shows: a recording that is whole, or one that grows while a program runs.

The program hands over what happens and goes on; whoever shows it makes rows of that in its own time. Nothing waits:
what finds no room is counted and left out, so that who looks on never changes or slows what is looked at.

Invariant: rows are added by the reader's side alone.
"""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Generic, Protocol, TypeVar

from p2os.view.header import PageHeader, PageSection, PanelState
from p2os.view.recording import ViewRecording
from p2os.view.run_control import RunCommand, RunState
from simbase.timing import Nanos

Happening = TypeVar("Happening")
#: chosen: a minute of a run whose page is stalled; some tens of megabytes.
MOST_WAITING = 50_000


class RunControl(Protocol):
    """A run that is controlled: commands go in, its state comes out; both from any thread."""

    @property
    def state(self) -> RunState:
        """How it stands."""

    def offer(self, command: RunCommand) -> bool:
        """Take a command; False where too many wait."""

    def offered(self, begun: str) -> Sequence[str]:
        """Return names of variables that what was typed may become."""

    def look(self, panel: str, choice: str) -> PanelState | None:
        """Return what a panel showed last; who asks again is shown what it has then. None: nothing yet."""


class ShownSource(Protocol):
    """A recording, and what brings it up to date."""

    recording: ViewRecording
    #: Controls the run that it is of; None: nothing does.
    control: RunControl | None

    def update(self) -> None:
        """Add what has come; called by who shows it."""


class LiveRecording(Generic[Happening]):
    """A recording that grows.

    Args:
        recording: What it is added to.
        add: Adds the rows of what happened.
        most_waiting: So many wait to be added.
    """

    def __init__(
        self, recording: ViewRecording, add: Callable[[Happening], None], most_waiting: int = MOST_WAITING
    ) -> None:
        self.recording = recording
        self.control: RunControl | None = None
        self._add, self._most = add, most_waiting
        # Between two threads: a deque's ends may be used from one each.
        self._waiting: deque[Happening] = deque()
        self._now: Nanos = 0
        self._lost = 0
        self._is_over = False
        self._report: PageHeader | None = None
        recording.header = replace(recording.header, is_live=True)

    def offer(self, happening: Happening, now: Nanos, *, is_kept: bool = False) -> None:
        """Take what happened; called by the program, and as quick as can be.

        Args:
            happening: It.
            now: Until when all is known.
            is_kept: Whether it finds room whatever waits: what the rest is understood by.
        """
        self._now = now
        if is_kept or len(self._waiting) < self._most:
            self._waiting.append(happening)
        else:
            self._lost += 1

    def advance_to(self, now: Nanos) -> None:
        """Take that time goes on, and nothing happens; called by the program."""
        self._now = now

    def report(self, report: PageHeader) -> None:
        """Say what came of the run, of which forks may still go on; called by the program."""
        self._report = report

    def end(self, report: PageHeader | None = None) -> None:
        """Say that nothing more will come, and what came of it; called by the program.

        Args:
            report: Has verdict, sections and what else a recorded one begins with; None: nothing is known yet.
        """
        self._report = report or self._report
        self._is_over = True

    def update(self) -> None:
        """Add what waits; called by who shows it."""
        is_over = self._is_over
        for _ in range(len(self._waiting)):
            self._add(self._waiting.popleft())
        header = self.recording.header
        left_out = (f"{self._lost} events: the program was faster than this page",) if self._lost else ()
        now = max(self._now, header.end_ns)
        if (now, not is_over, left_out) != (header.end_ns, header.is_live, header.left_out):
            self.recording.header = replace(header, end_ns=now, is_live=not is_over, left_out=left_out)
        if (report := self._report) is not None:
            self._report = None
            self.recording.header = replace(
                self.recording.header, verdict=report.verdict, standing=report.standing, lead=report.lead,
                why=report.why, sections=report.sections, footer=report.footer,
            )  # fmt: skip


class StillRecording:
    """A recording that is whole, but for sections that take a while."""

    def __init__(self, recording: ViewRecording) -> None:
        self.recording = recording
        self.control: RunControl | None = None
        self._sections: Sequence[PageSection] | None = None

    def show(self, sections: Sequence[PageSection]) -> None:
        """Show these sections from now on; called by the program."""
        self._sections = sections

    def update(self) -> None:
        """Take the sections that have come; called by who shows it."""
        if (sections := self._sections) is not None:
            self._sections = None
            self.recording.header = replace(self.recording.header, sections=sections)
