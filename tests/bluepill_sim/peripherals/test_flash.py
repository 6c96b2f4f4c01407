"""FLASH: wait states, keys, programming and erasing."""

from typing import Any

import pytest

KEYS = (0x4567_0123, 0xCDEF_89AB)
PG, PER, MER, STRT, LOCK, ERRIE, EOPIE = 1, 2, 4, 1 << 6, 1 << 7, 1 << 10, 1 << 12
BSY, PGERR, WRPRTERR, EOP = 1, 1 << 2, 1 << 4, 1 << 5
PROGRAM_NS, ERASE_NS = 52_500, 20_000_000


class Array:
    """Four pages of flash."""

    size = 4096

    def __init__(self) -> None:
        self.data = bytearray(b"\xff" * self.size)

    def read(self, offset: int, size: int) -> bytes:
        return bytes(self.data[offset : offset + size])

    def write(self, offset: int, data: bytes) -> None:
        self.data[offset : offset + len(data)] = data


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
    assert bytes(array.data) == bytes(1024) + b"\xff" * 1024 + bytes(2048)


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


def test_option_bytes_are_warned_of(unlocked: Any) -> None:
    unlocked.write("FLASH.OPTKEYR", KEYS[0])
    unlocked.write("FLASH.CR", 1 << 4)
    assert list(unlocked.warnings) == ["FLASH:options"]
