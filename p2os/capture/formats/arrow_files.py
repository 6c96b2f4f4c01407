"""Tables as Apache Parquet and Arrow (Feather) files, written one table at a time; needs the extra `export`."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import IO, Any

from p2os.capture.cells import Cell
from p2os.capture.table import CaptureTable
from simbase.errors import MissingDependencyError
from simbase.files import open_to_write

#: chosen: larger groups of rows are little faster and smaller in the file, and take more memory.
GROUP_ROWS = 1 << 16


def write_parquet(tables: Iterable[CaptureTable], path: Path) -> int:
    """Write tables as a Parquet file; return how many rows.

    Raises:
        MissingDependencyError: pyarrow is not installed.
        OSError: The file cannot be written.
    """
    _pyarrow(path)
    from pyarrow import parquet

    def writer_of(file: IO[bytes], schema: Any, columns: Mapping[str, Sequence[Cell]]) -> Any:
        # Times and positions hardly occur twice: looking for those that do takes longer and saves nothing.
        few = [name for name, column in columns.items() if getattr(column, "conversion", True) is not None]
        return parquet.ParquetWriter(file, schema, use_dictionary=few)

    return _write(tables, path, writer_of)


def write_arrow(tables: Iterable[CaptureTable], path: Path) -> int:
    """Write tables as an Arrow IPC file (also known as Feather 2); return how many rows.

    Raises:
        MissingDependencyError: pyarrow is not installed.
        OSError: The file cannot be written.
    """
    _pyarrow(path)
    from pyarrow import ipc

    return _write(tables, path, lambda file, schema, _: ipc.new_file(file, schema))


def _pyarrow(path: Path) -> Any:
    try:
        import pyarrow as pa

        import p2os.capture.columns.arrow  # noqa: F401  # with NumPy
    except ImportError as error:
        raise MissingDependencyError(
            f"{path.suffix} files need pyarrow", extra="export", hint="export to .csv"
        ) from error
    return pa


def _write(tables: Iterable[CaptureTable], path: Path, writer_of: Any) -> int:
    """Write tables; without any there is no file."""
    pa = _pyarrow(path)
    from p2os.capture.columns.arrow import cells_array, kind_of

    count = 0
    every = iter(tables)
    first = next(every, None)
    if first is None:
        return 0
    kinds = [kind_of(column) for column in first.columns.values()]
    types = {"b": pa.bool_(), "i": pa.int64(), "f": pa.float64(), "O": pa.string()}
    schema = pa.schema([(name, types[kind]) for name, kind in zip(first.columns, kinds, strict=True)])
    with open_to_write(path) as file, writer_of(file, schema, first.columns) as writer:
        group: list[Any] = []
        for table in chain([first], every):
            arrays = [cells_array(*both) for both in zip(table.columns.values(), kinds, strict=True)]
            group.append(pa.Table.from_arrays(arrays, schema=schema))
            count += table.rows
            if sum(part.num_rows for part in group) >= GROUP_ROWS:
                writer.write_table(pa.concat_tables(group))
                group.clear()
        if group:
            writer.write_table(pa.concat_tables(group))
    return count
