"""The speeds that are commanded: what is wanted, when it goes out, and whether the robot follows.

The mixer turns motor values or a pad into speeds, the pacer decides when a VEL+RVEL
pair goes out, the plausibility check compares the wheels with the command; the driver
joins the three. It holds no session state: the adapter calls it only while DRIVING.

Theory of operation
-------------------
Pacing. A change goes out at once, unless the last pair is nearer than
`pair_spacing_ns`: then the newest speeds wait for that boundary, and what they
overtake is never sent. Unchanged speeds go out again `refresh_ns` after the last
pair, for P2OS acknowledges nothing and a lost frame must not last.

Plausibility. The only feedback is the pair of wheel speeds in each SIP: a robot that
obeys is near its command, or comes nearer, or reports a stall. Each SIP that shows
one of the three passes the check; when none has for `plausibility_ns`, the robot's
motion is implausible. "Comes nearer" means that the larger error of the two wheels
fell by `progress_mm_s` below the least seen under this command. The larger one of
the two always shrinks while v and ω ramp towards their set-points together; the
smaller one need not. The least error can fall only so often, so a robot that merely
jitters does not pass for long.

Invariant: a new command buys no time; only a SIP that passes extends the deadline.
"""

from adapter_sim.codec import divide_half_away
from adapter_sim.mixing import STILL, CommandedSpeeds, Mixer
from adapter_sim.session import Session
from adapter_sim.settings import AdapterSettings
from p2os.protocol.commands import enable, rvel, vel
from p2os.protocol.sip import StandardSip
from p2os.robots.parameters import RobotParameters
from simbase.state import Stateful
from simbase.timing import NS_PER_S, Nanos

#: ENABLE 1 goes out with this many pairs: one frame may be lost. # chosen: not more, a person may switch the motors off
_ENABLES = 2


class Driver(Stateful):
    """Commands the robot's speeds and watches its wheels.

    Args:
        settings: Times, limits and meanings.
        parameters: The robot's own limits and conversions.
        full_steps: Steps of a motor value that a full duty stands for.
    """

    STATE = ("plausibility", "_pacer", "_enables_left")

    def __init__(self, settings: AdapterSettings, parameters: RobotParameters, *, full_steps: int) -> None:
        self.mixer = Mixer(
            settings,
            full_steps=full_steps,
            track_mm=parameters.track_mm,
            max_velocity_mm_s=min(parameters.max_velocity_mm_s, parameters.motion.max_velocity_mm_s),
            max_rotation_deg_s=min(parameters.max_rotation_deg_s, parameters.motion.max_rotation_deg_s),
        )
        self.plausibility = SpeedPlausibility(
            timeout_ns=settings.plausibility_ns,
            tolerance_mm_s=settings.plausibility_tolerance_mm_s,
            progress_mm_s=settings.plausibility_progress_mm_s,
        )
        self._pacer = CommandPacer(spacing_ns=settings.pair_spacing_ns, refresh_ns=settings.refresh_ns)
        self._velocity_um_s_per_count = parameters.velocity_um_s_per_count
        self._enables_left = 0

    @property
    def sent(self) -> CommandedSpeeds:
        """Return the speeds of the last pair."""
        return self._pacer.sent

    def begin(self, speeds: CommandedSpeeds, now: Nanos) -> None:
        """Start to drive: the first pair is due at once, the motors are enabled with it."""
        self._enables_left = _ENABLES
        self._pacer.begin(speeds)
        self.plausibility.begin(now)

    def stop(self) -> None:
        """Take standing still as wanted."""
        self._pacer.begin(STILL)

    def want(self, speeds: CommandedSpeeds) -> None:
        """Take the newest speeds."""
        self._pacer.wanted = speeds

    def pair_due_at(self, now: Nanos) -> Nanos:
        """Return when the next pair is due; `now` for at once."""
        return self._pacer.due_at(now)

    def send_pair(self, session: Session, now: Nanos) -> bool:
        """Send the newest speeds; tell whether they are new."""
        before, speeds = self._pacer.sent, self._pacer.take(now)
        if self._enables_left:
            self._enables_left -= 1
            session.send(enable(on=True), now)
        session.send(vel(speeds.forward_mm_s), now)
        session.send(rvel(speeds.turn_deg_s), now)
        self.plausibility.expect(*self.mixer.wheels_mm_s(speeds))
        return speeds != before

    def take(self, sip: StandardSip, now: Nanos) -> None:
        """Look at the wheels of a SIP."""
        conversion = self._velocity_um_s_per_count
        self.plausibility.take(
            divide_half_away(sip.raw_left_velocity * conversion, 1_000),
            divide_half_away(sip.raw_right_velocity * conversion, 1_000),
            stalled=sip.stall_left or sip.stall_right,
            now=now,
        )


