"""Things that move, are pushed, lie low, or belong to the building: what every body owes them."""

import math
import pickle

import pytest

from p2os.errors import WorldError
from p2os.pioneer.body.contract import RobotBody
from p2os.pioneer.body.factory import make_body
from p2os.pioneer.world import load_world
from p2os.pioneer.world.model import Mesh, Obstacle, Pose, Repeat, Walk, World
from p2os.robots.parameters import load_parameters
from tests.p2os.pioneer.body.bodies import Maker, drive, each_body

P2DX = load_parameters("p2dx")
FRONT_M = P2DX.body.hull_front_m

#: A hollow box of 4 x 4 m, 1 m high, and a floor on the ground, as a modeller exports a room.
ROOM = Mesh(
    name="room",
    vertices=tuple((x, y, z) for z in (0.0, 1.0) for x, y in ((-2, -2), (2, -2), (2, 2), (-2, 2))),
    triangles=(
        (0, 1, 2), (0, 2, 3), (0, 1, 5), (0, 5, 4), (1, 2, 6), (1, 6, 5), (2, 3, 7), (2, 7, 6), (3, 0, 4), (3, 4, 7),
    ),
)  # fmt: skip


def world_of(*things: Obstacle, meshes: tuple[Mesh, ...] = ()) -> World:
    return World(
        name="w", source="w", description="", start=Pose(0, 0, 0), extent=(-6, -6, 6, 6), obstacles=things,
        meshes=meshes,
    )  # fmt: skip


@pytest.fixture(params=each_body())
def make(request: pytest.FixtureRequest) -> Maker:
    return lambda world: make_body(request.param, world, P2DX)


def box(name: str = "box", x: float = 1.0, **fields: float | bool) -> Obstacle:
    return Obstacle(name=name, x_m=x, y_m=0.0, length_m=0.3, width_m=0.3, **fields)  # type: ignore[arg-type]  # mixed fields


def test_a_light_thing_is_pushed_and_reports_where_it_is(make: Maker) -> None:
    body = make(world_of(box(x=0.5, mass_kg=1.0, friction=0.3)))
    assert body.take_moved() == []
    state = drive(body, 0.3, 0.3, 1.5)
    assert state.x_m == pytest.approx(0.45, abs=0.02)
    (moved,) = body.take_moved()
    assert moved.x_m == pytest.approx(state.x_m + FRONT_M + 0.15, abs=0.05)
    assert body.take_moved() == []
    assert state.collisions == 1
    assert not state.stalled_left
    assert body.ranges([3])[0] < 0.4


def test_a_heavy_thing_stops_the_robot(make: Maker) -> None:
    body = make(world_of(box(x=0.6, mass_kg=200.0, friction=0.8)))
    state = drive(body, 0.2, 0.2, 2.0)
    assert state.x_m == pytest.approx(0.45 - FRONT_M, abs=0.01)
    assert state.stalled_left
    assert state.in_contact


def test_a_pushed_thing_stops_at_a_wall(make: Maker) -> None:
    body = make(world_of(box(x=0.5, mass_kg=1.0, friction=0.3), box("wall", 1.3, fixed=True)))
    state = drive(body, 0.3, 0.3, 3.2)
    assert state.x_m == pytest.approx(1.15 - 0.3 - FRONT_M, abs=0.02)
    assert state.stalled_left


def test_a_corridor_a_millimetre_wider_than_the_robot_lets_it_through(make: Maker) -> None:
    away = (P2DX.body.hull_width_m + 0.001 + 0.2) / 2
    walls = [
        Obstacle(name=f"wall {side}", x_m=1.0, y_m=side * away, length_m=1.0, width_m=0.2, fixed=True)
        for side in (-1, 1)
    ]
    body = make(world_of(*walls))
    state = drive(body, 0.3, 0.3, 3.0)
    assert state.x_m > 0.85, "the wheels' spheres are wider than the hull, and meet no wall"
    assert state.collisions == 0


def test_what_walks_is_where_its_path_leads_and_echoes(make: Maker) -> None:
    walk = Walk(points_m=((1.5, 0.0), (2.5, 0.0)), speed_mps=0.5, start_s=0.2, repeat=Repeat.ONCE)
    body = make(world_of(Obstacle(name="visitor", x_m=0, y_m=0, radius_m=0.2, walk=walk)))
    near = body.ranges([3])[0]
    drive(body, 0.0, 0.0, 1.2)
    assert body.ranges([3])[0] == pytest.approx(near + 0.5, abs=0.01)
    drive(body, 0.0, 0.0, 1.5)
    assert body.ranges([3])[0] == pytest.approx(near + 1.0, abs=0.01)
    assert body.clearance() == pytest.approx(2.5 - 0.2 - FRONT_M, abs=0.005)
    assert [item.x_m for item in body.take_moved()] == pytest.approx([2.5])
    body.move("visitor", 1.0, 0.0, 0.0)
    drive(body, 0.0, 0.0, 0.1)
    assert body.clearance() == pytest.approx(1.0 - 0.2 - FRONT_M, abs=0.005)


def test_what_walks_into_the_robot_is_a_collision(make: Maker) -> None:
    walk = Walk(points_m=((1.0, 0.0), (0.3, 0.0)), speed_mps=0.5, repeat=Repeat.ONCE)
    body = make(world_of(Obstacle(name="visitor", x_m=0, y_m=0, radius_m=0.2, walk=walk)))
    assert drive(body, 0.0, 0.0, 1.0).collisions == 0
    assert drive(body, 0.0, 0.0, 0.6).collisions == 1
    # Its front is then 0.2 m before its middle, which walks 0.5 m a second.
    assert [hit.at_ns / 1e9 for hit in body.take_hits()] == pytest.approx([(1.0 - 0.2 - FRONT_M) / 0.5], abs=0.02)


