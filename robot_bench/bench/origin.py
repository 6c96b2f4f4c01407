"""What a bench was made of: what has to be the same where one that was saved goes on.

Invariant: two benches of one origin that are in one state have one future.
"""

import hashlib
from collections.abc import Mapping

from p2os.pioneer.body.factory import resolve_body
from p2os.pioneer.world.model import World
from robot_bench.adapter import RUN_ANEW
from robot_bench.scenario.scenario import Scenario
from robot_bench.wires.ports import LeadingChip
from simbase.errors import UsageError
from simbase.installation import installed_version

VERSION = "version of p2os"
#: What decides a run besides its files; its end and its goals may be others after a restart.
DECISIVE = (
    "mode", "seed", "parameters", "threshold_um", "usart_baud", "outside", "start", "direct", "adapter",
    "adapter_core", "controller", "controller_kind", "changes", "faults", "triggers", "hands", "own_robot", "parts",
    "record", "sram", "crystal_ppm", "interrupt_latency_cycles",
)  # fmt: skip
#: Of these, what happens at times of its own: a part of it may be still to come.
LATER = ("changes", "faults")


def origin_of(scenario: Scenario, world: World, chip: LeadingChip) -> dict[str, object]:
    """Return what a bench is made of, each under its name for a person."""
    return {
        VERSION: installed_version(),
        "firmware": getattr(getattr(chip, "image", chip), "sha256", type(chip).__name__),
        "world": hashlib.sha256(repr(world).encode()).hexdigest(),
        "body": resolve_body(scenario.body),
        **{name: getattr(scenario, name) for name in DECISIVE},
        **scenario.own_classes,
    }


def refuse_others(saved: Mapping[str, object], here: Mapping[str, object]) -> None:
    """Refuse what was saved where something that decides a run is different from here.

    Raises:
        UsageError: So it is.
    """
    for what, value in saved.items():
        if here.get(what) != value:
            values = f": {value} there, {here.get(what)} here" if isinstance(value, str | int) else ""
            raise UsageError(f"the bench was saved with another {what}{values}", hint=RUN_ANEW)
