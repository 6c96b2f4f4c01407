"""How programs are run: who listens, on which core, for how long, in which slices; and the comparison of them all.

What is compared of a run is what its level writes down; a level without listeners is compared by its final state alone,
with that of a run that was listened to: listening changes nothing.
"""

import shutil
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from tools.compare_chip.differences import STATE, ChipDifference, compare
from tools.compare_chip.generator import labels_at
from tools.compare_chip.programs import MS, script_of
from tools.compare_chip.worker import Worker, WorkerError

HEARD = ("edges", "characters")


@dataclass(frozen=True, slots=True, kw_only=True)
class Level:
    """One way to look at a run."""

    name: str
    #: What it means, for people.
    doc: str
    core: str = "native"
    #: Virtual time, and that of `--quick`, in ms.
    ms: int
    quick_ms: int
    #: What is written down beside the state.
    kinds: tuple[str, ...] = HEARD


#: Levels of one time are compared with the first of them.
LEVELS = (
    Level(name="recorded", doc="every block", ms=20, quick_ms=4, kinds=(*HEARD, "blocks")),
    Level(name="heard", doc="edges and characters", ms=100, quick_ms=20),
    Level(name="watched", doc="slices end at edges", ms=40, quick_ms=8),
    Level(name="blind", doc="nobody listens", ms=100, quick_ms=20, kinds=()),
    Level(name="restored", doc="a snapshot goes on", ms=100, quick_ms=20),
    Level(name="python", doc="Python core, every block", core="python", ms=4, quick_ms=1, kinds=(*HEARD, "blocks")),
)
#: One call, the bench's slice, a shorter one, an odd one, and random ones.
SLICES: tuple[int | str, ...] = ("whole", 1_000_000, 100_000, 7_919, "random")
WORDS = {"whole": "one call", "random": "random slices"}


#: chosen: different differences of a program that are printed; the others are counted.
MOST_SHOWN = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparedRun:
    """One run of a program, on whichever chip."""

    program: str
    image: Path
    level: Level
    end_ns: int
    slices: int | str = "whole"
    #: Of the inputs and of random slices.
    seed: int

    def __str__(self) -> str:
        """Return it for a person."""
        length = f"slices of {self.slices:,} ns" if isinstance(self.slices, int) else WORDS[self.slices]
        return f"{self.program}, {self.level.name}, {length}"

    def job(self, folder: Path, addresses: dict[str, int]) -> dict[str, Any]:
        """Return what the probe is asked."""
        return {
            "image": str(self.image),
            "folder": str(folder),
            "core": self.level.core,
            "kinds": self.level.kinds,
            "level": self.level.name,
            "end_ns": self.end_ns,
            "slices": f"random {self.seed}" if self.slices == "random" else self.slices,
            "script": script_of(self.program, self.seed, self.end_ns),
            "addresses": addresses,
        }


@dataclass
class ChipComparison:
    """Runs programs on two chips and tells what differs."""

    old: Worker
    new: Worker
    #: For what is written down.
    folder: Path
    #: Takes lines for a person.
    say: Callable[[str], None]
    seed: int = 0
    slices: tuple[int | str, ...] = SLICES
    is_quick: bool = False
    #: Which core of the new chip stands in for its native one.
    core: str = "native"
    #: Runs that were compared, those that differ, and those that differ on both chips alike: no difference of the two.
    runs: int = 0
    differing: int = 0
    alike: int = 0
    _addresses: dict[str, int] = field(default_factory=dict)

    def compare(self, program: str, image: Path, levels: Iterable[Level] = LEVELS) -> bool:
        """Run a program every way; tell whether it is the same everywhere, and say what is not."""
        references: dict[int, Reference] = {}
        #: Runs by how they differ.
        found: dict[str, list[ComparedRun]] = {}
        before = self.differing
        for level in levels:
            end_ns = (level.quick_ms if self.is_quick else level.ms) * MS
            run = ComparedRun(program=program, image=image, level=level, end_ns=end_ns, seed=self.seed)
            if end_ns not in references:
                made = self._run(self.old, replace(run, level=replace(level, core="native")))
                if isinstance(made, str):
                    found.setdefault(f"the old chip {made}", []).append(run)
                    self.differing += 1
                    continue
                references[end_ns] = made
            for slices in self.slices:
                sliced = replace(run, slices=slices)
                text = self._compare_run(sliced, references[end_ns])
                if text:
                    found.setdefault(text, []).append(sliced)
        for folder, _ in references.values():
            shutil.rmtree(folder)
        self._tell(found)
        return self.differing == before

    def _compare_run(self, run: ComparedRun, reference: "Reference") -> str:
        """Return how a run on the new chip differs from that of the old one; empty where it does not."""
        self.runs += 1
        level = run.level
        other = replace(level, core=self.core) if level.core == "native" else level
        new = self._differences(self.new, replace(run, level=other), reference)
        if not new:
            return ""
        old = self._differences(self.old, run, reference)
        note = []
        if old == new:
            self.alike += 1
            note = ["the old chip differs alike from its own first run"]
        else:
            self.differing += 1
            if old:
                note = ["the old chip differs too from its own first run, in another way"]
        return "\n".join([*note, *(new if isinstance(new[0], str) else self._texts(run, new))])

    def _differences(self, worker: Worker, run: ComparedRun, reference: "Reference") -> list[Any]:
        """Run a program and return its differences; a text where it did not run."""
        made = self._run(worker, run)
        if isinstance(made, str):
            return [f"it {made}"]
        folder, kinds = reference
        found = compare(folder, made[0], [*(kind for kind in run.level.kinds if kind in kinds), STATE])
        shutil.rmtree(made[0])
        return found

    def _run(self, worker: Worker, run: ComparedRun) -> "Reference | str":
        """Run a program; return what was seen, or what happened instead."""
        folder = Path(tempfile.mkdtemp(dir=self.folder))
        try:
            self._addresses = self._addresses or self.old.ask("registers", folder=str(self.folder))["addresses"]
            worker.ask("run", **run.job(folder, self._addresses))
        except WorkerError as error:
            shutil.rmtree(folder)
            return str(error)
        return folder, set(run.level.kinds)

    def _texts(self, run: ComparedRun, found: list[ChipDifference]) -> list[str]:
        """Return differences for a person, with the symbols of the program where it has any."""
        addresses = sorted(set().union(*(difference.addresses() for difference in found)))
        names = labels_at(run.image, addresses)
        if not names:
            try:
                answer = self.old.ask("symbols", image=str(run.image), addresses=[int(at, 0) for at in addresses])
                names = dict(zip(addresses, answer["where"], strict=True))
            except WorkerError:
                names = {}
        return [one.text(lambda address: names.get(address, address)) for one in found]

    def _tell(self, found: dict[str, list[ComparedRun]]) -> None:
        for text, runs in list(found.items())[:MOST_SHOWN]:
            self.say("\n".join([f"  {runs[0]}", *(f"    {line}" for line in text.splitlines())]))
            if len(runs) > 1:
                self.say(f"    and alike in {len(runs) - 1} more runs, the last: {runs[-1]}")
        if len(found) > MOST_SHOWN:
            self.say(f"  {len(found) - MOST_SHOWN} more differences (--level and --slices show them)")


#: The folder of what was seen, and of which kinds.
Reference = tuple[Path, set[str]]
