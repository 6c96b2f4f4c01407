"""A node over zenoh, as rmw_zenoh has it: key expressions with type hashes, liveliness tokens, attachments.

    key      0/odom/nav_msgs::msg::dds_::Odometry_/RIHS01_3cc9…
    token    @ros2_lv/0/<session>/0/<number>/MP/%/%/p2os/%odom/nav_msgs::msg::dds_::Odometry_/RIHS01_3cc9…/::,10:,:,:,,
    attached sequence number and time (int64, little endian), 16, and the 16 bytes that name the publisher

A node connects to a router, as all of rmw_zenoh do; where none runs, it can be the router itself.

Theory of operation. What comes waits in rings of zenoh's own, one a topic and one a service, of which the oldest go;
no code of Python runs for a message that nobody takes, so a flood costs this program a look at each ring and no more.
zenoh lets a thread wait for one ring alone; so `take` looks at all of them, each `LOOK_S`.

Invariant: `take` returns at most a ring of each topic, however fast messages come.

Source: ros2/rmw_zenoh, docs/design.md and liveliness_utils; tokens were compared with those of PyZeROS 0.1, and read by
zenoh-ros2-sdk 0.1.8. A stock rmw_zenoh has not been tried.
"""

import contextlib
import json
import os
import struct
import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, TypeAlias

from p2os.errors import MissingDependencyError, RemoteProtocolError, TransportError
from p2os.ros.codec import Message, from_cdr, to_cdr
from p2os.ros.message_table import SERVICES, dds_name, message_type
from p2os.ros.transport import DEPTH, NodeOptions, Received, Topic

if TYPE_CHECKING:
    import zenoh

#: Port of rmw_zenoh's router.
PORT = 7447
NODE, PUBLISHER, SUBSCRIBER, SERVICE = "NN", "MP", "MS", "SS"
#: What stands for a slash within a part of a key, and for an empty one.
SLASH = "%"
GID_BYTES = 16
ATTACHMENT = struct.Struct(f"<qqB{GID_BYTES}s")
#: chosen: how long a message waits at most for a look; a robot takes a command each 100 ms.
LOOK_S = 0.005
#: chosen: a router of this machine answers at once.
CONNECT_MS = 2000


class ZenohNode:
    """One session of zenoh, as a node of ROS.

    Args:
        options: Which node, and where its router is.
        clock: Nanoseconds since 1970, for attachments.

    Raises:
        MissingDependencyError: eclipse-zenoh is not installed.
        TransportError: No router answers, or its port is taken.
    """

    def __init__(self, options: NodeOptions, clock: Callable[[], int] = time.time_ns) -> None:
        try:
            import zenoh
        except ImportError as error:
            raise MissingDependencyError("zenoh needs eclipse-zenoh", extra="ros") from error
        endpoint = f"tcp/{options.interface}:{PORT}" if ":" not in options.interface else f"tcp/{options.interface}"
        try:
            self._session = zenoh.open(configuration(endpoint, is_router=options.is_router))
        except zenoh.ZError as error:
            where = f"be the router on {endpoint}" if options.is_router else f"find a router on {endpoint}"
            hint = None if options.is_router else "run rmw_zenohd, or p2os ros URL --transport zenoh --router"
            raise TransportError(f"zenoh cannot {where}", hint=hint) from error
        self._options = options
        self._clock = clock
        self.damaged = 0
        self._publishers: dict[Topic, _Publisher] = {}
        self._subscribers: dict[Topic, zenoh.Subscriber[zenoh.Handler[zenoh.Sample]]] = {}
        self._services: dict[Topic, zenoh.Queryable[zenoh.Handler[zenoh.Query]]] = {}
        self._woken = threading.Event()
        self._numbers = 0
        self._tokens = [self._session.liveliness().declare_token(self._token(NODE, None))]

    def announce(self, topic: Topic) -> None:
        """Let others know of a topic."""
        if topic in self._publishers:
            return
        key = key_of(self._options.domain, topic)
        publisher: zenoh.Publisher | zenoh.ext.AdvancedPublisher
        if topic.is_latched:
            from zenoh import ext

            publisher = ext.declare_advanced_publisher(
                self._session, key, cache=ext.CacheConfig(max_samples=topic.depth), publisher_detection=True
            )
        else:
            publisher = self._session.declare_publisher(key)
        self._publishers[topic] = _Publisher(publisher, self._clock)
        self._tokens.append(self._session.liveliness().declare_token(self._token(PUBLISHER, topic)))

    def publish(self, topic: Topic, message: Message) -> None:
        """Hand a message to whoever subscribes."""
        self.announce(topic)
        self._publishers[topic].put(to_cdr(topic.type, message))

    def subscribe(self, topic: Topic) -> None:
        """Have messages of a topic returned by `take`."""
        from zenoh.handlers import RingChannel

        key = key_of(self._options.domain, topic)
        self._subscribers[topic] = self._session.declare_subscriber(key, RingChannel(topic.depth))
        self._tokens.append(self._session.liveliness().declare_token(self._token(SUBSCRIBER, topic)))

    def serve(self, service: Topic) -> bool:
        """Have the calls of a service returned by `take`."""
        from zenoh.handlers import RingChannel

        key = key_of(self._options.domain, service)
        self._services[service] = self._session.declare_queryable(key, RingChannel(DEPTH), complete=True)
        self._tokens.append(self._session.liveliness().declare_token(self._token(SERVICE, service)))
        return True

    def take(self, timeout_s: float) -> Sequence[Received]:
        """Return what came; wait at most so long."""
        ends = time.monotonic() + timeout_s
        while True:
            found, woken = self._found(), self._woken.is_set()
            left_s = ends - time.monotonic()
            if found or woken or left_s <= 0:
                self._woken.clear()
                return found
            self._woken.wait(min(LOOK_S, left_s))

    def wake(self) -> None:
        """Let `take` return at once."""
        self._woken.set()

    def close(self) -> None:
        """End the session."""
        self._tokens.clear()
        if not self._session.is_closed():
            self._session.close()  # type: ignore[no-untyped-call]  # zenoh's own

    def _found(self) -> list[Received]:
        """Return what waits in the rings; as many as each holds, for more may come meanwhile."""
        found: list[Received] = []
        for topic, subscriber in self._subscribers.items():
            for _ in range(topic.depth):
                if (sample := subscriber.handler.try_recv()) is None:
                    break
                self._decode(topic, topic.type, sample.payload, None, found)
        for service, queryable in self._services.items():
            for _ in range(DEPTH):
                if (query := queryable.handler.try_recv()) is None:
                    break
                reply = partial(self._reply, service, query)
                self._decode(service, f"{service.type}_Request", query.payload, reply, found)
        return found

    def _decode(
        self, topic: Topic, kind: str, data: "zenoh.ZBytes | None", reply: "_Reply", found: list[Received]
    ) -> None:
        try:
            found.append(Received(topic, from_cdr(kind, b"" if data is None else data.to_bytes()), reply))
        except RemoteProtocolError:
            self.damaged += 1

    def _reply(self, service: Topic, query: "zenoh.Query", message: Message) -> None:
        """Answer a call, with the number and the name that came with it."""
        attached = b"" if query.attachment is None else query.attachment.to_bytes()
        number, name = 0, bytes(GID_BYTES)
        if len(attached) == ATTACHMENT.size:
            number, _, _, name = ATTACHMENT.unpack(attached)
        import zenoh

        with contextlib.suppress(zenoh.ZError), query:  # who called may have gone
            query.reply(
                query.key_expr, to_cdr(f"{service.type}_Response", message),
                attachment=ATTACHMENT.pack(number, self._clock(), GID_BYTES, name),
            )  # fmt: skip

    def _token(self, kind: str, topic: Topic | None) -> str:
        session = str(self._session.info.zid())
        token = token_of(self._options, session, kind, self._numbers, topic)
        self._numbers += 1
        return token


