"""Every verb that reads a file of a user's refuses one that has no end or is huge, before it holds it."""

import re
import resource
from importlib.resources import files
from pathlib import Path

import pytest

from p2os.cli.main import run

MOTORS = files("robot_bench.firmware").joinpath("motors.elf")
#: Verbs, `{}` where the file stands, which has this ending.
VERBS = (
    ("mcu run {}", "elf"), ("mcu info {}", "elf"), ("mcu trace {}", "elf"), ("mcu coverage {}", "elf"),
    ("mcu profile {}", "elf"), ("mcu pins {}", "elf"), ("mcu debug {}", "elf"), ("mcu compare-silicon {}", "log"),
    ("mcu compare-cores {}", "elf"),
    (f"mcu run {MOTORS} --attach sd-card,on=SPI1,select=PA4,image={{}}", "img"),
    ("check {}", "toml"), ("run {}", "toml"), ("run dodge --firmware {}", "elf"), ("run dodge --world {}", "toml"),
    ("run dodge --world {}", "map"), ("run dodge --inputs {}", "jsonl"),
    ("world check {}", "toml"), ("world check {}", "map"), ("world check {}", "yaml"), ("world check {}", "sdf"),
    ("world check {}", "urdf"), ("world check {}", "obj"), ("world check {}", "stl"), ("world check {}", "dae"),
    ("world check {}", "gltf"), ("world check {}", "glb"),
    ("serve --fleet {}", "toml"), ("serve --robot {}", "toml"), ("serve --flash {}", "toml"),
    ("serve --errors {}", "toml"), ("serve --world {}", "toml"),
    ("metrics {}", "csv"), ("metrics {}", "tum"), ("compare {} {}", "csv"), ("explain {}", "jsonl"),
    ("campaign {}", "toml"), ("mutate {} dodge", "elf"), ("shrink {}", "toml"),
    ("fit {} --robot p2dx", "csv"),
)  # fmt: skip
#: Of which a run's folder is named.
FOLDERS = ("report {}", "diff {} {}", "explain {}", "metrics {}", "run dodge --inputs {}")
#: chosen: what reading one, and all that a verb imports, may add to what this process holds.
MOST_MIB = 400


#: A verb for each way of reading; the others are tried in `make soak`.
SAMPLE = {"mcu run {}", "run {}", "explain {}", "metrics {}", "mutate {} dodge"}


#: A card of a gigabyte is one that there is: the device fills it before it is refused.
ROWS = [(*row, kind) for row in (*VERBS, *((folder, "") for folder in FOLDERS)) for kind in ("sparse", "device")
        if row[1] != "img" or kind == "sparse"]  # fmt: skip


@pytest.mark.parametrize(
    ("verb", "ending", "kind"),
    [pytest.param(*row, marks=[] if row[0] in SAMPLE else pytest.mark.soak) for row in ROWS],
)
def test_a_verb_refuses_it_in_one_line(
    verb: str, ending: str, kind: str, tmp_path: Path, capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    path = tmp_path / (f"a.{ending}" if ending else "trace.jsonl")
    if kind == "device":
        path.symlink_to("/dev/zero")
    else:
        with path.open("wb") as file:
            file.truncate(3 << 30)
    before_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    words = verb.replace("{}", path.name if ending else str(tmp_path)).split()
    code = run(words)
    said = capfd.readouterr()
    assert code == (1 if verb.startswith("check") else 2)
    assert re.search("(larger|longer) than|there is no|holds no|no robot file|a card of", said.out + said.err), said
    assert len(said.err.splitlines()) <= 2
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kib < MOST_MIB << 10
