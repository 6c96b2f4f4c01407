"""Print what devices cost: PWM at 20 kHz, a test device that moves a million words a second, the ADC, polling, buses.

Each figure is the median of paired runs by CPU time in this process; the library is built here, with `mover.c` in it.
With `--timers` every timer runs all the while. Usage: python tools/bench/devices.py [--quick] [--timers]
"""

import subprocess
import sys
from pathlib import Path

from emulator import build, factor, rounds_of, stretch
from measuring import CROSS_COMPILER, IS_QUICK, RUNS, cpu_s, print_tables, row, several
from shares import HAS_TIMERS, bench, run_s
from timers import PERIOD, RCC_APB2ENR, TIM1_ENABLE, TIMER_HZ, start_timer, start_timers

from bluepill_sim import BluePill, stm32f103
from bluepill_sim.analysis.probe import Probe
from bluepill_sim.analysis.waveforms.vcd_writer import write_vcd
from bluepill_sim.extension import library
from bluepill_sim.fabric.registers import NATIVE, Peripheral, Register
from bluepill_sim.fabric.signals import Oscillation, Waveform
from bluepill_sim.parts import Eeprom24C02
from bluepill_sim.peripherals.spi import Loopback
from robot_bench.firmware.build import HERE as RUNTIME
from robot_bench.firmware.build import build_elf

HERE = Path(__file__).parent
SOURCES = sorted((HERE.parents[1] / "bluepill_sim" / "extension" / "source").rglob("*.c"))
#: Where TIM6 would stand on a larger chip.
PLACE = "TIM6"
PWM_S, DMA_S, ADC_S, POLLED_S = (1.0, 0.2, 0.2, 0.1) if IS_QUICK else (20.0, 2.0, 5.0, 2.0)
#: Programs that poll: name, what they do, goal.
POLLED = (
    ("analogread", "ADC set up, calibrated, polled and reset for each reading", "goal 2"),
    ("spi_dma", "SPI at 18 MHz by DMA, whose flags are polled", ""),
)
#: What the ADC converts by circular DMA, and with which options tools/bench/firmware/adc.c is built.
CONVERSIONS = {
    "8 channels at 10 kHz": (80_000, "5", ("-DBENCH_EIGHT",)),
    "8 channels at 10 kHz by TIM3": (80_000, "5", ("-DBENCH_EIGHT", "-DBENCH_TRGO")),
    "1 channel at 857 kS/s": (857_142, "2", ()),
    "1 channel at 1 MS/s": (1_000_000, "2", ("-DBENCH_56_MHZ",)),
}
#: After the program's start, with its clock at 72 MHz.
STARTED_NS = 10_000_000
#: The program of the buses, and its virtual seconds.
BUSES = HERE.parents[1] / "tests/bluepill_sim/peripherals/buses/firmware/dma_buses.c"
BUS_S = 0.2
GPIOA_ENABLE = 1 << 2
GPIOA_IDR, BUFFER, BUFFER_WORDS = 0x4001_0808, 0x2000_3000, 256


class MoverDevice(Peripheral):
    """`mover.c`."""

    KIND = "mover"
    REGISTERS = (
        Register(name="FROM", offset=0x0),
        Register(name="TO", offset=0x4),
        Register(name="COUNT", offset=0x8, on_write=NATIVE),
        Register(name="ERRORS", offset=0xC, writable=0),
    )


def start_pwm(board: BluePill) -> None:
    """Have TIM1 make four of them, on PA8 to PA11, which have no wire on the board."""
    rcc, parts = board.chip.parts.rcc, board.chip.parts.by_name
    rcc.write(RCC_APB2ENR, 4, rcc.read(RCC_APB2ENR, 4) | GPIOA_ENABLE | TIM1_ENABLE)
    parts["GPIOA"].write(4, 4, 0x8884_BBBB)  # PA8 to PA11 alternate functions
    start_timer(board, "TIM1")


def start_mover(board: BluePill) -> None:
    """Have words of a port moved into SRAM."""
    rcc, mover = board.chip.parts.rcc, board.chip.parts.by_name[PLACE]
    rcc.write(RCC_APB2ENR, 4, rcc.read(RCC_APB2ENR, 4) | GPIOA_ENABLE)
    for offset, word in ((0, GPIOA_IDR), (4, BUFFER), (8, BUFFER_WORDS)):
        mover.write(offset, 4, word)


def started(program: Path) -> BluePill:
    """Return a board past the start of its program."""
    board = BluePill(program)
    board.advance_to(STARTED_NS)
    if HAS_TIMERS:
        start_timers(board)
    return board


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
            took[name] = run_s(made)
            if probe is not None:
                probe.finish()
                took[name] += cpu_s(lambda: write_vcd(probe, folder / "pins.vcd"))  # noqa: B023 - called at once
                if len(probe.edges["PA11"]) < 2 * TIMER_HZ // PERIOD * (PWM_S - 0.1):
                    sys.exit("bench: edges of PWM are missing")
        unseen.append(took["without"] / took["unseen"])
        recorded.append(PWM_S / took["recorded"])
    row("4 channels of PWM at 20 kHz: bench without / with", unseen, note="goal 0.9")
    row("the same, recorded as VCD: times real", recorded, note="goal 2")


