"""Robots that share a world, for whoever looks on while they run: all of them live, let go, halted, slowed and stepped.

They have no snapshot of their own that is cheap enough to keep many of: what is known is not gone back over, and there
are no forks and no hands.

Invariant: the traces are those of robots at which nobody looks.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from p2os.cli.robots.command_queue import CommandQueue
from p2os.transport.wall_clock import Clock, wall_clock
from p2os.view.header import PageHeader, PageSection, PanelHeader, PanelState
from p2os.view.live import LiveRecording
from p2os.view.recording import ViewRecording
from p2os.view.run_control import RunCommand, RunState
from p2os.view.targets import ViewPanel, panels_of
from robot_bench.bench import Bench, run_of
from robot_bench.cli.shown.looked_panels import LookedPanels
from robot_bench.events.codec import Blocks, Json, Recorded
from robot_bench.report.run_page import lead_of
from robot_bench.run import meta_of
from robot_bench.scenario.scenario import Scenario
from robot_bench.view.run_tracks import RunTracks, add_events
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

#: chosen: of the clock, between two looks at what is asked for.
SLICE_NS: Nanos = NS_PER_S // 50
#: chosen: robots that cannot keep the pace go on from where they are after so long, ns of the clock.
_MOST_LAG_NS: Nanos = NS_PER_S // 2
_WAIT_S = 0.2
#: What one step goes by.
_STEP_NS = NS_PER_MS


@dataclass(frozen=True, slots=True)
class FleetBuilt:
    """Who runs, on what, in what: the first entry of each robot's trace; and the panels of their chips."""

    metas: Mapping[str, Json]
    panels: Sequence[PanelHeader]


@dataclass(frozen=True, slots=True)
class RobotReleased:
    """What was handed on at once of a robot."""

    robot: str
    events: Sequence[Recorded]


