"""The walks as traces that tests hold to what was approved (`tests.tools.suite.approved`): an episode each line."""

import random
from collections.abc import Iterator
from functools import partial

from tests.bluepill_sim.peripherals.walks.buses import BUSES
from tests.bluepill_sim.peripherals.walks.system import SYSTEM
from tests.bluepill_sim.peripherals.walks.timers import TIMERS
from tests.bluepill_sim.peripherals.walks.walker import RegisterWalk, RegisterWalker
from tests.tools.suite.approved import Trace

WALKS: tuple[RegisterWalk, ...] = (*BUSES, *TIMERS, *SYSTEM)


def traces_of(*names: str) -> dict[str, Trace]:
    """Return the traces of some walks, by their names."""
    return {walk.name: partial(_episodes, walk) for walk in WALKS if walk.name in names}


def _episodes(walk: RegisterWalk, _: random.Random) -> Iterator[str]:
    """Yield what each episode shows; each draws by its own number."""
    for number in range(walk.episodes):
        yield "\n".join(RegisterWalker(walk, number).go())
