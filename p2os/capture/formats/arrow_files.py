"""Tables as Apache Parquet and Arrow (Feather) files; needs the extra `export`."""

from pathlib import Path
from typing import Any

from p2os.capture.table import Table
from simbase.errors import MissingDependencyError


def write_parquet(table: Table, path: Path) -> None:
    """Write a table as a Parquet file.

    Raises:
        MissingDependencyError: pyarrow is not installed.
        OSError: The file cannot be written.
    """
    columns = _columns(table, path)
    from pyarrow import parquet

    parquet.write_table(columns, path)


def write_arrow(table: Table, path: Path) -> None:
    """Write a table as an Arrow IPC file (also known as Feather 2).

    Raises:
        MissingDependencyError: pyarrow is not installed.
        OSError: The file cannot be written.
    """
    columns = _columns(table, path)
    from pyarrow import ipc

    with path.open("wb") as file, ipc.new_file(file, columns.schema) as writer:
        writer.write_table(columns)


def _columns(table: Table, path: Path) -> Any:
    """Return a table as pyarrow's."""
    try:
        import pyarrow as pa
    except ImportError as error:
        raise MissingDependencyError(
            f"{path.suffix} files need pyarrow", extra="export", hint="export to .csv"
        ) from error
    return pa.table(dict(table.columns))
