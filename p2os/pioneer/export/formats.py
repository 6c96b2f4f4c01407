"""The formats that worlds and robots are written in, and what each holds of them: the one table."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from p2os.pioneer.export import gltf, mjcf, sdf, urdf
from p2os.pioneer.export.scene import ExportScene, Property


@dataclass(frozen=True, slots=True)
class Support:
    """How a format holds a property.

    Args:
        held: Whether our own readers or other programs get all of it back from the file.
        how: What becomes of it; "" where it is simply held.
    """

    held: bool = True
    how: str = ""


@dataclass(frozen=True, slots=True)
class Format:
    """A format: what it is called, its writer, and what it does not simply hold."""

    title: str
    #: Takes a scene and the stem of the file's name; returns files by their names, the one that was asked for first.
    write: Callable[[ExportScene, str], dict[str, bytes]]
    cells: Mapping[Property, Support]

    def cell(self, prop: Property) -> Support:
        """Return how it holds a property."""
        return self.cells.get(prop, SIMPLY)


SIMPLY = Support()
_FIRST_POINT = Support(held=False, how="what walks stands at the first point of its path")
_NO = Support(held=False)
_RENAMED = Support(held=False, how="`::`, `__` and what is taken are written otherwise")
_NO_CONES = Support(held=False, how="the places alone")
_OURS = Support(how="in an element of p2os, which p2os reads back and others pass over")
_EXTRAS = Support(held=False, how="in `extras`, which no physics engine reads")

_XML = {
    Property.KIND: _OURS, Property.START: _OURS, Property.WALK: _FIRST_POINT, Property.MARK: _NO,
    Property.NAME: _RENAMED, Property.CONE: _NO_CONES, Property.MESH: Support(how="as OBJ files beside it"),
}  # fmt: skip
_SDF = Format("SDF", sdf.write, _XML | {Property.SONAR: Support(how="as frames")})
_URDF = Format(
    "URDF",
    urdf.write,
    _XML
    | {
        Property.PUSHED: Support(held=False, how="on floating joints, that MuJoCo lets move and PyBullet holds fast"),
        Property.FRICTION: Support(how="in `<contact>` for PyBullet and p2os, in `<gazebo>` for Gazebo"),
        Property.SONAR: Support(how="as links"),
    },
)
_MJCF = Format(
    "MJCF",
    mjcf.write,
    {
        Property.MESH: Support(held=False,
                               how="shown as they are, and met as their convex hulls; flat ones are not met"),
        Property.KIND: Support(held=False, how="the shapes alone"),
        Property.START: _NO,
        Property.WALK: _FIRST_POINT, Property.MARK: _NO, Property.NAME: _RENAMED,
        Property.SONAR: Support(how="as sites"), Property.CONE: _NO_CONES,
    },
)  # fmt: skip
_GLTF_CELLS = {
    Property.BOX: Support(how="as triangles"), Property.ROUND: Support(held=False, how="as triangles, with 32 sides"),
    Property.POSE: Support(how="in 32-bit numbers"),
    Property.MASS: _EXTRAS, Property.FRICTION: _EXTRAS, Property.KIND: _EXTRAS, Property.TORQUE: _EXTRAS,
    Property.PUSHED: Support(held=False, how="nothing moves"),
    Property.WHEEL: Support(held=False, how="nothing moves"),
    Property.START: _NO,
    Property.WALK: _FIRST_POINT, Property.MARK: _NO, Property.NAME: _RENAMED,
    Property.SONAR: Support(how="as empty nodes"), Property.CONE: _NO_CONES,
}  # fmt: skip

#: Ending → format.
FORMATS: Mapping[str, Format] = {
    ".sdf": _SDF,
    ".urdf": _URDF,
    ".xml": _MJCF,
    ".gltf": Format("glTF", gltf.write, _GLTF_CELLS),
    ".glb": Format("glTF", gltf.write_binary, _GLTF_CELLS),
}


def losses(scene: ExportScene, made: Format) -> tuple[str, ...]:
    """Return what a format does not hold of a scene, a line each."""
    found = []
    for prop in Property:
        count, cell = scene.holds.get(prop, 0), made.cell(prop)
        if count and not cell.held:
            found.append(f"{made.title} does not hold {prop.value} ({count}){f': {cell.how}' if cell.how else ''}")
    return tuple(found)
