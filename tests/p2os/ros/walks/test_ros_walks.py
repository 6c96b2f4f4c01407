"""Robots as nodes of ROS: messages of any state, what any message asks for, and what transports ask of libraries."""

import math
import os
import random
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any, Self
from unittest.mock import patch

import pytest

pytest.importorskip("cyclonedds", reason="the extra ros is not installed")
pytest.importorskip("rosbags", reason="the extra ros is not installed")
pytest.importorskip("zenoh", reason="the extra ros is not installed")

from p2os.client.observer import Bumpers, Observer
from p2os.client.robot_state import RobotPose
from p2os.errors import RemoteProtocolError
from p2os.pioneer.devices.laser import LaserModel
from p2os.protocol.packets import SimLaserPacket
from p2os.protocol.sip import SonarReading, StandardSip
from p2os.robots.parameters import load_parameters
from p2os.ros import bags, codec, dds, message_table, transports, zenoh_node
from p2os.ros.frames import Frames
from p2os.ros.robot_messages import Scans, health, planar, seen_as
from p2os.ros.robot_node import COMMANDS, RobotNode
from p2os.ros.thesis_topics import encoder_code, motor_speed, near
from p2os.ros.topics import SERVICES, TOPICS
from p2os.ros.transport import NodeOptions, Received, Topic
from p2os.ros.urdf import urdf_text
from simbase.errors import UsageError
from simbase.timing import NS_PER_MS, NS_PER_S
from tests.p2os.ros.spoken_types import SPOKEN
from tests.tools.suite.acted import Acted, taken
from tests.tools.suite.approved import Trace, judge_of, rounded, said, tried
from tests.tools.suite.declared import declared_of

LASER = LaserModel(start_deg=-20, end_deg=20, step_cdeg=1000, range_m=8.0, nearest_m=0.1)
OPTIONS = (NodeOptions(), NodeOptions(namespace="/r1/a", name="n", domain=7))
STAMPS = (0, 1, NS_PER_S - 1, NS_PER_S, 1_700_000_000 * NS_PER_S + 7)


def shown(message: object) -> str:
    """Return a message as text, bytes of it in hexadecimal."""
    if isinstance(message, bytes):
        return message.hex()
    if isinstance(message, dict):
        return "{" + ", ".join(f"{key}: {shown(value)}" for key, value in message.items()) + "}"
    if isinstance(message, list | tuple) and not isinstance(message, Topic):
        return "(" + ", ".join(map(shown, message)) + ")"
    if hasattr(message, "tolist"):  # an array of NumPy
        return shown(message.tolist())
    return rounded(said(message)).replace("\n", " ")


def without_command(text: str) -> str:
    """Return a refusal without the command that installs what is missing."""
    return text.partition(" (")[0]


def drawn_sip(draw: random.Random) -> StandardSip:
    return StandardSip(
        raw_x=draw.randrange(1 << 15), raw_y=draw.randrange(1 << 15), raw_heading=draw.randrange(4096),
        raw_left_velocity=draw.randrange(-300, 300), raw_right_velocity=draw.randrange(-300, 300),
        raw_battery=draw.choice((0, 118, 255)), stall_left=draw.random() < 0.3, stall_right=draw.random() < 0.3,
        raw_compass=draw.choice((0, 1, 45, 90, 179)), raw_flags=draw.choice((0, 1, 0x20, 0x21)),
        sonar=tuple(
            SonarReading(number, draw.choice((0, 150, 900, 2499, 2500, 5000, 9000)))
            for number in draw.sample(range(16), draw.randrange(4))
        ),
    )  # fmt: skip


