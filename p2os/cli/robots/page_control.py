"""What the `RunControl` of a page is made of, whoever does what the page asks for.

Invariant: the state is another object only where it says something else, for that is what a page looks at.
"""

from collections.abc import Sequence

from p2os.cli.robots.command_queue import CommandQueue
from p2os.view.header import PanelState
from p2os.view.run_control import RunCommand, RunState


class ShownControl:
    """Shows how something stands; nobody sees into its program, unless a class says otherwise.

    Args:
        state: How it stands at first.
    """

    def __init__(self, state: RunState) -> None:
        self._state = state

    @property
    def state(self) -> RunState:
        """How it stands."""
        return self._state

    def offered(self, begun: str) -> Sequence[str]:  # noqa: ARG002 - as of `RunControl`
        """Return names of variables that what was typed may become."""
        return ()

    def look(self, panel: str, choice: str) -> PanelState | None:  # noqa: ARG002 - as of `RunControl`
        """Return what a panel showed last; None: there is nothing."""
        return None

    def _show(self, state: RunState) -> None:
        if state != self._state:
            self._state = state


class QueuedControl(ShownControl):
    """One whose commands wait until who does them takes them.

    Args:
        state: How it stands at first.
    """

    def __init__(self, state: RunState) -> None:
        super().__init__(state)
        self._commands = CommandQueue()

    def offer(self, command: RunCommand) -> bool:
        """Take a command; False where too many wait, but for those that stop."""
        return self._commands.offer(command)
