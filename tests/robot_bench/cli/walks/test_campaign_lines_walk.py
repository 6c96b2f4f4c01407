"""The verb of campaigns, whose runs are made up: who works on them, what is reported meanwhile, and what is printed."""

import contextlib
import io
import itertools
from collections.abc import Iterator
from pathlib import Path
from random import Random
from types import SimpleNamespace
from typing import Any
from unittest import mock

from p2os.cli.main import run as p2os
from robot_bench.campaign.conduct import PointFinding
from robot_bench.campaign.trial import Outcome, TrialVerdict
from robot_bench.cli.campaigns import campaign as verb
from tests.robot_bench.cli.walks.printed import in_folder, printed
from tests.tools.suite.acted import Acted, taken
from tests.tools.suite.approved import Trace, judge_of, rounded, said, tried

ASKED = (
    "a.toml",
    "a.toml --runs 3 --minutes 2 --search random --seed 4 -j 2",
    "a.toml --against good.elf --json --out there",
    "a.toml --dask local -j 3",
    "a.toml --scheduler tcp://x",
    "--resume kept",
    "--resume kept -j 1",
    "a.toml --dask other",
    "a.toml --firmware mine.elf",
    "comment kept",
    "comment kept --out c.md --url http://x/ --against good.elf",
    "new dodge",
    "new dodge",
    "new dodge --out none/c.toml",
    "new dodge --firmware mine.elf --out d.toml --runs 5",
    "new ./mine.toml --out e.toml",
)


def verbs(_draw: Random) -> Iterator[str]:
    """Ask for campaigns in all ways: who is asked to work, with what, and whether he is ended."""
    calls: list[str] = []
    found: Any = SimpleNamespace(limits="limits", budget=SimpleNamespace(runs=40))

    def made(name: str) -> Any:
        def make(*given: object, **named: object) -> Any:
            calls.append(said([name, [one for one in given if not callable(one)], {
                key: one for key, one in named.items() if not callable(one)}]))  # fmt: skip
            return Acted(calls, name) if name in {"processes", "against", "dask"} else found

        return make

    def dask(*given: object) -> Any:
        workers = made("dask")(*given)
        workers.where = "tcp://here"
        return workers

    other: Any = SimpleNamespace(of=lambda folder: f"of {folder}", read=lambda path: f"read {path}")
    parts = {"Processes": made("processes"), "Against": made("against"), "Other": other, "begin": made("begin"),
             "resume": made("resume"), "points_of": made("points"), "carry_out": made("carry out"),
             "core_count": lambda: 7,
             "write_comment": lambda *given, **named: f"{said(given[0])} {said(given[3])} {named}\n",
             "suggested": lambda scenario, *given: f"{scenario.name} {said(given)}\n",
             "tell": lambda *given, **named: calls.append(said(["tell", given[1], named]))}  # fmt: skip
    with in_folder() as folder, contextlib.ExitStack() as stack:
        for name, part in parts.items():
            stack.enter_context(mock.patch.object(verb, name, part))
        stack.enter_context(mock.patch("robot_bench.campaign.workers.dask_workers.DaskWorkers", dask))
        plan: Any = SimpleNamespace(name="plan")
        stack.enter_context(mock.patch.object(verb, "load_scenario", lambda *given, **named: calls.append(
            said([given, named["firmware"]])) or plan))  # fmt: skip
        Path("mine.toml").touch()
        for words in ASKED:
            yield f"$ campaign {words}"
            yield from (line.replace(str(folder), "HERE") for line in printed(p2os, ["campaign", *words.split()]))
            yield taken(calls)
        for file in sorted(folder.glob("*.toml")):
            yield f"{file.name} {file.read_text(encoding='utf-8')}"
        for path, one in (("a/c.toml", "b.elf"), ("c.toml", "a/b.elf"), ("a/c.toml", "/x/b.elf")):
            yield verb._seen_from(Path(path), Path(one))


