"""`p2os run --coverage --profile`: what it leaves, and that it changes nothing."""

import json
from pathlib import Path

import pytest

from bluepill_sim.program.image import load_image
from p2os.cli.main import run as p2os
from robot_bench.recording.run_folder import FILES
from robot_bench.run import RunProgress, RunResult, run_scenario
from robot_bench.scenario.loading import load_scenario
from robot_bench.scenario.scenario import Scenario
from tests.p2os.view.pages import ReadPage

CASES = [("python", "adapter"), ("native", "direct"), ("native", "adapter")]
COVERAGE = {"coverage.txt", "coverage.html", "coverage.info"}
PROFILE = {"profile.txt", "profile.folded", "profile.svg"}


def scenario(name: str = "dodge", mode: str = "adapter", duration_s: float = 1.5) -> Scenario:
    return load_scenario(name).with_options(mode=mode, body="kinematic", duration_s=duration_s)


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


@pytest.mark.parametrize(("core", "mode"), CASES)
def test_a_measured_run_has_the_trace_of_one_that_is_not(
    core: str, mode: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("P2OS_CORE", core)
    plain = run_scenario(scenario(mode=mode), tmp_path / "plain")
    measured = run_scenario(scenario(mode=mode), tmp_path / "measured", coverage=True, profile=True)
    assert measured.outcome["trace_sha256"] == plain.outcome["trace_sha256"]
    assert names(measured.folder) - names(plain.folder) == COVERAGE | PROFILE
    assert names(measured.folder) <= set(FILES)
    assert "coverage" not in plain.outcome


def test_both_cores_measure_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for core in ("native", "python"):
        monkeypatch.setenv("P2OS_CORE", core)
        run_scenario(scenario(), tmp_path / core, coverage=True, profile=True)
    for name in COVERAGE | PROFILE:
        assert (tmp_path / "native" / name).read_bytes() == (tmp_path / "python" / name).read_bytes(), name


def test_files_summary_and_page_tell_of_one_measurement(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["run", "sensors", "--mode", "direct", "--body", "kinematic", "--duration", "1s"]
    assert p2os([*words, "--out", str(tmp_path / "run"), "--coverage", "--profile", "--json"]) in {0, 1}
    outcome = json.loads(capsys.readouterr().out)
    folder, facts = tmp_path / "run", outcome["coverage"]
    text = (folder / "coverage.txt").read_text(encoding="utf-8")
    assert f"{facts['lines_hit']}/{facts['lines']} " in text
    assert "branches that went one way only:" in text
    info = (folder / "coverage.info").read_text(encoding="utf-8").splitlines()
    assert sum(int(line[3:]) for line in info if line.startswith("LH:")) == facts["lines_hit"]
    assert all(Path(line[3:]).is_file() for line in info if line.startswith("SF:"))
    folded = (folder / "profile.folded").read_text(encoding="utf-8").splitlines()
    assert outcome["profile"]["cycles"] >= sum(int(line.rsplit(" ", 1)[1]) for line in folded) > 0
    page = ReadPage((folder / "report.html").read_text(encoding="utf-8"))
    lists = [page.section(title)["blocks"][1]["items"] for title in ("Coverage", "Profile")]
    assert {link["href"] for links in lists for link in links} == COVERAGE | PROFILE
    assert "int main(void)" in (folder / "coverage.html").read_text(encoding="utf-8")
    assert p2os([*words, "--out", str(folder), "--force"]) in {0, 1}
    assert not names(folder) & (COVERAGE | PROFILE)


def test_one_of_the_two_is_enough_and_a_program_without_debug_information_is_measured(tmp_path: Path) -> None:
    image = load_image(scenario().firmware)
    (address, data), *_ = image.segments
    (tmp_path / "dodge.bin").write_bytes(data)
    assert address == image.linked_at
    bare = scenario(duration_s=0.5).with_options(firmware=tmp_path / "dodge.bin")
    folder = run_scenario(bare, tmp_path / "run", coverage=True).folder
    assert names(folder) & (COVERAGE | PROFILE) == {"coverage.txt", "coverage.html"}
    assert "no debug information and no symbols: by address" in (folder / "coverage.txt").read_text(encoding="utf-8")
    assert not names(run_scenario(bare, tmp_path / "profile", profile=True).folder) & COVERAGE


def test_an_interrupted_run_tells_what_ran_until_then(tmp_path: Path) -> None:
    def interrupt(progress: RunProgress) -> None:
        if progress.now > progress.duration_ns // 2:
            raise KeyboardInterrupt

    result: RunResult = run_scenario(scenario(), tmp_path / "run", coverage=True, on_progress=interrupt)
    assert result.was_interrupted
    assert names(result.folder) >= COVERAGE


@pytest.mark.parametrize("beside", [("--gdb", "0"), ("--port", "tcp:127.0.0.1:1")])
def test_what_cannot_be_measured_is_refused(
    beside: tuple[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert p2os(["run", "dodge", "--coverage", *beside]) == 2
    assert f"cannot stand beside {beside[0]}" in capsys.readouterr().err
    assert names(tmp_path) == set()
