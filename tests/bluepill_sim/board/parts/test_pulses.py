"""Parts that live by the widths of pulses: HC-SR04, servo, WS2812; one nanosecond around each limit."""

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bluepill_sim.parts import HcSr04, Servo, Ws2812
from bluepill_sim.parts.hc_sr04 import BURST_NS, FARTHEST_M, NO_ECHO_NS, TRIGGER_NS, echo_ns
from bluepill_sim.parts.servo import HOLD_NS
from bluepill_sim.parts.ws2812 import HEARD_NS, ONE_NS

Plug = Callable[..., Any]
US = 1000


def pulse(part: Any, pin: str, begin: int, width: int) -> None:
    part.changed([(begin, pin, True), (begin + width, pin, False)])


@pytest.mark.parametrize(("width", "measures"), [(TRIGGER_NS - 1, False), (TRIGGER_NS, True)])
def test_a_trigger_is_ten_microseconds_long_at_the_least(plugged: Plug, width: int, measures: bool) -> None:
    part = HcSr04(distance_m=1.0)
    socket = plugged(part, "trig", "echo")
    pulse(part, "trig", 1000, width)
    begin = 1000 + width + BURST_NS
    # 2 m at 331.3 + 0.606 * 20 = 343.42 m/s are 5.823773 ms.
    assert socket.pins["echo"].later == ([(begin, 1), (begin + 5_823_773, 0)] if measures else [])


def test_what_comes_while_it_measures_is_ignored_and_at_its_end_no_more(plugged: Plug) -> None:
    part = HcSr04(distance_m=1.0)
    plugged(part, "trig", "echo")
    end = TRIGGER_NS + BURST_NS + echo_ns(1.0, 20.0)
    for begin in (0, end - TRIGGER_NS - 1):
        pulse(part, "trig", begin, TRIGGER_NS)
    assert part.measured == 1
    pulse(part, "trig", end - TRIGGER_NS, TRIGGER_NS)
    assert part.measured == 2


def test_beyond_its_reach_there_is_no_echo_and_too_near_it_is_two_centimetres(plugged: Plug) -> None:
    part = HcSr04(x_m=0.1, heading_deg=90.0)
    socket = plugged(part, "trig", "echo")
    widths = []
    for n, metres in enumerate((FARTHEST_M, FARTHEST_M - 0.001, 0.001)):
        socket.surroundings.metres = metres
        pulse(part, "trig", n * 100_000_000, TRIGGER_NS)
        (rise, _), (fall, _) = socket.pins["echo"].later[-2:]
        widths.append(fall - rise)
    assert widths == [NO_ECHO_NS, echo_ns(FARTHEST_M - 0.001, 20.0), echo_ns(0.02, 20.0)]
    assert socket.surroundings.asked[:2] == (0.1, 0.0), "it looks from where it sits"


def test_sound_is_slower_in_the_cold() -> None:
    assert echo_ns(1.0, -20.0) > echo_ns(1.0, 20.0)
    with pytest.raises(ValueError, match="-300"):
        HcSr04(temperature_c=-300)


@pytest.mark.parametrize(
    ("width_us", "target"),
    [(499, 0.0), (500, -90.0), (1000, -90.0), (1500, 0.0), (1750, 45.0), (2000, 90.0), (2500, 90.0), (2501, 0.0)],
)
def test_a_servo_takes_pulses_up_to_half_its_range_beyond_its_ends(plugged: Plug, width_us: int, target: float) -> None:
    part = Servo()
    plugged(part, "signal")
    pulse(part, "signal", 0, width_us * US)
    assert (part.target_deg, part.pulses + part.ignored) == (target, 1)


def test_a_servo_turns_as_fast_as_it_can_and_no_longer_than_it_is_driven(plugged: Plug) -> None:
    part = Servo(deg_per_s=100.0)
    plugged(part, "signal")
    pulse(part, "signal", 0, 2000 * US)
    end = 2000 * US
    assert part.angle_at(end) == 0.0
    assert part.angle_at(end + 50_000_000) == 5.0
    # It was driven for 100 ms: 10 degrees of the 90.
    assert part.angle_at(end + HOLD_NS - 10) < part.angle_at(end + HOLD_NS) == part.angle_at(10**10) == 10.0


