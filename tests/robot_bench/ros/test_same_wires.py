"""The topics of the thesis mean what the adapter makes of the same wires."""

import math

import pytest

from adapter_sim.codec import encoder_code as adapter_encoder_code
from adapter_sim.codec import motor_value
from adapter_sim.settings import AdapterSettings
from p2os.ros.thesis_topics import CODES, encoder_code, motor_speed


def test_motor_values_mean_what_the_adapter_makes_of_the_same_wires() -> None:
    step = AdapterSettings().step_um_per_s
    for code in range(CODES):
        assert motor_speed(code) == pytest.approx(motor_value(code, 3) * step / 1e6)
        assert motor_speed(motor_value(code, 3)) == motor_speed(code)
    assert motor_speed(-CODES // 2 - 1) is None
    assert motor_speed(CODES) is None


def test_encoder_values_are_those_of_the_adapter_for_each_degree_of_both_ways() -> None:
    for degrees in range(-800, 801):
        wanted = adapter_encoder_code(2 * degrees + 1, 720, 3)
        assert encoder_code(math.radians(degrees + 0.5)) == wanted, degrees
