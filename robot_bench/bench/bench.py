"""The composition root: builds the chip, the wires, the robot and the loop for a scenario.

    mode A, direct     chip ─ nets ─ motors, encoders, sensors ─ body      (of a Pioneer, or a robot on own pins)
    mode B, adapter    chip ─ nets ─ adapter ─ lines at 9600 8N1 ─ controller ─ body

Mode C (a real or remote robot) is built by `robot_bench.remote`, on the same
parts. The order of the followers is fixed: who drives pins first, the script
and its faults second, the recorder last.

A bench is pickled as its scenario and its snapshot, and built anew where it is loaded,
in another process too. What listens to it (`on_slice`, a debugger, a measurement) is set
anew there. A trace in memory is in the pickle; a file goes on where it stood, and what was
written to it since is taken back. So runs that go on from one pickle at the same time need
a trace in memory.

Robots that share a world (`[[robot]]`) have a bench each, and each of these is one face of the whole: time goes on for
all of them, a snapshot, a fork and a pickle are those of all, and `robots` has them by name.

Invariant: a bench that was restored from a snapshot goes on as the one that the
snapshot was taken of.
"""

import pickle
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Self, Unpack, cast

from adapter_sim.pinout import load_pinout
from bluepill_sim.spans import Span, to_nanos
from p2os.event_log import logger
from p2os.pioneer.body.contract import RobotBody
from p2os.pioneer.body.factory import body_note, make_body, make_scene
from p2os.pioneer.controller import Pioneer
from p2os.pioneer.world import load_world
from p2os.pioneer.world.model import Pose, World
from robot_bench.adapter import RUN_ANEW, AnyAdapter
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
from robot_bench.bench.expectations import Expectations
from robot_bench.bench.far_end import make_far_end
from robot_bench.bench.interventions import Interventions
from robot_bench.bench.origin import LATER, VERSION, origin_of, refuse_others
from robot_bench.bench.waiting import EventWait
from robot_bench.direct.differential.robot import DifferentialRobot
from robot_bench.direct.senses import WorldSenses
from robot_bench.events.codec import events_of
from robot_bench.events.stream import EventStream
from robot_bench.recording.recorder import Recorder
from robot_bench.recording.run_record import RunRecord, record_of
from robot_bench.recording.trace import TraceWriter
from robot_bench.running.loop import RunLoop
from robot_bench.running.pacer import FIRST_SLICE_NS, SliceLength
from robot_bench.running.shared_world import SharedRobot, SharedWorld
from robot_bench.scenario.fault_script import LINK_DOWN, FaultScript
from robot_bench.scenario.goals.judging import GoalJudge, Judgement, RunEnd
from robot_bench.scenario.hand_script import Deed, HandScript
from robot_bench.scenario.scenario import (
    Scenario,
    ScenarioOptions,
    load_scenario,
    refuse_what_its_world_refuses,
)
from robot_bench.scenario.when_script import WhenScript
from robot_bench.scenario.world_script import WorldScript
from robot_bench.wires.chip_pins import ChipPins
from robot_bench.wires.line_ends import AdapterPart, ControllerPart
from robot_bench.wires.nets import Harness
from robot_bench.wires.ports import LeadingChip
from simbase.errors import UsageError, shown
from simbase.installation import installed_version
from simbase.state import PartState, Stateful
from simbase.timing import NS_PER_S, Nanos, Reached
from simbase.trust import Trust

#: chosen: so long a run goes on after a fault of the firmware, to show what the robot does then.
AFTER_FAULT_NS: Nanos = 1 * NS_PER_S
_LOG = logger("bench")


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


