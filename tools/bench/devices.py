"""Print what devices cost: PWM at 20 kHz, a test device that moves a million words a second, the ADC, polling.

Each figure is the median of paired runs by CPU time in this process; the library is built here, with `mover.c` in it.
With `--timers` every timer runs all the while. Usage: python tools/bench/devices.py [--quick] [--timers]
"""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from emulator import build
from shares import HAS_TIMERS, RUNS, bench, cpu_s, row, run
from timers import start_timers

from bluepill_sim import BluePill, stm32f103
from bluepill_sim.analysis.probe import Probe
from bluepill_sim.analysis.vcd import write_vcd
from bluepill_sim.extension import library
from bluepill_sim.fabric.registers import NATIVE, Peripheral, Register
from bluepill_sim.fabric.signals import Oscillation, Shape
from simbase.timing import NS_PER_S

HERE = Path(__file__).parent
SOURCES = sorted((HERE.parents[1] / "bluepill_sim" / "extension" / "source").rglob("*.c"))
#: Where TIM6 would stand on a larger chip.
PLACE = "TIM6"
PWM_S, DMA_S, ADC_S, POLLED_S = (1.0, 0.2, 0.2, 0.1) if "--quick" in sys.argv else (20.0, 2.0, 5.0, 2.0)
#: Programs that poll: name, what they do, goal.
POLLED = (
    ("analogread", "ADC set up, calibrated, polled and reset for each reading", "2"),
    ("spi_dma", "SPI at 18 MHz by DMA, whose flags are polled", "-"),
)
#: What the ADC converts by circular DMA, and with which options tools/bench/firmware/adc.c is built.
CONVERSIONS = {
    "8 channels at 10 kHz": (80_000, "5", ("-DBENCH_EIGHT",)),
    "8 channels at 10 kHz by TIM3": (80_000, "5", ("-DBENCH_EIGHT", "-DBENCH_TRGO")),
    "1 channel at 857 kS/s": (857_142, "2", ()),
    "1 channel at 1 MS/s": (1_000_000, "2", ("-DBENCH_56_MHZ",)),
}
#: TIM1's clock, period and high time in cycles; it drives PA8 to PA11, which have no wire on the board.
TIMER_HZ, PERIOD, HIGH = 72_000_000, 3600, 900
#: Registers of TIM1, by offset: ARR, CCMR1, CCMR2, CCR1 to CCR4, CCER, EGR, BDTR, CR1.
PWM = (
    (0x2C, PERIOD - 1), (0x18, 0x6868), (0x1C, 0x6868), (0x34, HIGH), (0x38, HIGH), (0x3C, HIGH), (0x40, HIGH),
    (0x20, 0x1111), (0x14, 1), (0x44, 0x8000), (0x00, 0x81),
)  # fmt: skip
#: After the program's start, with its clock at 72 MHz.
STARTED_NS = 10_000_000
RCC_APB2ENR, GPIOA_ENABLE, TIM1_ENABLE = 0x18, 1 << 2, 1 << 11
GPIOA_IDR, BUFFER, BUFFER_WORDS = 0x4001_0808, 0x2000_3000, 256


class Mover(Peripheral):
    """`mover.c`."""

    KIND = "mover"
    REGISTERS = (
        Register(name="FROM", offset=0x0),
        Register(name="TO", offset=0x4),
        Register(name="COUNT", offset=0x8, on_write=NATIVE),
        Register(name="ERRORS", offset=0xC, writable=0),
    )


def start_pwm(board: BluePill) -> None:
    """Have TIM1 make four of them."""
    rcc, parts = board.chip.parts.rcc, board.chip.parts.by_name
    rcc.write(RCC_APB2ENR, 4, rcc.read(RCC_APB2ENR, 4) | GPIOA_ENABLE | TIM1_ENABLE)
    parts["GPIOA"].write(4, 4, 0x8884_BBBB)  # PA8 to PA11 alternate functions
    for offset, word in PWM:
        parts["TIM1"].write(offset, 4, word)


def start_mover(board: BluePill) -> None:
    """Have words of a port moved into SRAM."""
    rcc, mover = board.chip.parts.rcc, board.chip.parts.by_name[PLACE]
    rcc.write(RCC_APB2ENR, 4, rcc.read(RCC_APB2ENR, 4) | GPIOA_ENABLE)
    for offset, word in ((0, GPIOA_IDR), (4, BUFFER), (8, BUFFER_WORDS)):
        mover.write(offset, 4, word)


