"""Motors and mass, against what a person works out by hand for the rover; and energy, which is never gained."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_bench.direct.differential.bridge import Shares
from robot_bench.direct.differential.description import Differential
from robot_bench.direct.differential.drive_train import DriveTrain
from tests.robot_bench.direct.robots import kinetic_j, rover

QUICK = settings(max_examples=60)
DT = 1e-3
#: The rover: R = 2.4 + 0.5 ohm, K N = 0.0124 * 34 V s/rad.
OHM, KN = 2.9, 0.4216
#: (K N)²/R, and the damping of 1e-7 * 34².
DRAG = KN * KN / OHM + 1.156e-4
#: A wheel and its rotor: 4e-7 * 34² + 0.04 * 0.0325²/2.
WHEEL = 4.624e-4 + 2.1125e-5
FORWARD, REVERSE, BRAKE, COAST = Shares(1, 0, 0), Shares(0, 1, 0), Shares(0, 0, 1), Shares(0, 0, 0)


def smooth(**parts: dict[str, object]) -> Differential:
    return rover(**{**parts, "motor": {"friction_nm": 0.0, **parts.get("motor", {})}})


def settled(robot: Differential, left: Shares, right: Shares, volts: float) -> DriveTrain:
    train = DriveTrain(robot, DT)
    for _ in range(1000):
        train.step(left, right, volts)
    return train


@pytest.mark.parametrize("duty", [1.0, 0.5, 0.1])
def test_with_brake_the_steady_speed_is_that_of_the_mean_volts(duty: float) -> None:
    part = Shares(duty, 0, 1 - duty)
    train = settled(smooth(), part, part, 12.0)
    # k V d / R = drag * w
    assert train.left_radps == pytest.approx(KN * 12.0 * duty / OHM / DRAG, rel=1e-9)
    assert train.left_radps == pytest.approx(12.0 * duty / KN, rel=0.003), "nearly V d / K N: the damping is small"


def test_with_coast_the_steady_speed_is_nearly_that_of_the_whole_volts() -> None:
    part = Shares(0.5, 0, 0)
    train = settled(smooth(motor={"damping_nm_s": 0.0}), part, part, 12.0)
    assert train.left_radps == pytest.approx(12.0 / KN, rel=1e-6), "no current brakes it between the pulses"


def test_friction_takes_its_torque_off_the_steady_speed() -> None:
    train = settled(rover(), FORWARD, FORWARD, 12.0)
    assert train.left_radps == pytest.approx((KN * 12.0 / OHM - 0.0012 * 34) / DRAG, rel=1e-9)


@pytest.mark.parametrize(
    ("right", "inertia"),
    [
        # Straight on: J + m r²/2.
        (FORWARD, WHEEL + 1.4 * 0.0325**2 / 2),
        # On the spot: J + 2 I r²/b², with I of a box of 0.18 x 0.19 m whose middle is 0.02 m ahead of the axle.
        (REVERSE, WHEEL + 2 * (1.4 * ((0.18**2 + 0.19**2) / 12 + 0.02**2)) * 0.0325**2 / 0.16**2),
    ],
)
def test_the_time_constant_is_inertia_by_drag(right: Shares, inertia: float) -> None:
    train, last = DriveTrain(smooth(), DT), 0.0
    steady, tau = KN * 12.0 / OHM / DRAG, inertia / DRAG
    assert 0.01 < tau < 0.03, "tens of steps"
    for step in range(1, 100):
        train.step(FORWARD, right, 12.0)
        # The midpoint rule is off by (dt/tau)²/12 of the exponent.
        assert train.left_radps == pytest.approx(steady * (1 - math.exp(-step * DT / tau)), rel=1e-3)
        assert train.left_radps > last
        last = train.left_radps
    assert train.right_radps == pytest.approx(train.left_radps if right is FORWARD else -train.left_radps)


def test_a_motor_that_is_held_draws_its_stall_current_and_one_at_no_load_none() -> None:
    train = DriveTrain(smooth(motor={"damping_nm_s": 0.0}, body={"mass_kg": 1000.0}), DT)
    made = train.step(FORWARD, FORWARD, 12.0)
    assert made.left_a == pytest.approx(12.0 / OHM, rel=1e-3)
    assert made.supply_a == pytest.approx(2 * 12.0 / OHM, rel=1e-3)
    free = settled(smooth(motor={"damping_nm_s": 0.0}), FORWARD, FORWARD, 12.0)
    assert free.step(FORWARD, FORWARD, 12.0).supply_a == pytest.approx(0.0, abs=1e-9)


def test_the_supply_sags_by_its_resistance_times_the_current() -> None:
    train = DriveTrain(smooth(), DT)
    # At rest: V = E − Rb (V/R twice + idle), so V = (12 − 0.2 * 0.5) / (1 + 0.2 * 2/2.9).
    volts = train.supply_v(FORWARD, FORWARD, 12.0, 0.2, 0.5)
    assert volts == pytest.approx((12.0 - 0.1) / (1 + 0.4 / OHM))
    assert train.supply_v(BRAKE, COAST, 12.0, 0.2, 0.5) == pytest.approx(11.9), "neither motor draws"


def test_a_drop_of_the_bridge_is_taken_off_the_supply_and_less_than_it_drives_nothing() -> None:
    robot = smooth(bridge={"drop_v": 2.0})
    assert settled(robot, FORWARD, FORWARD, 12.0).left_radps == pytest.approx(KN * 10.0 / OHM / DRAG, rel=1e-9)
    assert settled(robot, FORWARD, FORWARD, 1.9).left_radps == 0.0


def test_friction_holds_a_wheel_until_the_torque_is_more() -> None:
    # 0.0012 N·m at the shaft: 0.0012 / 0.0124 A, times 2.9 ohm.
    least = 0.0012 / 0.0124 * OHM
    assert settled(rover(), FORWARD, FORWARD, least * 0.999).left_radps == 0.0
    assert settled(rover(), FORWARD, FORWARD, least * 1.001).left_radps > 0.0


def test_a_braked_motor_stops_sooner_than_one_that_coasts_and_both_come_to_rest() -> None:
    times = {}
    for name, off in (("brake", BRAKE), ("coast", COAST)):
        train = settled(rover(), FORWARD, FORWARD, 12.0)
        steps = 0
        while train.left_radps != 0.0:
            train.step(off, off, 12.0)
            steps += 1
            assert steps < 5000
        times[name] = steps
        assert train.step(off, off, 12.0) == (0, 0, 0, 0, 0), "it stays there"
    assert times["brake"] * 3 < times["coast"]


PART = st.tuples(st.floats(0, 1), st.floats(0, 1), st.floats(0, 1), st.floats(0, 1)).map(
    lambda parts: Shares(*(part / (sum(parts) or 1.0) for part in parts[:3]))
)


@QUICK
@given(
    st.lists(st.tuples(PART, PART, st.floats(0, 30)), min_size=1, max_size=30), st.floats(0, 0.1), st.floats(0.05, 5),
    st.floats(-50, 50), st.floats(-50, 50),
)  # fmt: skip
def test_the_kinetic_energy_is_no_more_than_what_the_supply_has_given_less_what_the_windings_have_taken(
    steps: list[tuple[Shares, Shares, float]], friction_nm: float, ohm: float, left: float, right: float
) -> None:
    train = DriveTrain(rover(motor={"friction_nm": friction_nm, "resistance_ohm": ohm}), DT)
    train.left_radps, train.right_radps = left, right
    for one, other, volts in steps:
        before, speed = kinetic_j(train), max(abs(train.left_radps), abs(train.right_radps))
        made = train.step(one, other, volts)
        given_j = made.supply_a * volts * DT
        # Of a winding i² R is lost at least, where the current is the mean over the whole step.
        lost_j = (made.left_a**2 + made.right_a**2) * (ohm + 0.5) * DT
        # Friction that stops a wheel within a step may push it by the way of half of that step.
        slack = 2 * friction_nm * 34 * speed * DT if friction_nm else 0.0
        assert kinetic_j(train) - before <= given_j - lost_j + slack + 1e-9


@QUICK
@given(st.floats(-50, 50), st.floats(-50, 50), st.floats(0, 0.1), st.sampled_from([BRAKE, COAST]))
def test_without_volts_the_kinetic_energy_only_falls(left: float, right: float, friction: float, off: Shares) -> None:
    train = DriveTrain(rover(motor={"friction_nm": friction}), DT)
    train.left_radps, train.right_radps = left, right
    for _ in range(200):
        before = kinetic_j(train)
        train.step(off, off, 12.0)
        assert kinetic_j(train) <= before + 1e-12
