"""Compares the chips of two checkouts: edges, characters, blocks and final states of many programs.

    python -m tools.compare_chip ../old                      this checkout with another
    python -m tools.compare_chip ../old ../new --quick       shorter runs
    python -m tools.compare_chip ../old --program dodge --generated 0
    python -m tools.compare_chip . --core own                two cores of one checkout

Each program runs on the old chip once a level, in one call; then on the new one in slices of several lengths, each
compared with that one run. Where they differ, the old chip runs in those slices too, which tells whether its results
depended on them already. A checkout without its own `.venv` and library (`make setup`) uses this Python; its native
core must be built. 0: the same; 1: differences; 2: wrong usage.
"""

import argparse
import sys
import tempfile
import time
from pathlib import Path

from bluepill_sim.extension.library import CORE_CHOICES
from tools.compare_chip.comparison import LEVELS, SLICES, ChipComparison
from tools.compare_chip.programs import chosen, generated, programs_of
from tools.compare_chip.worker import PACKAGE, Worker

ROOT = Path(__file__).resolve().parents[2]
#: chosen: a run of the slowest level takes a tenth of it on a busy machine.
BUDGET_S = 120.0


def main() -> int:
    """Compare, and print one line a program and every difference."""
    options = _options()
    programs = [*programs_of(options.old), *generated(options.seed, options.generated)]
    try:
        programs = chosen(programs, options.program)
    except LookupError as error:
        print(f"compare_chip: {error}", file=sys.stderr)
        return 2
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        old, new = Worker(options.old, BUDGET_S), Worker(options.new, BUDGET_S)
        comparison = ChipComparison(
            old, new, folder, print, options.seed, tuple(options.slices or SLICES), is_quick=options.quick,
            core=options.core,
        )  # fmt: skip
        levels = [level for level in LEVELS if not options.level or level.name in options.level]
        same = count = 0
        try:
            for program in programs:
                is_same = comparison.compare(program.name, program.image(options.keep or folder), levels)
                same, count = same + is_same, count + 1
                print(f"{program.name:<24} {'the same' if is_same else 'DIFFERS'}", flush=True)
        finally:
            old.close()
            new.close()
    alike = f", {comparison.alike} differ on both chips alike" if comparison.alike else ""
    print(
        f"{same} of {count} programs the same; {comparison.differing} of {comparison.runs} runs differ{alike}; "
        f"{time.monotonic() - began:.0f} s"
    )
    return 0 if same == count else 1


def _options() -> argparse.Namespace:
    lines = (__doc__ or "").splitlines()
    parser = argparse.ArgumentParser(
        prog="python -m tools.compare_chip", description=lines[0], epilog="\n".join(lines[1:]),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    parser.add_argument("old", type=_checkout, help="the checkout to compare with")
    parser.add_argument("new", type=_checkout, nargs="?", default=ROOT, help="default: this one")
    parser.add_argument(
        "--slices",
        type=_slices,
        action="append",
        metavar="NS",
        help='a length in ns, "whole" or "random"; may come several times',
    )
    parser.add_argument(
        "--level",
        action="append",
        choices=[level.name for level in LEVELS],
        help="may come several times; default: all",
    )
    parser.add_argument("--program", action="append", metavar="NAME", help="may come several times; default: all")
    parser.add_argument("--core", default="native", choices=CORE_CHOICES, help="of the new chip (native)")
    parser.add_argument("--quick", action="store_true", help="shorter runs")
    parser.add_argument("--generated", type=int, default=20, metavar="N", help="how many generated programs (20)")
    parser.add_argument("--seed", type=int, default=0, help="of inputs, random slices and generated programs (0)")
    parser.add_argument("--keep", type=_folder, metavar="DIR", help="leave the programs here")
    return parser.parse_args()


def _checkout(text: str) -> Path:
    path = Path(text)
    if not (path / PACKAGE / "__init__.py").is_file():
        raise argparse.ArgumentTypeError(f"{text} is no checkout: it has no {PACKAGE} (hint: git worktree add)")
    return path.resolve()


def _folder(text: str) -> Path:
    path = Path(text)
    path.mkdir(parents=True, exist_ok=True)
    return path.resolve()


def _slices(text: str) -> int | str:
    if text in {"whole", "random"}:
        return text
    if not text.isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(f'{text} is neither nanoseconds, nor "whole", nor "random"')
    return int(text)


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
