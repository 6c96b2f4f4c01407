"""A verb in a process of its own that drives a robot served here, and what the robot received."""

import os
import pty
import re
import subprocess
import sys
import termios
import time
from collections.abc import Sequence
from pathlib import Path

from p2os.protocol.commands import Command, CommandNumber
from p2os.protocol.frames import Decoder, Frame
from p2os.transport.wall_clock import Clock, wall_clock
from simbase.timing import Nanos
from tests.p2os.client.served_robot import TIMEOUT_S, ServedRobot, until

#: What a process is started with that is to be stopped, or whose own start matters; for others, `forked_p2os`.
COMMAND = (sys.executable, "-m", "p2os")
CLOSE, STOP, VEL = CommandNumber.CLOSE, CommandNumber.STOP, CommandNumber.VEL
#: A bound on what is done at once: ten times what it takes, for a machine that does other things too.
AT_ONCE_S = 5.0


def is_raw(keyboard: int) -> bool:
    """Tell whether a terminal, by the end where its keys are pressed, hands each key over at once."""
    return not termios.tcgetattr(keyboard)[3] & termios.ICANON


class RecordingRobot(ServedRobot):
    """A served robot that keeps what it received."""

    def __init__(self, clock: Clock = wall_clock) -> None:
        self.received: list[tuple[float, Command]] = []
        decoder = Decoder()
        super().__init__(clock=clock)
        receive = self.pioneer.receive

        def hear(data: bytes, now: Nanos) -> object:
            decoder.receive(data, now)
            while (item := decoder.next_item()) is not None:
                if isinstance(item, Frame):
                    self.received.append((time.monotonic(), Command.from_frame(item)))
            return receive(data, now)

        self.pioneer.receive = hear  # type: ignore[method-assign,assignment]

    @property
    def numbers(self) -> list[int]:
        return [int(command.number) for _, command in self.received]

    def when_received(self, number: int, since: float) -> float:
        """Wait for a command that comes after a moment; return when it came."""

        def found() -> float:
            return next((at for at, command in list(self.received) if at >= since and command.number == number), 0.0)

        self.until(found, f"command {number}")
        return found()

    def wait_until_it_drives(self) -> None:
        self.until(lambda: self.is_moving and self.pioneer.state.left_setpoint_mps > 0.02, "motion")


class Driver:
    """A verb in a process of its own, on a terminal of its own."""

    def __init__(
        self, words: Sequence[str], *, on_terminal: bool = False, cwd: Path | None = None,
        stdout: int = subprocess.PIPE,
    ) -> None:  # fmt: skip
        self.keyboard = -1
        self._heard = ""
        if on_terminal:
            self.keyboard, inside = pty.openpty()
            self.process = subprocess.Popen(words, stdin=inside, stdout=inside, stderr=inside, start_new_session=True)
            os.close(inside)
        else:
            self.process = subprocess.Popen(
                words, stdin=subprocess.DEVNULL, stdout=stdout, stderr=subprocess.PIPE, cwd=cwd,
                bufsize=0,  # what `hear` does not take is left to `end`
            )  # fmt: skip

    def listens_at(self) -> str:
        """Return the URL that `p2os sniff` says it listens at, of a port that the system chose."""
        return self.hear(r"^listening on (\S+) ")[1]

    def hear(self, pattern: str) -> re.Match[str]:
        """Wait until it has said a line on standard error."""
        assert self.process.stderr is not None
        while not (found := re.search(pattern, self._heard, re.MULTILINE)):
            line = self.process.stderr.readline().decode()
            assert line, self._heard
            self._heard += line
        return found

    def press(self, keys: str) -> None:
        os.write(self.keyboard, keys.encode())

    def end(self) -> tuple[int, str]:
        """Wait for the end; return the exit code and what was said."""
        try:
            if self.keyboard < 0:
                out, err = self.process.communicate(timeout=TIMEOUT_S)
                return self.process.returncode, ((out or b"") + self._heard.encode() + err).decode()
            return self.process.wait(TIMEOUT_S), ""
        finally:
            self.close()

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait(TIMEOUT_S)
        if self.keyboard >= 0:
            os.close(self.keyboard)
            self.keyboard = -1


__all__ = ["AT_ONCE_S", "CLOSE", "COMMAND", "STOP", "TIMEOUT_S", "VEL", "Driver", "RecordingRobot", "is_raw", "until"]
