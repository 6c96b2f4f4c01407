"""Mutants of a program of a dozen instructions: which goals notice them, and that they are run as real programs are."""

import json
import math
import time
from collections import Counter
from collections.abc import Callable
from importlib.metadata import EntryPoint
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from bluepill_sim.program.image import load_image
from bluepill_sim.program.mutants import Mutant, mutants, mutated_file
from p2os.cli import main as cli
from robot_bench.bench import Bench
from robot_bench.campaign.variants.mutation import base_run as runs
from robot_bench.campaign.variants.mutation.base_run import BaseRun, base_run
from robot_bench.campaign.variants.mutation.interval import share_interval
from robot_bench.campaign.variants.mutation.trial import Fate, MutantResult, try_mutant
from robot_bench.cli.campaigns.mutate import _drawn
from robot_bench.scenario.scenario import load_scenario
from tests.bluepill_sim.machine import Assembler
from tests.robot_bench.firmware import thumb

#: Counts to 100, then raises PB12 (p2dx_con), and sleeps.
PROGRAM = """
mov32 r0, #0x40021000
movs r1, #8
str r1, [r0, #0x18]
mov32 r0, #0x40010C00
mov32 r1, #0x44414444
str r1, [r0, #4]
movs r2, #0
again: adds r2, #1
cmp r2, #100
bne again
mov32 r1, #0x1000
str r1, [r0, #0x10]
sleep: wfi
b sleep
"""
SCENARIO = """
firmware = "x.bin"
world = "room"
duration_s = 0.05
body = "kinematic"
mode = "direct"
[[goal]]
kind = "happens"
event = "pin PB12 high"
"""
HERE = thumb.FLASH + 16 * 4 + 2


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(runs, "STEPS", 8)  # the program is at its end in the first of as many
    firmware(PROGRAM)
    Path("mine.toml").write_text(SCENARIO, encoding="utf-8")
    here = EntryPoint("mutate", "robot_bench.cli.campaigns.mutate", cli.GROUP)
    found = [entry for entry in cli.verbs() if entry.name != "mutate"]
    monkeypatch.setattr(cli, "verbs", lambda: [*found, here])


def firmware(source: str) -> None:
    Path("x.bin").write_bytes(thumb.image(Assembler(source, HERE).code))


def base() -> BaseRun:
    return base_run(load_scenario("mine.toml"), time.process_time_ns)


def tried(run: BaseRun, wanted: Callable[[Mutant], bool] = lambda _: True) -> dict[str, MutantResult]:
    """Return what became of mutants, each tried on the one bench, which goes back for each."""
    found = {}
    for mutant in mutants(run.board.image, run.first_ns):
        if wanted(mutant):
            one = try_mutant(mutant, [run], time.process_time_ns, lambda: None)
            found[f"{mutant.alteration.before} -> {mutant.alteration.after.split(' 0x')[0]}"] = one
    return {key.replace(f" {HERE + 30:#010x}", ""): one for key, one in found.items()}


def test_the_goal_notices_what_keeps_the_wire_low_and_nothing_else() -> None:
    found = {words: one.fate for words, one in tried(base()).items()}
    missed = {words for words, fate in found.items() if fate is Fate.MISSED}
    survived = {words for words, fate in found.items() if fate is Fate.SURVIVED}
    branch = next(words for words in found if words.startswith("bne")).partition(" -> ")[0]
    assert missed == {
        "movs r1, #8 -> movs r1, #7", "adds r2, #1 -> adds r2, #0", "adds r2, #1 -> subs r2, #1", f"{branch} -> b",
    }  # fmt: skip
    assert survived == {
        "movs r2, #0 -> movs r2, #1", "adds r2, #1 -> adds r2, #2", "cmp r2, #100 -> cmp r2, #101",
        "cmp r2, #100 -> cmp r2, #99", f"{branch} -> beq", f"{branch} -> nop",
    }  # fmt: skip
    assert {words for words, fate in found.items() if fate is Fate.SAME} == {"movs r1, #8 -> movs r1, #9"}


