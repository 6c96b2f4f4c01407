"""The parts that ship, driven by programs on both cores; and each by itself where a program would be long."""

from collections.abc import Callable
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim import BluePill, BluePillError
from bluepill_sim.parts import Eeprom24C02, SpiFlash
from bluepill_sim.parts.eeprom_24c02 import WRITE_NS
from bluepill_sim.parts.spi_flash import BUSY, ERASES, PROGRAM_NS, SIZE_BYTES, WEL
from bluepill_sim.peripherals.spi import Loopback

Boards = Callable[[str], BluePill]
QUICK = settings(max_examples=40)
WRAPPED = bytes(n * 7 % 256 for n in range(32))


def said_by(board: BluePill) -> list[str]:
    """Run to the end of a program and return its lines."""
    said = bytearray()
    board.usart1.subscribe(lambda rows: said.extend(word for word, _ in rows))
    board.usart1.expect(b"end\n", within="1 s")
    return said.decode().splitlines()


def test_a_program_reads_erases_and_programs_the_flash(board_of: Boards) -> None:
    board, flash = board_of("flash_over_spi"), SpiFlash(b"\x00" * 0x2000)
    board.spi("SPI1", flash, select="PA4")
    said = said_by(board)
    assert said[:4] == ["id ef4015", "status 0002", "erase waited", "program waited"]
    assert said[4] == f"read {WRAPPED[16:].hex()}ff {WRAPPED[:16].hex()}", "it wraps within the page"
    assert flash.memory[0x0FFF:0x1010] == b"\x00" + WRAPPED[16:]
    assert (flash.ignored, board.warnings) == (0, [])


def test_a_program_scans_writes_and_reads_the_eeprom(board_of: Boards) -> None:
    board, memory = board_of("eeprom_over_i2c"), Eeprom24C02(0x50)
    board.i2c("I2C1", memory)
    said = said_by(board)
    assert said == ["scan 50", "write at once waited", "read a", "read ab", "read abc", "read abcdefgh45678923", "end"]
    assert memory.memory[0x28:0x30] == b"45678923"
    assert board.warnings == []


def test_dma_serves_both_buses_and_ends_a_reception_at_its_last_byte(board_of: Boards) -> None:
    board, memory = board_of("dma_buses"), Eeprom24C02(contents=bytes(range(48, 112)))
    if "DMA1" not in board.chip.parts.by_name:
        pytest.skip("the chip has no DMA1 yet")
    board.spi("SPI1", Loopback())
    board.i2c("I2C1", memory)
    said = said_by(board)
    assert said == ["spi 000", f"i2c {bytes(range(48, 112)).decode()}", "end"]
    assert memory._at == 64, "LAST refuses the byte that DMA takes last: no other is sent"
    assert board.warnings == []


@pytest.mark.parametrize("name", ["flash_over_spi", "eeprom_over_i2c"])
def test_a_snapshot_in_mid_transfer_goes_on_alike_on_either_core(
    program: Callable[[str], object], monkeypatch: pytest.MonkeyPatch, name: str, watchdog: None
) -> None:
    def made(core: str) -> tuple[BluePill, SpiFlash | Eeprom24C02]:
        monkeypatch.setenv("P2OS_CORE", core)
        board = BluePill(program(name))  # type: ignore[arg-type]
        if name == "flash_over_spi":
            part: SpiFlash | Eeprom24C02 = SpiFlash()
            board.spi("SPI1", part, select="PA4")
        else:
            part = Eeprom24C02()
            board.i2c("I2C1", part)
        return board, part

    board, part = made("native")
    board.run_for("3333333 ns")
    saved = board.snapshot()
    ends = []
    for one, other in ((board, part), made("python")):
        one.restore(saved)
        for _ in range(7):
            one.run_for("1234567 ns")
        ends.append((one.cycle, bytes(other.memory), one.snapshot()["chip"]["parts"]))  # type: ignore[index]
    assert ends[0] == ends[1]


def command(flash: SpiFlash, at_ns: int, *sent: int, reads: int = 0) -> bytes:
    flash.select(at_ns)
    got = bytes(flash.exchange(byte, at_ns) for byte in (*sent, *[0] * reads))
    flash.deselect(at_ns)
    return got[len(sent) :]


@pytest.mark.parametrize(
    ("code", "span_ns"), [(0x02, PROGRAM_NS), *((code, span) for code, (_, span) in ERASES.items())]
)
def test_the_flash_is_busy_until_its_time_and_not_a_ns_longer(code: int, span_ns: int) -> None:
    flash = SpiFlash(b"\x00" * SIZE_BYTES)
    command(flash, 0, 0x06)
    assert command(flash, 0, 0x05, reads=1) == bytes([WEL])
    command(flash, 10, code, *([0, 0, 0] if code not in {0xC7, 0x60} else []), *([1] if code == 2 else []))
    assert command(flash, 10 + span_ns - 1, 0x05, reads=1) == bytes([BUSY | WEL])
    assert command(flash, 10 + span_ns - 1, 0x9F, reads=1) == b"\xff"
    assert flash.ignored == 1
    assert command(flash, 10 + span_ns, 0x05, reads=1) == b"\x00"
    assert flash.memory[:2] == (b"\x00\x00" if code == 2 else b"\xff\xff")