@pytest.mark.parametrize(("height", "passes"), [(0.012, True), (0.04, False)])
def test_a_sill_is_driven_over_and_a_low_thing_stops_the_wheels(make: Maker, height: float, passes: bool) -> None:
    sill = Obstacle(name="sill", x_m=0.5, y_m=0.0, length_m=0.06, width_m=2.0, height_m=height)
    body = make(world_of(sill))
    state = drive(body, 0.4, 0.4, 2.8)
    assert (state.x_m > 0.9) is passes
    assert (state.collisions == 0) is passes
    if not passes:
        # A wheel of 82.5 mm radius meets an edge of 40 mm 71 mm ahead of its axle.
        assert state.x_m == pytest.approx(0.47 - 0.075, abs=0.01)
        assert state.stalled_left


def test_a_low_thing_between_the_wheels_is_driven_over(make: Maker) -> None:
    body = make(world_of(Obstacle(name="slipper", x_m=0.6, y_m=0.06, length_m=0.1, width_m=0.03, height_m=0.04)))
    assert drive(body, 0.3, 0.3, 2.0).x_m == pytest.approx(0.6, abs=0.06)


def test_a_mesh_is_met_and_echoes_and_its_floor_does_not(make: Maker) -> None:
    body = make(world_of(meshes=(ROOM,)))
    assert body.clearance() == pytest.approx(2.0 - 0.26, abs=0.002)
    # The ray nearest to the axis of sonar 0 (90 degrees) meets the wall squarely.
    assert body.ranges([0])[0] == pytest.approx(2.0 - 0.136, abs=0.003)
    body.reset(Pose(1.0, 0, 0), 0)
    state = drive(body, 0.4, 0.4, 2.5)
    assert state.x_m == pytest.approx(2.0 - FRONT_M, abs=0.004)
    assert state.collisions == 1
    assert abs(state.z_m) < 0.002
    for call in (lambda: body.remove("room"), lambda: body.move("room", 0, 0, 0)):
        with pytest.raises(WorldError, match="part of the building"):
            call()
    with pytest.raises(WorldError, match="already"):
        body.place(Obstacle(name="room", x_m=1, y_m=1, radius_m=0.1))


def test_many_fixed_boxes_are_met_and_echo_as_single_ones_are(make: Maker) -> None:
    def ring(fixed: bool) -> list[Obstacle]:
        return [
            Obstacle(
                name=f"stone {n}",
                x_m=1.5 * math.cos(n * 0.35),
                y_m=1.5 * math.sin(n * 0.35),
                heading_rad=n * 0.35,
                length_m=0.2,
                width_m=0.3,
                fixed=fixed,
            )
            for n in range(18)
        ]

    one, other = make(world_of(*ring(fixed=False))), make(world_of(*ring(fixed=True)))
    assert other.ranges(range(8)) == pytest.approx(one.ranges(range(8)), abs=1e-4)
    assert other.clearance() == pytest.approx(one.clearance(), abs=1e-6)
    for body in (one, other):
        drive(body, 0.4, 0.4, 3.5)
    assert other.state.x_m == pytest.approx(one.state.x_m, abs=0.003)
    assert other.state.collisions == one.state.collisions == 1


@pytest.mark.slow
def test_a_snapshot_holds_walkers_and_pushed_things(make: Maker) -> None:
    world = load_world("office")
    body = make(world)
    walk = Walk(points_m=((2.0, 0.5), (2.0, -0.5)), speed_mps=0.3)
    drive(body, 0.2, 0.2, 0.2)
    body.place(Obstacle(name="dog", x_m=0, y_m=0, radius_m=0.15, walk=walk))
    body.place(box("parcel", 0.6, mass_kg=1.0, friction=0.2))
    drive(body, 0.3, 0.28, 1.2)
    saved = pickle.loads(pickle.dumps(body.snapshot()))  # noqa: S301  # our own bytes

    def rest(other: RobotBody) -> list[object]:
        seen: list[object] = []
        for _ in range(5):
            seen += [drive(other, 0.25, 0.3, 0.1), other.ranges(range(8)), other.clearance(), other.take_moved()]
        return seen

    here = rest(body)
    for other in (body, make(world)):
        other.restore(saved)
        assert rest(other) == here


def test_a_reset_puts_walkers_and_pushed_things_back(make: Maker) -> None:
    body = make(world_of(box(x=0.6, mass_kg=1.0, friction=0.3), box("other", 3.0)))
    drive(body, 0.2, 0.2, 1.6)
    assert body.take_moved()
    body.reset(Pose(0, 0, 0), 0)
    assert body.take_moved() == []
    assert body.clearance() == pytest.approx(0.45 - FRONT_M, abs=0.002)


def test_an_echo_has_how_squarely_it_was_met(make: Maker) -> None:
    turned = Obstacle(name="w", x_m=2.0, y_m=0.0, heading_rad=math.pi / 3, length_m=3.0, width_m=0.1)
    body = make(world_of(turned))
    (rays,) = body.echoes([3])
    assert len(rays) == 9
    # The middle ray looks 10 degrees to the left, the wall's normal 30 degrees to the right of straight ahead.
    assert rays[4].cosine == pytest.approx(math.cos(math.radians(40)), abs=1e-4)
    assert min(echo.range_m for echo in rays) == pytest.approx(body.ranges([3])[0], abs=1e-6)
    assert body.echoes([]) == []
    assert all(echo.range_m == math.inf for echo in make(world_of()).echoes([3])[0])
