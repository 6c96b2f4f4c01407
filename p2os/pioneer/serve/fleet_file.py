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
from dataclasses import replace
from pathlib import Path
from typing import Any

from p2os.pioneer.body.factory import BEST, BODY_CHOICES, resolve_body
from p2os.pioneer.body.factory import GROUP as BODY_GROUP
from p2os.pioneer.controller.faults import read_fault
from p2os.pioneer.controller.flash import load_flash
from p2os.pioneer.controller.settings import ControllerSettings
from p2os.pioneer.devices.laser import read_laser
from p2os.pioneer.sensor_errors import load_sensor_errors
from p2os.pioneer.serve.fleet_order import MOST_ROBOTS, FleetOrder, RobotOrder, following_ports, read_aux
from p2os.pioneer.world import known_worlds
from p2os.pioneer.world.model import RANGES as WORLD_RANGES
from p2os.pioneer.world.model import Pose
from p2os.protocol.bauds import BAUDS, BAUDS_TEXT
from p2os.protocol.profiles import Profile
from p2os.robots.parameters import load_parameters
from p2os.toml_file import TomlSource, is_file, is_folder, read_toml, read_user_text
from p2os.toml_schema import LONGEST_S, Key, TablePlace, filled, placed, within
from p2os.transport.url import DEFAULT_URL
from simbase.errors import FileError, shown, shown_name
from simbase.timing import NS_PER_S
from simbase.trust import Trust


class FleetError(FileError):
    """A fleet's file is missing or breaks its schema."""


TOP = (
    Key(name="world", kind="text", default="room", doc="a shipped world, or a file"),
    Key(
        name="body",
        kind="text",
        choices=BODY_CHOICES,
        group=BODY_GROUP,
        default=BEST,
        doc="[which one](pioneer.md#bodies)",
    ),
    Key(name="seed", kind="whole", least=0, most=2**63 - 1, default=0, doc="of everything random"),
    Key(name="apart", kind="flag", default=False, doc="each robot in its own copy of the world"),
    Key(name="cross_talk", kind="flag", default=True, doc="a sonar hears other robots' pings"),
    Key(name="worlds", kind="text", doc="a folder of worlds that clients may load"),
    Key(name="robot", kind="tables", required=True, doc="a robot, or several alike"),
)
#: The upper ends are chosen.
ROBOT = (
    Key(name="count", kind="whole", least=1, most=MOST_ROBOTS, default=1, doc="robots alike"),
    Key(name="port", kind="text", doc="its URL"),
    Key(name="at", kind="list", doc="x and y in metres, heading in degrees; default a free place"),
    Key(name="model", kind="text", default="p2dx", doc="a robot model, or a file of one"),
    *(
        Key(name=name, kind="text", doc=doc)
        for name, doc in (("for", "`aria`"), ("laser", "as `--laser`"), ("flash", "a FLASH file"))
    ),
    Key(name="firmware", kind="text", choices=tuple(profile.value for profile in Profile), doc="default the model's"),
    *(Key(name=name, kind="flag", doc="as the option") for name in ("lenient", "all_sonar", "rear_sonar")),
    Key(name="errors", kind="text", default="ideal", doc="[of sensors](pioneer.md#sensors-errors)"),
    Key(name="baud", kind="whole", least=1, most=1_000_000, doc="a UART's speed"),
    *(
        Key(name=name, kind="texts", default=[], doc=doc)
        for name, doc in (("aux", '`"1=URL"`'), ("faults", "[words](pioneer.md#faults)"))
    ),
    Key(name="sync_limit_s", kind="number", least=1e-3, most=LONGEST_S, doc="without an open session"),
)
#: A place: metres, metres, degrees.
PLACE_RANGES = (WORLD_RANGES["x_m"], WORLD_RANGES["y_m"], WORLD_RANGES["heading_deg"])
#: Keys whose value may be a file.
FILES = frozenset({"world", "model", "flash", "errors"})
#: A table with a value or the default for every key.
Values = Mapping[str, Any]


def load_fleet(path: Path, *, trust: bool | Trust = False) -> FleetOrder:
    """Read a fleet's file.

    Args:
        path: The file.
        trust: Whether code that it names may be executed (docs/trust.md).

    Raises:
        FleetError: The file cannot be read, or breaks the schema.
        UntrustedError: It names code, and nobody has said that it may be executed.
    """
    text = read_user_text(path, "a fleet", FleetError, hint="docs/pioneer.md shows one")
    return parse_fleet(text, shown_name(path), path.parent, trust=trust)


