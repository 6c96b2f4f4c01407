"""The client without a line and without a clock: what both I/O layers of `Robot` drive.

An I/O layer carries out `take_action`, feeds `line_opened`, `line_failed`,
`line_lost` and `receive`, calls `advance_to` at `next_deadline`, and hands on
`news`. Everything else is decided here, in the time that is passed in: the
`LinkSupervisor` keeps the link, the `Observer` makes states of packets, the `Mover`
moves the robot. `REQUESTS` are the packets that a robot sends only when it is asked;
one without the device stays silent, and `fetch` ends with `NoAnswerError`.

After a loss the first motion call raises `LinkLostError`, even if the link is
back by then: the program has to know.

Invariant: after a loss nothing but zero speeds goes out until a motion call
has returned without raising.
"""

import math
from collections import deque
from collections.abc import Callable, Mapping
from typing import TypeVar

from p2os.client.goals import MotionAxis, MotionGoal, as_number
from p2os.client.link import LinkSupervisor
from p2os.client.mover import Mover, Speeds
from p2os.client.notices import (
    ConfigurationKnown,
    Connected,
    GaveUp,
    LinkLost,
    LinkLostError,
    Notice,
    OdometryDoubtful,
    PacketArrived,
    RobotUnknown,
)
from p2os.client.observer import Observer, bumpers_of, limits_of
from p2os.client.outbox import Action, Send
from p2os.client.robot_state import Limits, Link, RobotPose, RobotState
from p2os.client.settings import ClientSettings
from p2os.protocol.commands import Command, CommandNumber
from p2os.protocol.config_packet import ConfigPacket
from p2os.protocol.connection import ConnectionStats
from p2os.protocol.packets import (
    ArmInfoPacket,
    ArmPacket,
    BatteryPacket,
    CompassPacket,
    EncoderPacket,
    GripperPacket,
    GyroPacket,
    Identity,
    IoPacket,
    JoystickPacket,
    PlaylistPacket,
    ServerPacket,
)
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import StandardSip
from p2os.robots.parameters import ParametersError, RobotParameters, load_parameters
from simbase.errors import UsageError
from simbase.timing import Nanos, Reached

#: Any type of packet, for calls that return the type that they were given.
PacketType = TypeVar("PacketType", bound=ServerPacket)

#: Type of packet → the command that makes the robot send one (manuals, client commands).
REQUESTS: Mapping[type, Command] = {
    ArmInfoPacket: Command(CommandNumber.ARM_INFO),
    ArmPacket: Command(CommandNumber.ARM_STATUS, 1),
    BatteryPacket: Command(CommandNumber.BATTERYINFO, 1),
    CompassPacket: Command(CommandNumber.TCM2, 2),
    EncoderPacket: Command(CommandNumber.ENCODER, 1),
    GripperPacket: Command(CommandNumber.GRIPREQUEST, 1),
    GyroPacket: Command(CommandNumber.GYRO, 1),
    IoPacket: Command(CommandNumber.IOREQUEST, 1),
    JoystickPacket: Command(CommandNumber.JOYREQUEST, 1),
    PlaylistPacket: Command(CommandNumber.PLAYLIST),
}
#: Whose parameters are used for a model that nobody knows.
FALLBACK_MODEL = "p2dx"


