"""The TCM2 compass and the gyro: both look at how the body really stands and turns.

Source: Pioneer 2 TCM2 manual p. 13 and 17; ARIA for the gyro's units (a reading
each 25 ms, 0 to 1023, about 512 at rest, less is counter-clockwise).
"""

import math
from dataclasses import dataclass
from enum import IntEnum

from p2os.protocol.packets import CompassPacket, GyroPacket, GyroReading
from p2os.protocol.packets.sensors import GYRO_CENTRE, GYRO_DEG_S_PER_COUNT
from simbase.timing import NS_PER_MS, Nanos

GYRO_SAMPLE_NS: Nanos = 25 * NS_PER_MS
#: ARIA's GyroScaler of every model.
GYRO_SCALER = 1.626
#: chosen: the gyro's thermometer at room temperature; nothing is calibrated against it.
GYRO_TEMPERATURE = 60
#: A packet holds 255 readings; a line that is choked drops the oldest.
MOST_READINGS = 40
#: The TCM2 sends about five readings a second.
COMPASS_NS: Nanos = 200 * NS_PER_MS
#: chosen: the earth's field in central Europe, microtesla, horizontal and down.
FIELD_UT = (20.0, 44.0)


class CompassMode(IntEnum):
    """TCM2's argument."""

    OFF = 0
    IN_SIP = 1
    ONE_PACKET = 2
    CONTINUOUS = 3
    USER_CALIBRATION = 4
    AUTO_CALIBRATION = 5
    STOP_CALIBRATION = 6
    SOFT_RESET = 7


@dataclass(slots=True)
class Compass:
    """The compass module; world x is magnetic north in every world."""

    is_fitted: bool = True
    mode: CompassMode = CompassMode.OFF
    #: When the last reading was taken, and its heading; clockwise from north, degrees.
    read_ns: Nanos = -COMPASS_NS
    heading_deg: float = 0.0
    pitch_deg: float = 0.0

    def command(self, value: int) -> None:
        """Set the mode (TCM2); calibrations keep it, a reset switches off."""
        if value in {CompassMode.OFF, CompassMode.SOFT_RESET}:
            self.mode = CompassMode.OFF
        elif value in {CompassMode.IN_SIP, CompassMode.CONTINUOUS}:
            self.mode = CompassMode(value)

    def is_due(self, now: Nanos) -> bool:
        """Tell whether the module has a new reading."""
        return now - self.read_ns >= COMPASS_NS

    def read(self, heading_rad: float, pitch_rad: float, error_deg: float, now: Nanos) -> None:
        """Take a reading of how the body stands."""
        self.heading_deg = (error_deg - math.degrees(heading_rad)) % 360
        self.pitch_deg = math.degrees(pitch_rad)
        self.read_ns = now

    @property
    def raw_compass(self) -> int:
        """The packet's byte, 2 degrees; 0 without the module or with it off."""
        return round(self.heading_deg / 2) % 180 if self.is_fitted and self.mode is not CompassMode.OFF else 0

    def packet(self) -> CompassPacket:
        """Return a TCM2pac."""
        heading = math.radians(self.heading_deg)
        return CompassPacket(
            raw_compass=round(self.heading_deg * 10) % 3600, raw_pitch=round(self.pitch_deg * 10),
            raw_x=round(FIELD_UT[0] * math.cos(heading) * 100), raw_y=round(-FIELD_UT[0] * math.sin(heading) * 100),
            raw_z=round(FIELD_UT[1] * 100), raw_temperature=200,
        )  # fmt: skip


@dataclass(slots=True)
class Gyro:
    """The gyro: readings wait here for the next GYROpac."""

    is_fitted: bool = True
    is_on: bool = False
    next_ns: Nanos = 0
    readings: tuple[int, ...] = ()

    def switch(self, *, on: bool, now: Nanos) -> None:
        """Start or stop sampling (GYRO)."""
        if on and not self.is_on:
            self.next_ns = now + GYRO_SAMPLE_NS
            self.readings = ()
        self.is_on = on and self.is_fitted

    def sample(self, turn_rad_s: float, error_counts: float) -> None:
        """Take the reading that is due."""
        counts = GYRO_CENTRE - math.degrees(turn_rad_s) / (GYRO_DEG_S_PER_COUNT * GYRO_SCALER) + error_counts
        self.readings = (*self.readings, min(max(round(counts), 0), 1023))[-MOST_READINGS:]
        self.next_ns += GYRO_SAMPLE_NS

    def take_packet(self) -> GyroPacket:
        """Return the readings since the last packet, and forget them."""
        readings, self.readings = self.readings, ()
        return GyroPacket(
            readings=tuple(GyroReading(raw_rate=raw, raw_temperature=GYRO_TEMPERATURE) for raw in readings)
        )
