"""FLASH: wait states, keys, programming and erasing."""

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.peripherals.flash import DELIVERED

KEYS = (0x4567_0123, 0xCDEF_89AB)
PG, PER, MER, STRT, LOCK, ERRIE, EOPIE = 1, 2, 4, 1 << 6, 1 << 7, 1 << 10, 1 << 12
OPTPG, OPTER, OPTWRE = 1 << 4, 1 << 5, 1 << 9
BSY, PGERR, WRPRTERR, EOP = 1, 1 << 2, 1 << 4, 1 << 5
PROGRAM_NS, ERASE_NS = 52_500, 20_000_000


class Array:
    """Eight pages of flash."""

    size = 8192

    def __init__(self) -> None:
        self.data = bytearray(b"\xff" * self.size)
        self.options = DELIVERED

    def read(self, offset: int, size: int) -> bytes:
        return bytes(self.data[offset : offset + size])

    def write(self, offset: int, data: bytes) -> None:
        self.data[offset : offset + len(data)] = data

    def write_options(self, options: bytes) -> None:
        self.options = options


@pytest.fixture
def array(fake_chip: Any) -> Array:
    memory = Array()
    fake_chip.parts.flash.memory = memory
    return memory


@pytest.fixture
def unlocked(fake_chip: Any) -> Any:
    for key in KEYS:
        fake_chip.write("FLASH.KEYR", key)
    return fake_chip


def test_wait_states_and_prefetch_are_notified_to_the_cpu(fake_chip: Any) -> None:
    assert fake_chip.read("FLASH.ACR") == 0x30
    changes = fake_chip.clock_changes
    fake_chip.write("FLASH.ACR", 0x02)
    assert (fake_chip.clocks.flash_wait_states, fake_chip.clocks.flash_prefetch) == (2, False)
    assert fake_chip.read("FLASH.ACR") == 0x02
    fake_chip.write("FLASH.ACR", 0x02)
    assert fake_chip.clock_changes == changes + 1
    fake_chip.write("FLASH.ACR", 0x13)
    assert "FLASH:latency" in fake_chip.warnings
    fake_chip.parts.flash.reset()
    assert (fake_chip.clocks.flash_wait_states, fake_chip.clocks.flash_prefetch) == (0, True)


def test_two_keys_unlock_and_software_locks_again(unlocked: Any) -> None:
    assert unlocked.read("FLASH.CR") == 0
    unlocked.write("FLASH.KEYR", 1)
    unlocked.write("FLASH.CR", PG)
    assert unlocked.read("FLASH.CR") == PG
    unlocked.write("FLASH.CR", LOCK)
    assert unlocked.read("FLASH.CR") == LOCK


@pytest.mark.parametrize("keys", [(1,), (KEYS[1],), (KEYS[0], KEYS[0])])
def test_a_wrong_key_locks_until_reset(fake_chip: Any, keys: tuple[int, ...]) -> None:
    for key in (*keys, *KEYS):
        fake_chip.write("FLASH.KEYR", key)
    assert fake_chip.read("FLASH.CR") == LOCK
    fake_chip.parts.flash.reset()
    for key in KEYS:
        fake_chip.write("FLASH.KEYR", key)
    assert fake_chip.read("FLASH.CR") == 0


def test_a_locked_control_register_ignores_writes(fake_chip: Any) -> None:
    fake_chip.write("FLASH.CR", LOCK)
    assert fake_chip.warnings == {}
    fake_chip.write("FLASH.CR", PG)
    assert fake_chip.read("FLASH.CR") == LOCK
    assert list(fake_chip.warnings) == ["FLASH:locked"]


def test_a_halfword_is_programmed_in_its_time(unlocked: Any, array: Array) -> None:
    unlocked.write("FLASH.CR", PG | EOPIE)
    unlocked.parts.flash.program(6, 2, 0x1234)
    assert array.read(6, 2) == b"\x34\x12"
    unlocked.advance(PROGRAM_NS - 1)
    assert unlocked.read("FLASH.SR") == BSY
    assert not unlocked.irqs[4]
    unlocked.advance(PROGRAM_NS)
    assert unlocked.read("FLASH.SR") == EOP
    assert unlocked.irqs[4]
    unlocked.write("FLASH.SR", EOP)
    assert unlocked.read("FLASH.SR") == 0
    assert not unlocked.irqs[4]


