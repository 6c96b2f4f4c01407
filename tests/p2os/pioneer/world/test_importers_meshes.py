"""OBJ, STL and COLLADA: metres, Z up, the right way round, and nothing hostile gets through."""

# ruff: noqa: E501  # lines of XML stand as they are

import math
import struct
from pathlib import Path

import pytest

from p2os.errors import WorldError
from p2os.pioneer.world import load_world, parse_world
from p2os.pioneer.world.formats import xml_tree
from p2os.pioneer.world.formats.meshes import mesh_file
from p2os.pioneer.world.model import Mesh, cut, shadow
from p2os.pioneer.world.placing import Placing
from p2os.pioneer.world.readers import read_placed
from p2os.pioneer.world.writer import write_world

#: A wedge that no mirror image and no wrong turn leaves as it is: 2 m along x, 1 m along y, 3 m high at x = 0, y = 0.
WEDGE = [(0, 0, 0), (2, 0, 0), (0, 1, 0), (0, 0, 3)]
FACES = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
#: The same as a file with Y up writes it: (x, z, -y).
WEDGE_Y_UP = [(x, z, -y) for x, y, z in WEDGE]


def obj(points: list[tuple[float, float, float]]) -> str:
    lines = ["# Blender", "mtllib room.mtl", "o wedge"]
    lines += [f"v {x} {y} {z}" for x, y, z in points]
    lines += ["vn 0 0 1", "f " + " ".join(f"{i + 1}//1" for i in FACES[0])]
    lines += ["f " + " ".join(str(i - 4) for i in face) for face in FACES[1:]]
    return "\n".join(lines) + "\n"


def stl_text(points: list[tuple[float, float, float]]) -> str:
    facets = "".join(
        "facet normal 0 0 0\n outer loop\n"
        + "".join("  vertex {} {} {}\n".format(*points[i]) for i in face)
        + " endloop\nendfacet\n"
        for face in FACES
    )
    return f"solid wedge\n{facets}endsolid wedge\n"


def stl_binary(points: list[tuple[float, float, float]]) -> bytes:
    rows = b"".join(struct.pack("<12fH", 0, 0, 0, *(v for i in face for v in points[i]), 0) for face in FACES)
    return bytes(80) + struct.pack("<I", len(FACES)) + rows


def dae(points: list[tuple[float, float, float]], up: str = "Y_UP", unit: str = "1", node: str = "") -> str:
    values = " ".join(str(value) for point in points for value in point)
    indices = " ".join(f"{i} 0" for face in FACES for i in face)
    return f"""<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
  <asset><unit name="x" meter="{unit}"/><up_axis>{up}</up_axis></asset>
  <library_geometries><geometry id="g"><mesh>
    <source id="p"><float_array id="pa" count="12">{values}</float_array>
      <technique_common><accessor source="#pa" count="4" stride="3"/></technique_common></source>
    <source id="n"><float_array id="na" count="3">0 0 1</float_array></source>
    <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
    <polylist count="4"><input semantic="VERTEX" source="#v" offset="0"/><input semantic="NORMAL" source="#n" offset="1"/>
      <vcount>3 3 3 3</vcount><p>{indices}</p></polylist>
  </mesh></geometry></library_geometries>
  <library_visual_scenes><visual_scene id="s"><node id="w">{node}<instance_geometry url="#g"/></node>
    </visual_scene></library_visual_scenes>
  <scene><instance_visual_scene url="#s"/></scene>
</COLLADA>"""


def rounded(mesh: Mesh) -> set[tuple[float, ...]]:
    return {tuple(round(value, 6) + 0.0 for value in vertex) for vertex in mesh.vertices}


