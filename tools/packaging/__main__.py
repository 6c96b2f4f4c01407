"""`make wheels`: a source distribution and a wheel of each house, in dist/.

    python -m tools.packaging                                   all of them, for this machine
    python -m tools.packaging p2os simbase                      these
    python -m tools.packaging --for manylinux_2_17_aarch64      for another machine
    python -m tools.packaging --for all                         for all of them

The wheel is built from the source distribution, so that what it lacks is noticed. Two builds of one commit
give the same bytes.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

from simbase.errors import MissingDependencyError
from tools.packaging.release import prepare
from tools.packaging.same_bytes import epoch, packed_again
from tools.packaging.staging import ROOT, House, houses, whole_project
from tools.packaging.targets import TARGETS, environment


def main() -> int:
    """Build, and say what was written."""
    parser = argparse.ArgumentParser(prog="python -m tools.packaging", description=(__doc__ or "").splitlines()[0])
    known = houses()
    parser.add_argument("houses", nargs="*", metavar="HOUSE", help=f"of {', '.join(known)}; all when none is named")
    parser.add_argument("--out", type=Path, default=ROOT / "dist", help="folder of what is built (default: dist)")
    parser.add_argument("--wheel-only", action="store_true", help="build no source distribution")
    parser.add_argument(
        "--for", dest="target", choices=["all", *TARGETS], metavar="PLATFORM",
        help=f"in place of this machine: {', '.join(TARGETS)}, or all of them",
    )  # fmt: skip
    options = parser.parse_args()
    if unknown := [name for name in options.houses if name not in known]:
        parser.error(f"no house is named {unknown[0]} (there are {', '.join(known)})")
    targets = [*TARGETS] if options.target == "all" else [options.target] if options.target else []
    try:
        more = [environment(TARGETS[name]) for name in targets] or [{}]
    except MissingDependencyError as error:
        sys.stderr.write(f"{parser.prog}: {error}\nhint: {error.hint}\n")
        return 2
    with tempfile.TemporaryDirectory() as folder:
        for name in options.houses or known:
            place = prepare(known[name], Path(folder) / name)
            for number, variables in enumerate(wanted(known[name], more)):
                is_wheel_alone = options.wheel_only or number > 0
                done = built(place, options.out, variables, is_wheel_alone=is_wheel_alone)
                if done.returncode:
                    sys.stderr.write(done.stdout + done.stderr)
                    return 1
                print(done.stdout.splitlines()[-1])
    return 0


def wanted(house: House, more: list[dict[str, str]]) -> list[dict[str, str]]:
    """Return the variables of each build of a house: one where it has no part in C, else of targets that it runs on."""
    if not any(house.holds(part["name"]) for part in whole_project()["tool"]["setuptools"]["ext-modules"]):
        return [{}]
    return [one for one in more if not one or house.runs_on(TARGETS[one["P2OS_WHEEL_PLATFORM"]].is_unix)]


def built(
    place: Path, out: Path, variables: Mapping[str, str], *, is_wheel_alone: bool
) -> subprocess.CompletedProcess[str]:
    """Build a staged house into a folder."""
    out.mkdir(parents=True, exist_ok=True)
    before = {path: path.stat().st_mtime_ns for path in out.iterdir()}
    done = subprocess.run(
        [sys.executable, "-m", "build", "--outdir", str(out), str(place), *(["--wheel"] if is_wheel_alone else [])],
        capture_output=True, text=True, check=False, env=os.environ | {"SOURCE_DATE_EPOCH": str(epoch())} | variables,
    )  # fmt: skip
    for path in out.glob("*.tar.gz"):
        if before.get(path) != path.stat().st_mtime_ns:
            packed_again(path)
    return done


if __name__ == "__main__":
    sys.exit(main())
