"""The ESP32's whole program on simulated hardware, with a robot at its line and a person at its console."""

from pathlib import Path

from adapter_sim.pinout import Pinout, WireDirection, WireRole, load_pinout
from p2os.protocol.commands import Command
from p2os.protocol.frames import Frame
from robot_bench.wires.board_test.esp32 import CONSOLE, ROBOT, Esp32
from tests.adapter_sim.conftest import FakeRobot

PINOUT = load_pinout()
US_PER_MS, NS_PER_US = 1_000, 1_000


def pad_of(name: str, revision: str, pinout: Pinout = PINOUT) -> int | None:
    """Return the number of a wire's or an auxiliary's pad; None where the revision has none of the chip's own."""
    pins = {wire.name: wire.esp32_pin(revision) for wire in pinout.wires}
    pins |= {auxiliary.name: dict(auxiliary.esp32).get(revision) for auxiliary in pinout.auxiliaries}
    pin = pins[name] or "NC"
    return int(pin.removeprefix("IO")) if pin.startswith("IO") else None


class Shell:
    """An adapter on a bench.

    Args:
        library: Its program.
        revision: Its board.
        robot: None: nothing is at the line.
    """

    def __init__(self, library: Path, revision: str = "rev-b", robot: FakeRobot | None = None) -> None:
        self.revision = revision
        self.esp32 = Esp32(library)
        self.robot = robot
        self.text = ""
        #: Of each frame that has left at the line: ms, and the command's name.
        self.commands: list[tuple[int, str]] = []
        self._frames = b""
        #: The button's pin is pulled up by the chip, as are the pulls of the board.
        self.levels = 1 << (pad_of("mode_button", revision) or 0)
        self.esp32.put_levels(self.levels)
        for name in ("shift_data", "shift_clock", "shift_latch"):
            setattr(self.esp32.state, name, pad_of(name, revision) or 0)

    @property
    def now_ms(self) -> int:
        """Return the time since the first power-on."""
        return self.esp32.now_us // US_PER_MS

    def set(self, name: str, level: bool) -> None:
        """Put a level on a wire, or on an auxiliary pin."""
        pad = pad_of(name, self.revision)
        assert pad is not None
        self.levels = self.levels & ~(1 << pad) | level << pad
        self.esp32.put_levels(self.levels)

    def run_ms(self, span_ms: int) -> str:
        """Let time pass; return what the console has written meanwhile."""
        before = len(self.text)
        for _ in range(span_ms):
            until_us = self.esp32.now_us + US_PER_MS
            self.esp32.run_until(until_us)
            self.text += self.esp32.sent(CONSOLE).decode()
            self._serve(self.esp32.sent(ROBOT), until_us * NS_PER_US)
        return self.text[before:]

    def type(self, line: str, wait_ms: int = 30) -> str:
        """Type a line; return the answer."""
        self.esp32.receive(CONSOLE, f"{line}\r".encode())
        return self.run_ms(wait_ms)

    def driven(self) -> dict[str, bool]:
        """Return the wires that the chip drives, with their levels; its shift register only while that is enabled."""
        state = self.esp32.state
        enable = pad_of("shift_enable", self.revision) or 0
        is_enabled = bool(state.driven >> enable & 1) and not state.out >> enable & 1
        result = {}
        for wire in PINOUT.wires:
            if wire.direction is WireDirection.TO_BLUEPILL and wire.role is not WireRole.RESET:
                pad, pin = pad_of(wire.name, self.revision), wire.esp32_pin(self.revision) or ""
                if pad is not None and state.driven >> pad & 1:
                    result[wire.name] = bool(state.out >> pad & 1)
                elif is_enabled and pin.startswith("HC595.Q"):
                    result[wire.name] = bool(state.shifted >> ord(pin[-1]) - ord("A") & 1)
        return result

    def code(self, encoder: int) -> int:
        """Return an encoder's code on the wires."""
        levels = self.driven()
        return sum(levels[f"encoder{encoder}_s{bit + 1}"] << bit for bit in range(3))

    def drive(self, left: int, right: int) -> None:
        """Put motor codes on the wires."""
        for name, value in (("motor1", left), ("motor2", right)):
            for bit in range(3):
                self.set(f"{name}_comm{bit + 1}", bool(value >> bit & 1))

    def connect(self) -> None:
        """Raise p2dx_con and wait until the robot is driven."""
        self.run_ms(310)
        self.set("p2dx_con", True)
        said = self.run_ms(1500)
        assert " driving" in said, said

    def _serve(self, data: bytes, now: int) -> None:
        self._frames += data
        while len(self._frames) >= 3 and len(self._frames) >= 3 + self._frames[2]:
            size = 3 + self._frames[2]
            frame, self._frames = self._frames[:size], self._frames[size:]
            self.commands.append((self.now_ms, Command.from_frame(Frame.from_bytes(frame)).name))
        if self.robot is not None:
            self.robot.receive(data, now)
            self.robot.advance_to(now)
            self.esp32.receive(ROBOT, b"".join(self.robot.take_output()))
