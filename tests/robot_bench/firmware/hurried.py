"""The shipped programs in a hurry: what they wait for the link, three seconds, is a hundredth of one.

The adapter's link stands after 0.66 s; a robot in mode direct drives at once. All else is the program as it ships.
"""

import tempfile
from functools import cache
from pathlib import Path
from typing import Unpack

from robot_bench.scenario.scenario import Scenario, ScenarioOptions, load_scenario

#: `mov.w r0, #300` of board_wait_for_link, in ticks of 10 ms.
WAIT = bytes.fromhex("4ff49670")
#: With a number of 8 bits.
SHORTER = "4ff0{:02x}00"

_FOLDER = tempfile.TemporaryDirectory(prefix="hurried-")


@cache
def hurried(name: str, ticks: int = 1) -> Path:
    """Return the file of a scenario's program that waits so many ticks of 10 ms, at most 255."""
    shipped = load_scenario(name).firmware
    data = shipped.read_bytes()
    assert data.count(WAIT) == 1, "its only one"
    file = Path(_FOLDER.name, str(ticks), shipped.name)
    file.parent.mkdir(exist_ok=True)
    file.write_bytes(data.replace(WAIT, bytes.fromhex(SHORTER.format(ticks))))
    return file


def hurried_scenario(name: str, ticks: int = 1, **options: Unpack[ScenarioOptions]) -> Scenario:
    """Return a shipped scenario with its program in a hurry, and options of `Scenario.with_options`."""
    return load_scenario(name).with_options(firmware=hurried(name, ticks)).with_options(**options)
