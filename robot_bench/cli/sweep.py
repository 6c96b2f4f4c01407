"""Many runs of one scenario at once, as `p2os run --seeds` and `[sweep]` ask for: who runs, the table, the JUnit file.

Each run goes into a folder of its own below one of the sweep, which is kept where the run failed, or as `--keep` says.

Invariant: table, JSON and hashes are the same however many run at a time.
"""

import contextlib
import re
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import cast
from xml.etree import ElementTree as ET

from rich.table import Table
from rich.text import Text

from p2os.cli.console import ReadableConsole
from robot_bench.cli.progress import runs_bar
from robot_bench.cli.workers import failure, load_once, run_in_processes
from robot_bench.events.codec import Json
from robot_bench.recording.run_folder import make_next_folder
from robot_bench.recording.summary import INTERRUPTED
from robot_bench.run import run_scenario
from robot_bench.scenario.included_files import Setting, as_toml
from robot_bench.scenario.scenario import Scenario
from robot_bench.scenario.sweep import ALIKE, are_alike
from simbase.files import writing
from simbase.units import ranges_text

#: Which run folders are kept.
KEPT: Mapping[str, Callable[[bool], bool]] = {
    "failures": lambda passed: not passed, "all": lambda _passed: True, "none": lambda _passed: False,
}  # fmt: skip
#: chosen: a screen; of more runs the table has a line for all seeds of a row.
MOST_LINES = 40
#: chosen: so many failures are shown one by one.
MOST_FAILURES = 12
#: What a sweep writes of each run.
FIGURES = (
    "body", "virtual_s", "distance_m", "collisions", "min_clearance_m", "trace_sha256", "passed", "failures",
    "goals_met", "goals_not_judged", "wall_s",
)  # fmt: skip
_PASSED, _FAILED, _NOT_RUN = "passed", "failed", "not run"
#: What XML cannot hold.
_UNWRITABLE = re.compile(r"[^\t\n\r -\ud7ff\ue000-\ufffd]")


@dataclass(frozen=True, slots=True)
class SweepRow:
    """One run of a sweep."""

    scenario: Scenario
    #: What the sweep sets for it, beside the seed.
    settings: tuple[Setting, ...]
    #: The one command that runs it again.
    replay: str

    @property
    def words(self) -> str:
        """What it is called: parameters and seed."""
        return ", ".join([*(f"{key} {as_toml(value)}" for key, value in self.settings), f"seed {self.scenario.seed}"])


@dataclass(frozen=True, slots=True)
class SweepResult:
    """What came of all runs."""

    rows: Sequence[SweepRow]
    outcomes: Sequence[Json]
    was_interrupted: bool
    folder: Path

    def with_word(self, word: str) -> list[tuple[SweepRow, Json]]:
        """Return the runs of which this came: "passed", "failed", "interrupted" or "not run"."""
        return [pair for pair in zip(self.rows, self.outcomes, strict=True) if word_of(pair[1]) == word]

    @property
    def failed(self) -> list[tuple[SweepRow, Json]]:
        """Those that came to their end and did not pass."""
        return self.with_word(_FAILED)


def word_of(found: Json) -> str:
    """Return what came of a run, in a word."""
    if found["passed"]:
        return _PASSED
    first = next(iter(cast("Sequence[str]", found["failures"])), "").partition(" (")[0]
    return first if first in {_NOT_RUN, INTERRUPTED} else _FAILED


def command(scenario: str, options: Sequence[str], settings: Sequence[Setting], seed: int) -> str:
    """Return the command that runs one row."""
    changed = [word for key, value in settings for word in ("--set", f"{key}={as_toml(value)}")]
    return shlex.join(["p2os", "run", scenario, *options, *changed, "--seed", str(seed)])


