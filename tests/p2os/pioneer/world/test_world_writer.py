"""What is made or read can be written, and comes back equal; a line is found for every key."""

import math
import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2os.errors import WorldError
from p2os.pioneer.world import known_worlds, load_world, parse_world
from p2os.pioneer.world.makers import KINDS, make_world
from p2os.pioneer.world.model import Mesh, Obstacle, ObstacleKind, Pose, Repeat, Walk, World
from p2os.pioneer.world.plan import Plan
from p2os.pioneer.world.writer import degrees, write_world
from p2os.robots.parameters import load_parameters
from p2os.toml_file import find_places, line_of_error
from simbase.errors import UsageError

P2DX = load_parameters("p2dx")


@pytest.mark.parametrize("kind", KINDS)
def test_a_made_world_loads_back_equal_and_leaves_its_start_free(kind: str) -> None:
    for seed in range(12):
        world = make_world(kind, seed)
        assert parse_world(write_world(world), "made.toml") == world == make_world(kind, seed)
        start = world.start
        assert Plan.of_world(world, P2DX).clearance(start.x_m, start.y_m, start.heading_rad) > 0.5
    assert make_world(kind, 0) != make_world(kind, 1)


def test_an_unknown_kind_gets_a_hint() -> None:
    with pytest.raises(UsageError, match="no kind of world 'swamp'"):
        make_world("swamp", 0)


@pytest.mark.parametrize("name", known_worlds())
def test_a_shipped_world_comes_back_equal(name: str) -> None:
    world = load_world(name, 5)
    again = parse_world(write_world(world), "again.toml")
    # A heading that is no number of degrees may come back with another last bit.
    assert [item.name for item in again.obstacles] == [item.name for item in world.obstacles]
    for one, other in zip(again.obstacles, world.obstacles, strict=True):
        assert one.heading_rad == pytest.approx(other.heading_rad, abs=1e-15)
    assert write_world(again) == write_world(world)


def test_every_key_is_written() -> None:
    walk = Walk(points_m=((0.0, 1.0), (1.0, 1.0), (1.0, 2.0)), speed_mps=0.25, start_s=1.5, repeat=Repeat.LOOP)
    world = World(
        name='a "quoted" \\ name\t',
        source="x",
        description="Straße",
        start=Pose(0.1, 0.2, math.radians(30), 0.05),
        extent=(-1.0, -1.0, 3.0, 3.0),
        obstacles=(
            Obstacle(
                name="ramp", x_m=1, y_m=1, length_m=1, width_m=1, height_m=0.1, base_m=0.05, kind=ObstacleKind.RAMP
            ),
            Obstacle(name="stage", x_m=1, y_m=1, length_m=1, width_m=1, height_m=0.1, kind=ObstacleKind.FLOOR),
            Obstacle(name="can", x_m=1, y_m=1, radius_m=0.1, base_m=0.1, floor_m=0.1, mass_kg=2.5, friction=0.1),
            Obstacle(name="dog", x_m=1, y_m=1, radius_m=0.1, walk=walk),
            Obstacle(name="block", x_m=1, y_m=1, length_m=1, width_m=1, fixed=True, kind=ObstacleKind.RAIL),
        ),
        meshes=(
            Mesh(name="tent", vertices=((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 1.0)), triangles=((0, 1, 2),)),
        ),
    )
    assert parse_world(write_world(world), "y") == world


@given(st.floats(-360, 360, allow_nan=False))
def test_degrees_come_back(value: float) -> None:
    assert math.radians(degrees(math.radians(value))) == math.radians(value)


NESTED = '''name = """
[not a table]
extent_m = 3"""
extent_m = [0, # [
  0, 1,
  1]
[start]  # here
x_m = 0
[[box]]
name = 'a [ b'
[[ box ]]
name = "c"
path_m = [[0, 0],
 [1, 1]]
width_m = 1'''


