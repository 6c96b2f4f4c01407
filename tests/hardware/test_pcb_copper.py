"""Routing results as data: connected, wide enough, tied to their placement; stitching."""

import dataclasses
import shutil

import pytest

from hardware.pcb.checks import copper
from hardware.pcb.circuit.design import VARIANTS
from hardware.pcb.circuit.design import build as design_of
from hardware.pcb.circuit.netlist import DesignError, make
from hardware.pcb.layout import rules
from hardware.pcb.layout.footprints import FOOTPRINTS
from hardware.pcb.layout.placement import Placement, place, unturn
from hardware.pcb.layout.routing import (
    RoutingError,
    antenna_area,
    fingerprint,
    load_routes,
    placed_pads,
    router_input,
    run_router,
    turn,
)
from hardware.pcb.layout.shapes import PadKind
from hardware.pcb.outputs import generated_files
from hardware.pcb.outputs.pours import kept_stitches, load_stitches, stitch_at, stitches_text
from hardware.pcb.outputs.sexp import node


@pytest.mark.parametrize("variant", VARIANTS)
def test_every_net_is_one_piece_of_copper_as_wide_as_its_class(variant: str) -> None:
    design = design_of(variant)
    assert copper.faults(design, *generated_files.copper_of(design)) == []


def test_a_lost_track_a_thin_track_and_an_unknown_net_are_found() -> None:
    design = design_of()
    tracks, vias = generated_files.copper_of(design)
    lost = next(track for track in tracks if track.net == "RS_DTR")
    thin = next(track for track in tracks if track.net == "+5V")
    changed = [track for track in tracks if track.net != "RS_DTR"]
    changed = [dataclasses.replace(track, width_mm=0.25) if track is thin else track for track in changed]
    found = copper.faults(design, [*changed, dataclasses.replace(lost, net="NOWHERE")], vias)
    assert "track of NOWHERE, which is no net" in found
    assert any(fault.startswith("+5V: 0.25 mm wide") for fault in found)
    assert any(fault.startswith("RS_DTR is in") for fault in found)


def test_no_track_runs_below_the_antenna_and_all_copper_keeps_off_the_edge() -> None:
    left, top, right, bottom = antenna_area()
    tracks, vias = generated_files.copper_of(design_of())
    points = [point for track in tracks for point in (track.start_mm, track.end_mm)] + [via.at_mm for via in vias]
    assert not [point for point in points if left < point[0] < right and top < point[1] < bottom]
    rim = rules.EDGE_CLEARANCE_MM
    assert all(rim < x < rules.BOARD_WIDTH_MM - rim and rim < y < rules.BOARD_HEIGHT_MM - rim for x, y in points)


def test_pads_of_parts_never_overlap() -> None:
    pads = placed_pads(design_of())
    for index, first in enumerate(pads):
        for second in pads[index + 1 :]:
            if first.ref == second.ref or not first.layers & second.layers:
                continue
            x0, y0, x1, y1 = first.box_mm
            u0, v0, u1, v1 = second.box_mm
            assert x1 <= u0 or u1 <= x0 or y1 <= v0 or v1 <= y0, (first.ref, second.ref)


def test_routes_of_another_placement_are_refused(tmp_path) -> None:
    stale = tmp_path / "rev-b.txt"
    stale.write_text("# input 0123456789abcdef\n", encoding="utf-8")
    with pytest.raises(RoutingError):
        load_routes(design_of(), stale)
    with pytest.raises(RoutingError):
        load_routes(design_of(), tmp_path / "none.txt")


def test_broken_lines_of_routes_and_stitches_are_refused(tmp_path) -> None:
    broken = tmp_path / "rev-b.txt"
    first = (generated_files.HERE / "routes" / "rev-b.txt").read_text(encoding="utf-8").splitlines()[0]
    broken.write_text(f"{first}\nT GND zero\n", encoding="utf-8")
    with pytest.raises(RoutingError):
        load_routes(design_of(), broken)
    broken.write_text("1000000,2000000\n12\n", encoding="utf-8")
    with pytest.raises(RoutingError, match="stitches of rev-b, line 2"):
        load_stitches("rev-b", broken)
    with pytest.raises(RoutingError, match=r"cannot read none.txt"):
        load_stitches("rev-b", tmp_path / "none.txt")