def parse_fleet(text: str, source: str, folder: Path, *, trust: bool | Trust = False) -> FleetOrder:
    """Return the order that a TOML text gives.

    Args:
        text: The file's text.
        source: What to call it in messages.
        folder: Where files that it names are looked for first.
        trust: As of `load_fleet`.

    Raises:
        UntrustedError: As of `load_fleet`.
        FleetError: The text is no TOML or breaks the schema; the message names the source, the line and the key.
    """
    table, places = read_toml(text, source, "a fleet", FleetError)
    where = TablePlace(TomlSource(source, places), error=FleetError)
    top = _values(table, TOP, where, folder)
    robots: list[RobotOrder] = []
    for number, row in enumerate(top["robot"]):
        at = within(where, "robot", number)
        robots += _robots(_values(row, ROBOT, at, folder), at, robots)
    world, body = top["world"], Trust.of(trust).admit(top["body"], folder, f"{where.at('body')}: body")
    if world not in known_worlds() and not is_file(Path(world)):
        hint = f"shipped worlds: {', '.join(known_worlds())}, or a file"
        raise FleetError(f"{where.at('world')}: no world {shown(world)}", hint=hint)
    with placed(where, "body"):
        resolve_body(body)
    worlds = None if top["worlds"] is None else folder / top["worlds"]
    if worlds is not None and not is_folder(worlds):
        hint = "clients may load its files as worlds"
        raise FleetError(f"{where.at('worlds')}: no folder {shown_name(worlds)}", hint=hint)
    with placed(where, "robot"):
        return FleetOrder(
            robots=tuple(robots), world=world, body=body, seed=top["seed"], apart=top["apart"],
            cross_talk=top["cross_talk"], worlds=worlds, source=source,
        )  # fmt: skip


def _values(row: Values, keys: tuple[Key, ...], where: TablePlace, folder: Path) -> Values:
    """Check a table; a file that it names is looked for beside the fleet's first."""
    found = filled(row, keys, where)
    return found | {
        key: str(folder / found[key]) for key in FILES & found.keys() if found[key] and is_file(folder / found[key])
    }


def _robots(row: Values, where: TablePlace, before: list[RobotOrder]) -> list[RobotOrder]:
    """Return the robots of one table; those without a port follow the one before."""
    count, port = row["count"], row["port"]
    faults, auxes = ([row[key]] if isinstance(row[key], str) else row[key] for key in ("faults", "aux"))
    if count > 1 and (row["at"] is not None or row["aux"]):
        hint = "a table [[robot]] each"
        raise FleetError(f"{where.at('count')}: several robots cannot have one place or one AUX port", hint=hint)
    with placed(where, "port"):
        if port is None and before:
            ports = following_ports([before[-1].port], count + 1)[1:]
        else:
            ports = following_ports([DEFAULT_URL if port is None else port], count)
    with placed(where, "model"):
        sonar = load_parameters(row["model"]).sonar_fitted
    with placed(where, "faults"):
        for words in faults:
            read_fault(words, sonar=sonar)
    with placed(where, "aux"):
        aux = tuple(map(read_aux, auxes))
    limit_s = row["sync_limit_s"]
    at, settings = _place(row["at"], where), _settings(row, where)
    with placed(where):
        first = RobotOrder(
            port=ports[0], model=row["model"], at=at, settings=settings, faults=tuple(faults), aux=aux,
            sync_limit_ns=None if limit_s is None else round(limit_s * NS_PER_S),
        )  # fmt: skip
    return [replace(first, port=port) for port in ports]


def _place(numbers: list[object] | None, where: TablePlace) -> Pose | None:
    if numbers is None:
        return None
    found = [
        float(number) for number, (least, most) in zip(numbers, PLACE_RANGES, strict=False)
        if isinstance(number, (int, float)) and not isinstance(number, bool) and least <= number <= most
    ]  # fmt: skip
    if len(found) != len(numbers) or len(found) not in {2, 3}:
        raise FleetError(f"{where.at('at')}: at must be [x, y] or [x, y, heading] in metres and degrees")
    x, y, heading = (*found, 0.0)[:3]
    return Pose(x, y, math.radians(heading))


def _settings(row: Values, where: TablePlace) -> ControllerSettings:
    with placed(where, "for"):
        ControllerSettings.of(client=row["for"])
    with placed(where, "laser"):
        laser = None if row["laser"] is None else read_laser(row["laser"])
    if row["baud"] not in {None, *BAUDS}:
        what = f"a line of {row['baud']} bit/s is none that HOSTBAUD names"
        raise FleetError(f"{where.at('baud')}: {what}", hint=f"rates: {BAUDS_TEXT}")
    with placed(where, "errors"):
        errors = load_sensor_errors(row["errors"])
    with placed(where, "flash"):
        flash = None if row["flash"] is None else load_flash(Path(row["flash"]))
        return ControllerSettings.of(
            client=row["for"], firmware=None if row["firmware"] is None else Profile(row["firmware"]),
            lenient=row["lenient"], laser=laser, all_sonar=bool(row["all_sonar"]), rear_sonar=row["rear_sonar"],
            flash=flash, errors=errors, baud=row["baud"],
        )  # fmt: skip
