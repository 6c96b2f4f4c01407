"""Who proposes the points of a campaign: searches of well-kept libraries behind one question and one answer.

    grid              every step of each dimension, as many as the budget allows
    random            each point by itself
    latin-hypercube   spread evenly along each dimension                  scipy
    sobol             spread evenly in the whole space                    scipy
    tpe               mixed spaces: numbers and choices                   optuna
    cma-es            towards the least margin, along correlated numbers  ribs
    quality-diversity the least margin in each place where the robot ends ribs
    coverage          near inputs that reached code or states that are new

A search is asked for a batch and told all of it before it is asked again, in the order of the points. It tells the
same points for the same seed, batch and answers, whoever works on them in whatever order.

Invariant: a search knows points and answers, nothing of scenarios or robots.
"""

import itertools
import math
import random
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from types import ModuleType
from typing import Any, Protocol

from simbase.errors import MissingDependencyError

Point = tuple[float, ...]
#: chosen: coordinates stay off the ends, so that each rounds to a value of its range.
MOST = 1 - 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class PointResult:
    """What came of a point."""

    #: By how much all goals were met, about 0 to 1; negative where one was missed.
    margin: float
    #: Where the robot ended, as shares of the floor, 0 to 1.
    ended: tuple[float, float] = (0.5, 0.5)
    #: What was reached: blocks of the firmware, states that it printed.
    reached: frozenset[object] = field(default_factory=frozenset)
    #: Of which dimensions the coordinates had an effect; none is said: of all.
    acting: frozenset[int] = frozenset()
    #: It missed goals that do not judge it: it shows less than others.
    is_excused: bool = False


class Search(Protocol):
    """Proposes points."""

    def ask(self, count: int) -> list[Point]:
        """Return at most so many points; none where it has no more."""

    def tell(self, answers: Sequence[PointResult]) -> None:
        """Take what came of the points that were asked for last, of all of them, in their order."""

    def is_drawn(self, point: Point, /) -> bool:
        """Tell whether a point was drawn evenly from the whole space, so that such points tell of all of it."""


@dataclass(frozen=True, slots=True)
class Problem:
    """What a search is made for."""

    #: Of each dimension how many values it has; 0 where it is a range.
    counts: tuple[int, ...]
    #: Whether its values have an order.
    is_ordered: tuple[bool, ...]
    runs: int
    batch: int
    seed: int
    #: Points of a corpus, which reached something once.
    corpus: tuple[Point, ...] = ()


class Listed:
    """A list of points that is known beforehand."""

    def __init__(self, points: Iterator[Point], *, is_drawn: bool = True) -> None:
        self._points, self._is_drawn = points, is_drawn

    def ask(self, count: int) -> list[Point]:
        """Return the next ones."""
        return list(itertools.islice(self._points, count))

    def tell(self, answers: Sequence[PointResult]) -> None:
        """Answers change nothing."""

    def is_drawn(self, _point: Point, /) -> bool:
        """All are, or none."""
        return self._is_drawn


def grid(problem: Problem) -> Search:
    """Return every step of each dimension; of a range as many as the budget allows, in one order.

    The first dimension changes slowest.
    """
    ranges = problem.counts.count(0)
    fixed = math.prod(count or 1 for count in problem.counts)
    steps = max(int((problem.runs / fixed) ** (1 / ranges) + 1e-9), 1) if ranges else 0
    axes = [[(step + 0.5) / (count or steps) for step in range(count or steps)] for count in problem.counts]
    return Listed(itertools.product(*axes), is_drawn=False)


def at_random(problem: Problem) -> Search:
    """Return points that are each drawn by themselves."""
    source = random.Random(problem.seed)
    return Listed(tuple(source.random() for _ in problem.counts) for _ in itertools.count())


def latin_hypercube(problem: Problem) -> Search:
    """Return points of which each dimension has one in each of as many equal parts as there are runs."""
    qmc = _library("scipy.stats.qmc", "scipy")
    sampler = qmc.LatinHypercube(len(problem.counts), rng=problem.seed)
    return Listed(_points(sampler.random(problem.runs)))


