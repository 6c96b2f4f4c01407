"""A firmware on a board by itself on the page: what `--view` of the emulator's `run` does (`bluepill_sim.views`).

It is a run of the bench without a robot, so that what a live run is there is it here: one control, one kind of events.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from bluepill_sim.board import BluePill
from bluepill_sim.cli.browser.viewing import ViewedRun
from bluepill_sim.parts.registry import PartSpec, build
from p2os.cli.captures.shown_page import shown
from p2os.robots.parameters import RobotParameters, load_parameters
from robot_bench.bench import Bench
from robot_bench.cli.debugging.gdb import gdb_port
from robot_bench.cli.shown.live_run import LiveRun
from robot_bench.direct.wired import RobotWire
from robot_bench.events.selection import BUSES
from robot_bench.recording.trace import TraceWriter
from robot_bench.scenario.scenario import Scenario
from robot_bench.scenario.wired_robots import NO_ROBOT, OwnRobot
from simbase.timing import Nanos


@dataclass(frozen=True, slots=True)
class BoardPins:
    """The pins of a board, as the wires of no robot."""

    signals: tuple[RobotWire, ...]
    parameters: RobotParameters


def board_scenario(
    firmware: Path, duration: Nanos, *, usart_baud: int | None = None, parts: Sequence[PartSpec] = ()
) -> Scenario:
    """Return what runs a firmware on a board by itself.

    Args:
        firmware: ELF, HEX or BIN.
        duration: For how long, ns.
        usart_baud: Speed of USART1's far end, bit/s; None follows the program.
        parts: What is attached to the board; a pin that a part has been given is none of the wires.

    Raises:
        ImageError: The firmware is missing, damaged, or not for this chip.
        PartError: A part is none, or cannot be set so.
    """
    taken = {pin for spec in parts for pin in build(spec).pins.values()}
    names = [pin.name for pin in BluePill(firmware).pins if pin.name not in taken]
    parameters = load_parameters("p3dx")  # of nothing that is there
    pins = BoardPins(tuple(RobotWire(name=name, pin=name) for name in names), parameters)
    return Scenario(
        name=firmware.stem, description="", text="", firmware=firmware, world="", parameters=parameters, robot="",
        own_robot=OwnRobot(NO_ROBOT, pins), mode="direct", body="kinematic", duration_ns=duration,
        threshold_um=1, usart_baud=usart_baud, parts=tuple(parts),
        record=tuple(bus for bus in BUSES if bus != "usb"),
    )  # fmt: skip


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
