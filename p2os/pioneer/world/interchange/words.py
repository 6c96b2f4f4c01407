"""What p2os writes into files of other programs and reads back: elements of its own, and glTF's container.

`<thing>` and `<world>` of our own namespace hold what SDF and URDF have no words for: whether a box is a wall or a
floor, where a robot begins.
"""

NAMESPACE = "urn:p2os:world"
THING, WORLD = "thing", "world"
#: What is written for other programs alone: the level ground, and a robot at the start.
GROUND, ROBOT = "ground", "robot"
#: Of a .glb: magic number, version and length, then chunks of a length, a type and data (glTF 2.0, section 4.4).
GLB_MAGIC, GLB_HEADER, CHUNK_HEADER = b"glTF", 12, 8
