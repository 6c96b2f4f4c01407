"""Files that are odd but right, and small files that ask for much: read as they are meant, or refused in one line."""

import os
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from p2os.cli.main import run
from p2os.errors import WorldError
from p2os.pioneer.world import load_world
from p2os.pioneer.world.formats import collection
from p2os.pioneer.world.formats.meshes.polygon import MOST_CORNERS, triangulated
from p2os.pioneer.world.model import World, cut

#: A wall of 3 x 2 m in the plane y = 0 that goes around a doorway of 1 x 1.5 m, as one polygon: x, z.
DOORWAY = [(0, 0), (1, 0), (1, 1.5), (2, 1.5), (2, 0), (3, 0), (3, 2), (0, 2)]
FACET = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 0 1\nendloop\nendfacet\n"


def read(path: Path, text: str | bytes) -> World:
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return load_world(path)


def refusal(path: Path, text: str | bytes) -> str:
    """Return the message about a file: one line that names it."""
    with pytest.raises(WorldError) as caught:
        read(path, text)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith(str(path.parent))
    assert len(str(caught.value)) < 400
    return str(caught.value)


def area(world: World) -> float:
    """Return the area of all upright faces in the plane y = 0."""
    (mesh,) = world.meshes
    total = 0.0
    for a, b, c in ((mesh.vertices[i] for i in triangle) for triangle in mesh.triangles):
        total += abs((b[0] - a[0]) * (c[2] - a[2]) - (c[0] - a[0]) * (b[2] - a[2])) / 2
    return total


# Polygons ----------------------------------------------------------------------------------


VERTEX = '<input semantic="VERTEX" source="#v" offset="0"/>'


def dae(faces: str, points: list[tuple[float, float]]) -> str:
    numbers = " ".join(f"{x} 0 {z}" for x, z in points)
    return (
        '<COLLADA><asset><unit meter="0.5"/><up_axis>Z_UP</up_axis></asset><library_geometries><geometry id="g"><mesh>'
        f'<source id="s"><float_array>{numbers}</float_array></source>'
        '<vertices id="v"><input semantic="POSITION" source="#s"/></vertices>'
        f"{faces.format(vertex=VERTEX)}</mesh></geometry>"
        '</library_geometries><library_visual_scenes><visual_scene id="x"><node><scale>2 1 1</scale><node>'
        '<scale>1 2 2</scale><instance_geometry url="#g"/></node></node></visual_scene>'
        "</library_visual_scenes></COLLADA>"
    )


def obj(points: list[tuple[float, float]], face: str) -> str:
    return "".join(f"v {x} {z} 0\n" for x, z in points) + f"f {face}\n"


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("first", range(len(DOORWAY)))
def test_a_wall_around_a_doorway_leaves_it_open(first: int, turned: bool, tmp_path: Path) -> None:
    points = DOORWAY[first:] + DOORWAY[:first]
    if turned:
        points.reverse()
    faces = " ".join(str(number) for number in range(len(points)))
    worlds = [
        read(tmp_path / "a.obj", obj(points, " ".join(str(n - 8) for n in range(8)))),
        read(tmp_path / "b.dae", dae(f"<polygons>{{vertex}}<p>{faces}</p></polygons>", points)),
        read(tmp_path / "c.dae", dae(f"<polylist>{{vertex}}<vcount>8</vcount><p>{faces}</p></polylist>", points)),
    ]
    for world in worlds:
        assert area(world) == pytest.approx(4.5)
        walls = sorted(tuple(sorted((round(a[0], 6), round(b[0], 6)))) for a, b in cut(world.meshes[0], 0.2))
        assert walls == [(0.0, 1.0), (2.0, 3.0)]


@settings(max_examples=60)
@given(st.lists(st.tuples(*[st.floats(-5, 5)] * 3), min_size=3, max_size=12))
def test_any_polygon_becomes_triangles_of_its_corners(corners: list[tuple[float, float, float]]) -> None:
    found = triangulated(corners)
    assert len(found) == len(corners) - 2
    assert {number for triangle in found for number in triangle} <= set(range(len(corners)))


def test_a_star_keeps_its_area_and_a_huge_polygon_is_a_fan() -> None:
    star = [
        (r * x, r * y, 0.0) for r, x, y in ((1, 1, 0), (0.2, 1, 1), (1, 0, 1), (0.2, -1, 1), (1, -1, 0), (1, 0, -1))
    ]
    whole = sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(star, [*star[1:], star[0]], strict=True)) / 2
    parts = 0.0
    for a, b, c in triangulated(star):
        (ax, ay, _), (bx, by, _), (cx, cy, _) = star[a], star[b], star[c]
        parts += ((bx - ax) * (cy - ay) - (cx - ax) * (by - ay)) / 2
    assert parts == pytest.approx(whole)
    many = [(float(n), float(n % 2), 0.0) for n in range(MOST_CORNERS + 1)]
    assert triangulated(many) == [(0, n, n + 1) for n in range(1, MOST_CORNERS)]


