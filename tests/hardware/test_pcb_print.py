"""Print, lands and wires read back from the board's file, and drawn mistakes that must be named."""

import dataclasses
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from hardware.pcb.circuit.design import VARIANTS, build
from hardware.pcb.layout.footprints import FOOTPRINTS
from hardware.pcb.outputs import generated_files
from hardware.pcb.outputs.steps import STEPS, pictures
from hardware.pcb.proof import lands, printed
from hardware.pcb.proof.board_file import PrintedBoard, PrintedMark, SilkPart, read_board
from hardware.pcb.proof.mistakes import draw

LIBRARY = Path("/usr/share/kicad/footprints")


@cache
def board(variant: str = "rev-b") -> PrintedBoard:
    return read_board((generated_files.GENERATED / variant / f"{variant}.kicad_pcb").read_text(encoding="utf-8"))


@pytest.mark.parametrize("variant", VARIANTS)
def test_print_lands_and_wires_of_each_board_are_right(variant: str) -> None:
    assert printed.faults(board(variant), build(variant)) == []
    assert lands.faults(board(variant), build(variant)) == []


def test_a_part_of_the_circuit_that_is_not_on_the_board_is_named() -> None:
    without = dataclasses.replace(board(), parts={ref: part for ref, part in board().parts.items() if ref != "J1"})
    assert "J1 is not on the board" in lands.faults(without, build())


def with_part(ref: str, **changes: object) -> PrintedBoard:
    part = dataclasses.replace(board().parts[ref], **changes)  # type: ignore[arg-type]
    return dataclasses.replace(board(), parts={**board().parts, ref: part})


def marks_of(ref: str, change: Callable[[PrintedMark], PrintedMark | None]) -> PrintedBoard:
    return with_part(ref, marks=tuple(new for mark in board().parts[ref].marks if (new := change(mark)) is not None))


def labels(change: Callable[[PrintedMark], PrintedMark]) -> PrintedBoard:
    return dataclasses.replace(board(), labels=tuple(change(mark) for mark in board().labels))


def to_pad(number: str) -> Callable[[PrintedMark], PrintedMark]:
    part: SilkPart = board().parts["C1"]
    at = next(land.at for land in part.lands if land.number == number)
    return lambda mark: dataclasses.replace(mark, points=((at[0] + 1, at[1] + 1),)) if mark.text == "+" else mark


def renamed(**names: str) -> Callable[[PrintedMark], PrintedMark]:
    return lambda mark: dataclasses.replace(mark, text=names.get(mark.text, mark.text))


#: A wrong print, and the line that names it.
WRONG = (
    (lambda: marks_of("C1", to_pad("2")), "C1: its plus stands at the pad on GND, 1 is on +12V"),
    (lambda: marks_of("U1", renamed(PA4="PA5", PA5="PA4")), "U1: 'PA5' stands at the pad of PA4"),
    (lambda: marks_of("U2", renamed(TDI="TDO", TDO="TDI")), "U2: 'TDO' stands at the pad of TDI"),
    (lambda: marks_of("J3", renamed(**{str(n): str(6 - n) for n in range(1, 6)})),
     "J3: the mark of pin 5 stands at pad 1"),
    (lambda: marks_of("D6", lambda mark: None if len(mark.points) == 2 and mark.width_mm == 0.2 else mark),
     "D6 has 0 marks of its bar"),
    (lambda: marks_of("U3", renamed(IN="OUT", OUT="IN")), "U3: 'OUT' stands at the pad on +12V"),
    (lambda: marks_of("TP4", renamed(**{"+5V": "+12V"})), "TP4 says ['+12V'], it is on +5V"),
    (lambda: marks_of("R12", renamed(R12="R13")), "R12 is printed as R13"),
    (lambda: labels(renamed(**{"+12V-": "-12V+"})), "nobody knows what '-12V+' is about"),
    (lambda: labels(renamed(**{"12V": "BANK", "BANK": "12V"})),
     "'BANK' stands at the pad of JP1 on 5V_REG, expected 5V_BANK"),
    (lambda: labels(renamed(MODE="STOP", STOP="MODE")), "'MODE' stands at J7, it is about J5"),
    (lambda: labels(renamed(DD1="DD3", DD3="DD1")), "'DD3' stands at J4.1 on DD1_BP"),
    (lambda: labels(renamed(STOP="")), "'STOP' is printed 0 times"),
)  # fmt: skip