@pytest.mark.parametrize(("size", "value"), [(1, 5), (4, 5)])
def test_only_halfwords_can_be_programmed(unlocked: Any, array: Array, size: int, value: int) -> None:
    unlocked.write("FLASH.CR", PG | ERRIE)
    assert not unlocked.parts.flash.program(0, size, value)  # PM0075 2.3.3: a bus error
    assert (
        unlocked.warnings["FLASH:width"] == f"flash programmed by {8 * size} bits: only halfwords can be, a bus error"
    )
    assert unlocked.read("FLASH.SR") == 0
    unlocked.write("FLASH.CR", LOCK)
    assert unlocked.parts.flash.program(0, size, value)  # without PG it is ignored, and warned of
    assert array.read(0, 4) == b"\xff" * 4


def test_what_is_not_erased_takes_only_zero(unlocked: Any, array: Array) -> None:
    array.write(0, b"\x01\x02")
    unlocked.write("FLASH.CR", PG)
    unlocked.parts.flash.program(0, 2, 0x0201)
    assert unlocked.read("FLASH.SR") == PGERR
    unlocked.parts.flash.program(0, 2, 0)
    assert array.read(0, 2) == b"\0\0"


def test_a_write_during_an_operation_is_an_error(unlocked: Any, array: Array) -> None:
    unlocked.write("FLASH.CR", PG)
    unlocked.parts.flash.program(0, 2, 1)
    unlocked.parts.flash.program(2, 2, 1)
    unlocked.write("FLASH.CR", LOCK)
    assert unlocked.read("FLASH.SR") == BSY | PGERR
    assert unlocked.read("FLASH.CR") == PG
    assert array.read(2, 2) == b"\xff\xff"


def test_a_write_without_pg_does_nothing(unlocked: Any, array: Array) -> None:
    unlocked.parts.flash.program(0, 2, 0)
    assert array.read(0, 2) == b"\xff\xff"
    assert list(unlocked.warnings) == ["FLASH:write"]


def test_a_page_is_erased(unlocked: Any, array: Array) -> None:
    array.write(0, bytes(array.size))
    unlocked.write("FLASH.CR", PER)
    unlocked.write("FLASH.AR", 0x0800_0400 + 5)
    unlocked.write("FLASH.CR", PER | STRT)
    unlocked.advance(ERASE_NS - 1)
    assert unlocked.read("FLASH.SR") == BSY
    unlocked.advance(ERASE_NS)
    assert (unlocked.read("FLASH.SR"), unlocked.read("FLASH.CR")) == (EOP, PER)
    assert bytes(array.data) == bytes(1024) + b"\xff" * 1024 + bytes(array.size - 2048)


def test_everything_is_erased(unlocked: Any, array: Array) -> None:
    array.write(0, bytes(array.size))
    unlocked.write("FLASH.CR", MER | STRT)
    unlocked.advance(ERASE_NS)
    assert bytes(array.data) == b"\xff" * array.size


def test_a_page_outside_the_array_is_an_error(unlocked: Any, array: Array) -> None:
    unlocked.write("FLASH.AR", 0x0800_0000 + array.size)
    unlocked.write("FLASH.CR", PER | STRT)
    assert unlocked.read("FLASH.SR") == WRPRTERR
    unlocked.write("FLASH.CR", STRT)
    assert unlocked.read("FLASH.CR") == 0


def test_a_board_that_does_not_offer_its_array_warns(unlocked: Any) -> None:
    unlocked.write("FLASH.CR", PG)
    unlocked.parts.flash.program(0, 2, 0)
    unlocked.write("FLASH.CR", MER | STRT)
    assert list(unlocked.warnings) == ["FLASH:memory"]


def unlock_options(chip: Any) -> None:
    for key in KEYS:
        chip.write("FLASH.OPTKEYR", key)


def options_of(array: Array) -> list[int]:
    """The bytes, where each has its complement."""
    pairs = zip(array.options[::2], array.options[1::2], strict=True)
    return [byte if byte ^ complement == 0xFF else -1 for byte, complement in pairs]


@pytest.fixture
def open_options(unlocked: Any, array: Array) -> Any:
    unlock_options(unlocked)
    return unlocked


