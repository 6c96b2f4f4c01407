"""glTF and GLB: the scene that is shown, its nodes in their places, and what is hostile ends in one line."""

import base64
import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from p2os.errors import WorldError
from p2os.pioneer.world import load_world
from p2os.pioneer.world.formats.meshes.gltf import read_gltf
from tests.p2os.pioneer.world.counted_calls import calls_of

#: A wedge that no mirror image and no wrong turn leaves as it is, Z up: (x, z, -y) is how a file writes it.
WEDGE = [(0, 0, 0), (2, 0, 0), (0, 1, 0), (0, 0, 3)]
FACES = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
BYTES = b"".join(struct.pack("<3f", x, z, -y) for x, y, z in WEDGE) + struct.pack("<12H", *sum(FACES, ()))
#: As `tools/fuzz/files.py` writes a document: any JSON.
Document = dict[str, Any]


def document(**changes: object) -> Document:
    return {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 24},
        ],
        "buffers": [{"byteLength": 72, "uri": "data:;base64," + base64.b64encode(BYTES).decode()}],
    } | changes  # fmt: skip


def glb(content: Document) -> bytes:
    text = json.dumps(content).encode()
    body = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(BYTES), b"BIN\0") + BYTES
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def corners(path: Path) -> set[tuple[float, ...]]:
    (mesh,) = load_world(path).meshes
    return {tuple(round(value, 6) + 0.0 for value in vertex) for vertex in mesh.vertices}


def written(folder: Path, content: Document) -> Path:
    path = folder / "a.gltf"
    path.write_text(json.dumps(content))
    return path


def test_a_gltf_with_its_bytes_within_beside_or_behind_it_is_the_same_world(tmp_path: Path) -> None:
    (tmp_path / "a b.bin").write_bytes(BYTES)
    (tmp_path / "a.glb").write_bytes(glb(document(buffers=[{"byteLength": 72}])))
    beside = document(buffers=[{"byteLength": 72, "uri": "a%20b.bin"}])
    wanted = {tuple(map(float, point)) for point in WEDGE}
    assert corners(written(tmp_path, document())) == wanted
    assert corners(written(tmp_path, beside)) == wanted
    assert corners(tmp_path / "a.glb") == wanted


def test_nodes_within_nodes_scale_turn_and_move(tmp_path: Path) -> None:
    half = 0.5**0.5
    nodes = [
        # About Y, which is up: x of the file goes to -z, and that is y of the world.
        {"rotation": [0, half, 0, half], "translation": [5, 1, 0], "children": [1]},
        {"matrix": [2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1], "children": [2]},
        {"mesh": 0, "camera": 0, "name": "world"},
    ]
    turned = {(5 - 2.0 * y, 2.0 * x, 1 + 2.0 * z) for x, y, z in WEDGE}
    assert corners(written(tmp_path, document(nodes=nodes))) == {tuple(v + 0.0 for v in p) for p in turned}


def test_a_mesh_of_two_primitives_shown_twice_is_there_four_times_and_always_alike(tmp_path: Path) -> None:
    primitive = document()["meshes"][0]["primitives"][0]
    content = document(
        meshes=[{"primitives": [primitive, primitive]}], nodes=[{"mesh": 0, "children": [1]}, {"mesh": 0}]
    )
    path = written(tmp_path, content)
    (mesh,) = load_world(path).meshes
    assert len(mesh.triangles) == 16
    assert load_world(path).meshes == (mesh,)


def test_what_is_no_triangle_is_left_out_and_said(tmp_path: Path) -> None:
    primitives = [*document()["meshes"][0]["primitives"], {"mode": 1, "attributes": {"POSITION": 0}}]
    world = load_world(written(tmp_path, document(meshes=[{"primitives": primitives}], nodes=[{"mesh": 0, "skin": 0}])))
    assert [line.split(":")[1] for line in world.skipped] == [" glTF skins", " glTF lines"]


def changed(key: str, number: int, **changes: object) -> Document:
    content = document()
    content[key][number] |= changes
    return content


