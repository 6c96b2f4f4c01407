"""Faults, live inputs, FLASH files, sensors' errors: each as said, each refused in one line, each repeatable."""

import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from p2os.pioneer.body.ray_cast import Echo
from p2os.pioneer.controller.faults import FAULTS, MOMENTARY, read_fault
from p2os.pioneer.controller.flash import FlashError, FlashParameters, load_flash
from p2os.pioneer.controller.live_inputs import INPUTS
from p2os.pioneer.random_source import RandomSource
from p2os.pioneer.sensor_errors import IDEAL, REALISTIC, SensorErrorsError, SonarErrors, load_sensor_errors
from p2os.pioneer.sonar.errors import measure_ranges
from p2os.protocol.commands import CommandNumber as C
from p2os.protocol.profiles import Profile
from p2os.robots.parameters import load_parameters
from simbase.errors import UsageError
from simbase.timing import NS_PER_MS
from tests.p2os.conftest import context_of

MakeRobot = Callable[..., Any]
P2DX = load_parameters("p2dx")

EXAMPLES = {
    "NUMBER": "3", "METRES": "1.2", "SIDE": "left", "RATE": "0.01", "VOLTS": "10.5", "SEGMENT": "2",
}  # fmt: skip


def words_of(name: str) -> str:
    side = "front" if name == "bumper" else "left"
    return " ".join([name, *({**EXAMPLES, "SIDE": side}[word] for word in FAULTS[name][0])])


@pytest.mark.parametrize("name", FAULTS)
def test_every_fault_can_be_said_read_back_and_cleared(robot: Any, name: str) -> None:
    fault = read_fault(words_of(name), sonar=8)
    assert read_fault(fault.text, sonar=8) == fault
    robot.open()
    robot.pioneer.do(f"fault {words_of(name)}", robot.now)
    assert "fault" in robot.reported()
    if name in MOMENTARY:
        with pytest.raises(UsageError, match="nothing to clear"):
            robot.pioneer.do(f"clear {name}", robot.now)
    else:
        injected = context_of(robot.pioneer)["faults"], context_of(robot.pioneer)["devices"]
        robot.pioneer.do(f"clear {words_of(name)}", robot.now)
        assert (context_of(robot.pioneer)["faults"], context_of(robot.pioneer)["devices"]) != injected


#: The least and the most of each word of an input; a number beyond either is refused.
BOUNDS = {"X": (0, 1023), "Y": (0, 1023), "BUTTON": (0, 1), "PORT": (1, 9), "RAW": (0, 1023), "BYTE": (0, 255)}


@pytest.mark.parametrize(("name", "word"), [(name, word) for name, (words, _) in INPUTS.items() for word in words])
def test_each_word_of_an_input_has_its_bounds(robot: Any, name: str, word: str) -> None:
    robot.open()
    middle = dict.fromkeys(INPUTS[name][0], "1")
    values = ["on", "off"] if word == "ON_OFF" else list(map(str, BOUNDS[word]))
    beyond = ["1", "yes"] if word == "ON_OFF" else [str(BOUNDS[word][0] - 1), str(BOUNDS[word][1] + 1), "0.5"]
    for value in values:
        robot.pioneer.do(" ".join([name, *(middle | {word: value}).values()]), robot.now)
    for value in beyond:
        with pytest.raises(UsageError, match=r"is no number of|is none of"):
            robot.pioneer.do(" ".join([name, *(middle | {word: value}).values()]), robot.now)


@pytest.mark.parametrize(
    "text",
    ["", "fault", "fault sonar-stuck", "fault sonar-stuck 9 1", "fault sonar-stuck 3 far", "fault sonar-stuck 3 1 2",
     "fault line-noise 2", "fault wheel-blocked up", "fault bumper left 1", "joystick 1", "joystick 9999 1 1",
     "analog 0 1", "thing maybe", "dance"],
)  # fmt: skip
def test_words_that_mean_nothing_change_nothing(robot: Any, text: str) -> None:
    robot.open()
    before = robot.pioneer.snapshot()
    with pytest.raises(UsageError):
        robot.pioneer.do(text, robot.now)
    assert robot.pioneer.snapshot() == before


@pytest.mark.parametrize(("fault", "expected"), [("stuck", (1.2, 1.2)), ("dead", (5.0, 5.0)), ("noisy", (0.1, 5.0))])
def test_an_injected_sonar_fault_shows_and_the_others_do_not_err(fault: str, expected: tuple[float, float]) -> None:
    value = {"stuck": 1.2, "dead": 0.0, "noisy": 0.3}[fault]
    heard = [
        measure_ranges(Walls(), (0, 1), P2DX, IDEAL.sonar, {1: (fault, value)}, RandomSource(seed))
        for seed in range(20)
    ]
    assert {first for first, _ in heard} == {2.0}
    assert all(expected[0] <= second <= expected[1] for _, second in heard)
    assert (len({second for _, second in heard}) > 10) is (fault == "noisy")


