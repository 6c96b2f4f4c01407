"""`make test HOUSE=p2os`: the tests and pages of one house, with nothing of the others there.

    python -m tools.packaging.testing p2os              in about a minute on two cores, without slow tests
    python -m tools.packaging.testing p2os -m 'not soak and not hardware'   words behind the house go to pytest

What a house does not stand on is hidden (tests/tools/closure): its modules cannot be imported, and what they offer by
entry points is not there.
"""

import argparse
import os
import subprocess
import sys

from tools.packaging.staging import ROOT, House, houses

CLOSURE = ROOT / "tests" / "tools" / "closure"


def closure(house: House, known: dict[str, House]) -> set[str]:
    """Return the packages at the top that a house needs: its own and those of the houses that it stands on."""
    below = [closure(known[name], known) for name in house.houses]
    return set(house.folders).union(*below)


def environment(house: House, known: dict[str, House]) -> dict[str, str]:
    """Return the environment of a Python for which there are only the packages of a house's closure."""
    hidden = {folder for one in known.values() for folder in one.folders} - closure(house, known)
    path = os.pathsep.join(filter(None, (str(CLOSURE), os.environ.get("PYTHONPATH", ""))))
    return {**os.environ, "HIDDEN_PACKAGES": ",".join(sorted(hidden)), "PYTHONPATH": path}


def main() -> int:
    """Run them, and return pytest's exit code."""
    parser = argparse.ArgumentParser(prog="make test HOUSE=", description=(__doc__ or "").splitlines()[0])
    known = houses(with_tests_alone=True)
    parser.add_argument("house", choices=known, metavar="HOUSE", help=", ".join(known))
    options, words = parser.parse_known_args()
    house = known[options.house]
    pages = [f"tests/test_docs.py::test_the_examples_of_a_page_run[{page}]" for page in house.pages]
    command = [sys.executable, "-m", "pytest", *house.tests, *pages, *words]
    return subprocess.run(command, cwd=ROOT, env=environment(house, known), check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
