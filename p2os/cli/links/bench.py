"""`p2os bench`: how fast and how steady a link to a robot is."""

import contextlib
import json
import sys
from dataclasses import asdict, dataclass
from typing import Annotated

import typer

from p2os.cli.groups import LINKS
from p2os.cli.held_robot import hold_robot
from p2os.cli.links.link_quality import LinkQuality, Spread, spread_of
from p2os.cli.names import RobotUrl
from p2os.cli.quantities import option
from p2os.errors import RemoteProtocolError, TransportError
from p2os.protocol.commands import Command, CommandNumber
from p2os.protocol.connection import (
    ConfigReceived,
    ConnectFailed,
    Connection,
    ConnectionLost,
    ConnectionRole,
    SipReceived,
)
from p2os.transport import Transport, open_url
from p2os.transport.waiting import wait_for_line
from p2os.transport.wall_clock import Clock, wall_clock
from simbase.command_line.signals import postponed
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos
from simbase.units import TIME

HELP = """Measure the link to a robot, without moving it.

Connect: SYNC0 to the first packet. Period: between packets as they arrive.
Round trip: CONFIG to CONFIGpac, which older firmware does not answer. On FTDI
adapters the latency timer (16 ms) affects all three: docs/troubleshooting.md.

\b
Examples:
  p2os bench tcp:127.0.0.1:8101
  p2os bench serial:/dev/ttyUSB0?baud=38400 --for 30s
  p2os bench URL --json
"""
#: chosen: a robot's answer takes at most a cycle; without one for so long there is none.
ANSWER_WAIT_NS: Nanos = 500 * NS_PER_MS
#: chosen: between an answer and the next question; CONFIGpacs of 100 bytes fill a tenth of a 9600-baud line.
PAUSE_NS: Nanos = 300 * NS_PER_MS
#: Questions without an answer after which no more are asked.
MOST_UNANSWERED = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """What was measured; times in milliseconds."""

    connect_ms: float
    period: Spread | None
    round_trip: Spread | None
    unanswered: int
    packets: int
    missed: int
    bad_checksums: int
    noise_bytes: int
    given_up: int
    seconds: float


class LinkBenchmark:
    """Asks, and notes when what came.

    Passive: `turn` is called with what has arrived and returns what to send.
    """

    def __init__(self, now: Nanos) -> None:
        self.connection = Connection(ConnectionRole.CLIENT)
        self.quality = LinkQuality()
        self.round_trips: list[Nanos] = []
        self.unanswered = 0
        self.first_sip_ns: Nanos | None = None
        self.start_ns = now
        self._asked_ns: Nanos | None = None
        self._ask_at: Nanos = 0
        self.connection.connect(now)

    def turn(self, data: bytes, now: Nanos) -> bytes:
        """Take bytes and return those to send.

        Raises:
            RemoteProtocolError: No robot answers, or it has fallen silent.
        """
        self.connection.receive(data, now)
        while (event := self.connection.next_event()) is not None:
            if isinstance(event, SipReceived):
                self.first_sip_ns = now if self.first_sip_ns is None else self.first_sip_ns
                self.quality.packet(now)
            elif isinstance(event, ConfigReceived) and self._asked_ns is not None:
                self.round_trips.append(now - self._asked_ns)
                self._asked_ns, self._ask_at = None, now + PAUSE_NS
            elif isinstance(event, (ConnectFailed, ConnectionLost)):
                raise RemoteProtocolError(event.reason)
        if self._asked_ns is not None and now >= self._asked_ns + ANSWER_WAIT_NS:
            self._asked_ns, self.unanswered, self._ask_at = None, self.unanswered + 1, now
        can_ask = self.round_trips or self.unanswered < MOST_UNANSWERED
        if self.first_sip_ns is not None and self._asked_ns is None and now >= self._ask_at and can_ask:
            self.connection.send(Command(CommandNumber.CONFIG), now)
            self._asked_ns = now
        return b"".join(self.connection.take_output())

    def next_deadline(self) -> Nanos | None:
        """Return when something is due."""
        own = self._ask_at if self._asked_ns is None else self._asked_ns + ANSWER_WAIT_NS
        due = self.connection.next_deadline()
        return own if due is None else min(own, due)

    def result(self, now: Nanos) -> Measured:
        """Return what was measured so far."""
        wire = self.connection.stats.wire
        first = self.start_ns if self.first_sip_ns is None else self.first_sip_ns
        return Measured(
            connect_ms=(first - self.start_ns) / NS_PER_MS, period=self.quality.spread,
            round_trip=spread_of(self.round_trips), unanswered=self.unanswered, packets=self.quality.packets,
            missed=self.quality.missed, bad_checksums=wire.bad_checksums, noise_bytes=wire.noise_bytes,
            given_up=wire.stalled, seconds=(now - first) / NS_PER_S,
        )  # fmt: skip


def measure(transport: Transport, lasts_ns: Nanos, clock: Clock = wall_clock) -> Measured:
    """Measure a line for so long after its first packet, and leave the robot closed.

    Raises:
        RemoteProtocolError: No robot answers.
        TransportError: The line was lost.
    """
    bench = LinkBenchmark(clock())
    try:
        data = b""
        while bench.first_sip_ns is None or clock() < bench.first_sip_ns + lasts_ns:
            transport.write(bench.turn(data, clock()))
            wait_for_line(transport, bench.next_deadline(), clock())
            data = transport.read()
    except RemoteProtocolError as error:
        raise RemoteProtocolError(f"no robot on {transport.description}: {error}", hint="p2os scan") from error
    finally:
        with postponed():
            bench.connection.disconnect(clock())
            with contextlib.suppress(TransportError):
                transport.write(b"".join(bench.connection.take_output()))
    return bench.result(clock())


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("bench", help=HELP, rich_help_panel=LINKS)(bench)


def bench(
    url: RobotUrl,
    lasts_ns: Annotated[Nanos, option(TIME, "--for", purpose="How long.", above_zero=True, shown="10s")] = 10
    * NS_PER_S,
    json_output: Annotated[bool, typer.Option("--json", help="Print a JSON object.")] = False,
) -> None:
    """Measure a link."""
    hold_robot()
    with contextlib.closing(open_url(url)) as transport:
        measured = measure(transport, lasts_ns)
    if json_output:
        typer.echo(json.dumps(asdict(measured)))
        return
    for line in lines_of(measured):
        typer.echo(line)
    lost = measured.missed + measured.bad_checksums + measured.given_up
    sys.stderr.write(f"{measured.packets} packets in {measured.seconds:.1f} s, {lost or 'none'} lost or damaged\n")


def lines_of(measured: Measured) -> list[str]:
    """Return what was measured as lines."""
    lines = [f"connect      {measured.connect_ms:.0f} ms from SYNC0 to the first packet"]
    for name, spread in (("period", measured.period), ("round trip", measured.round_trip)):
        if spread is None:
            lines.append(
                f"{name:<12} not measured" + ("" if name == "period" else ": the robot does not answer CONFIG")
            )
        else:
            lines.append(
                f"{name:<12} {spread.mean_ms:.1f} ms ± {spread.deviation_ms:.1f} "
                f"(least {spread.least_ms:.1f}, median {spread.median_ms:.1f}, 99 % {spread.p99_ms:.1f}, "
                f"most {spread.most_ms:.1f}; {spread.count} times)"
            )
    lines.append(
        f"losses       {measured.missed} packets missed, {measured.bad_checksums} bad checksums, "
        f"{measured.given_up} cut off, {measured.noise_bytes} bytes of noise"
    )
    return lines
