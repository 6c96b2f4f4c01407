"""How late the ESP32's program sees the robot's bytes, and how late its STOP is out, behind FIFO and driver."""

from dataclasses import replace
from pathlib import Path

import pytest

from p2os.protocol.profiles import Profile
from p2os.protocol.sip import SonarReading
from robot_bench.wires.board_test.esp32 import ROBOT
from tests.adapter_fw.builds import built
from tests.adapter_fw.shell import BAUD, US_PER_MS, Shell
from tests.adapter_sim.conftest import FakeRobot

#: The loop looks once a millisecond; what the driver has handed over it sees then.
PASS_US = 1_000
LIVENESS_US = 350_000
#: A pair of two nine-byte frames, and STOP's six, at 9600 baud.
PAIR_US, STOP_US = 18_750, 6_250
BYTE_US = 10 * 10**6 / BAUD


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built("esp32-rev_b", tmp_path_factory.mktemp("esp32"))[0]


@pytest.fixture
def driving(library: Path) -> Shell:
    shell = Shell(library, robot=FakeRobot())
    shell.connect()
    shell.run_ms(800)
    return shell


def sip(shell: Shell, *, is_near: bool) -> bytes:
    reading = SonarReading(2, 300 if is_near else 32_000)
    return replace(shell.robot.sip, sonar=(reading,)).to_frame(Profile.P2OS).to_bytes()


@pytest.mark.parametrize("phase_us", [0, 400, 999])
def test_a_sip_is_seen_in_the_pass_after_its_last_byte(driving: Shell, phase_us: int) -> None:
    driving.robot.sends = False
    driving.run_ms(120)
    assert not driving.driven()["DD3"]
    data = sip(driving, is_near=True)
    ends_us = [
        driving.esp32.now_us + PASS_US + phase_us + round(number * BYTE_US) for number in range(1, len(data) + 1)
    ]
    driving.esp32.receive(ROBOT, data, ends_us)
    while not driving.driven()["DD3"]:
        driving.run_ms(1)
    assert 0 <= driving.esp32.now_us - ends_us[-1] <= PASS_US


def test_sips_without_a_gap_are_seen_one_by_one(driving: Shell) -> None:
    driving.robot.sends = False
    driving.run_ms(120)
    frames = [sip(driving, is_near=number % 2 == 1) for number in range(8)]
    begin_us, count = driving.esp32.now_us + PASS_US, 0
    ends = []
    for frame in frames:
        times = [begin_us + round((count + number) * BYTE_US) for number in range(1, len(frame) + 1)]
        driving.esp32.receive(ROBOT, frame, times)
        count += len(frame)
        ends.append(times[-1])
    edges, level = [], driving.driven()["DD3"]
    while driving.esp32.now_us < ends[-1] + 150 * US_PER_MS:
        driving.run_ms(1)
        if driving.driven()["DD3"] is not level:
            level = not level
            edges.append(driving.esp32.now_us)
    assert len(edges) == len(frames) - 1, "the first is as it was"
    assert max(edge - end for edge, end in zip(edges, ends[1:], strict=True)) <= PASS_US


def stop_after_silence(shell: Shell, sips: int) -> int:
    """Drive with as many pairs as there can be, let the robot fall silent; return µs from its last byte to STOP's."""
    silent_ms = shell.now_ms + 220 + 100 * sips
    while shell.now_ms < silent_ms + 450:
        if shell.now_ms % 8 == 0:
            step = shell.now_ms // 8 % 3
            shell.drive(step + 1, 3 - step)
        shell.robot.sends = shell.now_ms < silent_ms
        shell.run_ms(1)
    silent_us = shell.answers[-1][0]
    return next(at for at, name in shell.commands if at > silent_us and name == "STOP") - silent_us


@pytest.mark.slow
def test_stop_is_out_375_ms_after_the_robots_last_byte_however_full_the_line(library: Path) -> None:
    """A pair each 32 ms and a SIP each 100: eight SIPs stand at every place between two pairs."""
    late = []
    for sips in range(8):
        shell = Shell(library, robot=FakeRobot())
        shell.connect()
        late.append(stop_after_silence(shell, sips))
    # Seen in the next pass; 350 ms; a pair of the pass before that, and STOP itself.
    assert max(late) <= PASS_US + LIVENESS_US + PAIR_US - PASS_US + STOP_US, late
    assert max(late) > LIVENESS_US + PAIR_US + STOP_US - 4_000, "not as full as it gets"
    assert min(late) >= LIVENESS_US + STOP_US


# As many as come in a millisecond, and the time-out of a byte, which its register rounds up to 16 bits.
@pytest.mark.parametrize(
    ("baud", "threshold"), [(9600, 1), (19200, 1), (38400, 3), (57600, 5), (115200, 11), (1_000_000, 64)]
)
def test_at_every_speed_a_byte_is_handed_over_within_a_pass(library: Path, baud: int, threshold: int) -> None:
    shell = Shell(library)
    shell.run_ms(310)
    shell.type(f"set baud0 {baud}")
    shell.type("restart", wait_ms=350)
    assert shell.esp32.state.baud[ROBOT] == baud
    shell.type("test on")
    begin_us = shell.esp32.now_us + 2 * PASS_US
    times = [begin_us + round(number * 10 * 10**6 / baud) for number in range(1, threshold + 1)]
    shell.esp32.receive(ROBOT, bytes(threshold), times)
    shell.esp32.run_until(times[-1] - 1)
    assert shell.esp32.handed_over(ROBOT) == 0
    shell.esp32.run_until(times[-1])
    assert shell.esp32.handed_over(ROBOT) == threshold
    shell.run_ms(10)
    if threshold > 1:
        before = shell.esp32.handed_over(ROBOT)
        ends_us = shell.esp32.now_us + 500
        shell.esp32.receive(ROBOT, b"x", [ends_us])
        out_us = ends_us + -(-16 * 10**6 // baud)
        shell.esp32.run_until(out_us - 1)
        assert shell.esp32.handed_over(ROBOT) == before
        shell.esp32.run_until(out_us)
        assert shell.esp32.handed_over(ROBOT) == before + 1
        assert out_us - ends_us <= PASS_US


def test_the_search_for_a_speed_takes_the_threshold_along(library: Path) -> None:
    shell = Shell(library)
    shell.run_ms(310)
    shell.type("set baud1 115200")
    shell.type("restart", wait_ms=350)
    shell.set("p2dx_con", True)
    while shell.esp32.state.baud[ROBOT] != 115_200:
        shell.run_ms(50)
    begin_us = shell.esp32.now_us
    shell.esp32.receive(ROBOT, bytes(11), [begin_us + 87 * number for number in range(1, 12)])
    shell.esp32.run_until(begin_us + 87 * 10)
    assert shell.esp32.handed_over(ROBOT) == 0
    shell.esp32.run_until(begin_us + 87 * 11)
    assert shell.esp32.handed_over(ROBOT) == 11
