"""Which source line makes a trial fail, by a version that passes it.

The version differs from the one that fails in some lines of code; where these are lines of one place, that is what
makes the trial fail, as everything else is the same. `changed_back` looks for the line without such a version.

Invariant: what is not shown by runs is said to be unknown, and never named as a line.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from textwrap import wrap

from bluepill_sim.program.image import Image, load_image
from bluepill_sim.program.version_difference import LineDifference, line_differences
from robot_bench.campaign.trial import Trial, TrialVerdict, run_trial, unpacked
from robot_bench.campaign.variants.against import Other, first_apart, reported
from simbase.errors import UsageError
from simbase.units import ranges_text

#: Columns of a terminal.
WIDTH = 80
#: chosen: more lines in a row than these are no place.
MOST_LINES = 4
#: chosen: lines with more than one other between them are two places; the compiler has moved what follows from one.
MOST_APART = 2


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


def by_version(trials: Sequence[Trial], other: Other) -> FaultLine:
    """Return the lines by which a program that fails some trials differs from one that passes the first that it can.

    Raises:
        UsageError: A trial does not fail, or the other version passes none.
        ImageError: A program cannot be read.
    """
    for trial in trials:
        failing, good = run_trial(trial), trial.with_firmware(other.content)
        if failing.verdict is not TrialVerdict.FAILED:
            raise UsageError(f"{trial.firmware_name} does not fail here", hint="explain a run that fails")
        passing = run_trial(good)
        if passing.verdict is TrialVerdict.PASSED:
            break
    else:
        why = next(iter(passing.failures), "it has no verdict")
        raise UsageError(f"{other.name} does not pass either: {why}", hint="--against a version that is good")
    parted = first_apart(trial, other)
    also = (failing.failures[0], *([] if parted is None else [reported(parted)]))
    found = line_differences(*(image_of(one) for one in (trial, good)))
    place = place_of(found)
    if not place:
        where = ", ".join(dict.fromkeys(_lines(one) for one in found)) or "no line of code, so data, or none is known"
        says = f"it differs from {other.name} in more than one place: {where}" if found else f"it differs in {where}"
        return FaultLine(line="", says=says, also=also)
    by = ", by a number, which may be that of a macro" if all(one.is_number for one in found) else ""
    return FaultLine(line=place, says=f"{other.name} passes, and differs there alone{by}", also=also)


def place_of(found: Sequence[LineDifference]) -> str:
    """Return the one place of the differences between two versions: `a.c:12-14`; empty where it is not one.

    Where lines have no code in our version, these count: what follows in other lines is the compiler's. Lines that only
    compute do not count where others of the function differ, but for its first and last: what took their result may be
    what has changed.
    """
    most = max((one.missing for one in found), default=0)
    chosen = [one for one in found if one.missing == most] if most else [*found]
    if len({one.function for one in found if one.missing}) > 1 or len({one.function for one in chosen}) != 1:
        return ""
    if most and (len(chosen) > 1 or (not chosen[0].missing_acts and any(_is_beside(one, chosen[0]) for one in found))):
        return ""
    lines = sorted({place for one in chosen for place in (one.theirs or one.ours)})
    if not lines or len(lines) > MOST_LINES or len({file for file, _ in lines}) != 1:
        return ""
    if any(after - before > MOST_APART for (_, before), (_, after) in pairwise(lines)):
        return ""
    if lines[0][0].endswith(".h"):
        return ""  # inlined, so from a line that the table does not tell
    return f"{lines[0][0]}:{ranges_text([line for _, line in lines])}"


def _is_beside(one: LineDifference, chosen: LineDifference) -> bool:
    return one is not chosen and one.function == chosen.function and not one.is_edge


def _lines(one: LineDifference) -> str:
    places = one.theirs or one.ours
    return f"{places[0][0]}:{ranges_text(sorted({line for _, line in places}))} ({one.function})"


def image_of(trial: Trial) -> Image:
    """Return the program of a trial."""
    with unpacked(trial.files) as folder:
        return load_image(folder / trial.firmware_name)
