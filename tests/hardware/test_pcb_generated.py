"""Generated files: up to date, the same again, complete, readable."""

import csv
import io
import re
import xml.etree.ElementTree as ET

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hardware.pcb.checks import gerbers, suite
from hardware.pcb.checks.results import CheckStatus, table
from hardware.pcb.circuit.design import VARIANTS
from hardware.pcb.circuit.design import build as design_of
from hardware.pcb.layout.placement import place
from hardware.pcb.outputs import generated_files, project
from hardware.pcb.outputs.bom import rows
from hardware.pcb.outputs.sexp import QuotedText, SexpError, child, children, node, number, parse, render, word


@pytest.fixture(scope="module")
def sources() -> dict[str, str]:
    return generated_files.sources()


def test_every_committed_file_is_what_the_design_gives_now(sources: dict[str, str]) -> None:
    assert generated_files.stale_files(sources) == []


def test_missing_and_changed_files_are_written_and_others_left_alone(tmp_path, sources, monkeypatch) -> None:
    monkeypatch.setattr(generated_files, "sources", lambda: sources)
    assert len(generated_files.write_sources(tmp_path)) == len(sources)
    changed = tmp_path / "rev-b" / "rev-b-bom.csv"
    changed.write_text("stale", encoding="utf-8")
    (tmp_path / "rev-b" / "rev-b.kicad_pcb").unlink()
    assert sorted(generated_files.stale_files(sources, tmp_path)) == ["rev-b/rev-b-bom.csv", "rev-b/rev-b.kicad_pcb"]
    assert sorted(generated_files.write_sources(tmp_path)) == ["rev-b/rev-b-bom.csv", "rev-b/rev-b.kicad_pcb"]
    assert generated_files.write_sources(tmp_path) == []


@pytest.mark.parametrize("variant", VARIANTS)
def test_the_board_file_has_every_part_its_net_names_and_no_filling(variant: str, sources: dict[str, str]) -> None:
    tree = parse(sources[f"{variant}/{variant}.kicad_pcb"])
    parts = children(tree, "footprint")
    design = design_of(variant)
    assert len(parts) == len(design.components)
    names = {word(net, 2) for net in children(tree, "net")}
    assert set(design.nets()) <= names
    assert [children(zone, "filled_polygon") for zone in children(tree, "zone")].count([]) == len(
        children(tree, "zone")
    )


def test_every_pad_of_the_board_stands_in_the_net_of_the_design(sources: dict[str, str]) -> None:
    tree = parse(sources["rev-b/rev-b.kicad_pcb"])
    found: dict[str, set[tuple[str, str]]] = {}
    for part in children(tree, "footprint"):
        ref = next(word(entry, 2) for entry in children(part, "property") if word(entry) == "Reference")
        for pad in children(part, "pad"):
            for net in children(pad, "net"):
                found.setdefault(word(net, 2), set()).add((ref, word(pad)))
    wanted = {net: set(members) for net, members in design_of("rev-b").nets().items()}
    assert {net: members for net, members in found.items() if not net.startswith("unconnected-")} == wanted


@pytest.mark.parametrize("variant", VARIANTS)
def test_bill_of_materials_counts_each_bought_part_once(variant: str, sources: dict[str, str]) -> None:
    lines = list(csv.DictReader(io.StringIO(sources[f"{variant}/{variant}-bom.csv"])))
    design = design_of(variant)
    bought = sum(component.part.bought for component in design.components)
    sockets = sum(row.quantity for row in rows(design) if not row.part.footprint)
    assert sum(int(line["Quantity"]) for line in lines) == bought + sockets
    assert all(line["Part number"] and line["Manufacturer"] for line in lines)


def test_the_interactive_page_loads_nothing_and_names_every_part(sources: dict[str, str]) -> None:
    page = sources["rev-b/rev-b-bom.html"]
    assert "@" not in page.split("<script>")[0].replace("@media", "")
    assert "src=" not in page
    assert "http" not in page.replace("http://www.w3.org/2000/svg", "")
    for component in design_of("rev-b").components:
        assert f'id="{component.ref}"' in page


def test_placement_file_is_the_surface_parts_from_the_lower_left_corner(sources: dict[str, str]) -> None:
    lines = {line["Reference"]: line for line in csv.DictReader(io.StringIO(sources["rev-b/rev-b-placement.csv"]))}
    at = place(design_of("rev-b"))["U5"]
    assert (lines["U5"]["X mm"], lines["U5"]["Y mm"]) == (f"{at.x_mm:.3f}", f"{100 - at.y_mm:.3f}")
    assert "J1" not in lines
    assert "TP1" not in lines


@pytest.mark.parametrize("variant", VARIANTS)
def test_the_assembly_drawing_is_xml_with_a_group_for_each_part(variant: str, sources: dict[str, str]) -> None:
    root = ET.fromstring(sources[f"{variant}/{variant}-assembly.svg"])  # noqa: S314 - our own file
    groups = {element.get("id") for element in root.iter() if element.get("class") == "part"}
    assert groups == {component.ref for component in design_of(variant).components}