class Bench(Expectations, Interventions, Stateful):
    """A firmware, its robot and its world, run in virtual time; `from_scenario` makes one.

    >>> bench = Bench.from_scenario("mine.toml", body="kinematic")  # doctest: +SKIP
    >>> bench.run_until("2 s")                                      # doctest: +SKIP
    >>> bench.pose, bench.level("PB12"), bench.text                 # doctest: +SKIP
    >>> bench.judge().missed                                        # doctest: +SKIP

    Args:
        scenario: What to run.
        trace: Where the recording goes; None records in memory.
        chip: Runs the firmware; None boots the scenario's on an emulated BluePill.
        slice_ns: How often the loop gives control back, in virtual time; without effect on the result. None: as often
            as the wall clock wants it.
        on_slice: Called after each slice with the time reached; may raise to end the run.
        shared: The world that its robot shares with others; None: it is alone.
        whole: The scenario with all of these.

    Raises:
        ScenarioError: The scenario's world refuses it, or its mode has not what it asks for.
        ImageError: The firmware is missing, damaged, or not for this chip.
        MissingDependencyError: The emulator or the body is not installed.
    """

    STATE = (
        "made_of", "chip", "_harness", "_robots", "_ranges", "script", "faults", "hands", "whens", "recorder", "goals",
        "loop", "_senses", "_ends_at", "_has_told_death",
    )  # fmt: skip
    #: What the caller asked of this object; the lines, which are parts of the loop.
    DERIVED = ("_lines", "_checkpoints", "_waits", "on_slice")

    def __init__(
        self,
        scenario: Scenario,
        *,
        trace: TraceWriter | None = None,
        chip: LeadingChip | None = None,
        slice_ns: Nanos | None = None,
        on_slice: Callable[[Nanos], None] | None = None,
        shared: SharedWorld | None = None,
        whole: Scenario | None = None,
    ) -> None:
        self.scenario = scenario
        self.trace = trace or TraceWriter()
        self.on_slice = on_slice
        self._shared = shared
        self._whole = whole or scenario
        pinout = load_pinout()
        world = load_world(scenario.world, seed=scenario.seed)
        refuse_what_its_world_refuses(scenario, world)
        _refuse_several(scenario)
        body = body_of(scenario, world) if shared is None else shared.body_of(scenario.name)
        self._is_rebuildable = chip is None
        chip = chip or boot(scenario)
        own = scenario.own_robot
        self._harness = harness = make_harness(pinout) if own is None else make_own_harness(own.robot.signals)
        self.recorder = Recorder(self.trace, harness, body=body)
        self.recorder.on_event = log_bench_event
        #: States that `rewind` may go back to, oldest first: times and snapshots.
        self._checkpoints: list[tuple[Nanos, object]] = []
        self._waits = EventWait(self.events, self.trace, harness)
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
            bring_to=self._bring_robot_to, on_change=self.recorder.obstacle,
        )  # fmt: skip
        self.recorder.bring_to = self._bring_robot_to
        self.faults = FaultScript(scenario.faults, bring_to=self._bring_robot_to, do=self._inject)
        #: What parts on the board sense of the world; none where nothing is plugged in.
        self._senses = self._plug_in(chip) if scenario.parts else ()
        self.hands = HandScript(bring_to=self._bring_robot_to, do=self._do_by_hand)
        followers = (*self._robots, self.script, self.faults, self.hands, *self._senses)
        self._slices = SliceLength() if slice_ns is None else None
        self.loop = RunLoop(
            chip, followers, observers=(self.recorder,), slice_ns=slice_ns or FIRST_SLICE_NS,
            on_slice=self._after_slice, choose_watched=self._watch_wires,
        )  # fmt: skip
        #: When a goal's verdict or a `[[when]]` ends the run; None while none does.
        self._ends_at: Nanos | None = None
        self._has_told_death = False
        self.whens = WhenScript(
            scenario.whens, on_end=self._end_at,
            on_change=lambda changes: self.script.add(*changes), on_fault=lambda faults: self.faults.add(*faults),
            on_deed=lambda deeds: self.hands.add(*deeds),
        )  # fmt: skip
        self.whens.subscribe(self.events)
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
        self._listeners = self.events.listeners()

    @classmethod
    def from_scenario(
        cls, scenario: Scenario | str | Path, *, trust: bool | Trust = False, **options: Unpack[ScenarioOptions]
    ) -> Self:
        """Return a bench at its beginning.

        Args:
            scenario: A shipped scenario's name, a TOML file, or a `Scenario`.
            trust: Whether code that a file names may be executed (docs/trust.md); what the options name may always.
            options: What is to be otherwise than it says: see `ScenarioOptions`.

        Raises:
            UntrustedError: The file names code, and nobody has said that it may be executed.
            ScenarioError: There is no such scenario, or it breaks the schema.
            UsageError: That is no scenario, or an option cannot be.
            ImageError: The firmware is missing, damaged, or not for this chip.
            MissingDependencyError: The emulator or the body is not installed.
        """
        if not isinstance(scenario, Scenario | str | Path):
            raise UsageError(f"{shown(scenario)} is no scenario", hint="a name, a TOML file, or a Scenario")
        found = scenario if isinstance(scenario, Scenario) else load_scenario(str(scenario), trust=trust)
        wanted = found.with_options(**options)
        return next(iter(cls.together(wanted).values())) if wanted.robots else cls(wanted)

    @classmethod
    def together(
        cls, scenario: Scenario, *, traces: Mapping[str, TraceWriter] | None = None, slice_ns: Nanos | None = None
    ) -> dict[str, Self]:
        """Return the benches of all robots of a scenario that have a chip, by name, in one world.

        Args:
            scenario: One with several robots.
            traces: Where the recording of each goes; None records in memory.
            slice_ns: As of the class.

        Raises:
            ScenarioError, ImageError, MissingDependencyError: As of the class.
        """
        world = load_world(scenario.world, seed=scenario.seed)
        models = [robot.parameters for robot in scenario.robots]
        starts = [robot.start for robot in scenario.robots]
        scene = make_scene(scenario.body, world, models, starts, scenario.seed, trust=False)
        for robot, body in zip(scenario.robots, scene.bodies, strict=True):
            body.is_powered = robot.scenario is not None
        shared = SharedWorld(scene, [robot.name for robot in scenario.robots])
        return {
            robot.name: cls(
                robot.scenario, trace=(traces or {}).get(robot.name), slice_ns=slice_ns, shared=shared, whole=scenario
            )
            for robot in scenario.robots if robot.scenario is not None
        }  # fmt: skip

    @property
    def robots(self) -> Mapping[str, "Bench"]:
        """The benches of all robots of its world that have a chip, by name; alone in its world, itself."""
        if self._shared is None:
            return {self.scenario.name: self}
        return cast("Mapping[str, Bench]", self._shared.members)

    def _join_others(self) -> None:
        """Have the body stepped with those of other robots, and these in the trace among the things of the world."""
        if self._shared is None:
            return
        robot = self._robots[-1]
        if isinstance(robot, DifferentialRobot):
            robot.is_stepped_by_others = True
        self._shared.join(self.scenario.name, self, cast("SharedRobot", self.parts.pioneer or robot))
        for body in self._shared.scene.bodies:
            if body is not self.parts.body:
                self.recorder.watch_robot(body)

    def __repr__(self) -> str:
        what = self.scenario
        return f"<Bench {what.name} in {what.world}, {what.mode}, at {self.now / NS_PER_S:.3f} s>"

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
        return "; ".join(filter(None, (body_note(self.scenario.body), self.parts.body.note))) or None

    @property
    def end(self) -> Nanos:
        """Return when the run ends, as far as is known now; of several robots with the first that ends."""
        return self.own_end if self._shared is None else self._shared.end

    @property
    def own_end(self) -> Nanos:
        """Return when the run would end if this robot were alone."""
        died_ns, ends = self.chip.died_ns, [self.scenario.duration_ns]
        if died_ns is not None:
            ends.append(died_ns + AFTER_FAULT_NS)
        return min(ends if self._ends_at is None else [*ends, self._ends_at])

    def ended(self, at: Nanos) -> RunEnd:
        """Return what a run that ends at a time is to its goals; several robots end together, by any of them."""
        ends = [robot._ends_at for robot in self.robots.values()]  # noqa: SLF001 # benches of one world
        by_scenario = any(end is not None and end <= at for end in ends)
        return RunEnd(at, self.scenario.planned_ns, by_scenario=by_scenario)

    @property
    def now(self) -> Nanos:
        """Return the time that the chip has come to."""
        return self.parts.chip.now_ns

    @property
    def _reached(self) -> Nanos:
        """The time that the robot may be brought to: the chip's own, or that of all."""
        return self.now if self._shared is None else min(self.now, self._shared.now)

    @property
    def pose(self) -> Pose:
        """Where the robot is now: metres and radians of the world's plan."""
        self._bring_robot_to(self._reached)
        state = self.parts.body.state
        return Pose(state.x_m, state.y_m, state.heading_rad, state.z_m)

    @property
    def text(self) -> str:
        """All that the firmware has printed on USART1 so far, undecodable bytes replaced."""
        printed = record_of(line for line in self.recorder.lines() if '"k":"usart"' in line)
        pieces = [*(data for _, data in printed.usart), self.recorder.unfinished_text]
        return b"".join(pieces).decode("utf-8", "replace")

    def record(self) -> RunRecord:
        """Return what was recorded so far: poses, edges, texts, packets and the state log, each with its time."""
        return record_of(self.recorder.lines())

    def judge(self) -> Judgement:
        """End the run here and judge the scenario's goals; what an unfinished run could still meet is left open.

        Of several robots the goals of all, each with the robot's name before it.
        """
        if self._shared is None:
            return self.judge_own()
        found = {name: bench.judge_own() for name, bench in self.robots.items()}
        return Judgement(*(
            [f"{name}: {goal}" for name, one in found.items() for goal in getattr(one, field.name)]
            for field in fields(Judgement)
        ))  # fmt: skip

    def judge_own(self) -> Judgement:
        """End the run here and judge the goals of this robot."""
        return self.goals.finish(self.ended(self.finish()))

    def _run_to(self, wanted: Nanos, advance: Callable[[int], Reached] | None = None) -> None:
        end_ns = min(wanted, self.end)
        if end_ns > self.now and self.events.released_until >= self.now:
            raise UsageError(f"the run was ended at {self.now / NS_PER_S:g} s", hint="make another Bench")
        had_died = self.chip.has_died
        if self._shared is None:
            self.loop.run_until(end_ns, advance)
        elif advance is not None:
            raise UsageError("a debugger's steps are for a robot alone in its world", hint="a scenario with one robot")
        else:
            self._shared.run_to(end_ns)
        if self.chip.has_died and not had_died:
            _LOG.error("chip: %s", self.chip.verdict)

    def checkpoint(self) -> None:
        """Keep the present state, so that `rewind` to a later time is quick; some 100 kB."""
        for bench in self.robots.values():
            bench._checkpoints.append((bench.now, self.snapshot()))  # noqa: SLF001  # one of its own kind

    def rewind(self, to: Span) -> None:
        """Go back to a time: to the newest checkpoint before it, and on from there; the trace forgets what came after.

        Raises:
            UsageError: The time is not yet reached, or the bench has a chip of the caller's and no checkpoint.
            BluePillError: `to` is no time.
        """
        at = to_nanos(to)
        if at > self.now:
            raise UsageError(
                f"{at / NS_PER_S:g} s is not reached yet: it is {self.now / NS_PER_S:g} s", hint="run_until"
            )
        for bench in self.robots.values():
            bench._checkpoints = [(t, snapshot) for t, snapshot in bench._checkpoints if t <= at]  # noqa: SLF001  # its kind
        self.restore(self._checkpoints[-1][1] if self._checkpoints else self._at_beginning())
        self._run_to(at)

    def restart(self, snapshot: object) -> None:
        """Go back to a state as if it had just been built: who listens to events or slices since then does no more.

        Raises:
            TypeError, UsageError, FileError: As of `restore`.
        """
        for bench in self.robots.values():
            bench.events.drop_later(bench._listeners)  # noqa: SLF001  # one of its own kind
            bench.on_slice = None
            bench._checkpoints.clear()  # noqa: SLF001  # as above
        self.restore(snapshot)

    def fork(self) -> "Bench":
        """Return a bench that goes on from here by itself, with its trace in memory; this one goes on too.

        Raises:
            TypeError: The bench has a chip of the caller's.
        """
        self._refuse_a_chip_of_others()
        other = self._anew()
        written = {name: "".join(bench.trace.lines()) for name, bench in self.robots.items()}
        other.restore(self._with_traces(self.snapshot(), written))
        return other

    def _anew(self) -> "Bench":
        """Return a bench of the same at its beginning, with its trace in memory."""
        slice_ns = self.loop.slice_ns if self._slices is None else None
        if self._shared is None:
            return Bench(self.scenario, slice_ns=slice_ns)
        return Bench.together(self._whole, slice_ns=slice_ns)[self.scenario.name]

    def _at_beginning(self) -> object:
        """Return the snapshot of this bench at time 0, whose trace has no more than its first line."""
        self._refuse_a_chip_of_others()
        written: dict[str, str | int] = {}
        for name, bench in self.robots.items():
            head = next((line for line in bench.trace.lines() if bench.trace.has_meta), "")
            written[name] = len(head.encode()) if bench.trace.path is not None else head
        snapshot = self._with_traces(self._anew().snapshot(), written)
        for part, bench in zip(self._own_parts(snapshot), self.robots.values(), strict=True):
            _recorder(part)["has_meta"] = bench.trace.has_meta
        return snapshot

    def _with_traces(self, snapshot: object, written: Mapping[str, str | int]) -> object:
        """Return a snapshot whose traces hold this much."""
        for part, text in zip(self._own_parts(snapshot), written.values(), strict=True):
            _recorder(part)["written"] = text
        return snapshot

    def _own_parts(self, snapshot: object) -> Sequence[object]:
        """Return the parts of a snapshot that are each robot's own, in the order of `robots`."""
        return [snapshot] if self._shared is None else cast("dict[str, Sequence[object]]", snapshot)["_own"]

    def _refuse_a_chip_of_others(self) -> None:
        if not self._is_rebuildable:
            raise TypeError("a bench with a chip of the caller's cannot be built anew: restore its snapshot()")

    def finish(self) -> Nanos:
        """Bring everything to the end of the run and write the rest of the trace; return the end's time."""
        end = min(self._reached, self.end)
        for bench in self.robots.values():
            bench.finish_own(end)
        return end

    def finish_own(self, end: Nanos) -> None:
        """Bring the parts of this robot to the end of the run and write the rest of its trace."""
        if self.events.released_until >= end:
            return
        self.loop.finish(end)
        self.goals.end_at(self.ended(end))
        self.recorder.finish(end)

    def snapshot(self) -> PartState:
        """Return all that decides the future, of all robots of its world, as a value."""
        return self.own_snapshot() if self._shared is None else self._shared.snapshot()

    def own_snapshot(self) -> PartState:
        """Return what is this robot's own of it."""
        return super().snapshot()

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned, the trace too; the end of the run and its goals may be others.

        Raises:
            TypeError: It is no snapshot of a bench.
            UsageError: It is of another version, firmware, world, seed or other setting that decides the run.
            FileError: The trace's file is not the one that was begun.
        """
        parts = self._own_parts(snapshot) if isinstance(snapshot, PartState) and "_own" in snapshot else [snapshot]
        for part, bench in zip(parts, self.robots.values(), strict=False):
            made_of = part.get("made_of") if isinstance(part, PartState) else None
            if isinstance(made_of, dict):
                refuse_others(made_of, bench.made_of)
        if self._shared is None:
            self.restore_own(snapshot)
        else:
            self._shared.restore(snapshot)

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

    def restore_own(self, snapshot: object) -> None:
        """Put back what `own_snapshot` returned, as `restore` asks for it."""
        super().restore(snapshot)
        self._pins.chip_restored()
        self._waits.forget()
        if self.goals.is_behind:
            self.goals.catch_up(events_of(self.trace.lines()), self.events.released_until)

    def __reduce__(self) -> "tuple[Callable[[str, bytes], Bench], tuple[str, bytes]]":
        if not self._is_rebuildable:
            raise TypeError("a bench with a chip of the caller's cannot be pickled: pickle its snapshot()")
        paths: dict[str, Path | None] = {}
        for name, bench in self.robots.items():
            if not bench.trace.has_end:
                bench.trace.flush()
            paths[name] = None if bench.trace.path is None else bench.trace.path.absolute()
        slice_ns = self.loop.slice_ns if self._slices is None else None
        recipe = pickle.dumps((self._whole, self.scenario.name, slice_ns, paths, self.snapshot()))
        return _built_anew, (installed_version(), recipe)

    def _watch_wires(self, now: Nanos) -> None:
        """Let an edge end the chip's slice where a part may change an input before its own next deadline."""
        if self.parts.adapter is not None:
            self._pins.watch(self.parts.adapter.wakes_on, now)

    def _after_slice(self, now: Nanos) -> None:
        if self._slices is not None:
            self.loop.slice_ns = self._slices.after_slice()
        died_ns = self.chip.died_ns
        if died_ns is not None or self.chip.fault is not None:
            self.loop.end_at(self.end)
        if died_ns is not None and not self._has_told_death:
            self._has_told_death = True
            self.recorder.fault("died", self.chip.verdict, died_ns)
        if self.on_slice is not None:
            self.on_slice(now)

    def _bring_robot_to(self, at: Nanos) -> None:
        for robot in self._robots:
            robot.advance_to(at)

    def _end_at(self, at: Nanos) -> None:
        """End the run at a time, if nothing ends it before."""
        self._ends_at = at if self._ends_at is None else min(at, self._ends_at)
        self.loop.end_at(self.end)

    def _inject(self, words: str, at: Nanos) -> None:
        op, _, fault = words.partition(" ")
        self.recorder.fault("inject" if op == "fault" else op, fault, at)
        if fault == LINK_DOWN:
            for line in self._lines:
                line.is_cut = op == "fault"
        elif self.parts.controller is not None:
            self.parts.controller.do(words, at)

    def _do_by_hand(self, deed: Deed) -> None:
        self.recorder.event(deed.who, deed.at, deed.do, deed.words)
        do_by_hand(deed, self.chip, self.parts.harness)

    def _plug_in(self, chip: LeadingChip) -> tuple[WorldSenses, ...]:
        """Attach the scenario's parts to the board, and have them sense the world."""
        senses = WorldSenses(self.parts.body, self._bring_robot_to)
        plug_in(self.scenario, chip, self.recorder, senses)
        return (senses,)


