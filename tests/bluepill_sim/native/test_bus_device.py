"""A device in C that is master of the bus a million times a second: the same on both cores and in any slices."""

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bluepill_sim import stm32f103
from bluepill_sim.extension import library
from bluepill_sim.fabric.registers import NATIVE, Peripheral, Register
from tests.bluepill_sim.machine import LOG, Machine

ROOT = Path(__file__).resolve().parents[3]
SOURCES = sorted((ROOT / "bluepill_sim" / "extension" / "source").rglob("*.c"))
#: A place of the family where no device is modelled.
FREE = next(name for name in stm32f103.BASES if name not in {name for _, name in stm32f103.PERIPHERALS})
GPIOA_IDR, BUFFER, WORDS = 0x4001_0808, 0x2000_3000, 16

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="no C compiler")


class Mover(Peripheral):
    """The device of tools/bench."""

    KIND = "mover"
    REGISTERS = (
        Register(name="FROM", offset=0x0),
        Register(name="TO", offset=0x4),
        Register(name="COUNT", offset=0x8, on_write=NATIVE),
        Register(name="ERRORS", offset=0xC, writable=0),
    )


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Have boards made with a library that knows the device."""
    out = tmp_path_factory.mktemp("library") / "native.so"
    flags = ["-shared", "-fPIC", "-std=c11", "-Wall", "-Wextra", "-Werror", f"-I{SOURCES[0].parent}"]
    subprocess.run(
        ["gcc", *flags, *map(str, SOURCES), ROOT / "tools/bench/firmware/devices/mover.c", "-o", out], check=True
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(library, "library_path", lambda: str(out))
        patch.setattr(stm32f103, "PERIPHERALS", (*stm32f103.PERIPHERALS, (Mover, FREE)))
        library.library.cache_clear()
        yield
    library.library.cache_clear()


def moving(text: str, core: str, to: int = BUFFER, words: int = WORDS) -> tuple[Machine, list[int]]:
    """Return a machine whose PA3 is read a million times a second, and what Python was asked."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("P2OS_CORE", core)
        machine = Machine(text, {})
    chip = machine.board.chip
    chip.parts.rcc.write(0x18, 4, 4)
    mover = chip.parts.by_name[FREE]
    for offset, word in ((0, GPIOA_IDR), (4, to), (8, words)):
        mover.write(offset, 4, word)
    asked: list[int] = []
    reach = chip.reach_registers

    def reached(address: int, size: int, written: int | None) -> int | None:
        asked.append(address)
        return reach(address, size, written)

    chip.reach_registers = reached  # type: ignore[method-assign]
    return machine, asked


def state(machine: Machine) -> tuple[Any, ...]:
    board = machine.board
    mover = board.chip.parts.by_name[FREE]
    return (
        board.cycle, board.pc, board.read_memory(0x2000_0000, 0x4000), tuple(mover.words[:8]), mover.due_ns,
        [board.register(f"R{n}") for n in range(8)], board.last_rows,
    )  # fmt: skip


LOOPS = {
    "waits for a word": f"mov32 r4, #{BUFFER}\nagain: ldrb r1, [r4, #0]\ncmp r1, #9\nbne again\nlog #1",
    "counts": f"mov32 r4, #{BUFFER}\nagain: adds r6, #1\nldrb r1, [r4, #0]\ncmp r1, #9\nbne again\nstr r6, [r7, #0]",
    "sleeps": "again: wfi\nb again",
    "spins": "again: b again",
}


@pytest.mark.parametrize("name", LOOPS)
@settings(max_examples=8, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(slices=st.lists(st.integers(200, 40_000), max_size=12), rise=st.integers(5_000, 60_000))
def test_what_a_bus_master_moves_is_seen_in_the_same_cycle_however_the_program_waits(
    name: str, slices: list[int], rise: int, built: None
) -> None:
    machines = [moving(LOOPS[name], core) for core in ("python", "native", "native")]
    for machine, _ in machines:
        machine.board.pin("PA0").drive(True)
        machine.board.advance_to(rise)
        machine.board.pin("PA3").drive(True)
    for span in slices:
        board = machines[2][0].board
        board.advance_to(min(board.now_ns + span, 100_000))
    for machine, _ in machines:
        machine.board.advance_to(100_000)
    python, native, sliced = (state(machine) for machine, _ in machines)
    assert native == python
    assert sliced == python
    assert machines[1][1] == []  # a register of a device in C is answered in C
    assert machines[0][0].board.chip.parts.by_name[FREE].words[3] == 0
    if name in {"waits for a word", "counts"}:
        assert machines[0][0].is_done


def test_code_that_a_device_in_c_writes_over_is_run_as_written(built: None) -> None:
    # What is moved is IDR with PA13 and PA15 pulled up: 0xA008 is `add r0, pc, #32`; without PA3 it adds nothing.
    text = f"mov32 r4, #{BUFFER + 1}\nagain: blx r4\nstr r0, [r7, #0]\nb again"
    words = []
    for core in ("python", "native"):
        machine, _ = moving(text, core, BUFFER, 1)
        machine.board.pin("PA12").drive(False)  # its pull-up of the USB socket would make another instruction
        machine.board.chip.memory.write(BUFFER, bytes.fromhex("00a00000704700bf"))
        machine.board.advance_to(20_000)
        machine.board.pin("PA3").drive(True)
        seen = []
        for until in (20_400, 23_000, 40_000):
            machine.board.advance_to(until)
            seen.append(machine.board.read_memory(LOG, 4))
        words.append((seen, state(machine)))
    assert words[0] == words[1]
    assert words[0][0][0] != words[0][0][2]


def run_at_72_mhz(machine: Machine) -> None:
    """Set the clock from outside, while the program waits."""
    rcc, flash = machine.board.chip.parts.rcc, machine.board.chip.parts.flash
    flash.write(0, 4, 0x12)
    rcc.write(0, 4, rcc.read(0, 4) | 1 << 16)
    machine.board.run_for("3 ms")
    rcc.write(4, 4, 1 << 16 | 7 << 18 | 4 << 8)
    rcc.write(0, 4, rcc.read(0, 4) | 1 << 24)
    machine.board.run_for("1 ms")
    rcc.write(4, 4, rcc.read(4, 4) | 2)


def test_a_loop_that_waits_for_a_word_ends_at_the_right_round_whichever_it_is(built: None) -> None:
    # Ten rounds or so go between two words, and every 64th round or so is compared with the one before.
    machines = []
    for core in ("python", "native"):
        machine, _ = moving(LOOPS["waits for a word"], core, BUFFER, 1)
        machine.board.pin("PA0").drive(True)
        run_at_72_mhz(machine)
        machines.append((machine, machine.board.snapshot(), machine.board.now_ns))
    for rise in range(1_000, 30_000, 250):
        ends = []
        for machine, saved, start_ns in machines:
            machine.board.restore(saved)
            machine.board.advance_to(start_ns + rise)
            machine.board.pin("PA3").drive(True)
            machine.board.advance_to(start_ns + 32_000)
            assert machine.board.hclk_hz == 72_000_000
            ends.append(next(row[0] for row in machine.board.last_rows if row[1] == machine.label("stop")))
            machine.board.pin("PA3").drive(None)
        assert ends[0] == ends[1], rise
