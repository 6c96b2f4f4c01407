"""Going on, stepping, and going back: what a debugger's resume commands come to.

Theory of operation. Forwards the machine runs to what halts its chip; calls of
semihosting are served on the way. Backwards it is put to an older state and run
forward again, once to learn what stops lie on the way, and once to the last of
them. A run is repeatable, so it comes by the same states; nothing is printed
twice.

Invariant: outside of its methods the machine is halted.
"""

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from bluepill_sim.core import HaltKind, Watchpoint
from bluepill_sim.core.faults import FaultKind, SeenFault
from bluepill_sim.core.halts import ChipReached
from bluepill_sim.debug.history import MOST_POINTS, History, Point
from bluepill_sim.debug.machine import HaltReason, Machine, StopKind
from bluepill_sim.debug.semihosting import Semihosting
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos, Reason

#: chosen: how often a running machine checks for a request to stop.
SLICE_NS: Nanos = 2 * NS_PER_MS
#: chosen: so far before a state, in cycles, single steps towards it begin.
_MARGINS = (64, 512, 8192, 1 << 20, 1 << 62)
#: Bounds the steps of one way back: a program asleep or in a loop to itself takes one step for a long time.
_MAX_STEPS = 20_000

_STOP_OF_HALT = {
    HaltKind.BREAKPOINT: StopKind.BREAKPOINT,
    HaltKind.WATCHPOINT: StopKind.WATCHPOINT,
    HaltKind.STEP: StopKind.STEP,
    HaltKind.BKPT: StopKind.BKPT,
}


@dataclass(frozen=True, slots=True)
class _Place:
    """Tells one state of a run from all others."""

    cycle: int
    pc: int


