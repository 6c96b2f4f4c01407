"""Packets of what is mounted on a robot: serial ports, gripper, joystick, arm, sounds.

Source: Pioneer 2/3 H8 manual (GRIPPERpac table 11, SERAUXpac), AmigoBot manuals
pages 32 and 52 (PLAYLISTpac), ARIA (JOYSTICKpac), player (ARMpac, ARMINFOpac).
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from enum import IntFlag
from typing import ClassVar

from construct import Array, Bytes, Construct, Int8ul, Int16ul, Int32ul, Struct, this

from p2os.errors import LocalProtocolError, RemoteProtocolError
from p2os.protocol.fields import part
from p2os.protocol.frames import Frame
from p2os.protocol.packets.layout import TEXT, LaidOutPacket, build, parse


@dataclass(frozen=True, slots=True, kw_only=True)
class SerauxPacket:
    """SERAUXpac: bytes that came in at one of the robot's AUX serial ports, as GETAUX asked.

    Args:
        port: 1 to 3.
        data: 0 to 201 bytes.
    """

    #: Packet type of each port, and its name.
    KINDS: ClassVar[Mapping[int, int]] = {1: 0xB0, 2: 0xB8, 3: 0xC8}
    NAMES: ClassVar[Mapping[int, str]] = {0xB0: "SERAUXpac", 0xB8: "SERAUX2pac", 0xC8: "SERAUX3pac"}

    port: int = 1
    data: bytes = b""

    def __post_init__(self) -> None:
        if self.port not in self.KINDS:
            raise LocalProtocolError(f"there is no AUX port {self.port} (1 to 3)")

    def to_frame(self) -> Frame:
        """Return the frame.

        Raises:
            LocalProtocolError: The data does not fit a frame.
        """
        return Frame(bytes((self.KINDS[self.port],)) + self.data)

    @classmethod
    def from_frame(cls, frame: Frame) -> "SerauxPacket":
        """Read the packet; there is no length inside."""
        return cls(port={kind: port for port, kind in cls.KINDS.items()}[frame.kind], data=frame.data)


class GripperState(IntFlag):
    """The bits of GRIPPERpac's state (Pioneer 2/3 H8 manual, table 11)."""

    #: The paddles' open limit; 0 = fully open.
    PADDLES_NOT_OPEN = 1 << 0
    #: The lift's limits; 0 = at one of its ends.
    LIFT_NOT_AT_END = 1 << 1
    #: 0 = the outer light beam is broken.
    OUTER_BEAM_FREE = 1 << 2
    #: 0 = the inner light beam is broken.
    INNER_BEAM_FREE = 1 << 3
    #: 0 = the left paddle grasps.
    LEFT_PADDLE_FREE = 1 << 4
    #: 0 = the right paddle grasps.
    RIGHT_PADDLE_FREE = 1 << 5
    LIFT_MOVING = 1 << 6
    GRIPPER_MOVING = 1 << 7


_STATE_BITS = "bits: " + ", ".join(
    f"{bit.value.bit_length() - 1} {(bit.name or '').lower().replace('_', ' ')}" for bit in GripperState
)


@dataclass(frozen=True, slots=True, kw_only=True)
class GripperPacket(LaidOutPacket):
    """GRIPPERpac: what kind of gripper there is and what it does.

    Args:
        gripper_type: 0 none, 1 on the user I/O, 2 on the general I/O.
        state: See `GripperState`.
        grasp_time: In the robot's own units.
    """

    NAME: ClassVar[str] = "GRIPPERpac"
    KIND: ClassVar[int] = 0xE0
    LAYOUT: ClassVar[Construct] = Struct(
        part("gripper_type", Int8ul, "0 none, 1 on the user I/O, 2 on the general I/O"),
        part("state", Int8ul, _STATE_BITS),
        part("grasp_time", Int8ul, "in the robot's own units"),
    )

    gripper_type: int = 0
    state: int = 0
    grasp_time: int = 0
    #: Bytes after the last field that this project knows.
    rest: bytes = b""

    @property
    def flags(self) -> GripperState:
        """The state by the names of its bits."""
        return GripperState(self.state)


