"""A scenario file: which program, in which world, what happens, what is wanted.

TOML, checked key by key; units stand in the keys. `docs/scenarios.md` lists
every key. Files that are named in it are looked for beside it, then among those
that ship.

Invariant: a `Scenario` that exists can be run: its firmware and its world are
there, and every value is in range.
"""

import math
import numbers
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib.resources import files
from pathlib import Path
from typing import Any, TypedDict, Unpack, cast

from adapter_sim.codec import BitOrder
from adapter_sim.pinout import WireRole, load_pinout
from adapter_sim.settings import AdapterSettings, MotorCommand
from bluepill_sim.parts.registry import PartSpec
from p2os.errors import ScenarioError
from p2os.pioneer.body.factory import BEST, BODY_CHOICES, body_class, may_ship
from p2os.pioneer.body.factory import GROUP as BODY_GROUP
from p2os.pioneer.controller import ControllerSettings, SonarPerSip
from p2os.pioneer.controller.flash import load_flash
from p2os.pioneer.sensor_errors import load_sensor_errors
from p2os.pioneer.world import Pose, known_worlds, load_world, world_suffixes
from p2os.pioneer.world.file import in_range
from p2os.pioneer.world.model import World
from p2os.pioneer.world.start_places import refuse_start, start_places
from p2os.robots.parameters import RobotParameters, load_parameters
from p2os.toml_file import is_file
from p2os.toml_schema import LONGEST_S, Key, Table, TablePlace, Where, check_table, placed, within
from robot_bench.direct.robot import DirectSettings
from robot_bench.events.selection import BUSES, bus_of
from robot_bench.scenario import fault_script, plugged_parts, when_script, world_script
from robot_bench.scenario.fault_script import FaultChange, load_faults
from robot_bench.scenario.goals.judging import Goal, load_goal
from robot_bench.scenario.included_files import KEYS as INCLUDING
from robot_bench.scenario.included_files import (
    VERSION,
    ScenarioTable,
    Setting,
    read_tables,
    shipped_file,
    shipped_scenarios,
)
from robot_bench.scenario.several_robots import robot_keys, split
from robot_bench.scenario.sweep import LARGEST_SEED, SweptParameter, load_axes, load_seeds
from robot_bench.scenario.when_script import When, load_whens
from robot_bench.scenario.wired_robots import OwnRobot, find_own_robot, known_own_robots, load_own_robot
from robot_bench.scenario.world_script import ScriptedChange, load_changes, refuse_names
from robot_bench.wires.line_ends import ENDS
from robot_bench.wires.power_up import RANDOM_SRAM, ZEROS
from simbase.errors import FileError, UsageError, nearest, shown, shown_name
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos
from simbase.trust import Code, Trust, UntrustedError, own_code
from simbase.user_classes import source_of

MODES = ("direct", "adapter")
#: The kinds of wires that may be cut from the robot, for something outside to drive: those to the chip.
OUTSIDE = (WireRole.DISTANCE.value, WireRole.ENCODER.value)