def sobol(problem: Problem) -> Search:
    """Return the points of a scrambled Sobol sequence."""
    qmc = _library("scipy.stats.qmc", "scipy")
    sampler = qmc.Sobol(len(problem.counts), rng=problem.seed)
    exponent = max(math.ceil(math.log2(problem.runs)), 1)
    return Listed(_points(sampler.random_base2(exponent)))


class Tpe:
    """Tree-structured Parzen estimators on mixed spaces; choices are choices there."""

    def __init__(self, problem: Problem) -> None:
        optuna = _library("optuna")
        optuna.logging.set_verbosity(optuna.logging.ERROR)
        sampler = optuna.samplers.TPESampler(seed=problem.seed, n_startup_trials=problem.batch, constant_liar=True)
        self._study = optuna.create_study(sampler=sampler)
        distributions = optuna.distributions
        self._space = {
            f"{number:04d}": distributions.FloatDistribution(0.0, MOST) if is_ordered or not count
            else distributions.CategoricalDistribution(tuple(range(count)))
            for number, (count, is_ordered) in enumerate(zip(problem.counts, problem.is_ordered, strict=True))
        }  # fmt: skip
        self._counts = problem.counts
        self._asked: list[Any] = []

    def ask(self, count: int) -> list[Point]:
        """Return the next points."""
        self._asked = [self._study.ask(self._space) for _ in range(count)]
        return [
            tuple(
                (value + 0.5) / count if isinstance(value, int) else float(value)
                for count, (_, value) in zip(self._counts, sorted(trial.params.items()), strict=True)
            )
            for trial in self._asked
        ]

    def tell(self, answers: Sequence[PointResult]) -> None:
        """Take the margins."""
        for trial, answer in zip(self._asked, answers, strict=True):
            self._study.tell(trial, answer.margin)
        self._asked = []

    def is_drawn(self, _point: Point, /) -> bool:
        """None is: each goes where others were near a failure."""
        return False


#: Diagonal: it learns the scale of each of fifty dimensions in few generations.
ES = "sep_cma_es"


class Evolution:
    """CMA-ES of ribs, towards the least margin; with `is_diverse` in every place where a robot may end."""

    #: chosen: cells along each side of the floor, about half a metre of a room.
    CELLS = 12
    #: chosen: a step at first, of the unit interval.
    SIGMA = 0.25

    def __init__(self, problem: Problem, *, is_diverse: bool) -> None:
        archives, emitters, schedulers = (_library(f"ribs.{name}") for name in ("archives", "emitters", "schedulers"))
        dimensions = len(problem.counts)
        ranges = [(0.0, 1.0), (0.0, 1.0)]
        shape = [self.CELLS, self.CELLS] if is_diverse else [1, 1]
        archive = archives.GridArchive(solution_dim=dimensions, dims=shape, ranges=ranges, seed=problem.seed)
        emitter = emitters.EvolutionStrategyEmitter(
            archive, es=ES, x0=[0.5] * dimensions, sigma0=self.SIGMA, ranker="2imp" if is_diverse else "obj",
            bounds=[(0.0, MOST)] * dimensions, batch_size=problem.batch, seed=problem.seed,
            restart_rule="no_improvement" if is_diverse else 5,
        )  # fmt: skip
        self._scheduler = schedulers.Scheduler(archive, [emitter])
        self._batch = problem.batch

    def ask(self, count: int) -> list[Point]:
        """Return the next generation, which is a batch; none where less is left than that."""
        return list(_points(self._scheduler.ask())) if count >= self._batch else []

    def tell(self, answers: Sequence[PointResult]) -> None:
        """Take margins, and where the robots ended."""
        self._scheduler.tell([-answer.margin for answer in answers], [list(answer.ended) for answer in answers])

    def is_drawn(self, _point: Point, /) -> bool:
        """None is: each goes where others were near a failure."""
        return False


@dataclass(slots=True)
class _KeptPoint:
    """A point that reached something new."""

    point: Point
    #: Its dimensions that had an effect.
    acting: Sequence[int]
    is_excused: bool
    #: How often it was varied.
    uses: int = 0


