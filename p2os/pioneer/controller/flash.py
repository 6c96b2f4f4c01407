"""The robot's FLASH: what CONFIG reports and what a file may set, by the names of the CONFIGpac.

    [flash]
    name = "Wilma"
    watchdog = 1000       # ms
    sipcycle = 50         # ms
    hostbaud = 2          # 0 9600, 1 19200, 2 38400, 3 57600, 4 115200
    transvelmax = 500     # mm/s

Values that no source gives for a Pioneer 2-DX are marked as chosen.

Source: Pioneer 2/3 H8 manual and Pioneer 3 manual, CONFIGpac tables.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from p2os.errors import LocalProtocolError
from p2os.protocol.bauds import BAUDS
from p2os.protocol.config_packet import ARCOS_FIELDS, AROS_1_8_FIELDS, FIELDS, NUMBERS, P2OS_FIELDS, ConfigPacket
from p2os.protocol.profiles import Profile
from p2os.protocol.times import CYCLE_NS, WATCHDOG_NS
from p2os.robots.parameters import RobotParameters
from p2os.toml_file import read_toml, read_user_text
from simbase.errors import FileError, nearest, shown, shown_name
from simbase.timing import NS_PER_MS

#: What the robot file sets; a FLASH file cannot make another robot of it.
FIXED = frozenset({"robot_class", "subclass", "four_motors", "frontsonar", "rearsonar"})
FIELDS_OF_PROFILE = {Profile.P2OS: P2OS_FIELDS, Profile.AROS: AROS_1_8_FIELDS, Profile.ARCOS: ARCOS_FIELDS}
#: chosen: the version of each family's firmware that this robot reports.
VERSIONS = {Profile.P2OS: "1.M", Profile.AROS: "1.8", Profile.ARCOS: "2.0"}
#: Segments of a bumper ring that fit the packet.
MOST_SEGMENTS = 7

DEFAULTS: Mapping[str, int | str] = {
    "serial": "VIRTUAL",
    "name": "Virtual",
    "sipcycle": CYCLE_NS // NS_PER_MS,
    "watchdog": WATCHDOG_NS // NS_PER_MS,
    "hostbaud": 0,
    "auxbaud": 0,
    "gripper": 0,
    # chosen: ceilings and full duty cycle.
    "rotacctop": 300,
    "transacctop": 2000,
    "pwmmax": 500,
    # chosen: 11.0 V, a nearly empty lead-acid battery of nominal 12 V.
    "lowbattery": 110,
    "shutdownvolts": 0,
    # chosen: 500-tick encoders counted four times, 19.7:1 gear, 165 mm wheels: 76 counts a mm.
    "ticksmm": 76,
    # chosen: difference of both encoders over one turn on the spot, track 357 mm, in tens of counts.
    "revcount": 17048,
    # chosen: how hard and how long a wheel is stalled before the motors let go, and for how long they do.
    "stallval": 200,
    "stallcount": 200,
    # chosen: speeds at the joystick's full throw.
    "joyvel": 500,
    "joyrvel": 60,
    # Gains are reported and kept; the body's motors have their own.
    "rotkp": 20,
    "rotkv": 20,
    "rotki": 0,
    "transkp": 20,
    "transkv": 20,
    "transki": 0,
    "frontbumps": 0,
    "rearbumps": 0,
    "sonarcycle": 50,
    # 1: HOSTBAUD can change the rate; 2 would make ARIA change it unasked.
    "autobaud": 1,
    "hasgyro": 1,
    "batterytype": 0,
}


#: What a field cannot be though it fits: a baud code, segments that the packet tells, what something is divided by.
NARROWER: Mapping[str, tuple[int, int]] = {
    **dict.fromkeys(("hostbaud", "auxbaud", "aux2baud", "aux3baud"), (0, len(BAUDS) - 1)),
    **dict.fromkeys(("frontbumps", "rearbumps"), (0, MOST_SEGMENTS)),
    "sipcycle": (1, 255), "sonarcycle": (1, 255), "watchdog": (1, 65_535), "ticksmm": (1, 65_535),
}  # fmt: skip
#: Parameter → least and most of those that are numbers: what its field on the wire holds, or less.
RANGES: Mapping[str, tuple[int, int]] = {
    name: NARROWER.get(name, limits) for name, limits in NUMBERS.items() if name not in FIXED
}


class FlashError(FileError):
    """A FLASH file is missing or breaks its schema."""


@dataclass(frozen=True, slots=True)
class FlashParameters:
    """The parameters that survive a reset; `values` holds what differs from the defaults and the robot file."""

    values: Mapping[str, int | str] = field(default_factory=dict)

    def number(self, name: str) -> int:
        """Return a parameter that is a number; 0 where nothing sets it."""
        value = self.values.get(name, DEFAULTS.get(name, 0))
        return value if isinstance(value, int) else 0

    def text(self, name: str) -> str:
        """Return a parameter that is a text; empty where nothing sets it."""
        return str(self.values.get(name, DEFAULTS.get(name, "")))

    def baud(self) -> int:
        """Return the rate at which the host's line starts, bit/s."""
        return BAUDS[self.number("hostbaud")]

    def for_model(self, parameters: RobotParameters) -> "FlashParameters":
        """Return this FLASH with the bumpers of a model, where nothing else sets them."""
        equipment = parameters.equipment
        segments = {"frontbumps": equipment.front_bumpers, "rearbumps": equipment.rear_bumpers}
        fitting = {name: min(number, MOST_SEGMENTS) for name, number in segments.items()}
        return replace(self, values={**fitting, **self.values})

    def config(self, parameters: RobotParameters, profile: Profile) -> ConfigPacket:
        """Return the CONFIGpac of a robot with this FLASH."""
        start = parameters.motion
        known: dict[str, int | str] = {
            **DEFAULTS,
            "rotveltop": parameters.max_rotation_deg_s,
            "transveltop": parameters.max_velocity_mm_s,
            "rotvelmax": start.max_rotation_deg_s,
            "transvelmax": start.max_velocity_mm_s,
            "rotacc": start.rot_accel_deg_s2,
            "rotdecel": start.rot_decel_deg_s2,
            "transacc": start.accel_mm_s2,
            "transdecel": start.decel_mm_s2,
            "firmware_version": VERSIONS[profile],
            **self.values,
            "robot_class": parameters.robot_class,
            "subclass": parameters.subclass,
            "frontsonar": 1,
            "rearsonar": int(parameters.sonar_fitted > 8),
        }
        if profile is Profile.P2OS:
            known |= {"autobaud": 0, "hasgyro": 0}  # fields that its packet does not reach
        return ConfigPacket(**known, fields_sent=FIELDS_OF_PROFILE[profile])  # type: ignore[arg-type]  # checked when loaded

    def with_values(self, values: Mapping[str, int | str]) -> "FlashParameters":
        """Return this FLASH with more values.

        Raises:
            FlashError: There is no such parameter, or the value does not fit it.
        """
        names = [name for name, _ in FIELDS if name not in FIXED]
        for name, value in values.items():
            if name not in names:
                hint = nearest(name, names, "the CONFIGpac's names, in docs/pioneer.md")
                raise FlashError(f"FLASH has no parameter {shown(name)}", hint=hint)
            if isinstance(value, bool) or not isinstance(value, (int, str)):
                raise FlashError(f"FLASH: {name} = {shown(value)} is neither a whole number nor a text")
            _check(name, value)
        return replace(self, values={**self.values, **values})


