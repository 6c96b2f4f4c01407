"""COLLADA 1.4 and 1.5: the triangles of a scene, with its nodes' places, its unit and its up axis.

Taken: `triangles`, `polylist`, `polygons` of every geometry that the scene shows,
node transforms (`matrix`, `translate`, `rotate`, `scale`), instances of nodes.
Left out, and reported: lines, strips and fans, polygons with holes, skins and morphs,
cameras, lights, `lookat` and `skew`. Materials and animation need no word.

Ours and not pycollada's: pycollada 0.9 computes places in 32-bit floats, makes fans of polygons (a doorway is
closed), expands the entities of a hostile file, refuses accessors whose columns
have no names, turns no up axis, and names no line.
"""

import math
from collections.abc import Iterator
from pathlib import Path

from p2os.errors import WorldError
from p2os.pioneer.world.formats.collection import MOST_TRIANGLES, MOST_VERTICES
from p2os.pioneer.world.formats.meshes.polygon import Triangles, triangulated
from p2os.pioneer.world.formats.xml_tree import Element, numbers, read_xml
from p2os.pioneer.world.interchange.transform import IDENTITY, Transform, about_axis, after, apply, moved, scaled
from p2os.pioneer.world.model import Vertex

#: Nodes that name each other in a ring end here.
DEEPEST_NODES = 32
#: Nodes shown, instances of instances counted each time.
MOST_NODES = 20_000
UP_AXES = {"X_UP": "x", "Y_UP": "y", "Z_UP": "z"}
SKIPPED_NODES = ("instance_controller", "instance_camera", "instance_light", "lookat", "skew")
SKIPPED_FACES = ("lines", "linestrips", "tristrips", "trifans")


def read_collada(path: Path) -> tuple[Triangles, str]:
    """Return the triangles, metres, and the up axis.

    Raises:
        WorldError: The file is no COLLADA, or breaks its own rules.
    """
    return _Reader(path).read()


