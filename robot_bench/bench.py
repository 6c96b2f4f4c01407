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

Invariant: a bench that was restored from a snapshot goes on as the one that the
snapshot was taken of.
"""

import hashlib
import pickle
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Self, Unpack, cast

from adapter_sim import Adapter
from adapter_sim.pinout import Pinout, Pull, WireRole, load_pinout
from bluepill_sim.spans import Span, to_nanos
from p2os.errors import ScenarioError
from p2os.event_log import log_event, logger
from p2os.pioneer.body.contract import RobotBody
from p2os.pioneer.body.factory import body_note, make_body, resolve_body
from p2os.pioneer.controller import Pioneer
from p2os.pioneer.world import load_world
from p2os.pioneer.world.model import Pose, World
from robot_bench.adapter import RUN_ANEW, AnyAdapter, make_adapter
from robot_bench.direct import DirectRobot, DistanceSensors, JointMotor, WheelEncoder
from robot_bench.direct.wired import AnalogPin, RobotWire
from robot_bench.loop import RunLoop
from robot_bench.pacer import FIRST_SLICE_NS, SliceLength
from robot_bench.recording.client_view import SipRanges
from robot_bench.recording.recorder import Recorder
from robot_bench.recording.run_record import RunRecord, record_of
from robot_bench.recording.trace import TraceWriter
from robot_bench.scenario.fault_script import FaultScript
from robot_bench.scenario.goals import Judgement, judge
from robot_bench.scenario.scenario import (
    Scenario,
    ScenarioOptions,
    load_scenario,
    refuse_what_its_world_refuses,
)
from robot_bench.scenario.schema import nearest
from robot_bench.scenario.wired_robots import WiredPart
from robot_bench.scenario.world_script import WorldScript
from robot_bench.wires.chip_pins import ChipPins
from robot_bench.wires.endpoints import Endpoint
from robot_bench.wires.nets import Harness, Net, OwnedPins, Strength
from robot_bench.wires.ports import Chip
from robot_bench.wires.serial_line import SerialLine
from simbase.errors import UsageError, shown
from simbase.state import PartState, Stateful
from simbase.timing import NS_PER_S, Nanos, Reached

#: chosen: so long a run goes on after a fault of the firmware, to show what the robot does then.
AFTER_FAULT_NS: Nanos = 1 * NS_PER_S
#: Owner of the resistors on the wires.
RESISTORS = "board"
_LOG = logger("bench")


#: What decides a run besides its files; its end and its goals may be others after a restart.
DECISIVE = (
    "mode", "seed", "parameters", "threshold_um", "usart_baud", "start", "direct", "adapter", "adapter_core",
    "controller", "changes", "faults", "own_robot",
)  # fmt: skip
_VERSION = "version of p2os"


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchParts:
    """The parts of a bench, for those who want to look at one."""

    chip: Chip
    harness: Harness
    body: RobotBody
    world: World
    adapter: AnyAdapter | None = None
    pioneer: Pioneer | None = None


class Bench(Stateful):
    """A firmware, its robot and its world, run in virtual time; `from_scenario` makes one.

    >>> bench = Bench.from_scenario("motors", body="kinematic")  # doctest: +SKIP
    >>> bench.run_until("2 s")                                   # doctest: +SKIP
    >>> bench.pose, bench.level("PB12"), bench.text              # doctest: +SKIP
    >>> bench.judge().missed                                     # doctest: +SKIP

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

    STATE = ("made_of", "chip", "_harness", "_robots", "_ranges", "script", "faults", "recorder", "loop")

    def __init__(
        self,
        scenario: Scenario,
        *,
        trace: TraceWriter | None = None,
        chip: Chip | None = None,
        slice_ns: Nanos | None = None,
        on_slice: Callable[[Nanos], None] | None = None,
    ) -> None:
        self.scenario = scenario
        self.trace = trace or TraceWriter()
        self.on_slice = on_slice
        pinout = load_pinout()
        world = load_world(scenario.world, seed=scenario.seed)
        refuse_what_its_world_refuses(scenario, world)
        body = make_body(scenario.body, world, scenario.parameters)
        body.reset(scenario.start or world.start, scenario.seed)
        self._is_rebuildable = chip is None
        chip = chip or boot(scenario.firmware)
        own = scenario.own_robot
        self._harness = harness = make_harness(pinout) if own is None else make_own_harness(own.robot.signals)
        self.recorder = Recorder(self.trace, harness, body=body)
        self.recorder.on_event = log_bench_event
        #: What stands at the far end of the wires and owns the body.
        self._robots: list[DirectRobot | Endpoint | WiredPart] = []
        self._ranges: SipRanges | None = None
        self.parts = self._build(pinout, world, body, chip, harness)
        #: What must be the same where a snapshot of this bench is restored.
        self.made_of: dict[str, object] = {
            _VERSION: version("p2os"),
            "firmware": getattr(getattr(chip, "image", chip), "sha256", type(chip).__name__),
            "world": hashlib.sha256(repr(world).encode()).hexdigest(),
            "body": resolve_body(scenario.body),
            **{name: getattr(scenario, name) for name in DECISIVE},
        }
        self.script = WorldScript(
            scenario.changes, body, scenario.parameters,
            bring_to=self._bring_robot_to, on_change=self.recorder.obstacle,
        )  # fmt: skip
        self.recorder.bring_to = self._bring_robot_to
        self.faults = FaultScript(scenario.faults, bring_to=self._bring_robot_to, do=self._inject)
        followers = (*self._robots, self.script, self.faults)
        self._slices = SliceLength() if slice_ns is None else None
        self.loop = RunLoop(
            chip, followers, observers=(self.recorder,), slice_ns=slice_ns or FIRST_SLICE_NS,
            on_slice=self._after_slice, choose_watched=self._watch_wires,
        )  # fmt: skip
        pin_of = pins_of(scenario)
        #: Name of a wire, or of its pin → name of the wire.
        self._wires = {pin: name for name, pin in pin_of.items()} | {name: name for name in pin_of}
        self._pins = ChipPins(chip, harness, pin_of, on_watched=self.loop.note_edge)
        if isinstance(self.parts.adapter, Adapter):
            self.parts.adapter.samples.waits_for_edges = True
        chip.usart1.far_baud = scenario.usart_baud
        chip.usart1.subscribe(self.recorder.usart)
        chip.subscribe_warnings(lambda text: self.recorder.event("chip", chip.now_ns, "warning", text))
        self.recorder.start()

    @classmethod
    def from_scenario(cls, scenario: Scenario | str | Path, **options: Unpack[ScenarioOptions]) -> Self:
        """Return a bench at its beginning.

        Args:
            scenario: A shipped scenario's name, a TOML file, or a `Scenario`.
            options: What is to be otherwise than it says: see `ScenarioOptions`.

        Raises:
            ScenarioError: There is no such scenario, or it breaks the schema.
            UsageError: An option cannot be.
            ImageError: The firmware is missing, damaged, or not for this chip.
            MissingDependencyError: The emulator or the body is not installed.
        """
        found = scenario if isinstance(scenario, Scenario) else load_scenario(str(scenario))
        return cls(found.with_options(**options))

    @property
    def chip(self) -> Chip:
        """Return the chip."""
        return self.parts.chip

    @property
    def note(self) -> str | None:
        """Return what a reader of the result has to know of the body."""
        return "; ".join(filter(None, (body_note(self.scenario.body), self.parts.body.note))) or None

    @property
    def end(self) -> Nanos:
        """Return when the run ends, as far as is known now."""
        fault, duration_ns = self.chip.fault, self.scenario.duration_ns
        return (
            duration_ns if fault is None or not self.chip.has_died else min(duration_ns, fault.at_ns + AFTER_FAULT_NS)
        )

    @property
    def now(self) -> Nanos:
        """Return the time that the chip has come to."""
        return self.parts.chip.now_ns

    @property
    def pose(self) -> Pose:
        """Where the robot is now: metres and radians of the world's plan."""
        self._bring_robot_to(self.now)
        state = self.parts.body.state
        return Pose(state.x_m, state.y_m, state.heading_rad, state.z_m)

    @property
    def text(self) -> str:
        """All that the firmware has printed on USART1 so far, undecodable bytes replaced."""
        printed = record_of(line for line in self.trace.lines() if '"k":"usart"' in line)
        pieces = [*(data for _, data in printed.usart), self.recorder.unfinished_text]
        return b"".join(pieces).decode("utf-8", "replace")

    def level(self, wire: str) -> bool:
        """Return the level on a wire now.

        Args:
            wire: Its name in the pin-out (`motor1_comm1`), or the BluePill's pin (`PB7`).

        Raises:
            UsageError: There is no such wire.
        """
        if wire not in self._wires:
            raise UsageError(f"there is no wire {shown(wire)}", hint=nearest(wire, self._wires))
        return self.parts.harness[self._wires[wire]].level(self.now)

    def record(self) -> RunRecord:
        """Return what was recorded so far: poses, edges, texts, packets and the state log, each with its time."""
        return record_of(self.trace.lines())

    def judge(self) -> Judgement:
        """End the run here and judge the scenario's goals; what an unfinished run could still meet is left open."""
        return judged(self.trace, self.scenario, self.finish())

    def run_until(self, end: Span, advance: Callable[[int], Reached] | None = None) -> None:
        """Run to `end`, until shortly after a fault of the firmware, or to a debugger's halt.

        Args:
            end: When to come back, counted from the beginning: nanoseconds, or a text such as "2.5 s".
            advance: As of `RunLoop.run_until`.

        Raises:
            UsageError: The run has been judged, or finished.
            BluePillError: `end` is no time.
        """
        end_ns = min(to_nanos(end), self.end)
        if end_ns > self.now and self.trace.written_until >= self.now:
            raise UsageError(f"the run was ended at {self.now / NS_PER_S:g} s", hint="make another Bench")
        had_died = self.chip.has_died
        self.loop.run_until(end_ns, advance)
        if self.chip.has_died and not had_died:
            _LOG.error("chip: %s", self.chip.verdict)

    def finish(self) -> Nanos:
        """Bring everything to the end of the run and write the rest of the trace; return the end's time."""
        end = min(self.now, self.end)
        if self.trace.written_until >= end:
            return end
        self.loop.finish(end)
        self.recorder.finish(end)
        return end

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned, the trace too; the end of the run and its goals may be others.

        Raises:
            TypeError: It is no snapshot of a bench.
            UsageError: It is of another version, firmware, world, seed or other setting that decides the run.
            FileError: The trace's file is not the one that was begun.
        """
        made_of = snapshot.get("made_of") if isinstance(snapshot, PartState) else None
        if isinstance(made_of, dict):
            _refuse_others(made_of, self.made_of)
        super().restore(snapshot)
        self._pins.chip_restored()

    def __reduce__(self) -> "tuple[Callable[[str, bytes], Bench], tuple[str, bytes]]":
        if not self._is_rebuildable:
            raise TypeError("a bench with a chip of the caller's cannot be pickled: pickle its snapshot()")
        if not self.trace.has_end:
            self.trace.flush()
        path = None if self.trace.path is None else self.trace.path.absolute()
        slice_ns = self.loop.slice_ns if self._slices is None else None
        recipe = pickle.dumps((self.scenario, slice_ns, path, self.snapshot()))
        return _built_anew, (version("p2os"), recipe)

    def _watch_wires(self, now: Nanos) -> None:
        """Let an edge end the chip's slice where a part may change an input before its own next deadline."""
        if self.parts.adapter is not None:
            self._pins.watch(self.parts.adapter.wakes_on, now)

    def _after_slice(self, now: Nanos) -> None:
        if self._slices is not None:
            self.loop.slice_ns = self._slices.after_slice()
        if self.chip.fault is not None:
            self.loop.end_at(self.end)
        if self.on_slice is not None:
            self.on_slice(now)

    def _bring_robot_to(self, at: Nanos) -> None:
        for robot in self._robots:
            robot.advance_to(at)

    def _inject(self, words: str, at: Nanos) -> None:
        if self.parts.pioneer is not None:
            self.parts.pioneer.do(words, at)

    def _build(self, pinout: Pinout, world: World, body: RobotBody, chip: Chip, harness: Harness) -> BenchParts:
        if self.scenario.own_robot is not None:
            pins = {wire.name: wire.pin for wire in self.scenario.own_robot.robot.signals}
            robot = self.scenario.own_robot.build(
                body, harness, lambda signal: cast("AnalogPin", chip.pin(pins[signal]))
            )
            robot.on_event, robot.on_ranges = self.recorder.listener("robot"), self.recorder.sonar
            self._robots.append(robot)
            return BenchParts(chip=chip, harness=harness, body=body, world=world)
        if self.scenario.mode == "direct":
            if self.scenario.faults:
                raise ScenarioError(
                    f"{self.scenario.name}: [[fault]] acts on the robot's controller, and mode direct has none",
                    hint="--mode adapter",
                )
            self._robots.append(self._direct_robot(pinout, body, harness))
            return BenchParts(chip=chip, harness=harness, body=body, world=world)
        adapter, pioneer = self._adapter_and_pioneer(pinout, body, harness)
        return BenchParts(chip=chip, harness=harness, body=body, world=world, adapter=adapter, pioneer=pioneer)

    def _direct_robot(self, pinout: Pinout, body: RobotBody, harness: Harness) -> DirectRobot:
        settings = self.scenario.direct

        def nets(value: str) -> list[Net]:
            return [harness[name] for name in pinout.value(value).wires]

        def motor(value: str) -> JointMotor:
            return JointMotor(
                nets(value), step_um_per_s=settings.step_um_per_s, ramp_um_per_s2=settings.ramp_um_per_s2,
                dt_ns=body.dt_ns, bit_order=settings.bit_order,
            )  # fmt: skip

        wires = pinout.with_role(WireRole.DISTANCE)
        sensors = DistanceSensors(
            [harness[wire.name] for wire in wires],
            threshold_um=self.scenario.threshold_um, period_ns=settings.sensor_period_ns,
        )  # fmt: skip
        sensors.on_sample = self.recorder.sonar
        robot = DirectRobot(
            body, left=motor("motor1"), right=motor("motor2"),
            encoders=(WheelEncoder(nets("encoder1")), WheelEncoder(nets("encoder2"))),
            sensors=sensors, sonar_numbers=range(len(wires)), encoder_period_ns=settings.encoder_period_ns,
        )  # fmt: skip
        robot.on_event = self.recorder.listener("direct")
        return robot

    def _adapter_and_pioneer(self, pinout: Pinout, body: RobotBody, harness: Harness) -> tuple[AnyAdapter, Pioneer]:
        recorder, parameters = self.recorder, self.scenario.parameters
        to_robot, to_client = SerialLine(), SerialLine()
        adapter = make_adapter(self.scenario, OwnedPins(harness, "adapter"), pinout)
        adapter.on_event = recorder.listener("adapter")
        settings = replace(self.scenario.controller, baud=to_client.baud, seed=self.scenario.seed)
        pioneer = Pioneer(parameters=parameters, body=body, settings=settings)
        pioneer.on_event = recorder.listener("pioneer")
        ranges = self._ranges = SipRanges(parameters, pioneer.settings.profile, on_ranges=recorder.sonar)

        def arrives_at_client(data: bytes, at: Nanos) -> None:
            recorder.wire("r2c", data, at)
            ranges.take(data, at)

        self._robots.append(Endpoint(adapter, incoming=to_client, outgoing=to_robot, on_arrival=arrives_at_client))
        self._robots.append(
            Endpoint(
                pioneer,
                incoming=to_robot,
                outgoing=to_client,
                on_arrival=lambda data, at: recorder.wire("c2r", data, at),
            )
        )
        return adapter, pioneer


