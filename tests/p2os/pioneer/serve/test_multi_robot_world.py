"""Robots that share one world: what they see and feel of each other, and that nothing else decides it."""

import math
import pickle
from collections.abc import Callable, Sequence
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from p2os.pioneer.body.factory import make_body, make_scene
from p2os.pioneer.controller import ControllerSettings, Pioneer
from p2os.pioneer.serve.multi_robot_world import MultiRobotWorld
from p2os.pioneer.world import parse_world
from p2os.pioneer.world.model import Pose, World
from p2os.protocol.commands import Command
from p2os.protocol.commands import CommandNumber as C
from p2os.robots.parameters import load_parameters
from simbase.errors import UsageError
from simbase.timing import NS_PER_MS
from tests.p2os.pioneer.body.bodies import each_body

P2DX = load_parameters("p2dx")
HALL = parse_world('name = "hall"\nextent_m = [-4, -4, 4, 4]', "hall")
CARTON = parse_world(
    'name = "c"\nextent_m = [-4, -4, 4, 4]\n[[box]]\nname = "carton"\nx_m = 0.0\ny_m = 0.0\nlength_m = 0.3\n'
    'width_m = 0.3\nmass_kg = 1.5\n[[cylinder]]\nname = "visitor"\nx_m = 0\ny_m = 2\nradius_m = 0.2\n'
    "path_m = [[0, 2], [2, 2]]",
    "c",
)
FACING = ((-1.0, 0.0, 0.0), (1.0, 0.0, 180.0))
#: Of the hull's front before the axle, m.
FRONT_M = P2DX.body.hull_front_m

Places = Sequence[tuple[float, float, float]]
Meet = Callable[..., MultiRobotWorld]


@pytest.fixture(
    params=[
        "kinematic",
        pytest.param("bullet", marks=pytest.mark.bullet),
        pytest.param("mujoco", marks=pytest.mark.soak),
    ]
)
def meet(request: pytest.FixtureRequest) -> Meet:
    if request.param != "kinematic":
        pytest.importorskip({"bullet": "pybullet"}.get(request.param, request.param))
    return lambda places=FACING, world=HALL: multi_robot_world(places, world, request.param)


def multi_robot_world(
    places: Places, world: World = HALL, engine: str = "kinematic", *, cross_talk: bool = True
) -> MultiRobotWorld:
    scene = make_scene(engine, world, [P2DX] * len(places))
    scene.reset([Pose(x, y, math.radians(degrees)) for x, y, degrees in places], 0)
    robots = [
        Pioneer(parameters=P2DX, body=body, settings=ControllerSettings(seed=number))
        for number, body in enumerate(scene.bodies)
    ]
    return MultiRobotWorld(robots, scene, cross_talk=cross_talk)


def say(made: MultiRobotWorld, index: int, number: int, argument: int | None = None, *, at: int = 0) -> None:
    made.bring(index, at)
    made.robots[index].receive(Command(number, argument).to_frame().to_bytes(), at)


def drive(made: MultiRobotWorld, *speeds: int, apart_ns: int = 0) -> None:
    """Open a session with each robot, one so long after the other, and let it drive so fast, mm/s."""
    for index, speed in enumerate(speeds):
        for number, argument in ((0, None), (1, None), (2, None), (C.OPEN, None), (C.ENABLE, 1), (C.VEL, speed)):
            say(made, index, number, argument, at=index * apart_ns)


def live(made: MultiRobotWorld, seconds: float, *, since: float = 0.0) -> float:
    """Live on, with a word to every robot twice a second; return when it ends."""
    end = since + seconds
    while since < end:
        since = min(since + 0.5, end)
        at = round(since * 1e9)
        made.advance_to(at)
        for index in range(len(made.members)):
            say(made, index, C.PULSE, at=at)
    return end


def gap(made: MultiRobotWorld) -> float:
    first, second = (member.body.state for member in made.members[:2])
    return math.dist((first.x_m, first.y_m), (second.x_m, second.y_m)) - 2 * FRONT_M


def test_two_robots_that_face_each_other_read_the_gap_between_them(meet: Meet) -> None:
    for distance in (0.5, 1.0, 2.4):
        made = meet(((-distance, 0.3, 0.0), (distance, 0.3, 180.0)))
        for member in made.members:
            # The two middle transducers sit 14 mm behind the hull's front, at P2DX.sonar[3] and [4].
            behind = FRONT_M - P2DX.sonar[3].x_mm / 1000
            assert member.body.ranges([3, 4]) == pytest.approx([gap(made) + behind] * 2, abs=0.01)
            assert member.body.echoes([3])[0]
            assert member.body.clearance() == pytest.approx(gap(made), abs=0.001)