class RobotCore:
    """One robot, as a passive state machine.

    Args:
        settings: How it behaves.
        parameters: The robot's, where they are to be other than those of its model.
        load: Gives the parameters of a model.
    """

    def __init__(
        self,
        settings: ClientSettings,
        *,
        parameters: RobotParameters | None = None,
        load: Callable[[str], RobotParameters] = load_parameters,
    ) -> None:
        self.settings = settings
        self.news: deque[RobotState | Notice] = deque()
        #: What became of the last session that could not be opened, or the last loss.
        self.problem: GaveUp | LinkLost | None = None
        self._given = parameters
        self._load = load
        self._supervisor = LinkSupervisor(settings)
        self._observer = Observer(parameters or load(FALLBACK_MODEL), settings.profile)
        self._mover = Mover(
            settings, self._observer, send=self._supervisor.send, send_first=self._supervisor.send_first,
            drop=self._supervisor.drop, notify=self.news.append,
        )  # fmt: skip
        self._now: Nanos = 0
        self._packets: dict[type, ServerPacket] = {}
        self._unreported_loss: str | None = None

    # What is known ------------------------------------------------------------------------

    @property
    def link(self) -> Link:
        """Where the client stands with its robot."""
        return self._supervisor.link

    @property
    def is_ready(self) -> bool:
        """Whether packets flow and the configuration has come, or will not."""
        return self._supervisor.is_ready

    @property
    def state(self) -> RobotState | None:
        """The last state; None before the first packet."""
        return self._observer.state

    @property
    def identity(self) -> Identity | None:
        """The robot's identity, from its answer to SYNC2."""
        return self._supervisor.identity

    @property
    def config(self) -> ConfigPacket | None:
        """The robot's CONFIGpac, once it has come."""
        return self._supervisor.config

    @property
    def baud(self) -> int | None:
        """The line's speed; None where there is no such thing."""
        return self._supervisor.baud

    @property
    def parameters(self) -> RobotParameters:
        """The conversions, limits and measures in use."""
        return self._observer.parameters

    @property
    def profile(self) -> Profile:
        """The firmware family in use."""
        return self._observer.firmware.profile

    @property
    def limits(self) -> Limits:
        """How fast the robot may go: its own limits, and those that were set in this session."""
        return self._mover.limits(limits_of(self.parameters, self.config))

    def newest(self, kind: type[PacketType]) -> PacketType | None:
        """Return the last packet of a type that came in this session; standard packets are `state.sip`."""
        packet = self._packets.get(kind)
        return packet if isinstance(packet, kind) else None

    @property
    def stats(self) -> ConnectionStats:
        """Counters of the present connection."""
        return self._supervisor.stats

    @property
    def commanded(self) -> Speeds:
        """The speeds that are held; zero while nothing or a goal moves the robot."""
        return self._mover.commanded

    @property
    def is_quiet(self) -> bool:
        """Whether nothing waits to go out."""
        return self._supervisor.outbox.is_empty

    # What the program asks ----------------------------------------------------------------

    def connect(self, now: Nanos) -> None:
        """Begin to look for the robot."""
        self.touch(now)
        self.problem, self._unreported_loss = None, None
        self._supervisor.connect()

    def close(self, now: Nanos) -> None:
        """Stop the robot and leave it, whatever is under way."""
        self._mover.lose(now)
        self._supervisor.close(now)

    def touch(self, now: Nanos) -> None:
        """Note a call of the program: the deadman counts from the last one."""
        self._mover.touch(now)

    def send(self, command: Command, now: Nanos) -> None:
        """Send any command of the manual.

        Raises:
            LinkLostError: there is no open session.
        """
        self._require_open()
        self._mover.note(command, now)
        self._supervisor.send(command, now)

    def set_velocity(self, forward_mps: float, turn_radps: float, now: Nanos) -> None:
        """Hold these speeds, cut to the limits, until something else is asked.

        Raises:
            LinkLostError: there is no open session, or there was a loss since the last motion call.
            MotorsDisabledError: the motors are off and are not switched on by themselves.
            UsageError: a speed is no number.
        """
        forward_mps = as_number(forward_mps, "set_velocity", "m/s")
        turn_radps = as_number(turn_radps, "set_velocity", "rad/s")
        if not (math.isfinite(forward_mps) and math.isfinite(turn_radps)):
            raise UsageError(f"a speed of {forward_mps} m/s and {turn_radps} rad/s is no speed")
        self.touch(now)
        limits = self.limits
        speeds = Speeds.of(_cut(forward_mps, limits.forward_mps), _cut(turn_radps, limits.turn_radps))
        if speeds.are_zero:
            self._require_open()
        else:
            self._require_motion(now)
        self._mover.set_velocity(speeds, now)

    def stop(self, now: Nanos, *, at_once: bool = False) -> None:
        """Stop, and stay: STOP (`at_once`: E_STOP before it), then zero speeds held.

        Raises:
            LinkLostError: there is no open session.
        """
        self._require_open()
        self._mover.stop("stopped", now, at_once=at_once)

    def enable(self, on: bool, now: Nanos) -> None:
        """Switch the motors.

        Raises:
            LinkLostError: there is no open session.
        """
        self._require_open()
        self._mover.enable(on, now)

    def begin_goal(self, axis: MotionAxis, limit_ns: Nanos | None, speed: float | None, now: Nanos) -> MotionGoal:
        """Begin a `drive` or a `turn`; its end is a `MotionEnded`.

        Args:
            axis: What is to be done.
            limit_ns: How long it may take; None: twice what the limits allow, and some seconds.
            speed: The most for this goal, m/s or rad/s; None: the limit.
            now: Nanoseconds.

        Raises:
            LinkLostError, MotorsDisabledError, UsageError: as `set_velocity`.
        """
        self._require_motion(now)
        return self._mover.begin_goal(axis, limit_ns, speed, self.limits, now)

    def cancel_goal(self, goal: MotionGoal, now: Nanos) -> None:
        """Stop, if this goal is still under way."""
        self._mover.cancel_goal(goal, now)

    def set_pose(self, pose: RobotPose) -> None:
        """Set where the robot is; nothing is sent to the robot."""
        self._observer.place(pose)

    # What the line reports ----------------------------------------------------------------

    def line_opened(self, now: Nanos, baud: int | None) -> None:
        """Take a line that is open; `baud` is None where it has no speed."""
        self._supervisor.line_opened(now, baud)
        self._collect(now)

    def line_failed(self, reason: str, hint: str | None, now: Nanos) -> None:
        """Note that the line cannot be opened."""
        self._supervisor.line_failed(reason, hint, now)
        self._collect(now)

    def line_lost(self, reason: str, now: Nanos) -> None:
        """Note that the line has gone."""
        self._supervisor.line_lost(reason, now)
        self._collect(now)

    def receive(self, data: bytes, now: Nanos) -> None:
        """Take bytes that arrived at `now`."""
        self.advance_to(now)
        self._supervisor.receive(data, now)
        self._collect(now)

    def take_gap(self, gap_ns: Nanos, now: Nanos) -> None:
        """Send STOP before anything else: program or machine paused for `gap_ns`, which ended just now.

        `now` is the time before the gap; what was due in it has not been acted on.
        """
        if self.link is Link.OPEN:
            self._mover.take_gap(gap_ns, now)

    def take_action(self, now: Nanos) -> Action | None:
        """Return the next thing to do with the line, if any is due; a frame counts as sent from here on."""
        action = self._supervisor.take_action(now)
        if isinstance(action, Send):
            self._mover.take_sent(action.data)
        return action

    def next_deadline(self) -> Nanos | None:
        """Return when this wants to act, or an action is due."""
        due = [self._supervisor.next_deadline(), self._supervisor.outbox.next_deadline(), *self._own_deadlines()]
        return min((at for at in due if at is not None), default=None)

    def advance_to(self, limit: Nanos) -> Reached:
        """Act on every deadline of its own up to `limit`; actions wait for `take_action`."""
        while True:
            due = [self._supervisor.next_deadline(), *self._own_deadlines()]
            first = min((at for at in due if at is not None), default=None)
            if first is None or first > limit:
                self._now = max(self._now, limit)
                return Reached(limit)
            self._act(max(first, self._now))

    def _own_deadlines(self) -> list[Nanos | None]:
        return self._mover.deadlines() if self.link is Link.OPEN else []

    def _act(self, now: Nanos) -> None:
        """Do all that is due at `now`."""
        self._now = now
        self._supervisor.advance_to(now)
        self._collect(now)
        if self.link is Link.OPEN:
            self._mover.act(now)

    # What the link reports ----------------------------------------------------------------

    def _collect(self, now: Nanos) -> None:
        supervisor = self._supervisor
        while supervisor.news:
            item = supervisor.news.popleft()
            if isinstance(item, tuple):
                self._take_sip(*item, now)
                continue
            match item:
                case Connected():
                    self._begin_session(item.identity)
                case ConfigurationKnown():
                    self._observer.bumpers = bumpers_of(item.config)
                    self._observer.firmware.take_config(item.config)
                    self._supervisor.set_profile(self.profile)
                case LinkLost():
                    self.problem, self._unreported_loss = item, item.reason
                    self._mover.lose(now)
                case GaveUp():
                    self.problem = item
                case PacketArrived():
                    self._packets[type(item.packet)] = item.packet
                case _:
                    pass
            self.news.append(item)

    def _begin_session(self, identity: Identity) -> None:
        parameters = self._given
        if parameters is None:
            try:
                parameters = self._load(identity.subclass.lower())
            except ParametersError:
                parameters = self._load(FALLBACK_MODEL)
                self.news.append(RobotUnknown(identity.subclass, FALLBACK_MODEL))
        self._packets.clear()
        self._observer.new_session(parameters)
        self._supervisor.set_profile(self.profile)
        self._mover.new_session()

    def _take_sip(self, sip: StandardSip, read_as: Profile, now: Nanos) -> None:
        """Take a packet that was read in a family's layout; where it is of another one, it is read anew."""
        hint = self.profile
        sip = _read_anew(sip, read_as, hint)
        self._observer.firmware.take(sip)
        if self.profile is not hint:
            sip = _read_anew(sip, hint, self.profile)
            self._supervisor.set_profile(self.profile)
        state = self._observer.take(sip, now)
        if (gap_ns := self._observer.doubtful_gap_ns(self.limits)) is not None:
            self.news.append(OdometryDoubtful(gap_ns))
        self.news.append(state)
        self._mover.take(state, now)

    # What must be so ----------------------------------------------------------------------

    def _require_open(self) -> None:
        if self.link is Link.OPEN:
            return
        reason = f": {self.problem.reason}" if self.problem is not None else ""
        raise LinkLostError(f"no robot is connected ({self.link.value}){reason}", hint="wait for it, or connect again")

    def _require_motion(self, now: Nanos) -> None:
        """Refuse to move a robot of which the program does not know enough, and switch its motors on."""
        lost, self._unreported_loss = self._unreported_loss, None
        self._require_open()
        if lost is not None:
            raise LinkLostError(f"the link was lost and is back: {lost}", hint="the robot stands; call again to go on")
        self._mover.require_motors(now)


def request_for(kind: type) -> Command:
    """Return the command that asks for a type of packet.

    Raises:
        UsageError: Nothing asks for it.
    """
    if kind not in REQUESTS:
        names = ", ".join(sorted(known.__name__ for known in REQUESTS))
        raise UsageError(f"nothing asks for a {kind.__name__}", hint=f"one of {names}")
    return REQUESTS[kind]


def _read_anew(sip: StandardSip, was: Profile, profile: Profile) -> StandardSip:
    """Return a packet that was read in one family's layout as another's."""
    return sip if was is profile else StandardSip.from_frame(sip.to_frame(was), profile)


def _cut(value: float, most: float) -> float:
    return max(-most, min(most, value))