def test_a_mutant_that_branches_off_leaves_the_trace_of_its_file_run_from_the_reset(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(runs, "STEPS", 64)
    lowers = "movs r3, #9\nwait: subs r3, #1\ncmp r3, #0\nbne wait\nmov32 r1, #0x10000000\nstr r1, [r0, #0x10]\nsleep:"
    firmware(PROGRAM.replace("sleep:", lowers))
    Path("mine.toml").write_text(SCENARIO.replace("0.05", "0.002"), encoding="utf-8")
    run, image, data = base(), load_image("x.bin"), Path("x.bin").read_bytes()
    later = [one for one in mutants(image, run.first_ns) if run.first_ns[one.address] > 0]
    assert later, "the steps are fine enough to tell the loop from what comes before"
    for mutant in later:
        try_mutant(mutant, [run], time.process_time_ns, lambda: None)
        branched_off = run.bench.trace.sha256
        Path("mutant.bin").write_bytes(mutated_file(data, mutant, image))
        whole = Bench.from_scenario("mine.toml", firmware="mutant.bin")
        whole.run_until(run.bench.now)
        whole.finish()
        assert branched_off == whole.trace.sha256, mutant


def test_a_mutant_may_be_tried_again_and_the_program_itself_is_not_changed_by_it() -> None:
    run = base()
    assert tried(run) == tried(run)
    again = base_run(load_scenario("mine.toml"), time.process_time_ns)
    assert again.trace_sha256 == run.trace_sha256


def test_a_mutant_that_costs_far_more_than_the_program_is_stopped_and_counts_as_noticed() -> None:
    run = base()
    ticks = iter(range(0, 10**15, 10**12))  # of a clock that runs away
    mutant = mutants(run.board.image, run.first_ns)[0]
    found = try_mutant(mutant, [run], lambda: next(ticks), lambda: None)
    assert found.fate is Fate.STOPPED
    assert found.is_noticed


def test_a_program_that_ends_in_a_fault_is_noticed_by_that() -> None:
    tail = "sleep: wfi\nb sleep\nwrong: mov32 r0, #0x60000001\nbx r0\n"
    guarded = f"movs r1, #4\nsubs r1, #4\ncmp r1, #0\nbne wrong\n{tail}"
    firmware(PROGRAM.partition("sleep:")[0] + guarded)
    found = tried(base(), lambda mutant: mutant.alteration.before == "subs r1, #4")
    assert {one.fate for one in found.values()} == {Fate.CRASHED}
    assert all("fault" in one.says for one in found.values())


def test_the_command_prints_a_score_that_is_the_least_one_and_the_survivors_in_80_columns(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert cli.run(["mutate", "x.bin", "mine.toml", "-j", "2", "--fail-under", "40%"]) == 0
    out = capsys.readouterr().out
    assert all(len(line) <= 80 for line in out.splitlines())
    assert out.splitlines()[-1] == "score 40.0 %: 4 noticed of 10 that changed a run; 1 left the same trace"
    assert "cmp r2, #100 -> cmp r2, #101" in out
    assert "movs r1, #8 -> movs r1, #9" not in out


def test_a_score_below_the_least_one_fails(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """The command above has tried them: here two of each five are noticed, and of all eleven the last has one trace."""

    def try_all(tried: list[Mutant], *_: object) -> tuple[list[MutantResult], list[str], bool]:
        found = [MutantResult(Fate.MISSED if place % 5 < 2 else Fate.SURVIVED) for place in range(len(tried))]
        return [*found[:10], *(MutantResult(Fate.SAME) for _ in found[10:])], [], True

    monkeypatch.setattr("robot_bench.cli.campaigns.mutate._try_all", try_all)
    words = ["mutate", "x.bin", "mine.toml"]
    for least, code in (("40%", 0), ("40.1%", 1)):
        assert cli.run([*words, "--fail-under", least]) == code
        out, err = capsys.readouterr()
        assert out.splitlines()[-1].startswith("score 40.0 %: 4 noticed of 10"), "all were tried: it is exact"
        assert "confidence" not in out
        assert err == ("the score is below 40.1 %\n" if code else "")
    # Of ten of eleven, 4 or 5 may be noticed: 36.4 % at least.
    for least, code in (("36.3%", 0), ("36.4%", 1), ("40.1%", 1)):
        assert cli.run([*words, "--sample", "10", "--fail-under", least]) == code
        out, err = capsys.readouterr()
        assert out.splitlines()[-2] == "score of all 11: 36.4 to 45.5 % (95% confidence, by a sample of 10)"
        assert all(len(line) <= 80 for line in out.splitlines())
        assert err.startswith(
            {"36.3%": "", "36.4%": "the score may be below 36.4 %", "40.1%": "the score is below"}[least]
        )
        assert "hint: a greater --sample" in err or least != "36.4%"


@pytest.mark.parametrize("whole", [1, 2, 7, 30])
def test_an_interval_holds_the_share_of_the_whole_in_19_of_20_samples_at_least(whole: int) -> None:
    for sample in range(1, whole + 1):
        bounds = [share_interval(hits, sample, whole) for hits in range(sample + 1)]
        for of in range(whole + 1):
            ways = {hits: math.comb(of, hits) * math.comb(whole - of, sample - hits) for hits in range(sample + 1)}
            held = sum(n for hits, n in ways.items() if n and bounds[hits][0] <= of / whole <= bounds[hits][1])
            assert held >= 0.95 * sum(ways.values()), (sample, of)


def test_an_interval_of_the_whole_is_its_share_and_one_of_a_great_whole_is_that_of_clopper_and_pearson() -> None:
    assert [share_interval(hits, 10, 10) for hits in range(11)] == [(hits / 10, hits / 10) for hits in range(11)]
    assert share_interval(4, 10, 10**6) == pytest.approx((0.1216, 0.7376), abs=2e-4)  # their table, R's binom.test
    assert share_interval(0, 20, 10**6) == pytest.approx((0, 0.1684), abs=2e-4)
    assert share_interval(19, 81, 562) == pytest.approx((0.154, 0.338), abs=0.01)


def test_where_survivors_go_is_looked_at_before_anything_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("robot_bench.cli.campaigns.mutate.base_run", lambda *_: pytest.fail("it ran"))
    taken = tmp_path / "taken"
    taken.write_text("mine")
    assert cli.run(["mutate", "x.bin", "mine.toml", "--write", str(taken)]) == 2
    assert capsys.readouterr().err.splitlines() == [
        f"p2os: cannot write {taken}: file exists", "hint: --write takes a folder",
    ]  # fmt: skip
    assert taken.read_text() == "mine"


def test_a_sample_is_drawn_by_its_seed_and_json_junit_and_files_have_the_same(
    capsys: pytest.CaptureFixture[str],
) -> None:
    words = ["mutate", "x.bin", "mine.toml", "--sample", "5", "--seed", "1", "--json"]
    assert cli.run([*words, "-j", "1", "--junit", "r.xml", "--write", "wrong"]) == 0
    one = json.loads(capsys.readouterr().out)
    assert cli.run([*words, "-j", "2"]) == 0
    assert json.loads(capsys.readouterr().out) == one
    run = base()
    possible = mutants(run.board.image, run.first_ns)
    of_1, of_0 = ([mutant.alteration.after for mutant in _drawn(possible, 5, seed)] for seed in (1, 0))
    assert [mutant["after"] for mutant in one["mutants"]] == of_1 != of_0
    fates = Counter(mutant["fate"] for mutant in one["mutants"])
    suite = ET.fromstring(Path("r.xml").read_text(encoding="utf-8"))  # noqa: S314 - our own file
    low, high = one["score_bounds"]
    assert low < one["score"] < high
    assert (one["tried"], suite.get("tests"), suite.get("failures")) == (5, "5", str(fates["survived"]))
    assert len(list(Path("wrong").iterdir())) == fates["survived"] > 0
    assert cli.run(["run", "mine.toml", "--firmware", str(next(Path("wrong").iterdir()))]) == 0


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("[[goal]]", "#"), "no goals"),
        (("PB12 high", "PB13 high"), "fails with the program itself"),
        (('mode = "direct"', 'mode = "direct"\nstart = {x_m = 99.0, y_m = 0.0}'), "start"),
    ],
)
def test_a_scenario_that_can_tell_nothing_is_refused(
    change: tuple[str, str], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    text = SCENARIO.replace(*change)
    if change[1] == "#":
        text = SCENARIO.partition("[[goal]]")[0]
    Path("mine.toml").write_text(text, encoding="utf-8")
    assert cli.run(["mutate", "x.bin", "mine.toml"]) == 2
    assert says in capsys.readouterr().err


def test_a_name_that_nothing_ran_of_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["mutate", "x.bin", "mine.toml", "--only", "other.c"]) == 2
    assert "nothing of other.c that ran can be changed" in capsys.readouterr().err
    assert cli.run(["mutate", "y.bin", "mine.toml"]) == 2