_TOP = (
    VERSION,
    *INCLUDING,
    Key(name="description", kind="text"),
    Key(name="firmware", kind="text", required=True),
    Key(name="world", kind="text", required=True),
    Key(name="robot", kind="text"),
    Key(name="pins", kind="table"),
    Key(name="mode", kind="text", choices=MODES),
    Key(name="body", kind="text", choices=BODY_CHOICES, group=BODY_GROUP),
    Key(name="seed", kind="whole", least=0, most=LARGEST_SEED),
    Key(name="seeds", kind="text"),
    Key(name="sweep", kind="table"),
    Key(name="duration_s", kind="number", required=True, above=0, most=LONGEST_S),
    Key(name="threshold_m", kind="number", above=0, most=100),
    Key(name="usart_baud", kind="whole", least=1, most=4_500_000),
    Key(name="record", kind="texts"),
    Key(name="outside", kind="text"),
    Key(name="sram", kind="text", choices=(ZEROS, RANDOM_SRAM)),
    Key(name="crystal_ppm", kind="whole", least=-1000, most=1000),
    Key(name="gives_up_s", kind="number", above=0, most=LONGEST_S),
    Key(name="start", kind="table"),
    Key(name="direct", kind="table"),
    Key(name="adapter", kind="table"),
    Key(name="controller", kind="table"),
    Key(name="in_world", kind="table"),
    Key(name="obstacle", kind="tables"),
    Key(name="part", kind="tables"),
    Key(name="fault", kind="tables"),
    Key(name="when", kind="tables"),
    Key(name="goal", kind="tables"),
)
_START = (
    in_range("x_m", required=True),
    in_range("y_m", required=True),
    in_range("heading_deg"),
)
_DIRECT = (
    Key(name="step_mm_s", kind="number", least=0.001, most=10_000),
    Key(name="ramp_mm_s2", kind="number", least=0, most=1_000_000),
    Key(name="sensor_period_ms", kind="whole", least=1, most=60_000),
    Key(name="encoder_period_ms", kind="whole", least=1, most=60_000),
    Key(name="motor_command", kind="text", choices=tuple(MotorCommand)),
    Key(name="bit_order", kind="text", choices=tuple(BitOrder)),
)
#: Times of the adapter that a scenario may set, as in `AdapterSettings`, in ms.
_ADAPTER_TIMES = (
    "connect_after_ms", "disconnect_after_ms", "pair_spacing_ms", "refresh_ms", "pulse_ms", "liveness_ms", "retry_ms",
    "plausibility_ms", "distance_stale_ms", "encoder_dwell_ms",
)  # fmt: skip
_ADAPTER = (
    Key(name="core", kind="text", choices=ENDS["adapter"].ships, group=ENDS["adapter"].group),
    Key(name="step_mm_s", kind="number", least=0.001, most=10_000),
    Key(name="motor_command", kind="text", choices=tuple(MotorCommand)),
    Key(name="bit_order", kind="text", choices=tuple(BitOrder)),
    Key(name="motor_meaning", kind="text", choices=("wheels", "linear_angular")),
    Key(name="max_velocity_mm_s", kind="whole", least=0, most=32_767),
    Key(name="max_rotation_deg_s", kind="whole", least=0, most=32_767),
    Key(name="encoder_at_open", kind="text", choices=("zero", "continue")),
    Key(name="stop_unknown_robot", kind="flag"),
    *(Key(name=name, kind="whole", least=1, most=60_000) for name in _ADAPTER_TIMES),
)
_CONTROLLER = (
    Key(name="kind", kind="text", choices=ENDS["controller"].ships, group=ENDS["controller"].group),
    Key(name="name", kind="text"),
    Key(name="sonar_per_sip", kind="text", choices=tuple(member.value for member in SonarPerSip)),
    Key(name="errors", kind="text"),
    Key(name="flash", kind="text"),
)
#: What a scenario may set otherwise for one world.
_IN_WORLD = (
    Key(name="threshold_m", kind="number", above=0, most=100),
    Key(name="duration_s", kind="number", above=0, most=LONGEST_S),
    Key(name="start", kind="table"),
)
#: Every table of a scenario file and its keys, but `[[goal]]`, whose keys are those of its kind (`every_kind`).
TABLES: Mapping[str, tuple[Key, ...]] = {
    "": _TOP,
    "[start]": _START,
    "[[robot]]": robot_keys(_TOP),
    "[direct]": _DIRECT,
    "[adapter]": _ADAPTER,
    "[controller]": _CONTROLLER,
    "[in_world.NAME]": _IN_WORLD,
    "[[obstacle]]": world_script.KEYS,
    "[[part]]": plugged_parts.KEYS,
    "[[fault]]": fault_script.KEYS,
    "[[when]]": tuple(key for key in when_script.KEYS if key not in world_script.KEYS),
}


class ScenarioOptions(TypedDict, total=False):
    """What a command line or a program may set otherwise than a scenario; None keeps it as it is."""

    #: An ELF, HEX or BIN file.
    firmware: str | Path | None
    #: `adapter` or `direct`.
    mode: str | None
    #: `model`, `firmware`, or one of the user's.
    adapter_core: str | None
    #: `kinematic`, `bullet`, `mujoco`, `best`, or one of the user's.
    body: str | None
    #: A shipped world's name or a file.
    world: str | None
    #: Of everything random.
    seed: int | None
    #: Virtual time of the run, seconds.
    duration_s: float | None
    #: Speed of USART1's far end, bit/s.
    usart_baud: int | None
    #: Buses of the chip that are recorded besides: names of `selection.BUSES`, or one text with commas.
    record: str | Sequence[str] | None


_TEXT, _FILE, _WHOLE = ((str,), "text"), ((str, os.PathLike), "text or path"), ((numbers.Integral,), "whole number")
#: Option → what its value is, as types and in words.
_OPTION_TYPES: Mapping[str, tuple[tuple[type, ...], str]] = {
    "firmware": _FILE, "mode": _TEXT, "adapter_core": _TEXT, "body": _TEXT, "world": _FILE, "seed": _WHOLE,
    "duration_s": ((numbers.Real,), "number"), "usart_baud": _WHOLE,
}  # fmt: skip


