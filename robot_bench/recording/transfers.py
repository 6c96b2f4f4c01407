"""What went over the chip's buses, put together to events: transfers on SPI and I2C, frames on CAN, text of USB.

A bus is heard by the same subscriptions as the pins and the USARTs are; where nobody asked for it, nothing is done.

Theory of operation. A chip tells of words and conditions in bulk, behind its time slice; the recorder calls `release`
before it hands on events, so what is over by then is reported by then. An SPI has no end of a transfer but the pause
that follows: a word belongs to it that ends no later than a pause and a word's time behind the one before, and that is
when its event comes. (Ends count, not begins: of a word that is under way nothing is known yet.)
Invariant: what is reported, and when, depends on the bus alone, not on slices.
"""

from collections.abc import Callable, Sequence
from typing import Any

from bluepill_sim.fabric.can_network import CanEnd, CanError
from bluepill_sim.peripherals.i2c import I2cStep, I2cSymbol
from bluepill_sim.peripherals.spi import SpiWord
from robot_bench.events.kinds import CanTransfer, Event, I2cTransfer, SpiTransfer
from simbase.state import Stateful
from simbase.timing import Nanos

#: Called with what has happened.
Tell = Callable[[Event], None]
#: chosen: programs that poll leave some 10 us between two words of one transfer.
PAUSE_NS: Nanos = 50_000
#: chosen: what a longer transfer is cut into, so that a line of the trace stays short.
MOST_BYTES = 4096
_HEADER, _ENDS = 0xF0, {I2cStep.STOP: "stop", I2cStep.LOST: "lost", I2cStep.CUT: "cut"}
_ERRORS = {CanError.NONE: "", CanError.ACKNOWLEDGE: "acknowledge", CanError.BIT_DOMINANT: "damaged"}


