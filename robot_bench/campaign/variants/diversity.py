"""How different failures are: which of them are one, and a number for how far the rest lie apart.

The world's plan is cut into cells, `CELLS` along each side of its extent, so that worlds of any size compare. A trial
is the set of cells that its things cover, without those that every trial has (walls); a way is the set of cells that
the robot went through. The distance of two sets is Jaccard's, and the diversity of a list is the mean over all pairs:

    d(A, B) = |A Δ B| / |A ∪ B|      0 equal, 1 nothing in common; two empty sets are equal
    D = 2 / (n (n - 1)) Σ d(Ai, Aj)     for i < j; none of fewer than two

Two failures are one where they fail in the same way, by the same kind of contact, and the program took the same path:
the distance of the blocks that ran is at most `SAME_PATH`. An interrupt may begin a block anywhere, which is why it is
not 0.

Invariant: no order of the failures changes a number; clusters are in the order of their first members.
"""

from collections.abc import Hashable, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace
from itertools import combinations, pairwise

from p2os.pioneer.world import load_world
from p2os.pioneer.world.geometry import Footprint
from robot_bench.campaign.conduct import PointRow
from robot_bench.campaign.trial import Outcome, Trial, unpacked
from robot_bench.scenario.scenario import Scenario

#: chosen: a robot's length in a room.
CELLS = 16
#: chosen: runs of `dodge` from starts a centimetre apart run the same blocks; another turn makes 4 % of them others.
SAME_PATH = 0.02
#: chosen: so many points of a kind are named.
MOST_NAMED = 6
_Cells = frozenset[Hashable]


@dataclass(frozen=True, slots=True)
class Diversity:
    """How far failures lie apart, 0 to 1; None of fewer than two."""

    obstacles: float | None
    ways: float | None


@dataclass(frozen=True, slots=True)
class FailureSet:
    """The failures of a campaign: how many kinds they are, and how different."""

    #: The numbers of the points of each kind.
    kinds: list[list[int]]
    diversity: Diversity

    @classmethod
    def of(cls, rows: Sequence[PointRow]) -> "FailureSet":
        """Return that of the points that failed."""
        runs = [(row.number, run) for row in rows if (run := row.failing) is not None]
        outcomes = [run.outcome for _, run in runs]
        kinds = [[runs[place][0] for place in cluster] for cluster in clusters(outcomes)]
        return cls(kinds, diversity([run.trial for _, run in runs], outcomes))

    def words(self) -> dict[str, str]:
        """Return it for a person: what → how much."""
        found = {"kinds of failures": f"{len(self.kinds)}: points {' | '.join(_numbers(kind) for kind in self.kinds)}"}
        apart = {"obstacles": self.diversity.obstacles, "ways": self.diversity.ways}
        said = [f"of {what} {value:.2f}" for what, value in apart.items() if value is not None]
        return found | ({"diversity": f"{', '.join(said)} (0 alike, 1 nothing in common)"} if said else {})

    def to_plain(self) -> dict[str, object]:
        """Return it as JSON has it."""
        return {
            "clusters": self.kinds,
            "diversity": {"obstacles": self.diversity.obstacles, "ways": self.diversity.ways},
        }


def _numbers(kind: Sequence[int]) -> str:
    """Return the numbers of points, the first few of many."""
    more = f" and {len(kind) - MOST_NAMED} more" if len(kind) > MOST_NAMED else ""
    return ", ".join(map(str, kind[:MOST_NAMED])) + more


def diversity(trials: Sequence[Trial], outcomes: Sequence[Outcome]) -> Diversity:
    """Return the diversity of trials by what stands in them, and of their runs by where the robot went.

    Raises:
        ScenarioError: A trial cannot be run.
    """
    scenes = [_scene(trial) for trial in trials]
    shared = frozenset.intersection(*(covered for _, covered in scenes)) if scenes else frozenset()
    ways = [way_cells(outcome, extent) for outcome, (extent, _) in zip(outcomes, scenes, strict=True)]
    return Diversity(mean_distance([covered - shared for _, covered in scenes]), mean_distance(ways))


