"""The ESP32 adapter between a BluePill's pins and a Pioneer's P2OS line.

It is a client of the robot, driven by pins or by a game pad, never by both. The
states and their table stand in states.py; here is what happens in them. The
firmware in adapter_fw/core is its twin, byte for byte and edge for edge.

Not modelled: the ESP32 itself, the time that its program needs, analog levels.

Invariant: within one instant the order is fixed: reset wire, boot, connection,
sample, pad, loss, belief, distances, encoders, speeds, stops. A change of rst is seen
at the end of a slice, where the bench's watched nets put it, and at each sample.
"""

from dataclasses import replace
from typing import Any, cast

from adapter_sim.distances import Distances, threshold_um
from adapter_sim.driver import Driver
from adapter_sim.gamepad import Master, PadReport
from adapter_sim.inputs import Inputs
from adapter_sim.masters import Masters
from adapter_sim.outputs import Outputs
from adapter_sim.pinout import Pinout, Role
from adapter_sim.ports import EventCallback, PinBank
from adapter_sim.sample_clock import SampleClock
from adapter_sim.session import Session, SessionOpened
from adapter_sim.settings import AdapterSettings
from adapter_sim.states import AWAKE_STATES, NEVER, OPEN_STATES, STOPPING_STATES, AdapterState, AdapterStatus, Agenda
from adapter_sim.stopper import Stopper
from adapter_sim.wheel_codes import WheelCodes
from p2os.commands import set_origin, sonar
from p2os.parameters import RobotParameters
from p2os.sip import StandardSip
from p2os.timing import NS_PER_S, Nanos, Reached


