"""A node over DDS, which every ROS 2 speaks that was not told otherwise (Fast DDS, Cyclone DDS).

A topic `/odom` is `rt/odom` there, its type `nav_msgs::msg::dds_::Odometry_`, and each endpoint carries the hash of its
type in its user data. `ros_discovery_info` tells the name of the node and which endpoints are its own.

Services (`rq/…Request`, `rr/…Reply`) are left out. rmw_fastrtps tells requests apart by the number of the sample and by
PID_RELATED_SAMPLE_IDENTITY of its inline QoS, which Cyclone DDS 11 neither shows nor writes; rmw_cyclonedds puts 16
bytes before the message instead. Who served the latter would let every call of the former, ROS' default, hang.

Over loopback no multicast is used: the participants of this machine are asked one by one, by their ports. What is sent
to another address than the network's own reaches no socket of the node: `p2os.transport.one_address`.

Source: https://design.ros2.org/articles/topic_and_service_names.html; rmw_dds_common 3.1; DDSI-RTPS 2.5, 9.6.1.
"""

from collections.abc import Sequence
from ipaddress import ip_address
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import quoteattr

from p2os.errors import MissingDependencyError, TransportError
from p2os.ros.codec import Message, message_of, struct_class, struct_of
from p2os.ros.message_table import message_type
from p2os.ros.transport import DEPTH, NodeOptions, Received, Topic
from p2os.transport.one_address import opened_on
from simbase.timing import NS_PER_S

if TYPE_CHECKING:
    from cyclonedds.core import Qos
    from cyclonedds.pub import DataWriter
    from cyclonedds.sub import DataReader
    from cyclonedds.topic import Topic as DdsTopic

#: What the name of a topic of ROS begins with in DDS.
PREFIX = "rt"
DISCOVERY = Topic("ros_discovery_info", "rmw_dds_common/msg/ParticipantEntitiesInfo", is_latched=True)
#: chosen: how many participants of one machine are looked for; the ports of each are one more.
MOST_PARTICIPANTS = 32
#: ROS 2's mark of a participant's security context: none.
ENCLAVE = b"enclave=/;"


