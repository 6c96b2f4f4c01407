"""A virtual robot at a port in virtual time: what a run at a port sees, at no clock and no machine's mercy."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypedDict

from p2os.errors import TransportError
from p2os.pioneer.body.factory import make_body
from p2os.pioneer.controller.controller import Pioneer
from p2os.pioneer.controller.settings import ControllerSettings
from p2os.pioneer.world import load_world
from p2os.robots.parameters import load_parameters
from robot_bench.experiments.validation.experiments import EXPERIMENTS
from robot_bench.experiments.validation.trials import PortRun, TrialResult, port_runs, run_port
from robot_bench.report.make import Files
from robot_bench.run import RunResult, run_at_port
from robot_bench.running.pacer import RealTimePacer

FILES = Path(__file__).parents[4] / "robot_bench/experiments/validation/scenarios"
#: What `sensors` asks for at a port.
GATE = """name = "gate"
extent_m = [-10.0, -10.0, 10.0, 10.0]
[start]
x_m = 0.0
y_m = 0.0
heading_deg = 0.0
""" + "".join(
    f'[[box]]\nname = "{name}"\nx_m = 1.2\ny_m = {y_m}\nlength_m = 0.3\nwidth_m = 0.05\nheight_m = 0.5\n'
    for name, y_m in (("left", 0.4), ("right", -0.4))
)


class Time(TypedDict):
    """Arguments of `run_at_port`."""

    clock: Callable[[], int]
    pacer: RealTimePacer


@dataclass
class Clock:
    """Goes on where somebody sleeps, and nowhere else."""

    now: int = 10**9

    def read(self) -> int:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += round(seconds * 1e9)


@dataclass
class VirtualLine:
    """A line to a virtual robot; bytes take no time on it."""

    robot: Pioneer
    clock: Clock
    lasts_s: float = math.inf
    description: str = "virtual"
    began: int = field(init=False)

    def __post_init__(self) -> None:
        self.began = self.clock.now

    @property
    def time(self) -> Time:
        """What `run_at_port` lives by: the clock of this line."""
        clock = self.clock.read
        return {"clock": clock, "pacer": RealTimePacer(clock=clock, sleep=self.clock.sleep)}

    def read(self) -> bytes:
        now = self.clock.now - self.began
        if now > self.lasts_s * 1e9:
            raise TransportError("the line is gone")
        if (due := self.robot.next_deadline()) is not None and due <= now:  # before it says nothing of itself
            self.robot.advance_to(now)
        return b"".join(self.robot.take_output())

    def write(self, data: bytes) -> None:
        self.robot.receive(data, self.clock.now - self.began)

    def fileno(self) -> int:
        return -1

    def set_baud(self, baud: int) -> None: ...

    def close(self) -> None: ...


def virtual_line(world: Path | str, faults: tuple[str, ...] = (), lasts_s: float = math.inf) -> VirtualLine:
    """Return a line to a robot in a world."""
    parameters = load_parameters("p2dx")
    robot = Pioneer(
        parameters=parameters, body=make_body("kinematic", load_world(str(world)), parameters),
        settings=ControllerSettings(), faults=faults,
    )  # fmt: skip
    return VirtualLine(robot, Clock(), lasts_s)


def at_port(
    names: list[str], folder: Path, *, world: Path | str, faults: tuple[str, ...] = (), lasts_s: float = math.inf,
    duration_s: float | None = None,
) -> list[TrialResult]:  # fmt: skip
    """Return what experiments find of a virtual robot at a port; `lasts_s` is when the line goes."""
    settings = [] if duration_s is None else [("duration_s", duration_s)]

    def drive(run: PortRun, place: Path) -> RunResult:
        line = virtual_line(world, faults, lasts_s)
        return run_at_port(run.scenario, place, line, **line.time, files=Files.SUMMARY)

    return run_port(port_runs([EXPERIMENTS[name] for name in names], settings), drive, folder)
