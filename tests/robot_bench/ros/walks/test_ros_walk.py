"""A bench as a node of ROS, driven at random: pins and motion as messages, messages as levels, runs and bags."""

import math
import struct
from collections.abc import Iterator, Sequence
from pathlib import Path
from random import Random
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

from adapter_sim.pinout import load_pinout
from p2os.robots.parameters import RobotParameters, load_parameters
from p2os.ros.bags import BagMessage
from p2os.ros.transport import NodeOptions, Received
from robot_bench.drives.drive import Steps, Trajectory
from robot_bench.events.codec import line_of
from robot_bench.events.kinds import Contact, Event, Fault, Note, Packet, PinEdge, Pose, Ranges, Text, Verdict
from robot_bench.events.stream import EventStream
from robot_bench.ros import bag_drives, drive, run_bag
from robot_bench.ros.bag_drives import MEASURED, ODOMETRY
from robot_bench.ros.bench_node import BenchNode
from robot_bench.ros.drive import RosPlace, place_before, refuse_without_pins, run_beside
from robot_bench.ros.recorded import inputs_of
from robot_bench.ros.run_bag import RunMessages
from simbase.timing import NS_PER_MS, NS_PER_S
from tests.robot_bench.ros.test_bench_node import Script
from tests.tools.suite.approved import judge_of, rounded, said, tried
from tests.tools.suite.declared import declared_of

MODELS = ("p2dx", "amigo", "p3at-sh")
OPTIONS = (NodeOptions(name="bench"), NodeOptions(name="other", namespace="/r1/a"))
WIRES = [wire.name for wire in load_pinout().wires]


def shown(value: object) -> str:
    """Return messages as a line of text, fractions in texts of them as `said` says fractions."""
    return rounded(said(value)).replace("\n", " ")


def drawn_pose(draw: Random, t: int) -> Pose:
    micro = [draw.choice((0, 1, -1, 250_000, -400_000, draw.randrange(-5_000_000, 5_000_000))) for _ in range(9)]
    return Pose(
        t=t, x=micro[0], y=micro[1], z=micro[2], heading=micro[3], pitch=micro[4], left=micro[5], right=micro[6],
        left_angle=micro[7], right_angle=micro[8], collisions=draw.randrange(3),
    )  # fmt: skip


def drawn_event(draw: Random, t: int) -> Event:
    """Return an event of any kind that a bag has, or of one that it has not."""
    return draw.choice((
        lambda: PinEdge(t=t, wire=draw.choice(WIRES), level=draw.random() < 0.6),
        lambda: drawn_pose(draw, t),
        lambda: Ranges(t=t, mm=tuple(draw.randrange(6000) for _ in range(draw.choice((0, 8, 20))))),
        lambda: Packet(t=t, direction=draw.choice(("c2r", "r2c")), data=draw.randbytes(3)),
        lambda: Text(t=t, data=draw.choice((b"on\r\n", b"\n\n", b"\xff half", b" end ")), port="usart2"),
        lambda: Note(t=t, who="chip", what="warning", detail=draw.choice(("", "of a kind"))),
        lambda: Contact(t=t, what="wall", x_m=0.5, y_m=-1.25, part="front"),
        lambda: Fault(t=t, op="cut", words="cut DD1"),
        lambda: Verdict(t=t, goal="moves", met=draw.random() < 0.5, says="it does"),
    ))()  # fmt: skip


def nodes(draw: Random) -> Iterator[str]:
    """Tell of levels and motion at any time, and take messages of each topic, for each set of wires outside."""
    for model, options, outside in (
        ("p2dx", OPTIONS[0], ()), ("amigo", OPTIONS[1], ("distance",)), ("p3at-sh", OPTIONS[0], ("encoder",)),
        ("p2dx", OPTIONS[1], ("distance", "encoder", "motor")),
    ):  # fmt: skip
        levels: dict[str, bool] = {}
        node = BenchNode(lambda wire, _: levels.get(wire, False), load_parameters(model), options, outside)  # noqa: B023
        yield shown((model, [*node.announced()], node.taken, node.first()))
        now = 0
        for _ in range(24):
            now += draw.choice((0, 1, 10, 99, 100, 101)) * NS_PER_MS
            levels |= {wire: draw.random() < 0.5 for wire in draw.sample(WIRES, draw.choice((0, 0, 3, len(WIRES))))}
            yield shown(node.tell(now))
            yield shown(node.take_pose(drawn_pose(draw, now)))
            yield shown(
                node.take_ranges(Ranges(t=now, mm=tuple(draw.randrange(6000) for _ in range(draw.choice((0, 16, 40))))))
            )
            received = [
                Received(topic, {"data": draw.choice((-1, 0, 1, 5, 7, 8))})
                for topic in draw.choices([*node.taken], k=draw.randrange(5)) if node.taken
            ] if node.taken else []  # fmt: skip
            yield shown((node.take(received, now + 1), node.refused))


