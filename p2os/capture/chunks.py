"""What was sent on a P2OS line, by whom and when: chunks of bytes with time and direction.

A capture knows nothing of frames; `p2os.capture.listing` finds them. Where a
source gives no direction (raw bytes, plain hex), a chunk has none and each
frame's is guessed from its shape.

Invariant: chunks are in the order in which they were read, and time never runs back.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import Enum
from typing import TypeAlias

from p2os.errors import LocalProtocolError
from simbase.timing import Nanos


class Direction(Enum):
    """Which way bytes went."""

    #: From the client to the robot: commands.
    TO_ROBOT = "c2r"
    #: From the robot to its client: packets.
    FROM_ROBOT = "r2c"

    @property
    def opposite(self) -> "Direction":
        """The other one."""
        return Direction.FROM_ROBOT if self is Direction.TO_ROBOT else Direction.TO_ROBOT

    @property
    def arrow(self) -> str:
        """`>` to the robot, `<` from it."""
        return ">" if self is Direction.TO_ROBOT else "<"


@dataclass(frozen=True, slots=True, kw_only=True)
class Chunk:
    """Bytes that arrived together.

    Args:
        at_ns: When, in nanoseconds since the capture's start.
        direction: Who sent them, or None where the source does not give it.
        data: The bytes.

    Raises:
        LocalProtocolError: The time is negative.
    """

    at_ns: Nanos
    direction: Direction | None
    data: bytes

    def __post_init__(self) -> None:
        if self.at_ns < 0:
            raise LocalProtocolError(f"a chunk at {self.at_ns} ns: time begins at 0")


@dataclass(frozen=True, slots=True, kw_only=True)
class Capture:
    """A recorded conversation.

    Args:
        chunks: In the order of time.
        has_time: Whether the source gave times; without, all are 0.
        note: Free text, such as which robot and program were recorded.
    """

    chunks: tuple[Chunk, ...] = ()
    has_time: bool = True
    note: str = ""

    def __iter__(self) -> Iterator[Chunk]:
        return iter(self.chunks)

    @property
    def duration_ns(self) -> Nanos:
        """When the last chunk came, in nanoseconds."""
        return self.chunks[-1].at_ns if self.chunks else 0

    def bytes_of(self, direction: Direction | None) -> bytes:
        """Return all that was sent one way, joined."""
        return b"".join(chunk.data for chunk in self.chunks if chunk.direction is direction)


#: What a source gives: nanoseconds, who sent it if that is known, bytes.
Part: TypeAlias = tuple[Nanos, Direction | None, bytes]


def in_order(parts: Iterable[Part]) -> Iterator[Chunk]:
    """Yield parts as chunks; a time that steps back a little, as clocks of captures do, is moved up to the last."""
    last_ns = 0
    for at_ns, direction, data in parts:
        last_ns = max(last_ns, at_ns)
        if data:
            yield Chunk(at_ns=last_ns, direction=direction, data=data)


def capture_of(parts: Iterable[Part], *, has_time: bool = True, note: str = "") -> Capture:
    """Return a capture of (nanoseconds, direction, bytes)."""
    return Capture(chunks=tuple(in_order(parts)), has_time=has_time, note=note)