def test_an_elf_is_changed_where_the_chip_has_the_instruction(tmp_path: Path) -> None:
    scenario = load_scenario("motors")
    image = load_image(scenario.firmware)
    entry = image.word(image.vector_table + 4) & ~1
    data = scenario.firmware.read_bytes()
    for mutant in mutants(image, range(entry, entry + 60, 2)):
        file = tmp_path / "it.elf"
        file.write_bytes(mutated_file(data, mutant, image))
        assert load_image(file).segments == mutant.image(image).segments != image.segments


SUITE = """
import pytest

@pytest.mark.scenario("mine.toml")
def test_the_wire_rises(bench, pytestconfig):
    assert pytestconfig.rootpath == pytestconfig.invocation_params.dir, "they are run from where they stand"
    bench.expect("pin PB12 high", within="10 ms")

@pytest.mark.scenario("mine.toml")
def test_it_does_not_rise_at_once(bench):
    bench.expect_no("pin PB12 high", during="20 us")
"""


@pytest.mark.slow
def test_tests_of_pytest_judge_too_and_tell_which_of_them_noticed(capsys: pytest.CaptureFixture[str]) -> None:
    Path("tests").mkdir()
    Path("tests/test_it.py").write_text(SUITE, encoding="utf-8")
    Path("mine.toml").rename("tests/mine.toml")
    Path("x.bin").rename("tests/x.bin")
    assert cli.run(["mutate", "tests/x.bin", "tests", "-j", "2", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    fates = {f"{one['before'].split(' 0x')[0]} -> {one['after'].split(' 0x')[0]}": one for one in found["mutants"]}
    assert fates["adds r2, #1 -> adds r2, #0"]["says"] == "test_it.py::test_the_wire_rises"
    assert fates["bne -> nop"]["says"] == "test_it.py::test_it_does_not_rise_at_once"
    assert {fates[words]["fate"] for words in ("cmp r2, #100 -> cmp r2, #99", "movs r2, #0 -> movs r2, #1")} == {
        "survived"
    }
    assert fates["movs r1, #8 -> movs r1, #9"]["fate"] == "same"
    assert sorted(path.name for path in Path("tests").iterdir() if path.name != "__pycache__") == [
        "mine.toml", "test_it.py", "x.bin",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (SUITE.replace('PB12 high", within', 'PB13 high", within'), "test_it.py::test_the_wire_rises fails"),
        ("def test_it():\n    pass\n", "no test of test_it.py drives the fixture bench"),
        ("import nowhere_at_all\n", "pytest ended with exit code 2"),
    ],
)
def test_tests_that_can_tell_nothing_are_refused(text: str, says: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path("test_it.py").write_text(text, encoding="utf-8")
    assert cli.run(["mutate", "x.bin", "test_it.py"]) == 2
    assert says in capsys.readouterr().err
