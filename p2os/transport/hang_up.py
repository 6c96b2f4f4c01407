"""Whether the far side has gone, asked without reading what it has left behind."""

import select


def has_hung_up(descriptor: int) -> bool:
    """Tell whether the other end is closed, though bytes may still wait; False where a system cannot tell."""
    if not hasattr(select, "poll"):
        return False
    closed_for_writing: int = getattr(select, "POLLRDHUP", 0)  # Linux alone tells that of a socket
    poll = select.poll()
    poll.register(descriptor, closed_for_writing)
    gone = select.POLLHUP | select.POLLERR | closed_for_writing
    return any(event & gone for _, event in poll.poll(0))
