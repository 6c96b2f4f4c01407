"""`python -m hardware.pcb VERB`: builds, checks, routes, fills, simulates and compares the board.

Its pictures are made by `python -m tools.pictures`.
Exit codes: 0 done, 1 something failed, 2 wrong usage.
"""

import argparse
import sys
import tempfile
from pathlib import Path

from hardware.pcb.checks import suite
from hardware.pcb.checks.kicad_checks import stitches_of
from hardware.pcb.checks.results import CheckStatus, table
from hardware.pcb.circuit.design import VARIANTS
from hardware.pcb.circuit.design import build as design_of
from hardware.pcb.circuit.netlist import DesignError
from hardware.pcb.layout.routing import HERE, run_router
from hardware.pcb.outputs import difference, generated_files, kicad_cli
from hardware.pcb.spice.decks import decks
from hardware.pcb.spice.page import page_text
from hardware.pcb.spice.run import is_installed, simulate
from simbase.errors import P2osError


def main(arguments: list[str] | None = None) -> int:
    """Run one verb; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m hardware.pcb", description=__doc__)
    verbs = parser.add_subparsers(dest="verb", required=True)
    verbs.add_parser("build", help="write every generated file (KiCad's part only where it is installed)")
    checking = verbs.add_parser("check", help="run every check and print a table")
    checking.add_argument("--strict", action="store_true", help="a missing tool is a failure")
    for name, words in (
        ("route", "route the boards anew (needs a C++ compiler)"),
        ("stitch", "choose the stitching vias anew (needs KiCad)"),
    ):
        one = verbs.add_parser(name, help=words)
        one.add_argument("variant", nargs="*", help=f"one of {', '.join(VARIANTS)}; none for all")
    verbs.add_parser("simulate", help="run every circuit simulation and renew the page of their figures")
    comparing = verbs.add_parser("diff", help="lay two boards over each other: old in red, new in green")
    for name in ("old", "new"):
        comparing.add_argument(name, help="a variant, a .kicad_pcb file, or REVISION:VARIANT of git")
    comparing.add_argument(
        "--out", type=Path, default=Path("board-diff.svg"), help="the picture (default: %(default)s)"
    )
    given = parser.parse_args(arguments)
    try:
        return _VERBS[given.verb](given)
    except P2osError as error:
        sys.stderr.write(f"board: {error}\n" + (f"hint: {error.hint}\n" if error.hint else ""))
        return 1


def _build(_: argparse.Namespace) -> int:
    written = generated_files.write_sources()
    print(f"{len(written)} generated files renewed")
    if kicad_cli.version() is None:
        print("KiCad 9 is not installed: gerbers stay as they are (hint: tools/install_board_tools.sh)")
        return 0
    with tempfile.TemporaryDirectory() as folder:
        for variant in VARIANTS:
            board = generated_files.filled_project(variant, Path(folder))
            files = generated_files.fabrication_files(board, Path(folder) / f"{variant}-fabrication")
            target = generated_files.GENERATED / variant / f"{variant}-gerbers.zip"
            target.write_bytes(generated_files.archive(files))
            print(f"{target.name}: {len(files)} files, {target.stat().st_size} bytes")
            kicad_cli.step(board, target.with_name(f"{variant}.step"))
            schematic = target.with_name(f"{variant}.kicad_sch")
            for name, text in kicad_cli.reports(variant, schematic, board).items():
                target.with_name(name).write_text(text, encoding="utf-8", newline="\n")
    return 0


def _check(given: argparse.Namespace) -> int:
    results = suite.run_all()
    print(table(results))
    bad = {CheckStatus.BAD, CheckStatus.SKIPPED} if given.strict else {CheckStatus.BAD}
    return 1 if any(result.verdict in bad for result in results) else 0


def _route(given: argparse.Namespace) -> int:
    for variant in _variants(given.variant):
        text = run_router(design_of(variant))
        (HERE / "routes" / f"{variant}.txt").write_text(text, encoding="utf-8", newline="\n")
        print(f"routes/{variant}.txt: {text.count(chr(10) + 'T ')} tracks, {text.count(chr(10) + 'V ')} vias")
    return 0


def _stitch(given: argparse.Namespace) -> int:
    for variant in _variants(given.variant):
        text = stitches_of(variant)
        (HERE / "stitches" / f"{variant}.txt").write_text(text, encoding="utf-8", newline="\n")
        print(f"stitches/{variant}.txt: {text.count(chr(10))} stitching vias")
    return 0


def _simulate(_: argparse.Namespace) -> int:
    if not is_installed():
        print(table(suite.simulations()))
        return 0
    ran = [simulate(deck) for deck in decks()]
    results = [suite.simulation(one) for one in ran]
    print(table(results))
    page = page_text(decks(), {one.deck.name: one.figures for one in ran})
    generated_files.SIMULATION_PAGE.write_text(page, encoding="utf-8", newline="\n")
    print(f"{generated_files.SIMULATION_PAGE.name}: {len(ran)} simulations")
    return 1 if any(result.verdict is CheckStatus.BAD for result in results) else 0


def _diff(given: argparse.Namespace) -> int:
    old, new = difference.read_source(given.old), difference.read_source(given.new)
    said = difference.words(old, new)
    given.out.write_text(difference.picture(old, new, (given.old, given.new)), encoding="utf-8", newline="\n")
    print("\n".join([*said, f"{given.out}: {'no difference' if not said else 'red is gone, green is new'}"]))
    return 0


def _variants(names: list[str]) -> list[str]:
    unknown = [name for name in names if name not in VARIANTS]
    if unknown:
        raise DesignError(f"variant {unknown[0]!r} is unknown (one of {', '.join(VARIANTS)})")
    return names or list(VARIANTS)


_VERBS = {"build": _build, "check": _check, "route": _route, "stitch": _stitch, "simulate": _simulate, "diff": _diff}

if __name__ == "__main__":
    sys.exit(main())
