"""`p2os mcu info`: what a firmware is, and what it touches that is not modelled."""

import json
from typing import Annotated

import typer

from bluepill_sim.analysis.columns import in_columns
from bluepill_sim.board import BluePill
from bluepill_sim.cli.driving import run_driven
from bluepill_sim.cli.quantities import Firmware, JsonOutput, time_option
from bluepill_sim.program.elf_file import MemoryLayout, layout, stack_top, variables_end, vectors
from bluepill_sim.program.image import Image
from bluepill_sim.stm32f103 import FLASH_BYTES, SRAM_BYTES
from simbase.timing import NS_PER_S, Nanos

HELP = """Show a firmware's properties, and its use of unmodelled hardware.

It shows sections, sizes, vectors, largest symbols and stack, and runs the
firmware briefly.

\b
Examples:
  {program} info mine.elf             all of it
  {program} info mine.elf --for 10s   run longer, to find more unmodelled use
  {program} info mine.elf --json      one JSON object
"""

#: chosen: how many of the largest symbols a person wants to see.
_SHOWN_SYMBOLS = 12


def info(
    firmware: Firmware,
    span_ns: Annotated[
        Nanos, time_option("--for", purpose="How long it is run; 0: not at all.", shown="500ms")
    ] = NS_PER_S // 2,
    json_output: JsonOutput = False,
) -> None:
    """Show what a firmware is."""
    board = BluePill(firmware)
    board.chip.pins.is_serial_input = lambda _pin: True  # nothing is wired here: no wire is missing
    run_driven(board, span_ns, ())
    found = facts(board)
    if json_output:
        typer.echo(json.dumps(found, sort_keys=True))
        return
    _print(board, found)


def facts(board: BluePill) -> dict[str, object]:
    """Return everything that `info` shows, as plain values."""
    image = board.image
    lies = layout(image)
    symbols = sorted((s for s in image.symbols.symbols if s.size), key=lambda s: (-s.size, s.address))
    return {
        "file": image.name,
        "sha256": image.sha256,
        "flash_bytes": lies.flash_bytes,
        "sram_bytes": lies.sram_bytes,
        "stack_top": stack_top(image),
        "stack_room_bytes": stack_top(image) - variables_end(image),
        "vector_table": image.vector_table,
        "sections": [{"name": s.name, "address": s.address, "bytes": s.size} for s in lies.sections],
        "vectors": [
            {"number": v.number, "name": v.name, "target": v.target, "handler": _handler(image, v.target)}
            for v in vectors(image)
        ],
        "symbols": [{"name": s.name, "address": s.address, "bytes": s.size} for s in symbols],
        "ran_s": board.now_ns / NS_PER_S,
        "warnings": board.warnings,
        "fault": None if board.fault is None else str(board.fault),
        "has_died": board.has_died,
        "resets": {cause.name: count for cause, count in board.resets.items()},
    }


def _print(board: BluePill, found: dict[str, object]) -> None:
    image = board.image
    lies = layout(image)
    typer.echo(f"{image.name}  sha256 {image.sha256[:16]}…")
    typer.echo(f"flash  {lies.flash_bytes} of {FLASH_BYTES} bytes ({lies.flash_share:.1%})")
    typer.echo(
        f"SRAM   {lies.sram_bytes} of {SRAM_BYTES} bytes in variables ({lies.sram_share:.1%}); stack from "
        f"{stack_top(image):#010x} down, room for {found['stack_room_bytes']} bytes\n"
    )
    _print_sections(lies)
    _print_vectors(image)
    sized = sorted((s for s in image.symbols.symbols if s.size), key=lambda s: (-s.size, s.address))
    if sized:
        rows = [(s.name, str(s.size), f"{s.address:#010x}") for s in sized[:_SHOWN_SYMBOLS]]
        typer.echo("\n".join(in_columns(("largest symbols", "bytes", "address"), rows, right=(1,))))
        typer.echo("")
    ran = f"in {board.now_ns / NS_PER_S:g} s of virtual time"
    if board.has_died:
        typer.echo(f"it dies {ran}: {board.fault or board.reset_row}")
    elif board.verdict:
        typer.echo(f"{ran}: {board.verdict}")
    for warning in board.warnings:
        typer.echo(f"not modelled, or odd: {warning}")
    if not board.warnings and board.fault is None:
        typer.echo(f"nothing unmodelled was touched {ran}")


def _print_sections(lies: MemoryLayout) -> None:
    rows = [
        (
            s.name,
            f"{s.address:#010x}",
            str(s.size),
            " and ".join(name for name, there in (("flash", s.in_flash), ("SRAM", s.in_sram)) if there),
        )
        for s in lies.sections
    ]
    if rows:
        typer.echo("\n".join(in_columns(("section", "address", "bytes", "in"), rows, right=(2,))))
        typer.echo("")


def _print_vectors(image: Image) -> None:
    ordinary = _default_handler(image)
    rows = [
        (str(v.number), v.name, f"{v.target:#010x}", _handler(image, v.target))
        for v in vectors(image)
        if v.target != ordinary
    ]
    typer.echo("\n".join(in_columns(("exception", "", "address", "handler"), rows, right=(0,))))
    if ordinary is not None:
        others = [v.name for v in vectors(image) if v.target == ordinary]
        typer.echo(f"the other {len(others)} share {_handler(image, ordinary)} at {ordinary:#010x}")
    typer.echo("")


def _handler(image: Image, target: int) -> str:
    return image.symbols.where(target).split("+")[0].split(" ")[0]


def _default_handler(image: Image) -> int | None:
    """Return the handler that most vectors share, if at least four do."""
    targets = [vector.target for vector in vectors(image)]
    most = max(targets, key=targets.count, default=None)
    return most if most is not None and targets.count(most) >= 4 else None