class Walls:
    """Two metres away, met at 60 degrees but for one ray, which meets something at three."""

    def ranges(self, numbers: Any) -> list[float]:
        return [2.0 for _ in numbers]

    def echoes(self, numbers: Any) -> list[list[Echo]]:
        return [[Echo(2.0, 0.5), Echo(3.0, 0.99), Echo(float("inf"), 0.0)] for _ in numbers]


def test_a_surface_met_askew_sends_its_echo_elsewhere() -> None:
    assert measure_ranges(Walls(), (0,), P2DX, SonarErrors(specular_deg=25), {}, RandomSource()) == [3.0]
    assert measure_ranges(Walls(), (0,), P2DX, SonarErrors(specular_deg=61), {}, RandomSource()) == [2.0]
    assert measure_ranges(Walls(), (0,), P2DX, SonarErrors(specular_deg=5), {}, RandomSource()) == [P2DX.sonar_range_m]


@pytest.mark.parametrize("key", ["noise_m", "dropout", "crosstalk"])
def test_errors_of_sonar_are_drawn_from_the_seed(key: str) -> None:
    errors = SonarErrors(**{key: 0.3})

    def series(seed: int) -> list[float]:
        random_source = RandomSource(seed)
        return [measure_ranges(Walls(), (0,), P2DX, errors, {}, random_source)[0] for _ in range(50)]

    assert series(1) == series(1) != series(2)
    assert all(P2DX.sonar_min_range_m <= range_m <= P2DX.sonar_range_m for range_m in series(1))
    spoilt = sum(range_m != 2.0 for range_m in series(1))
    assert spoilt >= 5


def test_wheels_of_another_size_and_drift_show_in_the_odometry_alone(make_robot: MakeRobot) -> None:
    def drive(**settings: Any) -> tuple[float, float]:
        robot = make_robot(**settings).open()
        robot.say(C.VEL, 300)
        robot.run(9000)
        return robot.pioneer.state.x_mm, robot.pioneer.state.heading_rad

    true_mm, straight = drive()
    assert straight == 0
    believed_mm, heading = drive(errors=REALISTIC, seed=3)
    assert believed_mm != pytest.approx(true_mm, abs=0.1)
    assert heading != 0
    assert drive(errors=REALISTIC, seed=3) == (believed_mm, heading)
    assert drive(errors=REALISTIC, seed=4) != (believed_mm, heading)


def test_the_battery_drains_sags_and_is_reported_low(make_robot: MakeRobot) -> None:
    robot = make_robot(battery_decivolts=112, errors=REALISTIC).open()
    assert "battery low" not in robot.reported()
    robot.say(C.VEL, 500)
    robot.run(1900)
    assert robot.pioneer.state.battery_v < 11.0, "sags under load"
    assert "battery low" in robot.reported()
    robot.pioneer.do("fault low-battery 9.5", robot.now)
    assert robot.sip().raw_battery == 95


def test_a_stop_button_takes_the_power_until_enable(robot: Any) -> None:
    robot.open()
    robot.say(C.VEL, 200)
    robot.run(1000)
    robot.pioneer.do("fault stop-button", robot.now)
    assert robot.pioneer.state.left_setpoint_mps == 0
    robot.say(C.ENABLE, 1)
    assert not robot.pioneer.state.motors_enabled
    assert "motors stay off" in robot.reported()
    robot.pioneer.do("clear stop-button", robot.now)
    assert not robot.pioneer.state.motors_enabled
    robot.say(C.ENABLE, 1)
    assert robot.pioneer.state.motors_enabled


def test_a_blocked_wheel_stands_and_stalls(robot: Any) -> None:
    robot.open()
    robot.pioneer.do("fault wheel-blocked left", robot.now)
    robot.say(C.VEL, 200)
    robot.run(1000)
    assert robot.body.state.left_speed_mps == 0 < robot.body.state.right_speed_mps
    packet = robot.sip()
    assert (packet.stall_left, packet.stall_right) == (True, False)


@pytest.mark.parametrize("cut_ms", [450, 777, 1234])
def test_a_robot_with_every_error_goes_on_from_a_snapshot_byte_for_byte(make_robot: MakeRobot, cut_ms: int) -> None:
    def begin() -> Any:
        robot = make_robot(baud=9600, errors=REALISTIC, seed=5, profile=Profile.ARCOS).open()
        for number in (C.GYRO, C.IOREQUEST, C.ENCODER, C.TCM2):
            robot.say(number, 2 if number is not C.GYRO else 1)
        robot.say(C.VEL, 250)
        robot.pioneer.do("fault line-noise 0.001", robot.now)
        robot.pioneer.do("fault sonar-noisy 2 0.2", robot.now)
        return robot

    def output(robot: Any, milliseconds: int) -> bytes:
        robot.run(milliseconds)
        return b"".join(robot.pioneer.take_output())

    whole = begin()
    output(whole, cut_ms)
    saved = pickle.loads(pickle.dumps(whole.pioneer.snapshot()))  # noqa: S301 - our own bytes
    rest = output(whole, 1500)
    again = make_robot(baud=9600, errors=REALISTIC, seed=5, profile=Profile.ARCOS)
    again.pioneer.restore(saved)
    again.now = whole.now - 1500 * NS_PER_MS
    assert output(again, 1500) == rest


