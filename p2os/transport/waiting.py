"""Waiting for descriptors: the one place that does."""

import select
import time
from collections.abc import Iterable

from p2os.errors import TransportError
from p2os.transport.ports import Transport

#: chosen: how often a line without a descriptor is asked for bytes; a millisecond is a character at 9600 bit/s.
BLIND_POLL_S = 0.001
#: `select` ends waits to the microsecond, but knows no descriptor from here on (FD_SETSIZE); `poll` to the millisecond.
SELECT_LIMIT = 1024


def wait_readable(descriptors: Iterable[int], longest_s: float) -> set[int]:
    """Return the descriptors that have something to read, hung up included, as soon as there is one.

    Args:
        descriptors: Whom to wait for; without any it just waits.
        longest_s: Seconds after which nothing is an answer too; 0 or less only looks.
    """
    found = list(descriptors)
    if not found:
        time.sleep(max(longest_s, 0.0))
        return set()
    longest_s = max(longest_s, 0.0)
    if max(found) < SELECT_LIMIT or not hasattr(select, "poll"):
        return set(select.select(found, [], [], longest_s)[0])
    poll = select.poll()
    for descriptor in found:
        poll.register(descriptor, select.POLLIN)
    return {descriptor for descriptor, _ in poll.poll(longest_s * 1000)}


def wait_for_bytes(transport: Transport, longest_s: float) -> None:
    """Wait until a line has something to read; one that cannot be waited for is to be asked often."""
    try:
        wait_readable((transport.fileno(),), longest_s)
    except (TransportError, OSError, ValueError):  # no descriptor, or a line that was closed: its `read` tells
        time.sleep(min(max(longest_s, 0.0), BLIND_POLL_S))
