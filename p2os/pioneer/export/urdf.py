"""A scene as URDF: one tree of links. A thing hangs on a link `world`, by a fixed joint or a floating one.

Frictions stand twice: in `<contact>` for PyBullet and in `<gazebo>` for Gazebo. Meshes are OBJ files beside it.

Source: http://wiki.ros.org/urdf/XML
"""

from p2os.pioneer.export.annotation import DECLARATION, annotate_thing, annotate_world
from p2os.pioneer.export.scene import Box, Cylinder, ExportScene, FixedPose, JointKind, SceneBody, Sphere, Vector
from p2os.pioneer.export.triangles import obj_text
from p2os.pioneer.export.xml_text import Tag, spaced

ROOT = "world"
NOWHERE = (0.0, 0.0, 0.0)
JOINTS = {JointKind.FIXED: "fixed", JointKind.FREE: "floating", JointKind.WHEEL: "continuous"}


def write(scene: ExportScene, stem: str, joint_name: str = "{} joint") -> dict[str, bytes]:
    """Return the files by their names, the URDF first; a joint is named after its child."""
    root = Tag("robot", {"name": scene.name} | DECLARATION)
    files = {f"{stem}.urdf": b""}
    has_world = scene.extent is not None
    if has_world:
        annotate_world(root, scene)
        root.add("link", name=ROOT)
    for body in scene.bodies:
        _link(root, body, files, stem)
        parent = body.parent or (ROOT if has_world else None)
        if parent is not None:
            name = joint_name.format(body.name)
            _joint(root, name, body.name, parent, body.place, JOINTS[body.motion], body.torque_nm)
        for mark in body.marks:
            _mass(root.add("link", name=mark.name), 0.0, NOWHERE, NOWHERE)
            _joint(root, joint_name.format(mark.name), mark.name, body.name, mark.place, "fixed", 0.0)
    files[f"{stem}.urdf"] = root.document()
    return files


def _link(root: Tag, body: SceneBody, files: dict[str, bytes], stem: str) -> None:
    link = root.add("link", name=body.name)
    annotate_thing(link, body)
    _mass(link, body.mass_kg, body.centre, body.inertia)
    geometry = _geometry(body, files, stem)
    for tag in ("collision", "visual"):
        shape = link.add(tag)
        _origin(shape, body.at)
        shape.children.append(geometry)
    link.children[-1].add("material", name=f"colour of {body.name}").add("color", rgba=spaced((*body.colour, 1.0)))
    link.add("contact").add("lateral_friction", value=spaced([body.friction]))
    gazebo = root.add("gazebo", reference=body.name)
    gazebo.add("mu1", spaced([body.friction]))
    gazebo.add("mu2", spaced([body.friction]))


def _mass(link: Tag, mass_kg: float, centre: Vector, inertia: Vector) -> None:
    """Add the mass, a mass of 0 too: to a link without one PyBullet gives 1 kg."""
    inertial = link.add("inertial")
    inertial.add("origin", xyz=spaced(centre), rpy="0 0 0")
    inertial.add("mass", value=spaced([mass_kg]))
    ixx, iyy, izz = (spaced([value]) for value in inertia)
    inertial.add("inertia", ixx=ixx, iyy=iyy, izz=izz, ixy="0", ixz="0", iyz="0")


def _geometry(body: SceneBody, files: dict[str, bytes], stem: str) -> Tag:
    geometry, shape = Tag("geometry"), body.shape
    if isinstance(shape, Box):
        geometry.add("box", size=spaced(shape.size_m))
    elif isinstance(shape, Cylinder):
        geometry.add("cylinder", radius=spaced([shape.radius_m]), length=spaced([shape.length_m]))
    elif isinstance(shape, Sphere):
        geometry.add("sphere", radius=spaced([shape.radius_m]))
    else:
        name = f"{stem}_mesh{len(files)}.obj"
        files[name] = obj_text(shape)
        geometry.add("mesh", filename=name)
    return geometry


def _origin(holder: Tag, place: FixedPose) -> None:
    holder.add("origin", xyz=spaced(place.position), rpy=spaced(place.turns))


def _joint(root: Tag, name: str, child: str, parent: str, place: FixedPose, kind: str, torque_nm: float) -> None:
    joint = root.add("joint", name=name, type=kind)
    joint.add("parent", link=parent)
    joint.add("child", link=child)
    _origin(joint, place)
    if kind == "continuous":
        joint.add("axis", xyz="0 1 0")
        # A velocity of 0 is none to PyBullet, and no limit is none to URDF: faster than any wheel turns, rad/s.
        joint.add("limit", effort=spaced([torque_nm]), velocity="100")