class Adapter:
    """The adapter as a passive part in virtual time.

    Args:
        pins: Its ends of the wires.
        pinout: Names, widths and levels of the wires.
        parameters: The robot's own numbers.
        settings: None takes the defaults.
        on_event: Told of each transition.
        now: When power comes, in nanoseconds.
        master: Who commands; the board reads a jumper at boot.
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
        master: Master = Master.BLUEPILL,
    ) -> None:
        self.pinout = pinout
        self.parameters = parameters
        self.settings = settings = settings or AdapterSettings()
        self.on_event = on_event
        self.samples = SampleClock(settings.sample_period_ns)
        self._driver = Driver(settings, parameters)
        self.distances = Distances(
            len(pinout.with_role(Role.DISTANCE)),
            threshold_um=threshold_um(settings.threshold_um, parameters),
            stale_ns=settings.distance_stale_ns,
        )
        self._codes = WheelCodes(settings, parameters, pinout.value("encoder1").width)
        self.session = Session(settings)
        self.outputs = Outputs(pins, pinout)
        self.inputs = Inputs(pins, pinout, settings)
        self._masters = Masters(self.inputs, self._driver.mixer, settings, master)
        self._stopper = Stopper(settings)
        self._baud_place = 0
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
        if self._state in AWAKE_STATES:
            self._now = now
            self._stopper.hear(now)
            self.session.receive(data, now)
            self._take_session_events(now)
            self._replan()

    def receive_pad(self, report: PadReport, now: Nanos) -> None:
        """Take a pad's report that came at `now`; without effect on the robot while the BluePill is master."""
        self._run(now - 1)
        self._now = max(self._now, now)
        has_wish_ended = self._masters.take_pad(report, now)
        if self._state in AWAKE_STATES:
            if has_wish_ended:
                self._end_wish("Down was pressed", now)
            if self._state is AdapterState.DRIVING:
                self._driver.want(self._masters.speeds)
        self._replan()

    def set_master(self, master: Master, now: Nanos) -> None:
        """Give the robot to another master: it is stopped and closed first, and only a new wish starts it."""
        self._run(now - 1)
        if master is self._masters.master:
            return
        self._now = max(self._now, now)
        if self._state is AdapterState.CONNECTING or self._state in OPEN_STATES:
            self._halt(now)
        self._masters.switch(master)
        self._tell(now, "master", master.value)
        if self._state in AWAKE_STATES:
            self._enter(AdapterState.LOST, now, "master", "waits for the new master's wish, given anew")
        self._replan()

    def shutdown(self, reason: str, now: Nanos) -> None:
        """Stop the robot, drive every output to its safe level, and wait for the wish to end."""
        self._run(now - 1)
        self._now = max(self._now, now)
        if self._state in AWAKE_STATES:
            self._lose(now, "shutdown", reason)
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
            elif self.samples.is_asleep and not self.inputs.is_quiet(limit):
                self._replan()
                self._run(limit)
        return Reached(limit)

    def snapshot(self) -> dict[str, object]:
        """Return all that decides the future, as plain values."""
        return {
            "adapter": (self._state.value, self._reason, self._now, self.samples.next, self._baud_place),
            "agenda": replace(self._agenda),
            "masters": self._masters.snapshot(),
            "stopper": self._stopper.snapshot(),
            "driver": self._driver.snapshot(),
            "distances": self.distances.snapshot(),
            "codes": self._codes.snapshot(),
            "outputs": self.outputs.snapshot(),
            "session": self.session.snapshot(),
        }  # fmt: skip

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned."""
        parts = cast("dict[str, Any]", snapshot)
        state, self._reason, self._now, self.samples.next, self._baud_place = parts["adapter"]
        self._state = AdapterState(state)
        self._agenda = replace(parts["agenda"])
        self.samples.is_asleep = False
        self._masters.restore(parts["masters"])
        self._stopper.restore(parts["stopper"])
        self._driver.restore(parts["driver"])
        self.distances.restore(parts["distances"])
        self._codes.restore(parts["codes"])
        self.outputs.restore(parts["outputs"])
        self.session.restore(parts["session"])
        self._replan()

    def _run(self, limit: Nanos) -> Nanos | None:
        """Act on all that is due; return the last instant at which the pins were looked at, None for none."""
        now = None
        while self._deadline <= limit:
            now = self._deadline
            if now < self._other and not self._is_restless and self.inputs.is_quiet(now):
                self._now = now
                self.samples.was_quiet(now)
                self._deadline = self.samples.due(self._other)
            else:
                self.samples.wake(now)
                self._act(now)
                self._replan()
        return now

    @property
    def _is_restless(self) -> bool:
        """Tell whether the state is left at the next sample even if the pins stand still: a pad's wish came or went."""
        left_by_wish = {AdapterState.IDLE: True, AdapterState.LOST: False}
        return left_by_wish.get(self._state) is self._masters.wants_robot

    def _act(self, now: Nanos) -> None:
        """Do all that is due at `now`, in the fixed order."""
        self._now = now
        if self.inputs.is_reset(now) != (self._state is AdapterState.RESET):
            self._turn_reset(now)
        if self._state is AdapterState.RESET:
            self.samples.after(now)
            return
        if self._state is AdapterState.BOOTING:
            if now < self._agenda.boot_at:
                self.samples.after(now)
                return
            self._boot(now)
        self._work(now)

    def _work(self, now: Nanos) -> None:
        """Do all that is due while awake."""
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
            self._stopper.repeat(self.session, now)
        if self._state is AdapterState.CLOSING and now >= self._agenda.retry_at:
            self._enter(AdapterState.IDLE, now, "idle", "closed")
        if self._state is AdapterState.IDLE and self._masters.wants_robot:
            self._begin_session(now, self._masters.wish)
        if self._state is AdapterState.CONNECTING and now >= self._agenda.retry_at:
            self._begin_session(now, "trying again")

    def _run_open(self, now: Nanos) -> None:
        if now >= self._agenda.sip_deadline:
            self._lose(now, "lost", "no SIP in time")
            return
        if self._state is AdapterState.DRIVING and now >= self._driver.belief.ends_at:
            self._lose(now, "disbelief", self._driver.belief.describe())
            return
        expires_at = self.distances.expires_at
        if expires_at is not None and now >= expires_at:
            self.distances.expire(now)
            self.outputs.show_distances(self.distances.levels, now)
        if now >= self._agenda.sonar_at:
            # No reading for as long as one lives: SONAR 1 was lost, or somebody switched them off.
            self.session.send(sonar(on=True), now)
            self._agenda.sonar_at = now + self.settings.distance_stale_ns
        self.outputs.show_encoders(self._codes.walk(now), now)
        if self._state is AdapterState.DRIVING and now >= self._driver.pair_due_at(now):
            self._send_pair(now)

    def _replan(self) -> None:
        """Find the next deadline; `_other` is the earliest that is no sample."""
        self.samples.wake(self._now)
        state = self._state
        if state not in AWAKE_STATES:
            # Only rst is looked at; `_other` keeps these instants off the fast path.
            self._other = self._deadline = min(self._agenda.boot_at, self.samples.next)
            return
        times = [self.session.next_deadline(), self._masters.pad_lost_at]
        if state in OPEN_STATES:
            times += [self._agenda.sip_deadline, self._agenda.sonar_at, self.distances.expires_at]
            times += self._codes.due_at(self._now)
        if state is AdapterState.DRIVING:
            times += [self._driver.belief.ends_at, self._driver.pair_due_at(self._now)]
        if state in STOPPING_STATES:
            times.append(self._stopper.due_at)
        if state in {AdapterState.CLOSING, AdapterState.CONNECTING}:
            times.append(self._agenda.retry_at)
        self._other = min((time for time in times if time is not None), default=NEVER)
        self._deadline = self.samples.due(self._other)

    def _clear(self) -> None:
        """Forget everything, as a reset does."""
        self._agenda = Agenda()
        self._stopper.reset()
        self.samples.next = self._now
        self._masters.reset()
        self._driver.reset(self._now)
        self.distances.forget()
        self._codes.reset()
        self.session.forget()
        self._baud_place = 0

    def _turn_reset(self, now: Nanos) -> None:
        """Follow the reset wire, which stands otherwise than the state says."""
        self._now = now
        if self._state is AdapterState.RESET:
            self._agenda.boot_at = now + self.settings.boot_ns
            self._enter(AdapterState.BOOTING, now, "booting", "rst is low")
            return
        self._clear()
        self.outputs.release(now)
        self.samples.after(now)
        self._enter(AdapterState.RESET, now, "reset", "rst is high")

    def _boot(self, now: Nanos) -> None:
        self.outputs.show_safe(now)
        self.outputs.show_encoders((0, 0), now)
        self.session.stop_unknown()
        self.samples.next = now
        self._enter(AdapterState.IDLE, now, "booted", "waits for its master's wish")

    def _begin_session(self, now: Nanos, why: str) -> None:
        self._stopper.cancel()
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
                self._baud_place = (self._baud_place + 1) % len(self.settings.bauds)
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
        self._codes.open()
        self._enter(AdapterState.SETTLING, now, "connected", robot)

    def _take_sip(self, sip: StandardSip, now: Nanos) -> None:
        if self._state not in OPEN_STATES:
            return
        self._agenda.sips += 1
        self._agenda.sip_deadline = max(now, self._stopper.heard_at + self.settings.liveness_ns)
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
            self._tell(now, "odometry jumped", "the step is no travel; counts go on from here")
        self._driver.take(sip, now)
        stalled = (sip.stall_left, sip.stall_right)
        if stalled != self._agenda.stalled:
            self._agenda.stalled = stalled
            self._tell(now, "stall", f"left {int(stalled[0])}, right {int(stalled[1])}")
        self.outputs.show_encoders(self._codes.walk(now), now)

    def _drive(self, now: Nanos) -> None:
        self._driver.begin(self._masters.speeds, now)
        self._enter(AdapterState.DRIVING, now, "driving", "odometry is taken, motors enabled")

    def _lose(self, now: Nanos, what: str, why: str) -> None:
        self._halt(now)
        self._masters.forget_wish()
        self._enter(AdapterState.LOST, now, what, f"{why}; stopped until its master's wish is given anew")

    def _lose_pad(self, now: Nanos) -> None:
        if self._masters.lose_pad() and (self._state is AdapterState.CONNECTING or self._state in OPEN_STATES):
            self._lose(now, "pad lost", "no report of the pad in time")

    def _end_wish(self, why: str, now: Nanos) -> None:
        """Leave the robot, which the master no longer wants."""
        if self._state is AdapterState.CONNECTING or self._state in OPEN_STATES:
            self._halt(now)
            self._stopper.end_in_peace()
            self._agenda.retry_at = now + self.settings.stop_repeat_ns
            self._enter(AdapterState.CLOSING, now, "disconnected", why)

    def _halt(self, now: Nanos) -> None:
        """Stop and close the robot, and show what is known: nothing."""
        self._stopper.begin(self.session, now)
        self.distances.forget()
        self._driver.stop()
        self.outputs.show_safe(now)

    def _enter(self, state: AdapterState, now: Nanos, what: str, why: str) -> None:
        self._state = state
        self._reason = why
        self._tell(now, what, why)

    def _tell(self, now: Nanos, what: str, detail: str) -> None:
        if self.on_event is not None:
            self.on_event(now, what, detail)

    def _sample(self, now: Nanos) -> None:
        have_speeds_changed, has_wish_ended = self._masters.sample(now)
        if have_speeds_changed and self._state is AdapterState.DRIVING:
            self._driver.want(self._masters.speeds)
        if has_wish_ended:
            self._end_wish("p2dx_con is low", now)
        if self._state is AdapterState.LOST and not self._masters.wants_robot:
            self._enter(AdapterState.IDLE, now, "idle", "ready for a new connection")

    def _send_pair(self, now: Nanos) -> None:
        if self._driver.send_pair(self.session, now):
            speeds, (left, right) = self._driver.sent, self.inputs.motors
            self._tell(now, "command", f"VEL {speeds.forward_mm_s}, RVEL {speeds.turn_deg_s} (motors {left}, {right})")