class SpiTransfers(Stateful):
    """Words of an SPI, put together."""

    STATE = ("_from_master", "_from_slave", "_bits", "_begun", "_ended", "_over")

    def __init__(self, bus: str, tell: Tell) -> None:
        self._bus, self._tell = bus, tell
        self._from_master, self._from_slave = bytearray(), bytearray()
        self._bits = 8
        self._begun: Nanos = 0
        self._ended: Nanos = 0
        #: When it is over, unless another word has ended by then.
        self._over: Nanos = 0

    def take(self, words: Sequence[SpiWord]) -> None:
        """Take what was exchanged, oldest first."""
        for word in words:
            if self._from_master and word.ended_ns > self._over:
                self._end(self._over)
            if self._from_master and word.bits != self._bits:
                self._end(word.ended_ns)
            if not self._from_master:
                self._begun, self._bits = word.ended_ns - word.span_ns, word.bits
            self._ended, self._over = word.ended_ns, word.ended_ns + PAUSE_NS + word.span_ns
            self._from_master += word.from_master.to_bytes(word.bits // 8, "big")
            self._from_slave += word.from_slave.to_bytes(word.bits // 8, "big")
            if len(self._from_master) >= MOST_BYTES:
                self._end(self._ended)

    def release(self, limit: Nanos, *, is_end: bool = False) -> None:
        """Tell what is over at a time; at the end of a run everything."""
        if self._from_master and (is_end or self._over <= limit):
            self._end(min(self._over, limit))

    def _end(self, at: Nanos) -> None:
        self._tell(SpiTransfer(
            t=at, bus=self._bus, begun=self._begun, ended=self._ended, from_master=bytes(self._from_master),
            from_slave=bytes(self._from_slave), bits=self._bits,
        ))  # fmt: skip
        self._from_master.clear()
        self._from_slave.clear()


class I2cTransfers(Stateful):
    """Conditions and bytes of an I2C, put together."""

    STATE = ("_begun", "_header", "_ten_bit", "_address", "_is_read", "_answered", "_data", "_acknowledged")

    def __init__(self, bus: str, tell: Tell) -> None:
        self._bus, self._tell = bus, tell
        #: When the START was; None: the bus is free.
        self._begun: Nanos | None = None
        #: The header of a 10-bit address whose second byte is to come, and the last whole one.
        self._header: int | None = None
        self._ten_bit = 0
        #: None: it is to come.
        self._address: int | None = None
        self._is_read = self._answered = False
        self._data = bytearray()
        self._acknowledged = 0

    def take(self, symbols: Sequence[I2cSymbol]) -> None:
        """Take what was on the bus, oldest first."""
        for at, step, byte, is_acknowledged in symbols:
            if step is I2cStep.START:
                self._end(at, "restart")
                self._begun, self._address, self._header = at, None, None
                self._data.clear()
            elif step is not I2cStep.BYTE:
                self._end(at, _ENDS[step])
                self._begun = None
            elif self._begun is not None:
                self._take_byte(at, byte, is_acknowledged=is_acknowledged)

    def _take_byte(self, at: Nanos, byte: int, *, is_acknowledged: bool) -> None:
        if self._header is not None:
            self._ten_bit = self._address = self._header << 8 | byte
            self._header, self._answered = None, is_acknowledged
        elif self._address is None:
            self._acknowledged, self._is_read, self._answered = 0, bool(byte & 1), is_acknowledged
            self._address = byte >> 1
            if byte & 0xF8 == _HEADER:
                self._address = self._ten_bit if self._is_read else (byte >> 1 & 3) << 8
                self._header = byte >> 1 & 3 if is_acknowledged and not self._is_read else None
        else:
            self._data.append(byte)
            self._acknowledged += is_acknowledged
            if len(self._data) >= MOST_BYTES:
                self._end(at, "more")
                self._begun, self._acknowledged = at, 0
                self._data.clear()

    def release(self, limit: Nanos, *, is_end: bool = False) -> None:
        """Tell at the end of a run what has not ended."""
        if is_end:
            self._end(limit, "more")
            self._begun = None

    def _end(self, at: Nanos, end: str) -> None:
        if self._begun is None or self._address is None:
            return
        self._tell(I2cTransfer(
            t=at, bus=self._bus, begun=self._begun, address=self._address, is_read=self._is_read,
            data=bytes(self._data), answered=self._answered, acknowledged=self._acknowledged, end=end,
        ))  # fmt: skip


class CanTransfers(Stateful):
    """Frames of a CAN."""

    STATE = ("_released",)

    def __init__(self, bus: str, tell: Tell) -> None:
        self._bus, self._tell = bus, tell
        self._released: Nanos = -1

    def take(self, ends: Sequence[CanEnd]) -> None:
        """Take frames that have ended."""
        for end in ends:
            frame = end.frame
            # A chip that others of its network have left behind hears of a frame late.
            self._tell(CanTransfer(
                t=max(end.end_ns, self._released + 1), bus=self._bus, begun=end.start_ns, identifier=frame.identifier,
                is_extended=frame.is_extended, is_remote=frame.is_remote, dlc=frame.dlc, data=frame.data,
                is_own=end.is_own, error=_ERRORS[end.error],
            ))  # fmt: skip

    def release(self, limit: Nanos, *, is_end: bool = False) -> None:
        """Take notice that everything up to a time was handed on."""
        del is_end
        self._released = limit


Transfers = SpiTransfers | I2cTransfers | CanTransfers
_KINDS: dict[str, type[Transfers]] = {
    "spi1": SpiTransfers, "spi2": SpiTransfers, "i2c1": I2cTransfers, "i2c2": I2cTransfers, "can": CanTransfers,
}  # fmt: skip


def hear_bus(board: Any, bus: str, tell: Tell) -> Transfers:
    """Have what goes over a bus of a board reported from now on; return what puts it together.

    Args:
        board: A `BluePill`.
        bus: One of `selection.BUSES`, but for `usb`, whose text is a port's.
        tell: Called with each transfer.
    """
    transfers = _KINDS[bus](bus, tell)
    board.chip.parts.by_name[bus.upper()].subscribe(transfers.take)
    return transfers
