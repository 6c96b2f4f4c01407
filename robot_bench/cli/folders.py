"""Where run folders go by default: `runs/NAME-NNN` in the current directory."""

import re
from pathlib import Path

RUNS = Path("runs")


def next_folder(name: str, parent: Path = RUNS) -> Path:
    """Return the first number above all that are there."""
    pattern = re.compile(rf"{re.escape(name)}-(\d+)$")
    there = [int(found[1]) for item in parent.glob(f"{name}-*") if (found := pattern.match(item.name))]
    return parent / f"{name}-{max(there, default=0) + 1:03d}"