CASES = {
    "an OBJ with Y up": ("a.obj", obj(WEDGE_Y_UP), "auto"),
    "an OBJ with Z up, as named": ("a.obj", obj(WEDGE), "z"),
    "an OBJ with X up, as named": ("a.obj", obj([(z, y, -x) for x, y, z in WEDGE]), "x"),
    "a text STL": ("a.stl", stl_text(WEDGE), "auto"),
    "a text STL with Y up, as named": ("a.stl", stl_text(WEDGE_Y_UP), "y"),
    "a binary STL": ("a.stl", stl_binary(WEDGE), "auto"),
    "a COLLADA with Y up": ("a.dae", dae(WEDGE_Y_UP), "auto"),
    "a COLLADA with Z up": ("a.dae", dae(WEDGE, "Z_UP"), "auto"),
    "a COLLADA with X up": ("a.dae", dae([(z, y, -x) for x, y, z in WEDGE], "X_UP"), "auto"),
    "a COLLADA in millimetres": ("a.dae", dae([(1000 * x, 1000 * y, 1000 * z) for x, y, z in WEDGE], "Z_UP", "0.001"), "auto"),
    "a COLLADA with a scaled node": (
        "a.dae", dae([(x / 2, y / 2, z / 2) for x, y, z in WEDGE], "Z_UP", node="<scale>2 2 2</scale>"), "auto",
    ),
    "a COLLADA with turned and moved nodes": (
        "a.dae",
        dae([(y - 5, -x, z) for x, y, z in WEDGE], "Z_UP",
            node="<rotate>0 0 1 90</rotate><translate>5 0 0</translate>"),
        "auto",
    ),
    "a COLLADA with a matrix": (
        "a.dae", dae([(x - 1, y - 2, z - 3) for x, y, z in WEDGE], "Z_UP",
                     node="<matrix>1 0 0 1 0 1 0 2 0 0 1 3 0 0 0 1</matrix>"),
        "auto",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_a_mesh_comes_right_whatever_its_file(case: str, tmp_path: Path) -> None:
    name, data, up = CASES[case]
    path = tmp_path / name
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    (mesh,) = read_placed(path, Placing(up=up)).meshes
    assert rounded(mesh) == {tuple(map(float, point)) for point in WEDGE}
    assert len(mesh.triangles) == 4


def test_a_placed_mesh_is_scaled_turned_and_moved(tmp_path: Path) -> None:
    (tmp_path / "a.stl").write_text(stl_text(WEDGE))
    (tmp_path / "w.toml").write_text(
        'name = "w"\nextent_m = [-9, -9, 9, 9]\n'
        '[[import]]\nfile = "a.stl"\nx_m = 1\ny_m = 2\nz_m = 0.5\nheading_deg = 90\nscale = 2\n'
    )
    world = load_world(tmp_path / "w.toml")
    (mesh,) = world.meshes
    assert rounded(mesh) == {(1, 2, 0.5), (1, 6, 0.5), (-1, 2, 0.5), (1, 2, 6.5)}
    assert mesh.name == "a 1: a"
    assert parse_world(write_world(world), "again") == world


def test_the_cut_and_the_shadow_are_those_of_the_solid(tmp_path: Path) -> None:
    (tmp_path / "a.stl").write_text(stl_text(WEDGE))
    (mesh,) = load_world(tmp_path / "a.stl").meshes
    # At half its height the wedge is half as long and half as wide: 1 m, 0.5 m and the slope between.
    lengths = sorted(math.dist(*segment) for segment in cut(mesh, 1.5))
    assert lengths == pytest.approx([0.5, 1.0, math.hypot(1, 0.5)], abs=2e-4)
    points = [point for polygon in shadow(mesh, 1.5, 9.0) for point in polygon]
    assert max(x for x, _ in points) == pytest.approx(1.0, abs=1e-3)
    assert max(y for _, y in points) == pytest.approx(0.5, abs=1e-3)
    assert shadow(mesh, 4.0, 9.0) == []
    assert cut(mesh, 4.0) == []


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("a.obj", "v 1 2\n", "a.obj:1: 'v 1 2' cannot be read"),
        ("a.obj", "v 1 2 x\n", "a.obj:1:"),
        ("a.obj", "v 0 0 0\nf 1 2 3\n", "a.obj:2:"),
        ("a.obj", "v 0 0 0\nf 0 0 0\n", "a.obj:2:"),
        ("a.obj", "", "nothing in it"),
        ("a.obj", obj([(math.nan, 0, 0), *WEDGE_Y_UP[1:]]), "not finite"),
        ("a.obj", obj([(1e30, 0, 0), *WEDGE_Y_UP[1:]]), "farther out"),
        ("a.obj", obj([(0, -10_002.1, 0), *WEDGE_Y_UP[1:]]), "farther out"),
        ("a.stl", stl_binary(WEDGE)[:-1], "no STL"),
        ("a.stl", bytes(80) + b"\xff\xff\xff\xff" + bytes(100), "no STL"),
        ("a.stl", bytes(10), "no STL"),
        ("a.stl", stl_text(WEDGE)[:-20], "before its `endsolid`"),
        ("a.stl", stl_text(WEDGE).replace("  vertex 2 0 0\n", "", 1), "3 vertices, not 2"),
        ("a.stl", stl_text(WEDGE).replace("vertex 2 0 0", "vertex 2 0", 1), "is no vertex"),
        ("a.stl", stl_binary([(math.inf, 0, 0), *WEDGE[1:]]), "not finite"),
        ("a.dae", "<COLLADA>", "a.dae:1: no element found"),
        ("a.dae", "<html/>", "expected <COLLADA>, got <html>"),
        ("a.dae", dae(WEDGE).replace("#v", "#zz"), "names 'zz', which is not there"),
        ("a.dae", dae(WEDGE).replace("<p>0 0 2 0", "<p>0 0 99 0"), "vertex that is not there"),
        ("a.dae", dae(WEDGE).replace("<p>0 0 2 0", "<p>0 0 x 0"), "no whole number"),
        ("a.dae", dae(WEDGE).replace("<vcount>3 3 3 3", "<vcount>3 3 3 9"), "cut short"),
        ("a.dae", dae(WEDGE).replace("POSITION", "OTHER"), "without a POSITION"),
        ("a.dae", dae(WEDGE).replace('float_array id="pa"', "int_array").replace("</float_array>\n", "</int_array>\n", 1), None),
        ("a.dae", dae(WEDGE, unit="0"), "makes no sense"),
        ("a.dae", dae(WEDGE, unit="nan"), "not finite"),
        ("a.dae", dae(WEDGE, up="W_UP"), "makes no sense"),
        ("a.dae", dae(WEDGE, node="<matrix>1 2 3</matrix>"), "needs 16 numbers, got 3"),
    ],
)  # fmt: skip
def test_a_broken_mesh_is_one_line(tmp_path: Path, name: str, data: str | bytes, message: str | None) -> None:
    path = tmp_path / name
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    with pytest.raises(WorldError) as caught:
        load_world(path)
    assert (message or "") in str(caught.value)
    assert "\n" not in str(caught.value)


