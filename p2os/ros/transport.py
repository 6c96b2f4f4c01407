"""What a node needs of its transport, whichever it is: topics to publish and to subscribe to.

Names are whole ones of ROS (`/robot1/odom`). Everything is reliable, as ROS' own default: such a publisher also serves
best-effort subscribers.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from p2os.ros.codec import Message
from simbase.errors import UsageError, shown

#: The default of every ROS: domain 0.
DOMAIN = 0
#: Up to here every port of a DDS domain is below 65536 (7400 + 250 a domain, DDSI-RTPS 9.6.1.1).
MOST_DOMAIN = 232
#: Where servers listen unless they are told otherwise.
LOOPBACK = "127.0.0.1"
#: How many messages wait for a slow subscriber: ROS' own default.
DEPTH = 10
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_NAMESPACE = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")


@dataclass(frozen=True, slots=True)
class Topic:
    """A topic.

    Args:
        name: Its whole name, with the slash that it begins with.
        type: The name of its type, of `message_table`.
        is_latched: Who subscribes later gets the newest message too (transient local, depth 1).
    """

    name: str
    type: str
    is_latched: bool = False

    @property
    def depth(self) -> int:
        """How many messages are kept for a slow subscriber, or for a late one."""
        return 1 if self.is_latched else DEPTH


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeOptions:
    """Which node it is, and where it is found.

    Args:
        name: Of the node.
        namespace: What its topics' names begin with, such as "/robot1"; "" for none.
        domain: ROS_DOMAIN_ID, 0 to 232.
        interface: The address of the network, or its name; of zenoh the address of the router.
        is_router: With zenoh: be the router, for others to connect to.

    Raises:
        UsageError: A name is none of ROS, or the domain is none of DDS.
    """

    name: str = "p2os"
    namespace: str = ""
    domain: int = DOMAIN
    interface: str = LOOPBACK
    is_router: bool = False

    def __post_init__(self) -> None:
        if not _NAME.fullmatch(self.name):
            raise UsageError(f"{shown(self.name)} is no name of a node", hint="letters, digits and _")
        if self.namespace and not _NAMESPACE.fullmatch(self.namespace):
            raise UsageError(f"{shown(self.namespace)} is no namespace", hint="such as /robot1")
        if not 0 <= self.domain <= MOST_DOMAIN:
            raise UsageError(f"there is no domain {self.domain}", hint=f"0 to {MOST_DOMAIN}")
        if not re.fullmatch(r"[A-Za-z0-9_.:-]+", self.interface):
            raise UsageError(f"{shown(self.interface)} is no network", hint="such as 192.168.1.5, or eth0")

    def topic(self, name: str) -> str:
        """Return the whole name of a topic: one that begins with a slash stays as it is."""
        return name if name.startswith("/") else f"{self.namespace}/{name}"


@dataclass(frozen=True, slots=True)
class Received:
    """A message that came, on which topic, and how it is answered where a service was called."""

    topic: Topic
    message: Message
    reply: Callable[[Message], None] | None = None


class RosTransport(Protocol):
    """A node's way to the others."""

    def publish(self, topic: Topic, message: Message) -> None:
        """Hand a message to whoever subscribes; the first one of a topic announces it."""
        ...

    def announce(self, topic: Topic) -> None:
        """Let others know of a topic before its first message."""
        ...

    def subscribe(self, topic: Topic) -> None:
        """Have messages of a topic returned by `take`."""
        ...

    def serve(self, service: Topic) -> bool:
        """Have the calls of a service returned by `take`, each with its reply; tell whether there are services here.

        Args:
            service: Its name and type, such as std_srvs/srv/SetBool.
        """
        ...

    def take(self, timeout_s: float) -> Sequence[Received]:
        """Return what came, the oldest of each topic first; wait at most so long for the first, or for `wake`."""
        ...

    def wake(self) -> None:
        """Let `take` return at once; from any thread."""
        ...

    @property
    def damaged(self) -> int:
        """How many messages came that are none of their type."""
        ...

    def close(self) -> None:
        """Leave the others; a second call changes nothing."""
        ...
