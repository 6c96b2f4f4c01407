"""Memories on SPI and I2C, sent commands at random: what they answer, keep and count, as approved."""

import random
import tempfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from bluepill_sim.parts.eeprom_24c02 import WRITE_NS as CYCLE_NS
from bluepill_sim.parts.eeprom_24c02 import Eeprom24C02
from bluepill_sim.parts.sd_card import READ_NS, READY_NS, WRITE_NS, SdCard, crc7, crc16
from bluepill_sim.parts.spi_flash import ERASES, PROGRAM_NS, SIZE_BYTES, SpiFlash
from tests.tools.suite.approved import Trace, judge_of, said, tried


def digest(data: bytes) -> str:
    """Return bytes as a line: the whole of short ones, of long ones their ends and a checksum."""
    return data.hex() if len(data) <= 48 else f"{data[:20].hex()}…{data[-6:].hex()} {len(data)} {zlib.crc32(data):08x}"


class CardHost:
    """Sends a card commands, a byte each 400 ns."""

    def __init__(self, card: SdCard) -> None:
        self.card, self.now = card, 0

    def send(self, data: bytes, gap_ns: int = 400) -> bytes:
        answer = bytearray()
        for byte in data:
            self.now += gap_ns
            answer.append(self.card.exchange(byte, self.now))
        return bytes(answer)

    def command(self, number: int, argument: int = 0, *, wrong: int = 0) -> bytes:
        head = bytes((0x40 | number,)) + argument.to_bytes(4, "big")
        return self.send(head + bytes((crc7(head) ^ wrong,)))

    def read(self, count: int) -> str:
        return digest(self.send(b"\xff" * count))

    def begin(self) -> None:
        for number, argument in ((0, 0), (8, 0x1AA), (55, 0), (41, 1 << 30)):
            self.command(number, argument)
            self.read(4)
        self.now += READY_NS
        for number, argument in ((55, 0), (41, 1 << 30)):
            self.command(number, argument)
            self.read(3)


def seen_of(card: SdCard) -> str:
    kept = {name: value for name, value in card.snapshot().items() if name not in {"written", "_out", "_taken"}}
    return said([kept, sorted(card.written), len(kept), card.words()])


def write_block(host: CardHost, draw: random.Random) -> str:
    data = bytes((draw.randrange(256),)) * draw.choice((511, 512, 512, 512, 513))
    crc = crc16(data).to_bytes(2, "big") if draw.random() < 0.6 else b"\x12\x34"
    token = draw.choice((0xFE, 0xFE, 0xFC, 0xFC, 0xFD, 0xFF, 0x00))
    return host.send(bytes((0xFF, token)) + data + crc + b"\xff\xff\xff")[-6:].hex()


def read_long(host: CardHost, draw: random.Random) -> str:
    host.now += draw.choice((0, READ_NS - 401, READ_NS - 400, READ_NS, READ_NS + 1))
    found = host.read(draw.choice((3, 20, 518)))
    part, number = host.card.ahead(40)
    took = draw.choice((0, len(part)))
    if number is not None:
        host.card.went(took)
    return f"{found} {part.hex()} {number} {took if number is not None else ''}"


def cards(draw: random.Random) -> Iterator[str]:
    for options in ({"size_mb": 1}, {"size_mb": 8}, {"size_mb": 1, "save": True}, {"size_mb": 1024}):
        host = CardHost(SdCard(**options))  # type: ignore[arg-type]
        yield seen_of(host.card)
        if draw.random() < 0.8:
            host.begin()
        last = host.card._blocks - 1
        for _ in range(90):
            number = draw.choice(
                (0, 6, 8, 9, 10, 12, 13, 16, 17, 17, 18, 18, 24, 24, 25, 25, 32, 33, 38, 55, 55, 55, 58, 59, 23, 22)
            )
            argument = draw.choice((0, 1, 5, 512, last - 1, last, last + 1, 0x1AA, 0x2AA, 1 << 30, 511))
            if number in {16, 59}:
                argument = draw.choice((512, 511, 513) if number == 16 else (1, 3, 1, 0))
            if number == 33 and last > 5000:
                argument = draw.choice((3, 9))
            host.card.select(host.now)
            answer = host.command(number, argument, wrong=draw.choice((0, 0, 0, 0, 2)))
            line = [f"{number} {argument:x} {answer.hex()} {host.read(draw.choice((2, 3, 9)))}"]
            if draw.random() < 0.5:
                app = draw.choice((13, 22, 23, 41, 51, 17))
                line.append(f"{app} {host.command(app, draw.choice((0, 1 << 30))).hex()} {host.read(12)}")
            if number in {24, 25}:
                line += [write_block(host, draw) for _ in range(draw.choice((1, 2)))]
            if number in {17, 18, 9, 10} or draw.random() < 0.1:
                line.append(read_long(host, draw))
            host.now += draw.choice((0, 0, WRITE_NS - 401, WRITE_NS, WRITE_NS + 1, READY_NS))
            line.append(host.read(2))
            if draw.random() < 0.2:
                host.send(bytes((0x51, 0, 0)))
                host.card.deselect(host.now)
                line.append(seen_of(host.card))
            yield " | ".join(line)
        yield said(
            [sorted((number, zlib.crc32(data)) for number, data in host.card.written.items()), seen_of(host.card)]
        )
        yield said([(name, len(data), zlib.crc32(data)) for name, data in host.card.files().items()])
    yield from made_cards()


