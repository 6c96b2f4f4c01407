"""The `<geometry>` of SDF and URDF, put into a collection."""

from pathlib import Path

from p2os.errors import WorldError
from p2os.pioneer.world.formats.annotation import Traits
from p2os.pioneer.world.formats.collection import PLAIN, Collection
from p2os.pioneer.world.formats.local_file import find_local
from p2os.pioneer.world.formats.meshes.mesh_file import read_triangles
from p2os.pioneer.world.formats.xml_tree import Element, numbers
from p2os.pioneer.world.interchange.transform import Transform, after, apply, scaled

#: Mesh formats that say which axis is up.
STATES_ITS_AXIS = (".dae", ".gltf", ".glb")


def take_geometry(
    name: str,
    geometry: Element,
    place: Transform,
    collection: Collection,
    path: Path,
    *,
    in_attributes: bool,
    traits: Traits = PLAIN,
) -> None:
    """Take a box, cylinder, sphere or mesh at its place; note whatever else it is.

    Args:
        name: What to call it.
        geometry: The element.
        place: Where its middle is.
        collection: Takes it.
        path: The file, for messages and for meshes beside it.
        in_attributes: URDF writes sizes as attributes, SDF as elements.
        traits: What a box or a cylinder is beside its shape.

    Raises:
        WorldError: A size is no number, or a mesh cannot be read.
    """

    def sizes(shape: Element, key: str, count: int) -> list[float]:
        child = shape.first(key)
        text = shape.get(key) if in_attributes else "" if child is None else child.text
        return numbers(shape, text, path, count)

    for shape in geometry.children:
        if shape.tag == "box":
            collection.add_box(name, sizes(shape, "size", 3), place, traits)
        elif shape.tag == "cylinder":
            radius, length = sizes(shape, "radius", 1)[0], sizes(shape, "length", 1)[0]
            collection.add_cylinder(name, radius, length, place, traits)
        elif shape.tag == "sphere":
            collection.add_sphere(name, sizes(shape, "radius", 1)[0], place)
        elif shape.tag == "mesh":
            _take_mesh(name, shape, place, collection, path, in_attributes=in_attributes)
        elif shape.tag != "plane":  # the ground is there anyway
            collection.skip(f"geometry <{shape.tag}>")


def _take_mesh(
    name: str, shape: Element, place: Transform, collection: Collection, path: Path, *, in_attributes: bool
) -> None:
    uri, scale = shape.first("uri"), shape.first("scale")
    file_name = shape.get("filename") if in_attributes else "" if uri is None else uri.text
    text = shape.get("scale", "1 1 1") if in_attributes else "1 1 1" if scale is None else scale.text
    x, y, z = numbers(shape, text, path, 3)
    if not file_name.strip():
        raise WorldError(f"{path}:{shape.line}: <mesh> names no file")
    mesh_path = find_local(file_name, path)
    # These formats take a mesh's axes as they are, but for what the mesh's own states.
    found = read_triangles(mesh_path, "auto" if mesh_path.suffix.lower() in STATES_ITS_AXIS else "z")
    for what in found.skipped:
        collection.skip(what)
    collection.add_mesh(name, apply(after(place, scaled(x, y, z)), found.vertices), found.triangles)