def load_flash(path: Path) -> FlashParameters:
    """Read a FLASH file.

    Raises:
        FlashError: The file cannot be read, or breaks the schema.
    """
    source = shown_name(path)
    table, places = read_toml(
        read_user_text(path, "a FLASH", FlashError, hint="docs/pioneer.md shows one"), source, "a FLASH", FlashError
    )
    values = table.get("flash")
    if not isinstance(values, dict) or len(table) > 1:
        strange = next((key for key in table if key != "flash"), "flash")
        line = places.line(strange)
        raise FlashError(f"{source}:{line}: one table [flash] is wanted, and nothing else")
    flash = FlashParameters()
    for name, value in values.items():
        try:
            flash = flash.with_values({name: value})
        except FlashError as error:
            line = places.line("flash", 0, name)
            raise FlashError(f"{source}:{line}: {error}", hint=error.hint) from error
    return flash


def _check(name: str, value: int | str) -> None:
    try:
        ConfigPacket(**{name: value}, fields_sent=ARCOS_FIELDS).to_frame()  # type: ignore[arg-type]  # that is the test
    except (LocalProtocolError, AttributeError, TypeError) as error:
        least, most = RANGES.get(name, (0, 0))
        hint = f"a number of {least} to {most}" if name in RANGES else "a text"
        raise FlashError(f"FLASH: {name} = {shown(value)} does not fit its field", hint=hint) from error
    if name in RANGES:
        least, most = RANGES[name]
        if not least <= int(value) <= most:
            raise FlashError(f"FLASH: {name} = {value} is out of range: {least} to {most}")
