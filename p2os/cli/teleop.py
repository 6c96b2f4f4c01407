"""`p2os teleop`: drive a robot with the keyboard."""

import contextlib
import math
import os
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator
from typing import Annotated

import typer

from p2os.cli.holding import held, hold_robot
from p2os.cli.pad_source import SdlPad
from p2os.cli.quantities import Quantity, parse_quantity
from p2os.cli.teleop_keys import QUIT_KEYS, Teleop, split_keys
from p2os.cli.teleop_pad import PadDriver, is_stop
from p2os.client import Link, Notice, Robot
from p2os.client.problems import LinkLostError
from p2os.errors import MissingDependencyError, UsageError
from p2os.gamepad import PAD_MPS, PAD_RADPS
from p2os.timing import NS_PER_MS, NS_PER_S, Nanos
from p2os.transport.waiting import wait_readable
from p2os.transport.wall_clock import Clock, GapWatch, wall_clock

HELP = """Drive a robot with the keyboard, or with a game pad.

Hold a key to drive; let it go and the robot stops. So it does when the terminal
hangs, the link is lost, the machine sleeps, or anything ends the program: a key
must be pressed anew then.

\b
Keys:
  arrows, w a s d, or i j , l   ahead, left, back, right
  u o m .                       bends: ahead-left, ahead-right, back-left, back-right
  space, k, x                   stop
  + -                           faster, slower
  q, Esc, Ctrl-C                end

\b
Examples:
  p2os teleop tcp:127.0.0.1:8101
  p2os teleop serial:/dev/ttyUSB0 --vel 150mm/s --turn-rate 20deg/s
  p2os teleop tcp:127.0.0.1:8101 --pad

With --pad: Up connects, Down lets go, R2 drives ahead, L2 back, the right stick
turns; a pad that goes away stops the robot within 200 ms.
"""
DEFAULT_VEL, DEFAULT_RATE = "0.3m/s", "45deg/s"
#: chosen: how often keys are looked for and the line is renewed.
TURN_NS: Nanos = 50 * NS_PER_MS
#: chosen: a lone Esc and an arrow key begin alike; the rest of an arrow follows at once.
ESCAPE_WAIT_S = 0.03


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("teleop", help=HELP)(teleop)


def teleop(
    url: Annotated[str, typer.Argument(help="Where the robot is.", metavar="URL")],
    vel: Annotated[
        str, typer.Option(help=f"Speed of a held key or a full trigger; {DEFAULT_VEL}, pad 0.4m/s.", metavar="SPEED")
    ] = "",
    turn_rate: Annotated[
        str,
        typer.Option(
            help=f"Turning speed of a held key or a full stick; {DEFAULT_RATE}, pad 1.7rad/s.", metavar="RATE"
        ),
    ] = "",
    pad: Annotated[bool, typer.Option("--pad", help="Drive by game pad instead of keys.")] = False,
    robot: Annotated[str, typer.Option(help="Robot model or TOML file, if it is not what the robot says.")] = "",
) -> None:
    """Drive by keyboard or pad."""
    forward_mps = parse_quantity(vel or (f"{PAD_MPS}m/s" if pad else DEFAULT_VEL), Quantity.SPEED, "--vel")
    turn_radps = parse_quantity(
        turn_rate or (f"{PAD_RADPS}rad/s" if pad else DEFAULT_RATE), Quantity.TURN_RATE, "--turn-rate"
    )
    if forward_mps <= 0 or turn_radps <= 0:
        raise UsageError("--vel and --turn-rate must be positive", hint="p2os teleop --help")
    if pad:
        drive_by_pad(url, robot or None, (forward_mps, turn_radps))
        return
    if not sys.stdin.isatty():
        raise UsageError("there is no keyboard: stdin is not a terminal", hint="p2os drive URL --vel 0.2m/s --for 2s")
    with held(Robot(url, model=robot or None)) as client, raw_keyboard():
        sys.stderr.write("hold arrows or w a s d to drive, space stops, + - change the speed, q ends\r\n")
        loop = KeyLoop(Teleop(forward_mps, turn_radps), client)
        try:
            while not loop.keys.is_over:
                loop.turn()
        finally:
            sys.stderr.write("\r\n")


