"""Worlds and files at the bounds of all that they may hold, and one beyond, as approved."""

# ruff: noqa: E501  # rows of tables stand as they are

import json
import math
import random
import struct
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import fields, replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from unittest.mock import patch

from p2os.pioneer.world import model, parse_world, text_file
from p2os.pioneer.world.file import IMPORT_KEYS, MARK_KEYS, MESH_KEYS, SHAPES, START_KEYS, in_range
from p2os.pioneer.world.formats import annotation, aria_map, collection, rectangles, sdf, urdf, xml_tree
from p2os.pioneer.world.formats.local_file import find_local
from p2os.pioneer.world.formats.meshes import collada, gltf, mesh_file, polygon
from p2os.pioneer.world.geometry import Footprint, placed
from p2os.pioneer.world.makers.walkway import Measures, walkway
from p2os.pioneer.world.model import Mark, Mesh, Obstacle, ObstacleKind, Pose, Repeat, Walk, World
from p2os.pioneer.world.start_places import floor_height, refuse_start, start_places, thing_at
from p2os.pioneer.world.writer import write_world
from p2os.robots.parameters import load_parameters
from p2os.toml_file import toml_text
from p2os.toml_schema import Key
from tests.p2os.pioneer.world import test_importers_gltf as in_gltf
from tests.p2os.pioneer.world import test_importers_maps as maps
from tests.p2os.pioneer.world import test_importers_meshes as meshes
from tests.p2os.pioneer.world.walks.test_file_walks import seen
from tests.tools.suite.approved import Trace, judge_of, rounded, said, tried

HUGE = 1e300
NUMBERS = (0.0, -0.0, 1e-7, 1e-6, 0.001, 0.0099, 0.01, 1.0, 100.0, 100.1, -1.0, 10_000.0, 10_000.1, 20_000.0, 20_001.0)
FLAT = {"name": "a", "x_m": 1.0, "y_m": 2.0, "length_m": 1.0, "width_m": 0.5}
ROUND = {"name": "a", "x_m": 1.0, "y_m": 2.0, "radius_m": 0.5}
P2DX = load_parameters("p2dx")


def constructors(draw: random.Random) -> Iterator[str]:  # noqa: C901 - a table of rows
    """Make each value of a world with each number in each of its places."""
    bases: tuple[Mapping[str, object], ...] = (
        FLAT, ROUND, {**FLAT, "kind": ObstacleKind.RAMP}, {**FLAT, "kind": ObstacleKind.FLOOR}, {**ROUND, "mass_kg": 1.0},
    )  # fmt: skip
    for base in bases:
        for key in ("x_m", "base_m", "floor_m", "length_m", "width_m", "radius_m", "height_m", "mass_kg", "friction"):
            yield "\n".join(tried(lambda v=v, k=key, b=base: Obstacle(**b | {k: v}).section) for v in NUMBERS)  # type: ignore[arg-type]
        for heading in (math.nan, math.inf, 9.0):
            yield tried(Obstacle, **base | {"heading_rad": heading})
    flags = ({"fixed": True}, {"mass_kg": 1.0}, {"kind": ObstacleKind.FLOOR},
             {"walk": Walk(points_m=((0, 0), (1, 0)), speed_mps=1.0)})  # fmt: skip
    for one in flags:
        for other in flags:
            yield tried(Obstacle, **{**FLAT, **one, **other})
    for name in ("a" * 200, "a" * 201, "a\n", "ä", ""):
        yield tried(lambda n=name: Obstacle(**FLAT | {"name": n}).reach_m)  # type: ignore[arg-type]
        yield tried(
            lambda n=name: Mesh(name=n, vertices=((0, 0, 0), (1, 0, 0), (0, 1, 0)), triangles=((0, 1, 2),)).bounds
        )
    for at in NUMBERS:
        two = ((0.0, 0.0), (at, 1.0))
        yield tried(lambda at=at: Obstacle(**FLAT).standing_at(-at, at, 1.0).x_m)  # type: ignore[arg-type]
        yield tried(lambda two=two: Walk(points_m=two, speed_mps=1.0).round_trip())
        yield tried(lambda at=at: Walk(points_m=((0, 0), (1, 0)), speed_mps=at).speed_mps)
        yield tried(lambda at=at: Walk(points_m=((0, 0), (1, 0)), speed_mps=1, start_s=at * 100).start_s)
        yield tried(
            lambda at=at: Walk(points_m=((0, 0), (1, 0), (0, at)), speed_mps=1, repeat=Repeat.LOOP).round_trip()
        )
        yield tried(lambda at=at: Walk(points_m=((1, 0), (1, at)), speed_mps=1).round_trip())
        yield tried(
            lambda at=at: Mesh(name="m", vertices=((0, 0, 0), (at, 0, 0), (0, at, at)), triangles=((0, 1, 2),)).bounds
        )
        yield tried(lambda two=two: Mark(name="m", kind="dock", points_m=two).points_m)
        yield said(
            [at, model.has_area((0, 0, 0), (at, 0, 0), (0, at, 0)), model.has_area((0, 0, 0), (1, 0, 0), (1, at, 0))]
        )
        for start in (Pose(at, 0, 0), Pose(0, -at, 0), Pose(0, 0, 0, at)):
            yield tried(lambda at=at, start=start: world(start, extent=(-1, -1, 1, at)).extent)
    for corners in ((), ((0, 1, 3),), ((0, 1, -1),), ((0, 1, 1),), ((0, 1, 2), (0, 0, 0))):
        yield tried(lambda c=corners: Mesh(name="m", vertices=((0, 0, 0), (1, 0, 0), (0, 1, 0)), triangles=c).triangles)
    for value in (math.nan, math.inf, -HUGE):
        yield tried(Obstacle, **FLAT | {"y_m": value})
        yield tried(Walk, points_m=((0, 0), (value, 0)), speed_mps=1.0)
        yield tried(Obstacle(**FLAT).standing_at, 0.0, value, 0.0)  # type: ignore[arg-type]
        yield tried(Obstacle(**FLAT).standing_at, 0.0, 0.0, value)  # type: ignore[arg-type]
    for made in (partial(Walk, points_m=((0, 0),), speed_mps=1.0), partial(Mark, name="", kind="x", points_m=((0, 0),)),
                 partial(Mark, name="", kind="goal", points_m=())):  # fmt: skip
        yield tried(made)
    yield tried(world, things=[Obstacle(**FLAT), Obstacle(**ROUND)])  # type: ignore[arg-type]
    yield said([world().contains(x, y) for x in (-4.001, -4.0, 4.0, 4.001) for y in (-4.001, -4.0, 4.0, 4.001)])
    for base_m, height_m in ((0.0, 0.1), (0.2, 0.1), (0.1, 0.1), (0.0, 0.2)):
        item = Obstacle(**FLAT | {"base_m": base_m, "height_m": height_m})  # type: ignore[arg-type]
        yield said([item.stands_in(0.1, 0.2), item.stands_in(0.2, 0.3), item.stands_in(0.0, 0.1)])


