"""What a verb that holds a robot, or stands between one and its client, needs of the process.

Invariant: from `hold_robot` on, nothing suspends the program from its terminal, nothing that it
prints makes it wait, and no signal cuts the letting go of a robot short.
"""

import contextlib
import sys
from collections.abc import Iterator
from contextlib import AbstractContextManager
from typing import TypeVar

from p2os.cli.printing import queue_output
from p2os.cli.signals import end_on_suspension, postponed

Held = TypeVar("Held")


def hold_robot() -> None:
    """Prepare the process for holding a robot; before the robot is told anything."""
    end_on_suspension()
    queue_output()


@contextlib.contextmanager
def held(robot: AbstractContextManager[Held]) -> Iterator[Held]:
    """Connect a robot for a block, and let it go undisturbed by signals when the block is left."""
    hold_robot()
    client = robot.__enter__()
    try:
        yield client
    except BaseException:
        with postponed():
            if not robot.__exit__(*sys.exc_info()):
                raise
    else:
        with postponed():
            robot.__exit__(None, None, None)
