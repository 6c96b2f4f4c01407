"""A display, an inertial sensor and a receiver, told things at random: what they show and answer, as approved."""

import math
import random
import zlib
from collections.abc import Iterator
from types import SimpleNamespace

from bluepill_sim.fabric.surroundings import GRAVITY_MPS2, BoardMotion
from bluepill_sim.parts.gps import Gps, with_checksum
from bluepill_sim.parts.mpu6050 import Mpu6050
from bluepill_sim.parts.ssd1306 import ARGUMENTS, Ssd1306
from tests.bluepill_sim.board.parts.conftest import FakePort, FakeSocket
from tests.tools.suite.approved import Trace, judge_of, said, tried


def shown(oled: Ssd1306) -> str:
    kept = {name: value for name, value in oled.snapshot().items() if name != "memory"}
    dots = bytes(dot for row in oled.dots() for dot in row)
    return said([oled.words(), zlib.crc32(oled.memory), zlib.crc32(dots), kept])


def oleds(draw: random.Random) -> Iterator[str]:
    for height in (64, 32):
        oled, now = Ssd1306(address=0x3D, height=height), 0
        for _ in range(150):
            now += 5
            command = draw.choice(
                (
                    *ARGUMENTS,
                    *range(0, 0x20, 3),
                    0x1F,
                    0x40,
                    0x47,
                    0x7F,
                    *range(0xA0, 0xC0),
                    0xC0,
                    0xC8,
                    0xCF,
                    0xE3,
                    0xE4,
                    0x2E,
                    0x2F,
                )
            )
            acked = oled.start(draw.choice((0x3D, 0x3D, 0x3C)), False, now)
            control = draw.choice((0x00, 0x40, 0x80, 0xC0))
            data = [
                command,
                *(
                    draw.choice((0, 1, 2, 3, 7, 14, 15, 16, 63, 127, 200, 255))
                    for _ in range(ARGUMENTS.get(command, 0))
                ),
            ]
            sent = [control, *data] if control < 0x80 else [byte for each in data for byte in (control, each)]
            for byte in sent[: draw.choice((99, 99, 2))]:
                oled.write(byte, now)
            if draw.random() < 0.5:
                oled.start(0x3D, False, now)
                for byte in (0x40, *draw.randbytes(draw.choice((1, 9, 130)))):
                    oled.write(byte, now)
            oled.stop(now)
            yield f"{acked} {oled.read(now):02x} {bytes(sent).hex()} {shown(oled)}"
        yield f"{zlib.crc32(oled.picture().png()):08x} {oled.picture().text()[:40]}"
    yield from oleds_on_spi(draw)


def oleds_on_spi(draw: random.Random) -> Iterator[str]:
    for pins, spi in (((), None), (("dc",), None), ((), object()), (("dc", "res"), object()), (("res",), None)):
        oled, socket = Ssd1306(), FakeSocket(*pins)
        socket.spi = spi
        yield tried(oled.plug, socket)
        for _ in range(12):
            if "dc" in pins:
                socket.pins["dc"].level = draw.random() < 0.4
            byte = draw.choice((0xAF, 0xA1, 0x40, 0xB3, 0x05, 0x81, 0xFF))
            line = f"{oled.exchange(byte, 0) if len(pins) == 2 else 0} {oled.start(0x3C, False, 0)} "
            if draw.random() < 0.3:
                oled.changed([(1, "res", False), (2, "res", True)][: draw.choice((1, 2))])
            oled.select(0)
            oled.deselect(0)
            yield line + shown(oled)
    for address, height in ((0x3B, 64), (0x3C, 31), (0x3D, 32), (0x3E, 64), (0x3C, 33), (0x3C, 65)):
        yield tried(lambda at, rows: Ssd1306(address=at, height=rows).words(), address, height)


def motion_of(draw: random.Random) -> BoardMotion:
    force = tuple(draw.choice((0.0, 1.0, -2.5, 8.0, 17.0)) * GRAVITY_MPS2 for _ in range(3))
    rates = tuple(math.radians(draw.choice((0.0, 10.0, -99.5, 300.0, 2100.0))) for _ in range(3))
    return BoardMotion(force_mps2=force, rates_radps=rates)  # type: ignore[arg-type]


