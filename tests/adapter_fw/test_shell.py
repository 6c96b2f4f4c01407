"""The ESP32's whole program on simulated pins, UARTs, NVS and watchdog: what main.cpp wires, and what resets do."""

from dataclasses import replace
from pathlib import Path
from random import Random

import pytest

from adapter_sim.duty import DUTY_TIMEOUT_NS, DutyMeter
from adapter_sim.pinout import WireDirection, WireRole
from robot_bench.wires.board_test.esp32 import CONSOLE, NvsFault, ResetReason
from tests.adapter_fw.builds import built
from tests.adapter_fw.shell import PINOUT, Shell, pad_of
from tests.adapter_sim.conftest import FakeRobot

#: Of app::EventLog, app::ModeButton, app::Runner and sdkconfig.defaults.
KEPT_EVENTS, HOLD_MS, GAP_MS, WATCHDOG_MS = 32, 50, 350, 1000
BOOT_MS = 300


@pytest.fixture(scope="module", params=["esp32-rev_b", "esp32-rev_c"])
def any_library(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    name: str = request.param
    return built(name, tmp_path_factory.mktemp(name))[0], name.removeprefix("esp32-").replace("_", "-")


@pytest.fixture
def any_board(any_library: tuple[Path, str]) -> Shell:
    return Shell(*any_library)


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built("esp32-rev_b", tmp_path_factory.mktemp("esp32"))[0]


@pytest.fixture(scope="module")
def pad_library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built("esp32-rev_b-pad", tmp_path_factory.mktemp("esp32-pad"))[0]


@pytest.fixture
def shell(library: Path) -> Shell:
    return Shell(library)


@pytest.fixture
def driving(library: Path) -> Shell:
    shell = Shell(library, robot=FakeRobot())
    shell.connect()
    return shell


def test_each_wire_stands_on_its_pad_and_nothing_else_is_driven(any_board: Shell) -> None:
    shell = any_board
    shell.run_ms(BOOT_MS + 10)
    assert "test on" in shell.type("test on")
    outputs = [wire for wire in PINOUT.wires if wire.direction is WireDirection.TO_BLUEPILL]
    inputs = [wire for wire in PINOUT.wires if wire.direction is not WireDirection.TO_BLUEPILL]
    for bit, wire in enumerate(outputs):
        shell.type(f"wires {1 << bit:x} {1 << bit:x}", wait_ms=6)
        levels = shell.driven()
        assert levels[wire.name]
        own_pads = [name for name in levels if pad_of(name, shell.revision) is not None]
        assert set(own_pads) - {wire.name} == set(), "another pad is driven too"
        shell.type(f"wires {1 << bit:x} 0", wait_ms=6)
        assert not shell.driven()[wire.name]
    shell.type("wires 0 0", wait_ms=6)
    for bit, wire in enumerate(inputs):
        if wire.role is not WireRole.RESET:
            shell.set(wire.name, True)
            assert f"wires in {1 << bit:08x} out" in shell.type("wires", wait_ms=8)
            shell.set(wire.name, False)


def test_wires_follow_their_pulls_until_the_boot_is_over(any_board: Shell) -> None:
    shell = any_board
    said = shell.run_ms(BOOT_MS - 1)
    assert said.startswith(f"P2OS adapter 0.2.0, board {shell.revision}; type help\n")
    assert shell.driven() == {}
    assert shell.esp32.state.inputs >> 36 & 1, "the motor wires are read"
    shell.run_ms(3)
    assert {name: level for name, level in shell.driven().items() if name.startswith("DD")} == dict.fromkeys(
        (f"DD{number}" for number in range(1, 9)), True
    )


@pytest.mark.parametrize("is_fitted", [False, True])
def test_the_jumper_chooses_the_master_and_its_pin_is_a_wire_afterwards(library: Path, is_fitted: bool) -> None:
    shell = Shell(library)
    shell.set("mode_jumper", is_fitted)
    shell.run_ms(BOOT_MS + 10)
    assert f"master {'pad' if is_fitted else 'bluepill'}" in shell.type("status")
    assert "DD7" in shell.driven()
    assert not shell.esp32.state.pulled_down, "the jumper's pull is off again"


def test_the_button_counts_when_it_was_held_long_enough(shell: Shell) -> None:
    shell.run_ms(BOOT_MS + 10)
    for span_ms, said in ((HOLD_MS - 1, ""), (HOLD_MS + 2, " master: pad"), (HOLD_MS + 2, " master: bluepill")):
        shell.set("mode_button", False)
        words = shell.run_ms(span_ms)
        shell.set("mode_button", True)
        words += shell.run_ms(20)
        assert said in words
        assert bool(said) == (" master: " in words)


def test_a_button_that_is_held_from_the_start_on_does_not_count(shell: Shell) -> None:
    shell.set("mode_button", False)
    assert " master: " not in shell.run_ms(BOOT_MS + 10 * HOLD_MS)


def test_a_setting_lies_in_flash_under_a_short_name_and_comes_with_the_restart(shell: Shell) -> None:
    shell.run_ms(BOOT_MS + 10)
    assert "ok, in force after restart" in shell.type("set pulse_ns 400000000")
    ((space, name),) = [key for key, value in shell.esp32.nvs.items() if value == 400_000_000]
    assert (space, len(name), name[0]) == ("adapter", 9, "s")
    shell.type("restart", wait_ms=50)
    assert shell.esp32.starts == [ResetReason.POWER, ResetReason.RESTART]
    assert "pulse_ns = 400000000" in shell.type("get pulse_ns")
    assert "started by restart" in shell.type("test on")
    shell.esp32.power_off()
    shell.run_ms(5)
    shell.esp32.power_on()
    shell.run_ms(20)
    assert "pulse_ns = 400000000" in shell.type("get pulse_ns")
    shell.type("reset pulse_ns")
    assert (space, name) not in shell.esp32.nvs


def test_every_setting_has_a_name_in_flash_of_its_own(shell: Shell) -> None:
    shell.run_ms(BOOT_MS + 10)
    for line in shell.type("get", wait_ms=300).strip().splitlines():
        name, value = line.split(" = ")
        assert "ok" in shell.type(f"set {name} {value}", wait_ms=12)
    assert len(shell.esp32.nvs) == len(shell.type("get", wait_ms=300).strip().splitlines())


@pytest.mark.parametrize("place", [0, -1], ids=["first", "last"])
def test_the_first_and_the_last_setting_come_back_too(shell: Shell, place: int) -> None:
    shell.run_ms(BOOT_MS + 10)
    name = shell.type("get", wait_ms=300).strip().splitlines()[place].split(" = ")[0]
    assert "ok" in shell.type(f"set {name} 9601")
    shell.type("restart", wait_ms=50)
    assert f"{name} = 9601" in shell.type(f"get {name}")


def test_a_full_flash_is_said_and_one_of_another_layout_is_begun_anew(library: Path) -> None:
    shell = Shell(library)
    shell.run_ms(20)
    shell.esp32.state.nvs_fault = NvsFault.FULL
    assert "error: it could not be stored" in shell.type("set pulse_ns 400000000")
    shell.esp32.state.nvs_fault = NvsFault.SOUND
    assert "ok" in shell.type("set pulse_ns 400000000")
    shell.esp32.power_off()
    shell.esp32.nvs_fault = NvsFault.OLD_LAYOUT
    shell.esp32.power_on()
    assert "P2OS adapter" in shell.run_ms(20)
    assert shell.esp32.nvs == {}
    assert "pulse_ns = 500000000" in shell.type("get pulse_ns")


def test_settings_with_a_fault_are_left_out_aloud(library: Path) -> None:
    shell = Shell(library)
    shell.run_ms(20)
    shell.type("set refresh_ns 30000000")
    ((key, _),) = [row for row in shell.esp32.nvs.items() if row[1] == 30_000_000]
    shell.esp32.power_off()
    shell.esp32.nvs[key] = 5
    shell.esp32.power_on()
    assert shell.run_ms(20).startswith("stored settings are left out: a time that comes round is too short")


def test_the_log_keeps_the_last_events_oldest_first(shell: Shell) -> None:
    shell.run_ms(BOOT_MS + 10)
    masters = ["pad", "bluepill"] * KEPT_EVENTS
    for master in masters[: KEPT_EVENTS + 3]:
        shell.type(f"master {master}", wait_ms=30)
    kept = shell.type("log", wait_ms=400).strip().splitlines()
    assert len(kept) == KEPT_EVENTS
    times = [int(line.split(" ")[0]) for line in kept]
    assert times == sorted(times)
    assert "booted" not in "\n".join(kept), "the oldest went first"
    assert all(line in shell.text for line in kept), "what is kept was printed when it happened"


def test_the_robot_is_driven_by_the_wires_and_its_wheels_come_back(driving: Shell) -> None:
    driving.drive(3, 3)
    driving.run_ms(600)
    assert (driving.robot.forward, driving.robot.turn) == (188, 0), "3 steps of 62.5 mm/s"
    turn_wheels(driving)
    assert driving.esp32.state.baud[2] == 9600
    assert (driving.esp32.state.tx_pin[2], driving.esp32.state.rx_pin[2]) == (17, 16)


def test_reset_by_en_lets_go_of_every_wire_and_stop_is_first_afterwards(driving: Shell) -> None:
    driving.drive(2, 2)
    driving.run_ms(300)
    driving.esp32.power_off()
    driving.run_ms(20)
    assert driving.driven() == {}
    before = len(driving.commands)
    driving.set("p2dx_con", False)
    driving.esp32.power_on()
    driving.run_ms(BOOT_MS + 200)
    driving.set("p2dx_con", True)
    driving.run_ms(400)
    assert driving.commands[before][1] == "STOP"


def turn_wheels(shell: Shell) -> int:
    """Let the robot report a step of more than a code and less than two; return the ms at which it shows."""
    before = shell.code(1)
    shell.robot.sip = replace(shell.robot.sip, raw_x=shell.robot.sip.raw_x + 120)
    while shell.code(1) == before:
        shell.run_ms(1)
    assert shell.code(1) == (before + 1) % 8
    return shell.now_ms


def stood_still(shell: Shell, until_ms: int) -> int:
    shell.run_ms(until_ms - shell.now_ms)
    return shell.code(1)


# CodeKeeper writes flash in the first pass that comes a whole second after the wheels' last step.
@pytest.mark.parametrize(("stands_ms", "is_kept"), [(999, False), (1000, True), (1001, True)])
def test_codes_outlive_en_when_the_wheels_had_stood_for_a_second(driving: Shell, stands_ms: int, is_kept: bool) -> None:
    moved = stood_still(driving, turn_wheels(driving) + stands_ms)
    driving.esp32.power_off()
    driving.set("p2dx_con", False)
    driving.esp32.power_on()
    driving.run_ms(BOOT_MS + 10)
    assert moved != 0
    assert (driving.code(1) == moved) is is_kept


@pytest.mark.parametrize("reason", [ResetReason.RESTART, ResetReason.WATCHDOG])
def test_codes_outlive_what_leaves_power_on_at_once(driving: Shell, reason: ResetReason) -> None:
    turn_wheels(driving)
    moved = driving.code(1)
    driving.set("p2dx_con", False)
    if reason is ResetReason.RESTART:
        driving.esp32.receive(CONSOLE, b"restart\r")
    else:
        driving.esp32.state.stall_us = 2_000_000
        driving.run_ms(WATCHDOG_MS + 10)
    driving.run_ms(BOOT_MS + 250)
    assert driving.esp32.starts == [ResetReason.POWER, reason]
    assert driving.code(1) == moved


@pytest.mark.parametrize(("stall_ms", "resets"), [(WATCHDOG_MS - 2, False), (WATCHDOG_MS + 2, True)])
def test_a_task_that_hangs_for_a_second_is_reset_by_the_watchdog(shell: Shell, stall_ms: int, resets: bool) -> None:
    shell.run_ms(BOOT_MS + 10)
    shell.esp32.state.stall_us = stall_ms * 1000
    shell.run_ms(stall_ms + 50)
    assert (shell.esp32.starts[1:] == [ResetReason.WATCHDOG]) is resets


# The task sleeps to the next millisecond; the adapter was due at its next sample, a millisecond later.
@pytest.mark.parametrize(("stall_ms", "pauses"), [(GAP_MS, False), (GAP_MS + 1, False), (GAP_MS + 2, True)])
def test_after_a_gap_stop_is_first_and_the_robot_stands(driving: Shell, stall_ms: int, pauses: bool) -> None:
    driving.drive(2, 2)
    driving.run_ms(400)
    driving.esp32.state.stall_us = stall_ms * 1000
    before = len(driving.commands)
    said = driving.run_ms(stall_ms + 200)
    # What was in the transmitter when the task began to hang goes out of itself.
    came = [name for at, name in driving.commands[before:] if name != "PULSE"]
    assert ("lost: the program paused" in said) is pauses
    if pauses:
        assert came[0] == "STOP"
        assert driving.robot.forward == 0


def test_a_restart_waits_until_the_robot_was_told(driving: Shell) -> None:
    driving.drive(2, 2)
    driving.run_ms(400)
    before = len(driving.commands)
    driving.type("restart", wait_ms=100)
    assert [name for _, name in driving.commands[before:]][:4] == ["STOP", "VEL", "RVEL", "CLOSE"]
    assert driving.esp32.starts == [ResetReason.POWER, ResetReason.RESTART]
    assert driving.robot.forward == 0


def test_a_console_that_nobody_reads_fast_enough_keeps_no_frame_back(driving: Shell) -> None:
    """Twenty times `get` is 15 KB, the ring has 8: what does not fit is left out, and the robot is served."""
    for _ in range(20):
        driving.esp32.receive(CONSOLE, b"get\r")
        driving.run_ms(2)
    before = len(driving.commands)
    said = driving.run_ms(1500)
    assert 4_000 < len(said) < 12_000
    assert "lost" not in said
    assert len([name for _, name in driving.commands[before:] if name == "VEL"]) >= 6, "one each 200 ms"


# Twice 120 bytes are in the ring of 256, the third 120 wait for room in it, the FIFO holds 128: one more empties it.
@pytest.mark.parametrize(("size", "lost"), [(488, 0), (489, 129)])
def test_more_than_the_receiver_holds_is_lost_and_the_console_goes_on(shell: Shell, size: int, lost: int) -> None:
    shell.run_ms(BOOT_MS + 10)
    shell.esp32.state.stall_us = 60_000
    shell.esp32.receive(CONSOLE, b"x" * size)
    shell.run_ms(80)
    assert shell.esp32.state.lost[CONSOLE] == lost
    assert "error: the line is longer than 79 characters" in shell.type("")
    assert "P2OS adapter" in shell.type("version")


@pytest.mark.parametrize(("length", "is_taken"), [(79, True), (80, False)])
def test_a_line_has_79_characters_at_most(shell: Shell, length: int, is_taken: bool) -> None:
    shell.run_ms(BOOT_MS + 10)
    said = shell.type("get pulse_ns".ljust(length))
    assert ("pulse_ns" in said, "error: the line is longer than 79 characters" in said) == (is_taken, not is_taken)


def test_another_line_speed_is_tried_when_nobody_answers(shell: Shell) -> None:
    shell.run_ms(BOOT_MS + 10)
    shell.type("set baud1 38400")
    shell.type("restart", wait_ms=BOOT_MS + 50)
    shell.set("p2dx_con", True)
    bauds = set()
    for _ in range(200):
        shell.run_ms(100)
        bauds.add(shell.esp32.state.baud[2])
    assert bauds == {9600, 38400}


def test_the_task_has_the_stack_that_it_needs(driving: Shell) -> None:
    """Frames of a PC are no smaller than the ESP32's, but for windows; main.cpp's number has room for three times."""
    driving.type("get", wait_ms=200)
    driving.type("log", wait_ms=200)
    assert driving.esp32.state.stack_bytes == 12_288
    assert driving.esp32.stack_used < driving.esp32.state.stack_bytes


OURS, STRANGERS = 0xA0B1C2D3E4F5, 0xA0B1C2D3E4F6


@pytest.fixture
def paired(pad_library: Path) -> Shell:
    """A robot that a paired pad may drive."""
    shell = Shell(pad_library, robot=FakeRobot())
    shell.run_ms(BOOT_MS + 10)
    assert "ok, for 30 s" in shell.type("pad pair")
    assert shell.esp32.connect_pad(OURS)
    shell.type("master pad")
    return shell


def drive_by_pad(shell: Shell) -> None:
    for up in (False, True):
        shell.esp32.pad(up=up)
        shell.run_ms(50)
    for _ in range(30):
        shell.esp32.pad(forward=1023)
        shell.run_ms(50)


def test_a_pad_drives_and_its_silence_stops(paired: Shell) -> None:
    drive_by_pad(paired)
    assert paired.robot.forward > 0
    said = paired.run_ms(400)
    assert "pad lost" in said
    assert paired.robot.forward == 0
    assert "forward 1023" in paired.type("pad")


# 150 ms of silence (pad_loss_ns), a pass, a pair on the line (18.75 ms) and STOP (6.25 ms).
def test_a_pad_that_goes_away_stops_the_robot_and_drives_on_only_after_a_new_up(paired: Shell) -> None:
    drive_by_pad(paired)
    gone_us = paired.esp32.now_us
    paired.esp32.disconnect_pad()
    paired.run_ms(300)
    stop_us = next(at for at, name in paired.commands if at > gone_us - 50_000 and name == "STOP")
    assert stop_us - (gone_us - 50_000) <= 150_000 + 1_000 + 18_750 + 6_250
    assert paired.esp32.connect_pad(OURS), "it is known"
    for _ in range(30):
        paired.esp32.pad(forward=1023)
        paired.run_ms(50)
    assert paired.robot.forward == 0
    drive_by_pad(paired)
    assert paired.robot.forward > 0


@pytest.mark.parametrize("is_found", [True, False])
def test_only_the_pad_that_was_paired_is_obeyed_also_after_a_power_cut(paired: Shell, is_found: bool) -> None:
    paired.esp32.disconnect_pad()
    assert not paired.esp32.connect_pad(STRANGERS, is_found=is_found)
    assert not paired.esp32.pad(up=True)
    paired.esp32.power_off()
    paired.run_ms(5)
    paired.esp32.power_on()
    paired.run_ms(BOOT_MS + 10)
    assert not paired.esp32.connect_pad(STRANGERS, is_found=is_found)
    assert paired.esp32.connect_pad(OURS, is_found=is_found)
    assert "pad 0" in paired.type("pad")


def test_no_pad_is_obeyed_before_one_was_paired(pad_library: Path) -> None:
    shell = Shell(pad_library)
    shell.run_ms(BOOT_MS + 10)
    assert not shell.esp32.connect_pad(OURS)


# Asked for at 0.31 s; it ends with a whole second.
@pytest.mark.parametrize(("until_us", "is_paired"), [(29_999_999, True), (30_000_000, False)])
def test_a_pairing_ends_by_itself(pad_library: Path, until_us: int, is_paired: bool) -> None:
    shell = Shell(pad_library)
    shell.run_ms(BOOT_MS + 10)
    shell.type("pad pair")
    shell.esp32.run_until(until_us)
    assert shell.esp32.connect_pad(OURS) is is_paired


def test_one_pairing_takes_one_pad_and_the_next_replaces_it(paired: Shell) -> None:
    paired.esp32.disconnect_pad()
    assert not paired.esp32.connect_pad(STRANGERS), "the pairing has had its pad"
    paired.type("pad pair")
    assert paired.esp32.connect_pad(STRANGERS)
    paired.esp32.disconnect_pad()
    assert not paired.esp32.connect_pad(OURS)


def test_a_pad_that_flash_cannot_keep_is_not_paired(pad_library: Path) -> None:
    shell = Shell(pad_library)
    shell.run_ms(BOOT_MS + 10)
    shell.esp32.state.nvs_fault = NvsFault.FULL
    shell.type("pad pair")
    assert not shell.esp32.connect_pad(OURS)


def test_a_test_of_the_board_stops_the_robot_and_gives_the_wires_back(driving: Shell) -> None:
    driving.drive(2, 2)
    driving.run_ms(400)
    levels = driving.driven()
    assert "test on, started by power or EN" in driving.type("test on", wait_ms=300)
    assert driving.robot.forward == 0
    assert driving.driven() == {}, "its outputs are let go"
    driving.type("wires 1 1", wait_ms=5)
    assert driving.driven() == {"DD1": True}
    assert "state idle" in driving.type("status"), "it does not see that p2dx_con is high"
    driving.type("test off", wait_ms=5)
    encoders = {name: level for name, level in levels.items() if name.startswith("encoder")}
    assert {name: level for name, level in driving.driven().items() if name.startswith("encoder")} == encoders
    assert len(driving.driven()) == 14


@pytest.mark.parametrize(
    ("typed", "answer"),
    [
        ("wires 1 1", "error: only in a test; type test on"),
        ("link 55", "error: only in a test; type test on"),
        ("pad", "pad none"),
        ("pad pair", "pad none"),
        ("pad peer", "error: no such command; type help"),
        ("test", "error: no such command; type help"),
    ],
)
def test_the_console_refuses_what_would_take_the_wires_from_the_adapter(shell: Shell, typed: str, answer: str) -> None:
    shell.run_ms(BOOT_MS + 10)
    assert answer in shell.type(typed)


@pytest.mark.parametrize(
    ("typed", "answer"),
    [
        ("wires g 1", "error: that is no hexadecimal number"),
        ("wires 123456789 1", "error: that is no hexadecimal number"),
        ("wires ffffffff 0", "wires in"),
        ("link 5", "error: that is not one to 16 bytes in hexadecimal"),
        ("link " + "55" * 17, "error: that is not one to 16 bytes in hexadecimal"),
        ("link " + "55" * 16, "link"),
        ("link zz", "error: that is not one to 16 bytes in hexadecimal"),
    ],
)
def test_words_of_a_test_are_checked(shell: Shell, typed: str, answer: str) -> None:
    shell.run_ms(BOOT_MS + 10)
    shell.type("test on")
    assert answer in shell.type(typed)


def test_the_last_bytes_of_the_line_are_kept_for_the_console(shell: Shell) -> None:
    shell.run_ms(BOOT_MS + 10)
    shell.type("test on")
    shell.esp32.receive(2, bytes(range(40)))
    shell.run_ms(45)
    assert f"link {bytes(range(8, 40)).hex()}\n" in shell.type("link")
    assert "link \n" in shell.type("link")


@pytest.fixture
def measuring(library: Path) -> Shell:
    shell = Shell(library)
    shell.run_ms(BOOT_MS + 10)
    shell.type("set motor_command 1")
    shell.type("restart", wait_ms=BOOT_MS + 50)
    return shell


def motors(shell: Shell) -> list[int]:
    words = shell.type("status", wait_ms=20).split()
    return [int(words[words.index(name) + 1]) for name in ("motor1", "motor2")]


def test_the_capture_unit_measures_as_the_model_does(measuring: Shell) -> None:
    """Edges at any microsecond; compared when the median has settled, and after the time-out."""
    rng, shell = Random(1), measuring
    wires = {name: DutyMeter(DUTY_TIMEOUT_NS) for name in ("motor1_comm1", "motor2_comm1")}
    pads = {name: 1 << (pad_of(name, "rev-b") or 0) for name in wires}
    for _ in range(60):
        period = rng.choice([50, 1_000, 1_000, 20_000, 25_000, 49_999])
        high = rng.choice([1, period // 2, rng.randrange(1, period), period - 1])
        name = rng.choice(list(wires))
        for _ in range(rng.randrange(1, 4)):
            for span, level in ((high, True), (period - high, False)):
                shell.levels = shell.levels & ~pads[name] | level * pads[name]
                shell.esp32.put_levels(shell.levels)
                wires[name].edge(level, shell.esp32.now_us * 1_000)
                shell.esp32.run_until(shell.esp32.now_us + span)
        shell.esp32.run_until(-(-shell.esp32.now_us // 1_000) * 1_000)
        shell.run_ms(rng.choice([12, 30]))
        now = shell.esp32.now_us * 1_000
        for found, meter in zip(motors(shell), wires.values(), strict=True):
            # The median of five samples 2 ms apart; the answer is made when the line has come.
            assert found in {meter.duty(now - 10_000_000), meter.duty(now + 2_000_000)}


def test_the_last_wire_of_a_motor_is_its_sign(measuring: Shell) -> None:
    measuring.set("motor1_comm1", True)
    measuring.set("motor2_comm1", True)
    measuring.set("motor2_comm3", True)
    measuring.set("motor1_comm2", True)
    measuring.run_ms(40)
    assert motors(measuring) == [1000, -1000]


def test_a_test_of_the_board_takes_the_duties_from_the_adapter(measuring: Shell) -> None:
    measuring.set("motor1_comm1", True)
    measuring.run_ms(40)
    assert "test on" in measuring.type("test on")
    assert motors(measuring) == [0, 0]
    measuring.type("test off")
    assert motors(measuring) == [1000, 0]
