"""Both encoders, from the robot's odometry to the codes on the pins.

Codes walk: at most one code each `encoder_dwell_ns`, so that a program that
polls never sees a jump, not even when packets were lost and the wheels have
turned meanwhile.
"""

from typing import TypeAlias

from adapter_sim.encoders import HEADING_MODULUS, EncoderGeometry, Encoders, EncoderSnapshot
from adapter_sim.settings import AdapterSettings, EncoderAtOpen
from p2os.parameters import RobotParameters
from p2os.sip import StandardSip
from p2os.timing import Nanos

#: Count shown, time of the last step or None.
WalkSnapshot: TypeAlias = tuple[int, Nanos | None]


class CodeWalk:
    """One encoder's count on its way to a target."""

    def __init__(self, dwell_ns: Nanos) -> None:
        self._dwell_ns = dwell_ns
        self.shown = 0
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
        """Stand at 0."""
        self.shown = 0
        self._stepped_at = None

    def snapshot(self) -> WalkSnapshot:
        """Return all of it as plain values."""
        return self.shown, self._stepped_at

    def restore(self, snapshot: WalkSnapshot) -> None:
        """Put back what `snapshot` returned."""
        self.shown, self._stepped_at = snapshot


class WheelCodes:
    """What both wheels have turned since OPEN, and what of it stands on the pins.

    Args:
        settings: Dwell, and where the codes stand when a session opens.
        parameters: The robot's lengths.
        width: Wires of an encoder.
    """

    def __init__(self, settings: AdapterSettings, parameters: RobotParameters, width: int) -> None:
        self.encoders = Encoders(EncoderGeometry.of(parameters, settings.liveness_ns), width)
        self._at_open = settings.encoder_at_open
        self._heading_scale = HEADING_MODULUS // parameters.angle_counts_per_turn
        self._walks = (CodeWalk(settings.encoder_dwell_ns), CodeWalk(settings.encoder_dwell_ns))

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
            self.encoders.begin(self.shown)

    def reset(self) -> None:
        """Forget everything."""
        self.encoders.begin()
        self.encoders.jumps = 0
        for walk in self._walks:
            walk.reset()

    def take(self, sip: StandardSip) -> bool:
        """Add the odometry of a SIP; tell whether it could be believed as a step."""
        return self.encoders.take(sip.raw_x, sip.raw_y, sip.raw_heading * self._heading_scale)

    def due_at(self, now: Nanos) -> list[Nanos | None]:
        """Return when each encoder's next step is due, None where it has arrived."""
        return [walk.due_at(target, now) for walk, target in zip(self._walks, self.counts, strict=True)]

    def walk(self, now: Nanos) -> tuple[int, int]:
        """Take the steps that are due; return the counts to show."""
        for walk, target in zip(self._walks, self.counts, strict=True):
            walk.step(target, now)
        return self.shown

    def snapshot(self) -> tuple[EncoderSnapshot, tuple[WalkSnapshot, ...]]:
        """Return all of it as plain values."""
        return self.encoders.snapshot(), tuple(walk.snapshot() for walk in self._walks)

    def restore(self, snapshot: tuple[EncoderSnapshot, tuple[WalkSnapshot, ...]]) -> None:
        """Put back what `snapshot` returned."""
        self.encoders.restore(snapshot[0])
        for walk, saved in zip(self._walks, snapshot[1], strict=True):
            walk.restore(saved)
