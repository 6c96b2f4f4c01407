"""The wheels' absolute codes, out of the robot's odometry: SIP to travel, travel to counts, counts to pins.

Not here: noise, slip or the true pose; the codes show what the robot itself reports.

Theory of operation
-------------------
Travel. The wire carries x and y (15 bits, counts of DistConvFactor) and a heading (4096
counts a turn). Between two packets the robot moved along a chord; its signed
projection on the mean heading, lengthened to the arc, is the forward step. The
wheels' travels follow: forward ∓ heading × track / 2.

What keeps the errors from adding up:
- The heading part is taken from the whole unwrapped heading, never summed, so
  its error stays one count for ever (0.27 mm at the rim for the 2-DX).
- The forward part is summed in counts × 2^30, an exact integer: no remainder is
  ever dropped. The rounding of x and y to counts enters each chord twice with
  opposite signs; what is left is a count × the angle turned meanwhile, that is
  at most about 0.6 mm for each radian turned, and in practice a random walk.
- Chord to arc: × (1 + Δh² / 24). Without it a robot that always circles would
  lose 0.1 % of its way.

A step too long for any wheel (after SETO, or a robot that was reset) is no
travel: it becomes the new reference and is counted.

Codes. They walk: at most one code each `encoder_dwell_ns`, so that a program that
polls never sees a jump, not even when packets were lost and the wheels have
turned meanwhile. A new adapter begins at the codes that its wires show before it
drives them. They are absolute: neither a session's end nor a reset forgets where
the wheels stand, and travel is kept whole, not only its code. What the wheels turn
while no session is open is reported by nobody, and so not shown.

Invariant: integers only; all shifts are floor shifts of signed integers of 64 bits
or less, so the C++ twin computes the same.
"""

import math
from dataclasses import dataclass

from adapter_sim.codec import divide_half_away, encoder_count
from adapter_sim.settings import AdapterSettings, EncoderAtOpen
from p2os.protocol.odometry import POSITION_MODULUS, Unwrapper
from p2os.protocol.sip import StandardSip
from p2os.robots.parameters import RobotParameters
from simbase.state import Stateful
from simbase.timing import Nanos

#: Headings on the wire: counts a turn.
HEADING_MODULUS = 1 << 12
#: The mean of two headings needs half a count.
HALF_COUNTS = 2 * HEADING_MODULUS
_QUARTER = HALF_COUNTS // 4
#: One, in the fixed point of the sine table.
ONE_BITS = 30
#: (2π/4096)² / 24 in 2^-40: the arc's excess over its chord for one squared count of turn.
_ARC_BITS = 40
_ARC_E40 = 107_802
#: Beyond a quarter of a turn between two packets the arc is unknown: the chord is taken.
_MOST_TURN = HEADING_MODULUS // 4
#: π in 1e-9, for the wheel's circumference and the heading's rim travel.
PI_E9 = 3_141_592_654

#: sin of a quarter turn in half counts, × 2^30, rounded; a test shows that no entry is near a tie.
_SINE = tuple(round(math.sin(math.pi * k / (2 * _QUARTER)) * (1 << ONE_BITS)) for k in range(_QUARTER + 1))


