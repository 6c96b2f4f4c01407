"""Two versions of a firmware in one campaign: the worlds in which they differ are its failures.

Each trial is run with both. They differ where one fails and the other does not, where they miss different goals, or
where their margins part by more than `MOST_APART`. What the search is told is how near they are to that, so that it
goes towards worlds in which they part.

Invariant: two versions of which each leaves the trace of the other are never told to differ.
"""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from robot_bench.campaign.conduct import Workers
from robot_bench.campaign.margin import margin
from robot_bench.campaign.trial import Done, GoalResult, Outcome, Trial, TrialVerdict, bench_of, unpacked
from robot_bench.events.codec import events_of
from robot_bench.events.kinds import Event
from robot_bench.recording.divergence import Difference, differences
from simbase.errors import UsageError
from simbase.files import read_bytes, writing
from simbase.timing import NS_PER_S

#: The other version, in the campaign's folder, with the name that it had.
FOLDER = "against"
#: chosen: of margins from -1 to 1; a quarter of a metre, or two and a half seconds.
MOST_APART = 0.25
#: The kind of the one goal that such a campaign judges.
KIND = "against"


@dataclass(frozen=True, slots=True)
class Other:
    """The version that is compared with."""

    name: str
    content: bytes

    @property
    def sha256(self) -> str:
        """Of its bytes."""
        return hashlib.sha256(self.content).hexdigest()

    @classmethod
    def read(cls, path: Path) -> "Other":
        """Return a firmware file.

        Raises:
            UsageError: There is no such file, or it is too large.
        """
        return cls(path.name, read_bytes(path, UsageError, hint="give an ELF, HEX or BIN file"))

    def keep(self, folder: Path) -> None:
        """Keep it in a campaign's folder.

        Raises:
            FileError: The folder cannot be written.
        """
        with writing(folder, hint="--out another folder"):
            (folder / FOLDER).mkdir(parents=True, exist_ok=True)
            (folder / FOLDER / self.name).write_bytes(self.content)

    @classmethod
    def of(cls, folder: Path) -> "Other | None":
        """Return the version that a campaign's folder was begun against; None where there is none."""
        files = sorted((folder / FOLDER).glob("*")) if (folder / FOLDER).is_dir() else []
        return cls(files[0].name, read_bytes(files[0])) if files else None


class Against:
    """Workers that run each trial with both versions.

    Args:
        workers: Who runs.
        other: The other version.
    """

    def __init__(self, workers: Workers, other: Other) -> None:
        self._workers, self._other = workers, other

    def run(self, trials: Sequence[Trial], on_done: Callable[[int, Done], None], *, anew: bool = False) -> None:
        """Run all; call `on_done` with the place of each and how the two versions compare."""
        found: dict[int, Done] = {}
        both = [version for trial in trials for version in (trial, trial.with_firmware(self._other.content))]

        def on_one(number: int, done: Done) -> None:
            found[number] = done
            place, pair = number // 2, (number // 2 * 2, number // 2 * 2 + 1)
            if all(each in found for each in pair):
                (one, one_s), (other, other_s) = (found.pop(each) for each in pair)
                names = trials[place].firmware_name, self._other.name
                on_done(place, (compared(one, other, names), one_s + other_s))

        self._workers.run(both, on_one, anew=anew)

    def close(self) -> None:
        """End the workers."""
        self._workers.close()


def compared(one: Outcome, other: Outcome, names: tuple[str, str]) -> Outcome:
    """Return how two runs of one trial compare, as an outcome that fails where they differ.

    Args:
        one: Of the program of the trial; way and contacts are those of its run, or of the other where that alone fails.
        other: Of the other one.
        names: What the two are called.
    """
    errors = [f"{name}: {run.failures[0]}" for name, run in zip(names, (one, other), strict=True)
              if run.verdict is TrialVerdict.ERROR and run.failures]  # fmt: skip
    if TrialVerdict.ERROR in {one.verdict, other.verdict}:
        return replace(one, verdict=TrialVerdict.ERROR, failures=tuple(errors), goals=())
    margins = margin(one) or 0.0, margin(other) or 0.0
    apart = abs(margins[0] - margins[1])
    is_other = _missed(one) != _missed(other)
    by = MOST_APART - apart if not is_other else min(MOST_APART - apart, 0.0)
    differs = is_other or apart > MOST_APART
    says = "; ".join(f"{name} {_reported(run, at)}" for name, run, at in zip(names, (one, other), margins, strict=True))
    goal = GoalResult(
        kind=KIND, wanted=f"does what {names[1]} does", met=not differs, says=says, robustness=round(by, 9), unit=""
    )
    both = hashlib.sha256(f"{one.sha256} {other.sha256}".encode()).hexdigest()
    is_others = one.verdict is TrialVerdict.PASSED and other.verdict is TrialVerdict.FAILED
    seen = other if is_others else one
    return replace(
        seen, verdict=TrialVerdict.FAILED if differs else TrialVerdict.PASSED, goals=(goal,), sha256=both, died="",
        failures=(f"{KIND}: {says}",) if differs else (),
        blocks=one.blocks | other.blocks, ways=one.ways | other.ways, lines=one.lines | other.lines,
        transitions=one.transitions | other.transitions, happened=one.happened | other.happened,
    )  # fmt: skip


def first_apart(trial: Trial, other: Other) -> Difference | None:
    """Return what differs first between the runs of both versions; None where nothing does."""
    found = differences(*(_events(version) for version in (trial, trial.with_firmware(other.content))))
    return found[0] if found else None


def reported(difference: Difference) -> str:
    """Return when and in what two runs part."""
    return f"they part at {difference.at / NS_PER_S:.6f} s, first in {difference.signal}"


def _events(trial: Trial) -> list[Event]:
    with unpacked(trial.files) as folder:
        bench = bench_of(trial.scenario(folder))
        bench.run_until(bench.end)
        bench.finish()
        return list(events_of(bench.trace.lines()))


def _missed(outcome: Outcome) -> object:
    return frozenset((goal.robot, goal.wanted) for goal in outcome.failing_goals), bool(outcome.died)


def _reported(outcome: Outcome, at: float) -> str:
    return f"{outcome.failures[0] if outcome.failures else 'passes'} (margin {at:.2f})"
