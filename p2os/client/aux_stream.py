"""One of the robot's own serial ports as a file of bytes (TTY2 and GETAUX behind it)."""

import io

from p2os.client.aux_port import AuxBuffer
from p2os.client.engine import Engine
from p2os.client.notices import Notice

#: chosen: a GETAUX whose answer has not come for so long is sent again; it may have been lost.
ASK_AGAIN_S = 1.0


class AuxStream(io.RawIOBase):
    """Bytes to and from a device on the robot.

    `read` waits for as many bytes as it is asked for, at most `timeout_s`, and
    returns what has come. `io.BufferedRWPair` and `io.TextIOWrapper` fit on top.

    Args:
        engine: The robot's.
        port: 1, 2 or 3.
        timeout_s: How long a read waits; None: for ever.
    """

    def __init__(self, engine: Engine, port: int, timeout_s: float | None = 1.0) -> None:
        super().__init__()
        self.timeout_s = timeout_s
        self._engine = engine
        self._buffer = AuxBuffer(port)
        self._end = engine.on_event(self._take)

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
            self._engine.call(lambda core, now, command=command: core.send(command, now))  # type: ignore[misc]
        return len(data)

    def read(self, size: int = -1) -> bytes:
        """Return `size` bytes, or those that came within `timeout_s`; -1: what has come."""
        if size >= 0:
            self._wait(size)
        with self._engine.changed:
            return self._buffer.read(len(self._buffer) if size < 0 else size)

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]  # a writable buffer
        """Fill a buffer as far as bytes come within `timeout_s`; return how many."""
        data = self.read(len(buffer))
        buffer[: len(data)] = data
        return len(data)

    def flush_input(self) -> None:
        """Forget what has come, here and in the robot (GETAUX 0)."""
        command = self._buffer.flushing()
        self._engine.call(lambda core, now: core.send(command, now))

    def close(self) -> None:
        """Listen no more."""
        self._end()
        super().close()

    def _wait(self, size: int) -> None:
        left_s, again = self.timeout_s, False
        with self._engine.changed:
            while len(self._buffer) < size and (left_s is None or left_s > 0):
                command = self._buffer.asking(size, again=again)
                if command is not None:
                    self._engine.call(lambda core, now, command=command: core.send(command, now))  # type: ignore[misc]
                before = len(self._buffer)
                step_s = ASK_AGAIN_S if left_s is None else min(ASK_AGAIN_S, left_s)
                again = not self._engine.wait_for(lambda _, before=before: len(self._buffer) > before, step_s)  # type: ignore[misc]
                left_s = left_s if left_s is None or not again else left_s - step_s

    def _take(self, notice: Notice) -> None:
        with self._engine.changed:
            self._buffer.notice(notice)
            self._engine.changed.notify_all()
