"""SSD1306, MPU-6050, GPS, button, LEDs and potentiometer by themselves."""

import math
import struct
import zlib
from collections.abc import Callable, Iterable
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bluepill_sim.fabric.signals import Oscillation
from bluepill_sim.parts import BoardMotion, Button, Gps, LedPanel, Mpu6050, Picture, Potentiometer, Ssd1306
from bluepill_sim.parts.mpu6050 import FIFO_BYTES, PULSE_NS

Plug = Callable[..., Any]
MS = 1_000_000


def send(oled: Ssd1306, control: int, *data: int) -> None:
    assert oled.start(0x3C, False, 0)
    for byte in (control, *data):
        oled.write(byte, 0)
    oled.stop(0)


def commands(oled: Ssd1306, *data: int) -> None:
    send(oled, 0x00, *data)


def lit(oled: Ssd1306) -> set[tuple[int, int]]:
    return {(x, y) for y, row in enumerate(oled.dots()) for x, dot in enumerate(row) if dot}


def upright(**settings: int) -> Ssd1306:
    oled = Ssd1306(**settings)
    commands(oled, 0xA1, 0xC8, 0xAF)
    return oled


def test_a_byte_is_eight_dots_below_each_other_the_lowest_bit_on_top() -> None:
    oled = upright()
    commands(oled, 0xB2, 0x05, 0x11)
    send(oled, 0x40, 0b1000_0001)
    assert lit(oled) == {(0x15, 16), (0x15, 23)}


@pytest.mark.parametrize(
    ("mode", "second", "last"),
    [(0, (11, 8), (10, 8)), (1, (10, 16), (10, 8))],
)
def test_the_pointer_runs_through_its_window_and_wraps(
    mode: int, second: tuple[int, int], last: tuple[int, int]
) -> None:
    oled = upright()
    commands(oled, 0x20, mode, 0x21, 10, 12, 0x22, 1, 2)
    send(oled, 0x40, 1, 1)
    assert lit(oled) == {(10, 8), second}
    send(oled, 0x40, *[1] * 4, 0)  # five more: the seventh is the first again
    assert last not in lit(oled)
    assert len(lit(oled)) == 5


def test_by_page_a_row_wraps_within_its_page() -> None:
    oled = upright()
    commands(oled, 0xB0, 0x0F, 0x17)  # column 127
    send(oled, 0x40, 1, 2)
    assert lit(oled) == {(127, 0), (0, 1)}


def test_a_control_byte_with_co_is_for_one_byte() -> None:
    oled = upright()
    send(oled, 0x80, 0xB1, 0x80, 0x00, 0x80, 0x10, 0x40, 1, 1)
    assert lit(oled) == {(0, 8), (1, 8)}


def test_directions_offset_start_line_inverse_and_all_on_show_what_the_data_sheet_says() -> None:
    oled = upright()
    commands(oled, 0xB0, 0x00, 0x10)
    send(oled, 0x40, 1)
    assert lit(oled) == {(0, 0)}
    commands(oled, 0x40 | 3)
    assert lit(oled) == {(0, 61)}, "line 3 is on top"
    commands(oled, 0x40, 0xD3, 2)
    assert lit(oled) == {(0, 62)}
    commands(oled, 0xD3, 0, 0xC0)
    assert lit(oled) == {(0, 63)}
    commands(oled, 0xA0)
    assert lit(oled) == {(0, 63)}, "what is there stays where it is"
    commands(oled, 0xA7)
    assert len(lit(oled)) == 128 * 64 - 1
    commands(oled, 0xA5)
    assert len(lit(oled)) == 128 * 64
    commands(oled, 0xAE)
    assert lit(oled) == set()
    assert oled.start(0x3C, True, 0)
    assert oled.read(0) & 0x40, "off"


def test_a_glass_of_32_rows_shows_the_upper_half() -> None:
    oled = upright(height=32)
    commands(oled, 0xA8, 31, 0xB3, 0x00, 0x10)
    send(oled, 0x40, 0x80)
    commands(oled, 0xB4, 0x00, 0x10)
    send(oled, 0x40, 0x01)
    assert lit(oled) == {(0, 31)}


