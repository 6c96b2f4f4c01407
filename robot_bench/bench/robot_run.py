"""The run of one robot of a bench: chip, wires, far end, scripts, goals and recorder, brought through time by a loop.

`Bench` is what a user calls; this is what the runner, campaigns and debuggers hold beside it (`run_of`).
The order of the followers is fixed: who drives pins first, the script and its faults second, the recorder last.

Invariant: a run that was restored from a snapshot goes on as the one that the snapshot was taken of.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

from adapter_sim.pinout import load_pinout
from bluepill_sim.debug.sampler import VariableSampler
from p2os.pioneer.body.contract import RobotBody
from p2os.pioneer.body.factory import body_note, make_body
from p2os.pioneer.controller import Pioneer
from p2os.pioneer.world import load_world
from p2os.pioneer.world.model import World
from robot_bench.adapter import AnyAdapter
from robot_bench.bench.board import (
    boot,
    do_by_hand,
    hear_buses,
    hear_usarts,
    log_bench_event,
    make_harness,
    make_own_harness,
    pins_of,
    plug_in,
)
from robot_bench.bench.far_end import make_far_end
from robot_bench.bench.hand_driven_body import HandDrivenBody
from robot_bench.bench.origin import LATER, origin_of, refuse_others
from robot_bench.bench.waiting import EventWait
from robot_bench.direct.differential.robot import DifferentialRobot
from robot_bench.direct.senses import WorldSenses
from robot_bench.events.codec import events_of
from robot_bench.events.stream import EventStream
from robot_bench.recording.recorder import Recorder
from robot_bench.recording.trace import TraceWriter
from robot_bench.running.loop import RunLoop
from robot_bench.running.pacer import FIRST_SLICE_NS, SliceLength
from robot_bench.running.shared_world import SharedRobot, SharedWorld
from robot_bench.scenario.fault_script import LINK_DOWN, FaultScript
from robot_bench.scenario.goals.judging import GoalJudge, Judgement, RunEnd
from robot_bench.scenario.hands.actions import Action, HandScript
from robot_bench.scenario.hands.doing import Doing
from robot_bench.scenario.loading import refuse_what_its_world_refuses
from robot_bench.scenario.scenario import Scenario
from robot_bench.scenario.trigger_script import TriggerScript
from robot_bench.scenario.wired_robots import NOWHERE
from robot_bench.scenario.world_script import WorldScript
from robot_bench.wires.chip_pins import ChipPins
from robot_bench.wires.line_ends import AdapterPart, ControllerPart
from robot_bench.wires.nets import Harness
from robot_bench.wires.ports import LeadingChip
from simbase.errors import UsageError
from simbase.state import PartState, Stateful, state_names
from simbase.timing import NS_PER_S, Nanos

#: chosen: so long a run goes on after a fault of the firmware, to show what the robot does then.
AFTER_FAULT_NS: Nanos = 1 * NS_PER_S


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchParts:
    """The parts of a bench, for those who want to look at one."""

    chip: LeadingChip
    harness: Harness
    body: RobotBody
    world: World
    adapter: AdapterPart | None = None
    #: The robot's controller: the virtual Pioneer, or one of the user's.
    controller: ControllerPart | None = None

    @property
    def pioneer(self) -> Pioneer | None:
        """The controller, where it is the virtual Pioneer."""
        return self.controller if isinstance(self.controller, Pioneer) else None


class RobotRun(Stateful):
    """A firmware and its robot at a time between the beginning and the end of a run.

    Arguments and errors as of `Bench`.
    """

    STATE = (
        "made_of", "chip", "harness", "_robots", "_ranges", "script", "faults", "hands", "triggers", "recorder",
        "goals", "loop", "_senses", "ends_at", "_has_reported_death",
    )  # fmt: skip
    #: What the caller asked of this object; the lines, which are parts of the loop.
    DERIVED = ("_lines", "waits", "on_slice", "samplers")

    def __init__(
        self,
        scenario: Scenario,
        *,
        trace: TraceWriter | None = None,
        chip: LeadingChip | None = None,
        slice_ns: Nanos | None = None,
        on_slice: Callable[[Nanos], None] | None = None,
        shared: SharedWorld | None = None,
    ) -> None:
        self.scenario = scenario
        self.trace = trace or TraceWriter()
        self.on_slice = on_slice
        #: What looks at the program's variables while it runs.
        self.samplers: list[VariableSampler] = []
        self._shared = shared
        pinout = load_pinout()
        world = load_world(scenario.world, seed=scenario.seed) if scenario.has_robot else NOWHERE
        if scenario.has_robot:
            refuse_what_its_world_refuses(scenario, world)
        if scenario.robots:
            raise TypeError("a scenario with several robots has a bench each: Bench.from_scenario, or Bench.together")
        body = body_of(scenario, world, shared)
        chip = chip or boot(scenario)
        own = scenario.own_robot
        self.harness = harness = make_harness(pinout) if own is None else make_own_harness(own.robot.signals)
        self.recorder = Recorder(self.trace, harness, body=body if scenario.has_robot else None)
        self.recorder.on_event = log_bench_event
        self.waits = EventWait(self.events, self.trace, harness)
        far_end = make_far_end(scenario, pinout, body, chip, harness, self.recorder, is_among_others=shared is not None)
        #: What stands at the far end of the wires and owns the body.
        self._robots = far_end.robots
        self._lines, self._ranges = far_end.lines, far_end.ranges
        self.parts = BenchParts(
            chip=chip, harness=harness, body=body, world=world, adapter=far_end.adapter, controller=far_end.controller
        )
        #: What must be the same where a snapshot of this bench is restored.
        self.made_of = origin_of(scenario, world, chip)
        self.script = WorldScript(
            scenario.changes, body, scenario.parameters,
            bring_to=self.bring_robot_to, on_change=self.recorder.obstacle,
        )  # fmt: skip
        self.recorder.bring_to = self.bring_robot_to
        self.faults = FaultScript(scenario.faults, bring_to=self.bring_robot_to, do=self._inject)
        #: What parts on the board sense of the world; none where nothing is plugged in.
        self._senses = self._plug_in(chip) if scenario.parts else ()
        self.hands = HandScript(bring_to=self.bring_robot_to, do=self._do_by_hand)
        followers = (*self._robots, self.script, self.faults, self.hands, *self._senses)
        self._slices, self._slice_ns = SliceLength() if slice_ns is None else None, slice_ns
        self.loop = RunLoop(
            chip, followers, observers=(self.recorder,), slice_ns=slice_ns or FIRST_SLICE_NS,
            on_slice=self._after_slice, choose_watched=self._watch_wires,
        )  # fmt: skip
        #: When a goal's verdict or a `[[when]]` ends the run; None while none does.
        self.ends_at: Nanos | None = None
        self._has_reported_death = False
        self.triggers = TriggerScript(scenario.triggers, on_end=self._end_at, on_doing=self.schedule)
        for hand in scenario.hands:
            self.schedule(hand.doing)
        self.triggers.subscribe(self.events)
        self.goals = GoalJudge(scenario.goals)
        self.goals.on_end = lambda: self._end_at(self.loop.now)
        self.goals.subscribe(self.events)
        pin_of = pins_of(scenario)
        self._pins = ChipPins(chip, harness, pin_of, on_watched=self.loop.note_edge, now=lambda: self.loop.led)
        if isinstance(self.parts.adapter, AnyAdapter):
            self.parts.adapter.wait_for_edges()
        chip.usart1.far_baud = scenario.usart_baud
        hear_usarts(chip, self.recorder)
        hear_buses(chip, self.recorder, scenario.record)
        chip.subscribe_warnings(lambda text: self.recorder.event("chip", chip.now_ns, "warning", text))
        self.recorder.start()
        self._join_others()

    def _join_others(self) -> None:
        """Have the body stepped with those of other robots, and these in the trace among the things of the world."""
        if self._shared is None:
            return
        robot = self._robots[-1]
        if isinstance(robot, DifferentialRobot):
            robot.is_stepped_by_others = True
        driven = cast("SharedRobot", self.parts.pioneer or robot)
        self._shared.join(self.scenario.name, self, driven, cast("HandDrivenBody", self.parts.body))
        for name, body in zip(self._shared.names, self._shared.scene.bodies, strict=True):
            if name != self.scenario.name:
                self.recorder.watch_robot(body)

    @property
    def events(self) -> EventStream:
        """What happens, for whoever subscribes; it lags up to 50 ms behind `now`."""
        return self.recorder.events

    @property
    def chip(self) -> LeadingChip:
        """Return the chip."""
        return self.parts.chip

    @property
    def note(self) -> str | None:
        """Return what a reader of the result has to know of the body."""
        if not self.scenario.has_robot:
            return None
        return "; ".join(filter(None, (body_note(self.scenario.body), self.parts.body.note))) or None

    @property
    def end(self) -> Nanos:
        """Return when the run would end if this robot were alone."""
        died_ns, ends = self.chip.died_ns, [self.scenario.duration_ns]
        if died_ns is not None:
            ends.append(died_ns + AFTER_FAULT_NS)
        return min(ends if self.ends_at is None else [*ends, self.ends_at])

    @property
    def whole_end(self) -> Nanos:
        """Return when the run ends, as far as is known now; of several robots with the first that ends."""
        return self.end if self._shared is None else self._shared.end

    def ended(self, at: Nanos) -> RunEnd:
        """Return what a run that ends at a time is to its goals; several robots end together, by any of them."""
        runs = [self] if self._shared is None else cast("list[RobotRun]", list(self._shared.members.values()))
        by_scenario = any(run.ends_at is not None and run.ends_at <= at for run in runs)
        return RunEnd(at, self.scenario.planned_ns, by_scenario=by_scenario)

    @property
    def now(self) -> Nanos:
        """Return the time that the chip has come to."""
        return self.parts.chip.now_ns

    @property
    def slice_ns(self) -> Nanos | None:
        """The length of a slice that was asked for; None: as often as the wall clock wants it."""
        return self._slice_ns

    @property
    def reached(self) -> Nanos:
        """The time that the robot may be brought to: the chip's own, or that of all."""
        return self.now if self._shared is None else min(self.now, self._shared.now)

    def judge(self, end: Nanos) -> Judgement:
        """Judge the goals of this robot, whose run was finished at a time."""
        return self.goals.finish(self.ended(end))

    def finish(self, end: Nanos) -> None:
        """Bring the parts of this robot to the end of the run and write the rest of its trace."""
        if self.events.released_until >= end:
            return
        self.loop.finish(end)
        self.goals.end_at(self.ended(end))
        self.recorder.finish(end)

    def begin_as(self, snapshot: PartState, now: Nanos) -> None:
        """Put back what the bench of another scenario saved, which is the same as this one but for what comes later.

        Args:
            snapshot: As of `snapshot`.
            now: When it was taken. Things that come later, and faults, are this bench's own.

        Raises:
            UsageError: It has several robots; or up to that time the two are not the same.
        """
        if self._shared is not None:
            raise UsageError("robots that share a world begin at the beginning", hint="run it anew")
        made_of = cast("dict[str, object]", snapshot["made_of"])
        refuse_others({what: value for what, value in made_of.items() if what not in LATER}, self.made_of)
        script, faults = (
            timeline.begun_as(cast("PartState", snapshot[name]), now)
            for name, timeline in (("script", self.script), ("faults", self.faults))
        )
        self.restore(PartState(snapshot, made_of=self.made_of, script=script, faults=faults))

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned; `refuse` says whether it may be."""
        super().restore(snapshot)
        self._pins.chip_restored()
        self.waits.forget()
        if self.goals.is_behind:
            self.goals.catch_up(events_of(self.trace.lines()), self.events.released_until)

    def refuse(self, snapshot: object) -> None:
        """Refuse a snapshot of something else, before anything is put back.

        Raises:
            TypeError: It is no snapshot of a bench.
            UsageError: It is of another version, firmware, world, seed or other setting that decides the run.
        """
        made_of = snapshot.get("made_of") if isinstance(snapshot, PartState) else None
        if isinstance(made_of, dict):
            refuse_others(made_of, self.made_of)
        if not isinstance(snapshot, PartState) or tuple(snapshot) != state_names(RobotRun):
            raise TypeError("not a snapshot of a bench")

    def take_inputs(self, doing: Doing) -> None:
        """Take what comes in from outside, to be done at its times, which are after now; the trace notes each.

        `Bench.rewind` forgets what came in after the state that it goes back to.

        Raises:
            UsageError: The run has been judged, or finished.
        """
        self.refuse_the_ended()
        self.waits.forget()
        self.schedule(doing)

    def take_back(self, doing: Doing) -> None:
        """Forget what `schedule` has taken, as far as it is still to come."""
        self.script.take_back(*doing.changes)
        self.faults.take_back(*doing.faults)
        self.hands.take_back(*doing.actions)

    def schedule(self, doing: Doing) -> None:
        """Have something done at its times."""
        self.script.add(*doing.changes)
        self.faults.add(*doing.faults)
        self.hands.add(*doing.actions)

    def refuse_the_ended(self) -> None:
        """Refuse to change what has been finished.

        Raises:
            UsageError: The run has been judged, or finished.
        """
        if self.events.released_until >= self.now:
            raise UsageError(f"the run was ended at {self.now / NS_PER_S:g} s", hint="make another Bench")

    def _watch_wires(self, now: Nanos) -> None:
        """Let an edge end the chip's slice where a part may change an input before its own next deadline."""
        if self.parts.adapter is not None:
            self._pins.watch(self.parts.adapter.wakes_on, now)

    def _after_slice(self, now: Nanos) -> None:
        slice_ns = self._slice_ns if self._slices is None else self._slices.after_slice()
        slice_ns = slice_ns or FIRST_SLICE_NS
        self.loop.slice_ns = min(slice_ns, *(one.look(now) for one in self.samplers)) if self.samplers else slice_ns
        died_ns = self.chip.died_ns
        if died_ns is not None or self.chip.fault is not None:
            self.loop.end_at(self.whole_end)
        if died_ns is not None and not self._has_reported_death:
            self._has_reported_death = True
            self.recorder.fault("died", self.chip.verdict, died_ns)
        if self.on_slice is not None:
            self.on_slice(now)

    def bring_robot_to(self, at: Nanos) -> None:
        """Bring what stands at the far end of the wires to a time that the chip has come to."""
        for robot in self._robots:
            robot.advance_to(at)

    def _end_at(self, at: Nanos) -> None:
        """End the run at a time, if nothing ends it before."""
        self.ends_at = at if self.ends_at is None else min(at, self.ends_at)
        self.loop.end_at(self.whole_end)

    def _inject(self, words: str, at: Nanos) -> None:
        op, _, fault = words.partition(" ")
        self.recorder.fault("inject" if op == "fault" else op, fault, at)
        if fault == LINK_DOWN:
            for line in self._lines:
                line.is_cut = op == "fault"
        elif self.parts.controller is not None:
            self.parts.controller.do(words, at)

    def _do_by_hand(self, action: Action) -> None:
        self.recorder.event(action.who, action.at, action.do, action.words)
        do_by_hand(action, self.chip, self.parts.harness, self.parts.body)

    def _plug_in(self, chip: LeadingChip) -> tuple[WorldSenses, ...]:
        """Attach the scenario's parts to the board, and have them sense the world."""
        if not self.scenario.has_robot:
            plug_in(self.scenario, chip, self.recorder)
            return ()
        senses = WorldSenses(self.parts.body, self.bring_robot_to)
        plug_in(self.scenario, chip, self.recorder, senses)
        return (senses,)


class RunningBench(ABC):
    """What every face of a bench has: its scenario, its run, and the time that it has come to."""

    scenario: Scenario
    _run: RobotRun

    @property
    @abstractmethod
    def now(self) -> Nanos:
        """Return the time that the chip has come to, ns."""


def body_of(scenario: Scenario, world: World, shared: SharedWorld | None = None) -> RobotBody:
    """Return the body of a scenario's robot, standing where it begins: alone in a world, or in one that is shared."""
    start, robot = scenario.start or world.start, scenario.parameters
    if shared is None:
        body = make_body(scenario.body, world, robot, start=start, seed=scenario.seed, trust=False)
    else:
        body = shared.body_of(scenario.name)
    return cast("RobotBody", HandDrivenBody(body, robot.track_mm / 1000))
