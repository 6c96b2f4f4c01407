"""Builds the site into build/site: `make site`.

Usage: python -m tools.website [FOLDER]

The pages are staged first (`staging.py`), with those that are generated (`reference.py`, `api.py`, `fidelity.py`,
`gallery.py`); Zensical makes HTML of them, and `judging.py` looks at what came out. Exit code 1 where a page is not in
the navigation, a link or an anchor leads nowhere, a page would ask another host for something, or a public name has
no docstring. Nothing is fetched: neither by the build nor by the pages.
"""

import argparse
import shutil
import subprocess
import sys
from pathlib import Path

from tools.website import judging, mending, staging

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "build" / "site"


def build(folder: Path) -> list[str]:
    """Build the site into a folder, what is staged beside it; return what is wrong with it, a line each."""
    staged = folder.with_name(f"{folder.name}-pages")
    wrong = staging.stage(staged)
    command = [sys.executable, "-m", "zensical", "build", "--clean", "--strict", "-f", str(staged / "zensical.toml")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        return [*wrong, f"zensical ended with {done.returncode}:", done.stdout + done.stderr]
    shutil.rmtree(folder, ignore_errors=True)
    (staged / "site").rename(folder)
    mending.mend(folder)
    return [*wrong, *judging.faults(folder)]


def main() -> int:
    """Build the site, and say what is wrong."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path, nargs="?", default=FOLDER, help="where to (default: build/site)")
    folder: Path = parser.parse_args().folder.resolve()
    wrong = build(folder)
    pages = len(list(folder.rglob("*.html"))) if folder.is_dir() else 0
    print(*wrong, f"{pages} pages, open {folder / 'index.html'}", sep="\n")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
