"""A campaign's page, served: a failing point is run again and opened by one click.

A page asks by the point's number alone. What runs is the folder that the campaign has made of it, as `p2os run` would;
its hash is compared with that in the campaign's summary, and the run is served beside, with a link of its own.

Invariant: code that a point's scenario names runs only where that was trusted before.
"""

import contextlib
import json
import shlex
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from p2os.cli.robots.page_control import QueuedControl
from p2os.view.live import StillRecording
from p2os.view.page import header_in
from p2os.view.recording import ViewRecording
from p2os.view.run_control import OpenedRun, RunCommand, RunState
from p2os.view.targets import ViewTarget, served, target_of
from robot_bench.campaign.results import FAILURES
from robot_bench.campaign.whole import PAGE, SUMMARY
from robot_bench.recording.run_folder import make_next_folder
from robot_bench.run import run_scenario
from robot_bench.scenario.loading import load_scenario
from simbase.errors import FileError, P2osError
from simbase.files import read_text

#: chosen: runs that are served at a time; each has a thread.
MOST_OPENED = 16
_HOST, _TURN_S = "127.0.0.1", 1.0


@dataclass(frozen=True, slots=True)
class FailedPoint:
    """What a campaign's summary says of a point: its scenario file, without a folder, and the hash of its trace."""

    file: str
    sha256: str


def target_in(folder: Path) -> ViewTarget:
    """Return a campaign's folder.

    Raises:
        FileError: It has no report yet, or a damaged one.
    """
    if not (folder / PAGE).is_file():
        raise FileError(f"{folder} has no report yet", hint=f"p2os campaign --resume {folder}")
    try:
        recording = ViewRecording(header_in(read_text(folder / PAGE)))
        found = json.loads(read_text(folder / SUMMARY))["failures"]
        points = {int(one["number"]): _point(one) for one in found}
    except (ValueError, KeyError, TypeError, IndexError, RecursionError) as error:
        raise FileError(f"{folder} has a damaged report", hint=f"p2os campaign --resume {folder}") from error
    source, control = StillRecording(recording), CampaignPage(folder, points)
    source.control = control
    return ViewTarget(source=source, run=control.run)


def _point(found: Mapping[str, str]) -> FailedPoint:
    # `p2os run FOLDER/NAME.toml`: the folder may have been moved since.
    return FailedPoint(Path(shlex.split(found["replay"])[2]).name, str(found["trace_sha256"]))


class CampaignPage(QueuedControl):
    """Opens failing points of a campaign.

    Args:
        folder: The campaign's.
        points: Those that failed, by their numbers.
    """

    def __init__(self, folder: Path, points: Mapping[int, FailedPoint]) -> None:
        super().__init__(RunState())
        self._folder, self._points = folder, points
        self._opened: dict[int, OpenedRun] = {}
        self._serving = contextlib.ExitStack()

    def offer(self, command: RunCommand) -> bool:
        """Take a command; False where too many wait."""
        return command.do != "open" or super().offer(command)

    def run(self) -> None:
        """Open what is asked for, until an interrupt."""
        with self._serving:
            while True:
                self.turn(_TURN_S)

    def turn(self, wait_s: float = 0.0) -> None:
        """Open what is asked for next, where that comes within so many seconds."""
        if (command := self._commands.take(wait_s)) is not None:
            self._open(command.number)

    def _open(self, number: int) -> None:
        there = self._opened.get(number)
        if there is None or not there.url:
            self._tell(number, "running …")
            try:
                self._tell(number, *self._again(number))
            except P2osError as error:
                self._tell(number, f"{error}{f' (hint: {error.hint})' if error.hint else ''}")
        self._show(replace(self.state, done=self.state.done + 1))

    def _tell(self, number: int, words: str, url: str = "") -> None:
        self._opened[number] = OpenedRun(number=number, words=words, url=url)
        self._show(replace(self.state, opened=tuple(self._opened.values())))

    def _again(self, number: int) -> tuple[str, str]:
        """Run a point again; return what to say of it, and where it is seen."""
        if number not in self._points:
            raise FileError(f"point {number} is no failure of this campaign")
        if sum(bool(one.url) for one in self._opened.values()) >= MOST_OPENED:
            raise FileError(f"{MOST_OPENED} runs are open", hint="p2os view the campaign anew")
        kept = self._folder / FAILURES / f"{number:04d}"
        scenario = load_scenario(str(kept / self._points[number].file), trust=False)
        done = run_scenario(scenario, make_next_folder(scenario.name))
        if done.was_interrupted:
            raise KeyboardInterrupt
        found, wanted = str(done.outcome.get("trace_sha256")), self._points[number].sha256
        words = "the same hash" if found == wanted else f"ANOTHER hash: {found[:8]}, in the campaign {wanted[:8]}"
        target = target_of(str(done.folder))
        page = self._serving.enter_context(served(target.source, _HOST, 0))
        if target.run is not None:
            target.run()
        return f"{words}; in {done.folder}", page.url
