"""The rover with its own program: timers, ADC and DMA of the chip, bridges, motors and encoders, in the bench."""

import math
import pickle
import re
from pathlib import Path

import pytest

from robot_bench.bench import Bench, run_of
from robot_bench.bench.board import pins_of
from robot_bench.firmware import build
from robot_bench.recording.run_record import RunRecord
from robot_bench.run import run_scenario
from robot_bench.scenario.loading import load_scenario
from robot_bench.scenario.scenario import Scenario
from tests.robot_bench.direct.robots import rover

MM = 1000
#: The first leg and its corner on the kinematic body are in the tests that `p2os new --robot rover` writes.
BODIES = [
    pytest.param("kinematic", marks=pytest.mark.soak),
    pytest.param("bullet", marks=[pytest.mark.soak, pytest.mark.bullet]),
]
#: "rover: left 299 right 299 mm/s, 12352 mV"
_SPEEDS = re.compile(r"^rover: left (-?\d+) right (-?\d+) mm/s, (\d+) mV$")


def bench(scenario: Scenario | str = "rover", until: str = "0 s", **options: object) -> Bench:
    made = Bench.from_scenario(scenario, body="kinematic", **options)  # type: ignore[arg-type]
    made.run_until(until)
    return made


@pytest.fixture(scope="module")
def first_leg() -> RunRecord:
    """The first two seconds: the ramp, and cruising."""
    made = bench(until="2.05 s")
    made.finish()
    assert made.chip.warnings == []
    return made.record()


@pytest.mark.parametrize("body", BODIES)
def test_it_drives_its_square_and_comes_back(body: str, tmp_path: Path) -> None:
    result = run_scenario(load_scenario("rover").with_options(body=body), tmp_path)
    assert result.outcome["failures"] == []
    assert result.passed


def test_it_holds_300_mm_s_within_2_mm_s(first_leg: RunRecord) -> None:
    cruise = [pose for pose in first_leg.poses if pose.t >= 900_000_000]
    assert len(cruise) > 20
    for pose in cruise:
        assert pose.left == pytest.approx(300 * MM, abs=2 * MM)
        assert pose.right == pytest.approx(300 * MM, abs=2 * MM)
    assert max(pose.left for pose in first_leg.poses) < 315 * MM, "it overshoots by a twentieth at most"


def test_what_it_prints_is_so(first_leg: RunRecord) -> None:
    said = [(at, match) for at, line in first_leg.usart_lines() if (match := _SPEEDS.match(line))]
    assert [round(at / 1e8) for at, _ in said] == [6, 11, 16], "each half a second from 0.1 s on"
    for at, match in said:
        # 12.6 V, less what idle current and two motors take of it through 0.12 ohm.
        assert 12_000 < int(match[3]) < 12_600
        # It prints what it measured over half a second: the ramp, then 300 mm/s to an edge in that time.
        assert int(match[1]) == pytest.approx(155 if at < 700_000_000 else 300, abs=2)


def test_the_edges_on_the_wires_are_the_wheel_s_turns(first_leg: RunRecord) -> None:
    for side, angles in (("left", "left_angle"), ("right", "right_angle")):
        for pose in first_leg.poses[10:40:10]:
            # Each edge comes a step after the wheel was there.
            edges = sum(
                1 for name in ("a", "b") for at, _ in first_leg.pins[f"{side}_{name}"] if 0 < at <= pose.t + 1_000_000
            )
            assert edges == pytest.approx(getattr(pose, angles) / 1e6 / (2 * math.pi) * 1632, abs=1.01)


def test_its_pwm_is_recorded_as_20_kilohertz_with_a_row_a_change(first_leg: RunRecord) -> None:
    waves = [wave for _, wave in first_leg.waves["left_pwm"] if wave is not None]
    assert {wave.frequency_hz for wave in waves} == {20_000}
    assert 1000 < len(waves) < 2000, "each millisecond at most"
    # At 300 mm/s: back-EMF 0.4216 V s/rad * 9.23 rad/s, and friction 0.28 V, of 12.35 V.
    assert waves[-1].duty == pytest.approx((0.4216 * 0.3 / 0.0325 + 0.28) / 12.35, abs=0.01)


def test_its_program_has_the_pins_of_its_file() -> None:
    header = (build.HERE / "rover_board.h").read_text(encoding="utf-8")
    found = {name: f"P{port}{bit}" for name, port, bit in re.findall(r"X\((\w+), ([A-C]), (\d+)\)", header)}
    assert found == {name: pin for name, pin in rover().pins.items() if name != "bumper_front"}
    assert pins_of(load_scenario("rover"))["left_pwm"] == found["left_pwm"]


def test_a_thing_ahead_stops_it_until_it_is_gone(tmp_path: Path) -> None:
    more = """
[[obstacle]]
name = "thing"
at_s = 0.6
x_m = 0.45
y_m = 0.0
length_m = 0.1
width_m = 0.3
height_m = 0.3

[[obstacle]]
name = "thing"
op = "remove"
at_s = 1.2
"""
    path = tmp_path / "blocked.toml"
    path.write_text(load_scenario("rover").text.split("[[goal]]")[0] + more, encoding="utf-8")
    made = bench(str(path), until="1.6 s")  # type: ignore[arg-type]
    made.finish()
    record = made.record()
    said = [(at / 1e9, line) for at, line in record.usart_lines() if line in {"rover: blocked", "rover: clear"}]
    assert [line for _, line in said] == ["rover: blocked", "rover: clear"]
    assert 0.6 < said[0][0] < 1.2 < said[1][0] < 1.3
    stopped = next(pose for pose in record.poses if pose.t >= 1_150_000_000)
    assert stopped.left == 0
    assert record.poses[-1].left > 100 * MM, "and on it goes"
    assert record.contacts == []


def test_it_is_the_same_in_any_slices_and_from_a_pickle() -> None:
    whole = bench(until="400 ms")
    sliced = bench(until="150 ms", duration_s=16.0)
    run_of(sliced).loop.slice_ns = 333_333
    sliced.run_until("250 ms")
    again = pickle.loads(pickle.dumps(sliced))  # noqa: S301 - its own
    again.run_until("400 ms")
    for made in (whole, again):
        made.finish()
    assert again.trace.sha256 == whole.trace.sha256
    assert whole.record().waves["left_pwm"] != []
