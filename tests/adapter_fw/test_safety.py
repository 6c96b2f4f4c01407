"""The safety rules, read off the wire and the pins, hold for the firmware as for the model.

The machines of tests/adapter_sim run here with the C++ core in the model's
place; a machine with a game pad, which changes masters, runs with both.
"""

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import initialize, invariant, rule

from adapter_sim import Adapter
from adapter_sim.masters import Master
from p2os.gamepad import PadReport
from robot_bench.adapter import FirmwareAdapter, is_available
from tests.adapter_sim.conftest import MS, Rig
from tests.adapter_sim.test_adapter_machine import AdapterMachine, DeafRobotMachine, WatchedRig

pytestmark = pytest.mark.skipif(not is_available(), reason="the firmware core is not built: no C++17 compiler")

#: 0.4 m/s; 1.7 rad/s are 97 deg/s.
PAD_MM_S, PAD_DEG_S = 400, 97


class FirmwareMachine(AdapterMachine):
    kind = FirmwareAdapter


class FirmwareDeafRobotMachine(DeafRobotMachine):
    kind = FirmwareAdapter


class PadRig(WatchedRig):
    """A rig whose robot is given to a pad and back; it knows whose speeds are being sent."""

    fastest = (PAD_MM_S, PAD_DEG_S)

    def __init__(self, robot: object, kind: type) -> None:
        super().__init__(robot, kind)
        self.pad_at = -(10**12)

    @property
    def is_awake(self) -> bool:
        return self.adapter.state not in {"reset", "booting"}

    def pad(self, **report: object) -> None:
        self.pad_at = self.now
        self.adapter.receive_pad(PadReport(**report), self.now)
        self.to_robot.send(self.adapter.take_output(), self.now)

    def check(self) -> None:
        super().check()
        # In reset and while it boots the adapter is no adapter: the robot's own watchdog counts then.
        if self.is_awake and self.adapter.master is Master.PAD and self.commanded != (0, 0):
            # 150 ms, a pair being sent (18.75 ms) and the STOP (6.25 ms).
            assert self.now - self.pad_at <= 150 * MS


class PadMachine(AdapterMachine):
    """The robot is commanded by a pad, or by the BluePill, never by both."""

    @initialize()
    def power(self) -> None:
        self.rig = PadRig(self.make_robot(), self.kind)
        self.rig.ms(310)
        self.rig.adapter.set_master(Master.PAD, self.rig.now)
        self.rig.pad()

    @rule(master=st.sampled_from(list(Master)))
    def give_to(self, master: Master) -> None:
        changes = master is not self.rig.adapter.master
        self.rig.adapter.set_master(master, self.rig.now)
        self.rig.to_robot.send(self.rig.adapter.take_output(), self.rig.now)
        if changes and self.rig.is_awake:
            self.rig.check()
            assert self.rig.commanded == (0, 0), "a change of masters stops the robot at once"

    @rule(count=st.integers(1, 30), forward=st.integers(0, 1023), turn=st.integers(-512, 511), up=st.booleans())
    def drive(self, count: int, forward: int, turn: int, up: bool) -> None:
        for number in range(count):
            self.rig.pad(up=up and number == 1, forward=forward, turn=turn)
            self.rig.ms(20)

    @rule()
    def release(self) -> None:
        self.rig.pad(down=True)
        self.rig.check()
        if self.rig.is_awake and self.rig.adapter.master is Master.PAD:
            assert self.rig.commanded == (0, 0)

    @invariant()
    def the_other_master_moves_nothing(self) -> None:
        rig = self.rig
        speeds = rig.adapter.status.speeds
        if rig.adapter.state == "driving" and rig.adapter.master is Master.BLUEPILL:
            assert abs(speeds.forward_mm_s) <= 250, "a speed that only the pad can ask for"


class FirmwarePadMachine(PadMachine):
    kind = FirmwareAdapter


MACHINES = {
    machine.__name__: machine for machine in (FirmwareMachine, FirmwareDeafRobotMachine, PadMachine, FirmwarePadMachine)
}
for machine in MACHINES.values():
    machine.TestCase.settings = settings(
        max_examples=12,
        stateful_step_count=25,
        suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
    )
