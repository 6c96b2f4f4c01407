"""The events of a run as a bag: what a recorder beside `p2os run --ros` would have, without ROS and without time.

The messages are those of `bench_node`; beside them stand `/rosout`, with what the firmware prints, notes and verdicts,
and the bytes of the P2OS line. Times are the run's, from 0.
"""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import cast

from p2os.robots.parameters import ParametersError, load_parameters
from p2os.ros.bags import BagFile
from p2os.ros.codec import Message
from p2os.ros.frames import time_of
from p2os.ros.robot_node import Outgoing
from p2os.ros.topics import TOPICS
from p2os.ros.transport import NodeOptions
from robot_bench.events.codec import Json
from robot_bench.events.kinds import Contact, Event, Fault, Note, Packet, PinEdge, Pose, Ranges, Text, Verdict
from robot_bench.events.words import what_of
from robot_bench.ros.bench_node import BenchNode
from robot_bench.ros.drive import NODE, STEP_NS
from simbase.errors import UsageError
from simbase.timing import Nanos

#: Levels of rcl_interfaces/msg/Log.
INFO, ERROR = 20, 40
#: Direction of a packet → topic.
_WIRE = {"c2r": "from_client", "r2c": "from_robot"}


def write_bag(events: Iterable[Event], folder: Path, meta: Json, storage: str) -> int:
    """Write the events of a run as a bag; return how many messages.

    Args:
        events: In order of time.
        folder: Where; it must not be there.
        meta: The first entry of the run's trace.
        storage: One of `p2os.ros.bags.STORAGES`.

    Raises:
        UsageError: The run has no single Pioneer on the wires of the pin-out; or there is no such storage.
        MissingDependencyError, FileError: As of `BagFile`.
    """
    messages = RunMessages(meta)
    with BagFile(folder, storage) as bag:
        for at_ns, (topic, message) in messages.of(events):
            bag.write(topic, message, at_ns)
    return bag.count


class RunMessages:
    """Turns the events of one run into messages.

    Args:
        meta: The first entry of its trace.

    Raises:
        UsageError: Its robot is no Pioneer.
    """

    def __init__(self, meta: Json) -> None:
        name = cast("Json", meta.get("robot") or {}).get("name")
        try:
            parameters = load_parameters(str(name or ""))
        except ParametersError as error:
            raise UsageError(
                f"a bag is of one Pioneer on the wires of the pin-out: {error}", hint="--events FILE.mcap, or .jsonl"
            ) from error
        self._options = NodeOptions(name=NODE)
        self._levels: dict[str, bool] = {}
        self._node = BenchNode(lambda wire, _: self._levels.get(wire, False), parameters, self._options)

    def of(self, events: Iterable[Event]) -> Iterator[tuple[Nanos, Outgoing]]:
        """Yield messages and when they are sent: what happened at its time, pins and clock each `STEP_NS`."""
        yield from ((0, one) for one in self._node.first())
        due: Nanos = STEP_NS
        for event in events:
            while due < event.t:
                yield from ((due, one) for one in self._node.tell(due))
                due += STEP_NS
            yield from ((event.t, one) for one in self._made_of(event))
        yield from ((due, one) for one in self._node.tell(due))

    def _made_of(self, event: Event) -> list[Outgoing]:
        match event:
            case PinEdge():
                self._levels[event.wire] = event.level
            case Pose():
                return self._node.take_pose(event)
            case Ranges():
                return self._node.take_ranges(event)
            case Packet():
                return [self._outgoing(_WIRE[event.direction], {"data": event.data})]
            case Text():
                text = event.data.decode("utf-8", "replace").rstrip("\r\n")
                return [self._outgoing("rosout", _log(event.t, event.port, text))]
            case Note() | Contact() | Fault() | Verdict():
                name = event.who if isinstance(event, Note) else type(event).__name__.lower()
                is_bad = isinstance(event, Contact | Fault) or (isinstance(event, Verdict) and not event.met)
                return [self._outgoing("rosout", _log(event.t, name, what_of(event), ERROR if is_bad else INFO))]
        return []

    def _outgoing(self, key: str, message: Message) -> Outgoing:
        return TOPICS[key].topic(self._options), message


def _log(t: Nanos, name: str, text: str, level: int = INFO) -> Mapping[str, object]:
    return {"stamp": time_of(t), "level": level, "name": name, "msg": text}
