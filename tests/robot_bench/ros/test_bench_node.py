"""A bench as a node: what comes in reaches the program and the trace, and a run with it and without ROS is the same."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from adapter_sim.codec import motor_code
from adapter_sim.pinout import WireRole, load_pinout
from p2os.errors import ScenarioError
from p2os.ros.codec import Message
from p2os.ros.topics import TOPICS
from p2os.ros.transport import NodeOptions, Received, Topic
from robot_bench.bench import Bench, run_of
from robot_bench.bench.board import make_harness
from robot_bench.ros.bench_node import BenchNode
from robot_bench.ros.drive import RosPlace, refuse_without_pins, run_beside, with_inputs
from robot_bench.ros.recorded import inputs_of, read_inputs
from robot_bench.scenario.loading import load_scenario
from robot_bench.scenario.scenario import Scenario
from robot_bench.wires.nets import Harness, Strength
from simbase.errors import FileError, UsageError
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

OPTIONS = NodeOptions(name="bench")
P2DX = load_scenario("sensors").parameters


def topic(key: str, number: int | None = None) -> Topic:
    return TOPICS[key].topic(OPTIONS, number)


def sent(key: str, value: int, number: int | None = None) -> Received:
    return Received(topic(key, number), {"data": value})


@dataclass
class Script:
    """A network on which at the n-th look these messages are found; it keeps what is published."""

    incoming: dict[int, list[Received]] = field(default_factory=dict)
    published: list[tuple[Topic, Message]] = field(default_factory=list)
    subscribed: list[Topic] = field(default_factory=list)
    announced: list[Topic] = field(default_factory=list)
    looks: int = 0
    damaged: int = 0

    def announce(self, topic: Topic) -> None:
        self.announced.append(topic)

    def publish(self, topic: Topic, message: Message) -> None:
        self.published.append((topic, message))

    def subscribe(self, topic: Topic) -> None:
        self.subscribed.append(topic)

    def serve(self, service: Topic) -> bool:
        raise AssertionError(f"a bench serves no {service.name}")

    def take(self, timeout_s: float) -> Sequence[Received]:
        assert timeout_s == 0, "a bench waits for nobody"
        self.looks += 1
        return self.incoming.get(self.looks, [])

    def wake(self) -> None:
        """Nobody waits."""

    def close(self) -> None:
        """Nothing is open."""

    def values(self, wanted: Topic) -> list[Any]:
        return [message for where, message in self.published if where == wanted]


def scenario(name: str = "sensors", *, mode: str = "direct", lasts_s: float = 0.6, **settings: object) -> Scenario:
    made = load_scenario(name, settings=tuple(settings.items()))  # type: ignore[arg-type]  # as --set gives them
    return made.with_options(mode=mode, body="kinematic", duration_s=lasts_s)


def levels_of(harness: Harness) -> Callable[[str, Nanos], bool]:
    return lambda wire, now: harness[wire].level(now)


INCOMING = {
    5: [sent("distance_sensor", 1, 3), sent("encoder_left", 5)],
    20: [sent("distance_sensor", 0, 3), sent("distance_sensor", 1, 7)],
    21: [sent("distance_sensor", 1, 7), sent("encoder_left", 9), sent("encoder_right", -1)],
}


def ran(made: Scenario, network: Script, slice_ns: int | None = None) -> Bench:
    bench = Bench(made, slice_ns=slice_ns)
    run_beside(bench, network, OPTIONS)
    bench.finish()
    return bench


@pytest.mark.parametrize("mode", ["direct", "adapter"])
def test_a_run_with_the_inputs_of_another_and_without_ros_has_the_same_hash(mode: str, tmp_path: Path) -> None:
    made = scenario(mode=mode, outside="distance encoder")
    live = ran(made, Script(INCOMING))
    trace = tmp_path / "trace.jsonl"
    trace.write_text("".join(run_of(live).recorder.lines()))
    again = Bench(made, slice_ns=777_777)
    with_inputs(trace)(again)
    again.finish()
    assert again.trace.sha256 == live.trace.sha256
    silent = ran(made, Script())
    assert silent.trace.sha256 != live.trace.sha256


def test_messages_reach_the_chips_pins_at_their_times_and_the_trace_has_each_change_once() -> None:
    bench = ran(scenario(outside="distance encoder"), Script(INCOMING))
    lines = run_of(bench).recorder.lines()
    actions = [(action.at // (10 * NS_PER_MS), action.place, action.level) for action in inputs_of(lines, "t")]
    assert actions == [
        (5, "DD3", True), (5, "encoder1_s1", True), (5, "encoder1_s2", False), (5, "encoder1_s3", True),
        (20, "DD3", False), (20, "DD7", True),
    ]  # fmt: skip
    assert [bench.level(wire) for wire in ("DD3", "DD7", "encoder1_s3", "encoder1_s2")] == [False, True, True, False]


def test_a_program_names_the_sensor_that_ros_raises() -> None:
    quiet = {1: [sent("distance_sensor", 0, number) for number in range(1, 9)]}
    network = Script(quiet | {400: [sent("distance_sensor", 1, 5)]})
    bench = ran(scenario(outside="distance", lasts_s=4.2), network)
    assert bench.text.splitlines()[-1] == "sensor 5 on"
    assert network.values(topic("motor_left"))[-1] == {"data": 2}


@pytest.mark.parametrize("core", ["model", "firmware"])
def test_the_robot_does_not_drive_wires_that_are_outside(core: str) -> None:
    made = scenario("free-drive", mode="adapter", outside="distance").with_options(adapter_core=core)
    bench = Bench(made)
    bench.run_until("0.5 s")
    drivers = {name: set(net._drives) for name, net in bench.parts.harness.nets.items()}
    assert all("adapter" not in drivers[f"DD{number}"] for number in range(1, 9))
    assert "adapter" in drivers["encoder1_s1"]


def test_motor_topics_say_what_stands_on_the_motor_pins() -> None:
    harness = make_harness(load_pinout())
    node = BenchNode(levels_of(harness), P2DX, OPTIONS)
    for value in range(-4, 4):
        at = (value + 5) * NS_PER_S
        for bit, wire in enumerate(load_pinout().value("motor1").wires):
            harness[wire].drive("test", bool(motor_code(value, 3) >> bit & 1), Strength.PUSH_PULL, at)
        assert dict(node.tell(at))[topic("motor_left")] == {"data": value}


def test_values_are_reported_when_they_change_and_each_100_ms_and_the_clock_always() -> None:
    harness = make_harness(load_pinout())
    node = BenchNode(levels_of(harness), P2DX, OPTIONS)
    clock, left = topic("clock"), topic("motor_left")
    assert left in dict(node.tell(0))
    assert dict(node.tell(100 * NS_PER_MS - 1)) == {clock: {"clock": {"sec": 0, "nanosec": 99_999_999}}}
    assert left in dict(node.tell(100 * NS_PER_MS))
    harness["motor1_comm1"].drive("test", True, Strength.PUSH_PULL, 110 * NS_PER_MS)
    found = dict(node.tell(110 * NS_PER_MS))
    assert found[left] == {"data": 1}
    assert topic("motor_right") not in found


def test_pins_that_ros_drives_are_not_told_back() -> None:
    node = BenchNode(levels_of(make_harness(load_pinout())), P2DX, OPTIONS, outside=["distance"])
    assert {one.name for one in node.taken} == {f"/distance_sensor_{number}" for number in range(1, 9)}
    reported = {one.name for one in node.announced()}
    assert not reported & {one.name for one in node.taken}
    assert {"/motor_left", "/motor_right", "/encoder_left", "/encoder_right", "/clock", "/odom"} <= reported


def test_each_distance_topic_is_the_wire_of_its_number() -> None:
    node = BenchNode(levels_of(make_harness(load_pinout())), P2DX, OPTIONS, outside=["distance"])
    wires = [wire.name for wire in load_pinout().with_role(WireRole.DISTANCE)]
    assert [node.taken[topic("distance_sensor", number)] for number in range(1, 9)] == [(wire,) for wire in wires]


def test_odometry_and_clock_count_virtual_time() -> None:
    network = Script()
    bench = ran(scenario(), network)
    stamps = [message["header"]["stamp"] for message in network.values(topic("odom"))]
    assert [stamp["nanosec"] for stamp in stamps[:3]] == [0, 50 * NS_PER_MS, 100 * NS_PER_MS]
    clocks = [message["clock"] for message in network.values(topic("clock"))]
    times = [clock["sec"] * NS_PER_S + clock["nanosec"] for clock in clocks]
    assert times == sorted(set(times))
    assert times[-1] == bench.now
    assert network.values(topic("range", 0))


def test_publishing_decides_nothing() -> None:
    alone = Bench(scenario())
    alone.run_until(alone.scenario.duration_ns)
    alone.finish()
    assert ran(scenario(), Script()).trace.sha256 == alone.trace.sha256


@pytest.mark.parametrize(
    ("text", "found"),
    [("dds", ("dds", 0, "127.0.0.1")), ("dds:42", ("dds", 42, "127.0.0.1")),
     ("zenoh:3@127.0.0.1:7448", ("zenoh", 3, "127.0.0.1:7448")), ("dds@eth0", ("dds", 0, "eth0"))],
)  # fmt: skip
def test_a_place_names_transport_domain_and_network(text: str, found: tuple[str, int, str]) -> None:
    place = RosPlace.read(text)
    assert (place.transport, place.options.domain, place.options.interface) == found


@pytest.mark.parametrize("text", ["", "ros", "dds:", "dds:x", "dds:999", "dds@", "dds 42"])
def test_what_is_no_place_is_refused(text: str) -> None:
    with pytest.raises(UsageError):
        RosPlace.read(text)


def test_a_robot_on_own_pins_and_several_robots_are_refused() -> None:
    for name in ("rover", "two-dodge"):
        with pytest.raises(UsageError, match="on the wires of the pin-out"):
            refuse_without_pins(load_scenario(name))


def test_wires_that_cannot_be_outside_are_refused() -> None:
    with pytest.raises(ScenarioError, match="no wires are called 'motor'"):
        scenario(outside="distance motor")
    with pytest.raises(ScenarioError, match="only wires of the pin-out"):
        scenario("rover", outside="distance")


@pytest.mark.parametrize(
    ("lines", "says"),
    [([], "nothing came in"), (['{"detail":"DD1 up","k":"event","t":5,"what":"set_pin","who":"ros"}\n'], "is no input"),
     (['{"detail":"DD1 high","k":"event","t":5,"what":"burn","who":"ros"}\n'], "is no input")],
)  # fmt: skip
def test_a_trace_without_inputs_or_with_others_is_refused(tmp_path: Path, lines: Iterable[str], says: str) -> None:
    trace = tmp_path / "trace.jsonl"
    trace.write_text("".join(lines))
    with pytest.raises(FileError, match=says):
        read_inputs(trace)


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"cannot read .*nothing: no such file or directory"):
        read_inputs(tmp_path / "nothing")
