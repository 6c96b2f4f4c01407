"""Worlds: what ships keeps its promises, what is wrong is named with its key."""

import math
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2os.errors import WorldError
from p2os.pioneer.world import known_worlds, load_world, parse_world
from p2os.pioneer.world.geometry import Footprint, hull_polygon, placed
from p2os.pioneer.world.model import Obstacle, ObstacleKind
from p2os.pioneer.world.plan import Plan
from p2os.robots.parameters import load_parameters

P2DX = load_parameters("p2dx")
WORLDS = files("p2os.pioneer.world.worlds")
ROOM, ARENA = (WORLDS.joinpath(f"{name}.toml").read_text(encoding="utf-8") for name in ("room", "arena"))


@pytest.mark.parametrize("name", known_worlds())
def test_a_shipped_world_leaves_its_start_free(name: str) -> None:
    world = load_world(name, 3)
    start = world.start
    assert Plan.of_world(world, P2DX).clearance(start.x_m, start.y_m, start.heading_rad) > 0.5
    x0, y0, x1, y1 = world.extent
    assert all(x0 < item.x_m < x1 and y0 < item.y_m < y1 for item in world.obstacles)
    plain = world.to_plain()
    assert len(plain["obstacles"]) == len(world.obstacles)


@pytest.mark.parametrize("seed", range(25))
def test_an_arena_keeps_its_gaps(seed: int) -> None:
    world = load_world("arena", seed)
    assert world == parse_world(ARENA, "arena.toml", seed)
    assert world != load_world("arena", seed + 1)
    things = [item for item in world.obstacles if item.kind is ObstacleKind.OBSTACLE]
    assert len(things) >= 16
    for place, thing in enumerate(things):
        widths = (2 * thing.radius_m,) if thing.is_cylinder else (thing.length_m, thing.width_m)
        assert all(0.08 <= width <= 0.6 for width in widths)
        assert math.hypot(thing.x_m, thing.y_m) - thing.reach_m >= 1.0
        assert 4.0 - max(abs(thing.x_m), abs(thing.y_m)) - thing.reach_m >= 0.9
        for other in things[:place]:
            apart = math.hypot(thing.x_m - other.x_m, thing.y_m - other.y_m)
            assert apart - thing.reach_m - other.reach_m >= 0.9


def test_the_incline_is_no_wall_and_the_rails_are() -> None:
    world = load_world("ramp")
    assert world.has_slopes
    incline = next(item for item in world.obstacles if item.kind is ObstacleKind.RAMP)
    assert math.degrees(math.atan2(incline.height_m, incline.length_m)) <= 5
    rails = [item for item in world.obstacles if item.kind is ObstacleKind.RAIL]
    assert rails
    for rail in rails:
        assert rail.height_m > incline.height_m + P2DX.sonar_height_m


