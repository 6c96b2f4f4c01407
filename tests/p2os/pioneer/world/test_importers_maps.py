"""ARIA maps and occupancy images: what is taken, where it stands, and what is refused."""

import contextlib
import math
import tempfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from p2os.cli.main import run
from p2os.errors import WorldError
from p2os.pioneer.body.factory import make_body
from p2os.pioneer.world import load_world, parse_world
from p2os.pioneer.world.drawing import Look, shapes
from p2os.pioneer.world.formats.rectangles import rectangles
from p2os.pioneer.world.model import World
from p2os.pioneer.world.writer import write_world
from p2os.robots.parameters import load_parameters
from tests.p2os.pioneer.body.bodies import drive, each_body

P2DX = load_parameters("p2dx")

ARIA = """2D-Map
LineMinPos: -1000 -2000
NumLines: 2
NumPoints: 6
Resolution: 20
MapInfo: GoalType Name=Goal
Cairn: Goal 1000 500 0.000000 "" ICON "Goal 1"
Cairn: GoalWithHeading 1500 500 90.000000 "" ICON "Door"
Cairn: RobotHome -250 300 45.000000 "" ICON ""
Cairn: DockLynx 0 0 0 "" ICON "dock"
Cairn: ForbiddenLine 0 0 0.000000 "" ICON "a b" 0 1000 2000 1000
Cairn: ForbiddenArea 0 0 90.000000 "" ICON "" 0 0 1000 500
Cairn: Reflector 0 0 0.000000 "" ICON "bright" 3000 0 3000 500
Cairn: MotionLimitsSector 0 0 0 "" ICON "x" 0 0 1 1
LINES
-1000 -2000 3000 -2000
-1000 -2000 -1000 1000
DATA
2000 2000
2020 2000
2040 2000
2000 2020
2020 2020
2040 2020
"""


def aria(tmp_path: Path, text: str) -> World:
    path = tmp_path / "office.map"
    path.write_text(text)
    return load_world(path)


def test_an_aria_map_has_walls_points_and_marks(tmp_path: Path) -> None:
    world = aria(tmp_path, ARIA)
    bright, first, second, points = world.obstacles
    assert (first.x_m, first.y_m, first.heading_rad) == (1.0, -2.0, 0.0)
    assert (first.length_m, first.width_m) == pytest.approx((4.0001, 0.0001))
    assert (bright.name, bright.x_m, bright.y_m, bright.length_m) == ("bright", 3.0, 0.25, 0.5001)
    assert (second.x_m, second.y_m, second.heading_rad) == (-1.0, -0.5, math.pi / 2)
    # Beside lines, points are put on cells of 50 mm: these six on two of them.
    assert (points.x_m, points.y_m, points.length_m, points.width_m) == pytest.approx((2.025, 2.0, 0.1, 0.05))
    assert all(item.fixed for item in world.obstacles)
    assert (world.start.x_m, world.start.y_m, world.start.heading_rad) == (-0.25, 0.3, math.radians(45))
    assert [(mark.kind, mark.name) for mark in world.marks] == [
        ("goal", "Goal 1"), ("goal", "Door"), ("home", ""), ("dock", "dock"), ("forbidden", "a b"), ("forbidden", ""),
        ("reflector", "bright"),
    ]  # fmt: skip
    assert world.marks[4].points_m == ((0.0, 1.0), (2.0, 1.0))
    assert world.marks[5].points_m[2] == pytest.approx((-0.5, 1.0))
    assert world.skipped == ("skipped: Cairn MotionLimitsSector",)
    assert parse_world(write_world(world), "again.toml") == world


