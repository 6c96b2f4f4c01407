"""`p2os teleop`: drive a robot with the keyboard, or with a game pad.

What reads a pad is `p2os.cli.robots.pad_source`, what its buttons mean `p2os.gamepad`.

Theory of operation. A terminal shows when a key is pressed and repeats it while it is
held, but never that it was released. The first press drives for as long as keyboards
take to begin to repeat; each repetition drives on for a shorter time. So a tap is a
short push, a held key drives, and a key released, a terminal that hangs or a person
who walks away stop the robot (`Teleop`, passive; `KeyLoop` around it). With a pad, Up
connects, R2, L2 and the right stick drive, Down releases the robot (`PadDriver`).

Invariant: the robot stands unless a key or a report younger than its hold or loss time
asks for more, and after a pause of the program until a key or Up is pressed anew.
"""

import contextlib
import math
import os
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from typing import Annotated, Protocol

import typer

from p2os.cli.captures.shown_page import NoBrowser, Viewed
from p2os.cli.groups import ROBOTS
from p2os.cli.held_robot import held, hold_robot, say_what_is_beyond
from p2os.cli.keyboard import raw_keyboard
from p2os.cli.names import ReportedModel, RobotUrl
from p2os.cli.quantities import option
from p2os.cli.robots.pad_source import SdlPad
from p2os.cli.robots.page_stop import PageStop
from p2os.cli.robots.robot_page import opened_for
from p2os.client import Link, Robot
from p2os.client.notices import DeadmanStopped, GapStopped, LinkLostError, Notice
from p2os.gamepad import PAD_MPS, PAD_RADPS, STICK_FULL, TRIGGER_FULL, Gamepad, PadReport
from p2os.transport.waiting import wait_readable
from p2os.transport.wall_clock import Clock, GapWatch, wall_clock
from simbase.errors import UsageError
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos
from simbase.units import SPEED, TURN_RATE

HELP = """Drive a robot with the keyboard or a game pad.

Hold a key to drive; release it to stop. The robot also stops when the terminal
closes, the link is lost, the machine sleeps or the program ends. Press a key
again to continue.

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

With --view, STOP stands on the page in the browser, and Escape there is the same.

With --pad: Up connects, Down releases it, R2 drives ahead, L2 back, the right stick
turns; a pad that goes away stops the robot within 200 ms.
"""
#: Speeds of a held key.
KEY_MPS, KEY_RADPS = 0.3, math.radians(45)
#: chosen: how often keys are looked for and the line is renewed.
TURN_NS: Nanos = 50 * NS_PER_MS
#: chosen: a lone Esc and an arrow key begin alike; the rest of an arrow follows at once.
ESCAPE_WAIT_S = 0.03
#: Keyboards begin to repeat after 250 to 660 ms (X11's default is 660 ms).
FIRST_HOLD_NS: Nanos = 700 * NS_PER_MS
#: chosen: keyboards repeat every 25 to 50 ms; slow links bunch the repetitions up.
NEXT_HOLD_NS: Nanos = 300 * NS_PER_MS
#: chosen: two presses nearer than this are a held key.
REPEAT_NS: Nanos = 250 * NS_PER_MS
#: Each press of + or - changes the speeds by so much.
FACTOR = 1.1
SLOWEST, FASTEST = 0.05, 1.0

#: Key → (forward, turn), in shares of the chosen speeds.
KEYS: Mapping[str, tuple[float, float]] = {
    "up": (1, 0), "down": (-1, 0), "left": (0, 1), "right": (0, -1),
    "w": (1, 0), "s": (-1, 0), "a": (0, 1), "d": (0, -1),
    "i": (1, 0), ",": (-1, 0), "j": (0, 1), "l": (0, -1),
    "u": (1, 1), "o": (1, -1), "m": (-1, -1), ".": (-1, 1),
}  # fmt: skip
STOP_KEYS = (" ", "k", "x")
QUIT_KEYS = ("q", "escape", "\x03", "\x04")
#: What terminals send for the arrow keys.
SEQUENCES: Mapping[str, str] = {
    "\x1b[A": "up", "\x1b[B": "down", "\x1b[C": "right", "\x1b[D": "left",
    "\x1bOA": "up", "\x1bOB": "down", "\x1bOC": "right", "\x1bOD": "left",
}  # fmt: skip
#: How often the pad is read.
PAD_PERIOD_NS: Nanos = 20 * NS_PER_MS