def world(start: Pose = Pose(0, 0, 0), things: tuple[Obstacle, ...] | list[Obstacle] = (),  # noqa: B008 - a value
          extent: tuple[float, float, float, float] = (-4, -4, 4, 4)) -> World:  # fmt: skip
    return World(name="w", source="w", description="", start=start, extent=extent, obstacles=tuple(things))


def _given(key: Key) -> object:
    """Return a value that a key may have."""
    of_lists: dict[str, object] = {
        "path_m": [[0, 0], [1, 1]], "points_m": [[0, 0], [1, 1]], "from_m": [0, 0], "to_m": [2, 0],
        "vertices_m": [[0, 0, 0], [1, 0, 0], [0, 1, 1]], "triangles": [[0, 1, 2]], "kind": "wall", "fixed": False,
        "repeat": "once", "file": "nothing.obj", "up": "z", "name": "a",
    }  # fmt: skip
    return of_lists.get(key.name, 1)


def keys(draw: random.Random) -> Iterator[str]:
    """Give each key of a world file what it may not have, its bounds, and nothing."""
    tables = {**SHAPES, "mark": MARK_KEYS, "mesh": MESH_KEYS, "import": IMPORT_KEYS, "start": START_KEYS}
    for table, its_keys in tables.items():
        whole = {key.name: _given(key) for key in its_keys if key.required}
        if table == "mark":
            whole["kind"] = "goal"
        for key in its_keys:
            least, most = key.least, key.most
            ends = [] if least is None else [least, least - 0.001, most, (most or 0) + 1]
            for value in (_given(key), "x", -1, [[1]], [0, 0, 0, 1e9], *ends):
                rows = whole | {key.name: value}
                top = {"name": "w", "extent_m": [-5, -5, 5, 5], table: rows if table == "start" else [rows]}
                yield tried(_read_again, top)
            yield tried(
                _read_again,
                {"name": "w", "extent_m": [-5, -5, 5, 5], table: [{k: v for k, v in whole.items() if k != key.name}]},
            )
    for extent in ([0, 0, 0, 1], [0, 1, 1, 1], [1, 0, 0, 1], [0, 0, 1, 1], [0, 0, 1], [-10001, 0, 1, 1]):
        yield tried(_read_again, {"name": "w", "extent_m": extent})
    for version in (0, 1, 2, "1"):
        yield tried(_read_again, {"version": version, "name": "w", "extent_m": [0, 0, 1, 1], "arena": {}})
    yield tried(_read_again, {"name": "w", "extent_m": [0, 0, 1, 1], "arena": {"x": 1}})
    two = {"name": "b", "x_m": 1, "y_m": 1, "length_m": 1, "width_m": 1}
    yield tried(_read_again, {"name": "w", "extent_m": [0, 0, 1, 1], "box": [two, two]})
    yield tried(_read_again, {"name": "w", "extent_m": [0, 0, 1, 1], "box": [two], "floor": [two | {"top_m": 1}]})
    yield said([(name, in_range(name)) for name in (*model.RANGES, "up", "name")])
    yield tried(_read_again, {"name": "w", "extent_m": [0, 0, 1, 1], "mesh": [
        {"name": "m", "vertices_m": [[0, 0, 0], [1, 0, 0], [0, 1, 1]], "triangles": [[0, 1, 1.5]]}]})  # fmt: skip


def _read_again(table: dict[str, object]) -> str:
    return rounded(write_world(parse_world(toml_text(table), "w.toml")))


