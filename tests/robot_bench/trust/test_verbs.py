"""Verbs, worker processes and the pytest plugin: code that a file names is executed with trust, and never without."""

import json
import os
import re
import shlex
import sys
from importlib.resources import files
from pathlib import Path

import pytest
import typer

from p2os.cli.main import make_app
from p2os.cli.main import run as p2os
from p2os.toml_file import toml_text
from robot_bench.campaign.trial import TrialVerdict, run_trial, trial_of
from robot_bench.campaign.variants.shrinking.kept import trial_of_run
from robot_bench.recording.run_folder import TRACE_NAME, make_next_folder
from robot_bench.recording.run_record import read_run
from robot_bench.run import run_scenario
from robot_bench.scenario.loading import load_scenario
from simbase.errors import FileError, UsageError
from simbase.trust import Trust, UntrustedError
from simbase.user_classes import OF_USERS
from tests.robot_bench.firmware.hurried import hurried

MOTORS = hurried("motors")
#: A body that works, with a helper; each process that executes it writes its number.
BODY = """import os, sys
from pathlib import Path
from p2os.pioneer.body.kinematic import KinematicScene
sys.path.insert(0, str(Path(__file__).parent))
import aid_of_mine
with open({canary!r}, "a") as there:
    there.write(f"{{os.getpid()}}\\n")
class Own(KinematicScene):
    aid = aid_of_mine.AID
"""
SCENARIO = {"firmware": str(MOTORS), "world": "room", "duration_s": 0.2, "body": "./mine.py:Own"}
#: Verb → the words behind it, of files that the fixture writes.
VERBS = {
    "run": ["mine.toml"],
    "campaign": ["camp.toml", "--runs", "2"],
    "mutate": [str(MOTORS), "mine.toml"],
    "shrink": ["mine.toml"],
    "sensitivity": ["mine.toml", "--vary", "threshold_m=0.4..0.5"],
    "serve": ["--fleet", "fleet.toml"],
}
OTHERS = {
    "a sweep": ["run", "swept.toml", "-j", "2"],
    "seeds": ["run", "mine.toml", "--seeds", "0-1", "-j", "2"],
    "--set": ["run", "plain.toml", "--set", 'body="./mine.py:Own"'],
    "a run folder": ["shrink", "RUN-OF-MINE"],
    "gdb": ["run", "mine.toml", "--gdb", "0"],
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    here = tmp_path / "here"
    here.mkdir()
    (here / "mine.py").write_text(BODY.format(canary=str(tmp_path / "canary")))
    (here / "aid_of_mine.py").write_text("AID = 1\n")
    plain = {key: value for key, value in SCENARIO.items() if key != "body"}
    tables = {
        "mine": SCENARIO, "plain": plain, "swept": plain | {"sweep": {"body": ["./mine.py:Own", "kinematic"]}},
        "camp": {"scenario": "mine.toml", "vary": {"threshold_m": {"from": 0.4, "to": 0.5}}},
        "fleet": {"body": "./mine.py:Own", "robot": [{"port": "tcp:127.0.0.1:0"}]},
    }  # fmt: skip
    for name, table in tables.items():
        (here / f"{name}.toml").write_text(toml_text(table))
    for name in ("STATE", "CONFIG"):
        monkeypatch.setenv(f"XDG_{name}_HOME", str(tmp_path / name.lower()))
    monkeypatch.chdir(here)
    monkeypatch.setattr(sys, "stdin", open(os.devnull))  # noqa: SIM115, PTH123 - closed with the process
    monkeypatch.setattr(sys, "path", [*sys.path])
    for name in (f"{OF_USERS}mine", "aid_of_mine"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    return here


def executed_by(folder: Path) -> set[str]:
    """Return the numbers of the processes that executed the class's file, and forget them."""
    canary = folder.parent / "canary"
    found = set(canary.read_text().split()) if canary.exists() else set()
    canary.unlink(missing_ok=True)
    for name in (f"{OF_USERS}mine", "aid_of_mine"):
        sys.modules.pop(name, None)
    return found


def runs(words: list[str], folder: Path) -> list[str]:
    """Make the run folders that words name: of the scenario without code, and of the one with it."""
    if "RUN" in words:
        run_scenario(load_scenario("plain.toml"), folder / "RUN")
    if "RUN-OF-MINE" in words:
        run_scenario(load_scenario("mine.toml", trust=True), folder / "RUN-OF-MINE")
        executed_by(folder)
    return words


WORDS = {verb: [verb, *words] for verb, words in VERBS.items()} | OTHERS


@pytest.mark.parametrize(
    "what", [pytest.param(what, marks=pytest.mark.slow if what == "sensitivity" else ()) for what in WORDS]
)
def test_a_verb_without_trust_refuses_in_one_line_and_executes_nothing(
    what: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = runs(WORDS[what], folder)
    capsys.readouterr()
    assert p2os(words) == 2
    reported = capsys.readouterr().err.splitlines()
    assert executed_by(folder) == set()
    assert len(reported) == 2, reported
    assert re.match(r"p2os: .*(toml:\d+|--set).*body: .*mine\.py:Own is Python code", reported[0])
    assert re.match(r"hint: .*--trust", reported[1])


def test_the_verbs_with_the_option_are_those_that_were_looked_at() -> None:
    group = typer.main.get_command(make_app())
    commands = group.commands  # type: ignore[attr-defined] # a group
    assert {
        name for name, command in commands.items() if any("--trust" in option.opts for option in command.params)
    } == set(VERBS)


def test_a_run_with_trust_has_the_hash_of_each_file_outside_the_hash_of_its_trace(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = []
    for aid in ("AID = 1\n", "AID = 2\n"):
        (folder / "aid_of_mine.py").write_text(aid)
        executed_by(folder)
        assert p2os(["run", "mine.toml", "--trust", "--out", "out", "--force", "--json"]) == 0
        assert executed_by(folder) == {str(os.getpid())}
        record = read_run(folder / "out")
        found.append((record.meta["code"][0], json.loads(capsys.readouterr().out)["trace_sha256"]))
    (one, first), (two, second) = found
    assert first == second
    assert one["files"].keys() == {"mine.py", "aid_of_mine.py"}
    assert one["files"]["mine.py"] == two["files"]["mine.py"]
    assert one["files"]["aid_of_mine.py"] != two["files"]["aid_of_mine.py"]
    assert one["sha256"] != two["sha256"]
    assert (one["named"], one["where"]) == ("./mine.py:Own", "mine.toml:4: body")


def test_the_workers_of_a_sweep_have_the_trust_of_the_verb_and_its_commands_say_so(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert p2os(["run", "swept.toml", "-j", "2", "--trust"]) == 0
    assert executed_by(folder)
    reported = re.search("one of them again: (p2os run .*)", capsys.readouterr().out)
    assert reported is not None
    assert p2os(shlex.split(reported[1])[1:]) == 0
    assert executed_by(folder)


def test_a_trial_takes_its_code_and_the_trust_in_it_along(folder: Path) -> None:
    with pytest.raises(UntrustedError):
        trial_of("mine.toml")
    trial = trial_of("mine.toml", trust=True)
    executed_by(folder)
    assert sorted(name.rpartition("/")[2] for name in trial.files) == ["aid_of_mine.py", "mine.py", MOTORS.name]
    assert run_trial(trial).verdict is TrialVerdict.PASSED
    assert executed_by(folder)
    name = next(name for name in trial.files if name.endswith("aid_of_mine.py"))
    other = type(trial)(
        name=trial.name, table=trial.table, files={**trial.files, name: b"AID = 2"}, trusted=trial.trusted
    )
    assert "is Python code" in run_trial(other).failures[0]
    assert executed_by(folder) == set()


def test_a_trial_that_was_written_is_trusted_by_its_content_alone(folder: Path) -> None:
    trial = trial_of("mine.toml", trust=True)
    path = trial.write(folder / "written")
    with pytest.raises(UntrustedError):
        load_scenario(str(path))
    assert load_scenario(str(path), trust=Trust(keys=trial.trusted)).body.endswith("mine.py:Own")
    (path.parent / str(trial.table["body"])).parent.joinpath("new.py").write_text("")
    with pytest.raises(UntrustedError):
        load_scenario(str(path), trust=Trust(keys=trial.trusted))


@pytest.mark.slow
@pytest.mark.parametrize("way", ["resume", "new folder"])
def test_a_campaign_runs_the_code_of_its_folder_with_trust_alone(
    way: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("pyarrow")
    words = ["campaign", "camp.toml", "--runs", "2", "-j", "1", "--out", "out"]
    assert p2os([*words, "--trust"]) == 0, capsys.readouterr().err
    assert executed_by(folder)
    if way == "resume":
        assert p2os(["campaign", "--resume", "out", "-j", "1"]) == 2
        assert executed_by(folder) == set()
        assert p2os(["campaign", "--resume", "out", "-j", "1", "--trust"]) == 0
    else:
        assert p2os(["run", "out/scenario/mine.toml"]) == 2
        assert executed_by(folder) == set()


def test_check_says_what_it_has_not_checked_and_executes_nothing(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder.parent / "config" / "p2os").mkdir(parents=True)
    (folder.parent / "config" / "p2os" / "config.toml").write_text(f'trust = ["{folder}"]\n')
    assert p2os(["check", "mine.toml", "swept.toml", "plain.toml"]) == 0
    reported = capsys.readouterr().out.splitlines()
    assert [line for line in reported if "not checked" in line] == [
        "not checked: code  mine.toml:4: body = ./mine.py:Own",
        "not checked: code  swept.toml:5: [sweep] body: body = ./mine.py:Own",
    ]
    (folder / "mine.toml").write_text(toml_text(SCENARIO | {"body": "./none.py:Own"}))
    assert p2os(["check", "mine.toml"]) == 1
    assert "mine.toml:4: body: there is no file ./none.py" in capsys.readouterr().out
    assert executed_by(folder) == set()


@pytest.mark.parametrize("words", [["explain", "RUN", "mine.toml"], ["campaign", "new", "mine.toml"]], ids=" ".join)
def test_what_needs_goals_or_keys_alone_executes_nothing(words: list[str], folder: Path) -> None:
    assert p2os(runs(words, folder)) == 0
    assert executed_by(folder) == set()


def test_a_new_project_trusts_itself_in_its_tests() -> None:
    template = files("robot_bench.cli.project").joinpath("template", "pytest.ini").read_text(encoding="utf-8")
    assert "\np2os_trust = .\n" in template


def test_the_configuration_trusts_without_the_option(folder: Path) -> None:
    (folder.parent / "config" / "p2os").mkdir(parents=True)
    (folder.parent / "config" / "p2os" / "config.toml").write_text(f'trust = ["{folder}"]\n')
    assert p2os(["run", "mine.toml"]) == 0
    assert executed_by(folder)


def test_what_the_command_line_names_itself_needs_no_trust(folder: Path) -> None:
    assert p2os(["run", "plain.toml", "--body", "./mine.py:Own"]) == 0
    assert executed_by(folder)


@pytest.mark.parametrize("name", ["../X", "/X", "a/../../X", "x\0"])
def test_a_run_folder_that_calls_itself_by_a_way_out_writes_nothing_there(name: str, folder: Path) -> None:
    runs(["RUN"], folder)
    trace = folder / "RUN" / TRACE_NAME
    first, rest = trace.read_text().split("\n", 1)
    trace.write_text(f"{json.dumps(json.loads(first) | {'scenario': name})}\n{rest}")
    with pytest.raises(FileError, match="leads out of the folder"):
        trial_of_run(folder / "RUN").write(folder / "out")
    with pytest.raises(UsageError, match="leads out of the folder"):
        make_next_folder(name, folder / "shrunk")
    assert not list(folder.parent.rglob("X*"))
