"""The one place that knows how long characters take, held against exact fractions."""

from fractions import Fraction
from math import ceil

from hypothesis import given
from hypothesis import strategies as st

from p2os.protocol.line_time import LineTime
from simbase.timing import NS_PER_S

SENDINGS = st.lists(st.tuples(st.integers(1, 300), st.integers(0, 10**9)), max_size=20)


@given(SENDINGS, st.integers(300, 4_000_000))
def test_a_line_is_free_when_the_last_of_all_characters_has_gone(sendings: list[tuple[int, int]], baud: int) -> None:
    line, now, since, queued = LineTime(baud), 0, 0, 0
    for size, pause in sendings:
        now += pause
        if now >= since + ceil(Fraction(queued * 10 * NS_PER_S, baud)):
            since, queued = now, 0
        queued += size
        line = line.sent(size, now)
        assert line.free_at == since + ceil(Fraction(queued * 10 * NS_PER_S, baud))


def test_another_speed_counts_from_where_the_old_ends_and_no_speed_takes_no_time() -> None:
    line = LineTime(9600).sent(96, 0)
    assert line.free_at == NS_PER_S // 10
    assert line.at_baud(19200).sent(96, 0).free_at == NS_PER_S // 10 + NS_PER_S // 20
    assert LineTime(None).sent(1000, 7).free_at == 7
