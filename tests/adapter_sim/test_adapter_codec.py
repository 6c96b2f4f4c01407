"""Pure functions between levels and numbers."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from adapter_sim.codec import (
    BitOrder,
    divide_half_away,
    encoder_code,
    encoder_count,
    is_near,
    motor_code,
    motor_value,
    reverse_bits,
)

WIDTHS = st.integers(1, 8)
ORDERS = st.sampled_from(BitOrder)

#: (comm3, comm2, comm1) as a number → value.
MOTOR_TABLE = [(0, 0), (1, 1), (2, 2), (3, 3), (4, -4), (5, -3), (6, -2), (7, -1)]


@pytest.mark.parametrize(("code", "value"), MOTOR_TABLE)
def test_three_motor_wires_are_twos_complement(code: int, value: int) -> None:
    assert motor_value(code, 3) == value
    assert motor_code(value, 3) == code


@pytest.mark.parametrize(("code", "value"), [(0b100, 1), (0b110, 3), (0b001, -4), (0b111, -1), (0b011, -2)])
def test_the_other_bit_order_reads_the_same_wires_from_comm1(code: int, value: int) -> None:
    assert motor_value(code, 3, BitOrder.COMM1_MSB) == value
    assert motor_code(value, 3, BitOrder.COMM1_MSB) == code


@given(st.data(), WIDTHS, ORDERS)
def test_motor_codes_and_values_are_inverses_at_any_width(data: st.DataObject, width: int, order: BitOrder) -> None:
    code = data.draw(st.integers(0, 2**width - 1))
    value = motor_value(code, width, order)
    assert -(2 ** (width - 1)) <= value < 2 ** (width - 1)
    assert motor_code(value, width, order) == code


@given(st.data(), WIDTHS)
def test_reversing_bits_twice_changes_nothing(data: st.DataObject, width: int) -> None:
    code = data.draw(st.integers(0, 2**width - 1))
    assert reverse_bits(reverse_bits(code, width), width) == code


@pytest.mark.parametrize(("degrees", "code"), [(0, 0), (44, 0), (45, 1), (359, 7), (360, 0), (-1, 7), (-46, 6)])
def test_encoder_codes_are_taken_by_floor(degrees: int, code: int) -> None:
    assert encoder_code(degrees, 360, 3) == code


@given(st.integers(-(10**15), 10**15), st.integers(1, 10**10), WIDTHS)
def test_an_encoder_count_is_the_floor_of_the_exact_quotient(angle: int, per_turn: int, width: int) -> None:
    count = encoder_count(angle, per_turn, width)
    assert count * per_turn <= angle * 2**width < (count + 1) * per_turn
    assert encoder_code(angle, per_turn, width) == count % 2**width


def test_the_threshold_itself_is_not_nearer() -> None:
    assert is_near(599_999, 600_000)
    assert not is_near(600_000, 600_000)


@pytest.mark.parametrize(
    ("numerator", "quotient"), [(0, 0), (1, 0), (2, 1), (3, 1), (5, 1), (6, 2), (-1, 0), (-2, -1), (-5, -1), (-6, -2)]
)
def test_halves_are_rounded_away_from_zero(numerator: int, quotient: int) -> None:
    assert divide_half_away(numerator, 4) == quotient


@given(st.integers(-(10**18), 10**18), st.integers(1, 10**12))
def test_rounding_is_off_by_half_at_most_and_odd(numerator: int, denominator: int) -> None:
    quotient = divide_half_away(numerator, denominator)
    assert abs(2 * (numerator - quotient * denominator)) <= denominator
    assert divide_half_away(-numerator, denominator) == -quotient


def test_misuse_is_refused_with_its_values() -> None:
    with pytest.raises(ValueError, match=r"motor value 4 does not fit 3 bits \(-4\.\.3\)"):
        motor_code(4, 3)
    with pytest.raises(ValueError, match="code 8 does not fit 3 bits"):
        motor_value(8, 3)
    with pytest.raises(ValueError, match="width must be 1"):
        reverse_bits(0, 0)
    with pytest.raises(ValueError, match="per_turn must be positive"):
        encoder_code(0, 0, 3)
    with pytest.raises(ValueError, match="denominator must be positive"):
        divide_half_away(1, 0)
