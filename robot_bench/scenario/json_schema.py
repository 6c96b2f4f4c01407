"""The JSON schema of a scenario file, for editors that complete and check TOML while one types.

It is made of the same tables of keys that the loader checks by, so both refuse the same keys, types and ranges. What
the loader checks beyond that (files, names, events in words) a schema cannot say.

Source: JSON Schema, draft 2020-12.
"""

from collections.abc import Sequence

from p2os.toml_schema import Key
from robot_bench.events.codec import Json
from robot_bench.scenario.goals.judging import COMMON
from robot_bench.scenario.goals.kinds import every_kind
from robot_bench.scenario.scenario import TABLES
from robot_bench.scenario.several_robots import ROBOT
from robot_bench.scenario.trigger_script import KEYS as WHEN_KEYS
from simbase.entry_points import installed_points

DRAFT = "https://json-schema.org/draft/2020-12/schema"
_TYPES = {
    "text": "string", "number": "number", "whole": "integer", "flag": "boolean", "table": "object", "tables": "array",
    "list": "array",
    "numbers": "array",
    "points": "array",
}  # fmt: skip


def scenario_schema() -> Json:
    """Return the schema as a JSON object."""
    top = table_schema(TABLES[""])
    within = table_schema(TABLES["[in_world.NAME]"])
    start = table_schema(TABLES["[start]"])
    properties: Json = dict(top["properties"])  # type: ignore[call-overload] # table_schema has made it
    inner: Json = dict(within["properties"])  # type: ignore[call-overload] # as above
    within["properties"] = inner | {"start": start}
    parts = {name: table_schema(TABLES[f"[{name}]"]) for name in ("direct", "adapter", "controller")}
    robot = table_schema(TABLES["[[robot]]"])
    own: Json = dict(robot["properties"])  # type: ignore[call-overload] # as above
    robot["properties"] = own | parts
    properties |= {
        "start": start,
        **parts,
        "robot": {"oneOf": [{"type": "string"}, {"type": "array", "items": robot}]},
        "in_world": {"type": "object", "additionalProperties": within},
        **{
            name: {"type": "array", "items": table_schema((*TABLES[f"[[{name}]]"], ROBOT))}
            for name in ("obstacle", "fault")
        },
        "part": {"type": "array", "items": table_schema(TABLES["[[part]]"]) | {"additionalProperties": True}},
        "when": {"type": "array", "items": table_schema((*WHEN_KEYS, ROBOT))},
        "goal": goals_schema(),
        "sweep": _SWEEP,
    }
    # What a file extends or includes may say the rest.
    wanted = [{"required": keys} for keys in (top.pop("required"), ["extends"], ["include"])]
    # Several robots have a program each.
    wanted.append({"required": ["robot", "world", "duration_s"], "properties": {"robot": {"type": "array"}}})
    return {"$schema": DRAFT, "title": "A scenario of p2os", **top, "properties": properties, "anyOf": wanted}


def goals_schema() -> Json:
    """Return the schema of the `[[goal]]` tables."""
    goals = [
        table_schema((*(key for key in COMMON if key.name != "kind"), ROBOT, *kind.keys), kind=name)
        for name, kind in every_kind().items()
    ]
    return {"type": "array", "items": {"oneOf": goals}}


#: Values of a parameter; or a range of them, or a table with parameters.
_SWEEP: Json = {
    "type": "object",
    "additionalProperties": {
        "oneOf": [{"type": "array", "minItems": 1}, {"type": "object", "additionalProperties": True}]
    },
}


def table_schema(keys: Sequence[Key], *, kind: str = "") -> Json:
    """Return the schema of one table with these keys; with `kind` that key has this value."""
    properties: Json = {key.name: _key(key) for key in keys}
    required = [key.name for key in keys if key.required]
    if kind:
        properties = {"kind": {"const": kind}} | properties
        required = ["kind", *required]
    return {"type": "object", "properties": properties, "required": required, "additionalProperties": False}


def _key(key: Key) -> Json:
    bounds = {"minimum": key.least, "exclusiveMinimum": key.above, "maximum": key.most}
    if key.kind == "texts":
        return {"oneOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}}]}
    found: Json = {"type": _TYPES[key.kind]}
    found |= {name: bound for name, bound in bounds.items() if bound is not None and key.kind in {"number", "whole"}}
    choices: Json = {"enum": list(key.choices)} if key.choices else {}
    if key.group:
        installed = list(installed_points(key.group))
        return found | {"anyOf": [{"enum": [*key.choices, *installed]}, {"pattern": r"\.py:[^:]+$"}]}
    return found | choices
