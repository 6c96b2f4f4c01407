"""The plant of mode A: a body with motors, encoders and distance sensors on wires.

The body is stepped at multiples of its dt from time 0, lazily: a step is made
when someone wants to know what is behind it. The motors' wires are read at the
start of each step, from the nets' history.

Its state log has what the motors are told, and when a wheel stalls or is free again (looked
at with the encoders); the body itself tells of collisions.

The chip need not wait for instants of the encoders at which no wheel can have come to another sector, which
the body knows: it is asked anew each time, for a thing that was placed may push it.

Invariant: at time t the body has made every step that ended at or before t.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from adapter_sim.codec import BitOrder
from adapter_sim.settings import MotorCommand
from p2os.pioneer.body.contract import RobotBody, Wheels
from p2os.robots.motor_step import STEP_UM_PER_S
from robot_bench.direct.distance import DistanceSensors
from robot_bench.direct.encoder import WheelEncoder
from robot_bench.direct.motor import JointMotor
from simbase.errors import UsageError
from simbase.state import Stateful
from simbase.timing import NS_PER_MS, Nanos, Reached

UM_PER_M = 1_000_000
#: (left, right wheel stalled) → what the state log says.
STALLS = {
    (False, False): ("freed", "both wheels turn as they are told"),
    (True, False): ("stalled", "left wheel"),
    (False, True): ("stalled", "right wheel"),
    (True, True): ("stalled", "both wheels"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class DirectSettings:
    """What a scenario can set of the parts of mode A."""

    step_um_per_s: int = STEP_UM_PER_S
    #: None lets the wheels jump to their speed, as a velocity joint without a torque limit does.
    ramp_um_per_s2: int | None = 300_000
    #: chosen: a ranging module at 20 Hz.
    sensor_period_ns: Nanos = 50 * NS_PER_MS
    #: chosen: ten times as often as the 100 Hz programs look at a wheel at full speed.
    encoder_period_ns: Nanos = 5 * NS_PER_MS
    motor_command: MotorCommand = MotorCommand.BITS
    bit_order: BitOrder = BitOrder.COMM3_MSB

    def __post_init__(self) -> None:
        for name in ("step_um_per_s", "sensor_period_ns", "encoder_period_ns"):
            if getattr(self, name) <= 0:
                raise UsageError(f"direct setting {name} must be above 0, got {getattr(self, name)}")


class DirectRobot(Stateful):
    """A body whose motors and sensors hang on wires."""

    STATE = ("body", "sensors", "_left", "_right", "_next_encoder", "_steps", "_asked", "_stalled")
    #: The wheels are those of the body's state.
    DERIVED = ("_wheels",)

    def __init__(
        self,
        body: RobotBody,
        *,
        left: JointMotor,
        right: JointMotor,
        encoders: tuple[WheelEncoder, WheelEncoder],
        sensors: DistanceSensors,
        sonar_numbers: Sequence[int],
        encoder_period_ns: Nanos,
    ) -> None:
        self.body = body
        self.sensors = sensors
        self._left, self._right = left, right
        self._left_encoder, self._right_encoder = encoders
        self._sonar_numbers = tuple(sonar_numbers)
        self._encoder_period_ns = encoder_period_ns
        self._next_encoder: Nanos = 0
        self._steps = 0
        self._asked = (0, 0)
        self._stalled = (False, False)
        #: After the last step; the body's whole state is worked out only for who asks for it.
        self._wheels: Wheels = body.state
        #: Takes a line of the state log: (ns, what, detail).
        self.on_event: Callable[[Nanos, str, str], None] | None = None

    def next_deadline(self) -> Nanos:
        """Return when a wire may change next."""
        return min(self._encoders_change_at(), self.sensors.next_deadline())

    def advance_to(self, limit: Nanos) -> Reached:
        """Step the body and set the wires as they are due."""
        while (due := self.sensors.next_deadline()) <= limit:
            self._step_to(due)
            self.sensors.sample(self.body.ranges(self._sonar_numbers), due)
        self._step_to(limit)
        return Reached(limit)

    def _encoders_change_at(self) -> Nanos:
        """Return the first instant of the encoders that a wheel may have come to another sector by."""
        wheels = self._wheels
        turn_rad = min(
            self._left_encoder.margin_rad(wheels.left_angle_rad), self._right_encoder.margin_rad(wheels.right_angle_rad)
        )
        # Until the next look of the sensors, which ends the wait in any case, the ramp allows no more.
        steps = max(1, self.sensors.next_deadline() // self.body.dt_ns - self._steps)
        fastest_um_per_s = max(self._left.fastest_um_per_s(steps), self._right.fastest_um_per_s(steps))
        steps = min(steps, self.body.steps_within(turn_rad, fastest_um_per_s / UM_PER_M))
        safe_until = (self._steps + steps) * self.body.dt_ns
        missed = max(0, -((self._next_encoder - safe_until) // self._encoder_period_ns))
        return self._next_encoder + missed * self._encoder_period_ns

    def _step_to(self, limit: Nanos) -> None:
        """Make every step that ends by then, and set the encoders' wires at each of their instants by then."""
        dt_ns, wanted = self.body.dt_ns, limit // self.body.dt_ns
        while self._steps < wanted:
            made = (self._wheels, *self._steps_made(wanted - self._steps))
            while (at := self._next_encoder) <= (self._steps + len(made) - 1) * dt_ns:
                self._show_encoders(made[at // dt_ns - self._steps], at)
            self._wheels, self._steps = made[-1], self._steps + len(made) - 1
        while self._next_encoder <= limit:
            self._show_encoders(self._wheels, self._next_encoder)

    def _steps_made(self, most: int) -> Sequence[Wheels]:
        """Make up to so many steps in which the wires say the same; return the wheels after each."""
        setpoints = [self.next_setpoints()]
        if self._left.is_steady and self._right.is_steady:
            return self.body.hold(*setpoints[0], most)
        while len(setpoints) < most and self._left.is_known and self._right.is_known:
            setpoints.append(self.next_setpoints(len(setpoints)))
        return self.body.ramp(setpoints)

    def next_setpoints(self, later: int = 0) -> tuple[float, float]:
        """Return the rim-speed set-points of the next step, m/s, or of one so many steps later, each asked for once."""
        start = (self._steps + later) * self.body.dt_ns
        speeds = self._left.step(start) / UM_PER_M, self._right.step(start) / UM_PER_M
        if (self._left.asked, self._right.asked) != self._asked:
            self._asked = self._left.asked, self._right.asked
            self._tell(start, "command", f"motors {self._asked[0]}, {self._asked[1]}")
        return speeds

    def take_step(self, wheels: Wheels) -> None:
        """Take the wheels after a step that was made with `next_setpoints`."""
        self._steps += 1
        self._wheels = wheels

    def _show_encoders(self, wheels: Wheels, now: Nanos) -> None:
        self._left_encoder.show(wheels.left_angle_rad, now)
        self._right_encoder.show(wheels.right_angle_rad, now)
        self._next_encoder = now + self._encoder_period_ns
        stalled = (wheels.stalled_left, wheels.stalled_right)
        if stalled != self._stalled:
            self._stalled = stalled
            self._tell(now, *STALLS[stalled])

    def _restored(self) -> None:
        self._left_encoder.forget()
        self._right_encoder.forget()
        self._wheels = self.body.state

    def _tell(self, at: Nanos, what: str, detail: str) -> None:
        if self.on_event is not None:
            self.on_event(at, what, detail)
