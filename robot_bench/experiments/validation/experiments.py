"""The experiments: what is claimed, what is run, what is measured. Source: the thesis's validations 5.4.1 to 5.4.4."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import TypeAlias

from robot_bench.experiments.validation.encoders import (
    count_figures,
    encoder_figures,
    slip_figures,
    sparse_figures,
    wrap_figure,
)
from robot_bench.experiments.validation.figures import Figure, FigureTolerance, Finding, Missing
from robot_bench.experiments.validation.motors import Pair, motor_figures
from robot_bench.experiments.validation.nominal import Nominal
from robot_bench.experiments.validation.sensors import only_while_seen_figures, reading_figures, sensor_figures
from robot_bench.experiments.validation.signals import packets
from robot_bench.experiments.validation.silence import silence_figures
from robot_bench.recording.run_record import RunRecord
from robot_bench.scenario.goals.judging import Judgement
from robot_bench.scenario.included_files import Setting
from robot_bench.scenario.scenario import Scenario, known_scenarios, load_scenario
from simbase.errors import UsageError
from simbase.timing import NS_PER_S


@dataclass(frozen=True, slots=True, kw_only=True)
class ExperimentTrial:
    """One run of a scenario in one variant of the bench, and what is expected of it."""

    record: RunRecord
    nominal: Nominal
    scenario: Scenario
    judgement: Judgement


Measure: TypeAlias = Callable[[ExperimentTrial], Sequence[Finding]]


@dataclass(frozen=True, slots=True, kw_only=True)
class AtPort:
    """How a robot at a port does an experiment: nothing is placed there, and nothing but its packets is known.

    `room` is what a person sees to before it; `scenario` and `measure` stand in the place of the experiment's own.
    """

    room: str
    scenario: str = ""
    measure: Measure | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Experiment:
    """One claim about the bench.

    `scenario` is a shipped one's name or a file of this package, in several worlds where `worlds` names them; `at_port`
    how a robot at a port does it, or why it cannot.
    """

    name: str
    hypothesis: str
    procedure: str
    scenario: str
    measure: Measure
    worlds: tuple[str, ...] = ()
    seeds: tuple[int, ...] = (0,)
    settings: tuple[Setting, ...] = ()
    #: In these modes alone; empty: in all.
    modes: tuple[str, ...] = ()
    at_port: AtPort | str

    def load(self, settings: Sequence[Setting] = ()) -> Scenario:
        """Return its scenario, with what is set otherwise.

        Raises:
            ScenarioError, UsageError: A setting cannot be.
        """
        return _load(self.scenario, [*self.settings, *settings])

    def load_at_port(self, settings: Sequence[Setting] = ()) -> Scenario:
        """Return the scenario for a robot at a port, with what is set otherwise.

        Raises:
            ScenarioError, UsageError: A setting cannot be, or a robot at a port cannot do this experiment.
        """
        if isinstance(self.at_port, str):
            raise UsageError(f"{self.name} is not for a robot at a port: {self.at_port}")
        return _load(self.at_port.scenario or self.scenario, [*AT_PORT, *settings]).with_options(mode="adapter")

    def measure_at_port(self, trial: ExperimentTrial) -> Sequence[Finding]:
        """Return what a run at a port shows."""
        other = self.at_port.measure if isinstance(self.at_port, AtPort) else None
        return (other or self.measure)(trial)


def _load(scenario: str, settings: Sequence[Setting]) -> Scenario:
    name = scenario if scenario in known_scenarios() else str(_FILES / scenario)
    return load_scenario(name, settings=settings, trust=False)  # they name no code


_FILES = Path(str(files(__package__))) / "scenarios"


def _codes() -> list[tuple[Pair, float]]:
    """Return what codes.elf shows: 64 pairs to and fro, a second each, then seven changes of three seconds."""
    row, result = range(-4, 4), list[tuple[Pair, float]]()
    for place, left in enumerate(row):
        result += [((left, right), 1.0) for right in (row if place % 2 == 0 else reversed(row))]
    changes = ((3, 3), (-4, -4), (3, 3), (0, 0), (3, -4), (-4, 3), (0, 0))
    return result + [(pair, 3.0) for pair in changes]


#: What motors.elf shows after standing still; a tick longer than three seconds each.
MOTORS: Sequence[tuple[Pair, float]] = (((3, 3), 3.01), ((-4, -4), 3.01), ((0, 0), 3.01))
CODES: Sequence[tuple[Pair, float]] = tuple(_codes())


def drive_figures(trial: ExperimentTrial) -> list[Finding]:
    """Return how often the robot touched something, and how many of the scenario's goals were met."""
    judgement, poses = trial.judgement, trial.record.poses
    if not poses:
        return [Missing(group="motion", what="collisions", why="no pose was recorded")]
    where = "; ".join(str(hit) for hit in trial.record.contacts[:1])
    goals = len(trial.scenario.goals)
    return [
        Figure(
            group="motion", what="collisions", expected=0, measured=poses[-1].collisions, uncertainty=0, unit="",
            bound=FigureTolerance(name="collisions", value=0, formula="none"), at=where,
        ),
        Figure(
            group="motion", what="goals of the scenario", expected=goals, measured=len(judgement.met), uncertainty=0,
            unit="", bound=FigureTolerance(name="goals", value=0, formula="all met"),
            at="; ".join(judgement.missed)[:200],
        ),
    ]  # fmt: skip


