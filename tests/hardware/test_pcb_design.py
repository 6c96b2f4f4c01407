"""The board's design: pin rules, netlist, bill of materials, arithmetic."""

import dataclasses

import pytest

from adapter_sim.pinout import load_pinout
from hardware.pcb.checks.pin_checks import BOARDS, count_by_rule, findings
from hardware.pcb.circuit.design import VARIANTS, build
from hardware.pcb.circuit.electrical import Check, all_checks, bom_faults, netlist_faults
from hardware.pcb.circuit.modules import BLUEPILL_PINS, ESP32_PINS
from hardware.pcb.circuit.netlist import POWER_NETS, BoardDesign, DesignError, make
from hardware.pcb.circuit.parts import PARTS, Part
from hardware.pcb.proof.mutants import BoardMutant, apply

PINOUT = load_pinout()


@pytest.mark.parametrize("revision", ["rev-b", "rev-c"])
def test_our_revisions_break_no_pin_rule(revision: str) -> None:
    assert findings(PINOUT, BOARDS[revision]) == []


def test_the_same_rules_find_the_faults_of_table_3() -> None:
    found = findings(PINOUT, BOARDS["thesis-table3"])
    assert count_by_rule(found) == {"double": 1, "flash": 6, "input-only": 1, "jtag": 2, "no-pin": 1, "strap": 4}
    assert "double: motor2_comm2: IO25 is DD4 already" in map(str, found)
    assert "strap: motor1_comm3: IO0 must be high at reset, but is pulled down" in map(str, found)


def test_the_same_rules_find_the_faults_of_the_thesis_board() -> None:
    found = findings(PINOUT, BOARDS["thesis-board"])
    lines = [str(finding) for finding in found]
    assert count_by_rule(found)["5V"] == 19
    assert "flash: DD7: IO10 carries the module's flash" in lines
    assert "5V: p2os_rx: 5 V on IO16, which bears 3.6 V" in lines
    assert "input-only: led_state: IO36 cannot drive" in lines
    assert "strap: motor1_comm2: IO12 is a strap, but the BluePill drives it" in lines


def test_a_jtag_pin_that_the_bluepill_would_drive_is_found() -> None:
    wires = tuple(
        dataclasses.replace(wire, bluepill="PB3") if wire.name == "p2dx_con" else wire for wire in PINOUT.wires
    )
    found = findings(dataclasses.replace(PINOUT, wires=wires), BOARDS["rev-b"])
    assert count_by_rule(found) == {"jtag": 1}


def test_swd_and_pins_that_the_module_lacks_are_found() -> None:
    moved = {"p2dx_con": "PA13", "DD1": "PC0"}
    wires = tuple(dataclasses.replace(wire, bluepill=moved.get(wire.name, wire.bluepill)) for wire in PINOUT.wires)
    counts = count_by_rule(findings(dataclasses.replace(PINOUT, wires=wires), BOARDS["rev-b"]))
    assert counts == {"no-pin": 2, "swd": 1}


def test_io12_without_its_pull_down_is_found() -> None:
    wires = tuple(
        dataclasses.replace(wire, pull="none") if wire.name == "encoder2_s2" else wire for wire in PINOUT.wires
    )
    found = findings(dataclasses.replace(PINOUT, wires=wires), BOARDS["rev-b"])
    assert [str(finding) for finding in found] == [
        "strap: encoder2_s2: IO12 needs a pull-down: high selects 1.8 V flash"
    ]


def test_both_modules_have_forty_pins_and_no_gpio_twice() -> None:
    for pins in (BLUEPILL_PINS, ESP32_PINS):
        ports = [pin for pin in pins if pin not in {"GND", "3V3", "5V", "NC"}]
        assert (len(pins), len(set(ports))) == (40, len(ports))


@pytest.mark.parametrize("variant", VARIANTS)
def test_netlist_and_bill_of_materials_are_complete(variant: str) -> None:
    design = build(variant)
    assert netlist_faults(design) == []
    assert bom_faults(design) == []


def test_every_power_net_is_one_of_some_board() -> None:
    assert {net for variant in VARIANTS for net in build(variant).nets()} >= POWER_NETS


@pytest.mark.parametrize("variant", VARIANTS)
def test_every_electrical_figure_is_within_its_limits(variant: str) -> None:
    assert [str(check) for check in all_checks(build(variant)) if not check.is_good] == []


