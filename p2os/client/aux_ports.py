"""The robot's own serial ports as streams of bytes: `AuxStream` blocking, `AsyncAux` for asyncio.

TTY2, TTY3 and TTY4 pass bytes on. GETAUX n makes the robot send a SERAUXpac when n
bytes have come; GETAUX 0 empties its buffer (Pioneer 3 manual, commands 42, 43, 60,
61, 66, 67). So a reader has to ask, for as many as it wants and no more; `AuxBuffer`
knows what was asked for, the two streams only differ in how they wait.

Invariant: at most one GETAUX of a port is unanswered, unless it may have been lost.
"""

import io
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass

from p2os.client.line import Waiting
from p2os.client.notices import Notice, PacketArrived
from p2os.client.robot_thread import RobotThread
from p2os.protocol.commands import Command, CommandNumber
from p2os.protocol.packets import SerauxPacket
from simbase.errors import UsageError

#: The most bytes that one GETAUX may ask for, and that one TTY2 carries here.
MOST_WANTED, MOST_WRITTEN = 200, 190
#: chosen: a GETAUX whose answer has not come for so long is sent again; it may have been lost.
ASK_AGAIN_S = 1.0


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

    def filling(self, size: int, timeout_s: float | None, send: Callable[[Command], object]) -> Waiting[None]:
        """Ask and wait until `size` bytes have come, at most so long without any; None: for ever."""
        again = False
        while len(self) < size and (timeout_s is None or timeout_s > 0):
            command = self.asking(size, again=again)
            if command is not None:
                send(command)
            before = len(self)
            step_s = ASK_AGAIN_S if timeout_s is None else min(ASK_AGAIN_S, timeout_s)
            again = not (yield lambda _, before=before: len(self) > before, step_s)  # type: ignore[misc]  # bound now
            timeout_s = timeout_s if timeout_s is None or not again else timeout_s - step_s

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


class AuxStream(io.RawIOBase):
    """Bytes to and from a device on the robot.

    `read` waits for as many bytes as it is asked for, at most `timeout_s`, and
    returns what has come. `io.BufferedRWPair` and `io.TextIOWrapper` fit on top.

    Args:
        thread: The robot's.
        port: 1, 2 or 3.
        timeout_s: How long a read waits; None: for ever.
    """

    def __init__(self, thread: RobotThread, port: int, timeout_s: float | None = 1.0) -> None:
        super().__init__()
        self.timeout_s = timeout_s
        self._thread = thread
        self._buffer = AuxBuffer(port)
        self._unsubscribe = thread.listeners.on_event(self._take)

    def readable(self) -> bool:
        """Return True."""
        return True

    def writable(self) -> bool:
        """Return True."""
        return True

    def write(self, data: bytes | bytearray | memoryview) -> int:  # type: ignore[override]  # any buffer of bytes
        """Pass all of `data` on to the device.

        Raises:
            LinkLostError: no session is open.
        """
        for command in self._buffer.writing(bytes(data)):
            self._send(command)
        return len(data)

    def read(self, size: int = -1) -> bytes:
        """Return `size` bytes, or those that came within `timeout_s`; -1: what has come."""
        if size >= 0:
            self._thread.do(self._buffer.filling(size, self.timeout_s, self._send))
        with self._thread.changed:
            return self._buffer.read(len(self._buffer) if size < 0 else size)

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]  # a writable buffer
        """Fill a buffer as far as bytes come within `timeout_s`; return how many."""
        data = self.read(len(buffer))
        buffer[: len(data)] = data
        return len(data)

    def flush_input(self) -> None:
        """Discard what has come, here and in the robot (GETAUX 0)."""
        self._send(self._buffer.flushing())

    def close(self) -> None:
        """Unsubscribe from the robot's packets."""
        self._unsubscribe()
        super().close()

    def _send(self, command: Command) -> None:
        self._thread.run(lambda core, now: core.send(command, now))

    def _take(self, notice: Notice) -> None:
        with self._thread.changed:
            self._buffer.notice(notice)
            self._thread.changed.notify_all()


class AsyncAux:
    """Bytes to and from a device on the robot.

    Args:
        port: 1, 2 or 3.
        send: Sends a command of the open session.
        subscribe: Has a callback called with each notice; returns what ends that.
        do: Carries out a call that waits.
        timeout_s: How long a read waits; None: for ever.
    """

    def __init__(
        self,
        port: int,
        *,
        send: Callable[[Command], None],
        subscribe: Callable[[Callable[[Notice], None]], Callable[[], None]],
        do: Callable[[Waiting[None]], Awaitable[None]],
        timeout_s: float | None = 1.0,
    ) -> None:
        self.timeout_s = timeout_s
        self._send = send
        self._do = do
        self._buffer = AuxBuffer(port)
        self._unsubscribe = subscribe(self._buffer.notice)

    async def write(self, data: bytes) -> int:
        """Pass all of `data` on to the device; return how many bytes that were.

        Raises:
            LinkLostError: no session is open.
        """
        for command in self._buffer.writing(data):
            self._send(command)
        return len(data)

    async def read(self, size: int = -1) -> bytes:
        """Return `size` bytes, or those that came within `timeout_s`; -1: what has come."""
        if size < 0:
            return self._buffer.read(len(self._buffer))
        await self._do(self._buffer.filling(size, self.timeout_s, self._send))
        return self._buffer.read(size)

    async def flush_input(self) -> None:
        """Discard what has come, here and in the robot (GETAUX 0)."""
        self._send(self._buffer.flushing())

    def close(self) -> None:
        """Unsubscribe from the robot's packets."""
        self._unsubscribe()
