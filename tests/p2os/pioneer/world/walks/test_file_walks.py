"""Files of other programs, sound and spoilt, as worlds; as approved."""

import json
import random
import re
import tempfile
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path

from p2os.errors import WorldError
from p2os.pioneer.world import load_world, parse_world
from p2os.pioneer.world.formats.local_file import find_local
from p2os.pioneer.world.formats.meshes.polygon import triangulated
from p2os.pioneer.world.interchange import transform
from p2os.pioneer.world.writer import write_world
from tests.p2os.pioneer.world import test_importers_gltf as gltf
from tests.p2os.pioneer.world import test_importers_maps as maps
from tests.p2os.pioneer.world import test_importers_meshes as meshes
from tests.p2os.pioneer.world import test_importers_xml as xml
from tests.tools.suite.approved import Trace, judge_of, refusal, rounded, said, tried

_NUMBER = re.compile(r"(?<![\w#.])-?\d+(?:\.\d+)?(?![\w.])")
NUMBERS = ("0", "1", "-1", "2", "0.5", "3", "1000", "1e9", "90", "x", "")


def spoilt(draw: random.Random, text: str) -> str:
    """Return a text of which a number or a word is another, or is left out."""
    match draw.randrange(4):
        case 0 | 1:
            found = [*_NUMBER.finditer(text)]
            one = draw.choice(found)
            return text[: one.start()] + draw.choice(NUMBERS) + text[one.end() :]
        case 2:
            lines = text.splitlines(keepends=True)
            place = draw.randrange(len(lines))
            return "".join(lines[:place] + lines[place + 1 :] + draw.choice(([], [lines[place]])))
        case _:
            words = re.split(r"(\s+)", text)
            place = draw.randrange(0, len(words), 2)
            return "".join([*words[:place], *words[place + 1 :]])


def seen(folder: Path, name: str, data: str | bytes) -> Iterator[str]:
    """Yield a file as a world, or why it is none."""
    (folder / name).write_bytes(data if isinstance(data, bytes) else data.encode())
    try:
        world = load_world(folder / name)
    except WorldError as error:
        yield refusal(error).replace(str(folder), "…")
        return
    yield rounded(write_world(world)).replace(str(folder), "…")
    yield said((world.skipped, world.marks, world.start, world.extent))


def walk_of(name: str, text: str, count: int) -> Trace:
    def walked(draw: random.Random) -> Iterator[str]:
        with tempfile.TemporaryDirectory() as made:
            folder = Path(made)
            (folder / "crate.sdf").write_text(xml.CRATE.format(turn=0.5))
            (folder / "wedge.stl").write_text(xml.WEDGE)
            maps.pgm(folder / "map.pgm", maps.ROOM)
            yield from seen(folder, name, text)
            for _ in range(count):
                yield from seen(folder, name, spoilt(draw, spoilt(draw, text) if draw.random() < 0.3 else text))

    return walked


WORLD = """name = "w"
description = "all of it"
extent_m = [-5, -5, 5, 5]
[start]
x_m = 1
y_m = 2
heading_deg = 30
[[box]]
name = "b"
x_m = 1
y_m = 1
length_m = 1
width_m = 0.5
height_m = 0.4
mass_kg = 2
friction = 0.3
[[cylinder]]
name = "c"
x_m = -1
y_m = 1
radius_m = 0.2
path_m = [[0, 0], [2, 1]]
speed_mps = 0.5
start_s = 1
repeat = "loop"
[[floor]]
name = "f"
x_m = 3
y_m = 3
length_m = 1
width_m = 1
top_m = 0.2
[[ramp]]
name = "r"
x_m = 3
y_m = 1
length_m = 2
width_m = 1
rise_m = 0.2
[[mark]]
name = "dock"
kind = "dock"
points_m = [[1, 1], [2, 2]]
[[mesh]]
name = "m"
vertices_m = [[0, 0, 0], [1, 0, 0], [0, 1, 1]]
triangles = [[0, 1, 2]]
"""


