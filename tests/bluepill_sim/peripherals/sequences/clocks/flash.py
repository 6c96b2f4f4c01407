"""FLASH: keys before control, erase before program, the end before the next."""

from hypothesis import strategies as st

from bluepill_sim.peripherals.flash import FLASH_BASE, MASS_ERASE_NS, PAGE_BYTES, PAGE_ERASE_NS, PROGRAM_NS
from bluepill_sim.peripherals.rcc import ResetCause
from tests.bluepill_sim.peripherals.sequences.bench import Bench
from tests.bluepill_sim.peripherals.sequences.row import Sequences
from tests.bluepill_sim.peripherals.sequences.sources import HAL, HAL_EX, LOCM3, RIOT, RUST, pm

FLASH = Sequences("FLASH")
KEY1, KEY2 = 0x4567_0123, 0xCDEF_89AB


def unlock(chip: Bench) -> None:
    chip["FLASH.KEYR"] = KEY1
    chip["FLASH.KEYR"] = KEY2


def unlock_options(chip: Bench) -> None:
    unlock(chip)
    chip["FLASH.OPTKEYR"] = KEY1
    chip["FLASH.OPTKEYR"] = KEY2


def program(chip: Bench, offset: int, value: int) -> None:
    chip.parts.flash.program(offset, 2, value)


@FLASH.row(
    "unlock-first",
    "CR takes nothing, and nothing is programmed, until both keys have been written.",
    LOCM3("f1/flash", 28),
    HAL("flash", 150),
    pm("2.3.1"),
)
def _(chip: Bench) -> None:
    assert chip["FLASH.CR.LOCK"]
    chip["FLASH.CR.PG"] = 1
    program(chip, 0, 0x1234)
    assert (chip["FLASH.CR.PG"], chip.array.read(0, 2), chip["FLASH.SR"]) == (0, b"\xff\xff", 0)
    unlock(chip)
    chip["FLASH.CR.PG"] = 1
    assert chip["FLASH.CR"] == 1


@FLASH.row(
    "keys-in-order",
    "The keys come in their order; a wrong one locks CR until the next reset, whatever follows.",
    RUST("flash", 73),
    pm("2.3.1"),
    values=st.integers(0, 0xFFFF_FFFF).filter(lambda key: key != KEY1),
)
def _(chip: Bench, key: int) -> None:
    chip["FLASH.KEYR"] = key
    unlock(chip)
    assert chip["FLASH.CR.LOCK"]
    chip.parts.reset(ResetCause.SOFTWARE)
    unlock(chip)
    assert not chip["FLASH.CR.LOCK"]


@FLASH.row(
    "second-key",
    "A wrong second key locks CR until the next reset as well.",
    pm("2.3.1"),
    values=st.integers(0, 0xFFFF_FFFF).filter(lambda key: key != KEY2),
)
def _(chip: Bench, key: int) -> None:
    chip["FLASH.KEYR"] = KEY1
    chip["FLASH.KEYR"] = key
    unlock(chip)
    assert chip["FLASH.CR.LOCK"]


@FLASH.row(
    "lock-after",
    "LOCK is set by software and cleared only by the keys.",
    LOCM3("f1/flash", 31),
    HAL("flash", 690),
)
def _(chip: Bench) -> None:
    unlock(chip)
    chip["FLASH.CR.LOCK"] = 1
    chip["FLASH.CR"] = 0
    assert chip["FLASH.CR.LOCK"]
    unlock(chip)
    assert not chip["FLASH.CR.LOCK"]


@FLASH.row(
    "erase-first",
    "A halfword is programmed only where it is erased, else PGERR and nothing; 0 may be over anything.",
    HAL("flash", 156),
    LOCM3("f1/flash", 243),
    pm("2.3.3"),
    values=st.integers(1, 0xFFFE),
)
def _(chip: Bench, word: int) -> None:
    unlock(chip)
    chip["FLASH.CR.PG"] = 1
    program(chip, 4, word)
    chip.run(PROGRAM_NS)
    chip["FLASH.SR"] = 0x34
    program(chip, 4, 0xAAAA)
    assert (chip["FLASH.SR.PGERR"], chip["FLASH.SR.BSY"]) == (1, 0)
    assert chip.array.read(4, 2) == word.to_bytes(2, "little")
    chip["FLASH.SR"] = 0x34
    program(chip, 4, 0)
    chip.run(PROGRAM_NS)
    assert (chip["FLASH.SR.PGERR"], chip.array.read(4, 2)) == (0, b"\0\0")


