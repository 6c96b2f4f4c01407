"""`p2os run --gdb`: a scenario under GDB, with robot and world standing still at each halt."""

import contextlib
import sys
from collections.abc import Callable, Iterator

from bluepill_sim.cli.gdb_server import GdbPort, GdbServer
from p2os.errors import RunFailedError
from robot_bench.bench import Bench
from robot_bench.cli.debugging.machine import BenchMachine, RemoteMachine
from robot_bench.remote import RemoteBench
from robot_bench.run import RunBench, RunRemoteBench
from robot_bench.scenario.scenario import Scenario


def debug_bench(port: int, *, is_paced: bool, on_wait: Callable[[], None]) -> RunBench:
    """Return what lets GDB run a bench.

    Args:
        port: TCP port on this machine; 0 takes a free one.
        is_paced: whether virtual time goes no faster than the wall clock.
        on_wait: called while GDB is waited for; may raise to end the run.
    """

    def drive(bench: Bench) -> None:
        _serve(GdbServer(BenchMachine(bench), port, is_paced=is_paced, on_wait=on_wait), bench)
        bench.run_until(bench.scenario.duration_ns)

    return drive


def debug_port(port: int, *, on_wait: Callable[[], None]) -> RunRemoteBench:
    """Return what lets GDB run a bench with a real robot, which the first halt stops; arguments as of `debug_bench`."""

    def drive(bench: RemoteBench) -> None:
        try:
            _serve(GdbServer(RemoteMachine(bench), port, on_wait=on_wait), bench)
            if not bench.is_closed:
                bench.run_until(bench.scenario.duration_ns)
        finally:
            bench.close()

    return drive


@contextlib.contextmanager
def gdb_port(port: int | None, scenario: Scenario) -> Iterator[GdbPort | None]:
    """Yield where GDB comes to a run that a page controls, too, and print it; None: it does not come.

    Raises:
        BluePillError: The port is taken.
    """
    if port is None:
        yield None
        return
    with contextlib.closing(GdbPort(port)) as opened:
        say_where(opened.port, scenario)
        yield opened


def say_where(port: int, scenario: Scenario) -> None:
    """Print to standard error where GDB is waited for, and how one starts it."""
    sys.stderr.write(f"waiting for GDB on port {port}: gdb-multiarch {scenario.firmware} -ex 'target remote :{port}'\n")
    sys.stderr.flush()


def _serve(server: GdbServer, bench: Bench | RemoteBench) -> None:
    say_where(server.port, bench.scenario)
    try:
        runs_on = server.serve()
    finally:
        server.close()
    if not runs_on:
        raise RunFailedError("killed by the debugger", hint="detach lets the run go on")