@pytest.mark.parametrize(
    ("faces", "message"),
    [
        ("<polygons>{vertex}<p/></polygons>", "a face is cut short"),
        ("<polygons>{vertex}<p>0 1</p></polygons>", "a face is cut short"),
        ("<polygons>{vertex}<ph><p>0 1 2</p><h>0 1 2</h></ph></polygons>", "nothing in it"),
        ("<triangles>{vertex}<p>0 1 -1</p></triangles>", "-1 is out of range"),
        ("<polylist>{vertex}<vcount>999999999</vcount><p>0 1 2</p></polylist>", "a face is cut short"),
    ],
)
def test_a_broken_collada_face_is_one_line(faces: str, message: str, tmp_path: Path) -> None:
    assert message in refusal(tmp_path / "a.dae", dae(faces, DOORWAY))


# Lines as other systems end and continue them ----------------------------------------------


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_an_obj_line_that_goes_on_keeps_the_numbers_of_the_lines(end: str, tmp_path: Path) -> None:
    text = "\ufeffv 0 0 0\nv 1 0 \\\n0\nv 1 1 0\nf -3// -2/1 \\\n3/1/2\n"
    assert len(read(tmp_path / "a.obj", text.replace("\n", end)).meshes[0].triangles) == 1
    assert ":7:" in refusal(tmp_path / "a.obj", (text + "f 1 2\n").replace("\n", end))


@pytest.mark.parametrize("change", [str.upper, lambda text: text.replace("\n", "\r"), lambda text: text * 2])
def test_a_text_stl_in_capitals_with_old_line_ends_or_of_two_solids_is_read(change: object, tmp_path: Path) -> None:
    assert callable(change)
    assert read(tmp_path / "a.stl", change(f"solid a\n{FACET}endsolid a\n")).meshes
    assert "endsolid" in refusal(tmp_path / "a.stl", f"solid a\n{FACET}endsolid a\nsolid b\n{FACET}")


def test_a_map_with_a_byte_order_mark_and_foreign_line_ends_is_read(tmp_path: Path) -> None:
    assert read(tmp_path / "a.map", "\ufeff2D-Map\r\nNumLines: 1\r\nLINES\r\n0 0 1000 0\r\nDATA\r\n").obstacles


# Images ------------------------------------------------------------------------------------


def image_map(folder: Path, image: str, data: bytes, lines: str = "") -> World:
    (folder / image).write_bytes(data)
    return read(folder / "m.yaml", f"image: {image}\nresolution: 0.5\norigin: [0, 0, 0]\n{lines}")


@pytest.mark.parametrize(
    ("header", "body"),
    [
        ("P2\n# said\n3 2\n# and said\n255\n", b"0 254 205\n254 254 254\n"),
        ("P2 3 2 100\n", b"0 99 80 99 99 99"),
        ("P5 3 2 255\n", bytes((0, 254, 205, 254, 254, 254))),
        ("P5 3 2 100\n", bytes((0, 99, 80, 99, 99, 99))),
    ],
)
def test_every_grey_pgm_with_eight_bits_is_read_alike(header: str, body: bytes, tmp_path: Path) -> None:
    pytest.importorskip("PIL")
    (block,) = image_map(tmp_path, "a.pgm", header.encode() + body).obstacles
    assert (block.x_m, block.y_m, block.length_m, block.width_m) == pytest.approx((0.25, 0.75, 0.5, 0.5))


@pytest.mark.parametrize("mode", ["1", "L", "LA", "P", "RGB", "RGBA"])
def test_every_png_with_eight_bits_is_read_alike(mode: str, tmp_path: Path) -> None:
    image_of = pytest.importorskip("PIL.Image")
    picture = image_of.new("L", (3, 2), 255)
    picture.putpixel((2, 1), 0)
    picture.convert(mode).save(tmp_path / "kept.png")
    for lines in ("", "mode: scale\nnegate: 0\n", "mode: trinary\noccupied_thresh: 0.9\n"):
        (block,) = image_map(tmp_path, "a.png", (tmp_path / "kept.png").read_bytes(), lines).obstacles
        assert (block.x_m, block.y_m) == pytest.approx((1.25, 0.25))
    assert len(image_map(tmp_path, "a.png", (tmp_path / "kept.png").read_bytes(), "negate: true\n").obstacles) == 2


# Small files that ask for much --------------------------------------------------------------

BOMB = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{chr(98 + level)}: &{chr(98 + level)} [{', '.join(['*' + chr(97 + level)] * 9)}]\n" for level in range(9)
)


