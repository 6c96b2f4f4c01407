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

The line has a speed (`sender`, `line`): a packet is made when the line is free
for it. A reset (RESET, a brown-out) takes the power from the wheels and leaves
the controller deaf for its boot time; then it says so (packet 0xFF) and waits
for SYNC0. MAINTENANCE leaves it deaf for good, until it is rebooted.

What a client sets (limits, sonar order) is lost when it closes, as the H8
manual says of AROS 1.3 and later; earlier firmware kept it until power-down.

Invariant: at time t the body stands at its first step border at or after t, so
the result does not depend on how often anybody calls `advance_to`.
"""

from collections.abc import Callable
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
from p2os.packets import Identity, ResetNotice
from p2os.parameters import RobotParameters
from p2os.pioneer.chance import Chance
from p2os.pioneer.command_handlers import IGNORED, Effect, apply
from p2os.pioneer.controller_state import ControllerSnapshot, ControllerState
from p2os.pioneer.faults import read_fault
from p2os.pioneer.faults_acting import Patient, break_now, broken_now, mend_now
from p2os.pioneer.fresh import limits_of, new_rack
from p2os.pioneer.guard import is_watching, look_at_bumpers
from p2os.pioneer.live_inputs import apply_input
from p2os.pioneer.motion import Motion
from p2os.pioneer.odometry_counts import DeadReckoning
from p2os.pioneer.ports import Body, WheelAngles
from p2os.pioneer.reporter import Reporter
from p2os.pioneer.requests import Requests
from p2os.pioneer.sender import Sender
from p2os.pioneer.settings import ControllerSettings, SonarPerSip
from p2os.pioneer.sonar_schedule import SonarSchedule
from p2os.pioneer.works import Guard, Works
from p2os.timing import NS_PER_MS, NS_PER_S, Nanos, Reached

__all__ = ["ControllerSettings", "ControllerState", "EventCallback", "Pioneer", "SonarPerSip"]

#: (now in ns, what happened in a word or two, detail).
EventCallback = Callable[[Nanos, str, str], None]

#: chosen: from a reset to the notice that the controller is there again.
BOOT_NS: Nanos = 500 * NS_PER_MS


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
        self.parameters, self.body = parameters, body
        self.settings = settings or ControllerSettings()
        self.on_event = on_event
        self._body_now: Nanos = 0
        self._sip_due: Nanos | None = None
        #: When the controller is there again after a reset; -1: it waits in maintenance for a reboot.
        self._boot_at: Nanos | None = None
        self._ignored = 0
        self._complaints: tuple[str, ...] = ()
        self._connection = self._new_connection()
        self._sender = Sender(self.settings.baud)
        flash, odometry = self.settings.flash, self.settings.errors.odometry
        self._works = Works(
            motion=Motion(limits_of(parameters, flash.values), track_mm=parameters.track_mm, dt_ns=body.dt_ns),
            reckoning=DeadReckoning(
                wheel_diameter_m=parameters.body.wheel_diameter_m, track_mm=parameters.track_mm,
                left_wheel=odometry.left_wheel, right_wheel=odometry.right_wheel,
            ),
            sonar=self._new_sonar(),
            vel2_divisor=parameters.vel2_divisor,
            rack=new_rack(self.settings),
            profile=self.settings.profile,
            lenient=self.settings.lenient,
            joystick_mm_s=flash.number("joyvel"),
            joystick_deg_s=flash.number("joyrvel"),
            low_battery_decivolts=flash.number("lowbattery"),
            chance=Chance(self.settings.seed),
        )  # fmt: skip
        self._reporter = Reporter(self._works, body, self._sender, parameters, self.settings, self._tell)
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
            battery_v=works.rack.battery.decivolts / 10,
            line_load_percent=self._sender.line.load_percent,
            baud=self._sender.line.baud,
            packets_dropped=works.requests.dropped + self._sender.lost,
            broken=broken_now(works),
        )

    @property
    def baud(self) -> int | None:
        """Return the speed of the host's line now, bit/s; None on a line that takes no time."""
        return self._sender.line.baud

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
        if self._boot_at is not None:
            return
        if self._works.faults.spoils_line:
            data = self._works.faults.spoil(data, self._works.chance, to_robot=True)
        self._connection.receive(data, now)
        self._take_events(now)

    def count_silence(self, silence: Nanos, now: Nanos) -> None:
        """Let the watchdog count a pause, in ns, that was left out of the robot's time."""
        self.advance_to(now)
        self._connection.count_silence(silence, now)

    def hang_up(self, now: Nanos) -> None:
        """Stop at once and close, as when the host sees its client vanish."""
        self.advance_to(now)
        self._connection = self._new_connection()
        self._sender.clear()
        self._close(now, "line dropped")

    def take_output(self) -> list[bytes]:
        """Return the frames to send, one item each, oldest first, and forget them."""
        output = self._sender.take_output()
        if self._works.faults.spoils_line:
            spoilt = (self._works.faults.spoil(data, self._works.chance, to_robot=False) for data in output)
            return [data for data in spoilt if data]
        return output

    def receive_aux(self, port: int, data: bytes, now: Nanos) -> None:
        """Take bytes of the device at an AUX port, 1 to 3."""
        self.advance_to(now)
        self._works.rack.aux[port - 1].receive(data)
        self._reporter.look_at_aux()

    def take_aux_output(self, port: int) -> bytes:
        """Return the bytes for the device at an AUX port, 1 to 3, and forget them."""
        return self._works.rack.aux[port - 1].take_outgoing()

    def do(self, text: str, now: Nanos) -> None:
        """Break, mend or press something: "fault WORDS", "mend WORDS", or the words of a live input.

        Raises:
            UsageError: The words mean nothing; nothing has changed then.
        """
        first, _, words = text.strip().partition(" ")
        sonar = self.parameters.sonar_fitted
        fault = read_fault(words, sonar=sonar, complete=first == "fault") if first in {"fault", "mend"} else None
        self.advance_to(now)
        if fault is not None and first == "fault":
            self._tell(now, first, words)
            break_now(self._patient(now), fault)
        else:
            if fault is None:
                apply_input(self._works, text)
            else:
                mend_now(self._patient(now), fault)
            self._tell(now, first, words)
        self._tell_notes(now)

    def reboot(self, now: Nanos, *, notice: str = "reboot") -> None:
        """Start the controller anew, as after a dip of its supply: motors off, session gone, odometry at 0."""
        self.advance_to(now)
        self._restart(now, notice, boot_ns=BOOT_NS)

    def next_deadline(self) -> Nanos | None:
        """Return when bytes will come out or the watchdog will bite; None when neither ever will."""
        if self._boot_at is not None:
            return self._boot_at if self._boot_at >= 0 else None
        sip = None if self._sip_due is None else self._sender.turn_after(self._sip_due)
        due = [at for at in (sip, self._connection.next_deadline(), self._sender.next_deadline()) if at is not None]
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
        return ControllerSnapshot(
            body=self.body.snapshot(),
            own=(self._body_now, self._sip_due, self._boot_at, self._ignored),
            complaints=self._complaints,
            connection=self._connection.snapshot(),
            sender=self._sender.snapshot(),
            works=self._works.snapshot(),
        )

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned."""
        saved = cast("ControllerSnapshot", snapshot)
        self.body.restore(saved.body)
        self._body_now, self._sip_due, self._boot_at, self._ignored = cast(
            "tuple[Nanos, Nanos | None, Nanos | None, int]", saved.own
        )
        self._complaints = saved.complaints
        self._connection.restore(saved.connection)
        self._sender.restore(saved.sender)
        self._works.restore(saved.works)

    # Time ----------------------------------------------------------------------------

    def _next_due(self) -> Nanos | None:
        """Return when anything happens next, also what shows only in the next packet."""
        due = self.next_deadline()
        if self._sip_due is None or due is None:
            return due
        works = self._works
        if (ping := works.sonar.next_ping()) is not None:
            due = min(due, ping.at)
        if works.rack.gyro.is_on:
            due = min(due, works.rack.gyro.next_ns)
        if is_watching(works):
            due = min(due, works.guard.next_ns)
        return due

    def _act(self, now: Nanos) -> None:
        """Do all that is due at `now`: the connection's own, then sensors, then the packet that carries them."""
        if self._boot_at is not None:
            self._boot(now)
            return
        self._connection.advance_to(now)
        self._take_events(now)
        if self._sip_due is None:
            self._sender.flush(now)
            return
        works = self._works
        if works.rack.gyro.is_on and works.rack.gyro.next_ns <= now:
            self._reporter.sample_gyro()
        watch_due = is_watching(works) and works.guard.next_ns <= now
        if watch_due and look_at_bumpers(works, self.body.state, self.settings.flash, now):
            self._tell(now, "bumper stall", "the robot drove against a pressed bumper")
        ping = works.sonar.next_ping()
        if ping is not None and ping.at <= now:
            self._reporter.fire(ping.numbers)
        if self._sip_due is not None and self._sip_due <= now and self._sender.is_turn_of_packet(now):
            self._sip_due = self._reporter.send_standard_packet(self._connection, now)
        self._sender.flush(now)

    def _step_body_to(self, limit: Nanos) -> None:
        """Step the body to its first step border at or after `limit`."""
        if self._body_now >= limit:
            return
        works, body = self._works, self.body
        motion, step, advance = works.motion, body.step, works.reckoning.advance
        if self._works.faults.left_blocked or self._works.faults.right_blocked:
            step = self._step_blocked
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

    def _step_blocked(self, left_mps: float, right_mps: float) -> WheelAngles:
        """Step the body with wheels that do not turn."""
        faults = self._works.faults
        return self.body.step(0.0 if faults.left_blocked else left_mps, 0.0 if faults.right_blocked else right_mps)

    def _new_connection(self) -> Connection:
        identity = Identity(
            name=self.settings.name, robot_class=self.parameters.robot_class, subclass=self.parameters.subclass
        )
        return Connection(
            Role.SERVER, identity=identity, watchdog_ns=self.settings.watchdog_ns,
            settings=ConnectionSettings(profile=self.settings.profile), lenient=self.settings.lenient,
        )  # fmt: skip

    def _new_sonar(self) -> SonarSchedule:
        return SonarSchedule(
            self.parameters.sonar_fitted,
            pings_per_cycle=self.settings.sonar_per_sip.pings_per_cycle,
            cycle_ns=self.settings.sip_period_ns,
        )

    def _patient(self, now: Nanos) -> Patient:
        return Patient(self._works.faults, self._works, lambda notice: self._restart(now, notice, boot_ns=BOOT_NS))

    # Events of the connection ----------------------------------------------------------

    def _take_events(self, now: Nanos) -> None:
        while (event := self._connection.next_event()) is not None:
            self._take(event, now)
        self._sender.answer(self._connection.take_output(), now)

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
        works = self._works
        works.motion.power(on=False)
        works.reckoning.set_origin()
        works.sonar.start_cycle(now)
        works.guard = Guard(next_ns=now)
        self._sender.line.begin_session(now)
        self._reporter.look_at_battery(now)
        self._sip_due = now + self.settings.sip_period_ns
        self._tell(now, "opened", "")

    def _close(self, now: Nanos, detail: str) -> None:
        works = self._works
        works.motion.power(on=False)
        works.motion.release()
        works.motion.limits = limits_of(self.parameters, self.settings.flash.values)
        works.sonar = self._new_sonar()
        works.requests = Requests(dropped=works.requests.dropped)
        works.kept.clear()
        rack, fresh = works.rack, new_rack(self.settings)
        rack.gyro, rack.compass = fresh.gyro, fresh.compass
        rack.joystick.may_drive = rack.joystick.drives = rack.switches.battery_told = False
        rack.switches.bump_stall, rack.switches.e_stall = 0, fresh.switches.e_stall
        rack.battery.pretended_decivolts = None if rack.battery.is_test else rack.battery.pretended_decivolts
        self._reporter.look_at_battery(now)
        if self.settings.baud is not None:
            self._sender.line.set_baud(self.settings.baud)
        self._complaints = ()
        was_open, self._sip_due = self._sip_due is not None, None
        if was_open:
            self._tell(now, "closed", detail)

    def _restart(self, now: Nanos, notice: str, *, boot_ns: Nanos | None) -> None:
        """Take the power from everything; None waits for a reboot."""
        self._connection = self._new_connection()
        self._sender.clear()
        self._close(now, notice)
        works, keep = self._works, self._works.rack
        works.rack = new_rack(self.settings)
        works.rack.battery, works.rack.pins, works.rack.joystick = keep.battery, keep.pins, keep.joystick
        works.rack.switches.stop_button = keep.switches.stop_button
        works.rack.gripper.has_thing = keep.gripper.has_thing
        works.reckoning.set_origin()
        self._boot_at = -1 if boot_ns is None else now + boot_ns
        self._tell(now, "controller down", notice)

    def _boot(self, now: Nanos) -> None:
        if self._boot_at is None or not 0 <= self._boot_at <= now:
            return
        self._boot_at = None
        self._sender.answer([ResetNotice().to_frame().to_bytes()], now)
        self._tell(now, "controller up", "it says so with packet 0xFF and waits for SYNC0")

    def _obey(self, command: Command, now: Nanos) -> None:
        works, had_power, asked = self._works, self._works.motors_enabled, self._works.motion.asked
        effect = apply(works, command, now)
        if works.motion.asked != asked and self.body.state.stalled_left and self.body.state.stalled_right:
            works.motion.begin_from_stand()  # chosen: else a client cannot back off a wall before it gives up
        if effect in IGNORED:
            self._ignored += 1
        complaint = f"{command.name}: {effect.value}"
        if effect is not Effect.DONE and complaint not in self._complaints:  # a client may repeat itself
            self._complaints += (complaint,)
            self._tell(now, "command ignored" if effect in IGNORED else "command waits", complaint)
        if works.motors_enabled is not had_power:
            self._tell(now, "motors", "on" if works.motors_enabled else "off")
        self._tell_notes(now)
        self._reporter.look_at_aux()
        if works.baud_wanted is not None:
            self._sender.line.set_baud(works.baud_wanted)
            self._tell(now, "host baud", f"{works.baud_wanted} bit/s")
            works.baud_wanted = None
        if works.config_wanted:
            works.config_wanted = False
            if self._connection.is_open:  # else the client has asked and closed in one breath
                self._connection.send(self._reporter.configuration(), now)
        if works.restart_wanted is not None:
            notice, works.restart_wanted = works.restart_wanted, None
            self._restart(now, notice, boot_ns=BOOT_NS if notice == "RESET" else None)

    def _tell_notes(self, now: Nanos) -> None:
        notes, self._works.notes = self._works.notes, []
        for what, detail in notes:
            self._tell(now, what, detail)

    def _tell(self, now: Nanos, what: str, detail: str) -> None:
        if self.on_event is not None:
            self.on_event(now, what, detail)