def _built_anew(saved_by: str, recipe: bytes) -> Bench:
    """Return the bench of a pickle; the version is looked at before anything that another one may have changed.

    Raises:
        UsageError, FileError: As of `Bench.restore`.
    """
    _refuse_others({_VERSION: saved_by}, {_VERSION: version("p2os")})
    try:
        scenario, slice_ns, path, snapshot = pickle.loads(recipe)  # noqa: S301 - within a pickle already
        bench = Bench(scenario, slice_ns=slice_ns, trace=TraceWriter(path, goes_on=path is not None))
        bench.restore(snapshot)
    except (TypeError, AttributeError, ImportError) as error:
        raise UsageError(f"the bench was saved by another state of this version: {error}", hint=RUN_ANEW) from error
    return bench


def _refuse_others(saved: dict[str, object], here: dict[str, object]) -> None:
    """Refuse what was saved where something that decides a run is different from here."""
    for what, value in saved.items():
        if here.get(what) != value:
            values = f": {value} there, {here.get(what)} here" if isinstance(value, str | int) else ""
            raise UsageError(f"the bench was saved with another {what}{values}", hint=RUN_ANEW)


def judged(trace: TraceWriter, scenario: Scenario, end: Nanos) -> Judgement:
    """Judge a scenario's goals by what a run has recorded until its `end`."""
    return judge(record_of(trace.lines()), scenario.goals, end_ns=end, planned_ns=scenario.planned_ns)