def _things_of(text: str, name: str) -> Iterator[str]:
    with tempfile.TemporaryDirectory() as made:
        yield from seen(Path(made), name, text)


def models(draw: random.Random) -> Iterator[str]:
    """Read models and links that can be pushed, are too much to be, or hold several shapes."""
    box = "<geometry><box><size>{size}</size></box></geometry>"
    link = "<link name='l'>{mass}<collision name='c'>{shape}{mu}</collision>{more}</link>"
    for mass in ("", "<inertial><mass>{}</mass></inertial>"):
        for number in ("0", "0.0009", "0.001", "10000", "10001", "x", "1 2", "1"):
            for size, mu, more, rest in (
                ("0.01 1 1", "", "", ""), ("0.009 1 1", "", "", ""), ("1 1 1", "<surface><friction><ode><mu>{}</mu></ode></friction></surface>", "", ""),
                ("1 1 1", "", "<collision name='d'/>", ""), ("1 1 1", "", "", "<link name='k'/>"), ("1 0 1", "", "", ""),
                ("1 1 1", "", "", "<static>true</static>"), ("1 1 1", "", "", "<static> 1 </static>"),
                ("1 1 1", "", "", "<model name='in'/>"), ("1 1 1", "", "", "<include><uri>model://sun</uri></include>"),
            )[: 10 if number == "1" else 1]:  # fmt: skip
                body = link.format(
                    mass=mass.format(number), shape=box.format(size=size), mu=mu.format("0.2"), more=more
                )
                yield from _things_of(f"<sdf><model name='m'>{body}{rest}</model></sdf>", "a.sdf")
    for shape in ("<sphere><radius>{}</radius></sphere>", "<cylinder><radius>{}</radius><length>1</length></cylinder>",
                  "<cylinder><radius>1</radius><length>{}</length></cylinder>", "<box><size>1 {} 1</size></box>"):  # fmt: skip
        for size in ("-1", "-0.5", "0", "1e-7", "0.5"):
            body = link.format(mass="", shape=f"<geometry>{shape.format(size)}</geometry>", mu="", more="")
            yield from _things_of(f"<sdf><model name='m'>{body}</model></sdf>", "a.sdf")
    for mu in ("0", "9", "10", "11", "-1"):
        body = link.format(mass="<inertial><mass>1</mass></inertial>", shape=box.format(size="1 1 1"), more="",
                           mu=f"<surface><friction><ode><mu>{mu}</mu></ode></friction></surface>")  # fmt: skip
        yield from _things_of(f"<sdf><model name='m'>{body}</model></sdf>", "a.sdf")
        for joint in ("floating", "fixed", "continuous"):
            yield from _things_of(urdf_of(joint, f"<contact><lateral_friction value='{mu}'/></contact>"), "a.urdf")
    for joint, mass, count in (("floating", "", 1), ("floating", "<mass/>", 1), ("floating", "<mass value='2'/>", 2),
                               ("floating", "<mass value='2'/>", 0), ("floating", "<mass value='2'/>", 1)):  # fmt: skip
        yield from _things_of(urdf_of(joint, "", mass, count), "a.urdf")
    yield said([annotation.pushed(annotation.Traits(kind=kind), 1.0, 0.1) for kind in ObstacleKind])


def urdf_of(joint: str, contact: str, mass: str = "<mass value='2'/>", count: int = 1) -> str:
    shape = "<collision><geometry><cylinder radius='0.2' length='1'/></geometry></collision>"
    return (
        f"<robot><link name='a'/><link name='b'><inertial>{mass}</inertial>{contact}{shape * count}</link>"
        f"<joint name='j' type='{joint}'><parent link='a'/><child link='b'/></joint></robot>"
    )