@dataclass(frozen=True, slots=True, kw_only=True)
class JoystickPacket(LaidOutPacket):
    """JOYSTICKpac: the joystick plugged into the robot.

    Axes and throttle are 0 to 1023, 512 in the middle. ARIA turns the sign of x.
    """

    NAME: ClassVar[str] = "JOYSTICKpac"
    KIND: ClassVar[int] = 0xF8
    LAYOUT: ClassVar[Construct] = Struct(
        part("button1", Int8ul, "1 pressed"),
        part("button2", Int8ul, "1 pressed"),
        part("raw_x", Int16ul, "0 to 1023, 512 in the middle"),
        part("raw_y", Int16ul, "as x"),
        part("raw_throttle", Int16ul, "0 to 1023"),
    )

    button1: int = 0
    button2: int = 0
    raw_x: int = 512
    raw_y: int = 512
    raw_throttle: int = 0
    #: Bytes after the last field that this project knows.
    rest: bytes = b""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sound:
    """One row of the robot's list of sounds.

    Args:
        number: What SOUND plays it by.
        toggle: Whether it may be played; as the robot says it.
        raw_name: 16 bytes, NUL at the end unless all are used; "~" marks a group.
        offset: Where it starts in the robot's memory, bytes.
        length: Bytes.
    """

    number: int
    toggle: int
    raw_name: bytes
    offset: int
    length: int

    @property
    def name(self) -> str:
        """The name up to its NUL."""
        return self.raw_name.split(b"\0")[0].decode("latin-1")


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaylistPacket:
    """PLAYLISTpac: one sound of an AmigoBot, or None from a robot that has no sounds (25 NUL bytes)."""

    NAME: ClassVar[str] = "PLAYLISTpac"
    KIND: ClassVar[int] = 0xD0
    LAYOUT: ClassVar[Construct] = Struct(
        part("number", Int8ul, "what SOUND plays it by"),
        part("toggle", Int8ul, "as the robot says it"),
        part("raw_name", Bytes(16), "NUL at the end unless all are used; `~` marks a group"),
        part("offset", Int32ul, "in the robot's memory"),
        part("length", Int32ul, "bytes"),
    )
    #: What AROS sends when there are no sounds (Pioneer 2/3 H8 manual).
    NO_SOUNDS: ClassVar[bytes] = bytes(25)

    sound: Sound | None = None
    #: Bytes after the last field that this project knows.
    rest: bytes = b""

    def to_frame(self) -> Frame:
        """Return the frame.

        Raises:
            LocalProtocolError: A value does not fit its field.
        """
        if self.sound is None:
            return Frame(bytes((self.KIND,)) + self.NO_SOUNDS)
        return build(self.KIND, self.LAYOUT, {**asdict(self.sound), "rest": self.rest})

    @classmethod
    def from_frame(cls, frame: Frame) -> "PlaylistPacket":
        """Read the packet.

        Raises:
            RemoteProtocolError: It is too short.
        """
        if frame.data == cls.NO_SOUNDS:
            return cls()
        found = parse(cls.LAYOUT, frame)
        rest = found.pop("rest")
        return cls(sound=Sound(**found), rest=rest)


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmPacket(LaidOutPacket):
    """ARMpac: the state of the Pioneer Arm.

    Args:
        status: Bit 0 power on, bit 1 connected.
        moving: Bit per joint, joint 1 in bit 0.
        positions: Six joints, 0 to 255 in the servo's counts.
    """

    NAME: ClassVar[str] = "ARMpac"
    KIND: ClassVar[int] = 0xA0
    LAYOUT: ClassVar[Construct] = Struct(
        part("status", Int8ul, "bit 0 power, bit 1 connected"),
        part("moving", Int8ul, "a bit a joint, joint 1 in bit 0"),
        part("positions", Array(6, Int8ul), "servo counts of joints 1 to 6"),
    )

    status: int = 0
    moving: int = 0
    positions: tuple[int, ...] = (0,) * 6
    #: Bytes after the last field that this project knows.
    rest: bytes = b""


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmJoint:
    """What a joint of the arm can do; positions in the servo's counts, 0 to 255."""

    speed: int
    home: int
    least: int
    centre: int
    most: int
    #: Counts that turn the joint by 90 degrees.
    ticks_per_90: int


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmInfoPacket(LaidOutPacket):
    """ARMINFOpac: the arm's firmware and what each joint can do."""

    NAME: ClassVar[str] = "ARMINFOpac"
    KIND: ClassVar[int] = 0xA1
    COUNTS: ClassVar[Mapping[str, str]] = {"count": "joints"}
    LAYOUT: ClassVar[Construct] = Struct(
        part("raw_version", TEXT, "the arm's firmware"),
        part("count", Int8ul, "joints that follow"),
        part("joints", Array(this.count, Struct(
            part("speed", Int8ul, "set speed"), part("home", Int8ul, "position"), part("least", Int8ul, "position"),
            part("centre", Int8ul, "position"), part("most", Int8ul, "position"),
            part("ticks_per_90", Int8ul, "counts of 90°"),
        ))),
    )  # fmt: skip
    ITEM: ClassVar[type] = ArmJoint

    raw_version: bytes = b""
    joints: tuple[ArmJoint, ...] = ()
    #: Bytes after the last field that this project knows.
    rest: bytes = b""

    @property
    def version(self) -> str:
        """The arm's firmware."""
        return self.raw_version.decode("latin-1")


