"""Write into their pages what the files' readers and writers check by: ranges of numbers, and what a format holds.

What stands between `<!-- ranges: NAME -->`, or `table: NAME`, and `<!-- end -->` is generated; a test holds the
committed pages to what comes out here.
Usage: python tools/generate_ranges.py
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from adapter_sim import pinout
from p2os.pioneer import sensor_errors
from p2os.pioneer.controller import faults, flash
from p2os.pioneer.export.formats import FORMATS
from p2os.pioneer.export.scene import Property
from p2os.pioneer.serve import fleet_file
from p2os.pioneer.world import model as world
from p2os.robots import model_file
from p2os.toml_schema import Key
from robot_bench.scenario import scenario
from robot_bench.scenario.goals.kinds import every_kind

ROOT = Path(__file__).resolve().parents[1]
PAGES = tuple(ROOT / "docs" / name for name in ("worlds.md", "scenarios.md", "pioneer.md", "adapter.md"))
BLOCK = re.compile(r"(<!-- (?:ranges|table): (?P<name>[a-z ]+) -->\n)(?P<body>.*?)(<!-- end -->)", re.DOTALL)
#: Table → key → its range in words.
Ranges = Mapping[str, Mapping[str, str]]


def plain(table: Mapping[str, tuple[float, float]]) -> dict[str, str]:
    """Return the ranges of a table of least and most in words."""
    return {key: f"{number(least)} to {number(most)}" for key, (least, most) in table.items()}


def of_keys(keys: Iterable[Key]) -> dict[str, str]:
    """Return the ranges of the numbers among the keys of a scenario's table in words."""
    return {key.name: _of_key(key) for key in keys if key.kind in {"number", "whole"}}


def _of_key(key: Key) -> str:
    least = f"above {number(key.above)}" if key.above is not None else number(key.least or 0)
    return f"{least} to {number(key.most or 0)}"


def number(value: float) -> str:
    """Return a number as the tables show it."""
    if value == 2**63 - 1:
        return "2^63 - 1"
    return f"{int(value):,}".replace(",", " ") if value == int(value) else f"{value:g}"


def lines(ranges: Ranges, first: str) -> str:
    """Return one table: a row for each range of a table, with the keys that have it."""
    rows = [f"| {first} | keys | range |", "|---|---|---|"] if first else ["| keys | range |", "|---|---|"]
    for table, keys in ranges.items():
        for words in dict.fromkeys(keys.values()):
            named = ", ".join(f"`{key}`" for key, its in keys.items() if its == words)
            rows.append(f"| {table} | {named} | {words} |" if first else f"| {named} | {words} |")
    return "\n".join(rows)


def _one(table: Mapping[str, tuple[float, float]]) -> str:
    return lines({"": plain(table)}, "")


def _poses(names: Sequence[str], ranges: Sequence[tuple[float, float]]) -> dict[str, tuple[float, float]]:
    return dict(zip(names, ranges, strict=True))


def exports() -> str:
    """Return what the formats hold of a world and a robot: a row a property, a column a format."""
    made = {one.title: one for one in FORMATS.values()}
    rows = [f"| | {' | '.join(made)} |", f"|---|{'---|' * len(made)}"]
    for prop in Property:
        cells = (one.cell(prop) for one in made.values())
        words = (("yes" if cell.held else "**no**") + (f": {cell.how}" if cell.how else "") for cell in cells)
        rows.append(f"| {prop.value} | {' | '.join(words)} |")
    return "\n".join(rows)


def tables() -> dict[str, str]:
    """Return every generated table by its name."""
    goals = {f"[[goal]] {name}": kind.keys for name, kind in every_kind().items()}
    robots = {f"`[{name}]`": plain(keys) for name, keys in model_file.RANGES.items()}
    robots["`[sonar]` `poses`"] = plain(_poses(("x_mm", "y_mm", "heading_deg"), model_file.POSE_RANGES))
    at = _poses(("at[0]", "at[1]", "at[2]"), fleet_file.PLACE_RANGES)
    return {
        "world": _one(world.RANGES),
        "scenario": lines(
            {f"`{name}`" if name else "the file": of_keys(keys) for name, keys in {**scenario.TABLES, **goals}.items()},
            "table",
        ),
        "robot": lines(robots, "table"),
        "fleet": lines({"": {**of_keys((*fleet_file.TOP, *fleet_file.ROBOT)), **plain(at)}}, ""),
        "sensor errors": _one(sensor_errors.RANGES),
        "faults": _one(faults.VALUES),
        "flash": _one(flash.RANGES),
        "pinout": lines(
            {
                "": of_keys(
                    dict.fromkeys(
                        key for keys in pinout.KEYS.values() for key in (*keys, *pinout.OF_VALUE, *pinout.OF_DISTANCE)
                    )
                )
            },
            "",
        ),
        "exports": exports(),
    }


def page(text: str) -> str:
    """Return a page with every table renewed."""
    made = tables()
    return BLOCK.sub(lambda block: f"{block[1]}\n{made[block['name']]}\n\n{block[4]}", text)


if __name__ == "__main__":
    for path in PAGES:
        path.write_text(page(path.read_text(encoding="utf-8")), encoding="utf-8")
