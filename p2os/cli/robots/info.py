"""`p2os info URL`: who the robot at a line is, how it is set, and what it senses now."""

import json
import math
from dataclasses import dataclass, replace
from typing import Annotated

import typer

from p2os.cli.groups import ROBOTS
from p2os.cli.held_robot import ASKED, held
from p2os.cli.names import RobotUrl
from p2os.cli.robots.monitor import state_as_plain
from p2os.client import Robot, RobotState
from p2os.protocol.config_packet import FIELDS, ConfigPacket
from p2os.protocol.packets import Identity
from p2os.robots.parameters import RobotParameters

HELP = """Print a robot's identity, settings and sensors.

A robot that still streams to an earlier program is stopped first. The motors
stay off.

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


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotInfo:
    """What a robot reports of itself."""

    identity: Identity
    state: RobotState
    #: Of its model; where that is not known, of another one.
    parameters: RobotParameters
    #: None when its firmware does not know CONFIG.
    config: ConfigPacket | None = None


def ask(url: str) -> RobotInfo:
    """Connect, listen until the robot has sent all, and leave it closed.

    Raises:
        P2osError: as `Robot.connect`.
    """
    with held(Robot(url, settings=ASKED)) as robot:
        return RobotInfo(identity=robot.identity, state=robot.state, parameters=robot.parameters, config=robot.config)


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("info", help=HELP, rich_help_panel=ROBOTS)(info)


def info(
    url: RobotUrl,
    json_output: Annotated[bool, typer.Option("--json", help="Print a JSON object.")] = False,
) -> None:
    """Print what a robot reports of itself."""
    found = ask(url)
    if json_output:
        typer.echo(json.dumps(as_plain(found), indent=2))
        return
    for name, value in lines_of(found):
        typer.echo(f"{name:<10}{value}".rstrip())


def as_plain(found: RobotInfo) -> dict[str, object]:
    """Return what a robot reports as plain values, speeds and lengths in SI units, for JSON."""
    identity, config = found.identity, found.config
    sent = None if config is None else {name: getattr(config, name) for name, _ in FIELDS[: config.fields_sent]}
    return {
        "name": identity.name, "robot_class": identity.robot_class, "subclass": identity.subclass,
        "sip": state_as_plain(replace(found.state, pose=found.state.odometry), found.state.at_ns), "config": sent,
    }  # fmt: skip


def lines_of(found: RobotInfo) -> list[tuple[str, str]]:
    """Return what a robot reports as (name, text with units) for a person."""
    identity, state, title = found.identity, found.state, found.parameters.title
    stalls = [side for side, is_stalled in (("left", state.stall_left), ("right", state.stall_right)) if is_stalled]
    is_known = identity.subclass.lower() == found.parameters.subclass.lower()
    pose = state.odometry
    lines = [
        ("name", identity.name or "(none)"),
        ("class", identity.robot_class),
        ("model", f"{identity.subclass} ({title if is_known else f'unknown model, units of a {title}'})"),
        ("position", f"x {pose.x_m:.3f} m, y {pose.y_m:.3f} m, heading {math.degrees(pose.heading_rad):.1f} deg"),
        ("wheels", f"left {state.left_mps:.3f} m/s, right {state.right_mps:.3f} m/s"),
        ("stalled", " and ".join(stalls) or "none"),
        ("battery", f"{state.battery_v:.1f} V"),
        ("sonar", ", ".join(f"{echo.number}: {echo.range_m:.3f} m" for echo in state.sonar) or "off"),
    ]
    if found.config is None:
        return [*lines, ("config", "the robot does not send it")]
    shown = [(name, getattr(found.config, name)) for name, _ in FIELDS[: found.config.fields_sent]]
    return [*lines, *(("config", f"{name:<18}{value} {UNITS.get(name, '')}".rstrip()) for name, value in shown)]
