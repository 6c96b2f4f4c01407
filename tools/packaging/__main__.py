"""`make wheels`: a source distribution and a wheel of each house, in dist/.

    python -m tools.packaging                 all of them
    python -m tools.packaging p2os simbase    these

The wheel is built from the source distribution, so that what it lacks is noticed.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

from tools.packaging.staging import ROOT, houses, stage


def main() -> int:
    """Build, and say what was written."""
    parser = argparse.ArgumentParser(prog="python -m tools.packaging", description=(__doc__ or "").splitlines()[0])
    known = houses()
    parser.add_argument("houses", nargs="*", metavar="HOUSE", help=f"of {', '.join(known)}; all when none is named")
    parser.add_argument("--out", type=Path, default=ROOT / "dist", help="folder of what is built (default: dist)")
    parser.add_argument("--wheel-only", action="store_true", help="build no source distribution")
    options = parser.parse_args()
    if unknown := [name for name in options.houses if name not in known]:
        parser.error(f"no house is named {unknown[0]} (there are {', '.join(known)})")
    with tempfile.TemporaryDirectory() as folder:
        for name in options.houses or known:
            place = stage(known[name], Path(folder) / name)
            command = [sys.executable, "-m", "build", "--outdir", str(options.out), str(place)]
            done = subprocess.run(
                [*command, *(["--wheel"] if options.wheel_only else [])], capture_output=True, text=True, check=False
            )
            if done.returncode:
                sys.stderr.write(done.stdout + done.stderr)
                return 1
            print(done.stdout.splitlines()[-1])
    return 0


if __name__ == "__main__":
    sys.exit(main())
