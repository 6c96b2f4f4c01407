"""What a program can ask of a `Robot` without waiting: one list of calls for both I/O layers, and the gripper's.

The blocking and the asyncio robot differ in how they wait, not in what they can
do, so these calls stand here once. Each one is carried out at once on the core
and its frames leave in order; P2OS acknowledges nothing.

Source: Pioneer 3 manual, client commands; Pioneer 2 gripper manual, command 33 and its arguments.
"""

import math
import weakref
from collections.abc import Callable, Iterable
from enum import IntEnum
from typing import ClassVar, Protocol

from p2os.client.core import PacketType, RobotCore
from p2os.client.goals import as_number
from p2os.client.line import Listeners, Result
from p2os.client.notices import LinkLostError, Notice
from p2os.client.robot_state import Limits, Link, RobotPose, RobotState
from p2os.client.robot_thread import Opener
from p2os.client.settings import DEADMAN_S, ClientSettings
from p2os.protocol.commands import Command, CommandNumber, sonar
from p2os.protocol.config_packet import ConfigPacket
from p2os.protocol.connection import ConnectionStats
from p2os.protocol.packets import Identity
from p2os.protocol.profiles import Profile
from p2os.robots.parameters import RobotParameters, load_parameters
from p2os.transport import open_url
from p2os.transport.ports import Transport
from p2os.transport.url import SerialUrl, parse_url
from p2os.transport.wall_clock import Clock, wall_clock
from simbase.errors import UsageError
from simbase.timing import NS_PER_S, Nanos

#: What the argument of a request means: one packet, or one a cycle.
ONCE, ALWAYS = 1, 2
#: SAY carries at most so many notes, each at most so long (Pioneer manuals, command 15).
MOST_NOTES, LONGEST_NOTE_S, NOTE_UNIT_S = 20, 5.1, 0.02
#: POLLING carries a byte a sonar, counted from 1 (Pioneer manuals, command 3).
MOST_SONAR = 0xFE


class Runner(Protocol):
    """What drives a core on a line: a thread, or an event loop."""

    listeners: Listeners

    def __init__(
        self, core: RobotCore, baud: int | None, open_line: Callable[[], Transport], clock: Clock = wall_clock
    ) -> None: ...

    def run(self, call: Callable[[RobotCore, Nanos], Result]) -> Result:
        """Carry a call out on the core, now."""

    def finish(self) -> None:
        """Stop the robot and give everything back."""


