"""The processor of the native core: exceptions of the ordinary kind live in C.

It is its Python namesake; whatever C leaves to Python is done by the methods inherited.

Invariant: there is one copy of the state, in `shared`.
"""

from typing import Any

from bluepill_sim.core import Engine
from bluepill_sim.core.blocks import Measure
from bluepill_sim.core.faults import FAULT_OF_HALT, FAULT_ROWS, FaultKind, SeenFault
from bluepill_sim.core.halts import HaltKind
from bluepill_sim.core.nvic import FIRST_IRQ, SYSTEM_EXCEPTIONS
from bluepill_sim.core.processor import SEVONPEND, Processor, Sleep
from bluepill_sim.core.recorder import RECORD
from bluepill_sim.extension.library import is_native_wanted, library
from bluepill_sim.memory.arrays import Memory
from bluepill_sim.native.state import HALT_KINDS, HALT_NUMBERS, ordered_rows

_HALF = 64
_SLEEPS = (Sleep.AWAKE, Sleep.INTERRUPT, Sleep.EVENT)


def make_core(measure: Measure, memory: Memory) -> tuple[Engine, Processor]:
    """Return the engine and the processor: native ones where they are built and wanted.

    Raises:
        BluePillError: `P2OS_CORE` names no core.
        MissingDependencyError: Unicorn is not installed, or the core insisted on is not built.
    """
    if not is_native_wanted():
        engine = Engine(measure)
        return engine, Processor(engine, memory)
    from bluepill_sim.native.engine import NativeEngine

    native = NativeEngine(measure)
    return native, NativeProcessor(native, memory)


class NativeProcessor(Processor):
    """`Processor`; C runs, Python does what is out of the ordinary."""

    def __init__(self, engine: Any, memory: Memory) -> None:
        self._native = engine
        super().__init__(engine, memory)
        rows = {HALT_NUMBERS[halt]: FAULT_ROWS[kind] for halt, kind in FAULT_OF_HALT.items()}
        rows[HALT_NUMBERS[HaltKind.SUPERVISOR_CALL]] = FAULT_ROWS[FaultKind.MASKED_SVC]
        for number, row in rows.items():
            library().core_set_fault(engine.state, number, row.exception, row.cfsr, row.hfsr)

    @property
    def sleep(self) -> Sleep:
        """As of `Processor`."""
        return _SLEEPS[self.shared.sleep]

    @sleep.setter
    def sleep(self, sleep: Sleep) -> None:
        self.shared.sleep = _SLEEPS.index(sleep)

    def run(self, stop_at: int) -> None:
        """As of `Processor`; the ticks of SysTick on the way are no reason to come back."""
        if self._native.needs_python or self.is_stepping or self.bus_error_cycle is not None:
            super().run(self._before_event(stop_at))
            return
        must_deliver, halt = self._native.go_on(stop_at)
        if self.shared.has_fault:
            self._report_fault()
        if must_deliver:
            self._deliver()
        elif halt is not None:
            self._act_on(halt)

    def _report_fault(self) -> None:
        """Report the last HardFault that C has entered, with how often its handler came back to it."""
        self.shared.has_fault, fault = 0, self.shared.fault
        seen = SeenFault(
            at_ns=fault.ns,
            registers=tuple(fault.registers),
            exception_number=fault.exception_number,
            vector=fault.vector,
            last_rows=tuple(RECORD.iter_unpack(ordered_rows(fault))),
            last_ns=fault.last_ns,
            round_ns=fault.round_ns,
            returns=fault.returns,
            is_other=bool(fault.is_other),
        )
        address = fault.address if fault.has_address else None
        self._report(FAULT_OF_HALT[HALT_KINDS[fault.kind]], fault.pc, address, is_lockup=False, seen=seen)

    def _report(
        self, kind: FaultKind, pc: int, address: int | None, *, is_lockup: bool, seen: SeenFault | None = None
    ) -> None:
        if kind is FaultKind.MASKED_SVC:
            self.shared.knows_masked_svc = True
        super()._report(kind, pc, address, is_lockup=is_lockup, seen=seen)

    def _restored(self) -> None:
        super()._restored()
        self.shared.knows_masked_svc = self.shared.has_fault = False

    def step(self, stop_at: int) -> None:
        """As of `Processor`."""
        super().step(self._before_event(stop_at))

    def _before_event(self, stop_at: int) -> int:
        next_event: int = self._native.next_event
        return min(stop_at, next_event)

    def stop_at_boundary(self) -> None:
        """As of `Processor`."""
        self.shared.stop_at, self.shared.attention = 0, 1

    def pending_changed(self) -> None:
        """As of `Processor`; C itself looks again at a boundary."""
        shared = self.shared
        if shared.scr & SEVONPEND and self.nvic.pending:
            shared.event_register = 1
        enabled = shared.enabled << FIRST_IRQ
        low, high = shared.pending
        if low & (enabled | SYSTEM_EXCEPTIONS) or high & enabled >> _HALF:
            self._native.note_raised()
            shared.stop_at = 0
