"""glTF 2.0, as `.gltf` and `.glb`: the triangles of the scene that is shown, in metres with Y up.

Taken: triangles, strips and fans of every mesh that the scene shows, with its nodes' places. Left out, and
reported: points, lines, skins, morph targets. Refused: sparse accessors and extensions that a reader must have
(Draco, quantized positions). Pictures, materials, cameras, animation and names need no word.

Ours and not trimesh's: trimesh 5.2 takes seconds for 300 nodes in chains of 60, trusts each count and length (a file
of 1 KB asks for any memory), reads sparse accessors as zeros, and needs a copy of the document that is
checked first, which is longer than this reader. No file is opened but those beside this one.
"""

import json
import math
import struct
from base64 import b64decode
from collections.abc import Mapping, Sequence
from pathlib import Path
from urllib.parse import unquote

from p2os.errors import WorldError
from p2os.pioneer.world.formats.collection import MOST_TRIANGLES, MOST_VERTICES
from p2os.pioneer.world.formats.local_file import find_local
from p2os.pioneer.world.formats.meshes.polygon import Triangles
from p2os.pioneer.world.interchange.transform import IDENTITY, Transform, after, apply, moved, scaled
from p2os.pioneer.world.interchange.words import CHUNK_HEADER, GLB_HEADER, GLB_MAGIC
from p2os.pioneer.world.model import Triangle
from simbase.errors import shown
from simbase.files import LARGEST_FILE_BYTES, read_bytes

MOST_NODES = 20_000
DEEPEST_NODES = 64
#: chosen: 16 for the place of each node of the largest scene, and as many again.
MOST_VALUES = 1_000_000
#: chosen: of all buffers.
MOST_BYTES = 4 * LARGEST_FILE_BYTES

#: glTF 2.0, section 3.6.2.2: component type → its letter for `struct`; of positions, and of indices.
POSITION_TYPES = {5126: "3f"}
INDEX_TYPES = {5121: "B", 5123: "H", 5125: "I"}
#: glTF 2.0, section 3.7.2.1: modes by their number, and those that make triangles.
MODES = ("points", "lines", "line loops", "line strips", "triangles", "triangle strips", "triangle fans")
TRIANGLES, STRIP, FAN = 4, 5, 6
PLACES = {"matrix": 16, "translation": 3, "rotation": 4, "scale": 3}
#: Begin of the names of extensions that change no triangle.
HARMLESS = ("KHR_materials_", "KHR_texture_", "KHR_lights_", "EXT_texture_")

_Object = Mapping[str, object]


def read_gltf(path: Path) -> tuple[Triangles, str]:
    """Return the triangles, metres, and which axis is up: Y.

    Raises:
        WorldError: The file is no glTF, or breaks its own rules.
    """
    return _Reader(path).read()


