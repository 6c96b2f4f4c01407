"""Packets of the robot's own sensors: encoders, gyro, compass, inputs and outputs.

Source: Pioneer 2 / PeopleBot manual page 48 and Pioneer 3 manual page 46
(ENCODERpac), Pioneer 3 manual page 50 (IOpac), ARIA (GYROpac), Pioneer 2 TCM2
manual page 13 (compass). Values are those of the wire; properties are in units.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import ClassVar

from construct import Array, Construct, Int8ul, Int16sl, Int16ul, Int32sl, Struct, this

from p2os.protocol.fields import part
from p2os.protocol.frames import Frame
from p2os.protocol.packets.layout import LaidOutPacket, build, parse

#: The analog inputs of an IOpac: 0 to 1023 for 0 to 5 V.
ANALOG_FULL_SCALE, ANALOG_FULL_SCALE_V = 1023, 5.0
#: A gyro at rest reads about this, of 0 to 1023; less is counter-clockwise (ARIA).
GYRO_CENTRE = 512
#: ARIA's conversion of a gyro count to degrees a second, before the robot's own GyroScaler.
GYRO_DEG_S_PER_COUNT = 5 / 1023 * 300 / 2.5


@dataclass(frozen=True, slots=True, kw_only=True)
class EncoderPacket(LaidOutPacket):
    """ENCODERpac: both wheels' encoder counts since the robot was switched on, signed 32 bits."""

    NAME: ClassVar[str] = "ENCODERpac"
    KIND: ClassVar[int] = 0x90
    LAYOUT: ClassVar[Construct] = Struct(
        part("left_counts", Int32sl, "left wheel's encoder since power-on"),
        part("right_counts", Int32sl, "right wheel's"),
    )

    left_counts: int
    right_counts: int
    #: Bytes after the last field that this project knows.
    rest: bytes = b""


@dataclass(frozen=True, slots=True, kw_only=True)
class GyroReading:
    """One sample of the gyro, 25 ms after the one before.

    Args:
        raw_rate: 0 to 1023, about 512 at rest; less is counter-clockwise.
        raw_temperature: 0 to 255, uncalibrated.
    """

    raw_rate: int
    raw_temperature: int

    def rate_deg_s(self, centre: float = GYRO_CENTRE, scaler: float = 1.626) -> float:
        """Return the rate of turn in deg/s, + counter-clockwise.

        Args:
            centre: The counts at rest, best averaged over a few seconds of standing still.
            scaler: The robot's GyroScaler, 1.626 on all known models.
        """
        return -(self.raw_rate - centre) * GYRO_DEG_S_PER_COUNT * scaler


@dataclass(frozen=True, slots=True, kw_only=True)
class GyroPacket(LaidOutPacket):
    """GYROpac: the readings since the last packet, oldest first; ARCOS sends it just before the SIP."""

    NAME: ClassVar[str] = "GYROpac"
    KIND: ClassVar[int] = 0x98
    COUNTS: ClassVar[Mapping[str, str]] = {"count": "readings"}
    LAYOUT: ClassVar[Construct] = Struct(
        part("count", Int8ul, "readings that follow, 25 ms apart, oldest first"),
        part(
            "readings",
            Array(
                this.count,
                Struct(
                    part("raw_rate", Int16ul, "0 to 1023, about 512 at rest, less is counter-clockwise"),
                    part("raw_temperature", Int8ul, "uncalibrated"),
                ),
            ),
        ),
    )
    ITEM: ClassVar[type] = GyroReading

    readings: tuple[GyroReading, ...] = ()
    #: Bytes after the last field that this project knows.
    rest: bytes = b""