RING = document(nodes=[{"mesh": 0, "children": [1]}, {"children": [0]}])
SHARED = document(nodes=[{"children": [1, 1]}, {"mesh": 0}])
DEEP = document(nodes=[{"mesh": 0, "children": [n + 1]} for n in range(70)] + [{"mesh": 0}])
EMPTY = document(
    meshes=[{"primitives": [{"mode": 1}] * 300}],
    nodes=[{"children": [n + 1 for n in range(300)]}, *[{"mesh": 0}] * 300],
)
MANY = document(nodes=[{"children": [n + 1 for n in range(20_000)]}, *[{"mesh": 0}] * 20_000])


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (RING, "nodes make no tree"),
        (SHARED, "nodes make no tree"),
        (DEEP, "more than 64 deep"),
        (EMPTY, "more than 20000 shapes"),
        (MANY, "or are more than 20000"),
        (document(asset={"version": "1.0"}), "glTF version '1.0'"),
        (document(extensionsRequired=["KHR_draco_mesh_compression"]), "needs the extension 'KHR_draco"),
        (document(nodes=[{"mesh": 7}]), "meshes[7] is named and not there"),
        (document(nodes=[{"mesh": True}]), "mesh = True is no whole number"),
        (document(nodes=[{"mesh": 0, "scale": [1, 1]}]), "scale needs 3 finite numbers"),
        (document(nodes=[{"mesh": 0, "scale": [1, 1, float("nan")]}]), "scale needs 3 finite numbers"),
        (document(nodes=[{"mesh": 0, "rotation": [0, 0, 0, 0]}]), "rotation has no length"),
        (document(nodes=[{"mesh": 0, "translation": [1e8, 0, 0]}]), "farther out"),
        (document(nodes=[]), "nodes[0] is named and not there"),
        (changed("accessors", 0, count=10**12), "count = 1000000000000 is no whole number"),
        (changed("accessors", 0, count=5), "do not fit its buffer"),
        (changed("accessors", 0, count=-1), "count = -1"),
        (changed("accessors", 0, sparse={"count": 1}), "is sparse"),
        (changed("accessors", 0, componentType=5130), "expected VEC3 of component type 5126"),
        (changed("accessors", 1, count=11), "11 corners make no whole triangles"),
        (changed("accessors", 1, byteOffset=10**9), "do not fit its buffer"),
        (changed("bufferViews", 0, byteLength=10**8), "do not fit its buffer"),
        (changed("bufferViews", 0, byteLength=10**9), "do not fit its buffer"),
        (changed("bufferViews", 0, byteStride=253), "byteStride = 253"),
        (changed("buffers", 0, uri="http://example.org/a.bin"), "not a local file"),
        (changed("buffers", 0, uri="/etc/passwd"), "no file in the folder"),
        (changed("buffers", 0, uri="../a.bin"), "no file in the folder"),
        (changed("buffers", 0, uri="%2e%2e/a.bin"), "no file in the folder"),
        (changed("buffers", 0, uri="."), "no file in the folder"),
        (changed("buffers", 0, uri="none.bin"), "which is not there"),
        (changed("buffers", 0, uri="data:;base64,A"), "not base64"),
        (document(extras=[0] * 1_000_001), "more than 1000000 values"),
    ],
)  # fmt: skip
def test_a_hostile_gltf_is_one_line_that_names_it(content: Document, message: str, tmp_path: Path) -> None:
    (tmp_path / "inner").mkdir()
    (tmp_path / "a.bin").write_bytes(BYTES)
    path = written(tmp_path / "inner", content)
    with pytest.raises(WorldError) as caught:
        load_world(path)
    assert message in str(caught.value)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_an_index_beyond_the_vertices_is_refused(tmp_path: Path) -> None:
    data = BYTES[:48] + struct.pack("<12H", *range(12))
    uri = "data:;base64," + base64.b64encode(data).decode()
    with pytest.raises(WorldError, match="mesh 0: index 11 of 4 vertices"):
        load_world(written(tmp_path, changed("buffers", 0, uri=uri)))


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (lambda whole: whole[:-1], "a chunk is longer than the file"),
        (lambda whole: b"glTX" + whole[4:], "no GLB: it begins with b'glTX'"),
        (lambda whole: whole[:12], "its JSON cannot be read"),
        (lambda whole: whole.replace(b'"scene"', b"'scene\"", 1), "its JSON cannot be read"),
    ],
)
def test_a_damaged_glb_is_one_line(data: Callable[[bytes], bytes], message: str, tmp_path: Path) -> None:
    path = tmp_path / "a.glb"
    path.write_bytes(data(glb(document(buffers=[{"byteLength": 72}]))))
    with pytest.raises(WorldError, match=message):
        load_world(path)


@pytest.mark.parametrize(("mode", "count"), [(5, 2), (6, 2)])
def test_a_strip_and_a_fan_cover_the_same_square(mode: int, count: int, tmp_path: Path) -> None:
    order = (0, 1, 2, 3) if mode == 5 else (0, 1, 3, 2)
    square = b"".join(struct.pack("<3f", x, y, 0) for x, y in ((0, 0), (1, 0), (0, 1), (1, 1)))
    data = "data:;base64," + base64.b64encode(square + struct.pack("<4B", *order)).decode()
    content = document(
        meshes=[{"primitives": [{"mode": mode, "attributes": {"POSITION": 0}, "indices": 1}]}],
        buffers=[{"byteLength": 52, "uri": data}],
    )
    content["accessors"][1] |= {"componentType": 5121, "count": 4}
    content["bufferViews"][1] |= {"byteLength": 4}
    (mesh,) = load_world(written(tmp_path, content)).meshes
    assert len(mesh.triangles) == count
    total = 0.0
    for a, b, c in ((mesh.vertices[i] for i in triangle) for triangle in mesh.triangles):
        total += ((b[0] - a[0]) * (c[2] - a[2]) - (c[0] - a[0]) * (b[2] - a[2])) / 2
    assert total == pytest.approx(1.0)  # both the right way round


def test_twice_as_many_nodes_in_chains_are_twice_the_work(tmp_path: Path) -> None:
    def read(count: int, deep: int) -> int:
        nodes = [{"mesh": 0} | ({"children": [n + 1]} if (n + 1) % deep else {}) for n in range(count)]
        path = written(tmp_path, document(nodes=nodes, scenes=[{"nodes": list(range(0, count, deep))}]))
        work = calls_of(lambda: read_gltf(path))
        assert len(load_world(path).meshes[0].triangles) == 4 * count
        return work

    once = read(480, 60)
    assert read(960, 60) < 2.1 * once
    assert read(480, 6) > 0.9 * once, "a node costs the same at every depth"
