"""An SD card, by a host that does what the specification says, and by one that does not."""

from collections.abc import Iterable
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.parts import SdCard
from bluepill_sim.parts.sd_card import BLOCK_BYTES, READ_NS, READY_NS, WRITE_NS, crc7, crc16

BYTE_NS = 1000
BLOCK = bytes(n * 7 % 256 for n in range(BLOCK_BYTES))


class Host:
    """Clocks bytes into a card; a byte takes a microsecond."""

    def __init__(self, card: SdCard) -> None:
        self.card, self.now_ns = card, 0
        card.select(0)

    def send(self, *data: int) -> bytes:
        got = bytearray()
        for byte in data:
            self.now_ns += BYTE_NS
            got.append(self.card.exchange(byte, self.now_ns))
        return bytes(got)

    def read(self, count: int) -> bytes:
        return self.send(*b"\xff" * count)

    def until(self, *wanted: int, at_most: int = 5000) -> int:
        for _ in range(at_most):
            byte = self.read(1)[0]
            if byte in wanted:
                return byte
        raise AssertionError(f"none of {wanted} came")

    def command(self, number: int, argument: int = 0, *, crc: int | None = None) -> int:
        head = bytes((0x40 | number, *argument.to_bytes(4, "big")))
        self.send(*head, crc7(head) if crc is None else crc)
        for _ in range(9):
            if not (byte := self.read(1)[0]) & 0x80:
                return byte
        raise AssertionError(f"no answer to CMD{number}")

    def app(self, number: int, argument: int = 0) -> int:
        self.command(55)
        return self.command(number, argument)

    def block(self, token: int = 0xFE, count: int = BLOCK_BYTES) -> bytes:
        self.until(token)
        data, crc = self.read(count), self.read(2)
        assert crc == crc16(data).to_bytes(2, "big")
        return data

    def start(self) -> "Host":
        assert self.command(0) == 1
        assert self.command(8, 0x1AA) == 1
        assert self.read(4) == b"\0\0\1\xaa"
        began = self.now_ns
        while self.app(41, 1 << 30):
            assert self.now_ns - began < 2 * READY_NS
        return self


def test_the_crcs_are_those_of_the_specification() -> None:
    # Section 4.5: CMD0, CMD17 with argument 0, and 512 bytes of 0xFF.
    assert [crc7(bytes.fromhex(text)) for text in ("4000000000", "5100000000")] == [0x95, 0x55]
    assert crc16(b"\xff" * 512) == 0x7FA1


def test_it_starts_as_high_capacity_and_no_sooner_than_its_time() -> None:
    host = Host(SdCard())
    host.command(0)
    assert host.command(58) == 1
    assert host.read(4) == b"\x00\xff\x80\x00", "not powered up"
    assert host.command(17) == 1 | 4, "illegal while idle"
    assert host.app(41, 1 << 30) == 1
    began = host.now_ns
    host.now_ns = began - BYTE_NS + READY_NS - 20 * BYTE_NS
    while host.app(41, 1 << 30):
        pass
    assert began + READY_NS - 20 * BYTE_NS < host.now_ns < began + READY_NS + 20 * BYTE_NS
    assert host.command(58) == 0
    assert host.read(4) == b"\xc0\xff\x80\x00"


def test_a_host_that_knows_no_high_capacity_waits_for_ever() -> None:
    host = Host(SdCard())
    host.command(0)
    host.app(41)
    host.now_ns += 10 * READY_NS
    assert host.app(41) == 1


def test_the_crc_counts_before_spi_mode_and_where_it_is_asked_for() -> None:
    host = Host(SdCard())
    assert host.command(0, crc=0x97) == 1 | 8
    assert host.command(8, 0x1AA, crc=1) == 1 | 8
    host.start()
    assert host.command(13, crc=1) == 0
    assert host.command(59, 1) == 0
    assert host.command(13, crc=1) == 8


def test_blocks_behind_the_last_one_are_refused_while_several_are_written() -> None:
    card = SdCard()
    last = 8 * 1024 * 1024 // BLOCK_BYTES - 1
    host = Host(card).start()
    assert host.command(25, last) == 0
    answers = []
    for _ in range(2):
        host.send(0xFC, *BLOCK, 0, 0)
        answers.append(host.read(1)[0] & 0x1F)
        host.until(0xFF)
    assert answers == [0x05, 0x0D]
    assert [*card.written] == [last]