@given(st.lists(st.integers(400, 2600), min_size=1, max_size=30))
def test_a_servo_never_leaves_its_range_nor_jumps(widths: list[int]) -> None:
    part, last = Servo(deg_per_s=600.0), 0.0
    for n, width in enumerate(widths):
        pulse(part, "signal", n * 20_000_000, width * US)
        angle = part.angle_at(n * 20_000_000 + width * US)
        # 600 degrees a second for 20 ms and what the pulses differ by.
        assert -90 <= angle <= 90
        assert abs(angle - last) <= 600 * 0.0223 + 1e-6
        last = angle


def bits_of(part: Ws2812, word: int, begin: int, *, zero: int = 400, one: int = 800, count: int = 24) -> int:
    for n in range(count - 1, -1, -1):
        pulse(part, "din", begin, one if word >> n & 1 else zero)
        begin += 1250
    return begin


def test_leds_take_green_red_blue_and_pass_the_rest_on(plugged: Plug) -> None:
    part = Ws2812(leds=2)
    socket = plugged(part, "din")
    end = 0
    for word in (0x10FF20, 0x0000FF, 0xFFFFFF):
        end = bits_of(part, word, end)
    assert part.shown == [(0, 0, 0)] * 2, "nothing before the reset"
    due = part.next_deadline()
    assert due == end - 1250 + 800 + 50 * US, "50 us behind the last falling edge"
    part.advance_to(due)
    assert part.shown == [(0xFF, 0x10, 0x20), (0, 0, 0xFF)]
    assert (part.frames, part.out_of_limits, socket.notes[0][:2]) == (1, 0, (due, "shown"))


@pytest.mark.parametrize(("pause", "frames"), [(50 * US - 1, 0), (50 * US, 1)])
def test_a_reset_is_as_long_as_it_says(plugged: Plug, pause: int, frames: int) -> None:
    part = Ws2812(leds=1)
    plugged(part, "din")
    end = bits_of(part, 0xFFFFFF, 0) - 1250 + 800
    pulse(part, "din", end + pause, 400)
    assert part.frames == frames


@pytest.mark.parametrize(
    ("width", "bit", "is_bad"),
    [(249, 0, True), (250, 0, False), (550, 0, False), (551, 0, True), (ONE_NS - 1, 0, True), (ONE_NS, 1, True),
     (649, 1, True), (650, 1, False), (950, 1, False), (951, 1, True)],
)  # fmt: skip
def test_a_pulse_is_judged_by_the_data_sheet_and_taken_by_its_length(
    plugged: Plug, width: int, bit: int, is_bad: bool
) -> None:
    part = Ws2812(leds=1)
    plugged(part, "din")
    pulse(part, "din", 0, width)
    assert (part.out_of_limits > 0) is is_bad
    bits_of(part, 0, 1250, count=23)
    part.advance_to(part.next_deadline() or 0)
    assert part.shown == [(0, 0x80 * bit, 0)]


def test_a_glitch_is_no_pulse(plugged: Plug) -> None:
    part = Ws2812()
    plugged(part, "din")
    pulse(part, "din", 0, HEARD_NS - 1)
    assert part.next_deadline() is None
    pulse(part, "din", 1250, HEARD_NS)
    assert part.next_deadline() is not None