def sensors(draw: random.Random) -> Iterator[str]:
    for pins, address in ((("int",), 0x68), ((), 0x69)):
        imu, socket, now = Mpu6050(address=address, temperature_c=draw.choice((20.0, -40, 85))), FakeSocket(*pins), 0
        yield imu.words() + said(imu.next_deadline())
        imu.plug(socket)  # type: ignore[arg-type]
        writes = [
            (0x6B, 0),
            (0x19, 0),
            (0x19, 3),
            (0x19, 4),
            (0x1A, 0),
            (0x1A, 1),
            (0x1A, 5),
            (0x1A, 7),
            (0x23, 0xF8),
            (0x23, 0x78),
            (0x6A, 0x44),
            (0x6A, 0x40),
            (0x6A, 1),
            (0x68, 7),
            (0x38, 1),
            (0x38, 0x11),
            (0x37, 0x20),
            (0x37, 0x30),
            (0x37, 0x80),
            (0x37, 0xA0),
            (0x37, 0),
            (0x6C, 0x21),
            (0x6C, 0),
            (0x1B, 0x18),
            (0x1B, 8),
            (0x1C, 0x10),
            (0x1C, 0),
            (0x6B, 0x40),
            (0x6B, 0x80),
            (0x06, 3),
            (0x18, 4),
            (0x75, 1),
            (0x49, 0),
            (0x49, 5),
            (0x00, 0),
            (0x00, 1),
            (0x7F, 2),
            (0x12, 1),
            (0x13, 1),
            (0x0B, 9),
            (0x0D, 1),
            (0x67, 1),
            (0x69, 1),
            (0x24, 7),
            (0x36, 7),
        ]
        for step in range(260):
            number, byte = (
                writes[step] if step < len(writes) else draw.choice((*writes, (0x6B, 0), (0x6A, 0x40), (0x23, 0xF8)))
            )
            imu.start(address, False, now)
            line = f"{number:02x} {byte:02x} "
            line += f"{imu.write(number, now)} {imu.write(byte, now)} "
            imu.stop(now)
            for _ in range(draw.choice((0, 1, 3, 12))):
                due = imu.next_deadline()
                if due is None:
                    break
                now = max(now, due)
                socket.surroundings.now = motion_of(draw)
                imu.advance_to(due)
            first = draw.choice((0x3A, 0x3B, 0x41, 0x48, 0x72, 0x74, 0x06, 0x19, 0x6B, 0x75, 0x7F))
            line += f"{imu.start(draw.choice((address, 0x67)), False, now)} "
            imu.write(first | draw.choice((0, 0x80)), now)
            imu.start(address, True, now)
            line += bytes(imu.read(now) for _ in range(draw.choice((1, 2, 14)))).hex()
            state = {name: value for name, value in imu.snapshot().items() if name not in {"_fifo", "_registers"}}
            driven = said([pin.later for pin in socket.pins.values()] + [pin.driven for pin in socket.pins.values()])
            for pin in socket.pins.values():
                pin.later.clear()
            now += draw.choice((0, 7))
            seen = [imu.words(), driven, len(imu._fifo), socket.replans, imu.rate, state]
            yield f"{first:02x} {line} {said(seen)}"
    for address, degrees in ((0x67, 20), (0x68, -40), (0x69, 85), (0x6A, 20), (0x68, -40.01), (0x69, 85.1)):
        yield tried(lambda at, warm: Mpu6050(address=at, temperature_c=warm).words(), address, degrees)


def receivers(draw: random.Random) -> Iterator[str]:
    for start in (
        "2026-01-01T00:00:00",
        "2024-02-28T23:59:58",
        "2000-12-31T23:59:59",
        "1900-02-28T12:34:56",
        "2100-02-28T23:59:59",
        "0000-01-01T00:00:00",
        "2023-02-29T00:00:00",
        "2024-02-30T00:00:00",
        "2026-00-01T00:00:00",
        "2026-13-01T00:00:00",
        "2026-04-31T00:00:00",
        "2026-04-00T00:00:00",
        "2026-01-01T24:00:00",
        "2026-01-01T00:60:00",
        "2026-01-01T00:00:60",
        "2026-01-01 00:00:00",
        "",
    ):
        for place in ((48.137, 11.575, 520.0), (-33.9, -151.2, -3.25), (0.0, 180.0, 0.0), (89.5, -0.001, 8848.0)):
            yield tried(fixes, draw, start, place)
    for latitude, longitude in ((90, 0), (-90, 0), (89.999, 180), (-89.999, -180), (0, 180.001), (0, -180.001)):
        yield tried(lambda *at: Gps(latitude_deg=at[0], longitude_deg=at[1]).words(), latitude, longitude)
    for rate, baud in (
        (0, 9600),
        (1, 1499),
        (1, 1500),
        (10, 14_999),
        (10, 15_000),
        (11, 115_200),
        (6, 9600),
        (7, 9600),
    ):
        yield tried(lambda hz, speed: Gps(rate_hz=hz, baud=speed).words(), rate, baud)
    for rate in (1, 3, 7, 10):
        gps, socket = Gps(rate_hz=rate, baud=38_400, fix_s=0.5), FakeSocket()
        yield tried(gps.plug, socket)
        gps.advance_to(5)
        socket.port = FakePort()
        gps.plug(socket)  # type: ignore[arg-type]
        gps.sent([(1, 2)])
        for _ in range(6):
            due = gps.next_deadline()
            socket.surroundings.now = BoardMotion(
                x_m=draw.uniform(-9, 9), y_m=3.0, forward_mps=draw.choice((0.5, -0.5)), heading_rad=draw.uniform(-4, 4)
            )
            gps.advance_to(due)
            yield f"{due} {gps.words()} {socket.port.far_baud} {socket.port.received.decode()!r} {said(gps.snapshot())}"
            socket.port.received.clear()
    yield said([with_checksum("GPGLL"), with_checksum("")])


def fixes(draw: random.Random, start: str, place: tuple[float, float, float]) -> str:
    gps = Gps(start=start, latitude_deg=place[0], longitude_deg=place[1], altitude_m=place[2])
    lines = []
    for at_ns in (0, 1_999_999_999, 2_000_000_000, 2_009_999_999, 3_723_450_000_000, 90_000_000_000_000):
        motion = BoardMotion(
            x_m=draw.choice((0, 1234.5, -77)),
            y_m=draw.choice((0, -432.1, 9)),
            z_m=draw.choice((0, 1.26)),
            heading_rad=draw.choice((0.0, math.pi / 2, -math.pi / 2, math.pi, 0.3)),
            forward_mps=draw.choice((0.0, 1.5, -0.25)),
        )
        lines += [b"".join(gps.sentences(motion, at_ns)).decode(), said(gps.place(motion))]
    return " ".join(lines)


def settings(draw: random.Random) -> Iterator[str]:
    made = SimpleNamespace(oled=Ssd1306(), imu=Mpu6050(), gps=Gps())
    for part in vars(made).values():
        yield said([part.words(), part.snapshot()])
    made.imu.advance_to(1)
    yield said([made.imu.words(), made.imu.snapshot(), sorted(made.oled.spi_modes), made.oled.max_hz])


TRACES: dict[str, Trace] = {"oleds": oleds, "sensors": sensors, "receivers": receivers, "settings": settings}
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
