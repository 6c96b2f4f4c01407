"""Shapes as triangles, for formats that have nothing else, and meshes as OBJ files."""

from p2os.pioneer.export.scene import Box, Cylinder, Shape, TriangleMesh
from p2os.pioneer.world.solids import box, cylinder, sphere

#: chosen: sides of a cylinder, and sectors of a sphere, which has half as many bands.
SIDES = 32


def triangulated(shape: Shape) -> TriangleMesh:
    """Return a shape as triangles that look outwards; a round one as a prism inside of it."""
    if isinstance(shape, TriangleMesh):
        return shape
    if isinstance(shape, Box):
        return TriangleMesh(*box(shape.size_m))
    if isinstance(shape, Cylinder):
        return TriangleMesh(*cylinder(shape.radius_m, shape.length_m, SIDES))
    return TriangleMesh(*sphere(shape.radius_m, SIDES))


def obj_text(mesh: TriangleMesh) -> bytes:
    """Return an OBJ file: metres, with the axes of the mesh."""
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in mesh.vertices]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in mesh.triangles]
    return ("\n".join(lines) + "\n").encode()
