"""Runs a scenario into a run folder: the function behind `p2os run`.

The trace is written while the run goes on; when the run ends, however it ends,
the goals are judged from it and everything else in the folder is made from it.

Invariant: whatever raises in between, the trace is closed and readable.
"""

import contextlib
import hashlib
import math
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from p2os.errors import UsageError
from p2os.pioneer.scenery import World
from p2os.timing import NS_PER_MS, NS_PER_S, Nanos
from testbench.artefacts import Artefacts, make_artefacts
from testbench.bench import Bench
from testbench.goals import judge
from testbench.outcome import SUMMARY_NAME
from testbench.pacer import Clock, Pacer, wall_clock
from testbench.report.run_record import Json, read_run
from testbench.scenario import Scenario
from testbench.trace import TRACE_NAME, TraceWriter

#: chosen: without pacing, control comes back often enough for progress and Ctrl-C.
UNPACED_SLICE_NS: Nanos = 10 * NS_PER_MS
PACED_SLICE_NS: Nanos = 2 * NS_PER_MS
#: Nothing seen of the firmware for so long at the end of a run is worth a word: it spins, or has died quietly.
QUIET_NS: Nanos = 1 * NS_PER_S


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress:
    """Where a run stands."""

    now: Nanos
    duration_ns: Nanos
    #: What the robot is doing, in a few words.
    doing: str


@dataclass(frozen=True, slots=True, kw_only=True)
class RunResult:
    """A run that came to an end."""

    folder: Path
    outcome: Json
    report: Path
    #: Ctrl-C ended it.
    was_interrupted: bool

    @property
    def passed(self) -> bool:
        """Whether every goal was met and nothing failed."""
        return bool(self.outcome["passed"])


def run_scenario(
    scenario: Scenario,
    folder: Path,
    *,
    slice_ns: Nanos | None = None,
    speed: float | None = None,
    on_progress: Callable[[Progress], None] | None = None,
    clock: Clock = wall_clock,
) -> RunResult:
    """Run a scenario and make its run folder.

    Args:
        scenario: What to run.
        folder: Where to; made where it is missing.
        slice_ns: How often the loop gives control back; without effect on the result.
        speed: Virtual seconds a wall second; None runs as fast as it can.
        on_progress: Called after each slice; a KeyboardInterrupt out of it ends the run in good order.
        clock: Wall clock in nanoseconds.

    Raises:
        P2osError: A file cannot be read, or a part is not installed.
    """
    prepare_folder(folder)
    pacer = None if speed is None else Pacer(speed=speed, clock=clock)
    bench: Bench | None = None

    def after_slice(now: Nanos) -> None:
        if pacer is not None:
            pacer.keep_pace(now)
        if on_progress is not None and bench is not None:
            on_progress(Progress(now=now, duration_ns=scenario.duration_ns, doing=doing(bench)))

    trace = TraceWriter(folder / TRACE_NAME)
    with contextlib.closing(trace):
        bench = Bench(
            scenario,
            trace=trace,
            slice_ns=slice_ns or (UNPACED_SLICE_NS if pacer is None else PACED_SLICE_NS),
            on_slice=after_slice,
        )
        trace.meta(meta_of(scenario, bench.parts.world, bench.parts.body.note))
        began = clock()
        if pacer is not None:
            pacer.start(0)
        was_interrupted = _run_to_end(bench, scenario.duration_ns)
        end = bench.finish()
        wall_s = (clock() - began) / NS_PER_S
        artefacts = _close(bench, trace, folder, end, wall_s, pacer, was_interrupted=was_interrupted)
    return RunResult(folder=folder, outcome=artefacts.outcome, report=artefacts.report, was_interrupted=was_interrupted)


