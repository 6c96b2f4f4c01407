"""Write frames of every kind for the tests of the page's decoder, with the rows that are in them.

Made by `p2os.view.frames`, so that both sides of the wire read the same bytes; a test holds the committed file to what
comes out here. Usage: python tools/generators/page_frames.py
"""

import base64
import json
from array import array
from pathlib import Path

from p2os.view.channels import KINDS, CellType, ChannelKind
from p2os.view.frames import ColumnValues, FrameFlags, ViewFrame
from simbase.timing import NS_PER_S

TARGET = Path(__file__).resolve().parents[1] / "page" / "test" / "frames.json"
#: Before the start, at it, where 32 bits end, and after three months: the page has times as doubles.
TIMES = (-5, 0, 2**32 - 1, 2**32, 90 * 86400 * NS_PER_S + 1)
TEXTS = ("", "plain", "<script>alert(1)</script>", "µs ↔ 中文 🤖", "plain")
RUNS = (b"", b"\xfa\xfb\x03\x00\x00\x00", bytes(range(9)), b"\xff" * 8, b"")
WIDTH = 3
_CODES = {CellType.F64: "d", CellType.F32: "f", CellType.U32: "I", CellType.U8: "B"}


def text() -> str:
    """Return the whole file."""
    frames = [frame_of(kind, channel) for channel, kind in enumerate(KINDS)]
    empty = [ViewFrame(kind=kind, channel=channel, columns=tuple(values[:0] for values in frame.columns), from_ns=0,
                       to_ns=0, of=0, width=frame.width, flags=FrameFlags.REPLACES)
             for channel, (kind, frame) in enumerate(zip(KINDS, frames, strict=True))]  # fmt: skip
    rows = [_as_json(frame) for frame in (*frames, *empty)]
    data = b"".join(frame.to_bytes() for frame in (*frames, *empty))
    return json.dumps({"frames": rows, "data": base64.b64encode(data).decode()}, indent=1) + "\n"


def frame_of(kind: ChannelKind, channel: int) -> ViewFrame:
    """Return five rows of a kind, the same ones every time."""
    width = WIDTH if any(column.is_wide for column in kind.columns) else 1
    return ViewFrame(
        kind=kind, channel=channel, width=width, from_ns=TIMES[0], to_ns=TIMES[-1], of=len(TIMES) + channel,
        flags=FrameFlags.REDUCED if channel % 2 else FrameFlags.REPLACES,
        columns=tuple(_values(column.cells, width if column.is_wide else 1) for column in kind.columns),
    )  # fmt: skip


def _values(cells: CellType, width: int) -> ColumnValues:
    if cells is CellType.I64:
        return array("q", TIMES)
    if cells is CellType.TEXT:
        return list(TEXTS)
    if cells is CellType.BYTES:
        return list(RUNS)
    numbers = (
        [0, 1, 255, float("nan"), -2.5][: len(TIMES)] if cells in {CellType.F64, CellType.F32} else [0, 1, 2, 200, 255]
    )
    return array(_CODES[cells], [number for number in numbers for _ in range(width)])


def _as_json(frame: ViewFrame) -> dict[str, object]:
    columns = {
        column.name: [_plain(value) for value in values]
        for column, values in zip(frame.kind.columns, frame.columns, strict=True)
    }
    return {
        "kind": frame.kind.name, "channel": frame.channel, "count": frame.count, "of": frame.of, "width": frame.width,
        "from": frame.from_ns, "to": frame.to_ns, "isReduced": FrameFlags.REDUCED in frame.flags,
        "replaces": FrameFlags.REPLACES in frame.flags, "columns": columns,
    }  # fmt: skip


def _plain(value: float | str | bytes) -> float | str | None:
    if isinstance(value, bytes):
        return value.hex()
    return None if value != value else value  # noqa: PLR0124  # NaN is no JSON


if __name__ == "__main__":
    TARGET.write_text(text(), encoding="utf-8")
