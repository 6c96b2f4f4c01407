"""`p2os decode`: bytes of any origin, as readable lines, as JSON, or byte by byte."""

import json
import sys
from collections.abc import Iterator
from typing import Annotated

import typer

from p2os.capture import FollowedReading, ListingRow, Reading, explain, open_argument, open_capture, rows_of
from p2os.capture.chunks import ChunkBlock, chunks_of
from p2os.capture.explain import lines_of
from p2os.capture.listing import line_of, summary_of
from p2os.cli.captures.reading import (
    ProfileForLayouts,
    RobotForUnits,
    chosen_rows,
    direction_of,
    reading_of,
    wanted_names,
)
from p2os.cli.groups import CAPTURES
from simbase.errors import UsageError
from simbase.timing import NS_PER_S, Nanos

HELP = """Decode P2OS packets from a file, hex text or stdin.

SOURCE is a file, a run folder, hex text, or - for stdin. Files may be p2os
recordings, JSON lines of other programs, pcap or pcapng, hex text (also xxd and
hexdump -C), or raw bytes.

\b
Examples:
  p2os decode fa fb 06 0b 3b c8 00 d3 3b          one line: VEL 200
  p2os decode --explain fafb03000000              every byte in words
  p2os decode session.jsonl                       a recording, one line a packet
  p2os decode trace.pcap --json | jq .name        one JSON object a packet
  p2os decode dump.bin --dir r2c --robot p3dx --profile ARCOS
  p2os decode session.jsonl --only damaged        what was wrong on the line

> goes to the robot, < comes from it, !! is damaged. The exit code is 0 also when
frames are damaged: that is a result.
"""


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("decode", help=HELP, rich_help_panel=CAPTURES)(decode)


def decode(
    source: Annotated[list[str], typer.Argument(help="File, folder, hex text, or - for stdin.", metavar="SOURCE")],
    json_output: Annotated[bool, typer.Option("--json", help="Print one JSON object a packet.")] = False,
    explained: Annotated[bool, typer.Option("--explain", help="Show what every byte means.")] = False,
    only: Annotated[
        str, typer.Option("--only", help="Names to show, comma-separated, such as SIP,VEL or damaged.", metavar="NAMES")
    ] = "",
    direction: Annotated[
        str, typer.Option("--dir", help="Who sent bytes of unknown origin: client or robot.", metavar="auto|c2r|r2c")
    ] = "auto",
    robot: RobotForUnits = "",
    profile: ProfileForLayouts = None,
) -> None:
    """Print what stands in a capture."""
    if json_output and explained:
        raise UsageError("--json and --explain exclude each other", hint="--json already holds every field")
    sent_by = direction_of(direction)
    is_live = source == ["-"]
    capture = open_capture(sys.stdin.buffer, sent_by) if is_live else open_argument(source, sent_by)
    blocks = capture.blocks
    reading: Reading | FollowedReading
    if is_live:  # its beginning may be all that comes for hours
        reading = FollowedReading(robot, profile)
    else:
        reading, blocks = reading_of(blocks, robot=robot, profile=profile)
    wanted = wanted_names(only)
    shown = damaged = 0
    end = _End()
    watched = end.watched(blocks)
    for row in chosen_rows(watched, reading, wanted) if wanted else rows_of(chunks_of(watched), reading):
        by = reading.reading if isinstance(reading, FollowedReading) else reading
        for line in _lines(row, by, has_time=capture.has_time, as_json=json_output, explained=explained):
            sys.stdout.write(f"{line}\n")
        if is_live or not shown:
            sys.stdout.flush()
        shown += 1
        damaged += not row.valid
    if not json_output:
        sys.stdout.flush()
        sys.stderr.write(f"{summary_of(shown, damaged, end.at_ns / NS_PER_S)}\n")


class _End:
    """When the last of what was read had come."""

    def __init__(self) -> None:
        self.at_ns: Nanos = 0

    def watched(self, blocks: Iterator[ChunkBlock]) -> Iterator[ChunkBlock]:
        """Yield the same blocks."""
        for block in blocks:
            self.at_ns = block.at_ns[-1]
            yield block


def _lines(row: ListingRow, reading: Reading, *, has_time: bool, as_json: bool, explained: bool) -> Iterator[str]:
    if as_json:
        yield json.dumps(row.as_plain())
        return
    yield line_of(row, has_time=has_time)
    if explained:
        yield from lines_of(explain(row, reading))
