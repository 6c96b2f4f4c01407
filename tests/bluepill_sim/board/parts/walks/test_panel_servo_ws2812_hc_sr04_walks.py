"""Parts on single pins, with edges at every bound: what they show, drive and note, as approved."""

import random
import zlib
from collections.abc import Iterator
from typing import Any

from bluepill_sim.fabric.bus_parts import CanFrame
from bluepill_sim.fabric.can_network import CanNetwork, CanNode
from bluepill_sim.fabric.signals import Oscillation
from bluepill_sim.parts.can_talker import CanTalker
from bluepill_sim.parts.hc_sr04 import BURST_NS, NO_ECHO_NS, TRIGGER_NS, HcSr04, echo_ns
from bluepill_sim.parts.panel import Button, LedPanel, Potentiometer
from bluepill_sim.parts.picture import Picture
from bluepill_sim.parts.servo import HOLD_NS, Servo
from bluepill_sim.parts.ws2812 import HEARD_NS, HIGH_LIMITS_NS, LOW_LIMITS_NS, ONE_NS, Ws2812
from tests.bluepill_sim.board.parts.conftest import FakeSocket
from tests.tools.suite.approved import Trace, judge_of, said, tried

MS = 1_000_000


def plugged(part: Any, *pins: str) -> FakeSocket:
    socket = FakeSocket(*pins)
    part.plug(socket)
    return socket


def did(socket: FakeSocket) -> str:
    """Return what a part has done with its pins, notes and warnings since the last time."""
    found = said(
        [
            [
                (name, pin.driven, pin.later, pin.volts if not isinstance(pin.volts, Oscillation) else "wave")
                for name, pin in socket.pins.items()
            ],
            socket.notes,
            socket.warnings,
        ]
    )
    for pin in socket.pins.values():
        pin.driven.clear()
        pin.later.clear()
    socket.notes.clear()
    return found


def buttons(draw: random.Random) -> Iterator[str]:
    for options in (
        {},
        {"is_active_low": False, "seed": 4},
        {"bounce_ms": 0.0},
        {"bounce_ms": 0.000003, "held_s": 0.01},
        {"bounce_ms": 0.000001},
        {"bounce_ms": 5, "held_s": 0.005},
    ):
        button = Button(presses_s=(0.5, 0.1, 2.0), **options)  # type: ignore[arg-type]
        yield said([button.presses, button.next_deadline(), button.words(), tried(button.press, 1)])
        button.advance_to(1)
        socket = plugged(button, "out")
        yield did(socket)
        while (due := button.next_deadline()) is not None:
            button.advance_to(due)
            yield f"{due} {did(socket)} {button.words()}"
        free = button.snapshot()["_free_ns"]
        yield said([tried(button.press, free - 1), tried(button.press, free), button.next_deadline(), button.presses])  # type: ignore[operator]
    for options in (
        {"held_s": 0.0},
        {"held_s": -1.0},
        {"bounce_ms": -0.1},
        {"held_s": 0.002},
        {"held_s": 0.003},
        {"presses_s": (-0.1,)},
        {"presses_s": (0.0,)},
        {"presses_s": (0.1, 0.2029)},
        {"presses_s": (0.1, 0.203)},
    ):
        yield tried(lambda each: Button(**each).words(), options)


def panels(draw: random.Random) -> Iterator[str]:
    for low in (False, True):
        panel = LedPanel(is_active_low=low)
        socket, now = plugged(panel, "led0", "led2", "led7"), 0
        for _ in range(60):
            name = draw.choice(("led0", "led2", "led7"))
            panel.changed([(now, name, draw.random() < 0.5)])
            now += draw.choice((1, 5))
            socket.now_ns = now
            yield said(
                [
                    panel.words(),
                    [(panel.is_lit(each), panel.lit_ns(each)) for each in ("led0", "led2", "led7")],
                    panel.snapshot(),
                    panel.picture().rows[0],
                ]
            )
        yield said([panel.picture().width, panel.picture().scale(), len(panel.picture().rows)])
    alone = LedPanel()
    alone._lit_ns["led0"] = 5
    alone.changed([(7, "led0", True)])
    yield said(alone.lit_ns("led0"))
    yield said([LedPanel().words(), sorted(LedPanel.PINS), Button.PINS, Potentiometer.PINS])


def dividers(draw: random.Random) -> Iterator[str]:
    for options in (
        {},
        {"position": 0.0, "from_v": 0.3},
        {"position": 1, "from_v": 3.3, "to_v": 0.1},
        {"sweep_s": 2.0, "from_v": 0.2, "to_v": 3.0},
        {"position": 0.126},
    ):
        pot = Potentiometer(**options)
        pot.position = pot.position
        socket = plugged(pot, "wiper")
        yield f"{pot.words()} {did(socket)} {socket.pins['wiper'].volts} {pot.position}"
        for position in (-0.001, 0, 0.25, 1, 1.001):
            yield tried(setattr, pot, "position", position) + did(socket)
    for position, sweep in ((-0.001, 0), (1.001, 0), (0, -0.001), (float("nan"), 0), (0, float("nan"))):
        yield tried(lambda at, span: Potentiometer(position=at, sweep_s=span).words(), position, sweep)


