"""Every trap of the engine and of the architecture that was ever found, and the test that holds it.

The table is the index; the tests here fill what the other files leave.
"""

import ast
import random
import struct
from pathlib import Path

import pytest

from bluepill_sim.board import BluePill
from bluepill_sim.extension.library import core_chosen
from bluepill_sim.program.image import Image, SymbolTable
from tests.bluepill_sim.machine import Machine

HERE = Path(__file__).parent
RCC_APB2ENR, GPIOA_CRL, GPIOA_BSRR = 0x4002_1018, 0x4001_0800, 0x4001_0810
FLASH_KEYR, FLASH_SR, FLASH_CR = 0x4002_2004, 0x4002_200C, 0x4002_2010

#: What once went wrong, or would; the tests that hold it (file:test; no file: this one).
TRAPS = {
    "MODE_MCLASS silently makes a Cortex-M33": [
        "test_faults:test_a_fault_without_a_handler_is_a_hard_fault_that_names_its_place"
    ],
    "no NVIC, SysTick or SCB: exceptions by hand": ["test_exceptions:test_svc_enters_its_handler_and_returns_after_it"],
    "SVC, BKPT, NOCP, LDREX, XN, UDF and ARM state each end a run in their own way": [
        "test_faults:test_a_fault_without_a_handler_is_a_hard_fault_that_names_its_place"
    ],
    "entry: IPSR, then CPSR, or the mode is stale": [
        "test_stacks:test_a_thread_on_psp_without_privilege_is_interrupted_and_goes_on"
    ],
    "return: four instructions, two numbers": ["test_exceptions:test_every_way_of_returning_from_a_handler_works"],
    "WFI comes back like an expired count": ["test_sleep:test_wfi_sleeps_until_the_tick_and_the_handler_runs_first"],
    "WFE and YIELD are taken for undefined": ["test_sleep:test_wfe_in_its_wide_encoding_and_yield_are_known"],
    "cpsid, wfi, cpsie, isb: the open window never meets a boundary": [
        "test_sleep:test_wfi_under_primask_wakes_and_the_handler_runs_after_cpsie",
        "test_sleep:test_a_tick_while_masked_is_not_lost_by_a_wfi_behind_it",
    ],
    "nPRIV hides MSP, PSP and CONTROL": [
        "test_stacks:test_a_thread_on_psp_without_privilege_is_interrupted_and_goes_on",
        "test_stacks:test_nested_interrupts_of_an_unprivileged_thread_unwind_in_order",
    ],
    "a stop inside an access runs it twice": [
        "test_memory:test_an_access_to_a_peripheral_happens_once_even_when_it_ends_the_slice",
        "test_debug_halts:test_a_watched_access_to_a_peripheral_is_made_once",
    ],
    "the PC inside an access is that of the block": [
        "test_faults:test_a_fault_without_a_handler_is_a_hard_fault_that_names_its_place",
        "test_a_warning_names_the_accessing_instruction",
    ],
    "accesses of several words and unaligned ones arrive in pieces": [
        "test_several_words_of_a_peripheral_arrive_one_by_one"
    ],
    "unaligned LDRD, LDM pass; division by zero cannot trap": [
        "test_faults:test_an_aligned_multiple_transfer_passes_and_a_later_unaligned_one_traps",
        "test_faults:test_division_by_zero_gives_zero_while_the_trap_is_off_and_traps_once_it_is_on",
    ],
    "a hook cannot end a run inside an IT block": [
        "test_debug_halts:test_a_trap_inside_an_it_block_leaves_what_follows_undone",
        "test_debug_halts:test_a_breakpoint_inside_an_it_block_stops_there_and_the_rest_keeps_its_conditions",
    ],
    "counting instructions leaves out what IT skips": [
        "test_against_qemu:test_random_programs_do_not_depend_on_breakpoints_and_steps",
        "test_time:test_block_costs_agree_with_single_instructions",
    ],
    "pages of 1 KiB": [
        "test_memory:test_neighbouring_pages_of_one_kilobyte_are_different_peripherals",
        "test_memory:test_code_across_a_page_boundary_is_charged_once",
    ],
    "buffers and hooks must outlive the library's handle": ["test_a_machine_outlives_the_boards_around_it"],
    "hooks that trap stay where code is replaced": ["test_code_that_is_replaced_leaves_no_trap_behind"],
    "two aliases of the flash are two translations": [
        "test_memory:test_flash_is_seen_at_zero_too",
        "test_code_changed_by_one_alias_changes_at_the_other",
    ],
    "bit-band": [
        "test_memory:test_bits_of_a_peripheral_are_read_changed_and_written",
        "test_memory:test_bits_of_the_sram_have_words_of_their_own",
    ],
    "Python exceptions inside callbacks": [
        "test_board:test_an_exception_in_a_listener_comes_out_of_advance_to",
        "test_board:test_ctrl_c_while_blocks_run_comes_out_and_the_run_can_go_on",
    ],
    "ITSTATE goes through CPSR": [
        "test_exceptions:test_an_svc_inside_an_it_block_puts_itstate_aside_and_back",
        "test_exceptions:test_an_it_block_across_a_page_boundary_survives_stops_and_interrupts",
    ],
    "the ITSTATE of a trap lives on in its handler": ["test_a_handler_begins_outside_the_it_block_that_trapped"],
    "an exception breaks the exclusive reservation": ["test_stacks:test_an_exception_breaks_the_exclusive_reservation"],
    "BASEPRI keeps bits that an F103 has not": ["test_masks:test_the_low_bits_of_basepri_do_not_exist"],
    "counters stand still inside a block": ["test_time:test_counters_move_inside_a_straight_run_of_code"],
    "delay loops cost three cycles a round": ["test_time:test_a_delay_loop_takes_three_cycles_a_round"],
    "SVC while masked escalates (NuttX lives on it)": [
        "test_masks:test_a_masked_svc_becomes_a_hard_fault_that_is_no_fault_of_the_firmware",
        "test_masks:test_an_svc_masked_by_basepri_becomes_a_hard_fault",
    ],
    "tail-chain from SVC to PendSV": ["test_exceptions:test_svc_to_pendsv_tail_chains_without_unstacking"],
    "programs behind a boot loader, DBGMCU, unique id": [
        "test_resets:test_a_program_above_a_boot_loader_starts_at_its_own_vectors",
        "test_memory:test_the_unique_id_and_the_flash_size_are_there",
    ],
    "a refused write to flash is stored by the engine": ["test_a_refused_write_to_flash_is_never_seen"],
    "a peripheral that stays due hangs the host": ["test_a_peripheral_that_stays_due_is_a_bug_that_is_named"],
    "slices change the result": [
        "test_time:test_the_length_of_the_slices_changes_nothing",
        "test_against_qemu:test_random_programs_do_not_depend_on_slices",
    ],
    "a hostile image": ["test_images_of_random_bytes_neither_hang_nor_break_the_host"],
}


