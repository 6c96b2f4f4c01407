"""Results that tests compare whole with the text that is kept of them, in a folder of `tests/golden`.

Where one is meant otherwise, its file is deleted and its test is run: it fails, and writes the file anew. The
difference is read as that of any other change.
"""

from collections.abc import Callable, Iterable
from pathlib import Path

GOLDEN = Path(__file__).resolve().parents[2] / "golden"


def kept_in(folder: str) -> Callable[[Iterable[str], str], bool]:
    """Return what tells whether lines are those that a folder keeps under a name; where it keeps none, they are not."""

    def is_as_kept(lines: Iterable[str], name: str) -> bool:
        found, kept = [*lines], GOLDEN / folder / f"{name}.txt"
        if not kept.exists():
            kept.write_text("\n".join([*found, ""]), encoding="utf-8")
            return False
        assert found == kept.read_text(encoding="utf-8").splitlines(), f"delete {kept.name} where it is meant so"
        return True

    return is_as_kept
