"""A scenario: everything that a run needs to know.

`loading` makes one of files, whose keys are those of `tables`; `options` are what may be set otherwise.

Invariant: a `Scenario` that exists can be run: its firmware and its world are
there, and every value is in range.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Unpack

from adapter_sim.settings import AdapterSettings
from bluepill_sim.parts.registry import PartSpec
from p2os.pioneer.body.factory import BEST
from p2os.pioneer.controller import ControllerSettings
from p2os.pioneer.world import Pose, load_world
from p2os.pioneer.world.start_places import start_places
from p2os.robots.parameters import RobotParameters
from p2os.toml_schema import Where, within
from robot_bench.direct.robot import DirectSettings
from robot_bench.scenario.fault_script import FaultChange
from robot_bench.scenario.goals.judging import Goal
from robot_bench.scenario.hands.timed import Hand
from robot_bench.scenario.included_files import Setting
from robot_bench.scenario.options import (
    ScenarioOptions,
    buses,
    check_options,
    class_of_users,
    is_of_users,
    listed,
    resolve_world,
)
from robot_bench.scenario.sweep import SweptParameter
from robot_bench.scenario.tables import InWorldTable
from robot_bench.scenario.trigger_script import Trigger
from robot_bench.scenario.wired_robots import NO_ROBOT, OwnRobot
from robot_bench.scenario.world_script import ScriptedChange
from robot_bench.wires.power_up import ZEROS
from simbase.errors import UsageError
from simbase.timing import NS_PER_S, Nanos, nanos
from simbase.trust import Code, own_code
from simbase.user_classes import source_of


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
    #: By how many cycles each interrupt of the chip may be late, drawn by the seed.
    interrupt_latency_cycles: int = 0
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
    triggers: tuple[Trigger, ...] = ()
    #: What is done at times, in their order.
    hands: tuple[Hand, ...] = ()
    goals: tuple[Goal, ...] = ()
    #: World, as `world` names it → as the file names it, and what is otherwise there.
    in_world: Mapping[str, tuple[str, InWorldTable]] = field(default_factory=dict)
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
    def has_robot(self) -> bool:
        """Whether a robot stands at the far end of its wires, in a world."""
        return self.own_robot is None or self.own_robot.kind != NO_ROBOT

    @property
    def own_classes(self) -> dict[str, str]:
        """What stands in the place of what ships: its name, and the hash of its folder, or of the file of its class."""
        named = (("body", self.body), ("adapter", self.adapter_core), ("controller", self.controller_kind))
        return {str(code): code.key for code in self.codes} | {
            name: source_of(class_of_users(what, name))
            for what, name in named if is_of_users(what, name) and not isinstance(name, Code)
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
        check_options(options)
        world, body, core = options.get("world"), options.get("body"), options.get("adapter_core")
        seed, usart_baud, duration_s = options.get("seed"), options.get("usart_baud"), options.get("duration_s")
        if self.robots:
            return self._each_with(options)
        if self.own_robot is not None and options.get("mode") == "adapter":
            raise UsageError(f"the robot {self.robot!r} hangs on the chip's own pins", hint="--mode direct")
        moved = self if world is None else self._moved_to(world)
        return replace(
            moved,
            record=buses((*moved.record, *listed(options.get("record"))), "--record", UsageError),
            firmware=Path(options.get("firmware") or moved.firmware),
            mode=options.get("mode") or moved.mode,
            adapter_core=moved.adapter_core if core is None else own_code(core),
            body=moved.body if body is None else own_code(body),
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
        return replace(self, world=world, start=self.start if world == self.world else None).in_its_world()

    def in_its_world(self) -> "Scenario":
        """Return the scenario with what it says otherwise of the world that it is in."""
        world, part = self.in_world.get(self.world, ("", InWorldTable()))
        found = self
        if part.threshold_m is not None:
            threshold_um = round(part.threshold_m * 1e6)
            adapter = replace(found.adapter, threshold_um=threshold_um)
            found = replace(found, threshold_um=threshold_um, adapter=adapter)
        if part.duration_s is not None:
            planned_ns = nanos(part.duration_s)
            found = replace(found, duration_ns=planned_ns, planned_ns=planned_ns)
        if part.start is not None:
            at = str(within(found.where, f"in_world.{world}.start"))
            found = replace(found, start=part.start.pose, start_at=at)
        return found
