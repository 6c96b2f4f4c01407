"""Static meshes in MuJoCo, which takes every mesh for its convex hull.

So a mesh is two things here: its own triangles, which the rays meet and nothing
touches; and upright pieces over the plan of all that stands between the hull's
underside and its top, which the hull touches and no ray meets. A mesh with faces
that the wheels would climb is refused.
"""

import math
from collections.abc import Iterable

import mujoco

from p2os.errors import WorldError
from p2os.pioneer.mesh_plan import Polygon, shadow
from p2os.pioneer.mujoco.turns import quaternion
from p2os.pioneer.physical import OBSTACLE_GROUP, ON_FLOOR_M, is_level
from p2os.pioneer.scenery import Mesh
from p2os.pioneer.static_plan import Bands

#: How thick an upright face is to the hull, m; chosen: more than the fastest robot drives in a step.
WALL_THICK_M = 4e-3
#: chosen: of so many pieces the model is made within a second or two.
MOST_PIECES = 5000
#: MuJoCo's meshes have four corners at least.
LEAST_CORNERS = 4
#: As in `model`, which imports this.
_HEARD, _UNHEARD = 0, 1
_BOX, _MESH = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_MESH


def add_mesh(spec: mujoco.MjSpec, mesh: Mesh, name: str, bands: Bands) -> None:
    """Add a mesh to a model under a name of its own.

    Raises:
        WorldError: It has faces that wheels would climb, or too many for this engine.
    """
    _refuse_slopes(mesh, bands)
    low, high = bands.touch
    pieces = shadow(mesh, low, high)
    if len(pieces) > MOST_PIECES:
        raise WorldError(
            f"mesh {mesh.name!r}: {len(pieces)} pieces between {low:g} and {high:g} m of height; the mujoco body"
            f" takes {MOST_PIECES}",
            hint="--body bullet or --body kinematic",
        )
    _asset(spec, name, [value for vertex in mesh.vertices for value in vertex], mesh.triangles)
    spec.worldbody.add_geom(type=_MESH, meshname=name, contype=0, conaffinity=0, group=_HEARD)
    met = {"contype": OBSTACLE_GROUP, "conaffinity": 0, "friction": [0.0, 0.0, 0.0], "group": _UNHEARD}
    for number, outline in enumerate(pieces):
        if len(outline) == 2:
            (ax, ay), (bx, by) = outline
            spec.worldbody.add_geom(
                type=_BOX, pos=((ax + bx) / 2, (ay + by) / 2, (low + high) / 2),
                quat=quaternion(math.atan2(by - ay, bx - ax)),
                size=(math.dist(outline[0], outline[1]) / 2, WALL_THICK_M / 2, (high - low) / 2), **met,
            )  # fmt: skip
        else:
            piece = f"{name}, piece {number}"
            _prism(spec, piece, outline, low, high)
            spec.worldbody.add_geom(type=_MESH, meshname=piece, **met)


def _refuse_slopes(mesh: Mesh, bands: Bands) -> None:
    """Refuse faces that are level enough to be climbed, lower than the hull at their lowest, and not the floor."""
    for first, second, third in mesh.triangles:
        corners = (mesh.vertices[first], mesh.vertices[second], mesh.vertices[third])
        heights = sorted(z for _, _, z in corners)
        climbed = -bands.touch[0] < heights[0] < bands.touch[0] and max(map(abs, heights)) > ON_FLOOR_M
        if climbed and is_level(corners):
            raise WorldError(
                f"mesh {mesh.name!r}: it has a floor that wheels would climb (a face from {heights[0]:.3f} to"
                f" {heights[-1]:.3f} m); the mujoco body drives on boxes and ramps alone",
                hint="--body bullet",
            )


def _prism(spec: mujoco.MjSpec, name: str, outline: Polygon, low: float, high: float) -> None:
    """Add a convex outline (counter-clockwise) as an upright piece."""
    count = len(outline)
    corners = [value for z in (low, high) for x, y in outline for value in (x, y, z)]
    faces = [(0, n + 1, n) for n in range(1, count - 1)]
    faces += [(count, count + n, count + n + 1) for n in range(1, count - 1)]
    for n in range(count):
        after = (n + 1) % count
        faces += [(n, after, count + after), (n, count + after, count + n)]
    _asset(spec, name, corners, faces)


def _asset(
    spec: mujoco.MjSpec,
    name: str,
    numbers: list[float],
    triangles: Iterable[tuple[int, int, int]],
) -> None:
    missing = LEAST_CORNERS - len(numbers) // 3
    mesh = spec.add_mesh(name=name)
    mesh.uservert = numbers + numbers[:3] * max(0, missing)
    mesh.userface = [index for triangle in triangles for index in triangle]
    # An open mesh has no volume, and what stands fast needs none.
    mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
