"""Runs the same instructions on the interpreter and on Unicorn, and tells what differs.

A case is a few instructions somewhere in flash, with registers, flags and what the SRAM holds. Flash is full of
BKPT else, so that a branch to anywhere there ends the run. Compared are all registers, flags and special registers, the
SRAM, and what happened: each block with its size, each interrupt of Unicorn's own numbering, undefined instruction and
failed access, with its PC.

What Unicorn gets wrong is made by no case: `RUN_BY_UNICORN` and what stands below it.
"""

import ctypes
import random
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field

from bluepill_sim.core.unicorn_core import GENERAL, Reg, UnicornCore
from bluepill_sim.extension.encodings import NARROW, UNDEFINED, WIDE, Encoding, find
from bluepill_sim.native.interpreter_core import InterpreterCore

FLASH, FLASH_BYTES, SRAM, SRAM_BYTES = 0x0800_0000, 0x1_0000, 0x2000_0000, 0x1000
#: Bytes of flash for each case; the first kilobyte is left to what jumps near 0.
SLOT = 64
SLOTS = FLASH_BYTES // SLOT - 16
#: chosen: what a case may run before it is ended, as a loop of blocks.
MOST_BLOCKS = 12
_BKPT = 0xBE00
_WORD = 0xFFFF_FFFF
_SPECIAL = (Reg.PRIMASK, Reg.BASEPRI, Reg.FAULTMASK, Reg.CONTROL, Reg.XPSR)
#: Unicorn keeps the bits of BASEPRI that an STM32F103 does not have; the engine clears them behind the block.
_KEPT = {Reg.BASEPRI: 0xF0}
_Q_BIT, _T_BIT, _CPSR_T = 1 << 27, 1 << 24, 1 << 5

#: Instructions that ARMv7-M leaves undefined without the DSP extension, or at all, and that Unicorn 2.1.4 runs: the
#: interpreter does not. What else it does otherwise: `is_open`, `is_late`, `_NOT_IN_IT`; docs/core.md has the list.
RUN_BY_UNICORN = (
    0xB650,
    0xB658,  # SETEND
    0xF8AF_680C,
    0xF80F_A019,
    0xF8CF_1000,  # STRH, STRB, STR to [PC, #imm]
    0xF3AE_0E1C,
    0xF321_0C10,  # USAT16, SSAT16 (A7.7.152: UNDEFINED, ASR of 0)
    0xFA4E_F580,
    0xFA0E_F081,
    0xFA1E_FEA3,
    0xFA52_F485,  # SXTAB, SXTAH, UXTAH, UXTAB
    0xFB24_F30B,
    0xFB33_7E0C,
    0xFB44_FB05,
    0xFB36_4202,  # SMUAD, SMLAWB, SMUSD
    0xFBDC_78C9,
    0xFBC4_38D9,
    0xF986_280D,  # SMLALD, SMLALxy, a load of SIMD registers
)


@dataclass(frozen=True, slots=True)
class Case:
    """Instructions and what they start with."""

    words: tuple[int, ...]
    registers: tuple[int, ...]
    flags: int
    memory_seed: int = 0
    #: ITSTATE before the first instruction.
    it_state: int = 0

    @property
    def code(self) -> bytes:
        """What stands in flash."""
        return b"".join(
            struct.pack("<HH", word >> 16, word & 0xFFFF) if word >> 16 else struct.pack("<H", word)
            for word in self.words
        )

    def __str__(self) -> str:
        """Tell it as a person reads it."""
        words = " ".join(f"{word:04x}" for word in self.words)
        named = [row.operation if row else "undefined" for row in map(encoding_of, self.words)]
        registers = " ".join(f"{value:x}" for value in self.registers)
        return f"{words} ({', '.join(named)}) flags {self.flags >> 27:05b} IT {self.it_state:02x} registers {registers}"


def encoding_of(word: int) -> Encoding | None:
    """Return the encoding of an instruction of a case."""
    return find(word, is_wide=word >> 16 != 0)


