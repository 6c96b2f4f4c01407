"""What a sonar makes of the echoes that the body gives: specular loss, crosstalk, noise, dropout, faults.

A ping is nine rays. A ray that meets its surface too far from the square does not
come back; the nearest of those that do come back is the range, or another robot's ping
where it arrives before (`cross_talk`). Then, each
by its own random stream: crosstalk (another sonar's ping received: nearer), dropout
(no echo), noise. A stuck or noisy sonar errs on top.

Not modelled: multiple reflections, the temperature of the air, surfaces that
swallow sound.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Protocol, runtime_checkable

from p2os.pioneer.random_source import RandomSource
from p2os.pioneer.sensor_errors import SonarErrors
from p2os.robots.parameters import RobotParameters


class RayEcho(Protocol):
    """What one ray meets."""

    @property
    def range_m(self) -> float:
        """Metres from the transducer; infinite where it meets nothing."""
        ...

    @property
    def cosine(self) -> float:
        """1 where the surface is met squarely, 0 where it is grazed."""
        ...


class Ranging(Protocol):
    """A body that can be asked for ranges."""

    def ranges(self, numbers: Sequence[int]) -> Sequence[float]:
        """Return the nearest echo of each sonar, metres."""
        ...


@runtime_checkable
class Echoing(Protocol):
    """A body that gives each ray of a ping."""

    def echoes(self, numbers: Sequence[int]) -> Sequence[Sequence[RayEcho]]:
        """Return what each ray of some sonar meets."""
        ...


def measure_ranges(
    body: Ranging,
    numbers: Sequence[int],
    parameters: RobotParameters,
    errors: SonarErrors,
    faults: Mapping[int, tuple[str, float]],
    random_source: RandomSource,
    heard: Sequence[float | None] | None = None,
) -> list[float]:
    """Return the ranges that these sonar measure, metres; the robot file's longest range where no echo came.

    Args:
        body: Where the sonar sit.
        numbers: Which sonar, 0-based.
        parameters: Their ranges.
        errors: How much they err.
        faults: Sonar → ("stuck", metres), ("noisy", standard deviation in m) or ("dead", 0).
        random_source: The robot's randomness.
        heard: What each takes the ping of another robot for, metres, or None; None: there are no other robots.
    """
    longest, least = parameters.sonar_range_m, parameters.sonar_min_range_m
    if errors.specular_deg < 90.0 and isinstance(body, Echoing):
        limit = math.cos(math.radians(errors.specular_deg))
        found = [
            min((echo.range_m for echo in rays if echo.cosine >= limit), default=longest)
            for rays in body.echoes(numbers)
        ]
    else:
        found = list(body.ranges(numbers))
    if heard is not None:
        found = [
            true_m if other_m is None else min(true_m, other_m) for true_m, other_m in zip(found, heard, strict=True)
        ]
    measured = []
    for number, true_m in zip(numbers, found, strict=True):
        range_m = min(true_m, longest)
        if errors.crosstalk and random_source.of("crosstalk").random() < errors.crosstalk:
            range_m = random_source.of("crosstalk").uniform(least, max(range_m, least))
        if errors.dropout and random_source.of("dropout").random() < errors.dropout:
            range_m = longest
        deviation = errors.noise_m + errors.noise_part * range_m
        if deviation and range_m < longest:
            range_m += random_source.of("sonar noise").gauss(0.0, deviation)
        kind, value = faults.get(number, ("", 0.0))
        if kind == "stuck":
            range_m = value
        elif kind == "dead":
            range_m = longest
        elif kind == "noisy":
            range_m += random_source.of("sonar fault").gauss(0.0, value)
        measured.append(min(max(range_m, least), longest))
    return measured
