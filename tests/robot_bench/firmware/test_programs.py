"""The four programs in both modes, on both bodies, in room and ramp; dodge in the arena.

Any two of program, mode, body and world meet in a run of `make test`; all four at once in `make soak`.
"""

import itertools
import json
from pathlib import Path

import pytest
from _pytest.mark.structures import ParameterSet

from p2os.toml_record import given
from robot_bench.run import run_scenario
from robot_bench.scenario.loading import load_scenario

BODIES = ["kinematic", pytest.param("bullet", marks=pytest.mark.bullet)]
MODES = ["direct", "adapter"]
WORLDS = ["room", "ramp"]
PROGRAMS = ["motors", "sensors", "encoders", "dodge"]
#: What a run must show at the least: 12 cells of 0.5 m, 4 m a minute.
LEAST_CELLS, LEAST_M_A_MINUTE = 12, 4.0


def run(program: str, folder: Path, **options: object) -> dict[str, object]:
    result = run_scenario(load_scenario(program).with_options(**options), folder)  # type: ignore[arg-type]
    assert result.outcome["failures"] == []
    assert result.passed
    return result.outcome


def combinations() -> list[ParameterSet]:
    """Return all, with a mark: an orthogonal array of strength 2 is `slow`, the rest is `soak`."""
    found = []
    for program, mode, body, world in itertools.product(*map(range, map(len, (PROGRAMS, MODES, BODIES, WORLDS)))):
        is_of_array = body == (mode + program // 2) % 2 and world == (mode + program) % 2
        marks = [pytest.mark.slow if is_of_array else pytest.mark.soak, *([pytest.mark.bullet] if body else [])]
        row = PROGRAMS[program], MODES[mode], ("kinematic", "bullet")[body], WORLDS[world]
        found.append(pytest.param(*row, marks=marks))
    return found


def test_any_two_of_program_mode_body_and_world_meet_in_a_quick_run() -> None:
    every = combinations()
    quick = [row for row in every if pytest.mark.slow in row.marks]
    assert (len(every), len(quick)) == (32, 8)
    for one, other in itertools.combinations(range(4), 2):
        of_all, found = ({(row.values[one], row.values[other]) for row in rows} for rows in (every, quick))
        assert found == of_all


@pytest.mark.parametrize(("program", "mode", "body", "world"), combinations())
def test_a_program_reaches_its_goals(program: str, mode: str, body: str, world: str, tmp_path: Path) -> None:
    duration_s = 20.0 if program == "dodge" else None
    outcome = run(program, tmp_path, mode=mode, body=body, world=world, duration_s=duration_s)
    assert outcome["collisions"] == 0
    if duration_s is not None:  # its goals are judged from 120 s on
        assert outcome["distance_m"] >= LEAST_M_A_MINUTE * duration_s / 60  # type: ignore[operator]  # JSON
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
    wanted = {goal.kind: dict(given(goal.table)) for goal in load_scenario("dodge").goals}
    assert wanted["no_collision"] == {}
    assert wanted["min_distance"] == {"distance_m_a_minute": LEAST_M_A_MINUTE}
    assert wanted["cells"] == {"least": LEAST_CELLS}
