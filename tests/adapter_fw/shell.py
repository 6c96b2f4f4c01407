"""The ESP32's whole program on simulated hardware, with a robot at its line and a person at its console."""

from pathlib import Path

from adapter_sim.pinout import Pinout, WireDirection, WireRole, load_pinout
from p2os.pioneer.controller import Pioneer
from p2os.protocol.commands import Command
from p2os.protocol.frames import Frame
from robot_bench.wires.board_test.esp32 import CONSOLE, ROBOT, Esp32
from tests.adapter_fw.emulated import EmulatedEsp32
from tests.adapter_sim.conftest import FakeRobot

PINOUT = load_pinout()
US_PER_MS, NS_PER_US = 1_000, 1_000
#: Of the robot's line.
BAUD = 9600


def pad_of(name: str, revision: str, pinout: Pinout = PINOUT) -> int | None:
    """Return the number of a wire's or an auxiliary's pad; None where the revision has none of the chip's own."""
    pins = {wire.name: wire.esp32_pin(revision) for wire in pinout.wires}
    pins |= {auxiliary.name: dict(auxiliary.esp32).get(revision) for auxiliary in pinout.auxiliaries}
    pin = pins[name] or "NC"
    return int(pin.removeprefix("IO")) if pin.startswith("IO") else None


class Shell:
    """An adapter on a bench.

    Args:
        program: As a library for this machine; or an ESP32 that runs it.
        revision: Its board.
        robot: None: nothing is at the line.
    """

    def __init__(
        self, program: Path | EmulatedEsp32, revision: str = "rev-b", robot: FakeRobot | Pioneer | None = None
    ) -> None:
        self.revision = revision
        self.esp32 = Esp32(program) if isinstance(program, Path) else program
        self.robot = robot
        self.text = ""
        #: Of each frame that has left at the line: when its last byte was out in µs, and the command's name.
        self.commands: list[tuple[int, str]] = []
        #: Of each frame of the robot: when its last byte arrives in µs, and its bytes.
        self.answers: list[tuple[int, bytes]] = []
        self.line_free_us = 0
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
            self.esp32.run_until(self.esp32.now_us + US_PER_MS)
            self.text += self.esp32.sent(CONSOLE).decode()
            self._serve()
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

    def _serve(self) -> None:
        """Give the robot what has left, each byte in its time; what it sends takes its time too."""
        for at_us, byte in self.esp32.sent_in_time(ROBOT):
            self._frames += bytes((byte,))
            if len(self._frames) < 3 or len(self._frames) < 3 + self._frames[2]:
                continue
            frame, self._frames = self._frames, b""
            self.commands.append((at_us, Command.from_frame(Frame.from_bytes(frame)).name))
            self._run_robot(at_us)
            if self.robot is not None:
                self.robot.receive(frame, at_us * NS_PER_US)
                self._take_answers(at_us)
        self._run_robot(self.esp32.now_us)

    def _run_robot(self, until_us: int) -> None:
        while (
            self.robot is not None and (due := self.robot.next_deadline()) is not None and due <= until_us * NS_PER_US
        ):
            self.robot.advance_to(due)
            self._take_answers(-(-due // NS_PER_US))

    def _take_answers(self, at_us: int) -> None:
        """Put the robot's frames on the line, behind what is on it."""
        for frame in self.robot.take_output():
            begin_us = max(self.line_free_us, at_us)
            times = [begin_us - -(number * 10 * 10**6) // BAUD for number in range(1, len(frame) + 1)]
            self.line_free_us = times[-1]
            self.answers.append((times[-1], frame))
            self.esp32.receive(ROBOT, frame, times)
