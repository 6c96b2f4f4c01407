"""Columns as Arrow tables: numbers as they are, texts as binary, what varies in number as lists. Needs pyarrow."""

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np

from p2os.capture.cells import Cell
from p2os.capture.columns.column import Column as CellColumn
from p2os.capture.columns.framing import Bytes, Flags
from p2os.capture.columns.gathering import indexes_of, offsets_of
from p2os.capture.columns.table import Table
from p2os.capture.columns.walker import Column, Ragged, Spans
from simbase.errors import MissingDependencyError

#: pyarrow has no types of its own that a checker could read.
ArrowTable: TypeAlias = Any
ArrowArray: TypeAlias = Any


def to_arrow(table: Table) -> ArrowTable:
    """Return a table as `pyarrow.Table`, the number of each packet in the capture as its first column.

    Raises:
        MissingDependencyError: pyarrow is not installed.
    """
    try:
        import pyarrow as pa
    except ImportError as error:
        raise MissingDependencyError("Arrow tables need pyarrow", extra="export") from error
    found: dict[str, ArrowArray] = {"packet": numbers(table.packets)}
    found |= _arrays(table.data, table.columns, table.texts)
    for name, ragged in table.ragged.items():
        found[name] = pa.ListArray.from_arrays(numbers(ragged.offsets.astype(np.int32)), _items(table.data, ragged))
    return pa.table(found)


def numbers(values: Column, present: Flags | None = None) -> ArrowArray:
    """Return numbers, or truths, as an Arrow array, on their own bytes where they stand together.

    `pyarrow.array` would load pandas where that is installed, which takes longer than a large capture's packets do.

    Args:
        values: The cells; anything where one is absent.
        present: Which of them there are; None for all.
    """
    import pyarrow as pa

    kind = pa.from_numpy_dtype(values.dtype)
    cells = _bits(values) if values.dtype == np.bool_ else pa.py_buffer(np.ascontiguousarray(values))
    return pa.Array.from_buffers(kind, len(values), [_validity(present), cells])


def texts(sizes: Column, joined: bytes | Bytes, present: Flags | None = None, *, is_binary: bool = False) -> ArrowArray:
    """Return texts as an Arrow array.

    Args:
        sizes: How many bytes each has; 0 where one is absent.
        joined: The bytes of all, UTF-8 where they are not binary.
        present: Which of them there are; None for all.
        is_binary: Whether they are bytes and no texts.
    """
    import pyarrow as pa

    offsets = pa.py_buffer(offsets_of(sizes).astype(np.int32))
    buffers = [_validity(present), offsets, pa.py_buffer(joined)]
    return pa.Array.from_buffers(pa.binary() if is_binary else pa.string(), len(sizes), buffers)


def kind_of(column: Sequence[Cell]) -> str:
    """Return NumPy's letter for the kind that holds every cell of a column: text where they are of several kinds."""
    if isinstance(column, CellColumn):
        return column.kind
    kinds = frozenset(map(type, column)) - {type(None)}
    only = next(iter(kinds)) if len(kinds) == 1 else float if kinds == {int, float} else str
    return {bool: "b", int: "i", float: "f"}.get(only, "O")


def cells_array(column: Sequence[Cell], kind: str) -> Any:
    """Return a column's cells as an Arrow array, of the kind that a letter of NumPy's means."""
    cells = column if isinstance(column, CellColumn) else CellColumn.of(column, kind)
    return texts(*cells.encoded(), cells.present) if kind == "O" else numbers(cells.values, cells.present)


def _validity(present: Flags | None) -> ArrowArray:
    return None if present is None or present.all() else _bits(present)


def _bits(flags: Column) -> ArrowArray:
    import pyarrow as pa

    return pa.py_buffer(np.packbits(flags, bitorder="little"))


def _items(data: Bytes, ragged: Ragged) -> ArrowArray:
    import pyarrow as pa

    arrays = _arrays(data, ragged.columns, ragged.texts)
    if list(arrays) == ["value"]:
        return arrays["value"]
    return pa.StructArray.from_arrays(list(arrays.values()), list(arrays))


def _arrays(data: Bytes, columns: Mapping[str, Column], spans: Mapping[str, Spans]) -> dict[str, ArrowArray]:
    found = {name: numbers(column) for name, column in columns.items()}
    for name, places in spans.items():
        sizes = places.ends - places.starts
        found[name] = texts(sizes, data[indexes_of(places.starts, sizes)], is_binary=True)
    return found
