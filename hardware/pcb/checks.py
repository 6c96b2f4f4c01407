"""Every check of the board as one table: what is asked, the verdict, the figures.

Plain Python always runs; KiCad, ngspice and gerbonara where they are installed, and a
check that could not run says so. Invariant: no check changes a file.
"""

import tempfile
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from adapter_sim.pinout import load_pinout
from hardware.pcb import build, copper, gerbers, kicad
from hardware.pcb.board import board_text
from hardware.pcb.design import BOARD_VARIANTS, VARIANTS
from hardware.pcb.design import build as design_of
from hardware.pcb.electrical import all_checks, bom_faults, netlist_faults
from hardware.pcb.pin_checks import BOARDS, count_by_rule, findings
from hardware.pcb.pours import fill_and_stitch
from hardware.pcb.routing import HERE, load_routes
from hardware.pcb.schematic import placed_pins
from hardware.pcb.spice.decks import decks
from hardware.pcb.spice.run import is_installed, simulate

#: What the rules must find on the thesis's two maps (docs/board.md lists them).
THESIS_FINDINGS = {"thesis-table3": 15, "thesis-board": 33}
SKIPPED, GOOD, BAD = "skipped", "ok", "FAIL"


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """One line of the table."""

    name: str
    subject: str
    verdict: str
    detail: str


def run_all() -> list[Result]:
    """Run every check, plain ones first."""
    return [*plain(), *with_kicad(), *simulations()]


def plain() -> list[Result]:
    """Run what needs nothing but Python."""
    pinout = load_pinout()
    results = []
    for board in BOARDS.values():
        found = findings(pinout, board)
        wanted = THESIS_FINDINGS.get(board.revision, 0)
        words = ", ".join(f"{count} {rule}" for rule, count in count_by_rule(found).items()) or "none"
        results.append(
            _result(
                "pin rules", board.revision, len(found) == wanted, f"{len(found)} findings ({words}), {wanted} expected"
            )
        )
    for variant in VARIANTS:
        design = design_of(variant)
        results.append(_listed("netlist complete", variant, netlist_faults(design), f"{len(design.nets())} nets"))
        results.append(
            _listed("bill of materials", variant, bom_faults(design), f"{len(design.components)} components")
        )
        figures = all_checks(design)
        results.append(
            _listed(
                "electrical", variant, [str(check) for check in figures if not check.is_good], f"{len(figures)} figures"
            )
        )
    for variant in BOARD_VARIANTS:
        design = design_of(variant)
        tracks, vias = load_routes(design)
        results.append(
            _listed(
                "copper connected",
                variant,
                copper.faults(design, tracks, vias),
                f"{len(tracks)} tracks, {len(vias)} vias",
            )
        )
    stale = build.stale_files()
    results.append(
        _listed(
            "generated files", "all", [f"{name} is stale" for name in stale], f"{len(build.sources())} files up to date"
        )
    )
    return results


def with_kicad() -> list[Result]:
    """Run what needs KiCad 9; without it one line says so."""
    version = kicad.version()
    if version is None:
        return [Result(name="KiCad checks", subject="all", verdict=SKIPPED,
                       detail="KiCad 9 is not installed: ERC, DRC, netlist, pours, gerbers not checked")]  # fmt: skip
    results = []
    for variant in VARIANTS:
        folder = build.GENERATED / variant
        results.append(
            _listed(
                "ERC",
                variant,
                [str(one) for one in kicad.erc(folder / f"{variant}.kicad_sch")],
                f"0 findings (KiCad {version})",
            )
        )
        results.append(_listed("netlist equals design", variant, netlist_differences(variant), "same nets, same pins"))
    for variant in BOARD_VARIANTS:
        board = build.GENERATED / variant / f"{variant}.kicad_pcb"
        results.append(
            _listed(
                "DRC with parity",
                variant,
                [str(one) for one in kicad.drc(board)],
                "0 errors, 0 warnings, 0 unconnected",
            )
        )
        results.append(_pours(variant))
        results += _gerbers(variant)
    return results


