"""The state machine of `dodge`, compiled for this computer: the same C file that runs on the chip."""

import ctypes
import shutil
import subprocess
from pathlib import Path

from robot_bench.firmware.build import HERE

STATES = ("CRUISE", "VEER_LEFT", "VEER_RIGHT", "TURN_LEFT", "TURN_RIGHT", "BACK_OUT")
#: More than `struct dodge` needs.
ROOM_BYTES = 256


class Command(ctypes.Structure):
    """`struct dodge_command`."""

    _fields_ = (("left", ctypes.c_int8), ("right", ctypes.c_int8))


def compile_machine(folder: Path) -> ctypes.CDLL | None:
    """Return the machine as a library; None where no C compiler is installed."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        return None
    library = folder / "dodge_fsm.so"
    flags = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-O1", "-shared", "-fPIC"]
    subprocess.run([compiler, *flags, str(HERE / "dodge_fsm.c"), "-o", str(library)], check=True)
    loaded = ctypes.CDLL(str(library))
    loaded.dodge_tick.restype = Command
    loaded.dodge_tick.argtypes = (ctypes.c_void_p, ctypes.c_uint8, ctypes.c_int32, ctypes.c_int32)
    return loaded


class Dodge:
    """One machine; `sensors` are written as the program prints them, leftmost first."""

    def __init__(self, library: ctypes.CDLL) -> None:
        self._library = library
        self._memory = ctypes.create_string_buffer(ROOM_BYTES)
        library.dodge_start(self._memory)
        #: Encoder steps with fractions, moved by the commands as an ideal robot would.
        self.left = self.right = 0.0

    @property
    def state(self) -> str:
        return STATES[ctypes.c_int.from_buffer(self._memory).value]

    def tick(self, sensors: str) -> tuple[int, int]:
        """Run a tick and let the wheels follow at once: 0.625 mm a tick and code."""
        bits = sum(1 << i for i, level in enumerate(sensors) if level == "1")
        command = self._library.dodge_tick(self._memory, bits, int(self.left // 1), int(self.right // 1))
        self.left += command.left * 0.625 / 64.795
        self.right += command.right * 0.625 / 64.795
        return command.left, command.right

    def ticks(self, sensors: str, count: int) -> tuple[int, int]:
        for _ in range(count - 1):
            self.tick(sensors)
        return self.tick(sensors)
