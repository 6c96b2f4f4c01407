"""A mesh file as a world of its own."""

from pathlib import Path

from p2os.pioneer.world.formats.collection import Collection
from p2os.pioneer.world.formats.mesh_file import read_triangles
from p2os.pioneer.world.model import World


def read(path: Path, up: str) -> World:
    """Return the world of an OBJ, STL or COLLADA file.

    Raises:
        WorldError: The file is not what its ending says, or holds no triangles.
    """
    found, collection = read_triangles(path, up), Collection(path)
    for what in found.skipped:
        collection.skip(what)
    collection.add_mesh(path.stem, found.vertices, found.triangles)
    return collection.world()
