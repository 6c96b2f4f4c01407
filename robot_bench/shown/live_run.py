"""A run that goes on, for whoever looks at it: what the trace is written of, handed over as it is.

Invariant: nobody who looks on decides anything: the trace is the same with and without.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from p2os.view.header import PageHeader
from p2os.view.live import LiveRecording
from p2os.view.recording import ViewRecording
from robot_bench.bench import Bench, run_of
from robot_bench.events.codec import Blocks, EdgeBlock, Json, Levels, Recorded
from robot_bench.report.run_page import lead_of
from robot_bench.run import meta_of
from robot_bench.scenario.scenario import Scenario
from robot_bench.view.run_tracks import RunTracks
from robot_bench.wires.edges import Edges
from simbase.timing import Nanos


@dataclass(frozen=True, slots=True)
class BenchBuilt:
    """What is run, on what, in what: the first entry of the trace."""

    meta: Json


@dataclass(frozen=True, slots=True)
class BenchReleased:
    """What was handed on at once."""

    events: Sequence[Recorded]


class LiveRun:
    """Hands over what happens on a bench.

    Args:
        scenario: What will be run.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._recording = ViewRecording(PageHeader(title=scenario.name))
        self._tracks: RunTracks | None = None
        self._blocks = Blocks()
        #: What a server shows.
        self.source: LiveRecording[BenchBuilt | BenchReleased] = LiveRecording(self._recording, self._add)

    def drive(self, bench: Bench) -> None:
        """Run a bench to its end, as `run_scenario` takes it."""
        meta = meta_of(bench.scenario, bench.parts.world, run_of(bench).note, is_at_port=False)
        self.source.offer(BenchBuilt(meta), bench.now)
        bench.events.record(self._take)
        try:
            bench.run_until(bench.scenario.duration_ns)
        finally:
            self.source.end()

    def _take(self, events: Sequence[Recorded], limit: Nanos) -> None:
        if events:
            self.source.offer(BenchReleased(events), limit)
        else:
            self.source.advance_to(limit)

    def _add(self, happened: BenchBuilt | BenchReleased) -> None:
        if isinstance(happened, BenchBuilt):
            self._recording.header = replace(self._recording.header, lead=lead_of(happened.meta))
            self._tracks = RunTracks(self._recording, happened.meta)
            return
        assert self._tracks is not None  # noqa: S101 - a bench was built before
        for event in happened.events:
            if isinstance(event, Levels):
                self._blocks.begin(event)
                begun = zip(event.nets, event.levels, strict=True)
                self._tracks.edges({net: Edges([(event.t, int(level))]) for net, level in begun})
            elif isinstance(event, EdgeBlock):
                self._tracks.edges(dict(self._blocks.take(event)))
            else:
                self._tracks.take(event)
