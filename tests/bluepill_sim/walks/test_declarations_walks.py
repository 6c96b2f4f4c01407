"""What every module of bluepill_sim declares, against what was approved, a trace for each folder of it."""

from pathlib import Path

import bluepill_sim
from tests.tools.suite.approved import Trace, judge_of
from tests.tools.suite.declared import declared_of

#: What a function of a table is asked: an opcode or an address, operands, a name.
ASKED: tuple[object, ...] = (
    0, 1, 0x2A5B, 0x4D3E, 0xF3C1_5A2D, 0xEA4F_13B6, (0x1234_5678, 0x21), (0x8000_00FF, 0x103), "PA5", "",
)  # fmt: skip


def packages_below(folder: Path) -> list[str]:
    """Return the full names of the packages in a folder, itself among them."""
    return sorted(".".join(file.relative_to(folder.parent).parent.parts) for file in folder.rglob("__init__.py"))


def _traces() -> dict[str, Trace]:
    found: dict[str, list[str]] = {}
    for package in packages_below(Path(bluepill_sim.__file__).parent):
        found.setdefault(".".join(package.split(".")[:2]), []).append(package)
    return {name: declared_of(*packages, asked=ASKED) for name, packages in found.items()}


TRACES = _traces()
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
