"""Every check of the board: what is asked, the verdict, the figures.

Plain Python always runs; KiCad, ngspice and gerbonara where they are installed, and a
check that could not run says so. Invariant: no check changes a file.
"""

from collections import Counter

from adapter_sim.pinout import load_pinout
from hardware.pcb.checks import copper, gerbers, kicad_checks
from hardware.pcb.checks.pin_checks import BOARDS, count_by_rule, findings
from hardware.pcb.checks.results import CheckResult, judged, listed, skipped
from hardware.pcb.circuit.design import VARIANTS
from hardware.pcb.circuit.design import build as design_of
from hardware.pcb.circuit.electrical import all_checks, bom_faults, netlist_faults
from hardware.pcb.circuit.netlist import BoardDesign
from hardware.pcb.outputs import generated_files
from hardware.pcb.proof import lands, printed
from hardware.pcb.proof.board_file import read_board
from hardware.pcb.proof.expected import differences
from hardware.pcb.spice import run
from hardware.pcb.spice.decks import decks
from hardware.pcb.spice.run import is_installed, simulate

#: What the rules must find on the thesis's two maps (docs/board.md lists them).
THESIS_FINDINGS = {
    "thesis-table3": {"double": 1, "flash": 6, "input-only": 1, "jtag": 2, "no-pin": 1, "strap": 4},
    "thesis-board": {"5V": 19, "double": 1, "flash": 1, "input-only": 1, "jtag": 2, "no-pin": 5, "strap": 4},
}


def run_all() -> list[CheckResult]:
    """Run every check, plain ones first."""
    return [*plain(), *kicad_checks.with_kicad(), *simulations()]


def plain() -> list[CheckResult]:
    """Run what needs nothing but Python."""
    results = pin_rules()
    for variant in VARIANTS:
        design = design_of(variant)
        results.append(listed("netlist complete", variant, netlist_faults(design), f"{len(design.nets())} nets"))
        words = f"{len(design.components)} components"
        results.append(listed("bill of materials", variant, bom_faults(design), words))
        words = f"{sum(len(part.pins) for part in design.components)} pins as the table of its own has them"
        results.append(listed("expected connections", variant, differences(design), words))
        figures = all_checks(design)
        outside = [str(check) for check in figures if not check.is_good]
        results.append(listed("electrical", variant, outside, f"{len(figures)} figures within their limits"))
        results += print_and_lands(design)
        tracks, vias = generated_files.copper_of(design)
        words = f"{len(tracks)} tracks, {len(vias)} vias"
        results.append(listed("copper connected", variant, copper.faults(design, tracks, vias), words))
        results.append(gerbers_reread(variant))
    sources = generated_files.sources()
    stale = [f"{name} is stale" for name in generated_files.stale_files(sources)]
    results.append(listed("generated files", "all", stale, f"{len(sources)} files up to date"))
    return results


def print_and_lands(design: BoardDesign) -> list[CheckResult]:
    """Read print, lands and wires back from the committed board, and hold them against circuit and drawings."""
    file = generated_files.GENERATED / design.variant / f"{design.variant}.kicad_pcb"
    board = read_board(file.read_text(encoding="utf-8"))
    marks = sum(len(part.marks) for part in board.parts.values()) + len(board.labels)
    pads = sum(len(part.lands) for part in board.parts.values())
    return [
        listed("print", design.variant, printed.faults(board, design), f"{marks} marks where the circuit has them"),
        listed(
            "lands and wires", design.variant, lands.faults(board, design), f"{pads} pads as the drawings have them"
        ),
    ]


def gerbers_reread(variant: str) -> CheckResult:
    """Read the committed gerbers with a library that is not KiCad's, and hold them against the design."""
    files = generated_files.fabrication_archive(variant)
    if not files:
        return listed("gerbers re-read", variant, ["there is no archive (hint: make board)"], "")
    if not gerbers.is_installed():
        return skipped("gerbers re-read", variant, "gerbonara is not installed (hint: make board-tools)")
    reading = gerbers.read(files)
    words = (
        f"{reading.width_mm:g} x {reading.height_mm:g} mm, {reading.copper_layers} copper layers, "
        f"{reading.plated} + {reading.unplated} holes"
    )
    design = design_of(variant)
    _, vias = generated_files.copper_of(design)
    faults = [*generated_files.checksum_faults(variant), *gerbers.faults(design, vias, reading)]
    return listed("gerbers re-read", variant, faults, words)


def pin_rules() -> list[CheckResult]:
    """Ask the pin rules of our revisions, which break none, and of the thesis's, whose faults they must find."""
    results = []
    for board in BOARDS.values():
        found = count_by_rule(findings(load_pinout(), board))
        wanted = THESIS_FINDINGS.get(board.revision, {})
        words = ", ".join(f"{count} {rule}" for rule, count in found.items()) or "none"
        kind = "the known ones" if wanted else "none allowed"
        results.append(
            judged("pin rules", board.revision, found == wanted, f"{Counter(found).total()} findings ({words}), {kind}")
        )
    return results


def simulations() -> list[CheckResult]:
    """Run every deck; without ngspice one line says so."""
    if not is_installed():
        return [skipped("simulation", "all", "ngspice is not installed (hint: tools/install_board_tools.sh)")]
    return [simulation(simulate(deck)) for deck in decks()]


def simulation(ran: run.DeckResult) -> CheckResult:
    """Judge what a deck gave."""
    verdicts = ran.verdicts()
    words = "; ".join(f"{limit.measure} {value:.4g} {limit.unit}" for limit, value, _ in verdicts)
    return judged("simulation", ran.deck.name, all(good for *_, good in verdicts), words)