class RobotCalls:
    """The calls that both robots share. Arguments as those of `p2os.Robot`."""

    _runner_type: ClassVar[type[Runner]]
    _runner: Runner

    def __init__(
        self,
        url: str,
        *,
        model: str | RobotParameters | None = None,
        auto_enable: bool = True,
        reconnect: bool = True,
        deadman_s: float | None = DEADMAN_S,
        settings: ClientSettings | None = None,
        opener: Opener = open_url,
        clock: Clock = wall_clock,
    ) -> None:
        place = parse_url(url)
        deadman_ns = None if deadman_s is None else round(deadman_s * NS_PER_S)
        chosen = settings or ClientSettings(auto_enable=auto_enable, reconnect=reconnect, deadman_ns=deadman_ns)
        parameters = load_parameters(model) if isinstance(model, str) else model
        self.url = url
        self._clock = clock
        self._core = RobotCore(chosen, parameters=parameters)
        baud = place.baud if isinstance(place, SerialUrl) else None
        self._runner = self._runner_type(self._core, baud, lambda: opener(url), clock)
        self._finalizer = weakref.finalize(self, self._runner.finish)

    # Listening ----------------------------------------------------------------------------

    def on_state(self, callback: Callable[[RobotState], None]) -> Callable[[], None]:
        """Call `callback` with each state, from the client's thread or loop; return what ends that.

        An exception in it stops the robot and is raised in the program's next call.
        """
        return self._runner.listeners.on_state(callback)

    def on_event(self, callback: Callable[[Notice], None]) -> Callable[[], None]:
        """Call `callback` with what happens beside the states; otherwise as `on_state`."""
        return self._runner.listeners.on_event(callback)

    def _run(self, call: Callable[[RobotCore, Nanos], Result]) -> Result:
        return self._runner.run(call)

    def _angle_to(self, heading_rad: float) -> float:
        """Return the shorter way to a heading of the pose's frame."""
        return math.remainder(as_number(heading_rad, "turn_to", "radians") - self.pose.heading_rad, 2 * math.pi)

    # What is known ------------------------------------------------------------------------

    @property
    def state(self) -> RobotState:
        """The newest state.

        Raises:
            LinkLostError: no packet has come yet.
        """
        state = self._run(lambda core, _: core.state)
        if state is None:
            raise LinkLostError("the robot has not sent a packet yet", hint="connect first")
        return state

    @property
    def pose(self) -> RobotPose:
        """The newest pose: metres, and radians that do not wrap."""
        return self.state.pose

    @property
    def link(self) -> Link:
        """Where the client stands with its robot."""
        return self._run(lambda core, _: core.link)

    @property
    def identity(self) -> Identity:
        """The robot's identity.

        Raises:
            LinkLostError: it has not been received yet.
        """
        identity = self._run(lambda core, _: core.identity)
        if identity is None:
            raise LinkLostError("the robot has not sent its identity yet", hint="connect first")
        return identity

    @property
    def config(self) -> ConfigPacket | None:
        """The robot's CONFIGpac; None where it sends none."""
        return self._run(lambda core, _: core.config)

    @property
    def parameters(self) -> RobotParameters:
        """The conversions and measures in use."""
        return self._run(lambda core, _: core.parameters)

    @property
    def profile(self) -> Profile:
        """The firmware family in use."""
        return self._run(lambda core, _: core.profile)

    @property
    def limits(self) -> Limits:
        """How fast the robot may go, from its CONFIGpac where it sent one."""
        return self._run(lambda core, _: core.limits)

    @property
    def baud(self) -> int | None:
        """The line's speed now, bit/s; None where there is no such thing."""
        return self._run(lambda core, _: core.baud)

    @property
    def stats(self) -> ConnectionStats:
        """Counters of the present connection: frames, noise, bad checksums, timeouts."""
        return self._run(lambda core, _: core.stats)

    def newest(self, kind: type[PacketType]) -> PacketType | None:
        """Return the last packet of a type of `p2os.protocol.packets` that came in this session, or None.

        Standard packets are `state.sip`, the configuration is `config`.
        """
        return self._run(lambda core, _: core.newest(kind))

    # Motion -------------------------------------------------------------------------------

    def set_velocity(self, forward_mps: float = 0.0, turn_radps: float = 0.0) -> None:
        """Hold these speeds until something else is asked; cut to `limits`.

        The wire carries whole mm/s and whole deg/s.

        Args:
            forward_mps: m/s, positive forward.
            turn_radps: rad/s, positive counter-clockwise.

        Raises:
            LinkLostError: no session is open, or it was lost since the last motion call.
            MotorsDisabledError: the motors are off and this client does not switch them on by itself.
        """
        self._run(lambda core, now: core.set_velocity(forward_mps, turn_radps, now))

    def stop(self) -> None:
        """Stop with the robot's own deceleration, and stay; motors keep their power."""
        self._run(lambda core, now: core.stop(now))

    def emergency_stop(self) -> None:
        """Stop at once, without the ramp (E_STOP), and stay."""
        self._run(lambda core, now: core.stop(now, at_once=True))

    def enable(self, on: bool = True) -> None:
        """Switch the motors on; with False, off."""
        self._run(lambda core, now: core.enable(on, now))

    def disable(self) -> None:
        """Switch the motors off: the robot can be pushed by hand."""
        self.enable(False)

    def set_limits(
        self,
        *,
        forward_mps: float | None = None,
        turn_radps: float | None = None,
        accel_mps2: float | None = None,
        decel_mps2: float | None = None,
        turn_accel_radps2: float | None = None,
        turn_decel_radps2: float | None = None,
    ) -> None:
        """Set the robot's own limits for this session (SETV, SETRV, SETA, SETRA); None leaves one as it is.

        Raises:
            LinkLostError: no session is open.
            UsageError: a limit is no positive number, or is 0 in the whole units of the wire; none is set.
            LocalProtocolError: a limit is more than the wire carries; none is set.
        """
        rows = (
            (CommandNumber.SETV, forward_mps, 1000.0), (CommandNumber.SETRV, turn_radps, math.degrees(1)),
            (CommandNumber.SETA, accel_mps2, 1000.0), (CommandNumber.SETA, decel_mps2, -1000.0),
            (CommandNumber.SETRA, turn_accel_radps2, math.degrees(1)),
            (CommandNumber.SETRA, turn_decel_radps2, -math.degrees(1)),
        )  # fmt: skip
        commands = []
        for number, value, factor in rows:
            if value is None:
                continue
            value = as_number(value, "set_limits", "SI units")  # noqa: PLW2901 - checked
            if not (math.isfinite(value) and value > 0):
                raise UsageError(f"a limit of {value} is not positive")
            argument = round(value * factor)
            if not argument:
                raise UsageError(f"a limit of {value} is 0 in whole {number.row.unit}, which is what the wire carries")
            commands.append(Command(number, argument))
        for command in commands:
            self.send(command)

    def set_pose(self, x_m: float = 0.0, y_m: float = 0.0, heading_rad: float = 0.0) -> None:
        """Set where the robot is; states from now on count from there. Nothing is sent."""
        x_m, y_m = as_number(x_m, "set_pose", "metres"), as_number(y_m, "set_pose", "metres")
        pose = RobotPose(x_m, y_m, as_number(heading_rad, "set_pose", "radians"))
        self._run(lambda core, _: core.set_pose(pose))

    # Anything -----------------------------------------------------------------------------

    def send(self, command: Command | int, argument: int | bytes | None = None) -> None:
        """Send any command, by its number or ready made; no limit is looked at.

        A command that moves the robot takes the place of what was asked before,
        and nothing repeats it. SETO makes the pose jump: `set_pose` does not.

        Raises:
            LinkLostError: no session is open.
            LocalProtocolError: the argument does not fit the wire.
        """
        ready = command if isinstance(command, Command) else Command(command, argument)
        self._run(lambda core, now: core.send(ready, now))

    # Sonar --------------------------------------------------------------------------------

    def set_sonar(self, on: bool = True) -> None:
        """Switch all sonar."""
        self.send(sonar(on))

    def set_sonar_order(self, numbers: Iterable[int]) -> None:
        """Let sonar fire in this order, numbered from 0; repeats are allowed, an empty order is silence (POLLING).

        Raises:
            UsageError: A number does not fit a byte, in which the wire counts from 1.
        """
        order = list(numbers)
        if wrong := [number for number in order if not 0 <= number <= MOST_SONAR]:
            raise UsageError(f"sonar {wrong[0]}: they are numbered from 0 to {MOST_SONAR}")
        self.send(CommandNumber.POLLING, bytes(number + 1 for number in order))

    # Inputs and outputs -------------------------------------------------------------------

    def set_digital(self, mask: int, states: int) -> None:
        """Set those of the eight digital outputs that `mask` names (DIGOUT).

        The mask travels as the high byte, as the command tables, ARIA and the simulator have it.
        """
        if not (0 <= mask <= 0xFF and 0 <= states <= 0xFF):
            raise UsageError(f"outputs are eight bits: mask {mask}, states {states}")
        word = mask << 8 | states
        self.send(CommandNumber.DIGOUT, word if word < 0x8000 else word - 0x10000)

    def select_analog(self, port: int) -> None:
        """Show this analog port in the states (ADSEL)."""
        self.send(CommandNumber.ADSEL, port)

    def request_io(self, *, always: bool = False) -> None:
        """Ask for an IOpac, or for one a cycle; it comes as a `PacketArrived`."""
        self.send(CommandNumber.IOREQUEST, ALWAYS if always else ONCE)

    def request_encoders(self, *, always: bool = False) -> None:
        """Ask for an ENCODERpac, or for one a cycle; it comes as a `PacketArrived`."""
        self.send(CommandNumber.ENCODER, ALWAYS if always else ONCE)

    @property
    def gripper(self) -> "Gripper":
        """The gripper's commands."""
        return Gripper(self.send)

    # Sounds -------------------------------------------------------------------------------

    def say(self, notes: Iterable[tuple[float, int]]) -> None:
        """Play notes on the buzzer (SAY).

        Args:
            notes: (seconds, tone): at most 20 of at most 5.1 s; tone 0 is a rest, 1 to 127 are MIDI notes.
        """
        pairs = list(notes)
        if len(pairs) > MOST_NOTES:
            raise UsageError(f"{len(pairs)} notes: SAY takes at most {MOST_NOTES}")
        for duration_s, tone in pairs:
            if not (0 <= duration_s <= LONGEST_NOTE_S and 0 <= tone <= 0xFF):
                raise UsageError(f"note ({duration_s} s, {tone}): at most {LONGEST_NOTE_S} s, tones 0 to 255")
        self.send(CommandNumber.SAY, bytes(part for s, tone in pairs for part in (round(s / NOTE_UNIT_S), tone)))

    def play_sound(self, number: int) -> None:
        """Play a stored sound (SOUND; AmigoBot)."""
        self.send(CommandNumber.SOUND, number)

    def set_buzzer(self, on: bool) -> None:
        """Let the robot's own warnings sound, or not (SOUNDTOG)."""
        self.send(CommandNumber.SOUNDTOG, int(on))


