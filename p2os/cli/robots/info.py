"""`p2os info URL`: who the robot at a line is, how it is set, and what it senses now."""

import json
import math
from dataclasses import asdict, dataclass
from typing import Annotated

import typer

from p2os.cli.held_robot import ASKED, held
from p2os.cli.help_pages import ROBOTS
from p2os.cli.names import RobotUrl
from p2os.client import Robot
from p2os.protocol.config_packet import FIELDS, ConfigPacket
from p2os.protocol.odometry import Odometry
from p2os.protocol.packets import Identity
from p2os.protocol.sip import StandardSip
from p2os.protocol.units import in_units
from p2os.robots.parameters import ParametersError, RobotParameters, load_parameters

HELP = """Print who a robot is, how it is set and what it senses.

A robot that is still streaming to an earlier program is stopped first. The
motors stay off.

\b
Examples:
  p2os info tcp:127.0.0.1:8101               a robot served by `p2os serve`
  p2os info serial:/dev/ttyUSB0              a real one, whatever its line's speed
  p2os info tcp:127.0.0.1:8101 --json        for programs

Ends with exit code 1 when nobody answers.
"""

#: Units of the fields of the CONFIGpac that have one (`ConfigPacket`).
UNITS = {
    "rotveltop": "deg/s", "transveltop": "mm/s", "rotacctop": "deg/s2", "transacctop": "mm/s2", "sipcycle": "ms",
    "lowbattery": "x 0.1 V", "watchdog": "ms", "stallcount": "ms", "joyvel": "mm/s", "joyrvel": "deg/s",
    "rotvelmax": "deg/s", "transvelmax": "mm/s", "rotacc": "deg/s2", "rotdecel": "deg/s2", "transacc": "mm/s2",
    "transdecel": "mm/s2", "sonarcycle": "ms", "shutdownvolts": "x 0.1 V", "kinematicsdelay": "ms",
    "latveltop": "mm/s", "latacctop": "mm/s2", "latvelmax": "mm/s", "latacc": "mm/s2", "latdecel": "mm/s2",
}  # fmt: skip
#: Used for a robot whose model is not known, as clients do.
FALLBACK_MODEL = "p2dx"


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotInfo:
    """What a robot reports of itself."""

    identity: Identity
    sip: StandardSip
    #: None when its firmware does not know CONFIG.
    config: ConfigPacket | None = None


def ask(url: str) -> RobotInfo:
    """Connect, listen until the robot has sent all, and leave it closed.

    Raises:
        P2osError: as `Robot.connect`.
    """
    with held(Robot(url, settings=ASKED)) as robot:
        return RobotInfo(identity=robot.identity, sip=robot.state.sip, config=robot.config)


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("info", help=HELP, rich_help_panel=ROBOTS)(info)


def info(
    url: RobotUrl,
    json_output: Annotated[bool, typer.Option("--json", help="Print a JSON object.")] = False,
) -> None:
    """Print what a robot reports of itself."""
    found = ask(url)
    parameters, is_known = _parameters(found.identity.subclass)
    if json_output:
        typer.echo(json.dumps(as_plain(found, parameters), indent=2))
        return
    for name, value in lines_of(found, parameters, is_known=is_known):
        typer.echo(f"{name:<10}{value}".rstrip())


def as_plain(found: RobotInfo, parameters: RobotParameters) -> dict[str, object]:
    """Return what a robot reports as plain values, speeds and lengths in SI units, for JSON."""
    identity, config = found.identity, found.config
    sensed = {name: _rounded(value) for name, value in asdict(in_units(found.sip, parameters)).items()}
    place = _odometry(found.sip, parameters)
    sensed["x_m"], sensed["y_m"] = _rounded(place.x_m), _rounded(place.y_m)
    sent = None if config is None else {name: getattr(config, name) for name, _ in FIELDS[: config.fields_sent]}
    return {
        "name": identity.name, "robot_class": identity.robot_class, "subclass": identity.subclass,
        "sip": sensed, "config": sent,
    }  # fmt: skip


def lines_of(found: RobotInfo, parameters: RobotParameters, *, is_known: bool) -> list[tuple[str, str]]:
    """Return what a robot reports as (name, text with units) for a person."""
    identity, sensed = found.identity, in_units(found.sip, parameters)
    place = _odometry(found.sip, parameters)
    stalls = [side for side, is_stalled in (("left", sensed.stall_left), ("right", sensed.stall_right)) if is_stalled]
    model = parameters.title if is_known else f"unknown model, units of a {parameters.title}"
    lines = [
        ("name", identity.name or "(none)"),
        ("class", identity.robot_class),
        ("model", f"{identity.subclass} ({model})"),
        ("position", f"x {place.x_m:.3f} m, y {place.y_m:.3f} m, heading {math.degrees(sensed.heading_rad):.1f} deg"),
        ("wheels", f"left {sensed.left_mps:.3f} m/s, right {sensed.right_mps:.3f} m/s"),
        ("stalled", " and ".join(stalls) or "none"),
        ("battery", f"{sensed.battery_v:.1f} V"),
        ("sonar", ", ".join(f"{number}: {range_m:.3f} m" for number, range_m in sensed.sonar_m) or "off"),
    ]
    if found.config is None:
        return [*lines, ("config", "the robot does not send it")]
    shown = [(name, getattr(found.config, name)) for name, _ in FIELDS[: found.config.fields_sent]]
    return [*lines, *(("config", f"{name:<18}{value} {UNITS.get(name, '')}".rstrip()) for name, value in shown)]


def _rounded(value: object) -> object:
    """Return floats to a micrometre or microradian, also those in lists."""
    if isinstance(value, (tuple, list)):
        return [_rounded(item) for item in value]
    return round(value, 6) if isinstance(value, float) else value


def _odometry(sip: StandardSip, parameters: RobotParameters) -> Odometry:
    """Return where a packet says that the robot is, on either side of the origin."""
    odometry = Odometry(parameters)
    odometry.update(sip)
    return odometry


def _parameters(subclass: str) -> tuple[RobotParameters, bool]:
    """Return a model's parameters and whether it is known."""
    try:
        return load_parameters(subclass), True
    except ParametersError:
        return load_parameters(FALLBACK_MODEL), False
