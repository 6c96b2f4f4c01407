"""The description of each peripheral's registers: what is made from it, and what ST says of the same registers."""

import re
from dataclasses import replace

import pytest

from bluepill_sim.fabric.registers import Peripheral, Register, fields_of, indices, masks
from bluepill_sim.peripherals.dma import Dma
from bluepill_sim.stm32f103 import BASES
from tests.tools.svd import HINT, SvdRegister, svd_registers
from tools.generators.chip import HEADERS, ROOT, SOURCE, files, peripherals, registers_header

ROWS = list(peripherals())


def test_the_committed_files_are_what_the_descriptions_make() -> None:
    made = files()
    there = {path.relative_to(ROOT) for path in (ROOT / HEADERS).iterdir()} | {
        path for path in made if (ROOT / path).exists()
    }
    kept = {path: (ROOT / path).read_text(encoding="utf-8") for path in there}
    stale = sorted(str(path) for path in made.keys() | kept.keys() if made.get(path) != kept.get(path))
    assert stale == [], "run `make generated`"


def test_every_description_says_where_the_manual_tabulates_it() -> None:
    assert [name for kind, name in ROWS if not kind.SOURCE] == []


def test_no_device_in_c_spells_a_name_of_a_description_again() -> None:
    again = []
    for path in sorted((ROOT / SOURCE / "devices").glob("*.[ch]")):
        text = path.read_text(encoding="utf-8")
        mine = enumerators(text)
        for name in re.findall(r'#include "\.\./registers/(\w+)\.h"', text):
            made = enumerators((ROOT / HEADERS / f"{name}.h").read_text(encoding="utf-8"))
            again += [f"{path.name}: {one}" for one in sorted(mine & made)]
    assert again == []
    including = {path.stem for path in (ROOT / HEADERS).iterdir()}
    texts = "".join(path.read_text(encoding="utf-8") for path in (ROOT / SOURCE / "devices").glob("*.[ch]"))
    assert [name for name in sorted(including) if f'"../registers/{name}.h"' not in texts] == []


def test_a_name_with_two_meanings_gets_the_register_in_front() -> None:
    made = files()[HEADERS / "i2c.h"]
    assert {"CR1_PEC", "SR2_PEC", "SR2_PEC_AT"} < enumerators(made)
    assert "PEC" not in enumerators(made)
    assert "#define CNF7 0xc0000000u" in files()[HEADERS / "gpio.h"]


def test_a_bit_that_moves_moves_in_c(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "CIRC = 1 << 5" in registers_header("dma", [Dma])
    moved = [
        Register(name=one.name, offset=one.offset, fields=one.fields.replace("CIRC 5", "CIRC 15"))
        for one in Dma.REGISTERS
    ]
    monkeypatch.setattr(Dma, "REGISTERS", tuple(moved))
    assert "CIRC = 1 << 15" in registers_header("dma", [Dma])


def test_python_takes_names_from_a_description() -> None:
    assert masks("A 9:8, B 0", "B A") == (1, 0x300)
    assert indices(Dma.REGISTERS, "IFCR CCR1") == (1, 2)
    with pytest.raises(KeyError):
        masks("A 1", "C")


def enumerators(text: str) -> set[str]:
    """Return the names of all enumerators in C."""
    found: set[str] = set()
    for body in re.findall(
        r"\benum\b\s*\w*\s*\{(.*?)\}", re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL), flags=re.DOTALL
    ):
        found |= set(re.findall(r"(?:^|,)\s*(\w+)", body))
    return found


# Against ST's own description.

#: Names that ST spells otherwise there, or places that the manual names and it does not: by peripheral and field.
OTHERWISE = {
    ("RCC", "USBPRE"): "OTGFSPRE, of the connectivity line",
    ("FLASH", "UNUSED"): "the manual's name of bits that read 1",
    ("ADC", "DUALMOD"): "ADC2 has the place, and not the field",
    ("ADC", "ADC2DATA"): "likewise",
    ("I2C", "one"): "a bit that software keeps at 1 (RM0008 26.6.3)",
    ("I2C", "ADD"): "ADD0, ADD7 and ADD10",
    ("CAN", "FB"): "FB0 to FB31",
    ("WWDG", "EWIF"): "EWI, an error of theirs (RM0008 20.6.3)",
    ("BKP", "D"): "D1 to D10",
    ("TIM", "OC4CE"): "O24CE, an error of theirs",
    **{("CAN", f"RESERVED{n}"): "reserved bits that read" for n in ("", 0, 1, 2)},
}
#: Reset values that ST gives otherwise there.
RESETS = {
    r"CAN\.(MCR|MSR|TSR|BTR|FMR)": "all 0 there; RM0008 24.9.5",
    r"TIM\d\.ARR": "0 there; 0xFFFF in RM0008 14.4.12 and 15.4.12",
    r"RTC\.(PRLL|DIVL|ALRH|ALRL)": "write-only, or read through the counter",
    r"SPI\d\.I2SPR": "the medium-density part has no I2S",
}
#: Registers that are read, and write-only there and in the manual.
READS = {r"RTC\.ALR[HL]": "ST's library reads the alarm back"}