def _check_types(options: ScenarioOptions) -> None:
    """Raise UsageError where there is no such option, or a value is of another type."""
    for name, value in options.items():
        if name not in ScenarioOptions.__annotations__:
            raise UsageError(f"there is no option {shown(name)}", hint=nearest(name, ScenarioOptions.__annotations__))
        if value is None or name not in _OPTION_TYPES:
            continue
        types, what = _OPTION_TYPES[name]
        if not isinstance(value, types) or isinstance(value, bool):
            raise UsageError(f"{name} = {shown(value)} is no {what}")


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotPlace:
    """One of several robots of a scenario."""

    name: str
    parameters: RobotParameters
    start: Pose
    #: What its program is to do; None: it has none, and stands in the way.
    scenario: "Scenario | None"


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """Everything that a run needs to know."""

    name: str
    description: str
    #: The file's own text, for the run folder.
    text: str
    firmware: Path
    #: A shipped world's name or a file.
    world: str
    parameters: RobotParameters
    robot: str
    #: A robot that hangs on the chip's own pins; None: a Pioneer on the wires of the pin-out.
    own_robot: OwnRobot | None = None
    mode: str = "adapter"
    body: str = BEST
    seed: int = 0
    duration_ns: Nanos
    #: How long the file says; a run that is asked to be shorter leaves goals open.
    planned_ns: Nanos = 0
    threshold_um: int
    #: The speed of USART1's far end, bit/s; None follows the firmware.
    usart_baud: int | None = None
    #: Buses of the chip that are recorded, of `selection.BUSES`.
    record: tuple[str, ...] = ()
    #: Kinds of wires that the robot does not drive, but somebody outside: of `OUTSIDE`, sorted.
    outside: tuple[str, ...] = ()
    #: What the chip's SRAM holds when power comes up: `zeros`, or `random` by the seed.
    sram: str = ZEROS
    #: By how many millionths the 8 MHz crystal of the chip is too fast.
    crystal_ppm: int = 0
    #: For so long its program may go on with what it does before it does something else; None is not known, and
    #: `explain` takes what it holds for long. It changes nothing in the run.
    gives_up_s: float | None = None
    #: None starts at the world's own place.
    start: Pose | None = None
    #: What a message calls the start: file, line and key.
    start_at: str = field(default="[start]", compare=False)
    direct: DirectSettings = field(default_factory=DirectSettings)
    adapter: AdapterSettings = field(default_factory=AdapterSettings)
    adapter_core: str = "model"
    controller: ControllerSettings = field(default_factory=ControllerSettings)
    controller_kind: str = "pioneer"
    #: What is plugged into the board besides the robot.
    parts: tuple[PartSpec, ...] = ()
    changes: tuple[ScriptedChange, ...] = ()
    faults: tuple[FaultChange, ...] = ()
    whens: tuple[When, ...] = ()
    goals: tuple[Goal, ...] = ()
    #: World, as `world` names it → as the file names it, and what is otherwise there.
    in_world: Mapping[str, tuple[str, Table]] = field(default_factory=dict)
    #: Several robots in one world; what is said above is the first one's then. None: one robot.
    robots: tuple[RobotPlace, ...] = ()
    #: The seeds that `p2os run` takes one after the other; none: `seed` alone.
    seeds: tuple[int, ...] = ()
    #: The parameters that it sweeps.
    axes: tuple[SweptParameter, ...] = ()
    #: What was set beside the file.
    settings: tuple[Setting, ...] = ()
    #: The file; None: made by a program.
    path: Path | None = field(default=None, compare=False, repr=False)
    #: The file's own place, for messages.
    where: Where = field(default="", compare=False, repr=False)

    @property
    def threshold_m(self) -> float:
        """The distance below which something counts as an obstacle, metres."""
        return self.threshold_um / 1e6

    @property
    def own_classes(self) -> dict[str, str]:
        """What stands in the place of what ships: its name, and the hash of its folder, or of the file of its class."""
        named = (("body", self.body), ("adapter", self.adapter_core), ("controller", self.controller_kind))
        return {str(code): code.key for code in self.codes} | {
            name: source_of(_class_of_users(what, name))
            for what, name in named if _is_of_users(what, name) and not isinstance(name, Code)
        }  # fmt: skip

    @property
    def codes(self) -> tuple[Code, ...]:
        """The code of files that it has, of all its robots: that of bodies, adapters, controllers and parts."""
        each = self.programmed or (self,)
        named = [name for one in each for name in (one.body, one.adapter_core, one.controller_kind)]
        named += [part.kind for one in each for part in one.parts]
        return tuple({str(name): name for name in named if isinstance(name, Code)}.values())

    @property
    def programmed(self) -> "tuple[Scenario, ...]":
        """The scenarios of those of several robots that have a program; none of one robot."""
        return tuple(robot.scenario for robot in self.robots if robot.scenario is not None)

    def with_options(self, **options: Unpack[ScenarioOptions]) -> "Scenario":
        """Return the scenario with what a command line or a program sets otherwise, for each of its robots.

        Raises:
            UsageError: There is no such option, or a value cannot be.
        """
        _check_types(options)
        mode = options.get("mode")
        if mode is not None and mode not in MODES:
            raise UsageError(f"there is no mode {mode!r}", hint=" or ".join(f"--mode {word}" for word in MODES))
        body, core = (
            None if name is None else _known(what, own_code(name))
            for what, name in (("body", options.get("body")), ("adapter", options.get("adapter_core")))
        )
        duration_s, world = options.get("duration_s"), options.get("world")
        seed, usart_baud = options.get("seed"), options.get("usart_baud")
        if duration_s is not None and not 0 < duration_s < math.inf:
            raise UsageError(f"a run of {duration_s:g} s cannot be", hint="--duration takes more than 0, such as 10s")
        if seed is not None and not 0 <= seed <= LARGEST_SEED:
            raise UsageError(f"{shown(seed)} is no seed", hint=f"a whole number from 0 to {LARGEST_SEED}")
        firmware = Path(options.get("firmware") or self.firmware)
        if options.get("firmware") and not firmware.is_file():
            raise UsageError(f"there is no firmware file {firmware}", hint="give an ELF, HEX or BIN file")
        if self.robots:
            return self._each_with(options)
        if self.own_robot is not None and options.get("mode") == "adapter":
            raise UsageError(f"the robot {self.robot!r} hangs on the chip's own pins", hint="--mode direct")
        moved = self if world is None else self._moved_to(world)
        return replace(
            moved,
            record=_buses((*moved.record, *_listed(options.get("record"))), "--record", UsageError),
            firmware=firmware,
            mode=options.get("mode") or moved.mode,
            adapter_core=core or moved.adapter_core,
            body=body or moved.body,
            usart_baud=moved.usart_baud if usart_baud is None else int(usart_baud),
            seed=moved.seed if seed is None else int(seed),
            duration_ns=moved.duration_ns if duration_s is None else round(duration_s * NS_PER_S),
        )

    def _each_with(self, options: ScenarioOptions) -> "Scenario":
        """Return the scenario with options for each robot; the robots begin where the new world has room."""
        alone = replace(self, robots=()).with_options(**options)
        robots = tuple(
            replace(robot, scenario=robot.scenario and robot.scenario.with_options(**options)) for robot in self.robots
        )
        if options.get("world") is None:
            return replace(alone, robots=robots)
        given = [None] * len(robots)
        places = start_places(load_world(alone.world, seed=alone.seed), [one.parameters for one in robots], given)
        return replace(alone, robots=tuple(
            replace(robot, start=start, scenario=robot.scenario and replace(robot.scenario, start=start))
            for robot, start in zip(robots, places, strict=True)
        ))  # fmt: skip

    def _moved_to(self, world: str) -> "Scenario":
        resolve_world(world, Path(), "--world", error=UsageError)
        moved = replace(self, world=world, start=self.start if world == self.world else None)
        return _apply_in_world(moved)


