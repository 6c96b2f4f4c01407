"""Readers of files that hold triangles: OBJ, STL, COLLADA, glTF."""