def moved(folder: Path, name: str) -> tuple[list[float], list[float]]:
    """Return ratios to the same program without the device, and times real, of a program."""
    program = build(name, folder)
    ratios, factors = [], []
    for _ in range(RUNS):
        took = []
        for is_on in (False, True):
            board = started(program)
            if is_on:
                start_mover(board)
            took.append(stretch(board, DMA_S))
        errors = board.chip.parts.by_name[PLACE].words[3]
        if errors:
            sys.exit(f"bench: {errors} accesses of the bus failed")
        ratios.append(took[0] / took[1])
        factors.append(DMA_S / took[1])
    return ratios, factors


def movers(folder: Path) -> None:
    """A million words a second by the bus."""
    ratios, factors = moved(folder, "compute")
    row("a million words a second, computing: without / with", ratios, note="goal 0.6")
    row("the same: times real", factors)
    _, asleep = moved(folder, "systick")
    row("the same, asleep: times real", asleep, note="goal 2")


def conversions(folder: Path) -> None:
    """Conversions by circular DMA, in the bench with the kinematic body, the CPU asleep between interrupts."""

    def times_real(name: str, program: Path) -> float:
        made = bench(folder, program, ADC_S, "adapter")
        made.run_until(STARTED_NS)
        made.chip.pin("PA0").set_volts(Oscillation(shape=Waveform.SINE, low_v=0, high_v=3.3, period_ns=1_000_000))
        samples = made.chip.image.symbols.address_of("bench_samples") or 0
        took = run_s(made)
        if made.chip.warnings or not any(made.chip.read_memory(samples, 128) or b"") or not made.chip.is_asleep:
            sys.exit(f"bench: {name} does not run: {made.chip.warnings}")
        return ADC_S / took

    for name, (a_second, goal, options) in CONVERSIONS.items():
        found = several(times_real, name, build("adc", folder, *options))
        row(f"ADC, {name} ({a_second} conversions a second): times real", found, note=f"goal {goal}")


def polled(folder: Path) -> None:
    """Programs that set devices up and poll them, over and over."""

    def times_real(program: Path) -> float:
        board = started(program)
        rounds = rounds_of(board)
        before, found = rounds(), factor(board, POLLED_S)
        if board.warnings or rounds() == before:
            sys.exit(f"bench: {program.stem} does not run: {board.warnings}")
        return found

    for name, what, note in POLLED:
        row(f"{what}: times real", several(times_real, build(name, folder)), note=note)


class WirePart:
    """A part in Python that answers what it hears."""

    spi_modes = frozenset(range(4))
    max_hz = 36_000_000

    def select(self, at_ns: int) -> None:
        """Nothing selects it."""

    def deselect(self, at_ns: int) -> None:
        """Nothing selects it."""

    def exchange(self, byte: int, at_ns: int) -> int:  # noqa: ARG002 - the interface's
        """Return the byte."""
        return byte


class Announcer(WirePart):
    """One that says ahead what it sends, as a flash does that is read."""

    def ahead(self, count: int) -> tuple[bytes, int | None]:
        """Return what it sends next, whatever it is sent."""
        return bytes(count), None

    def went(self, count: int) -> None:
        """Keep nothing."""


def buses(folder: Path) -> None:
    """SPI at 18 MHz and I2C at 400 kHz by DMA, while the program sleeps."""
    elf = folder.resolve() / "dma_buses.elf"
    sources, flags = ("startup.c", "memory.c", "board.c", str(BUSES)), (f"-I{RUNTIME}",)
    build_elf(sources, folder=RUNTIME, linker_script="f103c8.ld", output=elf, more_flags=flags)
    for name, device, is_i2c in (
        ("SPI at 18 MHz, MISO tied to MOSI", Loopback(), False),
        ("SPI at 18 MHz, a part in Python", WirePart(), False),
        ("SPI at 18 MHz, a part in Python that says ahead", Announcer(), False),
        ("I2C at 400 kHz, the EEPROM", Loopback(), True),
    ):
        board = BluePill(elf)
        board.spi("SPI1", device)
        board.i2c("I2C1", Eeprom24C02())
        board.pin("PB0").drive(is_i2c)
        board.usart1.expect(b"end\n")
        row(f"{name}: times real", factor(board, BUS_S))


def with_mover(folder: Path) -> None:
    """Have the emulator's library built with the device of this bench in it, for this process."""
    built = folder / "native.so"
    flags = [
        "-shared",
        "-fPIC",
        "-std=c11",
        "-O2",
        "-fno-semantic-interposition",
        "-flto=auto",
        f"-I{SOURCES[0].parent}",
    ]
    subprocess.run(
        ["gcc", *flags, *map(str, SOURCES), str(HERE / "firmware" / "devices" / "mover.c"), "-o", str(built)],
        check=True,
    )
    library.library_path = lambda: str(built)  # type: ignore[assignment]  # a cached function
    stm32f103.PERIPHERALS = (*stm32f103.PERIPHERALS, (MoverDevice, PLACE))


if __name__ == "__main__":
    tables = (with_mover, waves, movers, conversions, polled, buses)
    sys.exit(print_tables(*tables, needs=(CROSS_COMPILER, "gcc")))
