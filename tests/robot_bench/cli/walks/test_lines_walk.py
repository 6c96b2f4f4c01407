"""Each line that verbs print of comparisons, metrics, fits and explanations that are made up, and how they end."""

import contextlib
import itertools
from collections.abc import Iterator
from pathlib import Path
from random import Random
from types import SimpleNamespace
from typing import Any
from unittest import mock

import numpy as np

from bluepill_sim.analysis.waveforms.alignment import Alignment, ChannelPair, Clock, Met, Tolerance
from bluepill_sim.analysis.waveforms.comparison import Jump, Miswired, PinComparison, Unexplained
from p2os.cli.main import run as p2os
from p2os.robots.parameters import load_parameters
from robot_bench.campaign.variants.fault_line import FaultLine
from robot_bench.cli import compare_pins, explain, sweep
from robot_bench.cli.experiments import compare, fit, metrics, validate
from robot_bench.cli.project import files as project_files
from robot_bench.drives.latency_budget import STEPS, WHOLE, LatencyBudget
from robot_bench.experiments import comparison_page
from robot_bench.experiments.fitting.least_squares import Estimate, Fit
from robot_bench.report import measures
from robot_bench.report.explain.chain import Explanation, Standing
from simbase.errors import FileError, UsageError
from tests.robot_bench.cli.walks.printed import in_folder, printed
from tests.tools.suite.approved import Trace, judge_of, rounded, said, tried


def unexplained(draw: Random) -> Unexplained:
    """Return an edge that a comparison does not explain, with and without what is known of it."""
    run_ns = draw.choice((0.0, 1.25e9))
    return Unexplained(
        channel="D1", pin="PA1", level=draw.randrange(2), is_added=draw.random() < 0.5, run_ns=run_ns,
        capture_ns=run_ns + draw.choice((0.0, 300.0)), other_level=draw.randrange(2),
        nearest=draw.choice((None, (run_ns - 0.5, 1), (run_ns + 0.5, 0), (run_ns + 2.5e3, 1), (run_ns, 0))),
        late_ns=draw.choice((None, 0.0, 0.5, -0.5, 1.5e6)), pulse_ns=draw.choice((None, 0.0, 999.0, 1000.0)),
        jump=draw.choice((None, None, Jump(0.5, 3, 4), Jump(-2e6, 3, 4), Jump(0.0, 1, 2))),
    )  # fmt: skip


def pins(draw: Random) -> Iterator[str]:
    """Print comparisons of pins with captures."""
    tracks = [ChannelPair(f"D{n}", f"PA{n}", [(n * 10.0, 1), (500.0, 0)], [(n * 10.0 + 3, 1), (503.5, 0)])
              for n in range(3)]  # fmt: skip
    for number in range(30):
        met = [Met(track, *draw.choice((([(0, 0)], [], []), ([], [1], [1]), ([(0, 0)], [], [1]), ([], [], []))))
               for track in tracks]  # fmt: skip
        limits = Tolerance(draw.choice((40.0, 1.5e6)), 1e-3, (0.0, 1e9), (0.0, 1e9))
        clock = Clock(draw.choice((0.0, -2.5e6)), draw.choice((0.0, 40e-6)), draw.choice((1e-6, 1e-3, 2e-3)))
        wires = [Miswired(channel="D0", pin="PA0", shows=draw.choice(("PA0", "PA3")), is_inverted=draw.random() < 0.5,
                          explained=7, of=8)] * draw.randrange(2)  # fmt: skip
        found = PinComparison(
            alignment=Alignment(clock, 3, draw.choice((None, 0.0, 0.5, -0.5, 2e9))), limits=limits, met=met,
            unjudged=draw.randrange(2), miswired=wires, unexplained=number,
            first=None if number % 5 == 0 else unexplained(draw),
        )  # fmt: skip
        seen: Any = SimpleNamespace(
            name="board.csv", start_ns=1e6, end_ns=5e9, sample_ns=draw.choice((41.67, 1e3, 2e6)),
            rate_from=draw.choice(("", "the times")),
        )  # fmt: skip
        model: Any = SimpleNamespace(name="run", start_ns=1.0, end_ns=2.5e9)
        yield from map(rounded, compare_pins._lines(found, model, seen))
        yield said([compare_pins._title(found), compare_pins._plain(found, seen)])
    yield said([compare_pins._length(ns) for ns in (0.0, 0.12345, 999.99, 1e3, 1e6 - 1, 1e6, 1e9, 12.3456789e9)])
    yield said([compare_pins._late(ns) for ns in (None, 0.0, 0.5, -1.0, 1e6)])
    for words in (["D0=PB7"], ["a=b=PA1", "D1 = motor1_comm1"], ["D0="], ["=PA0"], ["D0"], ["D0=PA0", "D0=PA1"]):
        yield tried(compare_pins._declared, words, {"motor1_comm1": "PB9"})
    yield said([tried(compare_pins._rate, words) for words in ("", "24MHz", "1k", "fast", "-3")])