@FLASH.row(
    "busy-then-eop",
    "After a halfword BSY stands until EOP rises; EOP stays until 1 is written to it.",
    HAL("flash", 827),
    LOCM3("f1/flash", 29),
    pm("3.4"),
)
def _(chip: Bench) -> None:
    unlock(chip)
    chip["FLASH.CR.PG"] = 1
    program(chip, 0, 0x1234)
    chip.run(PROGRAM_NS - 1)
    assert (chip["FLASH.SR.BSY"], chip["FLASH.SR.EOP"]) == (1, 0)
    chip.run(1)
    assert (chip["FLASH.SR.BSY"], chip["FLASH.SR.EOP"]) == (0, 1)
    chip["FLASH.SR"] = 0
    assert chip["FLASH.SR.EOP"]
    chip["FLASH.SR"] = 1 << 5
    assert chip["FLASH.SR"] == 0


@FLASH.row(
    "eop-without-eopie",
    "EOP rises with EOPIE 0 too, unlike in other families of the maker: who polls clears it.",
    RIOT("flash_common", 96),
    HAL("flash", 839),
)
def _(chip: Bench) -> None:
    unlock(chip)
    chip["FLASH.CR.PG"] = 1
    program(chip, 0, 1)
    chip.run(PROGRAM_NS)
    assert (chip["FLASH.SR.EOP"], chip.irqs[4]) == (1, False)
    chip["FLASH.CR.EOPIE"] = 1
    assert chip.irqs[4]
    chip["FLASH.SR"] = 1 << 5
    assert not chip.irqs[4]


@FLASH.row(
    "pg-needed",
    "A write to the array does nothing unless PG is set.",
    LOCM3("f1/flash", 225),
    pm("2.3.3"),
)
def _(chip: Bench) -> None:
    unlock(chip)
    program(chip, 0, 0x1234)
    assert (chip.array.read(0, 2), chip["FLASH.SR"]) == (b"\xff\xff", 0)
    chip["FLASH.CR.PG"] = 1
    program(chip, 0, 0x1234)
    assert chip.array.read(0, 2) == b"\x34\x12"


@FLASH.row(
    "halfwords-only",
    "With PG set only a halfword may be written: a byte or a word is a bus error.",
    HAL("flash", 790),
    pm("2.3.3"),
    values=st.sampled_from([1, 4]),
)
def _(chip: Bench, size: int) -> None:
    unlock(chip)
    chip["FLASH.CR.PG"] = 1
    assert not chip.parts.flash.program(0, size, 0)
    assert chip.array.read(0, 4) == b"\xff" * 4
    assert chip.parts.flash.program(0, 2, 0)


@FLASH.row(
    "page-erase",
    "A page goes by PER, then its address, then STRT; STRT falls, and EOP rises, at the end.",
    LOCM3("f1/flash", 262),
    RUST("flash", 131),
    pm("2.3.4"),
    values=st.integers(0, 15),
)
def _(chip: Bench, page: int) -> None:
    chip.array.data[:] = bytes(chip.array.size)
    unlock(chip)
    chip["FLASH.AR"] = FLASH_BASE + page * PAGE_BYTES + 7
    chip["FLASH.CR.STRT"] = 1
    assert chip["FLASH.CR.STRT"] == 0
    chip["FLASH.CR.PER"] = 1
    assert not any(chip.array.data)
    chip["FLASH.CR.STRT"] = 1
    chip.run(PAGE_ERASE_NS - 1)
    assert (chip["FLASH.CR.STRT"], chip["FLASH.SR"]) == (1, 1)
    chip.run(1)
    assert (chip["FLASH.CR.STRT"], chip["FLASH.SR"]) == (0, 1 << 5)
    erased = [number for number in range(16) if chip.array.data[number * PAGE_BYTES] == 0xFF]
    assert erased == [page]


