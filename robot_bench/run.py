"""Runs a scenario into a run folder: the functions behind `p2os run`.

The trace is written while the run goes on; when the run ends, however it ends,
the goals are judged from it and everything else in the folder is made from it.
What the folder holds is listed in `robot_bench.report.make`.

What the chip's package, the bench and the disk refuse in the midst of a run is a failure
of that run. What keeps it from beginning, and a bug, is raised; the folder tells of it too.

Invariant: whatever raises, the trace has its last line (unless the disk takes none), and
a report can be made of the folder.
"""

import base64
import contextlib
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar, cast

from bluepill_sim.parts.attached import AttachedParts
from bluepill_sim.parts.serial_port import QUIET_NS
from p2os.event_log import logger
from p2os.pioneer.body.factory import resolve_body
from p2os.pioneer.world import known_worlds
from p2os.pioneer.world.model import Pose, World
from p2os.transport import Transport
from p2os.transport.wall_clock import Clock, wall_clock
from robot_bench.bench import Bench, RobotRun, run_of
from robot_bench.bench.board import pins_of
from robot_bench.bench.recorded_variables import recording_variables, variables_of
from robot_bench.events.codec import Json
from robot_bench.recording.run_folder import TRACE_NAME, remove_run, reserved
from robot_bench.recording.run_record import read_run
from robot_bench.recording.summary import INTERRUPTED, end_of_a_broken_run, outcome_of, outcome_of_all
from robot_bench.recording.trace import TraceWriter
from robot_bench.remote import RemoteBench
from robot_bench.report.make import Artefacts, Files, make_artefacts, make_artefacts_of_all
from robot_bench.report.page_of_all import REPORT_NAME
from robot_bench.running.pacer import PACED_SLICE_NS, RealTimePacer
from robot_bench.scenario.scenario import Scenario
from robot_bench.wires.ports import LeadingChip
from simbase.entry_points import installed_points
from simbase.errors import FileError, P2osError, UsageError
from simbase.files import sha256_of
from simbase.installation import installed_version
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos
from simbase.user_classes import loaded, unforeseen

if TYPE_CHECKING:
    from robot_bench.recording.measurement import Measurement

#: What is recorded as the world where nothing is known of it: 8 m of an empty plan.
UNKNOWN_PLACE: Json = {"extent": [-4.0, -4.0, 4.0, 4.0], "obstacles": []}
#: Entry points that say in a line why a run failed: a function of its record and the firmware's file.
EXPLAINERS = "robot_bench.explainers"
#: Exit code of errors that whoever types the command can mend.
WRONG_USAGE = 2
_LOG = logger("bench")


@dataclass(frozen=True, slots=True, kw_only=True)
class RunProgress:
    """Where a run stands."""

    now: Nanos
    duration_ns: Nanos
    #: Returns what the robot is doing, in a few words.
    doing: Callable[[], str]