def test_option_bytes_have_keys_of_their_own_behind_those_of_the_flash(fake_chip: Any, array: Array) -> None:
    unlock_options(fake_chip)
    assert fake_chip.read("FLASH.CR") == LOCK
    for key in KEYS:
        fake_chip.write("FLASH.KEYR", key)
    fake_chip.write("FLASH.OPTKEYR", KEYS[0])
    fake_chip.write("FLASH.OPTKEYR", KEYS[0])
    assert "FLASH:option-key" in fake_chip.warnings
    fake_chip.write("FLASH.CR", OPTWRE)
    assert fake_chip.read("FLASH.CR") == 0  # it cannot be set
    unlock_options(fake_chip)
    assert fake_chip.read("FLASH.CR") == OPTWRE
    fake_chip.write("FLASH.CR", 0)
    assert fake_chip.read("FLASH.CR") == 0
    assert array.options == DELIVERED


def test_erased_options_are_read_after_a_reset_and_protect_the_flash(open_options: Any, array: Array) -> None:
    chip = open_options
    chip.write("FLASH.CR", OPTER | OPTWRE)
    chip.write("FLASH.CR", OPTER | OPTWRE | STRT)
    assert array.options == b"\xff" * 16
    chip.advance(ERASE_NS - 1)
    assert chip.read("FLASH.SR") == BSY
    chip.advance(ERASE_NS)
    assert chip.read("FLASH.SR") == EOP
    assert (chip.read("FLASH.OBR"), chip.read("FLASH.WRPR")) == (0x03FF_FFFC, 0xFFFF_FFFF)
    chip.parts.flash.reset()
    assert (chip.read("FLASH.OBR"), chip.read("FLASH.WRPR")) == (0x03FF_FFFE, 0xFFFF_FFFF)


def test_an_option_byte_gets_its_complement_and_must_be_erased_before(open_options: Any, array: Array) -> None:
    chip = open_options
    chip.write("FLASH.CR", OPTPG | OPTWRE)
    assert chip.parts.flash.program_option(4, 2, 0x1234)
    assert chip.read("FLASH.SR") == PGERR
    array.options = array.options[:4] + b"\xff\xff" + array.options[6:]
    chip.write("FLASH.SR", PGERR)
    assert chip.parts.flash.program_option(4, 2, 0x1234)
    assert (chip.read("FLASH.SR"), options_of(array)[2]) == (BSY, 0x34)
    chip.advance(chip.now_ns + PROGRAM_NS)
    assert chip.read("FLASH.SR") == EOP
    chip.parts.flash.reset()
    assert chip.read("FLASH.OBR") >> 10 & 0xFF == 0x34
    assert chip.parts.flash.program_option(6, 2, 0)
    assert "FLASH:options" in chip.warnings  # the reset has locked them
    assert not open_options.parts.flash.is_busy


@pytest.mark.parametrize("size", [1, 4])
def test_option_bytes_take_halfwords_only(open_options: Any, size: int) -> None:
    open_options.write("FLASH.CR", OPTPG | OPTWRE)
    assert not open_options.parts.flash.program_option(4, size, 0)
    assert "FLASH:width" in open_options.warnings


@settings(max_examples=25)
@given(pairs=st.lists(st.tuples(st.integers(0, 255), st.integers(0, 255), st.booleans()), min_size=8, max_size=8))
def test_a_reset_loads_what_fits_its_complement(
    make_fake_chip: Callable[[], Any], pairs: list[tuple[int, int, bool]]
) -> None:
    """PM0075 2.2: one that does not fit counts as 0xFF, and is an error unless both halves are erased."""
    chip, array = make_fake_chip(), Array()
    chip.parts.flash.memory = array
    rows = [(byte, byte ^ 0xFF if is_good else other) for byte, other, is_good in pairs]
    array.options = bytes(half for row in rows for half in row)
    chip.parts.flash.reset()
    values = [byte if byte ^ complement == 0xFF else 0xFF for byte, complement in rows]
    error = any(byte ^ other != 0xFF and (byte, other) != (0xFF, 0xFF) for byte, other in rows)
    obr = chip.read("FLASH.OBR")
    assert obr & 3 == error | (values[0] != 0xA5) << 1
    assert [obr >> 2 & 0xFF, obr >> 10 & 0xFF, obr >> 18 & 0xFF] == values[1:4]
    assert chip.read("FLASH.WRPR").to_bytes(4, "little") == bytes(values[4:])
    assert (chip.power.starts_watchdog, chip.power.resets_at_stop, chip.power.resets_at_standby) == tuple(
        not values[1] >> bit & 1 for bit in range(3)
    )


