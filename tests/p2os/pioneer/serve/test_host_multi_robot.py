"""Hosts of robots that share a world: one time for all, and nobody's turn decides anything."""

import math
from collections.abc import Sequence

import pytest

from p2os.pioneer.controller.settings import ControllerSettings
from p2os.pioneer.serve.fleet_order import FleetOrder, RobotOrder, make_fleet
from p2os.pioneer.serve.host import LEADING_WAIT_S, Host
from p2os.pioneer.serve.orders import execute
from p2os.pioneer.serve.robot_time import LONGEST_PAUSE_NS, SETTLE_NS, RobotTime
from p2os.pioneer.world.model import Pose
from p2os.protocol.commands import Command
from p2os.protocol.commands import CommandNumber as C
from p2os.robots.parameters import load_parameters
from p2os.transport import Loops, Transport, open_url
from simbase.timing import NS_PER_MS

P2DX = load_parameters("p2dx")
FACING = (Pose(-0.6, 0.3, 0.0), Pose(0.6, 0.3, math.pi))


class Clock:
    """A clock that stands until it is set."""

    now = 0

    def __call__(self) -> int:
        return self.now


class Hall:
    """Two robots face to face, their hosts, and a clock that the test holds."""

    def __init__(self, *, baud: int | None = None, backwards: bool = False) -> None:
        settings = ControllerSettings(baud=baud)
        robots = tuple(RobotOrder(port=f"loop:{n}", at=place, settings=settings) for n, place in enumerate(FACING))
        self.made = make_fleet(FleetOrder(robots=robots, body="kinematic"))
        assert self.made.multi_robot_world is not None
        self.multi_robot_world, self.clock, self.loops, self.events = (
            self.made.multi_robot_world,
            Clock(),
            Loops(),
            list[str](),
        )
        self.time = RobotTime(self.clock)
        self.hosts = [
            Host(
                robot, self.loops.listen(str(number)), shared=(self.time, self.multi_robot_world, number),
                on_event=lambda _now, what, detail, number=number: self.events.append(f"{number} {what}: {detail}"),
            )
            for number, robot in enumerate(self.made.robots)
        ]  # fmt: skip
        self.order = self.hosts[::-1] if backwards else self.hosts
        self.lines: list[Transport] = []

    def call(self, *numbers: int) -> None:
        self.lines = [open_url(f"loop:{number}", loops=self.loops) for number in numbers]
        self.turn()

    def turn(self) -> None:
        for host in self.order:
            host.turn(0)

    def run(self, milliseconds: int, step_ns: int = NS_PER_MS) -> list[bytes]:
        heard = [b""] * len(self.lines)
        for _ in range(milliseconds * NS_PER_MS // step_ns):
            self.clock.now += step_ns
            self.turn()
            heard = [said + line.read() for said, line in zip(heard, self.lines, strict=True)]
        return heard

    def say(self, number: int, argument: int | None = None, *, to: Sequence[int] = (0, 1)) -> None:
        for index in to:
            self.lines[index].write(Command(number, argument).to_frame().to_bytes())

    def drive(self, speed: int) -> None:
        for number, argument in ((0, None), (1, None), (2, None), (C.OPEN, None), (C.ENABLE, 1), (C.VEL, speed)):
            self.say(number, argument)
            self.run(80)

    @property
    def gap_m(self) -> float:
        first, second = (member.body.state.x_m for member in self.multi_robot_world.members)
        return second - first - 2 * P2DX.body.hull_front_m

    def close(self) -> None:
        for host in self.hosts:
            host.close()


@pytest.mark.parametrize("baud", [None, 9600])
def test_robots_drive_against_each_other_whoever_has_the_first_turn(baud: int | None) -> None:
    heard = []
    for backwards in (False, True):
        hall = Hall(baud=baud, backwards=backwards)
        hall.call(0, 1)
        hall.drive(300)
        said = hall.run(1500, step_ns=700_000)
        hall.say(C.PULSE)
        heard.append([*said, *hall.run(900)])
        assert hall.gap_m == pytest.approx(0, abs=0.001)
        assert all(member.body.state.stalled_left for member in hall.multi_robot_world.members)
        hall.close()
    assert heard[0] == heard[1]
    assert all(heard[0])


def test_a_robot_without_a_client_is_carried_along_and_seen() -> None:
    hall = Hall()
    hall.call(0)
    hall.say(C.PULSE, to=[0])
    hall.run(250)
    assert hall.time.now == 250 * NS_PER_MS
    assert execute(hall.hosts, "2: fault wheel-blocked left") == ["robot 2: fault wheel-blocked left"]
    assert hall.multi_robot_world.members[0].body.ranges([3])[0] == pytest.approx(hall.gap_m + 0.014, abs=0.01)
    hall.close()


def test_one_that_loses_its_client_stops_and_gives_way_to_one_that_drives() -> None:
    hall = Hall()
    hall.call(0, 1)
    hall.drive(200)
    first, second = (member.body for member in hall.multi_robot_world.members)
    hall.lines.pop(1).close()
    hall.run(20)
    there = second.state.x_m
    for _ in range(3):
        assert (second.state.x_m > there) is second.state.in_contact
        hall.say(C.PULSE, to=[0])
        hall.run(1500)
    assert second.state.x_m > there
    assert not first.state.stalled_left
    hall.close()


def test_time_stands_still_while_nobody_is_there_and_leaves_pauses_out() -> None:
    hall = Hall()
    hall.run(2000, step_ns=100 * NS_PER_MS)
    assert hall.time.now == 0
    hall.call(0, 1)
    hall.clock.now += LONGEST_PAUSE_NS + 1
    hall.turn()
    assert [event for event in hall.events if "lag" in event] == [
        "0 lag: the machine paused for 0.3 s; the robot's time leaves it out"
    ]
    for line in hall.lines:
        line.close()
    hall.lines = []
    hall.run(3000, step_ns=100 * NS_PER_MS)
    # The hosts notice it one turn later.
    assert hall.time.now == SETTLE_NS + 100 * NS_PER_MS
    hall.close()


def test_what_a_robot_sends_while_no_client_is_there_does_not_go_to_the_next() -> None:
    hall = Hall()
    hall.call(0)
    execute(hall.hosts, "2: fault reboot")
    hall.run(900)
    hall.lines.append(open_url("loop:1", loops=hall.loops))
    assert hall.run(100)[1] == b""
    hall.close()


def test_the_first_robot_steps_the_world_between_the_packets_while_anybody_is_there() -> None:
    hall = Hall()
    hall.run(2000)
    assert hall.hosts[0].wait_s() > LEADING_WAIT_S, "nobody is there"
    hall.call(1)
    hall.run(10)
    # The second one alone has a client; the work of all is the first one's.
    assert hall.hosts[0].wait_s() == LEADING_WAIT_S
    assert hall.hosts[1].wait_s() > LEADING_WAIT_S
    hall.clock.now += 5 * NS_PER_MS
    hall.hosts[0].turn(0)
    assert hall.multi_robot_world._at == hall.time.now
    hall.close()
