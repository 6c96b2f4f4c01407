"""Identifiers that never change from build to build.

KiCad names every object by a UUID. Ours are UUIDs of version 5 over a readable path
(`rev-b/U5/pad 3`), so that two builds write the same bytes.
"""

import uuid

from hardware.pcb.sexp import Node, Text, node

_SPACE = uuid.UUID("6f2d6a53-77d5-5f0b-9a3c-0b5a5d1c9e11")


def uid(*path: object) -> str:
    """Return the identifier of a path."""
    return str(uuid.uuid5(_SPACE, "/".join(str(part) for part in path)))


def uuid_node(*path: object) -> Node:
    """Return `(uuid "...")` of a path."""
    return node("uuid", Text(uid(*path)))


def sheet_path(variant: str, page: str) -> str:
    """Return the path of a page below the root sheet, as symbols' instances name it."""
    return f"/{uid(variant, 'root')}/{uid(variant, 'sheet', page)}"
