"""`p2os ports`: the serial ports of this machine, as URLs that every other verb takes, and what is likely there."""

import json
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer

from p2os.cli.groups import LINKS
from p2os.transport.serial_port import list_serial_ports

HELP = """List the serial ports of this machine and guess their devices.

No port is opened: the guess uses the USB description. To probe the ports, use
`p2os scan`.

\b
Examples:
  p2os ports           one port a line: its URL, its description, what it may be
  p2os ports --json    the same for programs
"""
#: USB vendor:product → what it is and whether a robot may be behind it (usb.ids; the vendors' data sheets).
ADAPTERS: Mapping[str, str] = {
    "0403:6001": "FTDI adapter: a robot may be behind it",
    "0403:6010": "FTDI adapter, two ports: a robot may be behind it",
    "0403:6011": "FTDI adapter, four ports: a robot may be behind it",
    "0403:6014": "FTDI adapter: a robot may be behind it",
    "0403:6015": "FTDI adapter: a robot may be behind it",
    "067B:2303": "Prolific adapter: a robot may be behind it",
    "067B:23A3": "Prolific adapter: a robot may be behind it",
    "1A86:7523": "CH340 adapter, also on ESP32 boards: a robot or the adapter board may be behind it",
    "1A86:55D4": "CH9102 adapter, also on ESP32 boards: a robot or the adapter board may be behind it",
    "10C4:EA60": "CP210x adapter, also on ESP32 boards: a robot or the adapter board may be behind it",
    "0483:374B": "ST-LINK: a BluePill's debugger, no robot",
    "0483:3752": "ST-LINK: a BluePill's debugger, no robot",
    "0483:5740": "STM32 with a USB port of its own: a BluePill program, no robot",
    "303A:1001": "ESP32 with a USB port of its own: the adapter board, no robot",
}
_VID_PID = re.compile(r"VID:PID=([0-9A-Fa-f]{4}:[0-9A-Fa-f]{4})")
#: The vendor whose adapters hold bytes back for as long as their latency timer runs.
FTDI = "0403"
#: Linux shows the timer there, in milliseconds.
LATENCY_FOLDER = Path("/sys/bus/usb-serial/devices")
#: Above this, the timer is worth a note: packets of a Pioneer come in bursts of it.
LATENCY_MS = 2


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("ports", help=HELP, rich_help_panel=LINKS)(ports)


def ports(json_output: Annotated[bool, typer.Option("--json", help="Print a JSON list.")] = False) -> None:
    """Print the serial ports of this machine."""
    found = [{**port, "guess": guess(port)} for port in list_serial_ports()]
    if json_output:
        typer.echo(json.dumps(found, indent=2))
        return
    width = max((len(port["url"]) for port in found), default=0)
    for port in found:
        known = ", ".join(text for text in (port["description"], port["hardware"]) if text not in {"", "n/a"})
        typer.echo(f"{port['url']:<{width}}  {known}".rstrip())
        typer.echo(f"{'':<{width}}  {port['guess']}")
    count = len(found)
    sys.stderr.write(f"{count or 'no'} serial port{'' if count == 1 else 's'}\n")
    hint = (
        "p2os scan asks them who is there"
        if found
        else "plug an adapter in, or use `p2os serve` to have a robot without one"
    )
    sys.stderr.write(f"hint: {hint}\n")


def guess(port: Mapping[str, str], latency_folder: Path = LATENCY_FOLDER) -> str:
    """Return what is likely behind a port.

    Args:
        port: Its url, description and hardware, as `list_serial_ports` gives them.
        latency_folder: Where Linux shows the latency timers of USB adapters.
    """
    found = _VID_PID.search(port["hardware"])
    name = port["url"].removeprefix("serial:").rsplit("/", maxsplit=1)[-1]
    if found is None:
        if "bluetooth" in port["description"].lower() or name.startswith("rfcomm"):
            return "Bluetooth: seldom a robot"
        return "a port of the machine itself: a robot may be on it, if it is wired at all"
    identifier = found[1].upper()
    words = ADAPTERS.get(identifier, "a USB device that is not known here: ask it with p2os scan")
    latency_ms = _latency_ms(name, latency_folder) if identifier.startswith(FTDI) else None
    if latency_ms is not None and latency_ms > LATENCY_MS:
        words += f"; its latency timer of {latency_ms} ms delays packets (docs/troubleshooting.md)"
    return words


def _latency_ms(name: str, folder: Path) -> int | None:
    try:
        return int((folder / name / "latency_timer").read_text(encoding="ascii"))
    except (OSError, ValueError):
        return None
