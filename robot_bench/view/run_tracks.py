"""The events of a run as rows of channels: of one that goes on as of one that was recorded.

Channels are made when their first row comes, but for the wires and the robot, which are known from the start. Several
robots are rows of one recording, each with its name as the channels' source.

Invariant: the events alone decide what is shown; who shows them decides nothing.
"""

import math
from collections.abc import Callable, Collection, Iterable, Mapping
from copy import copy
from dataclasses import replace
from itertools import groupby
from operator import itemgetter
from typing import Any, cast

from adapter_sim.adapter import AdapterState
from p2os.capture import Chunk, Direction
from p2os.robots.motor_step import STEP_MPS
from p2os.robots.parameters import ParametersError
from p2os.view.header import ChannelHeader, RobotHeader, SensorPlace, StateTransition, WorldHeader, WorldThing
from p2os.view.packet_rows import PacketRow, PacketRows
from p2os.view.recording import ChannelTrack, ViewRecording
from p2os.view.world_plan import thing_of, world_of
from robot_bench.events.codec import Blocks, EdgeBlock, Json, Levels, Recorded
from robot_bench.events.kinds import (
    CanTransfer,
    Clearance,
    Contact,
    Event,
    Fault,
    I2cTransfer,
    Note,
    Packet,
    Pose,
    Ranges,
    SpiTransfer,
    Text,
    Verdict,
    Wave,
    WorldChange,
)
from robot_bench.events.words import what_of
from robot_bench.recording.signals import GROUPS, grouped, pin_labels
from robot_bench.wires.edges import Edges
from simbase.timing import NS_PER_S, Nanos

DEBUG, INFO, WARNING, ERROR = range(4)
OPEN, MET, MISSED, NOT_JUDGED = range(4)
_NOWHERE = (math.nan, math.nan)
#: Note of the adapter → the state that it has entered; `adapter_sim.adapter` has their table.
_ENTERED: Mapping[str, AdapterState] = {
    "reset": AdapterState.RESET, "booting": AdapterState.BOOTING, "booted": AdapterState.IDLE,
    "idle": AdapterState.IDLE, "connecting": AdapterState.CONNECTING, "connected": AdapterState.SETTLING,
    "driving": AdapterState.DRIVING, "disconnected": AdapterState.CLOSING, "lost": AdapterState.LOST,
    "implausible": AdapterState.LOST, "shutdown": AdapterState.LOST, "pad lost": AdapterState.LOST,
    "master": AdapterState.LOST,
}  # fmt: skip
_STATES = tuple(AdapterState)
_S = AdapterState
#: As the table of `adapter_sim.adapter` has them.
_TRANSITIONS = tuple(
    StateTransition(source=_STATES.index(source), target=_STATES.index(target), cause=cause)
    for source, target, cause in (
        (_S.RESET, _S.BOOTING, "rst low"), (_S.BOOTING, _S.IDLE, "boot over"), (_S.IDLE, _S.CONNECTING, "requested"),
        (_S.CONNECTING, _S.SETTLING, "opened"), (_S.CONNECTING, _S.CLOSING, "withdrawn"),
        (_S.SETTLING, _S.DRIVING, "odometry 0, or time over"), (_S.SETTLING, _S.CLOSING, "withdrawn"),
        (_S.SETTLING, _S.LOST, "ended or implausible"), (_S.DRIVING, _S.CLOSING, "withdrawn"),
        (_S.DRIVING, _S.LOST, "ended or implausible"), (_S.CLOSING, _S.IDLE, "time over"),
        (_S.LOST, _S.IDLE, "withdrawn"),
        *((state, _S.RESET, "rst high") for state in AdapterState if state is not _S.RESET),
    )
)  # fmt: skip


