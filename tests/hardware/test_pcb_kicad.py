"""What KiCad says of the board (where it is installed), and how we read it (everywhere)."""

import json
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from hardware.pcb.checks import kicad_checks
from hardware.pcb.checks.results import CheckStatus
from hardware.pcb.circuit.design import VARIANTS
from hardware.pcb.circuit.design import build as design_of
from hardware.pcb.layout.routing import RoutingError
from hardware.pcb.outputs import generated_files, kicad_cli, pictures, pours
from hardware.pcb.outputs.pours import fill
from simbase.errors import MissingDependencyError

needs_kicad = pytest.mark.skipif(
    kicad_cli.version() is None,
    reason="KiCad 9 is not installed: rule checks of the board are not run (hint: make board)",
)


@needs_kicad
@pytest.mark.parametrize("variant", VARIANTS)
def test_the_electrical_rule_check_finds_nothing(variant: str) -> None:
    assert kicad_cli.erc(generated_files.GENERATED / variant / f"{variant}.kicad_sch") == []


@needs_kicad
@pytest.mark.parametrize("variant", VARIANTS)
def test_the_schematic_s_netlist_is_the_design(variant: str) -> None:
    assert kicad_checks.netlist_differences(variant) == []


@needs_kicad
@pytest.mark.soak  # `make board` runs it after each change of a board, and its reports are committed
@pytest.mark.parametrize("variant", ["rev-b", "rev-c"])
def test_a_board_passes_the_design_rule_check_with_parity_and_gives_the_committed_gerbers(variant: str) -> None:
    results = kicad_checks.board_checks(variant)
    assert [result for result in results if result.verdict is not CheckStatus.GOOD] == []
    assert len(results) == 3


#: Closes what is narrower than 0.08 mm in each pour, and writes the areas in mm² that this adds.
_SLITS = """
import sys, pcbnew
board = pcbnew.LoadBoard(sys.argv[1])
for zone in board.Zones():
    for layer in zone.GetLayerSet().Seq() if not zone.GetIsRuleArea() else ():
        shape = pcbnew.SHAPE_POLY_SET(zone.GetFilledPolysList(layer))
        closed = pcbnew.SHAPE_POLY_SET(shape)
        closed.Inflate(40000, pcbnew.CORNER_STRATEGY_ROUND_ALL_CORNERS, 5000)
        closed.Deflate(42000, pcbnew.CORNER_STRATEGY_ROUND_ALL_CORNERS, 5000)
        for area in board.Zones():
            if area.GetIsRuleArea():
                closed.BooleanSubtract(area.Outline())
        closed.BooleanSubtract(shape)
        for number in range(closed.OutlineCount()):
            print(closed.Outline(number).Area() * 1e-12)
"""
#: More than the round of a corner, measured 0.00008; a slit of 0.02 mm across a neck of a quarter millimetre has 0.005,
#: and the smallest that KiCad leaves 0.0008.
CORNER_MM2 = 0.0002


def widest_slit_mm2(folder: Path) -> float:
    """Return the largest area of a slit in any pour of rev B."""
    board = generated_files.filled_project("rev-b", folder)
    done = subprocess.run(["/usr/bin/python3", "-c", _SLITS, str(board)], capture_output=True, text=True, check=True)
    return max(float(line) for line in done.stdout.splitlines())


@needs_kicad
@pytest.mark.soak
def test_no_slit_of_a_pour_is_too_narrow_to_be_etched(monkeypatch, tmp_path) -> None:
    assert widest_slit_mm2(tmp_path) < CORNER_MM2
    monkeypatch.setattr(pours, "SLIT_MM", 0.0)
    assert widest_slit_mm2(tmp_path) > CORNER_MM2


@needs_kicad
def test_the_rule_check_sees_a_part_that_the_schematic_lacks(tmp_path) -> None:
    source = generated_files.GENERATED / "rev-b"
    for file in source.iterdir():
        if file.suffix in {".kicad_sch", ".kicad_pro"} or "table" in file.name:
            (tmp_path / file.name).write_bytes(file.read_bytes())
    page = (tmp_path / "rev-b-serial.kicad_sch").read_text(encoding="utf-8")
    (tmp_path / "rev-b-serial.kicad_sch").write_text(page.replace('"RS_DTR"', '"RS_DTS"', 1), encoding="utf-8")
    assert kicad_cli.erc(tmp_path / "rev-b.kicad_sch")


ERC = {"sheets": [{"violations": [{"type": "pin_not_driven", "severity": "error", "description": "Input not driven",
                                   "items": [{"description": "U1 pin 3"}, {"description": "U2 pin 4"}]}]}]}  # fmt: skip


def test_a_finding_is_read_with_its_severity_and_places(fake_kicad, tmp_path) -> None:
    fake_kicad(json.dumps(ERC))
    found = kicad_cli.erc(tmp_path / "x.kicad_sch")
    assert [str(one) for one in found] == ["error pin_not_driven: Input not driven: U1 pin 3; U2 pin 4"]


