"""`dodge` drives into a pocket 1.2 m wide and gets out of it again."""

from pathlib import Path

import pytest

from robot_bench.run import run_scenario
from robot_bench.scenario.loading import load_scenario

POCKET = """
name = "pocket"
description = "A dead end 1.2 m wide, straight ahead"
extent_m = [-4.2, -3.2, 4.2, 3.2]

[start]
x_m = 0.0
y_m = 0.0
heading_deg = 0.0
"""
WALLS = {
    "north": ((-4.0, 3.0), (4.0, 3.0)),
    "south": ((-4.0, -3.0), (4.0, -3.0)),
    "east": ((4.0, -3.0), (4.0, 3.0)),
    "west": ((-4.0, -3.0), (-4.0, 3.0)),
    "left side": ((1.2, 0.65), (2.8, 0.65)),
    "right side": ((1.2, -0.65), (2.8, -0.65)),
    "end": ((2.85, -0.65), (2.85, 0.65)),
}


def write_world(path: Path) -> Path:
    walls = (
        f'[[wall]]\nname = "{name}"\nfrom_m = {list(start)}\nto_m = {list(end)}\n'
        for name, (start, end) in WALLS.items()
    )
    path.write_text(POCKET + "\n".join(walls))
    return path


def drive(mode: str, folder: Path, duration_s: float) -> tuple[str, dict[str, object]]:
    world = write_world(folder / "pocket.toml")
    options = {"mode": mode, "body": "kinematic", "world": str(world), "duration_s": duration_s}
    outcome = run_scenario(load_scenario("dodge").with_options(**options), folder / "run").outcome
    return (folder / "run" / "usart.txt").read_text(), outcome


def test_it_backs_out_over_the_ground_it_has_driven(tmp_path: Path) -> None:
    said, outcome = drive("direct", tmp_path, 32.0)
    assert said.index("CRUISE -> BACK_OUT") < said.index("BACK_OUT -> TURN_")
    assert "-> CRUISE" in said[said.index("BACK_OUT -> TURN_") :]
    assert outcome["collisions"] == 0
    assert outcome["min_clearance_m"] > 0.15  # type: ignore[operator]  # the outcome is a plain table


@pytest.mark.slow
def test_it_gets_away_through_the_adapter_too(tmp_path: Path) -> None:
    # Sonar arrive two at a time: it steers in the pocket, has no straight ground, and turns on the spot.
    said, outcome = drive("adapter", tmp_path, 35.0)
    assert said.splitlines()[-1].startswith("dodge: ")
    assert outcome["collisions"] == 0
    assert outcome["min_clearance_m"] > 0.15  # type: ignore[operator]  # the outcome is a plain table
