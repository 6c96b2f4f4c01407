"""The firmware core and the model are the same machine: equal frames, pins, states and counters, step by step.

Each example is a life of some fifty steps; a step changes pins, brings bytes
(sound, damaged or noise), pad reports, a change of masters, a shutdown, a saved
and restored state, and lets time pass. Both are asked for their deadlines, too.
"""

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from adapter_sim import AdapterSettings
from adapter_sim.codec import BitOrder
from adapter_sim.masters import Master
from adapter_sim.pinout import parse_pinout
from adapter_sim.settings import EncoderAtOpen, MotorMeaning
from p2os.gamepad import PadReport
from p2os.protocol.frames import Frame
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import SonarReading
from robot_bench.adapter import is_available
from tests.adapter_fw.twins import MS, Twins
from tests.adapter_sim.conftest import four_bits

pytestmark = pytest.mark.skipif(not is_available(), reason="the firmware core is not built: no C++17 compiler")

WORDS = st.integers(0, 0xFFFF)
SIGNED = st.integers(-0x8000, 0x7FFF)
SPEEDS = st.integers(-400, 400)
TRIGGERS, STICKS = st.integers(0, 1023), st.integers(-512, 511)
PASSING = st.sampled_from(
    [1, 999_999, 2 * MS, 7 * MS, 25 * MS, 60 * MS, 99 * MS, 100 * MS, 240 * MS, 351 * MS, 1_100 * MS]
)
SONAR = st.lists(st.tuples(st.integers(0, 20), WORDS), max_size=4)
#: Weights: what keeps a session going comes often, what ends it seldom.
STEPS = st.one_of(
    st.tuples(st.just("motors"), st.integers(-4, 3), st.integers(-4, 3)),
    st.tuples(st.just("sips"), st.integers(1, 12), st.integers(-60, 60), SIGNED, SPEEDS, SPEEDS),
    st.tuples(st.just("sips"), st.integers(1, 12), st.integers(-60, 60), SIGNED, SPEEDS, SPEEDS),
    st.tuples(st.just("sip"), WORDS, WORDS, SIGNED, SIGNED, st.booleans(), SONAR),
    st.tuples(st.just("obey"), st.integers(1, 15)),
    st.tuples(st.just("noise"), st.binary(max_size=60)),
    st.tuples(st.just("damaged"), st.integers(0, 60), st.integers(1, 255)),
    st.tuples(st.just("frame"), st.sampled_from([0, 1, 2, 0x20, 0x90, 0xFE, 0xFF]), st.binary(max_size=8)),
    st.tuples(st.just("pin"), st.sampled_from(["p2dx_con", "motor1_comm1", "motor2_comm3"]), st.booleans()),
    st.tuples(st.just("glitch"), st.sampled_from(["p2dx_con", "motor1_comm2", "rst"]), st.sampled_from([1, 3, 9, 14])),
    st.tuples(st.just("time"), PASSING),
    st.tuples(st.just("connect"), st.booleans()),
    st.tuples(st.just("pad"), st.booleans(), st.booleans(), TRIGGERS, TRIGGERS, STICKS),
    st.tuples(st.just("drive by pad"), TRIGGERS, STICKS),
    st.tuples(st.just("master"), st.sampled_from(list(Master))),
    st.tuples(st.just("rare"), st.sampled_from(["shutdown", "reset", "restore", "half frame"])),
)  # fmt: skip
SETTINGS = st.builds(
    AdapterSettings,
    threshold_um=st.sampled_from([None, 600_000, 1_300_000]),
    bit_order=st.sampled_from(list(BitOrder)),
    motor_meaning=st.sampled_from(list(MotorMeaning)),
    step_um_per_s=st.sampled_from([62_500, 100_001, 250_000]),
    max_velocity_mm_s=st.sampled_from([None, 0, 150]),
    max_rotation_deg_s=st.sampled_from([None, 17]),
    sample_count=st.sampled_from([1, 3, 5, 9]),
    sample_period_ns=st.sampled_from([1 * MS, 2 * MS, 5 * MS]),
    encoder_at_open=st.sampled_from(list(EncoderAtOpen)),
    encoder_dwell_ns=st.sampled_from([0, 20 * MS]),
    stop_unknown_robot=st.booleans(),
    stop_repeats=st.sampled_from([0, 3]),
    bauds=st.sampled_from([(9_600,), (9_600, 38_400, 115_200)]),
)


class Life:
    """What a step does to both."""

    def __init__(self, adapter_settings: AdapterSettings, *, has_four_bits: bool) -> None:
        pinout = {"pinout": parse_pinout(four_bits())} if has_four_bits else {}
        self.twins = Twins(adapter_settings, **pinout)
        self.width = 4 if has_four_bits else 3
        self.twins.pass_time(310 * MS)

    def step(self, kind: str, *values: object) -> None:
        getattr(self, "_" + kind.replace(" ", "_"))(*values)
        self.twins.pass_time(1 * MS)

    def _motors(self, left: int, right: int) -> None:
        self.twins.motors(left, right, self.width)
        self.twins.pass_time(12 * MS)

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

    def _connect(self, in_peace: bool) -> None:
        """All the way to driving, unless something is in the way."""
        self.twins.pin("rst", False)
        if in_peace:
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
        self.twins.send_sip(raw_x=0, raw_y=0, raw_heading=0, raw_left_velocity=0, raw_right_velocity=0)
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


def live(steps: list[tuple[object, ...]], adapter_settings: AdapterSettings, *, has_four_bits: bool) -> int:
    life = Life(adapter_settings, has_four_bits=has_four_bits)
    for kind, *values in steps:
        life.step(str(kind), *values)
    return life.twins.steps


LIVES = given(st.lists(STEPS, min_size=30, max_size=60), SETTINGS, st.booleans())
QUIET = [HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.large_base_example]


@pytest.mark.slow
@settings(max_examples=12, deadline=None, suppress_health_check=QUIET)
@LIVES
def test_firmware_and_model_do_the_same_in_any_life(steps: list, adapter_settings: AdapterSettings, four: bool) -> None:
    live(steps, adapter_settings, has_four_bits=four)


@pytest.mark.slow
@settings(max_examples=115, deadline=None, suppress_health_check=QUIET)
@LIVES
def test_firmware_and_model_do_the_same_over_five_thousand_steps(
    steps: list, adapter_settings: AdapterSettings, four: bool
) -> None:
    live(steps, adapter_settings, has_four_bits=four)


@pytest.mark.soak
@settings(max_examples=2_500, deadline=None, suppress_health_check=QUIET)
@LIVES
def test_firmware_and_model_do_the_same_in_thousands_of_lives(
    steps: list, adapter_settings: AdapterSettings, four: bool
) -> None:
    live(steps, adapter_settings, has_four_bits=four)
