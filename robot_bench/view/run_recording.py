"""A recorded run as a recording of the page: its rows out of the trace, its report as sections.

Invariant: nothing but the trace is read.
"""

from collections.abc import Iterator
from itertools import chain
from operator import attrgetter

from p2os.view.header import PageHeader, Standing
from p2os.view.recording import ViewRecording
from robot_bench.events.kinds import Event, Ranges, Text, Wave
from robot_bench.recording.run_record import RunRecord
from robot_bench.recording.signals import motor_steps
from robot_bench.recording.summary import verdict
from robot_bench.view.run_tracks import RunTracks


def recording_of(record: RunRecord) -> ViewRecording:
    """Return all that a run's trace holds as a recording."""
    result = verdict(record)
    name = str(record.meta.get("scenario", "run"))
    found = ViewRecording(
        PageHeader(title=name, verdict=result, standing=standing_of(result), end_ns=max(record.last_ns, 1))
    )
    add_run(found, record)
    return found


def add_run(found: ViewRecording, record: RunRecord, source: str = "") -> None:
    """Add the channels of one robot's run; `source` is its name among several."""
    tracks = RunTracks(found, record.meta, source)
    for net, edges in record.pins.items():
        tracks.edges(net, edges.times, edges.levels)
    for motor in (1, 2):
        for t, steps in motor_steps(record.pins, motor):
            tracks.asked(motor, t, steps)
    for event in _events_of(record):
        tracks.take(event)
    tracks.finish(record.end)


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
