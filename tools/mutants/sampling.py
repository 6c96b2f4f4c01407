"""Many mutants judged, in several copies of the tree at once.

Invariant: a sample is the first of a drawn order that count, whatever takes how long.
"""

import sys
from collections.abc import Container, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import SimpleQueue
from typing import Self

from tools.mutants.changes import ChangeError
from tools.mutants.judge import NOTICED, Judge, MutantOutcome, MutantStatus, is_mutant
from tools.mutants.ledger import Ledger, Row
from tools.mutants.mutant import SourceMutant
from tools.mutants.natives import Natives
from tools.mutants.nearest import Nearest, cheapest_first
from tools.mutants.tree import TREE, Tree

#: Where the objects of sound sources are kept, in the project.
KEPT_OBJECTS = Path("build", "mutants", "objects")


class Court:
    """Copies of a tree with a judge each, made when the first mutants come.

    Args:
        root: The checkout.
        folder: Where the copies go.
        nearest: Which tests judge which line.
        ledger: What was judged before.
        paths: The files of the mutants.
        jobs: How many copies there are.
    """

    def __init__(
        self, root: Path, folder: Path, nearest: Nearest, ledger: Ledger, paths: Iterable[str], jobs: int
    ) -> None:
        self._root, self._folder, self._paths, self._jobs = root, folder, [*paths], jobs
        self._nearest, self._ledger = nearest, ledger
        self._judges: list[Judge] = []
        self._digest, self._strangers = "", set[str]()
        self._free: SimpleQueue[Judge] = SimpleQueue()
        self._sound: dict[str, float | None] = {}
        self._digests: dict[str, str] = {}
        self._pool = ThreadPoolExecutor(jobs)

    def __enter__(self) -> Self:
        """Return it."""
        return self

    def __exit__(self, *_: object) -> None:
        """End what runs."""
        for judge in self._judges:
            judge.end()
        self._pool.shutdown(cancel_futures=True)

    def judged(self, mutants: Sequence[SourceMutant]) -> Iterable[MutantOutcome]:
        """Go through the judgements of mutants, in their order.

        Raises:
            OSError: A library does not compile as it stands.
            ChangeError: A file is part of no library that tests load.
        """
        if not self._judges:
            self._make()
        return self._pool.map(self._judgement, mutants)

    def _make(self) -> None:
        natives: Natives | None = None
        for number in range(self._jobs):
            place = self._folder / str(number)
            scratch = place / "scratch"
            scratch.mkdir(parents=True)
            tree = Tree(self._root, place)
            self._digest = tree.digest
            if natives is None:
                natives = Natives(tree.folder, scratch, self._paths, self._root / KEPT_OBJECTS)
                strangers = [path for path in self._paths if not path.endswith(".py") and not natives.knows(path)]
                if strangers and len(strangers) == len(self._paths):
                    raise ChangeError(f"{strangers[0]} is part of no library that the tests load")
                self._strangers = {*strangers}
            self._sound |= self._ledger.sound(tree.digest)
            beside = natives.beside(tree.folder, scratch)
            self._judges.append(Judge(tree, scratch, beside, self._sound, self._ledger.add_lasted))
            self._free.put(self._judges[-1])

    def _judgement(self, mutant: SourceMutant) -> MutantOutcome:
        if mutant.path in self._strangers or not is_mutant(mutant):
            return MutantOutcome(verdict=MutantStatus.NO_MUTANT)
        files = cheapest_first(self._nearest.of(mutant.path, mutant.first_line), self._ledger.lasted)
        asked = {name: self._digest_of(name) for name in files}
        judgement = self._ledger.judgement(mutant, asked)
        if judgement is None:
            judge = self._free.get()
            try:
                judgement = judge.judged(mutant, files)
            finally:
                self._free.put(judge)
            self._ledger.add(mutant, asked, judgement)
            self._ledger.add_sound(self._digest, {**self._sound})
        return judgement

    def _digest_of(self, name: str) -> str:
        if name not in self._digests:
            self._digests[name] = self._nearest.digest_of(name, self._folder / "0" / TREE)
        return self._digests[name]


def sample(
    court: Court, mutants: Sequence[SourceMutant], count: int | None, equivalent: Container[Row]
) -> list[tuple[SourceMutant, MutantOutcome]]:
    """Return the first mutants that count, with their judgements; all of them where no count is given.

    Args:
        court: Who judges.
        mutants: In the order of the draw.
        count: How many.
        equivalent: Rows of mutants that no test can notice: another is taken for each.
    """
    waiting = [mutant for mutant in mutants if mutant.row not in equivalent]
    wanted = len(waiting) if count is None else count
    done: list[tuple[SourceMutant, MutantOutcome]] = []
    while waiting and len(done) < wanted:
        batch, waiting = waiting[: wanted - len(done)], waiting[wanted - len(done) :]
        for mutant, judgement in zip(batch, court.judged(batch), strict=True):
            if judgement.verdict is MutantStatus.NO_MUTANT:
                continue
            done.append((mutant, judgement))
            noticed = sum(each.verdict in NOTICED for _, each in done)
            print(f"\r{len(done)} of {wanted}: {noticed} noticed", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return done
