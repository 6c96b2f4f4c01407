"""The schema takes what the loader takes, and refuses what it refuses."""

import copy
import json
import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from p2os.cli.main import run as p2os
from p2os.errors import ScenarioError
from robot_bench.cli import check
from robot_bench.scenario.json_schema import scenario_schema
from robot_bench.scenario.loading import known_scenarios, load_scenario, read_scenario
from simbase.errors import UsageError

SCHEMA = scenario_schema()
TYPES = {"string": str, "number": (int, float), "integer": int, "boolean": bool, "object": dict, "array": list}
EXTRA = """
[[when]]
event = "contact"
do = "end"
[[goal]]
kind = "reach"
x_m = 1.0
y_m = 0.0
radius_m = 0.5
ends_run = "met"
[[fault]]
at_s = 1.0
fault = "reboot"
"""


def fits(value: Any, schema: dict[str, Any]) -> bool:
    """Tell whether a value is as a schema of this one's few words wants it."""
    if schema in ({}, True):
        return True
    if "oneOf" in schema:
        return sum(fits(value, one) for one in schema["oneOf"]) == 1
    if "const" in schema:
        return bool(value == schema["const"])
    kind = schema["type"]
    if not isinstance(value, TYPES[kind]) or (isinstance(value, bool) and kind != "boolean"):  # type: ignore[arg-type] # types
        return False
    return bool(RULES.get(kind, lambda _value, _schema: True)(value, schema))


def fits_object(value: dict[str, Any], schema: dict[str, Any]) -> bool:
    allowed = schema["additionalProperties"]
    inner = [schema.get("properties", {}).get(key, allowed) for key in value]
    if not any(is_one_of(value, one) for one in schema.get("anyOf", [{"required": ()}])):
        return False
    known = all(rule is not False and fits(item, rule) for item, rule in zip(value.values(), inner, strict=True))
    return known and set(schema.get("required", ())) <= set(value)


def is_one_of(value: dict[str, Any], one: dict[str, Any]) -> bool:
    has = set(one["required"]) <= set(value)
    return has and all(fits(value[key], inner) for key, inner in one.get("properties", {}).items())


def fits_number(value: float, schema: dict[str, Any]) -> bool:
    above = schema.get("exclusiveMinimum", -1e99) < value
    return bool(above and schema.get("minimum", -1e99) <= value <= schema.get("maximum", 1e99))


def fits_text(value: str, schema: dict[str, Any]) -> bool:
    return value in schema.get("enum", [value]) and re.search(schema.get("pattern", ""), value) is not None


RULES: dict[str, Any] = {
    "object": fits_object, "number": fits_number, "integer": fits_number,
    "array": lambda value, schema: "items" not in schema or all(fits(item, schema["items"]) for item in value),
    "string": lambda value, schema: any(fits_text(value, one) for one in schema.get("anyOf", [schema])),
}  # fmt: skip


@pytest.mark.parametrize("name", known_scenarios())
def test_what_ships_fits_the_schema(name: str) -> None:
    assert fits(tomllib.loads(load_scenario(name).text), SCHEMA)


@pytest.mark.parametrize(
    ("table", "key", "value"),
    [
        ("", "seed", -1), ("", "seed", 1.5), ("", "version", 2), ("", "sead", 1), ("", "body", "jelly"),
        ("", "robot", 3),
        ("goal", "radius_m", 0), ("goal", "radios_m", 1), ("goal", "kind", "reech"), ("goal", "ends_run", "soon"),
        ("when", "do", "explode"), ("when", "every", 1), ("fault", "at_s", "5"), ("fault", "at_s", 1e7),
    ],
)  # fmt: skip
def test_schema_and_loader_refuse_the_same(table: str, key: str, value: object, tmp_path: Any) -> None:
    text = load_scenario("motors").text + EXTRA
    plain = tomllib.loads(text)
    assert fits(plain, SCHEMA)
    (tmp_path / "right.toml").write_text(text, encoding="utf-8")
    read_scenario(tmp_path / "right.toml")
    wrong = copy.deepcopy(plain)
    (wrong[table][-1] if table else wrong)[key] = value
    assert not fits(wrong, SCHEMA)
    line = f"{key} = {str(value).lower() if not isinstance(value, str) else repr(value)}\n"
    old = [row for row in text.splitlines(keepends=True) if not row.startswith(f"{key} =")] if key in plain else None
    if table:
        head, tail = text.rsplit(f"[[{table}]]\n", 1)
        kept, *others = tail.split("[[", 1)
        kept = "".join(row for row in kept.splitlines(keepends=True) if not row.startswith(f"{key} ="))
        changed = f"{head}[[{table}]]\n{line}{kept}" + "".join(f"[[{other}" for other in others)
    else:
        changed = line + "".join(old or [text])
    (tmp_path / "wrong.toml").write_text(changed, encoding="utf-8")
    with pytest.raises(ScenarioError):
        read_scenario(tmp_path / "wrong.toml")


