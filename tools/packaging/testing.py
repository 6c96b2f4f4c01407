"""`make test HOUSE=p2os`: the tests and pages of one house, with nothing of the others there.

    python -m tools.packaging.testing p2os              in about a minute on two cores, without slow tests
    python -m tools.packaging.testing p2os --without physics    without a plug-in and its tests
    python -m tools.packaging.testing p2os -m 'not soak and not hardware'   words behind the house go to pytest

What a house does not stand on is hidden (tests/tools/closure): its modules cannot be imported, and what they offer by
entry points is not there.
"""

import argparse
import ast
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from tests.documentation.page import Page
from tools.packaging.staging import ROOT, House, Plugin, houses, plugins

CLOSURE = ROOT / "tests" / "tools" / "closure"


def closure(house: House, known: dict[str, House]) -> set[str]:
    """Return the packages at the top that a house needs: its own and those of the houses that it stands on."""
    below = [closure(known[name], known) for name in house.houses]
    return set(house.folders).union(*below)


def environment(house: House, known: dict[str, House], without: Sequence[Plugin] = ()) -> dict[str, str]:
    """Return the environment of a Python for which there is only what a house stands on, some plug-ins left out."""
    hidden = {folder for one in known.values() for folder in one.folders} - closure(house, known)
    hidden |= {module for one in without for module in one.modules}
    path = os.pathsep.join(filter(None, (str(CLOSURE), os.environ.get("PYTHONPATH", ""))))
    verbs = ",".join(verb for one in without for verb in one.verbs)
    return {**os.environ, "HIDDEN_PACKAGES": ",".join(sorted(hidden)), "HIDDEN_VERBS": verbs, "PYTHONPATH": path}


def tests_of(page: str) -> list[str]:
    """Return the tests that do what a page says; of a page without a block that is run there are none."""
    names = (
        "the_examples_of_a_page_run",
        "the_long_examples_of_a_page_run_among_the_others",
        "all_examples_of_a_page_run",
    )
    paces = {block.pace for block in Page(ROOT / page).blocks if block.is_run}
    return [f"tests/test_docs.py::test_{names[pace]}[{page}]" for pace in sorted(paces)]


def left_out(plugin: Plugin, folders: Sequence[str]) -> list[str]:
    """Return the words that leave the tests of a plug-in out: of files that import it, and those that its row names."""
    files = [
        path for folder in folders for path in (ROOT / folder).rglob("*.py") if any(map(plugin.holds, named(path)))
    ]
    rows = [*(path.relative_to(ROOT).as_posix() for path in files), *plugin.tests]
    return [f"--{'deselect' if '::' in row else 'ignore'}={row}" for row in rows]


def named(path: Path) -> set[str]:
    """Return the dotted names that a file imports, wherever in it."""
    nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
    found = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    for node in nodes:
        if isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return found


def main() -> int:
    """Run them, and return pytest's exit code."""
    parser = argparse.ArgumentParser(prog="make test HOUSE=", description=(__doc__ or "").splitlines()[0])
    known = houses(with_tests_alone=True)
    parser.add_argument("house", choices=known, metavar="HOUSE", help=", ".join(known))
    parser.add_argument("--without", choices=plugins(), default=[], action="append", help="hide a plug-in too")
    options, words = parser.parse_known_args()
    house = known[options.house]
    pages = [word for page in house.pages for word in tests_of(page)]
    without = [plugins()[name] for name in options.without]
    if without:  # pages are of a house with all that it has
        pages = [word for one in without for word in left_out(one, house.tests)]
        marks = "".join(f" and not {mark}" for one in without for mark in one.marks)
        words += ["-p", "without_verbs", "-m", f"not slow and not soak and not hardware{marks}"]
    command = [sys.executable, "-m", "pytest", *house.tests, *pages, *words]
    return subprocess.run(command, cwd=ROOT, env=environment(house, known, without), check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
