"""Write into their pages what the files' readers and writers check by: keys, ranges, and what a format holds.

What stands between `<!-- ranges: NAME -->`, or `table: NAME`, and `<!-- end -->` is generated; a test holds the
committed pages to what comes out here.
Usage: python tools/generators/ranges.py
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from enum import Enum
from pathlib import Path

from adapter_sim import pinout
from p2os.pioneer import sensor_errors
from p2os.pioneer.controller import faults, flash
from p2os.pioneer.export.formats import FORMATS
from p2os.pioneer.export.scene import Property
from p2os.pioneer.serve import fleet_file
from p2os.pioneer.world import model as world
from p2os.robots import model_file
from p2os.toml_record import keys_of
from p2os.toml_schema import Key
from robot_bench.campaign import campaign_file
from robot_bench.direct.differential import robot_file
from robot_bench.scenario.goals.kinds import every_kind
from robot_bench.scenario.hands.doing import ACTION_TABLES
from robot_bench.scenario.hands.timed import TimedHandTable
from robot_bench.scenario.tables import TABLES, TopTable
from robot_bench.scenario.trigger_script import WhenTable
from robot_bench.scenario.world_script import ThingTable

ROOT = Path(__file__).resolve().parents[2]
PAGES = tuple(
    ROOT / "docs" / name
    for name in (
        "worlds.md",
        "scenarios.md",
        "pioneer.md",
        "adapter.md",
        "campaigns.md",
        "own-robot.md",
    )
)
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


#: What has a section of its own.
_OF_SCRIPTS = ("[[obstacle]]", "[[fault]]")


def keys_table(tables: Mapping[str, Iterable[Key]]) -> str:
    """Return every key of some tables: its default, what may stand there, what it is for; a row for equal ones."""
    is_one = list(tables) == [""]
    head = [*([] if is_one else ["table"]), "key", "default", "values", "meaning"]
    rows = [_row(head), f"|{'---|' * len(head)}"]
    for table, keys in tables.items():
        named: dict[tuple[str, ...], list[str]] = {}
        for key in sorted(keys, key=lambda key: not key.required):
            words = "required" if key.required else _default(key), _values(key), _cell(key.doc)
            named.setdefault(words, []).append(f"`{_header(key)}`")
        first = [] if is_one else [f"`{table}`" if table.startswith("[") else table]
        rows += [_row([*first, ", ".join(one), *words]) for words, one in named.items()]
    return "\n".join(rows)


def kinds_table(kind: str, doc: str, kinds: Mapping[str, tuple[type, str]]) -> str:
    """Return a row for each kind of a table: its keys, required ones in bold, with their ranges; what it is."""
    named: dict[tuple[type, str], list[str]] = {}
    for name, said in kinds.items():
        named.setdefault(said, []).append(f"`{name}`")
    rows = [_row([kind, "keys", doc]), "|---|---|---|"]
    for (record, words), names in named.items():
        keys = _ELSEWHERE.get(record) or ", ".join(map(_short, keys_of(record)))
        rows.append(_row([", ".join(names), keys, _cell(words)]))
    return "\n".join(rows)


#: Whose keys have a table of their own.
_ELSEWHERE = {ThingTable: "those of `[[obstacle]]` but `at_s` and `op`"}


def _row(cells: Sequence[str]) -> str:
    return f"|{'|'.join(f' {cell} ' if cell else ' ' for cell in cells)}|"


def _short(key: Key) -> str:
    name, default, values = f"`{key.name}`", "" if key.required else _default(key), _values(key)
    limits = (f" = {default}" if default else "") + (f" ({values})" if values != "text" else "")
    return (f"**{name}**" if key.required else name) + limits


def _header(key: Key) -> str:
    if key.kind == "tables":
        return f"[[{key.name}]]"
    if key.kind == "table":
        return f"[{key.name}.NAME]" if key.is_named else f"[{key.name}]"
    return key.name


def _default(key: Key) -> str:
    value = key.default.value if isinstance(key.default, Enum) else key.default
    if value in (None, "", ()) or key.kind in {"table", "tables", "points"}:
        return ""
    if isinstance(value, (int, float)):
        return str(value).lower() if isinstance(value, bool) else number(value)
    return f"`{value if isinstance(value, str) else list(value)}`"


def _values(key: Key) -> str:
    """Return what may stand in a key."""
    if key.choices:
        return ", ".join(f"`{choice}`" for choice in key.choices)
    if key.kind in {"number", "whole"}:
        return _of_key(key)
    words = {"flag": "true, false", "table": "", "tables": "", "points": "list", "texts": "text, list"}
    return words.get(key.kind, key.kind)


def _cell(doc: str) -> str:
    return doc.strip().partition("\n")[0].removesuffix(".").replace("|", "\\|")


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
    robots = {f"`[{name}]`": plain(keys) for name, keys in model_file.RANGES.items()}
    robots["`[sonar]` `poses`"] = plain(_poses(("x_mm", "y_mm", "heading_deg"), model_file.POSE_RANGES))
    at = _poses(("at[0]", "at[1]", "at[2]"), fleet_file.PLACE_RANGES)
    return {
        "world": _one(world.RANGES),
        "scenario file": keys_table({"": keys_of(TopTable)}),
        "scenario tables": keys_table({name: keys for name, keys in TABLES.items() if name not in {"", *_OF_SCRIPTS}}),
        **{name.strip("[]"): keys_table({"": TABLES[name]}) for name in _OF_SCRIPTS},
        "when": keys_table({"": keys_of(WhenTable)}),
        "hand": keys_table({"": keys_of(TimedHandTable)}),
        "actions": kinds_table(
            "`do`", "what is done", {do: (one, one.__doc__ or "") for do, one in ACTION_TABLES.items()}
        ),
        "goals": kinds_table("kind", "met when", {name: (one.table, one.doc) for name, one in every_kind().items()}),
        "campaign file": keys_table({"": campaign_file.TABLES[""]}),
        "campaign tables": keys_table({name: keys for name, keys in campaign_file.TABLES.items() if name}),
        "own robot": keys_table({name or "the file": keys for name, keys in robot_file.TABLES.items()}),
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
