"""The proof of the circuit: the expected connections hold, and wrong circuits are noticed by name."""

import re
from pathlib import Path

import pytest

from hardware.pcb.circuit.design import VARIANTS, build
from hardware.pcb.circuit.netlist import DesignError
from hardware.pcb.layout.footprints import FOOTPRINTS
from hardware.pcb.layout.shapes import SILK_MM, Circle, Label, StraightStroke
from hardware.pcb.outputs.board import text_effects
from hardware.pcb.outputs.sexp import child, word
from hardware.pcb.proof import mutants
from hardware.pcb.proof.expected import differences, expected, si, symbol_differences
from hardware.pcb.proof.mutants import BoardMutant, apply, load

#: KiCad's own symbols, where they are installed.
SYMBOLS = Path("/usr/share/kicad/symbols")


def named(mutant: BoardMutant, lines: list[str]) -> bool:
    """Tell whether a line names a part, pin or net that the mutant's edits touch."""
    words = {word for line in lines for word in re.findall(r"[\w+.-]+", line)}
    words |= {word.split(".")[0] for word in words}
    return bool(words & mutant.touches())


@pytest.mark.parametrize("variant", VARIANTS)
def test_the_board_is_connected_as_the_table_of_its_own_says(variant: str) -> None:
    assert differences(build(variant)) == []


def test_the_list_of_wrong_circuits_is_the_one_that_was_drawn_and_has_every_rule() -> None:
    listed = load()
    # One draw came twice; the list stays as it was drawn.
    assert (len(listed), len({mutant.edits for mutant in listed})) == (181, 180)
    assert {mutant.rule for mutant in listed} == {
        "named", "net", "polarity", "value", "connector", "chip", "network", "left out",
    }  # fmt: skip


def test_at_least_95_percent_of_the_wrong_circuits_are_noticed_by_a_line_that_names_the_fault() -> None:
    design = build()
    missed = [mutant.name for mutant in load() if not named(mutant, differences(apply(design, mutant)))]
    assert missed == []


@pytest.mark.parametrize("variant", ["rev-b", pytest.param("rev-c", marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    "seed",
    [1, pytest.param(2, marks=pytest.mark.slow), *(pytest.param(seed, marks=pytest.mark.soak) for seed in (3, 4, 5))],
)
def test_wrong_circuits_of_other_draws_are_noticed_too(seed: int, variant: str) -> None:
    design = build(variant)
    # A fifth of them each: together every pin, value and part.
    for mutant in mutants.draw(design, seed)[seed - 1 :: 5]:
        lines = differences(apply(design, mutant))
        assert named(mutant, lines), (mutant.name, lines)


@pytest.mark.parametrize("variant", VARIANTS)
def test_a_whole_part_that_is_wrong_and_a_torn_net_are_named(variant: str) -> None:
    design = build(variant)
    drawn = mutants.draw_whole(design, seed=2026)
    assert len(drawn) > 50
    for mutant in drawn:
        lines = differences(apply(design, mutant))
        words = {word for line in lines for word in re.findall(r"[\w+-]+", line)}
        # A torn net is told by its pins.
        whole = {mutant.name.split()[0]} if "torn" not in mutant.name else mutant.touches() - {"TORN"}
        assert words & whole, (mutant.name, lines)


def test_a_part_the_wrong_way_round_is_called_so() -> None:
    lines = differences(apply(build(), BoardMutant(rule="x", name="x", edits=("swap D3.K D3.A",))))
    assert lines[0] == "D3 is the wrong way round: D3.K is on net 5V_EXT, D3.A on net 5V_BANK"


def test_a_pin_that_must_stay_open_says_why() -> None:
    lines = differences(apply(build(), BoardMutant(rule="x", name="x", edits=("net J3.7 +12V",))))
    (line,) = lines
    assert line.startswith("J3.7 is on net +12V")
    assert line.endswith("must stay open (thesis 2.4: a straight ribbon from JP8 puts 12 V here)")


@pytest.mark.parametrize("edit", ["net U9.1 GND", "swap U5.1 U9.1", "join GND NOWHERE", "value R99 1k", "drop R99"])
def test_an_edit_of_what_is_not_there_is_refused(edit: str) -> None:
    with pytest.raises(DesignError, match=r"no (pin|net|part)"):
        apply(build(), BoardMutant(rule="x", name="x", edits=(edit,)))


def test_every_row_of_the_table_names_its_source_and_values_read_as_printed() -> None:
    text = mutants.LIST.with_name("expected.toml").read_text(encoding="utf-8")
    assert text.count("[[node]]") + text.count(".node]]") == text.count('source = "')
    assert [si(word) for word in ("4k7", "680R", "22u", "100n", "1k2")] == pytest.approx([4700, 680, 22e-6, 1e-7, 1200])
    assert expected("rev-b").values["R12"] == "680R"


@pytest.mark.soak  # reads whole libraries
def test_the_table_s_pin_names_are_those_of_kicad_s_own_symbols() -> None:
    if not SYMBOLS.is_dir():
        pytest.skip("KiCad's symbol libraries are not installed (Debian: kicad-symbols of the same version)")
    assert symbol_differences(SYMBOLS) == []


def test_pin_names_that_differ_from_a_library_s_are_listed(tmp_path: Path) -> None:
    parts = {"Interface_UART": "MAX3232", "Transistor_BJT": "BC817", "Converter_DCDC": "TSR_1-2450",
             "Regulator_Linear": "LM317_SOT-223", "74xx": "74HC595", "Connector": "DE9_Pins_MountingHoles"}  # fmt: skip
    for library, name in parts.items():
        pin = '(pin passive line (at 0 0 0) (length 1) (name "B") (number "1"))'
        base = f'(symbol "BASE" (symbol "BASE_1_1" {pin}))'
        names = ("BC817", "BC807") if name == "BC817" else (name,)
        symbols = " ".join(f'(symbol "{one}" (extends "BASE"))' for one in names)
        (tmp_path / f"{library}.kicad_sym").write_text(f"(lib {base} {symbols})")
    pins = "".join(
        f'(pin passive line (at 0 0 0) (length 1) (name "{n}") (number "{i}"))' for i, n in ((1, "K"), (2, "A"))
    )
    plates = pins.replace('"K"', '"~"').replace('"A"', '"~"')
    (tmp_path / "Device.kicad_sym").write_text(
        f'(lib (symbol "D_Schottky" (symbol "D_1" {pins})) (symbol "C_Polarized" (symbol "C_1" {plates})))'
    )
    found = symbol_differences(tmp_path)
    assert [line.split(":")[0] for line in found] == ["MAX3232", "BC817", "BC807", "TSR1", "LM317", "HC595", "DE9"]


def test_no_stroke_on_the_print_is_thinner_than_makers_print() -> None:
    for footprint in FOOTPRINTS.values():
        for drawing in footprint.drawings:
            if drawing.layer != "F.SilkS":
                continue
            if isinstance(drawing, StraightStroke | Circle):
                assert drawing.width_mm >= SILK_MM, footprint.name
            elif isinstance(drawing, Label):
                effects = text_effects(drawing.size_mm)[0]
                assert float(word(child(child(effects, "font"), "thickness"))) >= SILK_MM, footprint.name
