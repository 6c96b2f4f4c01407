"""The differential robot as a part of the bench: bridges, motors and battery that move a body, and what it senses.

The body is stepped at multiples of its dt. When a step's time has passed, the bridges' wires are known over all of it:
volts, currents and speeds follow, and the body makes the step with the mean speeds of the wheels. So the drive acts
without delay, and what the encoders show of a step comes one step later.

A physical body (bullet, mujoco) is told each motor's torque and where that ends, and answers with how far its wheels
have turned: slopes, slip, walls and what is pushed act on the motors by that. The kinematic body takes speeds of the
rims, which the drive train works out with the robot's mass; a wheel that something holds, so that it turns more than a
tenth slower or faster than its motor, has its motor brought to its own speed. Either way a wheel that stands draws the
current of a stalled motor.

Invariant: at time t the body has made every step that ended at or before t.
"""

import math
from collections.abc import Callable, Sequence

from p2os.pioneer.body.contract import RobotBody, Wheels
from robot_bench.direct.differential.analog import DischargingBattery, volts_at
from robot_bench.direct.differential.bridge import HBridge, Shares
from robot_bench.direct.differential.description import SIDES, Differential
from robot_bench.direct.differential.drive_train import DriveTrain
from robot_bench.direct.differential.native import functions
from robot_bench.direct.differential.quadrature import OWNER, Quadrature
from robot_bench.direct.robot import STALLS
from robot_bench.direct.wired import AnalogPin
from robot_bench.wires.nets import Harness, Strength
from simbase.state import Stateful
from simbase.timing import NS_PER_S, Nanos, Reached

#: chosen: the kinematic body is told whole micrometres a second: a robot that stands at a wall while its battery falls
#: is told the same for many steps, and the body need not look again for a way.
SPEED_DIGITS = 6
#: chosen: a physical body's wheel that is slower than this trembles, and stands.
REST_RADPS = 1e-3
#: chosen: volts on a pin change by half of what the ADC tells apart, 3.3 V by 4096.
VOLTS_STEP = 4e-4
#: chosen: bumpers and stalls are looked at each 10 ms, as programs do.
LOOK_STEPS = 10


