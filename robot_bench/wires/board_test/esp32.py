"""The adapter's ESP32 program, whole, on a simulated ESP32 in virtual time (adapter_fw/esp32_sim).

All variables of the program are one piece of memory: a reset puts it back, and machines take turns in it. NVS and,
where power stays, RTC memory are carried over a reset. Not the chip's processor; what is not modelled stands in
adapter_fw/esp32_sim/machine.h.

Invariant: time goes forward in microseconds, and what the program does follows from what it was given.
"""

import ctypes
from collections import deque
from collections.abc import Sequence
from enum import IntEnum
from functools import cache
from pathlib import Path
from typing import Any

from simbase.c_library import built, loaded
from simbase.errors import MissingDependencyError
from simbase.installation import way_to_build

PORTS = 3
CONSOLE, ROBOT = 0, 2
#: Of a byte with its start and stop bit, at 1 bit/s.
_US_A_BYTE = 10 * 10**6
#: Of a port that no program has set up.
_RESET_BAUD = 115_200
_CHUNK = 4096
#: Where bytes that have left, and their times, are put, a chunk at a time.
_BUFFERS = ctypes.create_string_buffer(_CHUNK), (ctypes.c_int64 * _CHUNK)()


class ResetReason(IntEnum):
    """Of esp_reset_reason_t."""

    POWER = 1
    RESTART = 3
    PANIC = 4
    WATCHDOG = 6
    BROWN_OUT = 9


class NvsFault(IntEnum):
    """What ails the flash."""

    SOUND = 0
    OLD_LAYOUT = 1
    FULL = 2
    #: Not a fault any more: the program has begun it anew.
    ERASED = 3


#: How a run of the program ended; 0 is not at all.
_REASONS = {1: ResetReason.RESTART, 2: ResetReason.PANIC, 3: ResetReason.WATCHDOG}


#: The library of each revision of the board, as a module.
PARTS = {"rev-b": "robot_bench._esp32", "rev-c": "robot_bench._esp32_rev_c"}
#: Result and arguments of each function, as `simbase.c_library` spells them.
_FUNCTIONS = {
    "machine": "p", "machine_run": "il", "machine_sent": "zispz", "machine_receive": "vispz",
    "machine_pad": "iiiiii", "machine_pad_connect": "ili", "machine_pad_disconnect": "v",
    "machine_stack_used": "z", "machine_nvs_count": "z",
    "machine_nvs_put": "vssl", "machine_nvs_entry": "vzppp", "machine_ram": "vpp", "machine_rtc": "vpp",
}  # fmt: skip


class _State(ctypes.Structure):
    """machine_state of adapter_fw/esp32_sim/machine.h."""

    _fields_ = (
        ("now_us", ctypes.c_int64),
        *((name, ctypes.c_uint64) for name in ("levels", "out", "driven", "inputs", "pulled_up", "pulled_down")),
        ("changes", ctypes.c_uint32),
        ("end", ctypes.c_int32),
        ("panic", ctypes.c_char_p),
        ("reset_reason", ctypes.c_int32),
        ("nvs_fault", ctypes.c_int32),
        ("stall_us", ctypes.c_int64),
        *((name, ctypes.c_int32 * PORTS) for name in ("baud", "tx_pin", "rx_pin")),
        *((name, ctypes.c_uint32 * PORTS) for name in ("lost", "handed")),
        ("stack_bytes", ctypes.c_uint32),
        *((name, ctypes.c_int32) for name in ("shift_data", "shift_clock", "shift_latch")),
        ("shifted", ctypes.c_uint32),
    )


def library_path(revision: str = "rev-b") -> Path:
    """Return the library of a revision that was built with this package; KeyError where there is none of that name.

    Raises:
        MissingDependencyError: It was not built.
    """
    path = built(PARTS[revision])
    if path is None:
        raise MissingDependencyError("the simulated ESP32 is not built", hint=way_to_build(PARTS[revision]))
    return Path(path)


