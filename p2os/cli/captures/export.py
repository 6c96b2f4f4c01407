"""`p2os export`: a capture as a table or a log that other programs read."""

import sys
from collections.abc import Callable, Iterable, Iterator
from itertools import chain
from pathlib import Path
from typing import Annotated

import typer

from p2os.capture import CaptureSource, ListingRow, Reading, open_file, rows_of
from p2os.capture.chunks import ChunkBlock, chunks_of
from p2os.capture.formats.arrow_files import write_arrow, write_parquet
from p2os.capture.formats.mcap_files import write_mcap
from p2os.capture.sips import sips_of
from p2os.capture.table import CaptureTable, tables_of, tables_of_sips, write_csv
from p2os.cli.captures.reading import ProfileForLayouts, RobotForUnits, chosen_rows, reading_of, wanted_names
from p2os.cli.groups import CAPTURES
from p2os.cli.kept_files import FORCE_HELP, refuse_to_overwrite
from simbase.errors import FileError, UsageError
from simbase.files import open_to_write_text, writing

HELP = """Export a capture as CSV, Parquet, Arrow or MCAP.

The file's ending selects the format. Tables have one SIP per line, with
positions in metres that continue where counters wrap; --only selects other
packets. MCAP has one channel per packet name and opens in Foxglove.

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
    capture = open_file(source)
    reading, blocks = reading_of(capture.blocks, robot=robot, profile=profile)
    with writing(target):
        if ending == ".mcap":
            count = write_mcap(_chosen(blocks, reading, only or "all"), target)
        else:
            count = _TABLES[ending](_tables(capture, blocks, reading, only), target)
    if not count:
        raise FileError(f"{source} holds no {only or 'SIP'}", hint="p2os decode shows what it holds; --only all")
    sys.stdout.flush()
    sys.stderr.write(f"{count} packets\n")


def _tables(
    capture: CaptureSource, blocks: Iterator[ChunkBlock], reading: Reading, only: str
) -> Iterator[CaptureTable]:
    """Return what was chosen as tables; a large capture's SIPs the fast way, where NumPy is installed."""
    seen: list[ChunkBlock] = []
    if not only and capture.has_one_origin:
        size = 0
        for block in blocks:
            seen.append(block)
            size += len(block.data)
            if size >= LARGE_BYTES:
                break
        blocks = chain(seen, blocks)
        if size >= LARGE_BYTES:
            try:
                from p2os.capture.columns.sip_table import sip_tables
            except ImportError:
                pass
            else:
                return sip_tables(blocks, reading)
    if not wanted_names(only):
        return tables_of_sips(sips_of(blocks, reading), reading)
    return tables_of(_chosen(blocks, reading, only), reading)


def _chosen(blocks: Iterable[ChunkBlock], reading: Reading, only: str) -> Iterable[ListingRow]:
    wanted = wanted_names(only)
    if "all" in wanted:
        return rows_of(chunks_of(blocks), reading)
    return chosen_rows(blocks, reading, wanted - {"damaged"})


def _write_csv(tables: Iterator[CaptureTable], target: Path) -> int:
    if str(target) == "-":
        return write_csv(tables, sys.stdout)
    first = next(tables, None)
    if first is None:
        return 0
    with open_to_write_text(target, newline="") as file:
        return write_csv(chain([first], tables), file)


_TABLES: dict[str, Callable[[Iterator[CaptureTable], Path], int]] = {
    ".csv": _write_csv,
    ".parquet": write_parquet,
    ".arrow": write_arrow,
    ".feather": write_arrow,
}
