"""A scenario out of its files: what they name is looked up, checked against each other and put together.

Files that are named in a scenario are looked for beside it, then among those that ship. docs/scenarios.md has every
key, `tables` declares them.
"""

from collections.abc import Sequence
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

from adapter_sim.pinout import WireRole, load_pinout
from p2os.errors import ScenarioError
from p2os.pioneer.controller import ControllerSettings
from p2os.pioneer.controller.flash import load_flash
from p2os.pioneer.sensor_errors import load_sensor_errors
from p2os.pioneer.world import Pose, load_world
from p2os.pioneer.world.model import World
from p2os.pioneer.world.start_places import refuse_start, start_places
from p2os.robots.parameters import RobotParameters, load_parameters
from p2os.toml_file import is_file
from p2os.toml_record import given, number_of, read, table_of, tables_of
from p2os.toml_schema import Table, TablePlace, placed, within
from robot_bench.events.selection import bus_of
from robot_bench.scenario import plugged_parts
from robot_bench.scenario.fault_script import load_faults
from robot_bench.scenario.goals.judging import load_goal
from robot_bench.scenario.hands.timed import load_hands
from robot_bench.scenario.included_files import ScenarioTable, Setting, read_tables, shipped_file, shipped_scenarios
from robot_bench.scenario.options import buses, is_of_users, known_code, listed, resolve_world, world_file
from robot_bench.scenario.scenario import RobotPlace, Scenario
from robot_bench.scenario.several_robots import split
from robot_bench.scenario.sweep import load_axes, load_seeds
from robot_bench.scenario.tables import ControllerTable, StartTable, TopTable
from robot_bench.scenario.trigger_script import load_triggers
from robot_bench.scenario.wired_robots import OwnRobot, find_own_robot, known_own_robots, load_own_robot
from robot_bench.scenario.world_script import load_changes, refuse_names
from simbase.errors import FileError, UsageError, nearest, shown
from simbase.timing import NS_PER_S, nanos
from simbase.trust import Trust, UntrustedError

#: The kinds of wires that may be cut from the robot, for something outside to drive: those to the chip.
OUTSIDE = (WireRole.DISTANCE.value, WireRole.ENCODER.value)


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
    worlds = table_of(table, "in_world")
    for world in worlds:
        resolve_world(world, path.parent, str(within(where, f"in_world.{world}")))
    if "duration_s" in dict(settings):
        return
    longest_s = max(number_of(part, "duration_s") for part in (table, *(table_of(worlds, name) for name in worlds)))
    for kind in ("obstacle", "fault", "hand"):
        for number, item in enumerate(tables_of(table, kind)):
            if number_of(item, "at_s") >= longest_s:
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


def refuse_what_its_world_refuses(scenario: Scenario, world: World) -> None:
    """Refuse a start beyond the floor or inside a thing, and changes that the world's own things do not allow.

    Raises:
        ScenarioError: So it is; the message names the thing.
    """
    start, at = (scenario.start, scenario.start_at) if scenario.start else (world.start, world.start_at)
    refuse_start(world, scenario.parameters, start, at, error=ScenarioError)
    refuse_names(scenario.changes, world)


def _build(table: Table, text: str, path: Path, where: TablePlace, firmware: Path | None, trust: Trust) -> Scenario:
    top = read(TopTable, table, where)
    own_robot = _own_robot(top.robot, table, path, where)
    parameters = own_robot.robot.parameters if own_robot else _parameters(top.robot, path, where)
    threshold_um = round((parameters.sonar_range_m / 2 if top.threshold_m is None else top.threshold_m) * 1e6)
    changes = load_changes(top.obstacle, parameters, where)
    wires = own_robot.wires if own_robot else None
    goals = tuple(load_goal(goal, within(where, "goal", number), wires) for number, goal in enumerate(top.goal))
    adapter_at = within(where, "adapter")
    with placed(adapter_at):
        adapter = top.adapter.settings(threshold_um)
    with placed(within(where, "controller")):
        controller = _controller(top.controller, path.parent)
    scenario = Scenario(
        name=path.stem,
        description=top.description,
        text=text,
        firmware=firmware or _firmware(top.firmware, path, where),
        world=resolve_world(top.world, path.parent, f"{where.at('world')}: world"),
        parameters=parameters,
        robot=top.robot,
        own_robot=own_robot,
        mode=top.mode or ("direct" if own_robot else "adapter"),
        body=_code(top.body, "body", "body", path, where, trust),
        seed=top.seed,
        duration_ns=(planned_ns := nanos(top.duration_s)),
        planned_ns=planned_ns,
        threshold_um=threshold_um,
        usart_baud=top.usart_baud,
        record=buses(listed(",".join(top.record)), where.at("record"), ScenarioError),
        outside=_outside(top.outside, own_robot, where.at("outside")),
        sram=top.sram,
        crystal_ppm=top.crystal_ppm,
        interrupt_latency_cycles=top.interrupt_latency_cycles,
        gives_up_s=top.gives_up_s,
        start=None if top.start is None else top.start.pose,
        start_at=str(within(where, "start")),
        direct=top.direct.settings,
        adapter=adapter,
        adapter_core=_code(top.adapter.core, "core", "adapter", path, adapter_at, trust),
        controller=controller,
        controller_kind=_code(top.controller.kind, "kind", "controller", path, within(where, "controller"), trust),
        parts=plugged_parts.load_parts(top.part, path.parent, _taken(own_robot), where, trust),
        changes=changes,
        seeds=load_seeds(top.seeds, where.at("seeds")),
        axes=load_axes(top.sweep or {}, where),
        faults=load_faults(top.fault, parameters, where),
        triggers=load_triggers(top.when, parameters, where, wires),
        hands=load_hands(top.hand, parameters, where, wires),
        goals=goals,
        in_world={str(world_file(world, path.parent) or world): (world, part) for world, part in top.in_world.items()},
        where=where,
    )
    _refuse_unrecorded(scenario, table, where)
    scenario = scenario.in_its_world()
    _refuse_goals_beyond_the_end(scenario, where)
    return scenario