def nested(draw: random.Random) -> Iterator[str]:
    """Put models, nodes and elements within each other as deep as they may be, and one deeper."""
    crate = (
        "<link name='l'><collision name='c'><geometry><sphere><radius>1</radius></sphere></geometry></collision></link>"
    )
    for deep in (7, 8, 9, 10):
        inner = "<model name='m'><pose>1 0 0 0 0 0</pose>" * deep
        text = f"<sdf>{inner}{crate}{'</model>' * deep}</sdf>"
        yield from _things_of(text, "a.sdf")
    with (
        patch.object(sdf, "DEEPEST_INCLUDE", 2),
        patch.object(sdf, "MOST_INCLUDES", 3),
        tempfile.TemporaryDirectory() as made,
    ):
        Path(made, "c.sdf").write_text(f"<sdf><model name='c'>{crate}</model></sdf>")
        Path(made, "b.sdf").write_text("<sdf><include><uri>c.sdf</uri><name> n </name></include></sdf>")
        Path(made, "r.sdf").write_text("<sdf><include><uri>r.sdf</uri></include></sdf>")
        for name, count in (
            ("c.sdf", 3),
            ("c.sdf", 4),
            ("b.sdf", 1),
            ("b.sdf", 2),
            ("r.sdf", 1),
            ("model://ground_plane", 9),
        ):
            text = f"<sdf><light name='sun'/><plugin/>{f'<include><uri>{name}</uri></include>' * count}</sdf>"
            yield from seen(Path(made), "a.sdf", text)
        yield from seen(Path(made), "a.sdf", "<sdf><include/></sdf>")
        yield from seen(Path(made), "a.sdf", "<sdf><include><uri>model://nothing/of_this</uri></include></sdf>")
    with patch.object(xml_tree, "DEEPEST", 4), patch.object(xml_tree, "MOST_ELEMENTS", 6):
        for text in ("<sdf><a><b><c/></b></a></sdf>", "<sdf><a><b><c><d/></c></b></a></sdf>", f"<sdf>{'<a/>' * 5}</sdf>",
                     f"<sdf>{'<a/>' * 6}</sdf>", "<!DOCTYPE x><sdf/>", "<sdf", "<x/>", "<gazebo/>", ""):  # fmt: skip
            yield from _things_of(text, "a.sdf")
    whole = meshes.dae(meshes.WEDGE_Y_UP)
    begin, end = "<node>", "</node>"
    for deep in (1, 2, 3):
        with patch.object(collada, "DEEPEST_NODES", 2), patch.object(collada, "MOST_NODES", 20):
            inner = f"{begin * deep}<instance_geometry url='#g'/>{end * deep}"
            yield from _things_of(meshes.dae(meshes.WEDGE_Y_UP, node=inner), "a.dae")
    for most in (4, 5, 6):
        with patch.object(collada, "MOST_NODES", most):
            yield from _things_of(meshes.dae(meshes.WEDGE_Y_UP, node="<node/>" * 4), "a.dae")
    for limit in ("MOST_TRIANGLES", "MOST_VERTICES"):
        for most in (3, 4, 12):
            for module, name, data in ((collada, "a.dae", whole), (mesh_file, "a.obj", meshes.obj(meshes.WEDGE_Y_UP)),
                                       (mesh_file, "b.stl", meshes.stl_text(meshes.WEDGE)),
                                       (mesh_file, "c.stl", meshes.stl_binary(meshes.WEDGE)),
                                       (collection, "a.obj", meshes.obj(meshes.WEDGE_Y_UP)),
                                       (gltf, "a.gltf", json.dumps(in_gltf.document()))):  # fmt: skip
                if limit in vars(module):
                    with patch.object(module, limit, most), tempfile.TemporaryDirectory() as made:
                        yield from seen(Path(made), name, data)


def nodes(draw: random.Random) -> Iterator[str]:  # noqa: C901, PLR0912 - a table of rows
    """Read glTF's modes, turns and scenes, and each of its limits at the bound."""
    whole = in_gltf.document()
    (first,) = whole["meshes"][0]["primitives"]
    for mode in range(-1, 8):
        for count in (3, 5, 12):
            accessors = [whole["accessors"][0], whole["accessors"][1] | {"count": count}]
            yield from _gltf(meshes=[{"primitives": [first | {"mode": mode, "targets": []}]}], accessors=accessors)
    half = math.sqrt(0.5)
    turns: list[dict[str, object]] = [
        {"rotation": [half, 0, 0, half]}, {"rotation": [0, half, 0, half]}, {"rotation": [0, 0, half, half]},
        {"rotation": [0.1, 0.7, 0.3, 0.2]}, {"rotation": [0, 0, 0, 0]}, {"rotation": [0, 0, 0, 1e-6]}, {"rotation": [0, 0, 0, 9e-7]},
        {"scale": [1, 2, 3]}, {"translation": [1, 2, 1e9]}, {"translation": [1, 2, 1.1e9]}, {"translation": [1, 2]},
        {"translation": [1, 2, "x"]}, {"matrix": [*range(16)]}, {"matrix": [*range(15)]}, {"skin": 0}, {"mesh": 1}, {"mesh": -1},
        {"translation": [1, 2, 3], "rotation": [0.5, 0.5, 0.5, 0.5], "scale": [2, 3, 4]}, {"children": [0]}, {"children": [1]},
    ]  # fmt: skip
    for turn in turns:
        yield from _gltf(nodes=[{"mesh": 0} | turn])
    for scenes in (
        {"scenes": []},
        {"scene": 1},
        {"scenes": [{"nodes": [0]}, {"nodes": [0, 0]}], "scene": 1},
        {"scene": "0"},
    ):
        yield from _gltf(**scenes)
    yield from _gltf(scenes=[], nodes=[{"children": [1], "scale": [2, 2, 2]}, {"mesh": 0}])
    view, index = whole["bufferViews"], whole["accessors"][1]
    for change in (
        {"byteOffset": 1}, {"byteOffset": 0, "byteLength": 48}, {"byteLength": 47}, {"byteStride": 12}, {"byteStride": 11},
        {"byteStride": 14}, {"byteStride": 252}, {"byteStride": 253}, {"byteLength": 73}, {"buffer": 1},
    ):  # fmt: skip
        yield from _gltf(bufferViews=[view[0] | change, view[1]])
    for change in ({"count": 0}, {"count": 13}, {"count": 9, "componentType": 5121}, {"count": 3, "componentType": 5125},
                   {"componentType": 5124}, {"type": "VEC2"}, {"sparse": {}}, {"byteOffset": 2, "count": 9},
                   {"byteOffset": 1, "count": 12}, {"count": 11}):  # fmt: skip
        yield from _gltf(accessors=[whole["accessors"][0], index | change])
    yield from _gltf(accessors=[whole["accessors"][0] | {"count": 3}, index])
    yield from _gltf(accessors=[whole["accessors"][0] | {"bufferView": 9}, index])
    for extension in (
        "KHR_draco_mesh_compression",
        "KHR_materials_x",
        "KHR_texture_x",
        "KHR_lights_x",
        "EXT_texture_x",
        "EXT_",
    ):
        yield from _gltf(extensionsRequired=[extension])
    for version in ("2.0", "2.1", "1.0", "2", 2, None):
        yield from _gltf(asset={"version": version})
    for uri in ("data:;base64,!", "http://a/b", "../a.bin", "nothing.bin", 5, "data:;base64,AAAA"):
        yield from _gltf(buffers=[{"uri": uri}])
    for limit in ("MOST_NODES", "DEEPEST_NODES", "MOST_VALUES", "MOST_BYTES", "MOST_TRIANGLES", "MOST_VERTICES"):
        for most in (1, 2, 3, 8, 16, 71):
            with patch.object(gltf, limit, most):
                yield from _gltf(nodes=[{"mesh": 0, "children": [1]}, {"mesh": 0, "children": [2]}, {}])
    for data in (in_gltf.glb(in_gltf.document(buffers=[{}])), b"glTF", b"glTF" + bytes(16), struct.pack("<4sIII4s", b"glTF", 2, 28, 9, b"JSON"),
                 b"{}", b"\xff", b"[]", json.dumps(in_gltf.document()).encode()):  # fmt: skip
        for name in ("a.glb", "a.gltf"):
            with tempfile.TemporaryDirectory() as made:
                yield from seen(Path(made), name, data)


