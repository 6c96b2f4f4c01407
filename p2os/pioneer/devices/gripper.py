"""The gripper: two paddles, a lift, two light beams.

Source: Pioneer 2/3 H8 manual, command GRIPPER and table 11 (GRIPPERpac). How
long the paddles and the lift take is chosen; nothing is ever dropped.
"""

from dataclasses import dataclass, field

from p2os.protocol.packets import GripperPacket, GripperState
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

#: chosen: full way of the paddles and of the lift.
PADDLES_NS: Nanos = 1_500 * NS_PER_MS
LIFT_NS: Nanos = 3 * NS_PER_S
#: The unit of a timed carry and of the grasp time (H8 manual: pressure and carry time in 20 ms).
TIME_UNIT_NS: Nanos = 20 * NS_PER_MS


@dataclass(slots=True)
class Travel:
    """A thing that runs between two ends: 0 (open, down) to `length_ns` of running (closed, up)."""

    length_ns: Nanos
    place_ns: Nanos = 0
    #: +1, -1 or 0 since `since`.
    direction: int = 0
    since: Nanos = 0
    #: When a timed run ends.
    until: Nanos | None = None

    def at(self, now: Nanos) -> Nanos:
        """Return where it is."""
        end = now if self.until is None else min(now, self.until)
        return min(max(self.place_ns + self.direction * (end - self.since), 0), self.length_ns)

    def moving(self, now: Nanos) -> bool:
        """Tell whether it runs."""
        if not self.direction or (self.until is not None and now >= self.until):
            return False
        return self.at(now) != (0 if self.direction < 0 else self.length_ns)

    def go(self, direction: int, now: Nanos, run_ns: Nanos | None = None) -> None:
        """Run from here on; 0 stops."""
        self.place_ns = self.at(now)
        self.direction, self.since = direction, now
        self.until = None if run_ns is None else now + run_ns


#: GRIPPER's number → directions of paddles and lift, None where it leaves them (+ closes, + lifts).
MOVES: dict[int, tuple[int | None, int | None]] = {
    1: (-1, None), 2: (1, None), 3: (0, None), 4: (None, 1), 5: (None, -1), 6: (None, 0),
    7: (1, 1), 8: (-1, -1), 15: (0, 0),
}  # fmt: skip
PRESSURE, CARRY = 16, 17
#: `kind` of one whose switches hang at the user's digital inputs.
ON_USER_IO = 1
#: The states that are switches; the two above them are the controller's own.
SWITCHES = 0x3F


@dataclass(slots=True)
class VirtualGripper:
    """A gripper, or the place where one could be."""

    #: 0 none, 1 on the user I/O, 2 on the general I/O.
    kind: int = 0
    paddles: Travel = field(default_factory=lambda: Travel(PADDLES_NS))
    lift: Travel = field(default_factory=lambda: Travel(LIFT_NS))
    #: The last GRIPPERVAL.
    value: int = 0
    #: Grasp pressure, 20 ms units.
    pressure: int = 0
    #: A thing stands between the paddles.
    has_thing: bool = False

    def command(self, number: int, now: Nanos) -> None:
        """Take GRIPPER's number; those that the manual does not list do nothing."""
        if number == PRESSURE:
            self.pressure = self.value
        if number == CARRY:
            run_ns = abs(self.value) * TIME_UNIT_NS
            self.lift.go(1 if self.value > 0 else -1, now, run_ns)
        paddles, lift = MOVES.get(number, (None, None))
        if paddles is not None:
            self.paddles.go(paddles, now)
        if lift is not None:
            self.lift.go(lift, now)

    def state(self, now: Nanos) -> GripperState:
        """Return the bits of this moment (H8 manual, table 11)."""
        if not self.kind:
            return GripperState(0)
        paddles, lift = self.paddles, self.lift
        closed = paddles.at(now) == PADDLES_NS
        grasps = self.has_thing and paddles.at(now) >= PADDLES_NS // 2
        found = GripperState(0)
        for holds, bit in (
            (paddles.at(now) > 0, GripperState.PADDLES_NOT_OPEN),
            (0 < lift.at(now) < LIFT_NS, GripperState.LIFT_NOT_AT_END),
            (not self.has_thing and not closed, GripperState.OUTER_BEAM_FREE),
            (not self.has_thing and not closed, GripperState.INNER_BEAM_FREE),
            (not grasps, GripperState.LEFT_PADDLE_FREE),
            (not grasps, GripperState.RIGHT_PADDLE_FREE),
            (lift.moving(now), GripperState.LIFT_MOVING),
            (paddles.moving(now) and not grasps, GripperState.GRIPPER_MOVING),
        ):
            if holds:
                found |= bit
        return found

    def packet(self, now: Nanos) -> GripperPacket:
        """Return the answer to GRIPREQUEST."""
        return GripperPacket(gripper_type=self.kind, state=int(self.state(now)), grasp_time=self.pressure & 0xFF)
