"""Readings in whole grains: how coarse they are, and how much noise there is before they are rounded.

A reading that is rounded errs by a sawtooth of what is read. Noise before the rounding smoothes the sawtooth: with a
deviation of half a grain the error of the mean is gone (dither: Widrow and Kollár, Quantization Noise, 2008). With a
deviation of s grains, what is left of the sawtooth has the variance

    b(s) = sum_k exp(-(2 pi k s)^2) / (2 pi^2 k^2),    b(0) = 1/12,

in squares of a grain, and readings of a value that is held scatter by s^2 + 1/12 - b(s) in the mean over all values.
"""

import numpy as np

from robot_bench.drives.drive import Floats

#: chosen: deviations that are tried, in grains; beyond them nothing of the sawtooth is left.
_DEVIATIONS = np.linspace(0.0, 1.0, 201)
#: chosen: terms of the sum; the next has 1/5000 of the first.
_TERMS = 70
#: chosen: less than this part of the largest reading is no grain: a wire has 16 bits.
_LEAST_PART = 1e-6


def grain_of(values: Floats) -> float:
    """Return of what all readings are multiples, in their unit: Euclid's algorithm; 0 where there is no such grain."""
    sizes = np.unique(np.abs(values))
    grain, least = 0.0, _LEAST_PART * float(sizes.max(initial=0.0))
    for size in sizes.tolist():
        other = size
        while other > least:
            grain, other = other, abs(grain - other * round(grain / other))
    return grain if grain > 2 * least else 0.0


def noise_before(variance: float, grain: float) -> float:
    """Return the deviation before rounding of readings that scatter so much where the value is held.

    Args:
        variance: Of readings within each time in which the value is held, in the mean, squares of their unit.
        grain: Of a reading, in that unit; 0: they are not rounded.
    """
    if not grain:
        return float(np.sqrt(variance))
    k = np.arange(1, _TERMS + 1)[:, None]
    left = np.sum(np.exp(-((2 * np.pi * k * _DEVIATIONS) ** 2)) / k**2, axis=0) / (2 * np.pi**2)
    scatter = _DEVIATIONS**2 + 1 / 12 - left
    seen = variance / grain**2
    found = np.interp(seen, scatter, _DEVIATIONS) if seen < scatter[-1] else np.sqrt(seen - 1 / 12)
    return float(found * grain)
