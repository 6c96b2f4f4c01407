"""The judge of mappers and planners: what a true map is, what counts as reached; and what the nodes compute."""

import math
import os
import queue
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2os.pioneer.serve.host import Host
from p2os.pioneer.world.geometry import Footprint
from tests.tools.forked_python import forked_python
from tools.foreign.judges.map_truth import share_found, share_near
from tools.foreign.judges.navigates import Journey, Navigates, served, standing
from tools.foreign.nodes.driving import (
    AHEAD_M,
    CRUISE_MPS,
    FAR_M,
    INSCRIBED,
    LETHAL,
    SWING_M,
    TURN_RADPS,
    UNKNOWN,
    Grid,
    between,
    compose,
    costs_of,
    freed,
    inflation,
    inverse,
    is_free_ahead,
    steer,
)
from tools.foreign.row import RowError, RowPlace
from tools.foreign.rows.stacks import OFFICE_GOALS, VISITOR

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals and terminals are Unix's")
POSES = st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(-3.1, 3.1))
NOTHING = np.empty((0, 2))
CELL = 0.05
#: A wall from 1 to 2 m along x, 0.1 m thick, on the edges of cells.
WALL = Footprint.of_polygon("wall", ((1.0, 0.5), (2.0, 0.5), (2.0, 0.6), (1.0, 0.6)))


def mapped(*occupied: tuple[slice, slice]) -> Grid:
    """Return a map of 3 x 1.5 m at 0, 0 that is free but for these rows and columns."""
    cells = np.zeros((30, 60), np.int8)
    for rows, columns in occupied:
        cells[rows, columns] = 100
    return Grid(cells, 0.0, 0.0, CELL)


FACE = (slice(10, 11), slice(20, 40))


def test_cells_of_a_wall_are_near_it_and_find_it() -> None:
    grid = mapped(FACE, (slice(11, 12), slice(20, 40)))
    assert share_near(grid, [WALL], 0.1) == 1.0
    assert share_found(grid, [WALL], 0.1) == 1.0


@pytest.mark.parametrize(("row", "share"), [(8, 1.0), (7, 0.0), (13, 1.0), (14, 0.0)])
def test_a_cell_is_near_up_to_the_limit(row: int, share: float) -> None:
    # Middles 7.5 cm (row 8) and 12.5 cm (row 7) before the wall, and as far behind it.
    assert share_near(mapped((slice(row, row + 1), slice(20, 40))), [WALL], 0.1) == share


def test_a_cell_among_ten_where_nothing_stands_costs_a_tenth() -> None:
    grid = mapped((slice(10, 11), slice(20, 29)), (slice(25, 26), slice(50, 51)))
    assert share_near(grid, [WALL], 0.1) == pytest.approx(0.9)


def test_half_of_a_wall_that_is_not_on_the_map_is_not_found() -> None:
    assert share_found(mapped((slice(10, 12), slice(20, 30))), [WALL], 0.1) == pytest.approx(0.55, abs=0.06)


def test_what_could_not_be_seen_is_not_asked_for() -> None:
    grid = mapped((slice(10, 12), slice(20, 30)))
    grid.cells[:, 29:] = -1
    assert share_found(grid, [WALL], 0.1) == pytest.approx(1.0, abs=0.02)
    grid.cells[:] = -1
    assert share_found(grid, [WALL], 0.1) == 0.0


def test_an_empty_map_is_neither_near_nor_found() -> None:
    assert share_near(mapped(), [WALL], 0.1) == share_found(mapped(), [WALL], 0.1) == 0.0


def test_a_round_thing_is_found_by_its_outline() -> None:
    (post,) = [thing for thing in standing("office", ()) if thing.name == "north 1 chair"]
    rows, columns = np.mgrid[0:100, 0:100]
    away = np.hypot(-2 + (columns + 0.5) * CELL - post.x, 1 + (rows + 0.5) * CELL - post.y)
    grid = Grid(np.where(np.abs(away - post.radius) < 0.05, 100, 0).astype(np.int8), -2.0, 1.0, CELL)
    assert share_near(grid, [post], 0.1) == share_found(grid, [post], 0.1) == 1.0


# The goals.


@pytest.fixture(scope="module")
def host() -> Iterator[Host]:
    found = served("office", "ideal", (VISITOR,))
    yield found
    found.close()


