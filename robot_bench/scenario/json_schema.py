"""The JSON schema of a scenario file, for editors that complete and check TOML while one types.

It is made of the records that the loader reads by, so both refuse the same keys, types and ranges, and it says what
each key is for. What the loader checks beyond that (files, names, events in words) a schema cannot say.

Source: JSON Schema, draft 2020-12.
"""

import re
from collections.abc import Iterable
from enum import Enum

from p2os.toml_record import keys_of
from p2os.toml_schema import Key
from robot_bench.events.codec import Json
from robot_bench.scenario.tables import EachRobotTable, TopTable
from simbase.entry_points import installed_points

DRAFT = "https://json-schema.org/draft/2020-12/schema"
_TYPES = {
    "text": "string", "number": "number", "whole": "integer", "flag": "boolean", "table": "object", "tables": "array",
    "list": "array", "numbers": "array", "points": "array",
}  # fmt: skip
#: Values of a parameter; or a range of them, or a table with parameters.
_SWEEP: Json = {
    "type": "object",
    "additionalProperties": {
        "oneOf": [{"type": "array", "minItems": 1}, {"type": "object", "additionalProperties": True}]
    },
}
_LINK = re.compile(r"\[([^]]+)\]\([^)]*\)")


def scenario_schema() -> Json:
    """Return the schema as a JSON object."""
    top = table_schema(keys_of(TopTable))
    robots = {"type": "array", "items": table_schema(keys_of(EachRobotTable))}
    # What a file extends or includes may say the rest.
    wanted = [{"required": keys} for keys in (top.pop("required"), ["extends"], ["include"])]
    # Several robots have a program each.
    wanted.append({"required": ["robot", "world", "duration_s"], "properties": {"robot": {"type": "array"}}})
    own = {"robot": {"oneOf": [{"type": "string"}, robots]}, "sweep": _SWEEP}
    return {"$schema": DRAFT, "title": "A scenario of p2os", **with_properties(top, own), "anyOf": wanted}


def table_schema(keys: Iterable[Key], *, is_open: bool = False) -> Json:
    """Return the schema of one table with these keys; `is_open` lets it have others."""
    keys = tuple(keys)
    return {
        "type": "object", "properties": {key.name: key_schema(key) for key in keys},
        "required": [key.name for key in keys if key.required], "additionalProperties": is_open,
    }  # fmt: skip


def with_properties(table: Json, more: Json) -> Json:
    """Return the schema of a table with some of its keys as said here."""
    found = table["properties"]
    return table | {"properties": (found if isinstance(found, dict) else {}) | more}


def key_schema(key: Key) -> Json:
    """Return the schema of what stands in a key."""
    default = key.default.value if isinstance(key.default, Enum) else key.default
    said: Json = {"description": _LINK.sub(r"\1", key.doc)} if key.doc else {}
    said |= {"default": default} if isinstance(default, (str, int, float)) and not key.required else {}
    if key.variants is not None or key.record is not None:
        return said | _of_tables(key)
    if key.kind == "texts":
        return said | {"oneOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}}]}
    bounds = {"minimum": key.least, "exclusiveMinimum": key.above, "maximum": key.most}
    said |= {"type": _TYPES[key.kind]}
    said |= {name: bound for name, bound in bounds.items() if bound is not None and key.kind in {"number", "whole"}}
    if key.group:
        installed = list(installed_points(key.group))
        return said | {"anyOf": [{"enum": [*key.choices, *installed]}, {"pattern": r"\.py:[^:]+$"}]}
    return said | ({"enum": list(key.choices)} if key.choices else {})


def _of_tables(key: Key) -> Json:
    """Return the schema of a table, or of tables, that records declare."""
    if key.variants is not None:
        tag, common = key.variants.tag, keys_of(key.variants.common)
        rest = [one for one in common if one.name != tag]
        kinds = key.variants.kinds().items()
        tables: list[Json] = [_variant(tag, name, (*rest, *key.beside, *keys_of(kind))) for name, kind in kinds]
        return {"type": "array", "items": {"oneOf": tables}}
    table = table_schema((*keys_of(key.record or object), *key.beside), is_open=key.is_open)
    if key.kind == "tables":
        return {"type": "array", "items": table}
    return {"type": "object", "additionalProperties": table} if key.is_named else table


def _variant(tag: str, name: str, keys: Iterable[Key]) -> Json:
    table = with_properties(found := table_schema(keys), {tag: {"const": name}})
    required = found["required"]
    return table | {"required": [tag, *(required if isinstance(required, list) else [])]}
