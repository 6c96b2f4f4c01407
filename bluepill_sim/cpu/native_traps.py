"""The traps of the native core: the same hooks, that look at their register in C.

Invariant: Python is called only by a trap that springs.
"""

import ctypes
from collections.abc import Callable

from bluepill_sim.cpu.core import Core
from bluepill_sim.cpu.halt import HaltKind
from bluepill_sim.cpu.native_library import address_of, library
from bluepill_sim.cpu.native_state import HALT_NUMBERS
from bluepill_sim.cpu.registers import GENERAL
from bluepill_sim.cpu.traps import StopBefore, Traps


class NativeTraps(Traps):
    """Watches the instructions that may trap, without entering Python at each of them."""

    def __init__(
        self, core: Core, stop_before: StopBefore, leave_it_block: Callable[[], object], state: ctypes.c_void_p
    ) -> None:
        super().__init__(core, stop_before, leave_it_block)
        self._state = state

    def _trap(self, address: int, number: int, kind: HaltKind) -> None:
        if (address, number, kind) in self._trapped:
            return
        self._trapped.add((address, number, kind))
        user = library().core_trap(self._state, address, GENERAL[number].value, HALT_NUMBERS[kind])
        self._core.hook_native("instruction", address_of("core_on_trap"), user, address, address)
