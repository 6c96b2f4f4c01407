"""The two modules of a board under test, each behind its console: the same for serial ports and emulated modules.

Words of wires have a bit a wire, in the order of pinout.toml. The BluePill runs `robot_bench/firmware/board_test.c`,
the ESP32 the adapter's firmware (`adapter_fw/core/app/console.hpp`: `test`, `wires`, `link`, `pad`).

Invariant: None stands for silence, and is no error here: a module that is held in reset is silent.
"""

from dataclasses import dataclass
from typing import Protocol

from adapter_sim.pinout import Pinout, WireDirection, WireRole
from p2os.errors import P2osError

#: Who answers, in which version, and before what.
_GREETING = "board_test 1 csr "


class BoardTestError(P2osError):
    """The board cannot be tested: a module does not answer as it should."""

    exit_code = 1


class ConsoleLine(Protocol):
    """A console: a line out, the line that answers it back."""

    def ask(self, line: str, prefix: str) -> str | None:
        """Send a line; return the first line after it that begins with `prefix`, None where none came in time."""


def wires_of(pinout: Pinout, direction: WireDirection) -> tuple[int, ...]:
    """Return the places of those wires that one side drives, but for rst."""
    return tuple(
        place
        for place, wire in enumerate(pinout.wires)
        if wire.direction is direction and wire.role is not WireRole.RESET
    )


@dataclass(frozen=True, slots=True)
class HeardPad:
    """What the adapter has heard of its game pad."""

    #: Since the adapter began; None: its firmware has no pad.
    reports: int | None
    words: str


class BluePillEnd:
    """The BluePill with its test program."""

    def __init__(self, line: ConsoleLine) -> None:
        self._line = line

    def greet(self) -> int | None:
        """Return RCC_CSR, which has the cause of the last reset; None where no such program answers."""
        answer = self._line.ask("i", _GREETING)
        return None if answer is None else int(answer.removeprefix(_GREETING), 16)

    def has_crystal(self) -> bool | None:
        """Tell whether the 8 MHz crystal runs."""
        answer = self._line.ask("x", "crystal ")
        return None if answer is None else answer == "crystal 1"

    def hold(self, *, driven: int = 0, levels: int = 0, pulled: int = 0) -> int | None:
        """Drive some wires and pull others, let go of the rest; return the levels that every pad then has."""
        return self._word(f"s {driven:06x} {levels:06x} {pulled:06x}")

    def pulse(self, driven: int, levels: int) -> int | None:
        """Drive wires for a microsecond or two; return the levels that they had then, and those of all others."""
        return self._word(f"p {driven:06x} {levels:06x}")

    def _word(self, line: str) -> int | None:
        answer = self._line.ask(line, "r ")
        return None if answer is None else int(answer.split()[1], 16)


class AdapterEnd:
    """The ESP32 with the adapter's firmware, at its console."""

    def __init__(self, line: ConsoleLine, pinout: Pinout) -> None:
        self._line = line
        self._outputs = wires_of(pinout, WireDirection.TO_BLUEPILL)
        self._inputs = wires_of(pinout, WireDirection.TO_ADAPTER)

    def begin(self) -> str | None:
        """Take the hardware from the adapter; return why its program had begun."""
        answer = self._line.ask("test on", "test on, started by ")
        return None if answer is None else answer.removeprefix("test on, started by ")

    def end(self) -> None:
        """Give the hardware back."""
        self._line.ask("test off", "test off")

    def hold(self, driven: int, levels: int) -> bool:
        """Drive some of its outputs and let go of the rest; tell whether it answers."""
        mask = sum(1 << bit for bit, place in enumerate(self._outputs) if driven >> place & 1)
        word = sum(1 << bit for bit, place in enumerate(self._outputs) if levels >> place & 1)
        return self._line.ask(f"wires {mask:x} {word:x}", "wires ") is not None

    def read(self) -> int | None:
        """Return the level of every pad, outputs too; rst reads 0."""
        answer = self._line.ask("wires", "wires ")
        if answer is None:
            return None
        _, _, inputs, _, outputs = answer.split()
        word = 0
        for places, levels in ((self._inputs, int(inputs, 16)), (self._outputs, int(outputs, 16))):
            for bit, place in enumerate(places):
                word |= (levels >> bit & 1) << place
        return word

    def send(self, data: bytes) -> None:
        """Send bytes on the robot's line; what had come before is forgotten."""
        self._line.ask(f"link {data.hex()}", "link")

    def received(self) -> bytes:
        """Return what has come on the robot's line since the last call, at most the last 32 bytes."""
        answer = self._line.ask("link", "link")
        return bytes.fromhex((answer or "").removeprefix("link"))

    def pad(self) -> HeardPad | None:
        """Return what it has heard of a game pad."""
        answer = self._line.ask("pad", "pad ")
        if answer is None or answer == "pad none":
            return None if answer is None else HeardPad(None, "")
        words = answer.split()
        return HeardPad(int(words[1]), " ".join(words[2:]))
