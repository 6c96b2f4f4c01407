"""Resets, their causes, and where a program starts."""

import pytest

from bluepill_sim.board import BluePill
from bluepill_sim.peripherals.rcc import ResetCause
from simbase.timing import Reason
from tests.tools.examples import EXAMPLES

AIRCR = 0xE000ED0C
RCC_CSR, RCC_APB1ENR = 0x40021024, 0x4002101C
IWDG_KR, WWDG_CR = 0x40003000, 0x40002C00
START_IWDG = f"mov32 r1, #{IWDG_KR}\nmov32 r2, #0xCCCC\nstr r2, [r1, #0]\n"


def store(address: int, value: int) -> str:
    return f"mov32 r1, #{address}\nmov32 r2, #{value}\nstr r2, [r1, #0]\n"


def test_a_reset_at_full_speed_is_nothing_to_warn_of() -> None:
    board = BluePill(str(EXAMPLES / "dodge.elf"))
    board.chip.pins.is_serial_input = lambda _pin: True
    board.run_for("10 ms")
    assert board.hclk_hz == 72_000_000
    board.reset()
    assert board.hclk_hz == 8_000_000
    board.run_for("10 ms")
    assert board.warnings == []


def test_a_reset_by_software_starts_the_program_again(boot) -> None:
    machine = boot(
        """
        mov32 r3, #0x20001000
        ldr r0, [r3, #0]
        adds r0, #1
        str r0, [r3, #0]
        cmp r0, #3
        beq stop
        """
        + store(AIRCR, 0x05FA0004)
        + "here: b here"
    )
    machine.run(500)
    assert machine.is_done
    assert machine.board.read_memory(0x20001000, 4) == b"\x03\0\0\0"
    assert machine.board.now_ns >= 500_000


def test_a_write_to_aircr_without_its_key_does_nothing(run) -> None:
    assert run(store(AIRCR, 0x12340004) + "log #1").log == [1]


def test_vectors_follow_vtor(run) -> None:
    machine = run(
        """
        mov32 r1, #0x20004000
        mov32 r2, #handler+1
        str r2, [r1, #44]
        mov32 r3, #0xE000ED08
        str r1, [r3, #0]
        ldr r0, [r3, #0]
        svc #0
        log r0
        b stop
handler: log #1
        bx lr"""
    )
    assert machine.log == [1, 0x20004000]


def test_a_program_above_a_boot_loader_starts_at_its_own_vectors(boot) -> None:
    machine = boot("svc #0\nlog #2\nb stop\nhandler: log #1\nbx lr", {11: "handler"}, origin=0x0800_2000).run()
    assert machine.log == [1, 2]
    assert machine.board.image.vector_table == 0x0800_2000


#: Logs RCC_CSR, clears its flags, and counts the starts in SRAM; `again` is done only at the first.
TELL = f"""
        mov32 r1, #{RCC_CSR}
        ldr r0, [r1, #0]
        mov32 r3, #0x20001000
        ldr r4, [r3, #0]
        adds r4, #1
        str r4, [r3, #0]
        mov r5, r4
        adds r5, r5, r5
        adds r5, r5, r5
        str r0, [r3, r5]
        mov32 r2, #0x01000000
        str r2, [r1, #0]
        cmp r4, #1
        beq again
        b stop
again:  nop
"""
FLAGS = {
    ResetCause.POWER: 0x0C00_0000,
    ResetCause.PIN: 0x0400_0000,
    ResetCause.SOFTWARE: 0x1400_0000,
    ResetCause.IWDG: 0x2400_0000,
    ResetCause.WWDG: 0x4400_0000,
}
#: What the program does at its first start.
RESETS = {
    ResetCause.SOFTWARE: store(AIRCR, 0x05FA0004) + "here: b here",
    ResetCause.IWDG: START_IWDG + "here: b here",
    ResetCause.WWDG: store(RCC_APB1ENR, 1 << 11) + store(WWDG_CR, 0xFF) + "here: wfi\nb here",
}


def starts(machine) -> list[int]:
    """RCC_CSR at each start, oldest first."""
    data = machine.board.read_memory(0x20001000, 40)
    words = [int.from_bytes(data[n : n + 4], "little") for n in range(0, 40, 4)]
    return words[1 : words[0] + 1]


@pytest.mark.parametrize("cause", RESETS)
def test_the_program_reads_why_it_was_reset(boot, cause: ResetCause) -> None:
    machine = boot(TELL + RESETS[cause]).run(500_000)
    assert starts(machine) == [FLAGS[ResetCause.POWER], FLAGS[cause]]
    assert machine.is_done
    assert machine.board.fault is None


def test_the_reset_button_is_distinguished_from_power(boot) -> None:
    machine = boot(TELL).run(100)
    machine.board.reset()
    machine.run(100)
    assert starts(machine) == [FLAGS[ResetCause.POWER], FLAGS[ResetCause.PIN]]


def test_a_power_cut_clears_the_sram_and_the_flags(boot) -> None:
    machine = boot(TELL).run(100)
    machine.board.reset()
    machine.run(100)
    machine.board.chip.reset(ResetCause.POWER)
    machine.run(100)
    assert starts(machine) == [FLAGS[ResetCause.POWER]]


