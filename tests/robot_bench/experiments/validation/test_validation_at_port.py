"""What a robot at a port shows, in virtual time; each figure is seen to tell a planted error."""

import io
import json
import math
import subprocess
from functools import partial
from pathlib import Path

import pytest

from adapter_sim.codec import encoder_count
from adapter_sim.distances import Distances
from adapter_sim.encoders import Encoders
from p2os.cli.main import run as p2os
from robot_bench.cli import run as driving
from robot_bench.experiments.validation.experiments import EXPERIMENTS, AtPort
from robot_bench.experiments.validation.figures import LOOSE_BECAUSE, Missing, loose
from robot_bench.experiments.validation.trials import TrialResult, longest_s, port_runs, reported
from robot_bench.run import run_at_port
from tests.robot_bench.experiments.validation.virtual_port import FILES, GATE, at_port, virtual_line
from tests.tools.forked_python import forked_p2os

PLAIN = FILES / "plain.toml"
ROUND = ["motors", "codes", "encoders"]


@pytest.fixture
def gate(tmp_path: Path) -> Path:
    path = tmp_path / "gate.toml"
    path.write_text(GATE, encoding="utf-8")
    return path


def failing(found: list[TrialResult]) -> set[str]:
    return {failure.what for result in found for failure in result.failures}


@pytest.mark.soak  # all pairs of codes; `failing_of_itself` is what a few of them show
def test_motors_codes_and_encoders_hold_at_a_port(tmp_path: Path) -> None:
    found = at_port(ROUND, tmp_path / "v", world=PLAIN)
    assert [line for result in found for line in reported(result)] == []
    assert [result.experiment for result in found] == ROUND
    assert sorted(path.name for path in (tmp_path / "v").iterdir()) == ["codes", "motors"]  # one run for two
    assert set(loose(one for result in found for one in result.findings)) <= set(LOOSE_BECAUSE)


def test_a_robot_drives_through_a_gate_and_stops_and_its_pins_say_what_its_packets_do(
    gate: Path, tmp_path: Path
) -> None:
    found = at_port(["sensors", "only-while-seen"], tmp_path / "v", world=gate, duration_s=30.0)  # it stands by then
    assert [line for result in found for line in reported(result)] == []
    assert set(loose(one for result in found for one in result.findings)) <= set(LOOSE_BECAUSE)


@pytest.mark.slow
def test_a_drive_without_a_stall_holds_and_with_one_does_not(tmp_path: Path) -> None:
    assert reported(at_port(["dodge"], tmp_path / "v", world="arena", duration_s=20.0)[0]) == []
    blocked = at_port(["dodge"], tmp_path / "w", world="arena", faults=("wheel-blocked left",), duration_s=8.0)
    assert "packets with a stall" in failing(blocked)


def swapped(of: Encoders) -> tuple[int, int]:
    left, right = of.travel_nm
    return encoder_count(right, of._per_turn_nm, 3), encoder_count(left, of._per_turn_nm, 3)


def other_way(of: Encoders) -> tuple[int, int]:
    left, right = of.travel_nm
    return encoder_count(left, of._per_turn_nm, 3), encoder_count(-right, of._per_turn_nm, 3)