@pytest.mark.parametrize("offset", [0, 4095, 4096, 8191])
def test_a_protected_page_is_neither_programmed_nor_erased(unlocked: Any, array: Array, offset: int) -> None:
    """Bit 1 of WRP0 is 0: pages 4 to 7."""
    array.options = array.options[:8] + b"\xfd\x02" + array.options[10:]
    unlocked.parts.flash._load_options()
    is_protected = offset >= 4096
    unlocked.write("FLASH.CR", PG)
    unlocked.parts.flash.program(offset & ~1, 2, 5)
    assert unlocked.read("FLASH.SR") == (WRPRTERR if is_protected else BSY)
    unlocked.advance(unlocked.now_ns + PROGRAM_NS)
    unlocked.write("FLASH.SR", WRPRTERR | EOP)
    array.data[offset] = 7
    unlocked.write("FLASH.CR", PER)
    unlocked.write("FLASH.AR", 0x0800_0000 + offset)
    unlocked.write("FLASH.CR", PER | STRT)
    assert unlocked.read("FLASH.SR") == (WRPRTERR if is_protected else BSY)
    assert array.data[offset] == (7 if is_protected else 0xFF)


def test_one_protected_page_keeps_the_mass_erase_away(unlocked: Any, array: Array) -> None:
    array.data[0] = 7
    array.options = array.options[:8] + b"\xfd\x02" + array.options[10:]
    unlocked.parts.flash._load_options()
    unlocked.write("FLASH.CR", MER)
    unlocked.write("FLASH.CR", MER | STRT)
    assert (unlocked.read("FLASH.SR"), array.data[0], unlocked.read("FLASH.CR")) == (WRPRTERR, 7, MER)


def test_read_protection_guards_the_first_pages_and_goes_with_the_whole_flash(open_options: Any, array: Array) -> None:
    chip = open_options
    array.options = b"\xff" * 16
    chip.parts.flash._load_options()
    array.data[0] = array.data[5000] = 7
    chip.write("FLASH.CR", PER | OPTWRE)
    chip.write("FLASH.AR", 0x0800_0000)
    chip.write("FLASH.CR", PER | STRT | OPTWRE)
    assert chip.read("FLASH.SR") == WRPRTERR
    chip.write("FLASH.SR", WRPRTERR)
    chip.write("FLASH.CR", OPTPG | OPTWRE)
    chip.parts.flash.program_option(0, 2, 0xA5)
    assert (array.data[0], array.data[5000], options_of(array)[0]) == (0xFF, 0xFF, 0xA5)
    chip.advance(PROGRAM_NS + ERASE_NS - 1)
    assert chip.read("FLASH.SR") == BSY
    chip.advance(PROGRAM_NS + ERASE_NS)
    assert chip.read("FLASH.SR") == EOP
    chip.parts.flash.reset()
    assert not chip.read("FLASH.OBR") & 2


@pytest.mark.parametrize("control", [OPTPG, OPTWRE, OPTPG | OPTWRE | LOCK])
@pytest.mark.parametrize("size", [2, 4])
def test_each_of_optpg_optwre_and_lock_alone_keeps_the_option_bytes(
    open_options: Any, array: Array, control: int, size: int
) -> None:
    array.options = b"\xff" * 16
    open_options.write("FLASH.CR", control)
    assert open_options.parts.flash.program_option(4, size, 0x1234), "what is ignored is no bus error"
    assert (array.options, open_options.read("FLASH.SR")) == (b"\xff" * 16, 0)
    assert list(open_options.warnings) == ["FLASH:options"]


@pytest.mark.parametrize("control", [0, PG | LOCK])
@pytest.mark.parametrize("size", [1, 2, 4])
def test_each_of_pg_and_lock_alone_keeps_the_array(unlocked: Any, array: Array, control: int, size: int) -> None:
    unlocked.write("FLASH.CR", control)
    assert unlocked.parts.flash.program(0, size, 0)
    assert (bytes(array.data[:4]), unlocked.read("FLASH.SR")) == (b"\xff" * 4, 0)
    assert list(unlocked.warnings) == ["FLASH:write"]


