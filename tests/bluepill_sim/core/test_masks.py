"""PRIMASK, BASEPRI and FAULTMASK: what they hold back, and what an SVC becomes under them."""

import pytest

ICSR, SHPR2 = 0xE000ED04, 0xE000ED1C
PENDSV, NMI = 1 << 28, 1 << 31


def store(address: int, value: int) -> str:
    return f"mov32 r1, #{address}\nmov32 r2, #{value}\nstr r2, [r1, #0]\n"


def test_a_masked_svc_becomes_a_hard_fault_that_is_no_fault_of_the_firmware(run) -> None:
    """NuttX's critical sections rely on it; the return address is the next instruction."""
    machine = run(
        "cpsid i\nsvc #0\nafter: log #2\nb stop\nhard: ldr r0, [sp, #24]\nlog r0\nbx lr\nsvc_handler: log #9\nbx lr",
        {3: "hard", 11: "svc_handler"},
    )
    assert machine.log == [machine.label("after"), 2]
    assert machine.board.fault is None
    assert len(machine.board.warnings) == 1


def test_an_svc_masked_by_basepri_becomes_a_hard_fault(run) -> None:
    machine = run(
        store(SHPR2, 0x80 << 24) + "movs r1, #128\nmsr basepri, r1\nsvc #0\nlog #2\nb stop\nhard: log #1\nbx lr",
        {3: "hard"},
    )
    assert machine.log == [1, 2]


def test_basepri_lets_higher_priorities_through(run) -> None:
    machine = run(
        store(SHPR2, 0x40 << 24) + "movs r1, #128\nmsr basepri, r1\nsvc #0\nlog #2\nb stop\nhandler: log #1\nbx lr",
        {11: "handler"},
    )
    assert machine.log == [1, 2]


def test_the_low_bits_of_basepri_do_not_exist(run) -> None:
    """BASEPRI = 0x0F is 0 on an STM32F103: nothing is masked."""
    machine = run(
        "movs r1, #15\nmsr basepri, r1\n" + store(ICSR, PENDSV) + "isb\nlog #2\nb stop\npendsv: log #1\nbx lr",
        {14: "pendsv"},
    )
    assert machine.log == [1, 2]


def test_pendsv_waits_for_primask_and_comes_right_after_cpsie(run) -> None:
    machine = run(
        "cpsid i\n" + store(ICSR, PENDSV) + "log #1\ncpsie i\nlog #3\nb stop\npendsv: log #2\nbx lr", {14: "pendsv"}
    )
    assert machine.log == [1, 2, 3]


def test_faultmask_holds_back_all_but_nmi(run) -> None:
    machine = run(
        "cpsid f\n" + store(ICSR, PENDSV) + "log #1\n" + store(ICSR, NMI) + "isb\nlog #3\ncpsie f\nlog #5\nb stop\n"
        "pendsv: log #4\nbx lr\nnmi: log #2\nbx lr",
        {14: "pendsv", 2: "nmi"},
    )
    assert machine.log == [1, 2, 3, 4, 5]


def test_faultmask_is_cleared_by_the_return_from_a_handler(run) -> None:
    machine = run("svc #0\nmrs r0, faultmask\nlog r0\nb stop\nhandler: cpsid f\nbx lr", {11: "handler"})
    assert machine.log == [0]


@pytest.mark.parametrize("core", ["python", "native"])
def test_bits_that_do_not_exist_are_not_kept_by_msr(run, core, monkeypatch) -> None:
    monkeypatch.setenv("P2OS_CORE", core)
    machine = run(
        "movs r1, #255\nmsr basepri, r1\nmrs r0, basepri\nlog r0\n"
        "movs r1, #15\nmsr basepri, r1\nmrs r0, basepri\nlog r0\n"
        "mov32 r1, #0x20003003\nmsr psp, r1\nmrs r0, psp\nlog r0\n"
        "mov32 r1, #0x20004ffe\nmsr msp, r1\nmrs r0, msp\nlog r0\nmov r0, sp\nlog r0\n"
        "movs r1, #2\nmsr control, r1\nisb\nmov r0, sp\nlog r0\nmov32 r1, #0x20002001\nmsr psp, r1\nmov r0, sp\nlog r0"
    )
    assert machine.log == [0xF0, 0, 0x2000_3000, 0x2000_4FFC, 0x2000_4FFC, 0x2000_3000, 0x2000_2000]


@pytest.mark.parametrize("core", ["python", "native"])
def test_a_step_over_msr_keeps_no_more(boot, core, monkeypatch) -> None:
    monkeypatch.setenv("P2OS_CORE", core)
    machine = boot("mov32 r1, #0xFF\nmsr basepri, r1\nmrs r0, basepri\nlog r0")
    while not machine.is_done:
        machine.board.chip.step(machine.board.now_ns + 1000)
    assert machine.log == [0xF0]


@pytest.mark.parametrize("core", ["python", "native"])
def test_bits_that_do_not_exist_are_not_kept_by_an_msr_in_a_loop_either(run, core, monkeypatch) -> None:
    """What follows the MSR is known from the second round on."""
    monkeypatch.setenv("P2OS_CORE", core)
    machine = run(
        "movs r4, #4\nloop: mov32 r1, #0xFF\nmsr basepri, r1\nmrs r0, basepri\nb next\n"
        "next: movs r1, #0\nmsr basepri, r1\nlog r0\nsubs r4, #1\nbne loop"
    )
    assert machine.log == [0xF0] * 4
