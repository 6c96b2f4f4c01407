"""CONFIGpac, type 0x20: the robot's FLASH parameters.

Source: Pioneer 2/3 H8 manual, CONFIGpac table; Pioneer 3 manual for the fields
that ARCOS appended. Firmware only ever appends, so a packet is cut after the
last field that its firmware knows; what was not sent reads as 0 or "".

Invariant: `ConfigPacket.from_frame(packet.to_frame()) == packet`.
"""

from dataclasses import dataclass

from construct import (
    ConstructError,
    FormatField,
    GreedyBytes,
    Int8sl,
    Int8ul,
    Int16sl,
    Int16ul,
    Int32ul,
    NullTerminated,
    Struct,
)

from p2os.errors import LocalProtocolError
from p2os.protocol.frames import Frame

CONFIG_KIND = 0x20
_TEXT = NullTerminated(GreedyBytes)

#: Every field in the order of the wire: name, type, meaning beyond the name.
_ROWS = (
    ("robot_class", _TEXT, "`Pioneer`"), ("subclass", _TEXT, "the model, such as `p2dx`"),
    ("serial", _TEXT, "`SIM` in a simulator"), ("four_motors", Int8ul, "1 on an AT with P2OS"),
    ("rotveltop", Int16ul, "°/s"), ("transveltop", Int16ul, "mm/s"), ("rotacctop", Int16ul, "°/s²"),
    ("transacctop", Int16ul, "mm/s²"), ("pwmmax", Int16ul, "500 is full"), ("name", _TEXT, "of the robot"),
    ("sipcycle", Int8ul, "ms"), ("hostbaud", Int8ul, "as HOSTBAUD"), ("auxbaud", Int8ul, "as HOSTBAUD"),
    ("gripper", Int16ul, ""), ("frontsonar", Int16ul, ""), ("rearsonar", Int8ul, "one byte, unlike the front's"),
    ("lowbattery", Int16ul, "0.1 V"), ("revcount", Int16ul, "counts a turn of the robot"),
    ("watchdog", Int16ul, "ms"), ("p2mpacs", Int8ul, "1: another SIP that nobody has described"),
    ("stallval", Int16ul, ""), ("stallcount", Int16ul, "ms"), ("joyvel", Int16ul, "mm/s"),
    ("joyrvel", Int16ul, "°/s"), ("rotvelmax", Int16ul, "°/s"), ("transvelmax", Int16ul, "mm/s"),
    ("rotacc", Int16ul, "°/s²"), ("rotdecel", Int16ul, "°/s²"), ("rotkp", Int16ul, ""), ("rotkv", Int16ul, ""),
    ("rotki", Int16ul, ""), ("transacc", Int16ul, "mm/s²"), ("transdecel", Int16ul, "mm/s²"),
    ("transkp", Int16ul, ""), ("transkv", Int16ul, ""), ("transki", Int16ul, ""), ("frontbumps", Int8ul, "segments"),
    ("rearbumps", Int8ul, "segments"), ("charger", Int8ul, "1 P3, 2 PowerBot"), ("sonarcycle", Int8ul, "ms"),
    ("autobaud", Int8ul, "1: HOSTBAUD works, 2: raise it by itself"),
    ("hasgyro", Int8ul, "1: GYROpac, 2: used inside"), ("driftfactor", Int16sl, ""),
    ("aux2baud", Int8ul, "as HOSTBAUD"), ("aux3baud", Int8ul, "as HOSTBAUD"), ("ticksmm", Int16ul, "counts a mm"),
    ("shutdownvolts", Int16ul, "0.1 V"), ("firmware_version", _TEXT, ""), ("gyrocw", Int16ul, ""),
    ("gyroccw", Int16ul, ""), ("kinematicsdelay", Int8ul, "ms"), ("latveltop", Int16ul, "mm/s"),
    ("latacctop", Int16ul, "mm/s²"), ("latvelmax", Int16ul, "mm/s"), ("latacc", Int16ul, "mm/s²"),
    ("latdecel", Int16ul, "mm/s²"), ("chargethreshold", Int16ul, ""), ("pdbport", Int8ul, ""),
    ("gyroratelimit", Int16ul, ""), ("hightemp", Int8sl, "°C, −128 none"), ("powerbits", Int16ul, ""),
    ("batterytype", Int8ul, "2: state of charge"), ("soclow", Int16ul, ""), ("socshutdown", Int16ul, ""),
    ("bootloader_version", _TEXT, ""), ("configflags", Int32ul, ""), ("gyrofw", Int16sl, ""),
)  # fmt: skip
FIELDS = tuple((name, kind) for name, kind, _ in _ROWS)
MEANINGS = {name: means for name, _, means in _ROWS}

