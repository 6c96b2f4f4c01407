"""Two ends of a serial line at different speeds: what one receives of what the other sends.

Theory of operation. A receiver reads the line sixteen times a bit. A falling edge begins a start bit, which counts if
most of its samples 3, 5, 7 and most of 8, 9, 10 are 0; each bit after it is what most of its samples 8, 9, 10 say.
Samples that differ are noise. A stop bit that reads 0 is a framing error; either way the next falling edge begins the
next character. The sender's characters follow each other without a gap, and the line idles behind the last.

*Chosen*: the sixteen samples stand at 0/16 to 15/16 of a bit and the first on the edge (on silicon up to 1/16 late).
Source: RM0008 27.3.3 (receiver, noise error, framing error, stop bits) and 27.3.5 (tolerance).
Invariant: ends that differ by less than the manual's tolerance hear each other without damage.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

#: Speeds that something at the other end may be set to, bit/s: those of terminals, MIDI, DMX and fast adapters.
USUAL_BAUDS = (
    300, 600, 1200, 2400, 4800, 9600, 14400, 19200, 28800, 31250, 38400, 57600, 76800, 115200, 128000, 230400, 250000,
    256000, 460800, 500000, 576000, 921600, 1000000, 1152000, 1500000, 2000000, 2250000, 2500000, 3000000, 3500000,
    4000000, 4500000,
)  # fmt: skip
#: So many percent off a line still works for certain: each end may use up half of what a character bears.
TOLERANCE_PERCENT = 2
#: Samples of a bit, and those that are looked at, counted from 0 (RM0008 27.3.3).
_SAMPLES = 16
_FIRST_LOOK, _MIDDLE = (2, 4, 6), (7, 8, 9)
#: Where the stop bit is sampled, by its length in half-bits; half a bit is not sampled (RM0008 27.3.3).
_STOP_SAMPLES = {1: (), 2: _MIDDLE, 3: (15, 16, 17), 4: _MIDDLE}


@dataclass(frozen=True, slots=True)
class Heard:
    """One character as a receiver has it."""

    #: Its data bits, a parity among them.
    word: int
    #: Whether the stop bit read 0.
    has_framing_error: bool = False
    #: Whether samples of one bit differed.
    has_noise: bool = False


def nearest_usual(baud: int) -> int:
    """Return the usual speed that is nearest in proportion."""
    return min(USUAL_BAUDS, key=lambda usual: max(usual, baud) / min(usual, baud))


def is_usual(baud: int) -> bool:
    """Tell whether a speed is within the tolerance of a usual one."""
    usual = nearest_usual(baud)
    return 100 * abs(baud - usual) <= TOLERANCE_PERCENT * usual


def heard(
    words: Sequence[int], data_bits: int, numerator: int, denominator: int, stop_half_bits: int = 2
) -> Iterator[Heard]:
    """Return what a receiver makes of characters that follow each other without a gap.

    Args:
        words: their data bits, a parity among them.
        data_bits: how many in each, at both ends.
        numerator: the length of the receiver's bit in those of the sender,
        denominator: as a fraction.
        stop_half_bits: the length of the stop bit at both ends, in half-bits: 1 to 4.
    """
    line = [level for word in words for level in _levels(word, data_bits, stop_half_bits)]

    def sampled(edge: int, bit: int, samples: tuple[int, ...]) -> tuple[int, ...]:
        """Return the line's levels at samples of the receiver's bit, counted from an edge."""
        places = (edge + 2 * (_SAMPLES * bit + n) * numerator // (_SAMPLES * denominator) for n in samples)
        return tuple(line[place] if place < len(line) else 1 for place in places)

    edge = 0
    while edge < len(line):
        found, last = _character(sampled, edge, data_bits, _STOP_SAMPLES[stop_half_bits])
        if found is not None:
            yield found
        reached = edge + 2 * last * numerator // (_SAMPLES * denominator)
        edge = next((n for n in range(reached + 1, len(line)) if line[n] < line[n - 1]), len(line))


def _character(
    sampled: Callable[[int, int, tuple[int, ...]], tuple[int, ...]], edge: int, data_bits: int, stop: tuple[int, ...]
) -> tuple[Heard | None, int]:
    """Return what begins at an edge, None for no start bit, and the number of the last sample that was looked at."""
    looked: list[tuple[int, ...]] = []
    for samples in (_FIRST_LOOK, _MIDDLE):
        looked.append(sampled(edge, 0, samples))
        if _most(looked[-1]):
            return None, samples[-1]
    bits = [sampled(edge, 1 + n, _MIDDLE) for n in range(data_bits)]
    stopped = sampled(edge, 1 + data_bits, stop)
    found = Heard(
        sum(_most(bit) << n for n, bit in enumerate(bits)),
        has_framing_error=bool(stopped) and not _most(stopped),
        has_noise=any(len(set(levels)) > 1 for levels in (*looked, *bits, stopped)),
    )
    return found, _SAMPLES * (1 + data_bits) + (stop or _MIDDLE)[-1]


def _levels(word: int, data_bits: int, stop_half_bits: int) -> list[int]:
    """Return a character's levels, one each half-bit."""
    return [0, 0, *(word >> n // 2 & 1 for n in range(2 * data_bits)), *(1 for _ in range(stop_half_bits))]


def _most(levels: tuple[int, ...]) -> int:
    return int(2 * sum(levels) > len(levels))
