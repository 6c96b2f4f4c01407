"""Unicorn as the judge of a core that acts on what is due at the instruction: each instruction run on both.

The core itself says when an exception is taken; the judge, which knows of none, gets the state behind it. So it does
where it cannot judge: an instruction that reaches for what is no memory, one that ends a run (SVC, BKPT, WFI, WFE), and
an exclusive access, whose reservation it may not have.
"""

import ctypes
import struct

from bluepill_sim.board import BluePill
from bluepill_sim.core import Reg, it_state_of
from bluepill_sim.core.thumb import decode
from bluepill_sim.core.unicorn_core import GENERAL, UnicornCore
from bluepill_sim.debug.cores.comparison import Acts, ComparedCores, CoreDifference, CoreValue, core_value
from bluepill_sim.extension.encodings import Kind
from bluepill_sim.extension.layout import NOWHERE
from simbase.timing import Nanos

_BKPT = struct.pack("<H", 0xBE00)
_T_BIT, _FLAGS, _PRIVILEGE = 1 << 5, 0xF800_0000, 1
_IT_BITS = 0x0600_FC00
_PASSED_OVER = frozenset({
    Kind.SUPERVISOR_CALL, Kind.BREAKPOINT, Kind.WAIT_EVENT, Kind.WAIT_INTERRUPT, Kind.YIELD, Kind.SEND_EVENT,
    Kind.EXCLUSIVE, Kind.IF_THEN,
})  # fmt: skip
#: What is compared behind each instruction, and beside it the PC and the SRAM.
_COMPARED = (*GENERAL[:15], Reg.XPSR, Reg.CONTROL, Reg.PRIMASK, Reg.BASEPRI, Reg.FAULTMASK)
#: Which bits of them; a thread without privilege sees no masks in Unicorn.
_BITS = (*(0xFFFF_FFFF,) * 15, _FLAGS | 0x1FF, 3, 1, 0xF0, 1)
_MASKS = 17


