"""Reads the CSV that Saleae's Logic exports: seconds, then a level of each channel, a row for each change.

Logic 2 writes `Time [s],Channel 0,…`, Logic 1 `Time[s], Channel 0, …`; times count from the trigger, so that those
before it are negative. The rate is not in the file.

Source: support.saleae.com, "Exporting digital data", and files of both versions.
"""

import csv
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NoReturn

from bluepill_sim.analysis.waveforms.levels import CaptureError, LevelEdge, Waveforms, signal_of
from simbase.files import lines_of

_TIME = re.compile(r"time\s*\[s\]", re.IGNORECASE)
_HINT = "Saleae's Export Raw Data: CSV, digital, times in seconds (no ISO 8601)"


def read_saleae(path: Path) -> Waveforms:
    """Read an export.

    Raises:
        CaptureError: It cannot be read, or is damaged; the message names the line.
    """
    rows = csv.reader(lines_of(path, CaptureError, hint=_HINT))
    try:
        head, columns, start, end = _read(rows, path)
    except csv.Error as error:
        raise CaptureError(f"{path}:{rows.line_num}: {error}", hint=_HINT) from error
    if math.isnan(start):
        raise CaptureError(f"{path}: no rows", hint=_HINT)
    signals = {name: signal_of(column, end) for name, column in zip(head[1:], columns, strict=True)}
    return Waveforms(name=path.name, signals=signals, start_ns=start, end_ns=end, sample_ns=1.0, rate_from="")


def _read(rows: Iterator[list[str]], path: Path) -> tuple[list[str], list[list[LevelEdge]], float, float]:
    """Return the head, the changes of each channel, and the first and the last time."""
    head = [cell.strip() for cell in next(rows, [])]
    if len(head) < 2 or not _TIME.fullmatch(head[0]) or len(set(head)) < len(head):
        _refuse(path, 1, "no head of the kind Time [s],Channel 0,…")
    columns: list[list[LevelEdge]] = [[] for _ in head[1:]]
    start = end = math.nan
    for number, at_ns, levels in _rows(rows, len(head), path):
        if at_ns < end:
            _refuse(path, number, "an earlier time than the row before")
        start, end = (at_ns if math.isnan(start) else start), at_ns
        for column, level in zip(columns, levels, strict=True):
            if not column or column[-1][1] != level:
                column.append((at_ns, level))
    return head, columns, start, end


def _rows(rows: Iterator[list[str]], width: int, path: Path) -> Iterator[tuple[int, float, list[int]]]:
    for number, row in enumerate(rows, start=2):
        if not row:
            continue
        try:
            at_ns, levels = float(row[0]) * 1e9, [int(cell) for cell in row[1:]]
        except ValueError:
            at_ns, levels = math.nan, []
        if len(row) != width or not math.isfinite(at_ns) or not {*levels} <= {0, 1}:
            _refuse(path, number, f"no time with {width - 1} levels")
        yield number, at_ns, levels


def _refuse(path: Path, number: int, what: str) -> NoReturn:
    raise CaptureError(f"{path}:{number}: {what}", hint=_HINT)
