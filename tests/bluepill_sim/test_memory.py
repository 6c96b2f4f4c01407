"""Memories and the bus: aliases, bit-band, page boundaries, accesses that must happen once, flash."""

import pytest

RCC_APB2ENR, GPIOA_CRL, GPIOA_ODR, GPIOA_BSRR = 0x40021018, 0x40010800, 0x4001080C, 0x40010810
FLASH_KEYR, FLASH_SR, FLASH_CR = 0x40022004, 0x4002200C, 0x40022010


def store(address: int, value: int) -> str:
    return f"mov32 r1, #{address}\nmov32 r2, #{value}\nstr r2, [r1, #0]\n"


def load(address: int) -> str:
    return f"mov32 r1, #{address}\nldr r0, [r1, #0]\nlog r0\n"


def bit_alias(address: int, bit: int) -> int:
    return (address & 0xF000_0000) + 0x0200_0000 + (address & 0xFFFFF) * 32 + bit * 4


PORT_A = store(RCC_APB2ENR, 1 << 2) + store(GPIOA_CRL, 0x22222222)


def test_flash_is_seen_at_zero_too(run) -> None:
    machine = run(load(0x0800_0000) + load(0))
    assert machine.log == [0x2000_5000] * 2


def test_code_runs_from_the_alias_at_zero(run) -> None:
    machine = run(
        "mov32 r1, #low\nmov32 r2, #0x08000000\nsubs r1, r1, r2\nadds r1, #1\nbx r1\n"
        "low: log #1\nmov32 r1, #back+1\nbx r1\nback: log #2"
    )
    assert machine.log == [1, 2]


def test_code_written_to_sram_runs_and_can_be_rewritten(run) -> None:
    machine = run(
        store(0x2000_0800, 0x47702001)  # movs r0, #1 ; bx lr
        + "mov32 r3, #0x20000801\nblx r3\nlog r0\n"
        + store(0x2000_0800, 0x47702002)
        + "blx r3\nlog r0"
    )
    assert machine.log == [1, 2]


def test_an_access_to_a_peripheral_happens_once_even_when_it_ends_the_slice(boot) -> None:
    """Unicorn runs an access twice if it is stopped inside: reading COUNTFLAG twice would lose it."""
    machine = boot(PORT_A + "movs r4, #5\nloop: " + store(GPIOA_BSRR, 1) + store(GPIOA_BSRR, 1 << 16)
                   + "subs r4, #1\nbne loop\nlog #1")  # fmt: skip
    machine.board.subscribe_pins(["PA0"], lambda _rows: None, ends_slice=["PA0"])
    for _ in range(200):
        machine.board.advance_to(machine.board.now_ns + 5_000)
    assert machine.log == [1]
    levels = [drive for name, drive, _ in machine.edges if name == "PA0"]
    assert levels == ["low", *["high", "low"] * 5]


def test_bits_of_the_sram_have_words_of_their_own(run) -> None:
    machine = run(
        store(0x2000_0800, 0xF0)
        + store(bit_alias(0x2000_0800, 0), 1)
        + store(bit_alias(0x2000_0800, 31), 0xFFFF_FFFF)
        + store(bit_alias(0x2000_0800, 4), 0)
        + load(0x2000_0800)
        + load(bit_alias(0x2000_0800, 31))
        + load(bit_alias(0x2000_0800, 1))
    )
    assert machine.log == [0x8000_00E1, 1, 0]


def test_bits_of_a_peripheral_are_read_changed_and_written(run) -> None:
    machine = run(
        PORT_A
        + store(bit_alias(GPIOA_ODR, 3), 1)
        + store(bit_alias(GPIOA_ODR, 5), 1)
        + store(bit_alias(GPIOA_ODR, 3), 0)
        + load(GPIOA_ODR)
        + load(bit_alias(GPIOA_ODR, 5))
    )
    assert machine.log == [1 << 5, 1]
    assert machine.board.warnings == []


def test_neighbouring_pages_of_one_kilobyte_are_different_peripherals(run) -> None:
    """GPIOA ends at 0x40010BFF, GPIOB begins at 0x40010C00."""
    machine = run(
        store(RCC_APB2ENR, 0xC) + store(0x40010BFC, 1) + store(0x40010C0C, 0x55) + load(0x40010C0C) + load(GPIOA_ODR)
    )
    assert machine.log == [0x55, 0]
    assert any("GPIOA+0x3fc" in warning for warning in machine.board.warnings)