def test_on_an_spi_dc_tells_data_from_commands_and_res_resets(plugged: Plug, spi: Callable[[], object]) -> None:
    oled = Ssd1306()
    socket = plugged(oled, "dc", "res", spi=spi())
    for byte in (0xA1, 0xC8, 0xAF, 0xB0):
        oled.exchange(byte, 0)
    socket.pins["dc"].level = True
    oled.exchange(0xFF, 0)
    assert len(lit(oled)) == 8
    oled.changed([(0, "res", False), (1, "res", True)])
    assert not oled.is_on
    with pytest.raises(ValueError, match="dc"):
        plugged(Ssd1306(), spi=spi())


def test_it_answers_at_its_own_address_alone_and_has_no_other() -> None:
    assert [Ssd1306(address=0x3D).start(at, False, 0) for at in (0x3C, 0x3D)] == [False, True]
    with pytest.raises(ValueError, match="0x3e"):
        Ssd1306(address=0x3E)


@given(st.lists(st.tuples(st.booleans(), st.integers(0, 255)), max_size=400))
def test_whatever_it_is_sent_its_pointer_stays_in_its_memory(stream: Iterable[tuple[bool, int]]) -> None:
    oled = upright()
    for is_data, byte in stream:
        send(oled, 0x40 if is_data else 0x00, byte)
    assert len(oled.memory) == 1024
    assert len(oled.dots()) == 64
    assert all(len(row) == 128 for row in oled.dots())


def test_a_picture_is_a_png_of_its_dots_and_braille_on_a_terminal() -> None:
    picture = Picture((((255, 0, 0), (0, 0, 0)), ((0, 0, 0), (255, 255, 255))))
    png = picture.png(2)
    assert png[:8] == b"\x89PNG\r\n\x1a\n"
    assert struct.unpack_from(">II", png, 16) == (4, 4)
    at = png.index(b"IDAT")
    size = struct.unpack_from(">I", png, at - 4)[0]
    rows = zlib.decompress(png[at + 4 : at + 4 + size])
    assert rows[:13] == b"\0" + b"\xff\0\0" * 2 + b"\0\0\0" * 2
    assert picture.text() == "⠑"


# MPU-6050.


def put(imu: Mpu6050, number: int, *data: int, at_ns: int = 0) -> None:
    assert imu.start(0x68, False, at_ns)
    for byte in (number, *data):
        imu.write(byte, at_ns)
    imu.stop(at_ns)


def get(imu: Mpu6050, number: int, count: int = 1, at_ns: int = 0) -> bytes:
    imu.start(0x68, False, at_ns)
    imu.write(number, at_ns)
    imu.start(0x68, True, at_ns)
    return bytes(imu.read(at_ns) for _ in range(count))


def awake(plugged: Plug, *pins: str, divider: int = 0, dlpf: int = 1) -> tuple[Mpu6050, Any]:
    imu = Mpu6050()
    socket = plugged(imu, *pins)
    put(imu, 0x19, divider, dlpf)
    put(imu, 0x6B, 0)
    return imu, socket


def run(imu: Mpu6050, samples: int) -> int:
    at_ns = 0
    for _ in range(samples):
        at_ns = imu.next_deadline() or 0
        imu.advance_to(at_ns)
    return at_ns