def test_places_are_found_beside_long_values_and_comments() -> None:
    tomllib.loads(NESTED)
    places = find_places(NESTED)
    assert places.line("", 0, "name") == 1
    assert places.line("", 0, "extent_m") == 4
    assert places.line("start", 0, "x_m") == 8
    assert places.line("box", 0, "name") == 10
    assert (places.line("box", 1), places.line("box", 1, "path_m"), places.line("box", 1, "width_m")) == (11, 13, 15)
    assert places.line("box", 1, "missing") == 11
    assert places.line("zzz", 3, "missing") == 1
    assert line_of_error("strange", NESTED) == ("strange", 1)


@pytest.mark.parametrize("text", ["name = ", 'name = "a"\n\n[[box', "a = 1\na = 2"])
def test_what_is_no_toml_is_named_with_its_line(text: str) -> None:
    with pytest.raises(WorldError) as caught:
        parse_world(text, "mine.toml")
    assert str(caught.value).startswith(f"mine.toml:{text.count(chr(10)) + 1}: ")


def test_deep_nesting_is_refused() -> None:
    with pytest.raises(WorldError):
        parse_world("a = " + "[" * 5000 + "]" * 5000, "deep.toml")


BOX = '[[box]]\nname = "b"\nx_m = 0\ny_m = 0\nlength_m = 1\nwidth_m = 1\n'
HEAD = 'name = "a"\nextent_m = [0, 0, 1, 1]\n'


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ("fixed = 1", "mine.toml:9: [[box]] 1: fixed = 1 is not true or false"),
        ("mass_kg = -1", "mine.toml:9: [[box]] 1: mass_kg = -1 is out of range"),
        ("mass_kg = 1\nfixed = true", "only one of"),
        ("path_m = [[0, 0]]", "two points"),
        ("path_m = [[0, 0], [0, 0]]", "same point twice"),
        (
            "path_m = [[0, 0], [1]]",
            "mine.toml:9: [[box]] 1: path_m = [[0, 0], [1]] is not a list of lists",
        ),
        ("path_m = 3", "list of lists"),
        ("path_m = [[0, 0], [1, 1]]\nspeed_mps = 0", "speed_mps = 0 is out of range"),
        ('path_m = [[0, 0], [1, 1]]\nrepeat = "never"', 'repeat = "never" is none of'),
        ('path_m = [[0, 0], [1, 1], [0, 0]]\nrepeat = "loop"', "first point again"),
        (f"x_mm = {'9' * 400}", "unknown key 'x_mm'"),
        (f"base_m = {'9' * 400}", "out of range"),
    ],
)
def test_what_moves_is_checked(more: str, message: str) -> None:
    with pytest.raises(WorldError) as caught:
        parse_world(HEAD + BOX + more, "mine.toml")
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("mesh", "message"),
    [
        ("vertices_m = [[0, 0, 0]]\ntriangles = []", "no triangles"),
        ("vertices_m = [[0, 0, 0]]\ntriangles = [[0, 0, 1]]", "not there"),
        ("vertices_m = [[0, 0]]\ntriangles = [[0, 0, 0]]", "list of lists of 3 numbers"),
    ],
)
def test_a_mesh_is_checked(mesh: str, message: str) -> None:
    with pytest.raises(WorldError, match=message):
        parse_world(f'{HEAD}[[mesh]]\nname = "m"\n{mesh}', "mine.toml")


@pytest.mark.parametrize(
    ("repeat", "seconds", "pose"),
    [
        (Repeat.ONCE, 0.0, (0, 0, 0)),
        (Repeat.ONCE, 2.0, (1, 0, 0)),
        (Repeat.ONCE, 99.0, (2, 1, math.pi / 2)),
        (Repeat.BACK_AND_FORTH, 4.5, (2, 0.5, -math.pi / 2)),
        (Repeat.BACK_AND_FORTH, 7.0, (0, 0, 0)),
        (Repeat.LOOP, 2.0 + 3.0 + math.sqrt(5), (1, 0, 0)),
    ],
)
def test_a_walk_is_where_its_time_puts_it(repeat: Repeat, seconds: float, pose: tuple[float, float, float]) -> None:
    walk = Walk(points_m=((0, 0), (2, 0), (2, 1)), speed_mps=1.0, start_s=1.0, repeat=repeat)
    assert walk.pose_at(seconds) == pytest.approx(pose, abs=1e-9)