class _Reader:
    def __init__(self, path: Path) -> None:
        self._path = path
        self._root, self._binary = self._opened()
        self._found = Triangles()
        self._buffers: dict[int, bytes] = {}
        self._accessors: dict[int, list[tuple[float, ...]]] = {}
        self._bytes = self._rows = self._shown = 0

    def read(self) -> tuple[Triangles, str]:
        missing = [name for name in self._items(self._root, "extensionsRequired") if not str(name).startswith(HARMLESS)]
        if missing:
            raise self._error(f"it needs the extension {shown(missing[0])}", hint="export it without compression")
        waiting = [(number, IDENTITY, 1) for number in reversed(self._top())]
        seen: set[int] = set()
        while waiting:
            number, outer, depth = waiting.pop()
            node = self._entry("nodes", number)
            if number in seen or depth > DEEPEST_NODES or len(seen) >= MOST_NODES:
                raise self._error(
                    f"node {number}: nodes make no tree, are within each other more than {DEEPEST_NODES} deep, "
                    f"or are more than {MOST_NODES}"
                )
            seen.add(number)
            place = after(outer, self._place(node, number))
            if "skin" in node:
                self._found.skipped["glTF skins: a body stands as it was modelled"] = None
            if "mesh" in node:
                mesh = self._whole(node["mesh"], "mesh")
                for item in self._items(self._entry("meshes", mesh), "primitives"):
                    self._primitive(self._object(item, f"a primitive of mesh {mesh}"), mesh, place)
            inner = [self._whole(child, "a child") for child in self._items(node, "children")]
            waiting += [(child, place, depth + 1) for child in reversed(inner)]
        return self._found, "y"

    # Nodes ------------------------------------------------------------------------------------

    def _top(self) -> list[int]:
        """Return the top nodes of the scene that is shown; of a document without scenes, those in no other."""
        if self._items(self._root, "scenes"):
            scene = self._entry("scenes", self._whole(self._root.get("scene", 0), "scene"))
            return [self._whole(number, "a node of the scene") for number in self._items(scene, "nodes")]
        nodes = range(len(self._items(self._root, "nodes")))
        inner = {
            self._whole(item, "a child")
            for number in nodes
            for item in self._items(self._entry("nodes", number), "children")
        }
        return [number for number in nodes if number not in inner]

    def _place(self, node: _Object, number: int) -> Transform:
        found: dict[str, list[float]] = {}
        for key, count in PLACES.items():
            values = self._items(node, key)
            found[key] = [value for value in values if isinstance(value, int | float) and -1e9 <= value <= 1e9]
            if key in node and not len(values) == len(found[key]) == count:
                raise self._error(f"node {number}: {key} needs {count} finite numbers")
        place = IDENTITY
        if v := found["matrix"]:  # column by column
            place = (v[0], v[4], v[8], v[12]), (v[1], v[5], v[9], v[13]), (v[2], v[6], v[10], v[14])
        if found["translation"]:
            x, y, z = found["translation"]
            place = after(place, moved(x, y, z))
        if found["rotation"]:
            length = math.hypot(*found["rotation"])
            if length < 1e-6:
                raise self._error(f"node {number}: rotation has no length")
            x, y, z, w = (value / length for value in found["rotation"])
            place = after(place, (
                (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), 0.0),
                (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), 0.0),
                (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), 0.0),
            ))  # fmt: skip
        if found["scale"]:
            x, y, z = found["scale"]
            place = after(place, scaled(x, y, z))
        return place

    # Meshes -----------------------------------------------------------------------------------

    def _primitive(self, primitive: _Object, mesh: int, place: Transform) -> None:
        self._shown += 1
        if self._shown > MOST_NODES:
            raise self._error(f"more than {MOST_NODES} shapes", hint="make it simpler first")
        mode = self._whole(primitive.get("mode", TRIANGLES), "mode", len(MODES) - 1)
        if mode < TRIANGLES:
            self._found.skipped[f"glTF {MODES[mode]}"] = None
            return
        if "targets" in primitive:
            self._found.skipped["glTF morph targets: a shape stands as it was modelled"] = None
        attributes = self._object(primitive.get("attributes"), f"attributes of mesh {mesh}")
        points = self._accessor(attributes.get("POSITION"), "VEC3", POSITION_TYPES)
        order: Sequence[int] = range(len(points))
        if "indices" in primitive:
            order = [int(index) for (index,) in self._accessor(primitive["indices"], "SCALAR", INDEX_TYPES)]
            if order and max(order) >= len(points):
                raise self._error(f"mesh {mesh}: index {max(order)} of {len(points)} vertices")
        if mode == TRIANGLES and len(order) % 3:
            raise self._error(f"mesh {mesh}: {len(order)} corners make no whole triangles")
        base = len(self._found.vertices)
        self._found.vertices += apply(place, [(x, y, z) for x, y, z in points])
        self._found.triangles += [
            (base + order[a], base + order[b], base + order[c]) for a, b, c in _corners(mode, len(order))
        ]
        if len(self._found.triangles) > MOST_TRIANGLES or len(self._found.vertices) > MOST_VERTICES:
            raise self._error(
                f"more than {MOST_TRIANGLES} triangles, or {MOST_VERTICES} vertices", hint="decimate it first"
            )

    def _accessor(self, value: object, shape: str, types: Mapping[int, str]) -> list[tuple[float, ...]]:
        """Return the rows of an accessor; each is read once."""
        number = self._whole(value, "an accessor")
        entry = self._entry("accessors", number)
        kind = self._whole(entry.get("componentType"), "componentType")
        if entry.get("type") != shape or kind not in types or "bufferView" not in entry:
            raise self._error(f"accessor {number}: expected {shape} of component type {' or '.join(map(str, types))}")
        if "sparse" in entry:
            raise self._error(f"accessor {number} is sparse", hint="export it without sparse accessors")
        if number not in self._accessors:
            row, count = struct.Struct(f"<{types[kind]}"), self._whole(entry.get("count"), "count", MOST_VERTICES)
            view = self._entry("bufferViews", self._whole(entry["bufferView"], "a buffer view"))
            data = self._buffer(self._whole(view.get("buffer"), "a buffer"))
            at = self._whole(entry.get("byteOffset", 0), "byteOffset")
            length = self._whole(view.get("byteLength"), "byteLength")
            stride = self._whole(view.get("byteStride", row.size), "byteStride", 252)
            begin = self._whole(view.get("byteOffset", 0), "byteOffset")
            end = at + (count - 1) * stride + row.size if count else 0
            if stride < row.size or end > length or begin + length > len(data):
                raise self._error(f"accessor {number}: {count} times {row.size} bytes do not fit its buffer")
            self._rows += count
            if self._rows > MOST_VERTICES:
                raise self._error(f"more than {MOST_VERTICES} vertices and indices", hint="decimate it first")
            self._accessors[number] = [row.unpack_from(data, begin + at + stride * place) for place in range(count)]
        return self._accessors[number]

    def _buffer(self, number: int) -> bytes:
        if number not in self._buffers:
            uri = self._entry("buffers", number).get("uri")
            self._buffers[number] = self._binary if uri is None else self._fetched(uri)
            self._bytes += len(self._buffers[number])
            if self._bytes > MOST_BYTES:
                raise self._error(f"its buffers take more than {MOST_BYTES >> 20} MiB", hint="decimate it first")
        return self._buffers[number]

    def _fetched(self, uri: object) -> bytes:
        """Return the bytes of a `data:` URI, or of a file in the folder of this one."""
        if not isinstance(uri, str):
            raise self._error("a buffer whose uri is no text")
        if uri.startswith("data:"):
            try:
                return b64decode(uri.partition("base64,")[2])
            except ValueError as error:
                raise self._error("a data URI that is not base64") from error
        if ":" in uri:
            raise self._error(f"{shown(uri)} is not a local file", hint="fetch it first and name the copy")
        path = find_local(unquote(uri), self._path)
        if not path.resolve().is_relative_to(self._path.resolve().parent) or not path.is_file():
            raise self._error(f"{shown(uri)} is no file in the folder of {self._path.name}")
        return read_bytes(path, WorldError)

    # The file ---------------------------------------------------------------------------------

    def _opened(self) -> tuple[_Object, bytes]:
        """Return the JSON of a file, and the binary chunk of a .glb."""
        text, binary = read_bytes(self._path, WorldError), b""
        if text.startswith(GLB_MAGIC):
            chunks: dict[bytes, bytes] = {}
            at, data = GLB_HEADER, text
            while at + CHUNK_HEADER <= len(data):
                length, kind = int.from_bytes(data[at : at + 4], "little"), data[at + 4 : at + CHUNK_HEADER]
                at += CHUNK_HEADER
                if at + length > len(data):
                    raise self._error("a chunk is longer than the file", hint="it was cut short")
                chunks.setdefault(kind, data[at : at + length])
                at += length
            text, binary = chunks.get(b"JSON", b""), chunks.get(b"BIN\0", b"")
        elif self._path.suffix.lower() == ".glb":
            raise self._error(f"no GLB: it begins with {text[:4]!r}, not {GLB_MAGIC!r}")
        if text.count(b",") > MOST_VALUES:
            raise self._error(f"more than {MOST_VALUES} values", hint="make it simpler first")
        try:
            root = self._object(json.loads(text), "the document")
        except ValueError as error:  # UnicodeDecodeError too
            raise self._error(f"its JSON cannot be read: {shown(str(error))}") from error
        version = self._object(root.get("asset"), "asset").get("version")
        if not isinstance(version, str) or not version.startswith("2."):
            raise self._error(f"glTF version {shown(version)}; 2.0 is read")
        return root, binary

    def _error(self, text: str, hint: str | None = None) -> WorldError:
        return WorldError(f"{self._path}: {text}", hint=hint)

    def _entry(self, key: str, number: int) -> _Object:
        items = self._items(self._root, key)
        if number >= len(items):
            raise self._error(f"{key}[{number}] is named and not there")
        return self._object(items[number], f"{key}[{number}]")

    def _items(self, holder: _Object, key: str) -> list[object]:
        items = holder.get(key, [])
        if not isinstance(items, list):
            raise self._error(f"{key} is no list")
        return items

    def _object(self, value: object, what: str) -> _Object:
        if not isinstance(value, dict):
            raise self._error(f"{what} is no object")
        return value

    def _whole(self, value: object, what: str, most: int = 1 << 31) -> int:
        if type(value) is not int or not 0 <= value <= most:
            raise self._error(f"{what} = {shown(value)} is no whole number from 0 to {most}")
        return value


def _corners(mode: int, count: int) -> list[Triangle]:
    """Return the triangles of a primitive as places in its order of corners; the sides of a strip alternate."""
    if mode == STRIP:
        return [(at, at + 1 + at % 2, at + 2 - at % 2) for at in range(count - 2)]
    if mode == FAN:
        return [(0, at, at + 1) for at in range(1, count - 1)]
    return [(at, at + 1, at + 2) for at in range(0, count, 3)]