def drive_by_pad(url: str, model: str | None, fastest: tuple[float, float]) -> None:
    """Drive by the first game pad of this machine."""
    hold_robot()
    with SdlPad() as pad:
        sys.stderr.write(f"game pad: {pad.name}\n")
        PadDriver(
            pad.report,
            lambda: held(Robot(url, model=model)),
            fastest,
            clock=wall_clock,
            wait=lambda span_ns: time.sleep(span_ns / NS_PER_S),
            say=lambda text: print(text, file=sys.stderr),  # noqa: T201 - the skin
        ).run()


class KeyLoop:
    """Hands what the keys want to the robot, turn by turn.

    After a pause of the program nothing is held any more, and keys that waited
    mean nothing, but for those that end it; the next press or repetition drives.

    Args:
        keys: What the keys want.
        client: The robot.
        read: Returns the keys that came within so many nanoseconds.
        clock: Nanoseconds that never run back.
    """

    def __init__(
        self,
        keys: Teleop,
        client: Robot,
        *,
        read: Callable[[Nanos], list[str]] | None = None,
        clock: Clock = wall_clock,
    ) -> None:
        self.keys = keys
        self._client = client
        self._read = read_keys if read is None else read
        self._clock = clock
        self._gaps = GapWatch(clock())
        self._stops: deque[Notice] = deque()
        client.on_event(lambda notice: self._stops.append(notice) if is_stop(notice) else None)

    def turn(self) -> None:
        """Take the keys that came, tell the robot, show where it is."""
        self._gaps.expect(self._clock() + TURN_NS)
        pressed = self._read(TURN_NS)
        now = self._clock()
        if self._gaps.gap(now) or self._stops:
            self._stops.clear()
            pressed = [" ", *(key for key in pressed if key in QUIT_KEYS)]
        for key in pressed:
            self.keys.press(key, now)
        self.keys.advance_to(now)
        try:
            self._client.set_velocity(*self.keys.speeds)
        except LinkLostError:  # looked for again by the client; nothing moves meanwhile, nor at once afterwards
            self.keys.press(" ", now)
        sys.stderr.write(f"\r\x1b[K{status(self.keys, self._client)}")


def status(keys: Teleop, client: Robot) -> str:
    """Return one line about the robot."""
    if client.link is not Link.OPEN:
        return f"link: {client.link.value}"
    state, (forward_mps, turn_radps) = client.state, keys.speeds
    return (
        f"{'DRIVE' if keys.is_driving else 'stand'} {forward_mps:+.2f} m/s {math.degrees(turn_radps):+.0f} deg/s "
        f"({keys.share:.0%})  x {state.pose.x_m:.2f} m  y {state.pose.y_m:.2f} m  "
        f"heading {math.degrees(state.pose.heading_rad):.0f} deg  {state.battery_v:.1f} V"
        + ("  STALLED" if state.is_stalled else "")
    )


def read_keys(longest_ns: Nanos) -> list[str]:
    """Return the keys that came within so long; waits for the first only."""
    descriptor = sys.stdin.fileno()
    if not wait_readable((descriptor,), longest_ns / NS_PER_S):
        return []
    data = os.read(descriptor, 256)
    if not data:  # the terminal has gone
        return ["q"]
    if data.endswith(b"\x1b") and wait_readable((descriptor,), ESCAPE_WAIT_S):
        data += os.read(descriptor, 256)
    return split_keys(data.decode("utf-8", "replace"))


@contextlib.contextmanager
def raw_keyboard() -> Iterator[None]:
    """Let keys through one by one and unseen, and put the terminal back afterwards.

    Raises:
        MissingDependencyError: This system has no Unix terminals.
    """
    try:
        import termios
        import tty
    except ImportError as error:  # pragma: no cover - Windows
        raise MissingDependencyError("teleop needs a Unix terminal", hint="p2os drive") from error
    descriptor = sys.stdin.fileno()
    before = termios.tcgetattr(descriptor)
    try:
        tty.setcbreak(descriptor, termios.TCSANOW)  # the other ways wait for a terminal that is held
        yield
    finally:
        termios.tcsetattr(descriptor, termios.TCSANOW, before)
