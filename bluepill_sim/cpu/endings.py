"""What the numbers mean with which Unicorn ends a run.

Source: unicorn.h, and target/arm of Unicorn 2.1 (EXCP_ numbers).
"""

from bluepill_sim.block_cost import Block
from bluepill_sim.cpu import core
from bluepill_sim.cpu.halt import Halt, HaltKind
from bluepill_sim.thumb import Kind

#: Branches to these addresses are exception returns in handler mode (ARMv7-M B1.5.8).
FIRST_EXCEPTION_RETURN = 0xFFFF_FFE0

#: UC_ERR_EXCEPTION, and the number of the interrupt that it stands for.
_DENIED, _PREFETCH_ABORT = 21, 3

#: 3 and 8 are told apart by the PC.
_INTERRUPTS = {
    2: HaltKind.SUPERVISOR_CALL,
    3: HaltKind.EXECUTE_NEVER,
    4: HaltKind.UNALIGNED,
    7: HaltKind.BKPT,
    8: HaltKind.EXECUTE_NEVER,
    17: HaltKind.NO_COPROCESSOR,
}

_BAD_ACCESSES = {
    core.WRITE_UNMAPPED: HaltKind.WRITE_ERROR,
    core.WRITE_PROTECTED: HaltKind.WRITE_ERROR,
    core.FETCH_UNMAPPED: HaltKind.FETCH_ERROR,
    core.FETCH_PROTECTED: HaltKind.FETCH_ERROR,
}


def kind_of_interrupt(number: int, pc: int) -> HaltKind:
    """Return what an exception of Unicorn's own numbering is."""
    kind = _INTERRUPTS.get(number, HaltKind.UNDEFINED)
    if kind is HaltKind.EXECUTE_NEVER and pc >= FIRST_EXCEPTION_RETURN:
        return HaltKind.EXCEPTION_RETURN
    return kind


def kind_of_bad_access(access: int) -> HaltKind:
    """Return what an access to no memory, or against its protection, is."""
    return _BAD_ACCESSES.get(access, HaltKind.READ_ERROR)


def kind_of_invalid(block: Block, pc: int, *, is_thumb: bool) -> HaltKind | None:
    """Return what an instruction is that Unicorn does not know; None for one that does nothing.

    It takes WFE and YIELD for undefined, with the PC already past them; the rest stands at the PC.
    """
    last = block.last if pc == block.end else None
    if last is Kind.YIELD:
        return None
    if last is Kind.WAIT_EVENT:
        return HaltKind.WAIT_EVENT
    return HaltKind.UNDEFINED if is_thumb else HaltKind.INVALID_STATE


def halt_without_reason(error: int, block: Block, pc: int) -> Halt:
    """Tell why Unicorn came back without having called anything: WFI, or a fetch that its TLB denied.

    Raises:
        RuntimeError: it was not; a bug here.
    """
    if error == 0 and block.last is Kind.WAIT_INTERRUPT and pc == block.end:
        return Halt(HaltKind.WAIT_INTERRUPT, pc)
    if error == _DENIED:
        return Halt(kind_of_interrupt(_PREFETCH_ABORT, pc), pc)
    raise RuntimeError(f"Unicorn stopped at {pc:#010x} with error {error}")