def nodes(draw: random.Random) -> Iterator[str]:
    """Yield what robots publish of states, and take of messages, at any time."""
    for model, options, fitted, laser in (
        ("p2dx", OPTIONS[0], (5, 0), None), ("p3at-sh", OPTIONS[1], (5, 5), LASER), ("amigo", OPTIONS[0], (0, 3), LASER)
    ):  # fmt: skip
        parameters = load_parameters(model)
        several: dict[str, Any] = {} if laser is None else {"motor_step_mps": 0.07, "cycle_ns": 50 * NS_PER_MS}
        node = RobotNode(
            parameters, options, deadman_ns=500 * NS_PER_MS, bumpers_fitted=fitted, laser=laser,
            **several,
        )  # fmt: skip
        observer = Observer(parameters)
        observer.bumpers = Bumpers(*fitted)
        observer.place(RobotPose())
        yield shown([*node.announced()]) + shown([*node.at_connection()])
        yield said((node.commands, node.services))
        yield shown(node.first(7))
        now, state = 0, None
        for _ in range(24):
            now += draw.choice((1, 90, 100, 499, 500)) * NS_PER_MS
            if draw.random() < 0.6:
                state = observer.take(drawn_sip(draw), now)
                pressed = tuple(range(1, draw.randrange(6)))
                several = {
                    "compass_rad": draw.choice((None, 0.0, 1.0, 4.0)), "motors_enabled": draw.choice((None, True,
                    False)),
                    "state_of_charge": draw.choice((None, 0.0, 0.5)), "temperature_c": draw.choice((None, 21.0)),
                    "front_bumpers": pressed, "rear_bumpers": pressed[1:], "stop_button": draw.choice((None, True,
                    False)),
                }  # fmt: skip
                state = replace(state, **several)
                for topic, message in node.take_state(state, draw.choice(STAMPS) + now):
                    yield f"{said(topic)} {shown(message)}"
            received = [drawn_message(draw, node) for _ in range(draw.randrange(4))]
            yield said([one.topic.name for one in received]) + tried(node.take_commands, received, now)
            yield said((node.next_deadline(), node.advance_to(now + draw.choice((0, 1, 500 * NS_PER_MS - 1)))))
            for service, key in node.services.items():
                yield tried(node.take_call, Received(service, {"data": draw.random() < 0.5})) + key
            ranges = tuple(draw.choice((0, 99, 100, 3000, 7999, 8000)) for _ in range(draw.choice((2, 3, 5))))
            for first in (0, 2, 3):
                packet = SimLaserPacket(total=5, first=first, ranges_mm=ranges[: 5 - first])
                yield shown(node.take_packet(packet, now + first))
            yield shown(node.take_packet(object(), now))  # type: ignore[arg-type]  # any other packet
            counts = {"damaged": draw.randrange(3)}
            yield shown(node.tell_health(state, now, "in words", is_open=draw.random() < 0.5, counts=counts))
            if draw.random() < 0.2:
                node.forget_place()
            if draw.random() < 0.1:
                node.stopped()


def drawn_message(draw: random.Random, node: RobotNode) -> Received:
    topic, key = draw.choice([*node.commands.items()])
    one = draw.choice((0.0, 0.25, -0.5, math.nan, math.inf))
    twist = {
        "linear": {"x": one, "y": 7.0, "z": 7.0},
        "angular": {"x": 7.0, "y": 7.0, "z": draw.choice((0.0, -1.5, one))},
    }
    several: dict[str, Any] = {
        "cmd_vel": twist,
        "cmd_vel_stamped": {"header": {}, "twist": twist},
        "reset_odometry": {},
    }
    return Received(topic, several.get(key, {"data": draw.randint(-5, 8)}))


