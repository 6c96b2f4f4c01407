"""The table of sizes and times in docs/adapter-firmware.md, to which the tests hold what they measure."""

import re
from dataclasses import dataclass
from pathlib import Path

PAGE = Path(__file__).parents[2] / "docs" / "adapter-firmware.md"
ADAPTER_BYTES = "one adapter, RAM"
#: chosen: another release of the same compiler may differ so much; whoever grows the core by more says so in the docs.
ROOM = 0.03


@dataclass(frozen=True)
class Row:
    """A measured thing on each machine; None where nothing was measured."""

    cortex_m: int | None
    xtensa: int | None
    esp32: int | None


def documented(start: str) -> Row:
    """Return the row of the table that begins with these words."""
    lines = [line for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith(f"| {start}")]
    assert len(lines) == 1, f"docs/adapter-firmware.md has {len(lines)} rows {start!r}"
    cells = [cell.strip() for cell in lines[0].strip("|").split("|")]
    return Row(*(int(cell) if re.fullmatch(r"\d+", cell) else None for cell in cells[1:4]))


def is_as_documented(measured: int, said: int | None) -> bool:
    """Tell whether a measurement is what the docs say, but for some room."""
    assert said is not None, "the docs have no number here"
    assert abs(measured - said) <= ROOM * said, f"measured {measured}, docs/adapter-firmware.md says {said}"
    return True
