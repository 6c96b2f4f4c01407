"""The ESP32 adapter between a BluePill's pins and a Pioneer's P2OS line.

It is a client of the robot, commanded by pins or by a game pad, never by both. The
firmware in adapter_fw/core is its twin, byte for byte and edge for edge.

Not modelled: the ESP32 itself, the time that its program needs, analog levels.

Theory of operation
-------------------
The adapter samples its inputs at fixed instants (`sample_period_ns` apart, counted
from the end of its boot), and its state moves only there, at its own deadlines, and
when bytes arrive:

    RESET       rst is high: outputs released to their pulls, nothing runs
    BOOTING     rst fell (or power came): released still, for `boot_ns`
    IDLE        outputs safe, waits for its master's connect request: p2dx_con, or the pad's Up
    CONNECTING  the P2OS connection is being made; outputs safe
    SETTLING    OPEN: SETO and SONAR 1 sent, waits for odometry zero; distances live
    DRIVING     ENABLE 1 sent; motor values become VEL and RVEL; all live
    CLOSING     the connect request was withdrawn: STOP, VEL 0, RVEL 0, CLOSE sent; lasts `stop_repeat_ns`
    LOST        no SIP, implausible motion, no pad, a shutdown: the same four sent; waits for the
                connect request to be withdrawn

    from         rst high  boot over  requested      withdrawn     opened    odometry 0      ended or
                                                                             or settle_ns    implausible
    RESET        ·         ·          ·              ·             ·         ·               ·
    BOOTING      RESET     IDLE       ·              ·             ·         ·               ·
    IDLE         RESET     ·          CONNECTING     ·             ·         ·               ·
    CONNECTING   RESET     ·          ·              CLOSING       SETTLING  ·               tries again
    SETTLING     RESET     ·          ·              CLOSING       ·         DRIVING         LOST
    DRIVING      RESET     ·          ·              CLOSING       ·         ·               LOST
    CLOSING      RESET     ·          ·              ·             ·         ·               ·
    LOST         RESET     ·          ·              IDLE          ·         ·               ·

RESET leaves to BOOTING when rst is low, CLOSING to IDLE when its time is over.
From LOST the way to motion leads over a new connect request (p2dx_con low and high
again, or Up), whatever the robot does meanwhile. A change of masters leads to LOST too.

Any packet revives the last speed of a robot that its watchdog has stopped. So
the first frames after a loss are STOP, VEL 0, RVEL 0, and the same three stand
before every SYNC0 and go out after a boot: the adapter cannot know what the
robot was doing before.

Within one instant the order is fixed: bytes, reset wire, boot, connection, sample, pad, loss,
plausibility, distances, encoders, speeds, stops. A change of rst is seen at the end of
a slice, where the bench's watched nets put it, and at each sample.

Invariant: of the outputs, only SETTLING and DRIVING show what the robot reports.
"""

from dataclasses import dataclass
from enum import StrEnum

from adapter_sim.distances import Distances, threshold_um
from adapter_sim.driver import Driver
from adapter_sim.encoders import WheelCodes
from adapter_sim.masters import Master, Masters
from adapter_sim.mixing import CommandedSpeeds
from adapter_sim.pinout import Pinout, WireRole
from adapter_sim.pins import AdapterPins, EventCallback, Inputs, Outputs, SampleClock, released_codes
from adapter_sim.receiver import Receiver
from adapter_sim.session import Session, SessionOpened, StopRepeater
from adapter_sim.settings import AdapterSettings, MotorCommand
from p2os.gamepad import PadReport
from p2os.protocol.commands import set_origin, sonar
from p2os.protocol.sip import StandardSip
from p2os.robots.parameters import RobotParameters
from simbase.state import Stateful
from simbase.timing import NS_PER_S, Nanos, Reached


class AdapterState(StrEnum):
    """What the adapter is doing; see the theory of operation."""

    RESET = "reset"
    BOOTING = "booting"
    IDLE = "idle"
    CONNECTING = "connecting"
    SETTLING = "settling"
    DRIVING = "driving"
    CLOSING = "closing"
    LOST = "lost"


