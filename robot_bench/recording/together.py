"""The run folder of robots that share a world: one of its own for each, and all of their events as one stream.

Invariant: events come in order of time, and at one instant in the order of the robots.
"""

import heapq
import json
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import cast

from robot_bench.events.kinds import Event
from robot_bench.recording.run_folder import SUMMARY_NAME, TRACE_NAME
from robot_bench.recording.run_record import read_events, read_meta
from simbase.errors import FileError
from simbase.files import read_text
from simbase.timing import Nanos


def robots_in(folder: Path) -> list[str]:
    """Return the robots of a run folder by name, in the scenario's order; none where it is not one of several."""
    if (folder / TRACE_NAME).is_file() or not folder.is_dir():
        return []
    there = sorted(one.name for one in folder.iterdir() if (one / TRACE_NAME).is_file())
    listed = cast("Sequence[str]", read_meta(folder / there[0]).get("robots") or ()) if there else ()
    return [name for name in listed if name in there]


def scenario_of(folder: Path) -> str:
    """Return the name of the scenario that a folder of several robots was made with, as far as it tells."""
    try:
        return str(json.loads(read_text(folder / SUMMARY_NAME))["scenario"])
    except (FileError, ValueError, KeyError, TypeError):  # a run that was cut has none
        return folder.name


def named_events(folder: Path) -> Iterator[tuple[str, Event]]:
    """Play back the traces of a run folder: each event with the robot that tells it; with "" where there is one.

    Raises:
        TraceError: As of `read_events`.
    """
    names = robots_in(folder) or [""]
    streams = [_placed(place, read_events(folder / name)) for place, name in enumerate(names)]
    for _, place, event in heapq.merge(*streams, key=lambda row: row[:2]):
        yield names[place], event


def _placed(place: int, events: Iterable[Event]) -> Iterator[tuple[Nanos, int, Event]]:
    for event in events:
        yield event.t, place, event
