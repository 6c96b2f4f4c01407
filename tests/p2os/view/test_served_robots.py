"""Robots that are served, on a page: their places are the truth, and their lines are the clients' own."""

from contextlib import closing

import pytest

from p2os.capture import Direction
from p2os.cli.virtual.viewed_fleet import viewing
from p2os.pioneer.body.contract import BodyState
from p2os.pioneer.serve.fleet import open_hosts
from p2os.pioneer.serve.fleet_order import FleetOrder, RobotOrder, make_fleet
from p2os.pioneer.serve.host import Host
from p2os.pioneer.world import load_world
from p2os.protocol.commands import Command
from p2os.robots.parameters import load_parameters
from p2os.view.served_robots import ServedRobots


def rows(robots: ServedRobots, name: str, source: str) -> list[tuple[object, ...]]:
    robots.source.update()
    track = next(
        one for one in robots.source.recording.tracks if (one.header.name, one.header.source) == (name, source)
    )
    return list(zip(*track.columns, strict=True))


def test_each_robot_has_its_own_channels_and_all_have_one_list_of_events() -> None:
    robots = ServedRobots("x", load_world("room"), [load_parameters("p2dx")] * 2)
    robots.sample(1, BodyState(x_m=1.0, left_speed_mps=0.5), 7)
    robots.bytes_of(0, Direction.TO_ROBOT, Command(0).to_frame().to_bytes(), 8)
    robots.event(1, 9, "stall", "left")
    assert rows(robots, "pose", "robot 1") == []
    assert [row[:2] for row in rows(robots, "pose", "robot 2")] == [(7, 1.0)]
    assert rows(robots, "left", "robot 2") == [(7, 0.5)]
    assert [row[1:4] for row in rows(robots, "P2OS", "robot 1")] == [(1, bytes.fromhex("fafb03000000"), "SYNC0")]
    assert [row[:5] for row in rows(robots, "events", "")] == [(9, 1, "robot 2", "stall", "left")]
    header = robots.source.recording.full_header
    assert [one.name for one in header.robots] == ["robot 1", "robot 2"]
    assert header.world is not None
    assert header.world.name == "room"


@pytest.mark.parametrize("is_viewed", [False, True])
def test_a_fleet_is_served_alike_with_and_without_a_page(is_viewed: bool, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("uvicorn")
    order = FleetOrder(robots=(RobotOrder(port="tcp:127.0.0.1:0", model="p2dx"),), world="room", body="kinematic")
    made, hosts, seen = make_fleet(order), list[Host](), list[str]()
    with viewing(order, made, [lambda _at, what, _detail: seen.append(what)], lambda: hosts, is_viewed=is_viewed,
                 is_opened=False) as page:  # fmt: skip
        hosts += open_hosts(order, made, events=page.events, listens=page.listens)
        with closing(hosts[0]):
            for _, sample in page.ticks:
                sample()
            assert hosts[0].listener.description.startswith("tcp:127.0.0.1:")
            assert bool(page.ticks) is is_viewed
            made.robots[0].on_event(3, "stall", "left")
    assert seen == ["stall"]
    assert ("page: http" in capsys.readouterr().err) is is_viewed
