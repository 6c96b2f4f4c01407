"""Worlds to export, exported, and what must come back."""

import math
from dataclasses import replace
from pathlib import Path

from hypothesis import strategies as st

from p2os.pioneer.export import export
from p2os.pioneer.world.model import Mesh, Obstacle, ObstacleKind, Pose, Vertex, World
from p2os.robots.parameters import RobotParameters

places = st.floats(-50, 50)
sizes = st.floats(0.02, 8)
headings = st.floats(-3.1, 3.1)
#: What is hard on a format: its own words, other scripts, what XML escapes; `#` and a number are put before.
labels = st.text(st.sampled_from("aß_<>&\"': 7/é"), max_size=8)


@st.composite
def obstacles(draw: st.DrawFn, name: str) -> Obstacle:
    """Return a thing of any sort but one that walks."""
    where = {"name": name, "x_m": draw(places), "y_m": draw(places), "height_m": draw(sizes)}
    sort = draw(st.sampled_from(["box", "wall", "cylinder", "pushed", "pushed box", "ramp", "floor"]))
    round_, flat = {"radius_m": draw(sizes)}, {"length_m": draw(sizes), "width_m": draw(sizes)}
    base = {"base_m": draw(st.floats(0, 2)), "floor_m": draw(st.floats(0, 2))}
    moves = {"mass_kg": draw(st.floats(0.001, 9000)), "friction": draw(st.floats(0, 10))}
    if sort == "ramp":
        rise = {"base_m": base["base_m"], "height_m": draw(st.floats(0, 3))}
        return Obstacle(**where | flat | rise, heading_rad=draw(headings), kind=ObstacleKind.RAMP)
    if sort == "floor":
        return Obstacle(**where | flat, kind=ObstacleKind.FLOOR)
    if sort in {"pushed", "cylinder"}:
        return Obstacle(**where, **round_, **base, **(moves if sort == "pushed" else {"fixed": draw(st.booleans())}))
    kind = draw(st.sampled_from([ObstacleKind.OBSTACLE, ObstacleKind.WALL, ObstacleKind.RAIL]))
    more = moves if sort == "pushed box" else {"fixed": draw(st.booleans())}
    return Obstacle(**where, **flat, **base, **more, kind=kind, heading_rad=draw(headings))


@st.composite
def worlds(draw: st.DrawFn) -> World:
    """Return a world of things and meshes, without walks and marks."""
    names = [f"#{number}{draw(labels)}".strip() for number in range(draw(st.integers(1, 6)))]
    meshes = []
    for number in range(draw(st.integers(0, 2))):
        corner = st.tuples(places, places, st.floats(0, 3))
        vertices = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 1.0), *draw(st.lists(corner, max_size=3))]
        triangles = [(0, 1, 2), *((0, 1, index) for index in range(3, len(vertices)) if vertices[index][2] > 0.5)]
        meshes.append(Mesh(name=f"mesh {number}", vertices=tuple(vertices), triangles=tuple(triangles)))
    return World(
        name="made",
        source="made",
        description="",
        start=Pose(draw(places), draw(places), draw(headings), draw(st.floats(0, 1))),
        extent=(-60.0, -61.0, 62.0, 63.0),
        obstacles=tuple(draw(obstacles(name)) for name in names),
        meshes=tuple(meshes),
    )


def written(folder: Path, name: str, world: World | None, robot: RobotParameters | None = None) -> Path:
    """Write an export into a folder; return the file that was asked for."""
    for file_name, data in export(name, world, robot).files.items():
        (folder / file_name).write_bytes(data)
    return folder / name


def as_written(name: str) -> str:
    """Return a name as the formats have room for it."""
    return name.replace("::", ":").replace("__", "_").strip()


def expected(world: World) -> World:
    """Return the world that SDF and URDF give back: what stands fast has no friction of its own."""
    things = (
        replace(item, name=as_written(item.name), friction=item.friction if item.mass_kg else 0.5)
        for item in world.obstacles
    )
    return replace(world, obstacles=tuple(things))


def differences(one: World, other: World) -> list[str]:
    """Return what of two worlds is not the same to a nanometre and a nanoradian."""
    found = []
    if not _near((*one.extent, *_plain(one.start)), (*other.extent, *_plain(other.start))):
        found.append("start or extent")
    here, there = {item.name: item for item in one.obstacles}, {item.name: item for item in other.obstacles}
    found += sorted(here.keys() ^ there.keys())
    for name in here.keys() & there.keys():
        a, b = here[name], there[name]
        if (a.kind, a.fixed, a.is_cylinder) != (b.kind, b.fixed, b.is_cylinder) or not _near(_numbers(a), _numbers(b)):
            found.append(f"{a} {b}")
    if [mesh.name for mesh in one.meshes] != [mesh.name for mesh in other.meshes]:
        found.append("meshes")
    found += [
        a.name
        for a, b in zip(one.meshes, other.meshes, strict=False)
        if a.triangles != b.triangles or not all(map(_near, a.vertices, b.vertices))
    ]
    return found


def _plain(pose: Pose) -> tuple[float, ...]:
    return pose.x_m, pose.y_m, pose.z_m, math.sin(pose.heading_rad), math.cos(pose.heading_rad)


def _numbers(item: Obstacle) -> tuple[float, ...]:
    turned = (0.0, 0.0) if item.is_cylinder else (math.sin(item.heading_rad), math.cos(item.heading_rad))
    return (
        item.x_m, item.y_m, item.length_m, item.width_m, item.radius_m, item.base_m, item.height_m, item.floor_m,
        item.mass_kg, item.friction, *turned,
    )  # fmt: skip


def _near(one: Vertex | tuple[float, ...], other: Vertex | tuple[float, ...]) -> bool:
    return all(math.isclose(a, b, rel_tol=1e-9, abs_tol=1e-9) for a, b in zip(one, other, strict=True))