# Files ------------------------------------------------------------------------------------


def test_a_flash_file_sets_what_config_reports_and_the_robot_does(make_robot: MakeRobot, tmp_path: Path) -> None:
    path = tmp_path / "wilma.toml"
    path.write_text('[flash]\nname = "Wilma"\nsipcycle = 50\nwatchdog = 500\ntransvelmax = 300\n')
    settings = make_robot().pioneer.settings.with_flash(load_flash(path))
    robot = make_robot(
        name=settings.name, sip_period_ns=settings.sip_period_ns, watchdog_ns=settings.watchdog_ns, flash=settings.flash
    ).open()
    robot.say(C.VEL, 900)
    robot.run(400)
    assert len(robot.sips()) == 8
    robot.run(1000)
    assert "watchdog expired" in robot.reported()
    robot.say(C.CONFIG)
    from p2os.protocol.config_packet import ConfigPacket

    (frame,) = [frame for frame in robot.frames() if frame.kind == 0x20]
    config = ConfigPacket.from_frame(frame)
    assert (config.name, config.sipcycle, config.watchdog, config.transvelmax) == ("Wilma", 50, 500, 300)
    assert robot.pioneer.state.left_setpoint_mps <= 0.3


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[flash]\nwatchdg = 1", "no parameter 'watchdg'"),
        ("[flash]\nwatchdog = 1.5", "neither a whole number"),
        ("[flash]\nwatchdog = 99999", "does not fit"),
        ("[flash]\nwatchdog = 0", "watchdog = 0 is out of range: 1 to 65535"),
        ("[flash]\nhostbaud = 9", "hostbaud = 9 is out of range: 0 to 4"),
        ("[flash]\nfrontbumps = 9", "frontbumps = 9 is out of range: 0 to 7"),
        ("[flash]\nsubclass = 'p3dx'", "no parameter 'subclass'"),
        ("[flash]\nname = 3", "does not fit"),
        ("[flesh]\n", r"one table \[flash\]"),
        ("[flash", "no TOML|Expected"),
    ],
)
def test_a_wrong_flash_file_is_refused_with_its_name(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "wrong.toml"
    path.write_text(text)
    with pytest.raises(FlashError, match=message) as caught:
        load_flash(path)
    assert "wrong.toml" in str(caught.value)


def test_a_flash_file_that_is_not_there_is_reported(tmp_path: Path) -> None:
    with pytest.raises(FlashError, match="cannot read"):
        load_flash(tmp_path / "none.toml")
    assert FlashParameters().baud() == 9600


def test_a_file_of_errors_starts_from_a_set(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('based_on = "realistic"\n[sonar]\nnoise_m = 0.5\n')
    found = load_sensor_errors(str(path))
    assert found.sonar.noise_m == 0.5
    assert found.odometry == REALISTIC.odometry
    assert load_sensor_errors("ideal") == IDEAL


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("based_on = 'x'", "based_on"),
        ("[sonr]\n", "unknown key 'sonr'"),
        ("[sonar]\nnoise = 1", r"\[sonar\]: unknown key 'noise'"),
        ("[sonar]\ndropout = 2", "dropout = 2 is out of range"),
        ("[sonar]\nnoise_m = -1", "noise_m = -1 is out of range"),
        ("[sonar]\nnoise_m = true", "is not a number"),
        ("[sonar", "Expected"),
    ],
)
def test_a_wrong_file_of_errors_is_refused(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "wrong.toml"
    path.write_text(text)
    with pytest.raises(SensorErrorsError, match=message):
        load_sensor_errors(str(path))


def test_unknown_sets_of_errors_are_refused(tmp_path: Path) -> None:
    with pytest.raises(SensorErrorsError, match="no set of sensor errors 'realistc'"):
        load_sensor_errors("realistc")
    with pytest.raises(SensorErrorsError, match="cannot read"):
        load_sensor_errors(str(tmp_path / "none.toml"))


def test_every_live_input_acts(robot: Any) -> None:
    robot.open()
    for text in ("joystick 100 900 0", "analog 2 512", "digital 255", "thing on", "charger on"):
        before = context_of(robot.pioneer)["devices"]
        robot.pioneer.do(text, robot.now)
        assert context_of(robot.pioneer)["devices"] != before
    assert {text.split()[0] for text in ("joystick", "analog", "digital", "thing", "charger")} == set(INPUTS)
