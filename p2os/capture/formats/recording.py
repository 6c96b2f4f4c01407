"""Recordings as JSON lines: ours, those of run folders, and those of other recorders.

Ours: a first line `{"format": "p2os-recording", "version": 1, "note": …}`, then
one object a chunk: `t` nanoseconds since the start, `dir` `c2r` or `r2c`, `hex`.
A run folder's wire.jsonl is the same without the first line.

Others: `t` seconds, `dir` `c2s`, `s2c` or `event`; events are left out.
"""

import json
from collections.abc import Iterable, Iterator, Mapping

from p2os.capture.chunks import Capture, Chunk, Direction, Part
from simbase.errors import FileError, shown
from simbase.files import VersionedFormat
from simbase.timing import NS_PER_S, Nanos

#: What stands in the first line.
FORMAT = "p2os-recording"
RECORDING = VersionedFormat("a recording")
#: Spelling of `dir` → who spoke, and the unit of `t` in nanoseconds.
_DIRECTIONS: Mapping[str, tuple[Direction | None, int]] = {
    "c2r": (Direction.TO_ROBOT, 1),
    "r2c": (Direction.FROM_ROBOT, 1),
    "c2s": (Direction.TO_ROBOT, NS_PER_S),
    "s2c": (Direction.FROM_ROBOT, NS_PER_S),
    "event": (None, NS_PER_S),
}
#: chosen: eleven days; a larger number of seconds is a mistake of the unit.
LONGEST_NS: Nanos = 1_000_000 * NS_PER_S


def note_of(line: str) -> str:
    """Return the note in the first line of a recording of ours; empty where the line is none."""
    try:
        entry = json.loads(line)
    except (ValueError, RecursionError):
        return ""
    return str(entry.get("note", "")) if isinstance(entry, dict) and "format" in entry else ""


def chunk_words() -> tuple[bytes, bytes, bytes, bytes]:
    """Return what `chunk_line` writes before the time, the direction and the bytes, and behind them."""
    line = chunk_line(Chunk(at_ns=7, direction=Direction.FROM_ROBOT, data=b"\xfa")).rstrip("\n").encode("ascii")
    first, rest = line.split(b"7", 1)
    second, rest = rest.split(Direction.FROM_ROBOT.value.encode("ascii"), 1)
    third, fourth = rest.split(b"fa", 1)
    return first, second, third, fourth


def recorded_parts(lines: Iterable[str], first: int = 1) -> Iterator[Part]:
    """Yield what each line holds, one line read at a time.

    Args:
        lines: Of a recording.
        first: The number of the first of them.

    Raises:
        FileError: A line is no chunk; the message names it.
    """
    for number, line in enumerate(lines, first):
        if not line.strip():
            continue
        entry = _object(line, number)
        if "format" in entry:
            _check_header(entry, number)
            continue
        spelling = entry.get("dir")
        if not isinstance(spelling, str) or spelling not in _DIRECTIONS:
            raise FileError(f"line {number}: dir {spelling!r} is none of {', '.join(_DIRECTIONS)}")
        direction, unit_ns = _DIRECTIONS[spelling]
        data = _hex(entry.get("hex", ""), number)
        at_ns = _time(entry.get("t"), unit_ns, number)
        if direction is not None:
            yield at_ns, direction, data


def header_line(note: str = "") -> str:
    """Return the first line of a recording of ours."""
    return json.dumps({"format": FORMAT, "version": RECORDING.newest, "note": note}) + "\n"


def chunk_line(chunk: Chunk) -> str:
    """Return the line of a chunk in a recording of ours; a chunk without direction is the robot's."""
    direction = chunk.direction or Direction.FROM_ROBOT
    return json.dumps({"t": chunk.at_ns, "dir": direction.value, "hex": chunk.data.hex()}) + "\n"


def write_recording(capture: Capture) -> str:
    """Return a capture as a recording of ours."""
    return header_line(capture.note) + "".join(chunk_line(chunk) for chunk in capture.chunks)


def _object(line: str, number: int) -> Mapping[str, object]:
    try:
        entry = json.loads(line)
    except (json.JSONDecodeError, RecursionError) as error:
        raise FileError(
            f"line {number} is no JSON object", hint="was the file cut off? delete its last line"
        ) from error
    if not isinstance(entry, dict):
        raise FileError(f"line {number} is no JSON object")
    return entry


def _check_header(entry: Mapping[str, object], number: int) -> None:
    if entry["format"] != FORMAT:
        raise FileError(f"line {number}: a recording of the format {shown(entry['format'])}, expected {FORMAT}")
    RECORDING.version_of(entry.get("version"), f"line {number}")


def _hex(value: object, number: int) -> bytes:
    try:
        return bytes.fromhex(str(value))
    except ValueError as error:
        raise FileError(f"line {number}: hex {str(value)[:40]!r} is no hex text") from error


def _time(value: object, unit_ns: int, number: int) -> Nanos:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise FileError(f"line {number}: t {value!r} is no number")
    if not 0 <= value * unit_ns <= LONGEST_NS:
        raise FileError(f"line {number}: t {value!r} is not a time from the start")
    return round(value * unit_ns)
