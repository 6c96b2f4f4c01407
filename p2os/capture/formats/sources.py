"""Any file, folder or text that holds P2OS bytes, read as a capture."""

from pathlib import Path

from p2os.capture.chunks import Capture, Direction, capture_of
from p2os.capture.formats.hex_text import looks_like_hex, read_hex
from p2os.capture.formats.pcap import is_pcap, read_pcap
from p2os.capture.formats.recording import read_recording
from simbase.errors import FileError

#: The P2OS bytes in the folder that `p2os run` makes.
RUN_WIRE = "wire.jsonl"
#: chosen: a day of a fully used 115200-baud line is less.
LARGEST_BYTES = 2_000_000_000


def read_capture(data: bytes, direction: Direction | None = None) -> Capture:
    """Read a capture of whatever kind its bytes are: pcap, pcapng, JSON lines, hex text, else raw bytes.

    Args:
        data: The content of a file.
        direction: Who sent raw or hex bytes whose source does not give it.

    Raises:
        FileError: The content is of one of these kinds, and broken.
    """
    if is_pcap(data):
        return read_pcap(data)
    text = _text(data)
    if text is not None and text.lstrip().startswith("{"):
        return read_recording(text)
    if text is not None and text.strip():
        capture = read_hex(text)
    else:
        capture = capture_of([(0, direction, data)], has_time=False)
    if direction is None:
        return capture
    directed = [(chunk.at_ns, chunk.direction or direction, chunk.data) for chunk in capture.chunks]
    return capture_of(directed, has_time=False)


def read_file(path: Path, direction: Direction | None = None) -> Capture:
    """Read a capture from a file, or from the folder of a run.

    Raises:
        FileError: The file cannot be read, or holds no capture.
    """
    place = path / RUN_WIRE if path.is_dir() else path
    try:
        if place.stat().st_size > LARGEST_BYTES:
            raise FileError(f"{place} is larger than {LARGEST_BYTES // 1_000_000_000} GB")
        data = place.read_bytes()
    except OSError as error:
        raise FileError(f"cannot read {place}: {(error.strerror or str(error)).lower()}") from error
    try:
        return read_capture(data, direction)
    except FileError as error:
        raise FileError(f"{place}: {error}", hint=error.hint) from error


def read_argument(words: list[str], direction: Direction | None = None) -> Capture:
    """Read what a person named: one file or folder, or hex text in one or more words.

    Raises:
        FileError: It is neither.
    """
    if len(words) == 1 and Path(words[0]).exists():
        return read_file(Path(words[0]), direction)
    text = " ".join(words)
    if looks_like_hex(text):
        return read_capture(text.encode("ascii"), direction)
    what = words[0] if len(words) == 1 else text
    raise FileError(f"{what!r} is no file and no hex text", hint="p2os decode 'fa fb 03 00 00 00'")


def _text(data: bytes) -> str | None:
    """Return the content as text, or None where it is not meant as such."""
    try:
        text = data.decode("ascii" if data[:1] != b"{" else "utf-8")
    except UnicodeDecodeError:
        return None
    return text if all(character.isprintable() or character in "\t\n\r\f" for character in text) else None
