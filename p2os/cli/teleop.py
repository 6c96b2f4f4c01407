"""`p2os teleop`: drive a robot with the keyboard."""

import contextlib
import math
import os
import select
import sys
import time
from collections.abc import Iterator
from typing import Annotated

import typer

from p2os.cli.pad_source import SdlPad
from p2os.cli.quantities import Quantity, parse_quantity
from p2os.cli.signals import end_on_signals
from p2os.cli.teleop_keys import Teleop, split_keys
from p2os.cli.teleop_pad import PadDriver
from p2os.client import Link, Robot
from p2os.client.problems import LinkLostError
from p2os.errors import MissingDependencyError, UsageError
from p2os.gamepad import PAD_MPS, PAD_RADPS
from p2os.timing import NS_PER_S

HELP = """Drive a robot with the keyboard, or with a game pad.

Hold a key to drive; let it go and the robot stops. So it does when the
terminal hangs, the link is lost, or anything ends the program.

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
TURN_S = 0.05
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
    end_on_signals()
    keys = Teleop(forward_mps, turn_radps)
    with Robot(url, model=robot or None) as client, raw_keyboard():
        sys.stderr.write("hold arrows or w a s d to drive, space stops, + - change the speed, q ends\r\n")
        try:
            while not keys.is_over:
                turn(keys, client)
        finally:
            sys.stderr.write("\r\n")


def drive_by_pad(url: str, model: str | None, fastest: tuple[float, float]) -> None:
    """Drive by the first game pad of this machine."""
    end_on_signals()
    with SdlPad() as pad:
        sys.stderr.write(f"game pad: {pad.name}\n")
        PadDriver(
            pad.report,
            lambda: Robot(url, model=model),
            fastest,
            clock=time.monotonic_ns,
            wait=lambda span_ns: time.sleep(span_ns / NS_PER_S),
            say=lambda text: print(text, file=sys.stderr),  # noqa: T201 - the skin
        ).run()


def turn(keys: Teleop, client: Robot) -> None:
    """Take the keys that came, tell the robot, show where it is."""
    for key in read_keys(TURN_S):
        keys.press(key, time.monotonic_ns())
    keys.advance_to(time.monotonic_ns())
    try:
        client.set_velocity(*keys.speeds)
    except LinkLostError:  # looked for again by the client; nothing moves meanwhile, nor at once afterwards
        keys.press(" ", time.monotonic_ns())
    sys.stderr.write(f"\r\x1b[K{status(keys, client)}")
    sys.stderr.flush()


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


def read_keys(longest_s: float) -> list[str]:
    """Return the keys that came within so long; waits for the first only."""
    descriptor = sys.stdin.fileno()
    if not select.select([descriptor], [], [], longest_s)[0]:
        return []
    data = os.read(descriptor, 256)
    if not data:  # the terminal has gone
        return ["q"]
    if data.endswith(b"\x1b") and select.select([descriptor], [], [], ESCAPE_WAIT_S)[0]:
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
        tty.setcbreak(descriptor)
        yield
    finally:
        termios.tcsetattr(descriptor, termios.TCSADRAIN, before)