@given(st.lists(st.tuples(*[st.integers(0, 255)] * 3), min_size=1, max_size=6))
def test_every_colour_comes_through_an_spi_as_three_bits_a_bit(colours: list[tuple[int, int, int]]) -> None:
    part = Ws2812(leds=len(colours))

    class Socket:
        class spi:  # noqa: N801 - as the socket has it
            bit_hz = 2_250_000

        def has(self, _pin: str) -> bool:
            return False

        def note(self, *_what: object) -> None:
            pass

    part.plug(Socket())  # type: ignore[arg-type] # what it needs of one
    words = [green << 16 | red << 8 | blue for red, green, blue in colours]
    # 444 ns a bit of the SPI: 100 is a short pulse, 110 a long one.
    stream = "".join("110" if word >> n & 1 else "100" for word in words for n in range(23, -1, -1))
    data = int(stream, 2).to_bytes(len(stream) // 8, "big") + bytes(20)
    for n, byte in enumerate(data):
        part.exchange(byte, (n + 1) * 8 * 10**9 // 2_250_000)
    part.advance_to(part.next_deadline() or 0)
    assert part.shown == colours
    assert part.out_of_limits == 0


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: HcSr04(distance_m=-0.1), "a distance of -0.1 m"),
        (lambda: HcSr04(temperature_c=-40.5), "-40.5 degrees and 5.0 V: -40 to 80, and up to 5.5 V"),
        (lambda: HcSr04(temperature_c=80.5), "80.5 degrees and 5.0 V: -40 to 80, and up to 5.5 V"),
        (lambda: HcSr04(echo_v=0), "20.0 degrees and 0 V: -40 to 80, and up to 5.5 V"),
        (lambda: HcSr04(echo_v=5.6), "20.0 degrees and 5.6 V: -40 to 80, and up to 5.5 V"),
        (lambda: Ws2812(leds=0), "a string of 0 with a reset of 50.0 us: 1 to 1024, and 1 us or more"),
        (lambda: Ws2812(leds=1025), "a string of 1025 with a reset of 50.0 us: 1 to 1024, and 1 us or more"),
        (lambda: Ws2812(reset_us=0.5), "a string of 8 with a reset of 0.5 us: 1 to 1024, and 1 us or more"),
    ],
)
def test_what_cannot_be_is_refused_in_these_words(make: Callable[[], object], said: str) -> None:
    with pytest.raises(ValueError, match=r"\d") as caught:
        make()
    assert str(caught.value) == said


def test_what_is_at_the_ends_can_be() -> None:
    assert [
        HcSr04(distance_m=0, temperature_c=-40, echo_v=5.5),
        HcSr04(temperature_c=80),
        Ws2812(leds=1024, reset_us=1),
    ]
    for settings in ({"least_us": 0}, {"least_us": 2000}, {"least_deg": 90.0}, {"deg_per_s": 0.0}):
        with pytest.raises(ValueError, match=r"\d"):
            Servo(**settings)


def test_a_string_says_four_colours_and_its_worst_pulse_and_shows_squares(plugged: Plug) -> None:
    part = Ws2812(leds=5)
    plugged(part, "din")
    assert part.words() == "#000000 #000000 #000000 #000000 ... after 0 frames"
    end = bits_of(part, 0x102030, 0)
    pulse(part, "din", end, 1000)  # 50 ns beyond, and so is the next
    pulse(part, "din", end + 1000 + 400, 200)
    end = bits_of(part, 0, end + 2800, count=22)
    part.advance_to(part.next_deadline() or 0)
    words = "high of a 1 of 1000 ns, not 650 to 950"
    assert part.words().endswith(f" ... after 1 frames, 3 times beyond its limits ({part.worst[1]})")
    assert part.shown[0] == (0x20, 0x10, 0x30)
    four = Ws2812(leds=4)
    plugged(four, "din")
    pulse(four, "din", 0, 1000)
    pulse(four, "din", 1300, 200)
    assert four.words() == f"#000000 #000000 #000000 #000000 after 0 frames, 2 times beyond its limits ({words})"
    four.shown = [(1, 2, 3), (4, 5, 6), (7, 8, 9), (10, 11, 12)]
    row = [colour for one in four.shown for colour in [one] * 6 + [(0, 0, 0)]][:-1]
    assert four.picture().rows == (tuple(row),) * 6