def load_scenario(
    name_or_path: str, *, firmware: Path | None = None, settings: Sequence[Setting] = (), set_by: str = "--set",
    trust: bool | Trust = False,
) -> Scenario:  # fmt: skip
    """Return a shipped scenario by its name, or one from a file.

    Args:
        name_or_path: The scenario.
        firmware: Takes the place of its own program, which need not be there then.
        settings: Keys and values that are set beside the file: ("start.x_m", 1.5).
        set_by: What a message calls that.
        trust: Whether code that the file or a setting names may be executed (docs/trust.md).

    Raises:
        UntrustedError: Code is named, and nobody has said that it may be executed.
        ScenarioError: There is no such scenario, or it breaks the schema.
        UsageError: A setting names what is not there.
    """
    if name_or_path in known_scenarios():
        shipped = shipped_file(name_or_path)
        return read_scenario(shipped, firmware=firmware, settings=settings, set_by=set_by, trust=trust)
    path = Path(name_or_path)
    if not path.is_file():
        if path.suffix == ".toml" or len(path.parts) > 1:
            raise ScenarioError(f"there is no scenario file {path}")
        beside = Path(f"{name_or_path}.toml")
        hint = f"the file here is {beside}" if beside.is_file() else nearest(name_or_path, known_scenarios())
        raise ScenarioError(f"there is no scenario {name_or_path!r}", hint=hint)
    return read_scenario(path, firmware=firmware, settings=settings, set_by=set_by, trust=trust)


def known_scenarios() -> tuple[str, ...]:
    """Return the names of the scenarios that ship."""
    return shipped_scenarios()


def read_scenario(
    path: Path, *, firmware: Path | None = None, settings: Sequence[Setting] = (), set_by: str = "--set",
    trust: bool | Trust = False,
) -> Scenario:  # fmt: skip
    """Read and check a scenario file and those that it includes; arguments as of `load_scenario`.

    Raises:
        UntrustedError: As of `load_scenario`.
        ScenarioError: A file cannot be read or breaks the schema.
        UsageError: A setting names what is not there.
    """
    found = read_tables(path, settings, set_by)
    scenario = build_scenario(found, path, firmware=firmware, settings=settings, trust=trust)
    _refuse_what_never_comes(found, path, settings)
    return scenario


