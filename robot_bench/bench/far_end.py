"""What stands at the far end of a bench's wires and owns the robot's body.

    mode A, direct     motors, encoders, sensors ─ body      (of a Pioneer, or a robot on own pins)
    mode B, adapter    adapter ─ lines at 9600 8N1 ─ controller ─ body

Invariant: all that these parts tell goes to the recorder.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import cast

from adapter_sim.pinout import Pinout, WireRole
from p2os.errors import ScenarioError
from p2os.pioneer.body.contract import RobotBody
from p2os.pioneer.controller import Pioneer
from p2os.toml_schema import within
from robot_bench.adapter import AnyAdapter, make_adapter
from robot_bench.bench.board import cut_wires
from robot_bench.direct import DirectRobot, DistanceSensors, JointMotor, WheelEncoder
from robot_bench.direct.wired import AnalogPin
from robot_bench.recording.client_view import SipRanges
from robot_bench.recording.recorder import Recorder
from robot_bench.scenario.scenario import Scenario
from robot_bench.scenario.wired_robots import WiredPart
from robot_bench.wires.endpoints import Endpoint
from robot_bench.wires.line_ends import ENDS, AdapterPart, ControllerPart
from robot_bench.wires.nets import Harness, Net, OwnedPins, Unconnected
from robot_bench.wires.ports import LeadingChip
from robot_bench.wires.serial_line import SerialLine
from simbase.timing import Nanos


@dataclass(frozen=True, slots=True, kw_only=True)
class FarEnd:
    """Who is brought forward there, in this order, and who they are."""

    robots: tuple[DirectRobot | Endpoint | WiredPart, ...]
    adapter: AdapterPart | None = None
    controller: ControllerPart | None = None
    #: Both directions of the P2OS line; none in mode A.
    lines: tuple[SerialLine, ...] = ()
    #: The ranges as a client of the line has them.
    ranges: SipRanges | None = None


def make_far_end(
    scenario: Scenario,
    pinout: Pinout,
    body: RobotBody,
    chip: LeadingChip,
    harness: Harness,
    recorder: Recorder,
    *,
    is_among_others: bool,
) -> FarEnd:
    """Return what a scenario has at the far end of its wires.

    Args:
        scenario: What it asks for.
        pinout: Of the wires to a Pioneer.
        body: What moves.
        chip: Its analog pins are those of a robot on own pins.
        harness: The wires.
        recorder: Gets all.
        is_among_others: Whether other robots are in its world.

    Raises:
        ScenarioError: Its mode has not what it asks for.
    """
    if not scenario.has_robot:
        return FarEnd(robots=())
    if scenario.own_robot is not None:
        pins = {wire.name: wire.pin for wire in scenario.own_robot.robot.signals}
        robot = scenario.own_robot.build(body, harness, lambda signal: cast("AnalogPin", chip.pin(pins[signal])))
        robot.on_event, robot.on_ranges = recorder.listener("robot"), recorder.sonar
        return FarEnd(robots=(robot,))
    if scenario.mode == "direct":
        _refuse_faults(scenario)
        return FarEnd(robots=(_direct_robot(scenario, pinout, body, harness, recorder),))
    return _ends_of_line(scenario, pinout, body, harness, recorder, is_among_others=is_among_others)


def _refuse_faults(scenario: Scenario) -> None:
    where = scenario.where or scenario.name
    places = [within(where, "fault", 0)] if scenario.faults else []
    places += [within(where, "when", number) for number, when in enumerate(scenario.triggers) if when.doing.faults]
    places += [within(where, "hand", number) for number, hand in enumerate(scenario.hands) if hand.doing.faults]
    if places:
        raise ScenarioError(
            f"{places[0]}: a fault acts on the robot's controller, and mode direct has none", hint="--mode adapter"
        )


def _direct_robot(
    scenario: Scenario, pinout: Pinout, body: RobotBody, harness: Harness, recorder: Recorder
) -> DirectRobot:
    settings = scenario.direct

    def nets(value: str) -> list[Net]:
        return [harness[name] for name in pinout.value(value).wires]

    def motor(value: str) -> JointMotor:
        return JointMotor(
            nets(value), step_um_per_s=settings.step_um_per_s, ramp_um_per_s2=settings.ramp_um_per_s2,
            dt_ns=body.dt_ns, bit_order=settings.bit_order, command=settings.motor_command,
        )  # fmt: skip

    wires = pinout.with_role(WireRole.DISTANCE)
    cut = cut_wires(scenario, pinout)

    def driven(names: Iterable[str]) -> list[Net | Unconnected]:
        return [Unconnected() if name in cut else harness[name] for name in names]

    def encoder(value: str) -> WheelEncoder:
        return WheelEncoder(driven(pinout.value(value).wires))

    sensors = DistanceSensors(
        driven(wire.name for wire in wires),
        threshold_um=scenario.threshold_um, period_ns=settings.sensor_period_ns,
    )  # fmt: skip
    sensors.on_sample = recorder.sonar
    robot = DirectRobot(
        body, left=motor("motor1"), right=motor("motor2"),
        encoders=(encoder("encoder1"), encoder("encoder2")),
        sensors=sensors, sonar_numbers=range(len(wires)), encoder_period_ns=settings.encoder_period_ns,
    )  # fmt: skip
    robot.on_event = recorder.listener("direct")
    return robot


def _ends_of_line(
    scenario: Scenario, pinout: Pinout, body: RobotBody, harness: Harness, recorder: Recorder, *, is_among_others: bool
) -> FarEnd:
    parameters = scenario.parameters
    to_robot, to_client = SerialLine(), SerialLine()
    pins = OwnedPins(harness, "adapter", cut_wires(scenario, pinout))
    adapter = make_adapter(scenario, pins, pinout)
    adapter.on_event = recorder.listener("adapter")
    profile = scenario.controller.family_of(parameters)
    settings = replace(scenario.controller, profile=profile, baud=to_client.baud, seed=scenario.seed)
    kind = scenario.controller_kind
    controller: ControllerPart
    if kind in ENDS["controller"].ships:
        controller = Pioneer(parameters=parameters, body=body, settings=settings)
    else:
        controller = ENDS["controller"].make(kind, parameters=parameters, body=body, settings=settings)
    controller.on_event = recorder.listener("pioneer")
    ranges = SipRanges(parameters, profile, on_ranges=recorder.sonar)

    def arrives_at_client(data: bytes, at: Nanos) -> None:
        recorder.wire("r2c", data, at)
        ranges.take(data, at)

    at_client = Endpoint(
        adapter, incoming=to_client, outgoing=to_robot, on_arrival=arrives_at_client,
        first_sight=adapter.first_sight if isinstance(adapter, AnyAdapter) else None,
    )  # fmt: skip
    at_robot = Endpoint(
        controller,
        incoming=to_robot,
        outgoing=to_client,
        on_arrival=lambda data, at: recorder.wire("c2r", data, at),
        # Among others it measures where all of them are then: none of its pings may come late.
        next_due=controller.next_due if is_among_others and isinstance(controller, Pioneer) else None,
    )
    return FarEnd(
        robots=(at_client, at_robot), adapter=adapter, controller=controller, lines=(to_robot, to_client), ranges=ranges
    )
