"""Tables as Apache Parquet and Arrow (Feather) files, written one table at a time; needs the extra `export`."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import IO, Any

from p2os.capture.cells import Cell
from p2os.capture.table import Table
from simbase.errors import MissingDependencyError

#: chosen: larger groups of rows are little faster and smaller in the file, and take more memory.
GROUP_ROWS = 1 << 15


def write_parquet(tables: Iterable[Table], path: Path) -> int:
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


def write_arrow(tables: Iterable[Table], path: Path) -> int:
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
    except ImportError as error:
        raise MissingDependencyError(
            f"{path.suffix} files need pyarrow", extra="export", hint="export to .csv"
        ) from error
    return pa


def _write(tables: Iterable[Table], path: Path, writer_of: Any) -> int:
    """Write tables; without any there is no file."""
    pa = _pyarrow(path)
    count, schema = 0, None
    every = iter(tables)
    first = next(every, None)
    if first is None:
        return 0
    schema = pa.schema([(name, _type(pa, column)) for name, column in first.columns.items()])
    with path.open("wb") as file, writer_of(file, schema, first.columns) as writer:
        group: list[Any] = []
        for table in chain([first], every):
            arrays = [
                _array(pa, column, field.type) for column, field in zip(table.columns.values(), schema, strict=True)
            ]
            group.append(pa.Table.from_arrays(arrays, schema=schema))
            count += table.rows
            if sum(part.num_rows for part in group) >= GROUP_ROWS:
                writer.write_table(pa.concat_tables(group))
                group.clear()
        if group:
            writer.write_table(pa.concat_tables(group))
    return count


def _type(pa: Any, column: Sequence[Cell]) -> Any:
    """Return the type that holds every cell of a column: text where they are of several kinds."""
    if (kind := _array_kind(column)) is not None:
        return {"b": pa.bool_(), "i": pa.int64(), "f": pa.float64()}.get(kind, pa.string())
    kinds = frozenset(map(type, column)) - {type(None)}
    known = {bool: pa.bool_(), int: pa.int64(), float: pa.float64()}
    only = next(iter(kinds)) if len(kinds) == 1 else float if kinds == {int, float} else str
    return known.get(only, pa.string())


def _array_kind(column: Sequence[Cell]) -> str | None:
    kind: str | None = getattr(column, "kind", None)
    return kind


def _array(pa: Any, column: Sequence[Cell], kind: Any) -> Any:
    if _array_kind(column) is None:
        if kind == pa.string():
            return pa.array([cell if cell is None or isinstance(cell, str) else str(cell) for cell in column], kind)
        return pa.array(column, kind)
    codes, present, conversion = column.codes, column.present, column.conversion  # type: ignore[attr-defined]  # a column of NumPy's
    mask = None if present is None else ~present
    if conversion is None:
        return pa.array(codes, kind, mask=mask)
    if kind == pa.string():
        return pa.array(conversion.values, kind).take(pa.array(codes, mask=mask))
    return pa.array(conversion.values.take(codes), kind, mask=mask)
