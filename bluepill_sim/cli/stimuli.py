"""Files that `p2os mcu run` writes what comes out of the ITM to: --itm and --swo."""

from pathlib import Path

from bluepill_sim.board import BluePill
from bluepill_sim.debug.itm import PacketWriter, StimulusWriter, TextWriter
from bluepill_sim.errors import BluePillError


def open_traces(board: BluePill, text: Path | None, packets: Path | None) -> list[StimulusWriter]:
    """Open the files that are wanted and connect them; with any of them the trace is on from the start.

    Raises:
        BluePillError: One cannot be written.
    """
    try:
        writers: list[StimulusWriter] = [] if text is None else [TextWriter(text.open("w", encoding="utf-8"))]
        if packets is not None:
            writers.append(PacketWriter(packets.open("wb")))
    except OSError as error:
        raise BluePillError(
            f"cannot write {error.filename}: {error.strerror}", hint="give a file in a folder that exists"
        ) from error
    if writers:
        board.chip.system.enable_trace()
        board.chip.system.stimulus_sinks += [writer.write for writer in writers]
    return writers
