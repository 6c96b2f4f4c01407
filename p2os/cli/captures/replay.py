"""`p2os replay`: play a recorded conversation again, as its robot or as its client."""

import contextlib
import sys
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from p2os.capture import Capture, Direction, frame_chunks, read_file
from p2os.capture.replay import Replay
from p2os.capture.tap import Tap
from p2os.cli.groups import CAPTURES
from p2os.cli.held_robot import hold_robot
from p2os.cli.names import urls
from p2os.cli.quantities import option
from p2os.client import ClientSettings
from p2os.errors import RemoteProtocolError, RunFailedError, TransportError
from p2os.protocol.command_table import MOTION_COMMANDS
from p2os.transport import listen_url, open_url
from p2os.transport.ports import HungUpError, Listener, RefusedPeerError, Transport
from p2os.transport.waiting import LONGEST_WAIT_NS, wait_for_line, wait_readable
from p2os.transport.wall_clock import Clock, GapWatch, wall_clock
from simbase.command_line.signals import postponed
from simbase.errors import FileError, UsageError
from simbase.timing import NS_PER_S, Nanos
from simbase.units import FACTOR

HELP = """Play a recorded conversation again.

As the robot, it waits for a client at URL and sends what the recorded robot
sent. As the client, it connects to a robot at URL and sends what the recorded
client sent: the robot MOVES as it did. The handshake follows the other side;
the rest keeps its recorded times. At the end, on Ctrl-C and on errors, a robot
with an open session gets STOP, VEL 0 and CLOSE.

\b
Examples:
  p2os replay talk.jsonl tcp:127.0.0.1:8101                 act as the recorded robot
  p2os replay talk.jsonl pty:/tmp/robot --speed 2           twice as fast
  p2os replay talk.pcap tcp:127.0.0.1:8101 --as client      drive a robot as recorded
  p2os replay talk.jsonl serial:/dev/ttyUSB0 --as client --yes
"""
#: chosen: three times what clients wait for the answer to a SYNC.
ANSWER_TIMEOUT_NS: Nanos = 3 * NS_PER_S
#: A robot that has sent nothing for so long is lost, as it is to a client.
SILENCE_NS: Nanos = ClientSettings().liveness_ns
#: Speeds that are refused are mistakes.
SLOWEST, FASTEST = 0.01, 100.0


class ReplaySide(Enum):
    """Whom to be."""

    ROBOT = "robot"
    CLIENT = "client"

    @property
    def role(self) -> Direction:
        """Whose bytes are sent."""
        return Direction.FROM_ROBOT if self is ReplaySide.ROBOT else Direction.TO_ROBOT


def play(
    replay: Replay,
    transport: Transport,
    role: Direction,
    *,
    clock: Clock = wall_clock,
    answer_timeout_ns: Nanos = ANSWER_TIMEOUT_NS,
) -> None:
    """Play one side over a line until all was sent; leave a robot stopped and closed.

    Raises:
        RemoteProtocolError: As the client: the robot does not answer the handshake, or has fallen silent.
        RunFailedError: As the client: this program or its machine paused.
        TransportError: The line was lost.
    """
    tap, is_client = Tap(), role is Direction.TO_ROBOT
    try:
        replay.start(clock())
        gaps, received_at = GapWatch(clock()), None
        while replay.frames_left:
            now = clock()
            if (gap_ns := gaps.gap(now)) and is_client:
                raise RunFailedError(f"paused for {gap_ns / NS_PER_S:.1f} s: the recorded times have gone by")
            replay.advance_to(now)
            for data in replay.take_output():
                tap.observe(role, data, now)
                transport.write(data)
            if is_client and replay.waited(now) > answer_timeout_ns:
                raise RemoteProtocolError(
                    f"{transport.description} does not give {replay.awaited}, as in the recording",
                    hint="is a robot behind it? (p2os info URL)",
                )
            if is_client and received_at is not None and now - received_at > SILENCE_NS:
                raise RemoteProtocolError(
                    f"no packet for {(now - received_at) / NS_PER_S:.1f} s", hint="is the robot on, and the cable in?"
                )
            wait_for_line(transport, replay.next_deadline(), now, gaps)
            data, now = transport.read(), clock()
            received_at = now if data else received_at
            tap.observe(role.opposite, data, now)
            replay.receive(data, now)
    finally:
        with postponed():
            if is_client and (closing := tap.closing_frames()):
                with contextlib.suppress(TransportError):
                    transport.write(closing)


def motions_of(capture: Capture) -> int:
    """Return how many commands of a capture move a robot."""
    pieces = (piece for piece in frame_chunks(capture.chunks) if piece.direction is Direction.TO_ROBOT)
    return sum(piece.frame is not None and piece.frame.kind in MOTION_COMMANDS for piece in pieces)


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("replay", help=HELP, rich_help_panel=CAPTURES)(replay)


def replay(
    file: Annotated[Path, typer.Argument(help="Recording, JSON lines, pcap, or a run's folder.", metavar="FILE")],
    url: Annotated[str, typer.Argument(help="Where the far side is, or comes.", metavar="URL", autocompletion=urls)],
    side: Annotated[ReplaySide, typer.Option("--as", help="Whom to be.", metavar="robot|client")] = ReplaySide.ROBOT,
    speed: Annotated[
        float,
        option(FACTOR, "--speed", purpose="2: twice as fast.", least=f"{SLOWEST:g}", most=f"{FASTEST:g}", shown="1"),
    ] = 1.0,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask before moving a robot on a serial port.")] = False,
) -> None:
    """Play a recording."""
    capture = read_file(file)
    player = Replay(capture, side.role, speed=speed)
    if not player.frames_left:
        who = "robot" if side is ReplaySide.ROBOT else "client"
        raise FileError(f"{file} holds nothing that a {who} sent", hint="p2os decode shows what it holds")
    if side is ReplaySide.CLIENT:
        _ask(motions_of(capture), url, yes=yes)
        hold_robot()
        _play(player, open_url(url), side)
        return
    listener = listen_url(url)
    sys.stderr.write(f"waiting for a client on {listener.description}; Ctrl-C ends\n")
    while True:
        try:
            _play(Replay(capture, side.role, speed=speed), _first(listener), side)
        except RefusedPeerError:  # it was no client
            continue
        return


def _play(player: Replay, transport: Transport, side: ReplaySide) -> None:
    """Play to the end, or until a client has closed the session.

    Raises:
        RefusedPeerError: Who came may be no client.
        TransportError: The far side has gone before.
    """
    frames = player.frames_left
    with contextlib.closing(transport):
        try:
            play(player, transport, side.role)
        except RefusedPeerError:
            raise
        except HungUpError as error:
            sent = frames - player.frames_left
            if side is ReplaySide.ROBOT and player.is_closed:
                sys.stderr.write(f"the client closed the session after {sent} of {frames} frames\n")
                return
            raise TransportError(f"after {sent} of {frames} frames: {error}", hint=error.hint) from error
    sys.stderr.write(f"{frames} frames sent\n")


def _ask(motions: int, url: str, *, yes: bool) -> None:
    if not motions or yes or not url.startswith("serial:"):
        return
    if not sys.stdin.isatty():
        raise UsageError(f"the recording holds {motions} motion commands for the robot on {url}", hint="add --yes")
    typer.confirm(f"The robot will move: {motions} motion commands. Is there room?", abort=True, err=True)


def _first(listener: Listener) -> Transport:
    while (transport := listener.accept()) is None:
        descriptor = listener.fileno()
        wait_readable(() if descriptor is None else (descriptor,), listener.poll_s or LONGEST_WAIT_NS / NS_PER_S)
    return transport
