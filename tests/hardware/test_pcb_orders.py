"""Order numbers: what they say by their makers' numbering, held against value, facts and footprint."""

import csv
import dataclasses
import io

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hardware.pcb.circuit.design import build
from hardware.pcb.circuit.electrical import bom_faults
from hardware.pcb.circuit.part_numbers import SERIES, UnreadableError, decode, disagreements
from hardware.pcb.circuit.parts import ACCESSORIES, PARTS, Part
from hardware.pcb.outputs.bom import csv_text, html_text

BOUGHT = [part for part in (*PARTS.values(), *(row[2] for row in ACCESSORIES)) if part.bought]


@pytest.mark.parametrize("part", BOUGHT, ids=lambda part: part.mpn)
def test_every_part_is_what_its_order_number_says(part: Part) -> None:
    assert disagreements(part) == []


#: Part of the catalogue, a wrong number for it, and what must be said.
WRONG = (
    ("TVS12", "SMBJ5.0A", "SMBJ5.0A says standoff_v 5, the part's facts have 15"),
    ("MAX3232", "MAX232EIDR", "MAX232EIDR says supply_min_v 4.5, the part's facts have 3"),
    ("4k7", "RC0805FR-07470RL", "RC0805FR-07470RL says ohm 470, its value is 4700"),
    ("20k", "RC0805JR-0720KL", "RC0805JR-0720KL says tolerance 0.05, the part's facts have 0.01"),
    ("C 22u", "GRM31CR61A226KE15L", "GRM31CR61A226KE15L says voltage_v 10, its value is 16"),
    ("C 100n", "CC0603KRX7R9BB104", "CC0603KRX7R9BB104 says package 0603, its footprint is for 0805"),
    ("C 100u", "EEU-FR1V100", "EEU-FR1V100 says farad 1e-05, the part's facts have 0.0001"),
    ("BUCK", "TSR 1-2433", "TSR 1-2433 says output_v 3.3, the part's facts have 5"),
    ("PTC", "MF-MSMF110/16-2", "MF-MSMF110/16-2 says voltage_max_v 16, the part's facts have 24"),
    ("HC595", "74HCT595D,118", "74HCT595D,118 says supply_min_v 4.5, the part's facts have 2"),
    ("BC807", "BC817-40,215", "BC817-40,215 says symbol NPN, its symbol is PNP"),
    ("TVS12", "SMBJ15CA", "SMBJ15CA says type SMBJ15CA, its value is SMBJ15A"),
    ("LED red", "KP-2012SGC", "KP-2012SGC says colour green, its value is red"),
    ("TERMINAL", "1729131", "'1729131' is no order number of Phoenix Contact"),
    ("C 100n", "CC0805KRX7R4BB104",
     "'CC0805KRX7R4BB104': '4' is no code for voltage_v (Yageo CC X7R V.10 (2014), global part number, seen)"),
)  # fmt: skip


@pytest.mark.parametrize(("key", "number", "line"), WRONG)
def test_a_number_of_another_value_voltage_or_package_is_named(key: str, number: str, line: str) -> None:
    assert line in disagreements(dataclasses.replace(PARTS[key], mpn=number))


@pytest.mark.parametrize(("key", "number"), [row[:2] for row in WRONG[:3]])
def test_the_bill_of_materials_names_the_parts_of_a_wrong_number(key: str, number: str) -> None:
    design, wrong = build(), dataclasses.replace(PARTS[key], mpn=number)
    parts = tuple(dataclasses.replace(one, part=wrong) if one.part.key == key else one for one in design.components)
    found = bom_faults(dataclasses.replace(design, components=parts))
    refs = {one.ref for one in parts if one.part.key == key}
    assert {line.split(":")[0] for line in found} == refs


@given(st.integers(100, 999), st.integers(-1, 4), st.sampled_from("BDFJ"))
def test_a_resistor_s_code_is_read_as_it_is_written(figures: int, power: int, tolerance: str) -> None:
    ohm = figures / 100 * 10.0**power
    unit, letter = next(
        (unit, letter) for unit, letter in ((1e6, "M"), (1e3, "K"), (1.0, "R"), (0.0, "R")) if ohm >= unit
    )
    text = f"{ohm / (unit or 1.0):.6g}"
    whole, _, rest = text.partition(".")
    said = decode("Yageo", f"RC0805{tolerance}R-07{whole}{letter}{rest}L")
    assert said["ohm"] == pytest.approx(ohm)
    assert said["tolerance"] == {"B": 0.001, "D": 0.005, "F": 0.01, "J": 0.05}[tolerance]


@given(st.integers(10, 99), st.integers(0, 7))
def test_three_digits_are_a_capacitor_s_picofarads(figures: int, noughts: int) -> None:
    said = decode("Yageo", f"CC0805KRX7R9BB{figures}{noughts}")
    assert said["farad"] == pytest.approx(figures * 10**noughts * 1e-12)


@settings(max_examples=50)
@given(st.text(max_size=20), st.sampled_from(sorted({series.maker for series in SERIES})))
def test_any_text_is_read_or_refused(text: str, maker: str) -> None:
    try:
        said = decode(maker, text)
    except UnreadableError as error:
        said = {"refused": str(error)}
    assert all(isinstance(value, str | float) for value in said.values())
    assert repr(text) in str(said.get("refused", repr(text)))


def test_a_maker_that_nobody_knows_is_refused() -> None:
    with pytest.raises(UnreadableError, match="no order number of Nobody"):
        decode("Nobody", "RC0805FR-074K7L")


def test_what_rests_on_memory_is_asked_beside_the_order() -> None:
    design = build("rev-c")
    rows = list(csv.DictReader(io.StringIO(csv_text(design))))
    assert all(row["Ask the distributor"] for row in rows if "memory" in row["Source"])
    assert {row["Part number"] for row in rows if not row["Ask the distributor"]} >= {
        "SMBJ15A",
        "B340A-13-F",
        "TSR 1-2450",
    }
    assert "takes BVH-21T-P1.1, fits B2P-VH?" in html_text(design)
    unasked = dataclasses.replace(PARTS["MAX3232"], ask="")
    parts = tuple(dataclasses.replace(one, part=unasked) if one.ref == "U5" else one for one in design.components)
    assert bom_faults(dataclasses.replace(design, components=parts)) == [
        "U5: from memory, and no question to the distributor"
    ]


@pytest.mark.parametrize("missing", [{"manufacturer": ""}, {"mpn": ""}, {"manufacturer": "", "mpn": ""}])
def test_a_part_is_bought_by_a_manufacturer_and_a_number(missing: dict[str, str]) -> None:
    with pytest.raises(ValueError, match="is bought but has no manufacturer or no part number"):
        dataclasses.replace(PARTS["TVS12"], **missing)  # type: ignore[arg-type]
    assert not dataclasses.replace(PARTS["TVS12"], bought=False, **missing).bought  # type: ignore[arg-type]
