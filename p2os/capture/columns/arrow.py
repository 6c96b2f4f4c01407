"""Columns as Arrow tables: numbers as they are, texts as binary, what varies in number as lists. Needs pyarrow."""

from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np

from p2os.capture.columns.framing import Bytes
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
    found: dict[str, ArrowArray] = {"packet": pa.array(table.packets)}
    found |= _arrays(table.data, table.columns, table.texts)
    for name, ragged in table.ragged.items():
        found[name] = pa.ListArray.from_arrays(ragged.offsets.astype(np.int32), _items(table.data, ragged))
    return pa.table(found)


def _items(data: Bytes, ragged: Ragged) -> ArrowArray:
    import pyarrow as pa

    arrays = _arrays(data, ragged.columns, ragged.texts)
    if list(arrays) == ["value"]:
        return arrays["value"]
    return pa.StructArray.from_arrays(list(arrays.values()), list(arrays))


def _arrays(data: Bytes, columns: Mapping[str, Column], texts: Mapping[str, Spans]) -> dict[str, ArrowArray]:
    import pyarrow as pa

    found = {name: pa.array(np.ascontiguousarray(column)) for name, column in columns.items()}
    for name, spans in texts.items():
        sizes = spans.ends - spans.starts
        offsets = np.concatenate(([0], np.cumsum(sizes))).astype(np.int32)
        joined = data[np.repeat(spans.starts - offsets[:-1], sizes) + np.arange(offsets[-1])]
        buffers = [None, pa.py_buffer(offsets), pa.py_buffer(joined)]
        found[name] = pa.Array.from_buffers(pa.binary(), len(sizes), buffers)
    return found