@pytest.mark.parametrize(
    ("old", "new", "message", "hint"),
    [
        ("length_m = 0.5", "lenght_m = 0.5", "[[box]] 1: unknown key 'lenght_m'", "'length_m'"),
        ("length_m = 0.5", "", "key 'length_m' is missing", "metres"),
        ("length_m = 0.5", 'length_m = "50 cm"', 'length_m = "50 cm" is not a number of metres', "bare number"),
        ("length_m = 0.5", "length_m = inf", "length_m = inf is out of range", ""),
        ("length_m = 0.5", "length_m = -0.5", "out of range", ""),
        ("heading_deg = 30.0", "heading_deg = true", "is not a number of degrees", ""),
        ("heading_deg = 30.0", "heading_rad = 0.5", "unknown key 'heading_rad'", "heading_deg"),
        ('name = "crate"', 'name = "bin"', "two obstacles are named 'bin'", ""),
        ('name = "crate"', "name = 3", "is not a line of printable characters", ""),
        ('name = "crate"', 'name = "crate"\nkind = "door"', 'kind = "door" is none of wall', "floor"),
        ("from_m = [-3.05, 3.05]", "from_m = [-3.05]", "list of 2 numbers", ""),
        ("[[box]]", "[box]", "box", ""),
        ("[start]", "[[start]]", "is not a table", ""),
        ("[start]", "[strat]", "unknown key 'strat'", "start"),
        ("extent_m = [-3.2, -3.2, 3.2, 3.2]", "extent_m = [1, 1, 0, 0]", "x0 < x1", ""),
        ("extent_m = [-3.2, -3.2, 3.2, 3.2]", "", "key 'extent_m' is missing", "4 numbers"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, old: str, new: str, message: str, hint: str) -> None:
    path = tmp_path / "mine.toml"
    assert old in ROOM
    path.write_text(ROOM.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(WorldError) as caught:
        load_world(path)
    assert message in str(caught.value) or "is not TOML" in str(caught.value.hint)
    assert hint in (caught.value.hint or "")


def test_one_table_where_a_list_is_meant_is_named() -> None:
    with pytest.raises(WorldError, match=r"box = .* is not an array of tables"):
        parse_world('name = "x"\nextent_m = [0, 0, 1, 1]\n[box]\nname = "a"\n', "mine")


@pytest.mark.parametrize(("name", "hint"), [("rooom", "room"), ("zzz", "shipped worlds")])
def test_a_missing_world_gets_a_hint(name: str, hint: str) -> None:
    with pytest.raises(WorldError) as caught:
        load_world(name)
    assert hint in str(caught.value.hint)


def test_a_file_that_is_no_text_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "bad.toml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(WorldError, match="not a text file"):
        load_world(path)


def test_a_cylinder_and_a_floor_are_read() -> None:
    text = (
        'name = "x"\nextent_m = [-2, -2, 2, 2]\n'
        '[[cylinder]]\nname = "post"\nx_m = 1\ny_m = 0\nradius_m = 0.1\n'
        '[[floor]]\nname = "stage"\nx_m = 0\ny_m = 1\nlength_m = 1\nwidth_m = 1\ntop_m = 0.2\n'
    )
    post, stage = parse_world(text, "mine").obstacles
    assert post.to_plain()["radius"] == 0.1
    assert stage.kind.is_driven_on
    with pytest.raises(WorldError, match="must be finite"):
        Obstacle(name="x", x_m=math.inf, y_m=0, radius_m=1)


#: All over the hull of a P2DX.
POINTS = [(px / 50, py / 50) for px in range(-13, 10) for py in range(-9, 10)]


@given(st.floats(-2, 2), st.floats(-2, 2), st.floats(-4, 4), st.floats(0.05, 0.5), st.booleans())
def test_clearance_is_zero_just_where_a_sampled_point_is_inside(
    x: float, y: float, heading: float, size: float, is_round: bool
) -> None:
    shape = {"radius_m": size} if is_round else {"length_m": size, "width_m": size / 2}
    thing = Footprint(Obstacle(name="x", x_m=x, y_m=y, heading_rad=heading, **shape))
    hull = placed(hull_polygon(P2DX.body), 0.0, 0.0, 0.0)
    nearest = math.inf
    for px, py in sorted(POINTS, key=lambda point: math.dist(point, (x, y))):
        if math.dist((px, py), (x, y)) - size > nearest:  # it reaches no farther than its size
            break
        nearest = min(nearest, distance_to(thing, px, py))
    assert thing.distance(hull) <= nearest + 1e-9
    assert nearest - thing.distance(hull) < 0.03


def test_a_clearance_is_that_of_the_nearest_of_many_things_or_the_most_that_is_asked_for() -> None:
    # High enough for the hull, of all lengths, and none of them fixed.
    things = tuple(
        Obstacle(name=f"thing {n}", x_m=0.9 * (n % 5) - 1.8, y_m=0.8 * (n // 5) - 1.6, heading_rad=n,
                 **({"radius_m": 0.05 + n / 200} if n % 3 else {"length_m": 0.1 * (n % 7 + 1), "width_m": 0.1}))
        for n in range(25)
    )  # fmt: skip
    world = parse_world('name = "e"\nextent_m = [-4, -4, 4, 4]', "e")
    plan = Plan.of_world(replace(world, obstacles=things), P2DX)
    shapes = [Footprint(item) for item in things]
    for n in range(60):
        x, y, heading = 3 * math.sin(n), 3 * math.cos(1.7 * n), 0.4 * n
        hull = placed(hull_polygon(P2DX.body), x, y, heading)
        nearest = min(shape.distance(hull) for shape in shapes)
        for most in (0.05, 0.5, math.inf):
            assert plan.clearance(x, y, heading, no_more_than=most) == min(nearest, most)


def distance_to(thing: Footprint, x: float, y: float) -> float:
    """Distance of a point by rays all round: 0 inside."""
    if not thing.polygon:
        return max(0.0, math.hypot(x - thing.x, y - thing.y) - thing.radius)
    edges = [((ax, ay), (ax + ex, ay + ey)) for ax, ay, ex, ey in thing.edges]
    if all((x - ax) * (by - ay) - (y - ay) * (bx - ax) <= 0 for (ax, ay), (bx, by) in edges):
        return 0.0
    nearest = math.inf
    for (ax, ay), (bx, by) in edges:
        for share in range(21):
            nearest = min(nearest, math.hypot(x - ax - share / 20 * (bx - ax), y - ay - share / 20 * (by - ay)))
    return nearest


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(0, 6.28))
def test_a_ray_ends_on_the_outline(x: float, y: float, heading: float) -> None:
    dx, dy = math.cos(heading), math.sin(heading)
    box = Footprint(Obstacle(name="b", x_m=0, y_m=0, length_m=1, width_m=1))
    disc = Footprint(Obstacle(name="d", x_m=0, y_m=0, radius_m=0.5))
    hit = box.hit(x, y, dx, dy)
    if hit < math.inf:
        assert max(abs(x + hit * dx), abs(y + hit * dy)) == pytest.approx(0.5, abs=1e-6)
    hit = disc.hit(x, y, dx, dy)
    if hit < math.inf:
        assert math.hypot(x + hit * dx, y + hit * dy) == pytest.approx(0.5, abs=1e-6)
