"""A fleet from a TOML file: the world, and one table a robot.

    world = "office"
    body = "kinematic"

    [[robot]]
    port = "tcp:127.0.0.1:8101"
    at = [0.0, 0.0, 90]               # metres, metres, degrees

    [[robot]]
    count = 3                         # three more, on the ports that follow, beside it
    errors = "realistic"

Files that it names are looked for beside it first. Every complaint names the
file, the line and the key.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import cast

from p2os.pioneer.body.factory import BEST, resolve_body
from p2os.pioneer.controller.faults import read_fault
from p2os.pioneer.controller.flash import load_flash
from p2os.pioneer.controller.settings import ControllerSettings, SonarPerSip
from p2os.pioneer.devices.laser import read_laser
from p2os.pioneer.sensor_errors import load_sensor_errors
from p2os.pioneer.serve.fleet_order import DEFAULT_PORT, MOST_ROBOTS, FleetOrder, RobotOrder, following_ports, read_aux
from p2os.pioneer.world import known_worlds
from p2os.pioneer.world.model import RANGES as WORLD_RANGES
from p2os.pioneer.world.model import Pose
from p2os.protocol.bauds import BAUDS, BAUDS_TEXT
from p2os.protocol.profiles import Profile
from p2os.robots.parameters import load_parameters
from p2os.toml_file import TomlPlaces, is_file, is_folder, read_toml, read_user_text
from simbase.errors import FileError, P2osError, UsageError, shown, shown_name
from simbase.timing import NS_PER_S, Nanos
from simbase.user_classes import located


class FleetError(FileError):
    """A fleet's file is missing or breaks its schema."""


Table = Mapping[str, object]
#: Key → the types that its value may have, and their words in a message.
KINDS: Mapping[str, tuple[tuple[type, ...], str]] = {
    "world": ((str,), "a text"),
    "body": ((str,), "a text"),
    "seed": ((int,), "a whole number"),
    "apart": ((bool,), "true or false"),
    "cross_talk": ((bool,), "true or false"),
    "worlds": ((str,), "a text"),
    "robot": ((list,), "written as [[robot]]"),
    "count": ((int,), "a whole number"),
    "port": ((str,), "a text"),
    "at": ((list,), "[x, y] or [x, y, heading] in metres and degrees"),
    "model": ((str,), "a text"),
    "for": ((str,), "a text"),
    "firmware": ((str,), "a text"),
    "laser": ((str,), "a text"),
    "lenient": ((bool,), "true or false"),
    "all_sonar": ((bool,), "true or false"),
    "rear_sonar": ((bool,), "true or false"),
    "flash": ((str,), "a text"),
    "errors": ((str,), "a text"),
    "baud": ((int,), "a whole number"),
    "aux": ((list,), "a list of texts"),
    "faults": ((list,), "a list of texts"),
    "sync_limit_s": ((int, float), "a number of seconds, more than 0 and less than 1e9"),
}
#: Key → least and most; upper ends are chosen.
RANGES: Mapping[str, tuple[float, float]] = {
    "count": (1, MOST_ROBOTS), "seed": (0, 2**63 - 1), "baud": (1, 1_000_000), "sync_limit_s": (1e-3, 1e9),
}  # fmt: skip
#: A place: metres, metres, degrees.
PLACE_RANGES = (WORLD_RANGES["x_m"], WORLD_RANGES["y_m"], WORLD_RANGES["heading_deg"])
TOP_KEYS = ("world", "body", "seed", "apart", "cross_talk", "worlds", "robot")
ROBOT_KEYS = tuple(key for key in KINDS if key not in TOP_KEYS)
#: Keys whose value may be a file.
FILES = frozenset({"world", "model", "flash", "errors"})