def compared_pins(draw: Random) -> Iterator[str]:
    """Ask for comparisons of pins: what is asked of them, drawn, printed, and how it ends."""
    calls: list[object] = []
    model: Any = SimpleNamespace(name="run", start_ns=0.0, end_ns=1e9, signals={"PA1": 1, "PB9": 2})
    seen: Any = SimpleNamespace(name="board.csv", start_ns=0.0, end_ns=1e9, sample_ns=10.0, rate_from="",
                                signals={"Con": 1, "con2": 2, "D3": 3})  # fmt: skip
    clock = Clock(0.0, 0.0, 1e-6)
    place = "bluepill_sim.analysis.waveforms"
    for words in ("", "--json", "--wire D3=PA1 --rate 24MHz", "--ppm 0 --jitter 2.5", "--ppm 25000"):
        for count in (0, 2):
            found = PinComparison(
                alignment=Alignment(clock, 3, None), limits=Tolerance(40.0, 1e-3, (0.0, 1e9), (0.0, 1e9)), met=[],
                unjudged=0, miswired=[], unexplained=count, first=unexplained(draw) if count else None,
            )  # fmt: skip

            def compare_(*given: object, found: PinComparison = found, **named: object) -> PinComparison:
                calls.append([given[2], named])
                return found

            with (
                mock.patch.object(compare_pins, "_model", return_value=(model, {"con": "PA1", "con2": "PC7"})),
                mock.patch(f"{place}.reading.read_waveforms", lambda *given: calls.append(given) or seen),
                mock.patch(f"{place}.comparison.wires_of", lambda *given: given[2]),
                mock.patch(f"{place}.comparison.compare_pins", compare_),
            ):
                yield from printed(p2os, ["compare-pins", "run", "board.csv", *words.split()])
            yield said([words, calls])
            calls.clear()


def measured(draw: Random) -> Iterator[str]:
    """Print metrics of drives, with all that is known, and with nothing."""
    for number in range(12):
        steps = {name: [draw.uniform(0, 0.3) for _ in range(draw.choice((0, 0, 1, 5)) * (number % 3))]
                 for name in (*STEPS, WHOLE)}  # fmt: skip
        goals = tuple(
            (draw.choice(("reach", "no_collision " * 9, "x" * 58, "y" * 59, "x" * 60)),
             draw.choice((None, True, False)), draw.choice((None, 0.0, 1234.567)))
            for _ in range(number % 4)
        )  # fmt: skip
        values = {name: draw.choice((None, 0.0, -0.123456, 98765.4321)) for name in metrics_names()}
        found: Any = SimpleNamespace(name=f"d{number}", goals=goals, latency=LatencyBudget(steps), **values)
        yield from metrics.lines_of(found)
        yield said(measures._latency(found))
    with mock.patch("robot_bench.experiments.pictures.write_png", side_effect=ValueError("drawn")):
        yield tried(metrics._draw, found, Path("a.png"))
        found.latency = LatencyBudget()
        yield tried(metrics._draw, found, Path("a.png"))


def metrics_names() -> list[str]:
    from robot_bench.drives.metrics import SHOWN

    return [*SHOWN]