def run_sweep(
    rows: Sequence[SweepRow], folder: Path | None, *, jobs: int, kept: str, raise_if_interrupted: Callable[[], None],
    force: bool = False,
) -> SweepResult:  # fmt: skip
    """Run all rows, so many at a time.

    Raises:
        UsageError: The folder cannot be made.
    """
    whole = folder or make_next_folder(rows[0].scenario.name)
    places = _places(rows)
    outcomes: list[Json] = [failure(_NOT_RUN) for _ in rows]

    def job(number: int, look: Callable[[], None]) -> Json:
        result = run_scenario(
            rows[number].scenario, whole / places[number], on_progress=lambda _: look(), force=force,
            is_kept=KEPT[kept],
        )  # fmt: skip
        found: Json = {name: result.outcome.get(name) for name in FIGURES}
        return found | {"folder": str(result.folder) if result.folder.is_dir() else None}

    with runs_bar(len(rows)) as advance:

        def on_done(number: int, found: Json) -> None:
            outcomes[number] = found
            advance(passed=bool(found["passed"]))

        load_once(rows[0].scenario)
        is_whole = run_in_processes(
            job, len(rows), at_once=jobs, on_done=on_done, raise_if_interrupted=raise_if_interrupted
        )
    with contextlib.suppress(OSError):  # it holds runs
        whole.rmdir()
    return SweepResult(rows, outcomes, not is_whole, whole)


def refuse_junit(path: Path) -> None:
    """Refuse a JUnit file that cannot be written, before all that is to stand in it.

    Raises:
        FileError: So it is.
    """
    with writing(path, hint="--junit takes a file"):
        path.open("a", encoding="utf-8").close()


def write_junit(done: SweepResult, path: Path) -> None:
    """Write what CI services read: a test case a run, with its command, seed and hash.

    Raises:
        FileError: It cannot be written.
    """
    name = done.rows[0].scenario.name
    left = len(done.with_word(_NOT_RUN)) + len(done.with_word(INTERRUPTED))
    suite = ET.Element(
        "testsuite", name=name, tests=str(len(done.rows)), failures=str(len(done.failed)), errors="0", skipped=str(left)
    )
    if _are_seeds_alike(done):
        ET.SubElement(ET.SubElement(suite, "properties"), "property", name="note", value=ALIKE)
    for row, found in zip(done.rows, done.outcomes, strict=True):
        case = ET.SubElement(suite, "testcase", classname=name, name=row.words, time=str(found.get("wall_s") or 0))
        properties = ET.SubElement(case, "properties")
        for key in ("body", "trace_sha256", "folder"):
            if found.get(key):
                ET.SubElement(properties, "property", name=key, value=str(found[key]))
        failures = cast("Sequence[str]", found["failures"])
        word = word_of(found)
        if word in {_NOT_RUN, INTERRUPTED}:
            ET.SubElement(case, "skipped", message=word)
        elif word == _FAILED:
            why = _UNWRITABLE.sub("?", "\n".join(failures))
            ET.SubElement(case, "failure", message=why.partition("\n")[0]).text = f"{why}\n{row.replay}"
        ET.SubElement(case, "system-out").text = row.replay
    with writing(path):
        ET.ElementTree(suite).write(path, encoding="utf-8", xml_declaration=True)


def as_json(done: SweepResult) -> Json:
    """Return all that came of a sweep as one JSON object; times of this machine left out."""
    found = [
        {"seed": row.scenario.seed, "parameters": dict(row.settings), "replay": row.replay}
        | {key: value for key, value in outcome.items() if key != "wall_s"}
        for row, outcome in zip(done.rows, done.outcomes, strict=True)
    ]
    return {
        "scenario": done.rows[0].scenario.name,
        "passed": len(done.with_word(_PASSED)),
        "failed": len(done.failed),
        "was_interrupted": done.was_interrupted,
        "seeds_are_alike": _are_seeds_alike(done),
        "runs": found,
    }