def test_the_flash_writes_nothing_without_write_enable_or_in_power_down() -> None:
    flash = SpiFlash(b"\x00")
    command(flash, 0, 0x20, 0, 0, 0)
    assert command(flash, 0, 0x03, 0, 0, 0, reads=1) == b"\x00"
    command(flash, 0, 0xB9)
    assert command(flash, 0, 0x9F, reads=1) == b"\xff"
    assert command(flash, 0, 0xAB, 0, 0, 0, reads=1) == b"\x14"
    assert command(flash, 0, 0x90, 0, 0, 0, reads=2) == b"\xef\x14"
    command(flash, 0, 0x06)
    command(flash, 0, 0x04)
    command(flash, 0, 0x20, 0, 0, 0)
    assert flash.memory[0] == 0


@QUICK
@given(st.integers(0, 255), st.binary(min_size=1, max_size=600), st.integers(0, 255))
def test_a_page_program_is_what_a_plain_model_makes(start: int, data: bytes, before: int) -> None:
    flash = SpiFlash(bytes([before]) * 512)
    command(flash, 0, 0x06)
    command(flash, 0, 0x02, 0, 0, start, *data)
    page = [0xFF] * 256
    for n, byte in enumerate(data):
        page[(start + n) % 256] = byte
    assert flash.memory[:256] == bytes(before & byte for byte in page)
    assert flash.memory[256:512] == bytes([before]) * 256


def test_the_eeprom_acknowledges_nothing_in_its_write_cycle() -> None:
    memory = Eeprom24C02(0x57)
    assert not memory.start(0x50, False, 0)
    assert memory.start(0x57, False, 0)
    assert all(memory.write(byte, 0) for byte in (0xFF, 1, 2))
    memory.stop(100)
    assert (memory.memory[0xFF], memory.memory[0xF8]) == (1, 2)
    assert not memory.start(0x57, False, 100 + WRITE_NS - 1)
    assert memory.start(0x57, True, 100 + WRITE_NS)
    assert memory.read(0) == 0xFF, "the next place of the page"
    assert memory.start(0x57, False, 100 + WRITE_NS)
    memory.write(0xFF, 0)
    assert memory.start(0x57, True, 100 + WRITE_NS)
    assert [memory.read(0), memory.read(0)] == [1, 0xFF], "it goes on at 0"


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (lambda: Eeprom24C02(0x58), "0x50 to 0x57"),
        (lambda: Eeprom24C02(contents=bytes(257)), "do not fit"),
        (lambda: SpiFlash(bytes(SIZE_BYTES + 1)), "do not fit"),
    ],
)
def test_a_part_that_cannot_be_is_refused(made: Callable[[], object], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        made()


def test_a_bus_that_there_is_not_is_refused_with_a_hint(board_of: Boards) -> None:
    board = board_of("flash_over_spi")
    with pytest.raises(BluePillError, match="no such SPI: SPI3"):
        board.spi("SPI3")
    with pytest.raises(BluePillError, match="no such I2C: SPI1"):
        board.i2c("SPI1")
    with pytest.raises(BluePillError, match="no such pin: PZ1"):
        board.spi("SPI1", SpiFlash(), select="PZ1")


class AskedFlash(SpiFlash):
    """One that is asked for each byte."""

    ahead = None  # type: ignore[assignment] # as a part that has none


def test_what_a_part_says_ahead_changes_nothing_but_the_time_it_takes(board_of: Boards) -> None:
    found = []
    for flash in (SpiFlash(WRAPPED * 8), AskedFlash(WRAPPED * 8)):
        board, asked = board_of("flash_over_spi"), []
        board.spi("SPI1", flash, select="PA4").subscribe(asked.extend)
        found.append((said_by(board), bytes(flash.memory), flash.ignored, board.cycle, asked))
    assert found[0] == found[1]


@pytest.mark.parametrize("meant", [0, None])
def test_what_was_said_ahead_holds_for_what_was_sent_and_ends_with_the_selection(
    board_of: Boards, meant: int | None
) -> None:
    class Counter:
        """Sends numbers, and leaves out 100 when it is deselected; it keeps what it was asked."""

        spi_modes = frozenset(range(4))
        max_hz = 36_000_000

        def __init__(self) -> None:
            self.number, self.asked, self.times = 0, bytearray(), 0

        def select(self, at_ns: int) -> None:
            del at_ns

        def deselect(self, at_ns: int) -> None:
            del at_ns
            self.number += 100
            self.times += 1

        def exchange(self, byte: int, at_ns: int) -> int:
            del at_ns
            self.asked.append(byte)
            self.number += 1
            return self.number - 1 & 0xFF

        def ahead(self, count: int) -> tuple[bytes, int | None]:
            return bytes(self.number + n & 0xFF for n in range(min(count, 3))), meant

        def went(self, count: int) -> None:
            self.number += count

    board, part = board_of("flash_over_spi"), Counter()
    rows: list[tuple[int, int, int]] = []
    board.spi("SPI1", part, select="PA4").subscribe(lambda words: rows.extend(word[:3] for word in words))
    board.run_for("5 ms")
    heard = [(sent, got) for _, sent, got in rows]
    steps = [after - before & 0xFF for (_, before), (_, after) in pairwise(heard)]
    assert set(steps) == {1, 101}
    assert part.times - 1 <= steps.count(101) <= part.times
    others = [sent for sent, _ in heard if sent]
    assert meant is None or [byte for byte in part.asked if byte] == others
    assert len(part.asked) < len(heard)