def _gltf(**changes: object) -> Iterator[str]:
    return _things_of(json.dumps(in_gltf.document(**changes)), "a.gltf")


def faces(draw: random.Random) -> Iterator[str]:
    """Read faces of COLLADA, OBJ and STL that are whole, cut short, or name what is not there."""
    mesh = meshes.dae(meshes.WEDGE_Y_UP)
    counts, corners = "<vcount>3 3 3 3</vcount>", mesh[mesh.index("<p>") : mesh.index("</p>") + 4]
    for old, new in (
        (counts, "<vcount>4 4 4</vcount>"), (counts, "<vcount>3 3 2 3</vcount>"), (counts, "<vcount>3 3</vcount>"),
        (counts, "<vcount>3 3 3 4</vcount>"), (counts, ""), (corners, "<p>0 0 1 0</p>"), (corners, "<p>0 0 1 0 4 0</p>"),
        (corners, "<p>0 0 1 0 -1 0</p>"), (corners, "<p>0 0 1 0 1000000001 0</p>"), ('stride="3"', 'stride="4"'),
        ('stride="3"', 'stride="2"'), ('stride="3"', 'stride="6"'), ('offset="0"', ""), ('offset="1"', 'offset="0"'),
        ('semantic="VERTEX"', 'semantic="X"'), ('semantic="POSITION"', 'semantic="X"'), ("polylist", "triangles"),
        ("polylist", "polygons"), ("polylist", "lines"), ("<p>", "<ph/><p>"), ('url="#s"', 'url="#t"'), ('url="#g"', 'url="#h"'),
        ('source="#p"', 'source="#q"'), ("float_array", "x_array"), ("<mesh>", "<x><mesh>"), ("Y_UP", "W_UP"),
        ('meter="1"', 'meter="0"'), ('meter="1"', 'meter="0.01"'), ('meter="1"', 'meter="-1"'), ("<asset>", "<b>"),
        ("<instance_geometry", "<skew/><instance_camera/><instance_geometry"),
        ("<instance_geometry", "<rotate>1 2 3 40</rotate><translate>1 2 3</translate><scale>1 2 3</scale><instance_geometry"),
        ("<instance_geometry", "<matrix>1 2 3 4 5 6 7 8 9 10 12 12 0 0 0 1</matrix><instance_geometry"),
    ):  # fmt: skip
        text = mesh.replace(old, new)
        yield from _things_of(text.replace("</b>", "").replace("</x>", ""), "a.dae")
    wedge = meshes.obj(meshes.WEDGE_Y_UP)
    for more in (
        "f 1 2", "f 1 2 3", "f 1/1 2/2/2 3//3", "f -1 -2 -3", "f -5 1 2", "f 5 1 2", "f 0 1 2", "f 4 1 2", "f -4 2 3", "v 1 2",
        "v 1 2 3 4", "v 1 2 x", "f \\\n1 2 \\\r\n4", "l 1 2", "p 1", "curv 1", "# x", "g a b", "f 1 2 3 4", "f a b c", "surf",
    ):  # fmt: skip
        yield from _things_of(f"{wedge}\n{more}\n", "a.obj")
    stl, binary = meshes.stl_text(meshes.WEDGE), meshes.stl_binary(meshes.WEDGE)
    line = stl.splitlines().index(next(line for line in stl.splitlines() if "vertex" in line))
    for change in (lambda rows: rows[:-1], lambda rows: rows[:line] + rows[line + 1 :], lambda rows: [*rows[: line + 1], *rows[line:]],
                   lambda rows: [*rows, "x"], lambda rows: [*rows, "vertex 1 2 3"], lambda rows: [*rows, "", *rows],
                   lambda rows: [*rows[:line], "vertex 1 2", *rows[line + 1 :]], lambda rows: ["x", *rows], lambda rows: rows):  # fmt: skip
        yield from _things_of("\n".join(change(stl.splitlines())), "a.stl")
    for data in (
        binary,
        binary[:-1],
        binary + b"\0",
        binary[:84],
        binary[:83],
        binary[:80] + bytes(4),
        b"",
        b" SOLID",
        b"soli",
    ):
        with tempfile.TemporaryDirectory() as made:
            yield from seen(Path(made), "a.stl", data)