class CommandPacer(Stateful):
    """The newest speeds, and when to send them."""

    STATE = ("wanted", "sent", "_sent_at")

    def __init__(self, *, spacing_ns: Nanos, refresh_ns: Nanos) -> None:
        self._spacing_ns = spacing_ns
        self._refresh_ns = refresh_ns
        self.wanted = STILL
        self.sent = STILL
        self._sent_at: Nanos | None = None

    def begin(self, speeds: CommandedSpeeds) -> None:
        """Start with a first pair that is due at once."""
        self.wanted = speeds
        self.sent = STILL
        self._sent_at = None

    def due_at(self, now: Nanos) -> Nanos:
        """Return when the next pair is due; `now` for at once."""
        if self._sent_at is None:
            return now
        if self.wanted != self.sent:
            return max(now, self._sent_at + self._spacing_ns)
        return self._sent_at + self._refresh_ns

    def take(self, now: Nanos) -> CommandedSpeeds:
        """Return the speeds to send at `now`, as sent."""
        self.sent = self.wanted
        self._sent_at = now
        return self.sent


class SpeedPlausibility(Stateful):
    """Compares the commanded wheel speeds with those of the SIPs, all in mm/s."""

    STATE = ("command", "measured", "_least_error", "_passed_at")

    def __init__(self, *, timeout_ns: Nanos, tolerance_mm_s: int, progress_mm_s: int) -> None:
        self._timeout_ns = timeout_ns
        self._tolerance_mm_s = tolerance_mm_s
        self._progress_mm_s = progress_mm_s
        self.command = (0, 0)
        self.measured = (0, 0)
        self._least_error = 0
        self._passed_at: Nanos = 0

    def begin(self, now: Nanos) -> None:
        """Start anew, with the wheels at rest."""
        self.command = (0, 0)
        self.measured = (0, 0)
        self._passed_at = now

    def expect(self, left_mm_s: int, right_mm_s: int) -> None:
        """Take a command that is being sent.

        A new one measures progress from where the wheels are now; it buys no
        time, or a firmware that changes its command often would hide a robot that does not follow.
        """
        if (left_mm_s, right_mm_s) != self.command:
            self.command = (left_mm_s, right_mm_s)
            self._least_error = self._error()

    def take(self, left_mm_s: int, right_mm_s: int, *, stalled: bool, now: Nanos) -> None:
        """Take the wheel speeds and stall flags of a SIP."""
        was_near = self._error() <= self._tolerance_mm_s
        self.measured = (left_mm_s, right_mm_s)
        error = self._error()
        if error <= self._tolerance_mm_s or stalled or error <= self._least_error - self._progress_mm_s:
            self._least_error = error
            self._passed_at = now
        elif was_near:
            # It has left its command by itself: its way back is measured from here.
            self._least_error = error

    @property
    def ends_at(self) -> Nanos:
        """Return when the motion becomes implausible unless a SIP passes before."""
        return self._passed_at + self._timeout_ns

    def describe(self) -> str:
        """Return what is implausible, for people."""
        return (
            f"wheels at {self.measured[0]} and {self.measured[1]} mm/s for {self._timeout_ns / NS_PER_S:.1f} s, "
            f"commanded {self.command[0]} and {self.command[1]}, and no stall flag"
        )

    def _error(self) -> int:
        return max(abs(self.command[0] - self.measured[0]), abs(self.command[1] - self.measured[1]))