class WheelCodes(Stateful):
    """What both wheels have turned since power came, and what of it stands on the pins.

    Args:
        settings: Dwell, and where the codes stand when a session opens.
        parameters: The robot's lengths.
        width: Wires of an encoder.
        released: The codes that the wires show before anybody drives them, left first: what is begun with.
    """

    STATE = ("encoders", "_walks")

    def __init__(
        self, settings: AdapterSettings, parameters: RobotParameters, width: int, released: tuple[int, int] = (0, 0)
    ) -> None:
        self.encoders = Encoders(EncoderGeometry.of(parameters, settings.liveness_ns), width)
        self.encoders.begin(self.encoders.geometry.travel_nm_at(released, width))
        self._at_open = settings.encoder_at_open
        self._heading_scale = HEADING_MODULUS // parameters.angle_counts_per_turn
        self._walks = (
            CodeWalk(settings.encoder_dwell_ns, released[0]), CodeWalk(settings.encoder_dwell_ns, released[1]),
        )  # fmt: skip

    @property
    def counts(self) -> tuple[int, int]:
        """Return the encoder steps of both wheels, left first."""
        return self.encoders.counts

    @property
    def shown(self) -> tuple[int, int]:
        """Return the counts whose codes stand on the pins."""
        return self._walks[0].shown, self._walks[1].shown

    def open(self) -> None:
        """Begin with a session's first packet."""
        if self._at_open is EncoderAtOpen.ZERO:
            for walk in self._walks:
                walk.rebase(1 << self.encoders.width)
            self.encoders.begin()
        else:
            self.encoders.begin(self.encoders.travel_nm)

    def reset(self) -> None:
        """Forget all but where the wheels and their codes stand."""
        self.encoders.begin(self.encoders.travel_nm)
        self.encoders.jumps = 0
        for walk in self._walks:
            walk.reset()

    def take(self, sip: StandardSip) -> bool:
        """Add the odometry of a SIP; tell whether it is a plausible step."""
        return self.encoders.take(sip.raw_x, sip.raw_y, sip.raw_heading * self._heading_scale)

    def due_at(self, now: Nanos) -> list[Nanos | None]:
        """Return when each encoder's next step is due, None where it has arrived."""
        return [walk.due_at(target, now) for walk, target in zip(self._walks, self.counts, strict=True)]

    def walk(self, now: Nanos) -> tuple[int, int]:
        """Take the steps that are due; return the counts to show."""
        for walk, target in zip(self._walks, self.counts, strict=True):
            walk.step(target, now)
        return self.shown


