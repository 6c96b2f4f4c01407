"""`p2os sniff`: stand between a client and a robot, and show or record what they send.

`TapBridge` passes bytes on and knows neither screen nor files; the verb joins them.

One client at a time; each gets its own line to the robot. When either side
goes, the other is released too, and a robot whose session was open is stopped
first. So it is when the bridge itself has paused (the machine slept, the
process was stopped): what a client sent before is out of date, and never passed on.

Invariant: bytes are passed on before anything is shown or recorded.
"""

import contextlib
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from p2os.capture import Chunk, Direction, FollowedReading, Lister, ListingRow
from p2os.capture.listing import line_of, summary_of
from p2os.capture.tap import Tap
from p2os.cli.captures.capture_files import PcapFile, RecordingFile, Sink, Sinks
from p2os.cli.captures.reading import ProfileForLayouts, RobotForUnits
from p2os.cli.groups import CAPTURES
from p2os.cli.held_robot import hold_robot
from p2os.cli.kept_files import FORCE_HELP, refuse_to_overwrite
from p2os.cli.names import urls
from p2os.cli.quantities import option
from p2os.errors import TransportError
from p2os.transport import listen_url, open_url
from p2os.transport.ports import Listener, RefusedPeerError, Transport
from p2os.transport.waiting import BLIND_POLL_S, wait_readable
from p2os.transport.wall_clock import Clock, GapWatch, wall_clock
from simbase.command_line.signals import postponed
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos
from simbase.units import TIME

DEFAULT_LISTEN = "tcp:127.0.0.1:8102"

HELP = f"""Show or record the traffic between a client and a robot.

It relays all bytes between the two. Let the client connect to the URL of
--listen instead of the robot's. If the client leaves, Ctrl-C ends the program or
a file cannot be written while a session is open, the robot gets STOP, VEL 0 and
CLOSE. Output never delays the relay: a slow reader loses lines and gets their
number.

\b
Examples:
  p2os sniff serial:/dev/ttyUSB0 --listen pty:/tmp/robot   a client that wants a serial port
  p2os sniff tcp:127.0.0.1:8101                            listens on {DEFAULT_LISTEN}
  p2os sniff tcp:127.0.0.1:8101 --out talk.jsonl --quiet   record, show nothing
  p2os sniff tcp:127.0.0.1:8101 --pcap talk.pcap           for Wireshark
  p2os sniff --install-dissector                           put p2os.lua where Wireshark finds it
"""
#: chosen: how soon the loop notices that it should end.
LONGEST_WAIT_S = 0.2
#: From HOSTBAUD to our own change of speed: the command has to leave at the old one. ARIA waits 10 ms.
BAUD_DELAY_NS: Nanos = 20 * NS_PER_MS


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("sniff", help=HELP, rich_help_panel=CAPTURES)(sniff)


def sniff(
    url: Annotated[
        str | None,
        typer.Argument(help="Where the robot is.", metavar="URL", show_default=False, autocompletion=urls),
    ] = None,
    listen: Annotated[str, typer.Option(help="Where the client connects.", metavar="URL")] = DEFAULT_LISTEN,
    out: Annotated[Path | None, typer.Option(help="Record here (JSON lines).", metavar="FILE")] = None,
    pcap: Annotated[Path | None, typer.Option(help="Record here, for Wireshark.", metavar="FILE")] = None,
    force: Annotated[bool, typer.Option("--force", help=FORCE_HELP)] = False,
    json_output: Annotated[bool, typer.Option("--json", help="Print one JSON object a packet.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print no packets.")] = False,
    once: Annotated[bool, typer.Option("--once", help="End when the first client has gone.")] = False,
    lasts_ns: Annotated[Nanos | None, option(TIME, "--for", purpose="End after so long.", above_zero=True)] = None,
    robot: RobotForUnits = "",
    profile: ProfileForLayouts = None,
    install_dissector: Annotated[
        bool,
        typer.Option("--install-dissector", help="Copy the dissector into Wireshark's folder of plug-ins, and end."),
    ] = False,
) -> None:
    """Bridge clients to a robot until Ctrl-C."""
    if install_dissector:
        from p2os.capture.dissector import install

        typer.echo(f"installed {install()}")
        return
    if url is None:
        raise typer.BadParameter("name the robot's URL", param_hint="URL")
    for path in (out, pcap):
        refuse_to_overwrite(path, force=force)
    reading = FollowedReading(robot, profile)
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
        bridge = TapBridge(listener, robot_line, lambda: open_url(url), on_chunk=all_sinks.take, on_event=_print)
        _print(f"listening on {listener.description} for the robot on {url}; Ctrl-C ends")
        try:
            bridge.run(lambda: (once and bridge.sessions > 0) or (lasts_ns is not None and bridge.now >= lasts_ns))
        finally:
            with postponed():
                lasted_s = bridge.now / 1e9
                all_sinks.close()
                _print(summary_of(screen.rows, screen.damaged, lasted_s))


def _print(text: str) -> None:
    sys.stderr.write(f"{text}\n")