def test_all_three_lists_of_the_design_rule_check_are_read(fake_kicad, tmp_path) -> None:
    def entry(kind: str) -> dict[str, object]:
        return {"type": kind, "severity": "warning", "description": kind, "items": []}

    lists = {"violations": [entry("a")], "unconnected_items": [entry("b")], "schematic_parity": [entry("c")]}
    fake_kicad(json.dumps(lists))
    assert [one.kind for one in kicad_cli.drc(tmp_path / "x.kicad_pcb")] == ["a", "b", "c"]


def test_the_netlist_is_read_by_net(fake_kicad, tmp_path) -> None:
    fake_kicad('(export (nets (net (code "1") (name "+5V") (node (ref "R1") (pin "2")) (node (ref "C1") (pin "1")))))')
    assert kicad_cli.netlist(tmp_path / "x.kicad_sch") == {"+5V": [("C1", "1"), ("R1", "2")]}


def test_differences_of_the_netlist_are_named_on_both_sides(monkeypatch) -> None:
    nets = {net: list(members) for net, members in design_of("rev-b").nets().items()}
    nets["RS_DTR"].remove(("TP11", "1"))
    nets["+5V"].append(("R99", "1"))
    nets["unconnected-(U1-Pad3)"] = [("U1", "3")]
    monkeypatch.setattr(kicad_cli, "netlist", lambda _: nets)
    assert kicad_checks.netlist_differences("rev-b") == [
        "RS_DTR: TP11.1 is not in the schematic", "+5V: R99.1 is only in the schematic"]  # fmt: skip


def test_fabrication_files_lose_their_dates(fake_kicad, tmp_path) -> None:
    fake_kicad("G04 Created by KiCad (9.0.8) date 2025-01-01*\nG01*\n; #@! TF.CreationDate,2025\n")
    files = generated_files.fabrication_files(tmp_path / "board.kicad_pcb", tmp_path / "out")
    assert files == {"board-F_Cu.gtl": "G01*\n", "board-PTH.drl": "G01*\n"}
    monkeyed = kicad_checks.gerbers_up_to_date("rev-b", files)
    assert monkeyed.verdict is CheckStatus.BAD


def test_reports_lose_their_dates_and_are_named_by_variant(fake_kicad, tmp_path) -> None:
    fake_kicad("ERC report (2025-01-01, Encoding UTF8)\n** Created on 2025-01-01 **\n** ERC messages: 0\n")
    board = tmp_path / "rev-b.kicad_pcb"
    assert kicad_cli.reports("rev-b", tmp_path / "rev-b.kicad_sch", board) == {
        "rev-b-erc.rpt": "** ERC messages: 0\n", "rev-b-drc.rpt": "** ERC messages: 0\n"}  # fmt: skip


@pytest.mark.parametrize("variant", VARIANTS)
def test_the_committed_reports_are_empty(variant: str) -> None:
    folder = generated_files.GENERATED / variant
    assert "ERC messages: 0  Errors 0  Warnings 0" in (folder / f"{variant}-erc.rpt").read_text(encoding="utf-8")
    report = (folder / f"{variant}-drc.rpt").read_text(encoding="utf-8")
    for line in ("Found 0 DRC violations", "Found 0 unconnected pads", "Found 0 Footprint errors"):
        assert line in report


def test_a_failing_kicad_is_quoted(fake_kicad, tmp_path) -> None:
    fake_kicad(error="cannot load board")
    with pytest.raises(kicad_cli.KicadFailedError, match="pcb drc --severity-all: cannot load board"):
        kicad_cli.drc(tmp_path / "x.kicad_pcb")


def test_an_older_kicad_and_none_are_missing(fake_kicad, monkeypatch, tmp_path) -> None:
    fake_kicad(version="6.0.11")
    with pytest.raises(MissingDependencyError, match="KiCad 9 is not installed"):
        kicad_cli.erc(tmp_path / "x.kicad_sch")
    kicad_cli.version.cache_clear()
    monkeypatch.setenv("PATH", str(tmp_path))
    assert kicad_cli.version() is None
    (result,) = kicad_checks.with_kicad()
    assert result.verdict is CheckStatus.SKIPPED
    assert "ERC, DRC, netlist, pours, gerbers not checked" in result.detail


def test_the_filling_is_read_by_net_and_layer(fake_kicad) -> None:
    polygon = '(filled_polygon (layer "F.Cu") (pts (xy 1 2) (xy 3 4) (xy 5 6)))'
    fake_kicad(f'(kicad_pcb (zone (net 1) (net_name "GND") {polygon}) (zone (net 2) (net_name "+5V")))')
    assert list(fill("(kicad_pcb)")) == ["GND:F.Cu"]