def test_power_nets_have_wide_copper_and_severities_are_the_defaults() -> None:
    text = project.project_text(design_of("rev-b"))
    assert text.count('"rule_severities": {}') == 2
    assert '"track_width": 0.8' in text
    assert '"pattern": "+5V"' in text


@pytest.mark.parametrize("variant", VARIANTS)
def test_committed_gerbers_are_read_back_by_another_library(variant: str) -> None:
    if not gerbers.is_installed():
        pytest.skip("gerbonara is not installed: the gerbers are not re-read (hint: make board-tools)")
    result = suite.gerbers_reread(variant)
    assert result.verdict is CheckStatus.GOOD, result.detail


def test_gerbers_of_another_size_or_with_other_holes_are_found() -> None:
    reading = gerbers.GerberReading(width_mm=99.0, height_mm=100.0, layers=("top copper",), copper_layers=1, plated=3,
                                    unplated=4, smallest_drill_mm=0.3)  # fmt: skip
    found = gerbers.faults(design_of(), generated_files.copper_of(design_of())[1], reading)
    assert found[:3] == ["width is 99, the design has 100", "copper layers is 1, the design has 2",
                         "plated holes is 3, the design has 359"]  # fmt: skip
    assert "layer bottom mask is missing" in found


def test_a_hole_that_stands_elsewhere_in_the_gerbers_is_named() -> None:
    reading = gerbers.GerberReading(width_mm=100.0, height_mm=100.0, layers=(), copper_layers=2, plated=359, unplated=4,
                              smallest_drill_mm=0.3, holes=frozenset({(4.0, 4.0, 3.2), (5.0, 96.0, 3.2)}))  # fmt: skip
    found = gerbers.faults(design_of(), generated_files.copper_of(design_of())[1], reading)
    assert "a hole of 3.2 mm at 5, 96" in found
    assert "no hole of 3.2 mm at 4, 96" in found
    assert "no hole of 3.2 mm at 4, 4" not in found


def test_a_board_without_gerbers_or_without_the_library_says_so(monkeypatch) -> None:
    monkeypatch.setattr(gerbers, "is_installed", lambda: False)
    assert suite.gerbers_reread("rev-b").verdict is CheckStatus.SKIPPED
    monkeypatch.setattr(generated_files, "fabrication_archive", lambda _: {})
    assert suite.gerbers_reread("rev-c").detail == "1: there is no archive (hint: make board)"


def test_an_archive_of_the_same_files_is_the_same_and_says_no_date() -> None:
    files = {"b.gbr": "two", "a.gbr": "one"}
    assert generated_files.archive(files) == generated_files.archive(dict(reversed(list(files.items()))))


def test_the_plain_checks_all_pass_and_are_explained(sources: dict[str, str]) -> None:
    results = suite.plain()
    assert [result for result in results if result.verdict is CheckStatus.BAD] == []
    assert {result.subject for result in results if result.name == "pin rules"} == {
        "rev-b", "rev-c", "thesis-table3", "thesis-board"}  # fmt: skip
    assert table(results).splitlines()[-1].startswith(f"{len(results)} ok, 0 failed") or "skipped" in table(results)
    # Built a second time, whatever was built is byte for byte what is committed.
    (second,) = [result.detail for result in results if result.name == "generated files"]
    assert second == f"{len(sources)} files up to date"
    page = (generated_files.SIMULATION_PAGE.parent / "board.md").read_text(encoding="utf-8")
    explained = set(re.findall(r"^\| ([A-Za-z -]+?) \| ", page, re.MULTILINE))
    with_tools = {"ERC", "DRC with parity", "netlist equals design", "stitching", "gerbers up to date", "simulation"}
    assert {result.name for result in results} | with_tools <= explained


WORDS = st.text(st.characters(codec="ascii", exclude_characters='()" \t\r\n', categories=["L", "N", "P"]), min_size=1)
TREES = st.recursive(
    st.one_of(WORDS, st.text().map(QuotedText)),
    lambda items: st.lists(items, max_size=4).map(lambda tail: ["n", *tail]),
)


@settings(max_examples=60)
@given(st.lists(TREES, max_size=5))
def test_what_is_rendered_is_read_back(items: list[object]) -> None:
    tree = ["root", *items]
    assert parse(render(tree)) == tree


@pytest.mark.parametrize("text", ["", "word", "(a (b)", '"text"'])
def test_a_text_that_is_no_list_is_refused(text: str) -> None:
    with pytest.raises(SexpError):
        parse(text)


def test_a_missing_list_or_word_is_named() -> None:
    tree = node("pad", node("at", 1, 2.50))
    assert word(child(tree, "at"), 2) == "2.5"
    with pytest.raises(SexpError, match=r"no \(net"):
        child(tree, "net")
    with pytest.raises(SexpError, match="no word at 1"):
        word(tree)


def test_coordinates_have_six_decimals_at_most() -> None:
    assert [number(value) for value in (1.0, -0.0, 2.5400000001, -0.1)] == ["1", "0", "2.54", "-0.1"]
