"""Print how fast programs run that make the mistakes of beginners, or store and poll as tight as they can.

Each figure is the median of several runs by CPU time, in the strides of `p2os mcu run`, with every pin listened to.
A program that is not warned of what it does, or does not go on, ends the table.
Usage: python tools/bench/beginners.py [--quick]
"""

import sys
from pathlib import Path

from firmware.build import build as build_program
from measuring import CROSS_COMPILER, IS_QUICK, cpu_s, print_tables, row, several

from bluepill_sim import BluePill
from bluepill_sim.cli.run import bounded
from bluepill_sim.stm32f103 import BASES
from simbase.timing import NS_PER_S, Nanos

SOURCES = Path(__file__).parent / "firmware" / "beginners"
#: After the start of the clocks, and what a run lasts.
STARTED_NS: Nanos = 5_000_000
SPAN_NS: Nanos = 50_000_000 if IS_QUICK else 500_000_000
BUDGET_NS: Nanos = 600 * NS_PER_S
UNCLOCKED = tuple((name, BASES[name] + offset) for name, offset in (
    ("DMA1", 0), ("USART1", 0), ("TIM2", 0x10), ("GPIOA", 0x08), ("I2C2", 0x14),
))  # fmt: skip
#: What they do, program, options, how many warnings, goal.
ROWS = (
    *(
        (
            f"{name} polled without its clock{speed}",
            "unclocked",
            (f"-DBENCH_REGISTER={address:#x}u", *options),
            1,
            "goal 1",
        )
        for name, address in UNCLOCKED
        for speed, options in ((", 8 MHz", ("-DBENCH_8_MHZ",)), ("", ()))
    ),
    ("CCR1 of PWM stored, with preload", "compare", (), 0, "goal 1"),
    ("CCR1 of PWM stored, at once", "compare", ("-DBENCH_AT_ONCE",), 0, "goal 1"),
    ("flash erased and programmed", "flash", (), 0, "goal 1"),
    ("a CAN frame that nobody acknowledges, 500 kbit/s", "can", (), 0, "goal 1"),
    ("the same, given up after 10 ms", "can", ("-DBENCH_ABORT",), 0, "goal 1"),
    ("the same at 1 Mbit/s", "can", ("-DBENCH_MBIT",), 0, "goal 1"),
    ("the same at 1 Mbit/s, given up after 10 ms", "can", ("-DBENCH_MBIT", "-DBENCH_ABORT"), 0, "goal 1"),
    ("SPI at 1.1 MHz polled", "spi", ("-DBENCH_DIVIDER=5",), 0, "goal 1"),
    ("SPI at 9 MHz polled", "spi", (), 0, "goal 1"),
    ("a pin by its bit-band alias", "bitband", (), 0, ""),
    *(
        (f"{what}, over and over", "stray", (f"-DBENCH_STRAY={number}",), warnings, "goal 1")
        for number, what, warnings in (
            (1, "an address without a register written", 1),
            (4, "a peripheral without its clock written", 1),
            (6, "bytes that the APB bridge duplicates", 1),
            (10, "what is not modelled of the core written", 1),
        )
    ),
)


def times_real(program: Path, warnings: int) -> float:
    """Return the virtual seconds that pass in a CPU second."""
    board = BluePill(program)
    edges = 0

    def count(rows: bytes) -> None:
        nonlocal edges
        edges += len(rows)

    board.subscribe_pins([pin.name for pin in board.pins], count, waves=True)
    advance = bounded(board, BUDGET_NS)
    advance(STARTED_NS)
    at = board.image.symbols.address_of("bench_rounds") or 0
    before = board.chip.memory.read_word(at)
    took_s = cpu_s(lambda: advance(STARTED_NS + SPAN_NS))
    if len(board.warnings) != warnings or board.chip.memory.read_word(at) == before:
        sys.exit(f"bench: {program.stem} does not run: {board.warnings}")
    return SPAN_NS / NS_PER_S / took_s


def programs(folder: Path) -> None:
    """Each of them."""
    for number, (what, name, options, warnings, note) in enumerate(ROWS):
        program = build_program(SOURCES / f"{name}.c", folder / f"{name}{number}.elf", *options)
        row(f"{what}: times real", several(times_real, program, warnings), note=note)


if __name__ == "__main__":
    sys.exit(print_tables(programs, needs=(CROSS_COMPILER,)))