def waves(folder: Path) -> None:
    """Four channels of PWM in the bench, the CPU asleep between interrupts."""
    program = build("systick", folder)
    unseen, recorded = [], []
    for _ in range(RUNS):
        took = {}
        for name in ("without", "unseen", "recorded"):
            made = bench(folder, program, PWM_S, "adapter")
            made.run_until(STARTED_NS)
            if name != "without":
                start_pwm(made.chip)
            probe = Probe(made.chip) if name == "recorded" else None

            def whole() -> None:
                run(made)  # noqa: B023 - called at once
                if probe is not None:  # noqa: B023
                    probe.finish()  # noqa: B023
                    write_vcd(probe, folder / "pins.vcd")  # noqa: B023

            took[name] = cpu_s(whole)
            if probe is not None and len(probe.edges["PA11"]) < 2 * TIMER_HZ // PERIOD * (PWM_S - 0.1):
                sys.exit("bench: edges of PWM are missing")
        unseen.append(took["without"] / took["unseen"])
        recorded.append(PWM_S / took["recorded"])
    row("4 channels of PWM at 20 kHz: bench without / with", unseen, "0.9")
    row("the same, recorded as VCD: times real", recorded, "2")


def moved(folder: Path, name: str) -> tuple[list[float], list[float]]:
    """Return ratios to the same program without the device, and times real, of a program."""
    program = build(name, folder)
    ratios, factors = [], []
    for _ in range(RUNS):
        took = []
        for is_on in (False, True):
            board = BluePill(program)
            board.advance_to(STARTED_NS)
            if HAS_TIMERS:
                start_timers(board)
            if is_on:
                start_mover(board)
            took.append(cpu_s(lambda: board.advance_to(STARTED_NS + round(DMA_S * NS_PER_S))))  # noqa: B023
        errors = board.chip.parts.by_name[PLACE].words[3]
        if errors:
            sys.exit(f"bench: {errors} accesses of the bus failed")
        ratios.append(took[0] / took[1])
        factors.append(DMA_S / took[1])
    return ratios, factors


def movers(folder: Path) -> None:
    """A million words a second by the bus."""
    ratios, factors = moved(folder, "compute")
    row("a million words a second, computing: without / with", ratios, "0.6")
    row("the same: times real", factors, "-")
    _, asleep = moved(folder, "systick")
    row("the same, asleep: times real", asleep, "2")


def conversions(folder: Path) -> None:
    """Conversions by circular DMA, in the bench with the kinematic body, the CPU asleep between interrupts."""
    for name, (rate, goal, options) in CONVERSIONS.items():
        program = build("adc", folder, *options)
        factors = []
        for _ in range(RUNS):
            made = bench(folder, program, ADC_S, "adapter")
            made.run_until(STARTED_NS)
            made.chip.pin("PA0").set_volts(Oscillation(shape=Shape.SINE, low_v=0, high_v=3.3, period_ns=1_000_000))
            samples = made.chip.image.symbols.address_of("bench_samples") or 0
            factors.append(ADC_S / cpu_s(lambda: run(made)))  # noqa: B023 - called at once
            if made.chip.warnings or not any(made.chip.read_memory(samples, 128) or b"") or not made.chip.is_asleep:
                sys.exit(f"bench: {name} does not run: {made.chip.warnings}")
        row(f"ADC, {name} ({rate} conversions a second): times real", factors, goal)


def polled(folder: Path) -> None:
    """Programs that set devices up and poll them, over and over."""
    for name, what, goal in POLLED:
        program = build(name, folder)
        factors = []
        for _ in range(RUNS):
            board = BluePill(program)
            board.advance_to(STARTED_NS)
            if HAS_TIMERS:
                start_timers(board)
            counter = board.image.symbols.address_of("bench_rounds") or 0
            before = board.chip.memory.read_word(counter)
            factors.append(POLLED_S / cpu_s(lambda: board.advance_to(STARTED_NS + round(POLLED_S * NS_PER_S))))  # noqa: B023
            if board.warnings or board.chip.memory.read_word(counter) == before:
                sys.exit(f"bench: {name} does not run: {board.warnings}")
        row(f"{what}: times real", factors, goal)


def build_library(folder: Path) -> Path:
    """Return the emulator's library with the device of this bench in it."""
    out = folder / "native.so"
    flags = [
        "-shared",
        "-fPIC",
        "-std=c11",
        "-O2",
        "-fno-semantic-interposition",
        "-flto=auto",
        f"-I{SOURCES[0].parent}",
    ]
    subprocess.run(["gcc", *flags, *map(str, SOURCES), str(HERE / "mover.c"), "-o", str(out)], check=True)
    return out


def main() -> int:
    """Print the table; 1 without the compilers for it."""
    for compiler in ("arm-none-eabi-gcc", "gcc"):
        if shutil.which(compiler) is None:
            print(f"bench: no {compiler} (hint: sudo apt-get install gcc gcc-arm-none-eabi)")
            return 1
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        built = str(build_library(folder))
        library.library_path = lambda: built  # type: ignore[assignment]  # a cached function, for this process
        stm32f103.PERIPHERALS = (*stm32f103.PERIPHERALS, (Mover, PLACE))
        waves(folder)
        movers(folder)
        conversions(folder)
        polled(folder)
    return 0


if __name__ == "__main__":
    sys.exit(main())