#: Field that is a number → least and most that it holds.
NUMBERS = {
    name: (-(1 << bits - 1), (1 << bits - 1) - 1) if kind.fmtstr[-1].islower() else (0, (1 << bits) - 1)
    for name, kind in FIELDS
    if isinstance(kind, FormatField)
    for bits in (8 * kind.sizeof(),)
}
#: Field counts at which known firmware stops: P2OS and AROS before 1.6, AROS 1.6, 1.7 and 1.8, AMRISim, ARCOS.
P2OS_FIELDS, AROS_1_6_FIELDS, AROS_1_7_FIELDS, AROS_1_8_FIELDS = 36, 38, 39, 42
AMRISIM_FIELDS, ARCOS_FIELDS = 57, len(FIELDS)
_LAYOUT = Struct(*(name / kind for name, kind in FIELDS)).compile()
#: More NULs than all fields need: a cut packet reads as zeros and empty strings.
_PADDING = bytes(256)


@dataclass(frozen=True, slots=True, kw_only=True)
class ConfigPacket:
    """The robot's parameters.

    Speeds in mm/s and deg/s, accelerations in mm/s2 and deg/s2, `sipcycle`,
    `watchdog`, `stallcount` and `sonarcycle` in ms, `lowbattery` and
    `shutdownvolts` in 0.1 V; baud codes 0 to 4 for 9600 to 115200.
    """

    robot_class: str = "Pioneer"
    subclass: str = ""
    serial: str = ""
    four_motors: int = 0
    rotveltop: int = 0
    transveltop: int = 0
    rotacctop: int = 0
    transacctop: int = 0
    #: 500 is full.
    pwmmax: int = 0
    name: str = ""
    sipcycle: int = 0
    hostbaud: int = 0
    auxbaud: int = 0
    gripper: int = 0
    frontsonar: int = 0
    #: One byte on the wire, unlike the front's two.
    rearsonar: int = 0
    lowbattery: int = 0
    #: Differential encoder counts a turn of the robot.
    revcount: int = 0
    watchdog: int = 0
    #: 1: an alternative SIP that nobody has described.
    p2mpacs: int = 0
    stallval: int = 0
    stallcount: int = 0
    joyvel: int = 0
    joyrvel: int = 0
    rotvelmax: int = 0
    transvelmax: int = 0
    rotacc: int = 0
    rotdecel: int = 0
    rotkp: int = 0
    rotkv: int = 0
    rotki: int = 0
    transacc: int = 0
    transdecel: int = 0
    transkp: int = 0
    transkv: int = 0
    transki: int = 0
    frontbumps: int = 0
    rearbumps: int = 0
    charger: int = 0
    sonarcycle: int = 0
    #: 1: HOSTBAUD can change the rate; 2: a client should raise it by itself.
    autobaud: int = 0
    hasgyro: int = 0
    driftfactor: int = 0
    aux2baud: int = 0
    aux3baud: int = 0
    ticksmm: int = 0
    shutdownvolts: int = 0
    firmware_version: str = ""
    gyrocw: int = 0
    gyroccw: int = 0
    kinematicsdelay: int = 0
    latveltop: int = 0
    latacctop: int = 0
    latvelmax: int = 0
    latacc: int = 0
    latdecel: int = 0
    chargethreshold: int = 0
    pdbport: int = 0
    gyroratelimit: int = 0
    #: Degrees Celsius; -128 where the robot has no such limit.
    hightemp: int = -128
    powerbits: int = 0
    batterytype: int = 0
    soclow: int = 0
    socshutdown: int = 0
    bootloader_version: str = ""
    configflags: int = 0
    gyrofw: int = 0
    #: How many fields are on the wire, counted from the first.
    fields_sent: int = P2OS_FIELDS
    #: Bytes after the last whole field: half of one that was cut, or fields that this project does not know.
    rest: bytes = b""

    def to_frame(self) -> Frame:
        """Return the frame with the first `fields_sent` fields.

        Raises:
            LocalProtocolError: A value does not fit its field, or the packet does not fit a frame.
        """
        data = b""
        for name, kind in FIELDS[: self.fields_sent]:
            value = getattr(self, name)
            try:
                data += kind.build(value.encode("latin-1") if kind is _TEXT else value)
            except (ConstructError, UnicodeEncodeError) as error:
                raise LocalProtocolError(f"CONFIGpac: {name} = {value!r} does not fit its field") from error
        return Frame(bytes((CONFIG_KIND,)) + data + self.rest)

    @classmethod
    def from_frame(cls, frame: Frame) -> "ConfigPacket":
        """Read the fields that were sent; a field cut in the middle counts as not sent and reads as 0 or ""."""
        data = frame.data
        values = _LAYOUT.parse(data + _PADDING)
        sent, end = 0, 0
        for name, kind in FIELDS:
            after = end + (len(values[name]) + 1 if kind is _TEXT else kind.sizeof())
            if after > len(data):
                break
            sent, end = sent + 1, after
        known = {
            name: values[name].decode("latin-1") if kind is _TEXT else values[name] for name, kind in FIELDS[:sent]
        }
        return cls(**{"robot_class": "", **known}, fields_sent=sent, rest=data[end:])
