"""`p2os sniff`: sit between a client and a robot, and show or record what they say."""

import json
import sys
import time
from pathlib import Path
from typing import Annotated

import typer

from p2os.cli.bridge import Bridge
from p2os.cli.capture_files import PcapFile, RecordingFile, Sink, Sinks
from p2os.cli.holding import hold_robot
from p2os.cli.quantities import parse_duration
from p2os.cli.reading import DEFAULT_ROBOT
from p2os.cli.signals import postponed
from p2os.parameters import load_parameters
from p2os.profiles import Profile
from p2os.trace import Chunk, Lister, Reading, Row
from p2os.trace.text import line_of, summary_of
from p2os.transport import listen_url, open_url

DEFAULT_LISTEN = "tcp:127.0.0.1:8102"

HELP = f"""Sit between a client and a robot, pass everything on, and show or record it.

Let the client connect to the URL of --listen instead of the robot's. When the
client goes, Ctrl-C ends it or a file cannot be written while a session is open, the
robot is told STOP, VEL 0 and CLOSE. What is printed never holds the two up: a
reader that does not read misses lines, and is told how many.

\b
Examples:
  p2os sniff serial:/dev/ttyUSB0 --listen pty:/tmp/robot   a client that wants a serial port
  p2os sniff tcp:127.0.0.1:8101                            listens on {DEFAULT_LISTEN}
  p2os sniff tcp:127.0.0.1:8101 --out talk.jsonl --quiet   record, show nothing
  p2os sniff tcp:127.0.0.1:8101 --pcap talk.pcap           for Wireshark
  p2os sniff --install-dissector                           put p2os.lua where Wireshark finds it
"""


class Screen:
    """Shows rows on stdout as they come."""

    def __init__(self, reading: Reading, *, as_json: bool, quiet: bool) -> None:
        self._lister = Lister(reading)
        self._as_json = as_json
        self._quiet = quiet
        self._last_ns = 0
        self.rows = 0
        self.damaged = 0

    def take(self, chunk: Chunk) -> None:
        """Show what a chunk completes."""
        self._last_ns = chunk.at_ns
        for row in self._lister.take(chunk):
            self._show(row)

    def close(self) -> None:
        """Show what was left."""
        for row in self._lister.finish(self._last_ns):
            self._show(row)

    def _show(self, row: Row) -> None:
        self.rows += 1
        self.damaged += not row.valid
        if not self._quiet:
            typer.echo(json.dumps(row.as_plain()) if self._as_json else line_of(row))


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("sniff", help=HELP)(sniff)


def sniff(
    url: Annotated[str | None, typer.Argument(help="Where the robot is.", metavar="URL", show_default=False)] = None,
    listen: Annotated[str, typer.Option(help="Where the client connects.", metavar="URL")] = DEFAULT_LISTEN,
    out: Annotated[Path | None, typer.Option(help="Record here (JSON lines).", metavar="FILE")] = None,
    pcap: Annotated[Path | None, typer.Option(help="Record here, for Wireshark.", metavar="FILE")] = None,
    json_output: Annotated[bool, typer.Option("--json", help="Print one JSON object a packet.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print no packets.")] = False,
    once: Annotated[bool, typer.Option("--once", help="End when the first client has gone.")] = False,
    duration: Annotated[str, typer.Option("--for", help="End after so long.", metavar="TIME")] = "",
    robot: Annotated[str, typer.Option(help="Robot model, or a TOML file, for units.")] = DEFAULT_ROBOT,
    profile: Annotated[Profile, typer.Option(help="Firmware family, for layouts.")] = Profile.P2OS,
    install_dissector: Annotated[
        bool,
        typer.Option("--install-dissector", help="Copy the dissector into Wireshark's folder of plug-ins, and end."),
    ] = False,
) -> None:
    """Join clients to a robot until Ctrl-C."""
    if install_dissector:
        from p2os.cli.dissector import install

        typer.echo(f"installed {install()}")
        return
    if url is None:
        raise typer.BadParameter("name the robot's URL", param_hint="URL")
    lasts_ns = parse_duration(duration, "--for") if duration else None
    reading = Reading(profile=profile, parameters=load_parameters(robot))
    hold_robot()
    robot_line = open_url(url)
    listener = listen_url(listen)
    screen = Screen(reading, as_json=json_output, quiet=quiet)
    sinks: list[Sink] = [screen]
    with Sinks(sinks) as all_sinks:
        if out is not None:
            sinks.append(RecordingFile(out, note=f"p2os sniff {url}"))
        if pcap is not None:
            sinks.append(PcapFile(pcap, time.time_ns()))
        bridge = Bridge(listener, robot_line, lambda: open_url(url), on_chunk=all_sinks.take, on_event=_tell)
        _tell(f"listening on {listener.description} for the robot on {url}; Ctrl-C ends")
        try:
            bridge.run(lambda: (once and bridge.sessions > 0) or (lasts_ns is not None and bridge.now >= lasts_ns))
        finally:
            with postponed():
                lasted_s = bridge.now / 1e9
                all_sinks.close()
                _tell(summary_of(screen.rows, screen.damaged, lasted_s))


def _tell(text: str) -> None:
    sys.stderr.write(f"{text}\n")
