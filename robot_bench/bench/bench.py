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

from bluepill_sim.spans import Span, to_nanos
from p2os.event_log import logger
from p2os.pioneer.body.factory import make_scene
from p2os.pioneer.world import load_world
from p2os.pioneer.world.model import Pose
from robot_bench.adapter import RUN_ANEW
from robot_bench.bench.expectations import Expectations
from robot_bench.bench.interventions import Interventions
from robot_bench.bench.origin import VERSION, refuse_others
from robot_bench.bench.robot_run import RobotRun
from robot_bench.events.stream import EventStream
from robot_bench.recording.run_record import RunRecord, record_of
from robot_bench.recording.trace import TraceWriter
from robot_bench.running.shared_world import SharedWorld
from robot_bench.scenario.goals.judging import Judgement
from robot_bench.scenario.loading import load_scenario
from robot_bench.scenario.options import ScenarioOptions
from robot_bench.scenario.scenario import Scenario
from robot_bench.wires.ports import LeadingChip
from simbase.errors import UsageError, shown
from simbase.installation import installed_version
from simbase.state import PartState
from simbase.timing import NS_PER_S, Nanos, Reached
from simbase.trust import Trust

#: chosen: so long a run goes on after a fault of the firmware, to show what the robot does then.
AFTER_FAULT_NS: Nanos = 1 * NS_PER_S
_LOG = logger("bench")


@dataclass(frozen=True, slots=True)
class _Whole:
    """What the benches of several robots share: their world, the scenario with all of them, and each other."""

    world: SharedWorld
    scenario: Scenario
    benches: "dict[str, Bench]"