def test_a_watchdog_ends_a_lockup_whatever_the_slices(boot) -> None:
    """The stack is gone, so that the fault cannot be stacked: nothing but the watchdog moves the core."""
    source = TELL + START_IWDG + "mov32 r0, #0x10000000\nmov sp, r0\npush {r0}"
    whole, sliced = boot(source), boot(source)
    assert whole.board.advance_to(1_000_000_000).reason is Reason.DEADLINE
    sliced.run(1_000_000, slice_us=7000)
    assert starts(whole) == starts(sliced) == [FLAGS[ResetCause.POWER], FLAGS[ResetCause.IWDG]]
    # Started after two dozen cycles of 125 ns: 4096 counts of 100 us.
    assert whole.board.fault is not None
    assert whole.board.fault.is_lockup
    assert whole.is_done


def test_a_lockup_without_a_watchdog_is_the_end(boot) -> None:
    machine = boot("mov32 r0, #0x10000000\nmov sp, r0\npush {r0}")
    assert machine.board.advance_to(1_000_000).reason is Reason.HALT


def test_a_watchdog_resets_at_the_first_boundary_at_its_time(boot) -> None:
    machine = boot(TELL + START_IWDG + "here: b here")
    iwdg = machine.board.chip.parts.by_name["IWDG"]
    machine.run(1000)
    due = iwdg.due_ns
    machine.board.advance_to(due - 1000)
    assert len(starts(machine)) == 1
    assert machine.board.pc == machine.label("here")
    machine.board.advance_to(due)
    assert machine.board.pc == machine.label("start")


@pytest.mark.parametrize(("rounds", "count"), [(13_000, 1), (30_000, 2)])
def test_a_program_that_feeds_its_watchdog_in_time_lives(boot, rounds: int, count: int) -> None:
    """Ten milliseconds: 13000 rounds of three cycles of 125 ns are 4.9 ms, 30000 are 11.3 ms."""
    ten_ms = store(IWDG_KR, 0x5555) + store(IWDG_KR + 8, 99)
    feed = f"mov32 r2, #0xAAAA\nfeed: str r2, [r1, #0]\nmov32 r3, #{rounds}\nd: subs r3, #1\nbne d\nb feed"
    machine = boot(TELL + ten_ms + START_IWDG + feed).run(60_000)
    assert len(starts(machine)) == count


SKIP_TWO_BYTES = "hard: ldr r0, [sp, #24]\nadds r0, #2\nstr r0, [sp, #24]\nbx lr\n"


@pytest.mark.parametrize("core", ["python", "native"])
def test_a_firmware_that_comes_back_from_a_hard_fault_has_not_died(boot, core, monkeypatch) -> None:
    monkeypatch.setenv("P2OS_CORE", core)
    machine = boot("udf\nlog #1\nb stop\n" + SKIP_TWO_BYTES, {3: "hard"}).run(100)
    board = machine.board
    assert machine.log == [1]
    assert (board.has_died, board.fault is not None) == (False, True)
    assert board.verdict.startswith(
        "the firmware came back from a HardFault: UsageFault: undefined instruction at start"
    )


@pytest.mark.parametrize("core", ["python", "native"])
@pytest.mark.parametrize("slice_ns", [100, 1700, 500_000])
@pytest.mark.parametrize(("returns", "dies"), [(15, False), (16, True), (40, True)])
def test_a_handler_that_comes_back_to_the_same_fault_has_died_until_it_goes_on(
    boot, core, slice_ns, returns, dies, monkeypatch
) -> None:
    """A word of SRAM counts how often the handler ran; once it has come back so often, it skips the instruction."""
    monkeypatch.setenv("P2OS_CORE", core)
    count = "hard: mov32 r1, #0x20001000\nldr r0, [r1, #0]\nadds r0, #1\nstr r0, [r1, #0]\n"
    skip = SKIP_TWO_BYTES.removeprefix("hard: ").removesuffix("bx lr\n")
    text = f"udf\nlog #1\nb stop\n{count}cmp r0, #{returns + 1}\nbne back\n{skip}back: bx lr\n"
    board = boot(text, {3: "hard"}).board
    seen = []
    while board.now_ns < 500_000:
        board.advance_to(board.now_ns + slice_ns)
        seen.append(board.has_died and not board._handles_hard_fault())
    assert board.fault.returns == returns
    assert any(seen) is (dies and slice_ns < 500_000)
    assert not board.has_died, "it went on"
    assert board.fault.at_ns < 1000, "the first is kept"


@pytest.mark.parametrize("core", ["python", "native"])
def test_an_empty_hard_fault_handler_is_a_death_whenever_one_looks(boot, core, monkeypatch) -> None:
    monkeypatch.setenv("P2OS_CORE", core)
    board = boot("udf\nb stop\nhard: bx lr\n", {3: "hard"}).board
    verdicts = []
    for us in range(100, 140):
        board.advance_to(us * 1000)
        assert board.has_died
        verdicts.append((board.fault.at_ns, board.fault.returns))
    assert len({at_ns for at_ns, _ in verdicts}) == 1
    assert board.verdict.startswith("firmware fault: UsageFault: undefined instruction at start")
    assert "its handler came back to it again and again" in board.verdict


