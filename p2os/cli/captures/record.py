"""`p2os record`: open a session, motors off, and keep every byte of both sides."""

import contextlib
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from p2os.capture import Chunk, Direction
from p2os.cli.captures.capture_files import PcapFile, RecordingFile, Sink, Sinks
from p2os.cli.groups import CAPTURES
from p2os.cli.held_robot import hold_robot
from p2os.cli.kept_files import FORCE_HELP, refuse_to_overwrite
from p2os.cli.names import RobotUrl
from p2os.cli.quantities import option
from p2os.errors import RemoteProtocolError, TransportError
from p2os.protocol.connection import ConnectFailed, Connection, ConnectionLost, ConnectionRole, SipReceived
from p2os.transport import Transport, open_url
from p2os.transport.waiting import wait_for_line
from p2os.transport.wall_clock import Clock, wall_clock
from simbase.command_line.signals import postponed
from simbase.timing import NS_PER_S, Nanos
from simbase.units import TIME

HELP = """Record a robot's packets and this program's, motors off.

\b
Examples:
  p2os record tcp:127.0.0.1:8101 --for 10s              ten seconds into recording.jsonl
  p2os record serial:/dev/ttyUSB0 --out floor.jsonl     until Ctrl-C
  p2os record serial:/dev/ttyUSB0 --pcap floor.pcap     for Wireshark, too
  p2os decode floor.jsonl                               what was recorded

To record another program's session, put `p2os sniff` in between.
"""
DEFAULT_OUT = Path("recording.jsonl")


def record_session(
    transport: Transport,
    on_chunk: Callable[[Chunk], None],
    *,
    lasts_ns: Nanos | None = None,
    clock: Clock = wall_clock,
) -> int:
    """Listen to a robot until the time is over or an exception (Ctrl-C) ends it; return the number of SIPs.

    The robot is left stopped and closed, whatever happens.

    Args:
        transport: The line.
        on_chunk: Called with every chunk of both sides, time counted from the start.
        lasts_ns: How long from the first packet on; None for ever.
        clock: Nanoseconds that never run back.

    Raises:
        RemoteProtocolError: No robot answers, or it falls silent.
        TransportError: The line was lost.
    """
    start, connection = clock(), Connection(ConnectionRole.CLIENT)

    def send() -> None:
        for data in connection.take_output():
            transport.write(data)
            on_chunk(Chunk(at_ns=clock() - start, direction=Direction.TO_ROBOT, data=data))

    sips, ends_at = 0, None
    try:
        connection.connect(clock())
        while ends_at is None or clock() < ends_at:
            send()
            wait_for_line(transport, connection.next_deadline(), clock())
            data, now = transport.read(), clock()
            if data:
                on_chunk(Chunk(at_ns=now - start, direction=Direction.FROM_ROBOT, data=data))
            connection.receive(data, now)
            while (event := connection.next_event()) is not None:
                if isinstance(event, (ConnectFailed, ConnectionLost)):
                    raise RemoteProtocolError(
                        f"no robot on {transport.description}: {event.reason}", hint="p2os scan looks for it"
                    )
                if isinstance(event, SipReceived):
                    sips += 1
                    ends_at = now + lasts_ns if ends_at is None and lasts_ns is not None else ends_at
    finally:
        with postponed():
            connection.disconnect(clock())
            closing = b"".join(connection.take_output())
            with contextlib.suppress(TransportError):
                transport.write(closing)
                if closing:
                    on_chunk(Chunk(at_ns=clock() - start, direction=Direction.TO_ROBOT, data=closing))
    return sips


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("record", help=HELP, rich_help_panel=CAPTURES)(record)


def record(
    url: RobotUrl,
    out: Annotated[Path, typer.Option(help="Recording to write.", metavar="FILE")] = DEFAULT_OUT,
    pcap: Annotated[Path | None, typer.Option(help="Write this too, for Wireshark.", metavar="FILE")] = None,
    lasts_ns: Annotated[
        Nanos | None, option(TIME, "--for", purpose="How long; without, until Ctrl-C.", above_zero=True)
    ] = None,
    force: Annotated[bool, typer.Option("--force", help=FORCE_HELP)] = False,
) -> None:
    """Record a robot."""
    for path in (out, pcap):
        refuse_to_overwrite(path, force=force)
    hold_robot()
    transport = open_url(url)
    sinks: list[Sink] = []
    began = wall_clock()
    with contextlib.closing(transport), Sinks(sinks) as all_sinks:
        sinks.append(RecordingFile(out, note=f"p2os record {url}"))
        if pcap is not None:
            sinks.append(PcapFile(pcap, time.time_ns()))
        sys.stderr.write(f"recording {url} into {out}" + ("" if lasts_ns else "; Ctrl-C ends") + "\n")
        try:
            sips = record_session(transport, all_sinks.take, lasts_ns=lasts_ns)
        except KeyboardInterrupt:
            lasted_s = (wall_clock() - began) / NS_PER_S
            sys.stderr.write(f"interrupted after {lasted_s:.1f} s; {out} is complete up to there\n")
            raise
    sys.stderr.write(f"{sips} SIPs in {(wall_clock() - began) / NS_PER_S:.1f} s\n")
    typer.echo(out)