@dataclass(frozen=True, slots=True, kw_only=True)
class EncoderGeometry:
    """The lengths that the encoders need, in integers."""

    distance_nm_per_count: int
    track_mm: int
    wheel_diameter_um: int
    #: Longest plausible step between two packets.
    longest_step_um: int

    @classmethod
    def of(cls, parameters: RobotParameters, longest_gap_ns: Nanos) -> "EncoderGeometry":
        """Return a robot's lengths; a step may be as long as its top speed makes in the longest gap."""
        return cls(
            distance_nm_per_count=parameters.distance_nm_per_count,
            track_mm=parameters.track_mm,
            wheel_diameter_um=round(parameters.body.wheel_diameter_m * 10**6),
            # mm/s × ns are 1e-9 mm, that is 1e-6 µm.
            longest_step_um=parameters.max_velocity_mm_s * longest_gap_ns // 10**6,
        )

    def travel_nm_at(self, counts: tuple[int, int], width: int) -> tuple[int, int]:
        """Return how far both wheels have rolled where these counts begin; whole µm, for what is kept has no finer."""
        left, right = (-(-count * self.circumference_nm // (1_000 << width)) * 1_000 for count in counts)
        return left, right

    @property
    def circumference_nm(self) -> int:
        """Return the way of one turn of a wheel."""
        return divide_half_away(self.wheel_diameter_um * PI_E9, 10**6)


class Encoders(Stateful):
    """Both wheels' travel since the reference was taken."""

    STATE = ("_x", "_y", "_turn", "_raw_heading", "_heading", "_forward", "_offset_nm", "jumps")
    DERIVED = ("_counts",)

    def __init__(self, geometry: EncoderGeometry, width: int) -> None:
        self.geometry = geometry
        self.width = width
        self._per_turn_nm = geometry.circumference_nm
        self._longest_counts = geometry.longest_step_um * 1_000 // geometry.distance_nm_per_count
        self._rim_per_turn_nm = divide_half_away(geometry.track_mm * PI_E9, 1_000)
        self._x = Unwrapper(POSITION_MODULUS)
        self._y = Unwrapper(POSITION_MODULUS)
        self._turn = Unwrapper(HEADING_MODULUS)
        #: Heading of the last packet as on the wire, None before the first.
        self._raw_heading: int | None = None
        #: Turn and way since the reference, in heading counts and in counts × 2^30.
        self._heading = 0
        self._forward = 0
        #: Travel at which this session began, (left, right) in nm.
        self._offset_nm = (0, 0)
        #: Steps that no wheel can have made.
        self.jumps = 0
        #: What `counts` returns, asked several times a packet; None: not worked out.
        self._counts: tuple[int, int] | None = None

    @property
    def travel_nm(self) -> tuple[int, int]:
        """Return how far the left and the right rim have rolled, + forward."""
        whole, part = self._forward >> ONE_BITS, self._forward & ((1 << ONE_BITS) - 1)
        per_count = self.geometry.distance_nm_per_count
        forward_nm = whole * per_count + (part * per_count >> ONE_BITS)
        # One turn of the robot rolls each rim by π × track; whole turns apart, so that 64 bits last for ever.
        turns, counts = self._heading // HEADING_MODULUS, self._heading % HEADING_MODULUS
        rim_nm = turns * self._rim_per_turn_nm + divide_half_away(counts * self._rim_per_turn_nm, HEADING_MODULUS)
        return self._offset_nm[0] + forward_nm - rim_nm, self._offset_nm[1] + forward_nm + rim_nm

    @property
    def counts(self) -> tuple[int, int]:
        """Return the encoder steps of both wheels, by floor, unwrapped."""
        if self._counts is None:
            left_nm, right_nm = self.travel_nm
            self._counts = (
                encoder_count(left_nm, self._per_turn_nm, self.width),
                encoder_count(right_nm, self._per_turn_nm, self.width),
            )
        return self._counts

    def _restored(self) -> None:
        self._counts = None

    def begin(self, travel_nm: tuple[int, int] = (0, 0)) -> None:
        """Start anew at this travel; the next packet is the reference."""
        for counter in (self._x, self._y, self._turn):
            counter.forget()
        self._raw_heading = None
        self._heading = 0
        self._forward = 0
        self._offset_nm = travel_nm
        self._counts = None

    def take(self, raw_x: int, raw_y: int, raw_heading: int) -> bool:
        """Add the odometry of a packet; tell whether it is a plausible step."""
        dx, dy, turn = self._x.update(raw_x), self._y.update(raw_y), self._turn.update(raw_heading)
        before, self._raw_heading = self._raw_heading, raw_heading % HEADING_MODULUS
        if before is None:
            return True
        if max(abs(dx), abs(dy)) > self._longest_counts:
            self.jumps += 1
            return False
        self._forward += forward_step(dx, dy, before, before + turn)
        self._heading += turn
        self._counts = None
        return True


class CodeWalk(Stateful):
    """One encoder's count on its way to a target."""

    STATE = ("shown", "_stepped_at")

    def __init__(self, dwell_ns: Nanos, shown: int = 0) -> None:
        self._dwell_ns = dwell_ns
        self.shown = shown
        self._stepped_at: Nanos | None = None

    def due_at(self, target: int, now: Nanos) -> Nanos | None:
        """Return when the next step towards the target is due, None where it is reached."""
        if self.shown == target:
            return None
        return now if self._stepped_at is None else max(now, self._stepped_at + self._dwell_ns)

    def step(self, target: int, now: Nanos) -> None:
        """Take a step if one is due."""
        if self.due_at(target, now) == now:
            self.shown += 1 if target > self.shown else -1
            self._stepped_at = now

    def rebase(self, steps: int) -> None:
        """Name the same code by its count nearest to 0."""
        self.shown = (self.shown + steps // 2) % steps - steps // 2

    def reset(self) -> None:
        """Forget when the last step was; the code stays."""
        self._stepped_at = None


def sine(half_counts: int) -> int:
    """Return the sine × 2^30 of an angle in 8192nds of a turn."""
    quadrant, within = divmod(half_counts % HALF_COUNTS, _QUARTER)
    if quadrant & 1:
        within = _QUARTER - within
    value = _SINE[within]
    return -value if quadrant & 2 else value


def forward_step(dx: int, dy: int, heading_before: int, heading_after: int) -> int:
    """Return the signed length of a step along its mean heading, in counts × 2^30.

    Args:
        dx: Step in x, in counts.
        dy: Step in y, in counts.
        heading_before: Unwrapped heading in counts before the step.
        heading_after: The same after it.
    """
    mean = heading_before + heading_after
    chord = dx * sine(mean + _QUARTER) + dy * sine(mean)
    turn = heading_after - heading_before
    if abs(turn) > _MOST_TURN:
        return chord
    return chord + ((chord >> 20) * (turn * turn * _ARC_E40) >> (_ARC_BITS - 20))