@pytest.mark.parametrize(("make", "line"), WRONG, ids=[line[:40] for _, line in WRONG])
def test_a_wrong_mark_is_named(make: Callable[[], PrintedBoard], line: str) -> None:
    assert line in printed.faults(make(), build())


def test_a_plus_and_minus_that_changed_sides_are_named_by_their_pads() -> None:
    width = 12.0
    turned = labels(
        lambda mark: (
            dataclasses.replace(mark, points=((mark.at[0] + width, mark.at[1]),)) if mark.text == "+12V-" else mark
        )
    )
    assert any(line.startswith("'+12V-' stands at") for line in printed.faults(turned, build()))
    swapped = with_part("J1", lands=tuple(
        dataclasses.replace(land, net={"VIN": "GND", "GND": "VIN"}[land.net]) for land in board().parts["J1"].lands
    ))  # fmt: skip
    assert "the + of '+12V-' stands at the pad of J1 on GND" in printed.faults(swapped, build())
    assert "J1.1 is on GND, the circuit has VIN" in lands.faults(swapped, build())


def land_of(ref: str, number: str, **changes: object) -> PrintedBoard:
    return with_part(ref, lands=tuple(
        dataclasses.replace(land, **changes) if land.number == number else land for land in board().parts[ref].lands  # type: ignore[arg-type]
    ))  # fmt: skip


#: A wrong land, and the line that names it.
LANDS = (
    (lambda: land_of("U5", "3", own_mm=(-2.475, -1.75)),
     "U5.3: 1.95 x 0.6 mm at -2.475, -1.75, the drawing has 1.95 x 0.6 mm at -2.475, -1.905"),
    (lambda: land_of("J3", "2", drill_mm=1.0),
     "J3.2: 1.6 x 1.6 mm at 2.77, 0, hole 1, the drawing has 1.6 x 1.6 mm at 2.77, 0, hole 1.1"),
    (lambda: land_of("D2", "K", size_mm=(2.0, 2.3)),
     "D2.K: 2 x 2.3 mm at -2.15, 0, the drawing has 2.5 x 2.3 mm at -2.15, 0"),
    (lambda: land_of("U2", "7", own_mm=(0.0, 15.3)),
     "U2.7: 1.7 x 1.7 mm at 0, 15.3, hole 1, the drawing has no such pad"),
    (lambda: with_part("D1", lands=board().parts["D1"].lands[:1]), "D1 lacks pad A"),
    (lambda: with_part("D1", footprint="D_SMB"), "D1 has the footprint D_SMB, D_SMA is ordered"),
)  # fmt: skip


@pytest.mark.parametrize(("make", "line"), LANDS, ids=[line[:12] for _, line in LANDS])
def test_a_wrong_land_is_named(make: Callable[[], PrintedBoard], line: str) -> None:
    assert line in lands.faults(make(), build())


@pytest.mark.parametrize(("by_mm", "is_good"), [(-0.42, False), (-0.41, True), (0.0, True), (0.29, True), (0.3, False)])
def test_the_plug_s_flange_clears_the_board_s_edge(by_mm: float, is_good: bool) -> None:
    # 7.41 mm from the second row to the edge; the flange's back is at 7.70 mm, and 7.0 mm would still hold the plug.
    moved = dataclasses.replace(board(), bottom_mm=board().bottom_mm + by_mm)
    assert [line.split(":")[0] for line in lands.faults(moved, build())] == ([] if is_good else ["J3"])


@pytest.mark.parametrize("variant", ["rev-b", "rev-c"])
def test_a_wire_on_its_neighbour_is_named_by_the_modules_own_pin_outs(variant: str) -> None:
    whole = board(variant)
    swap = {"DD1_BP": "DD2_BP", "DD2_BP": "DD1_BP"}
    part = whole.parts["U1"]
    wrong = dataclasses.replace(part, lands=tuple(
        dataclasses.replace(land, net=swap.get(land.net, land.net)) for land in part.lands
    ))  # fmt: skip
    found = lands.wire_faults(dataclasses.replace(whole, parts={**whole.parts, "U1": wrong}), build(variant))
    assert found == ["wire DD1: from DD2_BP at the BluePill to DD1, joined by nothing",
                     "wire DD2: from DD1_BP at the BluePill to DD2, joined by nothing"]  # fmt: skip
    silent = {ref: one for ref, one in whole.parts.items() if ref != "Q1"}
    (line,) = lands.wire_faults(dataclasses.replace(whole, parts=silent), build(variant))
    assert line.startswith("wire rst: from RST_REQ at the BluePill to ESP_EN")


