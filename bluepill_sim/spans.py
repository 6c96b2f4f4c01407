"""Spans of the chip's time, as whoever uses the board gives them."""

from bluepill_sim.errors import BluePillError
from simbase.timing import Nanos
from simbase.units import TIME

#: A span: nanoseconds, or a number with its unit.
Span = int | str
#: chosen: longer than anybody waits, and far inside what the chip counts.
LONGEST = "8784h"
_LONGEST_NS = TIME.read(LONGEST)


def to_nanos(span: Span) -> Nanos:
    """Return a span in nanoseconds: exactly, for no binary fraction stands between the text and its value.

    Args:
        span: nanoseconds as an integer, or a number with one of ns, us, ms, s, min, h.

    Raises:
        BluePillError: it has no unit, a negative or absurd length, or is no span at all.
    """
    nanos = TIME.read(span, BluePillError) if isinstance(span, str) else span
    if isinstance(nanos, bool) or not isinstance(nanos, int):
        raise BluePillError(f"{span!r} is no span of time", hint='nanoseconds as an integer, or "10 ms"')
    if not 0 <= nanos <= _LONGEST_NS:
        raise BluePillError(f"{span!r} is negative or longer than a year", hint="give a span such as 10ms")
    return nanos