class RunTracks:
    """One robot's channels.

    Args:
        recording: Where they are added; its header gets the robot, and the world where it has none yet.
        meta: The first entry of the robot's trace.
        source: The robot's name among several; empty: the only one.
        others: Names of the other robots, which its world has as things that move.
        is_whole: Whether all of a run is taken before anybody looks: packets are read when somebody does.
    """

    def __init__(
        self, recording: ViewRecording, meta: Json, source: str = "", others: Collection[str] = (), *,
        is_whole: bool = False,
    ) -> None:  # fmt: skip
        self.recording, self._source, self._others = recording, source, frozenset(others)
        #: What a line of the events begins with, of robots that share them.
        self._prefix = source
        self._tracks: dict[str, ChannelTrack] = {}
        self._robot = cast("Mapping[str, Any]", meta.get("robot") or {})
        self._threshold_m = cast("float | None", meta.get("threshold_m"))
        self._step_mps = float(cast("float", meta.get("step_mps") or STEP_MPS))
        pins = cast("dict[str, str]", meta.get("pins") or {})
        self._labels = {net: f"{pin} {net}" if pin != net else net for net, pin in pins.items()} | pin_labels()
        self._groups = {net: title for title, nets in grouped(list(pins)) for net in nets}
        self._groups |= {net: f"port {pin[1]}" for net, pin in pins.items() if pin == net}
        self._levels: dict[str, int] = {}
        self._packets = _packets_of(str(self._robot.get("name", "")))
        self._is_whole, self._unread = is_whole, list[Packet]()
        header = recording.header
        world = cast("Mapping[str, Any]", meta.get("world") or {})
        if header.world is None and world:
            header = replace(header, world=world_of(world))
        if self._robot:
            header = replace(header, robots=(*header.robots, _robot_of(self._robot, source)))
        recording.header = header
        self._things = {thing.name: place for place, thing in enumerate(header.world.things)} if header.world else {}
        if self._robot:
            self._track("pose", "pose", group="robot")
        for net in pins:
            self._wire(net)

    def forked(self, source: str, until_ns: Nanos) -> "RunTracks":
        """Return the channels of another future of this robot, which has the same past up to a time."""
        header = self.recording.header
        alike = [replace(robot, name=source) for robot in header.robots if robot.name == self._source]
        self.recording.header = replace(header, robots=(*header.robots, *alike))
        other = copy(self)
        other._leave(source, until_ns)  # noqa: SLF001 - one of its own kind
        return other

    def _leave(self, source: str, until_ns: Nanos) -> None:
        """Be another future from now on, with channels of its own."""
        tracks, self._source, self._tracks = self._tracks, source, {}
        self._things, self._levels = dict(self._things), {}
        self._packets = _packets_of(str(self._robot.get("name", "")))
        ids: dict[int, int] = {}
        for key, track in sorted(tracks.items(), key=lambda row: row[1].header.id):
            made = self.recording.copied(track, source, until_ns, ids.get(track.header.of, -1))
            ids[track.header.id], self._tracks[key] = made.header.id, made
        for net in (net for motor in (1, 2) for net in GROUPS[_motor(motor)]):
            if (levels := self._tracks.get(f"levels:{net}")) is not None and len(levels):
                self._levels[net] = cast("int", levels.column("level")[-1])

    def take(self, event: Event) -> None:
        """Add the rows of an event; edges come by `edges`."""
        _ROWS[type(event)](self, event)

    def edges(self, tracks: Mapping[str, Edges]) -> None:
        """Add edges of wires, none of them before those that were added, and what the motor pins ask for by them."""
        for net, edges in tracks.items():
            self._wire(net).extend_levels(edges.times, edges.levels)
        for motor in (1, 2):
            nets = [net for net in GROUPS[_motor(motor)] if net in tracks]
            changes = sorted((t, net, level) for net in nets for t, level in tracks[net])
            for t, found in groupby(changes, key=itemgetter(0)):
                self._levels |= {net: level for _, net, level in found}
                self._asked(motor, t)

    def _asked(self, motor: int, t: Nanos) -> None:
        """Add what a motor's pins ask for from now on: two's complement, in steps."""
        levels = [self._levels[net] for net in GROUPS[_motor(motor)] if net in self._levels]
        code, sign = sum(level << bit for bit, level in enumerate(levels)), 1 << len(levels) - 1
        track = self._samples(
            f"{'left' if motor == 1 else 'right'} asked", "m/s", "wheels", "what the motor pins ask for",
            is_stepped=True,
        )  # fmt: skip
        track.append(t, ((code ^ sign) - sign) * self._step_mps)

    def variable(self, name: str, type_name: str) -> ChannelTrack:
        """Return the channel of a variable of the program, which holds its value until the next row."""
        doc = f"{type_name}, a variable of the program"
        return self._track(name, "samples", key=f"variable:{name}", doc=doc, is_stepped=True)

    def finish(self, end: Json) -> None:
        """Add the rest of what was sent, and how the goals stand that no event has decided."""
        at = self.recording.header.end_ns
        if self._unread:
            self._track("P2OS", "packets", group="packets").later = self._read
        else:
            self._end_packets()
        for key, standing in (("goals_met", MET), ("goals_not_judged", NOT_JUDGED)):
            for goal in cast("list[str]", end.get(key) or []):
                if (track := self._goal(goal)).column("standing")[-1] == OPEN:
                    track.append(at, standing, math.nan, "")

    def _track(self, name: str, kind: str, key: str = "", **about: Any) -> ChannelTrack:
        """Return a channel, made of `about` where it is not there yet."""
        key = key or f"{kind}:{name}"
        if key not in self._tracks:
            self._tracks[key] = self.recording.add(ChannelHeader(name=name, kind=kind, source=self._source, **about))
        return self._tracks[key]

    def _samples(self, name: str, unit: str, group: str, doc: str = "", **about: Any) -> ChannelTrack:
        return self._track(name, "samples", unit=unit, group=group, doc=doc, **about)

    def _wire(self, net: str) -> ChannelTrack:
        label = self._labels.get(net, net)
        return self._track(label, "levels", key=f"levels:{net}", group=self._groups.get(net, "other"), doc=net)

    def _goal(self, goal: str) -> ChannelTrack:
        track = self._track(goal, "goal", group="goals")
        if not len(track):
            track.append(0, OPEN, math.nan, "")
        return track

    def _event(
        self, t: Nanos, severity: int, who: str, what: str, detail: str, place: tuple[float, float] = _NOWHERE
    ) -> None:
        events = self._tracks.get("events") or self.recording.shared(ChannelHeader(name="events", kind="events"))
        self._tracks["events"] = events
        events.append(t, severity, f"{self._prefix} {who}".lstrip(), what, detail, *place)

    def pose(self, pose: Pose) -> None:
        """Add where the robot is, and how its wheels turn."""
        self._track("pose", "pose").append(pose.t, pose.x_m, pose.y_m, pose.z / 1e6, pose.heading_rad, pose.pitch / 1e6)
        for side, speed in (("left", pose.left), ("right", pose.right)):
            self._samples(side, "m/s", "wheels", "speed at the rim").append(pose.t, speed / 1e6)

    def ranges(self, ranges: Ranges) -> None:
        """Add the ranges of all sonar, and the nearest."""
        metres = [mm / 1000 if mm else math.nan for mm in ranges.mm]
        if not metres:
            return
        sensors = [
            SensorPlace(name=f"sonar {number}", x_m=place[0], y_m=place[1], bearing_rad=place[2])
            for number, place in enumerate(self._robot.get("sonar") or (), start=1)
        ]
        self._track(
            "sonar", "ranges", group="robot", unit="m", width=len(metres), sensors=sensors,
            cone_rad=float(self._robot.get("sonar_cone_rad") or 0.0),
            range_m=float(self._robot.get("sonar_range_m") or 0.0),
        ).append(ranges.t, metres)  # fmt: skip
        nearest = min((value for value in metres if not math.isnan(value)), default=math.nan)
        self._samples(
            "nearest echo", "m", "sonar", "of all sonar", is_stepped=True, mark=self._threshold_m or None
        ).append(ranges.t, nearest)  # fmt: skip

    def wave(self, wave: Wave) -> None:
        """Add a wire's wave, or its end."""
        wire, tick_ns = self._wire(wave.wire), NS_PER_S / wave.ticks_hz if wave.ticks_hz else 0.0
        self._track(
            wire.header.name, "waves", group=wire.header.group, of=wire.header.id, doc=wave.wire
        ).append(wave.t, wave.period * tick_ns, wave.high * tick_ns, wave.at * tick_ns)  # fmt: skip

    def text(self, text: Text) -> None:
        """Add printed lines."""
        track = self._track(text.port, "text", group="consoles")
        for line in text.data.decode("utf-8", "replace").splitlines():
            track.append(text.t, 0, line)

    def packet(self, packet: Packet) -> None:
        """Add the packets that these bytes complete."""
        if self._is_whole:
            self._unread.append(packet)
            return
        chunk = Chunk(at_ns=packet.t, direction=Direction(packet.direction), data=packet.data)
        for row, _ in self._packets.take(chunk):
            self._row(row)

    def _read(self) -> None:
        """Add all packets, of a run that is whole."""
        self._is_whole, unread, self._unread = False, self._unread, []
        for packet in unread:
            self.packet(packet)
        self._end_packets()

    def _end_packets(self) -> None:
        """Add what was left when the run ended."""
        for row, _ in self._packets.finish(self.recording.header.end_ns):
            self._row(row)

    def _row(self, row: PacketRow) -> None:
        self._track("P2OS", "packets", group="packets").append(*row)

    def transfer(self, event: SpiTransfer | I2cTransfer | CanTransfer) -> None:
        """Add what went over a bus."""
        words = what_of(event).removeprefix(f"{event.bus} ")
        data = event.from_master if isinstance(event, SpiTransfer) else event.data
        is_bad = isinstance(event, CanTransfer) and bool(event.error)
        self._track(event.bus, "packets", group="buses").append(
            event.begun, 2, data, type(event).__name__.removesuffix("Transfer"), words, "", int(is_bad)
        )

    def note(self, note: Note) -> None:
        """Add a line of a part's log, and the state that the adapter has entered by it."""
        self._event(note.t, INFO, note.who, note.what, note.detail)
        if note.who == "adapter" and note.what in _ENTERED:
            self._track("adapter", "state", group="adapter", states=_STATES, transitions=_TRANSITIONS).append(
                note.t, _STATES.index(_ENTERED[note.what]), f"{note.what}: {note.detail}" if note.detail else note.what
            )

    def fault(self, fault: Fault) -> None:
        """Add a fault that began or ended."""
        self._event(fault.t, WARNING, "fault", fault.op, fault.words)

    def contact(self, hit: Contact) -> None:
        """Add a collision."""
        self._event(hit.t, ERROR, "body", "collision", hit.place, (hit.x_m, hit.y_m))

    def clearance(self, clearance: Clearance) -> None:
        """Add the least clearance so far."""
        self._samples(
            "least clearance", "m", "clearance", "nearer to something than ever before", is_stepped=True
        ).append(clearance.t, clearance.um / 1e6)

    def verdict(self, verdict: Verdict) -> None:
        """Add how a goal came out."""
        track = self._goal(verdict.goal)
        margin = math.nan if verdict.robustness is None else verdict.robustness
        track.append(verdict.t, MET if verdict.met else MISSED, margin, verdict.says)
        what = f"goal {'met' if verdict.met else 'missed'}"
        detail = f"{verdict.goal}{': ' if verdict.says else ''}{verdict.says}"
        self._event(verdict.t, INFO if verdict.met else ERROR, "goals", what, detail)

    def change(self, change: WorldChange) -> None:
        """Add what becomes of a thing."""
        if change.name in self._others:
            return
        world = self.recording.header.world or WorldHeader(name="", extent_m=(-3.0, -3.0, 3.0, 3.0))
        if change.op == "remove":
            if change.name in self._things:
                self._moved(change.t, self._things[change.name], 0, world)
            return
        fields = cast("Mapping[str, Any]", change.fields)
        place = self._things.get(change.name)
        old = None if place is None else world.things[place]
        thing = thing_of({**({} if old is None else _plain_of(old)), **fields, "name": change.name})
        if old is None or _shape_of(thing) != _shape_of(old):
            self._things[change.name] = place = len(world.things)
            world = replace(world, things=(*world.things, replace(thing, is_there=False)))
            self.recording.header = replace(self.recording.header, world=world)
        self._moved(change.t, cast("int", place), 1, world, thing)

    def _moved(self, t: Nanos, place: int, is_there: int, world: WorldHeader, thing: WorldThing | None = None) -> None:
        thing = thing or world.things[place]
        self._track("things", "things", group="world").append(
            t, place, is_there, thing.x_m, thing.y_m, thing.heading_rad
        )


