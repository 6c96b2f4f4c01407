"""The ESP32 adapter between a BluePill's pins and a Pioneer's P2OS line.

It is a client of the robot, driven by pins. The states and their table stand in
states.py; here is what happens in them.

Not modelled: the ESP32 itself (cores, Bluetooth, flash), the time that its
program needs (a pass of its loop takes none here), analog levels.

Invariant: within one instant the order is fixed: reset wire, boot, connection,
sample, loss, belief, distances, encoders, speeds, stops. A change of rst is seen
at the end of a slice, where the bench's watched nets put it, and at each sample.
"""

from dataclasses import replace
from typing import Any, cast

from adapter_sim.belief import Belief
from adapter_sim.codec import divide_half_away
from adapter_sim.distances import Distances, threshold_um
from adapter_sim.encoders import HEADING_MODULUS, EncoderGeometry, Encoders
from adapter_sim.inputs import Inputs
from adapter_sim.mixing import STILL, Mixer
from adapter_sim.outputs import CodeWalk, Outputs
from adapter_sim.pacing import Pacer
from adapter_sim.pinout import Pinout, Role
from adapter_sim.ports import EventCallback, PinBank
from adapter_sim.session import Session, SessionOpened
from adapter_sim.settings import AdapterSettings, EncoderAtOpen
from adapter_sim.states import AWAKE_STATES, NEVER, OPEN_STATES, STOPPING_STATES, AdapterState, AdapterStatus, Agenda
from p2os.commands import enable, rvel, set_origin, sonar, vel
from p2os.parameters import RobotParameters
from p2os.sip import StandardSip
from p2os.timing import NS_PER_MS, NS_PER_S, Nanos, Reached

#: ENABLE 1 goes out with this many pairs: one frame may be lost. # chosen: not more, for a person may switch off
_ENABLES = 2
#: A robot heard from so recently is still streaming: one SIP period.
_ECHO_NS: Nanos = 100 * NS_PER_MS


