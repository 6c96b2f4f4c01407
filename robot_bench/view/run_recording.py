"""A recorded run as a recording of the page: its rows out of the trace, its report as sections.

Invariant: nothing but the run's record is read.
"""

import heapq
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import chain, repeat
from operator import attrgetter

from p2os.view.header import PageHeader, Standing
from p2os.view.recording import ViewRecording
from robot_bench.events.kinds import Event, Ranges, Text, Wave
from robot_bench.recording.run_record import RunRecord
from robot_bench.recording.summary import verdict
from robot_bench.view.run_tracks import RunTracks


def recording_of(record: RunRecord) -> ViewRecording:
    """Return all that a run's trace holds as a recording."""
    result = verdict(record)
    name = str(record.meta.get("scenario", "run"))
    header = PageHeader(title=name, verdict=result, standing=standing_of(result))
    return recording_of_all({"": record}, header)


def recording_of_all(records: Mapping[str, RunRecord], header: PageHeader) -> ViewRecording:
    """Return the traces of robots that share a world, by their names, as one recording.

    Args:
        records: Each robot's; with "" where there is one.
        header: Title, verdict, and what else its page begins with.
    """
    found = ViewRecording(replace(header, end_ns=max(1, *(record.last_ns for record in records.values()))))
    robots = {
        name: RunTracks(found, record.meta, name, others=records.keys() - {name}, is_whole=True)
        for name, record in records.items()
    }
    for name, record in records.items():
        robots[name].edges(record.pins)
        for one in record.variables:
            track = robots[name].variable(one.name, one.type_name)
            for row in zip(one.times, one.values, strict=True):
                track.append(*row)
    streams = [zip(repeat(name), _events_of(record), strict=False) for name, record in records.items()]
    for name, event in heapq.merge(*streams, key=lambda row: row[1].t):
        robots[name].take(event)
    for name, record in records.items():
        robots[name].finish(record.end)
    return found


def standing_of(result: str) -> Standing:
    """Return how a run came out that ended in these words."""
    if result.startswith(("failed", "cut", "interrupted")):
        return "failed"
    return "passed" if result.startswith("passed") else "open"


def _events_of(record: RunRecord) -> Iterator[Event]:
    """Yield all but the edges, in the order of time."""
    texts = (Text(t=t, data=data) for t, data in record.usart)
    ranges = (Ranges(t=t, mm=tuple(mm)) for t, mm in record.sonar)
    waves = (wave or Wave(t=t, wire=net, at=0, period=0, high=0, ticks_hz=1)
             for net, found in record.waves.items() for t, wave in found)  # fmt: skip
    lists = (
        record.poses, record.transfers, record.wire, record.events, record.changes, record.contacts, record.clearances,
        record.faults, record.verdicts, texts, record.other_texts, ranges, waves,
    )  # fmt: skip
    yield from sorted(chain(*lists), key=attrgetter("t"))
