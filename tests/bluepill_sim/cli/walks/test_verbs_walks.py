"""Verbs of `p2os mcu` with many words, on committed programs and on some that end badly: whole answers, as approved.

Covers how a command line is read (levels, volts, times, texts), what ends a run, and what is said where a run ends.
"""

import random
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path

from tests.bluepill_sim.cli.test_whole_answers import answer
from tests.bluepill_sim.machine import Machine
from tests.tools.suite.approved import Trace, judge_of

#: Programs that end in a way of their own; each is `OUT/name.bin`.
BAD = {
    "fault": "movs r0, #1\nmov32 r1, #0xE000ED14\nmovs r2, #16\nstr r2, [r1, #0]\nmovs r3, #0\nudiv r0, r0, r3",
    "undefined": "udf",
    "breakpoint": "bkpt #3",
    "asleep": "wfi\nb start",
    "lockup": "mov32 r0, #0x60000000\nmov32 sp, #0x60000000\nldr r1, [r0, #0]",
    "reset": "mov32 r0, #0xE000ED0C\nmov32 r1, #0x05FA0004\nstr r1, [r0, #0]",
    "unmodelled": "mov32 r0, #0x40002800\nldr r1, [r0, #0]\nmov32 r0, #0x60000000\nloop: b loop",
}
#: Those that `run` gives up before their time, and how soon hangs on the machine.
GIVEN_UP = ("lockup", "reset")
INFO = (
    "info codes.elf", "info board_test.elf --for 2ms", "info usb_echo.elf --json --for 1ms", "info missing.elf",
    "info", "info dodge.elf --for x", "info dodge.elf --for 0ms", "info OUT/fault.bin --for 50us",
    "info OUT/asleep.bin --json --for 50us",
)  # fmt: skip
TRACES_OF = (
    "trace dodge.elf --for 2us", "trace dodge.elf --from 1us --for 3us", "trace dodge.elf --from 3us --for 1us",
    "trace codes.elf --for 4us --calls", "trace codes.elf --for 200us --calls --json", "trace dodge.elf --from x",
    "trace OUT/lockup.bin --for 9us", "trace OUT/reset.bin --for 4us",
    "trace OUT/fault.bin --for 20us --json",
)  # fmt: skip
PINS = (
    "pins dodge.elf --for 200us", "pins board_test.elf --for 2ms", "pins analog.elf --for 1ms --all --json",
    "pins dodge.elf --for 4ms --drive PA6=1 --drive PB9=0@1us --drive pb8=z", "pins dodge.elf --for 4ms --vcd OUT/vcd",
    "pins dodge.elf --for 4ms --drive PA6=GND --sr OUT/sr", "pins dodge.elf --for 4ms --drive PA6=3V3@1us --all",
    "pins dodge.elf --drive PA6", "pins dodge.elf --drive PD9=1", "pins dodge.elf --drive PA6=2", "pins missing.elf",
    "pins dodge.elf --drive PA6=1@never", "pins dodge.elf --drive PA1=9.9V", "pins dodge.elf --drive PA1=-1.5V",
    "pins OUT/fault.bin --for 1ms", "pins OUT/asleep.bin --for 1ms --all",
)  # fmt: skip
RUN = (
    *(f"run OUT/{name}.bin --for 300us" for name in BAD if name not in GIVEN_UP),
    "run OUT/unmodelled.bin --for 9us --strict",
    "run dodge.elf --for 1ms --uart OUT/text", "run dodge.elf --for 1ms --raw", "run sensors.elf --for 1ms --itm OUT/i",
    "run sensors.elf --for 1ms --drive PA0=1.65V --drive PA0=z@10us --drive PA0=high@20us --drive PA0=0V@30us",
    "run sensors.elf --for 2ms --usart-baud 9600", "run codes.elf --for 2ms --swo OUT/swo", "run analog.elf --for 9us",
    "run dodge.elf --for 5ms --until 'PA9 falls'", "run dodge.elf --for 5ms --until 'usart1 matches ready'",
    "run dodge.elf --for 5ms --until 'usart1 matches never'", "run dodge.elf --for 1ms --until nonsense",
    "run dodge.elf --for 5ms --until '3ms'", "run dodge.elf --gdb 0", "run dodge.elf --no-browser",
    "run dodge.elf --for 1ms --view --raw", "run dodge.elf --for 1ms --view --until x", "run dodge.elf --view --usb -",
    "run dodge.elf --for 1ms --view --drive PA0=1", "run dodge.elf --view --budget 1s", "run dodge.elf --view --strict",
    "run dodge.elf --attach nothing", "run usb_echo.elf --for 1ms --usb OUT/usb", "run dodge.elf --for -1ms",
    "run dodge.elf --for 1ms --uart OUT/none/text", "run OUT/fault.bin --for 1ms --until 'usart1 matches x'",
)  # fmt: skip
REPORTS = (
    "coverage codes.elf --for 4ms --drive PA6=1@1us --missed", "coverage dodge.elf --for 300us --lcov OUT/lcov",
    "coverage codes.elf --for 50us --json --fail-under 90%", "coverage codes.elf --for 50us --fail-under 1%",
    "coverage codes.elf --for 50us --fail-under x", "coverage OUT/asleep.bin --for 50us", "coverage missing.elf",
    "profile codes.elf --for 4ms --all --json", "profile OUT/fault.bin --for 90us",
    "profile codes.elf --for 4ms --folded OUT/folded", "profile codes.elf --for x",
    "profile OUT/asleep.bin --for 9us",
    "races codes.elf --for 400us --runs 2 --seed 3 --cycles 9",
    "races codes.elf --for 400us --runs 1 --send ping@1us --send '\\x41\\t@2us'", "races codes.elf --send @1ms",
    "races codes.elf --send '\\x@1us'", "races missing.elf",
    "compare-cores codes.elf --for 90us", "compare-cores codes.elf --for 50us --core exact --drive PA0=1@9us",
    "compare-cores OUT/fault.bin --for 20us --core python --json", "compare-cores codes.elf --for 50us --core other",
    "parts nothing", "parts servo", "parts sd-card", "none", "compare-silicon missing.log", "compare-silicon OUT/x.bin",
)  # fmt: skip


def _bytes_of(source: str) -> bytes:
    """Return a program as a file: the flash up to its last word."""
    flash = Machine(f"{source}\nstop_here: b stop_here", {}).board.chip.memory.flash.raw
    return flash.rstrip(b"\xff\0") + bytes(4)


def _answers(lines: Sequence[str], _: random.Random) -> Iterator[str]:
    programs = {name: _bytes_of(source) for name, source in BAD.items()}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for number, line in enumerate(lines):
            inside = folder / str(number)
            inside.mkdir()
            for program, data in programs.items():
                if f"OUT/{program}.bin" in line:
                    (inside / f"{program}.bin").write_bytes(data)
            yield answer(line, inside)


def _of(lines: Iterable[str]) -> Trace:
    return partial(_answers, [*lines])


TRACES = {"info": _of(INFO), "trace": _of(TRACES_OF), "pins": _of(PINS), "run": _of(RUN), "reports": _of(REPORTS)}
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
