"""A virtual robot at a port in virtual time: what a run at a port sees, at no clock and no machine's mercy."""

import math
from dataclasses import dataclass, field
from pathlib import Path

from p2os.errors import TransportError
from p2os.pioneer.body.factory import make_body
from p2os.pioneer.controller.controller import Pioneer
from p2os.pioneer.controller.settings import ControllerSettings
from p2os.pioneer.world import load_world
from p2os.robots.parameters import load_parameters
from robot_bench.experiments.validation.experiments import EXPERIMENTS
from robot_bench.experiments.validation.trials import PortRun, Result, port_runs, run_port
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

    def read(self) -> bytes:
        now = self.clock.now - self.began
        if now > self.lasts_s * 1e9:
            raise TransportError("the line is gone")
        self.robot.advance_to(now)
        return b"".join(self.robot.take_output())

    def write(self, data: bytes) -> None:
        self.robot.receive(data, self.clock.now - self.began)

    def fileno(self) -> int:
        return -1

    def set_baud(self, baud: int) -> None: ...

    def close(self) -> None: ...


def at_port(
    names: list[str], folder: Path, *, world: Path | str, faults: tuple[str, ...] = (), lasts_s: float = math.inf,
    duration_s: float | None = None,
) -> list[Result]:  # fmt: skip
    """Return what experiments find of a virtual robot at a port; `lasts_s` is when the line goes."""
    settings = [] if duration_s is None else [("duration_s", duration_s)]
    parameters = load_parameters("p2dx")

    def drive(run: PortRun, place: Path) -> RunResult:
        clock = Clock()
        robot = Pioneer(
            parameters=parameters, body=make_body("kinematic", load_world(str(world)), parameters),
            settings=ControllerSettings(), faults=faults,
        )  # fmt: skip
        pacer = RealTimePacer(clock=clock.read, sleep=clock.sleep)
        return run_at_port(
            run.scenario, place, VirtualLine(robot, clock, lasts_s), clock=clock.read, pacer=pacer, files=Files.SUMMARY
        )

    return run_port(port_runs([EXPERIMENTS[name] for name in names], settings), drive, folder)
