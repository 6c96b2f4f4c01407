"""Loops that poll a timer: their time passes at once on the native core, and they end where they do on Python's."""

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim import BluePill
from tests.bluepill_sim.machine import Machine
from tests.bluepill_sim.native.test_native_core import state
from tests.bluepill_sim.native.test_native_system import COMPUTING, CONSTANTS

#: ldr r3, [r0, #36], ldrh r3, [r0, #36]; ldr r3, [r0, #16]; uxth r3, r3.
LOAD_CNT, LOAD_HALF_CNT, LOAD_SR, UXTH = 0x6A43, 0x8C83, 0x6903, 0xB29B


def make(source: str, core: str) -> BluePill:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("P2OS_CORE", core)
        return Machine(source, {}).deafen().board


def program(registers: dict[int, int], loop: str, sets: str = "") -> str:
    """TIM2 has its clock, registers by offset are written, and the loop goes round for ever."""
    stores = "\n".join(f"mov32 r1, #{value}\nstr r1, [r0, #{offset}]" for offset, value in registers.items())
    return f"""mov32 r0, #0x4002101C
        movs r1, #1
        str r1, [r0, #0]
        mov32 r0, #0x40000000
        {stores}
        {sets}
        again: nop
        b w
        w: {loop}
        adds r5, #1
        b again"""


def ends(source: str, slices: tuple[int, ...]) -> list[dict[str, Any]]:
    found = []
    for core, spans in (("native", slices), ("python", (sum(slices),))):
        board = make(source, core)
        for span in spans:
            board.advance_to(board.now_ns + span)
        board.advance_to(sum(slices) + 100_000)
        found.append(state(board))
    return found


@settings(max_examples=40)
@given(
    load=st.sampled_from([LOAD_CNT, LOAD_HALF_CNT]), control=st.sampled_from([0x00, 0x01, 0x11, 0x21, 0x61, 0x09]),
    psc=st.sampled_from([0, 1, 6, 71]), arr=st.one_of(st.integers(0, 9), st.integers(10, 3000), st.just(0xFFFF)),
    count=st.sampled_from([0, 1, 77, 0xFFF0]),
    steps=st.lists(st.one_of(COMPUTING, st.just(UXTH)), min_size=1, max_size=4),
    condition=st.integers(0, 13), constants=st.lists(CONSTANTS, min_size=3, max_size=3),
)  # fmt: skip
def test_a_loop_that_computes_with_cnt_is_left_at_the_same_round_on_both_cores(
    load: int, control: int, psc: int, arr: int, count: int, steps: list[int], condition: int, constants: list[int]
) -> None:
    sets = "\n".join(f"mov32 r{n}, #{value}" for n, value in zip((1, 2, 4), constants, strict=True))
    words = ", ".join(map(str, [load, *steps, 0xD000 | condition << 8 | 0x100 - len(steps) - 3]))
    registers = {0x28: psc, 0x2C: arr, 0x14: 1, 0x24: count, 0x00: control}
    ours, reference = ends(program(registers, f".half {words}", sets), (40_000, 333, 300_000))
    for name in reference:
        assert ours[name] == reference[name], name


@settings(max_examples=30)
@given(
    bit=st.integers(0, 4), arr=st.integers(1, 3000), compare=st.integers(0, 3000), psc=st.sampled_from([0, 3]),
    control=st.sampled_from([1, 0x11, 0x61, 0x09, 0]), clears=st.booleans(),
)  # fmt: skip
def test_a_loop_that_polls_sr_is_left_at_the_same_round_on_both_cores(
    bit: int, arr: int, compare: int, psc: int, control: int, clears: bool
) -> None:
    registers = {0x28: psc, 0x2C: arr, 0x34: compare, 0x14: 1, 0x10: 0, 0x00: control}
    shift = 0x0000 | 31 - bit << 6 | 3 << 3 | 3  # lsls r3, r3, #31 - bit
    clear = "movs r1, #0\nstr r1, [r0, #16]\n" if clears else ""
    ours, reference = ends(program(registers, f".half {LOAD_SR}, {shift}\nbpl w\n{clear}"), (40_000, 333, 300_000))
    for name in reference:
        assert ours[name] == reference[name], name


