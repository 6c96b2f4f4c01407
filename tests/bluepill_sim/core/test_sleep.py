"""WFI, WFE, SEV and sleep on exit: who wakes the core, and when."""

import pytest

SYSTICK_CTRL, SYSTICK_LOAD, SYSTICK_VAL = 0xE000E010, 0xE000E014, 0xE000E018
SCR, ICSR, ISER0 = 0xE000ED10, 0xE000ED04, 0xE000E100
SEVONPEND, SLEEPONEXIT = 1 << 4, 1 << 1
#: HSI after reset: one cycle in ns.
CYCLE_NS = 125


def store(address: int, value: int) -> str:
    return f"mov32 r1, #{address}\nmov32 r2, #{value}\nstr r2, [r1, #0]\n"


def tick_every(cycles: int) -> str:
    return store(SYSTICK_LOAD, cycles - 1) + store(SYSTICK_VAL, 0) + store(SYSTICK_CTRL, 7)


def test_wfi_sleeps_until_the_tick_and_the_handler_runs_first(run) -> None:
    machine = run(tick_every(800) + "wfi\nlog #2\nb stop\ntick: log #1\nbx lr", {15: "tick"})
    assert machine.log[:2] == [1, 2]


def test_wfi_under_primask_wakes_and_the_handler_runs_after_cpsie(boot) -> None:
    """The pattern that livelocks an emulator whose quanta never meet the unmasked window."""
    machine = boot(
        tick_every(800)
        + "loop: cpsid i\ncmp r5, #0\nbne awake\nwfi\nawake: cpsie i\nisb\nmovs r5, #0\nlog #1\nb loop\n"
        "tick: log #2\nbx lr",
        {15: "tick"},
    ).run(1000)
    log = machine.log
    assert log == [2, 1] * (len(log) // 2) + [2] * (len(log) % 2)
    # A tick each 100 µs: ten of them in the first ms, of which the first started a little late.
    assert 18 <= len(log) <= 20


def test_a_tick_while_masked_is_not_lost_by_a_wfi_behind_it(run) -> None:
    """The interrupt is already pending when WFI comes: it falls through."""
    machine = run(
        "cpsid i\n" + store(ICSR, 1 << 28) + "wfi\nlog #1\ncpsie i\nisb\nlog #3\nb stop\npendsv: log #2\nbx lr",
        {14: "pendsv"},
    )
    assert machine.log == [1, 2, 3]


def test_basepri_holds_back_the_wakening_by_wfi(boot) -> None:
    """Unlike PRIMASK: an interrupt that BASEPRI masks does not wake WFI."""
    machine = boot(
        store(0xE000ED20, 0x80 << 24) + "movs r1, #64\nmsr basepri, r1\n" + tick_every(800) + "wfi\nlog #1\nb stop"
    ).run(2000)
    assert machine.log == []
    assert machine.board.is_asleep


def test_a_disabled_interrupt_does_not_wake_wfi(boot) -> None:
    machine = boot("wfi\nlog #1\nb stop").run(50)
    machine.board.chip.fabric.set_line(6, True)
    assert machine.run(50).log == []


def test_sleep_costs_no_engine_time_and_jumps_to_the_deadline(boot) -> None:
    machine = boot(tick_every(8_000_000) + "wfi\nlog #1\nb stop\ntick: bx lr", {15: "tick"})
    machine.run(2_000_000)
    assert machine.is_done
    assert machine.board.activity.last_wfi_ns < 20_000


@pytest.mark.parametrize("instruction", ["wfi", "wfi.w"])
def test_both_encodings_of_wfi_sleep(boot, instruction: str) -> None:
    assert boot(f"{instruction}\nlog #1\nb stop").run(50).board.is_asleep


def test_wfe_falls_through_once_after_sev(boot) -> None:
    machine = boot("sev\nwfe\nlog #1\nwfe\nlog #2\nb stop").run(50)
    assert machine.log == [1]
    assert machine.board.is_asleep
    machine.board.chip.signal("event")
    machine.board.chip.signal("something else")
    assert machine.run(50).log == [1, 2]


def test_wfe_is_woken_by_an_interrupt_taken(run) -> None:
    machine = run(tick_every(800) + "wfe\nlog #2\nb stop\ntick: log #1\nbx lr", {15: "tick"})
    assert machine.log[:2] == [1, 2]


def test_wfe_is_woken_by_a_pending_interrupt_only_with_sevonpend(boot) -> None:
    masked = "cpsid i\n" + tick_every(800)
    assert boot(masked + "wfe\nlog #1\nb stop").run(500).log == []
    assert boot(store(SCR, SEVONPEND) + masked + "wfe\nlog #1\nb stop").run(500).log == [1]


def test_wfe_in_its_wide_encoding_and_yield_are_known(boot) -> None:
    machine = boot("yield\nlog #1\nsev\nwfe.w\nlog #2\nwfe.w\nlog #3\nb stop").run(50)
    assert machine.log == [1, 2]


def test_sleep_on_exit_returns_to_sleep_and_not_to_the_thread(boot) -> None:
    machine = boot(
        store(SCR, SLEEPONEXIT) + tick_every(800) + "wfi\nlog #9\nb stop\ntick: log #1\nbx lr", {15: "tick"}
    ).run(1000)
    assert set(machine.log) == {1}
    assert len(machine.log) == 9
    assert machine.board.is_asleep


def test_an_input_wakes_the_core_at_the_time_it_is_driven(boot) -> None:
    """EXTI line 4 on PA4: the edge is at 1 ms, the handler's first instruction 12 cycles later."""
    machine = boot(
        store(0x40021018, 0x5) + store(0x40010408, 1 << 4) + store(0x40010400, 1 << 4) + store(ISER0, 1 << 10)
        + "wfi\nlog #2\nb stop\nirq: mov32 r1, #0x40010414\nmovs r2, #16\nstr r2, [r1, #0]\nlog #1\nbx lr",
        {16 + 10: "irq"},
    ).run(1000)  # fmt: skip
    assert machine.board.is_asleep
    at = machine.board.now_ns
    machine.board.pin("PA4").drive(True)
    machine.board.advance_to(at + 1)
    assert machine.board.now_ns == at + 12 * CYCLE_NS
    assert machine.run(50).log == [1, 2]