def reported_meanwhile(_draw: Random) -> Iterator[str]:
    """Report how a campaign goes: a line each tenth where there is no terminal, none where there is one."""
    for runs in (40, 7):
        for is_terminal in (False, True):
            err, bars = io.StringIO(), list[object]()
            err.isatty = lambda is_terminal=is_terminal: is_terminal  # type: ignore[method-assign, misc]
            found: Any = SimpleNamespace(budget=SimpleNamespace(runs=runs))
            bar = contextlib.nullcontext(lambda *given, bars=bars: bars.append(given))
            with (
                mock.patch.object(verb, "counting_bar", lambda *given, bar=bar, bars=bars: bars.append(given) or bar),
                contextlib.redirect_stderr(err), verb.shown(found) as update,
            ):  # fmt: skip
                for answered in (0, 1, 3, 4, 5, 8, 9, 20, 39, 40):
                    update(SimpleNamespace(answered=answered, runs=answered + 2, failures=[1] * (answered // 9),  # type: ignore[arg-type]
                                           blocks={*range(answered)}))  # fmt: skip
            yield said([runs, is_terminal, err.getvalue(), bars])


def printed_wholes(draw: Random) -> Iterator[str]:
    """Print what campaigns came to: few and many failures, errors, moments, versions, and what ended it."""
    other: Any = SimpleNamespace(name="good.elf", sha256="0123456789abcdef" * 4)
    for number in range(24):
        count = draw.choice((0, 1, 3, verb.MOST_SHOWN, verb.MOST_SHOWN + 1, verb.MOST_SHOWN + 4))
        rows: list[Any] = []
        for place in range(count):
            finding = draw.choice([*PointFinding]) if number % 3 else PointFinding.ERROR
            runs = [SimpleNamespace(trial=place, outcome=Outcome(
                verdict=TrialVerdict.FAILED, failures=draw.choice(((), ("it hit",), ("too slow", "x")))))
                for _ in range(draw.randrange(1, 3))]  # fmt: skip
            rows.append(
                SimpleNamespace(number=place, finding=finding, runs=runs, failing=draw.choice((None, runs[-1])))
            )
        failures = [row for row in rows if row.finding in {PointFinding.CONFIRMED, PointFinding.FULL_ONLY}] or (
            rows if number % 4 == 1 else [])  # fmt: skip
        source = draw.choice((None, SimpleNamespace(lines=3, lines_of=0, ways=1, ways_of=4),
                              SimpleNamespace(lines=3, lines_of=9, ways=1, ways_of=4)))  # fmt: skip
        done: Any = SimpleNamespace(
            folder=Path("kept"), failures=failures, was_interrupted=number % 5 == 0,
            unreached=["state X"] * (number % 2),
            moments={row.number: SimpleNamespace(words="avoidable") for row in rows[::2]}, source=source,
            results=SimpleNamespace(replay=lambda row: f"p2os run {row.number}"), different_runs=draw.randrange(1, 4),
            counts={finding: sum(row.finding is finding for row in rows) for finding in PointFinding},
            campaign=SimpleNamespace(trial=SimpleNamespace(programs={"a.elf": "fedcba98" * 8})),
            progress=SimpleNamespace(rows=rows, runs=9, virtual_ns=5 * 10**12, cpu_s=12.5,
                                     left_out_words=lambda number=number: ["2 lines"] * (number % 2)),
            as_json=lambda: {"points": 3, "a": 1},
        )  # fmt: skip
        apart = draw.choice((None, "apart"))
        with (
            mock.patch.object(verb, "first_apart", lambda trial, _other, apart=apart: apart and f"{apart} {trial}"),
            mock.patch.object(verb, "reported", "they part: {}".format),
            mock.patch.object(verb, "FailureSet", SimpleNamespace(of=lambda rows: SimpleNamespace(
                words=lambda: {"different": len(rows)}))),
        ):  # fmt: skip
            for json_output in (False, True):
                ended = printed(verb.tell, done, draw.choice((None, other)), json_output=json_output)
                yield from itertools.chain([f"{number} {count} {len(failures)}"], map(rounded, ended))
    yield tried(verb._refuse_dask, "local", "x")


TRACES: dict[str, Trace] = {"verbs": verbs, "reported": reported_meanwhile, "printed": printed_wholes}
test_what_the_verb_of_campaigns_shows_is_what_was_approved = judge_of(__file__, TRACES)
