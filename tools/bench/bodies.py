"""Print how far each body ends from ideal paths, and how fast one robot lives on it, controller and sonar included.

Goals stand beside the figures. Run it on an idle machine; a body whose engine is
not installed is left out aloud. Usage: python tools/bench/bodies.py [--quick]
"""

import math
import statistics

from measuring import IS_QUICK, cpu_s, several

from p2os.pioneer.body.factory import engines, make_body
from p2os.pioneer.controller import Pioneer
from p2os.pioneer.world import load_world, parse_world
from p2os.pioneer.world.model import Pose
from p2os.protocol.commands import Command
from p2os.protocol.commands import CommandNumber as C
from p2os.robots.parameters import load_parameters
from simbase.errors import MissingDependencyError
from simbase.timing import NS_PER_MS, NS_PER_S

P2DX = load_parameters("p2dx")
EMPTY = parse_world('name = "empty"\nextent_m = [-4, -4, 4, 4]', "empty")
LIVED_S = 5 if IS_QUICK else 20
#: A robot lives at least so many times as fast as real time; and ends at most so many mm, degrees, mm from the ideal.
FASTER_THAN = {"kinematic": 100.0, "bullet": 15.0}
WITHIN = {"kinematic": (0.001, 0.001, 0.001), "bullet": (0.5, 0.05, 1.0), "mujoco": (0.5, 0.05, 1.0)}


def errors(name: str) -> tuple[float, float, float]:
    """Return how far a 1 m line, a full turn and a 1 m square end from the ideal: mm, degrees, mm."""
    body = make_body(name, EMPTY, P2DX)
    rim = math.pi / 2.5 * P2DX.track_mm / 2000

    def ramped(left: float, right: float) -> None:
        for step in range(3000):
            share = min(1.0, (step + 0.5) / 500, (2999.5 - step) / 500)
            body.step(left * share, right * share)
        for _ in range(300):
            body.step(0, 0)

    ramped(0.4, 0.4)
    line = math.hypot(body.state.x_m - 1, body.state.y_m)
    body.reset(Pose(0, 0, 0), 0)
    for _ in range(2):
        ramped(-rim, rim)
    turn = abs(math.degrees(math.remainder(body.state.heading_rad, 2 * math.pi)))
    body.reset(Pose(0, 0, 0), 0)
    for _ in range(4):
        ramped(0.4, 0.4)
        ramped(-rim / 2, rim / 2)
    square = math.hypot(body.state.x_m, body.state.y_m)
    return line * 1e3, turn, square * 1e3


def times_real(name: str, lived_s: int = LIVED_S) -> float:
    """Return how many times as fast as real time one robot drives in `room`, its eight sonar sounding."""
    robot = Pioneer(parameters=P2DX, body=make_body(name, load_world("room"), P2DX))
    for number, argument in ((0, None), (1, None), (2, None), (1, None), (C.ENABLE, 1), (C.VEL, 100), (C.RVEL, 20)):
        robot.receive(Command(number, argument).to_frame().to_bytes(), 0)

    def drive() -> None:
        for at in range(100 * NS_PER_MS, lived_s * NS_PER_S + 1, 100 * NS_PER_MS):
            robot.receive(Command(C.PULSE, None).to_frame().to_bytes(), at)
            robot.take_output()

    return lived_s / cpu_s(drive)


def main() -> None:
    """Print a table."""
    print(f"{'body':<10} {'1 m line':>11} {'full turn':>12} {'1 m square':>11} {'one robot at 1 kHz, 8 sonar':>29}")
    for name in engines():
        try:
            line, turn, square = found = errors(name)
        except MissingDependencyError as error:
            print(f"{name:<10} left out: {error} ({error.hint})")
            continue
        factor, least = statistics.median(several(times_real, name)), FASTER_THAN.get(name, 0.0)
        missed = any(is_ > most for is_, most in zip(found, WITHIN[name], strict=True)) or factor < least
        goals = "within {:g} mm, {:g} deg, {:g} mm".format(*WITHIN[name]) + (f", {least:g} x" if least else "")
        print(
            f"{name:<10} {line:>8.3f} mm {turn:>8.4f} deg {square:>8.3f} mm {factor:>22.1f} x real"
            f"  {'MISSES' if missed else 'meets'} its goal: {goals}"
        )


if __name__ == "__main__":
    main()