def test_a_robot_that_drives_is_seen_where_it_is(meet: Meet) -> None:
    made = meet()
    drive(made, 400, 0)
    live(made, 1.2)
    behind = FRONT_M - P2DX.sonar[3].x_mm / 1000
    # It stands at the last boundary: 10 ms at 0.4 m/s are 4 mm.
    assert made.members[1].body.ranges([3])[0] == pytest.approx(gap(made) + behind, abs=0.01)


def test_two_that_push_each_other_head_on_both_stall_and_part_again(meet: Meet) -> None:
    made = meet(((-0.35, 0.0, 0.0), (0.35, 0.0, 180.0)))
    drive(made, 300, 300)
    now = live(made, 1.8)
    states = [member.body.state for member in made.members]
    assert gap(made) == pytest.approx(0.0, abs=0.002)
    assert [state.stalled_left and state.stalled_right for state in states] == [True, True]
    assert [(state.collisions, state.in_contact) for state in states] == [(1, True)] * 2
    for index in (0, 1):
        say(made, index, C.VEL, -300, at=round(now * 1e9))
    live(made, 1.5, since=now)
    assert gap(made) > 0.5
    assert not any(member.body.state.in_contact for member in made.members)


def test_a_robot_that_stands_under_power_holds_out_and_feels_the_push(meet: Meet) -> None:
    made = meet(((0.5, 0.0, 0.0), (1.0, 0.0, 180.0)))
    drive(made, 300, 0)
    now = live(made, 2.2)
    pushing, standing = (member.body.state for member in made.members)
    assert pushing.stalled_left
    # The blow itself moves a robot with a mass by 9 kg x 0.3 m/s over what both motors hold.
    assert standing.x_m == pytest.approx(1.0, abs=0.02)
    assert (standing.collisions, standing.in_contact) == (1, True)
    assert [hit.name for hit in made.members[1].body.take_hits()] == ["robot 1"]
    live(made, 1.0, since=now)
    assert made.members[1].body.state.x_m == pytest.approx(standing.x_m, abs=5e-5), "it does not creep"


def test_a_robot_without_power_gives_way_and_its_odometry_counts_what_its_wheels_roll(meet: Meet) -> None:
    made = meet(((-0.2, 0.0, 0.0), (0.2, 0.0, 180.0)))
    drive(made, 300)
    live(made, 2.0)
    pushing, pushed = (member.body.state for member in made.members)
    way = pushed.x_m - 0.2
    assert way > 0.3
    assert pushing.forward_mps == pytest.approx(0.3, abs=0.01)
    assert not pushing.stalled_left
    assert pushed.left_speed_mps == pytest.approx(-0.3, abs=0.01)
    assert gap(made) == pytest.approx(0.0, abs=0.002)
    # Backwards along its own heading; what it rolls in the blow may slip.
    assert made.robots[1].state.x_mm / 1000 == pytest.approx(-way, abs=0.02)


def test_three_in_a_row_are_pushed_and_no_hull_enters_another(meet: Meet) -> None:
    made = meet(((-0.26, 0.0, 0.0), (0.2, 0.0, 0.0), (0.58, 0.0, 180.0)))
    drive(made, 300)
    live(made, 1.6)
    x = [member.body.state.x_m for member in made.members]
    assert x[2] > 0.68
    assert x[1] - x[0] == pytest.approx(P2DX.body.hull_front_m + P2DX.body.hull_rear_m, abs=0.003)
    assert x[2] - x[1] == pytest.approx(2 * FRONT_M, abs=0.003)


def test_a_robot_that_is_pushed_across_its_wheels_holds_out_against_one_of_its_own_model(meet: Meet) -> None:
    made = meet(((-0.3, 0.0, 0.0), (0.2, 0.04, 90.0)))
    drive(made, 300)
    live(made, 2.5)
    pushed = made.members[1].body.state
    assert pushed.x_m == pytest.approx(0.2, abs=0.02)
    assert made.members[0].body.state.stalled_left
    assert made.robots[1].state.y_mm == pytest.approx(0.0, abs=20)


def test_robots_of_one_scene_are_not_stepped_or_reset_by_themselves() -> None:
    made = multi_robot_world(FACING)
    for alone in (lambda body: body.step(0.1, 0.1), lambda body: body.reset(Pose(0, 0, 0), 0)):
        with pytest.raises(UsageError, match="together"):
            alone(made.members[0].body)