class Execution:
    """Runs one machine for a debugger.

    Args:
        machine: what runs.
        write: takes what the program prints by semihosting; None: no debugger is attached: BKPT and faults do what
            they do on a chip alone, and halt nothing.
        most_points: so many older states are kept at most.
        slice_ns: how often it looks for a request to stop, at least.
    """

    read_only = ""

    def __init__(
        self,
        machine: Machine,
        write: Callable[[bytes], None] | None = None,
        *,
        most_points: int = MOST_POINTS,
        slice_ns: Nanos = SLICE_NS,
    ) -> None:
        self.machine = machine
        self.history = History(machine, most_points)
        self._slice_ns = slice_ns
        #: Called between slices; True ends the run.
        self.wants_stop: Callable[[], bool] = lambda: False
        self._is_replaying = False
        self._write = write
        self._semihosting = Semihosting(machine.board, self._print)
        self._reported_fault = False
        self._bkpt_at: int | None = None
        #: The cycle up to which this run has printed: what it comes by again, after a way back, is not printed again.
        self._printed_cycle = -1
        self._report = machine.board.chip.processor.on_fault
        if write is not None:
            machine.board.chip.processor.halts_on_bkpt = True
            machine.board.chip.processor.on_fault = self._faulted

    def detach(self) -> None:
        """Let the machine run as if no debugger had been there."""
        chip = self.machine.board.chip
        chip.engine.breakpoints.clear()
        chip.engine.watchpoints.clear()
        chip.processor.halts_on_bkpt = False
        chip.processor.on_fault = self._report

    def set_point(self, point: int | Watchpoint, *, is_set: bool) -> None:
        """Halt before the instruction at an address, or at an access; or no longer."""
        engine = self.machine.board.chip.engine
        if isinstance(point, Watchpoint):
            (engine.watchpoints.add if is_set else engine.watchpoints.discard)(point)
        else:
            (engine.breakpoints.add if is_set else engine.breakpoints.discard)(point)

    def changed(self) -> None:
        """Begin the history anew: the machine has been written to."""
        self.history.begin()
        self._bkpt_at = None
        self._printed_cycle = self.machine.board.cycle - 1
        self._reported_fault = self.machine.board.fault is not None

    # Forwards.

    def go_on(self) -> HaltReason:
        """Run until something stops the chip."""
        stop = self._run(None)
        self.machine.halted()
        return stop

    def step(self) -> HaltReason:
        """Run one instruction of the program, or the entry of the exception that comes before it."""
        self._pass_bkpt()
        stop = self._step_once() or HaltReason(StopKind.INTERRUPT)
        self.machine.halted()
        return stop

    def run_to(self, limit_ns: Nanos) -> HaltReason:
        """Run to a time, which counts as no stop (INTERRUPT), or to what stops the chip before."""
        return self._run(None, limit_ns)

    def pass_to(self, limit_ns: Nanos) -> None:
        """Run to a time, past all stops but the program's own end."""
        board = self.machine.board
        with self._without_stops():
            while board.now_ns < limit_ns and not self._has_ended():
                self.history.pass_by()
                reached = self.machine.advance_to(min(limit_ns, board.now_ns + self._slice_ns))
                if reached.halt is not None:
                    stop = self._stop_of(reached.halt.kind, reached.halt.address)
                    if stop is not None and stop.kind is StopKind.EXIT:
                        break  # the program has ended: it stands there
                    self._pass_bkpt()

    def _run(self, until: _Place | None, limit_ns: Nanos | None = None) -> HaltReason:
        """Run to a stop; with `until` also to a state, with `limit_ns` to a time, which counts as none: INTERRUPT."""
        self._pass_bkpt()
        board = self.machine.board
        while True:
            if self._has_ended():
                return HaltReason(StopKind.END)
            if limit_ns is not None and board.now_ns >= limit_ns:
                return HaltReason(StopKind.INTERRUPT)
            ends = (board.now_ns + self._slice_ns, limit_ns, self.machine.end_ns)
            limit = min(end for end in ends if end is not None)
            if not self._is_replaying:
                self.history.pass_by()
            if until is not None and board.cycle >= until.cycle:
                return HaltReason(StopKind.INTERRUPT)
            reached = self.machine.advance_to(limit)
            stop = self._stopped(reached)
            if stop is not None:
                return stop

    def _stopped(self, reached: ChipReached) -> HaltReason | None:
        """Return what stops a run that came so far; None: nothing."""
        if reached.halt is not None:
            return self._stop_of(reached.halt.kind, reached.halt.address)
        if self._has_new_fault() or reached.reason is Reason.HALT:
            self._reported_fault = True
            return HaltReason(StopKind.FAULT)
        if not self._is_replaying and self.wants_stop():
            return HaltReason(StopKind.INTERRUPT)
        return None

    def _step_once(self) -> HaltReason | None:
        """Run one instruction; None where the chip sleeps until a stop is requested."""
        while True:
            if self._has_ended():
                return HaltReason(StopKind.END)
            reached = self.machine.advance_to(self.machine.board.now_ns + self._slice_ns, by_step=True)
            if reached.halt is not None:
                stop = self._stop_of(reached.halt.kind, reached.halt.address)
                return stop or HaltReason(StopKind.STEP)
            if self._has_new_fault() or reached.reason is Reason.HALT:
                self._reported_fault = True
                return HaltReason(StopKind.FAULT)
            if self.wants_stop():
                return None

    def _stop_of(self, kind: HaltKind, address: int | None) -> HaltReason | None:
        """Return what a halt is to the debugger; None for a call of semihosting that was served."""
        if kind is HaltKind.BKPT:
            pc = self.machine.board.pc
            if not self._semihosting.is_call(pc):
                self._bkpt_at = pc
                return HaltReason(StopKind.BKPT)
            ended = self._semihosting.serve()
            return None if ended is None else HaltReason(StopKind.EXIT, code=ended.code)
        return HaltReason(_STOP_OF_HALT[kind], address)

    def _pass_bkpt(self) -> None:
        """Go past the BKPT that was reported to the debugger."""
        board = self.machine.board
        if self._bkpt_at == board.pc:
            board.chip.engine.jump(board.pc + 2 | 1)
        self._bkpt_at = None

    def _has_ended(self) -> bool:
        end = self.machine.end_ns
        return end is not None and self.machine.board.now_ns >= end

    def _has_new_fault(self) -> bool:
        return self._write is not None and self.machine.board.fault is not None and not self._reported_fault

    def _faulted(self, kind: FaultKind, pc: int, address: int | None, is_lockup: bool, seen: SeenFault | None) -> None:
        if self._report is not None:
            self._report(kind, pc, address, is_lockup, seen)
        if self._has_new_fault():
            self.machine.board.request_stop()

    def _print(self, data: bytes) -> None:
        cycle = self.machine.board.cycle
        if not self._is_replaying and self._write is not None and cycle > self._printed_cycle:
            self._printed_cycle = cycle
            self._write(data)

    # Backwards.

    def go_to(self, at_ns: Nanos) -> None:
        """Go to a time, past all stops but the program's own end: forwards, or from the newest older state kept."""
        if at_ns < self.machine.board.now_ns:
            point = next((one for one in self.history.latest_first() if one.at_ns <= at_ns), None)
            if point is None:
                point = self.history.latest_first()[-1]
            self._bkpt_at = None
            self.machine.restore(point.snapshot)
            self.history.forget_after(point.cycle)
            self._reported_fault = self.machine.board.fault is not None
        self.pass_to(at_ns)

    def step_back(self) -> HaltReason:
        """Go to the state before the last instruction; of a chip that sleeps, before that which it sleeps in."""
        return self._replay(lambda here: self._back_by(here, self._step_once, StopKind.STEP))

    def go_back(self) -> HaltReason:
        """Go to the last stop before this state, or to where the history begins."""
        return self._replay(self._go_back)

    def back_to_near_stop(self) -> HaltReason:
        """Go to the last stop before this state, where stops are so many that they are looked for from nearby."""
        return self._replay(lambda here: self._back_by(here, lambda: self._run(here), StopKind.BREAKPOINT))

    def _replay(self, act: Callable[[_Place], HaltReason]) -> HaltReason:
        board = self.machine.board
        self._is_replaying = True
        self._bkpt_at = None
        try:
            stop = act(_Place(board.cycle, board.pc))
        finally:
            self._is_replaying = False
        self.history.forget_after(board.cycle)
        self._reported_fault = board.fault is not None
        return stop

    def _back_by(self, here: _Place, advance: Callable[[], HaltReason | None], kind: StopKind) -> HaltReason:
        """Go to the last state before another one that `advance` comes by, from nearby or from further away."""
        for margin in _MARGINS:
            for point in self.history.before(here.cycle)[:2]:
                self.machine.restore(point.snapshot)
                self._approach(here, margin)
                if self.machine.board.cycle >= here.cycle:
                    continue
                start, is_between = self.machine.snapshot(), self.machine.board.is_asleep or kind is not StopKind.STEP
                count = self._count_before(here, advance)
                self.machine.restore(start)
                # A chip that sleeps is between two instructions: this is no state that one stops in.
                if count is None or (count == 0 and is_between):
                    continue
                for _ in range(count):
                    advance()
                return HaltReason(kind)
        return self._to_begin(here)

    def _approach(self, here: _Place, margin: int) -> None:
        """Run to some cycles before a state, past all stops."""
        board = self.machine.board
        with self._without_stops():
            while board.cycle < here.cycle - margin:
                span_ns = (here.cycle - margin - board.cycle) * NS_PER_S // board.hclk_hz
                if span_ns <= 0:
                    break
                reached = self.machine.advance_to(board.now_ns + min(span_ns, self._slice_ns))
                if reached.halt is not None:
                    self._stop_of(reached.halt.kind, reached.halt.address)
                    self._pass_bkpt()

    @contextlib.contextmanager
    def _without_stops(self) -> Iterator[None]:
        engine = self.machine.board.chip.engine
        breakpoints, watchpoints = set(engine.breakpoints), set(engine.watchpoints)
        engine.breakpoints.clear()
        engine.watchpoints.clear()
        try:
            yield
        finally:
            engine.breakpoints.update(breakpoints)
            engine.watchpoints.update(watchpoints)

    def _count_before(self, here: _Place, advance: Callable[[], HaltReason | None]) -> int | None:
        """Return how many times one advances to the last state before another; None where that is too often."""
        board = self.machine.board
        for count in range(_MAX_STEPS):
            self._pass_bkpt()
            advance()
            if (board.cycle, board.pc) == (here.cycle, here.pc) or board.cycle > here.cycle:
                return count
            if self._has_ended():
                return count
        return None

    def _go_back(self, here: _Place) -> HaltReason:
        for point in self.history.before(here.cycle):
            stops = self._stops_between(point, here)
            if stops:
                self.machine.restore(point.snapshot)
                for _ in range(len(stops)):
                    self._run(None)
                self._bkpt_at = self.machine.board.pc if stops[-1].kind is StopKind.BKPT else None
                return stops[-1]
            here = _Place(point.cycle, here.pc)
        return self._to_begin(here)

    def _stops_between(self, point: Point, here: _Place) -> list[HaltReason]:
        self.machine.restore(point.snapshot)
        self._reported_fault = True
        board, stops = self.machine.board, list[HaltReason]()
        while True:
            stop = self._run(here)
            if (
                board.cycle > here.cycle
                or (board.cycle, board.pc) == (here.cycle, here.pc)
                or stop.kind in {StopKind.INTERRUPT, StopKind.END, StopKind.FAULT, StopKind.EXIT}
            ):
                return stops
            stops.append(stop)

    def _to_begin(self, here: _Place) -> HaltReason:
        first = self.history.before(here.cycle + 1)[-1:]
        if first:
            self.machine.restore(first[0].snapshot)
        return HaltReason(StopKind.BEGIN)
