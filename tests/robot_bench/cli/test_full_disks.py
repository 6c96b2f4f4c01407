"""Every verb that writes: where the system has no room for it, one line names the file, and nothing is a bug.

The limit of the size of a file stands in for a full disk: a write fails in the middle of a file, wherever that is.
"""

import json
import os
import shutil
import subprocess
import sys
from importlib.resources import files
from pathlib import Path

import pytest

from tests.tools.forked_python import forked_python
from tests.tools.made_once import made_once

MOTORS = files("robot_bench.firmware").joinpath("motors.elf")
SCENARIO = """
extends = "dodge"
duration_s = 2
body = "kinematic"
"""
CAMPAIGN = """
scenario = "dodge"
search = "random"
batch = 2
[budget]
runs = 4
confirmations = 2
[cheap]
mode = "direct"
duration_s = 2
[full]
mode = "adapter"
duration_s = 2
body = "kinematic"
[vary]
start.heading_deg = { from = 0, to = 350, step = 10 }
[[goal]]
kind = "no_collision"
"""
#: What a child does: no file of it becomes larger than its first word says.
CHILD = """
import resource, sys, tempfile
from p2os.cli.main import run
sys.dont_write_bytecode = True  # Python itself leaves half a file of code there
size = int(sys.argv[1])
tempfile.tempdir = "tmp"
resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))
sys.exit(run(sys.argv[2:]))
"""
#: Verbs, and up to which size of a file each is refused at least.
VERBS = (
    ("run a.toml --out o", 3000),
    ("run a.toml --out o --coverage --profile", 3000),
    ("run a.toml --out o --junit j.xml --seeds 0-1", 300),
    ("report c", 20_000),
    ("report c --events e.jsonl", 3000),
    ("report c --events e.parquet", 3000),
    ("report c --events e.mcap", 20_000),
    ("report c --events bag --ros2 mcap", 20_000),
    ("report c --events bag --ros2 sqlite3", 20_000),
    ("campaign b.toml --out o -j 1", 3000),
    ("campaign new dodge --out o.toml", 300),
    ("shrink a.toml --out o", 3000),
    ("new proj", 3000),
    ("world new --kind maze --seed 7 --out w.toml", 300),
    ("world show room --out w.svg", 3000),
    ("world convert room --out w.sdf", 3000),
    ("world convert room --out w.glb", 3000),
    ("export c e.csv", 300),
    ("export c e.parquet", 3000),
    ("export c e.arrow", 3000),
    ("export c e.mcap", 3000),
    ("fit --example o", 20_000),
    ("compare c c --html p.html", 20_000),
    ("compare c c --picture p.png", 3000),
    ("compare c c --tum t", 300),
    ("metrics c --picture m.png", 3000),
    ("sensitivity a.toml --vary threshold_m=0.3..0.6 --steps 2 --trajectories 0 --picture s.png", 3000),
    ("validate sensors --mode direct --body kinematic --out v", 300),
    (f"mcu run {MOTORS} --for 30ms --uart u.txt", 0),
    (f"mcu run {MOTORS} --for 30ms --itm i.txt --swo s.bin --uart u.txt", 0),
    (f"mcu run {MOTORS} --for 30ms --attach ssd1306,on=I2C1 --parts shots", 300),
    (f"mcu trace {MOTORS} --for 10ms --out t.txt", 20_000),
    (f"mcu coverage {MOTORS} --for 10ms --lcov c.info", 3000),
    (f"mcu profile {MOTORS} --for 10ms --flame p.svg --folded p.folded", 3000),
    (f"mcu pins {MOTORS} --for 30ms --vcd p.vcd --sr p.sr", 3000),
)
#: A verb for each way of writing; the others, and all sizes, are tried in `make soak`.
SAMPLE = {
    "run a.toml --out o": (300,), "report c": (3000,), "report c --events bag --ros2 mcap": (300,),
    "report c --events bag --ros2 sqlite3": (300,), "report c --events e.mcap": (300,), "export c e.parquet": (300,),
    "campaign b.toml --out o -j 1": (3000,), f"mcu trace {MOTORS} --for 10ms --out t.txt": (300,),
    f"mcu run {MOTORS} --for 30ms --uart u.txt": (0,),
}  # fmt: skip
SIZES = (0, 10, 300, 3000, 20_000)
ROWS = [
    pytest.param(verb, size, marks=[] if size in SAMPLE.get(verb, ()) else pytest.mark.soak)
    for verb, most in VERBS for size in SIZES if size <= most
]  # fmt: skip


