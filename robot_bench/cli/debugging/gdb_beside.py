"""GDB at a run that a page controls, too: both see the same halt, at the same instruction.

What GDB asks for is done by the page's own session; who holds the run is `holds`. GDB reads and halts; it writes
nothing, since what is written is in no record of the run, which then could not go back, fork, or run again.

Invariant: a run at which GDB has halted, stepped and gone back leaves the trace that it leaves alone.
"""

from bluepill_sim.cli.gdb_server import GdbPort
from bluepill_sim.core import Watchpoint
from bluepill_sim.debug.machine import Machine, StopKind
from p2os.errors import RunFailedError
from robot_bench.cli.debugging.future import Future
from robot_bench.cli.debugging.session import GDB, RunSession


class GdbBeside:
    """GDB beside the page of one run.

    Args:
        session: Controls the run.
        port: Where GDB comes.
    """

    read_only = "beside a page GDB writes nothing, which the run's record would not have: hands on the page do"

    def __init__(self, session: RunSession, port: GdbPort) -> None:
        self._session, self._port = session, port
        self._breakpoints: set[int] = set()
        self._watchpoints: set[Watchpoint] = set()

    def serve(self, wait_s: float) -> None:
        """Do what GDB has asked for, and tell it of the halt that it waits for; wait at most so many seconds.

        Raises:
            RunFailedError: GDB has killed the run.
        """
        self._tell()
        self._port.serve(self, wait_s)
        self._tell()

    def _tell(self) -> None:
        if (halted := self._session.take_gdb_halt()) is not None:
            is_of_page = halted.number != GDB and halted.stop.kind is not StopKind.END
            self._port.stopped(halted.stop, f"page: {halted.why}" if is_of_page else "")

    # As the debugger's target.

    @property
    def machine(self) -> Machine:
        """The future that is chosen on the page."""
        return self._session.chosen.machine

    def go_on(self) -> None:
        """Go on, once the page lets it."""
        self._session.do_for_gdb(None)

    def step(self) -> None:
        """Run one instruction, once the page lets it."""
        self._session.do_for_gdb(Future.step)

    def step_back(self) -> None:
        """Go to before the last instruction, once the page lets it."""
        self._session.do_for_gdb(Future.step_back)

    def go_back(self) -> None:
        """Go to the last place to halt at before this one, once the page lets it."""
        self._session.do_for_gdb(Future.go_back)

    def set_point(self, point: int | Watchpoint, *, is_set: bool) -> None:
        """Halt before the instruction at an address, or at an access; or no longer."""
        if isinstance(point, Watchpoint):
            (self._watchpoints.add if is_set else self._watchpoints.discard)(point)
        else:
            (self._breakpoints.add if is_set else self._breakpoints.discard)(point)
        self._session.halt_for_gdb(frozenset(self._breakpoints), frozenset(self._watchpoints))

    def changed(self) -> None:
        """Take that the machine has been written to: it never is."""

    def attached(self) -> None:
        """Take that GDB is there."""
        self._session.gdb_comes()

    def interrupted(self) -> None:
        """Halt for GDB."""
        self._session.stand_for_gdb("interrupt")

    def left(self, *, was_killed: bool, is_lost: bool) -> None:
        """Take that GDB is there no more.

        Raises:
            RunFailedError: It has killed the run.
        """
        self._breakpoints.clear()
        self._watchpoints.clear()
        if was_killed:
            raise RunFailedError("killed by the debugger", hint="detach lets the run go on")
        self._session.gdb_leaves(is_lost=is_lost)
