"""The checks that need KiCad 9: rule checks, netlist, stitching, gerbers.

Invariant: they work on a copy; the committed files are only read.
"""

import tempfile
from pathlib import Path

from hardware.pcb.checks.results import CheckResult, judged, listed, skipped
from hardware.pcb.circuit.design import VARIANTS
from hardware.pcb.circuit.design import build as design_of
from hardware.pcb.layout.routing import load_routes
from hardware.pcb.outputs import generated_files, kicad_cli
from hardware.pcb.outputs.board import board_text
from hardware.pcb.outputs.pours import fill, kept_stitches, load_stitches, stitches_text
from hardware.pcb.outputs.schematic import placed_pins


def with_kicad() -> list[CheckResult]:
    """Run them all; without KiCad one line says so."""
    version = kicad_cli.version()
    if version is None:
        why = "KiCad 9 is not installed: ERC, DRC, netlist, pours, gerbers not checked"
        return [skipped("KiCad checks", "all", f"{why} (hint: tools/install_board_tools.sh)")]
    results = []
    for variant in VARIANTS:
        schematic = generated_files.GENERATED / variant / f"{variant}.kicad_sch"
        found = [str(one) for one in kicad_cli.erc(schematic)]
        results.append(listed("ERC", variant, found, f"0 errors, 0 warnings (KiCad {version})"))
        results.append(listed("netlist equals design", variant, netlist_differences(variant), "same nets, same pins"))
    for variant in VARIANTS:
        results += board_checks(variant)
    return results


def board_checks(variant: str) -> list[CheckResult]:
    """Check a board that is filled anew: rules and parity, stitching, gerbers."""
    with tempfile.TemporaryDirectory() as folder:
        board = generated_files.filled_project(variant, Path(folder))
        found = [str(one) for one in kicad_cli.drc(board)]
        files = generated_files.fabrication_files(board, Path(folder) / "fabrication")
    return [
        listed("DRC with parity", variant, found, "0 errors, 0 warnings, 0 unconnected"),
        _stitches(variant),
        gerbers_up_to_date(variant, files),
    ]


def netlist_differences(variant: str) -> list[str]:
    """Return where the netlist that KiCad reads from the schematic differs from the design."""
    design = design_of(variant)
    wanted = {(net, member) for net, members in design.nets().items() for member in members}
    # Pins left open have nets of their own in KiCad.
    found = {
        (net, member)
        for net, members in kicad_cli.netlist(generated_files.GENERATED / variant / f"{variant}.kicad_sch").items()
        if not net.startswith("unconnected-")
        for member in members
    }
    known = {(part.ref, pin.pin.number) for part in design.components for pin in placed_pins(part)}
    missing = [f"{net}: {ref}.{pin} is not in the schematic" for net, (ref, pin) in sorted(wanted - found)]
    extra = [f"{net}: {ref}.{pin} is only in the schematic" for net, (ref, pin) in sorted(found - wanted)]
    lost = [f"{ref}.{pin} has no pin in its symbol" for _, (ref, pin) in sorted(wanted) if (ref, pin) not in known]
    return missing + extra + lost


def stitches_of(variant: str) -> str:
    """Return the text of a variant's stitches as KiCad's filling gives it now."""
    design = design_of(variant)
    tracks, vias = load_routes(design)
    bare = fill(board_text(design, tracks, [via for via in vias if not via.is_stitch], {}))
    return stitches_text(kept_stitches([via for via in vias if via.is_stitch], bare))


def gerbers_up_to_date(variant: str, files: dict[str, str]) -> CheckResult:
    """Compare fabrication files with the committed archive."""
    old = generated_files.fabrication_archive(variant)
    changed = sorted(name for name in {*files, *old} if files.get(name) != old.get(name))
    words = f"{len(files)} files, the same again"
    return listed("gerbers up to date", variant, [f"{name} differs" for name in changed], words)


def _stitches(variant: str) -> CheckResult:
    same = stitches_of(variant) == stitches_text(load_stitches(variant))
    words = "filled again: the same vias" if same else "filled again: other vias (hint: python -m hardware.pcb stitch)"
    return judged("stitching", variant, same, words)
