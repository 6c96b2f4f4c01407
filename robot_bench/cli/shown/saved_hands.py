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
from robot_bench.scenario.hands.timed import Hand
from robot_bench.scenario.included_files import read_tables, seen_from
from robot_bench.scenario.scenario import Scenario
from simbase.errors import UsageError
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
#: Where the programs that ship stand.
_SHIPPED = Path(__file__).parents[2] / "firmware"


def scenario_text(scenario: Scenario, hands: Sequence[Hand], folder: Path) -> str:
    """Return the text of a scenario that is a run with its hands.

    Args:
        scenario: What was run.
        hands: What was done beside what the scenario says.
        folder: Where the file will stand; files are named as seen from there.

    Raises:
        UsageError: The scenario is of no file, or of several robots.
        ScenarioError: Its files cannot be read any more.
    """
    if scenario.path is None or scenario.robots:
        what = "a scenario that a program made" if scenario.path is None else "a run of several robots"
        raise UsageError(f"{what} is not written down with its hands", hint="p2os view FILE.toml")
    there, folder = scenario.path.parent.absolute(), folder.absolute()
    found = {key: value for key, value in read_tables(scenario.path, scenario.settings).table.items()
             if key not in {"seeds", "sweep"}}  # fmt: skip
    seen_from(found, there, folder)
    table = {key: _with_code(value, there, folder) for key, value in found.items()} | _options(scenario, folder)
    if scenario.start is None:
        table.pop("start", None)
    own = table.get("hand")
    table.setdefault("goal", [{"kind": "no_collision"}])
    table["hand"] = [*(own if isinstance(own, list) else []), *(hand.table for hand in hands)]
    return HEAD.format(name=scenario.name.replace("\n", " ")) + toml_text(table)


def pytest_text(file: str, end: Nanos) -> str:
    """Return the text of a test of pytest that runs a scenario's file to its end, and fails where a goal is missed."""
    function = re.sub(r"\W+", "_", Path(file).stem, flags=re.ASCII).strip("_")
    return TEST.format(file=file, function=function, end_s=end / NS_PER_S)


def _options(scenario: Scenario, folder: Path) -> dict[str, object]:
    """Return what a command line may have set otherwise than the file, as a file has it."""
    firmware, is_file = scenario.firmware.absolute(), scenario.world not in known_worlds()
    found: dict[str, object] = {
        "firmware": firmware.name if firmware.parent == _SHIPPED else os.path.relpath(firmware, folder),
        "world": os.path.relpath(Path(scenario.world).absolute(), folder) if is_file else scenario.world,
        "mode": scenario.mode, "seed": scenario.seed, "duration_s": scenario.duration_ns / NS_PER_S,
        "record": list(scenario.record),
    }  # fmt: skip
    if not _CODE.fullmatch(str(scenario.body)):
        found["body"] = resolve_body(scenario.body)
    if scenario.usart_baud is not None:
        found["usart_baud"] = scenario.usart_baud
    return found


def _with_code(value: object, there: Path, folder: Path) -> object:
    """Return a value of a file with the code that it names, such as `./mine.py:Body`, as seen from a folder."""
    if isinstance(value, str) and (match := _CODE.fullmatch(value)) is not None:
        return f"./{os.path.relpath(there / match[1], folder)}:{match[2]}"
    if isinstance(value, Mapping):
        return {key: _with_code(one, there, folder) for key, one in value.items()}
    return [_with_code(one, there, folder) for one in value] if isinstance(value, list) else value