class UnicornJudge:
    """A bare Cortex-M3 of Unicorn with a copy of a board's memories.

    Raises:
        MissingDependencyError: Unicorn is not installed.
    """

    def __init__(self, board: BluePill) -> None:
        """Take the board's state."""
        self._board = board
        self._failures: list[BaseException] = []
        self._core = core = UnicornCore(self._failures.append)
        memory = board.chip.memory
        copies = {id(region.buffer): ctypes.create_string_buffer(region.buffer.raw, len(region.buffer))
                  for region in memory.regions}  # fmt: skip
        for region in memory.regions:
            core.map_memory(region.base, copies[id(region.buffer)], "rwx" if region.is_writable else "rx")
        self._sram, self._flash = copies[id(memory.sram)], copies[id(memory.flash)]
        self._is_judged, self._is_one_block = True, False
        core.on_bad_access(self._foreign)
        core.on_interrupt(self._ended)
        core.on_invalid(self._unknown)
        core.on_block(self._block)
        registers = core.registers
        registers[Reg.CPSR] |= _T_BIT
        self._new = core.context
        self._general = registers.batch(*GENERAL[:13], Reg.LR)
        self._seen = registers.batch(*_COMPARED)
        self._theirs = board.chip.engine.registers.batch(*_COMPARED)
        self.take_over()

    def take_over(self) -> None:
        """Take the board's registers and memories as they are."""
        core, memory, theirs = self._core, self._board.chip.memory, self._board.chip.engine.registers
        mine = core.registers
        if self._flash.raw != memory.flash.raw:
            ctypes.memmove(self._flash, memory.flash.raw, len(self._flash))
            core.drop_all_code()
        if self._sram.raw != memory.sram.raw:
            ctypes.memmove(self._sram, memory.sram.raw, len(self._sram))
        core.context = self._new
        control, number = theirs[Reg.CONTROL], theirs[Reg.XPSR] & 0x1FF
        for name in (Reg.MSP, Reg.PSP, Reg.PRIMASK, Reg.BASEPRI, Reg.FAULTMASK):
            mine[name] = theirs[name]
        mine[Reg.IPSR] = number
        if not number:
            mine[Reg.CONTROL] = control & ~_PRIVILEGE
        self._general.write(tuple(theirs[name] for name in (*GENERAL[:13], Reg.LR)))
        mine[Reg.SP] = theirs[Reg.SP]
        mine[Reg.XPSR] = theirs[Reg.XPSR]
        if control & _PRIVILEGE:
            mine[Reg.CONTROL] = control

    def runs(self) -> bool:
        """Run the instruction before which the board stands; return whether it was one to be judged."""
        board, core = self._board, self._core
        pc, it_state = board.pc, it_state_of(board.register("XPSR"))
        code = board.read_memory(pc, 4) or board.read_memory(pc, 2)
        self._is_judged = code is not None and decode(code, 0, pc).kind not in _PASSED_OVER
        if code is None or not self._is_judged or (it_state and not it_state & 15):
            return False
        if it_state:
            self._run_in_it(pc, it_state, decode(code, 0, pc).size)
        else:
            core.library.uc_emu_start(core.handle, pc | 1, NOWHERE, 0, 1)
        if self._failures:
            raise self._failures[0]
        return self._is_judged

    def values_apart(self) -> list[CoreValue]:
        """Return what differs from the board, behind an instruction that both have run."""
        board = self._board
        mine, theirs = self._seen.read(), self._theirs.read()
        rows = [("PC", self._core.registers[Reg.PC], board.pc)]
        count = _MASKS if theirs[16] & _PRIVILEGE else len(_COMPARED)
        rows += [
            (name.name, one & bits, other & bits)
            for name, bits, one, other in list(zip(_COMPARED, _BITS, mine, theirs, strict=True))[:count]
        ]
        found = [core_value(name, other, one) for name, one, other in rows if one != other]
        sram = board.chip.memory.sram.raw
        if self._sram.raw != sram and not self._has_dma():
            found.append(core_value("SRAM", sram, self._sram.raw))
        return found

    def _has_dma(self) -> bool:
        """Tell whether a channel of the DMA may have written."""
        registers = self._board.registers("DMA1")
        return any(register["EN"] for name, register in registers.items() if name.startswith("CCR"))

    def _run_in_it(self, pc: int, it_state: int, size: int) -> None:
        """Run one under IT, where Unicorn ends no run: a BKPT stands behind it."""
        core, at = self._core, pc + size
        region = next((each for each in self._board.chip.memory.regions if each.base <= at < each.end), None)
        if region is None:
            self._is_judged = False
            return
        buffer, offset = (self._sram if region.is_writable else self._flash), at - region.base
        kept = buffer.raw[offset : offset + 2]
        ctypes.memmove(ctypes.addressof(buffer) + offset, _BKPT, 2)
        core.drop_all_code()
        core.registers[Reg.CPSR] = (
            core.registers[Reg.CPSR] & ~_IT_BITS | (it_state & 3) << 25 | (it_state >> 2) << 10 | _T_BIT
        )  # fmt: skip
        self._is_one_block, self._blocks = True, 0
        core.start(pc | 1)
        self._is_one_block = False
        ctypes.memmove(ctypes.addressof(buffer) + offset, kept, 2)
        core.drop_all_code()
        core.registers[Reg.CPSR] = core.registers[Reg.CPSR] & ~_IT_BITS | _T_BIT

    def _block(self, _uc: int, _address: int, _size: int, _user: int) -> None:
        if self._is_one_block:
            self._blocks += 1
            if self._blocks > 1:
                self._core.stop()

    def _foreign(self, _kind: int, _address: int, _size: int, _value: int) -> bool:
        self._is_judged = False
        return False

    def _ended(self, number: int) -> None:
        self._is_judged &= self._is_one_block and number == 7
        self._core.stop()

    def _unknown(self) -> bool:
        self._is_judged = False
        self._core.stop()
        return True


def compare_instructions(board: BluePill, end_ns: Nanos, acts: Acts = ()) -> ComparedCores:
    """Run a fresh board up to a time, and have Unicorn judge each instruction.

    Args:
        board: with the exact core.
        end_ns: up to when, in ns of virtual time.
        acts: what happens to it from outside.

    Raises:
        MissingDependencyError: Unicorn is not installed.
    """
    judge, chip, waiting = UnicornJudge(board), board.chip, list(acts)
    judged = passed_over = 0
    while board.now_ns < end_ns:
        while waiting and waiting[0][0] <= board.now_ns:
            waiting.pop(0)[1](board)
        at_ns, cycle, address = board.now_ns, board.cycle, board.pc
        if board.is_asleep:
            limit_ns = min(end_ns, *(at for at, _ in waiting[:1]), board.next_deadline() or end_ns)
        else:
            limit_ns = chip.ns_of(cycle + 1)
        is_judged = not board.is_asleep and judge.runs()
        board.advance_to(max(limit_ns, at_ns + 1))
        if board.cycle == cycle and board.now_ns <= at_ns:
            break  # it is locked up
        has_turned = any(kind and began >= cycle for began, _, kind in chip.engine.log.rows())
        if not is_judged or has_turned:
            passed_over += 1
            judge.take_over()
            continue
        judged += 1
        values = judge.values_apart()
        if values:
            difference = CoreDifference(
                at_ns=at_ns, cycle=cycle, address=address, is_instruction=True, values=tuple(values)
            )  # fmt: skip
            return ComparedCores(
                end_ns=board.now_ns, cycles=board.cycle, difference=difference, instructions=judged,
                passed_over=passed_over,
            )  # fmt: skip
    return ComparedCores(end_ns=board.now_ns, cycles=board.cycle, instructions=judged, passed_over=passed_over)
