"""Networks of others on which a bench may be a node: each by its name an entry point of `robot_bench.networks`."""

from collections.abc import Sequence
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


def network_of(name: str) -> Network:
    """Return a network by its name, which is that of its option.

    Raises:
        UsageError: It is not installed.
    """
    point = installed_points(GROUP).get(name)
    if point is None:
        raise UsageError(f"--{name} is not there", hint=way_to_plug_in(GROUP) or "p2os doctor")
    return cast("Network", loaded(point))
