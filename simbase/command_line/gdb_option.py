"""The option that lets GDB come: a port, and the usual one where none is named."""

from collections.abc import Sequence

#: Where GDB looks for OpenOCD, and IDEs for a remote server.
GDB_PORT = 3333


def usual_port(following: str) -> Sequence[str]:
    """Return the port that an option without one has, seen from the word behind it."""
    return () if following.isdecimal() else (str(GDB_PORT),)
