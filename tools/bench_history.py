"""`make bench-history`: the figures of `make bench`, kept a line a run, and a page that sets them beside each other.

    python -m tools.bench_history FOLDER

FOLDER has `latest.txt`, what `make bench` printed. Its figures are added to `history.jsonl` as those of the commit that
is checked out, in place of earlier ones of that commit, and `history.md` is written: a row a figure, a column a commit.
"""

import argparse
import json
import re
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

#: chosen: what a page shows beside each other.
COLUMNS = 8
#: As `tools/bench/measuring.py` prints a row: a name, a figure with its unit, a note.
_ROW = re.compile(r"^(?P<name>\S.{0,59}?) {2,}(?P<figure>-?\d[\d.]*(?:e-?\d+)?(?: [^ ]+)*)(?: {2,}.*)?$")


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchRun:
    """The figures of a commit."""

    commit: str
    #: Of the commit, as ISO 8601 has it.
    date: str
    figures: dict[str, str]


def figures_of(text: str) -> dict[str, str]:
    """Return figures by their names, of what `make bench` printed; the last of one name."""
    rows = (_ROW.match(line) for line in text.splitlines())
    return {row["name"].strip(): row["figure"] for row in rows if row is not None}


def read_history(path: Path) -> list[BenchRun]:
    """Return the runs of a history, the oldest first; none where there is no file."""
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    return [BenchRun(**json.loads(line)) for line in lines]


def page(runs: Sequence[BenchRun]) -> str:
    """Return the last runs as a table in Markdown, the newest first."""
    shown = list(reversed(runs[-COLUMNS:]))
    names = dict.fromkeys(name for run in shown for name in run.figures)
    rows = [
        ["figure", *(f"{run.commit} {run.date[:10]}" for run in shown)],
        ["---"] * (len(shown) + 1),
        *([name.replace("|", "\\|"), *(run.figures.get(name, "") for run in shown)] for name in names),
    ]
    return "# Figures of `make bench`\n\n" + "".join(f"| {' | '.join(row)} |\n" for row in rows)


def main() -> int:
    """Add the latest figures."""
    parser = argparse.ArgumentParser(prog="python -m tools.bench_history", description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "folder", type=Path, metavar="FOLDER", help="with latest.txt; gets history.jsonl and history.md"
    )
    folder = parser.parse_args().folder
    commit, date = subprocess.run(
        ["git", "log", "-1", "--format=%h %cI"], capture_output=True, text=True, check=True
    ).stdout.split()
    found = figures_of((folder / "latest.txt").read_text(encoding="utf-8"))
    if not found:
        sys.stderr.write(f"{parser.prog}: {folder}/latest.txt has no figures\nhint: make bench\n")
        return 2
    kept = [run for run in read_history(folder / "history.jsonl") if run.commit != commit]
    runs = [*kept, BenchRun(commit=commit, date=date, figures=found)]
    lines = "".join(f"{json.dumps(asdict(run))}\n" for run in runs)
    (folder / "history.jsonl").write_text(lines, encoding="utf-8")
    (folder / "history.md").write_text(page(runs), encoding="utf-8")
    print(f"{folder}/history.md: {len(found)} figures of {commit}, {len(runs)} commits")
    return 0


if __name__ == "__main__":
    sys.exit(main())
