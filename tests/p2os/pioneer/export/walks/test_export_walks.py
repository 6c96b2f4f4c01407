"""Worlds and robots, shipped and drawn, written for other programs: every file of every format, as approved."""

import base64
import json
import random
import struct
from collections.abc import Iterator
from dataclasses import replace
from pathlib import PurePath

from p2os.pioneer.export import FORMATS, export, scene_of
from p2os.pioneer.export.scene import Property
from p2os.pioneer.world.loader import load_world
from p2os.pioneer.world.model import Mesh
from p2os.robots.parameters import load_parameters
from tests.p2os.pioneer.world.walks.things import drawn_world
from tests.tools.suite.approved import Trace, judge_of, rounded, said, tried
from tests.tools.suite.declared import declared_of

ROBOTS = ("p2dx", "p3at-sh", "amigo", "patrolbot-sh", "powerbot", "seekur")
#: What a format, the robot or the ground has taken, and what no format takes.
NAMES = ("world", "ground", "a::b", "c__d", " e ", "", "hull", "world 2", "x" * 80, "x" * 80)
#: Corners of meshes that have fewer than a solid, and as many.
LEAF = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.1), (0.5, 1.0, 0.2), (0.0, 1.5, 0.6), (-0.5, 0.5, 0.3))
#: Of a binary glTF: its magic, version and length, and the length and kind of its first chunk.
GLB_HEADER = struct.Struct("<4s3I4s")


def numbers_of(data: bytes) -> str:
    """Return the numbers of a glTF buffer, all of 32 bits."""
    return said([len(data), *(number for (number,) in struct.iter_unpack("<f", data))])


def shown(name: str, data: bytes) -> Iterator[str]:
    """Yield what a file holds, whatever its format."""
    match PurePath(name).suffix.lower():
        case ".glb":
            head = GLB_HEADER.unpack_from(data)
            end = GLB_HEADER.size + head[3]
            yield said([name, *head, len(data), *struct.unpack_from("<I4s", data, end)])
            yield rounded(data[GLB_HEADER.size : end].decode())
            yield numbers_of(data[end + 8 :])
        case ".gltf":
            tree = json.loads(data)
            for buffer in tree["buffers"]:
                yield numbers_of(base64.b64decode(buffer.pop("uri").partition(",")[2]))
            yield rounded(json.dumps(tree))
        case _:
            yield f"{name}\n{rounded(data.decode())}"


def scenes(draw: random.Random) -> Iterator[str]:
    """Describe robots, worlds, and robots at the start of worlds."""
    for robot in ROBOTS:
        yield said(scene_of(None, load_parameters(robot)))
    for number in range(8):
        world = drawn_world(draw)
        items = tuple(
            replace(item, name=name)
            for item, name in zip(world.obstacles, draw.sample(NAMES, len(NAMES)), strict=False)
        )
        world = replace(world, obstacles=items) if number % 2 else world
        for parameters in (None, load_parameters(draw.choice(ROBOTS))):
            scene = scene_of(world, parameters)
            yield said([scene.name, scene.holds, scene.start, scene.extent])
            yield from map(said, scene.bodies)
    yield tried(scene_of, None, None)


def files(draw: random.Random) -> Iterator[str]:
    """Write them in each format, and say what that does not hold."""
    worlds = [load_world("room"), load_world("ramp"), drawn_world(draw), drawn_world(draw)]
    leaves = [
        Mesh(name=f"leaf {count}", vertices=LEAF[:count], triangles=tuple((0, n, n + 1) for n in range(1, count - 1)))
        for count in range(3, len(LEAF) + 1)
    ]
    worlds.append(replace(worlds[0], obstacles=(), meshes=tuple(leaves)))
    for ending in FORMATS:
        for number, world in enumerate([None, *worlds]):
            robot = load_parameters(ROBOTS[number]) if number % 2 == 0 else None
            made = export(f"made{ending.upper() if number == 1 else ending}", world, robot)
            yield said(made.losses)
            for name, data in made.files.items():
                yield from shown(name, data)
    for name in ("made", "made.obj", ".sdf"):
        yield tried(lambda name=name: [*export(name, worlds[0]).files])
    yield said([[made.title, prop.name, made.cell(prop)] for made in FORMATS.values() for prop in Property])


TRACES: dict[str, Trace] = {each.__name__: each for each in (scenes, files)}
TRACES["declared"] = declared_of("p2os.pioneer.export")
test_what_was_approved_is_shown = judge_of(__file__, TRACES)
