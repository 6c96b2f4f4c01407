"""`p2os ports`: the serial ports of this machine, as URLs that every other verb takes."""

import json
import sys
from typing import Annotated

import typer

from p2os.transport.serial_port import list_serial_ports

HELP = """List the serial ports of this machine.

\b
Examples:
  p2os ports           one port a line: its URL, what it says it is
  p2os ports --json    the same for programs
"""


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("ports", help=HELP)(ports)


def ports(json_output: Annotated[bool, typer.Option("--json", help="Print a JSON list.")] = False) -> None:
    """Print the serial ports of this machine."""
    found = list_serial_ports()
    if json_output:
        typer.echo(json.dumps(found, indent=2))
        return
    width = max((len(port["url"]) for port in found), default=0)
    for port in found:
        known = ", ".join(text for text in (port["description"], port["hardware"]) if text not in {"", "n/a"})
        typer.echo(f"{port['url']:<{width}}  {known}".rstrip())
    count = len(found)
    sys.stderr.write(f"{count or 'no'} serial port{'' if count == 1 else 's'}\n")
    if not found:
        sys.stderr.write("hint: plug an adapter in, or use `p2os serve` to have a robot without one\n")