def test_330_ohms_in_series_would_overload_the_pins_of_an_unpowered_bluepill() -> None:
    design = with_resistor(build(), [f"R{number}" for number in range(1, 22)], 330.0)
    failed = {check.name for check in all_checks(design) if not check.is_good}
    assert failed == {"injected into one BluePill pin", "injected into the BluePill in all",
                      "injected into the ESP32 in all"}  # fmt: skip


def test_the_divider_of_the_thesis_leaves_the_lm317_below_its_minimum_load() -> None:
    design = with_resistor(with_resistor(build("lm317"), ["R70"], 3300.0), ["R71"], 5100.0)
    failed = {check.name for check in all_checks(design) if not check.is_good}
    assert failed == {"LM317 +3V3 minimum load by its divider"}


def test_a_wire_without_its_resistor_and_a_lone_pin_are_missed() -> None:
    design = build()
    fewer = BoardDesign(variant=design.variant, revision=design.revision, title=design.title,
                        components=tuple(part for part in design.components if part.ref not in {"R1",
                                                                                                "U1"}))  # fmt: skip
    faults = netlist_faults(fewer)
    assert "net DD2_BP ends at" not in faults
    assert any(fault.startswith("net MOTOR1_COMM1_BP ends at") for fault in faults)


def test_a_button_that_reaches_no_pad_is_missed() -> None:
    # The board as it was: IO0 open, and the firmware's mode button nowhere.
    design = apply(build(), BoardMutant(rule="x", name="x", edits=("net U2.37 -",)))
    assert netlist_faults(design) == ["mode_button is on IO0, which reaches nothing on this board"]
    failed = {check.name for check in all_checks(design) if not check.is_good}
    assert failed == {"strap IO0: pull-up on the board", "strap IO0 with the button held"}


@pytest.mark.parametrize(
    ("edit", "name"),
    [
        ("drop R75", "strap IO0: pull-up on the board"), ("value R75 47k", "strap IO0: pull-up on the board"),
        ("value R76 4k7", "strap IO0 with the button held"), ("drop SW1", "strap IO0 with the button held"),
        ("value R76 120R", "IO0 driven high with the button held"),
        ("value R77 1k", "stop loop closed: emitter to base of Q3 and Q4"),
        ("value R78 10k", "stop loop closed: current that wets the contact"),
        ("value R76 360R", None), ("value R75 20k", None),
    ],
)  # fmt: skip
def test_button_and_stop_loop_are_held_to_their_limits(edit: str, name: str | None) -> None:
    design = apply(build(), BoardMutant(rule="x", name="x", edits=(edit,)))
    failed = {check.name for check in all_checks(design) if not check.is_good}
    assert failed == set() if name is None else name in failed


def test_a_design_refuses_twins_and_unknown_parts() -> None:
    one = make("R1", "20k", ["A", "B"])
    with pytest.raises(DesignError, match="R1 stands twice"):
        BoardDesign(variant="x", revision="rev-b", title="", components=(one, one))
    twice = dataclasses.replace(one, ref="R2", pins=(("1", "A"), ("1", "B")))
    with pytest.raises(DesignError, match="R2 has a pin twice"):
        BoardDesign(variant="x", revision="rev-b", title="", components=(twice,))
    with pytest.raises(DesignError, match="no part 'R 9M'"):
        make("R3", "R 9M", ["A"])
    with pytest.raises(DesignError, match="variant 'rev-z' is unknown"):
        build("rev-z")


def test_a_bought_part_needs_a_number_to_order_it_by() -> None:
    with pytest.raises(ValueError, match="no part number"):
        Part(key="X", value="1", symbol="R", footprint="R_0805", description="nameless")
    nameless = dataclasses.replace(PARTS["20k"], source="")
    component = dataclasses.replace(make("R1", "20k", ["A", "B"]), part=nameless)
    design = BoardDesign(variant="x", revision="rev-b", title="", components=(component,))
    assert bom_faults(design) == ["R1: no source"]


def test_a_check_says_its_figure_and_its_limits() -> None:
    check = Check(name="rail", value=3.44, low=3.135, high=3.4, unit="V")
    assert str(check) == "FAIL rail: 3.44 V (limits 3.135 to 3.4)"


def with_resistor(design: BoardDesign, refs: list[str], ohm: float) -> BoardDesign:
    """Return the design with other resistor values."""
    parts = tuple(
        dataclasses.replace(part, part=dataclasses.replace(part.part, facts={"ohm": ohm})) if part.ref in refs else part
        for part in design.components
    )
    return dataclasses.replace(design, components=parts)
