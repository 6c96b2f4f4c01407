"""What verbs print and write of folders of runs, of one robot and of several, and of scenarios; and how runs end."""

import json
import zlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from random import Random
from types import SimpleNamespace
from typing import Any
from unittest import mock

from p2os.cli.main import run as p2os
from robot_bench.cli import report
from robot_bench.cli import run as run_verb
from robot_bench.cli.sweep import SweepResult, SweepRow
from robot_bench.events.codec import line_of
from robot_bench.events.kinds import Event, PinEdge, Wave
from robot_bench.run import RunResult
from robot_bench.scenario.loading import load_scenario
from robot_bench.scenario.scenario import Scenario
from tests.robot_bench.cli.walks.printed import in_folder, printed, result_of
from tests.robot_bench.firmware import thumb
from tests.robot_bench.recording.long_run import META, MORE, long_run
from tests.robot_bench.recording.records import S
from tests.tools.suite.approved import judge_of, said

LAST_S = 4
VERBS = """\
report run
report run --json
report cut
report run --events out.jsonl
report run --events out.txt
report both --events all.jsonl
report both
report run --ros2 mcap
report both --ros2 mcap --events bag
report run --ros2 none --events bag
report run --ros2 kept --events bag
metrics run other
metrics run --json
metrics run other --picture a.png
metrics empty
diff run run
diff run other
diff run cut
diff both both
diff both turned
compare run other
compare run other --json --shift 0.1s
compare run run --poses truth,odometry
compare run run --poses truth,truth
compare run run --poses truth,truth,truth
compare run run --poses here
compare run other --align least-squares --delta 500ms --tum ways
compare run other --align none --at moves --html page.html
compare run other --tum ways
explain run
explain run --json
explain cut/trace.jsonl
explain other/trace.jsonl goals.toml
explain run goals.toml distance --json
explain run goals.toml nothing
explain both
explain both --json
explain both --firmware x.elf
explain both --against x.elf
explain run --firmware none.elf
explain run --against run
explain empty
explain goals.toml
check goals.toml
check swept.toml
check goals.toml wrong.toml swept.toml
check goals.toml --firmware other.bin
""".splitlines()
GOALS = """\
firmware = "x.bin"
world = "room"
duration_s = 4
body = "kinematic"
[[goal]]
kind = "min_distance"
distance_m = 30
[[goal]]
kind = "no_collision"
"""
SWEPT = 'seeds = "0-2"\n' + GOALS + "[sweep]\nthreshold_m = [0.4, 0.5]\n"


def write_run(place: Path, seed: int, *, late_ns: int = 0, is_whole: bool = True, **meta: object) -> None:
    """Write the folder of a run of some seconds, that failed, or that was cut."""
    events: list[Event] = [
        replace(one, t=one.t + late_ns * (one.t > S)) for one in long_run(seed) if one.t < LAST_S * S
    ]
    nets = {one.wire for one in events if isinstance(one, PinEdge)}
    events = [one for one in (*MORE, *events) if not isinstance(one, Wave) or one.wire in nets]
    events.sort(key=lambda one: one.t)
    head = {"k": "meta", "scenario": "mine", "mode": "adapter", "body": "kinematic", "seed": seed, **META, **meta}
    end = {
        "k": "end", "passed": False, "goals_met": ["a"], "failures": ["b: missed", "c: 3 m not driven"], "notes": ["n"],
        "goals_not_judged": ["d"], "min_clearance_m": 0.25, "distance_m": 1.5, "collisions": 1, "virtual_s": 4.0,
        "wall_s": 0.5, "real_time_factor": 8.0, "trace_sha256": "ab" * 8, "last_blocks": [],
    }  # fmt: skip
    place.mkdir(parents=True)
    lines = [json.dumps(head), *map(line_of, events), *([json.dumps(end)] if is_whole else [])]
    (place / "trace.jsonl").write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")


def made_in(folder: Path, before: dict[str, tuple[int, int]]) -> tuple[list[str], dict[str, tuple[int, int]]]:
    """Return which files have come or changed, those that are short with their text; and how all are now."""
    now = {}
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            data = path.read_bytes()
            now[str(path.relative_to(folder))] = len(data), zlib.crc32(data)
    lines = []
    for name in (one for one in now if now[one] != before.get(one)):
        # The page's scripts, which are none of the bench's, are in it.
        is_shown = name.endswith((".jsonl", ".tum", ".json", ".txt"))
        lines.append(f"{name} {now[name] if is_shown else ''}")
    return lines, now


