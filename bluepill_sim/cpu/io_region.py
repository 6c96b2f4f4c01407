"""Regions of peripherals: their accesses are calls of Python, straight from C.

Invariant: a callback never raises; what it should have raised is kept by `fail`.
"""

from collections.abc import Callable

from bluepill_sim.cpu.core import RawRead, RawWrite, ReadAccess, WriteAccess


def guarded(
    read: ReadAccess, write: WriteAccess, is_denied: Callable[[], bool], fail: Callable[[BaseException], None]
) -> tuple[RawRead, RawWrite]:
    """Return callbacks that look whether the access is to be made at all, and that never raise."""

    def on_read(_uc: int, offset: int, count: int, _user: int) -> int:
        try:
            return 0 if is_denied() else read(offset, count)
        except BaseException as error:  # noqa: BLE001 - C stands between here and the caller
            fail(error)
            return 0

    def on_write(_uc: int, offset: int, count: int, value: int, _user: int) -> None:
        try:
            if not is_denied():
                write(offset, count, value)
        except BaseException as error:  # noqa: BLE001 - C stands between here and the caller
            fail(error)

    return on_read, on_write