def store(address: int, value: int) -> str:
    return f"mov32 r1, #{address}\nmov32 r2, #{value}\nstr r2, [r1, #0]\n"


@pytest.mark.parametrize("trap", TRAPS)
def test_every_trap_has_its_test(trap: str) -> None:
    for name in TRAPS[trap]:
        file, _, test = name.rpartition(":")
        [path] = HERE.parent.rglob(f"{file or 'test_traps'}.py")
        tree = ast.parse(path.read_text(encoding="utf-8"))
        assert test in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}, name


@pytest.mark.parametrize("address", [0x0800_8000, 0x8000])
@pytest.mark.parametrize("write", ["str r2, [r1, #0]", "strh r2, [r1, #0]", "strb r2, [r1, #0]", "stmia r1!, {r2, r3}"])
def test_a_refused_write_to_flash_is_never_seen(run, write: str, address: int) -> None:
    """The controller is locked; the read stands in the same block, right after the write."""
    machine = run(
        f"mov32 r1, #{address}\nmov32 r5, #{address}\nmov32 r2, #0x1234\n{write}\nldr r0, [r5, #0]\nlog r0\n"
        "mov r0, r1\nlog r0"
    )
    value, base = machine.log
    assert value == 0xFFFF_FFFF
    assert base == address + (8 if write.startswith("stm") else 0)
    assert len(machine.board.warnings) == 1


