"""A node on a CAN that sends a frame at a period, and echoes what it hears.

For a node with a program of its own write `CanNode` (docs/parts.md).
Invariant: each frame that it hears is answered once, with its identifier plus one and the same data.
"""

from bluepill_sim.fabric.bus_parts import CanFrame
from bluepill_sim.fabric.can_network import CanNetwork, CanNode
from simbase.state import Stateful
from simbase.timing import NS_PER_MS, Nanos

_MOST_ID, _MOST_EXTENDED = (1 << 11) - 1, (1 << 29) - 1


class CanTalker(Stateful):
    """A periodic sender and echo."""

    STATE = ("sent_count", "_next_ns")

    def __init__(
        self, *, identifier: int = 0x123, data: str = "01", period_ms: float = 100.0, echoes: bool = True
    ) -> None:  # fmt: skip
        """Make one.

        Args:
            identifier: Of its own frames; above 0x7FF an extended one.
            data: Theirs, in hex, up to eight bytes.
            period_ms: From one to the next; 0: it sends none.
            echoes: Whether it answers what it hears.

        Raises:
            ValueError: There is no such frame, or the period is below 0.
        """
        if not period_ms >= 0:
            raise ValueError(f"a period of {period_ms} ms")
        try:
            sent = bytes.fromhex(data)
        except ValueError:
            raise ValueError(f"{data!r} is no data in hex, such as 01ff") from None
        self._frame = CanFrame(identifier=identifier, data=sent, is_extended=identifier > _MOST_ID)
        self._period_ns = round(period_ms * NS_PER_MS)
        self.node = CanNode(self._heard if echoes else None)
        #: Frames that it has asked the bus for, echoes too.
        self.sent_count = 0
        self._next_ns: Nanos = self._period_ns

    def join(self, network: CanNetwork) -> None:
        """Put it on a bus, which saves its node."""
        network.join(self.node)

    def next_deadline(self) -> Nanos | None:
        """Return when its next frame is due."""
        return self._next_ns if self._period_ns else None

    def advance_to(self, now_ns: Nanos) -> None:
        """Send the frame that is due."""
        self._next_ns += self._period_ns
        self._send(self._frame, now_ns)

    def words(self) -> str:
        """Return what it has heard and sent."""
        node = self.node
        return f"{len(node.received)} frames heard, {self.sent_count} sent, {node.errors} not acknowledged"

    def _heard(self, frame: CanFrame, at_ns: Nanos) -> None:
        most = _MOST_EXTENDED if frame.is_extended else _MOST_ID
        if not frame.is_remote:
            answer = CanFrame(
                identifier=(frame.identifier + 1) & most, data=frame.data, is_extended=frame.is_extended
            )  # fmt: skip
            self._send(answer, at_ns)

    def _send(self, frame: CanFrame, at_ns: Nanos) -> None:
        self.sent_count += 1
        self.node.send(frame, at_ns)
