"""Worlds and robots written for other programs: SDF, URDF, MJCF, glTF.

One description (`scene`), made of a world and a robot (`scenes`), is what every writer walks; `formats` is the
table of writers and of what each format holds.
"""

from p2os.pioneer.export.export import Export, export
from p2os.pioneer.export.formats import FORMATS
from p2os.pioneer.export.scenes import scene_of

__all__ = ["FORMATS", "Export", "export", "scene_of"]