def folders(_draw: Random) -> Iterator[str]:
    """Give verbs folders of runs."""
    with in_folder() as folder:
        write_run(folder / "run", 5)
        write_run(folder / "other", 5, late_ns=7_000_000)
        write_run(folder / "cut", 6, is_whole=False)
        for name, first in (("both", 5), ("turned", 7)):
            write_run(folder / name / "west", first, robots=["west", "east"])
            write_run(folder / name / "east", 6, late_ns=1, robots=["west", "east"])
        (folder / "empty").mkdir()
        for name in ("x.bin", "other.bin"):
            (folder / name).write_bytes(thumb.SLEEP)
        for name, text in (("goals.toml", GOALS), ("swept.toml", SWEPT), ("wrong.toml", GOALS.replace("room", "rm"))):
            (folder / name).write_text(text, encoding="utf-8")
        _, now = made_in(folder, {})
        points = {"kept": SimpleNamespace(name="kept", load=lambda: lambda *given: len([*given[0]]) + len(given[3]))}
        with (
            mock.patch("robot_bench.report.make._plots", return_value=None),
            mock.patch.object(report, "installed_points", return_value=points),
            mock.patch.object(report, "loaded", lambda point: point.load()),
        ):
            for line in VERBS:
                yield f"$ {line}"
                yield from (row.replace(str(folder), "HERE") for row in printed(p2os, line.split()))
                made, now = made_in(folder, now)
                yield from made
            with mock.patch.object(report, "installed_points", return_value={}):
                yield from printed(p2os, ["report", "run", "--ros2", "mcap", "--events", "bag"])


def ends(draw: Random) -> Iterator[str]:
    """End sweeps and runs at a port: passed, failed, interrupted, as text and as JSON, with a file for CI or none."""
    dodge = load_scenario("dodge")
    rows = [
        SweepRow(replace(dodge, seed=seed), (("threshold_m", 0.4),), f"p2os run dodge --seed {seed}") for seed in (0, 1)
    ]
    with in_folder() as folder, mock.patch.object(run_verb, "core_count", return_value=7):
        for failures in ([], ["no_collision: it hit"]):
            for interrupted in (False, True):
                outcomes = [dict(result_of(passed=not failures, failures=failures).outcome) for _ in rows]
                asked: list[str] = []

                def sweep(
                    given: object,
                    out: Path | None,
                    *,
                    done: Any = (outcomes, interrupted),
                    asked: Any = asked,
                    **named: Any,
                ) -> SweepResult:
                    named.pop("raise_if_interrupted")()
                    asked.append(said([given == rows, out, named]))
                    return SweepResult(rows, done[0], was_interrupted=done[1], folder=Path("runs"))

                junit = Path("r.xml") if draw.random() < 0.7 else None
                with mock.patch.object(run_verb, "run_sweep", sweep):
                    yield from printed(
                        run_verb.run_many, rows, Path("o"), jobs=draw.choice((None, 2)), kept="failures", junit=junit,
                        json_output=bool(failures), force=interrupted,
                    )  # fmt: skip
                yield said([asked, [path.name for path in folder.iterdir()]])
                for path in folder.iterdir():
                    yield path.read_text(encoding="utf-8")
                    path.unlink()
        for kept in ("none", "some"):
            yield from printed(
                run_verb.run_many, rows, None, jobs=1, kept=kept, junit=Path("no/x"), json_output=False, force=False
            )
        yield from at_ports(folder)


def at_ports(folder: Path) -> Iterator[str]:
    """Drive robots at ports, of which a person says whether they may move: what is asked, held, shown and closed."""
    dodge = load_scenario("dodge")
    calls: list[str] = []

    def noted(words: str, answer: Any = None) -> Any:
        """Return what notes that it is called, and answers."""

        def note(*given: object, **named: object) -> Any:
            calls.append(f"{words}{said([one for one in given if isinstance(one, str)])}{said(named)}")
            return answer

        return note

    port, keys, display = SimpleNamespace(close=noted("close")), mock.MagicMock(), mock.MagicMock()
    keys.return_value.__enter__.return_value = noted("keys")
    shown = display.return_value.__enter__.return_value
    shown.update, shown.raise_if_interrupted = noted("shown"), print

    def run(scenario: Scenario, out: Path, transport: object, **named: Any) -> RunResult:
        named.pop("on_progress")(None)
        calls.append(said([scenario.name, scenario.adapter.max_velocity_mm_s, out, transport is port, named]))
        return result_of()

    with (
        mock.patch.object(run_verb, "open_url", noted("open", port)), mock.patch.object(run_verb, "run_at_port", run),
        mock.patch.object(run_verb, "RunDisplay", display), mock.patch.object(run_verb, "any_key_stops", keys),
        mock.patch("p2os.cli.held_robot.hold_robot", noted("held")),
        mock.patch("robot_bench.cli.debugging.gdb.debug_port", lambda port, **_: f"gdb {port}"),
    ):  # fmt: skip
        for yes, answer in ((True, False), (False, True), (False, False)):
            for gdb, out in ((None, None), (3333, Path("there"))):
                with mock.patch("typer.confirm", noted("asked", answer)):
                    yield from printed(
                        run_verb.drive_port, dodge, out, "tcp:x", yes=yes, max_speed_mps=0.1, gdb=gdb, force=yes
                    )
                yield said(calls).replace(str(folder), "HERE")
                calls.clear()
    yield said([run_verb._is_number(word) for word in ("1", "x", "1e3", "", "-2.5", "1 m")])


TRACES = {"ends": ends, "folders": folders}
test_what_verbs_make_of_folders_is_what_was_approved = judge_of(__file__, TRACES)
