"""The program's variables that a run was asked to record: `variables.jsonl` beside its trace.

The trace and its hash do not know of them: they are the same whatever was looked at. The first line names the
variables; each other one has rows of one of them: `n` is its place, `t` are ns, `v` values, null where one is no
number.

Invariant: reading never fails on a file that ends early: it ends with its last whole line.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from types import TracebackType
from typing import Self, cast

from bluepill_sim.program.variables import Variable
from robot_bench.events.codec import LAST_NS, Json, TraceError, damaged, entries_of
from robot_bench.recording.run_folder import VARIABLES_NAME
from simbase.files import lines_of, open_to_write_text
from simbase.timing import Nanos

VERSION = 1
#: chosen: rows of a line; what a run that is cut loses of each variable.
MOST_ROWS = 500


@dataclass(slots=True, kw_only=True)
class VariableRecord:
    """What a variable was, over time: it holds until the next row."""

    name: str
    #: As the program has it.
    type_name: str
    times: list[Nanos] = field(default_factory=list)
    values: list[float] = field(default_factory=list)


class VariableWriter:
    """Writes the file; a context manager.

    Args:
        folder: The run's.
        variables: What is recorded.

    Raises:
        FileError: It cannot be written.
    """

    def __init__(self, folder: Path, variables: Sequence[Variable]) -> None:
        self._places = {one.name: place for place, one in enumerate(variables)}
        self._rows: list[tuple[list[Nanos], list[float | None]]] = [([], []) for _ in variables]
        self._last = [-1] * len(variables)
        self._file = open_to_write_text(folder / VARIABLES_NAME)
        named = [{"name": one.name, "type": one.type_name} for one in variables]
        self._write({"v": VERSION, "variables": named})

    def take(self, at: Nanos, _is_anew: bool, changes: Sequence[tuple[str, float]]) -> None:
        """Add what a sampler saw; what is not later than the last row is known: a run that was set back comes again."""
        for name, value in changes:
            place = self._places[name]
            if at <= self._last[place]:
                continue
            self._last[place] = at
            times, values = self._rows[place]
            times.append(at)
            values.append(value if math.isfinite(value) else None)
            if len(times) >= MOST_ROWS:
                self._flush(place)

    def _flush(self, place: int) -> None:
        times, values = self._rows[place]
        if times:
            self._write({"n": place, "t": times, "v": values})
            self._rows[place] = [], []

    def _write(self, entry: Json) -> None:
        self._file.write(f"{json.dumps(entry, separators=(',', ':'), allow_nan=False)}\n")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:  # fmt: skip
        try:
            for place in range(len(self._rows)):
                self._flush(place)
        finally:
            self._file.close()


def read_variables(folder: Path) -> list[VariableRecord]:
    """Return what a run folder has of variables; none where none were recorded.

    Raises:
        TraceError: The file is damaged, or of a later version.
    """
    path = folder / VARIABLES_NAME
    if not path.is_file():
        return []
    found: list[VariableRecord] = []
    for number, entry in enumerate(entries_of(lines_of(path, TraceError)), start=1):
        try:
            if number == 1:
                if entry["v"] != VERSION:
                    raise TraceError(f"{path}: variables as a later version writes them", hint="install a newer p2os")
                named = cast("list[dict[str, object]]", entry["variables"])
                found = [VariableRecord(name=str(one["name"]), type_name=str(one["type"])) for one in named]
            else:
                _take(found, entry)
        except (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError) as error:
            raise damaged(str(path), number) from error
    return found


def _take(found: list[VariableRecord], entry: Json) -> None:
    place, times, values = entry["n"], cast("list[int]", entry["t"]), cast("list[float | None]", entry["v"])
    if not isinstance(times, list) or not isinstance(values, list):
        raise ValueError("no rows")  # noqa: TRY004 - a damaged line, as any other
    if type(place) is not int or not 0 <= place < len(found) or len(times) != len(values):
        raise ValueError("no rows of a variable")
    if not all(type(t) is int and 0 <= t <= LAST_NS for t in times):
        raise ValueError("at no time of a run")
    record = found[place]
    if any(later <= t for t, later in pairwise([*record.times[-1:], *times])):
        raise ValueError("a time that runs back")
    record.times += times
    record.values += [math.nan if value is None else float(value) for value in values]