class Adapter:
    """The adapter as a passive part in virtual time.

    Args:
        pins: Its ends of the wires.
        pinout: Names, widths and levels of the wires.
        parameters: The robot's own numbers.
        settings: None takes the defaults.
        on_event: Told of each transition.
        now: When power comes, in nanoseconds.
    """

    def __init__(
        self,
        *,
        pins: PinBank,
        pinout: Pinout,
        parameters: RobotParameters,
        settings: AdapterSettings | None = None,
        on_event: EventCallback | None = None,
        now: Nanos = 0,
    ) -> None:
        self.pinout = pinout
        self.parameters = parameters
        self.settings = settings = settings or AdapterSettings()
        self.on_event = on_event
        self._sample_period_ns = settings.sample_period_ns
        self.mixer = Mixer(
            settings,
            track_mm=parameters.track_mm,
            max_velocity_mm_s=min(parameters.max_velocity_mm_s, parameters.motion.max_velocity_mm_s),
            max_rotation_deg_s=min(parameters.max_rotation_deg_s, parameters.motion.max_rotation_deg_s),
        )
        self.distances = Distances(
            len(pinout.with_role(Role.DISTANCE)),
            threshold_um=threshold_um(settings.threshold_um, parameters),
            stale_ns=settings.distance_stale_ns,
        )
        self.encoders = Encoders(EncoderGeometry.of(parameters, settings.liveness_ns), pinout.value("encoder1").width)
        self.session = Session(settings)
        self.outputs = Outputs(pins, pinout)
        self.inputs = Inputs(pins, pinout, settings)
        self._belief = Belief(
            patience_ns=settings.disbelief_ns,
            tolerance_mm_s=settings.disbelief_tolerance_mm_s,
            progress_mm_s=settings.disbelief_progress_mm_s,
        )
        self._pacer = Pacer(spacing_ns=settings.pair_spacing_ns, refresh_ns=settings.refresh_ns)
        self._walks = (CodeWalk(settings.encoder_dwell_ns), CodeWalk(settings.encoder_dwell_ns))
        self._heading_scale = HEADING_MODULUS // parameters.angle_counts_per_turn
        self._now = now
        #: The earliest deadline, and the earliest that is no sample.
        self._deadline: Nanos = now
        self._other: Nanos = now
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
    def status(self) -> AdapterStatus:
        """Return what the adapter knows at this moment."""
        return AdapterStatus(
            state=self._state,
            reason=self._reason,
            motors=self.inputs.motors,
            speeds=self._pacer.sent,
            distances=self.distances.levels,
            ranges_um=self.distances.ranges_um,
            counts=self.encoders.counts,
            counts_shown=(self._walks[0].shown, self._walks[1].shown),
            sips=self._agenda.sips,
            odometry_jumps=self.encoders.jumps,
        )

    def receive(self, data: bytes, now: Nanos) -> None:
        """Take bytes that the line has delivered at `now`; what was due earlier is done first."""
        self._run(now - 1)
        if self._state in AWAKE_STATES:
            self._now = self._agenda.heard_at = now
            self.session.receive(data, now)
            self._take_session_events(now)
            self._replan()

    def take_output(self) -> list[bytes]:
        """Return the frames to send, one item each, oldest first, and forget them."""
        return self.session.take_output()

    def next_deadline(self) -> Nanos | None:
        """Return the next sample instant or deadline, in nanoseconds."""
        return self._deadline

    def advance_to(self, limit: Nanos) -> Reached:
        """Act on everything due up to and including `limit`, then look at rst."""
        looked_at = self._run(limit)
        if looked_at != limit:
            self._now = max(self._now, limit)
            if self.inputs.is_reset(limit) != (self._state is AdapterState.RESET):
                self._turn_reset(limit)
                self._replan()
        return Reached(limit)

    def snapshot(self) -> dict[str, object]:
        """Return all that decides the future, as plain values."""
        return {
            "adapter": (self._state.value, self._reason, self._now, self._next_sample),
            "agenda": replace(self._agenda),
            "inputs": self.inputs.snapshot(),
            "belief": self._belief.snapshot(),
            "pacer": self._pacer.snapshot(),
            "walks": tuple(walk.snapshot() for walk in self._walks),
            "distances": self.distances.snapshot(),
            "encoders": self.encoders.snapshot(),
            "outputs": self.outputs.snapshot(),
            "session": self.session.snapshot(),
        }  # fmt: skip

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned."""
        parts = cast("dict[str, Any]", snapshot)
        state, self._reason, self._now, self._next_sample = parts["adapter"]
        self._state = AdapterState(state)
        self._agenda = replace(parts["agenda"])
        self.inputs.restore(parts["inputs"])
        self._belief.restore(parts["belief"])
        self._pacer.restore(parts["pacer"])
        for walk, saved in zip(self._walks, parts["walks"], strict=True):
            walk.restore(saved)
        self.distances.restore(parts["distances"])
        self.encoders.restore(parts["encoders"])
        self.outputs.restore(parts["outputs"])
        self.session.restore(parts["session"])
        self._replan()

    # Time ------------------------------------------------------------------------------------------------

    def _run(self, limit: Nanos) -> Nanos | None:
        """Act on all that is due; return the last instant at which the pins were looked at, None for none."""
        now = None
        while self._deadline <= limit:
            now = self._deadline
            if now < self._other and self.inputs.is_quiet(now):
                self._now = now
                self._next_sample = now + self._sample_period_ns
                self._deadline = min(self._next_sample, self._other)
            else:
                self._act(now)
                self._replan()
        return now

    def _act(self, now: Nanos) -> None:
        """Do all that is due at `now`, in the fixed order."""
        self._now = now
        if self.inputs.is_reset(now) != (self._state is AdapterState.RESET):
            self._turn_reset(now)
        if self._state is AdapterState.RESET:
            self._next_sample = now + self._sample_period_ns
            return
        if self._state is AdapterState.BOOTING:
            if now < self._agenda.boot_at:
                self._next_sample = now + self._sample_period_ns
                return
            self._boot(now)
        self._work(now)

    def _work(self, now: Nanos) -> None:
        """Do all that is due while awake."""
        self.session.advance_to(now)
        self._take_session_events(now)
        if now >= self._next_sample:
            self._sample(now)
            self._next_sample = now + self._sample_period_ns
        if self._state in OPEN_STATES:
            self._run_open(now)
        if self._state in STOPPING_STATES and self._agenda.stops_left and now >= self._agenda.stop_at:
            self._repeat_stop(now)
        if self._state is AdapterState.CLOSING and now >= self._agenda.retry_at:
            self._enter(AdapterState.IDLE, now, "idle", "closed")
        if self._state is AdapterState.IDLE and self.inputs.wants_robot:
            self._begin_session(now, "p2dx_con is high")
        if self._state is AdapterState.CONNECTING and now >= self._agenda.retry_at:
            self._begin_session(now, "trying again")

    def _repeat_stop(self, now: Nanos) -> None:
        """Say the stop sequence again: nobody has confirmed it; a robot closed in peace shows it by its silence."""
        self._agenda.stops_left -= 1
        self._agenda.stop_at = now + self.settings.stop_repeat_ns
        if not self._agenda.closed_in_peace or now - self._agenda.heard_at < _ECHO_NS:
            self.session.abandon(now)

    def _run_open(self, now: Nanos) -> None:
        if now >= self._agenda.sip_deadline:
            self._lose(now, "lost", "no SIP in time")
            return
        if self._state is AdapterState.DRIVING and now >= self._belief.ends_at:
            self._lose(now, "disbelief", self._belief.describe())
            return
        expires_at = self.distances.expires_at
        if expires_at is not None and now >= expires_at:
            self.distances.expire(now)
            self.outputs.show_distances(self.distances.levels, now)
        if now >= self._agenda.sonar_at:
            # No reading for as long as one lives: SONAR 1 was lost, or somebody switched them off.
            self.session.send(sonar(on=True), now)
            self._agenda.sonar_at = now + self.settings.distance_stale_ns
        self._walk(now)
        if self._state is AdapterState.DRIVING and now >= self._pacer.due_at(now):
            self._send_pair(now)

    def _replan(self) -> None:
        """Find the next deadline; `_other` is the earliest that is no sample."""
        state = self._state
        if state not in AWAKE_STATES:
            # Only rst is looked at; `_other` keeps these instants off the fast path.
            self._other = self._deadline = min(self._agenda.boot_at, self._next_sample)
            return
        times = [self.session.next_deadline()]
        if state in OPEN_STATES:
            times += [self._agenda.sip_deadline, self._agenda.sonar_at, self.distances.expires_at]
            counts = self.encoders.counts
            times += [walk.due_at(target, self._now) for walk, target in zip(self._walks, counts, strict=True)]
        if state is AdapterState.DRIVING:
            times += [self._belief.ends_at, self._pacer.due_at(self._now)]
        if state in STOPPING_STATES and self._agenda.stops_left:
            times.append(self._agenda.stop_at)
        if state in {AdapterState.CLOSING, AdapterState.CONNECTING}:
            times.append(self._agenda.retry_at)
        self._other = min((time for time in times if time is not None), default=NEVER)
        self._deadline = min(self._next_sample, self._other)

    # Transitions -----------------------------------------------------------------------------------------

    def _clear(self) -> None:
        """Forget everything, as a reset does."""
        self._agenda = Agenda()
        self._next_sample = self._now
        self.inputs.reset()
        self._belief.begin(self._now)
        self._pacer.begin(STILL)
        self.distances.forget()
        self.encoders.begin()
        self.encoders.jumps = 0
        for walk in self._walks:
            walk.reset()
        self.session.forget()

    def _turn_reset(self, now: Nanos) -> None:
        """Follow the reset wire, which stands otherwise than the state says."""
        self._now = now
        if self._state is AdapterState.RESET:
            self._agenda.boot_at = now + self.settings.boot_ns
            self._enter(AdapterState.BOOTING, now, "booting", "rst is low")
            return
        self._clear()
        self.outputs.release(now)
        self._next_sample = now + self._sample_period_ns
        self._enter(AdapterState.RESET, now, "reset", "rst is high")

    def _boot(self, now: Nanos) -> None:
        self.outputs.show_safe(now)
        self.outputs.show_encoders((0, 0), now)
        self.session.stop_unknown()
        self._next_sample = now
        self._enter(AdapterState.IDLE, now, "booted", "waits for p2dx_con")

    def _begin_session(self, now: Nanos, why: str) -> None:
        self._agenda.stops_left = 0
        self._agenda.retry_at = NEVER
        self.session.connect(now)
        self._enter(AdapterState.CONNECTING, now, "connecting", why)

    def _take_session_events(self, now: Nanos) -> None:
        for event in self.session.take_events():
            if isinstance(event, StandardSip):
                self._take_sip(event, now)
            elif isinstance(event, SessionOpened):
                if self._state is AdapterState.CONNECTING:
                    self._open(now, event.robot)
            elif self._state is AdapterState.CONNECTING:
                self.session.drop(now)
                self._agenda.retry_at = now + self.settings.retry_ns
                self._tell(
                    now, "no connection", f"{event.reason}; tries again in {self.settings.retry_ns / NS_PER_S:.1f} s"
                )
            elif self._state in OPEN_STATES:
                self._lose(now, "lost", event.reason)

    def _open(self, now: Nanos, robot: str) -> None:
        settings = self.settings
        self.session.send(set_origin(), now)
        self.session.send(sonar(on=True), now)
        self._agenda.sip_deadline = now + settings.first_sip_ns
        self._agenda.settle_at = now + settings.settle_ns
        self._agenda.sonar_at = now + settings.distance_stale_ns
        self.distances.forget()
        if settings.encoder_at_open is EncoderAtOpen.ZERO:
            for walk in self._walks:
                walk.rebase(1 << self.encoders.width)
            self.encoders.begin()
        else:
            self.encoders.begin((self._walks[0].shown, self._walks[1].shown))
        self._enter(AdapterState.SETTLING, now, "connected", robot)

    def _take_sip(self, sip: StandardSip, now: Nanos) -> None:
        if self._state not in OPEN_STATES:
            return
        self._agenda.sips += 1
        self._agenda.sip_deadline = now + self.settings.liveness_ns
        for reading in sip.sonar:
            self.distances.take(reading.number, reading.raw_range * self.parameters.range_um_per_count, now)
        if sip.sonar:
            self._agenda.sonar_at = now + self.settings.distance_stale_ns
            self.outputs.show_distances(self.distances.levels, now)
        if self._state is AdapterState.SETTLING:
            if (sip.raw_x, sip.raw_y, sip.raw_heading) != (0, 0, 0) and now < self._agenda.settle_at:
                return
            self._drive(now)
        if not self.encoders.take(sip.raw_x, sip.raw_y, sip.raw_heading * self._heading_scale):
            self._tell(now, "odometry jumped", "the step is no travel; counts go on from here")
        conversion = self.parameters.velocity_um_s_per_count
        stalled = (sip.stall_left, sip.stall_right)
        self._belief.take(
            divide_half_away(sip.raw_left_velocity * conversion, 1_000),
            divide_half_away(sip.raw_right_velocity * conversion, 1_000),
            stalled=any(stalled),
            now=now,
        )
        if stalled != self._agenda.stalled:
            self._agenda.stalled = stalled
            self._tell(now, "stall", f"left {int(stalled[0])}, right {int(stalled[1])}")
        self._walk(now)

    def _drive(self, now: Nanos) -> None:
        self._agenda.enables_left = _ENABLES
        self._pacer.begin(self.mixer.mix(*self.inputs.motors))
        self._belief.begin(now)
        self._enter(AdapterState.DRIVING, now, "driving", "odometry is taken, motors enabled")

    def _lose(self, now: Nanos, what: str, why: str) -> None:
        self._halt(now)
        self._agenda.closed_in_peace = False
        self._enter(AdapterState.LOST, now, what, f"{why}; stopped until p2dx_con is given anew")

    def _disconnect(self, now: Nanos) -> None:
        self._halt(now)
        self._agenda.closed_in_peace = True
        self._agenda.retry_at = now + self.settings.stop_repeat_ns
        self._enter(AdapterState.CLOSING, now, "disconnected", "p2dx_con is low")

    def _halt(self, now: Nanos) -> None:
        """Stop and close the robot, and show what is known: nothing."""
        self.session.abandon(now)
        self._agenda.stops_left = self.settings.stop_repeats
        self._agenda.stop_at = now + self.settings.stop_repeat_ns
        self.distances.forget()
        self._pacer.begin(STILL)
        self.outputs.show_safe(now)

    def _enter(self, state: AdapterState, now: Nanos, what: str, why: str) -> None:
        self._state = state
        self._reason = why
        self._tell(now, what, why)

    def _tell(self, now: Nanos, what: str, detail: str) -> None:
        if self.on_event is not None:
            self.on_event(now, what, detail)

    # Work ------------------------------------------------------------------------------------------------

    def _sample(self, now: Nanos) -> None:
        motors_changed, connect_changed = self.inputs.sample(now)
        if motors_changed and self._state is AdapterState.DRIVING:
            self._pacer.wanted = self.mixer.mix(*self.inputs.motors)
        if not connect_changed or self.inputs.wants_robot:
            return
        if self._state in {AdapterState.CONNECTING, *OPEN_STATES}:
            self._disconnect(now)
        elif self._state is AdapterState.LOST:
            self._enter(AdapterState.IDLE, now, "idle", "p2dx_con is low; ready for a new connection")

    def _walk(self, now: Nanos) -> None:
        counts = self.encoders.counts
        for walk, target in zip(self._walks, counts, strict=True):
            walk.step(target, now)
        self.outputs.show_encoders((self._walks[0].shown, self._walks[1].shown), now)

    def _send_pair(self, now: Nanos) -> None:
        before, speeds = self._pacer.sent, self._pacer.take(now)
        if self._agenda.enables_left:
            self._agenda.enables_left -= 1
            self.session.send(enable(on=True), now)
        self.session.send(vel(speeds.forward_mm_s), now)
        self.session.send(rvel(speeds.turn_deg_s), now)
        self._belief.expect(*self.mixer.wheels_mm_s(speeds))
        if speeds != before:
            left, right = self.inputs.motors
            self._tell(now, "command", f"VEL {speeds.forward_mm_s}, RVEL {speeds.turn_deg_s} (motors {left}, {right})")