def test_a_sonar_takes_a_ping_of_another_robot_that_is_under_way_for_its_echo() -> None:
    for cross_talk in (True, False):
        made = multi_robot_world(((-2.0, 0.0, 0.0), (2.0, 0.0, 180.0)), cross_talk=cross_talk)
        ears = made.robots[1].hears
        assert (ears is None) is not cross_talk
        if ears is None:
            continue
        first = made.robots[0].hears
        assert first is not None
        far = made.members[1].body.sees(3, made.members[0].body, 4)
        assert far == pytest.approx(4.0 - 2 * P2DX.sonar[3].x_mm / 1000, abs=0.001)
        assert first([4], 0) == [None], "it does not hear itself"
        late_ns = 3_000_000
        # Sound needs far / 343 m/s; when the second fires 3 ms later, it counts the rest there and back.
        assert ears([3, 0], late_ns) == [pytest.approx((far - 343.0 * 3e-3) / 2), None]
        assert ears([3], round(far / 343.0 * 1e9) + 1) == [None], "it has passed"
        made.scene.place(replace(CARTON.obstacles[0], name="wall", height_m=0.5))
        assert made.members[1].body.sees(3, made.members[0].body, 4) is None


def test_a_ping_that_is_under_way_is_saved_with_the_world() -> None:
    places = ((-2.0, 0.0, 0.0), (2.0, 0.0, 180.0))
    made, other = multi_robot_world(places), multi_robot_world(places)
    assert made.robots[0].hears is not None
    made.robots[0].hears([4], 0)
    other.restore(pickle.loads(pickle.dumps(made.snapshot())))  # noqa: S301  # our own bytes
    heard = []
    for world in (made, other):
        ears = world.robots[1].hears
        assert ears is not None
        heard.append(ears([3], 3 * NS_PER_MS))
    assert heard[0] == heard[1] != [None]


def test_what_is_due_happens_in_the_order_of_the_times_and_of_the_robots() -> None:
    made = multi_robot_world(FACING)
    due = {0: [700, 900], 1: [300, 900, 1_001]}
    reported: list[tuple[int, int]] = []
    for member in made.members:

        def act(limit: int, number: int = member.number) -> None:
            reported.append((limit, number))
            due[number].remove(limit)

        member.advance_to = act
        member.next_due = lambda number=member.number: min(due[number], default=None)  # type: ignore[misc]
    made.advance_to(1_000)
    assert reported == [(300, 1), (700, 0), (900, 0), (900, 1)]
    made.advance_to(1_001)
    assert reported[4:] == [(1_001, 1)]


def test_a_reset_or_a_reboot_of_one_leaves_the_others_and_its_own_body_standing() -> None:
    made, alone = (multi_robot_world(FACING, cross_talk=False) for _ in range(2))
    for one in (made, alone):
        drive(one, 0, 200)
        live(one, 1.0)
    made.bring(0, 10**9)
    made.robots[0].do("fault reboot", 10**9)
    for one in (made, alone):
        one.robots[1].take_output()
        live(one, 4.0, since=1.0)
    assert made.robots[1].take_output() == alone.robots[1].take_output()
    assert made.members[1].body.state == alone.members[1].body.state
    assert made.members[0].body.state.x_m == -1.0
    assert made.members[1].body.state.x_m < 0.25


def its_power_goes(made: MultiRobotWorld) -> None:
    made.members[1].body.is_powered = False


def it_turns_away(made: MultiRobotWorld) -> None:
    made.members[1].body.stand_at(2.0, 2.0, 0.0)


def it_is_pushed_away(made: MultiRobotWorld) -> None:
    made.members[1].body.give_way(0.0, 0.5)  # and is still near


def the_post_goes(made: MultiRobotWorld) -> None:
    made.members[1].body.remove("post")


@pytest.mark.parametrize(
    ("is_powered", "change"),
    [
        (True, its_power_goes),
        (True, it_is_pushed_away),
        (True, it_turns_away),
        (False, it_turns_away),
        (False, the_post_goes),
    ],
)
def test_a_robot_that_another_holds_goes_on_when_that_changes(
    is_powered: bool, change: Callable[[MultiRobotWorld], None]
) -> None:
    made = multi_robot_world(((-0.5, 0.0, 0.0), (0.0, 0.0, 180.0)))
    pushing, held = (member.body for member in made.members)
    held.is_powered = is_powered
    if not is_powered:  # a post behind it holds it
        made.scene.place(replace(CARTON.obstacles[0], name="post", x_m=P2DX.body.hull_rear_m + 0.16, mass_kg=0.0))
    for _ in range(1000):
        made.scene.step([(0.3, 0.3), (0.0, 0.0)])
    stuck = pushing.state
    assert stuck.stalled_left
    assert held.state.in_contact, "it feels the push in each step"
    change(made)
    for _ in range(500):
        made.scene.step([(0.3, 0.3), (0.0, 0.0)])
    assert pushing.state.x_m > stuck.x_m + 0.1