class _Library:
    """A loaded program, and whose turn it is."""

    def __init__(self, path: Path) -> None:
        self.calls = loaded(str(path), _FUNCTIONS, "the simulated ESP32", PARTS["rev-b"])
        self.calls.machine.restype = ctypes.POINTER(_State)
        self.state: _State = self.calls.machine().contents
        self._ram = self._place(self.calls.machine_ram)
        self._rtc = self._place(self.calls.machine_rtc)
        self.fresh = self.ram
        self.turn_of: Esp32 | None = None

    @property
    def ram(self) -> bytes:
        """Return all variables."""
        return ctypes.string_at(*self._ram)

    @ram.setter
    def ram(self, data: bytes) -> None:
        ctypes.memmove(self._ram[0], data, len(data))

    @property
    def rtc(self) -> bytes:
        """Return those of them that a restart leaves alone."""
        return ctypes.string_at(*self._rtc)

    @rtc.setter
    def rtc(self, data: bytes) -> None:
        ctypes.memmove(self._rtc[0], data, len(data))

    @staticmethod
    def _place(ask: Any) -> tuple[int, int]:
        start, size = ctypes.c_void_p(), ctypes.c_size_t()
        ask(ctypes.byref(start), ctypes.byref(size))
        return start.value or 0, size.value