def test_code_across_a_page_boundary_is_charged_once(run) -> None:
    """Unicorn cuts blocks at 1 KiB: a straight run costs the same on both sides of a boundary."""
    cycles = []
    for pad in (0, 320):
        machine = run(
            "b over\n" + "nop\n" * pad
            + "over: mov32 r6, #0xE000EDFC\nmov32 r5, #0x01000000\nstr r5, [r6, #0]\n"
            + "mov32 r6, #0xE0001000\nmovs r5, #1\nstr r5, [r6, #0]\nisb\nldr r4, [r6, #4]\n"
            + "nop\n" * 100 + "ldr r5, [r6, #4]\nsubs r0, r5, r4\nlog r0"
        )  # fmt: skip
        cycles += machine.log
    assert cycles == [102, 102]  # 100 nops, and a load of two cycles


def test_a_peripheral_without_its_clock_reads_zero_and_is_named_once(run) -> None:
    machine = run(store(GPIOA_ODR, 1) + load(GPIOA_ODR) + store(RCC_APB2ENR, 4) + load(GPIOA_ODR))
    assert machine.log == [0, 0]
    (warning,) = machine.board.warnings
    assert "GPIOA has no clock: RCC_APB2ENR bit 2 is 0 (write of 0x1 to 0x4001080c) at start+" in warning


def test_a_de_initialization_without_a_clock_is_nothing_to_warn_of(run) -> None:
    # As HAL_GPIO_DeInit and HAL_UART_DeInit do it: fields back to their reset values, the rest as it was read, 0.
    text = "".join(load(0x40010800) + store(0x40010800, 4 << 4 * n) + store(GPIOA_ODR, 0) for n in range(8))
    text += load(0x4001380C) + store(0x4001380C, 0) + store(0x40013810, 0)
    assert run(text).board.warnings == []


def test_clearing_flags_or_writing_reserved_bits_without_a_clock_is_nothing_to_warn_of(run) -> None:
    # As ChibiOS's dmaInit: all flags of a controller that has no clock yet; bits 31 to 16 of USART1_BRR are reserved.
    text = store(0x40020004, 0xFFFFFFFF) + store(0x40013800, 0xFFFFFFFF) + store(0x40013808, 0xFFFF0000)
    assert run("mov32 r6, #0x40021014\nmovs r5, #0\nstr r5, [r6, #0]\n" + text).board.warnings == []


@pytest.mark.parametrize(
    ("address", "value", "name"),
    [
        (0x40020008, 1, "DMA1"),  # CCR1
        (0x40010810, 1, "GPIOA"),  # BSRR reads 0
        (0x40010818, 1, "GPIOA"),  # LCKR takes its bits by a sequence
        (0x40013804, 1, "USART1"),  # DR
        (0x40013808, 1 << 15, "USART1"),  # the highest bit of BRR
    ],
)
def test_a_write_without_a_clock_that_would_do_something_is_named(run, address: int, value: int, name: str) -> None:
    (warning,) = run(store(address, value)).board.warnings
    assert f"{name} has no clock" in warning


def test_reading_on_without_a_clock_is_named(boot) -> None:
    board = boot("mov32 r1, #0x40013800\nloop: ldr r0, [r1, #0]\ncmp r0, #0\nbeq loop\n").run(999).board
    assert board.warnings == []
    board.run_for("3 us")
    assert "USART1 has no clock: RCC_APB2ENR bit 14 is 0 (read of 0x40013800)" in board.warnings[0]


def test_reading_before_each_of_many_short_uses_is_not_reading_on(boot) -> None:
    """As an ADC driver does that gives the clock for each conversion: read, clock on, use, clock off, and again."""
    uses = "mov32 r1, #0x40013800\nmov32 r2, #0x40021018\nmov32 r3, #0x4000\nmovs r4, #0\n"
    uses += "loop: ldr r0, [r1, #0]\nstr r3, [r2, #0]\nldr r0, [r1, #0]\nstr r4, [r2, #0]\nb loop\n"
    board = boot(uses).run(5000).board
    assert board.warnings == []


def test_priorities_and_lines_beyond_the_chip_are_nothing_to_warn_of(run) -> None:
    addresses = [0xE000E400 + 4 * n for n in range(11, 60)]
    addresses += [base + 4 * n for base in (0xE000E100, 0xE000E180, 0xE000E280) for n in range(2, 8)]
    machine = run("".join(store(at, 0xFFFFFFFF) + load(at) for at in addresses))
    assert set(machine.log) == {0}
    assert machine.board.warnings == []


def test_what_is_not_modelled_is_named_once_and_reads_zero(run) -> None:
    machine = run(store(0x40013400, 1) + load(0x40013400) + load(0x40023C00) + load(0xE000EFA0) + store(0xE000EFA4, 1))
    assert machine.log == [0, 0, 0]
    texts = machine.board.warnings
    assert [text.split(" at ")[0] for text in texts] == [
        "TIM8 is not modelled (write of 0x1 to 0x40013400)",
        "no peripheral is here (read of 0x40023c00)",
        "0xe000efa0 of the system control space is not modelled",
        "0xe000efa4 of the system control space is not modelled",
    ]