class TapBridge:
    """Bridges the clients of a listener to a robot.

    Args:
        listener: Where clients come.
        robot: The line to the robot for the first client: opened early, so that its absence shows at once.
        open_robot: Opens a line to the robot for each further client.
        on_chunk: Called with all that goes by.
        on_event: Called with one line when a client comes or goes.
        clock: Nanoseconds that never run back.
    """

    def __init__(
        self,
        listener: Listener,
        robot: Transport,
        open_robot: Callable[[], Transport],
        *,
        on_chunk: Callable[[Chunk], None],
        on_event: Callable[[str], None],
        clock: Clock = wall_clock,
    ) -> None:
        self._listener = listener
        self._open_robot = open_robot
        self._on_chunk = on_chunk
        self._on_event = on_event
        self._clock = clock
        self._start = clock()
        self._gaps = GapWatch(self._start)
        self._woke_at = self._start
        self._client: Transport | None = None
        self._robot: Transport | None = None
        self._spare: Transport | None = robot
        self._tap = Tap()
        self._baud_due: Nanos | None = None
        #: How many clients have come and gone.
        self.sessions = 0

    @property
    def now(self) -> Nanos:
        """Nanoseconds since the bridge was made."""
        return self._clock() - self._start

    def run(self, until: Callable[[], bool]) -> None:
        """Bridge until `until` is true or an exception (Ctrl-C) ends it; then release both."""
        try:
            while not until():
                self.turn()
        finally:
            with postponed():
                self.close()

    def turn(self) -> None:
        """Wait for bytes or a client, and pass on what came."""
        self._wait()
        self._woke_at = self._clock()
        self._release_after_pause(self._woke_at)
        if self._client is None:
            self._accept()
            return
        self._pass(Direction.TO_ROBOT, self._client)
        if self._robot is not None:
            self._pass(Direction.FROM_ROBOT, self._robot)
        self._change_baud()

    def close(self) -> None:
        """Release both sides and stop listening."""
        try:
            self._release("the bridge ends")
        finally:
            if self._spare is not None:
                self._spare.close()
            self._listener.close()

    def _accept(self) -> None:
        client = self._listener.accept()
        if client is None:
            return
        try:
            self._robot = self._robot_line()
        except TransportError as error:
            client.close()
            self._on_event(f"client refused: {error}")
            return
        self._client, self._tap, self._baud_due = client, Tap(), None
        self._on_event(f"client connected: {client.description}")

    def _robot_line(self) -> Transport:
        """Return the line that was opened early if it is still open, else a new one."""
        spare, self._spare = self._spare, None
        if spare is None:
            return self._open_robot()
        try:
            spare.read()  # what a robot sent before there was a client is of no use to it
        except TransportError:
            spare.close()
            return self._open_robot()
        return spare

    def _pass(self, direction: Direction, source: Transport) -> None:
        target = self._robot if direction is Direction.TO_ROBOT else self._client
        try:
            data = source.read()
        except RefusedPeerError as error:
            self._release(str(error))
            self.sessions -= 1  # it was no client
            return
        except TransportError as error:
            self._release(str(error))
            return
        # What was read may have waited for this process, which can stand still between any two lines.
        if not data or target is None or self._release_after_pause(self._clock()):
            return
        chunk, lost = self._tap.observe(direction, data, self.now), ""
        try:
            target.write(data)
        except TransportError as error:
            lost = str(error)
        self._on_chunk(chunk)
        if lost:
            self._release(lost)

    def _release_after_pause(self, now: Nanos) -> bool:
        """Release both sides where this process stood still while a session was open; tell whether it did."""
        gap_ns = self._gaps.gap(now)
        is_over = bool(gap_ns and self._tap.closing_frames())
        if is_over:
            self._release(f"the bridge paused for {gap_ns / NS_PER_S:.1f} s")
        return is_over

    def _change_baud(self) -> None:
        if self._tap.new_baud is None or self._robot is None:
            return
        if self._baud_due is None:
            self._baud_due = self.now + BAUD_DELAY_NS
        elif self.now >= self._baud_due:
            self._on_event(f"client switches the line to {self._tap.new_baud} bit/s: following")
            self._robot.set_baud(self._tap.new_baud)
            self._tap.new_baud, self._baud_due = None, None

    def _release(self, reason: str) -> None:
        """Stop the robot if its session is open, and release both sides."""
        if self._client is None:
            return
        client, robot, self._client, self._robot = self._client, self._robot, None, None
        closing, is_sent = self._tap.closing_frames(), False
        if robot is not None:
            with contextlib.suppress(TransportError):
                robot.write(closing)
                is_sent = True
            robot.close()
        client.close()
        self.sessions += 1
        if closing and is_sent:
            self._on_chunk(self._tap.observe(Direction.TO_ROBOT, closing, self.now))
            self._on_event("the session was open: sent STOP, VEL 0 and CLOSE")
        elif closing:
            self._on_event("the session was open, and no STOP can be sent: the robot's watchdog stops it")
        self._on_event(f"client gone: {reason}")

    def _wait(self) -> None:
        descriptors, longest = [], LONGEST_WAIT_S
        if self._client is None:
            listening = self._listener.fileno()
            if listening is None:
                longest = self._listener.poll_s or LONGEST_WAIT_S
            else:
                descriptors.append(listening)
        for transport in (self._client, self._robot):
            if transport is None:
                continue
            try:
                descriptors.append(transport.fileno())
            except TransportError:
                longest = BLIND_POLL_S
        if self._baud_due is not None:
            longest = min(longest, max(self._baud_due - self.now, 0) / NS_PER_S)
        self._gaps.expect(self._woke_at + round(longest * NS_PER_S))
        wait_readable(descriptors, longest)


class Screen:
    """Shows rows on stdout as they come."""

    def __init__(self, reading: FollowedReading, *, as_json: bool, quiet: bool) -> None:
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

    def _show(self, row: ListingRow) -> None:
        self.rows += 1
        self.damaged += not row.valid
        if not self._quiet:
            typer.echo(json.dumps(row.as_plain()) if self._as_json else line_of(row))