#: Returns the pad's report; None while it is gone.
Reports = Callable[[], PadReport | None]


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("teleop", help=HELP, rich_help_panel=ROBOTS)(teleop)


def teleop(
    url: RobotUrl,
    vel: Annotated[
        float | None,
        option(
            SPEED,
            "--vel",
            purpose="Speed of a held key or a full trigger.",
            above_zero=True,
            shown=f"{KEY_MPS:g}m/s, pad {PAD_MPS:g}m/s",
        ),
    ] = None,
    turn_rate: Annotated[
        float | None,
        option(
            TURN_RATE,
            "--turn-rate",
            purpose="Turning speed of a held key or a full stick.",
            above_zero=True,
            shown=f"{math.degrees(KEY_RADPS):.0f}deg/s, pad {PAD_RADPS:g}rad/s",
        ),
    ] = None,
    pad: Annotated[bool, typer.Option("--pad", help="Drive by game pad instead of keys.")] = False,
    robot: ReportedModel = "",
    view: Viewed = False,
    no_browser: NoBrowser = False,
) -> None:
    """Drive by keyboard or pad."""
    stop = PageStop()

    @contextlib.contextmanager
    def connected() -> Iterator[Robot]:
        with (
            opened_for(url, robot, is_viewed=view, is_opened=not no_browser, stop=stop) as opener,
            held(Robot(url, model=robot or None, opener=opener), moves=True) as client,
        ):
            say_what_is_beyond(client.limits, speed_mps=vel, rate_radps=turn_rate)
            yield client

    if pad:
        drive_by_pad(connected, (vel or PAD_MPS, turn_rate or PAD_RADPS), stop)
        return
    if not sys.stdin.isatty():
        raise UsageError("there is no keyboard: stdin is not a terminal", hint="p2os drive URL --vel 0.2m/s --for 2s")
    with connected() as client, raw_keyboard():
        sys.stderr.write("hold arrows or w a s d to drive, space stops, + - change the speed, q ends\r\n")
        most = client.limits
        keys = Teleop(min(vel or KEY_MPS, most.forward_mps), min(turn_rate or KEY_RADPS, most.turn_radps))
        loop = KeyLoop(keys, client, stop=stop)
        try:
            while not loop.keys.is_over:
                loop.turn()
        finally:
            sys.stderr.write("\r\n")


def drive_by_pad(
    connect: Callable[[], AbstractContextManager[Robot]], fastest: tuple[float, float], stop: PageStop
) -> None:
    """Drive by the first game pad of this machine."""
    hold_robot()
    with SdlPad() as pad:
        sys.stderr.write(f"game pad: {pad.name}\n")
        PadDriver(
            pad.report,
            connect,
            fastest,
            clock=wall_clock,
            wait=lambda span_ns: time.sleep(span_ns / NS_PER_S),
            report=lambda text: print(text, file=sys.stderr),  # noqa: T201 - the I/O layer
            stop=stop,
        ).run()


