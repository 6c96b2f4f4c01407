"""The tables of a scenario file, a record each: the one declaration of every key with its type, range, default and use.

Reader, JSON schema, page of keys (docs/scenarios.md) and completion are made of these. The tables of `[[obstacle]]`,
`[[fault]]`, `[[when]]`, `[[hand]]`, `[[part]]` and of each kind of `[[goal]]` stand beside what reads them.
"""

import math
from collections.abc import Mapping
from dataclasses import field, fields, replace
from typing import Annotated, Any, Literal, TypeVar

from adapter_sim.codec import BitOrder
from adapter_sim.settings import AdapterSettings, EncoderAtOpen, MotorCommand, MotorMeaning
from p2os.pioneer.body.factory import BEST, BODY_CHOICES
from p2os.pioneer.body.factory import GROUP as BODY_GROUP
from p2os.pioneer.controller import SonarPerSip
from p2os.pioneer.world import Pose
from p2os.pioneer.world.file import in_range
from p2os.toml_record import Record, given, keys_of, sections
from p2os.toml_schema import LONGEST_S, Key, Table, Variants
from robot_bench.direct.robot import DirectSettings
from robot_bench.scenario.fault_script import FaultTable
from robot_bench.scenario.goals.judging import GoalTable
from robot_bench.scenario.goals.kinds import every_kind
from robot_bench.scenario.hands.doing import ACTION_TABLES
from robot_bench.scenario.hands.timed import HAND_TABLES, TimedHandTable
from robot_bench.scenario.included_files import IncludeTable
from robot_bench.scenario.plugged_parts import PartTable
from robot_bench.scenario.sweep import LARGEST_SEED
from robot_bench.scenario.trigger_script import WhenTable
from robot_bench.scenario.world_script import ObstacleTable
from robot_bench.wires.line_ends import ENDS
from robot_bench.wires.power_up import RANDOM_SRAM, ZEROS
from simbase.timing import NS_PER_MS

T = TypeVar("T", DirectSettings, AdapterSettings)

#: Of a list's table: the robot of several that it is for.
ROBOT = Key(name="robot", kind="text", doc="of [several robots](#several-robots) the one that it is for")
#: Of a scenario, and of a campaign.
GOALS = Key(
    variants=Variants("kind", GoalTable, lambda: {name: kind.table for name, kind in every_kind().items()}),
    beside=(ROBOT,), doc="what the run [has to show](scenarios.md#goal-what-the-run-has-to-show)",
)  # fmt: skip
Mode = Literal["direct", "adapter"]
_FIRMWARE = Key(doc="a file beside the scenario, or a [program that ships](#programs-that-ship)")
_Step = Annotated[float | None, Key(least=0.001, most=10_000, doc="speed of a step of the motor wires")]
_Time = Annotated[int | None, Key(least=1, most=60_000, doc="see [adapter.md](adapter.md)")]
_Period = Annotated[int | None, Key(least=1, most=60_000, doc="how often the robot sets these wires")]
_Command = Annotated[MotorCommand | None, Key(doc="how the motor wires carry a value")]
_Order = Annotated[BitOrder | None, Key(doc="which motor wire carries the most significant bit")]
_Threshold = Annotated[
    float | None, Key(above=0, most=100, doc="nearer counts as an obstacle on DD1–DD8; unset half the sonar range")
]


class StartTable(Record):
    """`[start]`: where the robot begins."""

    x_m: Annotated[float, in_range("x_m", doc="its place in the world")]
    y_m: Annotated[float, in_range("y_m", doc="its place in the world")]
    heading_deg: Annotated[float, in_range("heading_deg", doc="counter-clockwise")] = 0.0

    @property
    def pose(self) -> Pose:
        """The place and heading."""
        return Pose(x_m=self.x_m, y_m=self.y_m, heading_rad=math.radians(self.heading_deg))


class DirectTable(Record):
    """`[direct]`: the robot on the chip's pins, mode A."""

    step_mm_s: _Step = None
    ramp_mm_s2: Annotated[float | None, Key(least=0, most=1_000_000, doc="of the wheels; 0 for none")] = None
    sensor_period_ms: _Period = None
    encoder_period_ms: _Period = None
    motor_command: _Command = None
    bit_order: _Order = None

    @property
    def settings(self) -> DirectSettings:
        """What the robot is made with."""
        found = _in_units_of(DirectSettings(), self)
        return replace(found, ramp_um_per_s2=found.ramp_um_per_s2 or None)