@FLASH.row(
    "mass-erase",
    "MER and STRT erase every page, and no address is asked.",
    HAL("flash_ex", 174),
    pm("2.3.4"),
)
def _(chip: Bench) -> None:
    chip.array.data[:] = bytes(chip.array.size)
    unlock(chip)
    chip["FLASH.CR.MER"] = 1
    chip["FLASH.CR.STRT"] = 1
    chip.run(MASS_ERASE_NS)
    assert (set(chip.array.data), chip["FLASH.SR"]) == ({0xFF}, 1 << 5)


@FLASH.row(
    "wait-before-next",
    "CR is not changed while an operation runs: the last one must have ended.",
    LOCM3("f1/flash", 220),
    RUST("flash", 68),
    HAL("flash_ex", 174),
)
def _(chip: Bench) -> None:
    unlock(chip)
    chip["FLASH.CR.PG"] = 1
    program(chip, 0, 1)
    chip["FLASH.CR"] = 1 << 7
    assert chip["FLASH.CR"] == 1
    program(chip, 2, 1)
    assert chip.array.read(2, 2) == b"\xff\xff"
    chip.run(PROGRAM_NS)
    chip["FLASH.CR"] = 0
    assert chip["FLASH.CR"] == 0


@FLASH.row(
    "option-keys-after",
    "Option bytes need keys of their own, after those of CR: OPTWRE then reads 1.",
    HAL("flash", 710),
    HAL("flash_ex", 386),
    pm("2.4"),
)
def _(chip: Bench) -> None:
    chip["FLASH.OPTKEYR"] = KEY1
    chip["FLASH.OPTKEYR"] = KEY2
    assert not chip["FLASH.CR.OPTWRE"]
    unlock(chip)
    chip["FLASH.CR.OPTWRE"] = 1
    assert not chip["FLASH.CR.OPTWRE"]
    unlock_options(chip)
    assert chip["FLASH.CR.OPTWRE"]
    chip["FLASH.CR.OPTWRE"] = 0
    assert not chip["FLASH.CR.OPTWRE"]


@FLASH.row(
    "options-erase-first",
    "An option byte is programmed only after all have been erased, else PGERR.",
    HAL("flash_ex", 926),
    LOCM3("common/flash_common_f01", 91),
    pm("2.4"),
)
def _(chip: Bench) -> None:
    unlock_options(chip)
    chip["FLASH.CR.OPTPG"] = 1
    assert chip.parts.flash.program_option(8, 2, 0x0F)
    assert chip["FLASH.SR.PGERR"]
    chip["FLASH.SR"] = 0x34
    chip["FLASH.CR.OPTPG"] = 0
    chip["FLASH.CR.OPTER"] = 1
    chip["FLASH.CR.STRT"] = 1
    chip.run(PAGE_ERASE_NS)
    assert chip.array.options == b"\xff" * 16
    chip["FLASH.CR.OPTER"] = 0
    chip["FLASH.CR.OPTPG"] = 1
    chip.parts.flash.program_option(8, 2, 0x0F)
    assert (chip["FLASH.SR.PGERR"], chip.array.options[8:10]) == (0, b"\x0f\xf0")


@FLASH.row(
    "options-one-by-one",
    "An option byte takes OPTPG, OPTWRE and no LOCK: each of them alone keeps it.",
    HAL("flash", 707),
    HAL_EX("flash", 701),
    pm("2.4", looked_up=False),
    values=st.sampled_from([1 << 4, 1 << 9, 1 << 4 | 1 << 9 | 1 << 7]),
)
def _(chip: Bench, control: int) -> None:
    chip.array.options = b"\xff" * 16
    unlock_options(chip)
    chip["FLASH.CR"] = control
    assert chip.parts.flash.program_option(4, 2, 0x12)
    assert (chip.array.options, chip["FLASH.SR"]) == (b"\xff" * 16, 0)


