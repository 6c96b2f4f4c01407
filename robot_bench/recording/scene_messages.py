"""The events of a run as messages that Foxglove and Lichtblick show: a scene, transforms, scans, logs, plots.

Schemas are those that both know by name (`foxglove.SceneUpdate` and the like, as JSON); pins, wheels and packets have
schemas of ours, for plots and tables.

    /tf            FrameTransform    world -> base_link, each pose
    /path          PosesInFrame      where it was, each second
    /scene         SceneUpdate       the world's things, placed, moved and removed; the hull
    /sonar/1..     LaserScan         each sonar's cone, as a fan of equal ranges
    /log           Log               notes, faults, contacts, verdicts; /usart1 what the firmware prints
    /wheels        p2os.Wheels       rim speeds, mm/s
    /pins/NAME     p2os.Pin          a wire's level; of a wave its frequency and duty
    /wire          p2os.Packet       bytes of the P2OS line

Source: Foxglove's message schemas, https://docs.foxglove.dev/docs/visualization/message-schemas

Invariant: time is the run's, from 0; what a late reader needs stands in `anew`.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

from robot_bench.events.codec import Json
from robot_bench.events.kinds import (
    CanTransfer,
    Contact,
    Event,
    Fault,
    I2cTransfer,
    Note,
    Packet,
    PinEdge,
    Pose,
    Ranges,
    SpiTransfer,
    Text,
    Verdict,
    Wave,
    WorldChange,
)
from robot_bench.events.words import what_of
from simbase.timing import NS_PER_S, Nanos

WORLD_FRAME, ROBOT_FRAME = "world", "base_link"
#: chosen: rays that a sonar's cone is drawn with.
CONE_RAYS = 7
#: chosen: the path is sent each second, in at most so many poses.
PATH_NS: Nanos = NS_PER_S
MOST_PATH_POSES = 500
#: chosen: metres; a trace does not hold them.
HULL_HEIGHT_M, SONAR_HEIGHT_M = 0.22, 0.2
WALL, BOX, HULL = (0.45, 0.49, 0.53, 1.0), (0.73, 0.65, 0.4, 1.0), (0.75, 0.15, 0.15, 0.9)
#: Levels of a Log.
DEBUG, INFO, WARNING, ERROR = 1, 2, 3, 4


@dataclass(frozen=True, slots=True)
class Message:
    """One message: where it goes, what it is, when, and its fields."""

    topic: str
    schema: str
    t: Nanos
    data: Mapping[str, object]


#: Topic → its schema, of what every run has.
SCHEMAS: Mapping[str, str] = {
    "/tf": "foxglove.FrameTransform", "/path": "foxglove.PosesInFrame", "/scene": "foxglove.SceneUpdate",
    "/log": "foxglove.Log", "/usart1": "foxglove.Log", "/wheels": "p2os.Wheels", "/wire": "p2os.Packet",
}  # fmt: skip


def topics(sonar: int, wires: Iterable[str]) -> dict[str, str]:
    """Return topic → schema of a run whose robot has so many sonar and which has these wires."""
    scans = {f"/sonar/{number}": "foxglove.LaserScan" for number in range(1, sonar + 1)}
    return {**SCHEMAS, **scans, **{f"/pins/{wire}": "p2os.Pin" for wire in wires}}


class SceneMessages:
    """Turns the events of one run into messages.

    Args:
        meta: The first entry of its trace: the world's things, the robot's hull and sonar.
    """

    def __init__(self, meta: Json) -> None:
        self._robot = cast("Mapping[str, Any]", meta.get("robot") or {})
        world = cast("Mapping[str, Any]", meta.get("world") or {})
        self._things: dict[str, Mapping[str, Any]] = {str(item["name"]): item for item in world.get("obstacles") or ()}
        self._path: list[dict[str, object]] = []
        self._path_at: Nanos = 0
        #: What each wire was reported to be last.
        self._pins: dict[str, Mapping[str, object]] = {}

    def anew(self, t: Nanos) -> Iterator[Message]:
        """Yield what a reader needs who begins at `t`: all things, the hull, and the wires' levels."""
        entities = [_thing(item, t) for item in self._things.values()]
        if self._robot:
            entities.append(self._hull(t))
        yield Message("/scene", "foxglove.SceneUpdate", t, {"deletions": [], "entities": entities})
        for wire in self._pins:
            yield self._pin(wire, t)

    def of(self, event: Event) -> Iterator[Message]:
        """Yield the messages of an event; of some kinds there are none."""
        make = _MAKERS.get(type(event))
        return iter(()) if make is None else make(self, event)

    def _hull(self, t: Nanos) -> dict[str, object]:
        front, rear = float(self._robot["front_m"]), float(self._robot["rear_m"])
        size = front + rear, float(self._robot["width_m"]), HULL_HEIGHT_M
        entity = _entity("robot", ROBOT_FRAME, t, is_locked=True)
        entity["cubes"] = [
            {"pose": _pose((front - rear) / 2, 0.0, size[2] / 2, 0.0), "size": _xyz(*size), "color": _colour(HULL)}
        ]
        return entity

    def pose(self, pose: Pose) -> Iterator[Message]:
        """Yield transform, wheels, and now and then the path."""
        at = _pose(pose.x_m, pose.y_m, pose.z / 1e6, pose.heading_rad, pose.pitch / 1e6)
        yield Message("/tf", "foxglove.FrameTransform", pose.t, {
            "timestamp": _time(pose.t), "parent_frame_id": WORLD_FRAME, "child_frame_id": ROBOT_FRAME,
            "translation": at["position"], "rotation": at["orientation"],
        })  # fmt: skip
        wheels = {"left_mm_s": pose.left / 1000, "right_mm_s": pose.right / 1000, "collisions": pose.collisions}
        yield Message("/wheels", "p2os.Wheels", pose.t, wheels)
        self._path.append(at)
        if pose.t >= self._path_at:
            self._path_at = pose.t + PATH_NS
            if len(self._path) > 2 * MOST_PATH_POSES:
                self._path = self._path[::2]
            step = -(-len(self._path) // MOST_PATH_POSES)
            yield Message("/path", "foxglove.PosesInFrame", pose.t, {
                "timestamp": _time(pose.t), "frame_id": WORLD_FRAME, "poses": self._path[::step],
            })  # fmt: skip

    def ranges(self, ranges: Ranges) -> Iterator[Message]:
        """Yield a scan for each sonar."""
        half = float(self._robot.get("sonar_cone_rad") or 0.0) / 2
        places = cast("Sequence[Sequence[float]]", self._robot.get("sonar") or ())
        for number, (place, mm) in enumerate(zip(places, ranges.mm, strict=False), start=1):
            yield Message(f"/sonar/{number}", "foxglove.LaserScan", ranges.t, {
                "timestamp": _time(ranges.t), "frame_id": ROBOT_FRAME,
                "pose": _pose(place[0], place[1], SONAR_HEIGHT_M, place[2]),
                "start_angle": -half, "end_angle": half, "ranges": [mm / 1000] * CONE_RAYS, "intensities": [],
            })  # fmt: skip

    def change(self, change: WorldChange) -> Iterator[Message]:
        """Yield what becomes of a thing."""
        if change.op == "remove":
            self._things.pop(change.name, None)
            gone = {"timestamp": _time(change.t), "type": 0, "id": change.name}
            yield Message("/scene", "foxglove.SceneUpdate", change.t, {"deletions": [gone], "entities": []})
            return
        self._things[change.name] = {**self._things.get(change.name, {}), **change.fields, "name": change.name}
        entity = _thing(self._things[change.name], change.t)
        yield Message("/scene", "foxglove.SceneUpdate", change.t, {"deletions": [], "entities": [entity]})

    def edge(self, edge: PinEdge) -> Iterator[Message]:
        """Yield a wire's level."""
        self._pins[edge.wire] = {"level": int(edge.level), "hz": 0.0, "duty": 0.0}
        yield self._pin(edge.wire, edge.t)

    def wave(self, wave: Wave) -> Iterator[Message]:
        """Yield a wire's wave."""
        self._pins[wave.wire] = {"level": 0, "hz": wave.frequency_hz, "duty": wave.duty}
        yield self._pin(wave.wire, wave.t)

    def _pin(self, wire: str, t: Nanos) -> Message:
        return Message(f"/pins/{wire}", "p2os.Pin", t, self._pins[wire])

    def text(self, text: Text) -> Iterator[Message]:
        """Yield a printed line."""
        line = text.data.decode("utf-8", "replace").rstrip("\r\n")
        yield _log(f"/{text.port}", text.t, INFO, line, text.port)

    def packet(self, packet: Packet) -> Iterator[Message]:
        """Yield the bytes of a packet."""
        data = {"from": "client" if packet.direction == "c2r" else "robot", "hex": packet.data.hex(" ")}
        yield Message("/wire", "p2os.Packet", packet.t, data)

    def logged(self, event: Event) -> Iterator[Message]:
        """Yield a line of the log."""
        is_bad = isinstance(event, (Contact, Fault)) or (isinstance(event, Verdict) and not event.met)
        name = event.who if isinstance(event, Note) else type(event).__name__.lower()
        yield _log("/log", event.t, ERROR if is_bad else INFO, what_of(event), name)

    def transfer(self, event: SpiTransfer | I2cTransfer | CanTransfer) -> Iterator[Message]:
        """Yield what went over a bus."""
        yield _log(f"/{event.bus}", event.t, DEBUG, what_of(event), event.bus)


_MAKERS: Mapping[type, Callable[[SceneMessages, Any], Iterator[Message]]] = {
    Pose: SceneMessages.pose, Ranges: SceneMessages.ranges, WorldChange: SceneMessages.change,
    PinEdge: SceneMessages.edge, Wave: SceneMessages.wave, Text: SceneMessages.text, Packet: SceneMessages.packet,
    Note: SceneMessages.logged, Contact: SceneMessages.logged,
    Fault: SceneMessages.logged, Verdict: SceneMessages.logged,
    SpiTransfer: SceneMessages.transfer, I2cTransfer: SceneMessages.transfer, CanTransfer: SceneMessages.transfer,
}  # fmt: skip


def _log(topic: str, t: Nanos, level: int, text: str, name: str) -> Message:
    data = {"timestamp": _time(t), "level": level, "message": text, "name": name, "file": "", "line": 0}
    return Message(topic, "foxglove.Log", t, data)


def _thing(item: Mapping[str, Any], t: Nanos) -> dict[str, object]:
    """Return the entity of a thing: a cube or a cylinder that stands on the floor."""
    height = float(item.get("height", 0.5))
    pose = _pose(float(item["x"]), float(item["y"]), height / 2, float(item.get("heading", 0.0)))
    colour = _colour(WALL if item.get("kind") == "wall" else BOX)
    entity = _entity(str(item["name"]), WORLD_FRAME, t)
    if item.get("shape") == "cylinder":
        size = 2 * float(item["radius"])
        entity["cylinders"] = [
            {"pose": pose, "size": _xyz(size, size, height), "bottom_scale": 1.0, "top_scale": 1.0, "color": colour}
        ]
    else:
        size_xyz = _xyz(float(item.get("length", 0.1)), float(item.get("width", 0.1)), height)
        entity["cubes"] = [{"pose": pose, "size": size_xyz, "color": colour}]
    return entity


def _entity(name: str, frame: str, t: Nanos, *, is_locked: bool = False) -> dict[str, object]:
    lists: dict[str, object] = {
        kind: []
        for kind in ("metadata", "arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models")
    }
    return {
        "timestamp": _time(t), "frame_id": frame, "id": name, "lifetime": {"sec": 0, "nsec": 0},
        "frame_locked": is_locked, **lists,
    }  # fmt: skip


def _time(t: Nanos) -> dict[str, object]:
    return {"sec": t // NS_PER_S, "nsec": t % NS_PER_S}


def _xyz(x: float, y: float, z: float) -> dict[str, object]:
    return {"x": x, "y": y, "z": z}


def _colour(rgba: tuple[float, float, float, float]) -> dict[str, object]:
    return dict(zip("rgba", rgba, strict=True))


def _pose(x: float, y: float, z: float, yaw: float, pitch: float = 0.0) -> dict[str, object]:
    """Return a pose; `pitch` is positive with the nose up, against the y axis's sense."""
    cy, sy, cp, sp = math.cos(yaw / 2), math.sin(yaw / 2), math.cos(-pitch / 2), math.sin(-pitch / 2)
    return {"position": _xyz(x, y, z), "orientation": {"x": -sy * sp, "y": cy * sp, "z": sy * cp, "w": cy * cp}}