class Bench(Expectations, Interventions):
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

    Raises:
        ScenarioError: The scenario's world refuses it, or its mode has not what it asks for.
        ImageError: The firmware is missing, damaged, or not for this chip.
        MissingDependencyError: The emulator or the body is not installed.
    """

    def __init__(
        self,
        scenario: Scenario,
        *,
        trace: TraceWriter | None = None,
        chip: LeadingChip | None = None,
        slice_ns: Nanos | None = None,
        on_slice: Callable[[Nanos], None] | None = None,
        _whole: _Whole | None = None,
    ) -> None:
        self._whole = _whole
        self._is_rebuildable = chip is None
        self._run = RobotRun(
            scenario, trace=trace, chip=chip, slice_ns=slice_ns, on_slice=on_slice,
            shared=None if _whole is None else _whole.world,
        )  # fmt: skip
        #: What runs, and where its recording goes; the parts.
        self.scenario, self.trace, self.parts = scenario, self._run.trace, self._run.parts
        #: States that `rewind` may go back to, oldest first: times and snapshots.
        self._checkpoints: list[tuple[Nanos, object]] = []
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
        whole = _Whole(shared, scenario, {})
        for robot in scenario.robots:
            if robot.scenario is not None:
                trace = (traces or {}).get(robot.name)
                whole.benches[robot.name] = cls(robot.scenario, trace=trace, slice_ns=slice_ns, _whole=whole)
        return cast("dict[str, Self]", whole.benches)

    @property
    def robots(self) -> Mapping[str, "Bench"]:
        """The benches of all robots of its world that have a chip, by name; alone in its world, itself."""
        return {self.scenario.name: self} if self._whole is None else self._whole.benches

    @property
    def on_slice(self) -> Callable[[Nanos], None] | None:
        """What is called after each slice with the time reached, ns; it may raise to end the run."""
        return self._run.on_slice

    @on_slice.setter
    def on_slice(self, called: Callable[[Nanos], None] | None) -> None:
        self._run.on_slice = called

    def __repr__(self) -> str:
        what = self.scenario
        return f"<Bench {what.name} in {what.world}, {what.mode}, at {self.now / NS_PER_S:.3f} s>"

    @property
    def events(self) -> EventStream:
        """What happens, for whoever subscribes; it lags up to 50 ms behind `now`."""
        return self._run.events

    @property
    def chip(self) -> LeadingChip:
        """Return the chip."""
        return self.parts.chip

    @property
    def end(self) -> Nanos:
        """Return when the run ends, as far as is known now; of several robots with the first that ends."""
        return self._run.whole_end

    @property
    def now(self) -> Nanos:
        """Return the time that the chip has come to."""
        return self._run.now

    @property
    def pose(self) -> Pose:
        """Where the robot is now: metres and radians of the world's plan."""
        self._run.bring_robot_to(self._run.reached)
        state = self.parts.body.state
        return Pose(state.x_m, state.y_m, state.heading_rad, state.z_m)

    @property
    def text(self) -> str:
        """All that the firmware has printed on USART1 so far, undecodable bytes replaced."""
        printed = record_of(line for line in self._run.recorder.lines() if '"k":"usart"' in line)
        pieces = [*(data for _, data in printed.usart), self._run.recorder.unfinished_text]
        return b"".join(pieces).decode("utf-8", "replace")

    def record(self) -> RunRecord:
        """Return what was recorded so far: poses, edges, texts, packets and the state log, each with its time."""
        return record_of(self._run.recorder.lines())

    def judge(self) -> Judgement:
        """End the run here and judge the scenario's goals; what an unfinished run could still meet is left open.

        Of several robots the goals of all, each with the robot's name before it.
        """
        end = self.finish()
        found = {name: run_of(bench).judge(end) for name, bench in self.robots.items()}
        if self._whole is None:
            return found[self.scenario.name]
        return Judgement(*(
            [f"{name}: {goal}" for name, one in found.items() for goal in getattr(one, field.name)]
            for field in fields(Judgement)
        ))  # fmt: skip

    def _run_to(self, wanted: Nanos, advance: Callable[[int], Reached] | None = None) -> None:
        end_ns = min(wanted, self.end)
        if end_ns > self.now:
            self._run.refuse_the_ended()
        had_died = self.chip.has_died
        if self._whole is None:
            self._run.loop.run_until(end_ns, advance)
        elif advance is not None:
            raise UsageError("a debugger's steps are for a robot alone in its world", hint="a scenario with one robot")
        else:
            self._whole.world.run_to(end_ns)
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

    def fork(self, path: Path | None = None) -> "Bench":
        """Return a bench that goes on from here by itself, with its trace in memory; this one goes on too.

        Args:
            path: The file of its trace, in place of memory; for a robot alone in its world.

        Raises:
            TypeError: The bench has a chip of the caller's.
            UsageError: A file for several robots.
            FileError: The file cannot be written.
        """
        self._refuse_a_chip_of_others()
        if path is None:
            written: dict[str, str | int] = {name: "".join(one.trace.lines()) for name, one in self.robots.items()}
            other = self._anew()
        elif self._whole is not None:
            raise UsageError("robots that share a world have their forks in memory", hint="fork()")
        else:
            written = {self.scenario.name: self.trace.copy_to(path)}
            trace = TraceWriter(path, goes_on=True)
            other = Bench(self.scenario, slice_ns=self._run.slice_ns, trace=trace)
        other.restore(self._with_traces(self.snapshot(), written))
        return other

    def _anew(self) -> "Bench":
        """Return a bench of the same at its beginning, with its trace in memory."""
        slice_ns = self._run.slice_ns
        if self._whole is None:
            return Bench(self.scenario, slice_ns=slice_ns)
        return Bench.together(self._whole.scenario, slice_ns=slice_ns)[self.scenario.name]

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
        return [snapshot] if self._whole is None else cast("dict[str, Sequence[object]]", snapshot)["_own"]

    def _refuse_a_chip_of_others(self) -> None:
        if not self._is_rebuildable:
            raise TypeError("a bench with a chip of the caller's cannot be built anew: restore its snapshot()")

    def finish(self) -> Nanos:
        """Bring everything to the end of the run and write the rest of the trace; return the end's time."""
        end = min(self._run.reached, self.end)
        for bench in self.robots.values():
            run_of(bench).finish(end)
        return end

    def snapshot(self) -> PartState:
        """Return all that decides the future, of all robots of its world, as a value."""
        return self._run.snapshot() if self._whole is None else self._whole.world.snapshot()

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned, the trace too; the end of the run and its goals may be others.

        Raises:
            TypeError: It is no snapshot of a bench.
            UsageError: It is of another version, firmware, world, seed or other setting that decides the run.
            FileError: The trace's file is not the one that was begun.
        """
        parts = self._own_parts(snapshot) if isinstance(snapshot, PartState) and "_own" in snapshot else [snapshot]
        for part, bench in zip(parts, self.robots.values(), strict=False):
            run_of(bench).refuse(part)
        if self._whole is None:
            self._run.restore(snapshot)
        else:
            self._whole.world.restore(snapshot)

    def __reduce__(self) -> "tuple[Callable[[str, bytes], Bench], tuple[str, bytes]]":
        if not self._is_rebuildable:
            raise TypeError("a bench with a chip of the caller's cannot be pickled: pickle its snapshot()")
        paths: dict[str, Path | None] = {}
        for name, bench in self.robots.items():
            if not bench.trace.has_end:
                bench.trace.flush()
            paths[name] = None if bench.trace.path is None else bench.trace.path.absolute()
        whole = self.scenario if self._whole is None else self._whole.scenario
        recipe = pickle.dumps((whole, self.scenario.name, self._run.slice_ns, paths, self.snapshot()))
        return _built_anew, (installed_version(), recipe)


def run_of(bench: Bench) -> RobotRun:
    """Return what runs a bench's own robot, for what runs, judges and debugs benches: no promise to users."""
    return bench._run  # noqa: SLF001  # the one way to it


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
    return cast("dict[str, dict[str, dict[str, object]]]", snapshot)["recorder"]["trace"]
