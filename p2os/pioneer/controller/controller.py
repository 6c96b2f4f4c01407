"""The robot's own firmware, as a passive state machine above a body.

Bytes of a client go in, bytes of the robot come out, and the body is stepped in
between: handshake, motion commands, odometry, sonar, watchdog. It is no I/O layer:
it reads no clock and opens no line (`p2os.pioneer.serve` does), and what the single
parts do is theirs: `motion`, `commands`, `reporter`, `sender`, `faults`.

Theory of operation
-------------------
The `Connection` (server role) runs the handshake and keeps the watchdog; its
events drive the rest. While open, a standard packet (SIP) goes out every cycle,
counted from OPEN. Motors are off on each new connection; a client turns them on
with ENABLE. When no valid packet comes for the watchdog's time the wheels slow
down to a stand; the next packet releases them and they ramp back to the last
set speed, unless that packet commands otherwise. CLOSE, and a host that sees its
client vanish (`hang_up`), take the power from the wheels at once.

The line has a speed (`sender`): a packet is made when the line is free for it. A
reset (RESET, a brown-out) takes the power from the wheels, and the controller
receives nothing for its boot time; then it announces itself (packet 0xFF) and waits
for SYNC0. After MAINTENANCE it receives nothing until it is rebooted.

Devices and limits start from the FLASH. What a client sets of them (limits, sonar
order) is lost when it closes, as the H8 manual states for AROS 1.3 and later;
earlier firmware kept it until power-down.

Source: Pioneer 2 and Pioneer 2/3 H8 manuals, chapters on client commands, packets
and the watchdog.

Invariant: at time t the body stands at its first step boundary at or after t, so
the result does not depend on how often a caller calls `advance_to`.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from p2os.errors import WorldError
from p2os.pioneer.body.contract import RobotBody, Wheels
from p2os.pioneer.controller.bumper_watch import check_bumpers, is_watching
from p2os.pioneer.controller.commands import IGNORED, CommandEffect, apply
from p2os.pioneer.controller.context import BumperWatch, Context
from p2os.pioneer.controller.dead_reckoning import DeadReckoning
from p2os.pioneer.controller.fault_actions import FaultTarget, clear_now, inject_now, injected_now
from p2os.pioneer.controller.faults import read_fault
from p2os.pioneer.controller.flash import FlashParameters
from p2os.pioneer.controller.live_inputs import apply_input
from p2os.pioneer.controller.motion import Motion, MotionLimits
from p2os.pioneer.controller.packet_requests import Requests
from p2os.pioneer.controller.reporter import Reporter
from p2os.pioneer.controller.sender import Sender
from p2os.pioneer.controller.settings import ControllerSettings
from p2os.pioneer.devices.battery import Battery
from p2os.pioneer.devices.fitted import Devices
from p2os.pioneer.devices.laser import Laser
from p2os.pioneer.random_source import RandomSource
from p2os.pioneer.sonar.cross_talk import Ears
from p2os.pioneer.sonar.schedule import SonarSchedule
from p2os.protocol.commands import Command
from p2os.protocol.connection import (
    Closed,
    CommandReceived,
    Connection,
    ConnectionRole,
    ConnectionSettings,
    ConnectionStats,
    Event,
    Opened,
    Synchronised,
    WatchdogExpired,
    WatchdogRevived,
)
from p2os.protocol.packets import Identity, MapChangedPacket, ResetNotice
from p2os.protocol.profiles import Profile
from p2os.robots.parameters import RobotParameters
from simbase.errors import P2osError, UsageError, shown, shown_name
from simbase.state import Stateful
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos, Reached

#: (now in ns, what happened in a word or two, detail).
EventCallback = Callable[[Nanos, str, str], None]
#: Takes a name of a world and the time; puts this robot, and all that share its world, into it (`enter_world`).
#: Raises `P2osError` where it does not; nothing has changed then.
WorldLoader = Callable[[str, Nanos], None]

#: chosen: from a reset to the notice that the controller is there again.
BOOT_NS: Nanos = 500 * NS_PER_MS
#: AMRISim's status of a map that it has loaded, and of one that it could not load.
MAP_LOADED, MAP_NOT_LOADED = 1, 2
#: chosen: keeps a full battery above the half of a decivolt, so that it does not flicker.
BATTERY_MARGIN_V = 0.04
#: FLASH parameter → the limit that it sets.
LIMITS = {
    "transveltop": "top_velocity_mm_s", "rotveltop": "top_rotation_deg_s", "transvelmax": "max_velocity_mm_s",
    "rotvelmax": "max_rotation_deg_s", "transacc": "accel_mm_s2", "transdecel": "decel_mm_s2",
    "rotacc": "rot_accel_deg_s2", "rotdecel": "rot_decel_deg_s2",
}  # fmt: skip


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
    #: What the robot estimates its pose to be, since the last SETO.
    x_mm: float
    y_mm: float
    heading_rad: float
    #: Commands that had no effect since the start: not known, or without their number.
    ignored_commands: int
    battery_v: float
    #: How much of the line the last second took, percent; None on a line that takes no time.
    line_load_percent: int | None
    #: Speed of the line now, bit/s.
    baud: int | None
    #: Extra packets and answers that found no room on the line, since the start.
    packets_dropped: int
    #: The words of every fault that lasts.
    injected: tuple[str, ...] = ()


class Pioneer(Stateful):
    """A P2OS robot: its controller and its body.

    Args:
        parameters: What it is.
        body: Stands where the robot starts.
        settings: How its firmware behaves.
        on_event: Called with what happens.
        faults: Injected from the start, in the words of `faults`.

    Raises:
        UsageError: Words of a fault mean nothing.
    """

    STATE = ("body", "_body_now", "_sip_due", "_boot_at", "_ignored", "_complaints", "_connection", "_sender",
             "_context")  # fmt: skip
    #: Holds no state of its own.
    DERIVED = ("_reporter",)

    def __init__(
        self,
        *,
        parameters: RobotParameters,
        body: RobotBody,
        settings: ControllerSettings | None = None,
        on_event: EventCallback | None = None,
        faults: Sequence[str] = (),
    ) -> None:
        self.parameters, self.body = parameters, body
        chosen = settings or ControllerSettings()
        #: The family of its firmware.
        self.profile = chosen.family_of(parameters)
        self.settings = replace(chosen, profile=self.profile, flash=chosen.flash.for_model(parameters))
        self.on_event = on_event
        #: What its sonar hear of other robots; none by itself.
        self.hears: Ears | None = None
        #: Loads another world when a client wants it (LOADWORLD); none by itself.
        self.loads_world: WorldLoader | None = None
        self._faults = tuple(faults)
        self._body_now: Nanos = 0
        self._switch_on(0)

    def _switch_on(self, now: Nanos) -> None:
        """Make every part as it is when the robot is switched on, and inject the faults that it starts with."""
        parameters, body = self.parameters, self.body
        self._sip_due: Nanos | None = None
        #: When the controller is there again after a reset; -1: it waits in maintenance for a reboot.
        self._boot_at: Nanos | None = None
        self._ignored = 0
        self._complaints: tuple[str, ...] = ()
        self._connection = self._new_connection()
        self._sender = Sender(self.settings.baud)
        flash, odometry = self.settings.flash, self.settings.errors.odometry
        self._context = Context(
            motion=Motion(_limits_of(parameters, flash), track_mm=parameters.track_mm, dt_ns=body.dt_ns),
            reckoning=DeadReckoning(
                wheel_diameter_m=parameters.body.wheel_diameter_m, track_mm=parameters.track_mm,
                left_wheel=odometry.left_wheel, right_wheel=odometry.right_wheel, track=odometry.track,
            ),
            sonar=self._new_sonar(),
            vel2_divisor=parameters.vel2_divisor,
            devices=_new_devices(self.settings, self.profile),
            profile=self.profile,
            lenient=self.settings.lenient,
            joystick_mm_s=flash.number("joyvel"),
            joystick_deg_s=flash.number("joyrvel"),
            low_battery_decivolts=flash.number("lowbattery"),
            random_source=RandomSource(self.settings.seed),
        )  # fmt: skip
        self._reporter = Reporter(self._context, body, self._sender, parameters, self.settings, self._notify)
        self._context.reckoning.begin(body.state.left_angle_rad, body.state.right_angle_rad)
        for words in self._faults:
            self.do(f"fault {words}", now)

    @property
    def state(self) -> ControllerState:
        """Return what the controller is doing now."""
        context = self._context
        left, right = context.motion.wheels_mps
        return ControllerState(
            open=self._sip_due is not None,
            motors_enabled=context.motors_enabled,
            watchdog_expired=context.motion.is_held,
            sonar_on=context.sonar.is_on,
            left_setpoint_mps=left,
            right_setpoint_mps=right,
            x_mm=context.reckoning.x_mm,
            y_mm=context.reckoning.y_mm,
            heading_rad=context.reckoning.heading_rad,
            ignored_commands=self._ignored,
            battery_v=context.devices.battery.decivolts / 10,
            line_load_percent=self._sender.line.load_percent,
            baud=self._sender.line.time.baud,
            packets_dropped=context.requests.dropped + self._sender.lost,
            injected=injected_now(context),
        )

    @property
    def baud(self) -> int | None:
        """Return the speed of the host's line now, bit/s; None on a line that takes no time."""
        return self._sender.line.time.baud

    @property
    def stats(self) -> ConnectionStats:
        """Return the counters of the line since its client came: frames, noise, bad checksums."""
        return self._connection.stats

    @property
    def exit_code(self) -> int | None:
        """Return the code with which a client wants its simulator to end (SIM_EXIT); None until one does."""
        return self._context.exit_code

    def receive(self, data: bytes, now: Nanos) -> None:
        """Take bytes that the line has delivered at `now`.

        A command acts from the first body step at or after `now`. What is due at
        `now` itself is done first, so that a packet shows the robot before it.
        """
        self.advance_to(now)
        if self._boot_at is not None:
            return
        if self._context.faults.corrupts_line:
            data = self._context.faults.corrupt(data, self._context.random_source, to_robot=True)
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
        output, context = self._sender.take_output(), self._context
        if not context.faults.corrupts_line:
            return output
        corrupted = (context.faults.corrupt(data, context.random_source, to_robot=False) for data in output)
        return [data for data in corrupted if data]

    def receive_aux(self, port: int, data: bytes, now: Nanos) -> None:
        """Take bytes of the device at an AUX port, 1 to 3."""
        self.advance_to(now)
        self._context.devices.aux[port - 1].receive(data)
        self._reporter.check_aux_requests()

    def take_aux_output(self, port: int) -> bytes:
        """Return the bytes for the device at an AUX port, 1 to 3, and forget them."""
        return self._context.devices.aux[port - 1].take_outgoing()

    def do(self, text: str, now: Nanos) -> None:
        """Inject or clear a fault, or operate something: "fault WORDS", "clear WORDS", or the words of a live input.

        Raises:
            UsageError: The words mean nothing; nothing has changed then.
        """
        first, _, words = text.strip().partition(" ")
        sonar = self.parameters.sonar_fitted
        fault = read_fault(words, sonar=sonar, complete=first == "fault") if first in {"fault", "clear"} else None
        self.advance_to(now)
        if fault is not None and first == "fault":
            self._notify(now, first, words)
            inject_now(self._fault_target(now), fault)
        else:
            if fault is None:
                apply_input(self._context, text)
            else:
                clear_now(self._fault_target(now), fault)
            self._notify(now, first, words)
        self._report_notes(now)

    def start_over(self, now: Nanos) -> None:
        """Put the robot back at its start: body, odometry, devices and random draws as when it was made.

        What could be pushed is back in its place. The session is gone and the controller is not there for its boot
        time, as after the fault `reboot`; faults are those of the start.
        """
        self.advance_to(now)
        self.body.put_back()
        self._switch_on(now)
        self._boot_at = now + BOOT_NS
        self._notify(now, "started over", "at its start, as just switched on")

    def next_deadline(self) -> Nanos | None:
        """Return when bytes will come out or the watchdog will expire; None when neither ever will."""
        if self._boot_at is not None:
            return self._boot_at if self._boot_at >= 0 else None
        due, answer = self._connection.next_deadline(), self._sender.next_deadline()
        if self._sip_due is not None:
            sip = self._sender.turn_after(self._sip_due)
            due = sip if due is None else min(due, sip)
        return answer if due is None else due if answer is None else min(due, answer)

    def advance_to(self, limit: Nanos) -> Reached:
        """Act on everything due up to and including `limit`, and bring the body there."""
        while (due := self.next_due()) is not None and due <= limit:
            self._step_body_to(due)
            self._act(due)
        self._step_body_to(limit)
        return Reached(limit)

    # Time ----------------------------------------------------------------------------

    def next_due(self) -> Nanos | None:
        """Return when anything happens next, also what shows only in the next packet."""
        due = self.next_deadline()
        if self._sip_due is None or due is None:
            return due
        context = self._context
        if (ping := context.sonar.next_ping()) is not None:
            due = min(due, ping.at)
        if context.devices.gyro.is_on:
            due = min(due, context.devices.gyro.next_ns)
        if is_watching(context):
            due = min(due, context.bumper_watch.next_ns)
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
        context = self._context
        if context.devices.gyro.is_on and context.devices.gyro.next_ns <= now:
            self._reporter.sample_gyro()
        watch_due = is_watching(context) and context.bumper_watch.next_ns <= now
        if watch_due and check_bumpers(context, self.body.state, self.settings.flash, now):
            self._notify(now, "bumper stall", "the robot drove against a pressed bumper")
        ping = context.sonar.next_ping()
        if ping is not None and ping.at <= now:
            self._reporter.fire(ping.numbers, None if self.hears is None else self.hears(ping.numbers, ping.at))
        if self._sip_due is not None and self._sip_due <= now and self._sender.is_turn_of_packet(now):
            self._sip_due = self._reporter.send_standard_packet(self._connection, now)
        self._sender.flush(now)

    def _step_body_to(self, limit: Nanos) -> None:
        """Step the body to its first step boundary at or after `limit`."""
        if self._body_now >= limit:
            return
        body, motion, reckoning = self.body, self._context.motion, self._context.reckoning
        steps = -((self._body_now - limit) // body.dt_ns)
        self._body_now += steps * body.dt_ns
        while steps and not motion.is_steady:
            if motion.has_goal:
                made: Sequence[Wheels] = (body.step(*self.next_setpoints()),)
            else:
                made = body.ramp(self._next_ramp(steps))
            reckoning.follow(made)
            steps -= len(made)
        if steps:  # steady until the next command
            reckoning.follow(body.hold(*self.next_setpoints(), steps))

    def next_setpoints(self) -> tuple[float, float]:
        """Return the rim-speed set-points of the body's next step, m/s, for who steps it together with others."""
        context, motion = self._context, self._context.motion
        self.body.is_powered = motion.is_powered
        if motion.is_steady:
            left, right = motion.wheels_mps
        elif motion.has_goal:
            left, right = motion.step(context.travel_nm, context.heading_udeg)
        else:
            left, right = motion.step(0, 0)
        return self._turning(left, right)

    def _next_ramp(self, steps: int) -> list[tuple[float, float]]:
        """Return the set-points of the body's next steps, up to where they stay, at most so many."""
        motion, faults = self._context.motion, self._context.faults
        self.body.is_powered = motion.is_powered
        made = motion.ramp(steps)
        return [self._turning(*pair) for pair in made] if faults.left_blocked or faults.right_blocked else made

    def _turning(self, left_mps: float, right_mps: float) -> tuple[float, float]:
        """Return set-points without those of wheels that are blocked."""
        faults = self._context.faults
        return 0.0 if faults.left_blocked else left_mps, 0.0 if faults.right_blocked else right_mps

    def take_step(self, wheels: Wheels) -> None:
        """Take the wheels' angles after a step that was made with `next_setpoints`."""
        self._body_now += self.body.dt_ns
        self._context.reckoning.follow((wheels,))

    # Parts that are made anew -----------------------------------------------------------

    def _new_connection(self) -> Connection:
        identity = Identity(
            name=self.settings.name, robot_class=self.parameters.robot_class, subclass=self.parameters.subclass
        )
        return Connection(
            ConnectionRole.SERVER, identity=identity, watchdog_ns=self.settings.watchdog_ns,
            settings=ConnectionSettings(profile=self.profile), lenient=self.settings.lenient,
        )  # fmt: skip

    def _new_sonar(self) -> SonarSchedule:
        return SonarSchedule(
            self.parameters.sonar_fitted,
            pings_per_cycle=self.settings.sonar_per_sip.pings_per_cycle,
            cycle_ns=self.settings.sip_period_ns,
        )

    def _fault_target(self, now: Nanos) -> FaultTarget:
        return FaultTarget(self._context, lambda notice: self._restart(now, notice, boot_ns=BOOT_NS))

    # Events of the connection ----------------------------------------------------------

    def _take_events(self, now: Nanos) -> None:
        while (event := self._connection.next_event()) is not None:
            self._take(event, now)
        self._sender.answer(self._connection.take_output(), now)

    def _take(self, event: Event, now: Nanos) -> None:
        match event:
            case Synchronised():
                self._notify(now, "synchronised", "")
            case Opened():
                self._open(now)
            case Closed():
                self._close(now, "by its client")
            case CommandReceived():
                self._execute(event.command, now)
            case WatchdogExpired():
                self._context.motion.hold()
                self._notify(now, "watchdog expired", f"no packet for {self.settings.watchdog_ns / NS_PER_S:g} s")
            case WatchdogRevived():
                self._context.motion.release()
                self._notify(now, "watchdog revived", "the last set speeds hold again")
            case _:
                pass  # noise is counted in `stats`

    def _open(self, now: Nanos) -> None:
        context = self._context
        context.motion.power(on=False)
        context.reckoning.set_origin()
        context.sonar.start_cycle(now)
        context.bumper_watch = BumperWatch(next_ns=now)
        self._sender.line.begin_session(now)
        self._reporter.check_battery(now)
        self._sip_due = now + self.settings.sip_period_ns
        self._notify(now, "opened", "")

    def _close(self, now: Nanos, detail: str) -> None:
        context = self._context
        context.motion.power(on=False)
        context.motion.release()
        context.motion.limits = _limits_of(self.parameters, self.settings.flash)
        context.sonar = self._new_sonar()
        context.requests = Requests(dropped=context.requests.dropped)
        context.kept.clear()
        devices, defaults = context.devices, _new_devices(self.settings, self.profile)
        devices.gyro, devices.compass, devices.laser = defaults.gyro, defaults.compass, defaults.laser
        devices.joystick.may_drive = devices.joystick.drives = devices.switches.battery_reported = False
        devices.switches.bump_stall, devices.switches.e_stall = 0, defaults.switches.e_stall
        devices.battery.pretended_decivolts = None if devices.battery.is_test else devices.battery.pretended_decivolts
        self._reporter.check_battery(now)
        if self.settings.baud is not None:
            self._sender.line.set_baud(self.settings.baud)
        self._complaints = ()
        was_open, self._sip_due = self._sip_due is not None, None
        if was_open:
            self._notify(now, "closed", detail)

    def _restart(self, now: Nanos, notice: str, *, boot_ns: Nanos | None) -> None:
        """Take the power from everything; None waits for a reboot."""
        self._connection = self._new_connection()
        self._sender.clear()
        self._close(now, notice)
        context, keep = self._context, self._context.devices
        context.devices = _new_devices(self.settings, self.profile)
        context.devices.battery, context.devices.pins, context.devices.joystick = keep.battery, keep.pins, keep.joystick
        context.devices.switches.stop_button = keep.switches.stop_button
        context.devices.gripper.has_thing = keep.gripper.has_thing
        context.reckoning.set_origin()
        self._boot_at = -1 if boot_ns is None else now + boot_ns
        self._notify(now, "controller down", notice)

    def _boot(self, now: Nanos) -> None:
        if self._boot_at is None or not 0 <= self._boot_at <= now:
            return
        self._boot_at = None
        self._sender.answer([ResetNotice().to_frame().to_bytes()], now)
        self._notify(now, "controller up", "it says so with packet 0xFF and waits for SYNC0")

    # Commands and events ---------------------------------------------------------------

    def _execute(self, command: Command, now: Nanos) -> None:
        context, had_power, set_before = self._context, self._context.motors_enabled, self._context.motion.setpoints
        effect = apply(context, command, now)
        if context.motion.setpoints != set_before and self.body.state.stalled_left and self.body.state.stalled_right:
            context.motion.ramp_from_zero()  # chosen: else a client cannot back off a wall before it gives up
        if effect in IGNORED:
            self._ignored += 1
        complaint = f"{command.name}: {effect.value}"
        if effect is not CommandEffect.DONE and complaint not in self._complaints:  # once a session
            self._complaints += (complaint,)
            self._notify(now, "command ignored" if effect in IGNORED else "command waits", complaint)
        if context.motors_enabled is not had_power:
            self._notify(now, "motors", "on" if context.motors_enabled else "off")
        self._move_in_world()
        self._change_world(now)
        self._report_notes(now)
        self._reporter.check_aux_requests()
        if context.baud_wanted is not None:
            self._sender.line.set_baud(context.baud_wanted)
            self._notify(now, "host baud", f"{context.baud_wanted} bit/s")
            context.baud_wanted = None
        if context.config_wanted:
            context.config_wanted = False
            if self._connection.is_open:  # else the client has asked and closed at the same instant
                self._connection.send(self._reporter.configuration(), now)
        if context.restart_wanted is not None:
            notice, context.restart_wanted = context.restart_wanted, None
            self._restart(now, notice, boot_ns=BOOT_NS if notice == "RESET" else None)

    def _move_in_world(self) -> None:
        """Do what a client wants of the simulator: carry the robot elsewhere, or back to its start."""
        context, body = self._context, self.body
        if context.pose_wanted is not None:
            (x_mm, y_mm, heading_deg), context.pose_wanted = context.pose_wanted, None
            where = f"{x_mm / 1000:g}, {y_mm / 1000:g} m, {heading_deg}°"
            try:
                body.stand_at(x_mm / 1000, y_mm / 1000, math.radians(heading_deg))
            except WorldError as error:
                context.notes.append(("not moved", str(error)))
                return
            context.motion.ramp_from_zero()
            context.devices.laser.has_jumped = True
            context.notes.append(("moved by its client", where))
        if context.sim_reset_wanted:
            context.sim_reset_wanted = False
            if (other := body.who_stands_at_start()) is not None:
                context.notes.append(("not reset", f"{other} stands where this robot starts"))
                return
            body.put_back()
            self._feel_moved()
            context.reckoning.set_origin()
            context.notes.append(("back at its start", "its client wants it"))

    def _feel_moved(self) -> None:
        """Go on with wheels at other angles than the last."""
        context, state = self._context, self.body.state
        context.reckoning.begin(state.left_angle_rad, state.right_angle_rad)
        context.motion.ramp_from_zero()
        context.devices.laser.has_jumped = True

    def _change_world(self, now: Nanos) -> None:
        """Load the world that a client wants, where someone does that for this robot."""
        if (raw_name := self._context.world_wanted) is None:
            return
        self._context.world_wanted = None
        name = raw_name.decode("utf-8", "surrogateescape")
        try:
            if self.loads_world is None:
                raise UsageError("this robot stays in the one that it was made for")
            self.loads_world(name, now)
        except P2osError as error:
            self._context.notes.append(("world stays", f"its client wants {shown(name)}: {shown_name(error)}"))
            self._tell_of_map(MAP_NOT_LOADED, raw_name, now)

    def enter_world(self, body: RobotBody, raw_name: bytes, now: Nanos) -> None:
        """Go on in another world with the body that it has there; the session and the odometry go on.

        A snapshot of before does not fit the robot after this.

        Args:
            body: Where the robot starts, at the step that the old one has reached.
            raw_name: The world's, for the client.
            now: The time, ns.
        """
        self.body = self._reporter.body = body
        self._feel_moved()
        self._notify(now, "another world", shown_name(raw_name.decode("utf-8", "replace")))
        if self._sip_due is not None:
            self._tell_of_map(MAP_LOADED, raw_name, now)

    def _tell_of_map(self, status: int, raw_name: bytes, now: Nanos) -> None:
        """Send what has become of a map that a client wanted."""
        packet = MapChangedPacket(status=status, raw_name=raw_name)
        self._sender.answer([packet.to_frame().to_bytes()], now)

    def _report_notes(self, now: Nanos) -> None:
        notes, self._context.notes = self._context.notes, []
        for what, detail in notes:
            self._notify(now, what, detail)

    def _notify(self, now: Nanos, what: str, detail: str) -> None:
        if self.on_event is not None:
            self.on_event(now, what, detail)


def _new_devices(settings: ControllerSettings, profile: Profile) -> Devices:
    """Return the devices of a robot that was just switched on."""
    flash = settings.flash
    devices = Devices(
        battery=Battery.resting_at(
            settings.battery_decivolts / 10 + BATTERY_MARGIN_V, settings.errors.power.battery_resistance_ohm
        )
    )
    devices.gripper.kind = flash.number("gripper")
    devices.gyro.is_fitted = flash.number("hasgyro") > 0 and profile is not Profile.P2OS
    devices.laser = Laser.of(settings.laser)
    devices.switches.e_stall = profile is not Profile.P2OS
    return devices


def _limits_of(parameters: RobotParameters, flash: FlashParameters) -> MotionLimits:
    """Return the limits with which a robot starts: those of its file, but for what its FLASH sets."""
    found = {limit: value for name, limit in LIMITS.items() if isinstance(value := flash.values.get(name), int)}
    return replace(MotionLimits.of(parameters), **found)
