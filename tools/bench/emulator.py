"""Print how fast the emulated BluePill is, next to Unicorn without hooks, to QEMU and with `P2OS_CORE=own`.

Each row runs one program of tools/bench/firmware, built here by
arm-none-eabi-gcc, several times in turn with what it is compared to, and prints
the median, by CPU time. Usage: python tools/bench/emulator.py [--quick]
"""

import ctypes
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from firmware.build import build as build_program
from measuring import CROSS_COMPILER, IS_QUICK, RUNS, TIMES_REAL, cpu_s, print_tables, row, several

from bluepill_sim import BluePill
from bluepill_sim.analysis.probe import Probe
from bluepill_sim.analysis.waveforms.vcd_writer import write_vcd
from bluepill_sim.core.unicorn_core import Reg
from bluepill_sim.extension.library import core_chosen, library_path

HERE = Path(__file__).parent
#: Program, virtual seconds a run in C and in Python, goal of the native core in times real time.
ROWS = (
    ("compute", 1.0, 0.02, 2.0),
    ("gpio", 0.5, 0.01, 1.2),
    ("bitbang", 0.5, 0.01, None),
    ("systick", 60.0, 4.0, 150.0),
    ("usart", 3.0, 0.3, 5.0),
)
#: Goals of the Python executor: on compute, and when idling.
PYTHON_GOALS = {"compute": 0.05, "systick": 5.0}
#: What the interpreter of our own is compared on, with the virtual seconds of a turn; and how many pairs of turns.
TURNS = {
    "compute": 1.0,
    "mix": 1.0,
    "crc": 1.0,
    "crc -DBENCH_LOOP": 1.0,
    "gpio": 0.3,
    "bitbang": 0.3,
    "usart": 1.0,
    "systick": 20.0,
}
PAIRS = 1 if IS_QUICK else 7
SETTLED_NS = 5_000_000
QEMU = ("qemu-system-arm", "-M", "netduino2", "-nographic", "-icount", "shift=0", "-monitor", "stdio")
QEMU += ("-serial", "none")


def build(name: str, folder: Path, *options: str) -> Path:
    """Return a program of tools/bench/firmware, built."""
    return build_program(HERE / "firmware" / f"{name}.c", folder / f"{name}{''.join(options)}.elf", *options)


def board(program: Path, name: str) -> BluePill:
    """Return a board of one core, past the start of its clocks."""
    with core_chosen(name):
        made = BluePill(str(program))
    made.advance_to(SETTLED_NS)
    return made


def factor(made: BluePill, seconds: float) -> float:
    """Return the virtual seconds that pass in a CPU second."""
    return seconds / stretch(made, seconds)


def stretch(made: BluePill, seconds: float) -> float:
    """Return the CPU seconds of the next virtual seconds."""
    return cpu_s(lambda: made.advance_to(made.now_ns + round(seconds * 1e9)))


def counter_of(made: BluePill) -> int:
    """Return where the program counts its rounds."""
    return made.image.symbols.address_of("bench_rounds") or sys.exit("bench: the program has no bench_rounds")


def rounds_of(made: BluePill) -> Callable[[], int]:
    """Return what reads the program's own count of its rounds."""
    at = counter_of(made)
    return lambda: made.chip.memory.read_word(at) or 0


def rate(
    rounds: Callable[[], int], work: Callable[[], object], clock: Callable[[], float] = time.process_time
) -> float:
    """Return the rounds a CPU second of a piece of work."""
    before, took = rounds(), cpu_s(work, clock)
    return (rounds() - before) / took


def speeds(folder: Path) -> None:
    """Each program, on each core."""
    for name, native_s, python_s, goal in ROWS:
        program = build(name, folder)
        if library_path() is not None:
            note = "" if goal is None else f"goal {goal:g}"
            row(f"{name}, native", several(factor, board(program, "native"), native_s), TIMES_REAL, note)
        wanted = f"goal {PYTHON_GOALS[name]:g}" if name in PYTHON_GOALS else ""
        row(f"{name}, Python", several(factor, board(program, "python"), python_s), "{:.3f} x real", wanted)
    if library_path() is not None:
        found = several(recorded, build("bitbang", folder), folder / "pins.vcd")
        row("bitbang, native, every edge to a VCD file", found, TIMES_REAL, "goal 0.2, two edges a round")
        made = board(build("gpio", folder), "native")
        row("snapshot of the whole machine", several(lambda: 1e3 * cpu_s(made.snapshot)), "{:.2f} ms", "goal 1")


def recorded(program: Path, path: Path) -> float:
    """Return the virtual seconds that a CPU second runs, records and writes."""
    made = board(program, "native")
    probe = Probe(made)

    def whole() -> None:
        made.advance_to(made.now_ns + 100_000_000)
        probe.finish()
        write_vcd(probe, path)

    return 0.1 / cpu_s(whole)


