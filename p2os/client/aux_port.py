"""Bytes to and from the serial ports of the robot itself: TTY2 and GETAUX, and their brothers.

TTY2 passes bytes on. GETAUX n makes the robot send a SERAUXpac when n bytes
have come; GETAUX 0 empties its buffer (Pioneer 3 manual, commands 42, 43, 60,
61, 66, 67). So a reader has to ask, for as many as it wants and no more.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from p2os.client.notices import Notice, PacketArrived
from p2os.commands import Command, CommandNumber
from p2os.errors import UsageError
from p2os.packets import SerauxPacket

#: The most bytes that one GETAUX may ask for, and that one TTY2 carries here.
MOST_WANTED, MOST_WRITTEN = 200, 190


@dataclass(frozen=True, slots=True)
class AuxNumbers:
    """The commands of one port."""

    write: CommandNumber
    ask: CommandNumber


AUX_PORTS: Mapping[int, AuxNumbers] = {
    1: AuxNumbers(CommandNumber.TTY2, CommandNumber.GETAUX),
    2: AuxNumbers(CommandNumber.TTY3, CommandNumber.GETAUX2),
    3: AuxNumbers(CommandNumber.TTY4, CommandNumber.GETAUX3),
}


class AuxBuffer:
    """What has come from one port, and what has been asked for."""

    def __init__(self, port: int) -> None:
        if port not in AUX_PORTS:
            raise UsageError(f"the robot has no AUX port {port}", hint="1, 2 or 3")
        self.port = port
        self.numbers = AUX_PORTS[port]
        self._data = bytearray()
        self._asked = 0

    def __len__(self) -> int:
        return len(self._data)

    def writing(self, data: bytes) -> list[Command]:
        """Return the commands that pass `data` on."""
        return [
            Command(self.numbers.write, data[place : place + MOST_WRITTEN])
            for place in range(0, len(data), MOST_WRITTEN)
        ]

    def asking(self, size: int, *, again: bool = False) -> Command | None:
        """Return what asks for enough bytes to have `size`, or None where that was asked already.

        Args:
            size: Bytes wanted in all.
            again: Ask anew: the first asking may have been lost.
        """
        missing = min(size - len(self._data), MOST_WANTED)
        if missing <= 0 or (self._asked and not again):
            return None
        self._asked = missing
        return Command(self.numbers.ask, missing)

    def flushing(self) -> Command:
        """Return what empties the robot's buffer; ours is emptied too."""
        self._data.clear()
        self._asked = 0
        return Command(self.numbers.ask, 0)

    def notice(self, notice: Notice) -> None:
        """Take what belongs to this port of the client's notices."""
        packet = notice.packet if isinstance(notice, PacketArrived) else None
        if isinstance(packet, SerauxPacket) and packet.port == self.port:
            self.take(packet.data)

    def take(self, data: bytes) -> None:
        """Take the bytes of a SERAUXpac."""
        self._data += data
        self._asked = 0

    def read(self, size: int) -> bytes:
        """Return at most `size` bytes of those that have come."""
        data = bytes(self._data[:size])
        del self._data[:size]
        return data
