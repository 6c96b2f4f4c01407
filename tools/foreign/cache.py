"""The cache: a folder outside the checkout with a folder for each source, and what is missing in it.

    CACHE/klipper/...          what rows name, built by whoever wants the row
    CACHE/klipper/COMMIT       the commit that it was built of, if it is known
    CACHE/klipper/build        if it is there and a file is missing, it is run in that folder, and where it fails
                               what it said last is shown; it is the user's own

`git clone URL` at the row's commit into `CACHE/klipper/source` does as well as COMMIT.
"""

import os
import shutil
import subprocess
from pathlib import Path

from tools.foreign.row import Row, Source, matching

#: chosen: longer than any of them builds on a small machine, seconds.
BUILD_S = 1800.0
#: chosen: of what a build says last so much is shown.
_SHOWN_CHARACTERS = 160


def default_cache() -> Path:
    """Return the folder that is used unless another is named: XDG's, for this tool."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "p2os-foreign"


def missing(row: Row, cache: Path) -> list[str]:
    """Return what of a row's needs is not there."""
    return [need for need in row.all_needs if not _is_there(need, cache)]


def _is_there(need: str, cache: Path) -> bool:
    return bool(matching(need, cache)) if "/" in need else shutil.which(need) is not None


def build(source: Source, cache: Path) -> str:
    """Run the user's own `build` of a source, if there is one; return what it says last where it fails, else ""."""
    folder = cache / source.folder
    script = folder / "build"
    if not os.access(script, os.X_OK) or script.is_dir():
        return ""
    try:
        ended = subprocess.run(
            ["nice", str(script)], cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT, timeout=BUILD_S, check=False,
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired) as error:
        return f"build: {error}"
    if not ended.returncode:
        return ""
    said = ended.stdout.decode(errors="replace").split("\n")
    last = next((line.strip() for line in reversed(said) if line.strip()), "nothing")
    return f"build ended with {ended.returncode}: {last[:_SHOWN_CHARACTERS]}"


def built_commit(source: Source, cache: Path) -> str:
    """Return the commit that a source's folder is of; empty: not known."""
    folder = cache / source.folder
    note = folder / "COMMIT"
    if note.is_file():
        return note.read_text(errors="replace").strip()
    clone = folder / "source"
    if not (clone / ".git").exists():
        return ""
    asked = subprocess.run(["git", "rev-parse", "HEAD"], cwd=clone, capture_output=True, text=True, check=False)
    return asked.stdout.strip() if asked.returncode == 0 else ""