@dataclass(frozen=True, slots=True, kw_only=True)
class CompassPacket:
    """TCM2pac: a reading of the TCM2 compass module.

    Angles and the temperature in 0.1 degrees, the field in 0.01 uT. The byte that
    counts the others is listed by the manual and has not been seen on a wire:
    `raw_size` is None when a packet comes without it.
    """

    NAME: ClassVar[str] = "TCM2pac"
    KIND: ClassVar[int] = 0xC0
    READING: ClassVar[Construct] = Struct(
        part("raw_compass", Int16ul, "0.1°"),
        part("raw_pitch", Int16sl, "0.1°"),
        part("raw_roll", Int16sl, "0.1°"),
        part("raw_x", Int16sl, "0.01 µT"),
        part("raw_y", Int16sl, "0.01 µT"),
        part("raw_z", Int16sl, "0.01 µT"),
        part("raw_temperature", Int16sl, "0.1 °C"),
        part("error_bits", Int16ul, "bits"),
        part("h_score", Int8ul, "of a calibration"),
        part("v_score", Int8ul, "of a calibration"),
        part("raw_m_score", Int16ul, "of a calibration, 0.01"),
    )
    LAYOUT: ClassVar[Construct] = Struct(
        part(
            "raw_size",
            Int8ul,
            "23 in the manual, which counts more than follows; not seen on a wire, so a packet of 20 bytes "
            "is read without it",
        ),
        *READING.subcons,
    )
    #: Bytes of a reading without its size byte.
    READING_BYTES: ClassVar[int] = 20

    raw_compass: int
    raw_pitch: int = 0
    raw_roll: int = 0
    raw_x: int = 0
    raw_y: int = 0
    raw_z: int = 0
    raw_temperature: int = 0
    error_bits: int = 0
    h_score: int = 0
    v_score: int = 0
    raw_m_score: int = 0
    #: 23 in the manual.
    raw_size: int | None = 23
    #: Bytes after the last field that this project knows.
    rest: bytes = b""

    @property
    def heading_deg(self) -> float:
        """The compass, degrees."""
        return self.raw_compass / 10

    @property
    def pitch_deg(self) -> float:
        """Pitch, degrees."""
        return self.raw_pitch / 10

    @property
    def roll_deg(self) -> float:
        """Roll, degrees."""
        return self.raw_roll / 10

    @property
    def field_ut(self) -> tuple[float, float, float]:
        """The magnetic field along x, y and z, microtesla."""
        return self.raw_x / 100, self.raw_y / 100, self.raw_z / 100

    @property
    def temperature_c(self) -> float:
        """The module's temperature, degrees Celsius."""
        return self.raw_temperature / 10

    def to_frame(self) -> Frame:
        """Return the frame.

        Raises:
            LocalProtocolError: A value does not fit its field.
        """
        return build(self.KIND, self.READING if self.raw_size is None else self.LAYOUT, asdict(self))

    @classmethod
    def from_frame(cls, frame: Frame) -> "CompassPacket":
        """Read the packet, with its size byte or without.

        Raises:
            RemoteProtocolError: It is too short.
        """
        if len(frame.data) == cls.READING_BYTES:
            return cls(**parse(cls.READING, frame), raw_size=None)
        return cls(**parse(cls.LAYOUT, frame))


@dataclass(frozen=True, slots=True, kw_only=True)
class IoPacket(LaidOutPacket):
    """IOpac: digital inputs and outputs and analog inputs.

    ARCOS sends four bytes of inputs (DIGIN, front bumpers, rear bumpers, infra-red;
    their order has not been seen on a wire), one of outputs and nine analog
    values, the battery last. Bumpers are raw here: low is pressed.
    """

    NAME: ClassVar[str] = "IOpac"
    KIND: ClassVar[int] = 0xF0
    COUNTS: ClassVar[Mapping[str, str]] = {
        "input_count": "digital_in",
        "output_count": "digital_out",
        "analog_count": "raw_analog",
    }
    LAYOUT: ClassVar[Construct] = Struct(
        part("input_count", Int8ul, "4 on ARCOS"),
        part(
            "digital_in",
            Array(this.input_count, Int8ul),
            "DIGIN, front bumpers, rear bumpers, infra-red (order not seen on a wire); bumpers raw, low is pressed",
        ),
        part("output_count", Int8ul, "1 on ARCOS"),
        part("digital_out", Array(this.output_count, Int8ul), "as in the SIP"),
        part("analog_count", Int8ul, "9 on ARCOS"),
        part("raw_analog", Array(this.analog_count, Int16ul), "0 to 1023 for 0 to 5 V; the last is the battery"),
    )

    digital_in: tuple[int, ...] = ()
    digital_out: tuple[int, ...] = ()
    #: 0 to 1023 for 0 to 5 V.
    raw_analog: tuple[int, ...] = ()
    #: Bytes after the last field that this project knows.
    rest: bytes = b""

    @property
    def analog_v(self) -> tuple[float, ...]:
        """The analog inputs, volts at the pin."""
        return tuple(raw * ANALOG_FULL_SCALE_V / ANALOG_FULL_SCALE for raw in self.raw_analog)
