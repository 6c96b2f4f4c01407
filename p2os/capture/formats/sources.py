"""Any file, folder or text that holds P2OS bytes, read as a capture: whole, or chunk by chunk as it is read.

Invariant: what is opened holds no more of its file than a block or a line.
"""

import codecs
import io
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO, cast

from p2os.capture.chunks import Capture, Chunk, ChunkBlock, Direction, Part, block_of, blocks_of, chunks_of, in_order
from p2os.capture.formats.hex_text import hex_parts, is_hexdump, looks_like_hex
from p2os.capture.formats.pcap import is_pcap, pcap_blocks
from p2os.capture.formats.recording import note_of, recorded_parts
from simbase.errors import FileError, shown_name
from simbase.files import reading

#: The P2OS bytes in the folder that `p2os run` makes.
RUN_WIRE = "wire.jsonl"
#: chosen: what is held whole in memory, by `read_file`: 12 hours at 115200 baud. `open_file` takes any length.
LARGEST_BYTES = 512 << 20
#: chosen: what is read at a time; the kind of a file is told by its first block.
BLOCK_BYTES = 1 << 16
#: chosen: what is read at a time behind the first block; larger ones take more memory and hardly less time.
LARGE_BLOCK_BYTES = 1 << 19
#: chosen: a line of a recording is one chunk; a longer one is no text.
LONGEST_LINE = 16 << 20


@dataclass(frozen=True, slots=True, kw_only=True)
class CaptureSource:
    """A capture that is read while its blocks are taken.

    Args:
        blocks: Its chunks in the order of time, once.
        has_time: Whether the source gives times; without, all are 0.
        note: Free text, such as which robot and program were recorded.
        has_one_origin: Whether all of the robot's chunks have a direction, or none has.
    """

    blocks: Iterator[ChunkBlock]
    has_time: bool = True
    note: str = ""
    has_one_origin: bool = True

    @property
    def chunks(self) -> Iterator[Chunk]:
        """What is left to be read, one by one."""
        return chunks_of(self.blocks)

    def whole(self) -> Capture:
        """Read all of it.

        Raises:
            FileError: It is broken.
        """
        return Capture(chunks=tuple(self.chunks), has_time=self.has_time, note=self.note)


def open_capture(file: BinaryIO, direction: Direction | None = None) -> CaptureSource:
    """Begin to read a capture of whatever kind its bytes are: pcap, pcapng, JSON lines, hex text, else raw bytes.

    Args:
        file: Its content; taking blocks reads it, and raises `FileError` where it is broken.
        direction: Who sent raw or hex bytes whose source does not give it.
    """
    buffered = cast(
        "io.BufferedReader",
        file if isinstance(file, io.BufferedReader) else io.BufferedReader(cast("io.RawIOBase", file), BLOCK_BYTES),
    )
    head = buffered.peek(BLOCK_BYTES)
    if is_pcap(head):
        return CaptureSource(blocks=in_order(pcap_blocks(_blocks_of_bytes(buffered))))
    mark = codecs.BOM_UTF8 if head.startswith(codecs.BOM_UTF8) else b""  # editors of Windows put it before a text
    text = _text(head.removeprefix(mark))
    if text is not None:
        buffered.read(len(mark))
    if text is not None and text.lstrip().startswith("{"):
        return CaptureSource(blocks=in_order(_recorded(buffered)), note=note_of(text.lstrip().split("\n")[0]))
    is_hex = bool(text and text.strip())
    parts = hex_parts(_lines(_blocks_of_lines(buffered)), is_dump=is_hexdump(text or "")) if is_hex else _raw(buffered)
    directed = ((at_ns, sent_by or direction, data) for at_ns, sent_by, data in parts)
    return CaptureSource(
        blocks=in_order(block_of([part]) for part in directed), has_time=False, has_one_origin=not is_hex
    )


def open_file(path: Path, direction: Direction | None = None) -> CaptureSource:
    """Begin to read a capture from a file, or from the folder of a run.

    Raises:
        FileError: The file cannot be read; taking blocks raises it where the file is broken.
    """
    place = path / RUN_WIRE if path.is_dir() else path
    with reading(place):
        file = place.open("rb", buffering=BLOCK_BYTES)
        source = open_capture(file, direction)
    return replace(source, blocks=_named(source.blocks, file, place))


def open_argument(words: list[str], direction: Direction | None = None) -> CaptureSource:
    """Begin to read what a person named: one file or folder, or hex text in one or more words.

    Raises:
        FileError: It is neither.
    """
    if len(words) == 1 and words[0] and Path(words[0]).exists():
        return open_file(Path(words[0]), direction)
    text = " ".join(words)
    if looks_like_hex(text):
        return open_capture(io.BytesIO(text.encode("ascii")), direction)
    what = words[0] if len(words) == 1 else text
    raise FileError(f"{what!r} is no file and no hex text", hint="p2os decode 'fa fb 03 00 00 00'")


