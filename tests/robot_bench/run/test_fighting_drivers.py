"""A run tells of a pin that the chip and the adapter drive against each other."""

import json
from pathlib import Path

import pytest

from p2os.cli.main import run
from tests.bluepill_sim.machine import Machine

FIGHTS = """
mov32 r1, #0x40021018
mov32 r2, #0x4
str r2, [r1, #0]
ldr r2, [r1, #0]
mov32 r1, #0x40010800
mov32 r2, #0x44424444
str r2, [r1, #0]
sleep: wfi
b sleep
"""


def test_a_bench_tells_of_drivers_that_fight(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """DD1 (PA4) comes from the adapter, high while it knows no distance; this program holds it low."""
    (tmp_path / "fights.bin").write_bytes(Machine(FIGHTS, {}).image.segments[0][1])
    scenario = tmp_path / "fights.toml"
    scenario.write_text(
        'firmware = "fights.bin"\nworld = "room"\nduration_s = 0.5\nthreshold_m = 0.6\nbody = "kinematic"\n',
        encoding="utf-8",
    )
    assert run(["run", str(scenario), "--out", str(tmp_path / "out"), "--json"]) == 0
    notes = json.loads(capsys.readouterr().out)["notes"]
    assert any(note.startswith("PA4: two drivers fight: the chip drives it low, the other end high ") for note in notes)