def test_stitches_survive_writing_and_reading(tmp_path) -> None:
    file = tmp_path / "rev-b.txt"
    vias = [stitch_at(7.5, 15.0), stitch_at(22.5, 30.25)]
    file.write_text(stitches_text(vias), encoding="utf-8")
    assert load_stitches("rev-b", file) == vias


def test_a_stitch_is_kept_only_where_both_grounds_hold_its_whole_ring() -> None:
    square = [(98.0, 50.0), (118.0, 50.0), (118.0, 70.0), (98.0, 70.0)]
    half = [(98.0, 50.0), (108.0, 50.0), (108.0, 70.0), (98.0, 70.0)]

    def filled(points: list[tuple[float, float]]) -> list[object]:
        return node("filled_polygon", node("pts", *(node("xy", *point) for point in points)))

    vias = [stitch_at(5.0, 5.0), stitch_at(15.0, 5.0), stitch_at(9.9, 5.0)]
    assert kept_stitches(vias, {"GND:F.Cu": [filled(square)], "GND:B.Cu": [filled(half)]}) == vias[:1]


def test_a_part_without_a_place_is_named() -> None:
    design = design_of()
    more = dataclasses.replace(design, components=(*design.components, make("R99", "20k", ["+5V", "GND"])))
    with pytest.raises(DesignError, match="R99"):
        place(more)


@pytest.mark.parametrize("angle", [0, 90, 180, 270])
def test_unturning_an_offset_is_the_inverse_of_turning(angle: int) -> None:
    assert turn(unturn((2.0, -1.0), angle), Placement(x_mm=0, y_mm=0, angle_deg=angle)) == (2.0, -1.0)


def test_a_module_socket_has_the_pitch_and_drill_of_its_pins() -> None:
    for name, count in (("MODULE_BLUEPILL", 40), ("MODULE_ESP32_D1_MINI", 40), ("HEADER_2X12", 24)):
        pads = FOOTPRINTS[name].pads
        assert len(pads) == count
        assert {pad.drill_mm for pad in pads} == {1.0}
        assert all(pad.kind is PadKind.THROUGH for pad in pads)


@pytest.mark.soak
def test_the_router_finds_the_committed_result_again() -> None:
    if shutil.which("g++") is None and shutil.which("clang++") is None:
        pytest.skip("no C++ compiler: the router is not run")
    committed = (generated_files.HERE / "routes" / "rev-b.txt").read_text(encoding="utf-8")
    assert run_router(design_of()) == committed


COMPILER = """#!/bin/sh
for word; do target=$word; done
printf '#!/bin/sh\\ncat > /dev/null; echo T GND; exit %s\\n' "$ROUTER_CODE" > "$target"
chmod +x "$target"
exit "$COMPILER_CODE"
"""


@pytest.mark.parametrize(
    ("codes", "message"), [(("0", "0"), None), (("1", "0"), "does not compile"), (("0", "1"), "found no way")]
)
def test_the_router_s_result_carries_the_hash_of_its_input(codes, message, tmp_path, monkeypatch) -> None:
    compiler = tmp_path / "g++"
    compiler.write_text(COMPILER, encoding="utf-8")
    compiler.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    monkeypatch.setenv("COMPILER_CODE", codes[0])
    monkeypatch.setenv("ROUTER_CODE", codes[1])
    if message is None:
        assert run_router(design_of()) == f"# input {fingerprint(design_of())}\nT GND\n"
        return
    with pytest.raises(RoutingError, match=message):
        run_router(design_of())


def test_without_a_compiler_the_router_says_what_to_install(monkeypatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda _: None)
    with pytest.raises(RoutingError, match="no C\\+\\+ compiler found"):
        run_router(design_of())


def test_the_router_is_told_every_net_and_pad() -> None:
    text = router_input(design_of())
    assert f"nets {len(design_of().nets())}" in text
