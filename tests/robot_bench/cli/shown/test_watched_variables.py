"""Variables that a page watches: added while the run goes on and where it stands, after going back, in forks."""

import math
from pathlib import Path

import pytest

from p2os.view.recording import ViewRecording
from p2os.view.run_control import RunCommand, RunState
from robot_bench.bench import Bench
from robot_bench.cli.debugging.session import MOST_VARIABLES
from robot_bench.cli.shown.live_run import LiveRun
from robot_bench.recording.run_record import read_run
from robot_bench.report.make import Files
from robot_bench.run import run_scenario
from tests.robot_bench.firmware.hurried import hurried_scenario

SCENARIO = hurried_scenario("dodge", 1, mode="direct", body="kinematic", duration_s=0.5)
MS = 1_000_000


def rows(shown: ViewRecording, source: str = "", name: str = "ticks") -> list[tuple[int, float]]:
    track = next(one for one in shown.tracks if (one.header.source, one.header.name) == (source, name))
    return list(zip(track.times, track.column("value"), strict=True))  # type: ignore[arg-type]  # of numbers


@pytest.fixture(scope="module")
def alone() -> str:
    """Return the hash of the run that nobody looks at."""
    bench = Bench(SCENARIO)
    bench.run_until(bench.scenario.duration_ns)
    bench.finish()
    return str(bench.trace.sha256)


def test_a_variable_that_is_added_on_the_way_is_there_from_then_on_and_after_going_back_from_before(
    alone: str, tmp_path: Path
) -> None:
    live = LiveRun(SCENARIO, speed=0.0)
    asked = [
        RunCommand(do="go", at_ns=300 * MS), RunCommand(do="watch", words="ticks"),
        RunCommand(do="watch", words="no_such"), RunCommand(do="go", at_ns=400 * MS),
        RunCommand(do="go", at_ns=100 * MS), RunCommand(do="go", at_ns=200 * MS),
        RunCommand(do="fork", words=""), RunCommand(do="go", at_ns=250 * MS),
        RunCommand(do="choose", future="run"), RunCommand(do="run"),
    ]  # fmt: skip
    assert all(live.offer(one) for one in asked)
    folder = run_scenario(SCENARIO, tmp_path / "run", drive=live.drive, files=Files.SUMMARY).folder
    assert str(read_run(folder).end["trace_sha256"]) == alone
    assert (live.state.done, list(live.state.variables)) == (len(asked), ["ticks"])
    live.source.update()
    found = rows(live.source.recording)
    times = [t for t, _ in found]
    assert times == sorted(times)
    # It was seen from 100 ms on, and ticks each 10 ms; nothing is without a number but what lies before.
    assert 95 * MS <= times[0] <= 101 * MS
    assert not any(math.isnan(value) for _, value in found)
    counts = [value for _, value in found]
    assert counts == [counts[0] + n for n in range(len(counts))]
    assert times[-1] > 480 * MS
    fork = rows(live.source.recording, "fork 1")
    assert [row for row in fork if row[0] <= 250 * MS] == [row for row in found if row[0] <= 250 * MS]


def test_what_cannot_be_watched_is_said_and_names_are_offered(tmp_path: Path) -> None:
    live = LiveRun(SCENARIO, speed=0.0, variables=["head"])
    assert live.offered("dodge.turn_s") == ["main::dodge.turn_side"]
    asked = [RunCommand(do="go", at_ns=10 * MS), RunCommand(do="watch", words="tick"), RunCommand(do="run")]
    assert all(live.offer(one) for one in asked)
    troubles = []
    live._show = lambda state: troubles.append(state.trouble)  # type: ignore[method-assign]  # each of them
    run_scenario(SCENARIO, tmp_path / "run", drive=live.drive, files=Files.SUMMARY)
    assert "there is no variable 'tick' (did you mean 'ticks'?)" in troubles
    live.source.update()
    assert rows(live.source.recording, name="head")[0] == (0, 0.0)


def test_too_many_are_refused_and_one_that_is_taken_away_makes_room(tmp_path: Path) -> None:
    live = LiveRun(SCENARIO, speed=0.0, variables=[f"ring[{n}]" for n in range(MOST_VARIABLES)])
    words = [("watch", "ticks"), ("watch_not", "ring[3]"), ("watch", "ticks")]
    states = list[RunState]()
    live._show = states.append  # type: ignore[method-assign,assignment]  # each of them
    assert all(live.offer(RunCommand(do=do, words=name)) for do, name in words)  # type: ignore[arg-type]  # as a page has it
    live.offer(RunCommand(do="run"))
    run_scenario(SCENARIO, tmp_path / "run", drive=live.drive, files=Files.SUMMARY)
    assert any("32 variables are watched already" in one.trouble for one in states)
    assert "ring[3]" not in states[-1].variables
    assert "ticks" in states[-1].variables


def test_a_halt_at_a_part_of_a_variable_stands_where_it_is_written(tmp_path: Path) -> None:
    live = LiveRun(SCENARIO, speed=0.0)
    states = list[RunState]()
    live._show = states.append  # type: ignore[method-assign,assignment]  # each of them
    asked = [RunCommand(do="go", at_ns=1), RunCommand(do="halt_at", words="variable dodge.straight_ticks"),
             RunCommand(do="run")]  # fmt: skip
    assert all(live.offer(one) for one in asked)
    live._on_wait = lambda: (_ for _ in ()).throw(KeyboardInterrupt) if states[-1].halts and states[-1].why else None
    run_scenario(SCENARIO, tmp_path / "run", drive=live.drive, files=Files.SUMMARY)
    assert any(one.why == "variable dodge.straight_ticks" for one in states)