class DifferentialRobot(Stateful):
    """A body whose motors, encoders and sensors hang on the chip's pins.

    Args:
        robot: What it is.
        body: What moves.
        harness: Its wires, by their signals.
        analog_pin: Returns the chip's pin of an analog signal.
    """

    STATE = (
        "body", "train", "cell", "_encoders", "_bridges", "_steps", "_angles", "_next_distance", "_stalled",
        "_steps_of_volts", "_asked", "_stepped", "_driven",
    )  # fmt: skip

    def __init__(
        self, robot: Differential, body: RobotBody, harness: Harness, analog_pin: Callable[[str], AnalogPin]
    ) -> None:
        self.body = body
        self._robot = robot
        self._radius_m = robot.body.wheel_diameter_m / 2
        self._dt_s = body.dt_ns / NS_PER_S
        self.train = DriveTrain(robot, self._dt_s)
        self.cell = DischargingBattery(robot.battery)
        #: Tells a body that has the masses how hard its motors drive in the next step.
        self._torques: Callable[[float, float], None] | None = getattr(body, "limit_torques", None)
        self._bridges = tuple(
            HBridge([harness[f"{side}_{pin}"] for pin in robot.bridge.kind.pins], robot.bridge) for side in SIDES
        )
        per_turn = robot.encoder.edges_per_turn(robot.motor)
        self._encoders = tuple(Quadrature(harness[f"{side}_a"], harness[f"{side}_b"], per_turn) for side in SIDES)
        self._bumpers = [(harness[f"bumper_{one.name}"], one) for one in robot.bumpers]
        self._analog = {wire.name: analog_pin(wire.name) for wire in robot.signals if wire.is_analog}
        #: What is on the analog pins, in steps.
        self._steps_of_volts: dict[str, int] = {}
        self._steps = 0
        self._angles = (0.0, 0.0)
        #: Set once where a scene steps the body together with others'; it moves a step later then.
        self.is_stepped_by_others = False
        #: Speeds of the motors for the step that others make next, rad/s, and the angles after it, rad.
        self._asked = self._stepped = (0.0, 0.0)
        #: What the bridges did and the volts, of the step that others make next.
        self._driven: tuple[tuple[float, ...], tuple[float, ...], float] = ((0.0,) * 3, (0.0,) * 3, 0.0)
        self._next_distance: Nanos = 0
        self._stalled = (False, False)
        #: Takes a line of the state log: (ns, what, detail).
        self.on_event: Callable[[Nanos, str, str], None] | None = None
        #: Called with each look of the distance sensors: (ns, metres of each).
        self.on_ranges: Callable[[Nanos, Sequence[float]], None] | None = None
        for encoder in self._encoders:
            encoder.start()
        self._show(0)

    @property
    def currents_a(self) -> tuple[float, float]:
        """Mean currents of the windings in the last step, left and right, A."""
        return self.train.currents_a

    def next_deadline(self) -> Nanos:
        """Return when the step that is under way ends."""
        return (self._steps + 1) * self.body.dt_ns

    def advance_to(self, limit: Nanos) -> Reached:
        """Make every step that ends at or before `limit`."""
        while self.next_deadline() <= limit:
            self._step()
        return Reached(limit)

    def next_setpoints(self) -> tuple[float, float]:
        """Return the rim-speed set-points of the body's next step, m/s, for who steps it together with others."""
        return self._rims(*self._asked)

    def take_step(self, wheels: Wheels) -> None:
        """Take the wheels' angles after a step that was made with `next_setpoints`."""
        self._stepped = wheels.left_angle_rad, wheels.right_angle_rad

    def _step(self) -> None:
        body, cell, battery = self.body, self.cell, self._robot.battery
        begin, end = self._steps * body.dt_ns, (self._steps + 1) * body.dt_ns
        left, right = self._bridges
        left.take(begin, end)
        right.take(begin, end)
        turned_l, turned_r = self._drive() if self._torques is None else self._push(left.known, right.known)
        self._angles = turned_l, turned_r
        cell.give(self.train.struct.supply_a + battery.idle_current_a, self._dt_s)
        self._steps += 1
        self._encoders[0].turn_to(turned_l, end, body.dt_ns)
        self._encoders[1].turn_to(turned_r, end, body.dt_ns)
        self._show(end)

    def _drive(self) -> tuple[float, float]:
        """Make a step of a body that takes speeds; return the wheels' angles."""
        train, (left, right) = self.train, self._bridges
        functions().drive_begin(train.address, self.cell.address, left.address, right.address)
        made, (angle_l, angle_r) = train.struct, self._angles
        (asked_l, asked_r), turned_l, turned_r = self._turn(made.mean_left, made.mean_right)
        functions().drive_end(
            train.address, asked_l, asked_r, turned_l - angle_l, turned_r - angle_r, self._radius_m
        )  # fmt: skip
        return turned_l, turned_r

    def _push(self, left: Shares, right: Shares) -> tuple[float, float]:
        """Make a step of a body that has the masses and takes torques; return the same."""
        train, cell, battery = self.train, self.cell, self._robot.battery
        cell.volts = volts = train.supply_v(
            left, right, cell.source_v, battery.resistance_ohm, battery.idle_current_a
        )  # fmt: skip
        if self.is_stepped_by_others:
            # The step that is over was made with what the wires said in the one before.
            (was_left, was_right, was_volts), self._driven = self._driven, (tuple(left), tuple(right), volts)
            turned_l, turned_r = self._stepped
            real_l, real_r = self._real(turned_l, turned_r)
            train.take(Shares(*was_left), Shares(*was_right), was_volts, _or_rest(real_l), _or_rest(real_r))
            self._asked = self._aim(left, right, volts)
            return turned_l, turned_r
        _, turned_l, turned_r = self._turn(*self._aim(left, right, volts))
        real_l, real_r = self._real(turned_l, turned_r)
        train.take(left, right, volts, _or_rest(real_l), _or_rest(real_r))
        return turned_l, turned_r

    def _aim(self, left: Shares, right: Shares, volts: float) -> tuple[float, float]:
        """Tell the body how hard its motors drive; return where to, rad/s."""
        aim_l, aim_r = self.train.aims(left, right, volts)
        if self._torques is not None:
            self._torques(aim_l.torque_nm, aim_r.torque_nm)
        return aim_l.rate_radps, aim_r.rate_radps

    def _turn(self, left_radps: float, right_radps: float) -> tuple[tuple[float, float], float, float]:
        """Make a step; return the speeds that it was made with, and the wheels' angles after it."""
        if self.is_stepped_by_others:
            asked, self._asked = self._asked, (left_radps, right_radps)
            return asked, *self._stepped
        turned = self.body.step(*self._rims(left_radps, right_radps))
        return (left_radps, right_radps), turned.left_angle_rad, turned.right_angle_rad

    def _rims(self, left_radps: float, right_radps: float) -> tuple[float, float]:
        """Return the speeds of the rims, m/s."""
        left_mps, right_mps = left_radps * self._radius_m, right_radps * self._radius_m
        if self._torques is not None:
            return left_mps, right_mps
        return round(left_mps, SPEED_DIGITS), round(right_mps, SPEED_DIGITS)

    def _real(self, turned_l: float, turned_r: float) -> tuple[float, float]:
        """Return how fast the wheels have turned in a step, rad/s."""
        angle_l, angle_r = self._angles
        return (turned_l - angle_l) / self._dt_s, (turned_r - angle_r) / self._dt_s

    def _show(self, now: Nanos) -> None:
        """Show the sensors that are due."""
        self._put("battery", self.cell.volts * self._robot.battery.divider)
        if self._next_distance <= now and self._robot.distances:
            self._next_distance += self._robot.distance_period_ns
            measured = self.body.ranges(range(len(self._robot.distances)))
            for sensor, metres in zip(self._robot.distances, measured, strict=True):
                self._put(f"distance_{sensor.name}", volts_at(sensor.curve, metres))
            if self.on_ranges is not None:
                self.on_ranges(now, measured)
        if self._steps % LOOK_STEPS == 0:
            self._look(now)

    def _put(self, signal: str, volts: float) -> None:
        steps = round(volts / VOLTS_STEP)
        if self._steps_of_volts.get(signal) != steps:
            self._steps_of_volts[signal] = steps
            self._analog[signal].set_volts(steps * VOLTS_STEP)

    def _look(self, now: Nanos) -> None:
        state = self.body.state
        for net, bumper in self._bumpers:
            apart = math.remainder((state.contact_rad or 0.0) - math.radians(bumper.heading_deg), 2 * math.pi)
            is_pressed = state.in_contact and state.contact_rad is not None
            is_pressed = is_pressed and abs(apart) <= math.radians(bumper.width_deg) / 2
            if is_pressed:
                net.drive(OWNER, False, Strength.PUSH_PULL, now)
            else:
                net.release(OWNER, now)
        stalled = (state.stalled_left, state.stalled_right)
        if stalled != self._stalled:
            self._stalled = stalled
            if self.on_event is not None:
                self.on_event(now, *STALLS[stalled])


def _or_rest(radps: float) -> float:
    return 0.0 if abs(radps) < REST_RADPS else radps