@pytest.mark.parametrize(
    ("resolution", "message"),
    [
        ("*j", "resolution = a list must be"),
        ("0.05\nmode: *j", "mode = a list is unknown"),
        ("!!int ''", "does not fit its tag"),
        ("!!float ''", "does not fit its tag"),
        ("!!bool maybe", "does not fit its tag"),
        ("!!timestamp x", "does not fit its tag"),
        ("0x" + "f" * 6000, "resolution = a huge number"),
        ("true", "resolution = True must be"),
        ("'" + "x" * 1000 + "'", "resolution = 'xxx"),
        ("!!python/object/apply:os.getcwd []", "could not determine a constructor"),
    ],
)
def test_hostile_yaml_is_one_line(resolution: str, message: str, tmp_path: Path) -> None:
    pytest.importorskip("yaml")
    text = f"{BOMB}image: a.pgm\norigin: [0, 0, 0]\nresolution: {resolution}\n"
    (tmp_path / "a.pgm").write_bytes(b"P5 1 1 255\n\0")
    assert message in refusal(tmp_path / "m.yaml", text)


def urdf(geometry: str) -> str:
    return f'<robot name="r"><link name="l"><collision><geometry>{geometry}</geometry></collision></link></robot>'


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_a_pipe_in_place_of_a_file_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "p.stl")
    assert "neither a file" in refusal(tmp_path / "a.urdf", urdf('<mesh filename="p.stl"/>'))
    pytest.importorskip("yaml")
    assert "neither a file" in refusal(tmp_path / "m.yaml", "image: p.stl\nresolution: 1\norigin: [0, 0, 0]\n")


def test_a_chain_of_many_joints_is_walked_once(tmp_path: Path) -> None:
    count = 3000
    links = "".join(
        f'<link name="l{n}"><collision><geometry><sphere radius="1"/></geometry></collision></link>'
        if n in {0, count} else f'<link name="l{n}"/>'
        for n in range(count + 1)
    )  # fmt: skip
    joints = "".join(
        f'<joint name="j{n}"><origin xyz="0.001 0 0"/><parent link="l{n}"/><child link="l{n + 1}"/></joint>'
        for n in range(count)
    )
    first, last = read(tmp_path / "a.urdf", f'<robot name="r">{links}{joints}</robot>').meshes
    assert last.bounds[0][0] - first.bounds[0][0] == pytest.approx(3.0)


def test_lines_too_long_for_their_points_are_refused(tmp_path: Path) -> None:
    lines = "".join(f"-9000000 {n} 9000000 {n}\n" for n in range(10))
    assert "too long" in refusal(tmp_path / "a.map", f"2D-Map\nLINES\n{lines}DATA\n5 5\n")


@pytest.mark.parametrize("pose", ["0 0 1e200 0 0 0", "1e200 0 0 0 0 0"])
def test_a_thing_too_far_away_or_too_high_is_refused(pose: str, tmp_path: Path) -> None:
    text = (
        f'<sdf><model name="m"><pose>{pose}</pose><link name="l"><collision name="c"><geometry><box><size>1 1 1</size>'
        "</box></geometry></collision></link></model></sdf>"
    )
    assert "out of range" in refusal(tmp_path / "a.sdf", text)


def test_the_command_says_it_in_one_line_and_ends_with_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.obj").write_text("v 0 0 0\nf 1 2\n")
    assert run(["world", "show", str(tmp_path / "a.obj")]) == 2
    captured = capsys.readouterr()
    assert captured.err.splitlines()[0] == f"p2os: {tmp_path / 'a.obj'}:2: 'f 1 2' cannot be read"
    assert captured.out == ""


def test_the_start_in_a_large_uneven_field_is_found_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    side = 100  # 19 602 triangles, each through the height of the hull, over 10 x 10 m
    points = "".join(f"v {x / 10} {(x + y) % 2} {y / 10}\n" for y in range(side) for x in range(side))
    faces = "".join(
        f"f {i} {i + 1} {i + side}\nf {i + 1} {i + side + 1} {i + side}\n"
        for i in (1 + y * side + x for y in range(side - 1) for x in range(side - 1))
    )
    distances: list[tuple[float, float]] = []

    def counted(x: float, y: float, *line: float) -> float:
        distances.append((x, y))
        return distance(x, y, *line)

    distance = collection.point_segment
    monkeypatch.setattr(collection, "point_segment", counted)
    world = read(tmp_path / "a.obj", points + faces)
    # Less than one a triangle: each with each of 577 places would be 34 millions.
    assert 0 < len(distances) < 2 * (side - 1) ** 2
    assert (world.start.x_m, world.start.y_m) == pytest.approx((4.95, -4.95))  # no place is free: the middle
