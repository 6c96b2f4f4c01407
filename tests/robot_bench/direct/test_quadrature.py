"""Quadrature edges: as many as the wheel has turned by, in Gray code, each where the wheel was."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_bench.direct.differential.quadrature import QUARTERS, Quadrature
from robot_bench.wires.nets import Net

QUICK = settings(max_examples=60)
MS = 1_000_000


def made(edges_per_turn: float = 1632.0) -> tuple[Quadrature, Net, Net]:
    a, b = Net("a"), Net("b")
    encoder = Quadrature(a, b, edges_per_turn)
    encoder.start()
    return encoder, a, b


def counted(a: Net, b: Net, until: int, before: int = 0) -> tuple[int, list[int]]:
    """Count on as a timer does in encoder mode 3; return how far, and the times of the edges."""
    rows = [(at, place, level) for place, net in enumerate((a, b)) for at, level in net.edges_until(until)]
    levels, count = list(QUARTERS[before % 4]), 0
    for _, channel, level in sorted(rows):
        levels[channel] = bool(level)
        # RM0008 table 77: an edge of A counts up where B is then the opposite, one of B where A is the same.
        count += 1 if (levels[0] != levels[1]) == (channel == 0) else -1
    return count, sorted(at for at, _, _ in rows)


def test_forward_a_leads_and_each_edge_is_at_its_part_of_the_step() -> None:
    encoder, a, b = made(4.0)  # an edge a quarter of a turn
    encoder.turn_to(2 * math.pi, 5 * MS, MS)
    assert a.edges_until(10 * MS) == [(5 * MS + 250_000, 1), (5 * MS + 750_000, 0)]
    assert b.edges_until(10 * MS) == [(5 * MS + 500_000, 1), (6 * MS, 0)]


def test_in_reverse_b_leads() -> None:
    encoder, a, b = made(4.0)
    encoder.turn_to(-2 * math.pi, 5 * MS, MS)
    # At once it leaves the first quarter backwards: B rises.
    assert b.edges_until(10 * MS) == [(5 * MS + 1, 1), (5 * MS + 500_000, 0)]
    assert a.edges_until(10 * MS) == [(5 * MS + 250_000, 1), (5 * MS + 750_000, 0)]


@pytest.mark.parametrize("nudge", [1e-9, -1e-9])
def test_an_edge_comes_when_its_angle_is_reached_and_not_before(nudge: float) -> None:
    encoder, a, b = made(4.0)
    encoder.turn_to(math.pi / 2 + nudge, 0, MS)
    assert counted(a, b, 10 * MS)[0] == (1 if nudge > 0 else 0)


@pytest.mark.parametrize(("span_ns", "at"), [(5, 2), (3, 2), (1, 1), (4, 2)])
def test_an_edge_between_two_nanoseconds_is_at_the_even_one_and_within_the_span(span_ns: int, at: int) -> None:
    encoder, a, _ = made(4.0)
    encoder.turn_to(math.pi, 0, span_ns)  # half a line: A rises in the middle
    assert list(a.edges_until(span_ns)) == [(at, 1)]


@QUICK
@given(st.lists(st.floats(-3, 3), min_size=1, max_size=20), st.floats(4, 4000))
def test_a_timer_counts_the_wheel_s_angle_and_its_edges_keep_their_order(turns: list[float], per_turn: float) -> None:
    encoder, a, b = made(per_turn)
    angle, total = 0.0, 0
    for step, turn in enumerate(turns):
        angle += turn / 20
        encoder.turn_to(angle, step * MS, MS)
        count, times = counted(a, b, (step + 1) * MS, total)
        total += count
        assert total == math.floor(angle * (per_turn / (2 * math.pi)))
        assert (a.level((step + 1) * MS), b.level((step + 1) * MS)) == QUARTERS[total % 4]
        assert times == sorted(times)
        assert all(step * MS < at <= (step + 1) * MS for at in times)