def grids(draw: random.Random) -> Iterator[str]:
    """Read maps of points and lines that share cells, and cover cells by rectangles."""
    for _ in range(30):
        rows = [bytes(draw.choice((0, 0, 1, 1, 1)) for _ in range(draw.randint(1, 6)))] * draw.randint(1, 2)
        rows += [bytes(draw.choice((0, 1)) for _ in rows[0]) for _ in range(draw.randint(0, 4))]
        yield said((rows, rectangles.rectangles(rows)))
    yield said(rectangles.rectangles([]))
    for number in range(24):
        x0, y0, x1, y1 = (draw.randrange(-20, 21) * 50 for _ in range(4))
        points = [(draw.randrange(-1200, 1200, 25), draw.randrange(-1200, 1200, 25)) for _ in range(30)]
        points += [
            (x0 + (x1 - x0) * step // 9 + draw.choice((0, 60, 130)), y0 + (y1 - y0) * step // 9) for step in range(10)
        ]
        lines = f"NumLines: 1\nLINES\n{x0} {y0} {x1} {y1}\n" if number % 2 else ""
        text = f"2D-Map\nResolution: {draw.choice((0, 20, 50, 100))}\n{lines}DATA\n"
        yield from _things_of(text + "\n".join(f"{x} {y}" for x, y in points) + "\n", "a.map")
    for note in ("# x", "; x", "", "  # x"):
        yield from _things_of(f"2D-Map\n{note}\nLINES\n{note}\n0 -900 900 -900\n{note}\nDATA\n{note}\n0 0\n", "a.map")
    for most in (20, 21, 400, 441):
        with patch.object(aria_map, "MOST_CELLS", most), patch.object(aria_map, "MOST_LINE_CELLS", most):
            yield from _things_of("2D-Map\nDATA\n0 0\n400 400\n", "a.map")
            yield from _things_of("2D-Map\nLINES\n0 0 1000 0\nDATA\n0 400\n", "a.map")
    for cairns in (
        "RobotHome",
        "Dock",
        "DockLynx",
        "GoalWithHeading",
        "Goal",
        "Reflector",
        "ForbiddenArea",
        "Other",
        "",
    ):
        text = f'2D-Map\nCairn: Goal 10 20 30 "" ICON "g"\nCairn: {cairns} 1000 500 90 "" ICON "a b" 0 0 1000 500\nLINES\n0 -900 900 -900\n'
        yield from _things_of(text, "a.map")


def crowds(draw: random.Random) -> Iterator[str]:
    """Let a collection name, bound and place what it is given."""
    whole = collection.Collection(Path("a/b.sdf"))
    for name in ("a", "a", "a 2", "a", "b\n", "c" * 101, "c" * 101, "a 2"):
        whole.add_wall(name, (0.0, 0.0), (1.0, 1.0), thick=0.1, high=1.0)
    whole.add_wall("none", (1.0, 1.0), (1.0, 1.0), thick=0.1, high=1.0)
    yield said([item.name for item in whole.obstacles])
    for far in (9_999.0, 10_000.0, 10_001.0, 10_002.0, 10_002.1):
        one = collection.Collection(Path("b.sdf"))
        yield tried(one.add_mesh, "m", ((0, 0, 0), (far, 0, 0), (0, -far, 1)), ((0, 1, 2), (0, 0, 1)))
        yield said([(mesh.bounds, mesh.triangles) for mesh in one.meshes])
        for thing in (Obstacle(**ROUND | {"x_m": min(far, 10_000.0)}), Obstacle(**ROUND | {"radius_m": min(far, 1e4)})):  # type: ignore[arg-type]
            yield tried(one.add_thing, thing)
        yield tried(lambda one=one: one.world().extent)
    with patch.object(collection, "MOST_THINGS", 2):
        one = collection.Collection(Path("b.sdf"))
        for number in range(4):
            yield tried(one.add_thing, Obstacle(**ROUND | {"name": f"{number}"}))  # type: ignore[arg-type]
    for number in range(40):
        one = collection.Collection(Path("b.sdf"))
        for place in range(draw.choice((1, 3, 9))):
            x, y, long = draw.uniform(-3, 3), draw.uniform(-3, 3), draw.choice((0.3, 1.0, 4.0))
            one.add_thing(Obstacle(name=f"t{place}", x_m=x, y_m=y, length_m=long, width_m=draw.choice((0.1, 3.0)),
                                   heading_rad=draw.uniform(-3, 3), base_m=draw.choice((0.0, 0.49, 0.5, 0.51, -0.46))))  # fmt: skip
        if number % 2:
            x, y, size = draw.uniform(-3, 3), draw.uniform(-3, 3), draw.choice((0.5, 6.0))
            one.add_mesh("m", ((x, y, 0), (x + size, y, 0), (x, y + size, 1)), ((0, 1, 2),))
        if number % 3:
            one.marks.append(Mark(name="g", kind="goal", points_m=((draw.uniform(-9, 9), 6.0),)))
        made = one.world(extent=None if number % 5 else (-1.0, -1.0, 3.0, 1.0))
        yield said((made.start, made.extent))


def starts(draw: random.Random) -> Iterator[str]:
    """Begin on, above and beside things, at the edge of the floor, on slopes, and upon each other."""
    things = [
        Obstacle(name="post", x_m=2, y_m=2, radius_m=0.2), Obstacle(name="sill", x_m=-2, y_m=-2, length_m=1, width_m=1, height_m=0.03),
        Obstacle(name="ramp", x_m=2, y_m=-2, length_m=1, width_m=1, height_m=0.2, kind=ObstacleKind.RAMP),
        Obstacle(name="stage", x_m=-2, y_m=2, length_m=2, width_m=2, height_m=0.3, kind=ObstacleKind.FLOOR),
        Obstacle(name="visitor", x_m=0, y_m=3, radius_m=0.2, walk=Walk(points_m=((0, 3), (1, 3)), speed_mps=1)),
        Obstacle(name="carton", x_m=0, y_m=-3, radius_m=0.2, mass_kg=1.0), Obstacle(name="wall", x_m=3.5, y_m=0, length_m=0.1, width_m=2, fixed=True),
    ]  # fmt: skip
    places = [Pose(x / 2, y / 2, 0.3 * x, z) for x in range(-9, 10, 2) for y in range(-9, 10, 3) for z in (0.0,)]
    places += [
        Pose(-4, 0, 0),
        Pose(-4.01, 0, 0),
        Pose(2, 2, 0, 0.02),
        Pose(2, 2, 0, 0.021),
        Pose(-2, 2, 0),
        Pose(-1.3, 2, 0),
    ]
    places += [Pose(2.0 - by, 2, 0) for by in (0.4, 0.43, 0.45, 0.53, 0.55)] + [
        Pose(3.2, 0, 1),
        Pose(4, 4, 0),
        Pose(4, 4.01, 0),
    ]
    for pose in places:
        here = world(pose, things)
        yield tried(refuse_start, here, P2DX, pose, "w.toml:3: start")
        yield said(
            (
                thing_at(here, P2DX, pose),
                floor_height(here, pose.x_m, pose.y_m),
                floor_height(here, pose.x_m, pose.y_m, 0.3),
            )
        )
        yield tried(start_places, world(things=things), [P2DX], [pose])
        yield tried(start_places, world(things=things), [P2DX, P2DX], [pose, Pose(pose.x_m + 0.3, pose.y_m, 0)])
    for count in (1, 2, 5, 40):
        yield tried(start_places, world(things=things), [P2DX] * count, [None] * count)
        yield tried(start_places, world(extent=(-0.5, -0.5, 2.0, 0.5)), [P2DX] * count, [None] * count)
    for start in (Pose(2, 2, 0), Pose(9, 0, 0)):
        yield tried(start_places, world(start, things), [P2DX, P2DX], [None, Pose(0, 0, 0)])
    for extent in ((-0.5, -9, 0.5, 9), (-9, -0.5, 9, 0.5), (-9, -9, 0.5, 0.5), (-0.5, -0.5, 9, 9)):
        yield tried(start_places, world(extent=extent), [P2DX] * 6, [None] * 6)
    for heading in (0.0, 0.7):
        yield tried(start_places, world(Pose(0, 0, heading)), [P2DX] * 3, [None, Pose(0.9, 0, 0), None])


def touches(draw: random.Random) -> Iterator[str]:
    """Let outlines touch, meet a ray at their corners, and stand on each other's edges."""
    shapes = [Footprint(Obstacle(**FLAT)), Footprint(Obstacle(**ROUND)), Footprint.of_polygon("m", ((0, 0), (2, 0), (1, 1))),  # type: ignore[arg-type]
              Footprint.of_polygon("wall", ((0, 0), (2, 0)))]  # fmt: skip
    square = ((0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.5, -0.5))
    for shape in shapes:
        for x in (-1.0, -0.5, 0.0, 0.5, 1.0, 1.5, 2.0, 2.5):
            for y in (-0.5, 0.0, 0.5, 1.25, 1.5, 1.75, 2.0, 2.25, 2.75):
                hull = placed(square, x, y, 0.0)
                yield said(
                    (
                        x,
                        y,
                        shape.distance_to_point(x, y),
                        shape.contains(x, y),
                        shape.distance(hull),
                        shape.way_out(hull),
                    )
                )
                rays = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0), (0.6, 0.8))
                yield said([shape.hit(x, y, *ray) for ray in rays])
                if shape.edges:
                    yield said((shape.overlaps(hull), shape.normal_at(x, y)))
    for _ in range(60):
        corners = [(draw.randrange(4), draw.randrange(4), 0) for _ in range(draw.randint(4, 9))]
        turned = draw.choice(([*corners], [(x, z, y) for x, y, z in corners], [(z, x, y) for x, y, z in corners]))
        yield said(polygon.triangulated([(float(a), float(b), float(c)) for a, b, c in turned]))
    for count in (4, 99, 100, 101):
        ring = [(math.cos(n), math.sin(n) * (1 + n % 3), 0.0) for n in range(count)]
        yield said(polygon.triangulated(ring))