def test_every_footprint_has_a_drawing_and_those_with_a_kicad_twin_are_its_pads() -> None:
    assert [name for name in FOOTPRINTS if lands.wanted_lands(name) is None] == []
    if not LIBRARY.is_dir():
        pytest.skip("KiCad's footprint library is not installed: pads are not compared with it")
    assert lands.kicad_differences(LIBRARY) == []


def test_a_table_that_differs_from_kicad_s_library_is_named(tmp_path: Path) -> None:
    for row in lands.table()["lands"].values():
        folder, _, file = row["kicad"].partition("/")
        target = tmp_path / f"{folder}.pretty" / f"{file}.kicad_mod"
        target.parent.mkdir(exist_ok=True)
        names = {"K": "1", "A": "2"}
        pads = "".join(
            f'(pad "{names.get(n, n)}" smd rect (at {x} {y}) (size {w} {h}){f" (drill {d})" if d else ""})'
            for n, x, y, w, h, d in row["pads"]
        )
        target.write_text(f"(footprint {pads})", encoding="utf-8")
    assert lands.kicad_differences(tmp_path) == []
    chip = tmp_path / "Resistor_SMD.pretty" / "R_0805_2012Metric.kicad_mod"
    drawn = chip.read_text(encoding="utf-8")
    chip.write_text(drawn.replace("1.025", "1.0254"), encoding="utf-8")
    assert lands.kicad_differences(tmp_path) == []
    chip.write_text(drawn.replace("1.025", "1.026"), encoding="utf-8")
    (line,) = lands.kicad_differences(tmp_path)
    assert line.startswith("R_0805: ")


@pytest.mark.parametrize(("ref", "line"), [("J1", "'+12V-' is about J1"), ("J2", "'+5V-' is about J2"), ("J4", "J4 ")])
def test_a_connector_that_circuit_or_board_lacks_is_named(ref: str, line: str) -> None:
    fewer = tuple(part for part in build().components if part.ref != ref)
    parts = {name: part for name, part in board().parts.items() if name != ref}
    without = dataclasses.replace(board(), parts=parts)
    assert any(found.startswith(line) for found in printed.faults(without, build()))
    if ref != "J4":
        assert any(
            found.startswith(line) for found in printed.faults(board(), dataclasses.replace(build(), components=fewer))
        )


def named(variant: str, seed: int, count: int) -> tuple[int, list[str]]:
    drawn = draw(build(variant), board(variant), seed, count)
    return len(drawn), [f"{one.kind}: {one.name}" for one in drawn if not one.is_named()]


def test_drawn_mistakes_of_order_print_land_and_net_are_named() -> None:
    count, missed = named("rev-b", seed=42, count=8)
    assert (count, missed) == (8, [])


@pytest.mark.soak
@pytest.mark.parametrize("variant", ["rev-b", "rev-c", "lm317"])
@pytest.mark.parametrize("seed", range(1, 6))
def test_at_least_95_percent_of_60_drawn_mistakes_are_named(variant: str, seed: int) -> None:
    count, missed = named(variant, seed, 60)
    assert count == 60
    assert len(missed) <= 3, missed


@pytest.mark.parametrize("variant", VARIANTS)
def test_every_bought_part_is_soldered_in_one_step_and_each_step_has_a_picture(variant: str) -> None:
    import re
    import xml.etree.ElementTree as ET

    for part in build(variant).components:
        steps = [step.title for step in STEPS if step.is_soldering and re.fullmatch(step.parts, part.ref)]
        assert len(steps) == int(part.part.bought), part.ref
    drawn = pictures(build(variant))
    assert len(drawn) == len(STEPS)
    for number, (name, text) in enumerate(drawn.items(), start=1):
        assert name == f"{variant}-step-{number:02}.svg"
        words = {element.text for element in ET.fromstring(text).iter() if element.text}  # noqa: S314 - our own
        notes = [note for pad, note in STEPS[number - 1].notes if pad.split(".")[0] in board(variant).parts]
        assert words >= set(notes)
