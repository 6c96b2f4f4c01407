"""Raw counts in SI units: each factor, and where a heading wraps."""

import math

import pytest

from p2os.protocol.units import battery_v, heading_rad, range_m, rim_mps
from tests.p2os.client.client_rig import parameters

P2DX = parameters()
#: Headings are 4096ths of a turn.
TURN = 4096


@pytest.mark.parametrize(
    ("raw", "turns"),
    [(0, 0.0), (1, 1 / TURN), (1024, 0.25), (2047, 2047 / TURN), (2049, -2047 / TURN), (4095, -1 / TURN),
     (TURN, 0.0), (TURN + 1024, 0.25), (-1024, -0.25)],
)  # fmt: skip
def test_a_heading_lies_within_half_a_turn_of_0(raw: int, turns: float) -> None:
    assert heading_rad(raw, P2DX) == pytest.approx(2 * math.pi * turns, abs=2e-3)  # the files round the factor


def test_each_count_has_its_factor() -> None:
    assert rim_mps(-250, P2DX) == pytest.approx(-0.25 * P2DX.velocity_conv)
    assert range_m(1000, P2DX) == pytest.approx(P2DX.range_conv_mm)
    assert battery_v(123) == 12.3
