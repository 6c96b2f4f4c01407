"""Things, meshes and worlds that walks draw."""

import math
import random

from p2os.pioneer.world.model import Mark, Mesh, Obstacle, ObstacleKind, Pose, Repeat, Triangle, Vertex, Walk, World
from p2os.pioneer.world.solids import box, cylinder, sphere

SIZES = (0.02, 0.1, 0.3, 1.0, 2.5)
HEIGHTS = (0.01, 0.05, 0.2, 0.5, 2.0)
BASES = (0.0, 0.0, 0.0, 0.1, 0.22, 0.7)


def drawn_walk(draw: random.Random) -> Walk:
    count = draw.randint(2, 5)
    points = tuple((round(draw.uniform(-4, 4), 2), round(draw.uniform(-4, 4), 2)) for _ in range(count))
    return Walk(
        points_m=points, speed_mps=draw.choice((0.3, 1.0, 2.5)), start_s=draw.choice((0.0, 1.5)),
        repeat=draw.choice(list(Repeat)),
    )  # fmt: skip


def drawn_thing(draw: random.Random, name: str) -> Obstacle:
    """Return a thing of any sort, somewhere within four metres."""
    place = {
        "x_m": round(draw.uniform(-4, 4), 3), "y_m": round(draw.uniform(-4, 4), 3),
        "heading_rad": draw.choice((0.0, round(draw.uniform(-3, 3), 3))),
        "base_m": draw.choice(BASES), "height_m": draw.choice(HEIGHTS), "floor_m": draw.choice((0.0, 0.0, 0.1)),
    }  # fmt: skip
    flat = {"length_m": draw.choice(SIZES), "width_m": draw.choice(SIZES)}
    size = draw.choice((flat, {"radius_m": draw.choice(SIZES[:4])}))
    match draw.randrange(6):
        case 0:
            return Obstacle(name=name, **place, **size, mass_kg=draw.choice((0.5, 4.0, 40.0)), friction=0.3)
        case 1:
            return Obstacle(name=name, **place, **size, walk=drawn_walk(draw))
        case 2:
            return Obstacle(name=name, **place, **flat, kind=draw.choice((ObstacleKind.FLOOR, ObstacleKind.RAMP)))
        case 3:
            return Obstacle(
                name=name, **place, **size, fixed=True, kind=draw.choice((ObstacleKind.WALL, ObstacleKind.RAIL))
            )
        case 4:
            return Obstacle(name=name, **place | {"height_m": 0.01}, **size, fixed=draw.random() < 0.5)
    return Obstacle(name=name, **place, **size)


def drawn_mesh(draw: random.Random, name: str) -> Mesh:
    """Return a solid, or some triangles of any sort."""
    match draw.randrange(4):
        case 0:
            vertices, triangles = box([draw.choice(SIZES) for _ in range(3)])
        case 1:
            vertices, triangles = cylinder(draw.choice(SIZES), draw.choice(SIZES), draw.randint(3, 7))
        case 2:
            vertices, triangles = sphere(draw.choice(SIZES), draw.choice((4, 6, 8)))
        case _:
            vertices = tuple(
                (round(draw.uniform(-2, 2), 1), round(draw.uniform(-2, 2), 1), draw.choice((0.0, 0.1, 0.2, 0.4)))
                for _ in range(7)
            )
            triangles = tuple(_three(draw, len(vertices)) for _ in range(6))
    c, s = math.cos(turn := draw.choice((0.0, 0.5, 2.0))), math.sin(turn)
    x, y, z = (round(draw.uniform(-2, 2), 2) for _ in range(3))
    placed: tuple[Vertex, ...] = tuple((x + a * c - b * s, y + a * s + b * c, z / 4 + h) for a, b, h in vertices)
    return Mesh(name=name, vertices=placed, triangles=triangles)


def _three(draw: random.Random, count: int) -> Triangle:
    a, b, c = draw.sample(range(count), 3)
    return a, b, c


def drawn_world(draw: random.Random) -> World:
    """Return a world of some things, a mesh, and a mark of each kind."""
    marks = (
        Mark(name="<goal>", kind="goal", points_m=((1.0, 2.0),)),
        Mark(name="", kind="dock", points_m=((-1.0, 2.0),)),
        Mark(name="line", kind="forbidden", points_m=((0.0, 0.0), (2.0, 1.0))),
        Mark(name="area", kind="forbidden", points_m=((0.0, 0.0), (2.0, 1.0), (0.5, 3.0))),
        Mark(name="foil", kind="reflector", points_m=((-3.0, 0.0), (-3.0, 1.0))),
    )
    x, y, turn = (round(draw.uniform(-3, 3), 2) for _ in range(3))
    return World(
        name="drawn & seen", source="drawn", description="of a walk", start=Pose(x, y, turn, draw.choice((0.0, 0.1))),
        extent=(-4.0 - draw.randrange(3), -5.0, 6.0, 4.5 + draw.randrange(20)),
        obstacles=tuple(drawn_thing(draw, f"thing {number}") for number in range(6)),
        meshes=(drawn_mesh(draw, "mesh"),), marks=marks,
    )  # fmt: skip