def prepare_folder(folder: Path) -> None:
    """Make a run folder, or clear one of an earlier run.

    Raises:
        UsageError: The folder holds something else.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"cannot make the run folder {folder}: {error.strerror}") from error
    if any(folder.iterdir()) and not (folder / TRACE_NAME).is_file():
        raise UsageError(f"{folder} holds something that is no run", hint="--out takes a new or an empty folder")
    for name in (TRACE_NAME, SUMMARY_NAME, "report.html", "pins.vcd", "pins.sr", "wire.jsonl", "usart.txt"):
        (folder / name).unlink(missing_ok=True)


def meta_of(scenario: Scenario, world: World, note: str | None) -> Json:
    """Return the trace's first line: what was run, where, with what robot."""
    parameters = scenario.parameters
    start = scenario.start or world.start
    return {
        "version": version("p2os"),
        "scenario": scenario.name,
        "description": scenario.description,
        "text": scenario.text,
        "firmware": scenario.firmware.name,
        "firmware_sha256": hashlib.sha256(scenario.firmware.read_bytes()).hexdigest(),
        "mode": scenario.mode,
        "body": scenario.body,
        "seed": scenario.seed,
        "duration_s": scenario.duration_ns / NS_PER_S,
        "threshold_m": scenario.threshold_m,
        "step_mps": (scenario.direct if scenario.mode == "direct" else scenario.adapter).step_um_per_s / 1e6,
        "note": note,
        "start": {"x": start.x_m, "y": start.y_m, "heading": start.heading_rad},
        "world": world.to_plain(),
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


def doing(bench: Bench) -> str:
    """Return what the robot is doing, in a few words."""
    state, text = bench.recorder.last_state, bench.recorder.last_line
    wheels = "" if state is None else f"{state.left_speed_mps * 1000:+.0f} / {state.right_speed_mps * 1000:+.0f} mm/s"
    return f"{wheels}  {text}".strip()


def _run_to_end(bench: Bench, end: Nanos) -> bool:
    """Run; return whether Ctrl-C ended it."""
    try:
        bench.run_until(end)
    except KeyboardInterrupt:
        return True
    return False


def _close(
    bench: Bench,
    trace: TraceWriter,
    folder: Path,
    end: Nanos,
    wall_s: float,
    pacer: Pacer | None,
    *,
    was_interrupted: bool,
) -> Artefacts:
    """Judge the goals, write the trace's last line, and make the rest of the folder."""
    recorder = bench.recorder
    met, failures = judge(read_run(folder), bench.scenario.goals)
    fault = fault_text(bench)
    if fault is not None:
        failures.insert(0, fault)
    if was_interrupted:
        failures.insert(0, f"interrupted at {end / NS_PER_S:.3f} s")
    virtual_s = end / NS_PER_S
    trace.end(
        {
            "virtual_s": virtual_s,
            "wall_s": round(wall_s, 3),
            "real_time_factor": round(virtual_s / wall_s, 2) if wall_s > 0 else None,
            "distance_m": round(recorder.distance_m, 6),
            "collisions": None if recorder.last_state is None else recorder.last_state.collisions,
            "min_clearance_m": None if recorder.min_clearance_m is None else round(recorder.min_clearance_m, 6),
            "trace_sha256": trace.sha256,
            "passed": not failures,
            "failures": failures,
            "goals_met": met,
            "notes": notes(bench, end, pacer),
            "worst_lag_ms": None if pacer is None else round(pacer.worst_lag_ns / NS_PER_MS, 1),
        }
    )
    return make_artefacts(folder)


def fault_text(bench: Bench) -> str | None:
    """Return what made the firmware stand still, or None."""
    fault = bench.parts.chip.fault
    return None if fault is None else f"firmware fault: {fault}"


def notes(bench: Bench, end: Nanos, pacer: Pacer | None) -> list[str]:
    """Return what a reader of the result should know besides the verdict."""
    chip = bench.parts.chip
    result = [note for note in (bench.parts.body.note,) if note]
    result += chip.warnings
    quiet_since = max(chip.activity.last_pin_ns, chip.activity.last_usart_ns, chip.activity.last_wfi_ns)
    if chip.fault is None and end - quiet_since >= QUIET_NS:
        result.append(
            f"no pin, USART or WFI was seen since {quiet_since / NS_PER_S:.3f} s; the program is at {chip.where()}"
        )
    if pacer is not None and pacer.worst_lag_ns > PACED_SLICE_NS:
        result.append(f"the run lagged behind the wall clock by up to {pacer.worst_lag_ns / NS_PER_MS:.0f} ms")
    return result
