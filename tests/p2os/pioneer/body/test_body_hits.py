"""Every body tells what it has come to touch, where and when."""

import math
import pickle

import pytest

from p2os.pioneer.body.contacts import ContactCounter
from p2os.pioneer.body.contract import STEP_NS, RobotBody
from p2os.pioneer.body.factory import make_body
from p2os.pioneer.world import load_world
from p2os.pioneer.world.model import Obstacle, Pose, World
from p2os.robots.parameters import load_parameters
from tests.p2os.pioneer.body.bodies import Maker, drive, each_body

P2DX = load_parameters("p2dx")


@pytest.fixture(params=each_body())
def make(request: pytest.FixtureRequest) -> Maker:
    return lambda world: make_body(request.param, world, P2DX)


@pytest.mark.parametrize(("steps", "count"), [(0, 1), (1, 1), (198, 1), (199, 1), (200, 2), (201, 2), (1000, 2)])
def test_a_contact_is_a_new_one_after_so_many_steps_apart(steps: int, count: int) -> None:
    one_by_one, together = ContactCounter(), ContactCounter()
    for counter in (one_by_one, together):
        assert counter.update(True), "the first is new"
        assert not counter.update(True), "and goes on"
    for _ in range(steps):
        one_by_one.update(False)
    if steps:
        together.update(False, steps)
    for counter in (one_by_one, together):
        assert counter.update(True) is (count == 2)
        assert counter.collisions == count


def world_of(*things: Obstacle) -> World:
    return World(
        name="test", source="test", description="", extent=(-4.0, -4.0, 4.0, 4.0), start=Pose(0, 0, 0), obstacles=things
    )


def crate(name: str, x_m: float, *, fixed: bool = False, y_m: float = 0.0, height_m: float = 0.4) -> Obstacle:
    return Obstacle(name=name, x_m=x_m, y_m=y_m, length_m=0.2, width_m=0.6, height_m=height_m, fixed=fixed)


def until_hit(body: RobotBody) -> int:
    """Drive ahead until the first collision; return the number of steps."""
    for step in range(1, 8000):
        body.step(0.3, 0.3)
        if body.state.collisions:
            return step
    raise AssertionError("nothing was hit")


@pytest.mark.parametrize("fixed", [False, True], ids=["movable", "fixed"])
def test_a_hit_names_the_thing_the_place_and_the_time(make: Maker, fixed: bool) -> None:
    body = make(world_of(crate("crate", 0.6, fixed=fixed), crate("behind", -1.0), crate("beside", 0.6, y_m=1.0)))
    steps = until_hit(body)
    (hit,) = body.take_hits()
    assert (hit.name, hit.at_ns) == ("crate", steps * STEP_NS)
    assert hit.x_m == pytest.approx(0.5, abs=0.01)
    assert abs(hit.y_m) <= P2DX.body.hull_width_m / 2 + 0.01
    assert body.take_hits() == [], "each is told once"


def test_a_wall_of_a_building_of_many_is_named(make: Maker) -> None:
    ring = [
        Obstacle(
            name=f"stone {n}", x_m=1.5 * math.cos(n * 0.35), y_m=1.5 * math.sin(n * 0.35), heading_rad=n * 0.35,
            length_m=0.2, width_m=0.3, fixed=True,
        )
        for n in range(18)
    ]  # fmt: skip
    body = make(world_of(*ring))
    body.reset(Pose(0.9, 0, 0), 0)
    until_hit(body)
    assert [hit.name for hit in body.take_hits()] == ["stone 0"]


def test_what_only_the_wheels_meet_is_named_too(make: Maker) -> None:
    body = make(world_of(Obstacle(name="plank", x_m=0.35, y_m=0.0, length_m=0.1, width_m=1.0, height_m=0.04)))
    until_hit(body)
    assert [hit.name for hit in body.take_hits()] == ["plank"]


def test_what_is_put_into_the_robot_and_what_is_pushed_are_named(make: Maker) -> None:
    body = make(world_of(Obstacle(name="parcel", x_m=0.5, y_m=0, length_m=0.2, width_m=0.2, mass_kg=0.5)))
    until_hit(body)
    assert [hit.name for hit in body.take_hits()] == ["parcel"]
    other = make(world_of())
    drive(other, 0.1, 0.1, 0.1)
    other.place(Obstacle(name="lid", x_m=0.1, y_m=0.0, length_m=0.3, width_m=0.3))
    drive(other, 0.1, 0.1, 0.1)
    assert [hit.name for hit in other.take_hits()] == ["lid"]


def test_hits_that_nobody_has_taken_are_in_the_snapshot(make: Maker) -> None:
    world = load_world("room")
    body = make(world)
    body.reset(Pose(2.6, 0, 0), 0)
    until_hit(body)
    saved = pickle.loads(pickle.dumps(body.snapshot()))  # noqa: S301  # our own bytes
    hits = body.take_hits()
    assert [hit.name for hit in hits] == ["east wall"]
    other = make(world)
    other.restore(saved)
    assert other.take_hits() == hits


def test_a_reset_forgets_what_was_hit(make: Maker) -> None:
    body = make(world_of(crate("crate", 0.6)))
    until_hit(body)
    body.reset(Pose(0, 0, 0), 0)
    assert body.take_hits() == []
