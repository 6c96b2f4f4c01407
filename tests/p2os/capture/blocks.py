"""Chunks as the block that a reader would have made of them."""

from collections.abc import Iterable

from p2os.capture.chunks import Block, Chunk, block_of


def block_of_chunks(chunks: Iterable[Chunk]) -> Block:
    return block_of((chunk.at_ns, chunk.direction, chunk.data) for chunk in chunks)