def worlds(draw: random.Random) -> Iterator[str]:
    """Read our own files, and what a line of them names."""
    for _ in range(60):
        text = spoilt(draw, WORLD)
        yield tried(lambda text=text: rounded(write_world(parse_world(text, "w.toml"))))


def named(draw: random.Random) -> Iterator[str]:
    """Look for files that others name; read joints without ends and places of a map without names."""
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made, "robots", "one")
        (folder / "meshes").mkdir(parents=True)
        for place in ("wheel.stl", "meshes/arm.stl", "../pkg.stl"):
            (folder / place).write_text("x")
        for rest in ("wheel.stl", "meshes/arm.stl", "arm.stl", "other/wheel.stl", "other/meshes/arm.stl", "pkg.stl",
                     "other/pkg.stl", "robots/pkg.stl", "", "a/", "\0", " wheel.stl "):  # fmt: skip
            for scheme in ("", "file://", "package://", "model://", "http://", "://"):
                found = tried(find_local, f"{scheme}{rest}", folder / "robot.urdf")
                yield f"{scheme}{rest} {found.replace(made, '…')}"
        for old, new in (
            ("<parent link", "<x link"),
            ("<child link", "<child lonk"),
            ('<parent link="', '<parent link="" x="'),
        ):
            yield from seen(folder, "a.urdf", xml.URDF.replace(old, new))
        kinds = ("ForbiddenLine", "ForbiddenArea", "Goal", "GoalWithHeading", "Dock", "RobotHome", "Reflector", "x", "")
        for kind in kinds:
            for rest in (
                '100 200 30 "" ICON "a name" 0 0 500 700',
                '100 200 90 "" ICON "" 0 0 500 700',
                "1 2",
                "100 200 0",
            ):
                yield from seen(folder, "a.map", maps.ARIA.replace("LINES\n", f"Cairn: {kind} {rest}\nLINES\n"))


def polygons(draw: random.Random) -> Iterator[str]:
    for _ in range(30):
        corners = [(round(draw.uniform(0, 3)), round(draw.uniform(0, 3)), draw.choice((0.0, 0.0, 1.0)))
                   for _ in range(draw.randint(3, 7))]  # fmt: skip
        yield tried(triangulated, corners)


def transforms(draw: random.Random) -> Iterator[str]:
    makers: list[tuple[Callable[..., transform.Transform], int]] = [
        (transform.moved, 3), (transform.scaled, 3), (transform.from_roll_pitch_yaw, 6), (transform.about_axis, 4),
    ]  # fmt: skip
    for _ in range(40):
        one, other = (
            make(*(round(draw.choice((0.0, 1.0, draw.uniform(-2, 2))), 2) for _ in range(count)) )
            for make, count in draw.choices(makers, k=2)
        )  # fmt: skip
        both = transform.after(one, other)
        yield said((both, transform.apply(both, [(1.0, 2.0, 3.0)]), transform.upright_heading(one)))


TRACES: dict[str, Trace] = {
    "aria": walk_of("a.map", maps.ARIA, 40),
    "sdf": walk_of("a.sdf", xml.SDF, 36),
    "urdf": walk_of("a.urdf", xml.URDF, 36),
    "gltf": walk_of("a.gltf", json.dumps(gltf.document(), indent=1), 50),
    "dae": walk_of("a.dae", meshes.dae(meshes.WEDGE_Y_UP, node="<scale>2 1 1</scale><rotate>0 0 1 30</rotate>"), 50),
    "obj": walk_of("a.obj", meshes.obj(meshes.WEDGE_Y_UP), 30),
    "stl": walk_of("a.stl", meshes.stl_text(meshes.WEDGE), 30),
    **({"occupancy": walk_of("map.yaml", maps.YAML, 24)} if find_spec("PIL") and find_spec("yaml") else {}),
    **{each.__name__: each for each in (worlds, named, polygons, transforms)},
}
test_what_was_approved_is_shown = judge_of(__file__, TRACES)