class _Reader:
    def __init__(self, path: Path) -> None:
        self._path = path
        self._root = read_xml(path, "COLLADA")
        self._found = Triangles()
        self._shown = 0
        self._geometries = self._by_id("library_geometries", "geometry")
        self._nodes = self._by_id("library_nodes", "node")

    def read(self) -> tuple[Triangles, str]:
        asset = self._root.first("asset")
        unit_m, up = 1.0, "y"
        if asset is not None:
            unit, axis = asset.first("unit"), asset.first("up_axis")
            if unit is not None:
                unit_m = numbers(unit, unit.get("meter", "1"), self._path, 1)[0]
            if axis is not None:
                up = UP_AXES.get(axis.text.strip(), "")
        if not up or unit_m <= 0:
            raise WorldError(f"{self._path}: its unit or its up axis makes no sense")
        place = scaled(unit_m, unit_m, unit_m)
        for node in self._scene():
            self._node(node, place, 0)
        return self._found, up

    def _scene(self) -> Iterator[Element]:
        """Yield the top nodes of the scene that is shown; of all scenes where none is named."""
        scenes = [scene for library in self._root.all("library_visual_scenes") for scene in library.all("visual_scene")]
        shown = self._root.first("scene", "instance_visual_scene")
        if shown is not None:
            scenes = [scene for scene in scenes if scene.get("id") == shown.get("url").removeprefix("#")] or scenes
        for scene in scenes:
            yield from scene.all("node")

    def _node(self, node: Element, outer: Transform, depth: int) -> None:
        self._shown += 1
        if depth > DEEPEST_NODES or self._shown > MOST_NODES:
            raise WorldError(
                f"{self._path}:{node.line}: nodes within each other more than {DEEPEST_NODES} deep, "
                f"or more than {MOST_NODES} of them"
            )
        place = outer
        for child in node.children:
            place = after(place, self._transform(child))
            if child.tag in SKIPPED_NODES:
                self._found.skipped[f"COLLADA <{child.tag}>"] = None
        for child in node.children:
            if child.tag == "instance_geometry":
                self._geometry(self._named(child, self._geometries), place)
            elif child.tag == "instance_node":
                self._node(self._named(child, self._nodes), place, depth + 1)
            elif child.tag == "node":
                self._node(child, place, depth + 1)

    def _transform(self, element: Element) -> Transform:
        if element.tag == "matrix":
            v = numbers(element, element.text, self._path, 16)
            return (v[0], v[1], v[2], v[3]), (v[4], v[5], v[6], v[7]), (v[8], v[9], v[10], v[11])
        if element.tag in {"translate", "scale"}:
            x, y, z = numbers(element, element.text, self._path, 3)
            return moved(x, y, z) if element.tag == "translate" else scaled(x, y, z)
        if element.tag == "rotate":
            x, y, z, degrees = numbers(element, element.text, self._path, 4)
            return about_axis(x, y, z, math.radians(degrees))
        return IDENTITY

    def _geometry(self, geometry: Element, place: Transform) -> None:
        mesh = geometry.first("mesh")
        if mesh is None:
            self._found.skipped["COLLADA geometry without a mesh"] = None
            return
        sources = {source.get("id"): source for source in mesh.all("source")}
        points_of = {item.get("id"): item for item in mesh.all("vertices")}
        for faces in mesh.children:
            if faces.tag in SKIPPED_FACES:
                self._found.skipped[f"COLLADA <{faces.tag}>"] = None
            if faces.tag in {"triangles", "polylist", "polygons"}:
                if faces.first("ph") is not None:
                    self._found.skipped["COLLADA <ph>: polygons with holes"] = None
                self._faces(faces, sources, points_of, place)

    def _faces(
        self, faces: Element, sources: dict[str, Element], points_of: dict[str, Element], place: Transform
    ) -> None:
        inputs = faces.all("input")
        vertex = next((item for item in inputs if item.get("semantic") == "VERTEX"), None)
        if vertex is None:
            return
        points = self._points(self._named(vertex, points_of, "source"), sources)
        stride = 1 + max(self._whole(item, item.get("offset", "0")) for item in inputs)
        offset = self._whole(vertex, vertex.get("offset", "0"))
        base = len(self._found.vertices)
        self._found.vertices += apply(place, points)
        if len(self._found.vertices) > MOST_VERTICES:
            raise WorldError(f"{self._path}: more than {MOST_VERTICES} vertices", hint="decimate it first")
        for polygon in self._polygons(faces, stride, offset):
            if not all(0 <= index < len(points) for index in polygon):
                raise WorldError(f"{self._path}:{faces.line}: a face names a vertex that is not there")
            corners = [self._found.vertices[base + index] for index in polygon]
            self._found.triangles += [
                (base + polygon[a], base + polygon[b], base + polygon[c]) for a, b, c in triangulated(corners)
            ]
            if len(self._found.triangles) > MOST_TRIANGLES:
                raise WorldError(f"{self._path}: more than {MOST_TRIANGLES} triangles", hint="decimate it first")

    def _polygons(self, faces: Element, stride: int, offset: int) -> Iterator[list[int]]:
        """Yield the vertex numbers of each face."""
        counts_element = faces.first("vcount")
        counts = self._wholes(counts_element) if faces.tag == "polylist" and counts_element is not None else None
        for element in faces.all("p"):
            indices = self._wholes(element)[offset::stride]
            if faces.tag == "polygons":
                if len(indices) < 3:
                    raise WorldError(f"{self._path}:{element.line}: a face is cut short")
                yield indices
                continue
            place = 0
            for count in counts if counts is not None else [3] * (len(indices) // 3):
                polygon = indices[place : place + count]
                if count < 3 or len(polygon) < count:
                    raise WorldError(f"{self._path}:{element.line}: a face is cut short")
                yield polygon
                place += count

    def _points(self, vertices: Element, sources: dict[str, Element]) -> list[Vertex]:
        position = next((item for item in vertices.all("input") if item.get("semantic") == "POSITION"), None)
        if position is None:
            raise WorldError(f"{self._path}:{vertices.line}: <vertices> without a POSITION")
        source = self._named(position, sources, "source")
        array = source.first("float_array")
        if array is None:
            raise WorldError(f"{self._path}:{source.line}: <source> without a <float_array>")
        accessor = source.first("technique_common", "accessor")
        stride = 3 if accessor is None else self._whole(accessor, accessor.get("stride", "3"))
        values = numbers(array, array.text, self._path)
        if stride < 3 or len(values) % stride:
            raise WorldError(f"{self._path}:{array.line}: <float_array> is no list of points")
        return [(values[i], values[i + 1], values[i + 2]) for i in range(0, len(values), stride)]

    def _named(self, element: Element, table: dict[str, Element], attribute: str = "url") -> Element:
        name = element.get(attribute).removeprefix("#")
        if name not in table:
            raise WorldError(f"{self._path}:{element.line}: <{element.tag}> names {name!r}, which is not there")
        return table[name]

    def _by_id(self, library: str, tag: str) -> dict[str, Element]:
        return {item.get("id"): item for part in self._root.all(library) for item in part.all(tag)}

    def _whole(self, element: Element, text: str) -> int:
        try:
            value = int(text)
        except ValueError as error:
            raise WorldError(f"{self._path}:{element.line}: {text[:20]!r} is no whole number") from error
        if not 0 <= value <= 1_000_000_000:
            raise WorldError(f"{self._path}:{element.line}: {value} is out of range")
        return value

    def _wholes(self, element: Element) -> list[int]:
        return [self._whole(element, word) for word in element.text.split()]