_Reply: TypeAlias = Callable[[Message], None] | None


class _Publisher:
    """One publisher, with the count that goes with its messages."""

    def __init__(self, publisher: "zenoh.Publisher | zenoh.ext.AdvancedPublisher", clock: Callable[[], int]) -> None:
        self._publisher = publisher
        self._clock = clock
        self._gid = os.urandom(GID_BYTES)
        self._sequence = 0

    def put(self, data: bytes) -> None:
        self._sequence += 1
        self._publisher.put(data, attachment=ATTACHMENT.pack(self._sequence, self._clock(), GID_BYTES, self._gid))


def configuration(endpoint: str, *, is_router: bool) -> "zenoh.Config":
    """Return the settings of a session: a router that listens, or a client that connects; nothing else is asked."""
    import zenoh

    config = zenoh.Config()
    own, other = ("listen/endpoints", "connect/endpoints") if is_router else ("connect/endpoints", "listen/endpoints")
    rows: dict[str, object] = {
        "mode": "router" if is_router else "client", "scouting/multicast/enabled": False, own: [endpoint], other: [],
        "connect/timeout_ms": CONNECT_MS, "connect/exit_on_failure": True, "scouting/delay": 0,
    }  # fmt: skip
    for key, value in rows.items():
        config.insert_json5(key, json.dumps(value))
    return config


def key_of(domain: int, topic: Topic) -> str:
    """Return the key expression of a topic, or of a service."""
    return f"{domain}/{topic.name.strip('/')}/{'/'.join(_typed(topic))}"


def token_of(options: NodeOptions, session: str, kind: str, number: int, topic: Topic | None) -> str:
    """Return the liveliness token of a node (`NN`), a publisher (`MP`), a subscriber (`MS`) or a service (`SS`).

    Args:
        options: The node.
        session: The session's id.
        kind: What it is.
        number: Of this entity within the session; the node's own is 0.
        topic: None for a node.
    """
    parts = [
        "@ros2_lv", f"{options.domain}", session, "0", f"{number}", kind, SLASH, mangled(options.namespace),
        options.name,
    ]  # fmt: skip
    if topic is not None:
        parts += [mangled(topic.name), *_typed(topic), qos_text(topic)]
    return "/".join(parts)


def _typed(topic: Topic) -> tuple[str, str]:
    """Return the name and the hash of a topic's or a service's type."""
    if topic.type in SERVICES:
        return dds_name(topic.type), SERVICES[topic.type]
    row = message_type(topic.type)
    return row.dds_name, row.hash


def qos_text(topic: Topic) -> str:
    """Return reliability, durability, history and depth, deadline, lifespan, liveliness; a default is empty."""
    return f":{'1' if topic.is_latched else ''}:,{topic.depth}:,:,:,,"


def mangled(name: str) -> str:
    """Return a name as one part of a key."""
    return name.replace("/", SLASH) or SLASH
