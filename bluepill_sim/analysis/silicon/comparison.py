"""A chip's log beside the model's: what is the same, what differs within what is allowed, and what differs.

The model's log is made by running the kit's own program on the emulated board, so that both say the same things.
Each allowance has its reason; where there is none, one bit is a difference.
Source of ranges: DS5319 tables 21 to 25 (oscillators), 29 (flash); PM0075 for the times of the flash.
Invariant: a log beside itself has no difference.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from importlib.resources import as_file, files

from bluepill_sim.analysis.silicon.log import SiliconLog, read_log
from bluepill_sim.board import BluePill
from bluepill_sim.stm32f103 import name_at

#: Longer than the kit takes.
_MOST = "20 s"
_ALL = 0xFFFF_FFFF


class NumberVerdict(Enum):
    """How a number of the chip stands to the model's."""

    SAME = "the same"
    ALLOWED = "allowed"
    DIFFERS = "differs"
    #: One of the two has no such number.
    MISSING = "missing"


@dataclass(frozen=True, slots=True)
class Allowance:
    """By how much a number may differ, and why."""

    reason: str
    #: Bits that are not compared.
    ignored: int = 0
    #: Least and most that the data sheet gives, instead of the model's number.
    between: tuple[int, int] | None = None
    #: As a part of the model's number.
    share: float = 0.0


_PART = "differs from part to part"
#: By address.
REGISTERS: Mapping[int, Allowance] = {
    0x4002_1000: Allowance("the factory's trimming of HSI", ignored=0xFFF8),
    0x4002_1024: Allowance("what reset the chip last", ignored=0xFF00_0000),
    0x4002_201C: Allowance("option bytes of this part", ignored=_ALL),
    0x4002_2020: Allowance("option bytes of this part", ignored=_ALL),
    **{address: Allowance("levels on pins that nobody drives", ignored=0xFFFF) for address in
       (0x4001_0808, 0x4001_0C08, 0x4001_1008, 0x4001_1408)},
    **{0x4000_6C04 + 4 * n: Allowance("kept by VBAT", ignored=_ALL) for n in range(10)},
    **{0x4000_2800 + 4 * n: Allowance("kept by VBAT", ignored=_ALL) for n in range(10)},
    0x4000_7004: Allowance("whether it woke from Standby", ignored=0x3),
    0xE004_2000: Allowance("the revision; 0 on a part without a debugger (ST's errata)", ignored=_ALL),
    0xE000_E018: Allowance("SysTick's counter is not reset", ignored=_ALL),
    0xE000_E014: Allowance("SysTick's reload is not reset", ignored=_ALL),
    **{0x1FFF_F7E8 + 4 * n: Allowance("the part's own number", ignored=_ALL) for n in range(3)},
    **{0x1FFF_F800 + 4 * n: Allowance("option bytes of this part", ignored=_ALL) for n in range(4)},
}  # fmt: skip
#: By kind and name; a kind alone is for all that have no row of their own.
NUMBERS: Mapping[tuple[str, str], Allowance] = {
    ("start", ""): Allowance("oscillators start as they like", share=10.0),
    ("tim", "lsi_400_periods"): Allowance("LSI: 30 to 60 kHz", between=(480_000, 960_000)),
    ("tim", "lsi_400_periods_hsi"): Allowance("LSI: 30 to 60 kHz; HSI within 2.5 %", between=(52_000, 109_400)),
    ("tim", "flash_erase_page"): Allowance("20 to 40 ms", between=(1_440_000, 2_880_000)),
    ("tim", "flash_program"): Allowance("40 to 70 us", between=(2_880, 5_040)),
    ("tim", ""): Allowance("a poll more or less", share=0.02),
}


@dataclass(frozen=True, slots=True)
class ComparedNumber:
    """One number of both."""

    kind: str
    name: str
    chip: int | None
    model: int | None
    verdict: NumberVerdict
    #: Why it is allowed; empty where it is not.
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Model:
    """What the emulated board says of itself, and its names."""

    log: SiliconLog
    #: Name of a register by its address, such as "TIM2_CR1".
    names: Mapping[int, str]


def ask_model() -> Model:
    """Run the kit on the emulated board; some seconds."""
    with as_file(files("bluepill_sim.analysis.silicon").joinpath("kit.elf")) as path:
        board = BluePill(path)
        said = bytearray()
        board.usart1.subscribe(lambda rows: said.extend(word for word, _ in rows))
        board.until("usart1 sends end ", timeout=_MOST)
        board.run_for("5 ms")
    names = {
        part.base + register.offset: f"{part.name}_{register.name}"
        for part in board.chip.parts.by_name.values() for register in part.REGISTERS
    }  # fmt: skip
    return Model(read_log(bytes(said), "the model"), names)


def compare(chip: SiliconLog, model: Model) -> list[ComparedNumber]:
    """Return every number of both, in the model's order."""
    return [*_registers(chip, model), *_numbers(chip, model.log)]


def _registers(chip: SiliconLog, model: Model) -> Iterator[ComparedNumber]:
    for address in {**model.log.registers, **chip.registers}:
        name = model.names.get(address, f"{name_at(address) or 'core'} {address:#010x}")
        yield _row("reg", name, chip.registers.get(address), model.log.registers.get(address), REGISTERS.get(address))


def _numbers(chip: SiliconLog, model: SiliconLog) -> Iterator[ComparedNumber]:
    for kind, name in {**model.numbers, **chip.numbers}:
        key = (kind, name)
        allowance = NUMBERS.get(key) or NUMBERS.get((kind, ""))
        yield _row(kind, name, chip.numbers.get(key), model.numbers.get(key), allowance)


def _row(kind: str, name: str, chip: int | None, model: int | None, allowance: Allowance | None) -> ComparedNumber:
    if chip is None or model is None:
        return ComparedNumber(kind, name, chip, model, NumberVerdict.MISSING)
    if chip == model:
        return ComparedNumber(kind, name, chip, model, NumberVerdict.SAME)
    if allowance is not None and _is_allowed(chip, model, allowance):
        return ComparedNumber(kind, name, chip, model, NumberVerdict.ALLOWED, allowance.reason)
    return ComparedNumber(kind, name, chip, model, NumberVerdict.DIFFERS)


def _is_allowed(chip: int, model: int, allowance: Allowance) -> bool:
    if allowance.between is not None:
        return allowance.between[0] <= chip <= allowance.between[1]
    if allowance.ignored:
        return (chip ^ model) & ~allowance.ignored & _ALL == 0
    return abs(chip - model) <= allowance.share * model
