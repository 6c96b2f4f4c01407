"""The run of the unchanged program that mutants are held against: what it executes, and where they can branch off.

The bench runs once in steps, observed. At the beginning of each step that runs an instruction for the first time its
state is kept: a mutant of that instruction is the same run until then, so it begins there.

Invariant: a run that goes on from a kept state gives the trace of one from the reset.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

from bluepill_sim.analysis.coverage import Coverage
from bluepill_sim.analysis.observation import Observation
from bluepill_sim.board import BluePill
from bluepill_sim.program.line_table import read_lines
from bluepill_sim.program.static_code import StaticCode
from p2os.transport.wall_clock import Clock
from robot_bench.bench import Bench
from robot_bench.scenario.scenario import Scenario
from simbase.errors import UsageError
from simbase.timing import Nanos

#: chosen: fine enough that a mutant skips most of what it shares, and few states to keep.
STEPS = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class BaseRun:
    """A run, and the bench that can go back into it."""

    bench: Bench
    trace_sha256: str
    #: Instruction → the time of the newest kept state before it first ran.
    first_ns: dict[int, Nanos]
    #: Time → state of the bench.
    states: dict[Nanos, object]
    coverage: Coverage
    #: How long it was, and what it took, in nanoseconds of the clock given.
    ran_ns: Nanos
    cost_ns: int

    @property
    def board(self) -> BluePill:
        """The chip that runs the program."""
        return cast("BluePill", self.bench.chip)


def base_run(
    scenario: Scenario, clock: Clock, look: Callable[[], None] = lambda: None, *, is_sound: bool = True
) -> BaseRun:  # fmt: skip
    """Run a scenario with its own program.

    Args:
        scenario: One robot, with goals.
        clock: What the cost is measured by.
        look: Called between steps; may raise to end it.
        is_sound: Whether it has to meet all goals.

    Raises:
        UsageError: It has several robots or no goals, or misses a goal that it has to meet: then no mutant can be told
            from it.
        P2osError, BluePillError: As of `Bench`.
    """
    if scenario.robots:
        raise UsageError(f"{scenario.name} has several robots: mutants run alone", hint="leave out [[robot]]")
    if not scenario.goals:
        raise UsageError(f"{scenario.name} has no goals, so it can notice nothing", hint="add a [[goal]]")
    began = clock()
    bench = Bench(scenario)
    board = cast("BluePill", bench.chip)
    coverage = Coverage(board.image, read_lines(board.image), StaticCode(board.chip.memory))
    first_ns: dict[int, Nanos] = {}
    states: dict[Nanos, object] = {}
    step = max(1, -(-scenario.duration_ns // STEPS))
    while bench.now < bench.end:
        look()
        at, state = bench.now, bench.snapshot()
        with Observation(board, [coverage]):
            bench.run_until(at + step)
        new = coverage.instructions().keys() - first_ns.keys()
        if new:
            states[at] = state
            first_ns |= dict.fromkeys(new, at)
        if bench.now == at:  # a goal has ended it
            break
    judged = bench.judge()
    failures = [*([board.verdict] if bench.chip.has_died else []), *judged.missed]
    if failures and is_sound:
        raise UsageError(
            f"{scenario.name} fails with the program itself: {failures[0]}",
            hint="p2os run shows it; mend that first",
        )
    return BaseRun(
        bench=bench, trace_sha256=bench.trace.sha256, first_ns=first_ns, states=states, coverage=coverage,
        ran_ns=max(bench.now, 1), cost_ns=clock() - began,
    )  # fmt: skip
