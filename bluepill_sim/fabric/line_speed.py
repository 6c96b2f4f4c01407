"""Two ends of a serial line at different speeds: what one receives of what the other sends.

A receiver finds a start bit's edge and samples the middle of each bit at its own speed. Each character is judged
alone, as if the line idled after it. Not modelled: sampling three times a bit, and the noise flag.

Source: RM0008 27.3.3 (receiver).
Invariant: ends that differ by less than half a bit over a character hear each other without damage.
"""

from collections.abc import Iterator

#: Speeds that something at the other end may be set to, bit/s: those of terminals, MIDI, DMX and fast adapters.
USUAL_BAUDS = (
    300, 600, 1200, 2400, 4800, 9600, 14400, 19200, 28800, 31250, 38400, 57600, 76800, 115200, 128000, 230400, 250000,
    256000, 460800, 500000, 576000, 921600, 1000000, 1152000, 1500000, 2000000, 2250000, 2500000, 3000000, 3500000,
    4000000, 4500000,
)  # fmt: skip
#: So many percent off a line still works for certain: each end may use up half of what a character bears.
TOLERANCE_PERCENT = 2


def nearest_usual(baud: int) -> int:
    """Return the usual speed that is nearest in proportion."""
    return min(USUAL_BAUDS, key=lambda usual: max(usual, baud) / min(usual, baud))


def is_usual(baud: int) -> bool:
    """Tell whether a speed is within the tolerance of a usual one."""
    usual = nearest_usual(baud)
    return 100 * abs(baud - usual) <= TOLERANCE_PERCENT * usual


def heard(word: int, data_bits: int, numerator: int, denominator: int) -> Iterator[int]:
    """Return what a receiver makes of one character.

    Args:
        word: its data bits, a parity among them.
        data_bits: how many.
        numerator: the length of the receiver's bit in those of the sender,
        denominator: as a fraction.
    """
    line = [0, *(word >> n & 1 for n in range(data_bits)), 1]

    def level(position: int) -> int:
        return line[position] if position < len(line) else 1

    edge = 0
    while edge < len(line):
        samples = [edge + (2 * n + 1) * numerator // (2 * denominator) for n in range(data_bits + 2)]
        if level(samples[0]) == 0:  # else the start bit was over before its middle: noise
            yield sum(level(samples[n + 1]) << n for n in range(data_bits))
            edge = samples[-1]
        edge = next((n for n in range(edge + 1, len(line)) if line[n] < line[n - 1]), len(line))
