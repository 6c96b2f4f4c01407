"""What came in from ROS in an earlier run, out of its trace: the inputs of a run without ROS that is the same."""

from collections.abc import Iterable
from pathlib import Path

from robot_bench.events.codec import events_of
from robot_bench.events.kinds import Note
from robot_bench.recording.run_folder import TRACE_NAME
from robot_bench.ros.bench_node import SET_PIN, WHO
from robot_bench.scenario.hands.actions import LEVELS, Action
from simbase.errors import FileError, shown_name
from simbase.files import lines_of


def read_inputs(path: Path) -> list[Action]:
    """Return what came in, of a run folder or a trace.

    Raises:
        FileError: There is none, or it has no inputs.
        TraceError: It is damaged.
    """
    trace = path / TRACE_NAME if path.is_dir() else path
    found = inputs_of(lines_of(trace, hint="a run folder", errors="strict"), str(trace))
    if not found:
        raise FileError(f"in {shown_name(trace)} nothing came in from ROS", hint="p2os run SCENARIO --ros makes one")
    return found


def inputs_of(lines: Iterable[str], where: str) -> list[Action]:
    """Return the inputs among the lines of a trace.

    Raises:
        TraceError: A line is damaged.
        FileError: An input is none that ROS could have made.
    """
    return [_action(event, where) for event in events_of(lines, where) if isinstance(event, Note) and event.who == WHO]


def _action(note: Note, where: str) -> Action:
    place, _, level = note.detail.partition(" ")
    if note.what != SET_PIN or level not in LEVELS:
        raise FileError(f"{where}: {note.what} {note.detail} at {note.t} ns is no input", hint="cut that line")
    return Action(at=note.t, do=SET_PIN, place=place, level=LEVELS[level], who=WHO)
