"""What a bench tells of its parts: pins, text, wire bytes, state logs, ranges and poses become events.

The recorder is the last follower of the loop. It samples the pose each 50 ms, publishes what has
happened (`robot_bench.events`), and releases it to whoever has subscribed: the trace, goals, a program.
It keeps the few figures that a summary needs and no trace holds.

Edges are released up to the instant before the one reached: at that one itself someone may
still drive. So a wire's first level, too, is what it is when all of time 0 was driven.

Invariant: it changes nothing that it watches.
"""

import contextlib
import math
from binascii import b2a_base64
from collections.abc import Callable, Iterator, Mapping, Sequence
from operator import itemgetter

from bluepill_sim.fabric.characters import Characters
from p2os.pioneer.body.contract import BodyState, Hit, RobotBody
from p2os.pioneer.world.model import Obstacle
from robot_bench.events.codec import EdgeBlock, Levels, line_of
from robot_bench.events.kinds import (
    MICRO,
    Clearance,
    Contact,
    Fault,
    Note,
    Packet,
    Pose,
    Ranges,
    Text,
    Wave,
    WorldChange,
    hull_part,
)
from robot_bench.events.stream import EventStream
from robot_bench.recording.trace import TraceWriter
from robot_bench.recording.transfers import Transfers
from robot_bench.wires.edges import Edges, pack
from robot_bench.wires.nets import Harness, Net
from simbase.state import Stateful
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos, Reached

SAMPLE_NS: Nanos = 50 * NS_PER_MS
#: chosen: a line of some 10 kB, all that a cut can cost.
MOST_EDGES = 4096
#: A line of text longer than this is reported in pieces.
LONGEST_TEXT = 64
#: The port that firmware prints on.
CONSOLE = "usart1"
#: Of a wire that has not changed.
_NONE = Edges()
_LINE_END = ord("\n")
_PLACE = itemgetter(0)