def _refuse_what_never_comes(found: ScenarioTable, path: Path, settings: Sequence[Setting]) -> None:
    """Refuse what a file says of worlds that there are not, and of times after its end.

    A run that is cut short beside the file leaves out what would have come later.
    """
    where, table = TablePlace(found.source), found.table
    worlds = cast("Mapping[str, Table]", table.get("in_world", {}))
    for world in worlds:
        resolve_world(world, path.parent, str(within(where, f"in_world.{world}")))
    if "duration_s" in dict(settings):
        return
    longest_s = max(cast("float", part["duration_s"]) for part in (table, *worlds.values()) if "duration_s" in part)
    for kind in ("obstacle", "fault"):
        for number, item in enumerate(cast("list[Table]", table.get(kind, []))):
            if cast("float", item["at_s"]) >= longest_s:
                raise ScenarioError(
                    f"{within(where, kind, number)}: at_s = {item['at_s']}: the run is over by then",
                    hint=f"duration_s is {longest_s:g}",
                )


def build_scenario(
    found: ScenarioTable, path: Path, *, firmware: Path | None = None, settings: Sequence[Setting] = (),
    trust: bool | Trust = False,
) -> Scenario:  # fmt: skip
    """Check a scenario's tables and return the scenario.

    Args:
        found: The tables, and what messages call their places.
        path: What is named in them is looked for beside it; it need not be there.
        firmware: As of `load_scenario`.
        settings: Those of the tables' keys that were set beside the file.
        trust: As of `load_scenario`.

    Raises:
        UntrustedError: As of `load_scenario`.
        ScenarioError: They break the schema.
    """
    build = _build_several if isinstance(found.table.get("robot"), list) else _build
    scenario = build(found.table, found.text, path, TablePlace(found.source), firmware, Trust.of(trust))
    kept = tuple(axis for axis in scenario.axes if axis.key not in dict(settings))
    scenario = replace(scenario, settings=tuple(settings), axes=kept, path=path)
    for one in scenario.programmed or (scenario,):
        refuse_what_its_world_refuses(one, load_world(scenario.world, seed=scenario.seed))
    return scenario


def _outside(words: str, own_robot: OwnRobot | None, where: str) -> tuple[str, ...]:
    """Return the kinds of wires that words name, such as "distance encoder"."""
    found = tuple(sorted(set(words.replace(",", " ").split())))
    unknown = [word for word in found if word not in OUTSIDE]
    if unknown:
        raise ScenarioError(
            f"{where}: no wires are called {shown(unknown[0])}", hint=f'outside = "{" ".join(OUTSIDE)}"'
        )
    if found and own_robot is not None:
        raise ScenarioError(f"{where}: only wires of the pin-out can be driven from outside", hint="leave out `robot`")
    return found


def resolve_world(
    world: str, folder: Path, where: str, *, error: type[ScenarioError | UsageError] = ScenarioError
) -> str:
    """Return a shipped world's name or the path of a world file.

    Raises:
        ScenarioError: There is no such world.
        UsageError: Likewise, where `error` says so.
    """
    if world in known_worlds():
        return world
    path = _world_file(world, folder)
    if path is None:
        raise error(f"{where}: there is no world {shown(world)}", hint=nearest(world, known_worlds()))
    if not is_file(path):
        raise error(
            f"{where}: there is no world file {shown_name(path)}", hint=f"worlds that ship: {', '.join(known_worlds())}"
        )
    return str(path)


def _world_file(world: str, folder: Path) -> Path | None:
    """Return the file that a world names, there or not; None where it is a word."""
    is_word = world in known_worlds() or Path(world).suffix.lower() not in world_suffixes()
    return None if is_word else folder / world


def refuse_what_its_world_refuses(scenario: Scenario, world: World) -> None:
    """Refuse a start beyond the floor or inside a thing, and changes that the world's own things do not allow.

    Raises:
        ScenarioError: So it is; the message names the thing.
    """
    start, at = (scenario.start, scenario.start_at) if scenario.start else (world.start, world.start_at)
    refuse_start(world, scenario.parameters, start, at, error=ScenarioError)
    refuse_names(scenario.changes, world)