def images(draw: random.Random) -> Iterator[str]:
    """Read occupancy images of each mode and each lightness."""
    if find_spec("PIL") is None or find_spec("yaml") is None:
        return
    with tempfile.TemporaryDirectory() as made:
        table = {chr(0x100 + value): value for value in range(256)}
        rows = ["".join(table)] + [chr(0x100 + 254) * 256] * 3
        maps.pgm(Path(made, "map.pgm"), rows, table)
        for mode in ("trinary", "scale", "raw", "x"):
            for negate in (0, 1):
                for occupied, free in (
                    (0.65, 0.196),
                    (0.0, 1.0),
                    (1.0, 0.0),
                    (0.5, 0.5),
                    (0.99, 0.01),
                    (-0.1, 0.1),
                    (1.1, 1.0),
                ):
                    text = (
                        f"image: map.pgm\nresolution: 0.05\norigin: [-1, -0.5, 0.3]\nmode: {mode}\nnegate: {negate}\n"
                    )
                    yield from seen(Path(made), "a.yaml", f"{text}occupied_thresh: {occupied}\nfree_thresh: {free}\n")
        for resolution in ("0.0001", "0.00009", "39", "39.1", "100", "101", "x", "1e-02", "true"):
            yield from seen(Path(made), "a.yaml", f"image: map.pgm\nresolution: {resolution}\norigin: [0, 0, 0]\n")
        for origin in ("[0, 0]", "[10000, 0, 0]", "[10001, 0, 0]", "[0, 0, x]", "0", "[-10001, 0, 0]"):
            yield from seen(Path(made), "a.yaml", f"image: map.pgm\nresolution: 1\norigin: {origin}\n")
        for size in (3, 17, 40):
            for place in range(4):
                cells = [["." for _ in range(size)] for _ in range(size)]
                for _ in range(size * place):
                    cells[draw.randrange(size)][draw.randrange(size)] = draw.choice("#?")
                maps.pgm(Path(made, "map.pgm"), ["".join(row) for row in cells])
                corner = draw.choice(("[-1, -1, 0]", "[5, 5, 1]", "[-0.2, 3, 0]"))
                yield from seen(Path(made), "a.yaml", f"image: map.pgm\nresolution: 0.1\norigin: {corner}\n")


