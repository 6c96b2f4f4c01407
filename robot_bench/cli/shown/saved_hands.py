"""A run with what hands did in it, written down: as a scenario, and as a test of pytest that runs it.

The scenario stands for itself: it has all that the files and options of the run said, and a `[[hand]]` for all that was
done. Of a run without goals it asks that the robot touches nothing: a test has to be able to fail.

Invariant: a run of the file leaves the trace of the run that it was made of.
"""

import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from p2os.pioneer.body.factory import resolve_body
from p2os.pioneer.world import known_worlds
from p2os.toml_file import toml_text
from p2os.toml_record import tables_of
from p2os.toml_schema import Table
from robot_bench.scenario.hands.timed import Hand
from robot_bench.scenario.included_files import read_tables, seen_from
from robot_bench.scenario.scenario import Scenario
from simbase.errors import UsageError
from simbase.files import write_text
from simbase.timing import NS_PER_S, Nanos

HEAD = "# {name} with what was done by hand on its page: each [[hand]] at its time, to the nanosecond.\n"
TEST = '''"""A run of {file}, which has what was done by hand on the page of a run."""

import pytest


@pytest.mark.scenario("{file}")
def test_{function}(bench):
    bench.run_until("{end_s!r} s")
    assert bench.judge().missed == []
'''
#: A class in a file, as scenarios name code.
_CODE = re.compile(r"(.+\.py):(\w+)")
#: Where a robot begins, which another world decides anew.
_PLACE = frozenset({"x_m", "y_m", "heading_deg"})
#: Where the programs that ship stand.
_SHIPPED = Path(__file__).parents[2] / "firmware"


def scenario_text(scenario: Scenario, hands: Sequence[Hand], folder: Path) -> str:
    """Return the text of a scenario that is a run with its hands.

    Args:
        scenario: What was run.
        hands: What was done beside what the scenario says.
        folder: Where the file will stand; files are named as seen from there.

    Raises:
        UsageError: The scenario is of no file.
        ScenarioError: Its files cannot be read any more.
    """
    if scenario.path is None:
        raise UsageError(
            "a scenario that a program made is not written down with its hands", hint="p2os view FILE.toml"
        )
    there, folder = scenario.path.parent.absolute(), folder.absolute()
    found = {key: value for key, value in read_tables(scenario.path, scenario.settings).table.items()
             if key not in {"seeds", "sweep"}}  # fmt: skip
    seen_from(found, there, folder)
    table = {key: _with_code(value, there, folder) for key, value in found.items()} | _options(scenario, folder)
    if scenario.robots:
        table["robot"] = _robots(scenario, tables_of(table, "robot"), folder)
    elif scenario.start is None:
        table.pop("start", None)
    own = table.get("hand")
    table.setdefault("goal", [{"kind": "no_collision"}])
    table["hand"] = [*(own if isinstance(own, list) else []), *(hand.table for hand in hands)]
    return HEAD.format(name=scenario.name.replace("\n", " ")) + toml_text(table)


def saved_beside(scenario: Scenario, hands: Sequence[Hand], folder: Path | None, kind: str, future: str = "") -> str:
    """Write a run with its hands down beside its folder, as a `scenario` or a `test`; return where, for a person.

    Args:
        scenario: What was run.
        hands: What was done beside what it says.
        folder: The run's; None: it has none.
        kind: As what.
        future: Of which fork; empty: the run itself.

    Raises:
        UsageError: It has no folder; otherwise as of `scenario_text`.
        FileError: It cannot be written.
    """
    if folder is None:
        raise UsageError("this run has no folder to write into", hint="p2os run SCENARIO --view")
    name = "-".join([folder.name, *future.split()])
    file = folder.parent / f"{name}.toml"
    write_text(file, scenario_text(scenario, hands, folder.parent))
    if kind == "scenario":
        return f"saved: p2os run {_shown(file)}"
    module = re.sub(r"\W+", "_", name)
    test = folder.parent / f"test_{module}.py"
    write_text(test, pytest_text(file.name, scenario.duration_ns))
    return f"saved: pytest {_shown(test)}"


def _shown(path: Path) -> str:
    """Return a path as one types it here."""
    return os.path.relpath(path) if path.is_relative_to(Path.cwd()) else str(path)


def pytest_text(file: str, end: Nanos) -> str:
    """Return the text of a test of pytest that runs a scenario's file to its end, and fails where a goal is missed."""
    function = re.sub(r"\W+", "_", Path(file).stem, flags=re.ASCII).strip("_")
    return TEST.format(file=file, function=function, end_s=end / NS_PER_S)


def _options(scenario: Scenario, folder: Path) -> dict[str, object]:
    """Return what a command line may have set otherwise than the file, as a file has it."""
    is_file = scenario.world not in known_worlds()
    found: dict[str, object] = {
        "world": os.path.relpath(Path(scenario.world).absolute(), folder) if is_file else scenario.world,
        "seed": scenario.seed, "duration_s": scenario.duration_ns / NS_PER_S,
    }  # fmt: skip
    if not _CODE.fullmatch(str(scenario.body)):
        found["body"] = resolve_body(scenario.body)
    return found if scenario.robots else found | _own_options(scenario, folder)


def _own_options(scenario: Scenario, folder: Path) -> dict[str, object]:
    """Return those that each of several robots has for itself."""
    firmware = scenario.firmware.absolute()
    found: dict[str, object] = {
        "firmware": firmware.name if firmware.parent == _SHIPPED else os.path.relpath(firmware, folder),
        "mode": scenario.mode, "record": list(scenario.record),
    }  # fmt: skip
    return found if scenario.usart_baud is None else found | {"usart_baud": scenario.usart_baud}


def _robots(scenario: Scenario, tables: Sequence[Table], folder: Path) -> Sequence[Table]:
    """Return the `[[robot]]` tables of a scenario with what a command line may have set otherwise."""
    found = []
    for table, robot in zip(tables, scenario.robots, strict=True):
        own = {} if robot.scenario is None else _own_options(robot.scenario, folder)
        found.append({**table, **own})
    placed = [("x_m" in table, (table.get("x_m"), table.get("y_m", 0.0))) for table in tables]
    stand = [(robot.start.x_m, robot.start.y_m) for robot in scenario.robots]
    if any(has_place and at != there for (has_place, at), there in zip(placed, stand, strict=True)):
        return [{key: value for key, value in one.items() if key not in _PLACE} for one in found]  # another world
    return found


def _with_code(value: object, there: Path, folder: Path) -> object:
    """Return a value of a file with the code that it names, such as `./mine.py:Body`, as seen from a folder."""
    if isinstance(value, str) and (match := _CODE.fullmatch(value)) is not None:
        return f"./{os.path.relpath(there / match[1], folder)}:{match[2]}"
    if isinstance(value, Mapping):
        return {key: _with_code(one, there, folder) for key, one in value.items()}
    return [_with_code(one, there, folder) for one in value] if isinstance(value, list) else value