def child(folder: Path, size: int, words: str) -> subprocess.CompletedProcess[str]:
    """Run a verb in a folder in which no file becomes larger than a size."""
    (folder / "tmp").mkdir(exist_ok=True)
    return subprocess.run(
        [forked_python(), "-c", CHILD, str(size), *words.split()],
        cwd=folder, capture_output=True, text=True, check=False, timeout=120,
    )  # fmt: skip


def make_run(folder: Path) -> Path:
    """Make a run of two seconds."""
    (folder / "a.toml").write_text(SCENARIO, encoding="utf-8")
    assert "FAILED" in child(folder, 1 << 30, "run a.toml --out c").stdout  # its goals want more than two seconds
    return folder / "c"


@pytest.fixture
def place(tmp_path: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a scenario, a campaign and a run."""
    shutil.copytree(made_once(tmp_path_factory, "short-run", make_run), tmp_path / "c")
    (tmp_path / "a.toml").write_text(SCENARIO, encoding="utf-8")
    (tmp_path / "b.toml").write_text(CAMPAIGN, encoding="utf-8")
    return tmp_path


def refused(done: subprocess.CompletedProcess[str]) -> None:
    """Look at what a verb said that had no room."""
    assert done.returncode in {1, 2}
    assert "bug" not in done.stderr
    assert "Traceback" not in done.stderr
    assert "ignored" not in done.stderr
    *_, line, hint = done.stderr.splitlines()
    assert line.startswith("p2os: ")
    assert "cannot write" in line
    assert hint.startswith("hint: ")


@pytest.mark.parametrize(("verb", "size"), ROWS)
def test_no_room_is_reported_in_one_line_with_the_file_and_what_a_run_has_is_kept(
    verb: str, size: int, place: Path
) -> None:
    before = {path: path.read_bytes() for path in (place / "c").iterdir()}
    refused(child(place, size, verb))
    assert {path: path.read_bytes() for path in before} == before
    assert not list(place.rglob("*.part"))


@pytest.mark.parametrize(
    "verb", ["world list", f"mcu run {MOTORS} --for 20ms", "decode c", "metrics c", "--help", "export c -"]
)
def test_a_full_standard_output_is_no_bug(verb: str, place: Path) -> None:
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        done = subprocess.run(
            [forked_python(), "-m", "p2os", *verb.split()],
            cwd=place, stdout=full, stderr=subprocess.PIPE, text=True, check=False, timeout=60,
        )  # fmt: skip
    refused(done)
    assert "no space left on device" in done.stderr


@pytest.mark.parametrize(
    ("where", "code", "said"),
    [
        (">/dev/full", 1, "p2os: cannot write standard output: no space left on device\nhint: "),
        (">&-", 0, "45 packets"),
        ("| true", 1, ""),
    ],
)
def test_output_that_is_written_when_a_verb_has_ended_is_no_bug(where: str, code: int, said: str, place: Path) -> None:
    """As in most shells: where PYTHONUNBUFFERED is set, each line is written at once."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    line = f'( "{sys.executable}" -m p2os decode c; echo $? >code ) {where}'
    done = subprocess.run(
        ["sh", "-c", line], cwd=place, env=environment, stderr=subprocess.PIPE, text=True, check=False, timeout=60
    )
    assert (place / "code").read_text() == f"{code}\n"
    assert done.stderr.startswith(said)
    assert len(done.stderr.splitlines()) == (2 if code and said else bool(said))


@pytest.mark.parametrize(
    "size", [3000, *(pytest.param(size, marks=pytest.mark.soak) for size in (0, 300, 20_000, 30_000))]
)
def test_a_campaign_that_a_full_disk_has_ended_goes_on_or_begins_anew(size: int, place: Path) -> None:
    whole = child(place, 1 << 30, "campaign b.toml --out w -j 1")
    assert whole.returncode == 0, whole.stderr
    refused(child(place, size, "campaign b.toml --out o -j 1"))
    again = child(place, 1 << 30, "campaign --resume o -j 1")
    if again.returncode:  # it was not begun: then it can be
        again = child(place, 1 << 30, "campaign b.toml --out o -j 1")
    assert again.returncode == 0, again.stderr
    found, wanted = (json.loads((place / name / "summary.json").read_text(encoding="utf-8")) for name in "ow")
    assert found == wanted


def test_a_campaign_whose_beginning_was_killed_says_so(place: Path) -> None:
    (place / "o/scenario").mkdir(parents=True)
    done = child(place, 1 << 30, "campaign --resume o")
    assert done.returncode == 2
    assert "was not begun to its end" in done.stderr
    assert "hint: remove it, and begin anew" in done.stderr