def compared(draw: Random) -> Iterator[str]:
    """Print how drives part: not at all, in their motion, and in what does not move."""

    def figures() -> Any:
        return SimpleNamespace(**{name: draw.uniform(0, 2) for name in ("rmse", "mean", "median", "std", "max")})

    for number in range(16):
        parts: Any = [
            SimpleNamespace(
                signal=name, kind=kind,
                largest=draw.uniform(0, 1), largest_s=draw.uniform(0, 9), rms=draw.uniform(0, 1),
                parts_s=draw.choice((None, 1.0, 2.5)), ours=draw.uniform(0, 1), theirs=2.0,
                bound=SimpleNamespace(stage=stage, unit=draw.choice(("", "m"))),
            )
            for name, kind, stage in (
                ("sonar 3", "sonar", "sensor"), ("sonar 4", "sonar", "sensor"), ("left", "motion", "wheels"),
                *((f"pin {n}", "pin", "firmware") for n in range(6)))
        ][number % 3:]  # fmt: skip
        way = SimpleNamespace(path_m=draw.uniform(0, 9), t_s=[0.125, 9.875], __len__=lambda: 2)
        found: Any = SimpleNamespace(
            pose=(0.1, -0.2, draw.uniform(-3, 3)), shift_s=draw.uniform(-1, 1), how=SimpleNamespace(align="first"),
            one=SimpleNamespace(name="a"), other=SimpleNamespace(name="b"), ours=Way(way), theirs=way,
            step_s=draw.uniform(0.5, 1.5), parts=parts, origin=draw.choice((None, (parts[0], 1.0))),
            **{name: figures() for name in ("ape_m", "ape_rad", "rpe_m", "rpe_rad", "speed_mps", "turn_radps")},
            latency_s=tuple(np.array([draw.uniform(0, 1) for _ in range(draw.randrange(4))]) for _ in range(2)),
        )  # fmt: skip
        with mock.patch("robot_bench.experiments.parting.motion_parts_s", return_value=draw.choice((None, 1.5))):
            yield from compare.lines_of(found)
    for words in ("auto", "truth,odometry", "odometry,truth,auto", "here", "truth,", "truth,here"):
        yield tried(compare._which, words)


class Way:
    """A way that has poses."""

    def __init__(self, way: Any) -> None:
        self.path_m, self.t_s = way.path_m, way.t_s

    def __len__(self) -> int:
        return 77


def fitted(draw: Random) -> Iterator[str]:
    """Fit drives, whose fits are made up or refuse; write examples and squares."""
    estimates = {name: Estimate(name=name, value=1.0, low=0.5, high=1.75) for name in [*fit.SHOWN][:2]}
    one = Fit(estimates=estimates, unseen={}, residual=0.5, count=9)
    calls: list[str] = []

    def fits(name: str) -> Any:
        def made(*given: Any) -> Fit:
            calls.append(f"{name} {len(given)}")
            kind = draw.choice((None, None, FileError, UsageError))
            if kind is not None:
                raise kind(f"{name} cannot", hint="another")
            return one

        return made

    drives: Any = [SimpleNamespace(meta=meta, parameters=SimpleNamespace(subclass=kind), truth=None)
                   for meta, kind in (({}, "p2dx"), ({"world": {"name": "arena"}}, "odd"))]  # fmt: skip
    umbmark: Any = SimpleNamespace(as_plain=lambda: {"squares": 2})
    place = "robot_bench.experiments.fitting"
    with (
        in_folder() as folder, mock.patch.object(fit, "require"),
        mock.patch(f"{place}.clocks.on_one_clock", lambda given: (given, "")),
        mock.patch(f"{place}.wheels.fit_wheels", fits("wheels")), mock.patch(f"{place}.ramps.fit_ramps", fits("ramps")),
        mock.patch(f"{place}.sonar.fit_sonar", fits("sonar")),
        mock.patch(f"{place}.sonar.walls_of", lambda world, _: calls.append(world.name)),
        mock.patch(f"{place}.umbmark.umbmark", lambda given: umbmark if len(given) == 2 else None),
        mock.patch(f"{place}.robot_files.robot_text", lambda *given: said(given[0::2])),
        mock.patch(f"{place}.robot_files.errors_text", lambda *given: said(given[1])),
        mock.patch(f"{place}.examples.write_examples", lambda *given: [given[0], given[1].name, given[2]]),
        mock.patch.object(fit, "_umbmark_lines", lambda found: [said(found.as_plain())]),
    ):  # fmt: skip
        Path("full").mkdir()
        Path("full", "x").touch()
        for words in ("a b", "a b --json", "a b --world room", "a b --umbmark", "a b --umbmark --json", "a b --out c",
                      "a b --out c", "--example e", "--example e --seed 4 --world room", "--example full",
                      "--example full --force", "b a --out d", ""):  # fmt: skip
            given = drives[::-1] if words.startswith("b") else drives
            with mock.patch.object(fit, "_drives", return_value=given):
                for line in printed(p2os, ["fit", *words.split()]):
                    yield line.replace(str(folder), "HERE")
            yield said([calls, sorted(path.name for path in folder.iterdir())])
            calls.clear()
        for name in ("c", "c-errors"):
            with contextlib.suppress(OSError):
                yield Path(f"{name}.toml").read_text(encoding="utf-8")
        for _ in range(8):
            yield tried(
                lambda: {name: str(found) for name, found in fit._fits(drives[:1], draw.choice(("", "room"))).items()}
            )


LINES = (FaultLine(line="a.c:3", says="there alone", also=("it hit",)), FaultLine(line="", says="in many places"))