@pytest.mark.parametrize(
    ("control", "options", "word", "is_busy"),
    [
        (PG, DELIVERED, 0xFF, False),
        (0, DELIVERED, 0xFF, False),
        (PG | LOCK, DELIVERED, 0xFF, False),
        (PG | EOPIE, DELIVERED, 0xFF, False),
        (PG, DELIVERED, 0xFE, False),
        (PG, DELIVERED, 0xFF, True),
        (PG, DELIVERED[:8] + b"\xfe\x01" + DELIVERED[10:], 0xFF, False),
        (PG, b"\xff" * 16, 0xFF, False),
    ],
)
def test_a_halfword_is_programmed_at_once_only_where_nothing_is_seen_of_it(
    unlocked: Any, array: Array, control: int, options: bytes, word: int, is_busy: bool
) -> None:
    flash = unlocked.parts.flash
    array.options = options
    flash._load_options()
    array.data[7] = word
    if is_busy:
        unlocked.write("FLASH.CR", PG)
        flash.program(5000, 2, 1)
    unlocked.write("FLASH.CR", control)
    before = unlocked.read("FLASH.SR")
    is_simple = (control, options, word, is_busy) == (PG, DELIVERED, 0xFF, False)
    assert flash.program_at_once(6) is is_simple
    assert unlocked.read("FLASH.SR") == (EOP if is_simple else before)


def test_without_its_array_nothing_is_programmed_at_once(unlocked: Any) -> None:
    unlocked.write("FLASH.CR", PG)
    assert not unlocked.parts.flash.program_at_once(0)


@pytest.mark.parametrize("enable", [0, EOPIE, ERRIE])
@pytest.mark.parametrize("flag", [EOP, PGERR, WRPRTERR])
def test_each_flag_interrupts_by_its_enable_until_it_is_cleared(
    unlocked: Any, array: Array, enable: int, flag: int
) -> None:
    raises = enable == (EOPIE if flag == EOP else ERRIE)
    array.options = DELIVERED[:8] + b"\xfd\x02" + DELIVERED[10:]
    unlocked.parts.flash._load_options()
    array.data[0] = 0 if flag == PGERR else 0xFF
    unlocked.write("FLASH.CR", PG | enable)
    unlocked.parts.flash.program(4096 if flag == WRPRTERR else 0, 2, 5)
    unlocked.advance(PROGRAM_NS)
    assert (unlocked.read("FLASH.SR"), unlocked.irqs[4]) == (flag, raises)
    unlocked.write("FLASH.SR", (EOP | PGERR | WRPRTERR) & ~flag)
    assert (unlocked.read("FLASH.SR"), unlocked.irqs[4]) == (flag, raises)
    unlocked.write("FLASH.CR", PG)
    assert not unlocked.irqs[4]
    unlocked.write("FLASH.CR", PG | enable)
    assert unlocked.irqs[4] is raises
    unlocked.write("FLASH.SR", flag)
    assert (unlocked.read("FLASH.SR"), unlocked.irqs[4]) == (0, False)


def test_a_reset_takes_the_interrupt_the_operation_and_the_lock_back(unlocked: Any, array: Array) -> None:
    unlocked.write("FLASH.CR", PG | EOPIE)
    unlocked.parts.flash.program(0, 2, 5)
    unlocked.advance(PROGRAM_NS)
    assert unlocked.irqs[4]
    unlocked.parts.flash.program(2, 2, 5)
    unlocked.parts.flash.reset()
    assert (unlocked.read("FLASH.SR"), unlocked.read("FLASH.CR"), unlocked.irqs[4]) == (0, LOCK, False)
    unlocked.advance(3 * PROGRAM_NS)
    assert (unlocked.read("FLASH.SR"), unlocked.irqs[4]) == (0, False)


def test_a_reset_forgets_half_a_sequence_of_keys_and_the_address(fake_chip: Any, array: Array) -> None:
    fake_chip.write("FLASH.KEYR", KEYS[0])
    fake_chip.parts.flash.reset()
    fake_chip.write("FLASH.KEYR", KEYS[1])
    assert fake_chip.read("FLASH.CR") == LOCK
    fake_chip.parts.flash.reset()
    for key in KEYS:
        fake_chip.write("FLASH.KEYR", key)
    fake_chip.write("FLASH.OPTKEYR", KEYS[0])
    fake_chip.write("FLASH.AR", 0x0800_0400)
    fake_chip.parts.flash.reset()
    for key in KEYS:
        fake_chip.write("FLASH.KEYR", key)
    fake_chip.write("FLASH.OPTKEYR", KEYS[1])
    assert fake_chip.read("FLASH.CR") == 0
    array.data[:] = bytes(array.size)
    fake_chip.write("FLASH.CR", PER | STRT)
    assert (fake_chip.read("FLASH.SR"), any(array.data)) == (WRPRTERR, False), "the address is 0, which is no page"


