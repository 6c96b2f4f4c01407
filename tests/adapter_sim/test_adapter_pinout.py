"""The pin-out file: what it says, and what it refuses."""

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from adapter_sim import PinoutError, load_pinout, parse_pinout
from adapter_sim.pinout import Pinout, Pull, Safe, WireDirection, WireRole, faults_of
from tests.adapter_sim.conftest import PINOUT, four_bits
from tests.adapter_sim.conftest import PINOUT_TEXT as TEXT
from tests.tools.each_row import each_row

#: The BluePill's side, which binaries rely on.
FIXED = {
    "DD1": "PA4", "DD2": "PA5", "DD3": "PA6", "DD4": "PA7", "DD5": "PB0", "DD6": "PB1", "DD7": "PB10", "DD8": "PB11",
    "encoder1_s1": "PB4", "encoder1_s2": "PB3", "encoder1_s3": "PB15",
    "encoder2_s1": "PC13", "encoder2_s2": "PC14", "encoder2_s3": "PC15",
    "motor1_comm1": "PB7", "motor1_comm2": "PB6", "motor1_comm3": "PB5",
    "motor2_comm1": "PA1", "motor2_comm2": "PA2", "motor2_comm3": "PA3",
    "p2dx_con": "PB12", "rst": "PB13",
}  # fmt: skip


def test_the_22_wires_end_at_the_pins_that_binaries_rely_on() -> None:
    assert {wire.name: wire.bluepill for wire in PINOUT.wires} == FIXED


def test_the_third_wire_of_a_value_weighs_most() -> None:
    for name in ("encoder1", "encoder2", "motor1", "motor2"):
        value = PINOUT.value(name)
        assert (value.width, value.wires[-1][-1]) == (3, "3")


def test_levels_are_safe_by_role() -> None:
    safe = {WireRole.DISTANCE: Safe.HIGH, WireRole.ENCODER: Safe.HOLD}
    for wire in PINOUT.wires:
        assert wire.safe is safe.get(wire.role, Safe.LOW)
        assert wire.idle is (wire.pull is Pull.UP)
        assert wire.direction is (WireDirection.TO_BLUEPILL if wire.role in safe else WireDirection.TO_ADAPTER)


def test_rev_b_is_the_default_and_breaks_no_rule() -> None:
    assert PINOUT.default_revision == "rev-b"
    assert faults_of(PINOUT, "rev-b") == []
    assert faults_of(PINOUT, "rev-c") == []
    assert PINOUT.wire("motor1_comm3").esp32_pin("rev-b") == "IO34"


@pytest.mark.parametrize(
    ("revision", "fault"),
    [
        ("thesis-table3", "DD1: IO10 carries the module's flash"),
        ("thesis-table3", "DD8: IO36 is an input only, but must be driven"),
        ("thesis-table3", "encoder2_s1: no pin of the ESP32"),
        ("thesis-table3", "motor2_comm2: IO25 is DD4 already"),
        ("thesis-table3", "motor1_comm3: IO0 is a boot strap, but the BluePill drives it"),
        ("thesis-board", "motor1_comm2: IO12 is a boot strap, but the BluePill drives it"),
        ("thesis-board", "motor wires: not all in IO32..IO39, so no one read samples them at one instant"),
    ],
)
def test_the_thesis_revisions_have_faults(revision: str, fault: str) -> None:
    assert fault in faults_of(PINOUT, revision)


#: By Espressif's data sheet of the ESP32: of the flash, without an output driver, read at boot.
FLASH, NO_DRIVER, STRAPS = {6, 7, 8, 9, 10, 11}, {34, 35, 36, 37, 38, 39}, {0, 2, 5, 12, 15}
#: Read together.
SECOND_REGISTER = {32, 33, 34, 35, 36, 37, 38, 39}


def with_pin(name: str, pin: str) -> Pinout:
    """Return the pin-out with one wire on another pin of rev-b, and nothing but wires."""
    wires = tuple(replace(wire, esp32=(("rev-b", pin),)) if wire.name == name else wire for wire in PINOUT.wires)
    return replace(PINOUT, wires=wires, auxiliaries=())


@each_row("gpio", range(40))
def test_what_each_pin_of_the_esp32_can_bear(gpio: int) -> None:
    pin = f"IO{gpio}"
    for name, wrong in (
        ("DD1", [*["carries the module's flash"] * (gpio in FLASH), *["is an input only"] * (gpio in NO_DRIVER)]),
        ("p2dx_con", [*["carries the module's flash"] * (gpio in FLASH), *["is a boot strap"] * (gpio in STRAPS)]),
    ):
        found = [fault for fault in faults_of(with_pin(name, pin), "rev-b") if fault.startswith(f"{name}: {pin} ")]
        taken = [fault for fault in found if fault.endswith(" already")]
        assert len(found) - len(taken) == len(wrong)
        assert all(why in fault for why, fault in zip(wrong, found, strict=False))
    is_split = any(fault.startswith("motor wires") for fault in faults_of(with_pin("motor2_comm1", pin), "rev-b"))
    assert is_split is (gpio not in SECOND_REGISTER)


