"""A robot that is put back at its start: body, controller, world, its neighbours and its client."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from p2os import Robot
from p2os.pioneer.body.factory import make_body
from p2os.pioneer.controller.controller import BOOT_NS
from p2os.pioneer.serve import served_pioneer
from p2os.pioneer.serve.fleet_order import FleetOrder, RobotOrder, make_fleet
from p2os.pioneer.serve.host import Host
from p2os.pioneer.serve.orders import execute
from p2os.pioneer.serve.robot_time import RobotTime
from p2os.pioneer.world.model import Obstacle, Pose, World
from p2os.protocol.commands import Command
from p2os.protocol.commands import CommandNumber as C
from p2os.protocol.packets import ResetNotice
from p2os.robots.parameters import load_parameters
from p2os.transport import Loops, open_url
from p2os.transport.virtual_clock import VirtualClock
from simbase.errors import P2osError, UsageError
from simbase.timing import NS_PER_MS, NS_PER_S
from tests.p2os.pioneer.body.bodies import Maker, drive, each_body

P2DX = load_parameters("p2dx")
CARTON = Obstacle(name="carton", x_m=1.0, y_m=0.0, length_m=0.3, width_m=0.3, mass_kg=1.0, friction=0.3)
WORLD = World(name="w", source="w", description="", start=Pose(0, 0, 0), extent=(-6, -6, 6, 6), obstacles=(CARTON,))
CARTON_FILE = """
name = "c"
extent_m = [-4, -4, 4, 4]
[[box]]
name = "carton"
x_m = 0.0
y_m = 0.0
length_m = 0.3
width_m = 0.3
mass_kg = 1.0
"""
AT = (Pose(-1.0, 0.0, 0.0), Pose(1.5, 1.0, math.pi))


@pytest.fixture(params=each_body())
def make(request: pytest.FixtureRequest) -> Maker:
    return lambda: make_body(request.param, WORLD, P2DX)


def test_a_body_stands_at_its_start_again_and_so_does_what_it_has_pushed(make: Maker) -> None:
    body = make()
    body.reset(Pose(0.1, 0.0, 0.05), 0)
    begun = drive(body, 0, 0, 0.05)
    assert drive(body, 0.4, 0.4, 2.0).collisions == 1
    body.take_moved()
    body.take_hits()
    body.put_back()
    assert [(item.name, item.x_m, item.y_m) for item in body.take_moved()] == [("carton", 1.0, 0.0)]
    assert body.take_hits() == []
    back = drive(body, 0, 0, 0.3)
    for name in ("x_m", "y_m", "z_m", "heading_rad", "pitch_rad", "left_angle_rad", "right_angle_rad"):
        assert getattr(back, name) == pytest.approx(getattr(begun, name), abs=1e-4), name
    assert (back.collisions, back.in_contact, back.stalled_left) == (0, False, False)
    assert body.ranges([3]) == pytest.approx(make().ranges([3]), abs=0.11)


def test_a_body_that_was_put_back_goes_the_same_way_each_time_and_from_a_snapshot(make: Maker) -> None:
    def trial(body: Any) -> list[object]:
        body.put_back()
        return [drive(body, 0.45, 0.42, 0.5) for _ in range(4)]

    body, other = make(), make()
    drive(body, 0.2, 0.1, 1.0)
    other.restore(body.snapshot())
    other_start = Pose(0, 0, 0)
    assert trial(body) == trial(other), "a snapshot knows the start"
    assert body.state.x_m > other_start.x_m + 0.1


def test_what_was_taken_out_of_the_world_stays_out(make: Maker) -> None:
    body = make()
    body.remove("carton")
    body.put_back()
    assert body.take_moved() == []


def test_a_controller_that_starts_over_is_as_one_that_was_switched_on(make_robot: Any) -> None:
    robot, new = make_robot(), make_robot()
    robot.open()
    robot.say(C.SETA, 50)
    robot.say(C.ENABLE, 1)
    robot.say(C.VEL, 200)
    robot.pioneer.do("fault low-battery 9.5", robot.now)
    robot.run(2500)
    assert robot.body.state.left_angle_rad > 1.0, "its wheels stand elsewhere"
    robot.pioneer.start_over(robot.now)
    assert robot.frames() == []
    assert robot.pioneer.state == new.pioneer.state
    assert robot.body.state == new.body.state
    assert "started over" in robot.reported()
    robot.say(0)
    robot.run(BOOT_NS / NS_PER_MS - 1)
    assert robot.frames() == [], "it receives nothing while it boots"
    robot.run(1)
    assert [frame.kind for frame in robot.frames()] == [ResetNotice().to_frame().kind]
    behaviour = []
    for one in (robot, new):
        one.open()
        one.say(C.ENABLE, 1)
        one.say(C.VEL, 200)
        one.run(1500)
        behaviour.append([replace(sip) for sip in one.sips()])
    assert behaviour[0] == behaviour[1]


def test_faults_of_the_start_are_there_again_and_no_others() -> None:
    order = FleetOrder(robots=(RobotOrder(port="loop:0", faults=("sonar-dead 3",)),), body="kinematic")
    (pioneer,) = make_fleet(order).robots
    pioneer.do("clear sonar-dead 3", 0)
    pioneer.do("fault wheel-blocked left", 0)
    pioneer.start_over(NS_PER_S)
    assert pioneer.state.injected == ("sonar-dead 3",)


class Fleet:
    """Robots, their hosts, a client each, and a clock that the test holds."""

    def __init__(self, engine: str, world: str, *, apart: bool = False) -> None:
        robots = tuple(RobotOrder(port=f"loop:{n}", at=place) for n, place in enumerate(AT))
        self.made = make_fleet(FleetOrder(robots=robots, world=world, body=engine, apart=apart))
        self.now, loops = 0, Loops()
        time = RobotTime(lambda: self.now)
        multi = self.made.multi_robot_world
        self.hosts = [
            Host(
                robot, loops.listen(str(n)), clock=lambda: self.now,
                shared=None if multi is None else (time, multi, n),
            )
            for n, robot in enumerate(self.made.robots)
        ]  # fmt: skip
        self.lines = [open_url(f"loop:{n}", loops=loops) for n in range(len(AT))]
        self.heard = [b""] * len(AT)

    def run(self, milliseconds: int) -> None:
        for _ in range(milliseconds // 5):
            self.now += 5 * NS_PER_MS
            for number, host in enumerate(self.hosts):
                host.turn(0)
                self.heard[number] += self.lines[number].read()

    def drive(self, number: int, speed: int) -> None:
        for what, argument in ((0, None), (1, None), (2, None), (C.OPEN, None), (C.ENABLE, 1), (C.VEL, speed)):
            self.lines[number].write(Command(what, argument).to_frame().to_bytes())
            self.run(20)

    def at(self, number: int) -> tuple[float, float]:
        state = self.hosts[number].pioneer.body.state
        return state.x_m, state.y_m


@pytest.fixture(params=each_body())
def fleet(request: pytest.FixtureRequest, tmp_path: Path) -> Any:
    path = tmp_path / "c.toml"
    path.write_text(CARTON_FILE, encoding="utf-8")
    return lambda **options: Fleet(request.param, str(path), **options)


def test_one_robot_of_a_world_goes_back_the_others_go_on_and_see_it(fleet: Any) -> None:
    hall = fleet()
    hall.drive(0, 400)
    hall.drive(1, 100)
    hall.run(1500)
    hall.lines[1].write(Command(C.PULSE).to_frame().to_bytes())
    hall.run(1000)
    assert hall.at(0)[0] > -0.4
    moving = hall.at(1)[0]
    assert execute(hall.hosts, "1: reset") == ["robot 1: at its start, as just switched on"]
    assert hall.at(0) == pytest.approx((-1.0, 0.0), abs=1e-3)
    state = hall.hosts[0].pioneer.state
    assert (state.open, state.motors_enabled, state.x_mm) == (False, False, 0)
    hall.heard = [b"", b""]
    hall.run(600)
    assert hall.heard[0] == ResetNotice().to_frame().to_bytes(), "its client is told, and its line stays"
    assert hall.hosts[0].client is not None
    assert hall.hosts[1].pioneer.state.open
    assert hall.at(1)[0] < moving - 0.03
    for member in hall.made.multi_robot_world.members:  # each has its plan of the world
        (carton,) = [item for item in member.body.take_moved() if item.name == "carton"]
        assert (carton.x_m, carton.y_m) == pytest.approx((0, 0), abs=1e-3)


def test_all_of_a_world_go_back_at_once_and_worlds_apart_one_by_one(fleet: Any) -> None:
    for apart in (False, True):
        hall = fleet(apart=apart)
        for number in (0, 1):
            hall.drive(number, 300)
        hall.run(400)
        assert hall.at(0)[0] > AT[0].x_m + 0.01
        answer = execute(hall.hosts, "reset")
        assert answer == [f"robot {number}: at its start, as just switched on" for number in (1, 2)]
        for number, start in enumerate(AT):
            assert hall.at(number) == pytest.approx((start.x_m, start.y_m), abs=1e-3)
        assert not any(host.pioneer.state.open for host in hall.hosts)


def test_a_start_on_which_another_robot_stands_is_refused_and_nothing_changes(tmp_path: Path) -> None:
    hall = Fleet("kinematic", "room")
    first, second = hall.made.multi_robot_world.members  # type: ignore[union-attr]  # they share the room
    for number in (0, 1):
        hall.drive(number, 0)
    first.body.stand_at(2.0, 0.1, 0.0)
    second.body.stand_at(-1.1, 0.1, 0.0)
    (error, hint) = execute(hall.hosts, "1: reset")
    assert error == "error: robot 2 stands where robot 1 starts"
    assert hint == "hint: drive it away, or put all back: reset"
    assert hall.hosts[0].pioneer.state.open
    assert first.pioneer.state.motors_enabled


def test_a_robot_without_a_client_boots_and_then_rests() -> None:
    hall = Fleet("kinematic", "room", apart=True)
    hall.lines[0].close()
    host, spent = hall.hosts[0], []
    for _ in range(2):
        before = host.now
        for _ in range(60):
            hall.now += 50 * NS_PER_MS
            host.turn(0)
        spent.append(host.now - before)
        assert host.pioneer.next_deadline() is None
        execute([host], "reset")
    assert BOOT_NS <= spent[1] < 2 * NS_PER_S


def test_words_after_reset_are_refused() -> None:
    hall = Fleet("kinematic", "room")
    assert execute(hall.hosts, "reset now")[0].startswith("error: ")
    assert any(line.startswith("reset ") for line in execute(hall.hosts, "help"))


def test_a_program_puts_its_served_robot_back_and_its_client_finds_it_again() -> None:
    clock = VirtualClock()
    with served_pioneer(body="kinematic", clock=clock) as served:
        assert served.startswith("tcp:")
        with Robot(served, clock=clock) as robot:
            robot.drive(0.05)
            assert robot.state.pose.x_m > 0.03
            served.reset()
        with Robot(served, clock=clock) as robot:
            assert robot.state.pose.x_m == pytest.approx(0, abs=0.001)
        with pytest.raises(UsageError, match="no order 'rest'"):
            served.order("rest")
        asked_at = clock()
        assert served.order("status")[0].startswith("robot 1 at")
        assert clock() == asked_at, "its host is woken"
    with pytest.raises(P2osError, match="served no more"):
        served.reset()
