"""A fan of laser rays, and a robot that is carried elsewhere, in every body alike."""

import math

import pytest

from p2os.errors import WorldError
from p2os.pioneer.body.factory import make_body
from p2os.pioneer.devices.laser import LASERS, Laser
from p2os.pioneer.world import load_world
from p2os.pioneer.world.model import Pose
from p2os.robots.parameters import load_parameters
from tests.p2os.pioneer.body.bodies import Maker, drive, each_body

P2DX = load_parameters("p2dx")
ROOM = load_world("room")
FAN = Laser.of(LASERS["lms2xx"]).fan(17, 8)
ROUND = Laser(LASERS["lms2xx"], start_deg=-180, end_deg=180, step_cdeg=4500).fan(0, 0)


@pytest.fixture(params=each_body())
def make(request: pytest.FixtureRequest) -> Maker:
    return lambda world=ROOM: make_body(request.param, world, P2DX)


def test_every_body_measures_what_the_exact_one_measures(make: Maker) -> None:
    body, exact = make(), make_body("kinematic", ROOM, P2DX)
    for pose in (Pose(0, 0, 0), Pose(0.5, -0.5, 2.5), Pose(-1.0, 0.8, -1.9)):
        body.reset(pose, 0)
        exact.reset(pose, 0)
        for fan in (FAN, ROUND):
            found = zip(body.scan(fan, 32.0), exact.scan(fan, 32.0), strict=True)
            apart = [abs(one - other) for one, other in found]
            # A ray that grazes an edge may pass it in one body only; the others differ by how far the body settles.
            assert sum(difference > 0.02 for difference in apart) <= 2, (pose, max(apart))


def test_a_laser_and_a_sonar_meet_the_same_wall(make: Maker) -> None:
    body = make()
    body.reset(Pose(0, 0, 0), 0)
    cone = Laser(LASERS["lms2xx"], start_deg=0, end_deg=0).fan(0, 0)
    sonar = P2DX.sonar[3]
    nearest = body.ranges([3])[0] + math.hypot(sonar.x_mm, sonar.y_mm) / 1000
    assert body.scan(cone, 8.0)[0] == pytest.approx(nearest, abs=0.15)


def test_a_ray_that_meets_nothing_goes_as_far_as_it_is_looked_for(make: Maker) -> None:
    body = make()
    assert set(body.scan(FAN, 0.3)) == {0.3}


def test_a_robot_that_is_carried_elsewhere_keeps_its_wheel_angles(make: Maker) -> None:
    body = make()
    before = drive(body, 0.2, 0.15, 1.0)
    body.stand_at(-1.0, 0.8, 1.0)
    after = body.state
    assert (after.x_m, after.y_m, after.heading_rad) == pytest.approx((-1.0, 0.8, 1.0), abs=1e-6)
    assert after.left_angle_rad == pytest.approx(before.left_angle_rad, abs=1e-6)
    assert after.left_speed_mps == after.right_speed_mps == 0.0
    settled = drive(body, 0, 0, 0.5)
    assert (settled.x_m, settled.y_m, settled.heading_rad) == pytest.approx((-1.0, 0.8, 1.0), abs=2e-3)
    assert settled.left_angle_rad == pytest.approx(before.left_angle_rad, abs=0.02)
    assert not settled.stalled_left
    driven = drive(body, 0.2, 0.2, 1.0)
    assert math.dist((driven.x_m, driven.y_m), (-1.0, 0.8)) == pytest.approx(0.2, abs=0.03)


def test_a_robot_is_not_put_into_a_wall_nor_beyond_the_floor(make: Maker) -> None:
    body = make()
    before = body.state
    crate = next(item for item in ROOM.obstacles if item.name == "crate")
    for x, y, why in ((50.0, 0.0, "not in world"), (crate.x_m, crate.y_m, "inside 'crate'")):
        with pytest.raises(WorldError, match=why):
            body.stand_at(x, y, 0.0)
    assert body.state == before


def test_what_was_carried_goes_on_from_a_snapshot(make: Maker) -> None:
    body, other = make(), make()
    body.stand_at(0.5, -0.5, 2.0)
    other.restore(body.snapshot())
    assert drive(other, 0.2, 0.1, 0.5) == drive(body, 0.2, 0.1, 0.5)
    assert other.scan(FAN, 8.0) == body.scan(FAN, 8.0)
