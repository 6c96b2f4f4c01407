"""A firmware on a board by itself on the page: what `--view` of the emulator's `run` does (`bluepill_sim.views`).

It is a run of the bench without a robot, so that what a live run is there is it here: one control, one kind of events.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from bluepill_sim.cli.browser.viewing import ViewedRun
from p2os.cli.captures.shown_page import shown
from robot_bench.bench import Bench
from robot_bench.bench.lone_board import board_scenario
from robot_bench.cli.debugging.gdb import gdb_port
from robot_bench.cli.shown.live_run import LiveRun
from robot_bench.recording.trace import TraceWriter


def view_board(run: ViewedRun) -> None:
    """Run a firmware at the pace of the clock, show and control it, also when it is over, until an interrupt.

    Raises:
        ImageError, PartError: As of `board_scenario`.
        UsageError, MissingDependencyError: As of `shown`.
        BluePillError: The port for GDB is taken.
    """
    scenario = board_scenario(run.firmware, run.end_ns, usart_baud=run.usart_baud, parts=run.parts)
    with TemporaryDirectory(prefix="p2os-view-") as folder, gdb_port(run.gdb, scenario) as port:
        bench = Bench(scenario, trace=TraceWriter(Path(folder) / "trace.jsonl"))
        live = LiveRun(scenario, gdb=port)
        live.stays = True
        try:
            with shown(live.source, is_opened=run.is_opened):
                live.drive(bench)
                bench.finish()
                sys.stderr.write(f"over at {bench.now / 1e9:g} s; Ctrl-C ends the page\n")
                live.stay()
        finally:
            bench.trace.close()
