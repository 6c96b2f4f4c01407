"""What every body owes its controller, tried on each of them."""

import math
import pickle

import pytest

from p2os.errors import WorldError
from p2os.pioneer.body.contract import BodyState, RobotBody
from p2os.pioneer.body.factory import make_body
from p2os.pioneer.world import load_world, parse_world
from p2os.pioneer.world.model import Obstacle, Pose, World
from p2os.robots.parameters import load_parameters
from simbase.errors import UsageError
from tests.p2os.pioneer.body.bodies import Maker, drive, each_body, ramped

P2DX = load_parameters("p2dx")
EMPTY = parse_world('name = "empty"\ndescription = ""\nextent_m = [-4, -4, 4, 4]', "empty")
TRACK_M = P2DX.track_mm / 1000


@pytest.fixture(params=each_body())
def make(request: pytest.FixtureRequest) -> Maker:
    return lambda world=EMPTY, start=None: make_body(request.param, world, P2DX, start=start)


def test_it_stands_where_it_was_put(make: Maker) -> None:
    body = make(start=Pose(1.0, -2.0, 0.5))
    made = body.state
    state = body.reset(Pose(1.0, -2.0, 0.5), 3)
    assert made == state
    assert (state.x_m, state.y_m, state.heading_rad) == pytest.approx((1.0, -2.0, 0.5), abs=1e-4)
    assert (state.left_angle_rad, state.collisions, state.in_contact) == (0, 0, False)
    still = drive(body, 0, 0, 1)
    assert math.hypot(still.x_m - state.x_m, still.y_m - state.y_m) < 1e-6
    assert still.heading_rad == pytest.approx(state.heading_rad, abs=1e-6)


def test_the_same_calls_give_the_same_states(make: Maker) -> None:
    def run(body: RobotBody) -> list[BodyState]:
        body.reset(Pose(0, 0, 0.3), 1)
        return [drive(body, 0.2 * math.sin(n), 0.15, 0.05) for n in range(20)]

    first = make(load_world("room"))
    assert run(first) == run(first) == run(make(load_world("room")))


@pytest.mark.parametrize("steps", [0, 1, 25])
@pytest.mark.parametrize("rims", [(0.0, 0.0), (0.1, 0.3)])
def test_to_hold_a_speed_is_to_step_with_it(make: Maker, rims: tuple[float, float], steps: int) -> None:
    held, stepped = make(), make()
    for body in (held, stepped):
        drive(body, 0.3, 0.3, 0.02)
    ends = [(wheels.left_angle_rad, wheels.right_angle_rad) for wheels in held.hold(*rims, steps)]
    made = [stepped.step(*rims) for _ in range(steps)]
    assert ends == [(wheels.left_angle_rad, wheels.right_angle_rad) for wheels in made]
    assert held.state == stepped.state


def test_a_snapshot_is_all_that_decides_the_future(make: Maker) -> None:
    world = load_world("room")
    body = make(world)
    body.place(Obstacle(name="extra", x_m=0.5, y_m=0.0, radius_m=0.1))
    body.remove("crate")
    body.move("bin", 0.2, 1.0, 0.3)
    drive(body, 0.4, 0.36, 0.75)
    saved = pickle.loads(pickle.dumps(body.snapshot()))  # noqa: S301  # our own bytes
    seen = body.state, body.ranges(range(8)), body.clearance()
    here = [drive(body, 0.1, 0.2, 0.1) for _ in range(10)], body.ranges(range(8))
    for other in (body, make(world)):
        other.restore(saved)
        assert (other.state, other.ranges(range(8)), other.clearance()) == seen
        assert ([drive(other, 0.1, 0.2, 0.1) for _ in range(10)], other.ranges(range(8))) == here


def test_a_metre_and_a_turn_come_out(make: Maker) -> None:
    body = make()
    # 0.4 m/s for 3 s with ramps of 0.5 s each covers 1 m.
    line = ramped(body, 0.4, 0.4, 3.0)
    assert math.hypot(line.x_m - 1, line.y_m) < 0.0005
    body.reset(Pose(0, 0, 0), 0)
    rim = math.tau / 3.0 * TRACK_M / 2
    turned = ramped(body, -rim, rim, 3.5)
    assert abs(math.remainder(turned.heading_rad, 2 * math.pi)) < math.radians(0.05)


def test_the_wheels_tell_the_way(make: Maker) -> None:
    state = ramped(make(), 0.3, 0.15, 2.0)
    radius = P2DX.body.wheel_diameter_m / 2
    assert state.left_angle_rad * radius == pytest.approx(0.45, abs=0.001)
    assert state.right_angle_rad * radius == pytest.approx(0.225, abs=0.001)
    assert state.heading_rad == pytest.approx((0.225 - 0.45) / TRACK_M, abs=0.002)


def test_a_wall_stops_it_once_stalls_the_wheels_and_lets_it_go(make: Maker) -> None:
    body = make(load_world("room"))
    body.reset(Pose(2.7, 0, 0), 0)
    stuck = drive(body, 0.15, 0.15, 1.4)
    assert stuck.x_m == pytest.approx(3.0 - P2DX.body.hull_front_m, abs=0.002)
    assert (stuck.collisions, stuck.in_contact) == (1, True)
    assert stuck.stalled_left
    assert stuck.stalled_right
    assert body.clearance() < 0.001
    free = drive(body, -0.15, -0.15, 1.5)
    assert not free.stalled_left
    assert not free.in_contact
    assert body.clearance() > 0.2
    again = drive(body, 0.15, 0.15, 1.8)
    assert again.collisions == 2