class AdapterTable(Record):
    """`[adapter]`: the adapter between chip and robot, mode B."""

    core: Annotated[str, Key(
        choices=ENDS["adapter"].ships, group=ENDS["adapter"].group,
        doc="or [your own](bench.md#a-body-an-adapter-a-controller-of-your-own)",
    )] = "model"  # fmt: skip
    step_mm_s: _Step = None
    motor_command: _Command = None
    bit_order: _Order = None
    motor_meaning: Annotated[MotorMeaning | None, Key(doc="what the two motor values are")] = None
    max_velocity_mm_s: Annotated[int | None, Key(least=0, most=32_767, doc="cap of what is sent")] = None
    max_rotation_deg_s: Annotated[int | None, Key(least=0, most=32_767, doc="cap of what is sent")] = None
    encoder_at_open: Annotated[EncoderAtOpen | None, Key(doc="where the encoders stand as a session opens")] = None
    stop_unknown_robot: Annotated[bool | None, Key(doc="whether a robot of unknown state is stopped too")] = None
    connect_after_ms: _Time = None
    disconnect_after_ms: _Time = None
    pair_spacing_ms: _Time = None
    refresh_ms: _Time = None
    pulse_ms: _Time = None
    liveness_ms: _Time = None
    retry_ms: _Time = None
    plausibility_ms: _Time = None
    distance_stale_ms: _Time = None
    encoder_dwell_ms: _Time = None

    def settings(self, threshold_um: int) -> AdapterSettings:
        """Return what the adapter is made with.

        Raises:
            UsageError: They do not go together.
        """
        return _in_units_of(AdapterSettings(threshold_um=threshold_um), self)


class ControllerTable(Record):
    """`[controller]`: the virtual robot's own firmware."""

    kind: Annotated[str, Key(
        choices=ENDS["controller"].ships, group=ENDS["controller"].group, doc="or your own",
    )] = "pioneer"  # fmt: skip
    name: Annotated[str | None, Key(doc="what it calls itself")] = None
    sonar_per_sip: Annotated[SonarPerSip | None, Key(doc="how many sonar a packet tells")] = None
    errors: Annotated[str | None, Key(doc="`ideal`, `realistic` or a TOML file beside the scenario")] = None
    flash: Annotated[str | None, Key(doc="a TOML file, see [pioneer.md](pioneer.md)")] = None


class InWorldTable(Record):
    """`[in_world.NAME]`: what is otherwise in one world."""

    threshold_m: _Threshold = None
    duration_s: Annotated[float | None, Key(above=0, most=LONGEST_S, doc="virtual time of the run")] = None
    start: Annotated[StartTable | None, Key(doc="where the robot begins")] = None


class OwnTable(Record):
    """What each of several robots has for itself, and the one robot of a scenario at its top."""

    mode: Annotated[
        Mode | None, Key(doc="`adapter` is mode B, `direct` mode A; unset `adapter`, of a robot on own pins `direct`")
    ] = None
    threshold_m: _Threshold = None
    usart_baud: Annotated[int | None, Key(
        least=1, most=4_500_000, doc="speed of USART1's far end, bit/s: characters from a USART too far off arrive "
        "damaged; unset follows the firmware; option `--usart-baud`",
    )] = None  # fmt: skip
    pins: Annotated[Mapping[str, object] | None, Key(
        doc="of a robot on your own pins: signal = pin of the BluePill, where it is another than its file says"
    )] = None  # fmt: skip
    charge: Annotated[float | None, Key(
        least=0, most=1, doc="of a robot on your own pins: how much of its battery is left as the run begins"
    )] = None  # fmt: skip
    direct: Annotated[DirectTable, Key(doc="mode A")] = field(default_factory=DirectTable)
    adapter: Annotated[AdapterTable, Key(doc="mode B, see [adapter.md](adapter.md)")] = field(
        default_factory=AdapterTable
    )
    controller: Annotated[ControllerTable, Key(doc="the virtual robot's own firmware")] = field(
        default_factory=ControllerTable
    )
    record: Annotated[tuple[str, ...], Key(
        doc='buses of the chip whose transfers are [events](bench.md#events) too: `["spi1", "i2c1"]` of `spi1` `spi2` '
        "`i2c1` `i2c2` `can` `usb`; option `--record` adds to them"
    )] = ()  # fmt: skip


class EachRobotTable(OwnTable):
    """`[[robot]]`: one of several robots."""

    name: Annotated[str, Key(doc="what goals and messages call it")]
    model: Annotated[str, Key(doc="as `robot` of a file with one robot")] = "p2dx"
    firmware: Annotated[str | None, _FIRMWARE] = None
    x_m: Annotated[float | None, in_range("x_m", doc="its place in the world")] = None
    y_m: Annotated[float | None, in_range("y_m", doc="its place in the world")] = None
    heading_deg: Annotated[float | None, in_range("heading_deg", doc="counter-clockwise")] = None


