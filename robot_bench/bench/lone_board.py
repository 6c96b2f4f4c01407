"""A BluePill by itself, as a bench runs it: no robot and no world; each of its pins is a wire, for hands and eyes.

Invariant: its program does what it does on a lone chip.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from bluepill_sim.board import BluePill
from bluepill_sim.parts.registry import PartSpec, build
from p2os.pioneer.world.model import Pose, World
from p2os.robots.parameters import RobotParameters, load_parameters
from robot_bench.direct.wired import RobotWire
from robot_bench.events.selection import BUSES
from robot_bench.scenario.scenario import Scenario
from robot_bench.scenario.wired_robots import NO_ROBOT, OwnRobot
from simbase.timing import Nanos

#: Where nothing is.
NOWHERE = World(
    name="", source="", description="", start=Pose(0.0, 0.0, 0.0), extent=(-1.0, -1.0, 1.0, 1.0), obstacles=()
)


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
