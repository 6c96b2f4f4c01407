"""The judge of clients that know models: a pose on the way passes, one of a wrong factor does not."""

import os
import re
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from p2os.robots.parameters import known_robots
from tests.tools.forked_python import forked_python
from tools.foreign.judges.poses import LEAST_TURN_RAD, LEAST_WAY_M, OLDEST_S, CountedWay, Poses
from tools.foreign.row import RowError, RowPlace
from tools.foreign.rows.models import MODELS

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals and terminals are Unix's")


class Moved:
    """A host whose robot is where it is told to be."""

    def __init__(self) -> None:
        self.pioneer: Any = SimpleNamespace(state=SimpleNamespace(x_mm=0.0, y_mm=0.0, heading_rad=0.0))

    def turn(self, _seconds: float) -> None:
        """Time stands still."""


def way(*places: tuple[float, float, float]) -> CountedWay:
    host = Moved()
    found = CountedWay(host)  # type: ignore[arg-type]  # a stand-in
    for x, y, heading in places:
        host.pioneer.state = SimpleNamespace(x_mm=1000 * x, y_mm=1000 * y, heading_rad=heading)
        found.go_on(0.0)
    return found


def test_a_pose_between_two_looks_is_on_the_way() -> None:
    found = way((0.1, 0.0, 0.0), (0.2, 0.0, 0.4))
    assert found.off(0.15, 0.0, 0.2) == (pytest.approx(0, abs=1e-9), pytest.approx(0, abs=1e-9))
    assert found.off(0.15, 0.01, 0.25) == (pytest.approx(0.01), pytest.approx(0.05))
    assert found.off(0.3, 0.0, 0.4)[0] == pytest.approx(0.1)


def test_headings_are_compared_the_short_way_round() -> None:
    assert way((0.0, 0.0, 3.1)).off(0.0, 0.0, -3.1)[1] == pytest.approx(0.0832, abs=1e-3)


def test_what_was_long_ago_is_no_place_any_more(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr("tools.foreign.judges.poses.time.monotonic", lambda: now[0])
    host = Moved()
    found = CountedWay(host)  # type: ignore[arg-type]  # a stand-in
    host.pioneer.state.x_mm = 1000.0
    for later, off_m in ((OLDEST_S, 0.0), (OLDEST_S + 0.001, 1.0)):
        now[0] = 100.0 + later
        found.go_on(0.0)
        assert found.off(0.0, 0.0, 0.0)[0] == pytest.approx(off_m)


def test_a_factor_shows_after_a_way_and_a_turn() -> None:
    assert not way((LEAST_WAY_M, 0.0, 0.0)).has_come_far
    assert not way((0.0, 0.0, LEAST_TURN_RAD)).has_come_far
    assert way((LEAST_WAY_M, 0.0, 0.0), (LEAST_WAY_M, 0.0, LEAST_TURN_RAD)).has_come_far


#: Our own client, which tells its pose with a factor on it.
DRIVES = """import sys, time
from p2os import Robot
with Robot("{url}") as robot:
    robot.enable()
    while True:
        robot.set_velocity(0.3, 0.3)
        pose = robot.state.pose
        print("at %f %f %f" % (pose.x_m * {factor}, pose.y_m * {factor}, pose.heading_rad), flush=True)
        print("sonar" + " 1" * {sonar}, flush=True)
        time.sleep(0.1)
"""


def judge(tmp_path: Path, factor: float, sonar: int) -> str:
    (tmp_path / "known").mkdir()
    (tmp_path / "known" / "p2dx.p").touch()
    (tmp_path / "known" / "nobody.p").touch()
    text = DRIVES.replace("{factor}", f"{factor}").replace("{sonar}", f"{sonar}")
    poses = Poses(
        program=forked_python(), knows="known/*.p", files=(("drives.py", text),),
        commands=((forked_python(), "{scratch}/drives.py"),),
        pose=r"at (?P<x>\S+) (?P<y>\S+) (?P<th>\S+)", sonar=r" 1",
    )  # fmt: skip
    assert poses.models(tmp_path) == ["p2dx"]
    return poses.run(RowPlace(cache=tmp_path, scratch=tmp_path))


@pytest.mark.slow
def test_a_client_with_our_own_factors_passes_with_each_family(tmp_path: Path) -> None:
    assert judge(tmp_path, 1.0, 8).startswith("1 models with the packets of P2OS, AROS, ARCOS: 3 drives")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("factor", "sonar", "says"),
    [
        (1.03, 8, "off the way"),
        pytest.param(0.97, 8, "off the way", marks=pytest.mark.soak),
        (1.0, 7, "7 of 8 sonar"),
    ],
)
def test_a_wrong_factor_or_a_sonar_too_few_fails(
    tmp_path: Path, factor: float, sonar: int, says: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tools.foreign.judges.poses.LONGEST_S", 9.0)
    with pytest.raises(RowError, match=says):
        judge(tmp_path, factor, sonar)


def test_models_are_read_from_names_of_files_or_from_a_text(tmp_path: Path) -> None:
    (tmp_path / "params.cc").write_text('"p2dx", // Subclass\n"p3at", // Subclass\n"else", // Subclass\n')
    found = Poses(program="x", knows="params.cc", model=r'"([^"]+)", // Subclass', commands=(), pose="")
    assert found.models(tmp_path) == [name for name in known_robots() if name in {"p2dx", "p3at"}]
    assert Poses(program="x", knows="none/*.p", commands=(), pose="").models(tmp_path) == []


def test_rows_of_models_print_poses_that_are_read() -> None:
    aria, player = (row.judge for row in MODELS)
    assert isinstance(aria, Poses)
    assert isinstance(player, Poses)
    assert re.search(aria.pose, "x=-1.5 y=0.0 th=-12.3 vel=1.0")
    assert re.search(player.pose, "pose -0.1000 0.0000 0.10472")
    assert len(re.findall(aria.sonar, "sonar 0=1.000000 1=2.5 2=5000.0")) == 3
    assert len(re.findall(player.sonar, "sonar 1 1 1")) == 3
    assert sys.executable in player.commands[1]