def values(draw: random.Random) -> Iterator[str]:
    """Yield what single numbers become, at the ends of each range."""
    for code in range(-6, 10):
        yield said((motor_speed(code), motor_speed(code, 0.5)))
    for eighth in range(-9, 18):
        yield said([encoder_code(eighth * math.tau / 8 + off) for off in (-1e-6, 1e-6, 0.3)])
    for range_m in (0.0, 0.1, 0.0999, 2.4999, 2.5, 2.5001, 5.0, 4.9999, 9.0):
        yield said((near(range_m, 5.0), seen_as(range_m, 0.1, 5.0)))
    yield said(planar(1.5, 2.5, 3.5))
    scans = Scans(LASER, RobotNode(load_parameters("p2dx"), OPTIONS[0], deadman_ns=1, laser=LASER).frames)
    for total, first, count in (
        (5, 0, 2),
        (5, 2, 3),
        (5, 0, 5),
        (4, 0, 4),
        (6, 0, 6),
        (5, 1, 4),
        (5, 0, 3),
        (5, 4, 1),
        (5, 3, 2),
    ):
        packet = SimLaserPacket(total=total, first=first, ranges_mm=(50, 100, 7999, 8000, 12, 13)[:count])
        yield shown(scans.take(packet, 5_000_000_000 + first))
    yield said(Frames(load_parameters("p2dx")).name("x")) + said(Frames(load_parameters("p2dx")).has_laser)
    yield shown(health(None, "gone", is_open=False, counts={"a": 1}))
    for model in ("p2dx", "p3at-sh", "amigo"):
        frames = RobotNode(load_parameters(model), OPTIONS[1], deadman_ns=1, laser=LASER).frames
        yield shown(frames.fixed(3, range(frames.parameters.sonar_fitted))) + said(frames.joints)
        yield shown(urdf_text(frames))
        yield shown(urdf_text(replace(frames, prefix="", has_laser=False)))
    for key, row in (*TOPICS.items(), *SERVICES.items()):
        yield said(
            (key, [(row.topic(options, number), row.is_command) for options in OPTIONS for number in (None, 0, 12)])
        )
    yield said((COMMANDS, [Topic("/a", "b", is_latched).depth for is_latched in (True, False)]))
    given: list[dict[str, Any]] = [
        *({"name": name} for name in ("p2os", "_a9", "9a", "a-b", "", "a\n")),
        *({"namespace": name} for name in ("", "/a", "/a/b9", "a", "/", "/a/", "/9", "/a b", "/a\n")),
        *({"domain": number} for number in (-1, 0, 232, 233)),
        *({"interface": name} for name in ("eth0", "192.168.1.5", "::1", "a_b.c-d:1", "", "a b", "é", "a/b")),
    ]
    for options in given:
        yield tried(lambda options=options: NodeOptions(**options))
        yield tried(lambda options=options: [NodeOptions(**options).topic(name) for name in ("odom", "/tf")])


