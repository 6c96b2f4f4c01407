"""Spans of time as people write them: "10 ms", "1.5s", "250us".

Invariant: the result is exact: no binary fraction stands between the text and its nanoseconds.
"""

import re
from decimal import Decimal

from bluepill_sim.errors import BluePillError
from bluepill_sim.timing import NS_PER_MS, NS_PER_S, NS_PER_US, Nanos

#: A span: nanoseconds, or a number with its unit.
Span = int | str

_UNITS = {"ns": 1, "us": NS_PER_US, "µs": NS_PER_US, "ms": NS_PER_MS, "s": NS_PER_S, "min": 60 * NS_PER_S}
_TEXT = re.compile(r"(?P<number>\d+\.?\d*|\.\d+)\s*(?P<unit>[a-zµ]+)", re.ASCII | re.IGNORECASE)
_MICRO = "\N{GREEK SMALL LETTER MU}s"
#: chosen: longer than anybody waits, and far inside what the chip counts.
_LONGEST_NS = 366 * 24 * 3600 * NS_PER_S


def to_nanos(span: Span) -> Nanos:
    """Return a span in nanoseconds.

    Args:
        span: nanoseconds as an integer, or a number with one of ns, us, ms, s, min.

    Raises:
        BluePillError: it has no unit, a negative or absurd length, or is no span at all.
    """
    if isinstance(span, bool) or not isinstance(span, int | str):
        raise BluePillError(f"{span!r} is no span of time", hint='nanoseconds as an integer, or "10 ms"')
    if isinstance(span, int):
        nanos = span
    else:
        found = _TEXT.fullmatch(span.strip().replace("\N{MICRO SIGN}", "u").replace(_MICRO, "us"))
        unit = None if found is None else _UNITS.get(found["unit"].lower())
        if found is None or unit is None:
            raise BluePillError(f"{span!r} is no span of time", hint="a number with ns, us, ms, s or min, such as 10ms")
        nanos = int(Decimal(found["number"]) * unit)
    if not 0 <= nanos <= _LONGEST_NS:
        raise BluePillError(f"{span!r} is negative or longer than a year", hint="give a span such as 10ms")
    return nanos
