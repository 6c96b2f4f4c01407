"""What stands at the two ends of the P2OS line, and how one of the user's is named.

    core = "./mine.py:Adapter"      [adapter] of a scenario; or one of the entry points `p2os.adapters`
    kind = "./mine.py:Controller"   [controller]; or one of the entry points `p2os.controllers`

An adapter is made as (pins=, pinout=, parameters=, settings=), a controller as (parameters=, body=, settings=).
Invariant: what is between them is bytes on a line; neither knows the other.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from robot_bench.wires.endpoints import EndpointPart
from simbase.timing import Nanos
from simbase.user_classes import find_class, make, refuse_lacking


class AdapterPart(EndpointPart, Protocol):
    """An adapter: it reads and drives the wires to the chip, and has the client's end of the line."""

    #: Whom it tells what happens: (ns, what, detail); the bench sets it.
    on_event: Callable[[Nanos, str, str], None] | None

    @property
    def wakes_on(self) -> frozenset[str]:
        """Names of the wires at whose edges it has to be brought there; it acts at its deadlines beside these."""


class ControllerPart(EndpointPart, Protocol):
    """A robot's controller: it has the robot's end of the line, and steps the body each `body.dt_ns`.

    The body is the controller's: its state is in the controller's snapshots.
    """

    #: Whom it tells what happens: (ns, what, detail); the bench sets it.
    on_event: Callable[[Nanos, str, str], None] | None

    def do(self, text: str, now: Nanos) -> None:
        """Inject or clear a fault, or operate something: "fault WORDS", "clear WORDS", or the words of a live input.

        Raises:
            UsageError: It has none such.
        """


@dataclass(frozen=True, slots=True)
class LineEnd:
    """One of the two ends: what ships for it, and what another one must have."""

    what: str
    group: str
    ships: tuple[str, ...]
    protocol: type

    def check(self, name: str) -> Callable[..., Any]:
        """Return the class of one of the user's.

        Raises:
            UsageError: There is none of that name, or it lacks a method.
        """
        found = find_class(name, what=self.what, group=self.group, known=self.ships)
        refuse_lacking(found, self.protocol, name, self.what)
        return found

    def make(self, name: str, **arguments: object) -> Any:
        """Make one of the user's.

        Raises:
            UsageError: There is none of that name, it cannot be made, or it lacks something of the protocol.
        """
        found = make(self.check(name), name, self.what, **arguments)
        refuse_lacking(found, self.protocol, name, self.what)
        return found


ENDS: Mapping[str, LineEnd] = {
    "adapter": LineEnd("adapter", "p2os.adapters", ("model", "firmware"), AdapterPart),
    "controller": LineEnd("controller", "p2os.controllers", ("pioneer",), ControllerPart),
}