def _build(table: Table, text: str, path: Path, where: TablePlace, firmware: Path | None, trust: Trust) -> Scenario:
    check_table(table, _TOP, where)
    robot = str(table.get("robot", "p2dx"))
    own_robot = _own_robot(robot, table, path, where)
    parameters = own_robot.robot.parameters if own_robot else _parameters(robot, path, where)
    threshold_m = cast("float", table.get("threshold_m", parameters.sonar_range_m / 2))
    in_world = cast("Mapping[str, Table]", table.get("in_world", {}))
    for world, part in in_world.items():
        check_table({world: part}, (Key(name=world, kind="table"),), within(where, "in_world"))
        check_table(part, _IN_WORLD, within(where, f"in_world.{world}"))
        _start(part, where, f"in_world.{world}.start")
    changes = load_changes(cast("list[Table]", table.get("obstacle", [])), parameters, where)
    wires = own_robot.wires if own_robot else None
    goals = [
        load_goal(goal, within(where, "goal", number), wires)
        for number, goal in enumerate(cast("list[Table]", table.get("goal", [])))
    ]
    scenario = Scenario(
        name=path.stem,
        description=str(table.get("description", "")),
        text=text,
        firmware=firmware or _firmware(str(table["firmware"]), path, where),
        world=resolve_world(str(table["world"]), path.parent, f"{where.at('world')}: world"),
        parameters=parameters,
        robot=robot,
        own_robot=own_robot,
        mode=str(table.get("mode", "direct" if own_robot else "adapter")),
        body=_named(table, "body", "body", BEST, path, where, trust),
        seed=cast("int", table.get("seed", 0)),
        duration_ns=(planned_ns := round(cast("float", table["duration_s"]) * NS_PER_S)),
        planned_ns=planned_ns,
        threshold_um=round(threshold_m * 1e6),
        usart_baud=cast("int | None", table.get("usart_baud")),
        record=_buses(_listed(table.get("record")), where.at("record"), ScenarioError),
        outside=_outside(str(table.get("outside", "")), own_robot, where.at("outside")),
        sram=str(table.get("sram", ZEROS)),
        crystal_ppm=cast("int", table.get("crystal_ppm", 0)),
        gives_up_s=cast("float | None", table.get("gives_up_s")),
        start=_start(table, where),
        start_at=str(within(where, "start")),
        direct=_direct(cast("Table", table.get("direct", {})), where),
        adapter=_adapter(cast("Table", table.get("adapter", {})), round(threshold_m * 1e6), where),
        adapter_core=_named(
            table.get("adapter", {}), "core", "adapter", "model", path, within(where, "adapter"), trust
        ),
        controller=_controller(cast("Table", table.get("controller", {})), path, where),
        controller_kind=_named(
            table.get("controller", {}), "kind", "controller", "pioneer", path, within(where, "controller"), trust
        ),
        parts=plugged_parts.load_parts(
            cast("list[Table]", table.get("part", [])), path.parent, _taken(own_robot), where, trust
        ),
        changes=changes,
        seeds=load_seeds(table, where.at("seeds")),
        axes=load_axes(cast("Table", table.get("sweep", {})), where),
        faults=load_faults(cast("list[Table]", table.get("fault", [])), parameters, where),
        whens=load_whens(cast("list[Table]", table.get("when", [])), parameters, where, wires),
        goals=tuple(goals),
        in_world={str(_world_file(world, path.parent) or world): (world, part) for world, part in in_world.items()},
        where=where,
    )
    _refuse_unrecorded(scenario, table, where)
    scenario = _apply_in_world(scenario)
    _refuse_goals_beyond_the_end(scenario, where)
    return scenario


def _refuse_goals_beyond_the_end(scenario: Scenario, where: TablePlace) -> None:
    """Refuse goals that would look at nothing, and so be met by any run."""
    for number, goal in enumerate(scenario.goals):
        begin = goal.arguments.get("from_s", 0)
        if "after" not in goal.arguments and cast("float", begin) * NS_PER_S >= scenario.planned_ns:
            raise ScenarioError(
                f"{within(where, 'goal', number)}: from_s = {begin}: the run is over by then",
                hint=f"duration_s is {scenario.planned_ns / NS_PER_S:g}",
            )


def _listed(names: object) -> tuple[str, ...]:
    """Return names that are given as a list, or as a text with commas."""
    if isinstance(names, str):
        return tuple(filter(None, (name.strip() for name in names.split(","))))
    return tuple(map(str, cast("Sequence[object]", names or ())))


def _buses(names: Sequence[str], where: str, error: type[ScenarioError | UsageError]) -> tuple[str, ...]:
    """Return buses, each once, in the order of the table; the error names one that there is not."""
    for name in names:
        if name not in BUSES:
            raise error(f"{where}: there is no bus {shown(name)}", hint=f"one of {', '.join(BUSES)}")
    return tuple(bus for bus in BUSES if bus in names)


def _refuse_unrecorded(scenario: Scenario, table: Table, where: TablePlace) -> None:
    """Refuse goals and `[[when]]` that wait for what a bus does that is not recorded."""
    for kind, keys in _EVENT_KEYS.items():
        for number, item in enumerate(cast("list[Table]", table.get(kind, []))):
            for key in keys & item.keys():
                words = item[key]
                for one in words if isinstance(words, list) else [words]:
                    if (bus := bus_of(str(one))) and bus not in scenario.record:
                        at = within(where, kind, number)
                        raise ScenarioError(f"{at}: {key}: {bus} is not recorded", hint=f'record = ["{bus}"]')


