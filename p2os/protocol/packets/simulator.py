"""Packets that only simulators send: SIMSTAT, SIMINFO, laser readings, a changed map.

Source: MobileSim's continuation AMRISim and ARIA, from what they write and read.
No robot sends these; a client that sees one talks to a simulator.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import ClassVar

from construct import (
    Array,
    Construct,
    Int8sl,
    Int8ul,
    Int16sl,
    Int16ul,
    Int32sl,
    Int32ul,
    Struct,
    this,
)

from p2os.errors import LocalProtocolError
from p2os.protocol.fields import part
from p2os.protocol.frames import Frame
from p2os.protocol.packets.layout import TEXT, LaidOutPacket, build, parse


@dataclass(frozen=True, slots=True, kw_only=True)
class SimstatPacket(LaidOutPacket):
    """SIMSTAT: the simulator's clock and the true pose, as asked for by SIM_STAT.

    Intervals in ms, the true position in mm, its heading in degrees; latitude,
    longitude and odometry errors in 1e-7, the altitude in cm. `raw_precision`
    is 100 times the dilution of precision, 0 for a bad fix, -1 for none.
    """

    NAME: ClassVar[str] = "SIMSTAT"
    KIND: ClassVar[int] = 0x62
    LAYOUT: ClassVar[Construct] = Struct(
        part("raw_name", TEXT, "of the simulator"),
        part("raw_version", TEXT, "of it"),
        part("flags", Int32ul, "bit 1 the map has a geographic origin, bit 2 the odometry has errors"),
        part("wanted_interval_ms", Int16ul, "ms"),
        part("real_interval_ms", Int16ul, "ms"),
        part("last_interval_ms", Int16ul, "ms"),
        part("x_mm", Int32sl, "true position"),
        part("y_mm", Int32sl, "true position"),
        part("z_mm", Int32sl, "true position"),
        part("heading_deg", Int32sl, "true heading"),
        part("raw_latitude", Int32sl, "1e-7°"),
        part("raw_longitude", Int32sl, "1e-7°"),
        part("altitude_cm", Int32sl, "cm"),
        part("raw_precision", Int32sl, "100 times the dilution of precision; 0 a bad fix, −1 none"),
        part("raw_error_x", Int32sl, "1e-7"),
        part("raw_error_y", Int32sl, "1e-7"),
        part("raw_error_heading", Int32sl, "1e-7"),
    )
    #: Bits of `flags`: the map has a geographic origin; the odometry has an error of its own.
    HAS_GEOGRAPHIC_ORIGIN: ClassVar[int] = 1 << 1
    HAS_ODOMETRY_ERROR: ClassVar[int] = 1 << 2

    raw_name: bytes = b""
    raw_version: bytes = b""
    flags: int = 0
    wanted_interval_ms: int = 0
    real_interval_ms: int = 0
    last_interval_ms: int = 0
    x_mm: int = 0
    y_mm: int = 0
    z_mm: int = 0
    heading_deg: int = 0
    raw_latitude: int = 0
    raw_longitude: int = 0
    altitude_cm: int = 0
    raw_precision: int = -1
    raw_error_x: int = 0
    raw_error_y: int = 0
    raw_error_heading: int = 0
    #: Bytes after the last field that this project knows.
    rest: bytes = b""


@dataclass(frozen=True, slots=True, kw_only=True)
class SimDevice:
    """A device that the simulator has on a robot."""

    raw_name: bytes
    raw_type: bytes
    number: int
    status: int


@dataclass(frozen=True, slots=True, kw_only=True)
class SiminfoPacket(LaidOutPacket):
    """SIMINFO: which simulator it is and what the robot carries.

    Args:
        flags: Bit 0 it has a window, bit 1 it was restarted after a crash.
        devices: In its own order.
    """

    NAME: ClassVar[str] = "SIMINFO"
    KIND: ClassVar[int] = 0x63
    COUNTS: ClassVar[Mapping[str, str]] = {"count": "devices"}
    LAYOUT: ClassVar[Construct] = Struct(
        part("raw_name", TEXT, "of the simulator or device"),
        part("raw_version", TEXT, "of it"),
        part("flags", Int32ul, "bit 0 it has a window, bit 1 it was restarted after a crash"),
        part("count", Int32ul, "devices that follow"),
        part(
            "devices",
            Array(
                this.count,
                Struct(
                    part("raw_name", TEXT, "of the simulator or device"),
                    part("raw_type", TEXT, "of the device"),
                    part("number", Int8ul, "of its type"),
                    part("status", Int32ul, "as the simulator says it"),
                ),
            ),
        ),
    )
    ITEM: ClassVar[type] = SimDevice

    raw_name: bytes = b""
    raw_version: bytes = b""
    flags: int = 0
    devices: tuple[SimDevice, ...] = ()
    #: Bytes after the last field that this project knows.
    rest: bytes = b""


@dataclass(frozen=True, slots=True, kw_only=True)
class SimLaserPacket:
    """Some readings of a simulated laser, the old kind (0x60) or the extended one (0x61).

    Args:
        is_extended: Whether reflectances travel and the pose does not.
        raw_pose: x and y in mm, heading in degrees as 16 bits; only of the old kind.
        total: How many readings a whole sweep has.
        first: The number of the first reading in this packet, from 0.
        ranges_mm: Readings of this packet.
        reflectances: One a reading, of the extended kind only.
        flags_of_readings: Two reserved bytes a reading, of the extended kind only.
        laser: Which laser, extended kind only.
        flags: Bit 0 the robot has moved since, extended kind only.
    """

    KINDS: ClassVar[tuple[int, int]] = (0x60, 0x61)
    LAYOUT: ClassVar[Construct] = Struct(
        part("raw_pose", Array(3, Int16sl), "x, y (mm), heading (°)"),
        part("total", Int16ul, "readings of the whole sweep"),
        part("first", Int16ul, "number of the first reading here"),
        part("count", Int8ul, "readings that follow"),
        part("ranges_mm", Array(this.count, Int16ul), "mm"),
    )
    EXTENDED_LAYOUT: ClassVar[Construct] = Struct(
        part("total", Int16ul, "readings of the whole sweep"),
        part("first", Int16ul, "number of the first reading here"),
        part("count", Int8ul, "readings that follow"),
        part(
            "readings",
            Array(
                this.count,
                Struct(
                    part("range_mm", Int16ul, "mm"),
                    part("reflectance", Int8ul, "0 none"),
                    part("flags", Int16ul, "reserved; at the end: bit 0 the robot has moved since"),
                ),
            ),
        ),
        part("laser", Int8ul, "which one"),
        part("flags", Int8ul, "reserved; at the end: bit 0 the robot has moved since"),
    )

    is_extended: bool = False
    raw_pose: tuple[int, ...] = (0, 0, 0)
    total: int = 0
    first: int = 0
    ranges_mm: tuple[int, ...] = ()
    reflectances: tuple[int, ...] = ()
    flags_of_readings: tuple[int, ...] = ()
    laser: int = 0
    flags: int = 0
    #: Bytes after the last field that this project knows.
    rest: bytes = b""

    def to_frame(self) -> Frame:
        """Return the frame.

        Raises:
            LocalProtocolError: A value does not fit its field, or the lists have different lengths.
        """
        fields = {**asdict(self), "count": len(self.ranges_mm)}
        if not self.is_extended:
            return build(self.KINDS[0], self.LAYOUT, fields)
        if not len(self.ranges_mm) == len(self.reflectances) == len(self.flags_of_readings):
            raise LocalProtocolError("each reading of an extended laser packet has a range, a reflectance and flags")
        rows = zip(self.ranges_mm, self.reflectances, self.flags_of_readings, strict=True)
        fields["readings"] = [dict(zip(("range_mm", "reflectance", "flags"), row, strict=True)) for row in rows]
        return build(self.KINDS[1], self.EXTENDED_LAYOUT, fields)

    @classmethod
    def from_frame(cls, frame: Frame) -> "SimLaserPacket":
        """Read the packet of either kind.

        Raises:
            RemoteProtocolError: It is shorter than its count says.
        """
        is_extended = frame.kind == cls.KINDS[1]
        found = parse(cls.EXTENDED_LAYOUT if is_extended else cls.LAYOUT, frame)
        shared = {"total": found["total"], "first": found["first"], "rest": found["rest"]}
        if not is_extended:
            return cls(raw_pose=tuple(found["raw_pose"]), ranges_mm=tuple(found["ranges_mm"]), **shared)
        return cls(
            is_extended=True,
            ranges_mm=tuple(reading.range_mm for reading in found["readings"]),
            reflectances=tuple(reading.reflectance for reading in found["readings"]),
            flags_of_readings=tuple(reading.flags for reading in found["readings"]),
            laser=found["laser"],
            flags=found["flags"],
            **shared,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class MapChangedPacket(LaidOutPacket):
    """The simulator has loaded another map.

    Args:
        by_user: 1 where a person did it, 0 where a client did.
        status: As the simulator says it; negative where it failed.
        raw_name: The map's file.
    """

    NAME: ClassVar[str] = "SIMMAPCHANGED"
    KIND: ClassVar[int] = 0x66
    LAYOUT: ClassVar[Construct] = Struct(
        part("by_user", Int8ul, "1 a person did it, 0 a client"),
        part("status", Int8sl, "negative where it failed"),
        part("raw_name", TEXT, "its file"),
    )

    by_user: int = 0
    status: int = 0
    raw_name: bytes = b""
    #: Bytes after the last field that this project knows.
    rest: bytes = b""