@dataclass(frozen=True, slots=True)
class _Section:
    """One table of the file, and where it stands."""

    source: str
    places: TomlPlaces
    folder: Path
    name: str
    number: int
    row: Table

    def error(self, key: str, what: str, hint: str | None = None) -> FleetError:
        """Return the complaint about a key."""
        return FleetError(f"{self.source}:{self.places.line(self.name, self.number, key)}: {what}", hint=hint)

    def get(self, key: str, default: object) -> object:
        """Return a key's value, or the default where it is not there."""
        if key not in self.row:
            return default
        value, (kinds, meaning) = self.row[key], KINDS[key]
        if not isinstance(value, kinds) or (isinstance(value, bool) and bool not in kinds):
            raise self.error(key, f"{key} must be {meaning}")
        if key in RANGES and not RANGES[key][0] <= cast("float", value) <= RANGES[key][1]:
            least, most = RANGES[key]
            raise self.error(key, f"{key} = {shown(value)} must be {least:g} to {most:g}")
        if key in FILES and is_file(self.folder / str(value)):
            return str(self.folder / str(value))
        return value

    def texts(self, key: str) -> list[str]:
        """Return the texts of a list."""
        values = cast("list[object]", self.get(key, []))
        if not all(isinstance(value, str) for value in values):
            raise self.error(key, f"{key} must be {KINDS[key][1]}")
        return [str(value) for value in values]

    def check_keys(self, known: tuple[str, ...]) -> None:
        """Refuse a key that there is none of."""
        for key in self.row:
            if key not in known:
                close = get_close_matches(key, known, n=1)
                hint = f"did you mean {close[0]}?" if close else f"known keys: {', '.join(known)}"
                raise self.error(key, f"unknown key {shown_name(key)}", hint)


def load_fleet(path: Path) -> FleetOrder:
    """Read a fleet's file.

    Raises:
        FleetError: The file cannot be read, or breaks the schema.
    """
    return parse_fleet(
        read_user_text(path, "a fleet", FleetError, hint="docs/pioneer.md shows one"), shown_name(path), path.parent
    )


def parse_fleet(text: str, source: str, folder: Path) -> FleetOrder:
    """Return the order that a TOML text gives.

    Args:
        text: The file's text.
        source: What to call it in messages.
        folder: Where files that it names are looked for first.

    Raises:
        FleetError: The text is no TOML or breaks the schema; the message names the source, the line and the key.
    """
    table, places = read_toml(text, source, "a fleet", FleetError)
    top = _Section(source, places, folder, "", 0, table)
    top.check_keys(TOP_KEYS)
    rows = cast("list[object]", top.get("robot", []))
    if not rows or not all(isinstance(row, dict) for row in rows):
        raise top.error("robot", "a fleet needs robots", "each is a table [[robot]]")
    robots: list[RobotOrder] = []
    for number, row in enumerate(rows):
        section = _Section(source, places, folder, "robot", number, cast("Table", row))
        section.check_keys(ROBOT_KEYS)
        robots += _robots(section, robots)
    world, body = str(top.get("world", "room")), str(top.get("body", BEST))
    if world not in known_worlds() and not is_file(Path(world)):
        raise top.error("world", f"no world {shown(world)}", f"shipped worlds: {', '.join(known_worlds())}, or a file")
    body = located(body, folder)
    try:
        resolve_body(body)
    except UsageError as error:
        raise top.error("body", str(error), error.hint) from error
    seed, apart = cast("int", top.get("seed", 0)), bool(top.get("apart", False))
    cross_talk = bool(top.get("cross_talk", True))
    worlds = folder / str(top.get("worlds", "")) if "worlds" in table else None
    if worlds is not None and not is_folder(worlds):
        raise top.error("worlds", f"no folder {shown_name(worlds)}", "clients may load its files as worlds")
    try:
        return FleetOrder(
            robots=tuple(robots), world=world, body=body, seed=seed, apart=apart, cross_talk=cross_talk, worlds=worlds
        )
    except P2osError as error:
        raise top.error("robot", str(error), error.hint) from error