def test_check_says_of_each_file_what_it_is_or_what_is_wrong(tmp_path: Any) -> None:
    app = typer.Typer()
    check.register(app)

    def said(*words: str) -> Any:
        return CliRunner().invoke(app, words)

    wrong = tmp_path / "mine.toml"
    wrong.write_text(load_scenario("motors").text.replace("duration_s", "duration_m"), encoding="utf-8")
    both = said("motors", str(wrong))
    ok, refused = both.stdout.splitlines()
    assert (both.exit_code, ok) == (1, "ok     motors: 16 s of motors.elf in room, 4 goals")
    assert refused.startswith("wrong  mine.toml:6: unknown key 'duration_m' (hint: did you mean 'duration_s'?)")
    assert said("motors").exit_code == 0
    assert isinstance(said().exception, UsageError)
    assert json.loads(said("--schema").stdout) == json.loads(json.dumps(SCHEMA))


def test_the_schema_takes_several_robots_and_each_ones_goals() -> None:
    robots = """
    world = "room"
    duration_s = 3
    [[robot]]
    name = "a"
    firmware = "dodge.elf"
    adapter = { core = "model" }
    [[robot]]
    name = "b"
    [[goal]]
    robot = "a"
    kind = "no_collision"
    [[fault]]
    robot = "a"
    at_s = 1
    fault = "reboot"
    """
    assert fits(tomllib.loads(robots), SCHEMA)
    for old, new in (('name = "b"', 'color = "b"'), ('"model"', "3"), ('robot = "a"', "robot = 3")):
        assert not fits(tomllib.loads(robots.replace(old, new)), SCHEMA)
    assert not fits(tomllib.loads('world = "room"\nduration_s = 3\nrobot = "p2dx"'), SCHEMA), "no firmware"


def test_the_schema_takes_files_of_files_seeds_and_sweeps() -> None:
    sweep = 'seeds = "0-9"\n[sweep]\nthreshold_m = [0.4]\nstart.x_m = { from = 0, to = 1, step = 0.5 }\n'
    assert fits(tomllib.loads(f'extends = "dodge"\ninclude = ["a.toml"]\n{sweep}'), SCHEMA)
    assert not fits(tomllib.loads(f"include = 3\n{sweep}"), SCHEMA)
    assert not fits(tomllib.loads('extends = "dodge"\n[sweep]\nthreshold_m = 0.4\n'), SCHEMA)
    assert not fits(tomllib.loads(sweep), SCHEMA), "a file that names no other has to say what it runs"


def test_a_check_names_the_row_of_a_sweep_that_cannot_be(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("good.toml").write_text('extends = "dodge"\nseeds = "0-4"\n[sweep]\nthreshold_m = [0.4, 0.6]\n')
    Path("bad.toml").write_text('extends = "dodge"\n[sweep]\nthreshold_m = [0.4, -1]\n')
    Path("faults.toml").write_text('extends = "motors"\nmode = "direct"\n[[fault]]\nat_s = 1.0\nfault = "link-down"\n')
    Path("when.toml").write_text(
        'extends = "motors"\nmode = "direct"\n[[when]]\nevent = "contact"\ndo = "end"\n'
        '[[when]]\nevent = "contact"\ndo = "drop_link"\n'
    )
    Path("part.toml").write_text('extends = "motors"\n[[part]]\nkind = "gps"\non = "USART9"\n')
    Path("parts.toml").write_text(
        'extends = "motors"\n[sweep]\nseed = [1, 2]\npart.1.on = ["USART3", "USART9"]\n'
        '[[part]]\nkind = "gps"\non = "USART3"\n'
    )
    assert p2os(["check", "good.toml", "bad.toml", "faults.toml", "when.toml", "part.toml", "parts.toml"]) == 1
    lines = capsys.readouterr().out.splitlines()
    goals = len(load_scenario("dodge").goals)
    assert lines[0] == f"ok     good.toml: 120 s of dodge.elf in room, {goals} goals, 10 runs"
    assert lines[1].startswith("wrong  bad.toml:2: [sweep] threshold_m: threshold_m = -1 is out of range")
    assert lines[2].startswith("wrong  faults.toml:3: [[fault]] 1: a fault acts on the robot's controller, and mode")
    assert lines[3].startswith("wrong  when.toml:6: [[when]] 2: a fault acts on the robot's controller, and mode")
    assert lines[4].startswith("wrong  part.toml:2: [[part]] 1: no such port: USART9")
    row = "parts.toml:2: [sweep] seed = 1, part.1.on = USART9"
    assert lines[5].startswith(f"wrong  {row}: parts.toml:5: [[part]] 1: no")


def test_a_check_builds_a_bench_with_each_value_of_a_sweep_not_with_each_row(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    built = []
    monkeypatch.setattr(check, "_build", lambda scenario: built.append((scenario.threshold_m, scenario.mode)))
    Path("many.toml").write_text(
        'extends = "dodge"\n[sweep]\nthreshold_m = [0.4, 0.6, 0.4]\nmode = ["adapter", "direct"]\n'
    )
    assert p2os(["check", "many.toml"]) == 0
    assert capsys.readouterr().out.endswith(", 6 runs\n")
    assert built[1:] == [(0.4, "adapter"), (0.4, "direct"), (0.6, "adapter")], "the first is that of the file itself"
