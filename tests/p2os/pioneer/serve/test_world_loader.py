"""Worlds that a client loads: which it may, what becomes of the robots, and what it is told."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from p2os.pioneer.controller import ControllerSettings, Pioneer
from p2os.pioneer.serve.fleet_file import FleetError, parse_fleet
from p2os.pioneer.serve.fleet_order import FleetOrder, MadeFleet, RobotOrder, make_fleet
from p2os.pioneer.world.model import Pose
from p2os.protocol.commands import Command
from p2os.protocol.commands import CommandNumber as C
from p2os.protocol.frames import Decoder, Frame
from p2os.protocol.packets import MapChangedPacket
from simbase.errors import UsageError
from simbase.timing import NS_PER_MS
from tests.p2os.pioneer.body.bodies import each_body

NARROW = 'name = "narrow"\nextent_m = [-9, -9, 9, 9]\n[start]\nx_m = 5.0\ny_m = 0.0\n'
LENIENT = ControllerSettings(lenient=True)


class Fleet:
    """Robots in `room` with a folder of worlds, and their clients."""

    def __init__(self, folder: Path | None, *, robots: int = 1, apart: bool = False, body: str = "kinematic") -> None:
        order = FleetOrder(
            robots=tuple(RobotOrder(port=f"loop:{number}", settings=LENIENT) for number in range(robots)),
            body=body, apart=apart, worlds=folder,
        )  # fmt: skip
        self.made: MadeFleet = make_fleet(order)
        self.now = 0
        self.events: list[tuple[str, str]] = []
        for robot in self.made.robots:
            robot.on_event = lambda _now, what, detail: self.events.append((what, detail))
            for command in (C.PULSE, C.OPEN, C.CLOSE):  # SYNC0 to SYNC2
                robot.receive(Command(command).to_frame().to_bytes(), 0)
            robot.receive(Command(C.OPEN).to_frame().to_bytes(), 0)
            robot.receive(Command(C.ENABLE, 1).to_frame().to_bytes(), 0)

    def run(self, milliseconds: int) -> None:
        self.now += milliseconds * NS_PER_MS
        if self.made.multi_robot_world is not None:
            self.made.multi_robot_world.advance_to(self.now)
        else:
            for robot in self.made.robots:
                robot.advance_to(self.now)

    def say(self, number: int, command: int, argument: int | bytes | None = None) -> None:
        self.made.robots[number].receive(Command(command, argument).to_frame().to_bytes(), self.now)

    def maps(self, number: int = 0) -> list[MapChangedPacket]:
        decoder, found = Decoder(), []
        for data in self.made.robots[number].take_output():
            decoder.receive(data, self.now)
            while (item := decoder.next_item()) is not None:
                if isinstance(item, Frame) and item.kind == MapChangedPacket.KIND:
                    found.append(MapChangedPacket.from_frame(item))
        return found


def place(robot: Pioneer) -> tuple[float, float]:
    state = robot.body.state
    return round(state.x_m, 2), round(state.y_m, 2)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "worlds" / "upper").mkdir(parents=True)
    (tmp_path / "worlds" / "narrow.toml").write_text(NARROW)
    (tmp_path / "worlds" / "upper" / "größe.toml").write_text(NARROW)
    (tmp_path / "worlds" / "broken.toml").write_text("name = ")
    (tmp_path / "secret.toml").write_text(NARROW)
    (tmp_path / "worlds" / "way-out.toml").symlink_to(tmp_path / "secret.toml")
    return tmp_path / "worlds"


@pytest.mark.parametrize("body", each_body())
def test_a_client_loads_a_world_and_drives_on_in_it(body: str, folder: Path) -> None:
    fleet = Fleet(folder, body=body)
    fleet.say(0, C.VEL, 200)
    fleet.run(1500)
    driven_mm = fleet.made.robots[0].state.x_mm
    fleet.say(0, C.LOADWORLD, b"narrow.toml\0")
    assert place(fleet.made.robots[0]) == (5.0, 0.0), fleet.events
    assert fleet.maps() == [MapChangedPacket(status=1, raw_name=b"narrow.toml")]
    assert ("another world", "narrow.toml") in fleet.events
    assert fleet.made.robots[0].state.x_mm == driven_mm > 100
    fleet.run(1500)
    assert fleet.made.robots[0].body.state.x_m > 5.1
    assert fleet.made.robots[0].state.x_mm > driven_mm + 100
    fleet.say(0, C.SIM_RESET)
    assert place(fleet.made.robots[0]) == (5.0, 0.0)


@pytest.mark.parametrize("name", ["office", "narrow.toml", "upper/größe.toml", "upper/../narrow.toml", "room"])
def test_shipped_worlds_and_files_of_the_folder_are_loaded(name: str, folder: Path) -> None:
    fleet = Fleet(folder)
    fleet.say(0, C.LOADWORLD, name.encode())
    fleet.say(0, C.SIM_CTRL, b"\1\0" + len(name.encode()).to_bytes(2, "little") + name.encode())
    assert [packet.status for packet in fleet.maps()] == [1, 1]


@pytest.mark.parametrize(
    "name",
    [
        b"../secret.toml", b"way-out.toml", b"missing.toml", b"upper", b"broken.toml", b"/etc/passwd", b"",
        b"\xff\xfe", b"x" * 190, b"no\nline.toml",
    ],
)  # fmt: skip
def test_what_is_outside_or_no_world_is_refused_aloud_and_nothing_changes(name: bytes, folder: Path) -> None:
    fleet = Fleet(folder)
    before = fleet.made.robots[0].body
    fleet.say(0, C.LOADWORLD, name)
    assert fleet.maps() == [MapChangedPacket(status=2, raw_name=name)]
    assert fleet.made.robots[0].body is before
    (detail,) = [detail for what, detail in fleet.events if what == "world stays"]
    assert detail.isprintable()


def test_outside_and_missing_are_answered_alike(folder: Path) -> None:
    fleet = Fleet(folder)
    fleet.say(0, C.LOADWORLD, b"../secret.toml")
    fleet.say(0, C.LOADWORLD, b"../nothing.toml")
    reported = [detail for what, detail in fleet.events if what == "world stays"]
    assert reported[0].replace("secret", "nothing") == reported[1]


def test_without_a_folder_only_what_ships_is_loaded(folder: Path) -> None:
    fleet = Fleet(None)
    fleet.say(0, C.LOADWORLD, str(folder / "narrow.toml").encode())
    fleet.say(0, C.LOADWORLD, b"arena")
    assert [packet.status for packet in fleet.maps()] == [2, 1]


@pytest.mark.parametrize("body", each_body())
def test_all_robots_of_a_world_go_and_each_client_is_told(body: str, folder: Path) -> None:
    fleet = Fleet(folder, robots=2, body=body)
    fleet.say(1, C.LOADWORLD, b"narrow.toml")
    places = [place(robot) for robot in fleet.made.robots]
    assert places[0] == (5.0, 0.0)
    assert 0.5 < math.dist(*places) < 1.5
    assert [fleet.maps(0), fleet.maps(1)] == [[MapChangedPacket(status=1, raw_name=b"narrow.toml")]] * 2
    fleet.say(0, C.VEL, 200)
    fleet.run(1500)
    assert fleet.made.robots[0].body.state.x_m > 5.1


def test_robots_that_are_apart_go_alone(folder: Path) -> None:
    fleet = Fleet(folder, robots=2, apart=True)
    before = place(fleet.made.robots[0])
    fleet.say(1, C.LOADWORLD, b"narrow.toml")
    assert [place(robot) for robot in fleet.made.robots] == [before, (5.0, 0.0)]
    assert fleet.maps(0) == []


def test_a_world_comes_while_others_drive_and_the_time_goes_on_in_it(folder: Path) -> None:
    fleet = Fleet(folder, robots=2)
    fleet.say(0, C.VEL, 200)
    fleet.run(503)
    fleet.say(1, C.LOADWORLD, b"narrow.toml")
    fleet.run(497)
    assert fleet.made.robots[0].body.state.x_m > 5.0
    assert fleet.made.multi_robot_world is not None
    assert fleet.made.multi_robot_world.scene.bodies[0] is fleet.made.robots[0].body


def test_a_world_without_room_for_all_is_refused(folder: Path) -> None:
    (folder / "tiny.toml").write_text('name = "tiny"\nextent_m = [-0.5, -0.5, 0.5, 0.5]\n')
    fleet = Fleet(folder, robots=2)
    fleet.say(0, C.LOADWORLD, b"tiny.toml")
    assert [packet.status for packet in fleet.maps()] == [2]


def test_the_folder_is_checked_when_it_is_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no folder"):
        FleetOrder(robots=(RobotOrder(),), worlds=tmp_path / "none")
    with pytest.raises(FleetError, match=r"f:1: no folder"):
        parse_fleet('worlds = "none"\n[[robot]]', "f", tmp_path)
    (tmp_path / "maps").mkdir()
    assert parse_fleet('worlds = "maps"\n[[robot]]', "f", tmp_path).worlds == tmp_path / "maps"


@pytest.mark.parametrize("command", [C.SIM_RESET, C.RESETSIMTOORIGIN])
@pytest.mark.parametrize("body", each_body())
def test_a_client_cannot_reset_its_robot_into_another_one(body: str, command: int) -> None:
    settings = replace(LENIENT)
    order = FleetOrder(
        robots=(
            RobotOrder(port="loop:1", settings=settings, at=Pose(0.0, 0.0, 0.0)),
            RobotOrder(port="loop:2", settings=settings, at=Pose(0.0, 1.5, 0.0)),
        ),
        body=body,
    )  # fmt: skip
    made = make_fleet(order)
    reported: list[tuple[str, str]] = []
    made.robots[0].on_event = lambda _now, what, detail: reported.append((what, detail))
    for number in (C.PULSE, C.OPEN, C.CLOSE, C.OPEN):
        made.robots[0].receive(Command(number).to_frame().to_bytes(), 0)
    made.robots[0].body.stand_at(-1.5, 0.0, 0.0)
    made.robots[1].body.stand_at(0.1, 0.0, 0.0)
    made.robots[0].receive(Command(command, 1).to_frame().to_bytes(), 0)
    assert place(made.robots[0]) == (-1.5, 0.0)
    assert ("not reset", "robot 2 stands where this robot starts") in reported
    made.robots[1].body.stand_at(0.0, 1.5, 0.0)
    made.robots[0].receive(Command(command, 1).to_frame().to_bytes(), 0)
    assert place(made.robots[0]) == (0.0, 0.0)


def test_a_robot_of_no_fleet_keeps_its_world(folder: Path) -> None:
    fleet = Fleet(folder)
    fleet.made.robots[0].loads_world = None
    fleet.say(0, C.LOADWORLD, b"office")
    assert [packet.status for packet in fleet.maps()] == [2]