@dataclass(frozen=True, slots=True, kw_only=True)
class BatteryPacket(LaidOutPacket):
    """Battery packet 0xFA: a row of bytes for each battery.

    The bytes of a row are flags 1, flags 2, flags 3, relative and absolute state
    of charge in percent; firmware may send fewer or more.
    """

    NAME: ClassVar[str] = "BATTERYpac"
    KIND: ClassVar[int] = 0xFA
    COUNTS: ClassVar[Mapping[str, str]] = {"count": "batteries"}
    LAYOUT: ClassVar[Construct] = Struct(
        part("count", Int8ul, "batteries"),
        part("row_bytes", Int8ul, "bytes of each"),
        part(
            "batteries",
            Array(this.count, Array(this.row_bytes, Int8ul)),
            "flags 1, 2, 3, relative and absolute charge in percent, where there are five",
        ),
    )

    batteries: tuple[tuple[int, ...], ...] = ()
    #: Bytes that each battery has.
    row_bytes: int = 5
    #: Bytes after the last field that this project knows.
    rest: bytes = b""

    def relative_charge(self, battery: int) -> int | None:
        """Return a battery's charge in percent of what it holds now, or None where it is not sent."""
        row = self.batteries[battery]
        return row[3] if len(row) > 3 else None


@dataclass(frozen=True, slots=True, kw_only=True)
class ResetNotice:
    """A controller that has just been reset says so; the session is over.

    Args:
        kind: 0xFF or 0xFE.
        data: Whatever it says beside.
    """

    KINDS: ClassVar[tuple[int, ...]] = (0xFE, 0xFF)

    kind: int = 0xFF
    data: bytes = b""

    def to_frame(self) -> Frame:
        """Return the frame.

        Raises:
            LocalProtocolError: The kind is no reset notice.
        """
        if self.kind not in self.KINDS:
            raise LocalProtocolError(f"0x{self.kind:02X} is no reset notice (0xFE, 0xFF)")
        return Frame(bytes((self.kind,)) + self.data)

    @classmethod
    def from_frame(cls, frame: Frame) -> "ResetNotice":
        """Read the notice.

        Raises:
            RemoteProtocolError: The frame is another packet.
        """
        if frame.kind not in cls.KINDS:
            raise RemoteProtocolError(f"0x{frame.kind:02X} is no reset notice")
        return cls(kind=frame.kind, data=frame.data)