def test_the_unique_id_and_the_flash_size_are_there(run) -> None:
    machine = run(load(0x1FFFF7E0) + load(0x1FFFF7E8) + load(0xE0042000) + load(0xE000ED00))
    size, unique_id, idcode, cpuid = machine.log
    assert size & 0xFFFF == 64
    assert unique_id == int.from_bytes(b"P2OS", "little")
    assert idcode & 0xFFF == 0x410
    assert cpuid == 0x411FC231


UNLOCK = store(FLASH_KEYR, 0x45670123) + store(FLASH_KEYR, 0xCDEF89AB)
WAIT = f"mov32 r1, #{FLASH_SR}\nwait: ldr r0, [r1, #0]\nmovs r3, #1\nmov r4, r0\n.half 0x4218\nbne wait\n"


def test_flash_is_programmed_by_its_controller(run) -> None:
    machine = run(
        UNLOCK + store(FLASH_CR, 1) + "mov32 r1, #0x08008000\nmov32 r2, #0x1234\nstrh r2, [r1, #0]\n" + WAIT
        + load(0x0800_8000) + load(0x8000)
    )  # fmt: skip
    assert machine.log == [0xFFFF1234] * 2
    assert machine.board.now_ns > 52_500


def test_a_write_to_locked_flash_changes_nothing(run) -> None:
    machine = run("mov32 r1, #0x08008000\nmov32 r2, #0x1234\nstrh r2, [r1, #0]\nisb\n" + load(0x0800_8000))
    assert machine.log == [0xFFFFFFFF]
    assert len(machine.board.warnings) == 1


def test_code_programmed_into_flash_runs_and_is_forgotten_when_erased(run) -> None:
    call = "mov32 r3, #0x08008001\nblx r3\nlog r0\n"
    machine = run(
        UNLOCK + store(FLASH_CR, 1) + "mov32 r1, #0x08008000\nmov32 r2, #0x2007\nstrh r2, [r1, #0]\n" + WAIT
        + "mov32 r1, #0x08008002\nmov32 r2, #0x4770\nstrh r2, [r1, #0]\n" + WAIT.replace("wait", "again") + call
        + store(FLASH_CR, 2) + store(FLASH_CR + 4, 0x08008000) + store(FLASH_CR, 0x42) + WAIT.replace("wait", "third")
        + load(0x0800_8000) + "b stop", us=50_000,
    )  # fmt: skip
    assert machine.log == [7, 0xFFFFFFFF]


@pytest.mark.parametrize("offset", [0, 1, 2, 3])
def test_priorities_are_written_by_bytes(run, offset: int) -> None:
    machine = run(
        f"mov32 r1, #0xE000E400\nmovs r2, #0xF5\nstrb r2, [r1, #{offset}]\nldr r0, [r1, #0]\nlog r0\n"
        f"ldrb r0, [r1, #{offset}]\nlog r0"
    )
    assert machine.log == [0xF0 << 8 * offset, 0xF0]


def test_set_and_clear_registers_of_the_nvic_show_one_state(run) -> None:
    machine = run(
        "cpsid i\n" + store(0xE000E100, 0x30) + store(0xE000E180, 0x10) + load(0xE000E100) + load(0xE000E180)
        + store(0xE000E204, 0x3) + store(0xE000E284, 0x1) + load(0xE000E204) + load(0xE000E300)
        + store(0xE000E104, 0xFFFFFFFF) + load(0xE000E104)
    )  # fmt: skip
    assert machine.log == [0x20, 0x20, 2, 0, 0x7FF]


def test_other_registers_of_the_core_keep_what_exists_of_them(run) -> None:
    machine = run(
        store(0xE0042004, 0x107) + load(0xE0042004) + store(0xE000ED34, 5) + load(0xE000ED34) + store(0xE000ED38, 6)
        + load(0xE000ED38) + load(0xE000ED0C) + load(0xE000ED90) + load(0xE000E004) + load(0xE000E008)
        + load(0xE000E01C) + load(0xE000EDF0) + load(0xE000ED30) + store(0xE000ED30, 1) + store(0xE000E008, 1)
        + load(0xE000ED10) + load(0xE000ED14) + store(0xE000ED00, 7) + store(0xE000ED0C, 0x05FA0002)
    )  # fmt: skip
    assert machine.log == [0x107, 5, 6, 0xFA050000, 0, 1, 0, 0x40002328, 0, 0, 0, 0x200]
    assert len(machine.board.warnings) == 1