def test_stop_is_stop_and_no_energy_comes_from_nothing(make: Maker) -> None:
    body = make()
    drive(body, 0.3, 0.3, 0.5)
    stopped = drive(body, 0, 0, 1.0)
    later = drive(body, 0, 0, 1.0)
    assert abs(stopped.left_speed_mps) < 1e-4
    assert math.hypot(later.x_m - stopped.x_m, later.y_m - stopped.y_m) < 1e-4


def test_a_robot_that_something_is_put_into_is_not_flung_away(make: Maker) -> None:
    body = make()
    body.place(Obstacle(name="lid", x_m=0.0, y_m=0.0, length_m=0.3, width_m=0.3))
    fastest = max(abs(drive(body, 0.1, 0.1, 0.02).forward_mps) for _ in range(100))
    assert body.state.collisions == 1
    assert fastest < 1.0
    assert math.hypot(body.state.x_m, body.state.y_m) < 0.6


def test_obstacles_come_move_and_go(make: Maker) -> None:
    body = make()
    nothing = body.ranges([3])[0]
    assert nothing == P2DX.sonar_range_m
    body.place(Obstacle(name="post", x_m=1.0, y_m=0.0, radius_m=0.1))
    # The transducer sits at 0.166 m, 27 mm to the left; its cone of 30 degrees looks 10 degrees to the left.
    assert body.ranges([3])[0] == pytest.approx(1.0 - 0.1 - 0.166, abs=0.01)
    assert body.clearance() == pytest.approx(1.0 - 0.1 - 0.18, abs=0.001)
    with pytest.raises(WorldError, match="already"):
        body.place(Obstacle(name="post", x_m=2.0, y_m=0.0, radius_m=0.1))
    body.move("post", 0.0, 1.0, 0.0)
    assert body.ranges([3])[0] == nothing
    assert body.ranges([0])[0] == pytest.approx(1.0 - 0.1 - 0.136, abs=0.01)
    body.remove("post")
    assert body.ranges([0])[0] == nothing
    for call in (lambda: body.remove("post"), lambda: body.move("posr", 0, 0, 0)):
        with pytest.raises(WorldError, match="no obstacle"):
            call()


def test_an_obstacle_below_the_ring_gives_no_echo(make: Maker) -> None:
    body = make()
    body.place(Obstacle(name="step", x_m=1.0, y_m=0.0, length_m=0.2, width_m=2.0, height_m=0.15))
    assert body.ranges([3, 4]) == [P2DX.sonar_range_m] * 2
    assert body.clearance() < 1.0


@pytest.mark.parametrize("engine", each_body("kinematic"))
@pytest.mark.parametrize("name", ["room", "corridor", "arena"])
def test_the_bodies_agree_on_what_the_ring_measures_and_what_is_near(name: str, engine: str) -> None:
    bodies = [make_body(one, load_world(name, 5), P2DX) for one in ("kinematic", engine)]
    for turn in range(6):
        for body in bodies:
            body.reset(Pose(0.1 * turn, -0.05 * turn, turn), 0)
        exact, physical = (body.ranges(range(8)) for body in bodies)
        assert physical == pytest.approx(exact, abs=0.005)
        assert bodies[1].clearance() == pytest.approx(bodies[0].clearance(), abs=0.001)


@pytest.mark.parametrize("engine", each_body("kinematic"))
def test_the_physical_robot_climbs_the_incline(engine: str) -> None:
    body = make_body(engine, load_world("ramp"), P2DX)
    body.reset(Pose(1.5, 0, 0), 0)
    heights = [drive(body, 0.6, 0.6, 0.5) for _ in range(16)]
    assert heights[-1].z_m == pytest.approx(0.18, abs=0.005)
    assert max(state.pitch_rad for state in heights) == pytest.approx(-min(0, *[-s.pitch_rad for s in heights]))
    assert heights[-1].collisions == 0


def test_to_look_changes_nothing(make: Maker) -> None:
    seen, unseen = make(load_world("room")), make(load_world("room"))
    for _ in range(100):
        seen.step(0.3, 0.25)
        seen.ranges(range(8))
        seen.echoes([3])
        seen.clearance()
        seen.snapshot()
        unseen.step(0.3, 0.25)
    assert seen.state == unseen.state


def test_the_plan_view_notes_what_it_leaves_out() -> None:
    assert "slopes are flat" in str(make_body("kinematic", load_world("ramp"), P2DX).note)
    assert make_body("kinematic", load_world("room"), P2DX).note is None


def test_an_unknown_body_gets_a_hint() -> None:
    with pytest.raises(UsageError, match="no body 'ode'"):
        make_body("ode", EMPTY, P2DX)


def test_a_robot_inside_a_thing_may_move_out() -> None:
    body = make_body("kinematic", EMPTY, P2DX)
    body.place(Obstacle(name="lid", x_m=0.0, y_m=0.0, length_m=0.3, width_m=0.3))
    assert body.clearance() == 0
    body.step(0.0, 0.0)
    assert body.state.in_contact
    assert drive(body, 0.2, 0.2, 4.0).x_m == pytest.approx(0.8, abs=1e-6)


def test_the_world_of_a_body_is_its_own() -> None:
    world: World = load_world("room")
    make_body("kinematic", world, P2DX).place(Obstacle(name="mine", x_m=0, y_m=1, radius_m=0.1))
    assert "mine" not in {item.name for item in world.obstacles}