#: Runs a bench to its end in place of its `run_until`, as a debugger does.
RunBench = Callable[[Bench], None]
RunRemoteBench = Callable[[RemoteBench], None]
_AnyBench = TypeVar("_AnyBench", Bench, RemoteBench)
ProgressListener = Callable[[RunProgress], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class RunResult:
    """A run that came to an end."""

    folder: Path
    outcome: Json
    #: The page; the trace where no page was wanted.
    report: Path
    #: A signal ended it.
    was_interrupted: bool

    @property
    def passed(self) -> bool:
        """Whether every goal was met and nothing failed."""
        return bool(self.outcome["passed"])


def run_scenario(
    scenario: Scenario,
    folder: Path,
    *,
    speed: float | None = None,
    on_progress: ProgressListener | None = None,
    drive: RunBench | None = None,
    force: bool = False,
    coverage: bool = False,
    profile: bool = False,
    fail_under: float = 0.0,
    is_kept: Callable[[bool], bool] = lambda _passed: True,
    explained: bool = False,
    files: Files = Files.REPORT,
    variables: Sequence[str] = (),
) -> RunResult:
    """Run a scenario in virtual time and make its run folder.

    Args:
        scenario: What to run.
        folder: Where to; made where it is missing.
        speed: Virtual seconds a wall second; None runs as fast as it can.
        on_progress: Called after each slice; a KeyboardInterrupt out of it ends the run in good order.
        drive: Runs the bench in place of its `run_until`; a debugger.
        force: Overwrite the run that the folder holds.
        coverage: Write which lines and branches of the firmware ran; not with a `drive` that goes back.
        profile: Write where its cycles went; likewise.
        fail_under: With `coverage`, the run fails where fewer percent of the lines ran; 0 asks for nothing.
        is_kept: Told whether the run passed; where it says no, nothing is made of the run and its folder is removed.
        explained: Whether the report says of a run that failed why (`p2os explain`), which takes some seconds.
        files: How much is made of the run.
        variables: Names of the program's variables that are recorded beside the trace.

    Raises:
        UsageError: The program has no such variable.
        P2osError: The folder is not free, a file cannot be read or written, or a part is not installed.
        BluePillError: The firmware file cannot be read, or the emulator is not installed.
    """
    if scenario.robots:
        if variables:
            raise UsageError("variables are recorded of a robot alone", hint="a scenario with one robot")
        if drive is not None or coverage or profile:
            raise UsageError("a debugger, coverage and profile are for a robot alone", hint="a scenario with one robot")
        return run_together(
            scenario, folder, speed=speed, on_progress=on_progress, force=force, is_kept=is_kept, files=files
        )  # fmt: skip
    if variables:
        drive = recording_variables(variables_of(scenario.firmware, variables), folder, drive)
    pacer = None if speed is None else RealTimePacer(speed=speed)
    with reserved(folder, force=force), _trace_of(scenario, folder, is_at_port=False) as trace:
        bench = Bench(scenario, trace=trace, slice_ns=PACED_SLICE_NS if pacer else None)

        bench.on_slice = _after_slice(bench, pacer, on_progress)
        trace.meta(meta_of(scenario, bench.parts.world, run_of(bench).note, is_at_port=False))
        with _measured(bench.chip, coverage=coverage, profile=profile, fail_under=fail_under) as measurement:
            return _record(bench, trace, folder, pacer, drive, measurement, is_kept, explained=explained, files=files)


def run_at_port(
    scenario: Scenario,
    folder: Path,
    transport: Transport,
    *,
    on_progress: ProgressListener | None = None,
    clock: Clock = wall_clock,
    pacer: RealTimePacer | None = None,
    drive: RunRemoteBench | None = None,
    force: bool = False,
    files: Files = Files.REPORT,
) -> RunResult:
    """Drive the robot at a transport in real time (mode C), stop it, and make the run folder.

    The transport is closed in any case. A lost line, lag and a signal are failures of the run.

    With `drive`, a debugger runs the bench in place of its `run_until`; with `force`, the
    run that the folder holds is overwritten; `files` says how much is made of the run.

    Raises:
        P2osError: The folder is not free, a file cannot be read or written, or a part is not installed.
        BluePillError: The firmware file cannot be read, or the emulator is not installed.
    """
    if scenario.robots:
        transport.close()
        raise UsageError("a real robot is driven by a scenario with one robot", hint="leave out [[robot]]")
    pacer = pacer or RealTimePacer(clock=clock)
    with contextlib.ExitStack() as stack:
        stack.callback(transport.close)
        stack.enter_context(reserved(folder, force=force))
        trace = stack.enter_context(_trace_of(scenario, folder, is_at_port=True))
        bench = RemoteBench(scenario, transport, pacer, trace=trace)

        bench.on_slice = _after_slice(bench, None, on_progress)  # it keeps pace by itself
        trace.meta(meta_of(scenario, None, bench.note, is_at_port=True))
        return _record(bench, trace, folder, pacer, drive, clock=clock, files=files)


def write_run(
    bench: Bench, folder: Path, failure: str = "", *, explained: str = "", files: Files = Files.REPORT
) -> Path:  # fmt: skip
    """Write what a bench with its trace in memory has recorded so far as a run folder; return its report's path.

    Args:
        bench: It has run as far as it will.
        folder: Made where it is missing; a run that is there is overwritten.
        failure: Why it failed; empty where it did not.
        explained: What `why_failed` says of it; empty where nobody asked.
        files: How much is made of the run.

    Raises:
        UsageError: The folder holds something that is no run, or is written by another run.
        FileError: It cannot be written.
    """
    end = end_of_a_broken_run(bench.record(), failure) | {"trace_sha256": bench.trace.sha256}
    goals = run_of(bench).judge(bench.now)
    end |= {"goals_met": goals.met, "goals_not_judged": goals.not_judged}
    if not failure:
        end |= {"passed": True, "failures": []}
    if explained:
        end |= {"explained": explained}
    meta = meta_of(bench.scenario, bench.parts.world, run_of(bench).note, is_at_port=False)
    with reserved(folder, force=True), contextlib.closing(TraceWriter(folder / TRACE_NAME)) as trace:
        trace.meta(meta)
        trace.copy(run_of(bench).recorder.lines())
        trace.end(end)
        return make_artefacts(folder, files).report


def meta_of(scenario: Scenario, world: World | None, note: str | None, *, is_at_port: bool) -> Json:
    """Return the trace's first line: what was run, where, with what robot; no world is one that is not known."""
    parameters = scenario.parameters
    place = "the real one" if is_at_port else str(scenario.world)
    start = Pose(0.0, 0.0, 0.0) if world is None else scenario.start or world.start
    there: Json = {
        "world": {"name": place, **UNKNOWN_PLACE} if world is None else world.to_plain(),
        "robot": {
            "name": scenario.robot,
            "front_m": parameters.body.hull_front_m,
            "rear_m": parameters.body.hull_rear_m,
            "width_m": parameters.body.hull_width_m,
            "track_m": parameters.track_mm / 1000,
            "wheel_diameter_m": parameters.body.wheel_diameter_m,
            "sonar": [
                [sonar.x_mm / 1000, sonar.y_mm / 1000, math.radians(sonar.heading_deg)]
                for sonar in parameters.sonar[: parameters.sonar_fitted]
            ],
            "sonar_cone_rad": math.radians(parameters.sonar_cone_deg),
            "sonar_range_m": parameters.sonar_range_m,
        },
    }
    return {
        "version": installed_version(),
        "scenario": scenario.name,
        "description": scenario.description,
        "text": scenario.text,
        "scenario_path": None if scenario.path is None else str(scenario.path.absolute()),
        "settings": [[key, value] for key, value in scenario.settings],
        "code": [code.to_plain() for code in scenario.codes],
        "world_path": str(scenario.world) if scenario.world in known_worlds() else str(Path(scenario.world).absolute()),
        "firmware": scenario.firmware.name,
        "firmware_path": str(scenario.firmware.absolute()),
        "firmware_sha256": _sha256_of(scenario.firmware),
        "mode": "port" if is_at_port else scenario.mode,
        "body": "remote" if is_at_port else resolve_body(scenario.body),
        "seed": None if is_at_port else scenario.seed,
        "sram": scenario.sram,
        "crystal_ppm": scenario.crystal_ppm,
        "interrupt_latency_cycles": scenario.interrupt_latency_cycles,
        "gives_up_s": scenario.gives_up_s,
        "duration_s": scenario.duration_ns / NS_PER_S,
        "threshold_m": scenario.threshold_m,
        "step_mps": (scenario.direct if scenario.mode == "direct" else scenario.adapter).step_um_per_s / 1e6,
        "note": note,
        "pins": pins_of(scenario),
        "start": {"x": start.x_m, "y": start.y_m, "heading": start.heading_rad},
        **(there if scenario.has_robot else {}),
    }


def _measured(
    chip: LeadingChip, *, coverage: bool, profile: bool, fail_under: float
) -> "contextlib.AbstractContextManager[Measurement | None]":
    """Return a block in which coverage and profile of a chip are measured; nothing is where neither is wanted."""
    if not coverage and not profile:
        return contextlib.nullcontext()
    from bluepill_sim.board import BluePill
    from robot_bench.recording.measurement import measuring

    if not isinstance(chip, BluePill):
        raise TypeError(f"a {type(chip).__name__} cannot be measured: an emulated BluePill can")
    return measuring(chip, coverage=coverage, profile=profile, fail_under=fail_under)


def _sha256_of(firmware: Path) -> str | None:
    try:
        return sha256_of(firmware)
    except FileError:  # who needs the file says so
        return None


@contextlib.contextmanager
def _trace_of(scenario: Scenario, folder: Path, *, is_at_port: bool) -> Iterator[TraceWriter]:
    """Open a folder's trace for a block; what leaves the block as an error is reported in the folder first."""
    with contextlib.closing(TraceWriter(folder / TRACE_NAME)) as trace:
        try:
            yield trace
        except BaseException as error:
            if not trace.has_end:
                with contextlib.suppress(P2osError):  # a disk that is full: the first failure is the one to be reported
                    if not trace.has_meta:
                        trace.meta(meta_of(scenario, None, None, is_at_port=is_at_port))
                    trace.flush()
                    trace.end(end_of_a_broken_run(read_run(folder), _reason(error)))
                    make_artefacts(folder)
            raise


def _reason(error: BaseException) -> str:
    """Return why a run ended, in one line."""
    if isinstance(error, KeyboardInterrupt):
        return f"{INTERRUPTED} ({error})" if error.args else INTERRUPTED
    if isinstance(error, (P2osError, ModuleNotFoundError)):
        return str(error)
    return unforeseen(error)


def held(bench: Bench | RemoteBench) -> RobotRun | RemoteBench:
    """Return what the runner holds of a bench: its recorder, its goals, its loop."""
    return run_of(bench) if isinstance(bench, Bench) else bench


def doing(bench: Bench | RemoteBench) -> str:
    """Return what the robot is doing, in a few words."""
    recorder = held(bench).recorder
    state, text = recorder.last_state, recorder.last_line
    wheels = "" if state is None else f"{state.left_speed_mps * 1000:+.0f} / {state.right_speed_mps * 1000:+.0f} mm/s"
    return f"{wheels}  {text}".strip()


def _after_slice(
    bench: Bench | RemoteBench, pacer: RealTimePacer | None, on_progress: ProgressListener | None
) -> Callable[[Nanos], None]:
    """Return what a run does after each slice: it keeps pace, and tells how far it is."""

    def after_slice(now: Nanos) -> None:
        if pacer is not None:
            pacer.keep_pace(now)
        if on_progress is not None:
            on_progress(RunProgress(now=now, duration_ns=bench.scenario.duration_ns, doing=lambda: doing(bench)))

    return after_slice


@dataclass(frozen=True, slots=True)
class _Driven:
    """How a bench was run to its end."""

    end: Nanos
    wall_s: float
    failures: tuple[str, ...]
    was_interrupted: bool


def _record(
    bench: _AnyBench,
    trace: TraceWriter,
    folder: Path,
    pacer: RealTimePacer | None,
    drive: Callable[[_AnyBench], None] | None,
    measurement: "Measurement | None" = None,
    is_kept: Callable[[bool], bool] = lambda _passed: True,
    *,
    clock: Clock = wall_clock,
    explained: bool = False,
    files: Files = Files.REPORT,
) -> RunResult:
    """Run to the end, judge the goals, write the trace's last line, and make the rest of the folder."""
    driven = _drive(bench, pacer, drive, clock)
    passed = _conclude(bench, trace, folder, pacer, driven, measurement, explained=explained)
    made = make_artefacts(folder, files) if is_kept(passed) else _removed(folder)
    _LOG.info("%s %s: %s", bench.scenario.name, "passed" if passed else "failed", made.report)
    return RunResult(folder=folder, outcome=made.outcome, report=made.report, was_interrupted=driven.was_interrupted)


def _drive(
    bench: _AnyBench,
    pacer: RealTimePacer | None,
    drive: Callable[[_AnyBench], None] | None,
    clock: Clock = wall_clock,
) -> _Driven:
    """Run a bench to its end; what goes wrong in the midst of it is a failure of the run."""
    failures: list[str] = []
    was_interrupted = False
    began = clock()
    if pacer is not None:
        pacer.start(0)
    try:
        if drive is None:
            bench.run_until(bench.scenario.duration_ns)
        else:
            drive(bench)
    except KeyboardInterrupt as interruption:
        was_interrupted = True
        failures.append(_reason(interruption))
    except P2osError as error:
        if bench.chip.now_ns == 0 and error.exit_code == WRONG_USAGE:
            raise  # it has not begun: a port of GDB's that is taken
        failures.append(_reason(error))
    except Exception:
        with contextlib.suppress(Exception):  # the bug that is on its way counts
            bench.finish()
        raise
    end = bench.finish()
    return _Driven(end, (clock() - began) / NS_PER_S, tuple(failures), was_interrupted)


def _conclude(
    bench: Bench | RemoteBench,
    trace: TraceWriter,
    folder: Path,
    pacer: RealTimePacer | None,
    driven: _Driven,
    measurement: "Measurement | None" = None,
    *,
    explained: bool = False,
) -> bool:
    """Judge the goals and write the trace's last line; tell whether the run passed."""
    failures, end = list(driven.failures), driven.end
    for failure in failures:
        _LOG.error("%s: %s", bench.scenario.name, failure)
    if bench.chip.has_died:
        failures.append(bench.chip.verdict)
    measured: Json = {}
    if measurement is not None:
        measured = measurement.write(folder, bench.scenario.firmware.parent)
        failures += measurement.failures
    goals = held(bench).judge(end)
    passed = not failures and not goals.missed
    trace.end(
        _figures(bench, end, driven.wall_s)
        | {
            "trace_sha256": trace.sha256,
            "passed": passed,
            "failures": failures + goals.missed,
            "goals_met": goals.met,
            "goals_not_judged": goals.not_judged,
            "notes": notes(bench, end, pacer),
            "parts": parts_of(bench.chip),
            "last_blocks": last_blocks(bench, end, passed=passed),
            "worst_lag_ms": None if pacer is None else round(pacer.worst_lag_ns / NS_PER_MS, 1),
        }
        | measured
        | (
            {"explained": line}
            if explained and not passed and (line := why_failed(bench, failures + goals.missed))
            else {}
        )
    )
    return passed


def run_together(
    scenario: Scenario,
    folder: Path,
    *,
    speed: float | None = None,
    on_progress: ProgressListener | None = None,
    force: bool = False,
    is_kept: Callable[[bool], bool] = lambda _passed: True,
    files: Files = Files.REPORT,
    drive: Callable[[Mapping[str, Bench]], None] | None = None,
) -> RunResult:
    """Run a scenario with several robots: a run folder for each inside of `folder`, and there what came of all.

    Arguments and errors as of `run_scenario`; `drive` runs all benches in place of the first one's `run_until`.
    """
    pacer = None if speed is None else RealTimePacer(speed=speed)
    with contextlib.ExitStack() as stack:
        traces: dict[str, TraceWriter] = {}
        for own in scenario.programmed:
            stack.enter_context(reserved(folder / own.name, force=force))
            traces[own.name] = stack.enter_context(_trace_of(own, folder / own.name, is_at_port=False))
        benches = Bench.together(scenario, traces=traces, slice_ns=PACED_SLICE_NS if pacer else None)
        first = next(iter(benches.values()))
        first.on_slice = _after_slice(first, pacer, on_progress)
        for name, bench in benches.items():
            meta = meta_of(bench.scenario, bench.parts.world, run_of(bench).note, is_at_port=False)
            traces[name].meta(meta | {"robots": list(benches)})
        driven = _drive(first, pacer, None if drive is None else lambda _first: drive(benches))
        passed = [_conclude(bench, traces[name], folder / name, pacer, driven) for name, bench in benches.items()]
        if is_kept(all(passed)):
            made = make_artefacts_of_all(folder, list(benches), scenario.name, files)
        else:
            outcomes = {name: _removed(folder / name).outcome for name in benches}
            made = Artefacts(outcome=outcome_of_all(scenario.name, outcomes), report=folder / REPORT_NAME)
            remove_run(folder)
    return RunResult(folder=folder, outcome=made.outcome, report=made.report, was_interrupted=driven.was_interrupted)


def _removed(folder: Path) -> Artefacts:
    """Return the figures of a run that nobody wants to keep, and remove its folder."""
    outcome = outcome_of(read_run(folder))
    remove_run(folder)
    return Artefacts(outcome=outcome, report=folder / REPORT_NAME)


def parts_of(chip: LeadingChip) -> list[Json]:
    """Return what each part on the board came to: its name, a line, and a picture (PNG, base64) where it has one."""
    found: list[Json] = []
    attached: AttachedParts | None = getattr(chip, "attached", None)
    for name, part in attached.by_name.items() if attached else ():
        row: Json = {"name": name, "words": part.words() if hasattr(part, "words") else ""}
        if hasattr(part, "picture"):
            picture = part.picture()
            row["png"] = base64.b64encode(picture.png(picture.scale())).decode()
        found.append(row)
    return found


def why_failed(bench: Bench | RemoteBench, failures: Sequence[str]) -> str:
    """Return why a bench that has run has failed, in a line; empty where no entry point of `EXPLAINERS` finds it."""
    if isinstance(bench, RemoteBench):
        return ""
    explainers = (cast("Callable[..., str]", loaded(one)) for one in installed_points(EXPLAINERS).values())
    ended = replace(bench.record(), end={"failures": list(failures)})
    return next((line for one in explainers if (line := one(ended, bench.scenario.firmware))), "")


def _figures(bench: Bench | RemoteBench, end: Nanos, wall_s: float) -> Json:
    recorder, virtual_s = held(bench).recorder, end / NS_PER_S
    clearance = recorder.min_clearance_m
    return {
        "virtual_s": virtual_s,
        "wall_s": round(wall_s, 3),
        "real_time_factor": round(virtual_s / wall_s, 2) if wall_s > 0 else None,
        "distance_m": round(recorder.distance_m, 6),
        "usart_baud": bench.chip.usart1.measured_baud,
        "collisions": None if recorder.last_state is None else recorder.last_state.collisions,
        "min_clearance_m": None if clearance is None else round(clearance, 6),
    }


def notes(bench: Bench | RemoteBench, end: Nanos, pacer: RealTimePacer | None) -> list[str]:
    """Return what a reader of the result should know besides the verdict."""
    chip = bench.chip
    result = [note for note in (held(bench).note,) if note]
    if chip.verdict and not chip.has_died:
        result.append(chip.verdict)
    result += chip.warnings
    if is_quiet(bench, end):
        seen = _last_seen_ns(bench)
        result.append(f"no pin, USART or WFI was seen since {seen / NS_PER_S:.3f} s; the program is at {chip.where()}")
    if pacer is not None and pacer.worst_lag_ns > PACED_SLICE_NS:
        result.append(f"the run lagged behind the wall clock by up to {pacer.worst_lag_ns / NS_PER_MS:.0f} ms")
    return result


def last_blocks(bench: Bench | RemoteBench, end: Nanos, *, passed: bool) -> list[str]:
    """Return what the program ran last, where that may show why a run failed: at a fault, or where it hangs."""
    wanted = bench.chip.has_died or (is_quiet(bench, end) and not passed)
    return list(bench.chip.last_blocks()) if wanted else []


def is_quiet(bench: Bench | RemoteBench, end: Nanos) -> bool:
    """Tell whether a program without a fault shows no activity."""
    return not bench.chip.has_died and end - _last_seen_ns(bench) >= QUIET_NS


def _last_seen_ns(bench: Bench | RemoteBench) -> Nanos:
    activity = bench.chip.activity
    return max(activity.last_pin_ns, activity.last_usart_ns, activity.last_wfi_ns)