def mean_distance(sets: Sequence[AbstractSet[Hashable]]) -> float | None:
    """Return the mean distance of all pairs of sets, 0 to 1; None of fewer than two."""
    pairs = [distance(one, other) for one, other in combinations(sets, 2)]
    return sum(pairs) / len(pairs) if pairs else None


def distance(one: AbstractSet[Hashable], other: AbstractSet[Hashable]) -> float:
    """Return the distance of two sets, 0 (equal) to 1 (nothing in common)."""
    union = len(one | other)
    return len(one ^ other) / union if union else 0.0


def clusters(outcomes: Sequence[Outcome]) -> list[list[int]]:
    """Return the places of failures that are one, those of each together."""
    found: list[list[int]] = []
    for place, outcome in enumerate(outcomes):
        for cluster in found:
            first = outcomes[cluster[0]]
            if _kind(first) == _kind(outcome) and distance(first.blocks, outcome.blocks) <= SAME_PATH:
                cluster.append(place)
                break
        else:
            found.append([place])
    return found


def _kind(outcome: Outcome) -> Hashable:
    """Return what two failures have in common that are one: the goals, the fault, the side of the first contact."""
    part = outcome.hits[0].part.partition(" ")[0] if outcome.hits else ""
    goals = frozenset((goal.robot, goal.wanted) for goal in outcome.failing_goals)
    return goals, outcome.died.partition(" at ")[0], part


def way_cells(outcome: Outcome, extent: Sequence[float]) -> _Cells:
    """Return the cells that the robot went through, on straight lines between the places that are known."""
    found: set[Hashable] = set()
    places = [_in_plan(x / 1000, y / 1000, extent) for x, y in outcome.way_mm]
    for (ax, ay), (bx, by) in pairwise(places or [(0.0, 0.0)]):
        steps = max(1, round(4 * CELLS * max(abs(bx - ax), abs(by - ay))))
        found |= {
            (int(CELLS * (ax + (bx - ax) * n / steps)), int(CELLS * (ay + (by - ay) * n / steps)))
            for n in range(steps + 1)
        }
    return frozenset(found)


def _in_plan(x: float, y: float, extent: Sequence[float]) -> tuple[float, float]:
    """Return a place in the plan, both coordinates 0 to below 1; what lies outside of the extent at its edge."""
    x0, y0, x1, y1 = extent
    most = 1 - 1 / (1 << 20)
    return min(max((x - x0) / (x1 - x0), 0.0), most), min(max((y - y0) / (y1 - y0), 0.0), most)


def _scene(trial: Trial) -> tuple[Sequence[float], _Cells]:
    """Return the extent of a trial's world, and the cells that its things cover."""
    with unpacked(trial.files) as folder:
        scenario = trial.scenario(folder)
        world = load_world(scenario.world, seed=scenario.seed)
    found: set[Hashable] = set()
    x0, y0, x1, y1 = world.extent
    width, height = (x1 - x0) / CELLS, (y1 - y0) / CELLS
    for footprint in [*map(Footprint, world.obstacles), *_placed(scenario)]:
        found |= {
            (column, row)
            for column in range(CELLS)
            for row in range(CELLS)
            if footprint.distance_to_point(x0 + (column + 0.5) * width, y0 + (row + 0.5) * height)
            <= max(width, height) / 2
        }
    # What is placed before a sensor stands where the robot is then: not a place, but the same thing each time.
    found |= {change.before for change in scenario.changes if change.before is not None}
    return world.extent, frozenset(found)


def _placed(scenario: Scenario) -> list[Footprint]:
    return [
        Footprint(replace(change.obstacle, x_m=change.x_m, y_m=change.y_m, heading_rad=change.heading_rad))
        for change in scenario.changes if change.obstacle is not None and change.before is None
    ]  # fmt: skip
