"""Drawn things: where they stand, how far apart, and that a scenario takes them."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from p2os.pioneer.world import load_world
from p2os.pioneer.world.geometry import Footprint
from p2os.pioneer.world.model import Obstacle, Pose
from p2os.robots.parameters import load_parameters
from p2os.toml_schema import Table
from robot_bench.campaign.campaign_file import Span
from robot_bench.campaign.things import HEIGHT_M, KINDS, DrawnThing, Room
from robot_bench.scenario.world_script import load_changes

WORLD = load_world("room")
START = Pose(0.0, 0.0, 0.0)
GAP_M, FREE_M = 0.75, 0.45


def footprint(table: Table) -> Footprint:
    values = {key: float(value) for key, value in table.items() if isinstance(value, (int, float))}
    return Footprint(Obstacle(
        name="x", x_m=values["x_m"], y_m=values["y_m"], heading_rad=math.radians(values.get("heading_deg", 0.0)),
        length_m=values.get("length_m", 0.0), width_m=values.get("width_m", 0.0),
        radius_m=values.get("radius_m", 0.0), height_m=HEIGHT_M,
    ))  # fmt: skip


def apart_m(one: Footprint, other: Footprint) -> float:
    if other.polygon:
        return one.distance(other.polygon)
    return max(one.distance_to_point(other.x, other.y) - other.radius, 0.0)


things = st.lists(
    st.tuples(
        st.sampled_from(sorted(KINDS)), st.floats(-3, 3), st.floats(-3, 3), st.floats(0, 360), st.floats(0, 1)
    ),
    max_size=6,
)  # fmt: skip


def drawn(rows: list[tuple[str, float, float, float, float]]) -> list[DrawnThing]:
    return [
        DrawnThing(
            name=f"t{number}", kind=kind, place=(x, y, heading),
            measures={key: low + share * (high - low) for key, (low, high) in KINDS[kind].measures.items()},
        )
        for number, (kind, x, y, heading, share) in enumerate(rows)
    ]  # fmt: skip


@settings(max_examples=20)
@given(things)
def test_things_stand_apart_and_off_the_start_and_a_scenario_takes_them(
    rows: list[tuple[str, float, float, float, float]],
) -> None:
    found = Room(WORLD, [START], GAP_M, FREE_M).tables(drawn(rows))
    load_changes(found, load_parameters("p2dx"), "drawn")
    standing = [(str(table["name"]).partition("-")[0], footprint(table)) for table in found if "path_m" not in table]
    walls = [Footprint(item) for item in WORLD.obstacles]
    for number, (name, one) in enumerate(standing):
        assert one.distance_to_point(0.0, 0.0) >= FREE_M - 1e-9
        others = [*walls, *(other for other_name, other in standing[:number] if other_name != name)]
        assert all(apart_m(one, other) >= GAP_M - 1e-9 for other in others)
    assert found == Room(WORLD, [START], GAP_M, FREE_M).tables(drawn(rows))


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_a_thing_with_room_stands_where_it_was_drawn(kind: str) -> None:
    found = Room(WORLD, [Pose(0.0, -2.0, 0.0)], 0.1, 0.1).tables(drawn([(kind, 0.0, 0.4, 0.0, 0.0)]))
    assert found
    middle = sum(float(str(table["y_m"])) for table in found) / len(found)
    assert middle == pytest.approx(0.4, abs=1e-3)


@pytest.mark.parametrize(("own_m", "stands"), [(0.49, True), (0.51, False), (None, False)])
def test_a_thing_may_stand_nearer_to_others_than_the_rest(own_m: float | None, stands: bool) -> None:
    first = DrawnThing(name="a", kind="post", place=(1.2, 0.0, 0.0), measures={"width_m": 0.2})
    second = DrawnThing(name="b", kind="post", place=(1.9, 0.0, 0.0), measures={"width_m": 0.2}, gap_m=own_m)
    tables = {str(table["name"]): table for table in Room(WORLD, [START], GAP_M, FREE_M).tables([first, second])}
    assert (tables["b"]["x_m"] == 1.9) is stands


def test_a_dead_end_is_as_wide_and_deep_inside_as_it_was_drawn() -> None:
    thing = DrawnThing(name="d", kind="dead-end", place=(0.0, 0.5, 0.0), measures={"width_m": 0.8, "depth_m": 0.6})
    back, left, right = (footprint(t) for t in Room(WORLD, [Pose(0.0, -2.5, 0.0)], 0.0, 0.1).tables([thing]))
    assert apart_m(left, right) == pytest.approx(0.8)
    assert back.bounds[2] == pytest.approx(-0.3)
    assert left.bounds[2] == pytest.approx(0.3)


def test_a_span_comes_to_each_of_its_values_and_no_other() -> None:
    places = [at / 1000 for at in range(1000)]
    assert {Span(2, 5, 1.0, is_whole=True).value(at) for at in places} == {2, 3, 4, 5}
    assert {Span(0.0, 1.0, 0.25).value(at) for at in places} == {0.0, 0.25, 0.5, 0.75, 1.0}
    assert {Span(choices=("a", "b")).value(at) for at in places} == {"a", "b"}
    ends = [Span(0.4, 0.6).value(at) for at in (0.0, 1 - 1e-9)]
    assert ends == [0.4, 0.6]
