"""Waves and the bus on the whole chip, the same on both cores."""

from collections.abc import Callable
from typing import Any

import pytest

from bluepill_sim.analysis.probe import Probe
from bluepill_sim.extension.library import library_path
from tests.bluepill_sim.machine import COUNTER_ON, LOG, Machine

CORES = [
    "python",
    pytest.param("native", marks=pytest.mark.skipif(library_path() is None, reason="the native core is not built")),
]
#: GPIOA, GPIOC, AFIO and EXTI on; PA0 an alternate function at 50 MHz.
PINS_ON = """
mov32 r0, #0x40021018
movs r1, #0x15
str r1, [r0, #0]
mov32 r6, #0x40010800
mov32 r1, #0x4444444B
str r1, [r6, #0]
"""
SRAM_CODE = 0x2000_2000


@pytest.fixture(params=CORES)
def boot_on(request: pytest.FixtureRequest, boot: Callable[..., Machine], monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setenv("P2OS_CORE", request.param)
    return boot


def offer(machine: Machine, period: int, high: int, position: int = 0) -> None:
    board = machine.board
    board.pin("PA0").offer_wave("TIM2_CH1", board.chip.clocks.timer1_hz, period, high, position)


def test_idr_reads_the_level_of_the_reading_cycle(boot_on: Any) -> None:
    machine = boot_on(
        f"{COUNTER_ON}{PINS_ON}mov32 r5, #0xE0001000\nmovs r4, #200\n"
        "again: ldr r1, [r5, #4]\nldr r2, [r6, #8]\nstr r1, [r7, #0]\nstr r2, [r7, #4]\nadds r7, #8\n"
        "subs r4, #1\nbne again"
    )
    machine.run(4)
    offer(machine, 61, 17)
    wave = machine.board.pin("PA0").wave
    machine.run(1000)
    assert machine.is_done
    pairs = list(zip(machine.log[::2], machine.log[1::2], strict=True))[5:]
    levels = [bool(word & 1) for _, word in pairs]
    assert {True, False} == set(levels)
    # IDR is read a fixed number of cycles after CYCCNT, which began a fixed number of cycles after the start.
    offsets = [
        offset
        for offset in range(61)
        if levels == [wave.level(125 * (count + offset)) for count, _ in pairs]  # 8 MHz
    ]
    assert len(offsets) == 1


def test_exti_sees_every_edge_of_a_wave_in_slices_of_any_length(boot_on: Any) -> None:
    text = (
        f"{PINS_ON}mov32 r3, #0x40010400\nmovs r1, #1\nstr r1, [r3, #0]\nstr r1, [r3, #8]\n"
        "mov32 r3, #0xE000E100\nmovs r1, #0x40\nstr r1, [r3, #0]\nmovs r5, #0\nsleep: wfi\nb sleep\n"
        "hit: mov32 r3, #0x40010400\nmovs r1, #1\nstr r1, [r3, #20]\nadds r5, #1\nbx lr"
    )
    counts = []
    for slice_us in (None, 3.7):
        machine = boot_on(text, {16 + 6: "hit"}).run(20)
        start = machine.board.now_ns
        offer(machine, 400, 100, position=100)  # 20 kHz of 8 MHz, the first rise after 300 cycles
        machine.run(1000, slice_us)
        assert machine.board.now_ns - start >= 1_000_000
        counts.append((machine.board.register("R5"), machine.board.cycle))
    assert counts[0][0] == counts[1][0] == 20


def test_a_snapshot_in_the_middle_of_a_wave_goes_on_the_same(boot_on: Any) -> None:
    machine = boot_on(f"{PINS_ON}again: b again").run(20)
    offer(machine, 397, 100)
    machine.run(333)
    snapshot = machine.board.snapshot()
    seen = []
    for _ in range(2):
        probe = Probe(machine.board)
        machine.run(500)
        probe.finish()
        seen.append(probe.edges["PA0"])
        machine.board.restore(snapshot)
    assert seen[0] == seen[1]
    assert len(seen[0]) in (20, 21)
    assert [two[0] - one[0] for one, two in zip(seen[0][:-2], seen[0][2:], strict=True)] == [397 * 125] * (
        len(seen[0]) - 2
    )


def act_at(machine: Machine, at_ns: int, act: Callable[[int], None]) -> None:
    """Have a bus master act once, at a time."""
    fabric = machine.board.chip.fabric

    def event(_ns: int) -> None:
        fabric.schedule(slot, None)
        act(slot)

    slot = fabric.add_slot("DMA1", event)
    fabric.schedule(slot, at_ns)


def test_code_in_sram_that_a_bus_master_writes_over_is_run_as_written(boot_on: Any) -> None:
    machine = boot_on(f"mov32 r4, #{SRAM_CODE + 1}\nagain: blx r4\nstr r0, [r7, #0]\nb again")
    machine.board.chip.memory.write(SRAM_CODE, bytes.fromhex("01207047"))  # movs r0, #1; bx lr
    fabric = machine.board.chip.fabric
    done: list[bool] = []
    act_at(machine, 150_000, lambda slot: done.append(fabric.bus_write(slot, SRAM_CODE, 2, 0x2002)))
    assert (machine.run(100).board.read_memory(LOG, 4) or b"")[0] == 1
    assert (machine.run(100).board.read_memory(LOG, 4) or b"")[0] == 2
    assert done == [True]


def test_the_bus_reaches_what_it_should_and_refuses_the_rest(boot_on: Any) -> None:
    machine = boot_on(f"{PINS_ON}again: b again").run(20)
    chip = machine.board.chip
    fabric, slot = chip.fabric, chip.parts.by_name["IWDG"].slot
    assert fabric.bus_write(slot, 0x2000_0010, 4, 0x1234_5678)
    assert fabric.bus_read(slot, 0x2000_0011 + 1, 2) == 0x1234
    assert fabric.bus_read(slot, 0x2000_0013, 1) == 0x12
    assert fabric.bus_read(slot, 0x0800_0000, 4) == 0x2000_5000
    machine.board.pin("PA3").drive(True)
    assert (fabric.bus_read(slot, 0x4001_0808, 4) or 0) & 0xFF == 1 << 3
    assert fabric.bus_write(slot, 0x4001_080C, 4, 0x10)
    assert chip.parts.by_name["GPIOA"].read(0x0C, 4) == 0x10
    assert fabric.bus_read(slot, 0x4002_1018, 4) == 0x15  # RCC is Python's
    refused = {
        "flash is read only": fabric.bus_write(slot, 0x0800_0000, 4, 0),
        "the alias of the flash": fabric.bus_read(slot, 0, 4) is not None,
        "behind the SRAM": fabric.bus_read(slot, 0x2000_5000, 4) is not None,
        "a bit-band alias": fabric.bus_read(slot, 0x2200_0000, 4) is not None,
        "the private peripheral bus": fabric.bus_read(slot, 0xE000_E010, 4) is not None,
        "no clock": fabric.bus_read(slot, 0x4001_0C08, 4) is not None,
        "not modelled": fabric.bus_read(slot, 0x4000_0000, 4) is not None,
        "unaligned": fabric.bus_read(slot, 0x2000_0002, 4) is not None,
    }
    assert not any(refused.values()), refused
    assert machine.board.warnings == []


def test_what_a_bus_master_does_wrong_is_told_with_its_name(boot_on: Any) -> None:
    machine = boot_on(f"{PINS_ON}again: b again").run(20)
    chip = machine.board.chip
    act_at(machine, 50_000, lambda slot: bool(chip.fabric.bus_write(slot, 0x4002_1200, 4, 1)))
    machine.run(100)
    assert len(machine.board.warnings) == 1
    assert "by DMA1" in machine.board.warnings[0]


def test_an_access_of_the_bus_happens_at_the_time_of_its_event(boot_on: Any) -> None:
    machine = boot_on(f"{PINS_ON}again: nop\nnop\nnop\nnop\nb again").run(20)
    machine.board.chip.parts.by_name["GPIOA"].write(0, 4, 0x4444_4433)
    edges = machine.edges
    act_at(machine, 33_333, lambda slot: bool(machine.board.chip.fabric.bus_write(slot, 0x4001_0810, 4, 2)))
    machine.run(100)
    assert edges[-1] == ("PA1", "high", 33_333)


def test_a_wave_that_nobody_looked_at_is_part_of_a_snapshot_as_it_is(boot_on: Any) -> None:
    """Else a state that was restored would differ from the one that went on, until the next edge."""
    machine = boot_on(PINS_ON + "b stop")
    machine.deafen().run(50)
    offer(machine, 96, 40)
    for _ in range(12):
        machine.run(1.3)
        other = boot_on(PINS_ON + "b stop").deafen()
        other.board.restore(machine.board.snapshot())
        assert other.board.snapshot() == machine.board.snapshot()
