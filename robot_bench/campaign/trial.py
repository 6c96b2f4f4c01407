"""The unit of work of a campaign: one run as a value, and what came of it.

A `Trial` is a scenario as data: its tables after all that was set, the bytes of each file that they name (firmware,
world, robot, …), and its seed. It can be pickled and carried out anywhere, without a disk that is shared:
`run_trial` runs it in this process, `processes` in others within limits. `write` makes a folder of it that
`p2os run FOLDER/NAME.toml` runs, with the same hash.

Invariant: what comes of a trial depends on nothing but itself and the version of p2os.
"""

import hashlib
import os
import re
import shutil
import tempfile
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import lru_cache, partial
from pathlib import Path
from typing import cast

from bluepill_sim.board import BluePill
from bluepill_sim.program.image import Image, load_image
from p2os.pioneer.body.factory import BEST, resolve_body
from p2os.pioneer.world import known_worlds, load_world
from p2os.pioneer.world.writer import write_world
from p2os.toml_file import TomlSource, is_file, toml_text
from p2os.toml_record import tables_of
from p2os.toml_schema import Table
from robot_bench.bench import Bench, run_of
from robot_bench.bench.board import boot
from robot_bench.events.kinds import Contact, Event, Pose, Text
from robot_bench.events.selection import Selector, select
from robot_bench.scenario.included_files import (
    SCENARIO,
    MergedSource,
    ScenarioTable,
    Setting,
    read_tables,
    set_key,
    shipped_file,
)
from robot_bench.scenario.loading import build_scenario, known_scenarios, load_scenario
from robot_bench.scenario.scenario import Scenario
from simbase.errors import P2osError
from simbase.files import MAKE_ROOM, read_bytes, refuse_elsewhere, writing, writing_temporary
from simbase.timing import NS_PER_MS, Nanos
from simbase.trust import Code, Trust, fingerprint_of
from simbase.trust.code import is_in_file, located
from simbase.trust.fingerprint import importable

#: A way is kept as a place each so often.
WAY_NS: Nanos = 500 * NS_PER_MS
#: chosen: so many different lines that a firmware prints tell its states apart; one that prints numbers has no end.
MOST_LINES = 200
#: chosen: of these so many that follow another one.
MOST_TRANSITIONS = 400
_FIGURES = re.compile(r"\d+")
#: Keys of tables that are words, whatever file has their name.
_WORDS = frozenset({"text", "texts", "description", "event", "events", "name", "kind", "fault", "from", "to", "after"})
#: chosen: firmwares and worlds of a campaign that a worker keeps at hand.
_KEPT_FOLDERS = 8


