"""What pages ask for, until who does it takes it: from any thread, bounded; what stops a robot always comes through.

A stop (`stop`, or a `drive` of nothing, which lets go) comes out before all else that waits, in the order in which
stops came, and what was to be driven before it is driven no more.

Invariant: at most `most` commands wait, and two stops.
"""

import threading
from collections import deque

from p2os.view.run_control import RunCommand

#: chosen: commands that may wait; a page sends ten a second.
MOST_COMMANDS = 64


class CommandQueue:
    """Commands that wait.

    Args:
        most: So many may wait, and stops beside them.
    """

    def __init__(self, most: int = MOST_COMMANDS) -> None:
        self._most = most
        self._stops: deque[RunCommand] = deque()
        self._others: deque[RunCommand] = deque()
        self._changed = threading.Condition()

    def __len__(self) -> int:
        return len(self._stops) + len(self._others)

    def offer(self, command: RunCommand) -> bool:
        """Take a command; False where too many wait, but for those that stop."""
        with self._changed:
            if is_stop(command):
                self._stop(command)
            elif len(self._others) >= self._most:
                return False
            else:
                self._others.append(command)
            self._changed.notify()
        return True

    def _stop(self, command: RunCommand) -> None:
        for waiting in [one for one in self._others if one.do == "drive"]:
            self._others.remove(waiting)
        if command.do == "stop":
            self._stops.clear()  # what came before it changes nothing
        if not any((one.do, one.robot) == (command.do, command.robot) for one in self._stops):
            self._stops.append(command)

    def take(self, wait_s: float = 0.0) -> RunCommand | None:
        """Return the command that is next, once it is there; None where none comes within so many seconds."""
        with self._changed:
            if not len(self) and wait_s > 0:
                self._changed.wait_for(lambda: len(self) > 0, wait_s)
            waiting = self._stops or self._others
            return waiting.popleft() if waiting else None


def is_stop(command: RunCommand) -> bool:
    """Tell whether a command has a robot stand."""
    return command.do == "stop" or (command.do == "drive" and not command.forward_mps and not command.turn_dps)
