"""What was sent on a P2OS line, by whom and when: chunks of bytes with time and direction.

A capture knows nothing of frames; `p2os.capture.listing` finds them. Where a
source gives no direction (raw bytes, plain hex), a chunk has none and each
frame's is guessed from its shape.

A `Chunk` is an object; a `ChunkBlock` holds as many as were read together without an object each, for captures of
millions.

Invariant: chunks are in the order in which they were read, and time never runs back.
"""

from array import array
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from enum import Enum
from itertools import accumulate, chain
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
#: Who sent a chunk of a block, a letter each.
LETTERS = {Direction.TO_ROBOT: b"c", Direction.FROM_ROBOT: b"r", None: b"?"}
_DIRECTIONS = {letter[0]: direction for direction, letter in LETTERS.items()}


@dataclass(frozen=True, slots=True, kw_only=True)
class ChunkBlock:
    """Chunks that were read together, none of them empty.

    Args:
        at_ns: When each came, 64-bit integers.
        senders: `c` (client), `r` (robot) or `?` for each.
        ends: Where the bytes of each end in `data`, 64-bit integers, rising.
        data: All of their bytes.
        is_in_order: Whether it is known that no time steps back.
    """

    at_ns: "array[int]"
    senders: bytes
    ends: "array[int]"
    data: bytes
    is_in_order: bool = field(default=False, compare=False)

    def __len__(self) -> int:
        return len(self.senders)

    def chunk(self, number: int) -> Chunk:
        """Return one of them."""
        start = self.ends[number - 1] if number else 0
        data = self.data[start : self.ends[number]]
        return Chunk(at_ns=self.at_ns[number], direction=self.direction(number), data=data)

    def direction(self, number: int) -> Direction | None:
        """Return who sent one of them."""
        return _DIRECTIONS[self.senders[number]]

    def __iter__(self) -> Iterator[Chunk]:
        start = 0
        for at_ns, sender, end in zip(self.at_ns, self.senders, self.ends, strict=True):
            yield Chunk(at_ns=at_ns, direction=_DIRECTIONS[sender], data=self.data[start:end])
            start = end


def block_of(parts: Iterable[Part]) -> ChunkBlock:
    """Return parts as a block, those without bytes left out."""
    kept = [part for part in parts if part[2]]
    return ChunkBlock(
        at_ns=array("q", [at_ns for at_ns, _, _ in kept]),
        senders=b"".join([LETTERS[direction] for _, direction, _ in kept]),
        ends=array("q", accumulate(len(data) for _, _, data in kept)),
        data=b"".join([data for _, _, data in kept]),
    )


def blocks_of(parts: Iterable[Part]) -> Iterator[ChunkBlock]:
    """Yield parts as one block; where reading them fails, what came before, and then the error."""
    kept: list[Part] = []
    try:
        kept.extend(parts)
    except Exception:
        yield block_of(kept)
        raise
    yield block_of(kept)


def chunks_of(blocks: Iterable[ChunkBlock]) -> Iterator[Chunk]:
    """Yield the chunks of blocks one by one."""
    return chain.from_iterable(blocks)


def in_order(blocks: Iterable[ChunkBlock]) -> Iterator[ChunkBlock]:
    """Yield blocks that hold something; a time that steps back a little, as clocks of captures do, is moved up."""
    last_ns = 0
    for block in filter(len, blocks):
        # Looking costs a quarter of what accumulating does.
        is_in_order = block.is_in_order or array("q", sorted(block.at_ns)) == block.at_ns
        at_ns = block.at_ns
        if not is_in_order or at_ns[0] < last_ns:
            at_ns = array("q", accumulate(at_ns, max, initial=last_ns))[1:]
        last_ns = at_ns[-1]
        yield block if at_ns is block.at_ns else replace(block, at_ns=at_ns)


def capture_of(parts: Iterable[Part], *, has_time: bool = True, note: str = "") -> Capture:
    """Return a capture of (nanoseconds, direction, bytes)."""
    chunks = tuple(chunks_of(in_order([block_of(parts)])))
    return Capture(chunks=chunks, has_time=has_time, note=note)