class Guided:
    """Keeps points that reached something new, and varies them; begins with a corpus, then with points spread evenly.

    A kept point is varied in a few of its coordinates that had an effect, the least tried ones first; each fourth point
    is a new one. What is rarely drawn reaches something new as often as not, so that its variations would be most of
    the points: those that are excused, and show the less, are varied only while they are few.
    """

    #: chosen: so many coordinates change at once on average.
    CHANGED = 2.0
    #: chosen: how far, of the unit interval.
    STEP = 0.15
    #: chosen: one of so many points is a new one.
    NEW_EVERY = 4
    #: chosen: at most so much of the points is spent on the corpus, the newest of it.
    CORPUS_SHARE = 0.5
    #: chosen: no point that was excused is varied where so much of all were, or may be.
    EXCUSED_SHARE = 0.05

    def __init__(self, problem: Problem) -> None:
        self._random = random.Random(problem.seed)
        self._fresh = sobol(problem)
        most = int(problem.runs * self.CORPUS_SHARE)
        self._corpus = list(problem.corpus[-most:]) if most else []
        self._first = problem.batch
        self._count = 0
        self._seen: set[object] = set()
        self._kept: list[_KeptPoint] = []
        self._asked: list[Point] = []
        self._drawn: set[Point] = set()
        #: How many points have an answer, and how many of them were excused.
        self._answered = self._excused = 0

    def ask(self, count: int) -> list[Point]:
        """Return points of the corpus; then variations of what was kept, and new points."""
        found: list[Point] = []
        excused = self._excused
        for _ in range(count):
            if self._corpus:
                found.append(self._corpus.pop(0))
                continue
            self._count += 1
            is_spent = excused >= self.EXCUSED_SHARE * (self._answered + len(found))
            kept = [one for one in self._kept if not (is_spent and one.is_excused)]
            if not kept or self._count <= self._first or self._count % self.NEW_EVERY == 0:
                found += (fresh := self._fresh.ask(1))
                self._drawn.update(fresh)
            else:
                chosen = min(kept, key=lambda one: one.uses)
                chosen.uses += 1
                excused += chosen.is_excused  # as it may well be
                found.append(self._varied(chosen.point, chosen.acting))
        self._asked = found
        return found

    def tell(self, answers: Sequence[PointResult]) -> None:
        """Keep what reached something new."""
        for point, answer in zip(self._asked, answers, strict=True):
            self._answered += 1
            self._excused += answer.is_excused
            if not answer.reached <= self._seen:
                self._seen |= answer.reached
                self._kept.append(_KeptPoint(point, sorted(answer.acting) or range(len(point)), answer.is_excused))

    def is_drawn(self, point: Point, /) -> bool:
        """The new ones are."""
        return point in self._drawn

    def _varied(self, point: Point, acting: Sequence[int]) -> Point:
        share = min(self.CHANGED / len(acting), 1.0)
        chosen = {at for at in acting if self._random.random() < share} or {self._random.choice(acting)}
        return tuple(self._changed(at) if number in chosen else at for number, at in enumerate(point))

    def _changed(self, at: float) -> float:
        """Return another coordinate: as often one nearby as any."""
        if self._random.random() < 0.5:
            return self._random.random()
        return min(max(at + self._random.gauss(0.0, self.STEP), 0.0), MOST)


#: Name → what makes the search.
SEARCHES: Mapping[str, Callable[[Problem], Search]] = {
    "grid": grid,
    "random": at_random,
    "latin-hypercube": latin_hypercube,
    "sobol": sobol,
    "tpe": Tpe,
    "cma-es": lambda problem: Evolution(problem, is_diverse=False),
    "quality-diversity": lambda problem: Evolution(problem, is_diverse=True),
    "coverage": Guided,
}


def _points(rows: Any) -> Iterator[Point]:
    return (tuple(min(max(float(at), 0.0), MOST) for at in row) for row in rows)


def _library(name: str, shown: str = "") -> ModuleType:
    try:
        return import_module(name)
    except ImportError as error:
        raise MissingDependencyError(
            f"this search needs {shown or name.partition('.')[0]}", extra="campaign", hint='search = "random"'
        ) from error
