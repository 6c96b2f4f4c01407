"""A bench under a debugger: when the chip halts, robot and world stand still with it.

In virtual time the whole bench goes back with the chip, by the snapshots of all
its parts, and the trace loses what was written since. With a real robot nothing
goes back, and nothing stands still by itself: before the first halt is reported,
the robot is stopped and its session closed, and the run is over.

Invariant: a run that a debugger has halted and let go on leaves the same trace
as one that nobody debugged.
"""

from collections.abc import Callable

from bluepill_sim.board import BluePill
from bluepill_sim.core.halts import ChipReached
from bluepill_sim.errors import BluePillError
from robot_bench.bench import Bench
from robot_bench.remote import RemoteBench
from robot_bench.run import held
from simbase.timing import Nanos, Reason


def board_of(bench: Bench | RemoteBench) -> BluePill:
    """Return the emulated board of a bench.

    Raises:
        BluePillError: something else runs the firmware.
    """
    if not isinstance(bench.chip, BluePill):
        raise BluePillError("only an emulated BluePill can be debugged", hint="run without --gdb")
    return bench.chip


class BenchMachine:
    """A bench in virtual time, as `bluepill_sim.debug.machine.Machine`."""

    can_rewind = True

    def __init__(self, bench: Bench) -> None:
        self.board = board_of(bench)
        self._bench = bench

    @property
    def end_ns(self) -> Nanos | None:
        """When the scenario's time is up, or the firmware had its fault a while ago."""
        return self._bench.end

    def advance_to(self, limit_ns: Nanos, *, by_step: bool = False) -> ChipReached:
        """Bring the bench to a time; less far where the chip halts, or by one instruction of the chip."""
        return _advanced(self._bench, self._bench.run_until, limit_ns, by_step=by_step)

    def snapshot(self) -> object:
        """Return all that decides the bench's future, and where its trace stands."""
        return self._bench.snapshot()

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned."""
        self._bench.restore(snapshot)

    def halted(self) -> None:
        """All parts stand still already."""


class RemoteMachine:
    """A bench with a real robot: the first halt ends it."""

    can_rewind = False

    def __init__(self, bench: RemoteBench) -> None:
        self.board = board_of(bench)
        self._bench = bench
        self._has_begun = self._is_over = False

    @property
    def end_ns(self) -> Nanos | None:
        """When the scenario's time is up; at once after a halt."""
        return self.board.now_ns if self._is_over else self._bench.scenario.duration_ns

    def advance_to(self, limit_ns: Nanos, *, by_step: bool = False) -> ChipReached:
        """Bring the bench to a time, at the speed of the clock; less far where the chip halts."""
        if not self._has_begun:
            self._has_begun = True
            self._bench.start_clock()
        return _advanced(self._bench, self._bench.loop.run_until, limit_ns, by_step=by_step)

    def snapshot(self) -> object:
        """A real robot has no snapshot."""
        raise BluePillError("a real robot cannot go back")

    def restore(self, snapshot: object) -> None:  # noqa: ARG002 - the shape of a machine
        """A real robot cannot go back."""
        raise BluePillError("a real robot cannot go back")

    def halted(self) -> None:
        """Stop the robot and close its session: it would drive on by its last command."""
        self._is_over = True
        self._bench.close()


def _advanced(
    bench: Bench | RemoteBench,
    run_until: Callable[[Nanos, Callable[[Nanos], ChipReached]], object],
    limit_ns: Nanos,
    *,
    by_step: bool,
) -> ChipReached:
    """Bring a bench to a time, or to the first halt of its chip."""
    board = board_of(bench)
    run = board.step if by_step else board.advance_to
    halts: list[ChipReached] = []

    def advance(limit: Nanos) -> ChipReached:
        reached = run(limit)
        if reached.halt is not None:
            halts.append(reached)
            held(bench).loop.note_halt(is_inside_block=board.chip.engine.is_inside_block)
        return reached

    run_until(limit_ns, advance)
    return halts[-1] if halts else ChipReached(board.now_ns, Reason.DEADLINE)
