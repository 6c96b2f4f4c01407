"""How often an analyser looks: as a file says it in words, or as the times of its edges show it.

A file that does not say it (Saleae's CSV, a dump converted from something) still has all edges on whole samples: the
slowest rate at which they all are is taken. Where an analyser was faster, all its edges happen to lie on the coarser
samples too, and an edge that does not would have shown it.
"""

import re
from collections.abc import Iterable

#: Rates of analysers on the market, Hz, the slowest first.
RATES_HZ = (
    1e6, 2e6, 3e6, 4e6, 5e6, 6e6, 8e6, 10e6, 12e6, 12.5e6, 15e6, 16e6, 20e6, 24e6, 25e6, 32e6, 40e6, 48e6, 50e6, 64e6,
    80e6, 100e6, 125e6, 200e6, 250e6,
)  # fmt: skip
#: chosen: fewer edges say nothing of the rate.
LEAST_EDGES = 12
#: Nanoseconds by which a time in a file may be rounded.
ROUNDED_NS = 1.0
_WORDS = re.compile(r"(?:at|samplerate[:=]?)\s*([0-9.]+)\s*([kMG]?)Hz", re.IGNORECASE)
_RATE = re.compile(r"([0-9.]+)\s*([kKMG]?)(?:Hz)?")
_TIMES = {"": 1, "k": 1e3, "K": 1e3, "M": 1e6, "m": 1e6, "G": 1e9, "g": 1e9}


def rate_in_words(text: str) -> float:
    """Return the samples a second that a comment names ("… at 24 MHz"); 0 where it names none."""
    found = _WORDS.search(text)
    return float(found[1]) * _TIMES[found[2]] if found else 0.0


def rate_of(words: str) -> float:
    """Return the samples a second of words such as "24 MHz" or "500000".

    Raises:
        ValueError: They are none.
    """
    found = _RATE.fullmatch(words.strip())
    rate_hz = float(found[1]) * _TIMES[found[2]] if found else 0.0
    if not 0 < rate_hz <= 1e12:
        raise ValueError(f"{words!r} is no sample rate")
    return rate_hz


def rate_of_times(times_ns: Iterable[float]) -> float:
    """Return the slowest usual rate at which all times are whole samples apart; 0 where there is none, or too few."""
    times = sorted(set(times_ns))
    if len(times) < LEAST_EDGES:
        return 0.0
    for rate_hz in RATES_HZ:
        if rate_hz * 4 * ROUNDED_NS > 1e9:  # what is rounded says nothing of faster ones
            break
        sample_ns = 1e9 / rate_hz
        if all(abs((at - times[0]) / sample_ns - round((at - times[0]) / sample_ns)) * sample_ns <= ROUNDED_NS
               for at in times):  # fmt: skip
            return rate_hz
    return 0.0
