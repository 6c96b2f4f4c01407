"""Runs a scenario into a run folder: the functions behind `p2os run`.

The trace is written while the run goes on; when the run ends, however it ends,
the goals are judged from it and everything else in the folder is made from it.

Invariant: whatever raises in between, the trace is closed and readable.
"""

import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from p2os.errors import P2osError
from p2os.timing import NS_PER_MS, NS_PER_S, Nanos
from p2os.transport import Transport
from p2os.transport.wall_clock import Clock, wall_clock
from testbench.artefacts import make_artefacts
from testbench.bench import Bench
from testbench.goals import judge
from testbench.pacer import PACED_SLICE_NS, Pacer
from testbench.remote import RemoteBench
from testbench.report.run_record import Json, read_run
from testbench.run_folder import meta_of, prepare_folder
from testbench.scenario import Scenario
from testbench.trace import TRACE_NAME, TraceWriter

#: chosen: without pacing, control comes back often enough for progress and signals.
UNPACED_SLICE_NS: Nanos = 10 * NS_PER_MS
#: Nothing seen of the firmware for so long at the end of a run is worth a word: it spins, or has died quietly.
QUIET_NS: Nanos = 1 * NS_PER_S


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress:
    """Where a run stands."""

    now: Nanos
    duration_ns: Nanos
    #: Returns what the robot is doing, in a few words.
    doing: Callable[[], str]


#: Runs a bench to its end, however it likes.
Driver = Callable[[Bench], None]
RemoteDriver = Callable[[RemoteBench], None]
_AnyBench = TypeVar("_AnyBench", Bench, RemoteBench)
ProgressListener = Callable[[Progress], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class RunResult:
    """A run that came to an end."""

    folder: Path
    outcome: Json
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
    slice_ns: Nanos | None = None,
    speed: float | None = None,
    on_progress: ProgressListener | None = None,
    clock: Clock = wall_clock,
    drive: Driver | None = None,
) -> RunResult:
    """Run a scenario in virtual time and make its run folder.

    Args:
        scenario: What to run.
        folder: Where to; made where it is missing.
        slice_ns: How often the loop gives control back; without effect on the result.
        speed: Virtual seconds a wall second; None runs as fast as it can.
        on_progress: Called after each slice; a KeyboardInterrupt out of it ends the run in good order.
        clock: Wall clock in nanoseconds.
        drive: Runs the bench in place of its `run_until`; a debugger.

    Raises:
        P2osError: A file cannot be read, or a part is not installed.
    """
    prepare_folder(folder)
    pacer = None if speed is None else Pacer(speed=speed, clock=clock)
    with contextlib.closing(TraceWriter(folder / TRACE_NAME)) as trace:
        bench = Bench(scenario, trace=trace, slice_ns=slice_ns or (PACED_SLICE_NS if pacer else UNPACED_SLICE_NS))

        def after_slice(now: Nanos) -> None:
            if pacer is not None:
                pacer.keep_pace(now)
            if on_progress is not None:
                on_progress(Progress(now=now, duration_ns=scenario.duration_ns, doing=lambda: doing(bench)))

        bench.on_slice = after_slice
        trace.meta(meta_of(scenario, bench.parts.world, bench.note))
        return _record(bench, trace, folder, pacer, clock, drive)


def run_at_port(
    scenario: Scenario,
    folder: Path,
    transport: Transport,
    *,
    on_progress: ProgressListener | None = None,
    clock: Clock = wall_clock,
    drive: RemoteDriver | None = None,
) -> RunResult:
    """Drive the robot at a transport in real time (mode C), stop it, and make the run folder.

    The transport is closed in any case. A lost line, lag and a signal are failures of the run.

    With `drive`, a debugger runs the bench in place of its `run_until`.

    Raises:
        P2osError: A file cannot be read, or a part is not installed.
    """
    pacer = Pacer(clock=clock)
    with contextlib.ExitStack() as stack:
        stack.callback(transport.close)
        prepare_folder(folder)
        trace = stack.enter_context(contextlib.closing(TraceWriter(folder / TRACE_NAME)))
        bench = RemoteBench(scenario, transport, pacer, trace=trace)

        def after_slice(now: Nanos) -> None:
            if on_progress is not None:
                on_progress(Progress(now=now, duration_ns=scenario.duration_ns, doing=lambda: doing(bench)))

        bench.on_slice = after_slice
        trace.meta(meta_of(scenario, None, bench.note))
        return _record(bench, trace, folder, pacer, clock, drive)


