"""How the verbs that show captures choose units and layout: `--robot`, `--profile`, `--dir`.

Left open, both are found in the capture itself (`p2os.capture.reading`): in the beginning of what is read as a whole,
and as it comes in what is shown while it comes.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import chain
from typing import Annotated

import typer

from p2os.capture import Direction, FollowedReading, ListingRow, Reading, rows_of
from p2os.capture.chunks import ChunkBlock, chunks_of
from p2os.capture.listing import FrameCutter
from p2os.cli.names import robots
from p2os.protocol.profiles import Profile
from simbase.errors import UsageError

RobotForUnits = Annotated[
    str,
    typer.Option(
        "--robot", help="Robot model, or a TOML file, for units; default: by the capture, else p2dx.",
        metavar="MODEL|FILE", autocompletion=robots, show_default=False,
    ),
]  # fmt: skip
FAMILIES = "|".join(profile.value for profile in Profile)
ProfileForLayouts = Annotated[
    Profile | None,
    typer.Option("--profile", help="Firmware family, for layouts; default: as the packets look.", metavar=FAMILIES),
]
#: chosen: some two minutes of SIPs; a robot says who it is before the first.
LOOKED_AT_BYTES = 1 << 16


def direction_of(text: str) -> Direction | None:
    """Return the direction that `--dir` names, None for auto.

    Raises:
        UsageError: It names something else.
    """
    if text == "auto":
        return None
    try:
        return Direction(text)
    except ValueError as error:
        raise UsageError(f"--dir {text!r} is none of auto, c2r, r2c", hint="c2r: sent by the client") from error


def reading_of(
    source: Iterable[ChunkBlock], *, robot: str = "", profile: Profile | None = None
) -> tuple[Reading, Iterator[ChunkBlock]]:
    """Return how to read a capture, and its blocks, of which no more than the beginning was read.

    What is read while it comes is not to wait for a beginning: `FollowedReading`.

    Args:
        source: What is to be read.
        robot: Model or file; empty to look into the capture.
        profile: Firmware family; None to look into the capture.

    Raises:
        ParametersError: There is no such model or file.
    """
    blocks, seen = iter(source), list[ChunkBlock]()
    followed, size, cutter = FollowedReading(robot, profile), 0, FrameCutter()
    given = bool(robot) and profile is not None
    for chunk in () if given else chunks_of(_noted(blocks, seen)):
        size += len(chunk.data)
        for piece in cutter.take(replace(chunk, data=chunk.data[:LOOKED_AT_BYTES])):
            if piece.direction is not Direction.TO_ROBOT and piece.frame is not None and not followed.is_settled:
                followed.take(piece.frame.payload)
        if followed.is_settled or size > LOOKED_AT_BYTES:
            break
    return followed.reading, chain(seen, blocks)


def wanted_names(only: str) -> set[str]:
    """Return the names that `--only` lists, in lower case; none stands for the verb's own choice."""
    return {name.strip().lower() for name in only.split(",") if name.strip()}


def chosen_rows(
    blocks: Iterable[ChunkBlock], reading: Reading | FollowedReading, wanted: set[str]
) -> Iterator[ListingRow]:
    """Yield the rows of these names (`damaged`: of what is no sound frame); the rest costs little with NumPy."""
    try:
        from p2os.capture.columns.passing import rows_passing
    except ImportError:
        rows = rows_of(chunks_of(blocks), reading)
    else:
        rows = rows_passing(blocks, reading, wanted)
    for row in rows:
        if row.name.lower() in wanted or ("damaged" in wanted and not row.valid):
            yield row


def _noted(blocks: Iterator[ChunkBlock], seen: list[ChunkBlock]) -> Iterator[ChunkBlock]:
    for block in blocks:
        seen.append(block)
        yield block