def found_of(standing: Standing) -> Explanation:
    return Explanation(failure="it hit", standing=standing, summary="so", also=("a",), limits=("b",))


def explained(_draw: Random) -> Iterator[str]:
    """Explain runs, whose causes are made up, with a version that passes."""
    with in_folder() as folder:
        Path("run").mkdir()
        Path("trace.jsonl").touch()
        Path("good.elf").touch()
        for standing in Standing:
            for line in (*LINES, UsageError("it passes"), FileError("none")):
                for run in ("run", "trace.jsonl"):
                    for firmware in (None, Path("mine.elf")):
                        calls: list[object] = []

                        def of_run(*given: Any, calls: list[object] = calls, **named: Any) -> Any:
                            calls.append([*given, named])
                            return "trial"

                        with (
                            mock.patch.object(explain, "trial_of_run", of_run),
                            mock.patch.object(explain.Other, "read", lambda path: path),
                            mock.patch.object(explain, "by_version", side_effect=[line]),
                        ):
                            found = explain._with_line(found_of(standing), Path(run), firmware, Path("good.elf"))
                        yield said([standing.name, run, found, calls])
        plan: Any = SimpleNamespace(programmed=[SimpleNamespace(name="west"), SimpleNamespace(name="east")])
        for name in ("", "east", "north"):
            chosen = explain._plan_of(plan, name)
            yield said([name, chosen is plan, getattr(chosen, "name", "all")])
        yield said([explain._plan_of(None, "east"), explain._reference(folder / "good.elf").name])


def explained_campaigns(_draw: Random) -> Iterator[str]:
    """Explain campaigns, with and without a version that passes."""
    with in_folder():
        Path("run").mkdir()
        Path("good.elf").touch()
        Path("camp").mkdir()
        (Path("camp") / explain.JOURNAL).touch()
        asked: list[object] = []
        for words in ("camp", "camp --json", "camp --against good.elf", "camp --minutes 0.5", "run --against good.elf"):
            for line in LINES:

                def of_campaign(*given: object, line: FaultLine = line) -> FaultLine:
                    asked.append(given)
                    return line

                with (
                    mock.patch.object(explain, "_line_of_campaign", of_campaign),
                    mock.patch.object(explain.Other, "read", lambda path: path.name),
                    mock.patch.object(explain, "_explained", return_value=found_of(Standing.CAUSE)),
                    mock.patch.object(explain, "trial_of_run"),
                    mock.patch.object(explain, "by_version", return_value=line),
                ):  # fmt: skip
                    yield from printed(p2os, ["explain", *words.split()])
                yield said(asked)
                asked.clear()
        yield from lines_of_campaigns()


def lines_of_campaigns() -> Iterator[str]:
    """Look for a line in a campaign: by another version, by changes until none is left, and until the time is over."""
    for tick_s in (1, 20, 40):
        for other in (None, "good.elf"):
            calls: list[object] = []
            now = iter(range(0, 10**15, tick_s * 10**9))
            workers: Any = SimpleNamespace(close=lambda calls=calls: calls.append("closed"))

            def changed(*given: Any, calls: list[object] = calls) -> Any:
                calls.append([*given[:3], given[4]("trial")])
                return SimpleNamespace(
                    count=5, found=[1], look=lambda: (calls.append(n) or n for n in range(5)), result="r"
                )

            with (
                mock.patch.object(explain, "points_of", lambda *given, **named: [*given, named]),
                mock.patch.object(explain, "failing_and_passing", lambda rows: (rows[:1], ["p"])),
                mock.patch.object(explain, "by_version", lambda *given: given),
                mock.patch.object(explain, "wall_clock", lambda now=now: next(now)),
                mock.patch.object(explain, "Processes", lambda *given, w=workers, c=calls: c.append(given[:2]) or w),
                mock.patch.object(explain, "FailingRun", lambda *given: SimpleNamespace(ran=given[0])),
                mock.patch.object(explain, "passes", lambda trial, by, w=workers: [trial, by is w]),
                mock.patch.object(explain, "ChangedBack", changed),
            ):
                yield said([tick_s, explain._line_of_campaign(Path("camp"), other, 1.0), calls])  # type: ignore[arg-type]


def not_written(_draw: Random) -> Iterator[str]:
    """Write files of a project where the system refuses it, with and without the name of a file."""
    for error in (OSError(28, "No space left on device"), OSError(13, "Permission denied", "a/b")):
        with in_folder() as folder, mock.patch.object(Path, "open", side_effect=error):
            ended = tried(project_files.write_files, Path("made/here"), {"a.txt": "a"})
            yield said([ended, sorted(path.name for path in folder.iterdir())])


