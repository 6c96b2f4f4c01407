"""Judge which lines and branches ran: the protocol core is covered whole, the rest to 90 %.

Usage: python -m tools.check_coverage FOLDER, with what `pytest --count-lines FOLDER` has written.
"""

import json
import sys
from pathlib import Path

from tests.tools.counted_lines import Counter, modules

#: Modules whose every branch is tested: a fault in them reaches every user.
CORE = (
    "p2os/errors.py",
    "p2os/protocol/",
    "p2os/robots/parameters.py",
    "simbase/timing.py",
)
CORE_PERCENT = 100.0
REST_PERCENT = 90.0

_Files = dict[str, dict[str, dict[str, float]]]


def merged(folder: Path) -> _Files:
    """Return what all processes of a run have seen, of all modules."""
    counter = Counter(Path.cwd())
    for path in modules(Path.cwd()):
        counter.code_of(path)
    for path in sorted(folder.glob("*.json")):
        for file, labels in json.loads(path.read_text(encoding="utf-8")).items():
            counter.all_seen[file].update(tuple(each) if isinstance(each, list) else each for each in labels)
    return counter.get_coverage()["files"]


def percent(files: _Files, names: list[str]) -> float:
    """Return statements and branches covered, in per cent of those there are."""
    summaries = [files[name]["summary"] for name in names]
    covered = sum(s["covered_lines"] + s["covered_branches"] for s in summaries)
    there_are = covered + sum(s["missing_lines"] + s["missing_branches"] for s in summaries)
    return 100.0 * covered / there_are if there_are else 100.0


def main(folder: str) -> int:
    """Print the verdict for each group; return 1 where one falls short."""
    files = merged(Path(folder))
    core = [name for name in files if name.startswith(CORE)]
    failed = [name for name in core if percent(files, [name]) < CORE_PERCENT]
    for name in failed:
        lines = [*files[name]["missing_lines"], *files[name]["missing_branches"]]
        print(f"coverage: {name} at {percent(files, [name]):.1f} %, {CORE_PERCENT:.0f} % wanted; lines {lines}")
    for package in ("p2os", "bluepill_sim", "adapter_sim", "robot_bench", "hardware"):
        names = [name for name in files if name.startswith(f"{package}/")]
        figure = percent(files, names)
        print(f"coverage: {package} {figure:.1f} % of {len(names)} files")
        if figure < REST_PERCENT:
            print(f"coverage: {package} falls short of {REST_PERCENT:.0f} %")
            failed.append(package)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
