"""The thesis's ramp: the shipped world is its measures, and a robot drives all of it in each body."""

import math
from dataclasses import replace

import pytest

from p2os.pioneer.body.contract import BodyState, RobotBody
from p2os.pioneer.body.factory import make_body
from p2os.pioneer.world import load_world, parse_world
from p2os.pioneer.world.makers.walkway import Measures, walkway
from p2os.pioneer.world.model import ObstacleKind
from p2os.pioneer.world.writer import write_world
from p2os.robots.parameters import load_parameters
from tests.p2os.pioneer.body.bodies import drive, each_body, ramped

P2DX = load_parameters("p2dx")
TRACK_M = P2DX.track_mm / 1000


def line(body: RobotBody, length_m: float) -> BodyState:
    return ramped(body, 1.0, 1.0, length_m / 1.0 + 0.5)


def left_turn(body: RobotBody) -> BodyState:
    return ramped(body, -0.2, 0.2, math.pi / 2 * TRACK_M / 2 / 0.2 + 0.5)


def test_the_shipped_walkway_is_what_its_measures_give() -> None:
    assert parse_world(write_world(walkway(Measures())), "made") == load_world("walkway")


def test_another_slope_raises_the_third_leg_and_leaves_the_plan() -> None:
    gentle, steep = (walkway(replace(Measures(), slope_deg=slope)) for slope in (2.0, 5.0))
    assert gentle.extent == steep.extent
    tops = [max(item.base_m + item.height_m for item in world.obstacles if item.kind is ObstacleKind.FLOOR)
            for world in (gentle, steep)]  # fmt: skip
    # Ten metres of inclines.
    assert tops == pytest.approx([10 * math.tan(math.radians(2)), 10 * math.tan(math.radians(5))], abs=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("name", each_body())
def test_a_robot_drives_up_both_inclines_and_round_the_void_in_each_body(name: str) -> None:
    world = load_world("walkway")
    body = make_body(name, world, P2DX)
    body.reset(world.start, 1)
    crossed = line(body, 8.5)
    left_turn(body)
    line(body, 5.4)
    left_turn(body)
    end = line(body, 7.0)
    assert body.take_hits() == []
    # What is level to `kinematic` is shortened by the slope elsewhere: 6 m / cos 4 degrees - 6 m = 15 mm.
    assert (crossed.x_m, end.x_m, end.y_m) == pytest.approx((8.5, 1.5, 5.4), abs=0.03)
    if name != "kinematic":  # slopes are flat to it
        assert (crossed.z_m, end.z_m) == pytest.approx((0.42, 0.70), abs=0.005)


@pytest.mark.parametrize("name", each_body())
def test_the_rails_keep_a_robot_out_of_the_void_and_its_sonar_sees_them(name: str) -> None:
    world = load_world("walkway")
    body = make_body(name, world, P2DX)
    body.reset(replace(world.start, heading_rad=math.pi / 2), 1)
    # The two front sonars stand 0.166 m ahead of the axle; the rail's near face is at 1.2 - 0.02 m.
    assert min(body.ranges([3, 4])) == pytest.approx(1.18 - 0.166, abs=0.03)
    end = drive(body, 0.4, 0.4, 3.0)
    assert end.y_m + P2DX.body.hull_front_m < 1.2
    assert [hit.name for hit in body.take_hits()] == ["rail of the long leg, lower 1"]