def bytes_of_messages(draw: random.Random) -> Iterator[str]:
    """Yield the types that are spoken, and bytes of their messages, whole and cut."""
    for name in sorted(SPOKEN):
        row = message_table.message_type(name)
        yield said((row, row.dds_name))
        yield codec.to_cdr(name, {}).hex()
        message = drawn_of(draw, name, 2)
        data = codec.to_cdr(name, message)
        yield shown(message) + data.hex()
        yield shown(codec.from_cdr(name, data))
        for cut in (0, 3, 4, len(data) // 2):
            try:
                yield shown(codec.from_cdr(name, data[:cut]))
            except RemoteProtocolError as error:
                yield str(error).partition(": ")[0]
    for name, message in (("std_msgs/msg/Int32", {"date": 1, "a": 2}), ("std_msgs/msg/None", {}), ("a", {})):
        yield tried(codec.to_cdr, name, message)
    yield said(message_table.SERVICES)
    with patch.dict(sys.modules, {"rosbags.typesys": None, "rosbags.highlevel": None, "rosbags.rosbag2": None}):
        yield without_command(tried(message_table.standard_types.__wrapped__))
        yield without_command(tried(next, bags.read_bag(Path("x"), frozenset())))
        yield without_command(tried(bags.BagFile, Path("x"), "mcap"))
    with patch.dict(sys.modules, {"cyclonedds.idl": None, "zenoh": None, "cyclonedds.core": None}):
        yield without_command(tried(codec.struct_class.__wrapped__, "std_msgs/msg/Int32"))
        for name in ("dds", "zenoh", "udp"):
            yield without_command(tried(transports.open_transport, name, NodeOptions()))


def drawn_of(draw: random.Random, name: str, deep: int) -> dict[str, Any]:
    """Return any message of a type; fields are left out as well."""
    found: dict[str, Any] = {}
    primitives: dict[str, Callable[[], object]] = {
        "bool": lambda: draw.random() < 0.5, "string": lambda: draw.choice(("", "é", "abc")),
        "float32": lambda: draw.choice((0.5, -2.0)), "float64": lambda: draw.choice((1e300, -0.1)),
        "int32": lambda: draw.choice((-(1 << 31), 5)), "uint32": lambda: draw.choice((1 << 31, 6)),
    }  # fmt: skip
    for field in message_table.message_type(name).fields.values():
        if draw.random() < 0.2:
            continue
        make = primitives.get(field.kind, lambda: draw.randrange(256))
        if "/" in field.kind:

            def make(field: message_table.MessageField = field) -> Any:
                return drawn_of(draw, field.kind, deep - 1)

        count = field.count if field.count != 0 else draw.randrange(3)
        found[field.name] = make() if count is None else [make() for _ in range(count)]
    return found


def zenoh_names(draw: random.Random) -> Iterator[str]:
    for topic in (Topic("/r1/odom", "nav_msgs/msg/Odometry"), Topic("/tf_static", "tf2_msgs/msg/TFMessage", True),
                  Topic("/r1/enable_motors", "std_srvs/srv/SetBool")):  # fmt: skip
        for options in OPTIONS:
            yield said((zenoh_node.key_of(options.domain, topic), zenoh_node.qos_text(topic)))
            yield zenoh_node.token_of(options, "1f", "MP", 3, topic)
            yield zenoh_node.token_of(options, "1f", "NN", 0, None)
    for interface in ("127.0.0.1", "::1", "192.168.1.5", "eth0", 'a"b'):
        yield dds.configuration(interface)


class ZError(Exception):
    """As zenoh's."""


def over_zenoh(draw: random.Random) -> Iterator[str]:
    """Yield what a node asks of zenoh, and what it makes of what comes."""
    calls: list[str] = []
    odom, static = Topic("/odom", "nav_msgs/msg/Odometry"), Topic("/tf_static", "tf2_msgs/msg/TFMessage", True)
    number, service = Topic("/motor_left", "std_msgs/msg/Int32"), Topic("/enable_motors", "std_srvs/srv/SetBool")
    opened = Acted(calls, "session", is_closed=[False, True])
    opened.__dict__["info"] = Acted(calls, "info", zid=["1f"] * 99)
    tokens = Acted(calls, "tokens", declare_token=list("abcdefghi"))
    opened._answers |= {
        "liveliness": [tokens] * 99, "declare_publisher": [Acted(calls, f"publisher {each}") for each in (1, 2)],
    }  # fmt: skip
    payloads = [codec.to_cdr(number.type, {"data": each}) for each in range(3)] + [b"\0"]
    samples = [SimpleNamespace(payload=SimpleNamespace(to_bytes=lambda data=data: data)) for data in payloads]
    rings = Acted(calls, "ring", try_recv=[*samples, *samples[:1] * 20])
    opened._answers["declare_subscriber"] = [SimpleNamespace(handler=rings)]
    asked = codec.to_cdr("std_srvs/srv/SetBool_Request", {"data": True})
    queries = [Query(calls, data, attached) for data, attached in (
        (asked, zenoh_node.ATTACHMENT.pack(77, 1, 16, b"n" * 16)), (asked, None), (asked, b"short"), (None, None),
    )]  # fmt: skip
    opened._answers["declare_queryable"] = [SimpleNamespace(handler=Acted(calls, "calls", try_recv=[*queries, None]))]
    made = [ZError("no"), ZError("no"), opened]
    library = Acted(calls, "zenoh", open=made)
    library.__dict__ |= {"ZError": ZError, "Config": lambda: Acted(calls, "config"), "ext": Acted(
        calls, "ext", declare_advanced_publisher=[Acted(calls, "advanced")],
        CacheConfig=[lambda *_: "cache"])}  # fmt: skip
    handlers = SimpleNamespace(RingChannel=lambda depth: f"ring of {depth}")
    now_s = [10.0]

    class Woken(Acted):
        def wait(self, longest_s: float) -> None:
            calls.append(f"wait({longest_s:.4f})")
            now_s[0] += longest_s

    with (
        patch.dict(sys.modules, {"zenoh": library, "zenoh.handlers": handlers}),
        patch.object(os, "urandom", lambda count: b"g" * count),
        patch.object(zenoh_node, "time", SimpleNamespace(monotonic=lambda: now_s[0])),
    ):
        for is_router, interface in ((False, "127.0.0.1"), (True, "127.0.0.1:7000")):
            options = NodeOptions(is_router=is_router, interface=interface)
            yield tried(zenoh_node.ZenohNode, options) + taken(calls)
        node = zenoh_node.ZenohNode(NodeOptions(namespace="/r1"), clock=lambda: 123)
        yield taken(calls)
        for topic in (odom, odom, static):
            node.announce(topic)
            yield taken(calls)
        for topic in (odom, odom, static, number):
            node.publish(topic, {})
            yield taken(calls).replace("b'", "")
        node.subscribe(number)
        yield f"{node.serve(service)} {taken(calls)}"
        node._woken = Woken(calls, "woken", is_set=[True])  # type: ignore[assignment]
        for timeout_s in (0.0, 0.012, 0.012):
            found = node.take(timeout_s)
            yield shown([(one.topic, one.message, one.reply is not None) for one in found]) + taken(calls)
            for one in found:
                if one.reply is not None:
                    one.reply({"success": True, "message": "ok"})
                    yield taken(calls)
            yield said((node.damaged, now_s[0]))
        rings._answers["try_recv"] = []
        for timeout_s in (0.012, 0.005, 0.0):
            yield shown(node.take(timeout_s)) + said(now_s[0]) + taken(calls)
        node.wake()
        node.close()
        node.close()
        yield taken(calls)


class Query(Acted):
    """A call of a service, as zenoh has it."""

    def __init__(self, calls: list[str], data: bytes | None, attached: bytes | None) -> None:
        super().__init__(calls, "query")
        self.__dict__ |= {
            "payload": None if data is None else SimpleNamespace(to_bytes=lambda: data), "key_expr": "key",
            "attachment": None if attached is None else SimpleNamespace(to_bytes=lambda: attached),
        }  # fmt: skip

    def reply(self, key: str, data: bytes, *, attachment: bytes) -> None:
        self._calls.append(f"reply({key}, {data.hex()}, {attachment.hex()})")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._calls.append("query done")


class DdsError(Exception):
    """As cyclonedds's."""

    msg = "precondition not met"


def over_dds(draw: random.Random) -> Iterator[str]:  # noqa: C901 - a library is acted
    """Yield what a node asks of Cyclone DDS, and what it makes of what comes."""
    calls: list[str] = []
    odom, static = Topic("/odom", "nav_msgs/msg/Odometry"), Topic("/tf_static", "tf2_msgs/msg/TFMessage", True)
    number = Topic("/motor_left", "std_msgs/msg/Int32")
    for topic in (odom, static, number, dds.DISCOVERY):
        codec.struct_class(topic.type)  # by the library itself
    samples = [codec.struct_of(number.type, {"data": each}) for each in range(4)]

    class Entity(Acted):
        def __del__(self) -> None:
            calls.append(f"{self._name} deleted")

    class InvalidSample:
        pass

    def makes(kind: str, base: type[Acted] = Acted, **answers: Sequence[object]) -> Any:
        count = iter(range(1, 99))

        def make(*arguments: object, **named: object) -> Acted:
            made = base(calls, f"{kind}{next(count)}", **answers)
            made.__dict__["guid"] = SimpleNamespace(bytes=f"{made}".encode().rjust(16, b"."))
            calls.append(f"{made} = {kind}{said(arguments)}{said(named) if named else ''}")
            return made

        return make

    class Written(Acted):
        def write(self, struct: Any) -> None:
            calls.append(f"{self._name}.write({struct})")

    def named(name: str) -> Any:
        """Return a name whose attributes are longer names; called, it says with what."""

        class Name:
            def __getattr__(self, part: str) -> Any:
                return named(f"{name}.{part}")

            def __call__(self, *arguments: object, **options: object) -> str:
                return f"{name}{said(arguments)}{said(options) if options else ''}"

            def __or__(self, other: object) -> Any:
                return named(f"{name}|{other}")

            def __str__(self) -> str:
                return name

        return Name()

    takes: list[object] = [[samples[0]], ValueError("hostile"), [InvalidSample()], [samples[1]], []] + [
        [samples[2]]
    ] * 20
    core = SimpleNamespace(
        DDSException=DdsError, GuardCondition=makes("guard"), Policy=named("Policy"), Qos=named("Qos"),
        WaitSet=makes("waits"), InstanceState=named("I"), ReadCondition=makes("condition"), SampleState=named("S"),
        ViewState=named("V"), Entity=Entity,
    )  # fmt: skip
    modules = {
        "cyclonedds.core": core, "cyclonedds.pub": SimpleNamespace(DataWriter=makes("writer", Written)),
        "cyclonedds.domain": SimpleNamespace(Domain=makes("domain", Entity), DomainParticipant=makes("participant",
        Entity)),
        "cyclonedds.internal": SimpleNamespace(
            DDS=SimpleNamespace(_dll_handle=Acted(calls, "library")), InvalidSample=InvalidSample),
        "cyclonedds.sub": SimpleNamespace(DataReader=makes("reader", take=takes)),
        "cyclonedds.topic": SimpleNamespace(Topic=lambda _, name, kind: f"topic {name} {kind.__name__}"),
        "cyclonedds.util": SimpleNamespace(duration=named("duration")),
    }  # fmt: skip

    def open_there(address: str, opens: Callable[[], object]) -> object:
        calls.append(address)
        return opens()

    def fails(error: Exception) -> Any:
        def fail(_address: str, _opens: object) -> None:
            raise error

        return fail

    with patch.dict(sys.modules, modules):
        for error in (DdsError(), OSError(22, "Invalid argument")):
            with patch.object(dds, "opened_on", fails(error)):
                yield tried(dds.DdsNode, NodeOptions(interface="eth9", domain=5)) + taken(calls)
        with patch.object(dds, "opened_on", open_there):
            node = dds.DdsNode(NodeOptions(namespace="/r1", name="n", domain=5))
        yield taken(calls)
        for topic in (odom, odom, static):
            node.announce(topic)
            yield taken(calls)
        node.publish(number, {"data": -3})
        yield taken(calls)
        node.subscribe(number)
        yield f"{node.serve(Topic('/a', 'std_srvs/srv/SetBool'))} {taken(calls)}"
        for timeout_s in (0.0, 0.25, 1.5):
            found = node.take(timeout_s)
            yield shown([(one.topic, one.message, one.reply) for one in found]) + said(node.damaged) + taken(calls)
        node.wake()
        node.close()
        node.close()
        yield taken(calls)
        del node
        calls.clear()


def bag_files(draw: random.Random) -> Iterator[str]:
    number, latched = Topic("/a", "std_msgs/msg/Int32"), Topic("/b", "std_msgs/msg/String", True)
    odom = Topic("/odom", "nav_msgs/msg/Odometry")
    with TemporaryDirectory() as folder:
        for storage in (*bags.STORAGES, "zip"):
            path = Path(folder, storage)
            try:
                with bags.BagFile(path, storage) as file:
                    for at in range(4):
                        file.write(number, {"data": at}, at * NS_PER_S)
                        file.write(odom, drawn_of(draw, odom.type, 2), at * NS_PER_S + 1)
                    file.write(latched, {"data": "x"}, 9 * NS_PER_S)
                    yield said(file.count)
            except UsageError as error:
                yield f"{error} {error.hint}"
                continue
            yield tried(bags.BagFile, path, storage).replace(folder, "")
            yield said((bags.is_bag(path), [bags.is_bag(each) for each in sorted(path.iterdir())]))
            for types in ({number.type}, {latched.type, odom.type}, {"std_msgs/msg/Bool"}, set()):
                yield shown(
                    [(one.topic, one.type, one.at_ns, one.message) for one in bags.read_bag(path, frozenset(types))]
                )
            with open_bag(path) as bag:
                for connection in bag.connections:
                    qos = [said(each) for each in connection.ext.offered_qos_profiles]
                    yield said((connection.topic, connection.msgcount, connection.digest, qos))
        Path(folder, "x.mcap").write_bytes(b"no bag")
        Path(folder, "empty").mkdir()
        for name in ("x.mcap", "x.MCAP", "x.txt", "x.db3", "x.bag", "empty", "none"):
            path = Path(folder, name)
            yield said((name, bags.is_bag(path)))
            yield (
                tried(lambda path=path: [*bags.read_bag(path, frozenset({number.type}))])
                .partition(" that can")[0]
                .replace(folder, "")
            )


def open_bag(path: Path) -> Any:
    from rosbags.highlevel import AnyReader

    return AnyReader([path], default_typestore=message_table.standard_types())


TRACES: dict[str, Trace] = {
    each.__name__: each for each in (nodes, values, bytes_of_messages, zenoh_names, over_zenoh, over_dds, bag_files)
}
TRACES["declared"] = declared_of("p2os.ros")
test_what_was_approved_is_shown = judge_of(__file__, TRACES)
