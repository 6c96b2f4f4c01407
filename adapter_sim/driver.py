"""The speeds that are commanded: what is wanted, when it is said, and whether it is done.

The mixer turns wishes into speeds, the pacer says when a VEL+RVEL pair goes out,
the belief watches the wheels. This joins the three.
"""

from typing import TypeAlias

from adapter_sim.belief import Belief, BeliefSnapshot
from adapter_sim.codec import divide_half_away
from adapter_sim.mixing import STILL, Mixer, Speeds
from adapter_sim.pacing import Pacer, PacerSnapshot
from adapter_sim.session import Session
from adapter_sim.settings import AdapterSettings
from p2os.commands import enable, rvel, vel
from p2os.parameters import RobotParameters
from p2os.sip import StandardSip
from p2os.timing import Nanos

#: ENABLE 1 goes out with this many pairs: one frame may be lost. # chosen: not more, for a person may switch off
_ENABLES = 2

#: Belief, pacer, pairs before which ENABLE 1 is still to be said.
DriverSnapshot: TypeAlias = tuple[BeliefSnapshot, PacerSnapshot, int]


class Driver:
    """Commands the robot's speeds and watches its wheels.

    Args:
        settings: Times, limits and meanings.
        parameters: The robot's own limits and conversions.
    """

    def __init__(self, settings: AdapterSettings, parameters: RobotParameters) -> None:
        self.mixer = Mixer(
            settings,
            track_mm=parameters.track_mm,
            max_velocity_mm_s=min(parameters.max_velocity_mm_s, parameters.motion.max_velocity_mm_s),
            max_rotation_deg_s=min(parameters.max_rotation_deg_s, parameters.motion.max_rotation_deg_s),
        )
        self.belief = Belief(
            patience_ns=settings.disbelief_ns,
            tolerance_mm_s=settings.disbelief_tolerance_mm_s,
            progress_mm_s=settings.disbelief_progress_mm_s,
        )
        self._pacer = Pacer(spacing_ns=settings.pair_spacing_ns, refresh_ns=settings.refresh_ns)
        self._velocity_um_s_per_count = parameters.velocity_um_s_per_count
        self._enables_left = 0

    @property
    def sent(self) -> Speeds:
        """Return the speeds of the last pair."""
        return self._pacer.sent

    def begin(self, speeds: Speeds, now: Nanos) -> None:
        """Start to drive: the first pair is due at once, the motors are enabled with it."""
        self._enables_left = _ENABLES
        self._pacer.begin(speeds)
        self.belief.begin(now)

    def stop(self) -> None:
        """Want nothing any more."""
        self._pacer.begin(STILL)

    def reset(self, now: Nanos) -> None:
        """Forget everything."""
        self._enables_left = 0
        self.stop()
        self.belief.begin(now)

    def want(self, speeds: Speeds) -> None:
        """Take the newest speeds."""
        self._pacer.wanted = speeds

    def pair_due_at(self, now: Nanos) -> Nanos:
        """Return when the next pair is due; `now` for at once."""
        return self._pacer.due_at(now)

    def send_pair(self, session: Session, now: Nanos) -> bool:
        """Say the newest speeds; tell whether they are new."""
        before, speeds = self._pacer.sent, self._pacer.take(now)
        if self._enables_left:
            self._enables_left -= 1
            session.send(enable(on=True), now)
        session.send(vel(speeds.forward_mm_s), now)
        session.send(rvel(speeds.turn_deg_s), now)
        self.belief.expect(*self.mixer.wheels_mm_s(speeds))
        return speeds != before

    def take(self, sip: StandardSip, now: Nanos) -> None:
        """Look at the wheels of a SIP."""
        conversion = self._velocity_um_s_per_count
        self.belief.take(
            divide_half_away(sip.raw_left_velocity * conversion, 1_000),
            divide_half_away(sip.raw_right_velocity * conversion, 1_000),
            stalled=sip.stall_left or sip.stall_right,
            now=now,
        )

    def snapshot(self) -> DriverSnapshot:
        """Return all of it as plain values."""
        return self.belief.snapshot(), self._pacer.snapshot(), self._enables_left

    def restore(self, snapshot: DriverSnapshot) -> None:
        """Put back what `snapshot` returned."""
        self.belief.restore(snapshot[0])
        self._pacer.restore(snapshot[1])
        self._enables_left = snapshot[2]