def servos(draw: random.Random) -> Iterator[str]:
    for options in (
        {},
        {"least_us": 500, "most_us": 2500, "least_deg": 90.0, "most_deg": -45.5, "deg_per_s": 300.0},
        {"least_us": 1000, "most_us": 1001},
    ):
        servo = Servo(**options)  # type: ignore[arg-type]
        yield said([servo.words(), servo.angle_deg, servo.snapshot()])
        socket, now = plugged(servo, "signal"), 0
        first, last = (us * 1000 for us in servo._us)
        half = (last - first) // 2
        for _ in range(90):
            width = draw.choice(
                (
                    first,
                    last,
                    first - half,
                    first - half - 1,
                    last + half,
                    last + half + 1,
                    first - 1,
                    last + 1,
                    (first + last) // 2,
                    draw.randrange(first, last + 1),
                    3,
                )
            )
            rows = [(now, "signal", True), (now + width, "signal", False)]
            servo.changed(rows[draw.choice((0, 0, 0, 1)) :])
            if draw.random() < 0.1:
                servo.changed([(now + width + 1, "signal", False)])
            socket.now_ns = now + width + draw.choice((0, MS, 20 * MS, HOLD_NS - 1, HOLD_NS, HOLD_NS + 9))
            yield said(
                [
                    width,
                    servo.words(),
                    servo.angle_deg,
                    servo.target_deg,
                    servo.angle_at(now + width - 5),
                    servo.ignored,
                    did(socket),
                    servo.snapshot(),
                ]
            )
            now = socket.now_ns + draw.choice((0, 10 * MS))
    for options in (
        {"least_us": 0},
        {"least_us": 1},
        {"least_us": 2000},
        {"least_us": 1999},
        {"least_deg": 90.0},
        {"deg_per_s": 0},
        {"deg_per_s": float("nan")},
    ):
        yield tried(lambda each: Servo(**each).words(), options)


def strings(draw: random.Random) -> Iterator[str]:
    for leds, reset_us in ((3, 50.0), (1, 280.0), (6, 1.0)):
        string = Ws2812(leds=leds, reset_us=reset_us)
        socket, now, reset = plugged(string, "din"), 100, round(reset_us * 1000)
        yield said([string.words(), string.next_deadline()])
        for _ in range(70):
            rows = []
            for _ in range(draw.choice((1, 5, 23, 24, 25, 48, 72, 96))):
                bit = draw.random() < 0.5
                high = draw.choice(
                    (400, 800)[bit : bit + 1] * 12
                    + (
                        ONE_NS - 1,
                        ONE_NS,
                        HEARD_NS,
                        HEARD_NS - 1,
                        *HIGH_LIMITS_NS[bit],
                        HIGH_LIMITS_NS[bit][1] + 1,
                        HIGH_LIMITS_NS[bit][0] - 1,
                    )
                )
                low = draw.choice(
                    (850, 450)[bit : bit + 1] * 12
                    + (*LOW_LIMITS_NS[bit], LOW_LIMITS_NS[bit][0] - 1, LOW_LIMITS_NS[bit][1] + 1)
                )
                rows += [(now, "din", True), (now + high, "din", False)]
                now += high + low
            string.changed(rows)
            now += draw.choice((0, reset - 451, reset, reset + 7))
            due = string.next_deadline()
            line = said([due, string.words(), string.snapshot()])
            if due is not None and due <= now and draw.random() < 0.7:
                string.advance_to(due)
                line += f" {due} {string.words()} {string.next_deadline()}"
            yield f"{line} {did(socket)}"
        yield said(string.picture().rows[0]) + f" {len(string.picture().rows)}"
    for leds, reset_us in ((0, 50), (1, 1), (1024, 50), (1025, 50), (8, 0.99), (8, float("nan"))):
        yield tried(lambda count, span: Ws2812(leds=count, reset_us=span).words(), leds, reset_us)
    for mode, hz in ((0, 2_400_000), (1, 6_400_000), (3, 3_200_000)):
        string, socket = Ws2812(leds=2), FakeSocket()
        socket.spi = type("Spi", (), {"bit_hz": hz, "mode": mode})()
        yield tried(string.plug, socket)
        now = 0
        for _ in range(40):
            now += 8 * 10**9 // hz
            answer = tried(string.exchange, draw.choice((0x92, 0xDB, 0x49, 0xF0, 0xC0, 0, 0xFF)), now)
            yield said([answer, string.snapshot(), string.next_deadline()])
        string.select(now)
        string.deselect(now)
    yield said([sorted(Ws2812.spi_modes), Ws2812.max_hz])
    yield tried(Ws2812().plug, FakeSocket()) + said([Ws2812().words(), len(Ws2812().shown)])


