"""A scene as SDF 1.7, which Gazebo Classic 11 and every newer Gazebo read.

A thing is a model of one link; a robot is a model of a link a part. Meshes are OBJ files beside it.

Source: http://sdformat.org/spec?ver=1.7
"""

from p2os.pioneer.export.annotation import DECLARATION, annotate_thing, annotate_world
from p2os.pioneer.export.scene import Box, Cylinder, ExportScene, FixedPose, JointKind, SceneBody, Sphere
from p2os.pioneer.export.triangles import obj_text
from p2os.pioneer.export.xml_text import Tag, spaced


def write(scene: ExportScene, stem: str) -> dict[str, bytes]:
    """Return the files by their names, the SDF first."""
    root = Tag("sdf", {"version": "1.7"} | DECLARATION)
    holder = root
    files = {f"{stem}.sdf": b""}
    if scene.extent is not None:
        holder = root.add("world", name=scene.name)
        annotate_world(holder, scene)
        sun = holder.add("light", name="sun", type="directional")
        sun.add("pose", "0 0 10 0 0 0")
        sun.add("direction", "-0.5 0.1 -0.9")
    for top in (body for body in scene.bodies if body.parent is None):
        model = holder.add("model", name=top.name)
        annotate_thing(model, top)
        if top.motion is JointKind.FIXED:
            model.add("static", "true")
        _pose(model, top.place)
        parts = [top, *(body for body in scene.bodies if body.parent == top.name)]
        for body in parts:
            link = model.add("link", name=body.name)
            if body is not top:
                _pose(link, body.place)
            _fill(link, body, files, stem)
        for body in parts[1:]:
            _joint(model, body)
        for mark in top.marks:
            frame = model.add("frame", name=mark.name, attached_to=top.name)
            _pose(frame, mark.place)
    files[f"{stem}.sdf"] = root.document()
    return files


def _pose(holder: Tag, place: FixedPose) -> None:
    holder.add("pose", spaced((*place.position, *place.turns)))


def _fill(link: Tag, body: SceneBody, files: dict[str, bytes], stem: str) -> None:
    if body.mass_kg:
        inertial = link.add("inertial")
        inertial.add("pose", spaced((*body.centre, 0.0, 0.0, 0.0)))
        inertial.add("mass", spaced([body.mass_kg]))
        inertia = inertial.add("inertia")
        for key, value in zip(("ixx", "iyy", "izz"), body.inertia, strict=True):
            inertia.add(key, spaced([value]))
        for key in ("ixy", "ixz", "iyz"):
            inertia.add(key, "0")
    geometry = _geometry(body, files, stem)
    collision = link.add("collision", name="collision")
    _pose(collision, body.at)
    collision.children.append(geometry)
    ode = collision.add("surface").add("friction").add("ode")
    ode.add("mu", spaced([body.friction]))
    ode.add("mu2", spaced([body.friction]))
    visual = link.add("visual", name="visual")
    _pose(visual, body.at)
    visual.children.append(geometry)
    material = visual.add("material")
    for key in ("ambient", "diffuse"):
        material.add(key, spaced((*body.colour, 1.0)))


def _geometry(body: SceneBody, files: dict[str, bytes], stem: str) -> Tag:
    geometry, shape = Tag("geometry"), body.shape
    if isinstance(shape, Box):
        geometry.add("box").add("size", spaced(shape.size_m))
    elif isinstance(shape, Cylinder):
        cylinder = geometry.add("cylinder")
        cylinder.add("radius", spaced([shape.radius_m]))
        cylinder.add("length", spaced([shape.length_m]))
    elif isinstance(shape, Sphere):
        geometry.add("sphere").add("radius", spaced([shape.radius_m]))
    else:
        name = f"{stem}_mesh{len(files)}.obj"
        files[name] = obj_text(shape)
        geometry.add("mesh").add("uri", name)
    return geometry


def _joint(model: Tag, body: SceneBody) -> None:
    joint = model.add(
        "joint", name=f"{body.name} joint", type="fixed" if body.motion is JointKind.FIXED else "continuous"
    )  # fmt: skip
    joint.add("parent", body.parent or "")
    joint.add("child", body.name)
    if body.motion is JointKind.WHEEL:
        axis = joint.add("axis")
        axis.add("xyz", "0 1 0")
        axis.add("limit").add("effort", spaced([body.torque_nm]))
