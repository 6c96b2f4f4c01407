"""Read an OBJ, STL, COLLADA or glTF file: its triangles, or a world of its own.

What comes out is in metres with Z up. OBJ and STL have neither their unit (taken
as metres) nor their up axis: an OBJ is taken as Y up, as its exporters write
it, an STL as Z up; COLLADA and glTF have both.

Ours and not trimesh's: trimesh 5.2 makes a fan of a polygon, which closes a doorway; of the damaged files
that are refused here it takes 35 % of the text STLs and every binary one, as a smaller mesh or none;
it names no line, and takes half as long again for 100 000 triangles.
"""

import struct
from collections.abc import Callable, Mapping
from pathlib import Path

from p2os.errors import WorldError
from p2os.pioneer.world.formats.collection import MOST_TRIANGLES, MOST_VERTICES, Collection
from p2os.pioneer.world.formats.meshes.collada import read_collada
from p2os.pioneer.world.formats.meshes.gltf import read_gltf
from p2os.pioneer.world.formats.meshes.polygon import Triangles, triangulated
from p2os.pioneer.world.model import Vertex, World
from p2os.pioneer.world.placing import with_z_up
from p2os.pioneer.world.text_file import read_foreign_text
from simbase.errors import shown
from simbase.files import read_bytes

#: Of a binary STL: a header of 80 bytes, a count, then 50 bytes a triangle.
STL_HEADER, STL_TRIANGLE = 84, 50


def read(path: Path, up: str) -> World:
    """Return the world of a mesh file.

    Raises:
        WorldError: The file is not what its ending names, or holds no triangles.
    """
    found, collection = read_triangles(path, up), Collection(path)
    for what in found.skipped:
        collection.skip(what)
    collection.add_mesh(path.stem, found.vertices, found.triangles)
    return collection.world()


def read_triangles(path: Path, up: str = "auto") -> Triangles:
    """Return the triangles of a mesh file: metres, Z up.

    Args:
        path: An .obj, .stl, .dae, .gltf or .glb file.
        up: `auto`, or the axis that is up in the file.

    Raises:
        WorldError: The file is not what its ending names, or the ending is another.
    """
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise WorldError(f"{path}: no reader for this mesh", hint=f"readable: {', '.join(_READERS)}")
    found, own_up = reader(path)
    found.vertices = with_z_up(found.vertices, own_up if up == "auto" else up)
    return found


def _read_obj(path: Path) -> tuple[Triangles, str]:
    found = Triangles()
    left_out: set[str] = set()
    text = read_foreign_text(path)
    joined = ""
    for number, line in enumerate(text.split("\n"), start=1):
        if line.rstrip("\r").endswith("\\"):  # goes on in the next line
            joined += line.rstrip("\r")[:-1] + " "
            continue
        words, joined = (joined + line).split(), ""
        if not words or words[0].startswith("#"):
            continue
        try:
            if words[0] == "v":
                x, y, z = (float(word) for word in words[1:4])
                found.vertices.append((x, y, z))
            elif words[0] == "f":
                corners = _corners(words[1:], len(found.vertices))
                pieces = triangulated([found.vertices[corner] for corner in corners])
                found.triangles += [(corners[a], corners[b], corners[c]) for a, b, c in pieces]
        except (ValueError, IndexError) as error:
            raise WorldError(f"{path}:{number}: {shown(' '.join(words[:6]))} cannot be read") from error
        if len(found.triangles) > MOST_TRIANGLES or len(found.vertices) > MOST_VERTICES:
            raise WorldError(f"{path}:{number}: more than {MOST_TRIANGLES} triangles", hint="decimate it first")
        if words[0] in {"curv", "surf", "l", "p"}:
            left_out.add(words[0])
    for word in sorted(left_out):
        found.skipped[f"OBJ statement {word!r} (curves, lines and points are no walls)"] = None
    return found, "y"


def _corners(words: list[str], count: int) -> list[int]:
    """Return the vertices of a face."""
    if len(words) < 3:
        raise IndexError(words)
    return [_index(word, count) for word in words]


def _index(word: str, count: int) -> int:
    """Return the vertex of `7`, `7/1`, `7/1/2` or `-1`, counted from 0."""
    number = int(word.split("/", maxsplit=1)[0])
    if number == 0 or number < -count or number > count:
        raise IndexError(word)
    return number - 1 if number > 0 else count + number


def _read_stl(path: Path) -> tuple[Triangles, str]:
    data = read_bytes(path, WorldError)
    count = int.from_bytes(data[80:84], "little") if len(data) >= STL_HEADER else -1
    if len(data) == STL_HEADER + STL_TRIANGLE * count:
        if count > MOST_TRIANGLES:
            raise WorldError(f"{path}: more than {MOST_TRIANGLES} triangles", hint="decimate it first")
        rows = (row[3:12] for row in struct.iter_unpack("<12fH", data[STL_HEADER:]))
        return _indexed([row[3 * i : 3 * i + 3] for row in rows for i in range(3)]), "z"
    if not data.lstrip()[:5].lower() == b"solid":
        raise WorldError(
            f"{path}: no STL: {len(data)} bytes cannot hold {max(count, 0)} triangles, and no text begins it"
        )
    return _read_stl_text(path, data), "z"


def _read_stl_text(path: Path, data: bytes) -> Triangles:
    corners: list[Vertex] = []
    facet: list[Vertex] = []
    ended = False
    for number, line in enumerate(data.decode("ascii", "replace").splitlines(), start=1):
        words = line.lower().split()
        if not words:
            continue
        if words[0] == "vertex":
            try:
                x, y, z = (float(word) for word in words[1:4])
            except ValueError as error:
                raise WorldError(f"{path}:{number}: {line.strip()[:40]!r} is no vertex") from error
            facet.append((x, y, z))
            if len(corners) > 3 * MOST_TRIANGLES or len(facet) > 3:
                raise WorldError(f"{path}:{number}: too many vertices", hint="decimate it first")
        elif words[0] == "endfacet":
            if len(facet) != 3:
                raise WorldError(f"{path}:{number}: a facet has 3 vertices, not {len(facet)}")
            corners += facet
            facet = []
        ended = words[0] == "endsolid" or (ended and not facet)
    if facet or not ended:
        raise WorldError(f"{path}: the file ends before its `endsolid`", hint="it was cut short")
    return _indexed(corners)


def _indexed(corners: list[Vertex]) -> Triangles:
    """Return corners in threes as triangles over vertices that are named once each."""
    numbers: dict[Vertex, int] = {}
    indices = [numbers.setdefault((c[0], c[1], c[2]), len(numbers)) for c in corners]
    triangles = [(indices[i], indices[i + 1], indices[i + 2]) for i in range(0, len(indices), 3)]
    return Triangles(vertices=list(numbers), triangles=triangles)


_READERS: Mapping[str, Callable[[Path], tuple[Triangles, str]]] = {
    ".obj": _read_obj,
    ".stl": _read_stl,
    ".dae": read_collada,
    ".gltf": read_gltf,
    ".glb": read_gltf,
}