class Recorder(Stateful):
    """Watches the parts and publishes what they do.

    Args:
        trace: Where all of it is written.
        harness: The wires; every one is recorded.
        body: What moves; None where it is unknown.
        sample_ns: Time between two poses.
    """

    STATE = (
        "trace", "events", "min_clearance_m", "distance_m", "last_state", "last_line", "_next_sample", "_changed",
        "_has_levels", "_text", "_sonar_mm", "_clearance_um", "_other_places", "transfers",
    )  # fmt: skip
    #: Who they are is settled when they are built.
    DERIVED = ("_others",)

    def __init__(
        self,
        trace: TraceWriter,
        harness: Harness,
        *,
        body: RobotBody | None,
        sample_ns: Nanos = SAMPLE_NS,
    ) -> None:
        self.trace = trace
        #: What happens, for whoever subscribes.
        self.events = EventStream()
        self.events.record(trace.take)
        #: Called with (who, ns, what, detail) of each line of a part's state log.
        self.on_event: Callable[[str, Nanos, str, str], None] | None = None
        #: Brings the body to an instant before it is looked at; whoever owns the body sets it.
        self.bring_to: Callable[[Nanos], None] = lambda _at: None
        self.min_clearance_m: float | None = None
        self.distance_m = 0.0
        #: The state at the last sample; None before the first.
        self.last_state: BodyState | None = None
        #: What the firmware printed last.
        self.last_line = ""
        self._harness = harness
        self._nets = {net.name: (place, net) for place, net in enumerate(harness)}
        self._body = body
        self._sample_ns = sample_ns
        self._next_sample: Nanos = 0
        self._changed: dict[str, None] = {}
        #: Whether the levels at time 0 are reported: not before everything of that instant was driven.
        self._has_levels = False
        #: Port → what was sent of a line whose end has not come.
        self._text: dict[str, bytearray] = {}
        #: What puts together what goes over the buses that are recorded.
        self.transfers: dict[str, Transfers] = {}
        self._sonar_mm: tuple[int, ...] | None = None
        self._clearance_um: int | None = None
        #: Other robots of the world, and where each was reported to be.
        self._others: list[RobotBody] = []
        self._other_places: list[tuple[float, float, float] | None] = []
        for net in harness:
            net.watch(self._note_change)

    def watch_robot(self, robot: RobotBody) -> None:
        """Tell of another robot as of a thing of the world: placed at the first pose, moved with those that follow."""
        self._others.append(robot)
        self._other_places.append(None)

    def start(self) -> None:
        """Have every wire's level at time 0 reported once nobody can drive at that instant any more."""
        self._changed = dict.fromkeys(net.name for net in self._harness)

    @property
    def unfinished_text(self) -> bytes:
        """What the firmware has printed of a line whose end has not come."""
        return bytes(self._text.get(CONSOLE, b""))

    def lines(self) -> Iterator[str]:
        """Yield every line of the trace so far, with its end, in order; also those not yet written."""
        yield from self.trace.lines()
        for event in self.events.pending():
            yield f"{line_of(event)}\n"

    def usart(self, sent: Sequence[tuple[int, Nanos]], port: str = CONSOLE) -> None:
        """Take what a port of the chip has sent: (word, ns at the end of its stop bit), oldest first."""
        text = self._text.setdefault(port, bytearray())
        words = sent.words if isinstance(sent, Characters) else [word for word, _ in sent]
        first = 0
        while first < len(words):
            last = min(len(words), first + LONGEST_TEXT - len(text))
            with contextlib.suppress(ValueError):  # no end of a line
                last = words.index(_LINE_END, first, last) + 1
            portion = words[first:last]
            text += portion if isinstance(portion, bytes) else bytes([word & 0xFF for word in portion])
            if words[last - 1] == _LINE_END or len(text) >= LONGEST_TEXT:
                self._tell_text(port, sent[last - 1][1])
            first = last

    def wire(self, direction: str, data: bytes, at: Nanos) -> None:
        """Take bytes that have arrived: `c2r` client to robot, `r2c` back."""
        self.events.publish(Packet(t=at, direction=direction, data=data))

    def event(self, who: str, at: Nanos, what: str, detail: str) -> None:
        """Take a line of a part's state log."""
        self.events.publish(Note(t=at, who=who, what=what, detail=detail))
        self._log(who, at, what, detail)

    def listener(self, who: str) -> Callable[[Nanos, str, str], None]:
        """Return a callback for a part's state log."""
        return lambda at, what, detail: self.event(who, at, what, detail)

    def obstacle(self, op: str, name: str, at: Nanos, fields: Mapping[str, object]) -> None:
        """Take a change of the world."""
        self.events.publish(WorldChange(t=at, op=op, name=name, fields=fields))

    def fault(self, op: str, words: str, at: Nanos) -> None:
        """Take what was made to go wrong (`inject`), what was set right (`clear`), and a firmware that `died`."""
        self.events.publish(Fault(t=at, op=op, words=words))

    def sonar(self, at: Nanos, metres: Sequence[float]) -> None:
        """Take ranges in metres, all sonar in order; reported when they differ from the last."""
        mm = tuple(round(value * 1000) for value in metres)
        if mm != self._sonar_mm:
            self._sonar_mm = mm
            self.events.publish(Ranges(t=at, mm=mm))

    def next_deadline(self) -> Nanos:
        """Return when the next pose is due."""
        return self._next_sample

    def advance_to(self, limit: Nanos) -> Reached:
        """Sample the pose where due, and release what nobody can precede any more."""
        if self._next_sample <= limit:
            self.bring_to(limit)
            self._sample(limit)
            self._next_sample = limit + self._sample_ns - limit % self._sample_ns
            self._pass(limit - 1)
        return Reached(limit)

    def finish(self, end: Nanos) -> None:
        """Release everything up to `end`, a last pose and unfinished lines of text."""
        for port, text in self._text.items():
            if text:
                self._tell_text(port, end)
        for transfers in self.transfers.values():
            transfers.release(end, is_end=True)
        if self._next_sample - self._sample_ns < end:
            self._sample(end)
        self._pass(end)

    def _log(self, who: str, at: Nanos, what: str, detail: str) -> None:
        if self.on_event is not None:
            self.on_event(who, at, what, detail)

    def _note_change(self, net: Net, _owner: str, _at: Nanos) -> None:
        self._changed[net.name] = None

    def _tell_text(self, port: str, at: Nanos) -> None:
        text = self._text[port]
        self.events.publish(Text(t=at, data=bytes(text), port=port))
        if port == CONSOLE:
            self.last_line = text.decode("utf-8", "replace").strip()
        text.clear()

    def _sample(self, at: Nanos) -> None:
        if self._body is None:
            return
        state = self._body.state
        if self.last_state is not None:
            self.distance_m += math.hypot(state.x_m - self.last_state.x_m, state.y_m - self.last_state.y_m)
        self.last_state = state
        self.events.publish(pose_of(state, at))
        self._measure_clearance(self._body, at)
        for number, robot in enumerate(self._others):
            self._tell_other(number, robot, at)
        for item in self._body.take_moved():
            self.obstacle("move", item.name, at, moved_entry(item))
        for hit in self._body.take_hits():
            # The body may have made the step that ends just after `at` already.
            contact = contact_of(hit, state, min(hit.at_ns, at))
            self.events.publish(contact)
            self._log("body", contact.t, "collision", f"{contact.what} at x {hit.x_m:.3f} m, y {hit.y_m:.3f} m")

    def _tell_other(self, number: int, robot: RobotBody, at: Nanos) -> None:
        """Tell where another robot's hull is, as a box, where that is new."""
        state, hull = robot.state, robot.footprint_at(0.0, 0.0, 0.0).polygon
        front, rear = max(x for x, _ in hull), min(x for x, _ in hull)
        cosine, sine = math.cos(state.heading_rad), math.sin(state.heading_rad)
        middle = (front + rear) / 2
        there = state.x_m + middle * cosine, state.y_m + middle * sine, state.heading_rad
        place = (round(there[0], 6), round(there[1], 6), round(there[2], 6))
        reported, self._other_places[number] = self._other_places[number], place
        fields: dict[str, object] = dict(zip(("x", "y", "heading"), place, strict=True))
        if reported is None:
            box = {"kind": "obstacle", "shape": "box", "height": 0.0, "length": round(front - rear, 6)}
            width = round(2 * max(y for _, y in hull), 6)
            self.obstacle("place", robot.robot_name, at, fields | box | {"width": width})
        elif reported != place:
            self.obstacle("move", robot.robot_name, at, fields)

    def _measure_clearance(self, body: RobotBody, at: Nanos) -> None:
        """Tell the clearance where it is less than ever."""
        least = self.min_clearance_m
        found = body.clearance(no_more_than=math.inf if least is None else least)
        if not math.isfinite(found):  # there is nothing that it could touch
            return
        self.min_clearance_m = found
        if (um := round(found * MICRO)) != self._clearance_um:
            self._clearance_um = um
            self.events.publish(Clearance(t=at, um=um))

    def _pass(self, limit: Nanos) -> None:
        """Release what is stamped at or before `limit`, and let the wires forget it."""
        if not self._has_levels and limit >= 0:
            self._has_levels = True
            self._tell_levels()
        for transfers in self.transfers.values():
            transfers.release(limit)
        self.events.release(limit, self._tell_edges(limit) if self._changed else None)

    def _tell_levels(self) -> None:
        levels = ""
        for net in self._harness:
            net.edges_until(0)
            levels += str(int(net.level(0)))
        self.events.publish(Levels(t=0, nets=tuple(net.name for net in self._harness), levels=levels))

    def _tell_waves(self, net: Net) -> None:
        """Publish how a wire's wave has changed; where it ends, one of no period."""
        for at, wave in net.take_waves():
            if wave is None:
                self.events.publish(Wave(t=at, wire=net.name, at=0, period=0, high=0, ticks_hz=0))
            else:
                ticks = wave.at + ((at - wave.ns + 1) * wave.ticks_hz - 1) // NS_PER_S
                self.events.publish(
                    Wave(
                        t=at, wire=net.name, at=ticks % wave.period, period=wave.period, high=wave.high,
                        ticks_hz=wave.ticks_hz,
                    )
                )  # fmt: skip

    def _tell_edges(self, limit: Nanos) -> dict[str, tuple[int, Edges]]:
        """Publish the edges of all wires in blocks; return those that somebody wants one by one."""
        changed, self._changed = self._changed, {}
        tracks, wanted = [_NONE] * len(self._nets), {}
        for place, net in sorted([self._nets[name] for name in changed], key=_PLACE):
            edges = tracks[place] = net.edges_until(limit)
            if edges and self.events.wants_edges(net.name):
                wanted[net.name] = place, edges
            self._tell_waves(net)
            for fight in net.take_contentions():
                self.event(
                    "bench", fight.at, "contention", f"{net.name} is driven hard by {' and '.join(fight.owners)}"
                )
            if net.forget_before(limit):
                self._changed[net.name] = None
        for first, count, block in pack(tracks, MOST_EDGES):
            data = b2a_base64(block, newline=False).decode("ascii")
            self.events.publish(EdgeBlock(t=first, count=count, data=data))
        return wanted


