"""What a run writes down: pins, text, wire bytes, state logs, ranges and poses.

The recorder is the last follower of the loop. It samples the pose each 50 ms,
hands the trace what has passed, and keeps the few figures that a summary needs
and no trace holds (the clearance).

Edges are written up to the instant before the one reached: at that one itself someone may
still drive. So a wire's first level, too, is what it is when all of time 0 was driven.

Invariant: it changes nothing that it watches.
"""

import math
from binascii import b2a_base64
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import groupby
from typing import Protocol

from bluepill_sim.fabric.subscriptions import Wave
from p2os.pioneer.body.contract import BodyState, Hit
from p2os.pioneer.world.model import Obstacle
from robot_bench.recording.run_record import BLOCKS_VERSION, COLLISION
from robot_bench.recording.trace import MOST_EDGES, TraceWriter
from robot_bench.wires.edges import Edges, pack
from robot_bench.wires.nets import Harness, Net
from simbase.state import Stateful
from simbase.timing import NS_PER_MS, Nanos, Reached

SAMPLE_NS: Nanos = 50 * NS_PER_MS
#: A line of text longer than this is written in pieces.
LONGEST_TEXT = 64
MICRO = 1_000_000
#: Of a wire that has not changed.
_NONE = Edges()
_LINE_END = ord("\n")


class Observed(Protocol):
    """What the recorder wants to know of a body."""

    @property
    def state(self) -> BodyState:
        """Where it is and how it moves."""
        ...

    def clearance(self, *, no_more_than: float = math.inf) -> float:
        """Return metres between the hull and the nearest thing in the plan view, or `no_more_than`."""
        ...

    def take_moved(self) -> Sequence[Obstacle]:
        """Return what has walked or was pushed since this was asked last."""
        ...

    def take_hits(self) -> Sequence[Hit]:
        """Return the collisions since this was asked last."""
        ...


