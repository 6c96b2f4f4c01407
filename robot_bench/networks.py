"""What a bench joins while it runs, each by its option an entry point: networks of which it is a node, and viewers."""

from collections.abc import Callable, Collection, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Protocol, cast

from robot_bench.run import RunBench
from robot_bench.scenario.scenario import Scenario
from simbase.entry_points import installed_points
from simbase.errors import UsageError
from simbase.installation import way_to_plug_in
from simbase.user_classes import loaded

GROUP = "robot_bench.networks"
VIEWERS = "robot_bench.viewers"


class Network(Protocol):
    """What an entry point of `GROUP` is: a module with these functions."""

    def place_before(self, word: str) -> Sequence[str]:
        """Return the usual place where the word that follows the option names none; nothing where it does."""
        ...

    def refuse_without_pins(self, scenario: Scenario) -> None:
        """Refuse a scenario that has not the pins of which a node tells.

        Raises:
            UsageError: So it is.
        """
        ...

    def met(self, place: str) -> AbstractContextManager[RunBench]:
        """Join the network at a place for a block, and yield what runs a bench as a node of it.

        Raises:
            UsageError: The text names no place.
            MissingDependencyError, TransportError: It cannot be joined.
        """
        ...

    def with_inputs(self, path: Path) -> RunBench:
        """Return what runs a bench with what came in from the network in an earlier run.

        Raises:
            FileError, TraceError: There is none, or it cannot be read.
        """
        ...


class Viewer(Protocol):
    """What an entry point of `VIEWERS` is: a module with these functions."""

    def place_before(self, word: str) -> Sequence[str]:
        """Return the usual place where the word that follows the option names none; nothing where it does."""
        ...

    def live_scene(
        self, scenario: Scenario, place: str, on_ready: Callable[[str], None], origins: Collection[str] = ()
    ) -> AbstractContextManager[RunBench]:
        """Serve a run for a block at a place, to pages of these origins too, and yield what runs its bench.

        Raises:
            MissingDependencyError, UsageError: It cannot be served there.
        """
        ...


def network_of(name: str) -> Network:
    """Return a network by its name, which is that of its option.

    Raises:
        UsageError: It is not installed.
    """
    return cast("Network", _installed(GROUP, name))


def viewer_of(name: str) -> Viewer:
    """Return a viewer by its name, which is that of its option.

    Raises:
        UsageError: It is not installed.
    """
    return cast("Viewer", _installed(VIEWERS, name))


def _installed(group: str, name: str) -> object:
    point = installed_points(group).get(name)
    if point is None:
        raise UsageError(f"--{name} is not there", hint=way_to_plug_in(group) or "p2os doctor")
    return loaded(point)