class TrialVerdict(Enum):
    """What came of a trial."""

    #: Each goal was met, or left open by a run that was asked to be shorter.
    PASSED = "passed"
    #: A goal was missed, or the firmware died.
    FAILED = "failed"
    #: There is no verdict: the scenario cannot be run so, a limit was exceeded, or the process ended.
    ERROR = "error"


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One run as data."""

    #: What its scenario file would be called, without the ending.
    name: str
    #: The tables of the scenario, nothing included or extended any more; without the seed.
    table: Mapping[str, object]
    #: Name as the tables have it → content.
    files: Mapping[str, bytes]
    #: Of everything random.
    seed: int = 0
    #: What of its code may be executed: `Code.key` of each.
    trusted: frozenset[str] = frozenset()
    #: Events, as lines of words, of which its outcome says whether they have happened; they change nothing in the run.
    looks_for: tuple[str, ...] = ()
    #: Names of what disturbs it: a goal that is excused by one of these does not judge.
    disturbed_by: frozenset[str] = frozenset()

    def set(self, *settings: Setting) -> "Trial":
        """Return the trial with keys set as `--set` sets them: `("start.x_m", 1.5)`.

        Raises:
            UsageError: A key goes through what is no table, or names a table of a list that is not there.
        """
        table, seed = deepcopy(dict(self.table)), self.seed
        for key, value in settings:
            if key == "seed":
                seed = cast("int", value)
            else:
                set_key(table, key, value)
        return replace(self, table=_with_named_body(table), seed=seed)

    def with_lists(self, **lists: Sequence[Table]) -> "Trial":
        """Return the trial with other lists of tables: `obstacle=[…]`; an empty one is left out."""
        table = {key: value for key, value in self.table.items() if key not in lists}
        return replace(self, table=table | {key: list(value) for key, value in lists.items() if value})

    def with_firmware(self, content: bytes) -> "Trial":
        """Return the trial with the bytes of another firmware (of the first robot's, where there are several)."""
        return replace(self, files={**self.files, self.firmware_name: content})

    @property
    def firmware_name(self) -> str:
        """The name of its firmware among the files, of several robots' that of the first."""
        return next(iter(self.programs))

    @property
    def programs(self) -> Mapping[str, str]:
        """The name of each firmware among the files, in the order of the robots, and the SHA-256 of its bytes."""
        robots = self.table.get("robot")
        tables = tables_of(self.table, "robot") if isinstance(robots, list) else [self.table]
        names = dict.fromkeys(str(table["firmware"]) for table in tables if "firmware" in table)
        return {name: hashlib.sha256(self.files[name]).hexdigest() for name in names}

    @property
    def text(self) -> str:
        """The scenario file."""
        return toml_text({**self.table, "seed": self.seed})

    @property
    def sha256(self) -> str:
        """The hash of all that decides it: two trials with one hash have one outcome."""
        found = hashlib.sha256(self.text.encode())
        for name, content in sorted(self.files.items()):
            found.update(f"\0{name}\0{len(content)}\0".encode() + content)
        for words in self.looks_for:
            found.update(f"\0\0{words}".encode())
        for name in sorted(self.disturbed_by):
            found.update(f"\0\0\0{name}".encode())
        return found.hexdigest()

    def write(self, folder: Path) -> Path:
        """Write scenario and files into a folder; return the scenario's path, for `p2os run`.

        Goals that do not judge it say so there, since a scenario does not know what disturbs it.

        Raises:
            FileError: The folder cannot be written, or a name leads out of it.
        """
        path = refuse_elsewhere(folder, f"{self.name}.toml")  # a trace may say what it is called
        with writing(path, hint="name another folder"):
            _write_files(self.files, folder)
            table = {"version": SCENARIO.newest, **self._with_excused()}
            path.write_text(replace(self, table=table).text, encoding="utf-8")
        return path

    def _with_excused(self) -> Table:
        """Return the tables, in which goals that do not judge it say so."""
        by = self.disturbed_by
        goals = [
            {**goal, "excused": True} if by & set(cast("Sequence[str]", goal.get("excused_by", ()))) else goal
            for goal in tables_of(self.table, "goal")
        ]
        return {**self.table, "goal": goals} if goals else self.table

    def scenario(self, folder: Path) -> Scenario:
        """Return the scenario, its files being in a folder.

        Raises:
            ScenarioError: The tables break the schema, or the world refuses them.
        """
        path = folder / f"{self.name}.toml"
        source = MergedSource.of(TomlSource(path.name))
        table = {**deepcopy(dict(self.table)), "seed": self.seed}
        trust = Trust(keys=self.trusted, hint="a trial has the code that its scenario file names")
        return build_scenario(ScenarioTable(table=table, source=source, text=self.text), path, trust=trust)


@dataclass(frozen=True, slots=True, kw_only=True)
class GoalResult:
    """What became of one goal."""

    #: As in the scenario: `no_collision`.
    kind: str
    #: As a sentence.
    wanted: str
    #: None: the run was too short to tell.
    met: bool | None
    says: str
    #: By how much it was met, in `unit`, negative where it was missed; None where there is no measure.
    robustness: float | None
    unit: str
    #: Of several, whose.
    robot: str = ""
    #: It was missed, and does not judge this run.
    is_excused: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class HullContact:
    """A contact of the hull."""

    t: Nanos
    what: str
    #: Which part of the hull: `front left`.
    part: str
    x_m: float
    y_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What came of a trial."""

    verdict: TrialVerdict
    #: What was missed, each a sentence; of an error why.
    failures: tuple[str, ...] = ()
    goals: tuple[GoalResult, ...] = ()
    virtual_ns: Nanos = 0
    #: Of the trace: the same run has the same.
    sha256: str = ""
    distance_m: float = 0.0
    #: The least distance of the hull from anything, metres; None where nothing is known.
    clearance_m: float | None = None
    hits: tuple[HullContact, ...] = ()
    #: Where the (first) robot was each half second, millimetres.
    way_mm: tuple[tuple[int, int], ...] = ()
    #: How the firmware died; empty where it did not.
    died: str = ""
    #: The first address of each block of the firmware that ran.
    blocks: frozenset[int] = field(default_factory=frozenset)
    #: Of its blocks the addresses at which they end, one more where they went on elsewhere: the two ways of branches.
    ways: frozenset[int] = field(default_factory=frozenset)
    #: What it printed, figures as `#`: the states that it tells of.
    lines: frozenset[str] = field(default_factory=frozenset)
    #: Which of these followed another one: `ready → CRUISE`.
    transitions: frozenset[str] = field(default_factory=frozenset)
    #: What the trial looks for and has happened.
    happened: frozenset[str] = field(default_factory=frozenset)

    @property
    def failing_goals(self) -> tuple[GoalResult, ...]:
        """The goals that were missed, but for those that do not judge it."""
        return tuple(goal for goal in self.goals if goal.met is False and not goal.is_excused)

    @property
    def excused_goals(self) -> tuple[GoalResult, ...]:
        """The goals that were missed and do not judge it."""
        return tuple(goal for goal in self.goals if goal.is_excused)


#: What came of a trial, with the seconds of a processor that it took.
Done = tuple[Outcome, float]


def trial_of(
    name_or_path: str, *, firmware: Path | None = None, settings: Sequence[Setting] = (), trust: bool | Trust = False
) -> Trial:  # fmt: skip
    """Return the trial of a scenario that ships or of a file, with all files that it names.

    Args:
        name_or_path: As of `load_scenario`.
        firmware: Takes the place of its own program.
        settings: What is set beside the file.
        trust: Whether code that it names may be executed; it travels with the trial.

    Raises:
        UntrustedError: Code is named, and nobody has said that it may be executed.
        ScenarioError: There is no such scenario, or it breaks the schema.
        UsageError: A setting names what is not there, or there is no such firmware.
    """
    scenario = load_scenario(name_or_path, firmware=firmware, settings=settings, trust=trust)
    scenario = scenario.with_options(firmware=firmware)
    path = shipped_file(name_or_path) if name_or_path in known_scenarios() else Path(name_or_path)
    table = deepcopy(dict(read_tables(path, settings).table))
    for key in ("seeds", "sweep"):
        table.pop(key, None)
    files: dict[str, bytes] = {}
    _pack_firmware(table, scenario, files)
    _pack_world(table, scenario, path.parent, files)
    _pack_others(table, path.parent, files)
    table.pop("seed", None)
    trusted = frozenset(code.key for code in scenario.codes)
    named = _with_named_body(table)
    return Trial(name=scenario.name, table=named, files=files, seed=scenario.seed, trusted=trusted)


def _with_named_body(table: Table) -> Table:
    """Return the tables, in which the best body that is installed has its name: elsewhere it may be another one."""
    return {**table, "body": resolve_body(BEST)} if table.get("body", BEST) == BEST else table


@dataclass(slots=True)
class SeenSoFar:
    """What a run has shown so far, of what its outcome tells."""

    way_mm: list[tuple[int, int]] = field(default_factory=list)
    hits: list[HullContact] = field(default_factory=list)
    #: What it printed, figures as `#`, each line once, in the order in which they came; and which followed another.
    printed: dict[str, None] = field(default_factory=dict)
    transitions: dict[str, None] = field(default_factory=dict)
    last: str = ""
    #: Of the firmware, those that this process has not run itself.
    blocks: frozenset[int] = frozenset()
    ways: frozenset[int] = frozenset()
    #: Words of the events that are looked for and have happened.
    happened: set[str] = field(default_factory=set)
    #: What selects the others; of a run that goes on, the states that they had.
    selectors: list[Selector] = field(default_factory=list)
    selected: tuple[object, ...] = ()

    def subscribe(self, bench: Bench, looks_for: Sequence[str] = ()) -> None:
        """Have a run's events taken."""
        bench.events.subscribe(self._take, Pose, Contact, Text)
        own = run_of(bench).scenario.own_robot
        wires = None if own is None else own.wires
        self.selectors = [select(words, wires) for words in looks_for]
        for selector, state in zip(self.selectors, self.selected, strict=False):
            selector.restore(state)
        for selector in self.selectors:
            take = partial(self._look, selector)
            bench.events.subscribe(take, *selector.kinds, wires=selector.wires)

    def so_far(self, bench: Bench) -> "SeenSoFar":
        """Return it as a value, with what this process has run of the firmware."""
        states = tuple(selector.snapshot() for selector in self.selectors)
        return replace(
            self, blocks=self.blocks | blocks_of(bench), ways=self.ways | ways_of(bench), selectors=[], selected=states
        )

    def _look(self, selector: Selector, event: Event) -> None:
        if selector.takes(event):
            self.happened.add(selector.words)

    def _take(self, event: Event) -> None:
        if isinstance(event, Pose):
            if event.t % WAY_NS == 0:
                self.way_mm.append((event.x // 1000, event.y // 1000))
        elif isinstance(event, Contact):
            self.hits.append(HullContact(t=event.t, what=event.what, part=event.part, x_m=event.x_m, y_m=event.y_m))
        elif isinstance(event, Text):
            self._print(_FIGURES.sub("#", event.data.decode("ascii", "replace").strip()))

    def _print(self, line: str) -> None:
        if line not in self.printed:
            if len(self.printed) == MOST_LINES:
                return
            self.printed[line] = None
        if line != self.last:
            if self.last and len(self.transitions) < MOST_TRANSITIONS:
                self.transitions[f"{self.last} → {line}"] = None
            self.last = line


#: Puts a bench at its beginning where its run goes on, and returns what the run had shown until there.
Start = Callable[[Bench], SeenSoFar]


def run_trial(trial: Trial, look: Callable[[], None] | None = None, start: Start | None = None) -> Outcome:
    """Carry a trial out in this process.

    Args:
        trial: What to run.
        look: Called between slices of the run; what it raises ends it, a `P2osError` as an outcome.
        start: Where it goes on, in place of its beginning.
    """
    with unpacked(trial.files) as folder:
        try:
            bench = bench_of(trial.scenario(folder))
            seen = SeenSoFar() if start is None else start(bench)
            seen.subscribe(bench, trial.looks_for)
            if look is not None:
                for one in bench.robots.values():
                    one.on_slice = lambda _now: look()
            bench.run_until(bench.end)
            return outcome_of(bench, seen, trial.disturbed_by)
        except P2osError as error:
            hint = f" ({error.hint})" if error.hint else ""
            return Outcome(verdict=TrialVerdict.ERROR, failures=(f"{error}{hint}",))


def warm_up(trial: Trial) -> None:
    """Load what every run of the trial's files needs, so that forks of this process have it."""
    with unpacked(trial.files) as folder:
        try:
            bench_of(trial.scenario(folder))
        except P2osError:
            return  # each run tells it


@contextmanager
def unpacked(files: Mapping[str, bytes]) -> Iterator[Path]:
    """Have the files of a trial in a folder for a block; it is kept for the next trial that has the same."""
    key = tuple(sorted(files.items()))
    yield Path(_folder_of(key).name)


def bench_of(scenario: Scenario) -> Bench:
    """Return a bench at its beginning; its firmware's file is read once in a process."""
    if scenario.robots:
        return Bench.from_scenario(scenario)
    stat = scenario.firmware.stat()
    return Bench(scenario, chip=boot(scenario, _image_of(scenario.firmware, stat.st_mtime_ns, stat.st_size)))


def outcome_of(bench: Bench, seen: SeenSoFar, disturbed_by: frozenset[str] = frozenset()) -> Outcome:
    """End a run and return what came of it; `disturbed_by` as of `Trial`."""
    end = bench.finish()
    goals: list[GoalResult] = []
    failures: list[str] = []
    hashes: list[str] = []
    died = ""
    for name, one in bench.robots.items():
        robot = name if len(bench.robots) > 1 else ""
        before = f"{robot}: " if robot else ""
        if one.chip.has_died:
            failures.append(before + one.chip.verdict)
            died = died or failures[-1]
        found = _goals(one, end, robot, disturbed_by)
        goals += found
        failures += [f"{before}{goal.kind}: {goal.says}" for goal in found if goal.met is False and not goal.is_excused]
        hashes.append(one.trace.sha256)
    clearances = [run_of(one).recorder.min_clearance_m for one in bench.robots.values()]
    known = [clearance for clearance in clearances if clearance is not None]
    return Outcome(
        verdict=TrialVerdict.FAILED if failures else TrialVerdict.PASSED, failures=tuple(failures), goals=tuple(goals),
        virtual_ns=end, sha256=hashes[0] if len(hashes) == 1 else hashlib.sha256("".join(hashes).encode()).hexdigest(),
        distance_m=round(run_of(bench).recorder.distance_m, 6), clearance_m=round(min(known), 6) if known else None,
        hits=tuple(seen.hits), way_mm=tuple(seen.way_mm), died=died, blocks=seen.blocks | blocks_of(bench),
        ways=seen.ways | ways_of(bench), lines=frozenset(seen.printed), transitions=frozenset(seen.transitions),
        happened=frozenset(seen.happened),
    )  # fmt: skip


def blocks_of(bench: Bench) -> frozenset[int]:
    """Return the first address of each block of the firmware that this process has run of a bench, all its robots."""
    chips = (one.chip for one in bench.robots.values())
    return frozenset(block for chip in chips if isinstance(chip, BluePill) for block in chip.entered_blocks)


def ways_of(bench: Bench) -> frozenset[int]:
    """Return which ways this process has seen a bench's blocks go, as of `Outcome.ways`."""
    chips = (one.chip for one in bench.robots.values())
    return frozenset(
        end + is_elsewhere for chip in chips if isinstance(chip, BluePill) for end, is_elsewhere in chip.gone_ways
    )


def _goals(bench: Bench, end: Nanos, robot: str, disturbed_by: frozenset[str]) -> list[GoalResult]:
    found = []
    for one in run_of(bench).goals.at_end(run_of(bench).ended(end)):
        goal, outcome = one.goal, one.outcome
        by = outcome.robustness
        found.append(GoalResult(
            kind=goal.kind, wanted=goal.wanted, met=None if one.is_open else outcome.met, says=outcome.says,
            robustness=None if by is None else round(by, 9), unit="" if by is None else outcome.unit, robot=robot,
            is_excused=not one.is_open and not outcome.met
            and (goal.is_excused or bool(goal.excused_by & disturbed_by)),
        ))  # fmt: skip
    return found


def _pack_firmware(table: dict[str, object], scenario: Scenario, files: dict[str, bytes]) -> None:
    """Put the bytes of each program among the files; two robots with one program share it."""
    robots = table.get("robot")
    if not isinstance(robots, list):
        table["firmware"] = _packed(scenario.firmware, files)
        return
    found = {robot.name: robot.scenario.firmware for robot in scenario.robots if robot.scenario is not None}
    for one in robots:
        if one["name"] in found:
            one["firmware"] = _packed(found[str(one["name"])], files)
    table.pop("firmware", None)


def _pack_world(table: dict[str, object], scenario: Scenario, folder: Path, files: dict[str, bytes]) -> None:
    """Put a world's file among the files: as it is where it stands alone, else written as one that does."""
    world = str(table["world"])
    if world in known_worlds():
        return
    path = folder / world
    content = read_bytes(path)
    if path.suffix.lower() == ".toml" and b"[[import]]" not in content:
        table["world"] = _named(path.name, content, files)
        return
    text = write_world(load_world(scenario.world, seed=scenario.seed))
    table["world"] = _named(f"{path.stem}.toml", text.encode(), files)


def _pack_others(table: dict[str, object], folder: Path, files: dict[str, bytes]) -> None:
    """Put every other file that a value names among the files: robots, settings, classes of the user's, …."""
    for key, value in table.items():
        if isinstance(value, dict):
            _pack_others(value, folder, files)
        elif isinstance(value, list):
            for item in value:
                if isinstance(item, dict):
                    _pack_others(item, folder, files)
        elif isinstance(value, str) and key not in _WORDS and value not in files:
            if is_in_file(value):
                table[key] = _packed_code(Code(located(value, folder)), files) or value
            elif "." in Path(value).name and is_file(folder / value):
                table[key] = _packed(folder / value, files)


def _packed_code(code: Code, files: dict[str, bytes]) -> str:
    """Put all that can be imported beside a class among the files, in a folder of its own; empty: there is no file."""
    if not code.is_there:
        return ""
    there = code.file.parent
    into = f"code-{fingerprint_of(there).sha256[:12]}"
    files |= {f"{into}/{name}": read_bytes(path) for name, path in importable(there)}
    return f"{into}/{code.file.name}:{code.kind}"


def _packed(path: Path, files: dict[str, bytes]) -> str:
    return _named(path.name, read_bytes(path), files)


def _named(name: str, content: bytes, files: dict[str, bytes]) -> str:
    """Put a file among the files and return its name there: another one where that is taken by another content."""
    stem, suffix, number = Path(name).stem, Path(name).suffix, 1
    while files.get(name, content) != content:
        number += 1
        name = f"{stem}-{number}{suffix}"
    files[name] = content
    return name


def _write_files(files: Mapping[str, bytes], folder: Path) -> None:
    with writing(folder, hint=MAKE_ROOM):
        folder.mkdir(parents=True, exist_ok=True)
        for name, content in files.items():
            path = refuse_elsewhere(folder, name)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)


class _Folder:
    """A folder that is removed with the object, or at the end of the process that made it."""

    def __init__(self) -> None:
        with writing_temporary():
            self.name = tempfile.mkdtemp(prefix="p2os-trial-")
        weakref.finalize(self, _remove, self.name, os.getpid())


def _remove(folder: str, owner: int) -> None:
    if os.getpid() == owner:  # not a fork of it
        shutil.rmtree(folder, ignore_errors=True)


@lru_cache(maxsize=_KEPT_FOLDERS)
def _folder_of(files: tuple[tuple[str, bytes], ...]) -> _Folder:
    folder = _Folder()
    _write_files(dict(files), Path(folder.name))
    return folder


@lru_cache(maxsize=_KEPT_FOLDERS)
def _image_of(path: Path, _changed_ns: int, _size: int) -> Image:
    return load_image(path)