def ramps(draw: random.Random) -> Iterator[str]:
    """Build the walkway with each of its measures otherwise."""
    whole = Measures()
    yield rounded(write_world(walkway(whole)))
    for part in fields(Measures):
        value = getattr(whole, part.name)
        other = (0.2, 0.5) if isinstance(value, tuple) else value * 1.5
        made = walkway(replace(whole, **{part.name: other}))  # type: ignore[arg-type]
        yield said(
            (made.extent, [(item.name, item.x_m, item.y_m, item.base_m, item.height_m) for item in made.obstacles])
        )


def named(draw: random.Random) -> Iterator[str]:
    """Look for files that a file names: beside it, above it, by each scheme, too large, and none."""
    with tempfile.TemporaryDirectory() as made:
        beside = Path(made, "own", "sub", "w.sdf")
        for name in ("own/sub/a.stl", "own/b.stl", "own/sub/deep/c.stl", "own/model.d/e.stl", "d.stl"):
            (file := Path(made, name)).parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(b"x" * len(name))
        for scheme in ("", "file://", "package://", "model://", "http://", " "):
            for rest in (
                "a.stl",
                "b.stl",
                "deep/c.stl",
                "other/c.stl",
                "model.d/e.stl",
                "other/d.stl",
                "other/",
                "",
                ".",
                "\0",
            ):
                yield f"{scheme}{rest} {tried(find_local, scheme + rest, beside)}".replace(made, "…")
        for scheme in ("", "file://"):
            yield tried(find_local, f"{scheme}{made}/d.stl", beside).replace(made, "…")
        for least in (4, 5, 6):
            with patch.object(text_file, "LARGEST_FILE_BYTES", least):
                yield tried(text_file.sized, Path(made, "d.stl")).replace(made, "…")
        yield tried(text_file.sized, Path(made, "none")).replace(made, "…")


def limits(draw: random.Random) -> Iterator[str]:
    """Say what the pages promise that is taken, and what is not: none of these is met by a file of a test."""
    for module in (aria_map, collada, collection, gltf, mesh_file, model, polygon, sdf, urdf, xml_tree):
        numbers = {
            name: value for name, value in vars(module).items() if name.isupper() and isinstance(value, int | float)
        }
        yield said((module.__name__, dict(sorted(numbers.items()))))


TRACES: dict[str, Trace] = {
    each.__name__: each
    for each in (
        constructors,
        keys,
        models,
        nested,
        nodes,
        faces,
        grids,
        crowds,
        starts,
        touches,
        images,
        ramps,
        named,
        limits,
    )
}
test_what_was_approved_is_shown = judge_of(__file__, TRACES)