def test_a_motor_wire_on_no_pin_of_the_chip_is_not_sampled_with_the_others() -> None:
    for pin in ("EN", "HC595.QA"):
        faults = faults_of(with_pin("motor2_comm1", pin), "rev-b")
        assert faults[-1] == "motor wires: not all in IO32..IO39, so no one read samples them at one instant"


@each_row(
    ("key", "least", "most"),
    [("schema = 1", 1, 1), ("idle = 1", 0, 1), ("bit = 2", 0, 31), ("number = 8", 1, 32), ("width = 3", 1, 32)],
)
def test_numbers_of_the_file_have_their_bounds(key: str, least: int, most: int) -> None:
    name = key.partition(" ")[0]
    for number, is_in in ((least - 1, False), (least, True), (most, True), (most + 1, False)):
        try:
            parse_pinout(TEXT.replace(key, f"{name} = {number}", 1))
            said = ""
        except PinoutError as error:
            said = str(error)
        assert ("is out of range" in said) is not is_in, (number, said)


@each_row("pin", ["PA0", "PA9", "PA10", "PA15", "PB14", "PC0"])
def test_every_port_that_a_bluepill_brings_out_may_be_named(pin: str) -> None:
    assert parse_pinout(TEXT.replace('bluepill = "PA4"', f'bluepill = "{pin}"', 1)).wire("DD1").bluepill == pin


@each_row("pin", ["PA16", "PA20", "P15", "PA1x", "xPA1", "PD0", "PA"])
def test_what_is_no_pin_of_a_bluepill_is_refused(pin: str) -> None:
    with pytest.raises(PinoutError, match=r"expected PA0\.\.PC15"):
        parse_pinout(TEXT.replace('bluepill = "PA4"', f'bluepill = "{pin}"', 1))


def test_an_auxiliary_pin_that_a_wire_has_already_is_a_fault() -> None:
    text = TEXT.replace('rev-b = "IO0", rev-c', 'rev-b = "IO23", rev-c')
    assert faults_of(parse_pinout(text), "rev-b") == ["mode_button: IO23 is DD1 already"]


def test_a_fourth_motor_bit_is_one_more_wire_and_one_larger_number() -> None:
    pinout = parse_pinout(four_bits())
    assert pinout.value("motor1").width == 4
    assert pinout.value("motor2").wires[3] == "motor2_comm4"


def test_a_wire_of_a_value_that_is_not_declared_is_refused() -> None:
    with pytest.raises(PinoutError, match="wire 'motor1_comm4' belongs to no"):
        parse_pinout(four_bits().replace('value = "motor1"\nbit = 3', 'value = "motor9"\nbit = 0').replace(
            'side = "left"\nwidth = 4', 'side = "left"\nwidth = 3'))  # fmt: skip


def test_encoders_of_different_widths_are_refused() -> None:
    text = TEXT[: TEXT.index('[[wire]]\nname = "encoder1_s3"')] + TEXT[TEXT.index('[[wire]]\nname = "encoder2_s1"') :]
    with pytest.raises(PinoutError, match=r"the encoders have \[2, 3\] wires"):
        parse_pinout(text.replace('side = "left"\nwidth = 3', 'side = "left"\nwidth = 2', 1))


def test_auxiliary_pins_may_be_left_out() -> None:
    start, end = TEXT.index("# Pins of the ESP32 that reach"), TEXT.index('[[wire]]\nname = "DD1"')
    assert parse_pinout(TEXT[:start] + TEXT[end:]).auxiliaries == ()


