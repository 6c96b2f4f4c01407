"""The script that lays robots of any maker side by side: what it measures, and a robot of ours through all of it."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from p2os.protocol.sip import StandardSip
from tools.bench.peers.peer_figures import FIGURES, Sample, main, slope, table


def sample(robot_s: float, forward: float) -> Sample:
    return Sample(t=0, robot_s=robot_s, forward=forward, turn=0, x=0, y=0, heading=0, sip=StandardSip())


def test_a_slope_is_that_of_the_ramp_alone_and_of_two_packets_none() -> None:
    ramp = [sample(n / 10, min(300.0, 20.0 * n)) for n in range(40)]
    assert slope(ramp, lambda one: one.forward, 30, 270) == pytest.approx(200)
    assert slope(ramp[:4], lambda one: one.forward, 30, 270) is None


def test_what_was_not_measured_is_no_number_in_the_table() -> None:
    lines = table(["a", "b"], [{"packet period": 100.0}, {}]).splitlines()
    assert lines[2] == "| packet period, ms | 100 | 100 | - |"
    assert len(lines) == 2 + len(FIGURES)


def test_nobody_at_the_port_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["tcp:127.0.0.1:1"]) == 1
    assert capsys.readouterr().err.startswith("peer_figures: ")


@pytest.mark.soak
def test_a_robot_of_ours_does_what_the_manual_says(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    world = Path(__file__).parents[3] / "robot_bench/experiments/validation/scenarios/plain.toml"
    words = ["serve", "--robot", "p3dx", "--body", "kinematic", "--world", str(world), "--port", "tcp:127.0.0.1:0"]
    process = subprocess.Popen([sys.executable, "-m", "p2os", *words, "--json"], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        assert main([f"ours={json.loads(process.stdout.readline())['url']}", "--record", str(tmp_path)]) == 0
    finally:
        process.terminate()
        process.communicate(timeout=30)
    found = {row.split(" | ")[0].strip("| "): row.split(" | ")[2].strip("| ") for row in
             capsys.readouterr().out.splitlines()[2:]}  # fmt: skip
    for name, value, within in (
        ("acceleration, SETA, mm/s2", 200, 4), ("deceleration, SETA < 0, mm/s2", 400, 12),
        ("speed of VEL, mm/s", 300, 1),
        ("rate of RVEL, deg/s", 40, 1), ("turned by DHEAD 90, deg", 90, 1), ("way of MOVE -500, mm", -500, 3),
        ("watchdog stops after, s", 2, 0.4), ("speed with motors off, mm/s", 0, 0), ("x after SETO, mm", 0, 0),
    ):  # fmt: skip
        assert float(found[name]) == pytest.approx(value, abs=within), name
    assert (tmp_path / "ours.jsonl").stat().st_size > 10_000
