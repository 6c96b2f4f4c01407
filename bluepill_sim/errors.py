"""What this package raises, sorted by who can act on it.

Firmware that misbehaves is not an error here: it is a fault report of the
emulated chip. Any exception that is not a `P2osError` is a bug in this package.
"""

from simbase.errors import P2osError


class BluePillError(P2osError):
    """The emulator cannot do what was asked."""

    exit_code = 2


class ImageError(BluePillError):
    """A firmware file is missing, damaged, or not for this chip."""


class UnmodelledError(BluePillError):
    """In strict mode, the firmware used something that is not modelled."""

    exit_code = 1