@FLASH.row(
    "option-complement",
    "Of an option byte only the lower eight bits count; the controller adds the complement.",
    LOCM3("common/flash_common_f01", 117),
    pm("2.2"),
    values=st.integers(0, 0xFFFF),
)
def _(chip: Bench, word: int) -> None:
    chip.array.options = b"\xff" * 16
    unlock_options(chip)
    chip["FLASH.CR.OPTPG"] = 1
    chip.parts.flash.program_option(4, 2, word)
    assert chip.array.options[4:6] == bytes((word & 0xFF, ~word & 0xFF))


@FLASH.row(
    "options-after-reset",
    "What is written to the option bytes counts from the next reset on: WRPR and OBR show it then.",
    HAL("flash_ex", 387),
    HAL("flash", 735),
    pm("2.4"),
)
def _(chip: Bench) -> None:
    chip.array.options = b"\xff" * 16
    unlock_options(chip)
    chip["FLASH.CR.OPTPG"] = 1
    for offset, byte in ((0, 0xA5), (8, 0xFE)):
        chip.parts.flash.program_option(offset, 2, byte)
        chip.run(PROGRAM_NS)
    assert chip["FLASH.WRPR"] == 0xFFFF_FFFF
    chip.parts.reset(ResetCause.SOFTWARE)
    assert (chip["FLASH.WRPR"], chip["FLASH.OBR.RDPRT"]) == (0xFFFF_FFFE, 0)


@FLASH.row(
    "protected-page",
    "A page that its bit of WRPR protects is neither programmed nor erased: WRPRTERR.",
    HAL("flash", 336),
    pm("2.4.2"),
    values=st.integers(0, 3),
)
def _(chip: Bench, group: int) -> None:
    options = bytearray(chip.array.options)
    options[8:10] = bytes((0xFF & ~(1 << group), 1 << group))
    chip.array.options = bytes(options)
    chip.parts.reset(ResetCause.SOFTWARE)
    unlock(chip)
    chip["FLASH.CR.PG"] = 1
    for other in range(4):
        program(chip, other * 4 * PAGE_BYTES, 1)
        chip.run(PROGRAM_NS)
        assert chip["FLASH.SR.WRPRTERR"] == (other == group)
        chip["FLASH.SR"] = 0x34
    chip["FLASH.CR"] = 2
    chip["FLASH.AR"] = FLASH_BASE + (4 * group + 3) * PAGE_BYTES
    chip["FLASH.CR.STRT"] = 1
    assert (chip["FLASH.SR"], chip["FLASH.CR.STRT"]) == (1 << 4, 0)


@FLASH.row(
    "wait-states-first",
    "More wait states are set, and read back, before HCLK goes up.",
    HAL("rcc", 830),
    pm("3.1"),
    values=st.integers(0, 2),
)
def _(chip: Bench, states: int) -> None:
    chip["FLASH.ACR.LATENCY"] = states
    assert (chip["FLASH.ACR.LATENCY"], chip.clocks.flash_wait_states) == (states, states)
    chip.run_at_72_mhz()
    chip["FLASH.ACR.LATENCY"] = states
    chip.run(1_000_001)
    assert ("clock:latency" in chip.warnings) is (states < 2)


FLASH.not_modelled(
    "half-cycle",
    "Half-cycle access is for a SYSCLK of 8 MHz or less, without a prescaler or a PLL.",
    LOCM3("f1/flash", 71),
    pm("3.1"),
    why="HLFCYA is stored and changes no cost: the cost of a block has no such mode",
)
FLASH.not_modelled(
    "strt-then-bsy",
    "BSY rises a cycle after STRT, so that a program waits for one before it polls.",
    RUST("flash", 149),
    why="BSY rises with the write; code in flash stands from there on anyway",
)
FLASH.not_modelled(
    "rdp-debugger",
    "With read protection no page is erased or programmed while a debugger is attached or from SRAM.",
    HAL("flash_ex", 631),
    why="RDP protects the first pages alone; what runs the access is not looked at",
)
