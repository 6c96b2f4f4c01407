"""What a person says to the worlds and to the faults of robots that run."""

import pytest

from p2os.pioneer.controller.faults import FAULTS
from p2os.pioneer.serve.fleet_order import FleetOrder, RobotOrder, make_fleet
from p2os.pioneer.serve.host import Host
from p2os.pioneer.serve.multi_robot_world import MultiRobotWorld
from p2os.pioneer.serve.orders import execute
from p2os.pioneer.serve.robot_time import RobotTime
from p2os.transport import Loops

ENGINES = ["kinematic", pytest.param("bullet", marks=pytest.mark.bullet)]


def hosts_of(
    engine: str, *, robots: int = 2, apart: bool = False, world: str = "room"
) -> tuple[list[Host], MultiRobotWorld | None]:
    orders = tuple(RobotOrder(port=f"loop:{number}") for number in range(robots))
    made = make_fleet(FleetOrder(robots=orders, body=engine, apart=apart))
    loops, time = Loops(), RobotTime(lambda: 0)
    hosts = []
    for number, robot in enumerate(made.robots):
        shared = None if made.multi_robot_world is None else (time, made.multi_robot_world, number)
        hosts.append(Host(robot, loops.listen(str(number)), clock=lambda: 0, shared=shared))
    return hosts, made.multi_robot_world


@pytest.mark.parametrize("engine", ENGINES)
def test_things_come_move_and_go_for_all_robots_of_a_world(engine: str) -> None:
    if engine == "bullet":
        pytest.importorskip("pybullet")
    hosts, multi_robot_world = hosts_of(engine)
    assert multi_robot_world is not None
    body = multi_robot_world.members[0].body
    free = body.ranges([3])[0]
    assert execute(hosts, "place box 0.8 0 0.2 0.4 90") == ["world: box-1 at 0.8, 0"]
    assert body.ranges([3])[0] == pytest.approx(0.8 - 0.2 - 0.166, abs=0.01)
    assert execute(hosts, "place box 2.9 -2.9 0.1 0.1") == ["world: box-2 at 2.9, -2.9"]
    assert execute(hosts, "2: move box-1 1.2 0") == ["world: box-1 at 1.2, 0"]
    assert body.ranges([3])[0] == pytest.approx(1.2 - 0.1 - 0.166, abs=0.01)
    assert execute(hosts, "remove box-1") == ["world: box-1 is gone"]
    assert body.ranges([3])[0] == pytest.approx(free)
    assert execute(hosts, "place post 0.7 0 0.1") == ["world: post-1 at 0.7, 0"]
    multi_robot_world.members[1].body.remove("post-1")
    assert body.ranges([3])[0] == pytest.approx(free), "the world is one for all"


REFUSED = {
    "place": "error: 'place' is no order",
    "place ball 1 1 1": "error: 'place ball 1 1 1' is no order",
    "place box 1 1": "error: 'place box 1 1' is incomplete",
    "place post 1 1 1 1": "error: 'place post 1 1 1 1' has too many words",
    "place post 1 here 1": "error: 'here' is no number of -1000 to 1000",
    "place post 1 nan 1": "error: 'nan' is no number",
    "place box 1 1 0 1": "error: '0' is no number of 0.001 to 1000",
    "move crate": "error: 'move crate' is incomplete",
    "move crat 1 1": "error: no obstacle 'crat'",
    "remove 'crate": 'error: "remove \'crate": a quote is open',
    'remove "robot 2"': "error: 'robot 2' is a robot",
    'remove "a: b"': "error: no obstacle 'a: b'",
    "dance: status": "error: no robot 'dance'",
}


@pytest.mark.parametrize("engine", ENGINES)
def test_an_order_that_cannot_be_changes_nothing(engine: str) -> None:
    if engine == "bullet":
        pytest.importorskip("pybullet")
    hosts, multi_robot_world = hosts_of(engine)
    assert multi_robot_world is not None
    before = [member.body.ranges(range(8)) for member in multi_robot_world.members]
    for words, message in REFUSED.items():
        answer = execute(hosts, words)
        assert answer[0].startswith(message)
        assert answer[1].startswith("hint: ")
        assert [member.body.ranges(range(8)) for member in multi_robot_world.members] == before, words


def test_robots_apart_have_worlds_of_their_own() -> None:
    hosts, _ = hosts_of("kinematic", apart=True)
    assert execute(hosts, "place post 0.7 0 0.1") == [
        "world of robot 1: post-1 at 0.7, 0", "world of robot 2: post-1 at 0.7, 0",
    ]  # fmt: skip
    assert execute(hosts, "2: remove post-1") == ["world of robot 2: post-1 is gone"]
    ranges = [host.pioneer.body.ranges([3])[0] for host in hosts]
    assert ranges[0] < ranges[1]


def test_there_is_an_end_to_what_is_placed() -> None:
    hosts, _ = hosts_of("kinematic", robots=1)
    for _ in range(100):
        execute(hosts, "place post 3 3 0.01")
    assert execute(hosts, "place post 3 3 0.01")[0] == "error: there are 100 of that shape already"


WORDS = {"NUMBER": "3", "METRES": "1.25", "SIDE": "left", "RATE": "0.001", "VOLTS": "10.9", "SEGMENT": "2"}


@pytest.mark.parametrize("name", FAULTS)
def test_each_fault_is_injected_reported_and_cleared_live(name: str) -> None:
    (host,), _ = hosts_of("kinematic", robots=1)
    words = " ".join([name, *(WORDS[word] for word in FAULTS[name][0])])
    if name == "bumper":
        words = "bumper rear 2"
    assert execute([host], f"fault {words}") == [f"robot 1: fault {words}"]
    if name in {"reboot", "brown-out"}:
        assert host.pioneer.state.injected == ()
        assert execute([host], f"clear {name}")[0] == f"error: there is nothing to clear after {name}"
        return
    assert host.pioneer.state.injected == (words,)
    assert execute([host], "status")[0].endswith(f"injected: {words}")
    assert execute([host], "clear all") == [f"robot 1: cleared {words}"]
    assert execute([host], "clear all") == ["robot 1: cleared nothing: nothing was injected"]
    assert "injected" not in execute([host], "status")[0]


@pytest.mark.parametrize(
    ("words", "answer"),
    [
        ("fault", ["error: which fault?", "hint: faults: sonar-stuck"]),
        ("fault sonar-stuk 3 1", ["error: no fault 'sonar-stuk'", "hint: did you mean 'sonar-stuck'?"]),
        ("fault sonar-stuck 3", ["error: 'sonar-stuck 3' is incomplete", "hint: usage: sonar-stuck NUMBER METRES"]),
        ("fault reboot now", ["error: 'reboot now' has too many words", "hint: usage: reboot"]),
        ("faults", ["error: no order 'faults'", "hint: did you mean 'fault'?"]),
        ("quit", ["error: no order 'quit'", "hint: orders: status, fault"]),
        ("1:", ["error: no order ''", "hint: orders: "]),
    ],
)
def test_words_that_mean_nothing_are_answered_with_what_would(words: str, answer: list[str]) -> None:
    hosts, _ = hosts_of("kinematic", robots=1)
    for line, expected in zip(execute(hosts, words), answer, strict=True):
        assert line.startswith(expected)


def test_help_lists_every_order() -> None:
    text = "\n".join(execute([], "help"))
    assert all(word in text for word in ("place box X Y LENGTH WIDTH [HEADING]", "clear all", "fault reboot", "N: …"))
