"""The errors of the project, sorted by who can act on them.

Line noise, lost bytes and unknown packet types are events and counters, never
errors. Whatever is raised here reaches a person as one line and one hint.
"""


class P2osError(Exception):
    """The root of the tree.

    Args:
        message: What failed, with the values and the place.
        hint: What to try, as a command or a short sentence; None where there is nothing to say.
    """

    #: Exit code of a command that ends with this error: 1 it failed, 2 wrong usage or file.
    exit_code = 1

    def __init__(self, message: str, *, hint: str | None = None) -> None:
        super().__init__(message)
        self.hint = hint


class UsageError(P2osError):
    """The command line asks for what cannot be."""

    exit_code = 2


class FileError(P2osError):
    """A file is missing, unreadable or not what it should be."""

    exit_code = 2


class WorldError(FileError):
    """A world file is missing or breaks its schema."""


class ScenarioError(FileError):
    """A scenario file is missing or breaks its schema."""


class MissingDependencyError(P2osError):
    """An optional extra is not installed."""

    exit_code = 2


class LocalProtocolError(P2osError):
    """Our own caller asks for what the protocol or the state does not allow."""


class RemoteProtocolError(P2osError):
    """The far end does not behave as P2OS says."""


class TransportError(P2osError):
    """A port cannot be opened, or was lost."""


class RunFailedError(P2osError):
    """A run came to an end that its scenario does not want."""