class DdsNode:
    """One participant of a DDS domain, as a node of ROS.

    Args:
        options: Which node, and where.

    Raises:
        MissingDependencyError: cyclonedds is not installed.
        TransportError: There is no such network, or no place in the domain.
    """

    def __init__(self, options: NodeOptions) -> None:
        try:
            from cyclonedds.core import DDSException, GuardCondition, Policy, Qos, WaitSet
            from cyclonedds.domain import Domain, DomainParticipant
            from cyclonedds.internal import DDS
        except ImportError as error:
            raise MissingDependencyError("DDS needs cyclonedds", extra="ros") from error
        self._options = options
        self.damaged = 0
        try:
            self._domain: object = opened_on(
                options.interface, lambda: Domain(options.domain, configuration(options.interface))
            )
            # Whatever `Tracing` says, each datagram of a stranger that is no RTPS would be a line on standard error.
            DDS._dll_handle.dds_set_log_mask(0)  # noqa: SLF001 - the library's only handle
            self._participant = DomainParticipant(options.domain, qos=Qos(Policy.Userdata(ENCLAVE)))
        except DDSException as error:
            raise TransportError(
                f"no DDS on {options.interface}, domain {options.domain}: {error.msg}",
                hint="--interface ADDRESS, or another --domain",
            ) from error
        except OSError as error:
            raise TransportError(
                f"no DDS on {options.interface} alone: {error.strerror}", hint="--transport zenoh"
            ) from error
        self._writers: dict[Topic, DataWriter[object]] = {}
        self._readers: dict[Topic, DataReader[object]] = {}
        self._wake = GuardCondition(self._participant)
        self._waiting = WaitSet(self._participant)
        self._waiting.attach(self._wake)
        self._discovery: DataWriter[object] = self._writer(DISCOVERY, DISCOVERY.name)
        self._tell_endpoints()

    def announce(self, topic: Topic) -> None:
        """Let others know of a topic."""
        if topic not in self._writers:
            self._writers[topic] = self._writer(topic, PREFIX + topic.name)
            self._tell_endpoints()

    def publish(self, topic: Topic, message: Message) -> None:
        """Hand a message to whoever subscribes."""
        self.announce(topic)
        self._writers[topic].write(struct_of(topic.type, message))

    def subscribe(self, topic: Topic) -> None:
        """Have messages of a topic returned by `take`."""
        from cyclonedds.core import InstanceState, ReadCondition, SampleState, ViewState
        from cyclonedds.sub import DataReader

        reader: DataReader[object] = DataReader(
            self._participant, self._topic(topic, PREFIX + topic.name), qos=self._qos(topic)
        )
        self._readers[topic] = reader
        self._waiting.attach(ReadCondition(reader, ViewState.Any | InstanceState.Any | SampleState.Any))
        self._tell_endpoints()

    def serve(self, service: Topic) -> bool:
        """Serve nothing: what tells requests apart is out of reach here."""
        del service
        return False

    def take(self, timeout_s: float) -> Sequence[Received]:
        """Return what came; wait at most so long."""
        self._waiting.wait(round(timeout_s * NS_PER_S))
        self._wake.take()
        return [
            Received(topic, message)
            for topic, reader in self._readers.items()
            for message in self._taken(topic, reader)
        ]

    def wake(self) -> None:
        """Let `take` return at once."""
        self._wake.set(True)

    def close(self) -> None:
        """Delete the participant and all that it has."""
        from cyclonedds.core import Entity

        self._writers.clear()
        self._readers.clear()
        for entity in (self._participant, self._domain):
            if isinstance(entity, Entity):
                entity.__del__()
        self._domain = None

    def _taken(self, topic: Topic, reader: "DataReader[object]") -> list[Message]:
        from cyclonedds.internal import InvalidSample

        found: list[Message] = []
        for _ in range(DEPTH):
            try:
                sample = reader.take(1)
            except Exception:  # noqa: BLE001 - whatever the serialiser makes of hostile bytes: that message is lost
                self.damaged += 1
                continue
            if not sample:
                break
            if not isinstance(sample[0], InvalidSample):  # what says that a writer has gone
                found.append(message_of(topic.type, sample[0]))  # type: ignore[arg-type]  # of the type's own class
        return found

    def _writer(self, topic: Topic, name: str) -> "DataWriter[object]":
        from cyclonedds.pub import DataWriter

        return DataWriter(self._participant, self._topic(topic, name), qos=self._qos(topic))

    def _topic(self, topic: Topic, name: str) -> "DdsTopic[Any]":
        from cyclonedds.topic import Topic as DdsTopic

        kind: type[Any] = struct_class(topic.type)
        return DdsTopic(self._participant, name, kind)

    def _qos(self, topic: Topic) -> "Qos":
        from cyclonedds.core import Policy, Qos
        from cyclonedds.util import duration

        durability = Policy.Durability.TransientLocal if topic.is_latched else Policy.Durability.Volatile
        return Qos(
            Policy.Reliability.Reliable(duration(milliseconds=100)), Policy.History.KeepLast(topic.depth), durability,
            Policy.Userdata(f"typehash={message_type(topic.type).hash};".encode()),
        )  # fmt: skip

    def _tell_endpoints(self) -> None:
        """Tell which endpoints are the node's own: what `ros2 node list` is made of."""
        node = {
            "node_namespace": self._options.namespace or "/",
            "node_name": self._options.name,
            "reader_gid_seq": [_gid(reader) for reader in self._readers.values()],
            "writer_gid_seq": [_gid(writer) for writer in self._writers.values()],
        }
        info = {"gid": _gid(self._participant), "node_entities_info_seq": [node]}
        self._discovery.write(struct_of(DISCOVERY.type, info))


def configuration(interface: str) -> str:
    """Return the settings of Cyclone DDS for a network, by its address or name."""
    try:
        address = ip_address(interface)
    except ValueError:
        return _settings(f"<NetworkInterface name={quoteattr(interface)}/>")
    own = f"<NetworkInterface address={quoteattr(str(address))}/>"
    if not address.is_loopback:
        return _settings(own)
    return _settings(
        own,
        "<AllowMulticast>false</AllowMulticast>",
        f"<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>{MOST_PARTICIPANTS}"
        f"</MaxAutoParticipantIndex><Peers><Peer address={quoteattr(str(address))}/></Peers></Discovery>",
    )


def _settings(interface: str, general: str = "", more: str = "") -> str:
    return (
        f'<CycloneDDS><Domain id="any"><General><Interfaces>{interface}</Interfaces>{general}</General>{more}'
        # A subscriber that was killed is not waited for when the node leaves.
        "<Internal><WriterLingerDuration>50 ms</WriterLingerDuration></Internal>"
        "</Domain></CycloneDDS>"
    )


def _gid(entity: object) -> dict[str, object]:
    guid: object = getattr(entity, "guid", None)
    return {"data": getattr(guid, "bytes", bytes(16))}
