"""The latency of interrupts, varied: each is taken a drawn number of cycles later than it may be.

A Cortex-M3 takes an interrupt twelve cycles after it came, and up to so many more where the bus or an instruction in
several cycles holds it up, which no model tells exactly. A program whose outputs hang on it has a race. What draws and
puts off is `extension/source/core/latency.c`; this holds its settings and state.

Invariant: the n-th interrupt is put off by what the seed and n say, whatever came before.
"""

import ctypes
from typing import Any

from bluepill_sim.errors import BluePillError
from bluepill_sim.extension.layout import LATENCY, structure
from bluepill_sim.extension.library import is_exact_wanted, library
from bluepill_sim.fabric.fabric import Fabric
from bluepill_sim.native.engine import NativeEngine
from simbase.state import Stateful

#: chosen: so many cycles at the most, those that an exception's entry takes itself.
MOST_CYCLES = 12
#: What `until` is where all interrupts are put off as they are drawn.
ALL = (1 << 64) - 1


class InterruptLatency(Stateful):
    """Puts interrupts off, once `vary` was called.

    Args:
        engine: The core's.
        fabric: What it is joined to.
    """

    STATE = ("packed",)
    DERIVED = ("_struct", "_is_varied")

    def __init__(self, engine: object, fabric: Fabric) -> None:
        self._engine, self._fabric = engine, fabric
        self._struct: Any = structure(LATENCY)()
        self._slot = fabric.add_device(
            "latency of interrupts", "latency", 0, ctypes.addressof(self._struct),
            act=lambda _ns: None, answer=lambda _what, _value: None, deliver=lambda: None,
        )  # fmt: skip
        self._is_varied = False

    def vary(self, *, seed: int, most: int = MOST_CYCLES, until: int = ALL, last: int = 0) -> None:
        """Put each interrupt of a device, and of SysTick, off by 0 to `most` cycles from now on.

        Args:
            seed: Of what is drawn.
            most: Cycles.
            until: The interrupts from this one on, counted from 0, come at once.
            last: But for that one itself, which is put off by so many cycles.

        Raises:
            BluePillError: The core does not take interrupts at the instruction.
        """
        if not isinstance(self._engine, NativeEngine) or not is_exact_wanted():
            raise BluePillError(
                "the latency of interrupts varies only where they are taken at the instruction",
                hint="P2OS_CORE=exact in the environment chooses that core",
            )
        held = self._struct
        held.seed, held.most, held.until, held.last = seed & ALL, most, until, last
        self._join()

    @property
    def count(self) -> int:
        """How many interrupts have come since `vary` that could be put off."""
        return int(self._struct.count)

    @property
    def packed(self) -> bytes:
        """Settings and state; empty where nothing is varied."""
        return bytes(self._struct) if self._is_varied else b""

    @packed.setter
    def packed(self, packed: bytes) -> None:
        if packed:
            ctypes.memmove(ctypes.addressof(self._struct), packed, len(packed))
            self._join()
            self._fabric.command(self._slot, 0)

    def _join(self) -> None:
        if not self._is_varied and isinstance(self._engine, NativeEngine):
            self._is_varied = True
            library().core_vary_latency(self._engine.state, self._slot, ctypes.addressof(self._struct))
