"""A run on a page in the browser, by whichever installed package has one: an entry point of `GROUP`.

The entry point is a function that takes a `ViewedRun` and shows it until it is ended; what a live run is, is its own.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import cast

from bluepill_sim.parts.registry import PartSpec
from simbase.entry_points import installed_points
from simbase.errors import MissingDependencyError
from simbase.installation import way_to_plug_in
from simbase.timing import Nanos
from simbase.user_classes import loaded

GROUP = "bluepill_sim.views"


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewedRun:
    """What is run and shown."""

    firmware: Path
    end_ns: Nanos
    #: Speed of USART1's far end, bit/s; None follows the program.
    usart_baud: int | None = None
    parts: Sequence[PartSpec] = ()
    #: TCP port where GDB may come, 0 a free one; None: it does not.
    gdb: int | None = None
    #: Whether a browser is opened.
    is_opened: bool = True


def view_run(run: ViewedRun) -> None:
    """Show a run until it is ended.

    Raises:
        MissingDependencyError: No installed package has a page.
    """
    point = installed_points(GROUP).get("page")
    if point is None:
        hint = way_to_plug_in(GROUP) or "install the test bench of this project beside it"
        raise MissingDependencyError("--view is not there: no installed package shows a run on a page", hint=hint)
    cast("Callable[[ViewedRun], None]", loaded(point))(run)