BROKEN = [
    ('name = "DD2"', 'name = "DD1"', "wire 'DD1' stands twice"),
    ('bluepill = "PA5"', 'bluepill = "PA4"', "BluePill pin 'PA4' stands twice"),
    ('bluepill = "PA5"', 'bluepill = "PD5"', "bluepill = 'PD5', expected PA0..PC15"),
    ('pull = "up"\nidle = 1', 'pull = "up"\nidle = 0', "idle = 0 contradicts pull = 'up'"),
    ('role = "connect"', 'role = "conect"', 'role = "conect" is none of distance, encoder'),
    ('role = "connect"', 'role = "reset"', "0 wires have the role 'connect', expected 1"),
    ("number = 8", "number = 9", "expected 1, 2, 3"),
    ('value = "motor1"\nbit = 1', 'value = "motor1"\nbit = 2', "its wires have the bits [0, 2, 2]"),
    ('value = "motor1"\nbit = 1', 'value = "motor3"\nbit = 1', "width = 3, but its wires have the bits [0, 2]"),
    ("safe = 1", "safe = 2", "safe = 2, expected 0, 1"),
    ("safe = 1", "safe = true", "safe = True, expected 0, 1"),
    ('safe = "hold"', "", "key 'safe' is missing"),
    ("schema = 1", "schema = 2", "schema = 2 is out of range"),
    ("schema = 1", "schema = true", "schema = true is not a whole number"),
    ('default_revision = "rev-b"', 'default_revision = "rev-x"', "default_revision 'rev-x' is none of"),
    ('default_revision = "rev-b"', "default_revision = 3", "default_revision = 3 is not a text"),
    ('name = "DD2"', 'name = "DD2"\ncolour = "red"', "[[wire]] 2: unknown key 'colour'"),
    ("schema = 1", "schema = 1\ncolour = 1", "unknown key 'colour'"),
    ('rev-b = "IO23"', 'rev-b = "IO40"', "esp32.rev-b = 'IO40', expected IO0..IO39"),
    ('rev-b = "IO23"', 'rev-x = "IO23"', "esp32 names the unknown revision 'rev-x'"),
    (', rev-c = "HC595.QA"', "", "esp32 has no pin for revision 'rev-c'"),
    ('number = 1\ndirection = "to_bluepill"', 'number = 1\ndirection = "to_adapter"', "a distance wire is to_bluepill"),
    ('name = "encoder1"\nrole = "encoder"\nside = "left"', 'name = "encoder1"\nrole = "encoder"\nside = "right"',
     "expected ['encoder1', 'encoder2', 'motor1', 'motor2'] with their sides"),
    ('name = "encoder1"\nrole = "encoder"\nside', 'name = "encoder1"\nrole = "motor"\nside', "wire encoder1_s1 has"),
    ('name = "encoder1"\nrole', 'name = "encoder2"\nrole', "value 'encoder2' stands twice"),
    ('shares = "DD7"', 'shares = "DD9"', "shares = 'DD9', expected the name of a wire"),
    ('name = "p2os_rx"\ndirection = "in"', 'name = "p2os_rx"\ndirection = "up"', 'direction = "up" is none of in, out'),
    ('esp32 = { thesis-table3 = "IO16"', 'esp32 = 3 # { thesis-table3 = "IO16"', "esp32 = 3 is not a table"),
    ("[[revision]]", "[[revisions]]", "unknown key 'revisions'"),
    ("schema = 1", "schema = ", "pinout:18: Invalid value"),
]  # fmt: skip


@pytest.mark.parametrize(("good", "bad", "message"), BROKEN)
def test_a_broken_file_is_refused_with_the_place_and_the_reason(good: str, bad: str, message: str) -> None:
    assert good in TEXT
    count = -1 if good == "[[revision]]" else 1
    with pytest.raises(PinoutError) as refusal:
        parse_pinout(TEXT.replace(good, bad, count))
    assert message in str(refusal.value)


def test_a_value_left_out_is_missed_at_its_wires(tmp_path: Path) -> None:
    start = TEXT.index('[[value]]\nname = "motor2"')
    end = TEXT.index("# Pins of the ESP32 that reach")
    file = tmp_path / "mine.toml"
    file.write_text(TEXT[:start] + TEXT[end:], encoding="utf-8")
    with pytest.raises(PinoutError, match=r"mine\.toml: values are \['encoder1', 'encoder2', 'motor1'\]"):
        load_pinout(file)


def test_a_missing_file_is_one_error(tmp_path: Path) -> None:
    with pytest.raises(PinoutError, match="cannot read"):
        load_pinout(tmp_path / "none.toml")


@given(st.integers(0, len(TEXT) - 1), st.integers(1, 40))
def test_a_file_cut_anywhere_loads_or_is_refused_but_never_crashes(start: int, length: int) -> None:
    try:
        pinout = parse_pinout(TEXT[:start] + TEXT[start + length :])
    except PinoutError:
        return
    assert len({wire.bluepill for wire in pinout.wires}) == len(pinout.wires)


def test_a_misspelt_role_is_answered_with_the_word_that_the_file_has() -> None:
    with pytest.raises(PinoutError) as refused:
        parse_pinout(TEXT.replace('role = "encoder"', 'role = "encodr"', 1))
    assert refused.value.hint == "did you mean 'encoder'?"