def runs(draw: Random) -> Iterator[str]:
    """Turn what happens in a run into messages, and runs beside a network into what both see."""
    for model in (*MODELS, "none", "", None):
        events, now = list[Event](), 0
        for _ in range(60):
            now += draw.choice((0, 1, 5, 10, 20)) * NS_PER_MS
            events.append(drawn_event(draw, now))
        meta: dict[str, object] = {} if model is None else {"robot": {"name": model}}
        yield from tried(lambda meta=meta, events=events: [shown(one) for one in RunMessages(meta).of(events)]).split(
            "), ("
        )
        written = list[object]()
        bag = SimpleNamespace(count=7, write=lambda *row, written=written: written.append(row))
        with patch.object(run_bag, "BagFile", lambda *made, written=written, bag=bag: _Made(written, made, bag)):
            yield tried(run_bag.write_bag, events, Path("bag"), meta, "mcap")
        yield shown(written[:9]) + shown(len(written))


class _Made:
    """A bag that notes how it was made."""

    def __init__(self, written: list[object], made: object, bag: object) -> None:
        self._bag = bag
        written.append(made)

    def __enter__(self) -> object:
        return self._bag

    def __exit__(self, *_: object) -> None:
        """Nothing is open."""


def beside(draw: Random) -> Iterator[str]:
    """Run a bench beside a network, in steps of any length, and one that stands still."""
    for ends, still_at in ((95, None), (100, None), (101, 55), (7, None)):
        network = Script()
        bench: Any = SimpleNamespace(now=draw.choice((0, 3)) * NS_PER_MS, end=ends * NS_PER_MS, events=EventStream())
        bench.scenario = SimpleNamespace(parameters=load_parameters("p2dx"), outside=("distance",))
        bench.parts = SimpleNamespace(harness={wire: SimpleNamespace(level=lambda now: now % 3 == 0) for wire in WIRES})
        lines = list[str]()

        def run_until(end: int, bench: Any = bench, lines: list[str] = lines, still_at: int | None = still_at) -> None:
            lines.append(f"until {end}")
            if still_at is not None and end > still_at * NS_PER_MS:
                return
            for event in (drawn_pose(draw, end), Ranges(t=end, mm=(900, 30))):
                if draw.random() < 0.7:
                    bench.events.publish(event)
            bench.now = min(end, bench.end)

        bench.run_until = run_until
        topics = [*BenchNode(lambda *_: False, bench.scenario.parameters, OPTIONS[0], ("distance",)).taken]
        network.incoming = {n: [Received(draw.choice(topics), {"data": draw.randrange(2)})] for n in range(0, 12, 2)}
        takes = SimpleNamespace(take_inputs=lambda doing, lines=lines: lines.append(shown(doing)))
        with patch.object(drive, "run_of", lambda _, takes=takes: takes):
            run_beside(bench, network, OPTIONS[0])
        yield shown((bench.now, network.looks, network.subscribed, network.announced))
        yield from lines
        yield from (shown(one) for one in network.published)
        bench.events.publish(drawn_pose(draw, bench.now))


def places(_: Random) -> Iterator[str]:
    """Read places, words after the option, scenarios that have pins or not, and inputs."""
    words = ("dds", "dds:42", "dds:0", "dds:232", "dds:233", "dds:1234", "zenoh@127.0.0.1:7447", "zenoh:7@eth0", "dds@",
             "tcp", "", "dds:42@a b", "DDS", "dds:x")  # fmt: skip
    for word in words:
        yield f"{word}: {tried(RosPlace.read, word)} {place_before(word)}"
    for robots, own in (((), None), (("a",), None), ((), "own")):
        scenario: Any = SimpleNamespace(robots=robots, own_robot=own)
        yield tried(refuse_without_pins, scenario)
    notes = [
        Note(t=t, who=who, what=what, detail=detail)
        for t, (who, what, detail) in enumerate(
            (("ros", "set_pin", "DD1 high"), ("ros", "set_pin", "DD1 low"), ("hand", "set_pin", "DD1 high"),
             ("ros", "set_pin", "DD1"), ("ros", "set_pin", "DD1 1"), ("ros", "press", "DD1 high"),
             ("ros", "set_pin", "")))
    ]  # fmt: skip
    yield tried(inputs_of, [f"{line_of(note)}\n" for note in notes[:3]], "trace")
    yield from (tried(inputs_of, [f"{line_of(note)}\n"], "trace") for note in notes)