TestFirmware = pytest.mark.slow(FirmwareMachine.TestCase)
TestFirmwareDeafRobot = FirmwareDeafRobotMachine.TestCase
TestPad = PadMachine.TestCase
TestFirmwarePad = pytest.mark.slow(FirmwarePadMachine.TestCase)


def driven_by_pad(kind: type) -> Rig:
    rig = Rig(kind=kind)
    rig.ms(310)
    rig.adapter.set_master(Master.PAD, rig.now)
    for number in range(60):
        rig.adapter.receive_pad(PadReport(up=number == 1, forward=1023), rig.now)
        rig.ms(20)
    assert rig.adapter.state == "driving", rig.events
    return rig


@pytest.mark.parametrize("kind", [Adapter, FirmwareAdapter])
def test_full_trigger_is_the_speed_of_the_thesis(kind: type) -> None:
    rig = driven_by_pad(kind)
    assert ("VEL", PAD_MM_S) in [(name, argument) for _, name, argument in rig.sent()]
    rig.adapter.receive_pad(PadReport(turn=511), rig.now)
    rig.ms(30)
    assert rig.adapter.status.speeds.turn_deg_s == -PAD_DEG_S


@pytest.mark.parametrize("kind", [Adapter, FirmwareAdapter])
@pytest.mark.parametrize("pause_ms", [148, 152])
def test_a_silent_pad_stops_the_robot_one_tick_after_150_ms_and_not_before(kind: type, pause_ms: int) -> None:
    rig = driven_by_pad(kind)
    rig.adapter.receive_pad(PadReport(forward=1023), rig.now)
    silent_at = rig.now
    rig.run(silent_at + pause_ms * MS)
    stops = [at for at, name, _ in rig.sent(silent_at) if name == "STOP"]
    assert stops == ([] if pause_ms == 148 else [silent_at + 150 * MS])
    assert (rig.adapter.state == "lost") is (pause_ms == 152) or rig.adapter.state == "idle"


@pytest.mark.parametrize("kind", [Adapter, FirmwareAdapter])
def test_after_a_lost_pad_only_a_new_up_moves_the_robot(kind: type) -> None:
    rig = driven_by_pad(kind)
    rig.ms(3_000)
    for _ in range(50):
        rig.adapter.receive_pad(PadReport(up=True, forward=1023), rig.now)
        rig.ms(20)
    assert rig.adapter.state == "idle", "Up has been held all along"
    rig.adapter.receive_pad(PadReport(), rig.now)
    rig.adapter.receive_pad(PadReport(up=True), rig.now)
    rig.ms(5)
    assert rig.adapter.state == "connecting"


@pytest.mark.parametrize("kind", [Adapter, FirmwareAdapter])
def test_the_pad_in_a_firmwares_hands_waits_for_p2dx_con_to_fall_and_rise(kind: type) -> None:
    rig = driven_by_pad(kind)
    rig.pins.set("p2dx_con", True, rig.now + 1)
    rig.pins.motors(3, 3, rig.now + 1)
    rig.ms(30)
    rig.adapter.set_master(Master.BLUEPILL, rig.now)
    rig.ms(2_000)
    assert rig.adapter.state == "lost"
    rig.pins.set("p2dx_con", False, rig.now + 1)
    rig.ms(30)
    rig.pins.set("p2dx_con", True, rig.now + 1)
    rig.ms(1_500)
    assert rig.adapter.state == "driving"
    assert rig.adapter.status.speeds.forward_mm_s == 188


@pytest.mark.parametrize("kind", [Adapter, FirmwareAdapter])
def test_a_shutdown_stops_the_robot_and_says_why(kind: type) -> None:
    rig = Rig(kind=kind)
    rig.connect()
    rig.adapter.shutdown("brown-out", rig.now)
    at = rig.now
    rig.ms(1)
    assert [name for _, name, _ in rig.sent(at)][:4] == ["STOP", "VEL", "RVEL", "CLOSE"]
    assert rig.adapter.status.reason.startswith("brown-out")
    assert rig.pins.distances() == "11111111"