class LiveFleet:
    """Hands over what happens on the benches of robots in one world, and goes on as pages ask for.

    Args:
        scenario: What will be run, with several robots.
        speed: Virtual seconds a second at first; 0 as fast as it goes.
        on_wait: Called while it stands still; may raise to end the run.
        clock: Wall clock, ns.
    """

    def __init__(
        self, scenario: Scenario, *, speed: float = 1.0, on_wait: Callable[[], None] = lambda: None,
        clock: Clock = wall_clock,
    ) -> None:  # fmt: skip
        self._recording = ViewRecording(PageHeader(title=scenario.name))
        self._tracks: dict[str, RunTracks] = {}
        self._blocks: dict[str, Blocks] = {}
        self._on_wait, self._clock = on_wait, clock
        self._end_ns = scenario.duration_ns
        self._commands = CommandQueue()
        self._state = RunState(is_running=True, speed=speed)
        self._panels = LookedPanels(())
        #: Until when it runs though it stands still: a step; and the clock and the time at which its pace began.
        self._step_until: Nanos | None = None
        self._base: tuple[Nanos, Nanos] | None = None
        #: What a server shows.
        self.source: LiveRecording[FleetBuilt | RobotReleased] = LiveRecording(self._recording, self._add)
        self.source.control = self

    # As the page's `RunControl`.

    @property
    def state(self) -> RunState:
        """How the run stands."""
        return self._state

    def offer(self, command: RunCommand) -> bool:
        """Take a command; False where too many wait."""
        return self._commands.offer(command)

    def offered(self, begun: str) -> Sequence[str]:  # noqa: ARG002 - as of `RunControl`
        """Variables are looked at of a robot alone."""
        return ()

    def look(self, panel: str, choice: str) -> PanelState | None:
        """Return what a panel showed last; while it is asked for, it is looked at ten times a second."""
        return self._panels.asked(panel, choice)

    # As what runs the benches.

    def drive(self, benches: Mapping[str, Bench]) -> None:
        """Run the benches of one world to their end, as `run_together` takes it."""
        self._panels = LookedPanels(_panels_of_all(benches))
        metas = {
            name: meta_of(one.scenario, one.parts.world, run_of(one).note, is_at_port=False)
            for name, one in benches.items()
        }
        self.source.offer(FleetBuilt(metas, [one.header for one in self._panels.panels]), 0, is_kept=True)
        for name, bench in benches.items():
            self._record(name, bench)
        first = next(iter(benches.values()))
        while first.now < min(first.end, self._end_ns):
            self._turn(first)
        self._show(replace(self._state, is_running=False, why="the run is over", head_ns=first.now))
        self.source.end()

    def _record(self, name: str, bench: Bench) -> None:
        def take(events: Sequence[Recorded], limit: Nanos) -> None:
            if events:
                self.source.offer(RobotReleased(name, events), limit)
            else:
                self.source.advance_to(limit)

        bench.events.record(take)

    def _turn(self, first: Bench) -> None:
        """Run a slice, or wait; then do what was asked for."""
        now, state = self._clock(), self._state
        if self._step_until is not None:
            until, self._step_until = self._step_until, None
            first.run_until(min(until, self._end_ns))
            state = replace(state, why="a millisecond on")
            wait_s = 0.0
        elif state.is_running:
            wait_s = self._go_on(first, now, state.speed)
        else:
            wait_s = _WAIT_S
        self._panels.look(now, first.now)
        self._show(replace(state, head_ns=first.now))
        if wait_s:
            self._on_wait()
        if (command := self._commands.take(wait_s)) is not None:
            self._show(replace(self._done(command, first.now), done=self._state.done + 1))

    def _go_on(self, first: Bench, now: Nanos, speed: float) -> float:
        """Run as far as the pace has come; return for how many seconds nothing is to be done."""
        if speed == 0:
            first.run_until(min(first.now + SLICE_NS, self._end_ns))
            return 0.0
        if self._base is None or now - self._base[0] - (first.now - self._base[1]) / speed > _MOST_LAG_NS:
            self._base = now, first.now
        due = self._base[1] + int((now - self._base[0]) * speed)
        if due <= first.now:
            return max(SLICE_NS / NS_PER_S, (first.now - due) / speed / NS_PER_S)
        first.run_until(min(due, first.now + SLICE_NS * 5, self._end_ns))
        return 0.0

    def _done(self, command: RunCommand, now: Nanos) -> RunState:
        """Do what was asked for; return how it stands then."""
        state = replace(self._state, trouble="")
        if command.at_ns is not None and command.at_ns < now:
            return replace(state, trouble="robots that share a world are not set back: they go on from where they are")
        if command.do == "run":
            self._base = None
            return replace(state, is_running=True, why="")
        if command.do == "pause":
            return replace(state, is_running=False, why="paused")
        if command.do == "speed":
            self._base = None
            return replace(state, speed=command.speed)
        if command.do == "step" and command.unit == "millisecond":
            self._step_until = now + _STEP_NS
            return replace(state, is_running=False)
        return replace(
            state, trouble="robots that share a world are let go, halted and stepped by the millisecond alone"
        )

    def _show(self, state: RunState) -> None:
        if state != self._state:
            self._state = state

    def _add(self, happened: FleetBuilt | RobotReleased) -> None:
        if isinstance(happened, FleetBuilt):
            header = self._recording.header
            lead = lead_of(next(iter(happened.metas.values())))
            self._recording.header = replace(header, lead=lead, panels=happened.panels)
            for name, meta in happened.metas.items():
                self._tracks[name] = RunTracks(self._recording, meta, name, others=happened.metas.keys() - {name})
                self._blocks[name] = Blocks()
        else:
            add_events(self._tracks[happened.robot], self._blocks[happened.robot], happened.events)


def _panels_of_all(benches: Mapping[str, Bench]) -> list[ViewPanel]:
    """Return one panel of each name, in which each robot's choices stand under its name."""
    found: dict[str, dict[str, ViewPanel]] = {}
    for robot, bench in benches.items():
        for panel in panels_of(bench.chip):
            found.setdefault(panel.name, {})[robot] = panel
    return [_together(panels) for panels in found.values()]


def _together(panels: Mapping[str, ViewPanel]) -> ViewPanel:
    looks = {
        f"{robot}: {choice}" if choice else robot: (panel, choice)
        for robot, panel in panels.items() for choice in (panel.choices or ("",))
    }  # fmt: skip
    first = next(iter(panels.values()))

    def look(choice: str) -> Sequence[PageSection]:
        if choice not in looks:
            return ()
        panel, own = looks[choice]
        return panel.look(own)

    return replace(first, choices=tuple(looks), look=look)