#: Where goals and `[[when]]` have events in words.
_EVENT_KEYS = {"goal": {"event", "events", "after", "from", "to"}, "when": {"event"}}


def _build_several(
    table: Table, text: str, path: Path, where: TablePlace, firmware: Path | None, trust: Trust
) -> Scenario:
    """Return a scenario with several robots, from a table of each."""
    tables = split(table, _TOP, where)
    found: list[Scenario | None] = [
        replace(_build(one.table, text, path, one.place, firmware, trust), name=one.name) if one.has_firmware else None
        for one in tables
    ]
    for one, scenario in zip(tables, found, strict=True):
        if scenario is not None and _is_of_users("controller", scenario.controller_kind):
            raise ScenarioError(
                f"{within(one.place, 'controller')}: {scenario.controller_kind} steps its body by itself, and robots of"
                " one world are stepped together",
                hint="a controller of one's own has its world for itself",
            )
    models = [
        _model(one.table, path, one.place) if scenario is None else scenario.parameters
        for one, scenario in zip(tables, found, strict=True)
    ]
    first = next(scenario for scenario in found if scenario is not None)
    world = load_world(first.world, seed=first.seed)
    names = {item.name for item in world.obstacles} | {mesh.name for mesh in world.meshes}
    for one in tables:
        if one.name in names:
            raise ScenarioError(
                f"{one.place.at('name')}: world {shown(world.name)} has a thing called {shown(one.name)}"
            )
    given = [_start(one.table, one.place) for one in tables]
    with placed(where, "robot"):
        places = start_places(world, models, given)
    robots = tuple(
        RobotPlace(
            name=one.name, parameters=model, start=start, scenario=scenario and replace(scenario, start=start),
        )
        for one, model, start, scenario in zip(tables, models, places, found, strict=True)
    )  # fmt: skip
    first = next(robot.scenario for robot in robots if robot.scenario is not None)
    return replace(
        first, name=path.stem, robots=robots, where=where, seeds=load_seeds(table, where.at("seeds")),
        axes=load_axes(cast("Table", table.get("sweep", {})), where),
    )  # fmt: skip


def _model(table: Table, path: Path, where: TablePlace) -> RobotParameters:
    """Return what a robot without a program is."""
    robot = str(table["robot"])
    own = _own_robot(robot, {key: value for key, value in table.items() if key == "pins"}, path, where)
    return own.robot.parameters if own is not None else _parameters(robot, path, where)


def _taken(own_robot: OwnRobot | None) -> dict[str, str]:
    """Return the chip's pins that a robot has, with its signals."""
    if own_robot is None:
        return {wire.bluepill: wire.name for wire in load_pinout().wires}
    return {wire.pin: wire.name for wire in own_robot.robot.signals}


def _parameters(robot: str, path: Path, where: TablePlace) -> RobotParameters:
    """Return a model's parameters; a file of them stands beside the scenario, as all that it names."""
    beside = path.parent / robot
    try:
        return load_parameters(beside if beside.suffix in {".toml", ".p"} and is_file(beside) else robot)
    except FileError as error:
        hint = f"{error.hint or ''}; robots on pins of their own: {', '.join(known_own_robots())}".removeprefix("; ")
        raise ScenarioError(f"{where.at('robot')}: {error}", hint=hint) from error


def _own_robot(robot: str, table: Table, path: Path, where: TablePlace) -> OwnRobot | None:
    """Return the robot, where it hangs on the chip's own pins; what only another one can have is refused."""
    file = find_own_robot(robot, path.parent)
    if file is None:
        if "pins" in table:
            raise ScenarioError(
                f"{within(where, 'pins')}: the robot {shown(robot)} has the wires of the pin-out",
                hint=f"it is for {', '.join(known_own_robots())}, and robot files with a kind",
            )
        return None
    for key in ("direct", "adapter", "controller", "fault"):
        if key in table:
            at = within(where, key, 0 if key == "fault" else None)
            raise ScenarioError(f"{at}: this is for a Pioneer, and {shown(robot)} is none")
    if table.get("mode") == "adapter":
        raise ScenarioError(f"{where.at('mode')}: the robot {shown(robot)} hangs on the chip's own pins")
    return load_own_robot(file, cast("Table", table.get("pins", {})), where)


def _apply_in_world(scenario: Scenario) -> Scenario:
    world, part = scenario.in_world.get(scenario.world, ("", {}))
    if "threshold_m" in part:
        threshold_um = round(cast("float", part["threshold_m"]) * 1e6)
        adapter = replace(scenario.adapter, threshold_um=threshold_um)
        scenario = replace(scenario, threshold_um=threshold_um, adapter=adapter)
    if "duration_s" in part:
        planned_ns = round(cast("float", part["duration_s"]) * NS_PER_S)
        scenario = replace(scenario, duration_ns=planned_ns, planned_ns=planned_ns)
    if "start" in part:
        key = f"in_world.{world}.start"
        start = _start(part, scenario.where, key)
        scenario = replace(scenario, start=start, start_at=str(within(scenario.where, key)))
    return scenario


