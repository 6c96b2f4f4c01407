"""What may be done to model and firmware alike, step by step; who chooses the steps stands elsewhere."""

from adapter_sim import AdapterSettings
from adapter_sim.masters import Master
from adapter_sim.pinout import parse_pinout
from p2os.gamepad import PadReport
from p2os.protocol.frames import Frame
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import SonarReading
from simbase.timing import Nanos
from tests.adapter_fw.twins import MS, Twins
from tests.adapter_sim.conftest import four_bits


def _with_four_bits() -> str:
    """Return a pinout of four bits, whose left wheel shows another code than 0 while nobody drives it."""
    before, name, behind = four_bits().replace("safe = 1", "safe = 0", 1).partition('name = "encoder1_s1"')
    return before + name + behind.replace('pull = "down"\nidle = 0', 'pull = "up"\nidle = 1', 1)


class Sequence:
    """What a step does to both."""

    def __init__(
        self, adapter_settings: AdapterSettings, *, has_four_bits: bool, robot: str = "p2dx", start: Nanos = 0,
        waits_for_edges: bool = False, has_uart: bool = False,
    ) -> None:  # fmt: skip
        pinout = {"pinout": parse_pinout(_with_four_bits())} if has_four_bits else {}
        self.twins = Twins(
            adapter_settings, robot=robot, start=start, waits_for_edges=waits_for_edges, has_uart=has_uart, **pinout
        )
        self.width = 4 if has_four_bits else 3
        #: Whether both do what was due before they take what comes: a UART keeps it for them.
        self._may_be_late = not waits_for_edges and not has_uart
        #: Of the robot when it is found to stand at its origin.
        self.rim_speed = 0
        self.twins.pass_time(310 * MS)

    def step(self, kind: str, *values: object) -> None:
        getattr(self, "_" + kind.replace(" ", "_"))(*values)
        self.twins.pass_time(1 * MS)

    def _motors(self, left: int, right: int) -> None:
        self.twins.motors(left, right, self.width)
        self.twins.pass_time(12 * MS)

    def _pwm(self, number: int, period: Nanos, high: Nanos, turns: int, backward: bool) -> None:
        """Whole periods on a wheel's first wire, and a part of one more."""
        self.twins.pin(f"motor{number}_comm{self.width}", backward)
        for turn in range(turns):
            self.twins.pin(f"motor{number}_comm1", True, 1 + turn * period)
            self.twins.pin(f"motor{number}_comm1", False, 1 + turn * period + high)
        self.twins.pass_time(turns * period - high)

    def _sips(self, count: int, dx: int, heading: int, left: int, right: int) -> None:
        for number in range(count):
            sip = self.twins.sip
            self.twins.send_sip(
                raw_x=(sip.raw_x + dx) % 0x8000,
                raw_heading=heading // 16 + number * 3,
                raw_left_velocity=left,
                raw_right_velocity=right,
            )
            self.twins.pass_time(100 * MS)

    def _sip(self, x: int, y: int, heading: int, speed: int, stall: bool, sonar: list[tuple[int, int]]) -> None:
        self.twins.send_sip(
            raw_x=x, raw_y=y, raw_heading=heading, raw_left_velocity=speed, stall_left=stall,
            sonar=tuple(SonarReading(*reading) for reading in sonar),
        )  # fmt: skip

    def _obey(self, count: int) -> None:
        """SIPs of a robot that does what it was told."""
        for _ in range(count):
            speeds = self.twins.model.status.speeds
            self.twins.send_sip(raw_left_velocity=speeds.forward_mm_s, raw_right_velocity=speeds.forward_mm_s)
            self.twins.pass_time(100 * MS)

    def _noise(self, data: bytes) -> None:
        self.twins.receive(data)

    def _damaged(self, place: int, flip: int) -> None:
        data = bytearray(self.twins.sip.to_frame(Profile.P2OS).to_bytes())
        data[place % len(data)] ^= flip
        self.twins.receive(bytes(data))

    def _frame(self, kind: int, data: bytes) -> None:
        self.twins.frame(bytes((kind,)) + data)

    def _pin(self, name: str, high: bool) -> None:
        self.twins.pin(name, high)

    def _glitch(self, name: str, span_ms: int) -> None:
        level = self.twins.sides[0].pins.read(name, self.twins.now)
        self.twins.pin(name, not level)
        self.twins.pin(name, level, span_ms * MS)
        self.twins.pass_time(20 * MS)

    def _time(self, span: int) -> None:
        self.twins.pass_time(span)

    def _connect(self, on_request: bool) -> None:
        """All the way to driving, unless something is in the way."""
        self.twins.pin("rst", False)
        if on_request:
            self.twins.pin("p2dx_con", False)
            self.twins.pass_time(400 * MS)
        self.twins.master(Master.BLUEPILL)
        self.twins.pin("p2dx_con", True)
        self.twins.pass_time(420 * MS)
        self._handshake()

    def _handshake(self) -> None:
        for _ in range(3):
            self.twins.answer()
            self.twins.pass_time(40 * MS)
        self.twins.pass_time(70 * MS)
        speed = self.rim_speed
        self.twins.send_sip(raw_x=0, raw_y=0, raw_heading=0, raw_left_velocity=speed, raw_right_velocity=speed)
        self.twins.pass_time(60 * MS)

    def _pad(self, up: bool, down: bool, forward: int, backward: int, turn: int) -> None:
        self.twins.pad(PadReport(up=up, down=down, forward=forward, backward=backward, turn=turn))

    def _drive_by_pad(self, forward: int, turn: int) -> None:
        self.twins.master(Master.PAD)
        for up in (False, True, *(False,) * 12):
            self.twins.pad(PadReport(up=up, forward=forward, turn=turn))
            self.twins.answer()
            self.twins.pass_time(40 * MS)
        self._obey(1)

    def _master(self, master: Master) -> None:
        self.twins.master(master)

    def _late(self, what: str, after: Nanos) -> None:
        """Do something at or behind a deadline to which nobody has brought either."""
        twins, due = self.twins, self.twins.model.next_deadline()
        if due is not None and self._may_be_late:
            twins.now = max(twins.now, due + after)
        if what == "sip":
            twins.send_sip()
        elif what == "answer":
            twins.answer()
        elif what == "pad":
            twins.pad(PadReport(up=after == 1, down=after == 2, forward=600))
        elif what == "master":
            twins.master(Master.PAD if twins.model.master is Master.BLUEPILL else Master.BLUEPILL)
        else:
            twins.shutdown()

    def _rare(self, what: str) -> None:
        if what == "shutdown":
            self.twins.shutdown()
        elif what == "reset":
            self._glitch("rst", 14)
            self.twins.pass_time(310 * MS)
        elif what == "restore":
            saved = [side.adapter.snapshot() for side in self.twins.sides]
            now, before = self.twins.now, self.twins.model.state
            self.twins.pass_time(500 * MS)
            self.twins.now = now
            for side, state in zip(self.twins.sides, saved, strict=True):
                side.adapter.restore(state)
            assert self.twins.model.state == self.twins.firmware.state == before
        else:
            self.twins.receive(Frame(b"\x32" + bytes(40)).to_bytes()[:17])
