"""The adapter's parts by themselves: numbers at every bound, times at every deadline, tables spoiled, as approved."""

import random
import zlib
from collections.abc import Callable, Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

from adapter_sim.codec import (
    BitOrder,
    divide_half_away,
    encoder_code,
    encoder_count,
    is_near,
    motor_code,
    motor_value,
    reverse_bits,
)
from adapter_sim.distances import Distances, threshold_um
from adapter_sim.driver import CommandPacer, Driver, SpeedPlausibility
from adapter_sim.duty import COURSE_NS, DutyMeter, DutyWire
from adapter_sim.encoders import CodeWalk, EncoderGeometry, Encoders, WheelCodes, forward_step, sine
from adapter_sim.masters import Master, Masters
from adapter_sim.mixing import CommandedSpeeds, Mixer
from adapter_sim.pinout import Status, WireRole, faults_of, load_pinout, parse_pinout
from adapter_sim.pins import Debounce, Inputs, Majority, Median, Outputs, SampleClock, released_codes
from adapter_sim.receiver import Receiver, threshold
from adapter_sim.session import Session, StopRepeater
from adapter_sim.settings import AdapterSettings, EncoderAtOpen, MotorCommand, MotorMeaning
from p2os.gamepad import PadReport
from p2os.protocol.commands import vel
from p2os.protocol.frames import Frame
from p2os.protocol.packets import Identity
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import SonarReading, StandardSip
from p2os.robots.parameters import load_parameters
from tests.adapter_sim.conftest import PARAMETERS, PINOUT, PINOUT_TEXT, FakePins, FakeRobot, Rig, four_bits
from tests.tools.suite.approved import Trace, judge_of, said, tried
from tests.tools.suite.declared import declared_of

MS = 1_000_000


