"""The motion of the controller: ramps, limits, modes, goals."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from p2os.pioneer.controller.motion import Motion, MotionLimits, SpeedMode
from simbase.timing import NS_PER_MS

LIMITS = MotionLimits(
    top_velocity_mm_s=2200,
    top_rotation_deg_s=500,
    max_velocity_mm_s=750,
    max_rotation_deg_s=150,
    accel_mm_s2=300,
    decel_mm_s2=600,
    rot_accel_deg_s2=100,
    rot_decel_deg_s2=200,
)
#: 1 deg/s turns the rim of a wheel on a 360/pi mm track at exactly 1 mm/s.
TRACK_MM = 357
RIM_MPS_PER_DEG_S = 357 * 3.141592653589793 / 360_000


def make(limits: MotionLimits = LIMITS) -> Motion:
    motion = Motion(limits, track_mm=TRACK_MM, dt_ns=NS_PER_MS)
    motion.power(on=True)
    return motion


def run(motion: Motion, steps: int) -> tuple[float, float]:
    for _ in range(steps):
        motion.step(0, 0)
    return motion.wheels_mps


def test_a_speed_is_reached_exactly_when_the_acceleration_says() -> None:
    motion = make()
    motion.set_velocity(300)
    # 300 mm/s at 300 mm/s² take 1000 steps of 1 ms.
    assert run(motion, 999) == (0.2997, 0.2997)
    assert run(motion, 1) == (0.3, 0.3)
    assert run(motion, 1) == (0.3, 0.3)


def test_slowing_down_uses_the_deceleration_and_ends_at_zero() -> None:
    motion = make()
    motion.set_velocity(300)
    run(motion, 1000)
    motion.stop()
    # 600 mm/s² take 500 steps.
    left, _ = run(motion, 499)
    assert abs(left - 0.0006) < 1e-12
    assert run(motion, 1) == (0.0, 0.0)
    assert motion.is_steady


def test_a_reversal_slows_down_first_and_then_speeds_up() -> None:
    motion = make()
    motion.set_velocity(300)
    run(motion, 1000)
    motion.set_velocity(-300)
    assert run(motion, 500) == (0.0, 0.0)
    assert run(motion, 999)[0] > -0.3
    assert run(motion, 1) == (-0.3, -0.3)


def test_a_reversal_from_backwards_mirrors_it() -> None:
    motion = make()
    motion.set_velocity(-300)
    run(motion, 1000)
    motion.set_velocity(300)
    assert run(motion, 500) == (0.0, 0.0)
    assert run(motion, 1000) == (0.3, 0.3)


def test_a_lower_speed_of_the_same_sign_is_approached_at_the_deceleration() -> None:
    motion = make()
    motion.set_velocity(-300)
    run(motion, 1000)
    motion.set_velocity(-150)
    assert run(motion, 249)[0] < -0.15
    assert run(motion, 1) == (-0.15, -0.15)


def test_turning_moves_the_wheels_apart_by_the_track() -> None:
    motion = make()
    motion.set_rotation(50)
    left, right = run(motion, 500)
    assert abs(right - 50 * RIM_MPS_PER_DEG_S) < 1e-12
    assert left == -right


def test_translation_and_rotation_are_ramped_separately() -> None:
    motion = make()
    motion.set_velocity(300)
    motion.set_rotation(50)
    left, right = run(motion, 500)  # half way up in translation, all the way in rotation
    assert abs((left + right) / 2 - 0.15) < 1e-12
    assert abs((right - left) / 2 - 50 * RIM_MPS_PER_DEG_S) < 1e-12


def test_a_speed_beyond_the_limit_is_cut() -> None:
    motion = make()
    motion.set_velocity(5000)
    assert run(motion, 5000) == (0.75, 0.75)
    motion.set_rotation(-5000)
    left, right = run(motion, 5000)
    assert abs((left - right) / 2 - 150 * RIM_MPS_PER_DEG_S) < 1e-9


def test_limits_are_set_by_magnitude_and_never_beyond_the_top() -> None:
    assert LIMITS.with_max_velocity(9999).max_velocity_mm_s == 2200
    assert LIMITS.with_max_velocity(-300).max_velocity_mm_s == 300
    assert LIMITS.with_max_rotation(9999).max_rotation_deg_s == 500
    assert LIMITS.with_acceleration(200).accel_mm_s2 == 200
    assert LIMITS.with_acceleration(-200).decel_mm_s2 == 200
    assert LIMITS.with_acceleration(0) is LIMITS
    assert LIMITS.with_rotational_acceleration(50).rot_accel_deg_s2 == 50
    assert LIMITS.with_rotational_acceleration(-50).rot_decel_deg_s2 == 50
    assert LIMITS.with_rotational_acceleration(0) is LIMITS


def test_wheel_speeds_cancel_translation_and_rotation_without_a_jump() -> None:
    motion = make()
    motion.set_velocity(300)
    motion.set_rotation(30)
    before = run(motion, 1000)
    motion.set_wheels(300, 300)
    assert motion.mode is SpeedMode.WHEELS
    after = run(motion, 1)
    assert all(abs(new - old) <= 0.0006 + 1e-9 for new, old in zip(after, before, strict=True))
    assert run(motion, 3000) == (0.3, 0.3)


def test_translation_cancels_wheel_speeds_without_a_jump() -> None:
    motion = make()
    motion.set_wheels(100, 200)
    assert run(motion, 1000) == (0.1, 0.2)
    motion.set_velocity(150)
    left, right = run(motion, 1)
    assert abs(left - 0.1) < 0.001
    assert abs(right - 0.2) < 0.001
    left, right = run(motion, 2000)
    assert (left, right) == (0.15, 0.15), "the rotation that VEL2 asked for is cancelled too"


def test_an_emergency_stop_ignores_the_ramp_and_forgets() -> None:
    motion = make()
    motion.set_velocity(300)
    run(motion, 1000)
    motion.stop_now()
    assert motion.wheels_mps == (0.0, 0.0)
    assert run(motion, 1000) == (0.0, 0.0)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_ramp_stands_at_zero_for_a_step_before_it_turns_round(sign: int) -> None:
    motion = make()
    motion.set_velocity(sign)
    assert run(motion, 4) == (sign * 0.001, sign * 0.001)
    motion.set_velocity(-sign)
    # 0.6 mm/s a step down, 0.3 mm/s a step up: what is left of a step at zero is not used.
    seen = [round(motion.step(0, 0)[0] * 1e4) * sign for _ in range(7)]
    assert seen == [4, 0, -3, -6, -9, -10, -10]


def test_two_wheel_speeds_of_arcos_are_their_mean_and_their_difference_each_within_its_limit() -> None:
    motion = make()
    motion.set_wheels_as_turn(100, 201)
    mode, translation, _, rotation, _ = motion.setpoints
    assert (mode, translation) == (SpeedMode.TRANSLATE_ROTATE, 150_500_000)
    assert rotation == round(50.5e6 / (RIM_MPS_PER_DEG_S * 1e3))
    motion.set_wheels_as_turn(-100, -201)
    assert motion.setpoints[1:4:2] == (-150_500_000, -rotation)  # type: ignore[operator]  # a number
    motion.set_wheels_as_turn(750, 751)
    assert motion.setpoints[1] == 750_000_000
    motion.set_wheels_as_turn(-750, 750)
    assert motion.setpoints[1:4:2] == (0, 150_000_000)


def test_the_speeds_of_two_wheels_go_on_as_mean_and_difference_where_the_mode_changes() -> None:
    motion = make()
    motion.set_wheels(100, 200)
    assert run(motion, 1000) == (0.1, 0.2)
    motion.set_velocity(150)
    left, right = run(motion, 1)
    slower = 0.2e-3 * RIM_MPS_PER_DEG_S * 1e3  # 200 deg/s² for 1 ms, at the rim
    assert (left, right) == (pytest.approx(0.1 + slower, abs=1e-8), pytest.approx(0.2 - slower, abs=1e-8))


def test_a_held_robot_slows_down_and_later_resumes() -> None:
    motion = make()
    motion.set_velocity(300)
    run(motion, 1000)
    motion.hold()
    assert run(motion, 499)[0] > 0
    assert run(motion, 1) == (0.0, 0.0)
    assert motion.is_steady
    motion.release()
    assert not motion.is_steady
    assert run(motion, 1000) == (0.3, 0.3)


def test_without_power_speeds_are_set_but_the_wheels_stand() -> None:
    motion = Motion(LIMITS, track_mm=TRACK_MM, dt_ns=NS_PER_MS)
    motion.set_velocity(300)
    assert run(motion, 1000) == (0.0, 0.0)
    assert motion.is_steady
    motion.power(on=True)
    assert run(motion, 1000) == (0.3, 0.3)
    motion.power(on=False)
    motion.power(on=True)
    assert run(motion, 1000) == (0.0, 0.0)


def drive(motion: Motion, steps: int) -> tuple[float, float]:
    """Run on a perfect body; returns the travel in mm and the turn in degrees."""
    travel_m = turn_rad = 0.0
    for _ in range(steps):
        left, right = motion.step(round(travel_m * 1e9), round(turn_rad * 180e6 / 3.141592653589793))
        travel_m += (left + right) / 2 * 1e-3
        turn_rad += (right - left) / (TRACK_MM / 1000) * 1e-3
    return travel_m * 1000, turn_rad * 180 / 3.141592653589793


def test_a_move_ends_where_it_should() -> None:
    motion = make()
    motion.move_to(1_000_000_000)
    travel, _ = drive(motion, 8000)
    assert abs(travel - 1000) < 4
    assert motion.is_steady


def test_a_turn_takes_the_shorter_way_and_ends_where_it_should() -> None:
    motion = make()
    motion.turn_to(270_000_000)
    _, turn = drive(motion, 8000)
    assert abs(turn + 90) < 1
    assert motion.is_steady


def test_a_goal_is_forgotten_when_a_speed_is_set_and_known_until_then() -> None:
    motion = make()
    assert motion.heading_goal_udeg is None
    motion.turn_to(90_000_000)
    assert motion.heading_goal_udeg == 90_000_000
    assert not motion.is_steady
    motion.set_rotation(0)
    assert motion.heading_goal_udeg is None
    motion.set_wheels(1, 1)
    assert motion.heading_goal_udeg is None


def test_a_held_goal_waits() -> None:
    motion = make()
    motion.turn_to(90_000_000)
    motion.hold()
    assert drive(motion, 1000)[1] == 0
    motion.release()
    assert abs(drive(motion, 8000)[1] - 90) < 1


SPEEDS = st.integers(-3000, 3000)


class MotionMachine(RuleBasedStateMachine):
    """Whatever is commanded, no wheel set-point jumps more than the ramps allow, and a snapshot repeats it."""

    @initialize()
    def begin(self) -> None:
        self.motion = make()
        self.before = self.motion.wheels_mps
        self.jumped = False

    @rule(mm_s=SPEEDS, deg_s=SPEEDS)
    def drive(self, mm_s: int, deg_s: int) -> None:
        self.motion.set_velocity(mm_s)
        self.motion.set_rotation(deg_s)

    @rule(left=SPEEDS, right=SPEEDS)
    def wheels(self, left: int, right: int) -> None:
        self.motion.set_wheels(left, right)

    @rule(goal=st.integers(-(10**9), 10**9))
    def goals(self, goal: int) -> None:
        self.motion.move_to(goal)
        self.motion.turn_to(goal)

    @rule()
    def stop(self) -> None:
        self.motion.stop()

    @rule(held=st.booleans())
    def hold(self, held: bool) -> None:
        (self.motion.hold if held else self.motion.release)()

    @rule()
    def emergency(self) -> None:
        self.motion.stop_now()
        self.jumped = True

    @rule(steps=st.integers(1, 300))
    def run(self, steps: int) -> None:
        saved = self.motion.snapshot()
        for _ in range(steps):
            before = self.before if not self.jumped else self.motion.wheels_mps
            self.before = self.motion.step(0, 0)
            self.jumped = False
            # The steepest ramps together: 0.6 mm/s of translation and 0.2 deg/s of rotation a step.
            bound = 0.0006 + 0.2 * RIM_MPS_PER_DEG_S + 1e-8
            assert all(abs(new - old) <= bound for new, old in zip(self.before, before, strict=True))
        twin = make()
        twin.restore(saved)
        assert run(twin, steps) == self.motion.wheels_mps
        assert twin.snapshot() == self.motion.snapshot()

    @invariant()
    def limits_hold(self) -> None:
        left, right = self.motion.wheels_mps
        assert abs(left + right) / 2 <= 0.75 + 1e-8
        assert abs(right - left) / 2 <= max(0.75, 150 * RIM_MPS_PER_DEG_S) + 1e-8


TestMotionMachine = MotionMachine.TestCase
TestMotionMachine.settings = settings(max_examples=15, stateful_step_count=20)


@given(mm_s=st.integers(-750, 750), accel=st.integers(200, 2000))
@settings(max_examples=25)
def test_a_ramp_takes_the_whole_steps_that_arithmetic_says(mm_s: int, accel: int) -> None:
    motion = make(LIMITS.with_acceleration(accel))
    motion.set_velocity(mm_s)
    steps = 0
    while not motion.is_steady:
        motion.step(0, 0)
        steps += 1
    assert steps == -(-abs(mm_s) * 1000 // accel)
    assert motion.wheels_mps[0] == mm_s / 1000