class TopTable(OwnTable, IncludeTable):
    """The top of the file."""

    description: Annotated[str, Key(doc="one sentence")] = ""
    firmware: Annotated[str, _FIRMWARE]
    world: Annotated[str, Key(doc="a world that ships, or a world file beside the scenario")]
    robot: Annotated[str, Key(
        doc="a robot model, or a [file](pioneer.md) of one beside the scenario; or a [robot on your own pins]"
        "(own-robot.md), by its name or a TOML file beside the scenario; or [several](#several-robots)"
    )] = "p2dx"  # fmt: skip
    body: Annotated[str, Key(
        choices=BODY_CHOICES, group=BODY_GROUP, doc="by name ([which one](pioneer.md#bodies)), "
        "or `best`: the first of these that is installed; or "
        "[your own](bench.md#a-body-an-adapter-a-controller-of-your-own)",
    )] = BEST  # fmt: skip
    seed: Annotated[int, Key(least=0, most=LARGEST_SEED, doc="of everything random")] = 0
    seeds: Annotated[str | None, Key(doc='those that `p2os run` [takes](#many-runs): `"0-99"`, `"1,5,10-19"`')] = None
    sweep: Annotated[Mapping[str, object] | None, Key(doc="parameters, each with the values that it takes")] = None
    duration_s: Annotated[float, Key(above=0, most=LONGEST_S, doc="virtual time of the run")]
    outside: Annotated[str, Key(
        doc='`"distance"`, `"encoder"` or `"distance encoder"`: wires to the chip that the robot does not drive; ROS '
        "does, see [ros.md](ros.md#a-firmware-under-ros)"
    )] = ""  # fmt: skip
    sram: Annotated[str, Key(
        choices=(ZEROS, RANDOM_SRAM), doc="what the chip's SRAM holds when power comes up: zeros, or random bytes by "
        "the `seed`, as a real one's does; a program that uses a variable before it was set shows so",
    )] = ZEROS  # fmt: skip
    crystal_ppm: Annotated[int, Key(
        least=-1000, most=1000, doc="by how many millionths the chip's 8 MHz crystal is too fast; a program on the "
        "internal oscillator does not notice",
    )] = 0  # fmt: skip
    interrupt_latency_cycles: Annotated[int, Key(
        least=0, most=1000, doc="by how many cycles each interrupt of the chip may be late, drawn by the `seed`; above "
        "0 it needs `P2OS_CORE=exact`. A program that fails so has a [race](debugging.md#races-with-interrupts)",
    )] = 0  # fmt: skip
    gives_up_s: Annotated[float | None, Key(
        above=0, most=LONGEST_S, doc="for so long the program may go on with what it does, with nothing in sight, "
        "before it does something else; [`p2os explain`](cli.md), which takes 15 s where it is not set, says of what "
        "lasts longer that the program never leaves it. It changes nothing in a run",
    )] = None  # fmt: skip
    start: Annotated[StartTable | None, Key(doc="where the robot begins; else where the world says")] = None
    in_world: Annotated[Mapping[str, InWorldTable], Key(
        doc="what is otherwise in one world, by its name or its file beside the scenario"
    )] = field(default_factory=dict)  # fmt: skip
    obstacle: Annotated[tuple[Table, ...], Key(
        record=ObstacleTable, beside=(ROBOT,), doc="what [changes in the world](#obstacle-what-changes-during-the-run)"
    )] = ()  # fmt: skip
    part: Annotated[tuple[Table, ...], Key(
        record=PartTable, is_open=True, doc="a part [plugged into the board](parts.md) besides the robot; its pins and "
        "settings are keys too",
    )] = ()  # fmt: skip
    fault: Annotated[tuple[Table, ...], Key(
        record=FaultTable, beside=(ROBOT,), doc="[faults injected](#fault-faults-injected-during-the-run-mode-b)"
    )] = ()  # fmt: skip
    when: Annotated[tuple[Table, ...], Key(
        variants=Variants("do", WhenTable, lambda: ACTION_TABLES), beside=(ROBOT,),
        doc="what is [done when something happens](#when-what-is-done-when-something-happens)",
    )] = ()  # fmt: skip
    hand: Annotated[tuple[Table, ...], Key(
        variants=Variants("do", TimedHandTable, lambda: HAND_TABLES), beside=(ROBOT,),
        doc="what is [done at a time](#hand-what-is-done-at-a-time)",
    )] = ()  # fmt: skip
    goal: Annotated[tuple[Table, ...], GOALS] = ()


#: Every table of a scenario file and its keys, but those of the kinds of `[[goal]]` and `[[when]]`.
TABLES: Mapping[str, tuple[Key, ...]] = {**dict(sections(TopTable)), "[[robot]]": keys_of(EachRobotTable)}


def _in_units_of(settings: T, table: Record) -> T:
    """Return settings with what a table says otherwise, its milliseconds as ns and its mm/s as µm/s."""
    there = {one.name for one in fields(settings)}
    values: dict[str, Any] = {}
    for name, value in given(table):
        if name in there:
            values[name] = value
        elif name.endswith("_ms"):
            values[f"{name.removesuffix('_ms')}_ns"] = value * NS_PER_MS
        elif "_mm_s" in name:
            values[name.replace("_mm_s", "_um_per_s")] = round(value * 1000)
    return replace(settings, **values)