def contact_of(hit: Hit, state: BodyState, at: Nanos) -> Contact:
    """Return a collision as an event: to a micrometre, and with the part of the hull by where the robot is now."""
    bearing = math.atan2(hit.y_m - state.y_m, hit.x_m - state.x_m) - state.heading_rad
    return Contact(
        t=at, what=repr(hit.name) if hit.name else "something", part=hull_part(bearing),
        x_m=round(hit.x_m * MICRO) / MICRO, y_m=round(hit.y_m * MICRO) / MICRO,
    )  # fmt: skip


def moved_entry(item: Obstacle) -> dict[str, object]:
    """Return where a thing is, rounded to a micrometre and a microradian."""
    return {"x": round(item.x_m, 6), "y": round(item.y_m, 6), "heading": round(item.heading_rad, 6)}


def pose_of(state: BodyState, at: Nanos) -> Pose:
    """Return a body's state in the integers of the trace."""
    return Pose(
        t=at,
        x=round(state.x_m * MICRO),
        y=round(state.y_m * MICRO),
        z=round(state.z_m * MICRO),
        heading=round(state.heading_rad * MICRO),
        pitch=round(state.pitch_rad * MICRO),
        left=round(state.left_speed_mps * MICRO),
        right=round(state.right_speed_mps * MICRO),
        left_angle=round(state.left_angle_rad * MICRO),
        right_angle=round(state.right_angle_rad * MICRO),
        collisions=state.collisions,
        work=round(state.rim_work_j * MICRO),
    )