def _refuse_goals_beyond_the_end(scenario: Scenario, where: TablePlace) -> None:
    """Refuse goals that would look at nothing, and so be met by any run."""
    for number, goal in enumerate(scenario.goals):
        said = dict(given(goal.table))
        begin = said.get("from_s", 0)
        if "after" not in said and nanos(begin) >= scenario.planned_ns:
            raise ScenarioError(
                f"{within(where, 'goal', number)}: from_s = {begin:g}: the run is over by then",
                hint=f"duration_s is {scenario.planned_ns / NS_PER_S:g}",
            )


def _refuse_unrecorded(scenario: Scenario, table: Table, where: TablePlace) -> None:
    """Refuse goals and `[[when]]` that wait for what a bus does that is not recorded."""
    for kind, keys in _EVENT_KEYS.items():
        for number, item in enumerate(tables_of(table, kind)):
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
    tables = split(table, where)
    found: list[Scenario | None] = [
        replace(_build(one.table, text, path, one.place, firmware, trust), name=one.name) if one.has_firmware else None
        for one in tables
    ]
    for one, scenario in zip(tables, found, strict=True):
        if scenario is not None and is_of_users("controller", scenario.controller_kind):
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
    starts = [_start(one.table, one.place) for one in tables]
    with placed(where, "robot"):
        places = start_places(world, models, starts)
    robots = tuple(
        RobotPlace(
            name=one.name, parameters=model, start=start, scenario=scenario and replace(scenario, start=start),
        )
        for one, model, start, scenario in zip(tables, models, places, found, strict=True)
    )  # fmt: skip
    first = next(robot.scenario for robot in robots if robot.scenario is not None)
    return replace(
        first, name=path.stem, robots=robots, where=where, axes=load_axes(table_of(table, "sweep"), where),
        seeds=load_seeds(None if "seeds" not in table else str(table["seeds"]), where.at("seeds")),
    )  # fmt: skip


def _model(table: Table, path: Path, where: TablePlace) -> RobotParameters:
    """Return what a robot without a program is."""
    robot = str(table["robot"])
    own = _own_robot(robot, {key: value for key, value in table.items() if key in {"pins", "charge"}}, path, where)
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
        if "charge" in table:
            raise ScenarioError(
                f"{where.at('charge')}: charge is for robots on own pins", hint='fault = "low-battery 11.0"'
            )
        return None
    for key in ("direct", "adapter", "controller", "fault"):
        if key in table:
            at = within(where, key, 0 if key == "fault" else None)
            raise ScenarioError(f"{at}: this is for a Pioneer, and {shown(robot)} is none")
    if table.get("mode") == "adapter":
        raise ScenarioError(f"{where.at('mode')}: the robot {shown(robot)} hangs on the chip's own pins")
    charge = number_of(table, "charge") if "charge" in table else None
    return load_own_robot(file, table_of(table, "pins"), where, charge=charge)


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


def _start(table: Table, where: TablePlace) -> Pose | None:
    return read(StartTable, table_of(table, "start"), within(where, "start")).pose if "start" in table else None


def _controller(table: ControllerTable, folder: Path) -> ControllerSettings:
    settings = ControllerSettings()
    if table.flash is not None:
        settings = settings.with_flash(load_flash(folder / table.flash))
    if table.errors is not None:
        beside = folder / table.errors
        settings = replace(settings, errors=load_sensor_errors(str(beside if is_file(beside) else table.errors)))
    if table.sonar_per_sip is not None:
        settings = replace(settings, sonar_per_sip=table.sonar_per_sip)
    return settings if table.name is None else replace(settings, name=table.name)


def _code(name: str, key: str, what: str, path: Path, where: TablePlace, trust: Trust) -> str:
    """Return the body, adapter or controller that a key names, and refuse one that cannot be."""
    at = f"{where.at(key)}: {key}"
    admitted = trust.admit(name, path.parent, at)
    try:
        return known_code(what, admitted)
    except UntrustedError:
        raise
    except UsageError as error:
        raise ScenarioError(f"{at}: {error}", hint=error.hint) from error
