"""Digital distance sensors: a wire is high while something stands nearer than a threshold.

All sensors are sampled together, once a period, from time 0 on.

Not modelled: noise, crosstalk and the time that sound takes.
"""

from collections.abc import Callable, Sequence

from adapter_sim.codec import is_near
from robot_bench.wires.nets import Net, Strength, Unconnected
from simbase.state import Stateful
from simbase.timing import Nanos

#: The name under which the plug-ins drive wires.
OWNER = "sensor"
UM_PER_M = 1_000_000


class DistanceSensors(Stateful):
    """The ring of distance sensors.

    Args:
        nets: One wire a sensor, in the order of the sonar they stand for.
        threshold_um: Nearer than this is an obstacle.
        period_ns: Time between two samples.
    """

    STATE = ("_next",)

    def __init__(self, nets: Sequence[Net | Unconnected], *, threshold_um: int, period_ns: Nanos) -> None:
        self._nets = tuple(nets)
        self._threshold_um = threshold_um
        self._period_ns = period_ns
        self._next: Nanos = 0
        #: Called with each sample: (ns, metres of each sensor).
        self.on_sample: Callable[[Nanos, Sequence[float]], None] | None = None

    def next_deadline(self) -> Nanos:
        """Return when the next sample is due."""
        return self._next

    def sample(self, measured_m: Sequence[float], now: Nanos) -> None:
        """Set the wires to what was measured at `now`, in metres, one value a sensor."""
        self._next = now + self._period_ns
        for net, metres in zip(self._nets, measured_m, strict=True):
            near = is_near(round(metres * UM_PER_M), self._threshold_um)
            net.drive(OWNER, near, Strength.PUSH_PULL, now)
        if self.on_sample is not None:
            self.on_sample(now, measured_m)
