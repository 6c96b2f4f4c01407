"""What a fleet is to be: its file, its ports, and where each robot begins."""

import contextlib
import math
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from p2os.pioneer.controller import ControllerSettings
from p2os.pioneer.serve.fleet_file import FleetError, load_fleet, parse_fleet
from p2os.pioneer.serve.fleet_order import FleetOrder, RobotOrder, following_ports, make_fleet
from p2os.pioneer.world import load_world
from p2os.pioneer.world.geometry import Footprint, hull_polygon, placed
from p2os.pioneer.world.model import Pose
from p2os.pioneer.world.plan import Plan
from p2os.pioneer.world.start_places import start_places
from p2os.protocol.profiles import Profile
from p2os.robots.parameters import load_parameters
from simbase.errors import UsageError

P2DX, P3AT = load_parameters("p2dx"), load_parameters("p3at-sh")
FULL = """
world = "office"
body = "kinematic"
seed = 7

[[robot]]
at = [1.0, 0, 180]
model = "p3at-sh"
firmware = "ARCOS"
all_sonar = true
lenient = true
errors = "realistic"
baud = 19200
aux = ["1=pty:/tmp/aux1"]
faults = ["sonar-dead 3"]
sync_limit_s = 2.5
flash = "own.toml"

[[robot]]
count = 2

[[robot]]
port = "pty:/tmp/last"
"""


