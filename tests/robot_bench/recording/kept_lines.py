"""Results that are compared whole with the text that is kept of them, in `tests/golden/bench`."""

from collections.abc import Iterable
from pathlib import Path

KEPT = Path(__file__).resolve().parents[2] / "golden" / "bench"


def is_as_kept(lines: Iterable[str], name: str) -> bool:
    """Tell whether lines are what is kept under a name; where nothing is it is written, and they are not."""
    found, kept = [*lines], KEPT / f"{name}.txt"
    if not kept.exists():
        kept.write_text("\n".join([*found, ""]), encoding="utf-8")
        return False
    assert found == kept.read_text(encoding="utf-8").splitlines(), f"delete {kept.name} where it is meant so"
    return True