def log_bench_event(who: str, at: Nanos, what: str, detail: str) -> None:
    """Log a line of a bench's state log."""
    log_event(_LOG, who, at, what, detail)


def boot(firmware: Path) -> Chip:
    """Return an emulated BluePill with a firmware, at its reset.

    Raises:
        MissingDependencyError: The emulator's engine is not installed.
    """
    from bluepill_sim.board import BluePill

    return BluePill(firmware)


def pins_of(scenario: Scenario) -> dict[str, str]:
    """Return the chip's pin of each wire of a scenario."""
    if scenario.own_robot is None:
        return {wire.name: wire.bluepill for wire in load_pinout().wires}
    return {wire.name: wire.pin for wire in scenario.own_robot.robot.signals if not wire.is_analog}


def make_own_harness(signals: Sequence[RobotWire]) -> Harness:
    """Return the wires of a robot on own pins, with the resistors that hang on them."""
    harness = Harness(Net(wire.name) for wire in signals if not wire.is_analog)
    for wire in signals:
        if wire.pull is not None:
            harness[wire.name].drive(RESISTORS, wire.pull, Strength.PULL, 0)
    return harness


def make_harness(pinout: Pinout) -> Harness:
    """Return the wires of a pin-out, with the resistors that hang on them."""
    harness = Harness(Net(wire.name, idle=wire.idle) for wire in pinout.wires)
    for wire in pinout.wires:
        if wire.pull is not Pull.NONE:
            harness[wire.name].drive(RESISTORS, wire.pull is Pull.UP, Strength.PULL, 0)
    return harness