@pytest.mark.parametrize("words", [(LOAD_CNT, 0x4293), (LOAD_HALF_CNT, 0x4293)])
def test_minutes_of_waiting_for_a_count_are_over_at_once(watchdog: None, words: tuple[int, int]) -> None:
    """CNT reaches 65535 after 65536 * 65535 clocks of 8 MHz, 537 s; cmp r3, r2, bne."""
    source = program(
        {0x28: 0xFFFF, 0x14: 1, 0x00: 1}, f".half {words[0]}, {words[1]}, {0xD1FC}", "mov32 r2, #65535\nmovs r5, #0"
    )
    board = make(source, "native")
    board.advance_to(536_800_000_000)
    assert board.register("R5") == 0
    board.advance_to(536_900_000_000)
    assert board.register("R5") >= 1


def test_minutes_of_waiting_for_an_update_are_over_at_once(watchdog: None) -> None:
    """It comes 65536 * 65536 clocks after the start; lsls r3, r3, #31."""
    source = program({0x28: 0xFFFF, 0x14: 1, 0x10: 0, 0x00: 1}, f".half {LOAD_SR}, {0x07DB}\nbpl w", "movs r5, #0")
    board = make(source, "native")
    board.advance_to(536_870_000_000)
    assert board.register("R5") == 0
    board.advance_to(536_880_000_000)
    assert board.register("R5") >= 1


@pytest.mark.parametrize("target", [65_534, 65_535])
def test_no_count_is_passed_over(watchdog: None, target: int) -> None:
    """Each value of CNT is there for 65536 clocks, thousands of rounds; cmp r3, r2, bne."""
    source = program(
        {0x28: 0xFFFF, 0x14: 1, 0x00: 1}, f".half {LOAD_CNT}, {0x4293}, {0xD1FC}", f"mov32 r2, #{target}\nmovs r5, #0"
    )
    board = make(source, "native")
    board.advance_to(537_000_000_000)
    assert board.register("R5") >= 1


@pytest.mark.parametrize("nops", range(6))
def test_the_round_that_begins_with_a_new_count_is_not_passed_over(nops: int) -> None:
    """A count lasts 35 cycles, seven rounds of five: with some number of nops a round meets its begin."""
    source = f"""mov32 r0, #0x4002101C
        movs r1, #1
        str r1, [r0, #0]
        mov32 r0, #0xE000EDFC
        mov32 r1, #0x01000000
        str r1, [r0, #0]
        mov32 r6, #0xE0001000
        movs r1, #1
        str r1, [r6, #0]
        mov32 r0, #0x40000000
        movs r1, #34
        str r1, [r0, #40]
        movs r1, #1
        str r1, [r0, #20]
        str r1, [r0, #0]
        movs r2, #40
        {chr(10).join(["nop"] * nops)}
        b w
        w: .half {LOAD_CNT}, 0x4293, 0xD1FC
        ldr r0, [r6, #4]
        log r0
        b stop"""
    logs = []
    for core in ("native", "python"):
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("P2OS_CORE", core)
            logs.append(Machine(source, {}).deafen().run(500).log)
    assert logs[0] == logs[1] != []


@pytest.mark.parametrize("core", ["native", "python"])
def test_a_thread_without_privilege_faults_at_its_first_read_of_cyccnt(
    monkeypatch: pytest.MonkeyPatch, core: str
) -> None:
    """The loop has gone round before, with privilege, so that its rounds could be worked out."""
    monkeypatch.setenv("P2OS_CORE", core)
    machine = Machine(
        f"""mov32 r0, #0xE000EDFC
        mov32 r1, #0x01000000
        str r1, [r0, #0]
        mov32 r0, #0xE0001000
        movs r1, #1
        str r1, [r0, #0]
        mov32 r2, #400
        movs r5, #0
        again: ldr r3, [r0, #4]
        subs r3, r2, r3
        .half {0xDAFC}
        adds r5, #1
        mov32 r2, #100000
        movs r1, #1
        msr control, r1
        isb
        b again""", {},
    )  # fmt: skip
    machine.run(2000)
    fault = machine.board.fault
    assert fault is not None
    assert fault.pc == machine.label("again")
    assert fault.at_ns < 70_000, "CYCCNT reads 400 after 50 us"
