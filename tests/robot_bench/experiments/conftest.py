"""The verbs that pyproject.toml declares, whatever is installed; drives and runs to compare."""

import tomllib
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from p2os.cli import main
from tests.tools.made_once import made_once

np = pytest.importorskip("numpy")
pytest.importorskip("scipy")
ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def p2os(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    """Run a command line in an empty folder; return its exit code."""
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["entry-points"]
    verbs = {name: EntryPoint(name, value, main.GROUP) for name, value in declared["p2os.verbs"].items()}
    monkeypatch.setattr(main, "installed_points", lambda _group: verbs)
    monkeypatch.chdir(tmp_path)
    return lambda *words: main.run([str(word) for word in words])


@pytest.fixture(scope="session")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with `near` and `far`: dodge with two thresholds, 16 s."""

    def make(folder: Path) -> Path:
        from robot_bench.run import run_scenario
        from robot_bench.scenario.loading import load_scenario

        for name, threshold_m in (("near", 0.6), ("far", 0.9)):
            scenario = load_scenario("dodge", settings=[("threshold_m", threshold_m)])
            run_scenario(scenario.with_options(body="kinematic", duration_s=16.0), folder / name)
        return folder

    return made_once(tmp_path_factory, "compared-runs", make)
