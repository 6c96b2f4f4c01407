"""What prints tables and shows progress (rich), with text of others in it that must not act on the terminal."""

import sys
from collections.abc import Iterable

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment

from simbase.terminal import drawn, readable


class ReadableConsole(Console):
    """A console on standard output or standard error that reads no markup in text and lets none of it act.

    Args:
        stderr: Whether it is standard error's.
    """

    def __init__(self, *, stderr: bool = False) -> None:
        super().__init__(file=drawn(sys.stderr if stderr else sys.stdout), highlight=False, markup=False, emoji=False)

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Yield what is drawn: rich's own controls as they are, all text readable."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else Segment(readable(segment.text), segment.style)