def doing(bench: Bench | RemoteBench) -> str:
    """Return what the robot is doing, in a few words."""
    state, text = bench.recorder.last_state, bench.recorder.last_line
    wheels = "" if state is None else f"{state.left_speed_mps * 1000:+.0f} / {state.right_speed_mps * 1000:+.0f} mm/s"
    return f"{wheels}  {text}".strip()


def _record(
    bench: _AnyBench,
    trace: TraceWriter,
    folder: Path,
    pacer: Pacer | None,
    clock: Clock,
    drive: Callable[[_AnyBench], None] | None,
) -> RunResult:
    """Run to the end, judge the goals, write the trace's last line, and make the rest of the folder."""
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
        failures.append(f"interrupted ({interruption})" if interruption.args else "interrupted")
    except P2osError as error:
        failures.append(str(error))
    end = bench.finish()
    wall_s = (clock() - began) / NS_PER_S
    if bench.chip.fault is not None:
        failures.append(f"firmware fault: {bench.chip.fault}")
    record = read_run(folder)
    met, missed = judge(record, bench.scenario.goals)
    trace.end(
        _figures(bench, end, wall_s)
        | {
            "trace_sha256": trace.sha256,
            "passed": not failures and not missed,
            "failures": failures + missed,
            "goals_met": met,
            "notes": notes(bench, end, pacer),
            "last_blocks": last_blocks(bench, end, was_interrupted=was_interrupted),
            "worst_lag_ms": None if pacer is None else round(pacer.worst_lag_ns / NS_PER_MS, 1),
        }
    )
    made = make_artefacts(folder)
    return RunResult(folder=folder, outcome=made.outcome, report=made.report, was_interrupted=was_interrupted)


def _figures(bench: Bench | RemoteBench, end: Nanos, wall_s: float) -> Json:
    recorder, virtual_s = bench.recorder, end / NS_PER_S
    clearance = recorder.min_clearance_m
    return {
        "virtual_s": virtual_s,
        "wall_s": round(wall_s, 3),
        "real_time_factor": round(virtual_s / wall_s, 2) if wall_s > 0 else None,
        "distance_m": round(recorder.distance_m, 6),
        "collisions": None if recorder.last_state is None else recorder.last_state.collisions,
        "min_clearance_m": None if clearance is None else round(clearance, 6),
    }


def notes(bench: Bench | RemoteBench, end: Nanos, pacer: Pacer | None) -> list[str]:
    """Return what a reader of the result should know besides the verdict."""
    chip = bench.chip
    result = [note for note in (bench.note,) if note]
    result += chip.warnings
    if is_quiet(bench, end):
        seen = _last_seen_ns(bench)
        result.append(f"no pin, USART or WFI was seen since {seen / NS_PER_S:.3f} s; the program is at {chip.where()}")
    if pacer is not None and pacer.worst_lag_ns > PACED_SLICE_NS:
        result.append(f"the run lagged behind the wall clock by up to {pacer.worst_lag_ns / NS_PER_MS:.0f} ms")
    return result


def last_blocks(bench: Bench | RemoteBench, end: Nanos, *, was_interrupted: bool) -> list[str]:
    """Return what the program ran last, where that tells why it ended: it died, it hangs, or somebody had enough."""
    wanted = was_interrupted or bench.chip.fault is not None or is_quiet(bench, end)
    return list(bench.chip.last_blocks()) if wanted else []


def is_quiet(bench: Bench | RemoteBench, end: Nanos) -> bool:
    """Tell whether a program that has not died gives no sign of life."""
    return bench.chip.fault is None and end - _last_seen_ns(bench) >= QUIET_NS


def _last_seen_ns(bench: Bench | RemoteBench) -> Nanos:
    activity = bench.chip.activity
    return max(activity.last_pin_ns, activity.last_usart_ns, activity.last_wfi_ns)