def echoes(draw: random.Random) -> Iterator[str]:
    for options in (
        {},
        {"distance_m": 1.0},
        {"distance_m": 0.019, "temperature_c": -40},
        {"distance_m": 4.0},
        {"distance_m": 3.999, "temperature_c": 80},
        {"distance_m": 0.02, "echo_v": 3.3},
        {"x_m": 0.1, "y_m": -0.2, "heading_deg": 90.0},
    ):
        sonar = HcSr04(**options)
        sonar.changed([(0, "trig", True), (TRIGGER_NS, "trig", False)])
        socket, now = FakeSocket("trig", "echo"), 10
        socket.pins["echo"].name = "PB1"  # type: ignore[attr-defined]
        socket.pins["echo"].is_five_volt_tolerant = draw.random() < 0.5
        sonar.plug(socket)  # type: ignore[arg-type]
        yield did(socket)
        for _ in range(14):
            width = draw.choice((TRIGGER_NS - 1, TRIGGER_NS, TRIGGER_NS + 1, 50_000))
            socket.surroundings.metres = draw.choice((0.5, 3.9999, 4.0, 9.0, 0.0))
            sonar.changed([(now, "trig", True), (now + width, "trig", False), (now + width + 1, "trig", False)])
            now += width
            busy = sonar.snapshot()["_busy_until_ns"]
            yield said([width, sonar.words(), did(socket), busy, socket.surroundings.asked, sonar.snapshot()])
            now = draw.choice((now + 5, busy - TRIGGER_NS - 1, busy - TRIGGER_NS, busy, busy + NO_ECHO_NS))  # type: ignore[operator]
    for options in (
        {"distance_m": -0.001},
        {"distance_m": 0},
        {"temperature_c": -40.1},
        {"temperature_c": 80.1},
        {"echo_v": 0},
        {"echo_v": 5.5},
        {"echo_v": 5.6},
    ):
        yield tried(lambda each: HcSr04(**each).words(), options)
    yield said([echo_ns(metres, warm) for metres in (0.02, 1, 4) for warm in (-40, 0, 20, 80)] + [BURST_NS])


def pictures(draw: random.Random) -> Iterator[str]:
    small = Picture((((1, 2, 3), (255, 0, 9)),))
    yield said(small.png() == small.png(1))
    for width, height in ((1, 1), (2, 4), (3, 5), (32, 2), (33, 9), (512, 1), (513, 1), (300, 3)):
        picture = Picture(
            tuple(
                tuple((draw.choice((0, 127, 128, 255)), 0, draw.choice((0, 128))) for _ in range(width))
                for _ in range(height)
            )
        )
        yield said(
            [
                picture.width,
                picture.scale(),
                picture.text(),
                [
                    (
                        len(picture.png(n)),
                        zlib.crc32(zlib.decompress(picture.png(n)[41:-16])),
                        picture.png(n)[:41].hex(),
                        picture.png(n)[-12:].hex(),
                    )
                    for n in (1, 2)
                ],
            ]
        )


def talkers(draw: random.Random) -> Iterator[str]:
    for options in (
        {},
        {"identifier": 0x7FF, "data": "0102030405060708", "period_ms": 10.0},
        {"identifier": 0x800, "echoes": False},
        {"identifier": 0x1FFF_FFFF, "period_ms": 0.0},
        {"data": ""},
    ):
        talker, network = CanTalker(**options), CanNetwork()  # type: ignore[arg-type]
        other, now = CanNode(), 0
        talker.join(network)
        network.join(other)
        for _ in range(14):
            due = talker.next_deadline()
            if due is not None and draw.random() < 0.6:
                talker.advance_to(due)
            if draw.random() < 0.6:
                other.send(CanFrame(identifier=draw.choice((0, 5, 0x7FF)), data=draw.randbytes(2)), now)
            if draw.random() < 0.4:
                other.send(CanFrame(identifier=draw.choice((0x7FF, 0x1FFF_FFFF)), data=b"x", is_extended=True), now)
            if draw.random() < 0.3:
                other.send(CanFrame(identifier=9, is_remote=True, remote_bytes=3), now)
            now += draw.choice((100_000, 90 * MS))
            network.advance_to(now)
            yield said(
                [
                    due,
                    talker.words(),
                    talker.next_deadline(),
                    other.received[-3:],
                    talker.node.received[-2:],
                    talker.snapshot(),
                ]
            )
    for options in (
        {"identifier": -1},
        {"identifier": 0x2000_0000},
        {"data": "010203040506070809"},
        {"data": "x"},
        {"period_ms": -1.0},
        {"period_ms": float("nan")},
    ):
        yield tried(lambda each: CanTalker(**each).words() if each else "", options)


TRACES: dict[str, Trace] = {
    "buttons": buttons,
    "panels": panels,
    "dividers": dividers,
    "servos": servos,
    "strings": strings,
    "echoes": echoes,
    "pictures": pictures,
    "talkers": talkers,
}
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
