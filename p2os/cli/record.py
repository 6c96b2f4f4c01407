"""`p2os record`: listen to a robot and keep every byte of both sides."""

import contextlib
import select
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from p2os.cli.capture_files import PcapFile, RecordingFile, Sink, Sinks
from p2os.cli.quantities import parse_duration
from p2os.cli.signals import end_on_signals
from p2os.connection import ConnectFailed, Connection, ConnectionLost, Role, SipReceived
from p2os.errors import RemoteProtocolError, TransportError
from p2os.timing import NS_PER_S, Nanos
from p2os.trace import Chunk, Direction
from p2os.transport import Transport, open_url

HELP = """Connect to a robot, keep its motors off, and record all that both sides say.

\b
Examples:
  p2os record tcp:127.0.0.1:8101 --for 10s              ten seconds into recording.jsonl
  p2os record serial:/dev/ttyUSB0 --out floor.jsonl     until Ctrl-C
  p2os record serial:/dev/ttyUSB0 --pcap floor.pcap     for Wireshark, too
  p2os decode floor.jsonl                               what was recorded

To record another program's session, put `p2os sniff` in between.
"""
DEFAULT_OUT = Path("recording.jsonl")
LONGEST_WAIT_S = 0.1
BLIND_POLL_S = 0.002


def record_session(
    transport: Transport,
    on_chunk: Callable[[Chunk], None],
    *,
    lasts_ns: Nanos | None = None,
    clock: Callable[[], Nanos] = time.monotonic_ns,
) -> int:
    """Listen to a robot until the time is over or an exception (Ctrl-C) ends it; return the number of SIPs.

    The robot is left standing and closed, whatever happens.

    Args:
        transport: The line.
        on_chunk: Told every chunk of both sides, time counted from the start.
        lasts_ns: How long from the first packet on; None for ever.
        clock: Nanoseconds that never run back.

    Raises:
        RemoteProtocolError: No robot answers, or it falls silent.
        TransportError: The line was lost.
    """
    start, connection = clock(), Connection(Role.CLIENT)

    def speak() -> None:
        for data in connection.take_output():
            on_chunk(Chunk(at_ns=clock() - start, direction=Direction.TO_ROBOT, data=data))
            transport.write(data)

    sips, ends_at = 0, None
    try:
        connection.connect(clock())
        while ends_at is None or clock() < ends_at:
            speak()
            _wait(connection, transport, clock())
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
        connection.disconnect(clock())
        with contextlib.suppress(TransportError):
            speak()
    return sips


def _wait(connection: Connection, transport: Transport, now: Nanos) -> None:
    deadline = connection.next_deadline()
    wait_s = LONGEST_WAIT_S if deadline is None else min(max(deadline - now, 0) / NS_PER_S, LONGEST_WAIT_S)
    try:
        select.select([transport.fileno()], [], [], wait_s)
    except (TransportError, OSError):
        time.sleep(BLIND_POLL_S)


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("record", help=HELP)(record)


def record(
    url: Annotated[str, typer.Argument(help="Where the robot is.", metavar="URL")],
    out: Annotated[Path, typer.Option(help="Recording to write.", metavar="FILE")] = DEFAULT_OUT,
    pcap: Annotated[Path | None, typer.Option(help="Write this too, for Wireshark.", metavar="FILE")] = None,
    duration: Annotated[str, typer.Option("--for", help="How long; without, until Ctrl-C.", metavar="TIME")] = "",
) -> None:
    """Record a robot."""
    lasts_ns = parse_duration(duration, "--for") if duration else None
    transport = open_url(url)
    sinks: list[Sink] = []
    begun = time.monotonic()
    with contextlib.closing(transport), Sinks(sinks) as all_sinks:
        sinks.append(RecordingFile(out, note=f"p2os record {url}"))
        if pcap is not None:
            sinks.append(PcapFile(pcap, time.time_ns()))
        end_on_signals()
        sys.stderr.write(f"recording {url} into {out}" + ("" if lasts_ns else "; Ctrl-C ends") + "\n")
        try:
            sips = record_session(transport, all_sinks.take, lasts_ns=lasts_ns)
        except KeyboardInterrupt:
            sys.stderr.write(f"interrupted after {time.monotonic() - begun:.1f} s; {out} is complete up to there\n")
            raise
    sys.stderr.write(f"{sips} SIPs in {time.monotonic() - begun:.1f} s\n")
    typer.echo(out)
