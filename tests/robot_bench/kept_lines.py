"""Results that are compared whole with the text that is kept of them."""

from collections.abc import Iterable
from pathlib import Path


def is_as_kept(lines: Iterable[str], kept: Path) -> bool:
    """Tell whether lines are what a file keeps; where there is none it is written, and they are not."""
    found = [*lines]
    if not kept.exists():
        kept.write_text("\n".join([*found, ""]), encoding="utf-8")
        return False
    assert found == kept.read_text(encoding="utf-8").splitlines(), f"delete {kept.name} where it is meant so"
    return True