def print_sweep(done: SweepResult) -> None:
    """Print the table, what failed and how to see it again, and at the end the sum, on stdout."""
    console = ReadableConsole()
    console.print(_each(done) if len(done.rows) <= MOST_LINES else _summed(done))
    failed = done.failed
    for row, found in failed[:MOST_FAILURES]:
        first = next(iter(cast("Sequence[str]", found["failures"])), "")
        console.print(f"failed  {row.words}: {first}", soft_wrap=True)
        if found.get("folder"):
            console.print(f"        {found['folder']}/report.html", soft_wrap=True)
        console.print(f"        {row.replay}", soft_wrap=True)
    if len(failed) > MOST_FAILURES:
        console.print(f"and {len(failed) - MOST_FAILURES} more; --json and --junit have all")
    elif not failed:
        console.print(f"one of them again: {done.rows[0].replay}", soft_wrap=True)
    if _are_seeds_alike(done):
        console.print(f"note    {ALIKE}", soft_wrap=True)
    counts = [(word, len(done.with_word(word))) for word in (_PASSED, _FAILED, INTERRUPTED, _NOT_RUN)]
    summed = ", ".join(f"{count} {word}" for word, count in counts if count or word in {_PASSED, _FAILED})
    bodies = ", ".join(dict.fromkeys(str(found["body"]) for found in done.outcomes if found.get("body")))
    console.print(f"{summed} of {len(done.rows)}" + (f", body {bodies}" if bodies else ""))


def _are_seeds_alike(done: SweepResult) -> bool:
    """Tell whether the seeds made no difference to any row, where there were several."""
    groups = groupby(zip(done.rows, done.outcomes, strict=True), key=lambda pair: pair[0].settings)
    return all(are_alike(found.get("trace_sha256") for _, found in group) for _, group in groups)


def _each(done: SweepResult) -> Table:
    """Return a table with a line for each run."""
    keys = _headings([key for key, _ in done.rows[0].settings])
    table = Table(box=None, pad_edge=False)
    for heading in (*keys, "seed", "", "time", "way", "clear of", "trace"):
        table.add_column(heading, justify="right" if heading != "" else "left", overflow="fold")
    for row, found in zip(done.rows, done.outcomes, strict=True):
        word = word_of(found)
        table.add_row(
            *(as_toml(value) for _, value in row.settings), str(row.scenario.seed),
            Text(word, "green" if word == _PASSED else "red"), _figure(found, "virtual_s", "s", 1),
            _figure(found, "distance_m", "m", 2), _figure(found, "min_clearance_m", "m", 3),
            str(found.get("trace_sha256") or "")[:8],
        )  # fmt: skip
    return table


def _summed(done: SweepResult) -> Table:
    """Return a table with a line for all seeds of a row."""
    keys = _headings([key for key, _ in done.rows[0].settings])
    table = Table(box=None, pad_edge=False)
    for heading in (*keys, "passed", "of", "failed seeds"):
        table.add_column(heading, justify="left" if heading == "failed seeds" else "right", overflow="fold")
    pairs = zip(done.rows, done.outcomes, strict=True)
    for settings, group in groupby(pairs, key=lambda pair: pair[0].settings):
        runs = list(group)
        bad = [row.scenario.seed for row, found in runs if word_of(found) == _FAILED]
        good = sum(word_of(found) == _PASSED for _, found in runs)
        table.add_row(*(as_toml(value) for _, value in settings), str(good), str(len(runs)), ranges_text(bad))
    return table


def _headings(keys: Sequence[str]) -> list[str]:
    """Return the last word of each key, or all of it where two end alike."""
    last = [key.rpartition(".")[2] for key in keys]
    return [word if last.count(word) == 1 else key for key, word in zip(keys, last, strict=True)]


def _figure(found: Json, key: str, unit: str, places: int) -> str:
    value = found.get(key)
    return f"{value:.{places}f} {unit}" if isinstance(value, (int, float)) else ""


def _places(rows: Sequence[SweepRow]) -> list[str]:
    """Return a name for the folder of each run: what it is, with its number in front where two would have one."""
    names = [re.sub(r"[^\w.-]+", "-", row.words).strip("-")[:80] for row in rows]
    if len(set(names)) == len(names):
        return names
    return [f"{number:0{len(str(len(rows)))}d}-{name}" for number, name in enumerate(names, 1)]
