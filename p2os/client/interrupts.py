"""Work that an interrupt must not cut short: telling a robot to stop."""

from collections.abc import Callable


def held_back(work: Callable[[], None]) -> None:
    """Do some work to its end; interrupts that come meanwhile are raised afterwards.

    Args:
        work: Is begun again after each interrupt (KeyboardInterrupt, or what else a handler of signals raises),
            so it must know what it has done. It must take a bounded time.

    Raises:
        BaseException: The last interrupt, once the work is done; or at once an Exception of the work itself.
    """
    held: BaseException | None = None
    while True:
        try:
            work()
            break
        except Exception:
            raise
        except BaseException as interrupt:  # noqa: BLE001  # raised below
            held = interrupt
    if held is not None:
        raise held