def body_of(scenario: Scenario, world: World) -> RobotBody:
    """Return the body of a scenario's robot alone in a world, standing where it begins."""
    start = scenario.start or world.start
    return make_body(scenario.body, world, scenario.parameters, start=start, seed=scenario.seed, trust=False)


def _refuse_several(scenario: Scenario) -> None:
    if scenario.robots:
        raise TypeError("a scenario with several robots has a bench each: Bench.from_scenario, or Bench.together")


def _built_anew(saved_by: str, recipe: bytes) -> Bench:
    """Return the bench of a pickle; the version is looked at before anything that another one may have changed.

    Raises:
        UsageError, FileError: As of `Bench.restore`.
    """
    refuse_others({VERSION: saved_by}, {VERSION: installed_version()})
    try:
        scenario, name, slice_ns, paths, snapshot = pickle.loads(recipe)  # noqa: S301 - within a pickle already
        traces = {one: TraceWriter(path, goes_on=path is not None) for one, path in paths.items()}
        if scenario.robots:
            bench = Bench.together(scenario, traces=traces, slice_ns=slice_ns)[name]
        else:
            bench = Bench(scenario, slice_ns=slice_ns, trace=traces[name])
        bench.restore(snapshot)
    except (TypeError, AttributeError, ImportError) as error:
        raise UsageError(f"the bench was saved by another state of this version: {error}", hint=RUN_ANEW) from error
    return bench


def _recorder(snapshot: object) -> dict[str, object]:
    """Return the part of a bench's snapshot that says where its trace stands."""
    bench = cast("dict[str, dict[str, dict[str, object]]]", snapshot)
    return bench["recorder"]["trace"]