def test_what_one_pushes_the_other_sees_and_is_stopped_by(meet: Meet) -> None:
    made = meet(((-0.4, 0.0, 0.0), (0.7, 0.0, 180.0)), CARTON)
    before = made.members[1].body.ranges([3])[0]
    drive(made, 300, 0)
    now = live(made, 1.4)
    assert made.members[1].body.ranges([3])[0] < before - 0.15
    live(made, 1.4, since=now)
    # The carton is between them now: 0.3 m, and both hulls.
    assert gap(made) == pytest.approx(0.3, abs=0.02)
    assert made.members[0].body.state.stalled_left


def test_every_robot_is_told_where_what_walks_is_by_now(meet: Meet) -> None:
    made = meet(FACING, CARTON)
    for _ in range(20):
        made.scene.step([(0.0, 0.0)] * 2)
    for member in made.members:
        (visitor,) = [item for item in member.body.take_moved() if item.name == "visitor"]
        assert visitor.x_m == pytest.approx(20 * 1e-3 * 0.5, abs=1e-6)


def test_hulls_never_overlap() -> None:
    made = multi_robot_world(((0.0, 0.0, 0.0), (1.0, 0.1, 170.0), (0.4, 1.0, -90.0), (0.4, -1.0, 80.0)))
    drive(made, 500, 500, 500, 500)
    for index, turn in enumerate((10, -15, 20, -5)):
        say(made, index, C.RVEL, turn)
    now = 0.0
    for _ in range(20):
        now = live(made, 0.1, since=now)
        for member in made.members:
            hull = member.body.footprint.polygon
            for other in made.members:
                assert other is member or not other.body.footprint.overlaps(hull)


def test_bodies_of_different_scenes_cannot_meet() -> None:
    bodies = [make_body("kinematic", HALL, P2DX) for _ in range(2)]
    with pytest.raises(UsageError, match="bodies of its scene"):
        MultiRobotWorld(
            [Pioneer(parameters=P2DX, body=body) for body in bodies], make_scene("kinematic", HALL, [P2DX] * 2)
        )


def test_a_thing_of_the_world_may_have_a_robots_name() -> None:
    crowded = replace(HALL, obstacles=(replace(CARTON.obstacles[0], name="robot 2", x_m=3.0),))
    made = multi_robot_world(FACING, crowded)
    assert made.names == ("robot 1", "robot 2'")


def test_a_thing_that_was_pushed_is_seen_from_afar(meet: Meet) -> None:
    made = meet(((-0.4, 0.0, 0.0), (3.4, 0.0, 180.0)), CARTON)
    before = made.members[1].body.ranges([3])[0]
    drive(made, 300, 0)
    live(made, 1.4)
    assert made.members[1].body.ranges([3])[0] < before - 0.15


# The same bytes, whoever asks first -------------------------------------------------------

#: Close enough that all of them are in each other's way soon, around a carton.
CROWD = ((-0.38, 0.0, 0.0), (0.38, 0.05, 180.0), (0.0, -0.42, 90.0), (-2.6, 2.6, -45.0))
#: So that pings and packets of each fall between the steps and the boundaries.
UNEVEN_NS = 17_300_007
#: Looks that fall between any two of them.
DENSE = range(560_000_000, 690_000_000, 370_000)
#: They touch from 0.58 s on.
END_NS = 730_000_000
TIMES = st.integers(50_000_000, END_NS - 50_000_000)
ORDERS = st.lists(
    st.tuples(
        TIMES, st.integers(0, 3),
        st.sampled_from([(C.VEL, 400), (C.VEL, -300), (C.RVEL, 60), (C.RVEL, -40), (C.VEL, 0), (C.PULSE, None)]),
    ),
    max_size=12,
)  # fmt: skip