def test_it_sleeps_until_it_is_woken_and_says_who_it_is(plugged: Plug) -> None:
    imu = Mpu6050()
    socket = plugged(imu)
    assert (imu.next_deadline(), get(imu, 0x75), get(imu, 0x6B)) == (None, b"\x68", b"\x40")
    put(imu, 0x6B, 0, at_ns=500)
    assert (imu.next_deadline(), socket.replans) == (500 + MS // 8, 1)
    put(imu, 0x6B, 0x80, at_ns=900)
    assert (imu.next_deadline(), get(imu, 0x6B)) == (None, b"\x40"), "DEVICE_RESET"


@pytest.mark.parametrize(("dlpf", "divider", "period_ns"), [(0, 0, 125_000), (7, 7, MS), (1, 0, MS), (3, 4, 5 * MS)])
def test_samples_come_at_the_rate_and_none_is_lost(plugged: Plug, dlpf: int, divider: int, period_ns: int) -> None:
    imu, _ = awake(plugged, divider=divider, dlpf=dlpf)
    assert run(imu, 10) == 10 * period_ns


@pytest.mark.parametrize("scale", range(4))
def test_forces_and_rates_have_the_scale_that_is_set_and_end_at_its_ends(plugged: Plug, scale: int) -> None:
    imu, socket = awake(plugged)
    put(imu, 0x1B, scale << 3, scale << 3)
    socket.surroundings.now = BoardMotion(force_mps2=(9.80665, -200.0, 0.0), rates_radps=(0.0, 0.0, math.radians(100)))
    run(imu, 1)
    x, y, z, temperature, *rates = struct.unpack(">7h", get(imu, 0x3B, 14))
    assert (x, y, z) == (16384 >> scale, -32768, 0)
    assert rates == [0, 0, round(100 * (131.0, 65.5, 32.8, 16.4)[scale])]
    assert round(temperature / 340 + 36.53, 2) == 25.0


def test_the_low_pass_is_slower_the_lower_its_bandwidth(plugged: Plug) -> None:
    found = []
    for dlpf in (1, 3, 6):
        imu, socket = awake(plugged, dlpf=dlpf)
        run(imu, 1)
        socket.surroundings.now = BoardMotion(force_mps2=(9.80665, 0.0, 9.80665))
        run(imu, 5)
        found.append(struct.unpack(">h", get(imu, 0x3B, 2))[0])
    # 1 - exp(-2 pi f 5 ms) of 16384, with 184, 44 and 5 Hz.
    assert found == [round(16384 * (1 - math.exp(-2 * math.pi * hz * 0.005))) for hz in (184, 44, 5)]


def test_a_burst_is_of_one_sample(plugged: Plug) -> None:
    imu, socket = awake(plugged)
    run(imu, 1)
    imu.start(0x68, False, 0)
    imu.write(0x3F, 0)
    imu.start(0x68, True, 0)
    first = imu.read(0)
    socket.surroundings.now = BoardMotion(force_mps2=(0, 0, 0))
    run(imu, 50)
    assert bytes((first, imu.read(0))) == b"\x40\x00"


def test_the_fifo_keeps_the_newest_and_tells_that_it_overflowed(plugged: Plug) -> None:
    imu, _ = awake(plugged)
    put(imu, 0x23, 0x78)  # accelerometer and gyroscope: 12 bytes
    put(imu, 0x6A, 0x40)
    run(imu, FIFO_BYTES // 12)
    assert int.from_bytes(get(imu, 0x72, 2), "big") == FIFO_BYTES // 12 * 12
    assert get(imu, 0x3A)[0] & 0x10 == 0
    run(imu, 1)
    assert int.from_bytes(get(imu, 0x72, 2), "big") == FIFO_BYTES
    assert get(imu, 0x3A)[0] & 0x10
    assert get(imu, 0x3A) == b"\0", "reading clears"
    assert len(get(imu, 0x74, 12)) == 12
    assert int.from_bytes(get(imu, 0x72, 2), "big") == FIFO_BYTES - 12
    put(imu, 0x6A, 0x44)
    assert get(imu, 0x72, 2) == b"\0\0"


def test_int_is_a_pulse_or_stays_until_it_is_cleared(plugged: Plug) -> None:
    imu, socket = awake(plugged, "int")
    put(imu, 0x38, 1)
    at_ns = run(imu, 1)
    assert socket.pins["int"].later == [(at_ns, 1), (at_ns + PULSE_NS, 0)]
    put(imu, 0x37, 0x20)
    socket.pins["int"].later.clear()
    at_ns = run(imu, 1)
    assert socket.pins["int"].later == [(at_ns, 1)]
    get(imu, 0x3A, at_ns=at_ns + 7)
    assert socket.pins["int"].later[1:] == [(at_ns + 7, 0)]


def test_an_axis_in_standby_reads_nothing(plugged: Plug) -> None:
    imu, _ = awake(plugged)
    put(imu, 0x6C, 0x08)
    run(imu, 1)
    assert get(imu, 0x3B, 6) == bytes(6)


@given(st.lists(st.tuples(st.integers(0, 127), st.integers(0, 255)), max_size=60))
def test_whatever_is_written_it_stays_who_it_is_and_goes_on(stream: list[tuple[int, int]]) -> None:
    imu = Mpu6050()
    for number, byte in stream:
        put(imu, number, byte)
        due = imu.next_deadline()
        if due is not None:
            imu.advance_to(due)
            assert (imu.next_deadline() or 0) > due
    assert get(imu, 0x75) == b"\x68"
    saved = imu.snapshot()
    other = Mpu6050()
    other.restore(saved)
    assert get(other, 0x00, 0x72) == get(imu, 0x00, 0x72)


# GPS.


def checked(sentence: bytes) -> list[str]:
    body, _, checksum = sentence.removeprefix(b"$").removesuffix(b"\r\n").partition(b"*")
    total = 0
    for byte in body:
        total ^= byte
    assert checksum == f"{total:02X}".encode()
    return body.decode().split(",")


def degrees(text: str, half: str) -> float:
    point = text.index(".") - 2
    return (float(text[:point]) + float(text[point:]) / 60) * (-1 if half in "SW" else 1)


@pytest.mark.parametrize(
    ("start", "at_s", "date"),
    [
        ("2026-12-31T23:59:59", 1, "010127"),
        ("2024-02-28T00:00:00", 86_400, "290224"),
        ("2100-02-28T12:00:00", 86_400, "010300"),
        ("2000-02-29T00:00:00", 0, "290200"),
    ],
)
def test_a_fix_has_the_date_of_its_time(start: str, at_s: int, date: str) -> None:
    assert checked(Gps(start=start).sentences(BoardMotion(), at_s * 10**9)[1])[9] == date


@pytest.mark.parametrize("year", [2000, 2036, 2069])
def test_every_day_of_a_year_has_its_date(year: int) -> None:
    gps = Gps(start=f"{year:04d}-01-01T23:59:58")
    for day in range(366):
        at = datetime(year, 1, 1, 23, 59, 58, tzinfo=UTC) + timedelta(days=day)
        for at_s, expected in ((day * 86_400 + 1, at), (day * 86_400 + 2, at + timedelta(seconds=2))):
            assert (
                checked(gps.sentences(BoardMotion(), at_s * 10**9)[1])[9] == f"{expected:%d%m}{expected.year % 100:02d}"
            )


@pytest.mark.parametrize("start", ["2026-02-29T00:00:00", "2026-13-01T00:00:00", "2026-01-01T24:00:00", "noon"])
def test_a_start_that_is_no_time_is_refused(start: str) -> None:
    with pytest.raises(ValueError, match="is no time such as"):
        Gps(start=start)


@given(
    st.floats(-80, 80), st.floats(-179, 179), st.floats(-500, 500), st.floats(-500, 500),
    st.floats(-4, 4), st.floats(-3, 3),
)  # fmt: skip
def test_a_fix_is_where_the_world_has_the_board(
    latitude: float, longitude: float, x_m: float, y_m: float, heading: float, speed: float
) -> None:
    gps = Gps(latitude_deg=latitude, longitude_deg=longitude, fix_s=0)
    motion = BoardMotion(x_m=x_m, y_m=y_m, heading_rad=heading, forward_mps=speed)
    gga, rmc = (checked(sentence) for sentence in gps.sentences(motion, 3_661_500_000_000))
    assert (gga[0], gga[1], rmc[1], rmc[2], rmc[9]) == ("GPGGA", "010101.50", "010101.50", "A", "010126")
    assert gga[2:6] == rmc[3:7]
    # A degree of latitude is 110.57 to 111.70 km.
    north_m = (degrees(gga[2], gga[3]) - latitude) * 111_132
    assert abs(north_m - y_m) < 0.02 + 0.006 * abs(y_m)
    east_m = (degrees(gga[4], gga[5]) - longitude) * 111_320 * math.cos(math.radians(latitude))
    assert abs(east_m - x_m) < 0.02 + 0.006 * abs(x_m)
    assert abs(float(rmc[7]) - abs(speed) * 1.943844) < 0.001
    ahead = heading if speed >= 0 else heading + math.pi
    assert abs(math.remainder(float(rmc[8]) - (90 - math.degrees(ahead)), 360)) < 0.006


def test_there_is_no_fix_one_nanosecond_before_its_time(plugged: Plug, port: Callable[[], Any]) -> None:
    gps = Gps(fix_s=2.0, rate_hz=10, baud=38_400)
    socket = plugged(gps, port=port())
    assert [checked(gps.sentences(BoardMotion(), at)[1])[2] for at in (2 * 10**9 - 1, 2 * 10**9)] == ["V", "A"]
    for _ in range(3):
        due = gps.next_deadline()
        gps.advance_to(due)
    assert (due, gps.next_deadline(), socket.port.far_baud) == (300 * MS, 400 * MS, 38_400)
    assert socket.port.received.count(b"$") == 6


@pytest.mark.parametrize("settings", [{"rate_hz": 11}, {"rate_hz": 0}, {"rate_hz": 10}, {"latitude_deg": 90.0}])
def test_what_no_receiver_can_do_is_refused(settings: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"\d"):
        Gps(**settings)


# Button, LEDs, potentiometer.


def test_a_button_bounces_by_its_seed_and_ends_as_it_should(plugged: Plug) -> None:
    found = []
    for seed in (1, 1, 2):
        button = Button(presses_s=(0.1,), held_s=0.2, bounce_ms=3, seed=seed)
        socket = plugged(button, "out")
        assert socket.pins["out"].driven == [(1, True)], "its resistor"
        assert button.next_deadline() == 100 * MS
        button.advance_to(100 * MS)
        found.append(sorted(socket.pins["out"].later))
    assert found[0] == found[1] != found[2]
    for edges in found:
        times = [at for at, _ in edges]
        assert times[0] == 100 * MS
        pressed = [(at, level) for at, level in edges if at < 200 * MS]
        released = [(at, level) for at, level in edges if at >= 200 * MS]
        assert (pressed[0][1], pressed[-1][1], released[0], released[-1][1]) == (0, 0, (300 * MS, 1), 1)
        assert max(at for at, _ in pressed) <= 103 * MS
        assert len(set(times)) == len(times)
        assert 5 <= len(pressed) <= 13


def test_presses_may_not_overlap() -> None:
    with pytest.raises(ValueError, match="begins before"):
        Button(presses_s=(0.1, 0.2), held_s=0.1, bounce_ms=1)
    assert Button(presses_s=(0.1, 0.2), held_s=0.1, bounce_ms=0).presses == [100 * MS, 200 * MS]


def test_leds_shine_while_their_pin_is_high_or_low(plugged: Plug) -> None:
    for is_active_low in (False, True):
        panel = LedPanel(is_active_low=is_active_low)
        socket = plugged(panel, "led0", "led3")
        panel.changed([(10, "led0", not is_active_low), (30, "led3", is_active_low)])
        socket.now_ns = 50
        assert (panel.is_lit("led0"), panel.is_lit("led3"), panel.lit_ns("led0")) == (True, False, 40)
        panel.changed([(60, "led0", is_active_low)])
        assert (panel.lit_ns("led0"), panel.picture().width) == (50, 7)


def test_a_potentiometer_gives_its_share_or_sweeps(plugged: Plug) -> None:
    pot = Potentiometer(position=0.25, to_v=2.0)
    socket = plugged(pot, "wiper")
    assert socket.pins["wiper"].volts == 0.5
    pot.position = 1.0
    assert socket.pins["wiper"].volts == 2.0
    with pytest.raises(ValueError, match=r"1\.01"):
        pot.position = 1.01
    swept = plugged(Potentiometer(sweep_s=2.0), "wiper").pins["wiper"].volts
    assert isinstance(swept, Oscillation)
    assert swept.period_ns == 2 * 10**9


# What they are asked for, and what they say.


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Mpu6050(address=0x67), "no MPU-6050 at 0x67 and 25.0 degrees: 0x68 or 0x69, -40 to 85"),
        (lambda: Mpu6050(temperature_c=-40.1), "no MPU-6050 at 0x68 and -40.1 degrees: 0x68 or 0x69, -40 to 85"),
        (lambda: Mpu6050(temperature_c=85.1), "no MPU-6050 at 0x68 and 85.1 degrees: 0x68 or 0x69, -40 to 85"),
        (lambda: Ssd1306(height=48), "no SSD1306 at 0x3c with 48 rows: 0x3C or 0x3D, 32 or 64"),
        (lambda: Gps(latitude_deg=-90), "no place on Earth: -90, 11.575"),
        (lambda: Gps(longitude_deg=180.5), "no place on Earth: 48.137, 180.5"),
        (lambda: Gps(rate_hz=7, baud=10_499), "7 fixes a second do not fit into 10499 bit/s: 10500 at the least"),
        (lambda: Gps(rate_hz=11), "11 fixes a second: 1 to 10"),
        (lambda: Button(held_s=0), "held for 0 s with 3 ms of bounces: it is held longer than it bounces"),
        (lambda: Button(held_s=0.002), "held for 0.002 s with 3 ms of bounces: it is held longer than it bounces"),
        (lambda: Button(bounce_ms=-1), "held for 0.1 s with -1 ms of bounces: it is held longer than it bounces"),
        (lambda: Button(presses_s=(2.0, 1.0, 2.05)), "a press at 2.05 s begins before 2.103 s"),
        (lambda: Button(presses_s=(-1.0,)), "a press at -1 s begins before 0 s"),
        (lambda: Potentiometer(position=-0.01), "a position of -0.01 and 0.0 s: 0 to 1, and 0 or more"),
        (lambda: Potentiometer(position=1.01), "a position of 1.01 and 0.0 s: 0 to 1, and 0 or more"),
        (lambda: Potentiometer(sweep_s=-1), "a position of 0.5 and -1 s: 0 to 1, and 0 or more"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_in_these_words(make: Callable[[], object], said: str) -> None:
    with pytest.raises(ValueError, match=r"\d") as caught:
        make()
    assert str(caught.value) == said


def test_what_is_at_the_ends_can_be(plugged: Plug) -> None:
    assert [Mpu6050(address=0x69, temperature_c=-40), Mpu6050(temperature_c=85), Gps(rate_hz=10, baud=15_000)]
    assert [Gps(longitude_deg=-180), Gps(longitude_deg=180, latitude_deg=89.9), Button(held_s=0.003)]
    for position, volts in ((0.0, 0.5), (1.0, 2.5), (0.25, 1.0)):
        pot = Potentiometer(position=position, from_v=0.5, to_v=2.5)
        assert plugged(pot, "wiper").pins["wiper"].volts == volts
        pot.position = position
        assert (pot.position, pot.words()) == (position, f"at {100 * position:.0f} %")
    assert Potentiometer(sweep_s=1).words() == "sweeps"
    with pytest.raises(ValueError, match=r"a position of -0[.]1: 0 to 1"):
        pot.position = -0.1


@pytest.mark.parametrize("time", ["24:00:00", "23:60:00", "23:59:60"])
def test_a_day_ends_with_its_last_second(time: str) -> None:
    with pytest.raises(ValueError, match=f"'2026-12-31T{time}' is no time such as 2026-01-31T12:00:00"):
        Gps(start=f"2026-12-31T{time}")


def test_the_sentences_of_the_defaults() -> None:
    # 1 km to the south and to the east of 48 deg 8.22' N, 11 deg 34.5' E, 520 m above WGS 84.
    gps, motion = Gps(), BoardMotion(x_m=1000.0, y_m=-1000.0, z_m=1.25, heading_rad=0.0, forward_mps=-1.0)
    assert gps.sentences(motion, 2 * 10**9 - 1) == (
        b"$GPGGA,000001.99,,,,,0,00,99.99,,,,,,*67\r\n", b"$GPRMC,000001.99,V,,,,,,,010126,,,N*78\r\n",
    )  # fmt: skip
    assert gps.sentences(motion, 2 * 10**9) == (
        b"$GPGGA,000002.00,4807.68044,N,01135.30609,E,1,08,1.00,521.2,M,0.0,M,,*6C\r\n",
        b"$GPRMC,000002.00,A,4807.68044,N,01135.30609,E,1.944,270.00,010126,,,A*6A\r\n",
    )
    assert gps.words() == "0 fixes sent"


def test_leds_and_strings_say_and_show_what_shines(plugged: Plug) -> None:
    panel = LedPanel()
    socket = plugged(panel, "led0", "led2")
    assert (panel.words(), panel.lit_ns("led2")) == ("no LED lit after 0 changes", 0)
    panel.changed([(5, "led2", True), (7, "led2", True), (9, "led0", False)])
    socket.now_ns = 11
    assert (panel.words(), panel.lit_ns("led2")) == ("led2 lit after 3 changes", 6)
    row = ((60, 20, 16),) * 3 + ((0, 0, 0),) + ((255, 60, 40),) * 3
    assert panel.picture() == Picture((row,) * 3)


def test_an_oled_shows_its_dots_in_their_colours_and_counts_them() -> None:
    oled = upright(height=32)
    commands(oled, 0xA8, 31, 0xB0, 0x00, 0x10, 0xFF, 0x26, 0, 0, 0, 0, 0, 0xFF, 0x2E, 0xE3, 0x8D, 0x14)
    send(oled, 0x40, 0x81)
    assert oled.words() == "128x32, on, 2 dots lit, 2 commands ignored"
    rows = [[(0, 0, 0)] * 128 for _ in range(32)]
    rows[0][0] = rows[7][0] = (210, 235, 255)
    assert oled.picture() == Picture(tuple(map(tuple, rows)))
    commands(oled, 0xAE)
    assert oled.words() == "128x32, off, 0 dots lit, 2 commands ignored"


@pytest.mark.parametrize(("ratio", "rows"), [(0, 16), (14, 16), (15, 16), (16, 17), (63, 64)])
def test_the_glass_shows_as_many_rows_as_the_ratio_says_and_never_below_sixteen(ratio: int, rows: int) -> None:
    oled = upright()
    commands(oled, 0xA8, ratio, 0xA5)
    assert lit(oled) == {(x, y) for x in range(128) for y in range(64 - rows, 64)}


#: DLPF_CFG: bandwidth of accelerometer and gyroscope in Hz, and the rate in kHz that SMPLRT_DIV divides (RM 4.3).
FILTERS = [(260, 256, 8), (184, 188, 1), (94, 98, 1), (44, 42, 1), (21, 20, 1), (10, 10, 1), (5, 5, 1), (260, 256, 8)]


@pytest.mark.parametrize("dlpf", range(8))
def test_every_axis_goes_through_the_low_pass_of_its_sensor(plugged: Plug, dlpf: int) -> None:
    imu, socket = awake(plugged, dlpf=dlpf, divider=3)
    socket.surroundings.now = BoardMotion(force_mps2=(0, 0, 0))
    run(imu, 1)
    g = 9.80665
    socket.surroundings.now = BoardMotion(force_mps2=(g, -g / 2, g / 4), rates_radps=(4.0, -2.0, 1.0))
    run(imu, 1)
    *bands, khz = FILTERS[dlpf]
    shares = [1 - math.exp(-2 * math.pi * band * 4 / khz / 1000) for band in bands]
    wanted = [*(shares[0] * 16384 * part for part in (1, -0.5, 0.25)), (25 - 36.53) * 340, *(
        shares[1] * 131 * math.degrees(rate) for rate in (4, -2, 1))]  # fmt: skip
    assert struct.unpack(">7h", get(imu, 0x3B, 14)) == pytest.approx(wanted, abs=0.501)


def test_a_write_changes_the_bits_that_a_register_has_and_no_others() -> None:
    imu = Mpu6050()
    before = get(imu, 0, 0x72)
    for number in range(0x80):
        if number not in {0x6B, 0x6A}:
            put(imu, number, 0xFF)
    put(imu, 0x6B, 0x7F)
    put(imu, 0x6A, 0xFF)
    wanted = bytearray(before)
    wanted[0x06:0x0C] = wanted[0x13:0x19] = b"\xff" * 6
    for number, bits in {0x19: 0xFF, 0x1A: 0x3F, 0x1B: 0xF8, 0x1C: 0xF8, 0x23: 0xFF, 0x37: 0xFE, 0x38: 0x19,
                         0x6A: 0x70, 0x6B: 0x6F, 0x6C: 0xFF}.items():  # fmt: skip
        wanted[number] = bits
    assert get(imu, 0, 0x72).hex() == wanted.hex()


#: The bits of FIFO_EN, and what each puts into the FIFO: bytes of 3B to 48 (RM 4.9).
@pytest.mark.parametrize(
    ("bits", "parts"), [(0x08, "0-6"), (0x80, "6-8"), (0x40, "8-10"), (0x20, "10-12"), (0x10, "12-14"), (0x07, "0-0"),
                        (0xF8, "0-14")],
)  # fmt: skip
def test_the_fifo_takes_what_its_bits_say_in_the_order_of_the_registers(plugged: Plug, bits: int, parts: str) -> None:
    imu, socket = awake(plugged)
    socket.surroundings.now = BoardMotion(force_mps2=(1, 2, 3), rates_radps=(0.1, 0.2, 0.3))
    put(imu, 0x23, bits)
    put(imu, 0x6A, 0x40)
    run(imu, 1)
    begin, end = map(int, parts.split("-"))
    sample = get(imu, 0x3B, 14)
    assert int.from_bytes(get(imu, 0x72, 2), "big") == end - begin
    assert get(imu, 0x74, 15) == sample[begin:end].ljust(15, b"\xff"), "0xFF where it is empty"


@pytest.mark.parametrize(
    ("bit", "at"), [(0x20, 0), (0x10, 2), (0x08, 4), (0x04, 8), (0x02, 10), (0x01, 12)]
)  # fmt: skip
def test_each_axis_has_a_standby_of_its_own(plugged: Plug, bit: int, at: int) -> None:
    imu, socket = awake(plugged)
    socket.surroundings.now = BoardMotion(force_mps2=(1, 2, 3), rates_radps=(0.1, 0.2, 0.3))
    put(imu, 0x6C, bit)
    run(imu, 1)
    values = struct.unpack(">7h", get(imu, 0x3B, 14))
    assert [place for place, value in enumerate(values) if value == 0] == [at // 2]


def test_int_may_be_active_low_and_any_read_may_clear_it(plugged: Plug) -> None:
    imu, socket = awake(plugged, "int")
    levels = socket.pins["int"].later
    put(imu, 0x37, 0xB0, at_ns=3)
    assert levels == [(3, 1)], "it lets go, high now"
    put(imu, 0x38, 0x01)
    at_ns = run(imu, 1)
    get(imu, 0x75, at_ns=at_ns + 5)
    assert levels[1:] == [(at_ns, 0), (at_ns + 5, 1)]
    assert get(imu, 0x3A, at_ns=at_ns + 6) == b"\0"


def test_its_words_have_what_it_measures_in_g_and_degrees_a_second(plugged: Plug) -> None:
    imu, socket = awake(plugged)
    put(imu, 0x1B, 3 << 3, 2 << 3)
    socket.surroundings.now = BoardMotion(
        force_mps2=(9.80665, -4.903325, 0.0), rates_radps=(math.radians(90), 0.0, math.radians(-45.5))
    )
    run(imu, 1)
    assert imu.words() == "1 samples, +1.00, -0.50, +0.00 g, +90.0, +0.0, -45.5 deg/s"


def test_a_reset_of_the_signal_path_empties_the_sample_and_that_of_the_fifo_the_fifo(plugged: Plug) -> None:
    imu, _ = awake(plugged)
    put(imu, 0x23, 0x08)
    put(imu, 0x6A, 0x40)
    run(imu, 1)
    put(imu, 0x68, 0x07)
    assert (get(imu, 0x3B, 14), get(imu, 0x72, 2)) == (bytes(14), b"\0\x06")
    run(imu, 1)
    put(imu, 0x6A, 0x41)
    assert (get(imu, 0x3B, 14), get(imu, 0x72, 2)) == (bytes(14), b"\0\x0c")
    put(imu, 0x6A, 0x44)
    assert get(imu, 0x72, 2) == b"\0\0"