def test_a_board_that_kicad_cannot_fill_and_a_python_without_kicad_are_errors(fake_kicad, monkeypatch) -> None:
    fake_kicad(error="yes")
    with pytest.raises(RoutingError, match="KiCad could not fill the pours"):
        fill("(kicad_pcb)")
    monkeypatch.delenv("PYTHONPATH")
    for pythons in (("/nonexistent/python3", None), (sys.executable,)):
        monkeypatch.setattr(pours, "_PYTHONS", pythons)
        with pytest.raises(MissingDependencyError, match="Python module"):
            fill("(kicad_pcb)")


def test_a_filled_project_is_a_copy_with_its_library(fake_kicad, tmp_path) -> None:
    fake_kicad('(kicad_pcb (zone (net_name "GND") (filled_polygon (layer "B.Cu") (pts (xy 1 2) (xy 3 4) (xy 5 6)))))')
    board = generated_files.filled_project("rev-b", tmp_path)
    assert "filled_polygon" in board.read_text(encoding="utf-8")
    assert (tmp_path / "library" / "adapter.kicad_sym").exists()
    assert (tmp_path / "rev-b" / "rev-b.kicad_pro").exists()


def test_board_checks_make_one_line_each(fake_kicad, monkeypatch) -> None:
    monkeypatch.setattr(kicad_checks, "VARIANTS", ("lm317",))
    monkeypatch.setattr(kicad_cli, "drc", lambda _: [])
    monkeypatch.setattr(kicad_cli, "erc", lambda _: [])
    monkeypatch.setattr(kicad_cli, "netlist", lambda path: design_of(path.stem).nets())
    monkeypatch.setattr(kicad_checks, "fill", lambda _: {})
    monkeypatch.setattr(generated_files, "fill", lambda _: {})
    fake_kicad("G01*\n")
    results = kicad_checks.with_kicad()
    names = [result.name for result in results if result.subject == "lm317"]
    assert names == ["ERC", "netlist equals design", "DRC with parity", "stitching", "gerbers up to date"]
    verdicts = {result.name: result.verdict for result in results}
    assert verdicts["ERC"] is CheckStatus.GOOD
    assert verdicts["stitching"] is verdicts["gerbers up to date"] is CheckStatus.BAD


def test_an_archive_is_read_back(tmp_path) -> None:
    folder = tmp_path / "rev-b"
    folder.mkdir()
    assert generated_files.fabrication_archive("rev-b", tmp_path) == {}
    (folder / "rev-b-gerbers.zip").write_bytes(generated_files.archive({"a.gbr": "one"}))
    assert generated_files.fabrication_archive("rev-b", tmp_path) == {"a.gbr": "one"}
    with zipfile.ZipFile(folder / "rev-b-gerbers.zip") as kept:
        assert kept.infolist()[0].date_time == (1980, 1, 1, 0, 0, 0)


def test_pictures_are_rendered_and_shrunk(tmp_path, monkeypatch) -> None:
    image = pytest.importorskip("PIL.Image", reason="Pillow is not installed")
    monkeypatch.setattr(generated_files, "PICTURES", tmp_path)
    monkeypatch.setattr(kicad_cli, "picture", lambda _, file, *__: image.new("RGB", (8, 8), "green").save(file))
    board = tmp_path / "rev-b.kicad_pcb"
    board.write_text("(kicad_pcb)", encoding="utf-8")
    names = [path.name for path in pictures.board_pictures("rev-b", board)]
    assert names == ["rev-b-top.png", "rev-b-bottom.png", "rev-b-view.png", "rev-b-bare.png"]
    assert [path.name for path in pictures.board_pictures("lm317", board)] == ["lm317-top.png"]


def test_schematic_pages_are_drawn_by_number(tmp_path, monkeypatch) -> None:
    image = pytest.importorskip("PIL.Image", reason="Pillow is not installed")
    pages = []

    def pdftoppm(command: list[str], **_: object) -> None:
        pages.append(command[command.index("-f") + 1])
        image.new("RGB", (8, 8), "white").save(f"{command[-1]}.png")

    monkeypatch.setattr(generated_files, "PICTURES", tmp_path)
    monkeypatch.setattr(kicad_cli, "schematic_pdf", lambda *_: None)
    monkeypatch.setattr(pictures.subprocess, "run", pdftoppm)
    monkeypatch.setattr(pictures.shutil, "which", lambda _: "/usr/bin/pdftoppm")
    names = [path.name for path in pictures.schematic_pictures("rev-c")]
    assert (names, pages) == (["rev-c-serial.png", "rev-c-modules.png", "rev-c-supply.png"], ["5", "2", "4"])
    monkeypatch.setattr(pictures.shutil, "which", lambda _: None)
    assert pictures.schematic_pictures("rev-b") == []


def test_a_step_file_has_no_date(fake_kicad, tmp_path) -> None:
    fake_kicad("FILE_NAME('b.step','2026-01-02T03:04:05',('Pcbnew'));")
    kicad_cli.step(tmp_path / "b.kicad_pcb", tmp_path / "b.step")
    assert (tmp_path / "b.step").read_text(encoding="utf-8") == "FILE_NAME('b.step','',('Pcbnew'));"
