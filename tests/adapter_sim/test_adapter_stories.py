"""Whole stories of the adapter: every edge, frame and event of some sessions, with its time."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from adapter_sim.codec import BitOrder
from adapter_sim.masters import Master
from adapter_sim.settings import AdapterSettings, EncoderAtOpen, MotorCommand, MotorMeaning
from p2os.gamepad import PadReport
from p2os.protocol.sip import SonarReading
from tests.adapter_sim.conftest import MS, FakeRobot, Rig
from tests.tools.suite.golden import kept_in

is_as_kept = kept_in("adapter")


def drives(rig: Rig, robot: FakeRobot) -> None:
    """Every speed of both wheels, things near and far, wheels that roll, and an end."""
    rig.connect()
    for step, (left, right) in enumerate(((1, 1), (3, 3), (-4, -4), (3, -4), (-1, 2), (0, 0), (2, 2))):
        rig.pins.motors(left, right, rig.now)
        near = tuple(SonarReading(number, 599 + number + step) for number in range(step, step + 2))
        robot.sip = replace(robot.sip, sonar=near, raw_x=40 * step * step, raw_y=7 * step, raw_heading=300 * step)
        rig.ms(170)
    rig.pins.motors(1, 1, rig.now)
    rig.ms(8)
    rig.pins.motors(2, 2, rig.now)  # too short to be taken
    rig.ms(2)
    rig.pins.motors(1, 1, rig.now)
    rig.ms(1_200)
    rig.pins.set("p2dx_con", False, rig.now)
    rig.ms(1_200)


def loses(rig: Rig, robot: FakeRobot) -> None:
    """A robot that does what it was not told, one that is silent, a cut line, and resets."""
    rig.connect()
    rig.pins.motors(3, 3, rig.now)
    robot.obeys = False
    robot.sip = replace(robot.sip, raw_left_velocity=-300, raw_right_velocity=300)
    rig.ms(1_500)
    robot.obeys = True
    rig.pins.set("p2dx_con", False, rig.now)
    rig.ms(60)
    rig.pins.set("p2dx_con", True, rig.now)
    rig.ms(1_500)
    robot.sends = False
    rig.ms(1_500)
    rig.pins.set("rst", True, rig.now)
    rig.ms(5)
    rig.pins.set("rst", False, rig.now)
    robot.sends = True
    rig.ms(1_400)
    rig.to_robot.cut = True
    rig.ms(3_500)


def padded(rig: Rig, robot: FakeRobot) -> None:
    """A game pad that takes over, drives, is lost, and gives back."""
    rig.connect()
    rig.adapter.set_master(Master.PAD, rig.now)
    rig.ms(300)
    reports = [PadReport(), PadReport(up=True), PadReport(forward=1023), PadReport(forward=500, turn=-512),
               PadReport(turn=300), PadReport(backward=1023, turn=511), PadReport(forward=40, turn=30),
               PadReport(forward=30, backward=900), PadReport(down=True, up=True), PadReport(), PadReport(up=True),
               PadReport(forward=700)]  # fmt: skip
    for report in reports:
        for _ in range(20):
            rig.adapter.receive_pad(report, rig.now)
            rig.ms(20)
    rig.ms(900)
    rig.adapter.set_master(Master.BLUEPILL, rig.now)
    rig.ms(200)
    rig.adapter.shutdown("the battery is low", rig.now)
    rig.ms(200)


def by_duty(rig: Rig, robot: FakeRobot) -> None:
    """Pulses of several widths and both signs for a forward speed and a turn."""
    rig.ms(300)
    rig.pins.set("p2dx_con", True, rig.now)
    for high_us, is_back in ((250, False), (500, True), (1000, False), (0, True), (730, True)):
        for name in ("motor1", "motor2"):
            rig.pins.set(f"{name}_comm3", is_back, rig.now)
        for _ in range(300):
            for name in ("motor1", "motor2"):
                if high_us:
                    rig.pins.set(f"{name}_comm1", True, rig.now)
                rig.pins.set(f"{name}_comm1", high_us == 1000, rig.now + high_us * 1000)
            rig.ms(1)
    rig.ms(300)


def searches(rig: Rig, robot: FakeRobot) -> None:
    """Nobody answers at any line speed."""
    rig.to_robot.cut = True
    rig.ms(310)
    rig.pins.set("p2dx_con", True, rig.now)
    for _ in range(12):
        rig.ms(1_000)
        rig.events.append((rig.now, "speed", f"{rig.adapter.baud} bit/s"))


STORY_ROWS: dict[str, tuple[Callable[[Rig, FakeRobot], None], AdapterSettings]] = {
    "drives": (drives, AdapterSettings(threshold_um=603_000)),
    "drives-otherwise": (drives, AdapterSettings(
        bit_order=BitOrder.COMM1_MSB, motor_meaning=MotorMeaning.LINEAR_ANGULAR, max_velocity_mm_s=150,
        max_rotation_deg_s=40, encoder_at_open=EncoderAtOpen.ZERO, encoder_dwell_ns=3 * MS, sample_count=3,
        stop_unknown_robot=False, stop_repeats=1,
    )),
    "loses": (loses, AdapterSettings()),
    "pad": (padded, AdapterSettings()),
    "duty": (by_duty, AdapterSettings(motor_command=MotorCommand.DUTY, motor_meaning=MotorMeaning.LINEAR_ANGULAR)),
    "searches": (searches, AdapterSettings(bauds=(9600, 19_200, 38_400))),
}  # fmt: skip


def story_text(name: str) -> str:
    """Return a story: what the adapter did at which time, in the order of times, and what it knows in the end."""
    story, settings = STORY_ROWS[name]
    robot = FakeRobot()
    rig = Rig(settings, robot)
    story(rig, robot)
    lines = [(at, 0, f"{what}: {detail}") for at, what, detail in rig.events]
    lines += [(at, 1, f"{wire} {'released' if level is None else int(level)}") for at, wire, level in rig.pins.writes]
    lines += [(at, 2, data.hex()) for at, data in rig.to_robot.log]
    rows = [f"{at / MS:.6f} {text}" for at, _, text in sorted(lines, key=lambda line: line[:2])]
    return "\n".join([*rows, str(rig.adapter.status).replace(", ", ",\n  ")]) + "\n"


@pytest.mark.parametrize("name", STORY_ROWS)
def test_a_story_goes_as_it_went(name: str) -> None:
    assert is_as_kept(story_text(name).splitlines(), name)
