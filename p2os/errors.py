"""The errors of the protocol, the client and the virtual robot, sorted by who can act on them.

Line noise, lost bytes and unknown packet types are events and counters, never
errors. The root and what every package raises stand in `simbase.errors`; what p2os
raises of them can be had here.
"""

from simbase.errors import FileError, MissingDependencyError, P2osError, UsageError

__all__ = [
    "FileError", "LocalProtocolError", "MissingDependencyError", "P2osError", "RemoteProtocolError", "RunFailedError",
    "ScenarioError", "TransportError", "UsageError", "WorldError",
]  # fmt: skip


class WorldError(FileError):
    """A world file is missing or breaks its schema."""


class ScenarioError(FileError):
    """A scenario file is missing or breaks its schema."""


class LocalProtocolError(P2osError):
    """Our own caller asks for what the protocol or the state does not allow."""


class RemoteProtocolError(P2osError):
    """The far end does not behave as P2OS says."""


class TransportError(P2osError):
    """A port cannot be opened, or was lost."""


class RunFailedError(P2osError):
    """A run came to an end that its scenario does not want."""
