"""Chunks as the blocks that a reader would have made of them."""

from collections.abc import Iterable, Sequence

from p2os.capture.chunks import Chunk, ChunkBlock, Part, block_of


def parts_of(chunks: Iterable[Chunk]) -> list[Part]:
    """Return what chunks are made of."""
    return [(chunk.at_ns, chunk.direction, chunk.data) for chunk in chunks]


def block_of_chunks(chunks: Iterable[Chunk]) -> ChunkBlock:
    """Return one block of them."""
    return block_of(parts_of(chunks))


def blocks_of(chunks: Sequence[Chunk], together: int) -> list[ChunkBlock]:
    """Return blocks of so many each; of chunks without bytes none."""
    blocks = [block_of_chunks(chunks[place : place + together]) for place in range(0, len(chunks), together)]
    return [block for block in blocks if len(block)]
