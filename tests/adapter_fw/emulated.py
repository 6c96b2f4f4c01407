"""The real image of the ESP32's program in an emulator of the chip, in lock-step with a test.

Neither the image nor the emulator is part of this project: `P2OS_ESP32_EMULATOR` names the program, `P2OS_ESP32_ROM`
the folder with its copy of the chip's ROM, `P2OS_ESP32_IMAGE` the whole flash (boot loader, table of partitions,
application). The emulator is QEMU with the machine `esp32` of Espressif's branch. It has to know one thing more: given
a socket in `ESP32_LOCKSTEP`, it connects, and stands still whenever virtual time has come to where it was to go. Each
line is one message; times are nanoseconds since power-on in decimal, the rest is hexadecimal but for ports.

    it says                 t PORT TIME BYTE    the stop bit of a byte has ended at a UART's TX
                            i TIME              the program has read the second register of pins
                            o TIME OUT ENABLE   what is driven has changed
                            lost PORT           a byte found a full receiver
                            at TIME             it stands; everything up to here has been said
    it takes                l LEVELS            what stands on the pads
                            r PORT TIME BYTE    the stop bit of a byte will end at a UART's RX
                            go TIME             run on

Invariant: the same image, emulator and messages give the same times: virtual time counts instructions.
"""

import os
import socket
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace

from robot_bench.wires.board_test.esp32 import PORTS

EMULATOR, ROM, IMAGE = "P2OS_ESP32_EMULATOR", "P2OS_ESP32_ROM", "P2OS_ESP32_IMAGE"
NS_PER_US, NS_PER_MS = 1_000, 1_000_000
#: 8 ns an instruction: two processors in turn are as fast as the ESP32's at 160 MHz, about.
_SHIFT = "3"
_PATIENCE_S = 60.0
#: Boot loader and system have begun the program by then, or never will.
_LONGEST_BOOT_NS = 5_000 * NS_PER_MS
#: A pass is over so long after it began; it may read the pins more than once.
_PASS_NS = 400_000
_US_A_BYTE = 10 * 10**6
_CONSOLE_BAUD = 115_200


def named() -> tuple[Path, Path, Path] | str:
    """Return emulator, ROM and image; what is missing in words where one is not named, or not there."""
    for name in (EMULATOR, ROM, IMAGE):
        if not os.environ.get(name):
            return f"{name} names nothing; see docs/adapter-firmware.md, Builds"
        if not Path(os.environ[name]).exists():
            return f"{name}: {os.environ[name]} is not there"
    return Path(os.environ[EMULATOR]), Path(os.environ[ROM]), Path(os.environ[IMAGE])