def codec(draw: random.Random) -> Iterator[str]:
    for width in (0, 1, 3, 4, 8):
        top = 1 << width
        yield said([tried(reverse_bits, code, width) for code in (-1, 0, 1, top // 2, top - 1, top)])
        for order in BitOrder:
            yield said(
                [tried(motor_value, code, width, order) for code in (-1, 0, 1, top // 2 - 1, top // 2, top - 1, top)]
            )
            if width:
                yield said(
                    [
                        tried(motor_code, value, width, order)
                        for value in (-top // 2 - 1, -top // 2, -1, 0, 1, top // 2 - 1, top // 2)
                    ]
                )
    for turn in (-1, 0, 1, 360, 518_363):
        yield said(
            [
                tried(kind, angle, turn, 3)
                for kind in (encoder_count, encoder_code)
                for angle in (-361, -46, -45, -1, 0, 1, 44, 45, 359, 360)
            ]
        )
    yield said([is_near(range_um, 600) for range_um in (599, 600, 601)])
    yield said(
        [
            tried(divide_half_away, n, d)
            for d in (-1, 0, 1, 2, 3, 1000)
            for n in (-1500, -1499, -5, -3, -2, -1, 0, 1, 2, 3, 5, 499, 500, 501)
        ]
    )


def mixes(draw: random.Random) -> Iterator[str]:
    speeds = []
    for number in range(40):
        settings = AdapterSettings(
            motor_meaning=draw.choice(tuple(MotorMeaning)),
            motor_command=draw.choice(tuple(MotorCommand)),
            step_um_per_s=draw.choice((62_500, 100_001, 250_000, 0)),
            angular_step_urad_per_s=draw.choice((425_000, 1, 0)),
            max_velocity_mm_s=draw.choice((None, 0, 150, 9_999)),
            max_rotation_deg_s=draw.choice((None, 17, 0, 9_999)),
            pad_velocity_mm_s=draw.choice((400, 1_000)),
            pad_rotation_mrad_s=draw.choice((1_700, 5_000)),
        )
        mixer = Mixer(
            settings,
            full_steps=draw.choice((4, 8)),
            track_mm=draw.choice((357, 190)),
            max_velocity_mm_s=1_000,
            max_rotation_deg_s=draw.choice((100, 300)),
        )
        most = 1000 if settings.motor_command is MotorCommand.DUTY else 8
        found = [
            mixer.mix(a, b)
            for a, b in (
                (0, 0),
                (most, most),
                (-most, most),
                (most, -most),
                (1, 0),
                (0, -1),
                (draw.randint(-most, most), draw.randint(-most, most)),
            )
        ]
        found += [
            mixer.steer(a, b)
            for a, b in (
                (0, 0),
                (1023, 511),
                (-1023, 511),
                (1, 1),
                (draw.randint(-1023, 1023), draw.randint(-511, 511)),
            )
        ]
        speeds += found[-3:]
        yield said(
            [
                number,
                mixer.max_velocity_mm_s,
                mixer.max_rotation_deg_s,
                found,
                [mixer.wheels_mm_s(each) for each in found],
            ]
        )


def drivers(draw: random.Random) -> Iterator[str]:
    for _ in range(25):
        pacer, now = CommandPacer(spacing_ns=25, refresh_ns=200), 0
        pacer.begin(CommandedSpeeds(1, 2))
        for _ in range(12):
            now += draw.choice((0, 1, 24, 25, 199, 200))
            if draw.random() < 0.5:
                pacer.wanted = CommandedSpeeds(draw.choice((1, 2)), 2)
            due = pacer.due_at(now)
            took = pacer.take(now) if due <= now else None
            yield said([now, due, took, pacer.snapshot()])
        watch = SpeedPlausibility(timeout_ns=1_500_000_000, tolerance_mm_s=40, progress_mm_s=5)
        yield said([watch.snapshot(), watch.ends_at, CommandPacer(spacing_ns=25, refresh_ns=200).snapshot()])
        watch.begin(now)
        for _ in range(14):
            now += 100
            if draw.random() < 0.4:
                watch.expect(*draw.choice(((100, 100), (0, 0), (-50, 200))))
            left, right = watch.command
            off = draw.choice((0, 39, 40, 41, 60, 100, 95, 96, 55, 54))
            watch.take(left - off, right + draw.choice((0, off)), stalled=draw.random() < 0.1, now=now)
            yield said([watch.snapshot(), watch.ends_at, watch.describe()])
    for name in ("p2dx", "p3dx"):
        parameters = load_parameters(name)
        driver, session = Driver(AdapterSettings(), parameters, full_steps=4), Session(AdapterSettings())
        sent: list[object] = []
        session.send = lambda command, now, sent=sent: sent.append((command.name, command.argument, now))  # type: ignore[method-assign]
        driver.begin(CommandedSpeeds(100, 0), 5)
        for step in range(8):
            driver.want(CommandedSpeeds(100 + step // 2 * 10, step))
            yield said([driver.pair_due_at(step), driver.send_pair(session, step), sent, driver.sent])
            sent.clear()
            driver.take(
                StandardSip(
                    raw_left_velocity=100 * step,
                    raw_right_velocity=-77 * step,
                    stall_left=step == 5,
                    stall_right=step == 6,
                ),
                step,
            )
            yield said([driver.plausibility.snapshot(), driver.snapshot()])
        driver.stop()
        yield said(driver.snapshot())


def wheels(draw: random.Random) -> Iterator[str]:
    yield " ".join(
        str(sine(n))
        for n in (*range(-40, 8300, 53), 0, 1, 2047, 2048, 2049, 4095, 4096, 4097, 6143, 6144, 6145, 8191, 8192)
    )
    for dx, dy, before, turn in (
        (100, 0, 0, 0),
        (100, 50, 512, 3),
        (-70, 5, 4000, 200),
        (3, 900, 1024, 1023),
        (3, 900, 1024, 1024),
        (3, 900, 1024, 1025),
        (3, 900, 1024, -1025),
        (9, 9, -5, -1024),
    ):
        yield said([dx, dy, forward_step(dx, dy, before, before + turn)])
    for name in ("p2dx", "p3at", "p3dx"):
        parameters = load_parameters(name)
        geometry = EncoderGeometry.of(parameters, 350 * MS)
        yield said(
            [
                geometry,
                geometry.circumference_nm,
                [geometry.travel_nm_at(counts, 3) for counts in ((0, 0), (1, -1), (7, 8), (-9, 4))],
            ]
        )
        for at_open in EncoderAtOpen:
            codes = WheelCodes(
                AdapterSettings(encoder_at_open=at_open, encoder_dwell_ns=20),
                parameters,
                3,
                (draw.randrange(8), draw.randrange(8)),
            )
            x = y = heading = now = 0
            for _ in range(40):
                now += draw.choice((0, 1, 19, 20, 100))
                x, y = x + draw.choice((0, 3, 90, -60)), y + draw.choice((0, -4, 55))
                if draw.random() < 0.08:
                    x += draw.choice((9_000, codes.encoders._longest_counts, codes.encoders._longest_counts + 1))
                heading += draw.choice((0, 1, 40, -200, 1_100)) // codes._heading_scale
                did = draw.choice(("take", "take", "take", "open", "reset", "walk", "walk"))
                sip = StandardSip(
                    raw_x=x % 0x8000, raw_y=y % 0x8000, raw_heading=heading % parameters.angle_counts_per_turn
                )
                done = codes.take(sip) if did == "take" else codes.walk(now) if did == "walk" else getattr(codes, did)()
                yield said(
                    [
                        did,
                        done,
                        codes.counts,
                        codes.shown,
                        codes.encoders.travel_nm,
                        codes.encoders.jumps,
                        codes.due_at(now),
                        codes.snapshot(),
                    ]
                )
    walk = CodeWalk(20, 3)
    for target, now in ((3, 0), (5, 10), (5, 29), (5, 30), (5, 31), (4, 50), (4, 70), (-1, 90)):
        due = walk.due_at(target, now)
        walk.step(target, now)
        yield said([due, walk.snapshot()])
    for shown in range(-9, 10):
        walk.shown = shown
        walk.rebase(8)
        yield said(walk.shown)
    encoders = Encoders(EncoderGeometry.of(PARAMETERS, 350 * MS), 3)
    yield said([encoders.take(1, 2, 5000), encoders.snapshot(), encoders.counts])


def _move(draw: random.Random, masters: Masters, move: str, now: int) -> object:
    """Do something to the masters; return what they answer."""
    if move == "pad":
        report = PadReport(
            up=draw.random() < 0.4,
            down=draw.random() < 0.2,
            forward=draw.choice((0, 40, 41, 1023)),
            backward=draw.choice((0, 500)),
            turn=draw.choice((0, -512, 41, 511)),
        )
        return masters.take_pad(report, now)
    if move == "switch":
        masters.switch(draw.choice(tuple(Master)))
    elif move == "lose":
        return masters.lose_pad()
    elif move == "forget":
        masters.forget_request()
    elif move == "reset" and draw.random() < 0.3:
        masters.reset()
    return None


def inputs(draw: random.Random) -> Iterator[str]:
    for options in (
        {},
        {"motor_command": MotorCommand.DUTY, "sample_count": 3},
        {"bit_order": BitOrder.COMM1_MSB, "sample_count": 1, "connect_after_ns": 0, "disconnect_after_ns": 3},
    ):
        pins, now = FakePins(), 0
        settings = AdapterSettings(**options)  # type: ignore[arg-type]
        parts = Inputs(pins, PINOUT, settings)
        masters = Masters(
            parts,
            Mixer(settings, full_steps=4, track_mm=357, max_velocity_mm_s=1_000, max_rotation_deg_s=100),
            settings,
            Master.BLUEPILL,
        )
        yield said([sorted(parts.wires), sorted(parts.reset_wires), parts.motors])
        for _ in range(110):
            now += draw.choice((1, 2 * MS, 2 * MS, 10 * MS, 12 * MS))
            if draw.random() < 0.4:
                pins.set(draw.choice(sorted(parts.wires)), draw.random() < 0.5, now)
            quiet = parts.is_quiet(now)
            found = masters.sample(now)
            line = [
                quiet,
                found,
                parts.motors,
                parts.wants_robot,
                parts.is_reset(now),
                masters.wants_robot,
                masters.speeds,
                masters.connect_request,
                masters.pad_lost_at,
            ]
            move = draw.choice(("pad", "pad", "none", "switch", "lose", "forget", "reset"))
            line.append(_move(draw, masters, move, now))
            yield said([move, line, masters.master])


def windows(draw: random.Random) -> Iterator[str]:
    for kind in (Majority, Median):
        window = kind(5, 2)
        for _ in range(50):
            reading = (draw.choice((0, 1, 1, 7)), draw.choice((0, -2)))
            yield said([reading, window.take(reading), window.taken, window.is_settled])
        window.reset()
        yield said([window.taken, window.is_settled, window.at_rest])
    for high, low in ((10, 10), (0, 0), (5, 20)):
        level, now = Debounce(high, low), 0
        for _ in range(40):
            now += draw.choice((1, 4, 5, 10, 11, 20))
            yield said([now, level.take(draw.random() < 0.6, now), level.level, level.is_settled])
        level.reset()
        yield said(level.snapshot())


def clocks(draw: random.Random) -> Iterator[str]:
    for may, waits in ((True, True), (True, False), (False, True)):
        clock, now = SampleClock(20, may_suspend=may), 0
        clock.waits_for_edges = waits
        for _ in range(40):
            now += draw.choice((0, 1, 19, 20, 21, 55))
            what = draw.choice(("after", "was_quiet", "resume", "resume"))
            getattr(clock, what)(now)
            yield said([now, what, clock.next, clock.is_suspended, clock.due(now + 10)])
    for baud in (300, 9600, 38_400, 115_200, 1_000_000):
        receiver, now = Receiver(baud), 0
        yield said(
            [
                threshold(baud),
                receiver.due_at,
                receiver.first_sight(0),
                receiver.first_sight(MS - 1),
                receiver.first_sight(MS),
            ]
        )
        for step in range(40):
            now += draw.choice((0, 1, 16 * 10**9 // baud, MS, 999_999))
            if draw.random() < 0.7:
                receiver.arrive(bytes(draw.choice((1, 3, 11, 12, 64, 70))), now)
            if step == 20:
                receiver.restart(now + 7)
            yield said(
                [
                    now,
                    receiver.due_at,
                    [len(one) for one in receiver.take(now)],
                    receiver.snapshot()["_level"],
                    receiver.first_sight(now),
                ]
            )
    yield said([threshold(baud) for baud in (1, 9_999, 10_000, 19_999, 20_000, 639_999, 640_000, 10**7)])


def outputs(draw: random.Random) -> Iterator[str]:
    pins = FakePins()
    shown = Outputs(pins, PINOUT)
    yield said([shown.levels, released_codes(PINOUT), released_codes(parse_pinout(four_bits()))])
    for now in range(60):
        move = draw.choice(("safe", "release", "distances", "encoders", "encoders"))
        if move == "distances":
            shown.show_distances(tuple(draw.random() < 0.5 for _ in range(8)), now)
        elif move == "encoders":
            shown.show_encoders((draw.choice((0, 1, 7, 8, -1)), draw.choice((0, 5))), now)
        else:
            (shown.show_safe if move == "safe" else shown.release)(now)
        yield said([move, pins.writes, shown.levels])
        pins.writes.clear()
    held = Distances(4, threshold_um=600, stale_ns=100)
    for now in range(0, 900, 30):
        held.take(draw.choice((-1, 0, 1, 3, 4)), draw.choice((599, 600, 601)), now)
        if draw.random() < 0.5:
            held.expire(now + draw.choice((0, 70, 99, 100)))
        if draw.random() < 0.1:
            held.forget()
        yield said([held.levels, held.ranges_um, held.expires_at])
    yield said([threshold_um(wanted, PARAMETERS) for wanted in (None, 0, 7)])


def duties(draw: random.Random) -> Iterator[str]:
    for _ in range(30):
        meter, now = DutyMeter(25), 0
        for _ in range(25):
            now += draw.choice((0, 1, 3, 10, 24, 25, 26))
            if draw.random() < 0.6:
                meter.edge(draw.random() < 0.5, now)
            elif draw.random() < 0.1:
                meter.restart(draw.random() < 0.5)
            yield said([now, meter.duty(now), meter.snapshot()])
    for _ in range(40):
        wave = SimpleNamespace(
            ns=draw.choice((0, 500)),
            at=draw.choice((0, 3)),
            period=draw.choice((10, 7)),
            high=draw.choice((1, 3, 9)),
            ticks_hz=draw.choice((1_000_000, 72_000_000, 3)),
        )
        wave.level = lambda at_ns, wave=wave: (
            (wave.at + (at_ns - wave.ns) * wave.ticks_hz // 10**9) % wave.period < wave.high
        )
        rows = [(100, False), (700, True), (900, wave), (900 + draw.choice((5_000, 40_000)), draw.random() < 0.5)]

        def course(begin: int, end: int, rows: list[Any] = rows) -> list[Any]:
            before = [shown for at, shown in rows if at <= begin]
            return [(begin, before[-1] if before else False), *[(at, shown) for at, shown in rows if begin < at < end]]

        wire, now = DutyWire(course, timeout_ns=25_000), 0
        for _ in range(12):
            now += draw.choice((0, 100, 999, 5_000, 26_000, COURSE_NS, COURSE_NS + 1)[: draw.choice((5, 7))])
            yield said([now, wire.duty(now)])


def read_table(text: str) -> str:
    return tried(lambda: len(parse_pinout(text, "w").wires))


def setting(name: str, value: object) -> str:
    return tried(lambda: said(getattr(AdapterSettings(**{name: value}), name)))  # type: ignore[arg-type]


def pinouts(draw: random.Random) -> Iterator[str]:
    lines = PINOUT_TEXT.splitlines()
    yield said(load_pinout())
    yield said(
        [(one.name, [faults_of(PINOUT, one.name)]) for one in PINOUT.revisions]
        + [
            tried(faults_of, PINOUT, "x"),
            tried(PINOUT.wire, "x"),
            tried(PINOUT.value, "x"),
            list(Status),
            tried(load_pinout, "/no/such"),
        ]
    )
    yield said([[wire.name for wire in PINOUT.with_role(role)] for role in WireRole])
    places = [number for number, line in enumerate(lines) if "=" in line and not line.startswith("#")]
    for number in sorted(draw.sample(places, 45)):
        key = lines[number].partition("=")[0]
        for other in draw.sample(
            (
                None,
                "0",
                "1",
                "2",
                "-1",
                "33",
                '"PA0"',
                '"IO6"',
                '"none"',
                '"hold"',
                "true",
                "{ rev-b = 1 }",
                '"motor"',
                '"encoder1"',
                '"up"',
            ),
            2,
        ):
            changed = [*lines[:number], *([] if other is None else [f"{key}= {other}"]), *lines[number + 1 :]]
            yield f"{key.strip()}={other}: {read_table(chr(10).join(changed))}"
    for old, new in (
        ('"IO', '"HC595.Q'),
        ("rev-b =", "rev-z ="),
        ('"NC"', '"IO40"'),
        ('"NC"', '"EN"'),
        ("bit = 2", "bit = 1"),
        ("number = 8", "number = 9"),
        ('role = "connect"', 'role = "reset"'),
        ('side = "left"', 'side = "right"'),
        ("width = 3", "width = 2"),
        ('name = "encoder1"', 'name = "encoder3"'),
        ('shares = "', 'shares = "x'),
        ('name = "rev-c"', 'name = "rev-b"'),
        ('name = "p2os_rx"', 'name = "p2os_tx"'),
        ('name = "DD2"', 'name = "DD1"'),
        ('name = "motor2"\n', 'name = "motor1"\n'),
        ("rev-c =", "# rev-c ="),
        (", rev-c = ", "} # "),
        ('direction = "to_bluepill"', 'direction = "to_adapter"'),
        ('direction = "to_adapter"', 'direction = "to_bluepill"'),
        ('bluepill = "PA', 'bluepill = "PD'),
        ('bluepill = "PA1"', 'bluepill = "PA0"'),
        ('pull = "down"', 'pull = "up"'),
        ("safe = 0", "safe = 2"),
        ("safe = 0", "safe = true"),
        ('default_revision = "rev-', 'default_revision = "rev-x'),
    ):
        yield f"{old} {new}: {read_table(PINOUT_TEXT.replace(old, new))}"
    for wire in PINOUT.wires[::2]:
        for pin in (
            "IO0",
            "IO2",
            "IO5",
            "IO6",
            "IO11",
            "IO12",
            "IO15",
            "IO16",
            "IO31",
            "IO32",
            "IO33",
            "IO34",
            "IO39",
            "EN",
            "HC595.QA",
            None,
        ):
            other = replace(wire, esp32=tuple((name, pin) for name, _ in wire.esp32))
            table = replace(PINOUT, wires=tuple(other if one.name == wire.name else one for one in PINOUT.wires))
            yield f"{wire.name} {pin} {said(faults_of(table, 'rev-c'))}"


def settings(draw: random.Random) -> Iterator[str]:
    usual = AdapterSettings()
    yield said(usual)
    for name in usual.__dataclass_fields__:
        for value in (-1, 0, 1, 2, True, "x", 1.5, None):
            yield f"{name} {value!r}: {setting(name, value)}"
    for given in (
        {"pad_trigger_dead": 1022},
        {"pad_trigger_dead": 1023},
        {"pad_stick_dead": 510},
        {"pad_stick_dead": 511},
        {"pair_spacing_ns": 200 * MS},
        {"pair_spacing_ns": 200 * MS + 1},
        {"refresh_ns": 25 * MS - 1},
        {"sample_count": 4},
        {"bauds": ()},
        {"bauds": [1] * 8},
        {"bauds": [1] * 9},
        {"bauds": (0,)},
        {"bauds": (True,)},
        {"bauds": 9600},
        {"motor_meaning": "wheels"},
        {"bit_order": "z"},
    ):
        yield f"{given}: {tried(lambda each: said(AdapterSettings(**each)), given)}"


#: What a robot answers to SYNC0, 1 and 2, a SIP, and bytes that are none of these.
ANSWERS = (
    *(Frame(bytes((kind,))).to_bytes() for kind in (0, 1)),
    Identity("Name", "Pioneer", "p2dx").to_frame().to_bytes(),
    Identity("", "Pioneer", "").to_frame().to_bytes(),
    StandardSip(raw_x=3).to_frame(Profile.P2OS).to_bytes(),
    b"\xfa\xfb",
)


def _moves(draw: random.Random, session: Session, repeater: StopRepeater, now: int) -> dict[str, Callable[[], object]]:
    return {
        "begin": lambda: repeater.begin(session, now),
        "end": repeater.end_on_request,
        "cancel": repeater.cancel,
        "repeat": lambda: repeater.repeat(session, now),
        "bytes": lambda: repeater.note_bytes(now),
        "connect": lambda: tried(session.connect, now),
        "advance": lambda: session.advance_to(now),
        "send": lambda: tried(session.send, vel(300), now),
        "receive": lambda: session.receive(draw.choice(ANSWERS), now),
        "drop": lambda: session.drop(now),
        "unknown": session.stop_unknown,
        "forget": session.forget,
        "abandon": lambda: session.abandon(now),
    }


def stops(draw: random.Random) -> Iterator[str]:
    for options in ({}, {"stop_repeats": 0}, {"stop_unknown_robot": False, "stop_repeat_ns": 50 * MS}):
        made = AdapterSettings(**options)  # type: ignore[arg-type]
        session, repeater, now = Session(made), StopRepeater(made), 0
        for _ in range(45):
            now += draw.choice((1, 50 * MS, 100 * MS - 1, 100 * MS, 200 * MS - 1, 200 * MS, 700 * MS))
            what = draw.choice((*_moves(draw, session, repeater, now), "repeat", "repeat", "receive"))
            _moves(draw, session, repeater, now)[what]()
            yield said(
                [
                    what,
                    repeater.due_at,
                    repeater.snapshot(),
                    [frame.hex() for frame in session.take_output()],
                    session.next_deadline(),
                    session.take_events(),
                ]
            )


def sessions(draw: random.Random) -> Iterator[str]:
    """Sessions with a robot that answers, some of the time."""
    for deaf in (0.0, 0.0, 0.3):
        session, robot, now = Session(AdapterSettings(pulse_ns=300 * MS)), FakeRobot(), 0
        session.connect(now)
        for step in range(60):
            now += draw.choice((10, 40, 100, 349, 350)) * MS
            sent = session.take_output()
            for frame in sent:
                if draw.random() >= deaf:
                    robot.receive(frame, now)
            robot.advance_to(now)
            for frame in robot.take_output():
                session.receive(frame, now)
            session.advance_to(now)
            if step % 7 == 6:
                sent.append(tried(session.send, vel(step), now).encode())
            events = [
                type(event).__name__ if isinstance(event, StandardSip) else event for event in session.take_events()
            ]
            if step in {30, 45}:
                session.abandon(now)
                session.connect(now + 1)
            yield said([now, [frame.hex() for frame in sent], events, session.next_deadline(), session.stats])


def _acts(draw: random.Random, rig: Rig, robot: FakeRobot) -> dict[str, Callable[[], object]]:
    adapter, now = rig.adapter, rig.now
    level = draw.random() < 0.5
    x_mm, echo = draw.choice((0, 5, 40, 9_000)), SonarReading(draw.randint(0, 9), draw.choice((0, 599, 600, 3_000)))
    moved = replace(
        robot.sip, raw_x=(robot.sip.raw_x + x_mm) % 0x8000, stall_left=draw.random() < 0.1, sonar=(echo,) * level,
        raw_heading=draw.choice((0, robot.sip.raw_heading, 700)),
    )  # fmt: skip
    report = PadReport(
        up=draw.random() < 0.5, down=draw.random() < 0.15, forward=draw.choice((0, 41, 1_023)),
        backward=draw.choice((0, 500)), turn=draw.choice((0, -512, 300)),
    )  # fmt: skip
    return {
        "motors": lambda: rig.pins.motors(draw.randint(-4, 3), draw.randint(-4, 3), now),
        "connect": lambda: rig.pins.set("p2dx_con", draw.random() < 0.8, now),
        "reset": lambda: rig.pins.set("rst", level and draw.random() < 0.3, now),
        "glitch": lambda: [
            rig.pins.set("p2dx_con", high, at) for high, at in ((level, now), (not level, now + 3 * MS))
        ],
        "move": lambda: setattr(robot, "sip", moved),
        "SIP": lambda: adapter.receive(moved.to_frame(Profile.P2OS).to_bytes(), now) if robot.connection.is_open else 0,
        "noise": lambda: adapter.receive(draw.choice((b"", b"\xfa\xfb\3", bytes(9))), now),
        "pad": lambda: adapter.receive_pad(report, now),
        "master": lambda: adapter.set_master(draw.choice(tuple(Master)), now) if level else None,
        "shutdown": lambda: adapter.shutdown("asked", now) if draw.random() < 0.2 else None,
        "obeys": lambda: setattr(robot, "obeys", draw.random() < 0.7),
        "sends": lambda: setattr(robot, "sends", draw.random() < 0.7),
        "cut": lambda: setattr(rig.to_robot, "cut", draw.random() < 0.3),
        "restore": lambda: adapter.restore(adapter.snapshot()),
    }


def adapters(draw: random.Random) -> Iterator[str]:
    """Whole adapters between a robot and wires that do anything: what they show, send, say and keep."""
    for number, options in enumerate((
        {}, {"motor_command": MotorCommand.DUTY, "encoder_at_open": EncoderAtOpen.ZERO, "encoder_dwell_ns": 0},
        {"bauds": (9_600, 38_400), "pad_loss_ns": 300 * MS, "stop_repeats": 1, "boot_ns": 0},
        {"motor_meaning": MotorMeaning.LINEAR_ANGULAR, "max_velocity_mm_s": 150, "plausibility_ns": 500 * MS},
    )):  # fmt: skip
        robot = FakeRobot()
        rig = Rig(
            AdapterSettings(threshold_um=600_000, **options), robot,  # type: ignore[arg-type]  # of each setting its own
            pinout=PINOUT if number < 3 else parse_pinout(four_bits()), now=number,
            receiver=Receiver(9_600) if number == 2 else None,
        )  # fmt: skip
        adapter = rig.adapter
        if number == 1:
            adapter.wait_for_edges()
        rig.ms(310)
        rig.pins.set("p2dx_con", True, rig.now)
        rig.ms(700)
        for step in range(70):
            acts = _acts(draw, rig, robot)
            if step % 9 == 8:
                rig.to_robot.cut, robot.obeys, robot.sends = False, True, True
                rig.pins.set("rst", False, rig.now)
                rig.pins.set("p2dx_con", step % 2 == 0, rig.now)
            what = draw.choice((*acts, "motors", "motors", "move", "SIP", "pad"))
            acts[what]()
            yield said([what, adapter.status, adapter.next_deadline(), adapter.first_sight(rig.now)])
            before = rig.now
            rig.ms(draw.choice((0, 1, 2, 9, 60, 100, 240, 351)))
            yield said([rig.now, adapter.status, adapter.master, adapter.baud, sorted(adapter.wakes_on), rig.events])
            kept = zlib.crc32(said(adapter.snapshot()).encode())
            yield said([rig.pins.writes, rig.sent(before), adapter.next_deadline(), kept])
            rig.events.clear()
            rig.pins.writes.clear()


TRACES: dict[str, Trace] = {
    "codec": codec,
    "mixes": mixes,
    "drivers": drivers,
    "wheels": wheels,
    "inputs": inputs,
    "windows": windows,
    "clocks": clocks,
    "outputs": outputs,
    "duties": duties,
    "pinouts": pinouts,
    "settings": settings,
    "stops": stops,
    "sessions": sessions,
    "adapters": adapters,
    "declared": declared_of("adapter_sim"),
}
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