def test_keys_of_what_is_open_are_not_looked_at(open_options: Any, array: Array) -> None:
    open_options.write("FLASH.KEYR", 1)
    open_options.write("FLASH.OPTKEYR", 1)
    assert open_options.warnings == {}
    open_options.write("FLASH.CR", LOCK)
    open_options.write("FLASH.OPTKEYR", 1)
    open_options.write("FLASH.CR", LOCK)
    assert open_options.warnings == {}, "LOCK over LOCK says nothing"
    for key in KEYS:
        open_options.write("FLASH.KEYR", key)
    assert not open_options.read("FLASH.CR") & LOCK


@pytest.mark.parametrize("keys", [(KEYS[0], 1, KEYS[1]), (KEYS[1], KEYS[0], 1), (1, KEYS[1])])
def test_option_keys_begin_anew_behind_a_wrong_one(unlocked: Any, keys: tuple[int, ...]) -> None:
    for key in keys:
        unlocked.write("FLASH.OPTKEYR", key)
    assert not unlocked.read("FLASH.CR") & OPTWRE
    unlock_options(unlocked)
    assert unlocked.read("FLASH.CR") & OPTWRE


@pytest.mark.parametrize(
    ("control", "what"),
    [
        (0, ""), (OPTER, ""), (OPTWRE, ""), (OPTER | OPTWRE, "options"), (OPTER | OPTWRE | MER | PER, "options"),
        (PER, "page"), (PER | OPTER, "page"), (PER | OPTWRE, "page"), (MER, "all"), (MER | PER, "all"),
    ],
)  # fmt: skip
def test_strt_erases_what_is_chosen_and_allowed(open_options: Any, array: Array, control: int, what: str) -> None:
    array.data[:] = bytes(array.size)
    open_options.write("FLASH.AR", 0x0800_0400)
    open_options.write("FLASH.CR", control | STRT)
    assert (array.options == b"\xff" * 16) is (what == "options")
    assert array.data.count(0xFF) == {"page": 1024, "all": array.size}.get(what, 0)
    assert not array.data[1024] or what in {"page", "all"}
    assert open_options.read("FLASH.CR") == control | (STRT if what else 0)
    assert open_options.read("FLASH.SR") == (BSY if what else 0)
    open_options.advance(ERASE_NS)
    assert (open_options.read("FLASH.CR"), open_options.read("FLASH.SR")) == (control, EOP if what else 0)


@pytest.mark.parametrize(
    ("is_protected", "offset", "byte", "erases"),
    [(True, 0, 0xA5, True), (False, 0, 0xA5, False), (True, 4, 0xA5, False), (True, 0, 0xA4, False)],
)
def test_only_the_end_of_read_protection_erases_the_array(
    open_options: Any, array: Array, is_protected: bool, offset: int, byte: int, erases: bool
) -> None:
    array.options = b"\xff" * 16 if is_protected else DELIVERED
    open_options.parts.flash._load_options()
    array.options = b"\xff" * 16
    array.data[:] = bytes(array.size)
    open_options.write("FLASH.CR", OPTPG | OPTWRE)
    open_options.parts.flash.program_option(offset, 2, byte)
    assert array.data.count(0xFF) == (array.size if erases else 0)
    open_options.advance(PROGRAM_NS - 1)
    assert open_options.read("FLASH.SR") == BSY
    open_options.advance(PROGRAM_NS)
    assert open_options.read("FLASH.SR") == (BSY if erases else EOP)


def test_an_option_byte_waits_for_no_other(open_options: Any, array: Array) -> None:
    array.options = b"\xff" * 16
    open_options.write("FLASH.CR", OPTPG | OPTWRE)
    open_options.parts.flash.program_option(4, 2, 1)
    open_options.parts.flash.program_option(6, 2, 2)
    assert open_options.read("FLASH.SR") == BSY | PGERR
    assert options_of(array)[2:4] == [1, -1]
