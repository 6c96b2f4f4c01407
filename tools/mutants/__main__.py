"""`make mutants`: change the code in one place at a time, and run the nearest tests.

    python -m tools.mutants --since main      lines that differ from a commit
    python -m tools.mutants p2os --count 60   60 changes of files, drawn by seed
    python -m tools.mutants --sample ci       one of samples.toml, with its floor
    python -m tools.mutants --planted         the faults of planted.toml, or of another file

What was judged is kept in build/mutants; the same words resume a run.
Exit code 0: all noticed, or the floor met; 1: not; 2: usage; 130: interrupted.
"""

import argparse
import os
import random
import signal
import sys
import tempfile
import tomllib
from pathlib import Path
from types import FrameType

from tools.mutants import changes, figures
from tools.mutants.changes import ROOT, ChangeError
from tools.mutants.judge import NOTICED, MutantOutcome
from tools.mutants.ledger import SURVIVORS, Ledger, survivors, with_new, write_survivors
from tools.mutants.mutant import SourceMutant
from tools.mutants.native_lines import NativeLines
from tools.mutants.nearest import Nearest, counted_lines
from tools.mutants.sampling import Court, sample

KEPT = ROOT / "build" / "mutants" / "judged.jsonl"
SAMPLES = Path(__file__).with_name("samples.toml")
PLANTED = Path(__file__).with_name("planted.toml")


def main() -> int:
    """Judge what was asked for; return the exit code."""
    parser = _parser()
    options = parser.parse_args()
    signal.signal(signal.SIGTERM, _interrupt)
    try:
        return _judged(parser, options)
    except ChangeError as error:
        print(f"mutants: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"mutants: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("\nmutants: interrupted (hint: the same words resume it)", file=sys.stderr)
        return 130


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m tools.mutants", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("files", nargs="*", metavar="FILE", help="whole files, or all of folders")
    parser.add_argument("--since", metavar="COMMIT", help="the lines that differ from this commit")
    parser.add_argument("--sample", metavar="NAME", help="a sample of samples.toml")
    parser.add_argument(
        "--planted", type=Path, nargs="?", const=PLANTED, metavar="TOML", help="the faults of planted.toml, or another"
    )
    parser.add_argument("--count", type=_positive, help="how many to draw (default: all)")
    parser.add_argument("--seed", type=int, help="of the draw (default: 1)")
    parser.add_argument("--floor", type=float, help="per cent that are to be noticed (default: all of them)")
    parser.add_argument(
        "--gcov", action="store_true", help="first count the lines in C that each file of tests runs; it is kept"
    )
    parser.add_argument("--note", action="store_true", help="add survivors to the committed list")
    parser.add_argument("--list", action="store_true", help="only print what would be judged, and by which tests")
    cores = len(os.sched_getaffinity(0))
    parser.add_argument(
        "--jobs", type=_positive, default=cores, help=f"copies of the tree (default: {cores}, the cores)"
    )
    return parser


def _positive(text: str) -> int:
    number = int(text)
    if number < 1:
        raise ValueError
    return number


def _interrupt(_signal: int, _frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def _judged(parser: argparse.ArgumentParser, options: argparse.Namespace) -> int:
    if options.sample is not None:
        known = tomllib.loads(SAMPLES.read_text(encoding="utf-8"))
        if options.sample not in known:
            parser.error(f"no sample is named {options.sample} (there are {', '.join(known)})")
        parser.set_defaults(**known[options.sample])
        options = parser.parse_args()
        options.files = options.files or known[options.sample]["files"]
    if [bool(options.files), options.since is not None, options.planted is not None].count(True) != 1:
        parser.error("name files, or a commit by --since, or a --sample, or take what is --planted")
    if options.planted is not None:
        found = changes.planted(changes.read_planted(options.planted))
        lines: changes.Lines = changes.files(dict.fromkeys(mutant.path for mutant in found))
    else:
        lines = changes.since(options.since) if options.since is not None else changes.files(options.files)
        found = changes.mutants_of(lines)
    if options.count is not None:
        random.Random(1 if options.seed is None else options.seed).shuffle(found)
    native = NativeLines(ROOT)
    if options.gcov:
        native.count(Nearest(ROOT, {}), [mutant.path for mutant in found[: options.count]], options.jobs)
    nearest = Nearest(ROOT, {**counted_lines(ROOT / ".coverage", ROOT), **native.lines()})
    if options.list:
        for mutant in found[: options.count]:
            print(f"{mutant.name}\n    {' '.join(nearest.of(mutant.path, mutant.first_line)) or 'no tests'}")
        return 0
    known_rows = survivors()
    with (
        tempfile.TemporaryDirectory(prefix="mutants-") as folder,
        Court(ROOT, Path(folder), nearest, Ledger(KEPT), lines, options.jobs) as court,
    ):
        judged = sample(court, found, options.count, {row for row, reason in known_rows.items() if reason})
    return _reported(judged, options)


def _reported(judged: list[tuple[SourceMutant, MutantOutcome]], options: argparse.Namespace) -> int:
    """Print survivors and figures; return the exit code."""
    if not judged:
        print("mutants: there is nothing to change in these lines")
        return 0
    left = [mutant for mutant, judgement in judged if judgement.verdict not in NOTICED]
    known = survivors()
    for mutant in left:
        print(f"{'listed' if mutant.row in known else 'NOT NOTICED'} {mutant.name}")
    if options.note:
        write_survivors(with_new(known, left))
    print(*figures.table(judged), sep="\n")
    if options.floor is not None:
        share = 100 * (1 - len(left) / len(judged))
        print(f"mutants: {share:.1f} % noticed, {options.floor:g} % wanted")
        return int(share < options.floor)
    new = [mutant for mutant in left if mutant.row not in known]
    if new:
        print(f"mutants: {len(new)} not noticed (hint: a test each, or NOTE=1 and a reason in {SURVIVORS.name})")
    return int(bool(new))


if __name__ == "__main__":
    sys.exit(main())