@given(st.integers(0, 16383), st.binary(min_size=BLOCK_BYTES, max_size=BLOCK_BYTES))
@settings(max_examples=20)
def test_what_is_written_is_read_back(number: int, data: bytes) -> None:
    host = Host(SdCard()).start()
    assert host.command(24, number) == 0
    host.send(0xFF, 0xFE, *data, 0, 0)
    assert host.read(1)[0] & 0x1F == 5
    host.until(0xFF)
    assert host.command(17, number) == 0
    assert host.block() == data


def test_a_block_comes_no_sooner_than_its_time_and_writing_takes_its_time() -> None:
    host = Host(SdCard()).start()
    host.command(17, 0)
    began = host.now_ns
    host.until(0xFE)
    # The command ended two bytes before R1; the token follows the byte at which the block is there.
    assert host.now_ns - began == READ_NS - BYTE_NS
    host.read(514)
    host.command(24, 0)
    host.send(0xFE, *BLOCK, 0, 0)
    began = host.now_ns
    assert host.read(2)[1] == 0
    host.until(0xFF)
    assert host.now_ns - began == WRITE_NS


def test_many_blocks_are_read_and_written_until_they_are_stopped() -> None:
    card = SdCard()
    host = Host(card).start()
    assert host.app(23, 3) == 0
    assert host.command(25, 100) == 0
    for n in range(3):
        host.send(0xFC, *BLOCK[n:], *BLOCK[:n], 0, 0)
        assert host.read(1)[0] & 0x1F == 5
        host.until(0xFF)
    host.send(0xFD, 0xFF)
    host.until(0xFF)
    assert (card.writes, host.app(22)) == (3, 0)
    assert host.block(count=4) == (3).to_bytes(4, "big")
    assert host.command(18, 100) == 0
    assert [host.block() for _ in range(3)] == [BLOCK[n:] + BLOCK[:n] for n in range(3)]
    assert host.command(12) == 0
    host.until(0xFF)
    assert host.command(13) == 0
    assert host.read(1) == b"\0"


def test_a_damaged_block_is_refused_where_crcs_count_and_nothing_is_written() -> None:
    card = SdCard()
    host = Host(card).start()
    host.command(59, 1)
    for crc, answer in ((crc16(BLOCK) ^ 1, 0x0B), (crc16(BLOCK), 5)):
        assert host.command(24, 9) == 0
        host.send(0xFE, *BLOCK, *crc.to_bytes(2, "big"))
        assert host.read(1)[0] & 0x1F == answer
        host.until(0xFF)
    assert card.writes == 1


def test_its_last_block_is_there_and_the_next_is_not() -> None:
    host = Host(SdCard(size_mb=1)).start()
    assert host.command(17, 2047) == 0
    assert host.block() == bytes(BLOCK_BYTES)
    assert [host.command(number, 2048) for number in (17, 18, 24, 25)] == [0x20] * 4
    assert host.command(18, 2047) == 0
    host.block()
    assert host.until(0x08) == 0x08, "the end, out of range"


def test_csd_and_cid_have_its_size_and_their_own_crc() -> None:
    host = Host(SdCard(size_mb=3)).start()
    assert host.command(9) == 0
    csd = host.block(count=16)
    assert (csd[0] >> 6, int.from_bytes(csd[7:10], "big") & 0x3FFFFF, csd[15]) == (1, 5, crc7(csd[:15]))
    host.command(10)
    cid = host.block(count=16)
    assert cid[15] == crc7(cid[:15])


#: Of a card of 1 GiB, as section 5 has them, without their CRCs.
CSD = bytes.fromhex("400e00325b59000007ff7f800a4000")
CID = b"\x00P2BENCH\x10\x00\x00\x00\x01\x01\xa1"


def data(contents: bytes) -> bytes:
    return b"\xfe" + contents + crc16(contents).to_bytes(2, "big")