def _drive_at_port(trial: ExperimentTrial) -> list[Finding]:
    """Return what the packets tell of a drive: stalls, and the goals that can be judged from outside."""
    told = packets(trial.record, trial.scenario.controller.family_of(trial.scenario.parameters))
    if not told:
        return [Missing(group="wire", what="packets with a stall", why="no packet came")]
    stalls = [t for t, sip in told if sip.stall_left or sip.stall_right]
    judgement = trial.judgement
    return [
        Figure(
            group="wire", what="packets with a stall", expected=0, measured=len(stalls), uncertainty=0, unit="",
            bound=FigureTolerance(name="stalls", value=0, formula="none"), count=len(told),
            at=f"{stalls[0] / NS_PER_S:.2f} s" if stalls else "",
        ),
        Figure(
            group="motion", what="goals of the scenario", expected=len(trial.scenario.goals),
            measured=len(judgement.met), uncertainty=0, unit="", at="; ".join(judgement.missed)[:200],
            bound=FigureTolerance(name="goals", value=0, formula="all met"),
        ),
    ]  # fmt: skip


def _sensors(trial: ExperimentTrial) -> list[Finding]:
    found = sensor_figures(trial.record, trial.nominal, trial.scenario)
    return found if trial.nominal.is_direct else [*found, *reading_figures(trial.record, trial.scenario)]


def _encoders(trial: ExperimentTrial) -> list[Finding]:
    return [*encoder_figures(trial.record, trial.nominal), *count_figures(trial.record)]


def _long_drive(trial: ExperimentTrial) -> list[Finding]:
    found = [finding for finding in encoder_figures(trial.record, trial.nominal) if "codes reached" not in finding.what]
    length_mm = trial.record.poses[-1].left_angle / 1e6 * trial.scenario.parameters.body.wheel_diameter_m * 500
    needed_mm = 32768 * trial.scenario.parameters.distance_nm_per_count / 1e6
    return [*found, Figure(
        group="motion", what="turns of the position counter, whole ones", expected=1, measured=length_mm // needed_mm,
        uncertainty=0, unit="", bound=FigureTolerance(name="wrap", value=0, formula=f"{needed_mm / 1000:.4g} m of way"),
    )]  # fmt: skip


