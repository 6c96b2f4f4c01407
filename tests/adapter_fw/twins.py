"""Model and firmware side by side: the same pins, bytes and times into both, everything compared."""

from dataclasses import dataclass, field, replace

from adapter_sim import Adapter, AdapterSettings, Pinout, load_pinout
from adapter_sim.masters import Master
from adapter_sim.receiver import Receiver
from p2os.gamepad import PadReport
from p2os.protocol.frames import Frame
from p2os.protocol.packets import Identity
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import SonarReading, StandardSip
from p2os.robots.parameters import load_parameters
from robot_bench.adapter import FirmwareAdapter
from simbase.timing import NS_PER_MS, Nanos
from tests.adapter_sim.conftest import FakePins

PINOUT = load_pinout()
MS = NS_PER_MS
#: Events whose details both say alike; the words of the others are each side's own.
EXACT = {"command", "stall", "connected", "connecting"}
#: Counters that both keep, of the line and of the session.
WIRE_COUNTERS = ("frames", "noise_bytes", "bad_checksums", "bad_counts", "stalled", "rescued")
CLIENT_COUNTERS = ("frames_received", "frames_ignored", "malformed", "sync_timeouts", "losses")


@dataclass
class Side:
    """One of the two, with all that came out of it."""

    pins: FakePins
    adapter: Adapter | FirmwareAdapter
    frames: list[bytes] = field(default_factory=list)
    events: list[tuple[Nanos, str]] = field(default_factory=list)

    def listen(self) -> None:
        self.adapter.on_event = lambda now, what, detail: self.events.append(
            (now, f"{what}: {detail}" if what in EXACT else what)
        )

    def bring(self, at: Nanos) -> None:
        """Bring it to its next deadline or to an edge: nothing may have happened before."""
        events, writes = len(self.events), len(self.pins.writes)
        self.adapter.advance_to(at)
        late = [what for what in (*self.events[events:], *self.pins.writes[writes:]) if what[0] != at]
        assert not late, f"only noticed at {at} ns: {late}"

    def collect(self) -> None:
        self.frames += self.adapter.take_output()


