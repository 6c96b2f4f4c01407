"""What a shrunk failure is kept as: a folder that anybody can run, look at and add to a test suite.

    NAME.toml          the scenario, with its goal; its firmware and world beside it: `p2os run FOLDER/NAME.toml`
    test_NAME.py       the same as a test that fails as it stands: `pytest FOLDER`
    scene.png          world and path (where Matplotlib is installed)
    explained.txt      what `p2os explain` says of it
    run                its run folder, with the report

The run is made by another process, from the files alone.

Invariant: `is_confirmed` means that the other process left the trace of this one.
"""

import hashlib
import json
import re
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast

from p2os.pioneer.world import known_worlds, load_world
from p2os.pioneer.world.writer import write_world
from p2os.toml_record import number_of, table_of
from robot_bench.campaign.trial import Outcome, Trial, TrialVerdict, run_trial, trial_of
from robot_bench.campaign.variants.shrinking.failure import FailureMode
from robot_bench.campaign.variants.shrinking.things import WORLD_NAME
from robot_bench.recording.run_folder import TRACE_NAME
from robot_bench.recording.run_record import RunRecord, read_run
from robot_bench.report import make_scene
from robot_bench.report.explain.explain import explain
from simbase.errors import P2osError, UsageError, shown_name
from simbase.files import write_text, writing
from simbase.trust import Trust

#: The folder of the run within.
RUN_NAME = "run"
#: chosen: longer than the other process takes for an hour of virtual time.
_MOST_S = 3600
_COMMAND = (sys.executable, "-P", "-c", "from p2os.cli.main import main; main()")
_HINT = "give the scenario itself, with --firmware where the program is elsewhere"


@dataclass(frozen=True, slots=True, kw_only=True)
class Kept:
    """A failure in a folder."""

    scenario: Path
    test: Path
    #: The other process found the same: it fails, and its trace has the hash that it has here.
    is_confirmed: bool
    outcome: Outcome
    explained: str


def keep(trial: Trial, way: FailureMode, folder: Path) -> Kept:
    """Write a failing trial into a folder, and run it there in another process.

    Args:
        trial: It fails.
        way: How.
        folder: Made where it is missing; files of the same names are overwritten.

    Raises:
        FileError: The folder cannot be written.
        P2osError: The other process cannot be begun, or its run cannot be read, or explained.
    """
    scenario = trial.write(folder)
    trust = ["--trust"] if trial.trusted else []
    test = folder / f"test_{_identifier(trial.name)}.py"
    write_text(test, test_text(trial, way))
    try:
        found = subprocess.run(  # noqa: S603 - this interpreter, with files of our own
            [*_COMMAND, "run", scenario, *trust, "--out", folder / RUN_NAME, "--force", "--json"],
            capture_output=True, text=True, timeout=_MOST_S, check=False,
        )  # fmt: skip
        there = json.loads(found.stdout) if found.stdout.startswith("{") else {}
    except (OSError, ValueError) as error:
        raise P2osError(f"cannot run {shown_name(scenario)}: {error}", hint="end other programs") from error
    record = None
    if (folder / RUN_NAME / TRACE_NAME).is_file():  # several robots have one each
        record, scene = read_run(folder / RUN_NAME), folder / "scene.png"
        with writing(scene):
            make_scene(record, scene)
    here = run_trial(trial)
    explained = "" if record is None else _explained(record, folder / trial.firmware_name)
    if explained:
        write_text(folder / "explained.txt", f"{explained}\n")
    hashes = there.get("trace_sha256") or there.get("sha256")
    is_same = hashes == here.sha256 or "robots" in there  # several robots have a hash each, there
    return Kept(
        scenario=scenario, test=test, outcome=here, explained=explained,
        is_confirmed=found.returncode == 1 and here.verdict is TrialVerdict.FAILED and is_same,
    )  # fmt: skip


def test_text(trial: Trial, way: FailureMode) -> str:
    """Return a test of pytest that runs a trial's scenario, and fails while it fails."""
    wanted = "never ends in a fault" if way.is_fault else way.what
    judged = (
        "    assert not bench.chip.has_died, bench.chip.verdict\n"
        if way.is_fault
        else "    assert bench.judge().missed == []\n"
    )
    return (
        f'"""Shrunk by `p2os shrink`: {_plain(str(way))}. With a mended program: pytest --firmware FILE."""\n\n'
        "import pytest\n\n\n"
        f"@pytest.mark.scenario({json.dumps(f'{trial.name}.toml')})\n"
        f"def test_{_identifier(trial.name)}_{_identifier(wanted)}(bench):\n"
        f'    bench.run_until("{number_of(trial.table, "duration_s"):g} s")\n'
        f"{judged}"
    )


def trial_of_run(folder: Path, firmware: Path | None = None, *, trust: bool | Trust = False) -> Trial:
    """Return the trial that a run folder is of, from the scenario's file and what was set beside it.

    Args:
        folder: The run folder of one robot.
        firmware: Takes the place of the program that ran.
        trust: As of `load_scenario`.

    Raises:
        UntrustedError: As of `load_scenario`.
        UsageError: The scenario's file or the program are gone, or were changed since.
        TraceError: It is no run folder.
    """
    record = read_run(folder)
    meta = record.meta
    path = str(meta.get("scenario_path") or "")
    if not Path(path).is_file():
        where = path or "the run does not name it"
        raise UsageError(f"the scenario of {folder} is not here any more: {where}", hint=_HINT)
    program = firmware or Path(str(meta["firmware_path"]))
    if not program.is_file():
        raise UsageError(f"the program of {folder} is not here any more: {program}", hint=_HINT)
    settings = [(str(key), value) for key, value in cast("list[list[object]]", meta.get("settings") or [])]
    # What options of the command line may have set.
    settings += [(key, meta[key]) for key in ("mode", "body") if meta.get("mode") != "port"]
    settings += [("seed", meta["seed"]), ("duration_s", number_of(meta, "duration_s"))]
    trial = _in_world(trial_of(path, firmware=program, settings=settings, trust=trust), str(meta["world_path"]))
    _refuse_another(record, trial, folder, firmware)
    return replace(trial, name=str(meta["scenario"]))


def _in_world(trial: Trial, world: str) -> Trial:
    """Return the trial in the world that it ran in, where `--world` had named another one than the scenario does."""
    own = str(trial.table["world"])
    if world == own or Path(world).name == own:
        return trial
    there = table_of(table_of(trial.table, "in_world"), world)
    table = {key: value for key, value in trial.table.items() if key != "start"} | dict(there)
    if world in known_worlds():
        return replace(trial, table={**table, "world": world})
    text = write_world(load_world(world, seed=trial.seed))
    return replace(trial, table={**table, "world": WORLD_NAME}, files={**trial.files, WORLD_NAME: text.encode()})


def _refuse_another(record: RunRecord, trial: Trial, folder: Path, firmware: Path | None) -> None:
    """Refuse a run whose program was built anew since, unless another one is asked for."""
    here = hashlib.sha256(trial.files[trial.firmware_name]).hexdigest()
    if firmware is None and here != record.meta["firmware_sha256"]:
        raise UsageError(f"the program of {folder} was built anew since", hint="--firmware FILE takes another one")


def _explained(record: RunRecord, firmware: Path) -> str:
    try:
        return explain(record, firmware).text()
    except P2osError:  # a robot on pins of its own
        return ""


def _identifier(text: str) -> str:
    return re.sub(r"\W+", "_", text, flags=re.ASCII).strip("_").lower()


def _plain(text: str) -> str:
    return re.sub(r'["\\\n]', " ", text)