class EmulatedEsp32:
    """An ESP32 that runs an image, with power from the start.

    Its time is that of `Esp32`, where a program's second pass begins after two milliseconds: what chip and boot loader
    take before is in `boot_ns`.

    Args:
        emulator: The program.
        rom: The folder with the chip's ROM.
        image: The whole flash.

    Raises:
        AssertionError: The program did not begin.
    """

    def __init__(self, emulator: Path, rom: Path, image: Path) -> None:
        self.state = SimpleNamespace(out=0, driven=0, shifted=0)
        self.now_us = 0
        #: Bytes that found a receiver full.
        self.lost = 0
        #: When the program's passes began, counted as all times here.
        self.passes_ns: list[int] = []
        self._zero_ns = 0
        self._levels = 0
        self._sent: list[list[tuple[int, int]]] = [[] for _ in range(PORTS)]
        self._to_tell: list[str] = []
        self._console_free_us = 0
        self._folder = tempfile.TemporaryDirectory()
        path = Path(self._folder.name) / "lockstep"
        with socket.socket(socket.AF_UNIX) as listener:
            listener.bind(str(path))
            listener.listen()
            listener.settimeout(_PATIENCE_S)
            self._process = subprocess.Popen(
                [
                    emulator, "-machine", "esp32", "-display", "none", "-serial", "null", "-monitor", "none",
                    "-icount", f"shift={_SHIFT},sleep=off", "-snapshot",
                    "-drive", f"file={image},if=mtd,format=raw", "-L", rom,
                ],
                env=os.environ | {"ESP32_LOCKSTEP": str(path)}, stdin=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            )  # fmt: skip
            self._socket = listener.accept()[0]
        self._socket.settimeout(_PATIENCE_S)
        self._lines = self._socket.makefile("r", encoding="ascii")
        self._wait()
        self._boot()

    def close(self) -> None:
        """Take the power away."""
        self._socket.close()
        self._process.kill()
        self._process.wait()
        self._folder.cleanup()

    @property
    def boot_ns(self) -> int:
        """Return what passed between power-on and this object's time."""
        return self._zero_ns

    def put_levels(self, levels: int) -> None:
        """Say what stands on the pads, a bit each."""
        self._levels = levels
        self._to_tell.append(f"l {levels:x}")

    def receive(self, port: int, data: bytes, at_us: Sequence[int] | None = None) -> None:
        """Let bytes arrive at a UART; see `Esp32.receive`. Without times: at the console's speed."""
        if at_us is None:
            begin_us = max(self.now_us, self._console_free_us)
            at_us = [begin_us - -(number * _US_A_BYTE) // _CONSOLE_BAUD for number in range(1, len(data) + 1)]
            self._console_free_us = at_us[-1]
        for at, byte in zip(at_us, data, strict=True):
            self._to_tell.append(f"r {port} {self._zero_ns + at * NS_PER_US} {byte:x}")

    def sent(self, port: int) -> bytes:
        """Return what has left at a UART since the last call."""
        return bytes(byte for _, byte in self.sent_in_time(port))

    def sent_in_time(self, port: int) -> list[tuple[int, int]]:
        """Return what has left at a UART since the last call: when each byte's stop bit ended in µs, and the byte."""
        sent, self._sent[port] = self._sent[port], []
        return sent

    def run_until(self, until_us: int) -> None:
        """Run until the pass of that time is done."""
        self._go(self._zero_ns + until_us * NS_PER_US + _PASS_NS)
        self.now_us = max(self.now_us, until_us)

    def _boot(self) -> None:
        """Run until the program's second pass, and count time from two passes before it on."""
        self.put_levels(1)
        at = 0
        while len(self.passes_ns) < 2:
            at += NS_PER_MS
            assert at < _LONGEST_BOOT_NS, f"no program: {self.sent(0)!r}"
            self._go(at)
        self._zero_ns = self.passes_ns[1] - 2 * NS_PER_MS
        self.passes_ns = [at - self._zero_ns for at in self.passes_ns]
        self._sent = [[(at - self._zero_ns // NS_PER_US, byte) for at, byte in sent] for sent in self._sent]
        self._sent[0].clear()
        self.now_us = 2_000
        self._go(self._zero_ns + self.now_us * NS_PER_US + _PASS_NS)

    def _go(self, until_ns: int) -> None:
        commands = "".join(f"{line}\n" for line in (*self._to_tell, f"go {until_ns}"))
        self._to_tell.clear()
        self._socket.sendall(commands.encode())
        self._wait()

    def _wait(self) -> None:
        """Take what is said until it stands."""
        for line in self._lines:
            match line.split():
                case ["t", port, at, byte]:
                    self._sent[int(port)].append(((int(at) - self._zero_ns) // NS_PER_US, int(byte, 16)))
                case ["i", text]:
                    at_ns = int(text) - self._zero_ns
                    if not self.passes_ns or at_ns > self.passes_ns[-1] + _PASS_NS:
                        self.passes_ns.append(at_ns)
                case ["o", _, out, enable]:
                    self.state.out, self.state.driven = int(out, 16), int(enable, 16)
                case ["lost", _]:
                    self.lost += 1
                case ["at", _]:
                    return
        raise AssertionError(f"the emulator ended: {self._process.wait(_PATIENCE_S)}")