BILLION_LAUGHS = """<?xml version="1.0"?>
<!DOCTYPE lolz [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">]>
<COLLADA>&b;</COLLADA>"""
OUTSIDE = '<!DOCTYPE x [<!ENTITY e SYSTEM "file:///etc/passwd">]><sdf>&e;</sdf>'


@pytest.mark.parametrize(
    ("name", "text"),
    [("a.dae", BILLION_LAUGHS), ("a.sdf", OUTSIDE), ("a.urdf", BILLION_LAUGHS), ("a.world", OUTSIDE)],
)
def test_entities_are_refused(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(WorldError, match="document type declaration is refused"):
        load_world(tmp_path / name)


def test_deep_and_wide_xml_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.dae"
    path.write_text("<COLLADA>" + "<node>" * 5000)
    with pytest.raises(WorldError, match="within each other"):
        load_world(path)
    assert xml_tree.MOST_ELEMENTS == 200_000
    monkeypatch.setattr(xml_tree, "MOST_ELEMENTS", 2_000)
    for count, message in ((1_999, "nothing in it"), (2_000, "more than 2000 elements")):
        path.write_text("<COLLADA>" + "<a/>" * count + "</COLLADA>")
        with pytest.raises(WorldError, match=message):
            load_world(path)


def test_nodes_that_show_each_other_again_and_again_are_refused(tmp_path: Path) -> None:
    nodes = "".join(
        f'<node id="n{n}"><instance_node url="#n{n + 1}"/><instance_node url="#n{n + 1}"/></node>' for n in range(30)
    )
    text = dae(WEDGE, node='<instance_node url="#n0"/>').replace(
        "<library_visual_scenes>", f'<library_nodes>{nodes}<node id="n30"/></library_nodes><library_visual_scenes>'
    )
    (tmp_path / "a.dae").write_text(text)
    with pytest.raises(WorldError, match="nodes within each other"):
        load_world(tmp_path / "a.dae")


def test_too_many_triangles_are_refused_before_they_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert mesh_file.MOST_TRIANGLES == 200_000
    monkeypatch.setattr(mesh_file, "MOST_TRIANGLES", 500)
    facet = struct.pack("<12fH", *(0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0), 0)
    for count in (500, 501):
        (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n" + "f 1 2 3\n" * count + "no more\n")
        (tmp_path / "a.stl").write_bytes(bytes(80) + struct.pack("<I", count) + facet * count)
        for name, where in (("a.obj", ":504"), ("a.stl", "")):
            if count <= 500:
                assert len(load_world(tmp_path / name).meshes[0].triangles) == count
            else:
                with pytest.raises(WorldError, match=f"{name}{where}: more than 500 triangles"):
                    load_world(tmp_path / name)


def refusal(path: Path) -> str:
    """Return what the reader says against a file, or nothing."""
    try:
        load_world(path)
    except WorldError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("case", ["an OBJ with Y up", "a text STL", "a binary STL", "a COLLADA with Y up"])
def test_a_mesh_cut_at_any_place_is_refused_or_read(case: str, tmp_path: Path) -> None:
    name, data, _ = CASES[case]
    whole = data if isinstance(data, bytes) else data.encode()
    path = tmp_path / name
    for length in range(0, len(whole), 7):
        path.write_bytes(whole[:length])
        assert "\n" not in refusal(path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('file = "none.stl"', "w.toml:4: [[import]] 1: "),
        ('file = "a.txt"', "no reader for .txt"),
        ('file = "a.stl"\nup = "q"', "up = 'q' is unknown"),
        ('file = "a.stl"\nscale = 0', "scale = 0 is out of range"),
        ('file = "."', "no reader"),
        ('file = "w.toml"', "where a file of another program is taken"),
    ],
)
def test_a_broken_import_names_its_line(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "a.stl").write_text(stl_text(WEDGE))
    (tmp_path / "a.txt").write_text("")
    (tmp_path / "w.toml").write_text(f'name = "w"\nextent_m = [-9, -9, 9, 9]\n[[import]]\n{text}\n')
    with pytest.raises(WorldError) as caught:
        load_world(tmp_path / "w.toml")
    assert message in str(caught.value)
