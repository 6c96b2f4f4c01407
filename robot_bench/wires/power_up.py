"""An emulated BluePill as a run has it at power-on: what its memory holds then, and how fast its crystal is.

Invariant: a run and the replay of its chip are powered up alike, the second by what the trace tells.
"""

import random
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bluepill_sim.board import BluePill
    from bluepill_sim.program.image import Image

#: What `sram` may say.
ZEROS, RANDOM_SRAM = "zeros", "random"


def power_up(
    program: "Image | Path", *, sram: str = ZEROS, crystal_ppm: int = 0, latency_cycles: int = 0, seed: int = 0
) -> "BluePill":
    """Return a board with a program, at its reset.

    Args:
        program: The image, or its file.
        sram: `zeros`, or `random`: bytes drawn from the seed.
        crystal_ppm: By how much its crystal is fast, in millionths; below 0 it is slow.
        latency_cycles: By how many cycles each interrupt may be late.
        seed: Of what is drawn.

    Raises:
        MissingDependencyError: The emulator's engine is not installed.
        ImageError: The program cannot be read.
        BluePillError: Interrupts may be late, and the core does not take them at the instruction.
    """
    from bluepill_sim.board import BluePill
    from bluepill_sim.fabric.clocks import CRYSTAL_HZ
    from bluepill_sim.stm32f103 import SRAM_BYTES

    board = BluePill(program)
    board.chip.parts.rcc.hse_hz = CRYSTAL_HZ + CRYSTAL_HZ * crystal_ppm // 10**6
    if sram == RANDOM_SRAM:
        board.power_up_with(random.Random(seed).randbytes(SRAM_BYTES))
    if latency_cycles:
        board.chip.latency.vary(seed=seed, most=latency_cycles)
    return board
