"""What never moves in a world, as few PyBullet bodies: fixed boxes and meshes melted into one.

Each static body costs the engine a third of a microsecond in every step, so that
a map of a thousand walls as bodies of their own would halve the speed tenfold.

Faces that are nearly level can be driven on and belong to the floor; all others
are what the hull meets. Level faces on the ground are left out: the floor is
there, and the seams of triangles would shake the wheels.
"""

from collections.abc import Iterable, Sequence

from p2os.pioneer.bullet.engine import pybullet
from p2os.pioneer.bullet.model import LEVEL, make_static
from p2os.pioneer.geometry import Footprint
from p2os.pioneer.physical import FLOOR_GROUP, OBSTACLE_GROUP, ON_FLOOR_M, is_level
from p2os.pioneer.scenery import Obstacle, Triangle, Vertex, World

#: chosen: so few fixed boxes stay bodies of their own, which meet a hull more exactly than triangles.
FEW_BOXES = 12
#: The engine takes no more corners in one shape.
MOST_TRIANGLES = 30_000
#: Corners of a box as made below: bottom ring, top ring; counter-clockwise.
BOX_FACES: tuple[Triangle, ...] = (
    (0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7), (0, 1, 5), (0, 5, 4),
    (1, 2, 6), (1, 6, 5), (2, 3, 7), (2, 7, 6), (3, 0, 4), (3, 4, 7),
)  # fmt: skip

Corners = tuple[Vertex, Vertex, Vertex]


def melted(world: World) -> list[Obstacle]:
    """Return the fixed boxes of a world that go into the building; none where they are few."""
    boxes = [item for item in world.obstacles if item.fixed and not item.is_cylinder]
    return boxes if len(boxes) > FEW_BOXES else []


def add_building(world: World, client: int) -> tuple[list[int], list[int]]:
    """Make the building; return the numbers of the bodies that are met, and of those that are driven on."""
    walls: list[Corners] = [corners for item in melted(world) for corners in _box(item)]
    floors: list[Corners] = []
    for mesh in world.meshes:
        for a, b, c in mesh.triangles:
            corners = (mesh.vertices[a], mesh.vertices[b], mesh.vertices[c])
            if not is_level(corners):
                walls.append(corners)
            elif max(abs(z) for _, _, z in corners) > ON_FLOOR_M:
                floors.append(corners)
    return _add(walls, OBSTACLE_GROUP, client), _add(floors, FLOOR_GROUP, client)


def _add(faces: Sequence[Corners], group: int, client: int) -> list[int]:
    numbers = []
    for begin in range(0, len(faces), MOST_TRIANGLES):
        vertices: dict[Vertex, int] = {}
        indices = [
            vertices.setdefault(corner, len(vertices))
            for corners in faces[begin : begin + MOST_TRIANGLES]
            for corner in corners
        ]
        shape = pybullet.createCollisionShape(
            pybullet.GEOM_MESH,
            vertices=[list(vertex) for vertex in vertices],
            indices=indices,
            flags=pybullet.GEOM_FORCE_CONCAVE_TRIMESH,
            physicsClientId=client,
        )
        numbers.append(make_static(shape, (0.0, 0.0, 0.0), LEVEL, group, client))
    return numbers


def _box(item: Obstacle) -> Iterable[Corners]:
    low, high = item.base_m, item.base_m + item.height_m
    (d, c, b, a) = Footprint(item).polygon[::-1]
    corners = [(x, y, z) for z in (low, high) for x, y in (a, b, c, d)]
    return [(corners[i], corners[j], corners[k]) for i, j, k in BOX_FACES]
