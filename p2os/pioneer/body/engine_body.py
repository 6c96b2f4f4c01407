"""What the bodies on a physics engine share: their state as it is read, stalls, and what the engine moves.

The engine's own state is one value, `engine_state`, that any process can take up; all that is
told of it here is worked out from poses and speeds that the engine gives.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from itertools import repeat
from typing import Any, ClassVar

from p2os.pioneer.body.contacts import ContactCounter
from p2os.pioneer.body.contract import FASTEST_MPS, BodyState, Turned, Wheels
from p2os.pioneer.body.in_world import DT_S, BodyInWorld, WorldScene
from p2os.pioneer.body.physical import (
    BACK_DRIVE,
    PUSHED_BACK_MPS,
    PUSHED_M,
    STALL_RIM_MPS,
    STALL_STEPS,
    STALL_TORQUE_SHARE,
    UNPOWERED_SHARE,
)
from p2os.pioneer.body.rim_work import mean_magnitude
from p2os.pioneer.sonar.ring import Cone, reading
from p2os.pioneer.world.model import Obstacle
from p2os.robots.parameters import RobotParameters

#: Farther than this from everything, contacts need not be looked for; looked again after so many steps otherwise.
FAR_M, LOOK_STEPS = 0.1, 50
#: No point of a hull that touches nothing gains speed faster, m/s². The tyres' friction gives the middle of the robot
#: at most 8, and the ends of the longest hull 15 more where it turns the robot (chosen: about twice the sum).
MOST_MPS2 = 50.0


class EngineScene(WorldScene):
    """Robots and things in one world of an engine."""

    bodies: "tuple[EngineBody, ...]"
    #: Whether something is driven on beside the level floor.
    is_uneven: bool

    def _count_step(self, setpoints: Sequence[tuple[float, float]]) -> None:
        """Begin a step of all robots with these rim-speed set-points; put what walks where it is by then."""
        for body, (left_mps, right_mps) in zip(self.bodies, setpoints, strict=True):
            body.count_step(left_mps, right_mps)
        first, *others = self.bodies
        for item in first.walk():
            self._put(item)
            for body in others:
                body.note_moved(item.name)


class EngineBody(BodyInWorld):
    """A differential drive with mass, torque limits and friction."""

    STATE: ClassVar[tuple[str, ...]] = ("_zero", "_stalling", "_is_held", "_is_at_rest", "_most_nm", "_rates")
    #: What is read from the engine, and what spares a look for contacts.
    DERIVED: ClassVar[tuple[str, ...]] = ("_state", "_is_grip_changed", "_fan", "_fan_rays", "_alone", "_look_in",
                                          "_is_busy")  # fmt: skip

    #: What prepares the rays of some cones: (cones, height of their plane, longest range), metres.
    _rays_of: ClassVar[Callable[..., Any]]
    #: Angles of the wheels when it was reset.
    _zero: tuple[float, ...]
    scene: "EngineScene"

    def __init__(self, scene: EngineScene, parameters: RobotParameters, number: int) -> None:
        super().__init__(scene, parameters, number)
        self._radius_m = parameters.body.wheel_diameter_m / 2
        self._straining_nm = STALL_TORQUE_SHARE * parameters.body.motor_torque_nm
        self._slow_radps = STALL_RIM_MPS / self._radius_m
        self._state: BodyState | None = None
        #: Steps for which nothing can touch the robot, and steps until that is looked at again.
        self._alone, self._look_in = 0, 0
        #: Whether things around it move, or floors rise, so that nothing is known of the next steps.
        self._is_busy = True
        #: Whether a wheel has come to rest or moves again, is held or free again, since its motor was told anything.
        self._is_grip_changed = True
        self._torque_nm = parameters.body.motor_torque_nm
        self._stalling = [0, 0]
        #: The wheels' rates after the last step, rad/s.
        self._rates = [0.0, 0.0]
        #: What drives each wheel to its set-point at most, where somebody says so for each step.
        self._most_nm: tuple[float, float] | None = None
        #: Wheels that something would turn back against their motor, and that the gear's friction holds.
        self._is_held = [False, False]
        #: Wheels that have come to rest since their set-point is 0: they are held, as hard as the gear allows.
        self._is_at_rest = [False, False]
        #: The fan of rays that was cast last, prepared.
        self._fan: tuple[Cone, float] | None = None

    def _restored(self) -> None:
        super()._restored()
        self._state, self._is_grip_changed = None, True

    @property
    def state(self) -> BodyState:
        """The state after the last step, read from the engine when it is asked for."""
        if self._state is None:
            self._state = self._read()
        return self._state

    def steps_within(self, turn_rad: float, rim_mps: float) -> int:  # noqa: ARG002  # the contract's
        """Return 0: what pushes the robot turns its wheels too."""
        return 0

    def step(self, left_mps: float, right_mps: float) -> Turned:
        """Move on by one step with these rim-speed set-points; see `RobotBody`."""
        if self.others or self._walking:
            return super().step(left_mps, right_mps)
        return self._step_alone(((left_mps, right_mps),))[0]

    def hold(self, left_mps: float, right_mps: float, steps: int) -> Sequence[Wheels]:
        """Make so many steps with these set-points; see `RobotBody`."""
        if self.others or self._walking:
            return super().hold(left_mps, right_mps, steps)
        return self._step_alone(repeat((left_mps, right_mps), steps))

    def ramp(self, setpoints: Sequence[tuple[float, float]]) -> Sequence[Wheels]:
        """Make a step with each of these set-points; see `RobotBody`."""
        if self.others or self._walking:
            return super().ramp(setpoints)
        return self._step_alone(setpoints)

    def clearance(self, *, no_more_than: float = math.inf) -> float:
        """Return the plan-view distance from the hull to the nearest thing that it could touch, metres, or that."""
        state = self.state
        self._tell_plan()
        free = self._plan.clearance(state.x_m, state.y_m, state.heading_rad, no_more_than=no_more_than)
        return self._nearest_robot(free)

    def limit_torques(self, left_nm: float, right_nm: float) -> None:
        """Have the next step drive the wheels to their set-points with no more; the gear holds nothing by itself."""
        self._most_nm = left_nm, right_nm

    def _count_anew(self) -> None:
        """Begin to count contacts and stalls."""
        self._contacts = ContactCounter()
        self._is_held, self._is_at_rest, self._is_grip_changed = [False, False], [False, False], True
        self._halt()

    def _halt(self) -> None:
        """Take notice that the wheels were made to stand, by no work of their motors."""
        self._stalling, self._rates = [0, 0], [0.0, 0.0]
        self._state = None

    def _watch_motor(self, wheel: int, asked_mps: float, effort_nm: float, rate_radps: float) -> None:
        """Add a wheel's work, count for how many steps its motor is stalled; see whether the gear holds it from now on.

        Args:
            wheel: 0 left, 1 right.
            asked_mps: Its set-point.
            effort_nm: What its motor and gear gave in the last step, positive forward.
            rate_radps: Its rate since.
        """
        rates, is_at_rest, is_held = self._rates, self._is_at_rest, self._is_held
        was, rates[wheel] = rates[wheel], rate_radps
        self._rim_work_j += abs(effort_nm) * mean_magnitude(was, rate_radps) * DT_S
        if self._most_nm is not None:
            is_straining = self._most_nm[wheel] > 0.0 and abs(effort_nm) > STALL_TORQUE_SHARE * self._most_nm[wheel]
            is_stalled = asked_mps != 0.0 and is_straining and abs(rate_radps) < self._slow_radps
            self._stalling[wheel] = min(STALL_STEPS, self._stalling[wheel] + 1) if is_stalled else 0
            return
        is_resting = asked_mps == 0.0 and (is_at_rest[wheel] or abs(rate_radps) * self._radius_m < PUSHED_BACK_MPS)
        if is_resting is not is_at_rest[wheel]:
            is_at_rest[wheel], self._is_grip_changed = is_resting, True
        if -self._straining_nm <= effort_nm <= self._straining_nm and not is_held[wheel]:
            self._stalling[wheel] = 0
            return
        forward = math.copysign(1.0, asked_mps)
        if is_held[wheel]:
            holds = asked_mps != 0.0 and effort_nm * forward > self._torque_nm
        else:
            is_pushed_back = asked_mps != 0.0 and rate_radps * forward * self._radius_m < -PUSHED_BACK_MPS
            holds = is_pushed_back and effort_nm * forward > self._straining_nm
        if holds is not is_held[wheel]:
            is_held[wheel], self._is_grip_changed = holds, True
        is_straining = holds or abs(effort_nm) > self._straining_nm
        is_stalled = is_straining and abs(rate_radps) < self._slow_radps
        self._stalling[wheel] = min(STALL_STEPS, self._stalling[wheel] + 1) if is_stalled else 0

    @property
    def _stalled(self) -> tuple[bool, bool]:
        left, right = self._stalling
        return left >= STALL_STEPS, right >= STALL_STEPS

    def _motor(self, wheel: int, asked_mps: float) -> tuple[float, float]:
        """Return the rate that a wheel is driven to, rad/s, and the greatest torque for it, Nm.

        A wheel that is held stands, until what pushes it back has become less than what its motor gives. One that
        rests at a set-point of 0 is held so too; without power, by the friction of motor and gear.
        """
        if self._most_nm is not None:
            return asked_mps / self._radius_m, self._most_nm[wheel]
        if self._is_at_rest[wheel] and asked_mps == 0.0:
            return 0.0, self._torque_nm * (BACK_DRIVE if self.is_powered else UNPOWERED_SHARE)
        if self._is_held[wheel] and asked_mps != 0.0:
            return 0.0, self._torque_nm * BACK_DRIVE
        return asked_mps / self._radius_m, self._torque_nm

    def _look_around(self) -> None:
        """Find for how many steps nothing can touch the robot, so that contacts need not be asked for."""
        self._look_in -= 1
        if self._look_in > 0 or self._contacts.touching or self._is_busy:
            return
        self._look_in = LOOK_STEPS
        state = self.state
        free = self._nearest_robot(self._plan.clearance(state.x_m, state.y_m, state.heading_rad, no_more_than=2.0))
        if free > FAR_M:
            way_m = free - FAR_M / 2
            if self.others:
                self._alone = int(way_m / (2 * FASTEST_MPS * DT_S))
            else:
                now_mps = abs(state.forward_mps) + abs(state.turn_radps) * self.reach_m
                gaining_s = (math.sqrt(now_mps**2 + 2 * MOST_MPS2 * way_m) - now_mps) / MOST_MPS2
                self._alone = int(max(gaining_s, way_m / FASTEST_MPS) / DT_S)
            self._look_in = 0

    def look_anew(self) -> None:
        """Look for contacts anew: something else is around the robot now."""
        self._alone, self._look_in = 0, 0
        self._is_busy = (
            self.scene.is_uneven
            or bool(self._walking)
            or any(item.mass_kg > 0 or item.kind.is_driven_on for item in self._plan.obstacles)
        )

    def read_anew(self) -> None:
        """Forget the state that was read while robots of the scene took their step one after the other."""
        self._state = None

    def walk(self) -> list[Obstacle]:
        """Return everything that walks where it is by now; the plan learns of it when it is asked."""
        found = []
        for name, pose in self._walked():
            found.append(self._plan.find(name).standing_at(*pose))
            self.note_moved(name)
        return found

    def _tell_plan(self) -> None:
        for name, pose in self._walked():
            self._plan.move(name, *pose)
        for item in self._plan.obstacles:
            if item.mass_kg > 0:
                x, y, m = self._where_is(item.name)
                if math.dist((x, y), (item.x_m, item.y_m)) > PUSHED_M:
                    self._plan.move(item.name, x, y, math.atan2(m[3], m[0]))
                    self.note_moved(item.name)

    def _note_touched(self, name: str | None, x_m: float, y_m: float) -> None:
        """Remember a collision; what the engine has no name for is found by its place."""
        if name is None:
            self._tell_plan()
            name = self._plan.thing_at(x_m, y_m)
        self._note_hit(name, x_m, y_m)

    def _state_of(
        self, place: tuple[float, float, float], turn: Sequence[float], wheels: Sequence[tuple[float, float]],
        velocity: tuple[float, float], turn_radps: float,
    ) -> BodyState:  # fmt: skip
        """Return the engine's state as ours.

        Args:
            place: Of the robot's frame, metres.
            turn: The same as nine numbers, row by row.
            wheels: Angle and rate of the left and the right wheel, rad and rad/s.
            velocity: Along x and y of the world, m/s.
            turn_radps: Rate of turn, counter-clockwise.
        """
        x, y, z = place
        (left, left_rate), (right, right_rate) = wheels
        heading = math.atan2(turn[3], turn[0])
        stalled_left, stalled_right = self._stalled
        return BodyState(
            x_m=x,
            y_m=y,
            z_m=z,
            heading_rad=heading,
            pitch_rad=math.asin(max(-1.0, min(1.0, turn[6]))),
            left_angle_rad=left - self._zero[0],
            right_angle_rad=right - self._zero[1],
            left_speed_mps=left_rate * self._radius_m,
            right_speed_mps=right_rate * self._radius_m,
            forward_mps=velocity[0] * math.cos(heading) + velocity[1] * math.sin(heading),
            turn_radps=turn_radps,
            stalled_left=stalled_left,
            stalled_right=stalled_right,
            collisions=self._contacts.collisions,
            in_contact=self._contacts.touching,
            contact_rad=self._contacts.bearing_rad(x, y, heading),
            rim_work_j=self._rim_work_j,
        )

    def _readings(self, numbers: Sequence[int], found: Sequence[float]) -> list[float]:
        """Return what some sonar read whose rays have met the world this near, other robots before it."""
        if self.others:
            longest = self._parameters.sonar_range_m
            found = [
                min(nearest, *self._robot_ranges(self._cones[number], longest))
                for number, nearest in zip(numbers, found, strict=True)
            ]
        return [reading(nearest, self._parameters) for nearest in found]

    def scan(self, fan: Cone, longest_m: float) -> list[float]:
        """Return how far each ray of a fan goes, metres; the rays tilt with the body."""
        if (fan, longest_m) != self._fan:
            self._fan = (fan, longest_m)
            self._fan_rays = self._rays_of((fan,), self._parameters.sonar_height_m, longest_m)
        met = self._cast_fan(self._fan_rays)
        return list(map(min, met, self._robot_ranges(fan, longest_m))) if self.others else met

    # What the engine tells -------------------------------------------------------------------

    def count_step(self, left_mps: float, right_mps: float) -> None:
        """Begin a step with these rim-speed set-points."""
        raise NotImplementedError

    def _step_alone(self, setpoints: Iterable[tuple[float, float]]) -> list[Turned]:
        """Make the steps that its scene would make, where nobody else moves in it."""
        raise NotImplementedError

    def _read(self) -> BodyState:
        """Return the state as the engine has it now."""
        raise NotImplementedError

    def _where_is(self, name: str) -> tuple[float, float, Sequence[float]]:
        """Return where a thing that can be pushed is: x, y, and its turn as nine numbers."""
        raise NotImplementedError

    def _cast_fan(self, rays: Any) -> list[float]:
        """Return how far each of the rays that `_rays_of` has prepared goes, metres."""
        raise NotImplementedError