class GripperAction(IntEnum):
    """The arguments of GRIPPER."""

    OPEN = 1
    CLOSE = 2
    STOP = 3
    LIFT_UP = 4
    LIFT_DOWN = 5
    LIFT_STOP = 6
    #: Close and lift, for driving.
    STORE = 7
    #: Lower and open, ready to grasp.
    DEPLOY = 8
    #: Stop paddles and lift.
    HALT = 15
    #: The grasping pressure; its value goes before it with GRIPPERVAL.
    PRESSURE = 16
    #: Lift for so long; its value goes before it with GRIPPERVAL.
    LIFT_CARRY = 17


class CommandSender(Protocol):
    """Sends one command with its argument."""

    def __call__(self, command: int, argument: int | bytes | None = None) -> None:
        """Send it."""


class Gripper:
    """Paddles and lift; what they do shows in GRIPPERpacs (`request`)."""

    def __init__(self, send: CommandSender) -> None:
        self._send = send

    def act(self, action: GripperAction) -> None:
        """Send any of the gripper's actions."""
        self._send(CommandNumber.GRIPPER, int(action))

    def open(self) -> None:
        """Open the paddles."""
        self.act(GripperAction.OPEN)

    def close(self) -> None:
        """Close the paddles until they grasp."""
        self.act(GripperAction.CLOSE)

    def stop(self) -> None:
        """Stop paddles and lift."""
        self.act(GripperAction.HALT)

    def lift_up(self) -> None:
        """Raise the lift."""
        self.act(GripperAction.LIFT_UP)

    def lift_down(self) -> None:
        """Lower the lift."""
        self.act(GripperAction.LIFT_DOWN)

    def store(self) -> None:
        """Close and lift, for driving."""
        self.act(GripperAction.STORE)

    def deploy(self) -> None:
        """Lower and open, ready to grasp."""
        self.act(GripperAction.DEPLOY)

    def set_pressure(self, value: int) -> None:
        """Set the grasping pressure, 0 to 255 of the gripper's own units."""
        self._send(CommandNumber.GRIPPERVAL, value)
        self.act(GripperAction.PRESSURE)

    def carry(self, value: int) -> None:
        """Move the lift for `value` times 20 ms, upwards where positive."""
        self._send(CommandNumber.GRIPPERVAL, value)
        self.act(GripperAction.LIFT_CARRY)

    def request(self, *, always: bool = False) -> None:
        """Ask for a GRIPPERpac, or for one a cycle; it comes as a `PacketArrived`."""
        self._send(CommandNumber.GRIPREQUEST, ALWAYS if always else ONCE)
