"""What this package raises, sorted by who can act on it.

Firmware that misbehaves is not an error here: it is a fault report of the
emulated chip. Any exception that is not a `BluePillError` is a bug in this package.
"""


class BluePillError(Exception):
    """The emulator cannot do what was asked.

    Args:
        message: one line: what failed, with which values, where.
        hint: one line: what to try, or None.
    """

    #: Exit code of a command that ends with this error.
    exit_code = 2

    def __init__(self, message: str, *, hint: str | None = None) -> None:
        super().__init__(message)
        self.hint = hint


class ImageError(BluePillError):
    """A firmware file is missing, damaged, or not for this chip."""


class MissingDependencyError(BluePillError):
    """A library that the emulator needs is not installed.

    Args:
        message: one line: what needs it.
        extra: the extra that brings it; a command line says how that is installed.
        hint: one line: what to try, or None.
    """

    def __init__(self, message: str, *, extra: str | None = None, hint: str | None = None) -> None:
        super().__init__(message, hint=hint)
        self.extra = extra


class UnmodelledError(BluePillError):
    """In strict mode, the firmware used something that is not modelled."""

    exit_code = 1
