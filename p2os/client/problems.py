"""What a client raises, one class for each thing that a program may want to catch.

All are `P2osError`: one line for a person, and a hint.
"""

from p2os.errors import LocalProtocolError, TransportError


class ConnectError(TransportError):
    """No session could be opened; the message says how far it came."""


class LinkLostError(TransportError):
    """The session is gone, or was gone since the last motion call; the robot was told to stop."""


class NoAnswerError(TransportError):
    """The robot did not answer a request in time; it may not have what was asked for."""


class MotorsDisabledError(LocalProtocolError):
    """The motors are off, and this client does not switch them on by itself."""


class MotionError(LocalProtocolError):
    """`drive` or `turn` did not arrive: it stalled, was too slow, or something else took its place."""