def svd_differences(kind: type[Peripheral], name: str, theirs: dict[int, list[SvdRegister]]) -> list[str]:
    """Return in what a description is not what ST says, but for what is known.

    Args:
        kind: The peripheral's class.
        name: Its name.
        theirs: ST's registers by address; CCMRx has two.
    """
    family, found = re.sub(r"\d+$|(?<=GPIO)\w", "", name), []
    for register in kind.REGISTERS:
        there = theirs.get(BASES[name] + register.offset)
        if there is None:
            found += [] if register.name.startswith("PMA_") else [f"{name}.{register.name} is at no address of theirs"]
            continue
        places = {place: each for one in there for each, place in one.fields.items()}
        if register.reset not in {one.reset for one in there} and not known(RESETS, f"{name}.{register.name}"):
            found.append(f"{name}.{register.name}: reset {register.reset:#x}, ST has {there[0].reset:#x}")
        for field in fields_of(register.fields):
            spelled = places.get((field.high, field.low))
            if (family, field.name) not in OTHERWISE and not is_same(field.name, spelled, register.name):
                found.append(f"{name}.{register.name}: {field.name} at {field.high}:{field.low}, ST has {spelled}")
        found += [
            f"{name}.{register.name}: {one.access}, and not so by {field.name}"
            for one in there
            for field in fields_of(register.fields)
            if (one.access == "read-only" and register.access(field) != "r")
            or (
                one.access == "write-only"
                and not known(READS, f"{name}.{register.name}")
                and register.access(field) not in {"w", "rc_w1", "rc_w0"}
            )
        ]
    return found


def known(table: dict[str, str], name: str) -> bool:
    """Tell whether a pattern of a table is that name."""
    return any(re.fullmatch(pattern, name) for pattern in table)


def is_same(ours: str, theirs: str | None, register: str) -> bool:
    """Tell whether a field has the same name: ST's may have the register's kind behind, or be the register's own."""
    plain = (theirs or "").upper().replace("_", "")
    mine = ours.upper().replace("_", "")
    return plain in {mine, mine + "EN", mine + "RST", mine + "REMAP"} or (bool(plain) and plain == register)


def by_address(theirs: dict[str, dict[str, SvdRegister]]) -> dict[int, list[SvdRegister]]:
    """Return ST's registers by their addresses."""
    found: dict[int, list[SvdRegister]] = {}
    for registers in theirs.values():
        for one in registers.values():
            found.setdefault(one.address, []).append(one)
    return found


@pytest.fixture(scope="module")
def theirs() -> dict[int, list[SvdRegister]]:
    found = svd_registers()
    if found is None:
        pytest.skip(HINT)
    return by_address(found)


def test_the_descriptions_are_what_st_says(theirs: dict[int, list[SvdRegister]]) -> None:
    assert [line for kind, name in ROWS for line in svd_differences(kind, name, theirs)] == []


@pytest.mark.parametrize(
    ("register", "change", "reported"),
    [
        ("CCR1", {"fields": "EN 1, TCIE 0"}, "DMA1.CCR1: EN at 1:1, ST has TCIE"),
        ("CCR1", {"reset": 1, "mask": 1}, "DMA1.CCR1: reset 0x1, ST has 0x0"),
        ("CCR1", {"offset": 0x18}, "DMA1.CCR1 is at no address of theirs"),
        ("ISR", {"mask": 1, "readable": 1, "writable": 1}, "DMA1.ISR: read-only, and not so by GIF1"),
    ],
)
def test_what_is_planted_in_a_description_is_named(
    theirs: dict[int, list[SvdRegister]],
    monkeypatch: pytest.MonkeyPatch,
    register: str,
    change: dict[str, int],
    reported: str,
) -> None:
    planted = tuple(replace(one, **({"mask": 0} | change)) if one.name == register else one for one in Dma.REGISTERS)
    monkeypatch.setattr(Dma, "REGISTERS", planted)
    assert reported in svd_differences(Dma, "DMA1", theirs)
