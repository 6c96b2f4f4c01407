"""A scene as glTF 2.0, for viewers and Blender: `.gltf` with its buffer within, or `.glb`.

A body is a node with its shape below it; its mass, its friction and its kind stand in the node's `extras`. The scene's
one top node turns Z up into glTF's Y up. Faces are flat: each triangle has three vertices of its own, with a normal.

Source: https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html
"""

import json
import math
import struct
from base64 import b64encode
from collections.abc import Sequence

from p2os.pioneer.export.scene import ExportScene, FixedPose, JointKind, SceneBody, Vector
from p2os.pioneer.export.triangles import triangulated
from p2os.pioneer.world.interchange.words import GLB_HEADER, GLB_MAGIC
from p2os.pioneer.world.model import normal_of

#: glTF 2.0, sections 3.6.2.2 and 3.6.2: floats, and a buffer of vertices.
FLOAT, ARRAY_BUFFER = 5126, 34962
#: A quarter turn about X: x, y, z, w.
Z_UP_TO_Y_UP = [-math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)]
_Object = dict[str, object]


def write(scene: ExportScene, stem: str) -> dict[str, bytes]:
    """Return the file by its name."""
    document, binary = _Writer(scene).written()
    uri = "data:application/octet-stream;base64," + b64encode(binary).decode()
    document["buffers"] = [{"byteLength": len(binary), "uri": uri}]
    return {f"{stem}.gltf": json.dumps(document, indent=1, ensure_ascii=False).encode()}


def write_binary(scene: ExportScene, stem: str) -> dict[str, bytes]:
    """Return the file by its name."""
    document, binary = _Writer(scene).written()
    document["buffers"] = [{"byteLength": len(binary)}]
    text = json.dumps(document, ensure_ascii=False).encode()
    chunks = b""
    # glTF 2.0, section 4.4.3: chunks end at multiples of four, JSON filled up with blanks.
    for kind, data, filling in ((b"JSON", text, b" "), (b"BIN\0", binary, b"\0")):
        whole = data + filling * (-len(data) % 4)
        chunks += struct.pack("<I4s", len(whole), kind) + whole
    return {f"{stem}.glb": struct.pack("<4sII", GLB_MAGIC, 2, GLB_HEADER + len(chunks)) + chunks}


class _Writer:
    def __init__(self, scene: ExportScene) -> None:
        self._scene = scene
        self._nodes: list[_Object] = []
        self._meshes: list[_Object] = []
        self._materials: dict[Vector, int] = {}
        self._accessors: list[_Object] = []
        self._views: list[_Object] = []
        self._binary = bytearray()

    def written(self) -> tuple[_Object, bytes]:
        tops: list[int] = []
        children: dict[str, list[int]] = {}
        for body in self._scene.bodies:
            number, own = self._body(body)
            children[body.name] = own
            (tops if body.parent is None else children[body.parent]).append(number)
        top = self._node({"name": self._scene.name, "rotation": Z_UP_TO_Y_UP, "children": tops})
        document: _Object = {
            "asset": {"version": "2.0", "generator": "p2os"},
            "scene": 0,
            "scenes": [{"nodes": [top]}],
            "nodes": self._nodes,
            "meshes": self._meshes,
            "materials": [
                {"pbrMetallicRoughness": {"baseColorFactor": [*map(_linear, colour), 1.0], "metallicFactor": 0.0}}
                for colour in self._materials
            ],
            "accessors": self._accessors,
            "bufferViews": self._views,
        }
        return document, bytes(self._binary)

    def _body(self, body: SceneBody) -> tuple[int, list[int]]:
        """Add a body's node; return its number, and the list of its children."""
        held: _Object = {"kind": body.kind} if body.kind else {}
        held["friction"] = body.friction
        if body.mass_kg:
            held |= {"mass_kg": body.mass_kg, "centre_m": list(body.centre), "inertia_kg_m2": list(body.inertia)}
        if body.motion is JointKind.WHEEL:
            held |= {"wheel_axis": "y", "torque_nm": body.torque_nm}
        mesh = self._mesh(body)
        children = [self._node({"name": f"{body.name} shape", "mesh": mesh, **_placed(body.at)})]
        children += [self._node({"name": mark.name, **_placed(mark.place)}) for mark in body.marks]
        return self._node({"name": body.name, "extras": held, "children": children, **_placed(body.place)}), children

    def _node(self, node: _Object) -> int:
        self._nodes.append(node)
        return len(self._nodes) - 1

    def _mesh(self, body: SceneBody) -> int:
        mesh = triangulated(body.shape)
        corners = [mesh.vertices[index] for triangle in mesh.triangles for index in triangle]
        normals = [
            normal for at in range(0, len(corners), 3) for normal in [_normal(*corners[at : at + 3])] for _ in range(3)
        ]
        material = self._materials.setdefault(body.colour, len(self._materials))
        attributes = {"POSITION": self._accessor(corners, bounded=True), "NORMAL": self._accessor(normals)}
        self._meshes.append({"name": body.name, "primitives": [{"attributes": attributes, "material": material}]})
        return len(self._meshes) - 1

    def _accessor(self, rows: Sequence[Vector], *, bounded: bool = False) -> int:
        data = struct.pack(f"<{3 * len(rows)}f", *(value for row in rows for value in row))
        self._views.append(
            {"buffer": 0, "byteOffset": len(self._binary), "byteLength": len(data), "target": ARRAY_BUFFER}
        )
        accessor: _Object = {
            "bufferView": len(self._views) - 1, "componentType": FLOAT, "count": len(rows), "type": "VEC3"
        }  # fmt: skip
        if bounded:  # of the 32-bit numbers that are in the file
            stored = struct.unpack(f"<{3 * len(rows)}f", data)
            accessor |= {"min": [min(stored[axis::3]) for axis in range(3)]}
            accessor |= {"max": [max(stored[axis::3]) for axis in range(3)]}
        self._binary += data
        self._accessors.append(accessor)
        return len(self._accessors) - 1


def _placed(place: FixedPose) -> _Object:
    w, x, y, z = place.quaternion
    return {"translation": list(place.position), "rotation": [x, y, z, w]}


def _normal(a: Vector, b: Vector, c: Vector) -> Vector:
    x, y, z = normal_of(a, b, c)
    length = math.hypot(x, y, z)
    return (x / length, y / length, z / length) if length > 0 else (0.0, 0.0, 1.0)


def _linear(value: float) -> float:
    """Return a share of a colour as glTF counts it: linear in light (IEC 61966-2-1)."""
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4