#: What a person sees to.
_FREE = "two metres free on each side of it"
_FREE_ROUND = f"{_FREE}: it goes to and fro and turns for a minute and a half"
_GATE = (
    "two boxes 0.3 m long, 0.75 m apart, as a gate 1.05 m before its middle, and nothing else within two metres:"
    " it drives between them and stops behind"
)
EXPERIMENTS: Mapping[str, Experiment] = {one.name: one for one in (
    Experiment(
        name="motors", scenario="motors", at_port=AtPort(room=f"{_FREE}: it goes half a metre ahead and as far back"),
        hypothesis="The robot does what the motor pins say: 0, +3, -4, 0.",
        procedure="motors.elf holds each pair for three seconds in the room.",
        measure=lambda trial: motor_figures(trial.record, trial.nominal, MOTORS),
    ),
    Experiment(
        name="codes", scenario="codes.toml", at_port=AtPort(room=_FREE_ROUND),
        hypothesis="Every pair of motor codes comes to its speed, and every change keeps to its ramp.",
        procedure="codes.elf holds all 64 pairs for a second, then changes from end to end, on an empty floor.",
        measure=lambda trial: motor_figures(trial.record, trial.nominal, CODES),
    ),
    Experiment(
        name="capped", scenario="codes.toml", modes=("adapter",),
        at_port="the adapter is the same at every robot, and speeds there are far below a cap",
        settings=(("adapter.max_velocity_mm_s", 150), ("adapter.max_rotation_deg_s", 30)),
        hypothesis="Where a pair of codes asks for more than the adapter's caps, both its speeds shrink by one factor.",
        procedure="The run of codes with caps of 150 mm/s and 30 deg/s.",
        measure=lambda trial: motor_figures(trial.record, trial.nominal, CODES),
    ),
    Experiment(
        name="sensors", scenario="sensors",
        at_port=AtPort(
            room=_GATE, scenario="port-gate.toml", measure=lambda trial: reading_figures(trial.record, trial.scenario)
        ),
        hypothesis="Each distance pin rises for a thing before its own sonar, and for no other.",
        procedure="A post stands 0.45 m before each of the eight sonar in turn, for a second.",
        measure=_sensors,
    ),
    Experiment(
        name="sensors-all", scenario="sensors-all.toml",
        at_port="eight things at once, to the centimetre and the second, are placed by no person",
        hypothesis="All eight distance pins rise and fall at once for what is nearer than the threshold alone.",
        procedure="Posts stand before all eight sonar for three seconds, 3 mm within the threshold, then 3 mm beyond.",
        measure=_sensors,
    ),
    Experiment(
        name="only-while-seen", scenario="sensors", at_port=AtPort(room=_GATE, scenario="port-gate.toml"),
        hypothesis="The robot moves only while a sensor sees something.",
        procedure="sensors.elf drives at code +2 while any distance pin is high; the posts of sensors.",
        measure=lambda trial: only_while_seen_figures(trial.record, trial.nominal),
    ),
    Experiment(
        name="encoders", scenario="codes.toml",
        at_port=AtPort(
            room=_FREE_ROUND,
            measure=lambda trial: [
                *_encoders(trial),
                wrap_figure(trial.record, trial.scenario.controller.family_of(trial.scenario.parameters)),
            ],
        ),
        hypothesis="The encoder pins show the wheels' angles in both directions at every speed; a program misses none.",
        procedure="The run of codes: every pose against the pins, every printed count against both.",
        measure=_encoders,
    ),
    Experiment(
        name="silence", scenario="silence.toml", modes=("adapter",),
        at_port="it drives on for two seconds with nobody to stop it",
        hypothesis="Without packets the adapter shows obstacles, without commands the robot stops, and neither goes on"
        " by itself.",
        procedure="motors.elf drives ahead when the P2OS line goes down for four seconds.",
        measure=lambda trial: silence_figures(trial.record, trial.nominal),
    ),
    Experiment(
        name="long-drive", scenario="long-drive.toml",
        at_port="it needs 28 m; the counter wraps at its origin too, in the run of encoders",
        hypothesis="The encoder pins stay right where the position in the packets wraps.",
        procedure="Straight on for more than 27.5 m.",
        measure=_long_drive,
    ),
    Experiment(
        name="sparse", scenario="sparse.toml",
        at_port="it needs 880 mm/s and packets each 250 ms",
        hypothesis="A wheel that turns more than half a turn between two samples is followed; what shows samples loses"
        " whole turns and no part of one.",
        procedure="codes.elf on an AmigoBot whose samples come each 250 ms, at up to 880 mm/s, on an empty floor.",
        measure=lambda trial: sparse_figures(trial.record, trial.nominal),
    ),
    Experiment(
        name="slip", scenario="slip.toml",
        at_port="wheels that spin against a wall harm a robot",
        hypothesis="The encoder pins show what the wheels turn where they slip, and no more where they stall.",
        procedure="motors.elf between two walls, against which the wheels of a strong robot spin, ahead and back.",
        measure=lambda trial: slip_figures(trial.record, trial.nominal, trial.scenario.body),
    ),
    Experiment(
        name="dodge", scenario="dodge",
        at_port=AtPort(
            room="four metres by three or more, with a few things in it as high as its sonar; it roams for a minute",
            scenario="port-dodge.toml", measure=_drive_at_port,
        ),
        worlds=("room", "arena", "office"), seeds=(0, 1),
        settings=(("controller.errors", "realistic"),),
        hypothesis="A program that dodges by the distance pins touches nothing.",
        procedure="dodge.elf roams for two minutes in each world, with realistic sensor errors, a run a seed.",
        measure=drive_figures,
    ),
)}  # fmt: skip

#: The scenario that a robot at a port runs: steps so small that every code is within the cautious limits.
AT_PORT: tuple[Setting, ...] = (("adapter.step_mm_s", 40.0),)
