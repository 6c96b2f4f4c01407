"""STOP on the page of a robot that a terminal drives: the page stops the robot, and does nothing else to it.

Invariant: whoever drives hears of each STOP at its next turn, and once.
"""

import threading
from dataclasses import replace

from p2os.cli.robots.page_control import ShownControl
from p2os.view.header import HandsOffer
from p2os.view.run_control import RunCommand, RunState

#: What its page offers: a robot that is there, which it does not drive.
STOPPED_FROM_PAGE = HandsOffer(is_real=True, most_mps=0.0, most_dps=0.0)
STANDS = "stopped from the page: let go of what is held, and press anew"
DRIVEN_HERE = "the terminal drives this robot: its page stops it, and nothing else"


class PageStop(ShownControl):
    """The button; the page's `RunControl`."""

    def __init__(self) -> None:
        super().__init__(RunState(is_running=True, why="the terminal drives"))
        self._pressed = threading.Event()
        self._guard = threading.Lock()

    # As the page's `RunControl`; from any thread.

    def offer(self, command: RunCommand) -> bool:
        """Take a command: STOP, or one that is refused in the state."""
        if command.do == "stop":
            self._pressed.set()
        self._say(trouble="" if command.do == "stop" else DRIVEN_HERE, is_done=True)
        return True

    # As who drives.

    def take(self) -> bool:
        """Tell whether STOP was pressed since the last call."""
        was_pressed = self._pressed.is_set()
        if was_pressed:
            self._pressed.clear()
            self._say(why=STANDS)
        return was_pressed

    def drives(self, *, is_driving: bool) -> None:
        """Take whether the robot is driven again, or stands."""
        if is_driving:
            self._say(why="the terminal drives")

    def _say(self, *, why: str | None = None, trouble: str | None = None, is_done: bool = False) -> None:
        with self._guard:
            old = self._state
            self._show(replace(
                old, why=old.why if why is None else why, trouble=old.trouble if trouble is None else trouble,
                done=old.done + is_done,
            ))  # fmt: skip