def _firmware(name: str, path: Path, where: TablePlace) -> Path:
    """Return the file beside the scenario, or the shipped program of that name."""
    beside = path.parent / name
    if is_file(beside):
        return beside
    shipped = files("robot_bench.firmware").joinpath(name if name.endswith(".elf") else f"{name}.elf")
    if is_file(Path(str(shipped))):
        return Path(str(shipped))
    raise ScenarioError(
        f"{where.at('firmware')}: firmware: there is no file {shown(name)} beside it, nor a program of that name that"
        " ships",
        hint="build it first, name it as seen from the scenario file, or give another by --firmware",
    )


def _start(table: Table, where: Where, key: str = "start") -> Pose | None:
    if "start" not in table:
        return None
    part = cast("Table", table["start"])
    check_table(part, _START, within(where, key))
    heading_rad = math.radians(cast("float", part.get("heading_deg", 0.0)))
    return Pose(x_m=cast("float", part["x_m"]), y_m=cast("float", part["y_m"]), heading_rad=heading_rad)


def _direct(part: Table, where: Where) -> DirectSettings:
    check_table(part, _DIRECT, within(where, "direct"))
    return replace(DirectSettings(), **{
        name: turn(value) for key, value in part.items() for name, turn in (_DIRECT_SETTINGS[key],)
    })  # fmt: skip


#: Key of [direct] → its setting, and how that is made of the value.
_DIRECT_SETTINGS: Mapping[str, tuple[str, Callable[[Any], Any]]] = {
    "step_mm_s": ("step_um_per_s", lambda value: round(value * 1000)),
    "ramp_mm_s2": ("ramp_um_per_s2", lambda value: round(value * 1000) or None),
    "sensor_period_ms": ("sensor_period_ns", lambda value: value * NS_PER_MS),
    "encoder_period_ms": ("encoder_period_ns", lambda value: value * NS_PER_MS),
    "motor_command": ("motor_command", MotorCommand),
    "bit_order": ("bit_order", BitOrder),
}


def _adapter(part: Table, threshold_um: int, where: Where) -> AdapterSettings:
    check_table(part, _ADAPTER, within(where, "adapter"))
    values = {name: value for name, value in part.items() if name not in {"step_mm_s", "core", *_ADAPTER_TIMES}}
    for name in _ADAPTER_TIMES:
        if name in part:
            values[f"{name.removesuffix('_ms')}_ns"] = cast("int", part[name]) * NS_PER_MS
    if "step_mm_s" in part:
        values["step_um_per_s"] = round(cast("float", part["step_mm_s"]) * 1000)
    with placed(within(where, "adapter")):
        return AdapterSettings(threshold_um=threshold_um, **values)  # type: ignore[arg-type] # check_table has seen to it


def _controller(part: Table, path: Path, where: Where) -> ControllerSettings:
    check_table(part, _CONTROLLER, within(where, "controller"))
    with placed(within(where, "controller")):
        return _settings(part, path)


def _settings(part: Table, path: Path) -> ControllerSettings:
    settings = ControllerSettings()
    if "flash" in part:
        settings = settings.with_flash(load_flash(path.parent / str(part["flash"])))
    if "errors" in part:
        beside = path.parent / str(part["errors"])
        settings = replace(settings, errors=load_sensor_errors(str(beside if is_file(beside) else part["errors"])))
    if "name" in part:
        settings = replace(settings, name=str(part["name"]))
    if "sonar_per_sip" in part:
        settings = replace(settings, sonar_per_sip=SonarPerSip(str(part["sonar_per_sip"])))
    return settings


def _named(table: object, key: str, what: str, default: str, path: Path, where: Where, trust: Trust) -> str:
    """Return the body, adapter or controller that a key names, and refuse one that cannot be."""
    at = f"{where.at(key) if isinstance(where, TablePlace) else where}: {key}"
    name = trust.admit(str(cast("Table", table).get(key, default)), path.parent, at)
    try:
        return _known(what, name)
    except UntrustedError:
        raise
    except UsageError as error:
        raise ScenarioError(f"{at}: {error}", hint=error.hint) from error


def _known(what: str, name: str) -> str:
    """Return the name of a body, adapter or controller; code that is only read is not looked into.

    Raises:
        UsageError: There is none, or its class lacks a method.
    """
    if _is_of_users(what, name) and not (isinstance(name, Code) and name.is_unread):
        _class_of_users(what, name)
    return name


def _is_of_users(what: str, name: str) -> bool:
    return not may_ship(name) if what == "body" else name not in ENDS[what].ships


def _class_of_users(what: str, name: str) -> Callable[..., object]:
    return body_class(name) if what == "body" else ENDS[what].check(name)
