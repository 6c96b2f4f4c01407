"""Plan-view geometry: the way out of a hull, and things that stand elsewhere."""

import cmath
import math
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from p2os.errors import WorldError
from p2os.pioneer.body.ray_cast import cast
from p2os.pioneer.world import parse_world
from p2os.pioneer.world.drawing import start_arrow
from p2os.pioneer.world.formats.annotation import Traits
from p2os.pioneer.world.formats.collection import STANDS_STILL, Collection
from p2os.pioneer.world.geometry import Footprint, hull_polygon, placed
from p2os.pioneer.world.interchange.transform import from_roll_pitch_yaw
from p2os.pioneer.world.model import FARTHEST_M, Obstacle, Pose
from p2os.robots.parameters import load_parameters

HULL = hull_polygon(load_parameters("p2dx").body)
near, angles = st.floats(-0.2, 0.2), st.floats(-math.pi, math.pi)
CARTON = Obstacle(name="carton", x_m=0.0, y_m=0.0, length_m=0.3, width_m=0.4, mass_kg=1.5, friction=0.3, height_m=0.2)


@settings(max_examples=40)
@given(st.one_of(near.map(lambda size: {"radius_m": 0.21 + size}), st.just({"length_m": 0.3, "width_m": 0.4})),
       near, near, angles, angles)  # fmt: skip
def test_no_shorter_way_leads_out_of_a_hull(
    size: dict[str, float], x: float, y: float, heading: float, turn: float
) -> None:
    hull = placed(HULL, 0.0, 0.0, turn)
    thing = Footprint(Obstacle(name="thing", x_m=x, y_m=y, heading_rad=heading, **size))
    dx, dy = thing.way_out(hull)
    assume(thing.distance(hull) == 0.0 and math.hypot(dx, dy) > 1e-3)
    for share, is_out in ((1 + 1e-6, True), (1 - 1e-6, False)):
        moved = Obstacle(name="thing", x_m=x + share * dx, y_m=y + share * dy, heading_rad=heading, **size)
        assert (Footprint(moved).distance(hull) > 0.0) is is_out
    length = math.hypot(dx, dy) - 1e-6
    for number in range(12):
        way = math.tau * number / 12
        moved = Obstacle(name="thing", x_m=x + length * math.cos(way), y_m=y + length * math.sin(way),
                         heading_rad=heading, **size)  # fmt: skip
        assert Footprint(moved).distance(hull) == 0.0


@pytest.mark.parametrize(
    ("x", "turn", "way"),
    [
        (1.0, 0.0, 0.5),  # from its centre
        (0.7, 0.0, 0.8),  # the far side, for the near one lies behind
        (0.7, math.pi, 0.2),
        (0.5, 0.0, 0.0),  # from its rim: met at once, inwards and outwards
        (0.5, math.pi, 0.0),
        (0.25, 0.0, 0.25),
        (0.25, math.pi, math.inf),  # it lies behind
        (1.75, math.pi, 0.25),
        (0.25, math.pi / 2, math.inf),
    ],
)
def test_a_ray_meets_a_circle_from_outside_its_rim_or_its_inside(x: float, turn: float, way: float) -> None:
    post = Footprint(Obstacle(name="post", x_m=1.0, y_m=2.0, radius_m=0.5))
    ray = round(math.cos(turn), 9), round(math.sin(turn), 9)
    assert post.hit(x, 2.0, *ray) == pytest.approx(way)
    if way < 3.0:
        assert cast([post], x, 2.0, [ray], 3.0) == [pytest.approx(way)]
        assert cast([post], x, 2.0, [ray], way) == [pytest.approx(way)], "no farther than was asked"
    else:
        assert cast([post], x, 2.0, [ray], 3.0) == [3.0]


@given(st.floats(-math.pi, math.pi), st.floats(0.1, 2.0))
def test_the_arrow_at_the_start_looks_where_the_robot_does(heading: float, length: float) -> None:
    """Its tip is a length ahead; what is behind is as far to the left as to the right."""
    world = replace(parse_world('name = "a"\nextent_m = [-9, -9, 9, 9]', "a"), start=Pose(1.0, 2.0, heading))
    ahead, left = (complex(math.cos(heading), math.sin(heading)) * way for way in (1, 1j))
    shape = [(complex(*point) - (1 + 2j)) / length for point in start_arrow(world, length)]
    assert [cmath.isclose(one, other, abs_tol=1e-9) for one, other in zip(
        shape, (ahead, -0.7 * ahead + 0.6 * left, -0.4 * ahead, -0.7 * ahead - 0.6 * left), strict=True,
    )] == [True] * 4  # fmt: skip


@pytest.mark.parametrize(("mass_kg", "roll", "left"), [(1.0, 0.3, 1), (0.0, 0.3, 0), (0.0, 0.0, 0), (0.001, 0.3, 1)])
@pytest.mark.parametrize("shape", ["box", "cylinder"])
def test_what_a_model_moves_stands_still_where_it_is_tilted(shape: str, mass_kg: float, roll: float, left: int) -> None:
    collection = Collection(Path("a.sdf"))
    place, traits = from_roll_pitch_yaw(0.0, 0.0, 1.0, roll, 0.0, 0.0), Traits(mass_kg=mass_kg)
    if shape == "box":
        collection.add_box("a", (1.0, 1.0, 1.0), place, traits)
    else:
        collection.add_cylinder("a", 0.5, 1.0, place, traits)
    assert collection._skipped.get(STANDS_STILL, 0) == left


def test_what_stands_elsewhere_is_else_the_same() -> None:
    there = CARTON.standing_at(1.0, -FARTHEST_M, 0.5)
    assert (there.x_m, there.y_m, there.heading_rad) == (1.0, -FARTHEST_M, 0.5)
    assert there.standing_at(0.0, 0.0, 0.0) == CARTON


@pytest.mark.parametrize(
    ("place", "value"),
    [
        *[(place, value) for place in range(3) for value in (math.nan, math.inf)],
        *[(place, math.nextafter(FARTHEST_M, math.inf)) for place in range(2)],
    ],
)
def test_nothing_stands_where_no_place_is(place: int, value: float) -> None:
    pose = [0.0, 0.0, 0.0]
    pose[place] = value
    with pytest.raises(WorldError, match="carton"):
        CARTON.standing_at(*pose)