@dataclass
class Machine:
    """One of the two cores, with flash and SRAM."""

    core: UnicornCore
    happened: list[tuple[object, ...]] = field(default_factory=list)
    failures: list[BaseException] = field(default_factory=list)

    def __post_init__(self) -> None:
        core = self.core
        core._on_failure = self.failures.append
        self.flash = ctypes.create_string_buffer(struct.pack("<H", _BKPT) * (FLASH_BYTES // 2), FLASH_BYTES)
        self.sram = ctypes.create_string_buffer(SRAM_BYTES)
        core.map_memory(FLASH, self.flash, "rx")
        core.map_memory(SRAM, self.sram, "rwx")
        core.on_block(self._block)
        core.on_interrupt(self._interrupt)
        core.on_invalid(self._invalid)
        core.on_bad_access(self._bad_access)
        registers = core.registers
        registers[Reg.CPSR] = registers[Reg.CPSR] | _CPSR_T
        self.start_context = core.context
        self._general = registers.batch(*GENERAL[:15])
        self._seen = registers.batch(*GENERAL[:15], *_SPECIAL)

    def put(self, cases: list[Case]) -> None:
        """Put cases into flash, each in its slot."""
        code = bytearray(struct.pack("<H", _BKPT) * (FLASH_BYTES // 2))
        for at, case in zip(places(), cases, strict=False):
            code[at - FLASH : at - FLASH + len(case.code)] = case.code
        ctypes.memmove(self.flash, bytes(code), FLASH_BYTES)
        self.core.drop_all_code()

    def run(self, case: Case, at: int) -> tuple[object, ...]:
        """Run a case that stands at an address; return all that is to be compared."""
        core, registers = self.core, self.core.registers
        core.context = self.start_context
        self.happened.clear()
        ctypes.memmove(self.sram, memory_of(case.memory_seed), SRAM_BYTES)
        self._general.write(case.registers)
        registers[Reg.XPSR] = case.flags
        it_bits = (case.it_state & 3) << 25 | case.it_state >> 2 << 10
        registers[Reg.CPSR] = registers[Reg.CPSR] & 0xF9FF_03FF | it_bits | _CPSR_T
        error = core.start(at | 1)
        if self.failures:
            raise self.failures[0]
        seen = list(self._seen.read())
        for number, name in enumerate(_SPECIAL, 15):
            seen[number] &= _KEPT.get(name, _WORD)
        if seen[18] & 1:  # a thread without privilege, of which Unicorn shows no masks
            seen[15:18] = [0, 0, 0]
        return (*seen, registers[Reg.PC], error, self.sram.raw, tuple(self.happened))

    def _block(self, _uc: int, address: int, size: int, _user: int) -> None:
        self.happened.append(("block", address, size))
        if len(self.happened) > MOST_BLOCKS:
            self.core.stop()

    def _interrupt(self, number: int) -> None:
        self.happened.append(("interrupt", number, self.core.registers[Reg.PC]))
        self.core.stop()

    def _invalid(self) -> bool:
        self.happened.append(("undefined", self.core.registers[Reg.PC]))
        self.core.stop()
        return True

    def _bad_access(self, kind: int, address: int, size: int, _value: int) -> bool:
        is_fetch = kind == 21
        self.happened.append(("failed", kind, address, 0 if is_fetch else size, self.core.registers[Reg.PC]))
        return False


def places() -> Iterator[int]:
    """Yield where cases stand."""
    return (FLASH + 0x400 + SLOT * n for n in range(SLOTS))


_MEMORIES: dict[int, bytes] = {}


def memory_of(seed: int) -> bytes:
    """Return what SRAM holds: random words, pointers into SRAM, addresses of code."""
    if seed not in _MEMORIES:
        dice = random.Random(seed)
        words = [any_value(dice) for _ in range(SRAM_BYTES // 4)]
        _MEMORIES[seed] = struct.pack(f"<{len(words)}I", *words)
    return _MEMORIES[seed]


def any_value(dice: random.Random) -> int:
    """Return a word: at the bounds of arithmetic, an address, or any."""
    return dice.choice(
        (
            dice.getrandbits(32), dice.getrandbits(32), dice.getrandbits(5), _WORD - dice.getrandbits(3), 0x8000_0000,
            0x7FFF_FFFF, 0, SRAM + 0x400 + 4 * dice.getrandbits(9), SRAM + 0x400 + dice.getrandbits(11),
            FLASH + 0x400 + 2 * dice.getrandbits(14) | 1,
        )
    )  # fmt: skip


def flags_of(dice: random.Random) -> int:
    """Return flags: N and Z may both be set, as no arithmetic sets them."""
    return dice.getrandbits(5) << 27


#: Rows that cases are made of.
ROWS = tuple(row for row in (*NARROW, *WIDE) if row.operation != UNDEFINED)
#: What ends a case, or makes of the rest another one: the last of its instructions.
_LAST = frozenset({
    "B_T1", "B_T2", "B_T3", "B_T4", "BL", "BX", "BLX", "CBZ", "CBNZ", "TBB", "TBH", "ADD_PC", "MOV_PC", "POP", "SVC",
    "BKPT", "UDF", "WFI", "WFE", "YIELD", "NO_COPROCESSOR", "LDM_IA", "LDM_DB",
})  # fmt: skip
#: What may not stand in an IT block (A7.3.2); and ISB, behind which Unicorn loses ITSTATE.
_NOT_IN_IT = frozenset({"IT", "CBZ", "CBNZ", "B_T1", "B_T3", "CPS", "ISB"})
#: Instructions that keep SP a multiple of 4, and which fields the others write where it is not Rd and Rt.
_KEEPS_SP = frozenset({"CMP_T1", "BX", "BLX", "STR_R", "STRH_R", "STRB_R", "STRD", "STM_IA", "STM_DB"})
_WRITTEN = dict.fromkeys(("SMULL", "UMULL", "SMLAL", "UMLAL"), "ad") | {"LDRD": "atn", "LDRD_POST": "atn"}
_WRITTEN |= {"STRD_POST": "n", "STRD": ""} | dict.fromkeys(("STR_X", "STRH_X", "STRB_X"), "n")
_WRITTEN |= dict.fromkeys(("LDR_X", "LDRH_X", "LDRB_X", "LDRSH_X", "LDRSB_X"), "nt")


def filled(row: Encoding, dice: random.Random) -> int:
    """Return an instruction of a row with random fields."""
    bits = 32 if row.is_wide else 16
    while True:
        word = row.value | dice.getrandbits(bits) & ~row.mask & (1 << bits) - 1
        if find(word, is_wide=row.is_wide) is row and not is_open(row, word):
            return word


def is_open(row: Encoding, word: int) -> bool:  # noqa: PLR0911 - one return a reason
    """Tell whether the manual leaves open what an instruction does, or Unicorn does what no case is to make."""
    values = row.values(word)
    if row.operation == "IT":
        condition, mask = values["i"] >> 4, values["i"] & 15
        return condition == 15 or (condition == 14 and mask.bit_count() != 1)
    if row.operation == "MSR":  # other profiles', the low bits of stack pointers, and CONTROL: without privilege
        # a CPS ends no block of Unicorn's
        return values["i"] not in {0, 1, 2, 3, 16, 17, 18, 19} or not values["b"] & 2
    if values.get("s") and values.get("d") == 15:  # Unicorn returns from an exception of another profile
        return True
    if row.operation not in _KEEPS_SP and 13 in {values.get(letter) for letter in _WRITTEN.get(row.operation, "dt")}:
        return True
    if values.get("t") == 15 and row.operation.startswith(("LDRB", "LDRH", "LDRS", "LDRT")):
        return True
    if values.get("r", 0) >> 13 & 1 and row.operation in {"LDM_IA", "LDM_DB"}:
        return True
    if row.operation == "MRS":
        return values["i"] not in {0, 1, 2, 3, 5, 6, 7, 8, 9, 16, 17, 18, 19, 20}
    return False


def is_last(row: Encoding, word: int) -> bool:
    """Tell whether an instruction may branch, or ends the run."""
    values = row.values(word)
    return row.operation in _LAST or 15 in (values.get("d"), values.get("t"), values.get("a"), values.get("n"))


def made(dice: random.Random, rows: list[Encoding] | None = None, length: int = 0) -> Case:
    """Return a case: instructions, some of them in IT blocks."""
    words: list[int] = []
    chosen = rows or [dice.choice(ROWS) for _ in range(length or dice.randrange(1, 6))]
    left = 0
    for n, row in enumerate(chosen):
        word = filled(row, dice)
        if row.operation == "IT":
            left = 5 - (word & -word).bit_length()
        elif left:
            while (row.operation in _NOT_IN_IT or (left > 1 and is_last(row, word))) and not rows:
                row = dice.choice(ROWS)  # noqa: PLW2901 - another in its place
                word = filled(row, dice)
            left -= 1
        words.append(word)
        if is_last(row, word) and n + 1 < len(chosen) and not left:
            break
    registers = [any_value(dice) for _ in range(15)]
    registers[13] &= ~3
    return Case(tuple(words), tuple(registers), flags_of(dice), dice.getrandbits(4))


class Lockstep:
    """Both machines."""

    def __init__(self) -> None:
        self.unicorn = Machine(UnicornCore(_raise))
        self.own = Machine(InterpreterCore(_raise))

    def differences(self, cases: list[Case]) -> Iterator[tuple[Case, str]]:
        """Run cases on both; yield those that differ, and how."""
        for start in range(0, len(cases), SLOTS):
            batch = cases[start : start + SLOTS]
            self.unicorn.put(batch)
            self.own.put(batch)
            for at, case in zip(places(), batch, strict=False):
                expected, seen = self.unicorn.run(case, at), self.own.run(case, at)
                if expected != seen and not is_late(expected, seen) and not is_astray(seen, case, at):
                    yield case, reported(expected, seen, at)


def is_late(expected: tuple[object, ...], seen: tuple[object, ...]) -> bool:
    """Tell whether Unicorn has not ended at a failed access: in an IT block, or of a store that leaves memory."""
    late, here = expected[-1], seen[-1]
    if not isinstance(here, tuple) or not isinstance(late, tuple) or not here or here[-1][0] != "failed":
        return False
    is_in_it = bool(int(str(seen[19])) & 0x0600_FC00)
    is_by_bytes = all(what[0] == "failed" and what[-1] == here[-1][-1] for what in late[len(here) :])
    return late[: len(here)] == here and (is_in_it or is_by_bytes)


def is_astray(seen: tuple[object, ...], case: Case, at: int) -> bool:
    """Tell whether a branch has led to what no case has put there, which may be undefined, and Unicorn may run that."""
    here, starts = seen[-1], {at}
    for word in case.words:
        starts.add(max(starts) + (4 if word >> 16 else 2))
    if not isinstance(here, tuple) or not here:
        return False
    is_in_sram = any(what[0] == "block" and SRAM <= int(what[1]) < SRAM + SRAM_BYTES for what in here)
    return is_in_sram or (here[-1][0] == "undefined" and here[-1][1] not in starts)


def reported(expected: tuple[object, ...], seen: tuple[object, ...], at: int) -> str:
    """Return how two results differ."""
    names = [*(f"R{n}" for n in range(15)), *(name.name for name in _SPECIAL), "PC", "error", "SRAM", "happened"]
    lines = [f"at {at:#x}"]
    for name, one, other in zip(names, expected, seen, strict=True):
        if one == other:
            continue
        if isinstance(one, bytes) and isinstance(other, bytes):
            first = next(n for n in range(len(one)) if one[n] != other[n])
            lines.append(f"SRAM + {first:#x}: {one[first : first + 8].hex()}, here {other[first : first + 8].hex()}")
        else:
            spelt = [hex(value) if isinstance(value, int) else str(value) for value in (one, other)]
            lines.append(f"{name}: {spelt[0]}, here {spelt[1]}")
    return "; ".join(lines)


def _raise(error: BaseException) -> None:
    raise error
