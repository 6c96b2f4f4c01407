"""Mode C: the emulated BluePill and the adapter model drive a robot at a port.

    chip ─ nets ─ adapter ─ transport ─ a real Pioneer, or any P2OS server

It runs in real time. A loop that lags the wall clock would steer by outdated data,
so too much lag ends the run, from when the adapter asks for a session on; so do a lost line and a robot
that the adapter has lost. However it ends, the robot is stopped and closed.

Invariant: `close` sends the stop sequence, once, whatever happened before.
"""

import contextlib
from collections.abc import Callable

from adapter_sim.adapter import AdapterState
from adapter_sim.pinout import load_pinout
from p2os.errors import RemoteProtocolError, RunFailedError, TransportError
from p2os.protocol.frames import Decoder, Frame
from p2os.protocol.sip import SIP_KINDS, StandardSip
from p2os.transport import Transport
from robot_bench.adapter import make_shipped_adapter
from robot_bench.bench.board import (
    boot,
    cut_wires,
    hear_buses,
    hear_usarts,
    log_bench_event,
    make_harness,
    plug_in,
)
from robot_bench.recording.client_view import OdometryPose, SipRanges
from robot_bench.recording.recorder import Recorder
from robot_bench.recording.trace import TraceWriter
from robot_bench.running.loop import RunLoop
from robot_bench.running.pacer import PACED_SLICE_NS, RealTimePacer
from robot_bench.scenario.goals.judging import GoalJudge, RunEnd
from robot_bench.scenario.scenario import Scenario
from robot_bench.wires.chip_pins import ChipPins
from robot_bench.wires.nets import OwnedPins
from robot_bench.wires.port_endpoint import PortEndpoint, stop_robot
from robot_bench.wires.ports import LeadingChip
from simbase.interrupts import held_back
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

#: More than this behind the wall clock, and the robot is stopped.
MOST_LAG_NS: Nanos = 100 * NS_PER_MS
#: Where the adapter has asked nothing of the robot yet, which nobody steers then: a slow boot does no harm.
BEFORE_SESSION = frozenset({AdapterState.RESET, AdapterState.BOOTING, AdapterState.IDLE})
#: chosen: caps of an untried program on a real robot, mm/s and deg/s.
CAUTIOUS_VELOCITY_MM_S = 200
CAUTIOUS_ROTATION_DEG_S = 45