@pytest.mark.parametrize("name", each_body())
@pytest.mark.parametrize("far_mm", [0, 400_000])
def test_a_line_stands_where_it_is_drawn_and_holds_a_robot(name: str, far_mm: int, tmp_path: Path) -> None:
    home = f'Cairn: RobotHome {far_mm} 0 0 "" ICON ""'
    world = aria(tmp_path, f"2D-Map\n{home}\nLINES\n{far_mm + 800} -1000 {far_mm + 800} 1100\n")
    body = make_body(name, world, P2DX)
    body.reset(world.start, 1)
    # The two front sonars: 0.166 m ahead, 27 mm to the side, 10 degrees outwards; their cones reach straight ahead.
    assert min(body.ranges([3, 4])) == pytest.approx(0.8 - 0.166, abs=0.002)
    end = drive(body, 0.75, 0.75, 2.0)
    assert end.x_m - far_mm / 1000 + P2DX.body.hull_front_m == pytest.approx(0.8, abs=0.012)


def test_a_line_and_what_is_marked_are_drawn_and_counted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    world = aria(tmp_path, ARIA)
    assert [shape.is_open for shape in shapes(world) if shape.name == "line 1"] == [True]
    assert {shape.look for shape in shapes(world) if shape.name == "bright"} == {Look.WALL, Look.REFLECTOR}
    assert run(["world", "show", world.source]) == 0
    out = capsys.readouterr().out.splitlines()
    assert sum(character in "▀▄█" for line in out for character in line) > 60
    assert out[-1].endswith(": 4 obstacles; marks: 2 goal, 1 home, 1 dock, 2 forbidden, 1 reflector")


def test_points_alone_keep_the_resolution_and_points_on_a_line_are_the_line(tmp_path: Path) -> None:
    (points,) = aria(tmp_path, "2D-Map\nDATA\n" + ARIA.split("DATA\n")[1]).obstacles
    assert (points.x_m, points.y_m, points.length_m, points.width_m) == pytest.approx((2.02, 2.01, 0.06, 0.04))
    assert len(aria(tmp_path, "2D-Map\nLINES\n0 0 5000 0\nDATA\n2000 40\n2500 -90\n").obstacles) == 1


def test_a_map_without_a_home_starts_at_a_goal_or_at_a_free_place(tmp_path: Path) -> None:
    home_less = ARIA.replace("RobotHome", "Label").replace("DockLynx", "Label")
    assert aria(tmp_path, home_less).start.heading_rad == math.radians(90)
    bare = "2D-Map\nLINES\n-1000 0 3000 0\n"
    start = aria(tmp_path, bare).start
    assert abs(start.y_m) > 0.5


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("2D-Map", "3D-Map", ":1: an ARIA map begins"),
        ("NumLines: 2", "NumLines: 5", "promises lines 5, and has 2"),
        ("NumPoints: 6", "NumPoints: 7", "promises points 7"),
        ("NumPoints: 6", "NumPoints: many", ":4: expected 1 numbers"),
        ("-1000 -2000 3000 -2000", "-1000 -2000 3000", ":16: expected 4 numbers"),
        ("-1000 -2000 3000 -2000", "-1000 -2000 nan 3", ":16: expected 4 numbers"),
        ("2000 2000", "1e300 0", ":19: expected 2 numbers"),
        ("Cairn: Goal 1000 500 0.000000", "Cairn:", "without a type"),
        ("Cairn: Goal 1000 500 0.000000", "Cairn: Goal 1000", ":7: expected 3"),
        ("0 1000 2000 1000", "0 1000", ":11: expected 4"),
        ("2000 2000", "9000000 9000000", "too far apart"),
    ],
)
def test_a_broken_map_is_one_line_with_its_place(tmp_path: Path, old: str, new: str, message: str) -> None:
    text = ARIA.replace(old, new, 1)
    if "Cairn:\n" in text or new == "Cairn:":
        text = ARIA.replace('Cairn: Goal 1000 500 0.000000 "" ICON "Goal 1"', "Cairn: ", 1)
    with pytest.raises(WorldError) as caught:
        aria(tmp_path, text)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_empty_map_is_refused(tmp_path: Path) -> None:
    with pytest.raises(WorldError, match="nothing in it"):
        aria(tmp_path, "2D-Map\nLINES\n5 5 5 5\nDATA\n")


@settings(max_examples=60)
@given(st.text(alphabet=st.sampled_from('0123456789 -.\n"CairnGoalLINESDATA:e'), max_size=200))
def test_no_text_breaks_the_reader_of_maps(text: str) -> None:
    with tempfile.TemporaryDirectory() as folder, contextlib.suppress(WorldError):
        aria(Path(folder), "2D-Map\n" + text)


