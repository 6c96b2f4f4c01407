"""The battery: 0.9 A at rest, 0.3 A for motors, 2 A for a rim's m/s, 3 A for a stalled wheel; a charger gives 2 A."""

import pytest

from p2os.pioneer.devices.battery import CAPACITY_C, EMPTY_V, FULL_V, Battery
from simbase.timing import NS_PER_S

HOUR = 3600 * NS_PER_S


@pytest.mark.parametrize(("motors_on", "rims_mps", "stalled", "charging", "amperes"), [
    (False, 0.0, 0, False, 0.9), (True, 0.0, 0, False, 1.2), (True, 0.8, 0, False, 2.8), (True, 0.0, 2, False, 7.2),
    (False, 0.0, 0, True, -1.1), (True, 0.8, 1, True, 3.8),
])  # fmt: skip
def test_what_flows_from_a_look_to_the_next_is_by_the_load_at_the_first(
    motors_on: bool, rims_mps: float, stalled: int, charging: bool, amperes: float
) -> None:
    battery = Battery(charge_c=CAPACITY_C / 2, resistance_ohm=0.1, is_charging=charging)
    battery.look(0, motors_on=motors_on, rims_mps=rims_mps, stalled=stalled)
    assert battery.charge_c == CAPACITY_C / 2
    assert battery.current_a == pytest.approx(amperes)
    assert battery.volts == pytest.approx((EMPTY_V + FULL_V) / 2 - 0.1 * amperes)
    battery.look(HOUR // 60, motors_on=False, rims_mps=0.0, stalled=0)
    assert battery.charge_c == pytest.approx(CAPACITY_C / 2 - 60 * amperes)


def test_it_holds_no_more_than_is_in_it_and_no_less_than_nothing() -> None:
    battery = Battery()
    battery.look(7 * HOUR, motors_on=False, rims_mps=0.0, stalled=0)
    assert battery.charge_c == pytest.approx(CAPACITY_C * 0.1)
    assert (battery.decivolts, battery.state_of_charge) == (113, 10)
    battery.look(8 * HOUR, motors_on=False, rims_mps=0.0, stalled=0)
    assert (battery.charge_c, battery.decivolts, battery.state_of_charge) == (0.0, 111, 0)
    battery.is_charging = True
    battery.look(8 * HOUR, motors_on=False, rims_mps=0.0, stalled=0)
    battery.look(30 * HOUR, motors_on=False, rims_mps=0.0, stalled=0)
    assert (battery.charge_c, battery.decivolts, battery.state_of_charge) == (CAPACITY_C, 129, 100)


@pytest.mark.parametrize(("pretended", "shown"), [(-1, 0), (0, 0), (97, 97), (255, 255), (256, 255)])
def test_what_is_pretended_is_shown_within_a_byte(pretended: int, shown: int) -> None:
    assert Battery(pretended_decivolts=pretended).decivolts == shown


@pytest.mark.parametrize(("volts", "part"), [(11.0, 0.0), (11.1, 0.0), (11.55, 0.25), (12.9, 1.0), (13.0, 1.0)])
def test_a_battery_that_rests_at_a_voltage_has_so_much_charge(volts: float, part: float) -> None:
    battery = Battery.resting_at(volts, 0.2)
    assert (battery.charge_c, battery.resistance_ohm) == (pytest.approx(part * CAPACITY_C), 0.2)
