"""The sonar ranges that a client knows, gathered from the standard packets it receives.

A Pioneer 2 sends two readings a packet; the others keep their last value, and
before the first reading the sonar's longest range.
"""

from collections.abc import Callable, Sequence

from p2os.errors import LocalProtocolError, RemoteProtocolError
from p2os.parameters import RobotParameters
from p2os.profiles import Profile
from p2os.sip import SIP_KINDS, StandardSip
from p2os.timing import Nanos
from p2os.wire import Frame

UM_PER_M = 1_000_000


class SipRanges:
    """Ranges of all fitted sonar; tells them after each packet that brings a reading."""

    def __init__(
        self, parameters: RobotParameters, profile: Profile, *, on_ranges: Callable[[Nanos, Sequence[float]], None]
    ) -> None:
        self._profile = profile
        self._parameters = parameters
        self._on_ranges = on_ranges
        self._ranges_m = [parameters.sonar_range_m] * parameters.sonar_fitted

    def take(self, data: bytes, now: Nanos) -> None:
        """Look into one frame; anything but a standard packet is passed over."""
        try:
            frame = Frame.from_bytes(data)
            if frame.kind not in SIP_KINDS:
                return
            sip = StandardSip.from_frame(frame, self._profile)
        except (LocalProtocolError, RemoteProtocolError):  # a noisy line: no sound frame
            return
        self.take_sip(sip, now)

    def take_sip(self, sip: StandardSip, now: Nanos) -> None:
        """Take the readings of a standard packet."""
        for reading in sip.sonar:
            if reading.number < len(self._ranges_m):
                metres = reading.raw_range * self._parameters.range_um_per_count / UM_PER_M
                self._ranges_m[reading.number] = min(metres, self._parameters.sonar_range_m)
        if sip.sonar:
            self._on_ranges(now, self._ranges_m)

    def snapshot(self) -> tuple[float, ...]:
        """Return the ranges."""
        return tuple(self._ranges_m)

    def restore(self, snapshot: Sequence[float]) -> None:
        """Put back what `snapshot` returned."""
        self._ranges_m = list(snapshot)