def test_every_goal_of_the_office_has_room_for_a_robot_that_turns() -> None:
    things = standing("office", (VISITOR,))
    assert len(OFFICE_GOALS) == len(set(OFFICE_GOALS)) == 20
    assert min(thing.distance_to_point(*goal) for thing in things for goal in OFFICE_GOALS) > SWING_M + 0.15
    rooms = {(round((x + 1) // 4), y > 0) for x, y in OFFICE_GOALS if abs(y) > 1}
    assert len(rooms) == 6


def test_what_walks_is_no_part_of_the_map() -> None:
    assert VISITOR in {thing.name for thing in standing("office", ())}
    assert VISITOR not in {thing.name for thing in standing("office", (VISITOR,))}
    assert "north 1 desk top" not in {thing.name for thing in standing("office", ())}


@pytest.mark.parametrize(("x", "is_fault"), [(0.249, False), (0.251, True)])
def test_a_goal_counts_where_the_robot_itself_is_near_it(host: Host, x: float, is_fault: bool) -> None:
    journey = Journey(host, [(x, 0.0)], 0.25)
    assert not journey.hear("reached 1")
    assert bool(journey.faults()) is is_fault
    assert journey.hear("done")


def test_a_goal_that_is_given_up_or_never_named_is_a_fault(host: Host) -> None:
    journey = Journey(host, [(0.0, 0.0), (0.1, 0.0), (0.2, 0.0)], 0.25)
    journey.hear("reached 1")
    journey.hear("gave up 2")
    assert journey.faults() == ["goal 2 given up", "goal 3 never reached"]
    assert journey.text().startswith("1 of 3 goals, 0.00 m off at worst, 0 contacts")


def test_a_node_that_ends_fails_the_row_with_its_code(tmp_path: Path) -> None:
    (tmp_path / "libraries").mkdir()
    judge = Navigates(
        python=forked_python(), programs=(), libraries=("libraries/",), goals=((0.0, 0.0),),
        commands=(("-c", "import sys; print('reached 1'); sys.stdout.flush(); sys.exit(3)"),),
    )  # fmt: skip
    with pytest.raises(RowError, match="a node ended with code"):
        judge.run(RowPlace(cache=tmp_path, scratch=tmp_path))


def test_silence_is_no_journey(host: Host, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tools.foreign.judges.navigates.SILENCE_S", 0.0)
    with pytest.raises(RowError, match="nothing more for 0 s"):
        Journey(host, [(0.0, 0.0)], 0.25).follow(queue.SimpleQueue(), ())


# What the nodes compute.


@given(POSES, POSES)
def test_a_pose_in_a_frame_and_back(outer: tuple[float, float, float], inner: tuple[float, float, float]) -> None:
    back = compose(inverse(outer), compose(outer, inner))
    assert back[:2] == pytest.approx(inner[:2], abs=1e-9)
    assert math.remainder(back[2] - inner[2], math.tau) == pytest.approx(0, abs=1e-9)


def test_half_way_between_two_headings_is_the_short_way() -> None:
    first, second = (0, (0.0, 0.0, 3.0)), (10, (1.0, 2.0, -3.0))
    assert between(first, second, 5)[:2] == (0.5, 1.0)
    assert abs(between(first, second, 5)[2]) == pytest.approx(math.pi)
    assert between(first, second, 10)[2] == pytest.approx(-3.0)
    assert between(second, second, 10) == second[1]


@pytest.mark.parametrize(
    ("metres", "least", "most"),
    [(0.0, LETHAL, LETHAL), (0.01, INSCRIBED, INSCRIBED), (SWING_M, INSCRIBED, INSCRIBED),
     (SWING_M + 0.001, 200, INSCRIBED - 1), (FAR_M - 0.001, 0, 1), (FAR_M, 0, 0)],
)  # fmt: skip
def test_costs_fall_with_the_distance(metres: float, least: int, most: int) -> None:
    assert least <= inflation(metres) <= most


def test_costs_are_of_what_is_mapped_and_of_what_is_seen_now() -> None:
    grid = Grid(np.array([[-1] * 40 for _ in range(40)], np.int8), 0.0, 0.0, CELL)
    grid.cells[:, 10:] = 0
    costs = costs_of(grid, np.array([[1.0 + CELL / 2, 1.0 + CELL / 2], [9.0, 9.0]]))
    assert costs[20, 20] == LETHAL
    assert costs[20, 26] == INSCRIBED
    assert 0 < costs[20, 30] < INSCRIBED
    assert costs[20, 36] == 0
    assert costs[39, 0] == UNKNOWN
    assert np.array_equal(costs[20, 10:31], costs[20, 10:31][::-1])
    assert freed(costs, 20, 20, 2)[20, 21] == INSCRIBED - 1
    assert freed(costs, 20, 20, 2)[20, 20] == LETHAL
    assert grid.grown(1.0).cell(0.0, 0.0) == (20, 20)


def test_a_path_ahead_is_driven_and_one_aside_is_turned_to() -> None:
    path = np.array([[step * CELL, 0.0] for step in range(60)])
    assert steer((0.0, 0.0, 0.0), path) == (pytest.approx(CRUISE_MPS), pytest.approx(0.0))
    assert steer((0.0, 0.0, math.pi / 2), path) == (0.0, -TURN_RADPS)
    forward, turn = steer((0.0, 0.1, 0.0), path)
    assert 0 < forward < CRUISE_MPS
    assert turn < 0
    assert steer((2.9, 0.0, 0.0), path)[0] < 0.2 < AHEAD_M


@pytest.mark.parametrize(
    ("point", "is_free"),
    [((0.22, 0.0), False), ((0.24, 0.0), True), ((0.2, 0.22), True), ((0.2, -0.20), False), ((-0.1, 0.0), True)],
)
def test_what_is_before_the_bumper_stops_it(point: tuple[float, float], is_free: bool) -> None:
    assert is_free_ahead(np.array([point]), 0.0) is is_free
    assert is_free_ahead(NOTHING, CRUISE_MPS)
    assert not is_free_ahead(np.array([(0.35, 0.0)]), CRUISE_MPS)