class Esp32:
    """An ESP32 with the adapter's firmware; it has power from the start.

    Args:
        library: The program; None takes the one of this package (rev-b, with a game pad).
    """

    def __init__(self, library: Path | None = None) -> None:
        self._library = _library(library or library_path())
        self._ram = b""
        self.now_us = 0
        self.is_running = False
        #: What is stored in flash while the program does not run: (namespace, name) to value.
        self._nvs: dict[tuple[str, str], int] = {}
        self.nvs_fault = NvsFault.SOUND
        #: How the program began each time since the first power-on.
        self.starts: list[ResetReason] = []
        #: The failed call of the last panic.
        self.panic = ""
        self._started_us = 0
        self._levels = 0
        #: Of each port: bytes that have left, with the time at which their stop bit ended; and those that are to come.
        self._sent: list[list[tuple[int, int]]] = [[] for _ in range(PORTS)]
        self._arriving: list[deque[tuple[int, int]]] = [deque() for _ in range(PORTS)]
        self.power_on()

    @property
    def state(self) -> _State:
        """Return the chip's state; of a chip that EN holds, one that drives nothing."""
        return self._calls_and_state()[1] if self.is_running else _State()

    @property
    def nvs(self) -> dict[tuple[str, str], int]:
        """Return what is in flash: (namespace, name) to value."""
        if not self.is_running:
            return self._nvs
        calls, entries = self._calls, {}
        for place in range(calls.machine_nvs_count()):
            space, name, value = ctypes.c_char_p(), ctypes.c_char_p(), ctypes.c_int64()
            calls.machine_nvs_entry(place, ctypes.byref(space), ctypes.byref(name), ctypes.byref(value))
            entries[(space.value or b"").decode(), (name.value or b"").decode()] = value.value
        return entries

    @property
    def stack_used(self) -> int:
        """Return the bytes of stack that the program has used, as compiled for this machine."""
        return int(self._calls.machine_stack_used())

    def power_on(self) -> None:
        """Let EN rise."""
        self._start(ResetReason.POWER, None)

    def power_off(self) -> None:
        """Pull EN low, or take the power: every pad floats, RTC memory is lost, flash is kept."""
        if self.is_running:
            self._stop()

    def put_levels(self, levels: int) -> None:
        """Say what stands on the pads, a bit each."""
        self._levels = levels
        self.state.levels = levels

    def receive(self, port: int, data: bytes, at_us: Sequence[int] | None = None) -> None:
        """Let bytes arrive at a UART.

        Args:
            port: Its number.
            data: The bytes.
            at_us: When the stop bit of each ends, in order; None: one after the other at the port's speed, from now on.
        """
        if at_us is None:
            arriving, baud = self._arriving[port], self.state.baud[port] or _RESET_BAUD
            begin_us = max(self.now_us, arriving[-1][0] if arriving else 0)
            at_us = [begin_us - -(number * _US_A_BYTE) // baud for number in range(1, len(data) + 1)]
        self._arriving[port] += zip(at_us, data, strict=True)

    def sent(self, port: int) -> bytes:
        """Return what has left at a UART since the last call."""
        return bytes(byte for _, byte in self.sent_in_time(port))

    def sent_in_time(self, port: int) -> list[tuple[int, int]]:
        """Return what has left at a UART since the last call: when each byte's stop bit ended in µs, and the byte."""
        self._collect()
        sent, self._sent[port] = self._sent[port], []
        return sent

    def handed_over(self, port: int) -> int:
        """Return how many bytes the driver of a UART has taken from its receiver since the reset."""
        return int(self.state.handed[port])

    def connect_pad(self, address: int, *, is_found: bool = True) -> bool:
        """Let a game pad come; False where the program has none, or declines this one.

        Args:
            address: Its Bluetooth address.
            is_found: Whether the radio has found it, as it must a new one; False: it comes by itself.
        """
        return self.is_running and bool(self._calls.machine_pad_connect(address, is_found))

    def disconnect_pad(self) -> None:
        """Let the connected game pad go."""
        if self.is_running:
            self._calls.machine_pad_disconnect()

    def pad(self, *, up: bool = False, down: bool = False, forward: int = 0, backward: int = 0, turn: int = 0) -> bool:
        """Let the connected game pad report; False where none is."""
        return self.is_running and bool(self._calls.machine_pad(up, down, forward, backward, turn))

    def run_until(self, until_us: int) -> None:
        """Run to a time; a program that ends begins anew, as the chip does."""
        while self.is_running:
            calls, state = self._calls_and_state()
            self._give_bytes(until_us)
            end = calls.machine_run(until_us - self._started_us)
            if end == 0:
                break
            self.now_us = self._started_us + state.now_us
            self.panic = (state.panic or b"").decode()
            memory = self._library.rtc
            self._stop()
            self._start(_REASONS[end], memory)
        self.now_us = max(self.now_us, until_us)
        for arriving in self._arriving:  # nobody was there to hear them
            while arriving and arriving[0][0] <= self.now_us:
                arriving.popleft()

    @property
    def _calls(self) -> Any:
        return self._calls_and_state()[0]

    def _calls_and_state(self) -> tuple[Any, _State]:
        """Return the library with this machine's memory in it."""
        library = self._library
        if library.turn_of is not self:
            if library.turn_of is not None:
                library.turn_of._ram = library.ram  # noqa: SLF001 - another of this class
            library.ram = self._ram
            library.turn_of = self
        return library.calls, library.state

    def _start(self, reason: ResetReason, memory: bytes | None) -> None:
        self._ram = self._library.fresh
        self.is_running = True
        calls, state = self._calls_and_state()
        state.reset_reason, state.nvs_fault, state.levels = reason, self.nvs_fault, self._levels
        self._started_us = self.now_us
        self.starts.append(reason)
        for (space, name), value in self._nvs.items():
            calls.machine_nvs_put(space.encode(), name.encode(), value)
        if memory is not None:
            self._library.rtc = memory

    def _stop(self) -> None:
        self._collect()
        self._nvs = self.nvs
        self.nvs_fault = NvsFault(self.state.nvs_fault)
        if self.nvs_fault is NvsFault.ERASED:
            self.nvs_fault = NvsFault.SOUND
        self._library.turn_of = None
        self.is_running = False

    def _give_bytes(self, until_us: int) -> None:
        """Give the program what arrives up to a time."""
        calls = self._calls
        for port, arriving in enumerate(self._arriving):
            due = []
            while arriving and arriving[0][0] <= until_us:
                due.append(arriving.popleft())
            if due:
                times = [max(at, self.now_us) - self._started_us for at, _ in due]
                calls.machine_receive(
                    port, bytes(byte for _, byte in due), (ctypes.c_int64 * len(due))(*times), len(due)
                )

    def _collect(self) -> None:
        if not self.is_running:
            return
        calls, (data, times) = self._calls, _BUFFERS
        for port in range(PORTS):
            while size := calls.machine_sent(port, data, times, _CHUNK):
                self._sent[port] += (
                    (self._started_us + at, byte) for at, byte in zip(times[:size], data.raw[:size], strict=True)
                )


@cache
def _library(path: Path) -> _Library:
    return _Library(path)
