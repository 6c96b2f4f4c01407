"""What a campaign draws: tables of things in a room, and points of searches that hear what came of them."""

import math
from collections.abc import Sequence

import pytest

from p2os.pioneer.world import load_world
from p2os.pioneer.world.model import Pose
from robot_bench.campaign.search import SEARCHES, PointResult, Problem
from robot_bench.campaign.things import KINDS, DrawnThing, Room
from tests.robot_bench.recording.kept_lines import is_as_kept


def test_where_things_of_each_kind_stand() -> None:
    lines = []
    for free_m, gap_m in ((0.45, 0.1), (1.6, 0.75)):
        room = Room(load_world("room"), [Pose(0.2, 0.1, 0.0)], gap_m, free_m)
        things = [
            DrawnThing(
                name=f"{kind}{turn}", kind=kind, place=(1.4 * math.cos(n), 1.2 * math.sin(2 * n), 37.0 * n),
                measures={key: low + 0.3 * (high - low) for key, (low, high) in KINDS[kind].measures.items()},
                gap_m=0.02 if turn else None,
            )
            for turn in range(2) for n, kind in enumerate(KINDS)
        ]  # fmt: skip
        lines += [f"free {free_m}, apart {gap_m}", *map(str, room.tables(things))]
    assert is_as_kept(lines, "draws_of_things")


def answered(points: Sequence[tuple[float, ...]]) -> list[PointResult]:
    """A point reaches what its coordinates, in tenths, are; a third of them is excused."""
    return [
        PointResult(
            margin=sum(point), reached=frozenset(round(at * 6) for at in point), is_excused=point[0] > 0.66,
            acting=frozenset({0, 2}) if point[1] > 0.5 else frozenset(),
        )
        for point in points
    ]  # fmt: skip


@pytest.mark.parametrize("name", ["grid", "random", "latin-hypercube", "sobol", "coverage"])
def test_which_points_a_search_proposes(name: str) -> None:
    pytest.importorskip("scipy")
    lines = []
    for runs, corpus in ((30, ()), (7, ((0.1, 0.2, 0.3), (0.4, 0.5, 0.6), (0.7, 0.8, 0.9), (0.2, 0.2, 0.2)))):
        for counts in ((0, 0, 0), (3, 0, 2)):
            search = SEARCHES[name](Problem(counts, (True, False, True), runs, 4, 3, corpus))
            lines.append(f"{runs} {counts}")
            for _ in range(6):
                points = search.ask(5)
                lines += [f"  {' '.join(f'{at:.4f}' for at in point)} {search.is_drawn(point)}" for point in points]
                search.tell(answered(points))
    assert is_as_kept(lines, f"draws_of_{name}")
