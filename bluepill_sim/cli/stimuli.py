"""Files that `p2os mcu run` writes what comes out of the ITM to: --itm and --swo."""

from pathlib import Path

from bluepill_sim.board import BluePill
from bluepill_sim.debug.itm import PacketWriter, StimulusWriter, TextWriter
from simbase.files import open_to_write, open_to_write_text


def open_traces(board: BluePill, text: Path | None, packets: Path | None) -> list[StimulusWriter]:
    """Open the files that are wanted and connect them; with any of them the trace is on from the start.

    Raises:
        FileError: One cannot be written.
    """
    writers: list[StimulusWriter] = []
    if text is not None:
        writers.append(TextWriter(open_to_write_text(text)))
    if packets is not None:
        writers.append(PacketWriter(open_to_write(packets)))
    if writers:
        board.chip.system.enable_trace()
        board.chip.system.stimulus_sinks += [writer.write for writer in writers]
    return writers
