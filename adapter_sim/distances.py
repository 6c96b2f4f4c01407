"""The eight distance levels, out of sonar readings that arrive two at a time.

A level is high where the last reading is nearer than the threshold, and high
where there is none or it has gone stale: what is not known is an obstacle.
"""

from adapter_sim.codec import is_near
from p2os.robots.parameters import RobotParameters
from simbase.state import Stateful
from simbase.timing import Nanos


class Distances(Stateful):
    """The newest reading of each sonar.

    Args:
        count: Number of distance wires; sonar 0 is wire 1.
        threshold_um: Nearer is an obstacle.
        stale_ns: A reading of this age is none any more.
    """

    STATE = ("_readings",)

    def __init__(self, count: int, *, threshold_um: int, stale_ns: Nanos) -> None:
        self.threshold_um = threshold_um
        self._stale_ns = stale_ns
        self._readings: list[tuple[int, Nanos] | None] = [None] * count

    def take(self, number: int, range_um: int, now: Nanos) -> None:
        """Store a reading of sonar `number` (from 0); sonar without a wire are left out."""
        if 0 <= number < len(self._readings):
            self._readings[number] = (range_um, now)

    def forget(self) -> None:
        """Know nothing."""
        self._readings = [None] * len(self._readings)

    def expire(self, now: Nanos) -> None:
        """Forget the readings that are stale at `now`."""
        for number, reading in enumerate(self._readings):
            if reading is not None and now - reading[1] >= self._stale_ns:
                self._readings[number] = None

    @property
    def expires_at(self) -> Nanos | None:
        """Return when the oldest reading goes stale."""
        times = [reading[1] for reading in self._readings if reading is not None]
        return min(times) + self._stale_ns if times else None

    @property
    def levels(self) -> tuple[bool, ...]:
        """Return the level of each distance wire, sonar 0 first."""
        return tuple(reading is None or is_near(reading[0], self.threshold_um) for reading in self._readings)

    @property
    def ranges_um(self) -> tuple[int | None, ...]:
        """Return the range of each sonar in µm, None where it is not known."""
        return tuple(None if reading is None else reading[0] for reading in self._readings)


def threshold_um(wanted_um: int | None, parameters: RobotParameters) -> int:
    """Return the distance below which something is an obstacle: as wanted, or half of the sonar range."""
    return round(parameters.sonar_range_m * 10**6) // 2 if wanted_um is None else wanted_um
