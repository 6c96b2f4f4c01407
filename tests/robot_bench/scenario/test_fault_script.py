"""Faults of a scenario: they happen at their time, repeat with the seed, and are refused in one line."""

import json
import pickle
from dataclasses import replace

import pytest

from p2os.errors import ScenarioError
from p2os.robots.parameters import load_parameters
from robot_bench.bench import Bench
from robot_bench.scenario.fault_script import FaultChange, load_faults
from robot_bench.scenario.loading import load_scenario
from tests.robot_bench.wires.fake_chip import FakeChip, PinDrive

S, MS = 10**9, 10**6
P2DX = load_parameters("p2dx")


def bench(*faults: FaultChange, mode: str = "adapter", slice_ns: int = MS, seed: int = 0) -> Bench:
    """A chip that connects at once and drives ahead."""
    script = [(0, "PB13", PinDrive.LOW), (10, "PB12", PinDrive.HIGH)]
    script += [(S, pin, PinDrive.HIGH) for pin in ("PB6", "PB5", "PA2", "PA3")]
    of = load_scenario("motors").with_options(mode=mode, body="kinematic", duration_s=3.0)
    return Bench(replace(of, faults=faults, seed=seed), chip=FakeChip(script, [], block_ns=700), slice_ns=slice_ns)


def finished(made: Bench) -> str:
    made.run_until(made.scenario.duration_ns)
    made.finish()
    return made.trace.text


def test_a_fault_is_felt_from_its_time_on_and_cleared() -> None:
    made = bench(FaultChange(S, "fault sonar-stuck 3 1.2"), FaultChange(2 * S, "clear sonar-stuck 3"))
    made.run_until(3 * S // 2)
    assert made.parts.pioneer is not None
    assert "sonar-stuck 3 1.2" in made.trace.text
    finished(made)
    rows = [row["mm"][2] for row in map(json.loads, made.trace.text.splitlines()) if row["k"] == "sonar"]
    assert 1200 in rows
    assert rows[-1] != 1200


def test_a_reboot_in_motion_stops_the_robot_and_its_master_is_told() -> None:
    made = bench(FaultChange(2 * S, "fault reboot"))
    text = finished(made)
    reported = [(row["t"], row["what"]) for row in map(json.loads, text.splitlines()) if row["k"] == "event"]
    assert (2 * S, "controller down") in reported
    assert (2 * S + S // 2, "controller up") in reported
    assert "lost" in [what for _, what in reported], "the adapter has noticed"
    assert made.parts.pioneer is not None
    assert made.parts.pioneer.state.left_setpoint_mps == 0


@pytest.mark.parametrize("seed", [0, 7])
def test_noise_repeats_with_the_seed_whatever_the_slices(seed: int) -> None:
    noise = FaultChange(S // 2, "fault line-noise 0.002"), FaultChange(2 * S, "fault loose-connector")
    texts = {finished(bench(*noise, slice_ns=slice_ns, seed=seed)) for slice_ns in (10 * MS, MS)}
    assert len(texts) == 1
    assert texts != {finished(bench(*noise, seed=seed + 1))}


def test_a_bench_restored_between_faults_goes_on_alike() -> None:
    faults = FaultChange(S, "fault line-noise 0.002"), FaultChange(2 * S, "fault wheel-blocked left")
    whole = finished(bench(*faults))
    first, second = bench(*faults), bench(*faults)
    first.run_until(3 * S // 2)
    second.restore(pickle.loads(pickle.dumps(first.snapshot())))  # noqa: S301 - our own bytes
    assert finished(second) == whole


def test_mode_a_has_no_controller_to_break() -> None:
    with pytest.raises(ScenarioError, match="mode direct has none"):
        bench(FaultChange(S, "fault reboot"), mode="direct")


def test_tables_become_changes_in_order_of_time() -> None:
    tables = [
        {"at_s": 5, "fault": "reboot"},
        {"at_s": 1, "fault": "sonar-dead 8", "for_s": 0.5},
    ]
    assert load_faults(tables, P2DX, "x.toml") == (
        FaultChange(S, "fault sonar-dead 8"),
        FaultChange(3 * S // 2, "clear sonar-dead 8"),
        FaultChange(5 * S, "fault reboot"),
    )


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"at_s": 1}, "'fault'"),
        ({"at_s": 1, "fault": "sonar-dead 9"}, "'9' is no number of 1 to 8"),
        ({"at_s": 1, "fault": "sonar-stuk 1 2"}, "no fault 'sonar-stuk'"),
        ({"at_s": 1, "fault": "reboot", "for_s": 2}, "reboot happens once"),
        ({"at_s": -1, "fault": "reboot"}, "at_s"),
    ],
)
def test_wrong_tables_are_refused_with_their_place(table: dict[str, object], message: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        load_faults([table], P2DX, "x.toml")
    assert "x.toml: [[fault]] 1" in str(caught.value)
    assert message in str(caught.value)
