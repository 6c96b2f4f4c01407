"""Every verb that writes, one of its calls failing, short or its last: one line says so, and what was there is kept.

The verbs are those of test_full_disks.py. `make test` tries a few calls of those that are quick, drawn by a seed;
`make soak` all calls of a kind that a verb makes, or so many of them that one kind of one verb takes minutes.
"""

import random
import shutil
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest

from tests.robot_bench.cli.test_full_disks import CAMPAIGN, MOTORS, SCENARIO, VERBS, make_run
from tests.tools.made_once import made_once
from tests.whole.failing_calls import SOUND, Ended, FailedCall, Kind, Outcome, calls_of, library, run_verb, swept

SEED = 39
#: Where this stands in an output, or in the page of a run, so does how fast the machine was.
REAL_TIME = "× real time"
#: How many calls of a kind are tried in `make soak`: of a verb that takes less than a second, and of another.
WHOLE, DRAWN = 400, 12
SLOW = ("run", "report c ", "campaign b", "shrink", "fit", "compare", "metrics", "sensitivity", "validate")
#: Verbs of `make test`: a way of writing each, and a quarter of a second.
SAMPLE = (
    "report c --events e.jsonl", "report c --events e.mcap", "campaign new dodge --out o.toml", "new proj",
    "world show room --out w.svg", "export c e.csv", f"mcu run {MOTORS} --for 30ms --uart u.txt",
)  # fmt: skip
#: Calls that each found a fault.
FOUND = (
    ("export c e.csv", FailedCall(Kind.MALLOC, 1, Outcome.FAIL)),
    (f"mcu run {MOTORS} --for 30ms --uart u.txt", FailedCall(Kind.MALLOC, 60, Outcome.FAIL)),
    (f"mcu run {MOTORS} --for 30ms --uart u.txt", FailedCall(Kind.MALLOC, 100, Outcome.FAIL)),
)


@dataclass(frozen=True, slots=True)
class Reference:
    """What a verb does where no call fails."""

    ended: Ended
    #: What it leaves, of what is the same each time.
    files: dict[str, bytes]
    #: Every name, and those that were there before and are as they were.
    names: frozenset[str]
    kept: frozenset[str]
    has_same_output: bool


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    """The library, and a folder with a scenario, a campaign and a run."""
    folder = tmp_path_factory.mktemp("place")
    shutil.copytree(made_once(tmp_path_factory, "short-run", make_run), folder / "c")
    (folder / "a.toml").write_text(SCENARIO, encoding="utf-8")
    (folder / "b.toml").write_text(CAMPAIGN, encoding="utf-8")
    return library(tmp_path_factory), folder


def files_in(folder: Path) -> dict[str, bytes]:
    """Return the files of a folder, but for what is temporary."""
    found = (path for path in folder.rglob("*") if path.is_file())
    names = ((path.relative_to(folder), path) for path in found)
    return {str(name): path.read_bytes() for name, path in names if name.parts[0] != "tmp"}


@cache
def reference(path: str, place: Path, verb: str) -> Reference:
    """Do it twice."""
    done = []
    for _ in range(2):
        ended = _run_in_copy(path, place, verb, SOUND)
        done.append((ended, files_in(_copy(place))))
    (first, files), (second, others) = done
    before = files_in(place)
    assert first.code in {0, 1}, first.err
    assert any(first.counts.values()), "the verb was counted"
    same = {
        name: data for name, data in files.items() if others.get(name) == data and not name.endswith("o/report.html")
    }
    has_same_output = first.out == second.out and REAL_TIME not in first.out
    return Reference(
        first, same, frozenset(files),
        frozenset(name for name, data in before.items() if files.get(name) == data), has_same_output,
    )  # fmt: skip


def _copy(place: Path) -> Path:
    return place.with_name(f"{place.name}-copy")


def _run_in_copy(path: str, place: Path, verb: str, call: FailedCall) -> Ended:
    shutil.rmtree(_copy(place), ignore_errors=True)
    shutil.copytree(place, _copy(place))
    return run_verb(path, _copy(place), call, *verb.split())


def wrong(path: str, place: Path, verb: str, call: FailedCall) -> list[str]:
    """Let a call fail; return what must not be."""
    sound, ended = reference(path, place, verb), _run_in_copy(path, place, verb, call)
    left = files_in(_copy(place))
    if _has_errors(left.get("o/summary.json", b"")):
        return ended.wrong()
    found = [f"{name} was lost" for name in sorted(sound.kept) if left.get(name) != files_in(place)[name]]
    if not ended.failed:
        return found  # not each run makes as many calls
    if call.outcome is Outcome.END:
        found += [] if ended.was_killed else ended.wrong()  # a worker's call: its run has failed
    elif ended.was_killed_by_others:
        return found
    else:
        found += ended.wrong()
        if call.outcome is Outcome.SHORTEN and ended.code != sound.ended.code:
            found.append("what was short was not gone on with")
        if "p2os: " not in ended.err and (ended.code == 0 or ended.out == sound.ended.out):  # it said nothing
            found += [f"{name} differs" for name, data in sound.files.items() if left.get(name) != data]
            found += [f"{name} is there or not" for name in sound.names ^ set(left)]
            found += ["the output differs"] if sound.has_same_output and ended.out != sound.ended.out else []
    return [f"{each}\n{call}: {ended.failed}\n{ended.err[-500:]}" for each in found + _what_is_left(path, place, verb)]


def _has_errors(summary: bytes) -> bool:
    """Tell whether a campaign has trials that failed for want of memory, as its summary says."""
    return b'"error": ' in summary and b'"error": 0' not in summary


def _what_is_left(path: str, place: Path, verb: str) -> list[str]:
    """Go on with what a verb has left: report it, resume it, or do it again, which may be refused with a reason."""
    folder, goes_on = _copy(place), verb
    if verb.startswith(("run ", "campaign b")):
        goes_on = "report o" if verb.startswith("run ") else "campaign --resume o -j 1"
    again = run_verb(path, folder, SOUND, *goes_on.split())
    found = again.wrong()
    if verb.startswith("campaign b") and again.code == 0:
        summary = "o/summary.json"
        data = files_in(folder)[summary]
        is_whole = data == reference(path, place, verb).files[summary] or _has_errors(data)
        found += [] if is_whole else ["rows were lost"]
    return [f"afterwards, {goes_on}: {each}: {again.err[-300:]}" for each in found]


@pytest.mark.parametrize("verb", SAMPLE)
def test_a_few_calls_of_a_verb_that_fail_are_reported(verb: str, shared: tuple[str, Path]) -> None:
    chooser = random.Random(f"{SEED} {verb}")
    calls = calls_of(reference(*shared, verb).ended, chooser, 2)
    for call in chooser.sample(calls, 3):
        assert not wrong(*shared, verb, call)


@pytest.mark.parametrize(("verb", "call"), FOUND, ids=str)
def test_calls_that_found_a_fault_are_reported(verb: str, call: FailedCall, shared: tuple[str, Path]) -> None:
    assert not wrong(*shared, verb, call)


@pytest.mark.soak
@pytest.mark.parametrize("verb", [verb for verb, _ in VERBS])
def test_every_call_of_a_verb_that_fails_is_reported(verb: str, shared: tuple[str, Path]) -> None:
    most = DRAWN if f"{verb} ".startswith(SLOW) and "--events e" not in verb else WHOLE
    calls = swept(verb, reference(*shared, verb).ended, random.Random(f"{SEED} {verb}"), most)
    found = [problem for call in calls for problem in wrong(*shared, verb, call)]
    assert not found, "\n\n".join(found)
