"""The robot's own firmware, as a passive state machine above a body.

Bytes of a client go in, bytes of the robot come out, and the body is stepped in
between: handshake, motion commands, odometry, sonar, watchdog.

Theory of operation
-------------------
The `Connection` (server role) speaks the handshake and keeps the watchdog; its
events drive the rest. While open, a standard packet (SIP) goes out every cycle,
counted from OPEN. Motors are off on each new connection; a client turns them on
with ENABLE. When no valid packet comes for the watchdog's time the wheels slow
down to a stand; the next packet releases them and they ramp back to the last
set speed, unless that packet says otherwise. CLOSE, and a host that sees its
client vanish (`hang_up`), take the power from the wheels at once.

What a client sets (limits, sonar order) is lost when it closes, as the H8
manual says of AROS 1.3 and later; earlier firmware kept it until power-down.

Invariant: at time t the body stands at its first step border at or after t, so
the result does not depend on how often anybody calls `advance_to`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

from p2os.commands import Command
from p2os.connection import (
    Closed,
    CommandReceived,
    Connection,
    ConnectionSettings,
    ConnectionStats,
    Event,
    Opened,
    Role,
    Synchronised,
    WatchdogExpired,
    WatchdogRevived,
)
from p2os.packets import Identity
from p2os.parameters import RobotParameters
from p2os.pioneer.command_handlers import Effect, Works, apply
from p2os.pioneer.motion import Motion, MotionLimits
from p2os.pioneer.odometry_counts import DeadReckoning
from p2os.pioneer.ports import Body
from p2os.pioneer.reports import configuration, standard_packet
from p2os.pioneer.settings import ControllerSettings, SonarPerSip
from p2os.pioneer.sonar_schedule import SonarSchedule, raw_range
from p2os.timing import NS_PER_S, Nanos, Reached

__all__ = ["ControllerSettings", "ControllerState", "EventCallback", "Pioneer", "SonarPerSip"]

#: (now in ns, what happened in a word or two, detail).
EventCallback = Callable[[Nanos, str, str], None]

IGNORED = frozenset({Effect.UNKNOWN, Effect.MALFORMED})


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerState:
    """What the controller is doing, as plain values."""

    open: bool
    motors_enabled: bool
    watchdog_expired: bool
    sonar_on: bool
    #: Rim-speed set-points of this moment, after the ramps, in m/s.
    left_setpoint_mps: float
    right_setpoint_mps: float
    #: What the robot believes of its pose, since the last SETO.
    x_mm: float
    y_mm: float
    heading_rad: float
    #: Commands that had no effect since the start: not known, or without their number.
    ignored_commands: int


@dataclass(frozen=True, slots=True, kw_only=True)
class _Snapshot:
    body: object
    body_now: Nanos
    sip_due: Nanos | None
    ignored: int
    complaints: tuple[str, ...]
    connection: object
    output: tuple[bytes, ...]
    motion: object
    reckoning: object
    sonar: object


class Pioneer:
    """A P2OS robot: its controller and its body."""

    def __init__(
        self,
        *,
        parameters: RobotParameters,
        body: Body,
        settings: ControllerSettings | None = None,
        on_event: EventCallback | None = None,
    ) -> None:
        self.parameters = parameters
        self.body = body
        self.settings = settings or ControllerSettings()
        self.on_event = on_event
        self._body_now: Nanos = 0
        self._sip_due: Nanos | None = None
        self._ignored = 0
        self._complaints: tuple[str, ...] = ()
        self._connection = self._new_connection()
        self._output: list[bytes] = []
        self._works = Works(
            motion=Motion(MotionLimits.of(parameters), track_mm=parameters.track_mm, dt_ns=body.dt_ns),
            reckoning=DeadReckoning(
                wheel_diameter_m=parameters.body.wheel_diameter_m, track_mm=parameters.track_mm
            ),
            sonar=self._new_sonar(),
            vel2_divisor=parameters.vel2_divisor,
        )  # fmt: skip
        self._works.reckoning.begin(body.state.left_angle_rad, body.state.right_angle_rad)

    @property
    def state(self) -> ControllerState:
        """Return what the controller is doing now."""
        works = self._works
        left, right = works.motion.wheels_mps
        return ControllerState(
            open=self._sip_due is not None,
            motors_enabled=works.motors_enabled,
            watchdog_expired=works.motion.is_held,
            sonar_on=works.sonar.is_on,
            left_setpoint_mps=left,
            right_setpoint_mps=right,
            x_mm=works.reckoning.x_mm,
            y_mm=works.reckoning.y_mm,
            heading_rad=works.reckoning.heading_rad,
            ignored_commands=self._ignored,
        )

    @property
    def stats(self) -> ConnectionStats:
        """Return the counters of the line since its client came: frames, noise, bad checksums."""
        return self._connection.stats

    def receive(self, data: bytes, now: Nanos) -> None:
        """Take bytes that the line has delivered at `now`.

        A command acts from the first body step at or after `now`. What is due at
        `now` itself is done first, so that a packet shows the robot before it.
        """
        self.advance_to(now)
        self._connection.receive(data, now)
        self._take_events(now)

    def hang_up(self, now: Nanos) -> None:
        """Stop at once and close, as when the host sees its client vanish."""
        self.advance_to(now)
        self._connection = self._new_connection()
        self._output.clear()
        self._close(now, "line dropped")

    def take_output(self) -> list[bytes]:
        """Return the frames to send, one item each, oldest first, and forget them."""
        output, self._output = self._output, []
        return output

    def next_deadline(self) -> Nanos | None:
        """Return when bytes will come out or the watchdog will bite; None when neither ever will."""
        due = [at for at in (self._sip_due, self._connection.next_deadline()) if at is not None]
        return min(due, default=None)

    def advance_to(self, limit: Nanos) -> Reached:
        """Act on everything due up to and including `limit`, and bring the body there."""
        while (due := self._next_due()) is not None and due <= limit:
            self._step_body_to(due)
            self._act(due)
        self._step_body_to(limit)
        return Reached(limit)

    def snapshot(self) -> object:
        """Return all that decides the future, body included, as a plain value."""
        works = self._works
        return _Snapshot(
            body=self.body.snapshot(),
            body_now=self._body_now,
            sip_due=self._sip_due,
            ignored=self._ignored,
            complaints=self._complaints,
            connection=self._connection.snapshot(),
            output=tuple(self._output),
            motion=works.motion.snapshot(),
            reckoning=works.reckoning.snapshot(),
            sonar=works.sonar.snapshot(),
        )

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned."""
        saved, works = cast("_Snapshot", snapshot), self._works
        self.body.restore(saved.body)
        self._body_now = saved.body_now
        self._sip_due = saved.sip_due
        self._ignored = saved.ignored
        self._complaints = saved.complaints
        self._connection.restore(saved.connection)
        self._output = list(saved.output)
        works.motion.restore(saved.motion)
        works.reckoning.restore(saved.reckoning)
        works.sonar.restore(saved.sonar)

    # Time ----------------------------------------------------------------------------

    def _next_due(self) -> Nanos | None:
        """Return when anything happens next, pings included, which show only in the next packet."""
        due = [at for at in (self._sip_due, self._connection.next_deadline()) if at is not None]
        if self._sip_due is not None and (ping := self._works.sonar.next_ping()) is not None:
            due.append(ping.at)
        return min(due, default=None)

    def _act(self, now: Nanos) -> None:
        """Do all that is due at `now`: the connection's own, then pings, then the packet that carries them."""
        self._connection.advance_to(now)
        self._take_events(now)
        if self._sip_due is None:
            return
        ping = self._works.sonar.next_ping()
        if ping is not None and ping.at <= now:
            self._fire(ping.numbers)
        if self._sip_due <= now:
            self._send_standard_packet(now)

    def _step_body_to(self, limit: Nanos) -> None:
        """Step the body to its first step border at or after `limit`."""
        if self._body_now >= limit:
            return
        works, body = self._works, self.body
        motion, step, advance = works.motion, body.step, works.reckoning.advance
        steps = -((self._body_now - limit) // body.dt_ns)
        self._body_now += steps * body.dt_ns
        while steps and not motion.is_steady:
            left, right = motion.step(works.travel_nm, works.heading_udeg) if motion.has_goal else motion.step(0, 0)
            wheels = step(left, right)
            advance(wheels.left_angle_rad, wheels.right_angle_rad)
            steps -= 1
        left, right = motion.wheels_mps  # steady until the next command
        for _ in range(steps):
            wheels = step(left, right)
            advance(wheels.left_angle_rad, wheels.right_angle_rad)

    def _new_connection(self) -> Connection:
        identity = Identity(
            name=self.settings.name, robot_class=self.parameters.robot_class, subclass=self.parameters.subclass
        )
        return Connection(
            Role.SERVER, identity=identity, watchdog_ns=self.settings.watchdog_ns,
            settings=ConnectionSettings(profile=self.settings.profile),
        )  # fmt: skip

    def _new_sonar(self) -> SonarSchedule:
        return SonarSchedule(
            self.parameters.sonar_fitted,
            pings_per_cycle=self.settings.sonar_per_sip.pings_per_cycle,
            cycle_ns=self.settings.sip_period_ns,
        )

    # Events of the connection ----------------------------------------------------------

    def _take_events(self, now: Nanos) -> None:
        while (event := self._connection.next_event()) is not None:
            self._take(event, now)
        self._output += self._connection.take_output()

    def _take(self, event: Event, now: Nanos) -> None:
        match event:
            case Synchronised():
                self._tell(now, "synchronised", "")
            case Opened():
                self._open(now)
            case Closed():
                self._close(now, "by its client")
            case CommandReceived():
                self._obey(event.command, now)
            case WatchdogExpired():
                self._works.motion.hold()
                self._tell(now, "watchdog expired", f"no packet for {self.settings.watchdog_ns / NS_PER_S:g} s")
            case WatchdogRevived():
                self._works.motion.release()
                self._tell(now, "watchdog revived", "the last set speeds hold again")
            case _:
                pass  # noise is counted in `stats`

    def _open(self, now: Nanos) -> None:
        self._works.motion.power(on=False)
        self._works.reckoning.set_origin()
        self._works.sonar.start_cycle(now)
        self._sip_due = now + self.settings.sip_period_ns
        self._tell(now, "opened", "")

    def _close(self, now: Nanos, detail: str) -> None:
        works = self._works
        works.motion.power(on=False)
        works.motion.release()
        works.motion.limits = MotionLimits.of(self.parameters)
        works.sonar = self._new_sonar()
        self._complaints = ()
        was_open, self._sip_due = self._sip_due is not None, None
        if was_open:
            self._tell(now, "closed", detail)

    def _obey(self, command: Command, now: Nanos) -> None:
        works, had_power = self._works, self._works.motors_enabled
        effect = apply(works, command, now)
        if effect in IGNORED:
            self._ignored += 1
        complaint = f"{command.name}: {effect.value}"
        if effect is not Effect.DONE and complaint not in self._complaints:  # a client may repeat itself
            self._complaints += (complaint,)
            self._tell(now, "command ignored" if effect in IGNORED else "command waits", complaint)
        if works.motors_enabled is not had_power:
            self._tell(now, "motors", "on" if works.motors_enabled else "off")
        if works.config_wanted:
            works.config_wanted = False
            if self._connection.is_open:  # else the client has asked and closed in one breath
                self._connection.send(configuration(self.parameters, self.settings, works.motion.limits), now)

    # What the robot says ---------------------------------------------------------------

    def _fire(self, numbers: tuple[int, ...]) -> None:
        readings = []
        for number, range_m in zip(numbers, self.body.ranges(numbers), strict=True):
            counts = raw_range(range_m, self.parameters, self.settings.profile)
            readings.append((number, counts))
        self._works.sonar.take_ping(readings)

    def _send_standard_packet(self, now: Nanos) -> None:
        packet = standard_packet(self._works, self.body.state, self.parameters, self.settings)
        self._connection.send(packet, now)
        self._output += self._connection.take_output()
        self._works.sonar.start_cycle(now)
        self._sip_due = now + self.settings.sip_period_ns

    def _tell(self, now: Nanos, what: str, detail: str) -> None:
        if self.on_event is not None:
            self.on_event(now, what, detail)
