"""A field of a packet: its name, what it is on the wire, and what it means, said in one place.

Readers, writers, `PROTOCOL.md` and the Wireshark dissector take them from the layout.
"""

from construct import Construct, Renamed


def part(name: str, kind: Construct, means: str = "") -> Construct:
    """Return a named field of a layout.

    Args:
        name: As the packet's own attribute.
        kind: What it is on the wire.
        means: In a few words, its unit first where it is a number with one; empty where its own rows say it.
    """
    return Renamed(kind, newname=name, newdocs=means)


def meaning(field: Construct) -> str:
    """Return what a field of a layout means; empty: its own rows say it."""
    return str(field.docs)
