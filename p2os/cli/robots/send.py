"""`p2os send`: any command by its name, its argument checked before it leaves."""

import json
import sys
from typing import Annotated

import typer

from p2os.capture.describe import describe_packet
from p2os.cli.groups import ROBOTS
from p2os.cli.held_robot import RobotWatch, held
from p2os.cli.quantities import option
from p2os.client import ConfigurationKnown, Notice, PacketArrived, Robot
from p2os.errors import LocalProtocolError
from p2os.protocol.command_table import ROWS, Argument, CommandRow, command_row
from p2os.protocol.commands import Command, command
from p2os.protocol.packets import ServerPacket, packet_frame
from p2os.protocol.profiles import Profile
from simbase.errors import UsageError
from simbase.timing import NS_PER_MS, Nanos
from simbase.units import TIME

HELP = """Send one command to a robot and show its answer.

Use the manuals' names; the argument is checked before anything is sent. The
session is then closed, which ends a commanded speed: to move, use `p2os drive`.

\b
Examples:
  p2os send --list                           every command, its argument, its firmware
  p2os send --list gripper                   commands with "gripper" in them
  p2os send URL SONAR 0                      sonar off
  p2os send URL ENCODER 1                    ask for an ENCODERpac and print it
  p2os send URL DIGOUT 0x03 0xff             two bytes: low first, then high
  p2os send URL SAY "hex:14 3c 14 40"        a string, as bytes
  p2os send URL 250 126                      any command by number
"""
#: chosen: an answer comes with the next cycle of 100 ms, or the one after it.
DEFAULT_WAIT_NS: Nanos = 500 * NS_PER_MS


def register(app: typer.Typer) -> None:
    """Add the verb."""
    # A negative argument is no option.
    app.command("send", help=HELP, rich_help_panel=ROBOTS, context_settings={"ignore_unknown_options": True})(send)


def send(
    words: Annotated[
        list[str] | None, typer.Argument(help="URL, command, arguments.", metavar="URL COMMAND [ARG...]")
    ] = None,
    list_all: Annotated[bool, typer.Option("--list", help="List the commands; a word chooses.")] = False,
    waits_ns: Annotated[
        Nanos, option(TIME, "--wait", purpose="How long to listen for answers.", above_zero=True, shown="0.5s")
    ] = DEFAULT_WAIT_NS,
    json_output: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Send one command."""
    words = words or []
    if list_all:
        _list(" ".join(words).lower(), as_json=json_output)
        return
    if len(words) < 2:
        raise UsageError("name the robot's URL and a command", hint="p2os send tcp:127.0.0.1:8101 SONAR 0")
    wanted = make_command(words[1], words[2:])
    answers: list[ServerPacket] = []
    with held(Robot(words[0], reconnect=False)) as robot:
        profile = robot.profile
        warning = unknown_to(wanted, profile)
        if warning:
            sys.stderr.write(f"note: {warning}\n")
        robot.on_event(lambda notice: answers.extend(_packets(notice)))
        robot.send(wanted)
        RobotWatch(robot, f"wait for answers to {wanted.name}", moves=False).wait(waits_ns)
        parameters = robot.parameters
    sent = {"command": wanted.name, "number": int(wanted.number), "hex": wanted.to_frame().to_bytes().hex()}
    described = [describe_packet(packet_frame(packet, profile), profile, parameters) for packet in answers]
    if json_output:
        typer.echo(
            json.dumps({"sent": sent, "answers": [{"name": name, "fields": fields} for name, fields in described]})
        )
        return
    typer.echo(f"sent {sent['command']}: {wanted.to_frame().to_bytes().hex(' ')}")
    for name, fields in described:
        typer.echo(f"{name}  " + ", ".join(f"{field} {value}" for field, value in fields.items()))


def _packets(notice: Notice) -> list[ServerPacket]:
    if isinstance(notice, PacketArrived):
        return [notice.packet]
    return [notice.config] if isinstance(notice, ConfigurationKnown) else []


def make_command(name: str, arguments: list[str]) -> Command:
    """Return the command that a person typed.

    Args:
        name: Name, alias or number.
        arguments: Integers (also 0x…), or one string as text or as `hex:…`.

    Raises:
        UsageError: There is no such command, or it does not take this.
    """
    try:
        if name.isascii() and name.isdigit():
            return _by_number(int(name), arguments)
        row = command_row(name)
        if {Argument.STRING, Argument.DATA} & set(row.kinds):
            return command(row.number, *([_bytes(" ".join(arguments))] if arguments else []))
        return command(row.number, *[_integer(text) for text in arguments])
    except LocalProtocolError as error:
        raise UsageError(str(error), hint=error.hint or "p2os send --list") from error


def unknown_to(wanted: Command, profile: Profile) -> str:
    """Return a warning if a robot's firmware family is not known to have a command, else an empty string."""
    if wanted.row is None:
        return f"no manual names command {wanted.number}"
    if wanted.row.is_known_to(profile) is False:
        return f"{wanted.name} is not in the manual of {profile.value} robots; it will probably be ignored"
    return ""


def _by_number(number: int, arguments: list[str]) -> Command:
    if number > 255:
        raise UsageError(f"command {number} does not fit a byte", hint="0 to 255, or a name: p2os send --list")
    if len(arguments) > 1:
        raise UsageError(f"command {number}: one argument at most", hint="give the name to send two bytes")
    if not arguments:
        return Command(number)
    text = arguments[0]
    return Command(number, _bytes(text) if text.startswith("hex:") else _integer(text))


def _integer(text: str) -> int:
    try:
        return int(text, 0)
    except ValueError as error:
        raise UsageError(f"{text!r} is no whole number", hint="decimal, or 0x and hex digits") from error


def _bytes(text: str) -> bytes:
    if not text.startswith("hex:"):
        return text.encode("utf-8")
    try:
        return bytes.fromhex(text[4:])
    except ValueError as error:
        raise UsageError(f"{text!r} is no hex text", hint="hex:14 3c") from error


def _list(word: str, *, as_json: bool) -> None:
    rows = [row for row in ROWS if word in f"{row.number} {row.name} {row.meaning}".lower()]
    if not rows:
        raise UsageError(f"no command has {word!r} in it", hint="p2os send --list")
    if as_json:
        typer.echo(json.dumps([_plain(row) for row in rows], indent=2))
        return
    width = max(len(row.name) for row in rows)
    for row in rows:
        typer.echo(f"{int(row.number):3d}  {row.name:<{width}}  {row.takes}")
        typer.echo(f"     {'':<{width}}  {row.meaning}")
    sys.stderr.write(f"{len(rows)} commands\n")


def _plain(row: CommandRow) -> dict[str, object]:
    versions = {profile.value: row.version(profile) for profile in Profile}
    return {"number": int(row.number), "name": row.name, "takes": row.takes, "unit": row.unit,
            "meaning": row.meaning, "firmware": versions}  # fmt: skip