def read_capture(data: bytes, direction: Direction | None = None) -> Capture:
    """Read a whole capture, as `open_capture` does.

    Raises:
        FileError: The content is of one of the kinds, and broken.
    """
    return open_capture(io.BytesIO(data), direction).whole()


def read_file(path: Path, direction: Direction | None = None) -> Capture:
    """Read a whole capture from a file, or from the folder of a run.

    Raises:
        FileError: The file cannot be read, or holds no capture.
    """
    place = path / RUN_WIRE if path.is_dir() else path
    source = open_file(path, direction)
    return replace(source, blocks=_bounded(source.blocks, place)).whole()


def _bounded(blocks: Iterator[ChunkBlock], place: Path) -> Iterator[ChunkBlock]:
    """Yield blocks, as many as are held in memory: what is read may have no end."""
    left = LARGEST_BYTES
    for block in blocks:
        left -= len(block.data)
        if left < 0:
            raise FileError(
                f"{shown_name(place)} holds more than {LARGEST_BYTES >> 20} MiB", hint="p2os decode takes any length"
            )
        yield block


def _named(blocks: Iterator[ChunkBlock], file: BinaryIO, place: Path) -> Iterator[ChunkBlock]:
    """Yield blocks; what is wrong names the file, which is closed at the end."""
    with file, reading(place):
        try:
            yield from blocks
        except FileError as error:
            raise FileError(f"{place}: {error}", hint=error.hint) from error


def _raw(file: io.BufferedReader) -> Iterator[Part]:
    for data in _blocks_of_bytes(file):
        yield 0, None, data


def _recorded(file: io.BufferedReader) -> Iterator[ChunkBlock]:
    before = 0
    for lines in _blocks_of_lines(file):
        block = _in_bulk(lines) if before else None  # a small file is read before NumPy is loaded
        if block is None:
            counted = _Numbered(before)
            yield from blocks_of(recorded_parts(_lines((lines,), counted), before + 1))
            before = counted.count
        else:
            yield block
            before += len(block)


def _in_bulk(lines: bytes) -> ChunkBlock | None:
    """Return what lines of ours hold; None where one is spelled otherwise, and without NumPy."""
    try:
        from p2os.capture.formats.recording_bulk import plain_lines
    except ImportError:
        return None
    return plain_lines(lines)


@dataclass(slots=True)
class _Numbered:
    """How many lines there were."""

    count: int = 0


def _lines(blocks: Iterable[bytes], lines: _Numbered | None = None) -> Iterator[str]:
    """Yield each line, however lines end."""
    lines = lines or _Numbered()
    for block in blocks:
        for line in block.split(b"\n") if len(block) < LONGEST_LINE else [block]:
            if len(line) >= LONGEST_LINE:
                raise FileError(f"line {lines.count + 1} is longer than {LONGEST_LINE >> 20} MB")
            try:
                text = line.decode("utf-8")
            except UnicodeDecodeError as error:
                raise FileError(f"line {lines.count + 1} is no text: byte 0x{line[error.start]:02X}") from error
            for part in text.splitlines():
                lines.count += 1
                yield part


def _blocks_of_bytes(file: io.BufferedReader) -> Iterator[bytes]:
    """Yield what can be read at once, so that nothing waits for the rest of a block."""
    size = BLOCK_BYTES
    while data := file.read1(size):
        yield data
        size = LARGE_BLOCK_BYTES


def _blocks_of_lines(file: io.BufferedReader) -> Iterator[bytes]:
    """Yield whole lines, as many as were read together; what is longer than any line may be is cut."""
    rest: list[bytes] = []
    size = 0
    for data in _blocks_of_bytes(file):
        end = data.rfind(b"\n") + 1
        if end:
            yield b"".join((*rest, memoryview(data)[:end]))
            rest, size = [], 0
        rest.append(data[end:])
        size += len(data) - end
        if size >= LONGEST_LINE:
            yield b"".join(rest)
            rest, size = [], 0
    if size:
        yield b"".join(rest)


def _text(data: bytes) -> str | None:
    """Return what a file begins with as text, or None where it is not meant as such."""
    try:
        # The block may end inside a character.
        text = codecs.getincrementaldecoder("ascii" if data[:1] != b"{" else "utf-8")().decode(data)
    except UnicodeDecodeError:
        return None
    return text if all(character.isprintable() or character in "\t\n\r\f" for character in text) else None