def test_a_write_to_flash_of_the_wrong_width_is_an_error_and_never_seen(run) -> None:
    unlock = store(FLASH_KEYR, 0x45670123) + store(FLASH_KEYR, 0xCDEF89AB) + store(FLASH_CR, 1)
    machine = run(
        unlock + "mov32 r1, #0x08008000\nmov32 r2, #0x1234\nstrb r2, [r1, #0]\nlog #1\nb stop\n"
        f"hard: ldr r0, [r1, #0]\nlog r0\nmov32 r1, #{FLASH_SR}\nldr r0, [r1, #0]\nlog r0\nb stop",
        {3: "hard"},
    )
    assert machine.log == [0xFFFF_FFFF, 0]


def test_a_programmed_halfword_is_seen_by_the_next_instruction_which_the_flash_gives_afterwards(run) -> None:
    """In one block: program, read, read SR: the code is in flash too, so that BSY is over."""
    unlock = store(FLASH_KEYR, 0x45670123) + store(FLASH_KEYR, 0xCDEF89AB) + store(FLASH_CR, 1)
    machine = run(
        unlock
        + f"mov32 r1, #0x08008000\nmov32 r4, #{FLASH_SR}\nmov32 r2, #0x1234\nstrh r2, [r1, #0]\nldr r0, [r1, #0]\n"
        "ldr r3, [r4, #0]\nlog r0\nmov r0, r3\nlog r0\nmovs r5, #1\n"
        "wait: ldr r0, [r4, #0]\n.half 0x4228\nbne wait\nlog r0",
    )
    assert machine.log == [0xFFFF_1234, 1 << 5, 1 << 5]


def test_a_handler_begins_outside_the_it_block_that_trapped(run) -> None:
    """The handler's first block is stopped too, by a write to flash: what follows must not be conditional."""
    machine = run(
        store(0xE000ED24, 1 << 18) + "mov32 r4, #0x20000802\nmov32 r1, #0x08008000\nmovs r5, #0\nmovs r2, #1\n"
        "cmp r2, #1\nitttt eq\nldmia r4!, {r2, r3}\nnop\nnop\nnop\nb stop\n"
        "fault: cmp r5, #1\nstrh r5, [r1, #0]\nadds r5, #7\nadds r5, #1\nmov r0, r5\nlog r0\nb stop",
        {6: "fault"},
    )
    assert machine.log == [8]


def test_code_changed_by_one_alias_changes_at_the_other(run) -> None:
    unlock = store(FLASH_KEYR, 0x45670123) + store(FLASH_KEYR, 0xCDEF89AB) + store(FLASH_CR, 1)
    # movs r0, #7; bx lr; then zero over the first, which may be programmed over anything: movs r0, r0.
    write = "strh r2, [r1, #0]\nw{0}: ldr r3, [r4, #0]\n.half 0x422B\nbne w{0}\n"
    machine = run(
        unlock + f"mov32 r4, #{FLASH_SR}\nmovs r5, #1\n"
        + "mov32 r1, #0x08008002\nmov32 r2, #0x4770\n" + write.format(1)
        + "mov32 r1, #0x8000\nmov32 r2, #0x2007\n" + write.format(2)
        + "mov32 r6, #0x8001\nblx r6\nlog r0\nmov32 r6, #0x08008001\nblx r6\nlog r0\n"
        + "mov32 r1, #0x08008000\nmov32 r2, #0\n" + write.format(3)
        + "movs r0, #9\nblx r6\nlog r0\nmov32 r6, #0x8001\nmovs r0, #8\nblx r6\nlog r0"
    )  # fmt: skip
    assert machine.log == [7, 7, 9, 8]


def test_several_words_of_a_peripheral_arrive_one_by_one(run) -> None:
    """LDM, STM, LDRD, STRD and an unaligned load, on the two words of GPIOA's configuration."""
    machine = run(
        store(RCC_APB2ENR, 4) + f"mov32 r1, #{GPIOA_CRL}\nmov32 r2, #0x11111111\nmov32 r3, #0x22222222\n"
        "strd r2, r3, [r1]\nldrd r4, r5, [r1]\nmov r0, r4\nlog r0\nmov r0, r5\nlog r0\n"
        "mov r6, r1\nstmia r6!, {r3, r4}\nldmia r1!, {r2, r3}\nmov r0, r2\nlog r0\nmov r0, r3\nlog r0\n"
        f"mov32 r1, #{GPIOA_CRL + 2}\nldr r0, [r1, #0]\nlog r0"
    )
    assert machine.log == [0x1111_1111, 0x2222_2222, 0x2222_2222, 0x1111_1111, 0x1111_2222]


