"""Files of ours have versions: a sample of each is kept and read, and a later one is refused in a line."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from p2os.capture.formats.recording import RECORDING
from p2os.capture.formats.sources import read_file
from p2os.cli.main import run as p2os
from p2os.pioneer.world import load_world
from p2os.pioneer.world.file import WORLD
from p2os.pioneer.world.writer import write_world
from robot_bench.campaign.campaign_file import CAMPAIGN, load_campaign
from robot_bench.events.codec import TRACE
from robot_bench.recording.run_record import read_run
from robot_bench.scenario.included_files import SCENARIO
from robot_bench.scenario.loading import load_scenario
from simbase.errors import FileError
from simbase.files import VersionedFormat

SAMPLES = Path(__file__).parents[2] / "golden" / "formats"


@dataclass(frozen=True)
class Kept:
    """A format, whose samples are `SAMPLES/NAME/VERSION.ENDING`, or `unversioned` for one that says none."""

    name: str
    format: VersionedFormat
    ending: str
    #: What a file holds, comparable.
    read: Callable[[Path], object]
    #: The text of a first line of a later version, in place of that of the newest.
    later: tuple[str, str]
    #: The command that reads a file.
    verb: tuple[str, ...]


def scenario(path: Path) -> object:
    found = load_scenario(str(path))
    return found.seed, found.duration_ns, found.start, found.threshold_m, [goal.kind for goal in found.goals]


def world(path: Path) -> object:
    found = load_world(str(path))
    return found.name, found.start, found.extent, found.obstacles


def campaign(path: Path) -> object:
    found = load_campaign(path)
    return found.search, found.seed, found.budget, found.full, found.vary, found.disturbances


def trace(path: Path) -> object:
    """Return what two versions of a run have alike: they were made of one program, seed and world."""
    folder = path.parent / "run"
    folder.mkdir(exist_ok=True)
    (folder / "trace.jsonl").write_bytes(path.read_bytes())
    found = read_run(folder)
    assert not found.is_cut
    assert found.pins
    assert found.wire
    return found.meta["scenario"], found.meta["seed"], [line for _, line in found.usart_lines()], found.last_ns


def capture(path: Path) -> object:
    return read_file(path).chunks


KEPT = (
    Kept("scenario", SCENARIO, "toml", scenario, ("version = 1", "version = 2\nthruster = 3"), ("run",)),
    Kept("world", WORLD, "toml", world, ("version = 1", "version = 2\nthruster = 3"), ("world", "check")),
    Kept("campaign", CAMPAIGN, "toml", campaign, ("version = 1", "version = 2\nthruster = 3"), ("campaign",)),
    Kept("trace", TRACE, "jsonl", trace, ('"trace": 2', '"trace": 3'), ("report",)),
    Kept("capture", RECORDING, "jsonl", capture, ('"version": 1', '"version": 2'), ("decode",)),
)  # fmt: skip
ROWS = pytest.mark.parametrize("kept", KEPT, ids=lambda kept: kept.name)


def sample(kept: Kept, version: object, folder: Path) -> Path:
    path = folder / f"{version}.{kept.ending}"
    path.write_bytes((SAMPLES / kept.name / path.name).read_bytes())
    return path


@ROWS
def test_a_sample_of_each_version_is_read(kept: Kept, tmp_path: Path) -> None:
    """Whoever raises a version keeps a sample of it, and a reader of those before."""
    found = [kept.read(sample(kept, version, tmp_path)) for version in range(1, kept.format.newest + 1)]
    assert all(one == found[0] for one in found)
    held = {path.stem for path in (SAMPLES / kept.name).iterdir()} - {"unversioned"}
    assert held == {str(version) for version in range(1, kept.format.newest + 1)}


@ROWS
def test_a_file_that_says_no_version_is_of_the_first(kept: Kept, tmp_path: Path) -> None:
    first = sample(kept, 1, tmp_path)
    if kept.format is TRACE:
        assert '"trace"' not in first.read_text(encoding="utf-8").partition("\n")[0], "the first said none"
        return
    assert kept.read(sample(kept, "unversioned", tmp_path)) == kept.read(first)


@ROWS
def test_a_later_version_is_one_line_with_a_hint_and_exit_code_2(
    kept: Kept, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = sample(kept, kept.format.newest, tmp_path)
    text = path.read_text(encoding="utf-8")
    assert kept.later[0] in text
    path.write_text(text.replace(*kept.later, 1), encoding="utf-8")
    named = path
    if kept.format is TRACE:
        (tmp_path / "run").mkdir()
        named = path.rename(tmp_path / "run" / "trace.jsonl").parent
    assert p2os([*kept.verb, str(named)]) == 2
    later = kept.format.newest + 1
    assert re.fullmatch(
        rf"p2os: .*{kept.format.name} of version {later}, and this program reads up to {kept.format.newest}\n"
        r"hint: install a newer version\n",
        capsys.readouterr().err,
    )


@pytest.mark.parametrize("said", [0, -1, 1.0, True, "1", pytest.param(10**5000, id="huge")])
def test_what_is_no_version_is_refused(said: object) -> None:
    with pytest.raises(FileError, match=r"^here: (version = .* is no version of a thing|a thing of version a huge)"):
        VersionedFormat("a thing", newest=3).version_of(said, "here")


def test_every_version_up_to_the_newest_is_one() -> None:
    form = VersionedFormat("a thing", newest=3)
    assert [form.version_of(said) for said in (None, 1, 2, 3)] == [1, 1, 2, 3]
    with pytest.raises(FileError, match=r"^a thing of version 4, and this program reads up to 3"):
        form.version_of(4)


def test_what_is_written_says_its_version() -> None:
    assert write_world(load_world("room")).startswith(f"version = {WORLD.newest}\n")