def stripped(program: Path, hook: int) -> Callable[[], float]:
    """Return what runs a program with another hook of blocks than ours, or with none, and tells its rounds a second.

    All else is as it is: without our declaration of SRAM as data, Unicorn takes several times as long for each store.
    """
    made = board(program, "native")
    engine, rounds = made.chip.engine, rounds_of(made)
    core = engine._core  # noqa: SLF001
    core.remove_hook(engine._native_hooks[0])  # type: ignore[attr-defined]  # noqa: SLF001 - of the native one
    if hook:
        core.hook_native("block", ctypes.c_void_p(hook), 0)
    core.drop_all_code()

    def work() -> None:
        core.library.uc_emu_start(core.handle, core.registers[Reg.PC] | 1, 0xFFFF_FFFF, 500_000, 0)

    return lambda: rate(rounds, work, time.thread_time)  # the clock of Unicorn's time-out is a thread of its own


def against_unicorn(folder: Path) -> None:
    """Compute, with everything that this project does at a block, and with nothing, in turn."""
    if library_path() is None:
        return
    program = build("compute", folder)
    made = board(program, "native")
    rounds = rounds_of(made)
    empty = ctypes.cast(ctypes.CDLL(None).abs, ctypes.c_void_p).value or 0  # a function that does next to nothing
    others = {"without a hook": (0, "goal 0.65"), "with an empty hook": (empty, "what our accounting costs beside it")}
    runs = {name: stripped(program, hook) for name, (hook, _) in others.items()}
    shares: dict[str, list[float]] = {name: [] for name in others}
    for _ in range(RUNS):
        ours = rate(rounds, lambda: made.advance_to(made.now_ns + 2_000_000_000), time.thread_time)
        for name, run in runs.items():
            shares[name].append(ours / run())
    for name, (_, note) in others.items():
        row(f"compute, to Unicorn {name} at each block", shares[name], "{:.2f}", f"{note}; rounds, paired")


def turn(made: BluePill, seconds: float) -> float:
    """Return the rounds a CPU second of the next virtual seconds; where the program counts none, these."""
    has_rounds = made.image.symbols.address_of("bench_rounds") is not None
    return rate(
        rounds_of(made) if has_rounds else lambda: made.now_ns,
        lambda: made.advance_to(made.now_ns + round(seconds * 1e9)),
    )


def own_core(folder: Path) -> None:
    """Each program on the interpreter of our own, in turn with the default core; the first pair warms up."""
    if library_path() is None:
        return
    for name, seconds in TURNS.items():
        source, *options = name.split()
        program = build(source, folder, *options)
        native, own = board(program, "native"), board(program, "own")
        found = [1 / turn(native, seconds) * turn(own, seconds) for _ in range(PAIRS + 1)][1:]
        row(f"{name}, P2OS_CORE=own to the default", found, "{:.2f}", "rounds a CPU second, paired")


def qemu_cpu_s(program: Path, seconds: float, commands: str, *options: str) -> tuple[float, str]:
    """Return the CPU seconds of QEMU over so long on the wall clock and a few commands, and what it told."""
    before = os.times()
    with subprocess.Popen(
        [*QEMU, *options, "-kernel", str(program)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as qemu:
        time.sleep(seconds)
        output, _ = qemu.communicate(f"{commands}quit\n", timeout=20)
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system, output


def against_qemu(folder: Path) -> None:
    """Compute in QEMU with its instruction counter, in turn with ours: rounds a CPU second, without QEMU's start."""
    if shutil.which(QEMU[0]) is None:
        row("compute, QEMU -icount shift=0", "skipped", "qemu-system-arm is not installed")
        return
    program = build("compute", folder, "-DBENCH_NO_CLOCK=1")
    made = board(program, "native" if library_path() else "python")
    at = counter_of(made)
    rounds = rounds_of(made)

    def pair() -> float:
        ours = rate(rounds, lambda: made.advance_to(made.now_ns + 40_000_000_000))
        start_s, _ = qemu_cpu_s(program, 0.1, "", "-S")
        took_s, output = qemu_cpu_s(program, 2.0, f"stop\nxp /1wx {at:#x}\n")
        word = next(line.split(":")[1] for line in output.splitlines() if line.startswith(f"{at:016x}:"))
        return int(word, 16) / (took_s - start_s) / ours

    note = "of our rounds a CPU second, paired; goal 1.45 at most"
    row("compute, QEMU -icount shift=0", several(pair), "{:.2f}", note)


if __name__ == "__main__":
    sys.exit(print_tables(speeds, against_unicorn, own_core, against_qemu, needs=(CROSS_COMPILER,)))
