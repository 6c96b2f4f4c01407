"""The four programs in both modes, on both bodies, in room and ramp; dodge in the arena."""

import json
from pathlib import Path

import pytest

from robot_bench.run import run_scenario
from robot_bench.scenario.scenario import load_scenario

BODIES = ["kinematic", pytest.param("bullet", marks=pytest.mark.bullet)]
MODES = ["direct", "adapter"]
WORLDS = ["room", "ramp"]
#: What a run must show at the least: 12 cells of 0.5 m, 4 m a minute.
LEAST_CELLS, LEAST_M_A_MINUTE = 12, 4.0


def run(program: str, folder: Path, **options: object) -> dict[str, object]:
    result = run_scenario(load_scenario(program).with_options(**options), folder)  # type: ignore[arg-type]
    assert result.outcome["failures"] == []
    assert result.passed
    return result.outcome


@pytest.mark.slow
@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("program", ["motors", "sensors", "encoders", "dodge"])
def test_a_program_reaches_its_goals(program: str, mode: str, body: str, world: str, tmp_path: Path) -> None:
    duration_s = 60.0 if program == "dodge" else None
    outcome = run(program, tmp_path, mode=mode, body=body, world=world, duration_s=duration_s)
    assert outcome["collisions"] == 0
    names = {path.name for path in tmp_path.iterdir()}
    assert names >= {"trace.jsonl", "summary.json", "pins.vcd", "pins.sr", "wire.jsonl", "usart.txt", "report.html"}
    assert json.loads((tmp_path / "summary.json").read_text()) == outcome


@pytest.mark.soak
@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("mode", MODES)
def test_dodge_keeps_it_up_for_ten_minutes(mode: str, body: str, world: str, tmp_path: Path) -> None:
    run("dodge", tmp_path, mode=mode, body=body, world=world, duration_s=600.0)


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("mode", MODES)
def test_dodge_touches_nothing_in_the_arena(mode: str, body: str, seed: int, tmp_path: Path) -> None:
    run("dodge", tmp_path, mode=mode, body=body, world="arena", seed=seed)


def test_dodge_wants_what_it_must_show() -> None:
    wanted = {goal.kind: goal.arguments for goal in load_scenario("dodge").goals}
    assert wanted["no_collision"] == {}
    assert wanted["min_distance"] == {"distance_m_a_minute": LEAST_M_A_MINUTE}
    assert wanted["cells"] == {"least": LEAST_CELLS}