def test_every_command_is_answered_as_the_specification_has_it() -> None:
    host = Host(SdCard(size_mb=1024)).start()
    beyond = 1 << 21  # the first block that is not there
    good = {
        8: b"\0\0\1\xaa", 9: data(CSD + bytes((crc7(CSD),))), 10: data(CID + bytes((crc7(CID),))), 12: b"", 13: b"\0",
        38: b"", 55: b"", 58: b"\xc0\xff\x80\0", 59: b"",
    }  # fmt: skip
    refused = {16: 0x40, 17: 0x20, 18: 0x20, 24: 0x20, 25: 0x20, 32: 0x20, 33: 0x20}
    found = {number: (host.command(number, {8: 0x1AA, 59: 0}.get(number, beyond)), host.read(24)) for number in
             range(1, 64) if number != 38}  # fmt: skip
    assert found == {number: (4, b"\xff" * 24) for number in range(1, 64) if number != 38} | {
        number: (0, text.ljust(24, b"\xff")) for number, text in good.items() if number != 38
    } | {number: (error, b"\xff" * 24) for number, error in refused.items()}
    assert host.command(16, BLOCK_BYTES) == 0


def test_every_command_of_applications_is_known_behind_cmd55_alone() -> None:
    host = Host(SdCard()).start()
    scr = bytes.fromhex("0225800000000000")
    good = {13: b"\0" + data(bytes(64)), 22: data(bytes(4)), 23: b"", 41: b"", 51: data(scr)}
    found = {number: (host.app(number), host.read(70)) for number in (*good, 14, 42, 52)}
    assert found == {number: (0, text.ljust(70, b"\xff")[:70]) for number, text in good.items()} | dict.fromkeys(
        (14, 42, 52), (4, b"\xff" * 70)
    )
    assert [host.command(number) for number in (22, 23, 41, 51)] == [4] * 4
    assert host.app(9) == 0, "one that is of all cards is that behind CMD55, too"


def test_a_command_may_come_while_a_block_is_awaited_and_the_stop_takes_its_time() -> None:
    card = SdCard()
    host = Host(card).start()
    assert host.command(25, 7) == 0
    assert host.command(13) == 0
    assert host.read(1) == b"\0"
    host.send(0xFC, *BLOCK, 0, 0)
    assert host.read(1)[0] & 0x1F == 5
    host.until(0xFF)
    host.send(0xFD)
    began = host.now_ns
    assert host.read(2) == b"\xff\0"
    host.until(0xFF)
    assert (host.now_ns - began, [*card.written]) == (WRITE_NS, [7])
    assert card.words() == "8 MiB, 0 blocks read, 1 written"
    host.command(60)
    assert card.words() == "8 MiB, 0 blocks read, 1 written, 1 commands refused"


@pytest.mark.parametrize("size_mb", [0, 1025, -1])
def test_no_card_is_empty_or_larger_than_a_gibibyte(size_mb: int) -> None:
    with pytest.raises(ValueError, match="up to 1024 MiB"):
        SdCard(size_mb=size_mb)


def test_erased_blocks_are_empty_and_their_neighbours_are_not(tmp_path: Path) -> None:
    image = tmp_path / "card.img"
    image.write_bytes(b"\x55" * 512 * 1024)
    card = SdCard(image=image, save=True)
    host = Host(card).start()
    assert [host.command(32, 3), host.command(33, 4), host.command(38)] == [0, 0, 0]
    host.until(0xFF)
    assert [set(card.block(n)) for n in (2, 3, 4, 5)] == [{0x55}, {0}, {0}, {0x55}]
    assert card.files()["img"][3 * 512 : 5 * 512] == bytes(1024)
    assert set(image.read_bytes()) == {0x55}, "the image stays"


@given(
    st.lists(st.one_of(st.integers(0, 255), st.sampled_from([0x40, 0x51, 0x58, 0x59, 0x4C, 0xFE, 0xFF])), max_size=600)
)
@settings(max_examples=15)
def test_whatever_it_is_sent_it_can_be_started_again(stream: Iterable[int]) -> None:
    card = SdCard(size_mb=1)
    host = Host(card).start()
    host.send(*stream)
    card.deselect(host.now_ns)
    host.send(*[0xFF] * 520)  # whatever block was awaited is over
    saved = card.snapshot()
    card.deselect(host.now_ns)
    card.select(host.now_ns)
    host.now_ns += 10**9
    host.start()
    other = SdCard(size_mb=1)
    other.restore(saved)
    assert other.snapshot() == saved


@pytest.mark.parametrize("size", [1, 512 * 1024 - 1, 512 * 1024 + 512])
def test_an_image_that_is_no_card_is_refused(tmp_path: Path, size: int) -> None:
    (tmp_path / "card.img").write_bytes(bytes(size))
    with pytest.raises(ValueError, match=str(size)):
        SdCard(image=tmp_path / "card.img")