def simulations() -> list[Result]:
    """Run every deck; without ngspice one line says so."""
    if not is_installed():
        return [Result(name="simulation", subject="all", verdict=SKIPPED, detail="ngspice is not installed")]
    results = []
    for deck in decks():
        verdicts = simulate(deck).verdicts()
        words = "; ".join(f"{limit.measure} {value:.4g} {limit.unit}" for limit, value, _ in verdicts)
        results.append(_result("simulation", deck.name, all(good for *_, good in verdicts), words))
    return results


def netlist_differences(variant: str) -> list[str]:
    """Return where the netlist that KiCad reads from the schematic differs from the design."""
    design = design_of(variant)
    wanted = {(net, member) for net, members in design.nets().items() for member in members}
    # A pin that several of a symbol's rows share has one entry; pins left open have nets of their own.
    found = {
        (net, member)
        for net, members in kicad.netlist(build.GENERATED / variant / f"{variant}.kicad_sch").items()
        if not net.startswith("unconnected-")
        for member in members
    }
    known = {(part.ref, pin.pin.number) for part in design.components for pin in placed_pins(part)}
    missing = [f"{net}: {ref}.{pin} is not in the schematic" for net, (ref, pin) in sorted(wanted - found)]
    extra = [f"{net}: {ref}.{pin} is only in the schematic" for net, (ref, pin) in sorted(found - wanted)]
    lost = [f"{ref}.{pin} has no pin in its symbol" for _, (ref, pin) in sorted(wanted) if (ref, pin) not in known]
    return missing + extra + lost


def table(results: list[Result]) -> str:
    """Return the table that a person reads; the last line sums up."""
    widths = [max(len(getattr(one, name)) for one in results) for name in ("name", "subject", "verdict")]
    lines = [
        f"{one.verdict:<{widths[2]}}  {one.name:<{widths[0]}}  {one.subject:<{widths[1]}}  {one.detail}"
        for one in results
    ]
    counts = {verdict: sum(one.verdict == verdict for one in results) for verdict in (GOOD, BAD, SKIPPED)}
    return "\n".join([*lines, f"{counts[GOOD]} ok, {counts[BAD]} failed, {counts[SKIPPED]} skipped"])


def _pours(variant: str) -> Result:
    design = design_of(variant)
    tracks, vias = load_routes(design)
    board: Callable[..., str] = partial(board_text, design, tracks)
    same = fill_and_stitch(board, vias) == (HERE / "pours" / f"{variant}.txt").read_text(encoding="utf-8")
    return _result(
        "pours up to date", variant, same, "filled again: the same" if same else "filled again: differs (make board)"
    )


def _gerbers(variant: str) -> list[Result]:
    with tempfile.TemporaryDirectory() as folder:
        files = build.fabrication_files(variant, Path(folder) / "fabrication")
    kept = build.GENERATED / variant / f"{variant}-gerbers.zip"
    if not kept.exists():
        return [_listed("gerbers up to date", variant, [f"{kept.name} is missing (hint: make board)"], "")]
    with zipfile.ZipFile(kept) as archive:
        old = {name: archive.read(name).decode() for name in archive.namelist()}
    changed = sorted(name for name in {*files, *old} if files.get(name) != old.get(name))
    results = [
        _listed(
            "gerbers up to date",
            variant,
            [f"{name} differs" for name in changed],
            f"{len(files)} files, the same again",
        )
    ]
    if not gerbers.is_installed():
        return [
            *results,
            Result(name="gerbers re-read", subject=variant, verdict=SKIPPED, detail="gerbonara is not installed"),
        ]
    design = design_of(variant)
    _, vias = load_routes(design)
    from hardware.pcb.pours import load_pours

    _, stitches = load_pours(variant)
    reading = gerbers.read(old)
    words = (
        f"{reading.width_mm:g} x {reading.height_mm:g} mm, {reading.copper_layers} copper layers, "
        f"{reading.plated} + {reading.unplated} holes"
    )
    found = gerbers.faults(design, [*(via for via in vias if not via.is_stitch), *stitches], reading)
    return [*results, _listed("gerbers re-read", variant, found, words)]


def _result(name: str, subject: str, is_good: bool, detail: str) -> Result:
    return Result(name=name, subject=subject, verdict=GOOD if is_good else BAD, detail=detail)


def _listed(name: str, subject: str, faults: list[str], detail: str) -> Result:
    words = f"{len(faults)}: {faults[0]}" if faults else detail
    return _result(name, subject, not faults, words)
