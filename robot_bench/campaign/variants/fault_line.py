"""Which source line makes a trial fail: by a version that passes it, or by changing the program back.

A version that passes differs from the one that fails in some lines of code; where these are lines of one place, that
is what makes the trial fail, as everything else is the same. Without such a version each instruction that ran is
changed, one at a time, as `mutation` changes it: a change that makes the failing trial pass, and no passing one fail,
undoes the fault or goes round it. Only where all such changes are of one source line is that line named.

Invariant: what is not shown by runs is said to be unknown, and never named as a line.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from textwrap import wrap

from bluepill_sim.analysis.coverage import Coverage
from bluepill_sim.board import BluePill
from bluepill_sim.program.image import Image, load_image
from bluepill_sim.program.line_table import read_lines
from bluepill_sim.program.mutants import Mutant, mutants, mutated_file
from bluepill_sim.program.version_difference import LineDifference, line_differences
from robot_bench.campaign.conduct import PointRow, Workers
from robot_bench.campaign.trial import Trial, TrialVerdict, bench_of, run_trial, unpacked
from robot_bench.campaign.variants.against import Other, first_apart, reported
from simbase.errors import UsageError
from simbase.units import ranges_text

#: Columns of a terminal.
WIDTH = 80
#: chosen: more lines in a row than these are no place.
MOST_LINES = 4
#: chosen: fewer trials that pass show nothing of a change.
LEAST_PASSING = 3
#: chosen: so many are tried with each change that makes the failing one pass.
MOST_PASSING = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultLine:
    """What is known of where the fault is."""

    #: "dodge_fsm.c:122-123"; empty where it is not known.
    line: str
    #: In a sentence, what shows it, or why it is not known.
    says: str
    #: What else was found, a line each.
    also: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """Return all of it in lines."""
        head = f"cause: {self.line}: {self.says}" if self.line else f"unknown: {self.says}"
        rows = [head, *(f"  {one}" for one in self.also)]
        return "\n".join(line for row in rows for line in wrap(row, WIDTH, subsequent_indent="  "))


def by_version(trial: Trial, other: Other) -> FaultLine:
    """Return the lines by which a program that fails a trial differs from one that passes it.

    Raises:
        UsageError: The trial does not fail, or fails with the other version too.
        ImageError: A program cannot be read.
    """
    failing, good = run_trial(trial), trial.with_firmware(other.content)
    passing = run_trial(good)
    if failing.verdict is not TrialVerdict.FAILED:
        raise UsageError(f"{trial.firmware_name} does not fail here", hint="explain a run that fails")
    if passing.verdict is not TrialVerdict.PASSED:
        why = next(iter(passing.failures), "it has no verdict")
        raise UsageError(f"{other.name} does not pass either: {why}", hint="--against a version that is good")
    parted = first_apart(trial, other)
    also = (failing.failures[0], *([] if parted is None else [reported(parted)]))
    found = line_differences(*(_image(one) for one in (trial, good)))
    place = place_of(found)
    if not place:
        where = ", ".join(dict.fromkeys(_lines(one) for one in found)) or "no line of code, so data, or none is known"
        says = f"it differs from {other.name} in more than one place: {where}" if found else f"it differs in {where}"
        return FaultLine(line="", says=says, also=also)
    return FaultLine(line=place, says=f"{other.name} passes, and differs there alone", also=also)


def place_of(found: Sequence[LineDifference]) -> str:
    """Return the one place of the differences between two versions: `a.c:12-14`; empty where it is not one.

    Where lines have no code in our version, these count: what follows in other lines is the compiler's.
    """
    most = max((one.missing for one in found), default=0)
    chosen = [one for one in found if one.missing == most] if most else [*found]
    if len({one.function for one in found if one.missing}) > 1 or len({one.function for one in chosen}) != 1:
        return ""
    if most and len(chosen) > 1:
        return ""
    lines = sorted({place for one in chosen for place in (one.theirs or one.ours)})
    if not lines or len(lines) > MOST_LINES or len({file for file, _ in lines}) != 1:
        return ""
    if lines[0][0].endswith(".h"):
        return ""  # inlined, so from a line that the table does not tell
    return f"{lines[0][0]}:{ranges_text([line for _, line in lines])}"


def _lines(one: LineDifference) -> str:
    places = one.theirs or one.ours
    return f"{places[0][0]}:{ranges_text(sorted({line for _, line in places}))} ({one.function})"


@dataclass(slots=True)
class ChangedBack:
    """Looks for the single changes of a program that make a failing trial pass, and no passing one fail.

    Args:
        failing: The trial.
        passing: Others, that pass.
        passes: Tells whether a trial passes; it runs it.
    """

    failing: Trial
    passing: Sequence[Trial]
    passes: Callable[[Trial], bool]
    #: Every change, those that were found so far, and how many were tried.
    changes: Sequence[Mutant] = ()
    found: list[Mutant] = field(default_factory=list)
    tried: int = 0

    def __post_init__(self) -> None:
        """Find the changes: of what the failing trial runs."""
        self.changes = mutants(_image(self.failing), _ran(self.failing))

    @property
    def count(self) -> int:
        """How many changes there are."""
        return len(self.changes)

    def look(self) -> Iterator[int]:
        """Try one change after the other; yield how many were tried, so that the caller may end it."""
        image, content = _image(self.failing), self.failing.files[self.failing.firmware_name]
        short = _ends_when_missed(self.failing)
        for one in self.changes:
            changed = mutated_file(content, one, image)
            if self._passes(short, changed) and all(self._passes(trial, changed) for trial in self.passing):
                self.found.append(one)
            self.tried += 1
            yield self.tried

    def _passes(self, trial: Trial, changed: bytes) -> bool:
        return self.passes(trial.with_firmware(changed))

    @property
    def result(self) -> FaultLine:
        """What is known."""
        table = read_lines(_image(self.failing))
        also = tuple(
            f"{table.place(one.address) or hex(one.address)}: {one.alteration.before} -> {one.alteration.after}"
            for one in self.found
        )
        lines = {table.place(one.address) for one in self.found}
        tried = f"{self.tried} of {self.count} changes of an instruction were tried"
        if self.tried < self.count:
            return FaultLine(line="", says=f"{tried}, and the time was over", also=also)
        if len(self.passing) < LEAST_PASSING:
            return FaultLine(line="", says=f"{len(self.passing)} points pass, too few to judge a change by", also=also)
        if not lines:
            return FaultLine(line="", says=f"{tried}, and none makes it pass: a fault of omission, or of more than one")
        if len(lines) > 1 or "" in lines:
            return FaultLine(line="", says=f"{tried}, and those of more than one line make it pass", also=also)
        says = f"{tried}; only there a change makes it pass, and none of {len(self.passing)} passing points fail"
        return FaultLine(line=lines.pop(), says=says, also=also)


def passes(trial: Trial, workers: Workers) -> bool:
    """Tell whether a trial passes, run by workers: what never ends is ended by their limits."""
    found: list[TrialVerdict] = []
    workers.run([trial], lambda _, done: found.append(done[0].verdict))
    return found == [TrialVerdict.PASSED]


def _ends_when_missed(trial: Trial) -> Trial:
    """Return a trial that ends with the first goal that is missed."""
    goals = trial.table.get("goal")
    if not isinstance(goals, list):
        return trial
    return trial.with_lists(goal=[{**goal, "ends_run": "missed"} for goal in goals])


def _image(trial: Trial) -> Image:
    with unpacked(trial.files) as folder:
        return load_image(folder / trial.firmware_name)


def _ran(trial: Trial) -> list[int]:
    """Return the instructions that a trial executes."""
    outcome = run_trial(trial)
    with unpacked(trial.files) as folder:
        board = bench_of(trial.scenario(folder)).chip
    if not isinstance(board, BluePill):
        return []
    return sorted(Coverage.of_board(board, outcome.blocks, ()).instructions())


def failing_and_passing(rows: Sequence[PointRow]) -> tuple[Trial, list[Trial]]:
    """Return the failing trial of a campaign that is soonest over, and the passing ones that are, the first ones.

    Raises:
        UsageError: Nothing fails.
    """
    cheap = [row.cheap for row in rows]
    failing = [run for run in cheap if run.outcome.verdict is TrialVerdict.FAILED]
    if not failing:
        raise UsageError("nothing fails in this campaign", hint="explain a run that fails")
    passing = [run for run in cheap if run.outcome.verdict is TrialVerdict.PASSED and not run.outcome.excused_goals]
    by_time = sorted(passing, key=lambda run: run.outcome.virtual_ns)
    return min(failing, key=lambda run: run.outcome.virtual_ns).trial, [run.trial for run in by_time[:MOST_PASSING]]