# Occupancy images ------------------------------------------------------------------------

YAML = (
    "image: map.pgm\nresolution: 0.05\norigin: [-1.0, -0.5, 0.0]\nnegate: 0\n"
    "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
)


def pgm(path: Path, rows: list[str], values: dict[str, int] | None = None) -> None:
    table = {"#": 0, ".": 254, "?": 205} if values is None else values
    data = bytes(table[cell] for row in rows for cell in row)
    path.write_bytes(f"P5\n# a comment\n{len(rows[0])} {len(rows)}\n255\n".encode() + data)


ROOM = ["#" * 60, *["#" + "." * 58 + "#"] * 58, "#" * 60]


@pytest.fixture
def image_map(tmp_path: Path) -> Path:
    pytest.importorskip("PIL")
    pytest.importorskip("yaml")
    pgm(tmp_path / "map.pgm", ROOM)
    (tmp_path / "map.yaml").write_text(YAML)
    return tmp_path / "map.yaml"


def test_an_image_becomes_few_boxes_in_their_places(image_map: Path) -> None:
    world = load_world(image_map)
    assert len(world.obstacles) == 4
    assert world.extent == pytest.approx((-1.0, -0.5, 2.0, 2.5))
    top = max(world.obstacles, key=lambda item: item.y_m)
    assert (top.x_m, top.y_m, top.length_m, top.width_m) == pytest.approx((0.5, 2.475, 3.0, 0.05))
    assert -0.5 < world.start.x_m < 1.5
    assert parse_world(write_world(world), "again.toml") == world


def test_the_yaw_of_the_origin_turns_the_map_about_its_corner(image_map: Path) -> None:
    image_map.write_text(YAML.replace("[-1.0, -0.5, 0.0]", f"[-1.0, -0.5, {math.pi / 2}]"))
    world = load_world(image_map)
    # The corner stays; what was up is now left.
    assert world.extent == pytest.approx((-4.0, -0.5, -1.0, 2.5))
    left = min(world.obstacles, key=lambda item: item.x_m)
    assert (left.x_m, left.y_m) == pytest.approx((-3.975, 1.0))


@pytest.mark.parametrize(
    ("settings_", "lightness", "solid"),
    [
        ("", 89, True),
        ("", 90, False),
        ("negate: 1", 165, False),
        ("negate: 1", 166, True),
        ("mode: scale", 89, True),
        ("mode: raw", 64, False),
        ("mode: raw", 65, True),
        ("mode: raw", 255, False),
    ],
)
def test_thresholds_and_modes_decide_what_is_solid(
    image_map: Path, settings_: str, lightness: int, solid: bool
) -> None:
    # (255 - 89) / 255 = 0.651 and (255 - 90) / 255 = 0.647 about the threshold of 0.65; 166 / 255 = 0.651.
    other = {"negate: 1": 254, "mode: raw": 100}.get(settings_, 0)
    pgm(image_map.parent / "map.pgm", ["#" * 8, "..x.....", "........"], {"#": other, ".": 254 - other, "x": lightness})
    if settings_ == "mode: raw":
        pgm(image_map.parent / "map.pgm", ["#" * 8, "..x....."], {"#": 100, ".": 0, "x": lightness})
    image_map.write_text(YAML.replace("negate: 0\n", "") + settings_)
    assert (len(load_world(image_map).obstacles) == 2) is solid


def test_colours_are_averaged_and_a_transparent_pixel_is_unknown(image_map: Path) -> None:
    from PIL import Image

    picture = Image.new("RGBA", (4, 4), (255, 255, 255, 255))
    picture.putpixel((0, 0), (0, 0, 0, 255))
    picture.putpixel((2, 2), (0, 0, 0, 0))
    picture.save(image_map.parent / "map.png")
    image_map.write_text(YAML.replace("map.pgm", "map.png"))
    assert len(load_world(image_map).obstacles) == 1