class Twins:
    """Both, fed alike; a robot that is only a source of SIPs answers the model's frames.

    Where the firmware waits for edges, each is brought to its own deadlines, both to those of rst, and the firmware to
    the others too.
    """

    def __init__(
        self,
        settings: AdapterSettings | None = None,
        pinout: Pinout = PINOUT,
        *,
        robot: str = "p2dx",
        start: Nanos = 0,
        waits_for_edges: bool = False,
        has_uart: bool = False,
    ) -> None:
        self.now: Nanos = start
        parameters = load_parameters(robot)
        self.steps = 0
        self.sides = []
        for kind in (Adapter, FirmwareAdapter):
            pins = FakePins()
            receiver = Receiver() if has_uart else None
            adapter = kind(
                pins=pins, pinout=pinout, parameters=parameters, settings=settings, now=start, receiver=receiver
            )
            self.sides.append(Side(pins, adapter))
            self.sides[-1].listen()
        #: When which wire has an edge, if the firmware waits for it; None where it samples on.
        self._edges: list[tuple[Nanos, str]] | None = [] if waits_for_edges else None
        if waits_for_edges:
            self.firmware.wait_for_edges()
        #: How many deadlines each has had where it has its own.
        self.deadlines = [0, 0]
        self.sip = StandardSip(sonar=(SonarReading(0, 5_000), SonarReading(3, 1_000)))

    @property
    def model(self) -> Adapter:
        adapter = self.sides[0].adapter
        assert isinstance(adapter, Adapter)
        return adapter

    @property
    def firmware(self) -> FirmwareAdapter:
        adapter = self.sides[1].adapter
        assert isinstance(adapter, FirmwareAdapter)
        return adapter

    def pin(self, name: str, high: bool, after: Nanos = 1) -> None:
        self._note_edge(self.now + after, name)
        for side in self.sides:
            side.pins.set(name, high, self.now + after)

    def motors(self, left: int, right: int, width: int = 3) -> None:
        self._note_edge(self.now + 1, "motors")
        for side in self.sides:
            side.pins.motors(left, right, self.now + 1, width)

    def receive(self, data: bytes) -> None:
        for side in self.sides:
            side.adapter.receive(data, self.now)

    def frame(self, payload: bytes) -> None:
        self.receive(Frame(payload).to_bytes())

    def pad(self, report: PadReport) -> None:
        for side in self.sides:
            side.adapter.receive_pad(report, self.now)

    def master(self, master: Master) -> None:
        for side in self.sides:
            side.adapter.set_master(master, self.now)

    def shutdown(self) -> None:
        for side in self.sides:
            side.adapter.shutdown("asked to", self.now)

    def send_sip(self, **changes: object) -> None:
        self.sip = replace(self.sip, **changes)
        self.frame(self.sip.to_frame(Profile.P2OS).payload)

    def go_before(self, at: Nanos) -> None:
        """Pass the time up to the last nanosecond before an instant; what comes next comes at the instant itself."""
        self.pass_time(at - 1 - self.now)
        self.now = at

    def pass_time(self, span: Nanos) -> None:
        """Advance both, each at its own deadlines, and compare."""
        until = self.now + span
        if self._edges is not None:
            self._pass_apart(until, self._edges)
            return
        while True:
            due = self.model.next_deadline()
            assert due == self.firmware.next_deadline()
            self.now = min(until, due if due is not None else until)
            for side in self.sides:
                side.adapter.advance_to(self.now)
            if self.now >= until:
                break
        self.compare()

    def _note_edge(self, at: Nanos, name: str) -> None:
        if self._edges is not None:
            self._edges.append((at, name))

    def _pass_apart(self, until: Nanos, edges: list[tuple[Nanos, str]]) -> None:
        to_come = sorted({edge for edge in edges if self.now < edge[0] < until})
        resets = [at for at, name in to_come if name == "rst"]
        for place, (side, stops) in enumerate(zip(self.sides, (resets, [at for at, _ in to_come]), strict=True)):
            for limit in (*stops, until):
                while (due := side.adapter.next_deadline()) is not None and due <= limit:
                    side.bring(due)
                    self.deadlines[place] += 1
                side.bring(limit)
        self.now = until
        self.compare()

    def answer(self) -> None:
        """Answer the last SYNC as a robot would."""
        last = self.sides[0].frames[-1] if self.sides[0].frames else b""
        kind = last[3] if len(last) == 6 else None
        if kind in {0, 1}:
            self.frame(bytes((kind,)))
        elif kind == 2:
            self.frame(Identity("Twin", "Pioneer", "p2dx").to_frame().payload)

    def compare(self) -> None:
        self.steps += 1
        one, other = self.sides
        for side in self.sides:
            side.collect()
        assert one.frames == other.frames, f"frames differ at {self.now} ns"
        assert one.pins.writes == other.pins.writes, f"pins differ at {self.now} ns"
        assert one.events == other.events, f"{one.events}\n{other.events}"
        model, firmware = self.model, self.firmware
        assert model.state == firmware.state
        assert (model.master, model.baud) == (firmware.master, firmware.baud)
        numbers, status = firmware.numbers, model.status
        assert (numbers["motor1"], numbers["motor2"]) == status.motors
        assert (numbers["left_count"], numbers["right_count"]) == status.counts
        assert (numbers["left_shown"], numbers["right_shown"]) == status.counts_shown
        assert (numbers["forward_mm_s"], numbers["turn_deg_s"]) == (
            status.speeds.forward_mm_s,
            status.speeds.turn_deg_s,
        )
        assert (numbers["sips"], numbers["jumps"]) == (status.sips, status.odometry_jumps)
        # Finer than the counts of them, so that no rounding hides a difference.
        assert (numbers["left_travel_nm"], numbers["right_travel_nm"]) == model._codes.encoders.travel_nm
        shown = list(model.outputs.levels.values())
        assert numbers["driven"] == sum((level is not None) << bit for bit, level in enumerate(shown))
        assert numbers["levels"] == sum(bool(level) << bit for bit, level in enumerate(shown))
        stats = model.session.stats
        assert [numbers[name] for name in WIRE_COUNTERS] == [getattr(stats.wire, name) for name in WIRE_COUNTERS]
        assert [numbers[name] for name in CLIENT_COUNTERS] == [getattr(stats, name) for name in CLIENT_COUNTERS]
        assert numbers["overflows"] == 0
        for side in self.sides:
            del side.frames[:-1], side.pins.writes[:], side.events[:]