class RemoteBench:
    """A run in real time with a robot at the far end of a transport.

    Args:
        scenario: Its firmware, its adapter settings, its goals; world and body are the robot's own.
        transport: The line to the robot; the caller opens it, `close` closes it.
        pacer: Keeps virtual time at the wall clock.
        trace: Where the recording goes.
        chip: Runs the firmware; None boots the scenario's.

    `on_slice` is called after each slice with the time reached; it may raise to end the run.
    """

    def __init__(
        self,
        scenario: Scenario,
        transport: Transport,
        pacer: RealTimePacer,
        *,
        trace: TraceWriter | None = None,
        chip: LeadingChip | None = None,
    ) -> None:
        self.scenario = scenario
        self.trace = trace or TraceWriter()
        self.chip = chip = chip or boot(scenario)
        self.note: str | None = "the pose is the robot's own odometry; collisions and clearance cannot be told"
        if scenario.changes:
            self.note += "; the scenario's obstacles are not placed"
        if scenario.parts:
            self.note += "; parts on the board sense no world"
        self._transport = transport
        self._pacer = pacer
        self.on_slice: Callable[[Nanos], None] | None = None
        self._is_closed = False
        pinout = load_pinout()
        harness = make_harness(pinout)
        self.recorder = recorder = Recorder(self.trace, harness, body=None)
        recorder.on_event = log_bench_event
        self.adapter = make_shipped_adapter(
            scenario, OwnedPins(harness, "adapter", cut_wires(scenario, pinout)), pinout
        )
        self.adapter.on_event = recorder.listener("adapter")
        self._listener = _Listener(scenario, recorder)
        endpoint = PortEndpoint(
            self.adapter, transport,
            on_sent=lambda data, at: recorder.wire("c2r", data, at), on_received=self._listener.receive,
        )  # fmt: skip
        self.loop = RunLoop(
            chip, (endpoint,), observers=(recorder,), slice_ns=PACED_SLICE_NS, on_slice=self._after_slice
        )
        self.goals = GoalJudge(scenario.goals, can_tell_world=False)
        self.goals.on_end = lambda: self.loop.end_at(self.loop.now)
        self.goals.subscribe(recorder.events)
        pin_of = {wire.name: wire.bluepill for wire in pinout.wires}
        ChipPins(chip, harness, pin_of, on_watched=self.loop.note_edge).watch(self.adapter.wakes_on, 0)
        chip.usart1.far_baud = scenario.usart_baud
        if scenario.parts:
            plug_in(scenario, chip, recorder)
        hear_usarts(chip, recorder)
        hear_buses(chip, recorder, scenario.record)
        chip.subscribe_warnings(lambda text: recorder.event("chip", chip.now_ns, "warning", text))
        recorder.start()

    @property
    def is_closed(self) -> bool:
        """Whether the robot has been stopped and its line given back."""
        return self._is_closed

    def start_clock(self) -> None:
        """Take the present as the beginning of real time: nobody has lagged while the bench stood still."""
        self._pacer.start(self.chip.now_ns)

    def run_until(self, end: Nanos) -> None:
        """Run to `end` at the speed of the wall clock, then stop and close the robot.

        Raises:
            RunFailedError: The loop lagged, or the adapter has lost the robot.
            TransportError: The line is lost.
        """
        try:
            self.loop.run_until(end)
        finally:
            self.close()

    def close(self) -> None:
        """Stop the robot, close its session and give the line back; closing twice is harmless.

        Interrupts (Ctrl-C) meanwhile are raised when that is done.
        """
        held_back(self._close)

    def _close(self) -> None:
        if self._is_closed:
            return
        with contextlib.suppress(TransportError):  # the robot's watchdog stops it
            stop_robot(self._transport)
            self.recorder.event("bench", self.loop.now + 1, "robot stopped", "STOP, VEL 0, RVEL 0 twice, CLOSE")
        self._is_closed = True
        with contextlib.suppress(TransportError):
            self._transport.close()

    def ended(self, at: Nanos) -> RunEnd:
        """Return what a run that ends at a time is to its goals."""
        return RunEnd(at, self.scenario.planned_ns, by_scenario=self.goals.has_ended_run)

    def finish(self) -> Nanos:
        """Write the rest of the trace; return the end's time."""
        end = min(self.chip.now_ns, self.scenario.duration_ns)
        self.recorder.distance_m = self._listener.pose.distance_m
        self.goals.end_at(self.ended(end))
        self.recorder.finish(end)
        return end

    def _after_slice(self, now: Nanos) -> None:
        self._pacer.keep_pace(now)
        lag_ns = self._pacer.lag_ns
        if lag_ns > MOST_LAG_NS and self.adapter.state in BEFORE_SESSION:
            self._pacer.start(now)
        elif lag_ns > MOST_LAG_NS:
            raise RunFailedError(
                f"the loop lagged {lag_ns / NS_PER_MS:.0f} ms behind the clock at {now / NS_PER_S:.3f} s",
                hint="a program that polls without WFI is too slow for real time here; close other programs",
            )
        if self.adapter.state is AdapterState.LOST:
            raise RunFailedError(
                f"the adapter lost the robot at {now / NS_PER_S:.3f} s: {self.adapter.status.reason}",
                hint="p2os info URL",
            )
        if self.chip.has_died:
            self.loop.end_at(now)
        if self.on_slice is not None:
            self.on_slice(now)


class _Listener:
    """Splits what is read into frames, for the recording."""

    def __init__(self, scenario: Scenario, recorder: Recorder) -> None:
        self.pose = OdometryPose(scenario.parameters)
        self._recorder = recorder
        self._profile = scenario.controller.family_of(scenario.parameters)
        self._decoder = Decoder()
        self._ranges = SipRanges(scenario.parameters, self._profile, on_ranges=recorder.sonar)

    def receive(self, data: bytes, now: Nanos) -> None:
        self._decoder.receive(data, now)
        while (item := self._decoder.next_item()) is not None:
            if not isinstance(item, Frame):
                continue
            self._recorder.wire("r2c", item.to_bytes(), now)
            if item.kind in SIP_KINDS:
                with contextlib.suppress(RemoteProtocolError):
                    sip = StandardSip.from_frame(item, self._profile)
                    self._recorder.events.publish(self.pose.take(sip, now))
                    self._ranges.take_sip(sip, now)
