"""What the bench needs of an emulated chip.

`bluepill_sim.board.BluePill` has this shape, and so have the fakes of the tests.
"""

from collections.abc import Callable, Sequence
from typing import Protocol

from robot_bench.wires.chip_pins import ChipWithPins
from simbase.timing import Reached


class ChipUsart(Protocol):
    """A serial port of the chip, from outside."""

    #: The far end's speed in bit/s; None follows the firmware.
    far_baud: int | None

    def subscribe(self, sink: Callable[[Sequence[tuple[int, int]]], None]) -> Callable[[], None]:
        """Have `sink` called with rows of what was sent, (word, ns when its stop bit ended); return what ends it."""

    @property
    def measured_baud(self) -> int | None:
        """The speed at which most characters were sent, in bit/s; None before the first."""


class ChipActivity(Protocol):
    """When the firmware last showed activity, in ns."""

    last_pin_ns: int
    last_usart_ns: int
    last_wfi_ns: int


class ChipFault(Protocol):
    """The fault that ended the firmware; printed, it is one line for a person."""

    @property
    def at_ns(self) -> int:
        """When."""


class LeadingChip(ChipWithPins, Protocol):
    """A chip that runs a firmware and leads the bench's time."""

    def subscribe_warnings(self, sink: Callable[[str], None]) -> Callable[[], None]:
        """Have `sink` called with each new warning, at its time; return a function that ends it."""

    @property
    def usart1(self) -> ChipUsart:
        """The port that firmware prints on."""

    @property
    def warnings(self) -> Sequence[str]:
        """Everything that was warned of, oldest first."""

    @property
    def fault(self) -> ChipFault | None:
        """The fault that ended the firmware, or that it came back from; None while there is none."""

    @property
    def has_died(self) -> bool:
        """Whether the firmware has ended: by its fault, or because it resets for ever."""

    @property
    def died_ns(self) -> int | None:
        """When it ended; None: it has not."""

    @property
    def verdict(self) -> str:
        """What became of the firmware: its fault, its resets; empty where it just ran."""

    def last_blocks(self) -> Sequence[str]:
        """Return what it ran last, up to the fault if there was one, as lines for a person."""

    @property
    def activity(self) -> ChipActivity:
        """When the firmware last showed activity."""

    def advance_to(self, limit_ns: int) -> Reached:
        """Run to `limit_ns`, at most a basic block beyond; less far where a pin changes that ends its slice."""

    def where(self) -> str:
        """Return where the program is: symbol, offset and address."""

    def snapshot(self) -> object:
        """Return all that decides the chip's future."""

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned."""