def test_a_map_has_its_names_in_latin_1_where_it_is_no_utf_8(tmp_path: Path) -> None:
    path = tmp_path / "a.map"
    for encoding in ("utf-8", "utf-8-sig", "latin-1"):
        path.write_bytes(ARIA.replace('"Goal 1"', '"K\xfcche"').encode(encoding))
        assert "K\xfcche" in [mark.name for mark in load_world(path).marks]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("image: [", "map.yaml:"),
        ("- 3", "names no image"),
        (YAML.replace("map.pgm", "other.pgm"), "'other.pgm', which is not there"),
        (YAML.replace("map.pgm", "http://example.org/a.pgm"), "not a local file"),
        (YAML.replace("image: map.pgm", "image: 3"), "must name a file"),
        (YAML.replace("0.05", "0"), "resolution = 0 must be a number"),
        (YAML.replace("0.05", ".nan"), "resolution = nan must be a number"),
        (YAML.replace("0.05", "99"), None),
        (YAML.replace("[-1.0, -0.5, 0.0]", "3"), "origin must be"),
        (YAML.replace("[-1.0, -0.5, 0.0]", "[.inf, 0, 0]"), "origin = inf"),
        (YAML + "mode: fancy", "mode = 'fancy'"),
        (YAML.replace("0.65", "7"), "occupied_thresh = 7"),
        ("a: &a [x]\n" + "".join(f"b{n}: &b{n} [*a, *a]\n" for n in range(3)), "names no image"),
    ],
)
def test_a_broken_yaml_is_one_line(image_map: Path, text: str, message: str | None) -> None:
    image_map.write_text(text)
    if message is None:
        assert load_world(image_map).extent[2] > 5000
        return
    with pytest.raises(WorldError) as caught:
        load_world(image_map)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_numbers_of_a_yaml_are_those_of_yaml_cpp_and_its_comments_any_bytes(image_map: Path) -> None:
    image_map.write_bytes(b"# caf\xe9\n" + YAML.replace("0.05", "5e-02").replace("-1.0", "1e-05").encode())
    assert load_world(image_map).extent[:3] == pytest.approx((1e-5, -0.5, 3.00001))
    image_map.write_text(YAML.replace("0.05", "5 cm"))
    with pytest.raises(WorldError, match="resolution = '5 cm' must be a number"):
        load_world(image_map)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"P5\n60 60\n255\n" + bytes(100), "cannot be read"),
        (b"P5\n100000 100000\n255\n", "too many"),
        (b"no picture", "cannot be read"),
        (b"P5\n10 10\n65535\n" + bytes(200), "8 bits"),
    ],
)
def test_a_broken_or_huge_image_is_refused(image_map: Path, data: bytes, message: str) -> None:
    (image_map.parent / "map.pgm").write_bytes(data)
    with pytest.raises(WorldError) as caught:
        load_world(image_map)
    assert message in f"{caught.value} {caught.value.hint}"


def test_an_image_cut_anywhere_is_refused_or_read(image_map: Path) -> None:
    from PIL import Image

    Image.new("L", (20, 20), 0).save(image_map.parent / "map.png")
    image_map.write_text(YAML.replace("map.pgm", "map.png"))
    whole = (image_map.parent / "map.png").read_bytes()
    for length in range(0, len(whole), 3):
        (image_map.parent / "map.png").write_bytes(whole[:length])
        assert refusal(image_map) in {"", f"{image_map.parent / 'map.png'}: the image cannot be read"}


def refusal(path: Path) -> str:
    """Return what the reader says against a file, or nothing."""
    try:
        load_world(path)
    except WorldError as error:
        return str(error)
    return ""


@given(st.lists(st.binary(min_size=6, max_size=6).map(lambda row: bytes(cell & 1 for cell in row)), max_size=8))
def test_rectangles_cover_each_solid_cell_once(rows: list[bytes]) -> None:
    covered = [[0] * 6 for _ in rows]
    for column, row, columns, count in rectangles(rows):
        for y in range(row, row + count):
            for x in range(column, column + columns):
                covered[y][x] += 1
    assert covered == [list(row) for row in rows]