def test_a_warning_names_the_accessing_instruction(run) -> None:
    machine = run(f"mov32 r1, #{GPIOA_CRL}\nnop\nhere: str r1, [r1, #0]\nnop")
    (warning,) = machine.board.warnings
    assert f"here+0x0 (0x{machine.label('here'):08x})" in warning


#: ldmia r1!, {r2, r3}; udiv r4, r4, r1; nop twice; ldmia r5!, {r2, r3} and a nop.
_LOADS, _DIVIDES, _NOTHING, _LOADS_BY_R5 = 0xBF00_C90C, 0xF4F1_FBB4, 0xBF00_BF00, 0xBF00_CD0C


@pytest.mark.parametrize("core", ["native", "python", "own"])
@pytest.mark.parametrize(("first", "then", "r1"), [
    (_LOADS, _NOTHING, 1), (_LOADS, _LOADS_BY_R5, 1), (_DIVIDES, _NOTHING, 0), (_DIVIDES, _LOADS_BY_R5, 0),
])  # fmt: skip
def test_code_that_is_replaced_leaves_no_trap_behind(core: str, first: int, then: int, r1: int) -> None:
    with core_chosen(core):
        machine = Machine(
            f"{store(0xE000_ED14, 0x10)}mov32 r6, #0x20000900\nmov32 r1, #0x4770\nstr r1, [r6, #4]\n"
            f"mov32 r4, #{first}\n"
            f"str r4, [r6, #0]\nmov32 r1, #0x20000800\nmov32 r5, #0x20000901\nblx r5\nmov32 r4, #{then}\n"
            f"str r4, [r6, #0]\ndsb\nisb\nmov32 r4, #0x20000901\nmov32 r5, #0x20000800\nmovs r1, #{r1}\nblx r4\nlog #1",
            {},
        )
    machine.run(100)
    assert machine.board.fault is None
    assert machine.log == [1]


def test_a_machine_outlives_the_boards_around_it(boot) -> None:
    """Boards come and go while one runs: none frees what another uses."""
    machine = boot(store(RCC_APB2ENR, 4) + store(GPIOA_CRL, 0x2222_2222) + "loop: adds r3, #1\nb loop")
    for _ in range(20):
        boot("loop: b loop").run(10)
        machine.run(10)
    assert machine.board.register("R3") > 100


def test_a_peripheral_that_stays_due_is_a_bug_that_is_named(boot, monkeypatch: pytest.MonkeyPatch) -> None:
    machine = boot("nop")
    iwdg = machine.board.chip.parts.by_name["IWDG"]
    monkeypatch.setitem(machine.board.chip.fabric._acts, iwdg.slot, lambda _due_ns: None)
    iwdg.due_ns = 1000
    with pytest.raises(RuntimeError, match="IWDG is still due at 1000 ns"):
        machine.run(10)


@pytest.mark.parametrize("first", range(0, 60, 20))
def test_images_of_random_bytes_neither_hang_nor_break_the_host(first: int) -> None:
    """Any bytes run to the end of their time: into faults, lockups, loops, or whatever they are."""
    for seed in range(first, first + 20):
        rng = random.Random(seed)
        vectors = struct.pack("<16I", 0x2000_5000, *(0x0800_0100 + 2 * rng.randrange(0x800) | 1 for _ in range(15)))
        wide = 0 if seed % 2 else 0x10000
        halves = (rng.randrange(max(0xE800, wide)) for _ in range(0x1000))
        image = Image(
            "random", ((0x0800_0000, vectors + bytes(0xC0) + struct.pack("<4096H", *halves)),), SymbolTable(())
        )
        board = BluePill(image)
        board.chip.processor.set_ccr(rng.choice((0x200, 0x208, 0x210, 0x218)))
        board.chip.engine.breakpoints.update(0x0800_0100 + 2 * rng.randrange(0x800) for _ in range(seed % 3))
        for _ in range(10_000):
            if board.now_ns >= 200_000:
                break
            board.advance_to(200_000)