def add_events(tracks: RunTracks, blocks: Blocks, events: Iterable[Recorded]) -> None:
    """Add what a trace is written of as it comes, edges too.

    Args:
        tracks: Of one robot, or of one future of it.
        blocks: Its wires, as far as the trace has come.
        events: What was handed on at once.
    """
    for event in events:
        if isinstance(event, Levels):
            blocks.begin(event)
            begun = zip(event.nets, event.levels, strict=True)
            tracks.edges({net: Edges([(event.t, int(level))]) for net, level in begun})
        elif isinstance(event, EdgeBlock):
            tracks.edges(dict(blocks.take(event)))
        else:
            tracks.take(event)


_ROWS: Mapping[type, Callable[[RunTracks, Any], None]] = {
    Wave: RunTracks.wave, Text: RunTracks.text, SpiTransfer: RunTracks.transfer,
    I2cTransfer: RunTracks.transfer, CanTransfer: RunTracks.transfer, WorldChange: RunTracks.change,
    Fault: RunTracks.fault, Packet: RunTracks.packet, Note: RunTracks.note, Ranges: RunTracks.ranges,
    Pose: RunTracks.pose, Clearance: RunTracks.clearance, Contact: RunTracks.contact, Verdict: RunTracks.verdict,
}  # fmt: skip


def _motor(number: int) -> str:
    return f"motor {number} ({'left' if number == 1 else 'right'})"


def _packets_of(robot: str) -> PacketRows:
    """Return what reads a robot's packets; in the units that it says itself where its model is not to be had."""
    try:
        return PacketRows(robot)
    except ParametersError:
        return PacketRows()


def _plain_of(thing: WorldThing) -> dict[str, object]:
    """Return a thing as the trace has it."""
    names = {"kind": "kind", "shape": "shape", "x": "x_m", "y": "y_m", "heading": "heading_rad", "height": "height_m",
             "length": "length_m", "width": "width_m", "radius": "radius_m"}  # fmt: skip
    return {key: getattr(thing, name) for key, name in names.items()}


def _shape_of(thing: WorldThing) -> tuple[object, ...]:
    return thing.kind, thing.shape, thing.height_m, thing.length_m, thing.width_m, thing.radius_m


def _robot_of(robot: Mapping[str, Any], source: str) -> RobotHeader:
    return RobotHeader(
        name=source, model=str(robot.get("name", "")), front_m=float(robot.get("front_m", 0.18)),
        rear_m=float(robot.get("rear_m", 0.26)), width_m=float(robot.get("width_m", 0.38)),
    )  # fmt: skip
