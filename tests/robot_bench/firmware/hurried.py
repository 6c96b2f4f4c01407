"""The shipped programs in a hurry: they wait for the link, and `motors` holds its values, for less than three seconds.

The adapter's link stands after 0.66 s; a robot in mode direct drives at once. All else is the program as it ships.
"""

import tempfile
from functools import cache
from pathlib import Path
from typing import Unpack

from robot_bench.scenario.loading import load_scenario
from robot_bench.scenario.options import ScenarioOptions
from robot_bench.scenario.scenario import Scenario

#: `mov.w r0, #300` of board_wait_for_link, in ticks of 10 ms.
WAIT = bytes.fromhex("4ff49670")
#: `movw r0, #301` of `motors`, and 1.61 s in its place: its slowest ramp takes 1.46 s.
HOLD, HELD_TICKS = bytes.fromhex("40f22d10"), 161
#: `mov.w r0` with a number of 8 bits.
SHORTER = "4ff0{:02x}00"

_FOLDER = tempfile.TemporaryDirectory(prefix="hurried-")


@cache
def hurried(name: str, ticks: int = 1) -> Path:
    """Return the file of a scenario's program that waits so many ticks of 10 ms, at most 255."""
    shipped = load_scenario(name).firmware
    data = shipped.read_bytes()
    assert (data.count(WAIT), data.count(HOLD)) == (1, name == "motors"), "its only ones"
    file = Path(_FOLDER.name, str(ticks), shipped.name)
    file.parent.mkdir(exist_ok=True)
    for long, short in ((WAIT, ticks), (HOLD, HELD_TICKS)):
        data = data.replace(long, bytes.fromhex(SHORTER.format(short)))
    file.write_bytes(data)
    return file


def hurried_scenario(name: str, ticks: int = 1, **options: Unpack[ScenarioOptions]) -> Scenario:
    """Return a shipped scenario with its program in a hurry, and options of `Scenario.with_options`."""
    return load_scenario(name, firmware=hurried(name, ticks)).with_options(**options)