@pytest.mark.parametrize("core", ["python", "native"])
@pytest.mark.parametrize("slice_ns", [100, 50_000])
def test_a_lockup_at_the_instruction_that_faulted_before_is_reported(boot, core, slice_ns, monkeypatch) -> None:
    """The same fault, with all registers as they were, but under FAULTMASK, where no HardFault can be entered."""
    monkeypatch.setenv("P2OS_CORE", core)
    board = boot("again: udf\ncpsid f\nb again\n" + SKIP_TWO_BYTES, {3: "hard"}).board
    while board.now_ns < 200_000:
        board.advance_to(board.now_ns + slice_ns)
    assert board.fault.is_lockup
    assert board.has_died
    assert board.fault.returns == 0


@pytest.mark.parametrize("core", ["python", "native"])
@pytest.mark.parametrize("slice_ns", [100, 50_000])
def test_faults_in_turn_are_none_that_its_handler_comes_back_to(boot, core, slice_ns, monkeypatch) -> None:
    monkeypatch.setenv("P2OS_CORE", core)
    board = boot("again: udf\nnop\nudf\nb again\n" + SKIP_TWO_BYTES, {3: "hard"}).board
    while board.now_ns < 500_000:
        board.advance_to(board.now_ns + slice_ns)
        assert board.fault is None or board.fault.returns == 0


def test_the_fault_that_kills_is_shown_in_place_of_one_that_was_survived(boot) -> None:
    text = "udf\nmovs r4, #1\nmovs r3, #0\nldr r3, [r3, #0]\nmov32 r3, #0x60000000\nldr r3, [r3, #0]\nb stop\n"
    again = "hard: cmp r4, #1\nbeq here\n" + SKIP_TWO_BYTES.removeprefix("hard: ") + "here: b here\n"
    board = boot(text + again, {3: "hard"}).run(100).board
    assert board.has_died
    assert "read of nothing" in board.verdict


def test_a_reset_out_of_a_fault_is_a_death_and_is_counted(boot) -> None:
    text = "mov32 r3, #0x20001000\nldr r0, [r3, #0]\nadds r0, #1\nstr r0, [r3, #0]\ncmp r0, #4\nbeq stop\nudf\nb stop\n"
    machine = boot(text + "hard: " + store(AIRCR, 0x05FA0004) + "here: b here", {3: "hard"}).run(500)
    board = machine.board
    assert machine.is_done
    assert board.has_died
    assert dict(board.resets) == {ResetCause.SOFTWARE: 3}
    assert "firmware fault: UsageFault" in board.verdict
    assert board.verdict.endswith("a reset ended it; 3 resets (SOFTWARE 3)")
    other = BluePill(machine.image)
    other.restore(board.snapshot())
    assert other.verdict == board.verdict
    other.reset()
    assert (other.has_died, other.verdict) == (False, "4 resets (SOFTWARE 3, PIN 1)")


@pytest.mark.parametrize("rounds", range(84, 111, 3))
def test_what_is_due_in_the_block_that_asks_for_a_reset_comes_before_it_on_both_cores(
    boot, monkeypatch: pytest.MonkeyPatch, rounds: int
) -> None:
    """A character ends, or does not, before the boundary at which the reset is made."""
    source = (
        store(0x4002_1018, 0x4005) + store(0x4001_0804, 0x4444_44B4) + store(0x4001_3808, 16)
        + store(0x4001_380C, 0x2008) + store(0x4001_3804, 0x41) + f"movs r3, #{rounds}\nwait: subs r3, #1\nbne wait\n"
        + store(AIRCR, 0x05FA_0004) + "nop\n" * 30 + "b stop"
    )  # fmt: skip
    seen = []
    for core in ("native", "python"):
        monkeypatch.setenv("P2OS_CORE", core)
        machine = boot(source).run(65)
        seen.append((bytes(machine.sent), machine.board.resets, machine.board.cycle))
    assert seen[0] == seen[1]
    assert seen[0][1], "the reset has come"


@pytest.mark.parametrize("core", ["native", "python"])
def test_a_locked_up_chip_goes_on_but_for_its_core(boot, monkeypatch: pytest.MonkeyPatch, core: str) -> None:
    """A character that is on its way comes out in the same run in which the core locks up."""
    monkeypatch.setenv("P2OS_CORE", core)
    machine = boot(
        store(0x4002_1018, 0x4005) + store(0x4001_0804, 0x4444_44B4) + store(0x4001_3808, 16)
        + store(0x4001_380C, 0x2008) + store(0x4001_3804, 0x41) + "cpsid f\nudf\nb stop"
    )  # fmt: skip
    reached = machine.board.advance_to(1_000_000)
    assert machine.board.fault.is_lockup
    assert (reached.reason, bytes(machine.sent)) == (Reason.HALT, b"A")