def test_a_file_names_every_robot(tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text('[flash]\nname = "Wilma"\n')
    (tmp_path / "fleet.toml").write_text(FULL)
    order = load_fleet(tmp_path / "fleet.toml")
    assert (order.world, order.body, order.seed, order.apart) == ("office", "kinematic", 7, False)
    first, second, third, last = order.robots
    assert [robot.port for robot in order.robots] == [
        "tcp:127.0.0.1:8101", "tcp:127.0.0.1:8102", "tcp:127.0.0.1:8103", "pty:/tmp/last",
    ]  # fmt: skip
    assert first.at == Pose(1.0, 0.0, math.pi)
    assert (first.settings.profile, first.settings.baud, first.settings.name) == (Profile.ARCOS, 19200, "Wilma")
    assert (first.aux, first.faults) == (((1, "pty:/tmp/aux1"),), ("sonar-dead 3",))
    assert first.sync_limit_ns == 2_500_000_000
    assert second == RobotOrder(port="tcp:127.0.0.1:8102")
    assert third.at is last.at is None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("world = ", "f:1: Invalid value"),
        ('wrld = "room"\n[[robot]]', "f:1: unknown key 'wrld'"),
        ('world = "room"', "f:1: key 'robot' is missing"),
        ("robot = 3", "f:1: robot = 3 is not an array of tables"),
        ("robot = [3]", "f:1: robot = [3] is not an array of tables"),
        ("seed = true\n[[robot]]", "f:1: seed = true is not a whole number"),
        ("[[robot]]\nplace = 1", "f:2: [[robot]] 1: unknown key 'place'"),
        ("[[robot]]\nat = [1]", "f:2: [[robot]] 1: at must be [x, y]"),
        ('[[robot]]\nat = [1, "2"]', "f:2: [[robot]] 1: at must be [x, y]"),
        ("[[robot]]\nat = [1, nan]", "f:2: [[robot]] 1: at = nan is out of range"),
        ("[[robot]]\nat = 3", "f:2: [[robot]] 1: at = 3 is not a list"),
        ("[[robot]]\ncount = 0", "f:2: [[robot]] 1: count = 0 is out of range"),
        ("[[robot]]\ncount = 2\nat = [0, 0]", "f:2: [[robot]] 1: several robots cannot have one place"),
        ("[[robot]]\ncount = 300", "f:2: [[robot]] 1: count = 300 is out of range"),
        ('[[robot]]\nport = "COM3"', "f:2: [[robot]] 1: 'COM3' is not a port URL"),
        ('[[robot]]\nport = "serial:/dev/a"\ncount = 2', "f:2: [[robot]] 1: no port follows serial:"),
        ('[[robot]]\n[[robot]]\nport = "tcp:127.0.0.1:8101"', "f:1: two robots on tcp:127.0.0.1:8101"),
        ('[[robot]]\nfirmware = "PSOS"', 'f:2: [[robot]] 1: firmware = "PSOS" is none of'),
        ("[[robot]]\nbaud = 1200", "f:2: [[robot]] 1: a line of 1200 bit/s"),
        ('[[robot]]\nerrors = "many"', "f:2: [[robot]] 1: no set of sensor errors 'many'"),
        ('[[robot]]\nflash = "none.toml"', "f:2: [[robot]] 1: cannot read none.toml"),
        ('[[robot]]\naux = ["4=pty:"]', "f:2: [[robot]] 1: '4=pty:' names no AUX port"),
        ('[[robot]]\naux = ["1=pty:", "1=pty:/tmp/x"]', "f:1: [[robot]] 1: AUX ports [1, 1]"),
        ("[[robot]]\nfaults = [1]", "f:2: [[robot]] 1: faults = [1] is not a text in quotes, or a list of them"),
        ("[[robot]]\nsync_limit_s = 0", "f:2: [[robot]] 1: sync_limit_s = 0 is out of range"),
        ("[[robot]]\nsync_limit_s = 1000001", "f:2: [[robot]] 1: sync_limit_s = 1000001 is out of range"),
        ("[[robot]]\nsync_limit_s = nan", "f:2: [[robot]] 1: sync_limit_s = nan is out of range"),
        ("robot = []", "f:1: "),
        ("a = " + "[" * 5000, "f:1:"),
    ],
)
def test_a_complaint_names_the_file_the_line_and_the_key(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(FleetError) as caught:
        parse_fleet(text, "f", tmp_path)
    assert str(caught.value).startswith(message)


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    (tmp_path / "noise.toml").write_bytes(b"\xff\xfe\x00")
    for name, message in (("noise.toml", "not a text file"), ("none.toml", "no such file"), (".", "directory")):
        with pytest.raises(FleetError, match=message):
            load_fleet(tmp_path / name)


@settings(max_examples=40)
@given(st.text(max_size=60) | st.text(alphabet='[]robt="=\n 12.{}', max_size=80))
def test_any_text_is_a_fleet_or_a_complaint(text: str) -> None:
    with contextlib.suppress(FleetError):
        assert parse_fleet(text, "f", Path()).robots


def test_ports_follow_the_last_one() -> None:
    assert following_ports(["tcp:127.0.0.1:9"], 3) == ["tcp:127.0.0.1:9", "tcp:127.0.0.1:10", "tcp:127.0.0.1:11"]
    assert following_ports(["pty:/tmp/a", "pty:/tmp/b"], 3) == ["pty:/tmp/a", "pty:/tmp/b", "pty:/tmp/b2"]
    assert following_ports(["tcp:127.0.0.1:0"], 2) == ["tcp:127.0.0.1:0"] * 2
    assert following_ports(["pty:"], 2) == ["pty:", "pty:"]
    with pytest.raises(UsageError, match="ports end"):
        following_ports(["tcp:127.0.0.1:65535"], 2)


# Where they begin -------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["room", "corridor", "ramp", "maze", "office", "doorway", "slalom"])
def test_robots_begin_free_of_things_and_of_each_other(name: str) -> None:
    world, models = load_world(name), [P2DX, P3AT, P2DX, P2DX]
    starts = start_places(world, models, [None] * 4)
    assert starts[0] == world.start
    hulls = [placed(hull_polygon(m.body), s.x_m, s.y_m, s.heading_rad) for m, s in zip(models, starts, strict=True)]
    for number, (start, model) in enumerate(zip(starts, models, strict=True)):
        assert Plan.of_world(world, model).clearance(start.x_m, start.y_m, start.heading_rad) > 0.05
        for other in hulls[number + 1 :]:
            assert Footprint.of_polygon("", hulls[number]).distance(other) > 0.2
    assert start_places(world, models, [None] * 4) == starts


def test_a_place_on_an_upper_floor_is_that_high() -> None:
    world = load_world("ramp")
    (there,) = start_places(world, [P2DX], [Pose(7.0, 0.0, 0.0)])
    assert there.z_m == pytest.approx(0.18)
    with pytest.raises(UsageError, match="on a slope"):
        start_places(world, [P2DX], [Pose(4.0, 0.0, 0.0)])
    assert all(start.z_m == 0.0 for start in start_places(world, [P2DX] * 6, [None] * 6)[:4])


@pytest.mark.parametrize(
    ("places", "message"),
    [
        ([Pose(9, 0, 0)], "robot 1 at 9, 0 is not in 'room'"),
        ([Pose(1.2, 1.5, 0)], "robot 1 at 1.2, 1.5 would stand in 'case'"),
        ([Pose(0, 0, 0), Pose(0.3, 0, 0)], "robot 2 at 0.3, 0 would stand in robot 1"),
        ([None] * 60, "no room for robot"),
    ],
)
def test_a_place_that_is_not_free_is_refused(places: list[Pose | None], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        start_places(load_world("room"), [P2DX] * len(places), places)


def test_a_place_of_a_file_that_is_taken_names_the_file() -> None:
    text = 'world = "office"\nbody = "kinematic"\n[[robot]]\nat = [0, 0, 0]\n[[robot]]\nat = [0.1, 0, 0]\n'
    with pytest.raises(UsageError, match=r"^fleet\.toml: robot 2 at 0\.1, 0 would stand in robot 1"):
        make_fleet(parse_fleet(text, "fleet.toml", Path()))
    robots = (RobotOrder(port="pty:"), RobotOrder(port="pty:", at=Pose(99, 0, 0)))
    with pytest.raises(UsageError, match=r"^robot 2 at 99, 0 is not in 'room'"):
        make_fleet(FleetOrder(robots=robots, body="kinematic"))


def test_a_fleet_stands_where_it_is_placed_in_one_world_or_apart() -> None:
    robots = (
        RobotOrder(port="pty:", faults=("wheel-blocked left",)),
        RobotOrder(port="pty:", at=Pose(1.5, 0, math.pi)),
    )
    made = make_fleet(FleetOrder(robots=robots, body="kinematic", seed=3))
    assert made.multi_robot_world is not None
    assert [robot.settings.seed for robot in made.robots] == [3, 4]
    assert [member.body.state.x_m for member in made.multi_robot_world.members] == [0.0, 1.5]
    assert made.multi_robot_world.members[0].body.ranges([3])[0] < 1.3
    apart = make_fleet(FleetOrder(robots=(RobotOrder(port="pty:"),) * 2, body="kinematic", apart=True))
    assert apart.multi_robot_world is None
    assert apart.starts[0] == apart.starts[1]
    slow = make_fleet(FleetOrder(robots=(RobotOrder(port="serial:/dev/ttyS9?baud=19200"),), body="kinematic"))
    assert slow.robots[0].baud == 19200
    with pytest.raises(UsageError, match="0 robots"):
        FleetOrder(robots=())


def test_the_rear_ring_is_fitted_on_demand_and_measures_behind() -> None:
    fitted = {}
    for chosen in (ControllerSettings(), ControllerSettings(rear_sonar=True), ControllerSettings.for_client("aria")):
        (robot,) = make_fleet(
            FleetOrder(robots=(RobotOrder(model="p3dx-sh", settings=chosen),), body="kinematic")
        ).robots
        fitted[chosen.rear_sonar] = robot.parameters.sonar_fitted
        assert len(robot.body.ranges(range(robot.parameters.sonar_fitted))) == robot.parameters.sonar_fitted
    assert fitted == {False: 8, True: 16}
