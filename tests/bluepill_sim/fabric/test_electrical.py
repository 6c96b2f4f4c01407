"""Warnings of what is wrong with a wire, and what is on the board."""

from pathlib import Path

import pytest

from bluepill_sim.__main__ import run
from bluepill_sim.fabric.pins import PinDrive, PinMode
from bluepill_sim.stm32f103 import make_pins
from tests.bluepill_sim.machine import Machine
from tests.tools.examples import EXAMPLES


class Ports:
    now_ns = 0

    def __init__(self) -> None:
        self.warnings: dict[str, str] = {}

    def request_stop(self) -> None:
        pass

    @property
    def access_cycle(self) -> int:
        return self.now_ns

    def warn(self, message: str, *, once: str) -> None:
        self.warnings.setdefault(once, message)


@pytest.fixture
def ports() -> Ports:
    return Ports()


def test_two_drivers_that_differ_are_reported(ports: Ports) -> None:
    pin = make_pins(ports)["PB12"]
    pin.drive(0)
    pin.configure(PinMode.PUSH_PULL, output_bit=False)
    assert ports.warnings == {}, "both low: no harm"
    pin.configure(pin.mode, output_bit=True)
    assert list(ports.warnings.values()) == ["PB12: two drivers fight: the chip drives it high, the other end low"]
    assert pin.level is False


def test_an_open_drain_and_a_pull_fight_nobody(ports: Ports) -> None:
    pins = make_pins(ports)
    for mode in (PinMode.OPEN_DRAIN, PinMode.PULLED):
        pins["PB12"].drive(0)
        pins["PB12"].configure(mode, output_bit=True)
    assert ports.warnings == {}


@pytest.mark.parametrize(("rail", "bit", "word"), [("GND", True, "high"), ("3V3", False, "low")])
def test_a_shorted_output_is_reported(ports: Ports, rail: str, bit: bool, word: str) -> None:
    pin = make_pins(ports)["PA4"]
    pin.configure(PinMode.PUSH_PULL, output_bit=not bit)
    pin.short(rail)
    assert ports.warnings == {}
    pin.configure(pin.mode, output_bit=bit)
    assert list(ports.warnings.values()) == [f"PA4: output {word} is shorted to {rail}"]
    assert pin.level is not bit
    assert pin.is_contended
    pin.short(None)
    assert pin.level is bit


def test_a_rail_that_is_not_there_is_refused(ports: Ports) -> None:
    with pytest.raises(ValueError, match="no such rail"):
        make_pins(ports)["PA4"].short("12V")


@pytest.mark.parametrize(
    ("name", "mode", "bit", "complaint"),
    [
        ("PA4", PinMode.FLOATING, False, "5 V on PA4: it bears 3.6 V at most"),
        ("PB5", PinMode.FLOATING, False, "5 V on PB5: it bears 3.6 V at most"),
        ("PC13", PinMode.FLOATING, False, "5 V on PC13: it bears 3.6 V at most"),
        ("PB10", PinMode.FLOATING, False, None),
        ("PA9", PinMode.FLOATING, False, None),
        ("PB10", PinMode.PULLED, True, "5 V on PB10: it bears 5 V only without its pull"),
        ("PB10", PinMode.PUSH_PULL, True, "5 V on PB10: it bears 5 V only as an input"),
    ],
)
def test_five_volts_are_reported_where_they_hurt(
    ports: Ports, name: str, mode: PinMode, bit: bool, complaint: str | None
) -> None:
    pin = make_pins(ports)[name]
    pin.configure(mode, output_bit=bit)
    pin.drive(1, volts=5.0)
    assert list(ports.warnings.values()) == ([complaint] if complaint else [])


def test_three_volts_three_hurt_nobody(ports: Ports) -> None:
    pins = make_pins(ports)
    for pin in pins:
        if pin.is_bonded:
            pin.drive(1, volts=3.3)
            pin.drive(0, volts=5.0)
    assert ports.warnings == {}


def test_a_short_survives_a_snapshot(ports: Ports) -> None:
    one, other = make_pins(ports), make_pins(ports)
    one["PA4"].short("3V3")
    other.restore(one.snapshot())
    assert other["PA4"].level is True
    assert not other["PA4"].is_floating
    other["PA4"].configure(PinMode.PUSH_PULL, output_bit=False)
    assert other["PA4"].output is PinDrive.LOW
    assert other["PA4"].level is True


MOTORS = str(EXAMPLES / "motors.elf")
#: What happens to a pin of a running program, and what is said of it. PB12 (p2dx_con) is an output, high.
MISHAPS = [
    ("PB12=0@50ms", "PB12: two drivers fight: the chip drives it high, the other end low at "),
    ("PB12=GND@50ms", "PB12: output high is shorted to GND at "),
    ("PA4=5V@50ms", "5 V on PA4: it bears 3.6 V at most at "),
    ("PA4=z@50ms", "PA4: floating input that nobody drives"),
]


@pytest.mark.parametrize(("change", "says"), MISHAPS)
def test_run_tells_of_what_happens_to_a_pin(change: str, says: str, capsys: pytest.CaptureFixture[str]) -> None:
    wires = ("PA4", "PA5", "PA6", "PA7", "PB0", "PB1", "PB10", "PB11", "PB4", "PB3", "PB15", "PC14", "PC15")
    words = [word for wire in wires for word in ("--drive", f"{wire}=0@0s")]
    assert run(["run", MOTORS, "--for", "60ms", *words, "--drive", change]) == 0
    error = capsys.readouterr().err
    (warning,) = [line for line in error.splitlines() if line.startswith("warning: ")]
    assert warning.startswith(f"warning: {says}")
    assert ", 1 warning" in error


#: RCC and AFIO clocks on; PB4 (NJTRST), PB12 as an output.
PINS_OF_JTAG = """
mov32 r1, #0x40021018
mov32 r2, #0xD
str r2, [r1, #0]
ldr r2, [r1, #0]
mov32 r1, #0x40010C00
mov32 r2, #0x44484444
str r2, [r1, #0]
mov32 r2, #0x44424444
str r2, [r1, #4]
sleep: wfi
b sleep
"""


def test_a_pin_that_still_belongs_to_jtag_is_reported_on_the_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    image = tmp_path / "jtag.bin"
    image.write_bytes(Machine(PINS_OF_JTAG, {}).image.segments[0][1])
    assert run(["run", str(image), "--for", "5ms"]) == 0
    assert "warning: PB4 belongs to NJTRST: its GPIO configuration has no effect until" in capsys.readouterr().err