def drawn_message(draw: Random, kind: str, parameters: RobotParameters) -> dict[str, Any]:
    """Return a message of a bag, sometimes with a stamp of its own, and with what is not finite."""

    def one() -> float:
        return draw.choice(
            (draw.uniform(-3, 3), draw.uniform(-3, 3), 0.0, -0.5, 0.5, 1.0, 4.0) * 3 + (math.nan, math.inf)
        )

    turned = draw.uniform(-3, 3)
    pose = {
        "position": {"x": one(), "y": draw.uniform(-1, 1), "z": 9.0},
        "orientation": {"x": 0.0, "y": 0.1, "z": math.sin(turned / 2), "w": math.cos(turned / 2)},
    }
    twist = {"linear": {"x": one(), "y": 9.0, "z": 9.0}, "angular": {"x": 9.0, "y": 9.0, "z": one()}}
    header = draw.choice(({}, {"header": {"stamp": {"sec": draw.randrange(3), "nanosec": draw.randrange(NS_PER_S)}}}))
    count = draw.choice((parameters.sonar_fitted, parameters.sonar_fitted, parameters.sonar_fitted - 1))
    points = [(draw.uniform(-2, 2), draw.uniform(-2, 2)) for _ in range(count)]
    order = draw.random() < 0.5
    data = b"".join(struct.pack(f"{'>' if order else '<'}fff", 5.0, *point) for point in points)
    axes = [{"name": name, "offset": 4 * n, "datatype": 7} for n, name in enumerate("zxy")]
    parts: dict[str, dict[str, Any]] = {
        "Odometry": {"pose": {"pose": pose}, "twist": {"twist": twist}},
        "PoseStamped": {"pose": pose}, "Twist": twist, "TwistStamped": {"twist": twist},
        "Range": {"range": one()}, "SonarArray": {"ranges": [one() for _ in range(3)]},
        "PointCloud": {"points": [{"x": x, "y": y, "z": 0.0} for x, y in points]},
        "PointCloud2": {
            "fields": axes[: draw.choice((2, 3, 3, 3))], "is_bigendian": order, "point_step": 12, "height": 1,
            "data": data[: draw.choice((len(data), len(data), len(data) - 1))], "width": count,
        },
    }  # fmt: skip
    return {**parts[kind.rpartition("/")[2]], **header}


def steps(found: Steps | None) -> str:
    return "none" if found is None else said((found.t_s.tolist(), found.values.tolist()))


def way(found: Trajectory | None) -> str:
    return (
        "none"
        if found is None
        else said([one.tolist() for one in (found.t_s, found.x_m, found.y_m, found.heading_rad)])
    )


def bags(draw: Random) -> Iterator[str]:
    """Read drives out of bags of a few topics, whose messages come in any order."""
    topics: Sequence[tuple[str, str]] = (
        ("/odom", ODOMETRY), ("/r/pose", ODOMETRY), ("/wheels", ODOMETRY), ("/ground_truth", MEASURED),
        ("/pose", MEASURED), ("/goal", MEASURED),
        ("/cmd_vel", "geometry_msgs/msg/Twist"), ("/a/other", "geometry_msgs/msg/TwistStamped"),
        ("/range7", "sensor_msgs/msg/Range"), ("/range", "sensor_msgs/msg/Range"), ("/s", "p2os_msgs/msg/SonarArray"),
        ("/p", "sensor_msgs/msg/PointCloud"), ("/p2", "sensor_msgs/msg/PointCloud2"),
    )  # fmt: skip
    for number in range(24):
        parameters = load_parameters(MODELS[number % 3])
        chosen = draw.sample(topics, draw.choice((2, 5, 9, len(topics)))) + [draw.choice(topics[:3])] * 2
        found, at_ns = list[BagMessage](), 5 * NS_PER_S
        for _ in range(draw.choice((1, 12, 40))):
            at_ns += draw.choice((0, 1, 100)) * NS_PER_MS
            topic, kind = draw.choice(chosen)
            found.append(BagMessage(topic, kind, at_ns, drawn_message(draw, kind, parameters)))
        asked = list[tuple[Path, frozenset[str]]]()
        with patch.object(
            bag_drives,
            "read_bag",
            lambda path, types, asked=asked, found=found: (asked.append((path, types)), iter(found))[1],
        ):
            yield tried(drive_of, parameters)
        yield said([(path, sorted(types)) for path, types in asked])


def drive_of(parameters: RobotParameters) -> Sequence[str]:
    """Return what a bag tells of a drive, as text."""
    one = bag_drives.read(Path("folder/bag.mcap"), parameters)
    speeds = (one.left_mps, one.right_mps, one.reported_left_mps, one.reported_right_mps)
    return [
        one.name, way(one.odometry), way(one.truth), *map(steps, speeds),
        *(f"{name} {steps(row)}" for name, row in (*one.commands.items(), *one.sonar_m.items())),
    ]  # fmt: skip


TRACES = {
    each.__name__: each for each in (nodes, runs, beside, places, bags)
} | {"declared": declared_of("robot_bench.ros")}  # fmt: skip
test_what_a_bench_says_to_ros_is_what_was_approved = judge_of(__file__, TRACES)