def _robots(section: _Section, before: list[RobotOrder]) -> list[RobotOrder]:
    """Return the robots of one table; those without a port follow the one before."""
    count = cast("int", section.get("count", 1))
    if count > 1 and ("at" in section.row or "aux" in section.row):
        raise section.error("count", "several robots cannot have one place or one AUX port", "a table [[robot]] each")
    key = "port"
    try:
        if "port" in section.row:
            ports = following_ports([str(section.get("port", ""))], count)
        elif before:
            ports = following_ports([before[-1].port], count + 1)[1:]
        else:
            ports = following_ports([DEFAULT_PORT], count)
        key = "model"
        sonar = load_parameters(str(section.get("model", "p2dx"))).sonar_fitted
        key = "faults"
        for words in section.texts("faults"):
            read_fault(words, sonar=sonar)
        key = "aux"
        aux = tuple(read_aux(text) for text in section.texts("aux"))
        first = RobotOrder(
            port=ports[0], model=str(section.get("model", "p2dx")), at=_place(section), settings=_settings(section),
            faults=tuple(section.texts("faults")), aux=aux, sync_limit_ns=_sync_limit(section),
        )  # fmt: skip
    except FleetError:
        raise
    except P2osError as error:
        raise section.error(key, shown_name(error), error.hint) from error
    return [replace(first, port=port) for port in ports]


def _sync_limit(section: _Section) -> Nanos | None:
    seconds = cast("float | None", section.get("sync_limit_s", None))
    if seconds is None:
        return None
    if not 0 < seconds < 1e9:
        raise section.error("sync_limit_s", f"sync_limit_s must be {KINDS['sync_limit_s'][1]}")
    return round(seconds * NS_PER_S)


def _place(section: _Section) -> Pose | None:
    values = section.get("at", None)
    if values is None:
        return None
    numbers = cast("list[object]", values)
    sound = all(isinstance(value, (int, float)) and not isinstance(value, bool) for value in numbers)
    within = sound and all(
        least <= cast("float", value) <= most for value, (least, most) in zip(numbers, PLACE_RANGES, strict=False)
    )
    if len(numbers) not in {2, 3} or not within:
        raise section.error("at", f"at must be {KINDS['at'][1]}")
    x, y, heading = (*(float(cast("float", value)) for value in numbers), 0.0)[:3]
    return Pose(x, y, math.radians(heading))


def _settings(section: _Section) -> ControllerSettings:
    base, key = ControllerSettings(), "for"
    try:
        if "for" in section.row:
            base = ControllerSettings.for_client(str(section.get("for", "")))
        key = "laser"
        laser = read_laser(str(section.get("laser", ""))) if "laser" in section.row else base.laser
    except FleetError:
        raise
    except P2osError as error:
        raise section.error(key, str(error), error.hint) from error
    profile, key = str(section.get("firmware", base.profile.value)), "errors"
    if profile not in {member.value for member in Profile}:
        raise section.error(
            "firmware", f"no firmware {shown(profile)}", f"one of {', '.join(p.value for p in Profile)}"
        )
    baud = section.get("baud", None)
    if baud is not None and baud not in BAUDS:
        raise section.error("baud", f"a line of {baud} bit/s is none that HOSTBAUD names", f"rates: {BAUDS_TEXT}")
    try:
        settings = replace(
            base, profile=Profile(profile), lenient=bool(section.get("lenient", base.lenient)), laser=laser,
            rear_sonar=bool(section.get("rear_sonar", base.rear_sonar)),
            sonar_per_sip=SonarPerSip.ALL if section.get("all_sonar", False) else base.sonar_per_sip,
            errors=load_sensor_errors(str(section.get("errors", "ideal"))), baud=baud,
        )  # fmt: skip
        key = "flash"
        if "flash" in section.row:
            settings = settings.with_flash(load_flash(Path(str(section.get("flash", "")))))
    except FleetError:
        raise
    except P2osError as error:
        raise section.error(key, str(error), error.hint) from error
    return settings