def unequal(_draw: Random) -> Iterator[str]:
    """Refuse results whose parts are not of one length, where no more is shown of them than their shorter one."""
    rows = [SimpleNamespace(settings=()), SimpleNamespace(settings=(("a", 1),))]
    for count in range(4):
        outcomes: Any = [{"trace_sha256": f"{n}"} for n in range(count)]
        yield tried(sweep._are_seeds_alike, SimpleNamespace(rows=rows, outcomes=outcomes)).partition(":")[0]
    for ours, theirs in (((2, 2), (2, 2)), ((3, 2), (2, 2)), ((2, 2), (3, 2)), ((2, 3), (2, 2)), ((2, 2), (2, 3))):
        shown: list[object] = []
        ways = [SimpleNamespace(t_s=[0.0, 0.5], x_m=[1.0] * places, y_m=[2.0] * places, heading_rad=[0.25 * n] * turns)
                for n, (places, turns) in enumerate((ours, theirs))]  # fmt: skip
        compared: Any = SimpleNamespace(ours=ways[0], theirs=ways[1])
        with mock.patch.object(comparison_page, "_samples", lambda *given, s=shown: s.append(said(given[1:]))):
            ended = tried(comparison_page._add_differences, SimpleNamespace(), compared)
        yield said([ours, theirs, ended.partition(":")[0], shown])


def pages_and_schemas(_draw: Random) -> Iterator[str]:
    """Begin pages of comparisons, of ways as long as they are and of one time alone, and print what files may have."""
    part = SimpleNamespace(signal="s", bound=SimpleNamespace(stage="w"))
    for times in ((0.0, 1.5), (0.5, 0.5), (-1.0, 2.0), (0.0, 0.0), (0.0, 1e-9), (0.0, 2e-9)):
        for poses in (("truth", "truth"), ("truth", "odometry")):
            for other in ("a", "b"):
                robots: Any = [SimpleNamespace(name=name, meta={}, parameters=load_parameters("p2dx"))
                               for name in ("a", other)]  # fmt: skip
                found: Any = SimpleNamespace(
                    ours=SimpleNamespace(t_s=times), theirs=SimpleNamespace(t_s=times), one=robots[0], other=robots[1],
                    how=SimpleNamespace(poses=poses), parts=[],
                    origin=None if other == "a" else (part, 1.25),
                )  # fmt: skip
                with (
                    mock.patch.object(comparison_page, "_add_way"),
                    mock.patch.object(comparison_page, "_add_differences"),
                    mock.patch.object(comparison_page, "page_of", lambda recording: recording),
                    mock.patch.object(comparison_page, "ViewRecording", Recording),
                ):  # fmt: skip
                    made: Any = comparison_page.comparison_page(found, ["one", "two"])
                yield said([times, poses, made.header, made.rows])
    for words in ("check --schema", "campaign --schema"):
        yield from itertools.islice(printed(p2os, words.split()), 12)


class Recording:
    """What is written on a page."""

    def __init__(self, header: object) -> None:
        self.header, self.rows = header, list[object]()

    def add(self, header: object) -> Any:
        self.rows.append(header)
        return SimpleNamespace(append=lambda *row: self.rows.append(row))


def validated(_draw: Random) -> Iterator[str]:
    """Validate, by runs that are made up: what is printed, and how it ends."""
    for passed in (True, False):
        results: Any = [SimpleNamespace(
            passed=passed, experiment="motors", findings=[], failures=(), world="room", seed=1,
            variant=SimpleNamespace(name="direct"), folder="x", trace_sha256="ab",
        )]  # fmt: skip
        for words in ("", " --json"):
            with (
                in_folder(), mock.patch.object(validate, "_run_all", return_value=results),
                mock.patch.object(validate, "_write"), mock.patch.object(validate, "_print"),
                mock.patch.object(validate, "reported", return_value=[]),
            ):  # fmt: skip
                yield from printed(p2os, f"validate motors --mode direct --out v{words}".split())
    with in_folder(), mock.patch.object(validate, "_run_all", side_effect=KeyboardInterrupt):
        yield from printed(p2os, ["validate", "motors", "--out", "v"])


TRACES: dict[str, Trace] = {
    "pins": pins,
    "compared pins": compared_pins,
    "measured": measured,
    "compared": compared,
    "fitted": fitted,
    "explained": explained,
    "explained campaigns": explained_campaigns,
    "validated": validated,
    "unequal": unequal,
    "not written": not_written,
    "pages and schemas": pages_and_schemas,
}
test_each_line_of_what_came_is_what_was_approved = judge_of(__file__, TRACES)