class Teleop:
    """What the keys ask of the robot.

    Args:
        forward_mps: Speed of a full step, m/s.
        turn_radps: Turning speed of a full step, rad/s.
    """

    def __init__(self, forward_mps: float, turn_radps: float) -> None:
        self._forward_mps, self._turn_radps = forward_mps, turn_radps
        self.share = 1.0
        self.is_over = False
        self._wanted = (0.0, 0.0)
        self._key = ""
        self._pressed_ns: Nanos = 0
        self._until: Nanos | None = None
        #: Until when keys that drive mean nothing, unless one comes before: then that much longer.
        self._deaf_until: Nanos | None = None

    @property
    def is_stopped(self) -> bool:
        """Whether what is held means nothing until it was let go."""
        return self._deaf_until is not None

    def stop(self, now: Nanos) -> None:
        """Stand, until no key was held for as long as a keyboard takes to begin to repeat."""
        self._until, self._key, self._deaf_until = None, "", now + FIRST_HOLD_NS

    @property
    def is_driving(self) -> bool:
        """Whether a key is held."""
        return self._until is not None

    @property
    def speeds(self) -> tuple[float, float]:
        """What the robot should do now: m/s forward, rad/s counter-clockwise."""
        if self._until is None:
            return 0.0, 0.0
        return self._wanted[0] * self._forward_mps * self.share, self._wanted[1] * self._turn_radps * self.share

    def press(self, key: str, now: Nanos) -> None:
        """Take a key."""
        self.advance_to(now)
        if key in QUIT_KEYS:
            self.is_over = True
            self._until = None
        elif key in STOP_KEYS:
            self._until, self._key = None, ""
        elif key in {"+", "="}:
            self.share = min(FASTEST, self.share * FACTOR)
        elif key in {"-", "_"}:
            self.share = max(SLOWEST, self.share / FACTOR)
        elif key in KEYS and self._deaf_until is not None:
            self._deaf_until = now + FIRST_HOLD_NS
        elif key in KEYS:
            is_repeated = key == self._key and now - self._pressed_ns < REPEAT_NS
            hold = NEXT_HOLD_NS if is_repeated else FIRST_HOLD_NS
            self._wanted, self._key, self._pressed_ns = KEYS[key], key, now
            self._until = max(now + hold, self._until or 0) if is_repeated else now + hold

    def next_deadline(self) -> Nanos | None:
        """Return when the deadman stops the robot."""
        return self._until

    def advance_to(self, now: Nanos) -> None:
        """Stop if no key came in time."""
        if self._until is not None and now >= self._until:
            self._until = None
        if self._deaf_until is not None and now >= self._deaf_until:
            self._deaf_until = None


class KeyLoop:
    """Hands what the keys ask for to the robot, turn by turn.

    After a pause of the program nothing is held any more, and keys that waited
    mean nothing, but for those that end it; the next press or repetition drives.

    Args:
        keys: What the keys ask for.
        client: The robot.
        read: Returns the keys that came within so many nanoseconds.
        clock: Nanoseconds that never run back.
        stop: The button on its page; what is held then means nothing until it was let go.
    """

    def __init__(
        self,
        keys: Teleop,
        client: Robot,
        *,
        read: Callable[[Nanos], list[str]] | None = None,
        clock: Clock = wall_clock,
        stop: PageStop | None = None,
    ) -> None:
        self._stop = stop or PageStop()
        self.keys = keys
        self._client = client
        self._read = read_keys if read is None else read
        self._clock = clock
        self._gaps = GapWatch(clock())
        self._stops: deque[Notice] = deque()
        client.on_event(lambda notice: self._stops.append(notice) if is_stop(notice) else None)

    def turn(self) -> None:
        """Take the keys that came, send the speeds, show where the robot is."""
        self._gaps.expect(self._clock() + TURN_NS)
        pressed = self._read(TURN_NS)
        now = self._clock()
        if self._gaps.gap(now) or self._stops:
            self._stops.clear()
            pressed = [" ", *(key for key in pressed if key in QUIT_KEYS)]
        for key in pressed:
            self.keys.press(key, now)
        if self._stop.take():
            self.keys.stop(now)
        self.keys.advance_to(now)
        self._stop.drives(is_driving=self.keys.is_driving)
        try:
            self._client.set_velocity(*self.keys.speeds)
        except LinkLostError:  # looked for again by the client; nothing moves meanwhile, nor at once afterwards
            self.keys.press(" ", now)
        sys.stderr.write(f"\r\x1b[K{status(self.keys, self._client)}")


def status(keys: Teleop, client: Robot) -> str:
    """Return one line about the robot, of 78 characters at most: a longer one would wrap and not be drawn over."""
    if client.link is not Link.OPEN:
        return f"link: {client.link.value}"
    state, (forward_mps, turn_radps) = client.state, keys.speeds
    standing = "STOP " if keys.is_stopped else "stand"
    doing = "STALL" if state.is_stalled else "DRIVE" if keys.is_driving else standing
    return (
        f"{doing} {forward_mps:+.2f} m/s {math.degrees(turn_radps):+.0f} deg/s "
        f"({keys.share:.0%})  x {state.pose.x_m:.2f} m  y {state.pose.y_m:.2f} m  "
        f"{math.degrees(state.pose.heading_rad):.0f} deg  {state.battery_v:.1f} V"
    )