def made_cards() -> Iterator[str]:
    for size in (0, -1, 1, 1024, 1025):
        yield tried(lambda each: SdCard(size_mb=each).words(), size)
    with tempfile.TemporaryDirectory() as folder:
        image = Path(folder) / "card.img"
        for size in (0, 1, 512 * 1024 - 1, 512 * 1024, 512 * 1024 + 1, 1024 * 1024):
            image.write_bytes(bytes(range(256)) * (size // 256) + bytes(size % 256))
            yield tried(lambda: SdCard(image=image, size_mb=2).words())
        card = SdCard(image=image)
        card.written[1] = b"\x55" * 512
        yield said([digest(card.block(number)) for number in (0, 1, 2, 2047, 2048)])
        yield said([len(card.contents()), zlib.crc32(card.contents()), card.files()])
    yield said([crc7(bytes((n, 0, 0, 1, 0xAA))) for n in (0x40, 0x48, 0x77)] + [crc16(bytes(9)), crc16(b"123456789")])


def flashes(draw: random.Random) -> Iterator[str]:
    part, now = SpiFlash(b"begin of it"), 0
    commands = (
        0x9F,
        0x90,
        0xAB,
        0x4B,
        0x5A,
        3,
        3,
        0x0B,
        2,
        2,
        2,
        0x20,
        0x52,
        0xD8,
        0x60,
        5,
        5,
        0x35,
        0x15,
        6,
        6,
        6,
        6,
        4,
        0xB9,
        0x66,
        1,
    )
    for _ in range(420):
        command, at = (
            draw.choice(commands),
            draw.choice((0, 1, 0xFE, 0x100, 0xFFF, 0x1000, 0x7FFF, 0x8000, 0xFFFF, 0x10000, SIZE_BYTES - 2)),
        )
        part.select(now)
        sent = (
            bytes((command,))
            + (at | draw.choice((0, 0xE0 << 16))).to_bytes(3, "big")
            + draw.randbytes(draw.choice((0, 1, 5)))
        )
        if command == 2 and draw.random() < 0.3:
            sent += draw.randbytes(260)
        if draw.random() < 0.15 or command == 0x60:
            sent = sent[: draw.choice((1, 3, 4))]
        answer = bytearray()
        for byte in sent:
            now += 300
            answer.append(part.exchange(byte, now))
        line = f"{sent[:12].hex()} {digest(bytes(answer))}"
        ahead, number = part.ahead(draw.choice((1, 9)))
        line += f" {ahead.hex()} {number}"
        if ahead and draw.random() < 0.5:
            part.went(len(ahead))
            line += f" {part.exchange(0, now):02x}"
        part.deselect(now)
        part.deselect(now)
        if command in {2, *ERASES}:
            line += f" {zlib.crc32(part.memory[:0x2_0000]):08x} {part.memory[-2:].hex()}"
        state = part.snapshot()
        now += draw.choice((0, 0, PROGRAM_NS - 2000, PROGRAM_NS, 1000, 45_000_000, 5_000_000_000))
        yield line + said([{name: value for name, value in state.items() if name not in {"memory", "_page"}}])
    yield said([zlib.crc32(part.memory), *[(sorted(each.spi_modes), each.max_hz) for each in (SpiFlash, SdCard)]])
    for size in (SIZE_BYTES, SIZE_BYTES + 1):
        yield tried(lambda each: len(SpiFlash(bytes(each)).memory), size)
    for command, count in ((0x5A, 260), (0x9F, 5), (0x90, 6), (0x4B, 10), (0x35, 3), (0x15, 3), (5, 3)):
        part = SpiFlash()
        part.select(0)
        yield bytes(part.exchange(byte, 0) for byte in (command, *bytes(4), *bytes(count))).hex()


def eeproms(draw: random.Random) -> Iterator[str]:
    part, now = Eeprom24C02(0x53, b"\1\2\3"), 0
    for _ in range(260):
        address, is_read = draw.choice((0x53, 0x53, 0x53, 0x52, 0)), draw.random() < 0.4
        line = f"{address:x} {is_read} {part.start(address, is_read, now)} "
        for _ in range(draw.choice((0, 1, 2, 9, 10))):
            byte = draw.choice((0, 6, 7, 8, 0xFE, 0xFF, draw.randrange(256)))
            line += f"{part.read(now):02x}" if is_read else f"{byte:02x}{part.write(byte, now):d}"
        if draw.random() < 0.7:
            part.stop(now)
        now += draw.choice((0, CYCLE_NS - 1, CYCLE_NS, 1))
        state = part.snapshot()
        yield line + said([{name: value for name, value in state.items() if name != "memory"}, zlib.crc32(part.memory)])
    for address, size in ((0x4F, 0), (0x50, 0), (0x57, 256), (0x58, 0), (0x50, 257)):
        yield tried(lambda at, count: made_of(Eeprom24C02(at, bytes(count))), address, size)
    yield made_of(Eeprom24C02())


def made_of(part: Any) -> str:
    return said([part.address, part.memory.hex(), part.snapshot()])


TRACES: dict[str, Trace] = {"cards": cards, "flashes": flashes, "eeproms": eeproms}
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
