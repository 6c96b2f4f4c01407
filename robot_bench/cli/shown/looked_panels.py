"""The panels that pages look at: each is looked at while it is asked for, at most ten times a second of the clock.

Invariant: a look is made between two slices of the chip, and changes nothing.
"""

from collections.abc import Sequence

from p2os.view.header import PanelState
from p2os.view.targets import ViewPanel
from simbase.timing import Nanos

#: chosen: panels that are looked at ten times a second, of all pages together.
MOST_LOOKS, LOOK_NS = 12, 100_000_000


class LookedPanels:
    """The panels of what runs.

    Args:
        panels: Of its chip, or of several.
    """

    def __init__(self, panels: Sequence[ViewPanel]) -> None:
        self._by_name = {one.name: one for one in panels}
        #: What pages look at, by panel and choice, and what each showed last.
        self._looked: dict[tuple[str, str], PanelState | None] = {}
        self._wanted: set[tuple[str, str]] = set()
        self._looked_at: Nanos = 0

    @property
    def panels(self) -> Sequence[ViewPanel]:
        """All of them."""
        return [*self._by_name.values()]

    def replace(self, panels: Sequence[ViewPanel]) -> None:
        """Look at another chip's from now on."""
        self._by_name = {one.name: one for one in panels}
        self._looked.clear()

    def asked(self, panel: str, choice: str) -> PanelState | None:
        """Return what a panel showed last; None: there is nothing yet. Called by who shows it."""
        key = panel, choice
        if panel not in self._by_name or len(self._wanted) >= MOST_LOOKS:
            return None
        self._wanted.add(key)
        return self._looked.get(key)

    def is_due(self, clock_ns: Nanos) -> bool:
        """Tell whether somebody looks, and the last look was long ago."""
        return bool(self._wanted) and clock_ns - self._looked_at >= LOOK_NS

    def look(self, clock_ns: Nanos, at_ns: Nanos) -> None:
        """Look at what is asked for, where that is due; called by who runs the chip."""
        if not self.is_due(clock_ns):
            return
        wanted, self._wanted, self._looked_at = self._wanted, set(), clock_ns
        for panel, choice in wanted:
            sections = self._by_name[panel].look(choice)
            found = PanelState(name=panel, choice=choice, at_ns=at_ns, sections=sections)
            if found != self._looked.get((panel, choice)):
                self._looked[panel, choice] = found
