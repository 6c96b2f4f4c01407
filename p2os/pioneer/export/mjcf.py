"""A scene as MJCF, which MuJoCo reads: one file, meshes within it.

Of two surfaces that touch MuJoCo takes the greater friction, or that of the greater priority: what
stands fast has none, then come wheels and what can be pushed, then the hull and the caster, whose
frictions are less than those of what they touch.

Source: https://mujoco.readthedocs.io/en/stable/XMLreference.html
"""

import math

from p2os.pioneer.body.physical import GRAVITY_MPS2
from p2os.pioneer.export.scene import Box, Cylinder, ExportScene, FixedPose, JointKind, SceneBody, Sphere, TriangleMesh
from p2os.pioneer.export.xml_text import Tag, spaced
from p2os.pioneer.world.interchange.words import ROBOT
from p2os.pioneer.world.model import normal_of

#: chosen: a wheel's motor holds its speed with the torque that it has, N m s/rad.
MOTOR_GAIN = 10.0
#: MuJoCo's meshes have four corners at least.
LEAST_CORNERS = 4
#: chosen: what is thinner, as a share of its length, is flat.
FLAT = 1e-4


def write(scene: ExportScene, stem: str) -> dict[str, bytes]:
    """Return the file by its name."""
    root = Tag("mujoco", {"model": scene.name})
    root.add("compiler", angle="radian", autolimits="true")
    root.add("option", timestep="0.001", gravity=spaced((0.0, 0.0, -GRAVITY_MPS2)), cone="elliptic")
    root.add("statistic", extent=spaced([_across(scene)]))
    root.add("visual").add("global", offwidth="1280", offheight="960")
    asset, world = Tag("asset"), Tag("worldbody")
    root.children += [asset, world]
    world.add("light", pos="0 0 10", dir="-0.3 0.2 -1", directional="true", castshadow="false")
    holders: dict[str | None, Tag] = {None: world}
    for body in scene.bodies:
        holder = holders[body.parent].add(
            "body", name=body.name, pos=spaced(body.place.position), quat=spaced(body.place.quaternion)
        )
        holders[body.name] = holder
        _fill(holder, body, asset)
    wheels = [body for body in scene.bodies if body.motion is JointKind.WHEEL]
    if wheels:
        actuators = root.add("actuator")
        for wheel in wheels:
            limits = spaced((-wheel.torque_nm, wheel.torque_nm))
            actuators.add("velocity", name=wheel.name, joint=wheel.name, kv=spaced([MOTOR_GAIN]), forcerange=limits)
    return {f"{stem}.xml": root.document()}


def _fill(holder: Tag, body: SceneBody, asset: Tag) -> None:
    if body.motion is JointKind.FREE:
        holder.add("freejoint", name=body.name)
    elif body.motion is JointKind.WHEEL:
        holder.add("joint", name=body.name, type="hinge", axis="0 1 0")
    if body.mass_kg:
        holder.add("inertial", pos=spaced(body.centre), mass=spaced([body.mass_kg]), diaginertia=spaced(body.inertia))
    # What stands fast weighs nothing, and not what its size would.
    still = {} if body.mass_kg else {"mass": "0"}
    holder.add(
        "geom", name=body.name, **still, **_shape(body, asset), **_at(body.at),
        friction=f"{spaced([body.friction])} 0 0", priority=str(_priority(body)), rgba=spaced((*body.colour, 1.0)),
    )  # fmt: skip
    for mark in body.marks:
        holder.add("site", name=mark.name, size="0.01", **_at(mark.place))


def _at(place: FixedPose) -> dict[str, str]:
    return {"pos": spaced(place.position), "quat": spaced(place.quaternion)}


def _priority(body: SceneBody) -> int:
    if not body.mass_kg:
        return 0
    is_driven_on = body.motion is JointKind.WHEEL or body.kind not in {"", ROBOT}
    return 1 if is_driven_on else 2


def _shape(body: SceneBody, asset: Tag) -> dict[str, str]:
    shape = body.shape
    if isinstance(shape, Box):
        return {"type": "box", "size": spaced(size / 2 for size in shape.size_m)}
    if isinstance(shape, Cylinder):
        return {"type": "cylinder", "size": spaced((shape.radius_m, shape.length_m / 2))}
    if isinstance(shape, Sphere):
        return {"type": "sphere", "size": spaced([shape.radius_m])}
    corners = [*shape.vertices, *shape.vertices[:1] * max(0, LEAST_CORNERS - len(shape.vertices))]
    asset.add(
        "mesh", name=body.name, inertia="shell", vertex=spaced(value for corner in corners for value in corner),
        face=" ".join(str(index) for triangle in shape.triangles for index in triangle),
    )  # fmt: skip
    met = {"contype": "0", "conaffinity": "0"} if _is_flat(shape) else {}
    return {"type": "mesh", "mesh": body.name} | met


def _is_flat(mesh: TriangleMesh) -> bool:
    """Tell whether all corners are near one plane: of those MuJoCo makes no hull, and refuses the file."""
    origin = mesh.vertices[0]
    farthest = max(mesh.vertices, key=lambda corner: math.dist(origin, corner))
    normals = (normal_of(origin, farthest, corner) for corner in mesh.vertices)
    x, y, z = normal = max(normals, key=lambda upright: math.hypot(*upright))
    off = max(abs((a - origin[0]) * x + (b - origin[1]) * y + (c - origin[2]) * z) for a, b, c in mesh.vertices)
    return off <= FLAT * math.dist(origin, farthest) * math.hypot(*normal)


def _across(scene: ExportScene) -> float:
    """Return how large the scene is: MuJoCo's viewer and its clipping planes go by it."""
    if scene.extent is None:
        return 1.0
    x0, y0, x1, y1 = scene.extent
    return max(x1 - x0, y1 - y0)
