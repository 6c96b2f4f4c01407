"""The test bench: a firmware on an emulated BluePill, in a robot, in a world.

    from robot_bench import Bench

    bench = Bench.from_scenario("dodge", firmware="mine.elf")
    bench.run_until("20 s")
    print(bench.pose, bench.level("PB12"), bench.text)

It is the composition root: wires, run loop, scenarios, recordings and reports.
Names are fetched on first use.
"""

from typing import TYPE_CHECKING

from simbase.lazy import lazily

if TYPE_CHECKING:
    from robot_bench.bench import Bench, BenchParts
    from robot_bench.events.codec import events_of
    from robot_bench.events.expectation import ExpectationError
    from robot_bench.events.kinds import Event
    from robot_bench.recording.run_record import RunRecord, read_run
    from robot_bench.remote import RemoteBench
    from robot_bench.report.make import Files
    from robot_bench.run import RunResult, run_at_port, run_scenario
    from robot_bench.scenario.goals.judging import Goal, Judgement
    from robot_bench.scenario.goals.watch import GoalKind, GoalOutcome, Watch
    from robot_bench.scenario.loading import known_scenarios, load_scenario
    from robot_bench.scenario.scenario import Scenario

    __version__: str

__all__ = [
    "Bench",
    "BenchParts",
    "Event",
    "ExpectationError",
    "Files",
    "Goal",
    "GoalKind",
    "GoalOutcome",
    "Judgement",
    "RemoteBench",
    "RunRecord",
    "RunResult",
    "Scenario",
    "Watch",
    "events_of",
    "known_scenarios",
    "load_scenario",
    "read_run",
    "run_at_port",
    "run_scenario",
]

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazily(
        __name__,
        {
            "robot_bench.bench": ("Bench", "BenchParts"),
            "robot_bench.events.codec": ("events_of",),
            "robot_bench.events.kinds": ("Event",),
            "robot_bench.events.expectation": ("ExpectationError",),
            "robot_bench.recording.run_record": ("RunRecord", "read_run"),
            "robot_bench.remote": ("RemoteBench",),
            "robot_bench.report.make": ("Files",),
            "robot_bench.run": ("RunResult", "run_at_port", "run_scenario"),
            "robot_bench.scenario.goals.judging": ("Goal", "Judgement"),
            "robot_bench.scenario.goals.watch": ("GoalKind", "GoalOutcome", "Watch"),
            "robot_bench.scenario.loading": ("known_scenarios", "load_scenario"),
            "robot_bench.scenario.scenario": ("Scenario",),
        },
    )
