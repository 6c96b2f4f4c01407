"""Robots that share a world, for whoever looks on while they run: all of them live, let go, halted, slowed and stepped.

They have no snapshot of their own that is cheap enough to keep many of: what is known is not gone back over, and there
are no forks. What hands do is written into the run's folder at once, as a scenario that is that run without a page.

Invariant: the traces are those of robots at which nobody looks, with what hands have done in them.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from p2os.cli.robots.page_control import QueuedControl
from p2os.transport.wall_clock import Clock, wall_clock
from p2os.view.header import PageHeader, PageSection, PanelHeader, PanelState
from p2os.view.live import LiveRecording
from p2os.view.recording import ViewRecording
from p2os.view.run_control import HandState, RunCommand, RunState
from p2os.view.targets import ViewPanel, panels_of
from robot_bench.bench import Bench, run_of
from robot_bench.cli.debugging.hands import saved_as
from robot_bench.cli.debugging.session import MOST_HANDS, trouble_of
from robot_bench.cli.shown.fleet_hands import FleetHands
from robot_bench.cli.shown.looked_panels import LookedPanels
from robot_bench.cli.shown.offered_hands import hands_of
from robot_bench.cli.shown.saved_hands import saved_beside, scenario_text
from robot_bench.events.codec import Blocks, Json, Recorded
from robot_bench.recording.run_folder import HANDS_NAME
from robot_bench.report.run_page import lead_of
from robot_bench.run import meta_of
from robot_bench.scenario.scenario import Scenario
from robot_bench.view.run_tracks import RunTracks, add_events
from simbase.errors import P2osError
from simbase.files import write_text
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


class LiveFleet(QueuedControl):
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
        super().__init__(RunState(is_running=True, speed=speed))
        offers = [replace(hands_of(one), robot=one.name) for one in scenario.programmed]
        self._scenario = scenario
        self._run_folder: Path | None = None
        self._recording = ViewRecording(PageHeader(title=scenario.name, hands=offers[0], robot_hands=offers))
        self._tracks: dict[str, RunTracks] = {}
        self._blocks: dict[str, Blocks] = {}
        self._on_wait, self._clock = on_wait, clock
        self._end_ns = scenario.duration_ns
        self._panels = LookedPanels(())
        self._hands = FleetHands({}, 0)
        #: Until when it runs though it stands still: a step; and the clock and the time at which its pace began.
        self._step_until: Nanos | None = None
        self._base: tuple[Nanos, Nanos] | None = None
        self._doing: Mapping[str, Callable[[RunState, RunCommand, Nanos], RunState]] = {
            "run": self._run, "pause": self._pause, "speed": self._set_speed, "step": self._step, "hand": self._hand,
            "drive": self._drive, "stop": self._drive, "save": self._save,
        }  # fmt: skip
        #: What a server shows.
        self.source: LiveRecording[FleetBuilt | RobotReleased] = LiveRecording(self._recording, self._add)
        self.source.control = self

    # As the page's `RunControl`; variables are looked at of a robot alone.

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
        self._hands = FleetHands(benches, self._end_ns)
        first = next(iter(benches.values()))
        if first.trace.path is not None:
            self._run_folder = first.trace.path.parent.parent
        while first.now < min(first.end, self._end_ns):
            self._turn(first)
        self._show(replace(self._state, is_running=False, why="the run is over", head_ns=first.now))
        self.source.end()

    def _record(self, name: str, bench: Bench) -> None:
        known: Nanos = -1

        def take(events: Sequence[Recorded], limit: Nanos) -> None:
            nonlocal known
            if limit <= known:  # a hand could do nothing: it comes by the same again
                return
            known = limit
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
            state = self._by_hand(state, lambda: self._hands.drive_on(now))
            wait_s = self._go_on(first, now, state.speed)
        else:
            wait_s = _WAIT_S
        self._panels.look(now, first.now)
        self._show(replace(state, head_ns=first.now))
        if wait_s:
            self._on_wait()
        if (command := self._commands.take(wait_s)) is not None:
            self._show(replace(self._done(command, first.now), head_ns=first.now, done=self._state.done + 1))

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
        state = replace(self._state, trouble="", saved="")
        if command.at_ns is not None and command.at_ns < now:
            return replace(state, trouble="robots that share a world are not set back: they go on from where they are")
        doing = self._doing.get(command.do)
        if doing is None or (command.do == "step" and command.unit != "millisecond"):
            what = "let go, halted, stepped by the millisecond, and changed by hand alone"
            return replace(state, trouble=f"robots that share a world are {what}")
        return doing(state, command, now)

    def _run(self, state: RunState, _command: RunCommand, _now: Nanos) -> RunState:
        self._base = None
        return replace(state, is_running=True, why="")

    def _pause(self, state: RunState, _command: RunCommand, _now: Nanos) -> RunState:
        return replace(state, is_running=False, why="paused")

    def _set_speed(self, state: RunState, command: RunCommand, _now: Nanos) -> RunState:
        self._base = None
        return replace(state, speed=command.speed)

    def _step(self, state: RunState, _command: RunCommand, now: Nanos) -> RunState:
        self._step_until = now + _STEP_NS
        return replace(state, is_running=False)

    def _hand(self, state: RunState, command: RunCommand, _now: Nanos) -> RunState:
        return self._by_hand(state, lambda: self._hands.do(command.robot, command.words))

    def _drive(self, state: RunState, command: RunCommand, _now: Nanos) -> RunState:
        return self._by_hand(state, lambda: self._hands.ask(command, self._clock()))

    def _by_hand(self, state: RunState, act: Callable[[], None]) -> RunState:
        """Have hands do something, and write down what they have done by now; what cannot be done is said."""
        before = self._hands.done
        try:
            act()
        except P2osError as error:
            return replace(state, trouble=trouble_of(error))
        done = self._hands.done
        if done is before:
            return state
        if self._run_folder is not None:
            write_text(self._run_folder / HANDS_NAME, scenario_text(self._scenario, done, self._run_folder))
        last = [HandState(at_ns=one.at, words=f"{one.robot}: {one.words}") for one in done[-MOST_HANDS:]]
        return replace(state, hands=last, hand_count=len(done))

    def _save(self, state: RunState, command: RunCommand, _now: Nanos) -> RunState:
        try:
            kind = saved_as(command.words)
            saved = saved_beside(self._scenario, self._hands.done, self._run_folder, kind)
            return replace(state, saved=saved)
        except P2osError as error:
            return replace(state, trouble=trouble_of(error))

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