def split_keys(text: str) -> list[str]:
    """Return the keys that a terminal's characters stand for."""
    keys, place = [], 0
    while place < len(text):
        sequence = text[place : place + 3]
        if sequence in SEQUENCES:
            keys.append(SEQUENCES[sequence])
            place += 3
        elif text[place] == "\x1b" and text[place + 1 : place + 2] in {"[", "O"}:
            end = next(
                (at for at in range(place + 2, len(text)) if text[at].isalpha() or text[at] == "~"), len(text) - 1
            )
            place = end + 1  # a key that means nothing here
        else:
            keys.append("escape" if text[place] == "\x1b" else text[place].lower())
            place += 1
    return keys


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


class DrivenClient(Protocol):
    """What is needed of the robot's client."""

    def set_velocity(self, forward_mps: float, turn_radps: float) -> None:
        """Drive at these speeds from now on."""
        ...

    def on_event(self, callback: Callable[[Notice], None]) -> object:
        """Call `callback` with what happens, from any thread."""
        ...


class PadDriver:
    """One pad and one robot.

    Args:
        reports: The pad.
        connect: Opens the robot; leaving it stops the motors.
        fastest: Speeds at full deflection, m/s and rad/s.
        clock: Returns the time, nanoseconds.
        wait: Lets so many nanoseconds pass.
        report: Called with one line at each change.
        stop: The button on its page.
    """

    def __init__(
        self,
        reports: Reports,
        connect: Callable[[], AbstractContextManager[DrivenClient]],
        fastest: tuple[float, float],
        *,
        clock: Callable[[], Nanos],
        wait: Callable[[Nanos], None],
        report: Callable[[str], None],
        stop: PageStop | None = None,
    ) -> None:
        self._stop = stop or PageStop()
        self._reports, self._connect, self._fastest = reports, connect, fastest
        self._clock, self._wait, self._report = clock, wait, report
        self._pad = Gamepad()

    def run(self) -> None:
        """Drive until the pad is gone for good while no robot is connected."""
        self._report("Up connects")
        while True:
            while not self._pad.wants_robot:
                if self._look() is None:
                    self._report("the pad is gone")
                    return
                self._wait(PAD_PERIOD_NS)
            with self._connect() as robot:
                self._report("connected: R2 ahead, L2 back, right stick turns, Down releases the robot")
                why = self._drive(robot)
            self._pad.forget_request()
            self._report(f"{why}: the robot stands; Up connects again")

    def _drive(self, robot: DrivenClient) -> str:
        """Hand speeds on while the connect request lasts; return why it ended."""
        stops: deque[Notice] = deque()
        robot.on_event(lambda notice: stops.append(notice) if is_stop(notice) else None)
        gaps = GapWatch(self._clock())
        self._stop.take()  # one that nobody was driven at means nothing
        self._stop.drives(is_driving=True)
        while True:
            if self._stop.take():
                _stop(robot)
                self._pad.lose()
                return "STOP was pressed on the page"
            if (gap_ns := gaps.gap(self._clock())) or stops:
                _stop(robot)
                self._pad.lose()
                return f"paused for {gap_ns / NS_PER_S:.1f} s" if gap_ns else "the client stopped the robot"
            self._look()
            lost_at = self._pad.lost_at
            if lost_at is None or self._clock() >= lost_at:
                _stop(robot)
                self._pad.lose()
                return "the pad is lost"
            if not self._pad.wants_robot:
                _stop(robot)
                return "Down was pressed"
            try:
                robot.set_velocity(
                    self._fastest[0] * self._pad.forward / TRIGGER_FULL, self._fastest[1] * self._pad.turn / STICK_FULL
                )
            except LinkLostError:
                return "the link is lost"
            gaps.expect(self._clock() + PAD_PERIOD_NS)
            self._wait(PAD_PERIOD_NS)

    def _look(self) -> PadReport | None:
        report = self._reports()
        if report is not None:
            self._pad.take(report, self._clock())
        return report


def is_stop(notice: Notice) -> bool:
    """Tell whether the client has stopped the robot by itself: what drove it must be asked for again."""
    return isinstance(notice, (GapStopped, DeadmanStopped))


def _stop(robot: DrivenClient) -> None:
    with contextlib.suppress(LinkLostError):  # it stands by itself then
        robot.set_velocity(0.0, 0.0)
