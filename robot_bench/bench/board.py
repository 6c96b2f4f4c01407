"""Chip and wires of a scenario, what is heard on them and done to them; also where the robot is at a port.

Invariant: what a scenario says of its chip and its wires becomes parts here alone.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, cast

from adapter_sim.pinout import Pinout, Pull, load_pinout
from bluepill_sim.fabric.surroundings import Surroundings
from bluepill_sim.parts.registry import attach
from p2os.event_log import log_event, logger
from p2os.pioneer.body.contract import RobotBody
from p2os.toml_schema import placed, within
from robot_bench.bench.hand_driven_body import hand_driven
from robot_bench.direct.wired import AnalogPin, RobotWire
from robot_bench.recording.recorder import Recorder
from robot_bench.recording.transfers import hear_bus
from robot_bench.scenario.hands.actions import WHEELS, Action
from robot_bench.scenario.scenario import Scenario
from robot_bench.wires.nets import Harness, Net, Strength
from robot_bench.wires.ports import LeadingChip
from robot_bench.wires.power_up import power_up
from simbase.errors import UsageError
from simbase.timing import Nanos

if TYPE_CHECKING:
    from bluepill_sim.board import BluePill
    from bluepill_sim.program.image import Image

#: Owner of the resistors on the wires.
RESISTORS = "board"
#: Owner of the levels that are put on wires by hand.
BY_HAND = "hand"
_LOG = logger("bench")


def plug_in(scenario: Scenario, chip: LeadingChip, recorder: Recorder, world: Surroundings | None = None) -> None:
    """Attach a scenario's parts to a board, have what they tell recorded, and have them sense a world if there is one.

    Raises:
        TypeError: The chip is none that takes parts.
        ScenarioError: One cannot be attached.
    """
    board = cast("BluePill", chip)
    if not hasattr(board, "attached"):
        raise TypeError(f"a {type(chip).__name__} takes no parts: an emulated BluePill does")
    if world is not None:
        board.attached.surroundings = world
    board.attached.note_sinks.append(
        lambda at, part, what, detail: recorder.event("part", at, part, f"{what} {detail}".rstrip())
    )
    for number, spec in enumerate(scenario.parts):
        with placed(within(scenario.where or scenario.name, "part", number)):
            attach(board, spec)


def hear_usarts(chip: LeadingChip, recorder: Recorder) -> None:
    """Have all that a chip sends on any of its ports recorded."""
    chip.usart1.subscribe(recorder.usart)
    for port in ("usart2", "usart3"):
        if (other := getattr(chip, port, None)) is not None:
            other.subscribe(lambda sent, port=port: recorder.usart(sent, port))


def hear_buses(chip: LeadingChip, recorder: Recorder, buses: Sequence[str]) -> None:
    """Have recorded what goes over buses of a chip; a host is plugged into its USB where that is one of them.

    Raises:
        UsageError: The chip is none that has buses.
    """
    if buses and not hasattr(chip, "usb_serial"):
        raise UsageError(f"a {type(chip).__name__} has no buses to record", hint="an emulated BluePill does")
    for bus in buses:
        if bus == "usb":
            board = cast("BluePill", chip)
            board.usb.plug()
            board.usb_serial.subscribe(lambda sent: recorder.usart(sent, "usb"))
        else:
            recorder.transfers[bus] = hear_bus(chip, bus, recorder.events.publish)


def log_bench_event(who: str, at: Nanos, what: str, detail: str) -> None:
    """Log a line of a bench's state log."""
    log_event(_LOG, who, at, what, detail)


def boot(scenario: Scenario, image: "Image | None" = None) -> LeadingChip:
    """Return an emulated BluePill with a scenario's firmware, at its reset.

    Args:
        scenario: What it runs.
        image: Its firmware, where that was read before.

    Raises:
        MissingDependencyError: The emulator's engine is not installed.
    """
    return power_up(
        image or scenario.firmware, sram=scenario.sram, crystal_ppm=scenario.crystal_ppm,
        latency_cycles=scenario.interrupt_latency_cycles, seed=scenario.seed,
    )  # fmt: skip


def pins_of(scenario: Scenario) -> dict[str, str]:
    """Return the chip's pin of each wire of a scenario."""
    if scenario.own_robot is None:
        return {wire.name: wire.bluepill for wire in load_pinout().wires}
    return {wire.name: wire.pin for wire in scenario.own_robot.robot.signals if not wire.is_analog}


def cut_wires(scenario: Scenario, pinout: Pinout) -> frozenset[str]:
    """Return the wires of a pin-out that a scenario's robot does not drive."""
    return frozenset(wire.name for wire in pinout.wires if wire.role.value in scenario.outside)


def make_own_harness(signals: Sequence[RobotWire]) -> Harness:
    """Return the wires of a robot on own pins, with the resistors that hang on them."""
    harness = Harness(Net(wire.name) for wire in signals if not wire.is_analog)
    for wire in signals:
        if wire.pull is not None:
            harness[wire.name].drive(RESISTORS, wire.pull, Strength.PULL, 0)
    return harness


def make_harness(pinout: Pinout) -> Harness:
    """Return the wires of a pin-out, with the resistors that hang on them."""
    harness = Harness(Net(wire.name, idle=wire.idle) for wire in pinout.wires)
    for wire in pinout.wires:
        if wire.pull is not Pull.NONE:
            harness[wire.name].drive(RESISTORS, wire.pull is Pull.UP, Strength.PULL, 0)
    return harness


def do_by_hand(action: Action, chip: LeadingChip, harness: Harness, body: RobotBody) -> None:
    """Have a hand do something, now.

    Raises:
        WorldError: The robot is carried to where there is no room.
        UsageError: It is driven, and is there.
    """
    if action.pose is not None:
        body.stand_at(action.pose.x_m, action.pose.y_m, action.pose.heading_rad)
    elif action.place == WHEELS:
        hand_driven(body).drive_by_hand(action.speeds)
    elif action.do == "type":
        getattr(chip, action.place).receive(action.text)
    elif action.do == "set_volts":
        cast("AnalogPin", chip.pin(action.place)).set_volts(action.volts)
    elif action.place not in [net.name for net in harness]:
        chip.pin(action.place).drive(action.level)
    elif action.level is None:
        harness[action.place].release(BY_HAND, action.at)
    else:
        harness[action.place].drive(BY_HAND, action.level, Strength.PUSH_PULL, action.at)