class Recorder(Stateful):
    """Watches the parts and fills the trace.

    Args:
        trace: Where entries go.
        harness: The wires; every one is recorded.
        body: What moves; None where it is unknown.
        sample_ns: Time between two poses.
    """

    STATE = (
        "trace", "min_clearance_m", "distance_m", "last_state", "last_line", "_next_sample", "_changed", "_has_levels",
        "_text", "_sonar_mm",
    )  # fmt: skip

    def __init__(
        self,
        trace: TraceWriter,
        harness: Harness,
        *,
        body: Observed | None,
        sample_ns: Nanos = SAMPLE_NS,
    ) -> None:
        self.trace = trace
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
        self._body = body
        self._sample_ns = sample_ns
        self._next_sample: Nanos = 0
        self._changed: dict[str, None] = {}
        #: Whether the levels at time 0 are written: not before everything of that instant was driven.
        self._has_levels = False
        self._text = bytearray()
        self._sonar_mm: list[int] | None = None
        for net in harness:
            net.watch(self._note_change)

    def start(self) -> None:
        """Have every wire's level at time 0 written once nobody can drive at that instant any more."""
        self._changed = dict.fromkeys(net.name for net in self._harness)

    @property
    def unfinished_text(self) -> bytes:
        """What the firmware has printed of a line whose end has not come."""
        return bytes(self._text)

    def usart(self, sent: Sequence[tuple[int, Nanos]]) -> None:
        """Take what the chip has sent: (word, ns at the end of its stop bit), oldest first."""
        for word, at in sent:
            self._text.append(word & 0xFF)
            if word == _LINE_END or len(self._text) >= LONGEST_TEXT:
                self._write_text(at)

    def wire(self, direction: str, data: bytes, at: Nanos) -> None:
        """Take bytes that have arrived: `c2r` client to robot, `r2c` back."""
        self.trace.add("wire", at, {"dir": direction, "hex": data.hex()})

    def event(self, who: str, at: Nanos, what: str, detail: str) -> None:
        """Take a line of a part's state log."""
        self.trace.add("event", at, {"who": who, "what": what, "detail": detail})
        if self.on_event is not None:
            self.on_event(who, at, what, detail)

    def listener(self, who: str) -> Callable[[Nanos, str, str], None]:
        """Return a callback for a part's state log."""
        return lambda at, what, detail: self.event(who, at, what, detail)

    def obstacle(self, op: str, name: str, at: Nanos, fields: Mapping[str, object]) -> None:
        """Take a change of the world."""
        self.trace.add("obstacle", at, {"op": op, "name": name, **fields})

    def sonar(self, at: Nanos, metres: Sequence[float]) -> None:
        """Take ranges in metres, all sonar in order; written when they differ from the last."""
        mm = [round(value * 1000) for value in metres]
        if mm != self._sonar_mm:
            self._sonar_mm = mm
            self.trace.add("sonar", at, {"mm": mm})

    def next_deadline(self) -> Nanos:
        """Return when the next pose is due."""
        return self._next_sample

    def advance_to(self, limit: Nanos) -> Reached:
        """Sample the pose where due, and write what nobody can precede any more."""
        if self._next_sample <= limit:
            self.bring_to(limit)
            self._sample(limit)
            self._next_sample = limit + self._sample_ns - limit % self._sample_ns
            self._pass(limit - 1)
        return Reached(limit)

    def finish(self, end: Nanos) -> None:
        """Write everything up to `end`, a last pose and an unfinished line of text."""
        if self._text:
            self._write_text(end)
        if self._next_sample - self._sample_ns < end:
            self._sample(end)
        self._pass(end)

    def _note_change(self, net: Net, _owner: str, _at: Nanos) -> None:
        self._changed[net.name] = None

    def _write_text(self, at: Nanos) -> None:
        self.trace.add("usart", at, {"hex": self._text.hex()})
        self.last_line = self._text.decode("utf-8", "replace").strip()
        self._text.clear()

    def _sample(self, at: Nanos) -> None:
        if self._body is None:
            return
        state = self._body.state
        if self.last_state is not None:
            self.distance_m += math.hypot(state.x_m - self.last_state.x_m, state.y_m - self.last_state.y_m)
        self.last_state = state
        least = self.min_clearance_m
        self.min_clearance_m = self._body.clearance(no_more_than=math.inf if least is None else least)
        self.trace.add("pose", at, pose_entry(state))
        for item in self._body.take_moved():
            self.obstacle("move", item.name, at, moved_entry(item))
        for hit in self._body.take_hits():
            # The body may have made the step that ends just after `at` already.
            self.event("body", min(hit.at_ns, at), COLLISION, hit_detail(hit))

    def _pass(self, limit: Nanos) -> None:
        """Write what is stamped at or before `limit`, and let the wires forget it."""
        if not self._has_levels and limit >= 0:
            self._has_levels = True
            self._write_levels()
        if self._changed:
            self._write_edges(limit)
        self.trace.write_until(limit)

    def _write_levels(self) -> None:
        levels = ""
        for net in self._harness:
            net.edges_until(0)
            levels += str(int(net.level(0)))
        names = [net.name for net in self._harness]
        self.trace.add("pins", 0, {"v": BLOCKS_VERSION, "nets": names, "levels": levels})

    def _write_edges(self, limit: Nanos) -> None:
        changed, self._changed = self._changed, {}
        tracks = []
        for net in self._harness:
            if net.name not in changed:
                tracks.append(_NONE)
                continue
            tracks.append(net.edges_until(limit))
            for at, entry in wave_entries(net.name, net.take_waves()):
                self.trace.add("waves", at, entry)
            for fight in net.take_contentions():
                self.event(
                    "bench", fight.at, "contention", f"{net.name} is driven hard by {' and '.join(fight.owners)}"
                )
            if net.forget_before(limit):
                self._changed[net.name] = None
        for first, count, block in pack(tracks, MOST_EDGES):
            self.trace.add("pins", first, {"n": count, "d": b2a_base64(block, newline=False).decode("ascii")})


def wave_entries(net: str, rows: Sequence[tuple[Nanos, Wave | None]]) -> Iterator[tuple[Nanos, dict[str, object]]]:
    """Yield the lines of a net's waves and when each begins: the rows that share a clock are one."""
    for (hz, ns), part in groupby(rows, lambda row: (0, 0) if row[1] is None else (row[1].ticks_hz, row[1].ns)):
        some = list(part)
        changes = [[at, *((wave.at, wave.period, wave.high) if wave else ())] for at, wave in some]
        yield some[0][0], {"net": net, "hz": hz, "ns": ns, "rows": changes}


def hit_detail(hit: Hit) -> str:
    """Return what was hit, and where, in one line."""
    what = repr(hit.name) if hit.name else "something"
    return f"{what} at x {hit.x_m:.3f} m, y {hit.y_m:.3f} m"


def moved_entry(item: Obstacle) -> dict[str, object]:
    """Return where a thing is, rounded to a micrometre and a microradian."""
    return {"x": round(item.x_m, 6), "y": round(item.y_m, 6), "heading": round(item.heading_rad, 6)}


def pose_entry(state: BodyState) -> dict[str, int]:
    """Return a body's state in the integers of the trace."""
    return {
        "x": round(state.x_m * MICRO),
        "y": round(state.y_m * MICRO),
        "z": round(state.z_m * MICRO),
        "h": round(state.heading_rad * MICRO),
        "p": round(state.pitch_rad * MICRO),
        "l": round(state.left_speed_mps * MICRO),
        "r": round(state.right_speed_mps * MICRO),
        "la": round(state.left_angle_rad * MICRO),
        "ra": round(state.right_angle_rad * MICRO),
        "c": state.collisions,
    }