def life(
    made: MultiRobotWorld,
    orders: Sequence[tuple[int, int, tuple[int, int | None]]],
    looks: Sequence[int],
    *,
    backwards: bool,
    at_looks: Callable[[list[bytes]], None] = lambda _: None,
) -> tuple[list[bytes], list[object]]:
    """Give orders at their times, look in between, and return every wire's bytes and where everybody is.

    At each look `at_looks` is called with the bytes so far.
    """
    drive(made, 300, 300, 300, 200, apart_ns=UNEVEN_NS)
    sign = -1 if backwards else 1
    events = [(at, 1, sign * index, words) for at, index, words in orders]
    events += [(at, 0, 0, (0, None)) for at in looks]
    wires: list[bytes] = [b""] * len(made.members)
    for at, is_order, signed, (number, argument) in sorted(events, key=lambda event: event[:3]):
        if is_order:
            say(made, abs(signed), number, argument, at=at)
        else:
            made.advance_to(at)
        wires = [wire + b"".join(robot.take_output()) for wire, robot in zip(wires, made.robots, strict=True)]
        if not is_order:
            at_looks(wires)
    made.advance_to(END_NS)
    wires = [wire + b"".join(robot.take_output()) for wire, robot in zip(wires, made.robots, strict=True)]
    return wires, [member.body.state for member in made.members]


@pytest.mark.slow
@settings(max_examples=2)  # each asks 351 times and more
@given(orders=ORDERS, looks=st.lists(TIMES, max_size=20))
def test_the_same_bytes_however_often_and_in_whatever_order_robots_are_asked(
    orders: list[tuple[int, int, tuple[int, int | None]]], looks: list[int]
) -> None:
    once = {(at, index): (at, index, words) for at, index, words in orders}
    chosen = list(once.values())
    first = life(multi_robot_world(CROWD, CARTON), chosen, [], backwards=False)
    assert life(multi_robot_world(CROWD, CARTON), chosen, [*looks, *DENSE], backwards=True) == first


def test_two_that_look_at_each_other_from_near_say_the_same_however_often_they_are_asked() -> None:
    places = ((-0.45, 0.0, 0.0), (0.45, 0.0, 180.0), (-3.0, -3.0, 0.0), (-3.0, 3.0, 0.0))
    first = life(multi_robot_world(places), [], [], backwards=False)
    assert life(multi_robot_world(places), [], DENSE, backwards=True) == first


@settings(max_examples=6)
@given(orders=ORDERS, half=TIMES)
def test_a_multi_robot_world_that_was_saved_goes_on_as_it_would_have(
    orders: list[tuple[int, int, tuple[int, int | None]]], half: int
) -> None:
    made, fresh = multi_robot_world(CROWD, CARTON), multi_robot_world(CROWD, CARTON)
    life_until(made, orders, half)
    saved = pickle.loads(pickle.dumps(made.snapshot()))  # noqa: S301  # our own bytes

    def end(world: MultiRobotWorld) -> object:
        world.advance_to(half + 100 * NS_PER_MS)
        return [robot.take_output() for robot in world.robots], [member.body.state for member in world.members]

    never_restored = end(made)
    for other in (made, fresh):
        other.bring(0, half + 200 * NS_PER_MS)  # when the others act next is known, and of another past
        other.restore(saved)
        assert end(other) == never_restored


@pytest.mark.slow
@pytest.mark.parametrize("engine", each_body("kinematic"))
def test_physical_robots_repeat_and_go_on_after_a_restore(engine: str) -> None:
    orders = [(600_000_123, 0, (C.RVEL, 30)), (640_000_000, 1, (C.VEL, -100)), (640_000_000, 2, (C.RVEL, 40))]
    made, other = (multi_robot_world(CROWD, CARTON, engine) for _ in range(2))
    kept = list[tuple[bytes, list[bytes]]]()
    first = life(
        made, orders, [641_000_000], backwards=False,
        at_looks=lambda wires: kept.append((pickle.dumps(made.snapshot()), wires)),
    )  # fmt: skip
    assert life(other, orders, DENSE, backwards=True) == first
    ((saved, heard),) = kept
    for one in (made, other):
        one.restore(pickle.loads(saved))  # noqa: S301  # our own bytes
        one.advance_to(END_NS)
        wires = [wire + b"".join(robot.take_output()) for wire, robot in zip(heard, one.robots, strict=True)]
        assert (wires, [member.body.state for member in one.members]) == first


def life_until(made: MultiRobotWorld, orders: Sequence[tuple[int, int, tuple[int, int | None]]], end: int) -> None:
    drive(made, 300, 300, 300, 200, apart_ns=UNEVEN_NS)
    for at, index, (number, argument) in sorted(orders, key=lambda order: order[:2]):
        if at <= end:
            say(made, index, number, argument, at=at)
    made.advance_to(end)