#: Later than any deadline.
NEVER: Nanos = 1 << 62
#: States in which the robot's session is open.
OPEN_STATES = frozenset({AdapterState.SETTLING, AdapterState.DRIVING})
#: States with a session that is open or being opened.
SESSION_STATES = OPEN_STATES | {AdapterState.CONNECTING}
#: States in which bytes are taken and inputs are sampled.
RUNNING_STATES = frozenset(AdapterState) - {AdapterState.RESET, AdapterState.BOOTING}
#: States in which the stop sequence is repeated.
STOPPING_STATES = frozenset({AdapterState.CLOSING, AdapterState.LOST, AdapterState.IDLE})


@dataclass(frozen=True, slots=True, kw_only=True)
class AdapterStatus:
    """What the adapter knows at this moment, for people and tests."""

    state: AdapterState
    #: Why the state is what it is.
    reason: str
    #: Motor values taken, motor1 first.
    motors: tuple[int, int]
    #: Speeds of the last pair sent.
    speeds: CommandedSpeeds
    #: Level of each distance wire, wire 1 first.
    distances: tuple[bool, ...]
    #: Last range of each sonar in µm, None where unknown.
    ranges_um: tuple[int | None, ...]
    #: Encoder steps, (left, right), and those on the pins.
    counts: tuple[int, int]
    counts_shown: tuple[int, int]
    #: SIPs taken and odometry jumps since the boot.
    sips: int
    odometry_jumps: int


@dataclass(slots=True, kw_only=True)
class Agenda:
    """What is planned, and when; a reset clears it."""

    #: End of the boot.
    boot_at: Nanos = NEVER
    #: Next try to connect, or end of CLOSING.
    retry_at: Nanos = NEVER
    #: The session is lost unless a SIP comes before.
    sip_deadline: Nanos = NEVER
    #: From here on the odometry is taken as it is.
    settle_at: Nanos = NEVER
    #: SONAR 1 is sent again unless a reading comes before.
    sonar_at: Nanos = NEVER
    #: Stall flags of the last SIP.
    stalled: tuple[bool, bool] = (False, False)
    #: SIPs taken.
    sips: int = 0


