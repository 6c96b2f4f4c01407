"""`p2os export`: a capture as a table or a log that other programs read."""

import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Annotated

import typer

from p2os.capture import Capture, ListingRow, Reading, read_file, rows_of
from p2os.capture.formats.arrow_files import write_arrow, write_parquet
from p2os.capture.formats.mcap_files import write_mcap
from p2os.capture.table import Table, from_robot, table_of, write_csv
from p2os.cli.captures.reading import ProfileForLayouts, RobotForUnits, reading_of
from p2os.cli.help_pages import CAPTURES
from p2os.cli.kept_files import FORCE_HELP, refuse_to_overwrite
from simbase.errors import FileError, UsageError

HELP = """Write a capture as CSV, Parquet, Arrow or MCAP.

The file's ending decides. Tables hold the robot's SIPs, one a line, with positions in metres that go on
where the robot's counters wrap; --only chooses other packets. MCAP holds every
packet, one channel a name, and opens in Foxglove.

\b
Examples:
  p2os export talk.jsonl talk.csv                    SIPs as CSV
  p2os export talk.jsonl - | head -3                 the same on stdout
  p2os export talk.jsonl talk.parquet                needs pyarrow
  p2os export talk.pcap talk.mcap                    needs mcap
  p2os export runs/dodge-001 vel.csv --only VEL,RVEL  what the client of a run sent
"""

#: chosen: some twenty minutes of SIPs; below, NumPy takes longer to load than the rows take to read.
LARGE_BYTES = 500_000


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("export", help=HELP, rich_help_panel=CAPTURES)(export)


def export(
    source: Annotated[Path, typer.Argument(help="Recording, JSON lines, pcap, or a run's folder.", metavar="SOURCE")],
    target: Annotated[Path, typer.Argument(help="File to write, or - for CSV on stdout.", metavar="TARGET")],
    only: Annotated[
        str, typer.Option("--only", help="Names of packets, comma-separated, or all.", metavar="NAMES")
    ] = "",
    robot: RobotForUnits = "",
    profile: ProfileForLayouts = None,
    force: Annotated[bool, typer.Option("--force", help=FORCE_HELP)] = False,
) -> None:
    """Write a capture in another format."""
    ending = ".csv" if str(target) == "-" else target.suffix.lower()
    if ending not in {*_TABLES, ".mcap"}:
        known = ", ".join(sorted({*_TABLES, ".mcap"}))
        raise UsageError(f"{target}: cannot tell the format from {ending or 'no ending'!r}", hint=f"use {known}")
    refuse_to_overwrite(target, force=force)
    capture = read_file(source)
    reading = reading_of(capture, robot=robot, profile=profile)
    rows = rows_of(capture, reading)
    try:
        if ending == ".mcap":
            count = write_mcap(_chosen(rows, only or "all"), target)
        else:
            table = None if only else _by_columns(capture, reading)
            if table is None:
                table = table_of(_chosen(rows, only), reading.parameters)
            count = table.rows
            if count:
                _TABLES[ending](table, target)
    except OSError as error:
        raise FileError(f"cannot write {target}: {(error.strerror or str(error)).lower()}") from error
    if not count:
        raise FileError(f"{source} holds no {only or 'SIP'}", hint="p2os decode shows what it holds; --only all")
    sys.stdout.flush()
    sys.stderr.write(f"{count} packets\n")


def _by_columns(capture: Capture, reading: Reading) -> Table | None:
    """Return a large capture's SIPs the fast way; the same cells, where NumPy is installed."""
    if sum(len(chunk.data) for chunk in capture.chunks) < LARGE_BYTES:
        return None
    try:
        from p2os.capture.columns.sip_table import sip_table
    except ImportError:
        return None
    return sip_table(capture, reading)


def _chosen(rows: Iterable[ListingRow], only: str) -> Iterable[ListingRow]:
    wanted = {name.strip().lower() for name in only.split(",") if name.strip()}
    if not wanted:
        return from_robot(rows)
    return (row for row in rows if "all" in wanted or row.name.lower() in wanted)


def _write_csv(table: Table, target: Path) -> None:
    if str(target) == "-":
        write_csv(table, sys.stdout)
        return
    with target.open("w", encoding="utf-8", newline="") as file:
        write_csv(table, file)


_TABLES: dict[str, Callable[[Table, Path], None]] = {
    ".csv": _write_csv,
    ".parquet": write_parquet,
    ".arrow": write_arrow,
    ".feather": write_arrow,
}
