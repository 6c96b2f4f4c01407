"""One of the robot's own serial ports for asyncio: `AuxStream`'s twin, waiting with `await`."""

from collections.abc import Awaitable, Callable

from p2os.client.aux_port import AuxBuffer
from p2os.client.aux_stream import ASK_AGAIN_S
from p2os.client.core import RobotCore
from p2os.client.notices import Notice
from p2os.commands import Command


class AsyncAux:
    """Bytes to and from a device on the robot.

    Args:
        port: 1, 2 or 3.
        send: Sends a command of the open session.
        listen: Has a callback called with each notice; returns what ends that.
        wait_for: Waits until something is so of the client's core, at most so many seconds.
        timeout_s: How long a read waits; None: for ever.
    """

    def __init__(
        self,
        port: int,
        *,
        send: Callable[[Command], None],
        listen: Callable[[Callable[[Notice], None]], Callable[[], None]],
        wait_for: Callable[[Callable[[RobotCore], bool], float | None], Awaitable[bool]],
        timeout_s: float | None = 1.0,
    ) -> None:
        self.timeout_s = timeout_s
        self._send = send
        self._wait_for = wait_for
        self._buffer = AuxBuffer(port)
        self._end = listen(self._buffer.notice)

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
        left_s, again = self.timeout_s, False
        while len(self._buffer) < size and (left_s is None or left_s > 0):
            command = self._buffer.asking(size, again=again)
            if command is not None:
                self._send(command)
            before = len(self._buffer)
            step_s = ASK_AGAIN_S if left_s is None else min(ASK_AGAIN_S, left_s)
            again = not await self._wait_for(lambda _, before=before: len(self._buffer) > before, step_s)  # type: ignore[misc]  # bound now
            left_s = left_s if left_s is None or not again else left_s - step_s
        return self._buffer.read(size)

    async def flush_input(self) -> None:
        """Forget what has come, here and in the robot (GETAUX 0)."""
        self._send(self._buffer.flushing())

    def close(self) -> None:
        """Listen no more."""
        self._end()
