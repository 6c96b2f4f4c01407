"""`python -m hardware.case check|build`: whether the case fits the board, and its STEP and STL files.

Exit codes: 0 done, 1 something is wrong or missing, 2 wrong usage.
"""

import argparse
import sys
from pathlib import Path

from hardware.case import design, step
from hardware.case.fit import CHECKS
from simbase.errors import MissingDependencyError

#: Says which design the files are of.
STAMP = "design.sha256"
GENERATED = Path(__file__).resolve().parent / "generated"


def main(arguments: list[str] | None = None) -> int:
    """Run one verb; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m hardware.case", description=(__doc__ or "").splitlines()[0])
    verbs = parser.add_subparsers(dest="verb", required=True)
    verbs.add_parser("check", help="compare the case with the board, and print a table")
    building = verbs.add_parser("build", help="check, then write base and lid as STEP and STL (needs build123d)")
    building.add_argument("--out", type=Path, default=GENERATED, help="folder (default: beside the sources)")
    given = parser.parse_args(arguments)
    if (status := _check()) or given.verb == "check":
        return status
    try:
        given.out.mkdir(parents=True, exist_ok=True)
        for body in (design.base(), design.lid()):
            for path in step.export(body, given.out):
                print(f"{path.name}: {path.stat().st_size} bytes")
        (given.out / STAMP).write_text(design.stamp() + "\n", encoding="utf-8")
    except MissingDependencyError as error:
        sys.stderr.write(f"case: {error}\nhint: {error.hint}\n")
        return 1
    return 0


def _check() -> int:
    found = {words: check() for words, check in CHECKS.items()}
    for words, wrong in found.items():
        print(f"{'wrong' if wrong else 'good':6} {words}")
        for line in wrong[:5]:
            print(f"       {line}")
    return int(any(found.values()))


if __name__ == "__main__":
    sys.exit(main())