def wider(of: Encoders) -> tuple[int, int]:
    left, right = of.travel_nm
    return encoder_count(left, of._per_turn_nm, 3), encoder_count(right * 102 // 100, of._per_turn_nm, 3)


def short_failing(folder: Path) -> set[str]:
    """Return what fails of a run that is too short to reach every code."""
    return failing(at_port(["encoders"], folder, world=PLAIN, duration_s=8.0))


@pytest.fixture(scope="module")
def failing_of_itself(tmp_path_factory: pytest.TempPathFactory) -> set[str]:
    return short_failing(tmp_path_factory.mktemp("short") / "v")


@pytest.mark.parametrize("wrong", [swapped, other_way, wider], ids=["swapped", "sign", "scale 2 %"])
def test_encoders_that_are_wrong_are_reported_by_what_the_packets_tell(
    wrong: object, failing_of_itself: set[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Encoders, "counts", property(wrong))  # type: ignore[arg-type]  # of this class
    assert short_failing(tmp_path / "v") - failing_of_itself == {"encoder code against the packets' odometry"}


def test_a_pin_that_comes_a_packet_late_is_reported(
    gate: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    take, late = Distances.take, dict[int, int]()

    def take_late(self: Distances, number: int, range_um: int, now: int) -> None:
        take(self, number, late.get(number, range_um), now)
        late[number] = range_um

    monkeypatch.setattr(Distances, "take", take_late)
    found = at_port(["sensors"], tmp_path / "v", world=gate, duration_s=15.0)
    assert "readings in packets that stand on their pins" in failing(found)


def test_a_sonar_that_never_sees_is_reported(gate: Path, tmp_path: Path) -> None:
    (found,) = at_port(["sensors"], tmp_path / "v", world=gate, faults=("sonar-stuck 3 4.0",), duration_s=15.0)
    (failure,) = found.failures
    assert not isinstance(failure, Missing)
    assert (failure.what, failure.at) == ("sonar that saw something within the threshold and beyond", "not 3")


@pytest.mark.parametrize(
    ("faults", "lasts_s", "why"),
    [((), 8.0, "the line is gone"), (("line-noise 0.5",), math.inf, "the robot opened no session")],
)
def test_a_run_that_shows_nothing_is_missing_with_its_reason(
    faults: tuple[str, ...], lasts_s: float, why: str, tmp_path: Path
) -> None:
    (found,) = at_port(["motors"], tmp_path / "v", world=PLAIN, faults=faults, lasts_s=lasts_s)
    (line,) = reported(found)
    assert line.startswith("motors: the run: ")
    assert why in line


def test_every_experiment_says_how_it_goes_at_a_port_or_why_not() -> None:
    ways = {name: one.at_port for name, one in EXPERIMENTS.items()}
    assert [name for name, way in ways.items() if isinstance(way, str)] == [
        "capped",
        "sensors-all",
        "silence",
        "long-drive",
        "sparse",
        "slip",
    ]
    assert all(len(way) < 90 for way in ways.values() if isinstance(way, str))
    runs = port_runs(list(EXPERIMENTS.values()))
    assert [len(run.experiments) for run in runs] == [1, 2, 2, 1]
    assert longest_s(runs) == 16 + 90 + 45 + 60
    assert all(isinstance(way, (str, AtPort)) for way in ways.values())
    for run in runs:
        assert run.scenario.adapter.step_um_per_s == 40_000


def test_what_is_not_done_at_a_port_and_what_room_is_needed_is_said_before_anything_moves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.stdin", io.StringIO())
    assert p2os(["validate", "slip", "sensors", "--port", f"pty:{tmp_path}/line"]) == 1
    err = capsys.readouterr().err
    assert "not at a port: slip: wheels that spin against a wall harm a robot" in err
    assert "the robot needs two boxes 0.3 m long" in err
    assert "nobody said yes" in err
    assert list(tmp_path.glob("runs/*")) == []


def holds(out: str) -> None:
    """See that the command has passed, and what it has written in `v`."""
    assert "motors      1 of 1" in out
    (result,) = json.loads(Path("v/validation.json").read_text(encoding="utf-8"))["results"]
    figures = {figure["what"]: figure for figure in result["figures"]}
    assert figures["steady rim speed"]["expected"] in {120.0, -160.0, 0.0}
    assert figures["VEL for a pair of codes"]["bound"]["value"] == 0.5
    assert abs(figures["the same by the packets' odometry"]["difference"]) < 10
    assert Path("v/motors/report.html").is_file()


#: So long as it holds its last pair for a second.
AT_PORT = ["validate", "motors", "--yes", "--out", "v", "--set", "duration_s=13.0", "--port"]


def test_a_robot_is_validated_at_its_port(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """By the command, on a line of virtual time; how it drives on one of real time is `run/test_port.py`'s."""
    monkeypatch.chdir(tmp_path)
    line, opened = virtual_line("arena"), list[str]()
    monkeypatch.setattr(driving, "open_url", lambda url: opened.append(url) or line)
    monkeypatch.setattr(driving, "run_at_port", partial(run_at_port, **line.time))
    assert p2os([*AT_PORT, "tcp:127.0.0.1:8101"]) == 0
    assert opened == ["tcp:127.0.0.1:8101"]
    holds(capsys.readouterr().out)


@pytest.mark.soak
def test_a_served_robot_is_validated_at_its_port(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    served = forked_p2os("serve", "--port", "tcp:127.0.0.1:0", "--body", "kinematic", "--world", "arena", "--json")
    process = subprocess.Popen(served, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        url = str(json.loads(process.stdout.readline())["url"])
        code = p2os([*AT_PORT, url])
    finally:
        process.terminate()
        process.communicate(timeout=30)
    failures = json.loads(Path("v/motors/summary.json").read_text(encoding="utf-8"))["failures"]
    if any("lagged" in failure for failure in failures):
        pytest.skip("this machine is too busy for real time now")
    assert code == 0
    holds(capsys.readouterr().out)