class Adapter(Stateful):
    """The adapter as a passive part in virtual time.

    Args:
        pins: Its ends of the wires.
        pinout: Names, widths and levels of the wires.
        parameters: The robot's own numbers.
        settings: None takes the defaults.
        on_event: Called at each transition.
        now: When power comes, in nanoseconds.
        master: Who commands; the board reads a jumper at boot.
        receiver: The UART in front of it; None: bytes are seen when they arrive.
    """

    STATE = (
        "_state", "_reason", "_now", "_baud_place", "_agenda", "samples", "_masters", "_stop_repeater", "_driver",
        "distances", "_codes", "outputs", "session", "_receiver",
    )  # fmt: skip
    DERIVED = ("_deadline", "_other", "_bytes_at")

    def __init__(
        self,
        *,
        pins: AdapterPins,
        pinout: Pinout,
        parameters: RobotParameters,
        settings: AdapterSettings | None = None,
        on_event: EventCallback | None = None,
        now: Nanos = 0,
        master: Master = Master.BLUEPILL,
        receiver: Receiver | None = None,
    ) -> None:
        self.pinout = pinout
        self.parameters = parameters
        self.settings = settings = settings or AdapterSettings()
        self.on_event = on_event
        # A duty changes by its time-out too.
        may_suspend = settings.motor_command is MotorCommand.BITS
        self.samples = SampleClock(settings.sample_period_ns, may_suspend=may_suspend)
        self._driver = Driver(settings, parameters, full_steps=1 << pinout.value("motor1").width - 1)
        self.distances = Distances(
            len(pinout.with_role(WireRole.DISTANCE)),
            threshold_um=threshold_um(settings.threshold_um, parameters),
            stale_ns=settings.distance_stale_ns,
        )
        self._codes = WheelCodes(settings, parameters, pinout.value("encoder1").width, released_codes(pinout))
        self.session = Session(settings)
        self._receiver = receiver
        if receiver is not None:
            receiver.restart(now)
        self.outputs = Outputs(pins, pinout)
        self.inputs = Inputs(pins, pinout, settings)
        self._masters = Masters(self.inputs, self._driver.mixer, settings, master)
        self._stop_repeater = StopRepeater(settings)
        self._baud_place = 0
        self._now = now
        #: The earliest deadline, and the earliest that is no sample.
        self._deadline: Nanos
        self._other: Nanos
        #: When bytes that the receiver holds are seen.
        self._bytes_at: Nanos
        self._clear()
        self._state = AdapterState.BOOTING
        self._reason = "power"
        self._agenda.boot_at = now + settings.boot_ns
        self._replan()

    @property
    def state(self) -> AdapterState:
        """Return what the adapter is doing."""
        return self._state

    @property
    def master(self) -> Master:
        """Return who commands."""
        return self._masters.master

    @property
    def baud(self) -> int:
        """Return the line speed that is being tried or used; whoever owns the line follows it."""
        return self.settings.bauds[self._baud_place]

    @property
    def status(self) -> AdapterStatus:
        """Return what the adapter knows at this moment."""
        return AdapterStatus(
            state=self._state,
            reason=self._reason,
            motors=self.inputs.motors,
            speeds=self._driver.sent,
            distances=self.distances.levels,
            ranges_um=self.distances.ranges_um,
            counts=self._codes.counts,
            counts_shown=self._codes.shown,
            sips=self._agenda.sips,
            odometry_jumps=self._codes.encoders.jumps,
        )

    def receive(self, data: bytes, now: Nanos) -> None:
        """Take bytes that the line has delivered at `now`; what was due earlier is done first."""
        self._run(now - 1)
        if self._state in RUNNING_STATES:
            if self._receiver is None:
                self._now = now
                self._see_bytes(data, now)
            else:
                self._receiver.arrive(data, now)
            self._replan()

    def first_sight(self, at: Nanos) -> Nanos:
        """Return the earliest time at which it acts on bytes that arrive at a time."""
        return at if self._receiver is None else self._receiver.first_sight(at)

    def receive_pad(self, report: PadReport, now: Nanos) -> None:
        """Take a pad's report that came at `now`; without effect on the robot while the BluePill is master."""
        self._run(now - 1)
        self._now = max(self._now, now)
        has_request_ended = self._masters.take_pad(report, now)
        if self._state in RUNNING_STATES:
            if has_request_ended:
                self._end_request("Down was pressed", now)
            if self._state is AdapterState.DRIVING:
                self._driver.want(self._masters.speeds)
        self._replan()

    def set_master(self, master: Master, now: Nanos) -> None:
        """Give the robot to another master: it is stopped and closed; only a new connect request starts it."""
        self._run(now - 1)
        if master is self._masters.master:
            return
        self._now = max(self._now, now)
        if self._state in SESSION_STATES:
            self._halt(now)
        self._masters.switch(master)
        self._notify(now, "master", master.value)
        if self._state in RUNNING_STATES:
            self._enter(AdapterState.LOST, now, "master", "waits for a new connect request of the new master")
        self._replan()

    def shutdown(self, reason: str, now: Nanos) -> None:
        """Stop the robot, drive every output to its safe level, and wait for the connect request to be withdrawn."""
        self._run(now - 1)
        self._now = max(self._now, now)
        if self._state in RUNNING_STATES:
            self._lose(now, "shutdown", reason)
            self._replan()

    def take_output(self) -> list[bytes]:
        """Return the frames to send, one item each, oldest first, and forget them."""
        return self.session.take_output()

    def wait_for_edges(self) -> None:
        """Sample no settled wires from now on: whoever runs it brings it to every edge of the wires in `wakes_on`."""
        self.samples.waits_for_edges = True

    @property
    def wakes_on(self) -> frozenset[str]:
        """Names of the wires whose edges it has to be brought to: rst, and all inputs while it does not sample them."""
        return self.inputs.wires if self.samples.is_suspended else self.inputs.reset_wires

    def next_deadline(self) -> Nanos | None:
        """Return the next sample instant or deadline, in nanoseconds."""
        return self._deadline

    def advance_to(self, limit: Nanos) -> Reached:
        """Act on everything due up to and including `limit`, then look at rst."""
        looked_at = self._run(limit)
        if looked_at != limit:
            self._now = max(self._now, limit)
            if self.inputs.is_reset(limit) != (self._state is AdapterState.RESET):
                self._follow_reset(limit)
                self._replan()
            elif self.samples.is_suspended and not self.inputs.is_quiet(limit):
                self._replan()
                self._run(limit)
        return Reached(limit)

    def _restored(self) -> None:
        self._replan()

    def _run(self, limit: Nanos) -> Nanos | None:
        """Act on all that is due; return the last instant at which the pins were looked at, None for none."""
        looked_at = None
        while self._deadline <= limit:
            now = self._deadline
            if now == self._bytes_at:
                self._see_received(now)
                continue
            looked_at = now
            if now < self._other and not self._has_pending_request and self.inputs.is_quiet(now):
                self._now = now
                self.samples.was_quiet(now)
                self._deadline = self.samples.due(self._other)
            else:
                self.samples.resume(now)
                self._act(now)
                self._replan()
        return looked_at

    def _see_received(self, now: Nanos) -> None:
        """Take what a pass sees, before all else that is due then."""
        self._now = now
        for data in self._receiver.take(now) if self._receiver is not None else ():
            self._see_bytes(data, now)
        self._replan()

    @property
    def _has_pending_request(self) -> bool:
        """Tell whether the next sample leaves the state, with no edge at any pin."""
        left_by_request = {AdapterState.IDLE: True, AdapterState.LOST: False}
        return left_by_request.get(self._state) is self._masters.wants_robot

    def _act(self, now: Nanos) -> None:
        """Do all that is due at `now`, in the fixed order."""
        self._now = now
        if self.inputs.is_reset(now) != (self._state is AdapterState.RESET):
            self._follow_reset(now)
        if self._state is AdapterState.RESET:
            self.samples.after(now)
            return
        if self._state is AdapterState.BOOTING:
            if now < self._agenda.boot_at:
                self.samples.after(now)
                return
            self._boot(now)
        self._act_running(now)

    def _act_running(self, now: Nanos) -> None:
        """Do all that is due in a running state."""
        self.session.advance_to(now)
        self._take_session_events(now)
        if now >= self.samples.next:
            self._sample(now)
            self.samples.after(now)
        if (lost_at := self._masters.pad_lost_at) is not None and now >= lost_at:
            self._lose_pad(now)
        if self._state in OPEN_STATES:
            self._run_open(now)
        if self._state in STOPPING_STATES:
            self._stop_repeater.repeat(self.session, now)
        if self._state is AdapterState.CLOSING and now >= self._agenda.retry_at:
            self._enter(AdapterState.IDLE, now, "idle", "closed")
        if self._state is AdapterState.IDLE and self._masters.wants_robot:
            self._begin_session(now, self._masters.connect_request)
        if self._state is AdapterState.CONNECTING and now >= self._agenda.retry_at:
            self._begin_session(now, "trying again")

    def _see_bytes(self, data: bytes, now: Nanos) -> None:
        self._stop_repeater.note_bytes(now)
        self.session.receive(data, now)
        self._take_session_events(now)

    def _run_open(self, now: Nanos) -> None:
        if now >= self._agenda.sip_deadline:
            self._lose(now, "lost", "no SIP in time")
            return
        if self._state is AdapterState.DRIVING and now >= self._driver.plausibility.ends_at:
            self._lose(now, "implausible", self._driver.plausibility.describe())
            return
        expires_at = self.distances.expires_at
        if expires_at is not None and now >= expires_at:
            self.distances.expire(now)
            self.outputs.show_distances(self.distances.levels, now)
        if now >= self._agenda.sonar_at:
            # No reading for as long as one is valid: SONAR 1 was lost, or somebody switched them off.
            self.session.send(sonar(on=True), now)
            self._agenda.sonar_at = now + self.settings.distance_stale_ns
        self.outputs.show_encoders(self._codes.walk(now), now)
        if self._state is AdapterState.DRIVING and now >= self._driver.pair_due_at(now):
            self._send_pair(now)

    def _sample(self, now: Nanos) -> None:
        have_speeds_changed, has_request_ended = self._masters.sample(now)
        if have_speeds_changed and self._state is AdapterState.DRIVING:
            self._driver.want(self._masters.speeds)
        if has_request_ended:
            self._end_request("p2dx_con is low", now)
        if self._state is AdapterState.LOST and not self._masters.wants_robot:
            self._enter(AdapterState.IDLE, now, "idle", "ready for a new connection")

    def _send_pair(self, now: Nanos) -> None:
        if self._driver.send_pair(self.session, now):
            speeds, (left, right) = self._driver.sent, self.inputs.motors
            pair = f"VEL {speeds.forward_mm_s}, RVEL {speeds.turn_deg_s}"
            self._notify(now, "command", f"{pair} (motors {left}, {right})")

    def _replan(self) -> None:
        """Find the next deadline; `_other` is the earliest that is no sample."""
        self.samples.resume(self._now)
        state = self._state
        self._bytes_at = NEVER
        if state not in RUNNING_STATES:
            # Only rst is looked at; `_other` keeps these instants off the fast path.
            self._other = self._deadline = min(self._agenda.boot_at, self.samples.next)
            return
        if self._receiver is not None and (due_at := self._receiver.due_at) is not None:
            self._bytes_at = due_at
        times = [self.session.next_deadline(), self._masters.pad_lost_at, self._bytes_at]
        if state in OPEN_STATES:
            times += [self._agenda.sip_deadline, self._agenda.sonar_at, self.distances.expires_at]
            times += self._codes.due_at(self._now)
        if state is AdapterState.DRIVING:
            times += [self._driver.plausibility.ends_at, self._driver.pair_due_at(self._now)]
        if state in STOPPING_STATES:
            times.append(self._stop_repeater.due_at)
        if state in {AdapterState.CLOSING, AdapterState.CONNECTING}:
            times.append(self._agenda.retry_at)
        self._other = min((time for time in times if time is not None), default=NEVER)
        if self.samples.waits_for_edges and not self._has_pending_request and self.inputs.is_quiet(self._now):
            self.samples.suspend()
        self._deadline = self.samples.due(self._other)

    def _clear(self) -> None:
        """Forget everything, as a reset does, but where the encoders stand."""
        self._agenda = Agenda()
        self._stop_repeater.reset()
        self.samples.next = self._now
        self._masters.reset()
        self._driver.stop()
        self.distances.forget()
        self._codes.reset()
        self.session.forget()
        self._baud_place = 0

    def _follow_reset(self, now: Nanos) -> None:
        """Follow the reset wire, whose level does not fit the state."""
        if self._state is AdapterState.RESET:
            self._agenda.boot_at = now + self.settings.boot_ns
            if self._receiver is not None:
                self._receiver.restart(now)
            self._enter(AdapterState.BOOTING, now, "booting", "rst is low")
            return
        self._clear()
        self.outputs.release(now)
        self.samples.after(now)
        self._enter(AdapterState.RESET, now, "reset", "rst is high")

    def _boot(self, now: Nanos) -> None:
        self.outputs.show_safe(now)
        self.outputs.show_encoders(self._codes.shown, now)
        self.session.stop_unknown()
        self.samples.next = now
        self._enter(AdapterState.IDLE, now, "booted", "waits for its master's connect request")

    def _begin_session(self, now: Nanos, why: str) -> None:
        self._stop_repeater.cancel()
        self._agenda.retry_at = NEVER
        self.session.connect(now)
        self._enter(AdapterState.CONNECTING, now, "connecting", why)

    def _take_session_events(self, now: Nanos) -> None:
        for event in self.session.take_events():
            if isinstance(event, StandardSip):
                self._take_sip(event, now)
            elif isinstance(event, SessionOpened):
                self._open(now, event.robot)
            elif self._state is AdapterState.CONNECTING:
                self.session.drop(now)
                self._agenda.retry_at = now + self.settings.retry_ns
                self._baud_place = (self._baud_place + 1) % len(self.settings.bauds)
                self._notify(
                    now, "no connection", f"{event.reason}; tries again in {self.settings.retry_ns / NS_PER_S:.1f} s"
                )
            else:
                self._lose(now, "lost", event.reason)

    def _open(self, now: Nanos, robot: str) -> None:
        settings = self.settings
        self.session.send(set_origin(), now)
        self.session.send(sonar(on=True), now)
        self._agenda.sip_deadline = now + settings.first_sip_ns
        self._agenda.settle_at = now + settings.settle_ns
        self._agenda.sonar_at = now + settings.distance_stale_ns
        self.distances.forget()
        self._codes.open()
        self._enter(AdapterState.SETTLING, now, "connected", robot)

    def _take_sip(self, sip: StandardSip, now: Nanos) -> None:
        if self._state not in OPEN_STATES:
            return
        self._agenda.sips += 1
        self._agenda.sip_deadline = max(now, self._stop_repeater.received_at + self.settings.liveness_ns)
        for reading in sip.sonar:
            self.distances.take(reading.number, reading.raw_range * self.parameters.range_um_per_count, now)
        if sip.sonar:
            self._agenda.sonar_at = now + self.settings.distance_stale_ns
            self.outputs.show_distances(self.distances.levels, now)
        if self._state is AdapterState.SETTLING:
            if (sip.raw_x, sip.raw_y, sip.raw_heading) != (0, 0, 0) and now < self._agenda.settle_at:
                return
            self._drive(now)
        if not self._codes.take(sip):
            self._notify(now, "odometry jumped", "the step is no travel; counts go on from here")
        self._driver.take(sip, now)
        stalled = (sip.stall_left, sip.stall_right)
        if stalled != self._agenda.stalled:
            self._agenda.stalled = stalled
            self._notify(now, "stall", f"left {int(stalled[0])}, right {int(stalled[1])}")
        self.outputs.show_encoders(self._codes.walk(now), now)

    def _drive(self, now: Nanos) -> None:
        self._driver.begin(self._masters.speeds, now)
        self._enter(AdapterState.DRIVING, now, "driving", "odometry is taken, motors enabled")

    def _lose(self, now: Nanos, what: str, why: str) -> None:
        self._halt(now)
        self._masters.forget_request()
        self._enter(AdapterState.LOST, now, what, f"{why}; stopped until its master asks for a connection anew")

    def _lose_pad(self, now: Nanos) -> None:
        if self._masters.lose_pad() and self._state in SESSION_STATES:
            self._lose(now, "pad lost", "no report of the pad in time")

    def _end_request(self, why: str, now: Nanos) -> None:
        """Leave the robot, which the master no longer wants."""
        if self._state in SESSION_STATES:
            self._halt(now)
            self._stop_repeater.end_on_request()
            self._agenda.retry_at = now + self.settings.stop_repeat_ns
            self._enter(AdapterState.CLOSING, now, "disconnected", why)

    def _halt(self, now: Nanos) -> None:
        """Stop and close the robot, and show what is known: nothing."""
        self._stop_repeater.begin(self.session, now)
        self.distances.forget()
        self._driver.stop()
        self.outputs.show_safe(now)

    def _enter(self, state: AdapterState, now: Nanos, what: str, why: str) -> None:
        self._state = state
        self._reason = why
        self._notify(now, what, why)

    def _notify(self, now: Nanos, what: str, detail: str) -> None:
        if self.on_event is not None:
            self.on_event(now, what, detail)
