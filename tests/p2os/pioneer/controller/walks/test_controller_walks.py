"""Clients and operators that do anything to a robot of each firmware: bytes, events and state, as approved."""

import math
import random
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from p2os.pioneer.body.contract import free_wheels
from p2os.pioneer.body.factory import make_body
from p2os.pioneer.controller import ControllerSettings, Pioneer
from p2os.pioneer.controller.bumper_watch import _middle, _touched, stalls
from p2os.pioneer.controller.dead_reckoning import DeadReckoning, raw_angle
from p2os.pioneer.controller.faults import FAULTS, Faults, read_fault
from p2os.pioneer.controller.flash import DEFAULTS, RANGES, FlashParameters, load_flash
from p2os.pioneer.controller.live_inputs import INPUTS
from p2os.pioneer.controller.motion import Motion, MotionLimits
from p2os.pioneer.controller.settings import LONGEST_SIP_PERIOD_MS, SonarPerSip
from p2os.pioneer.devices.laser import LaserModel
from p2os.pioneer.random_source import RandomSource
from p2os.pioneer.sensor_errors import REALISTIC
from p2os.pioneer.world.loader import load_world
from p2os.protocol.command_table import BY_NUMBER, Argument
from p2os.protocol.commands import Command
from p2os.protocol.commands import CommandNumber as C
from p2os.protocol.profiles import Profile
from p2os.robots.parameters import load_parameters
from simbase.timing import NS_PER_MS
from tests.tools.suite.approved import Trace, judge_of, said, tried
from tests.tools.suite.declared import declared_of

LASER = LaserModel(start_deg=-20, end_deg=20, step_cdeg=200, range_m=8.0)
#: What moves the robot, and is said more often than the rest.
DRIVES = (C.VEL, C.RVEL, C.VEL2, C.MOVE, C.HEAD, C.DHEAD, C.ENABLE, C.ROTATE, C.STOP)
ENDS = (C.CLOSE, C.MAINTENANCE, C.SIM_EXIT, C.RESET)


def every_command(draw: random.Random) -> list[Command]:
    """Return each command with the ends of its range, with what is small, and a few that end a session; shuffled."""
    found = []
    for row in BY_NUMBER.values():
        if row.number in ENDS:
            continue
        for kind in row.kinds:
            if kind is Argument.NONE:
                found.append(Command(row.number))
                continue
            least, most = row.limits(kind)
            if kind in {Argument.STRING, Argument.DATA}:
                found += [Command(row.number, draw.randbytes(size)) for size in {least, min(most, 3), min(most, 20)}]
            else:
                values = {least, most, *(value for value in (0, 1, 2, draw.randint(3, 300)) if least < value < most)}
                found += [Command(row.number, value) for value in sorted(values)]
    draw.shuffle(found)
    return found


def drive(draw: random.Random) -> Command:
    number = draw.choice(DRIVES)
    value = {C.VEL2: draw.choice((0x1010, 0x0810, 0xF010, 0x1000)), C.ENABLE: 1}.get(number, draw.randint(-400, 400))
    return Command(number, None if number is C.STOP else value)


def drawn_words(draw: random.Random) -> str:
    """Return what an operator says: a fault that begins or ends, or an input."""
    word = {
        "NUMBER": str(draw.randint(1, 9)), "METRES": draw.choice(("0.5", "1", "101")),
        "SIDE": draw.choice(("left", "front")), "RATE": draw.choice(("0.001", "0.6")),
        "VOLTS": draw.choice(("10.5", "11.9")), "SEGMENT": str(draw.randint(0, 6)),
        "X": str(draw.choice((0, 512, 1023))), "Y": str(draw.choice((0, 800, 1024))),
        "BUTTON": draw.choice(("0", "1", "2")), "PORT": str(draw.randint(0, 10)),
        "RAW": str(draw.choice((0, 700, 1023))), "BYTE": str(draw.choice((0, 129, 256))),
        "ON_OFF": draw.choice(("on", "off", "on", "maybe")),
    }  # fmt: skip
    if draw.random() < 0.5:
        name = draw.choice([*INPUTS])
        return " ".join([name, *(word[each] for each in INPUTS[name][0])])
    name = draw.choice([*FAULTS])
    words = [word[each] for each in FAULTS[name][0]][: draw.choice((0, 2, 2, 2))]
    return " ".join([draw.choice(("fault", "clear")), name, *words])


def life(  # noqa: C901 - a table of acts
    draw: random.Random, model: str, settings: ControllerSettings, steps: int, each: int, world: str = "room"
) -> Iterator[str]:
    """Yield what a robot shows of a client that says what it likes, and of an operator."""
    parameters, events = load_parameters(model), list[str]()
    body = make_body("kinematic", load_world(world, seed=3), parameters)
    pioneer = Pioneer(
        parameters=parameters, body=body, settings=settings,
        on_event=lambda now, what, detail: events.append(f"{now} {what} {detail}"),
    )  # fmt: skip
    now, waiting = 0, every_command(draw)
    for number in range(steps):
        said_now = [*waiting[number * each : (number + 1) * each], drive(draw)]
        if not pioneer.state.open:
            said_now = [*map(Command, (0, 1, 2, C.OPEN)), *said_now]
        if not pioneer.state.motors_enabled:
            said_now.append(Command(C.ENABLE, 1))
        if number % 40 == 39:
            said_now.append(Command(draw.choice([*ENDS])))
        for command in said_now:
            pioneer.receive(command.to_frame().to_bytes(), now)
        match draw.randrange(9):
            case 0 | 1:
                yield tried(pioneer.do, drawn_words(draw), now)
            case 2:
                pioneer.receive_aux(port := draw.randint(1, 3), draw.randbytes(6), now)
                yield pioneer.take_aux_output(port).hex()
            case 3:
                pioneer.restore(pioneer.snapshot())
            case 4 if number % 3 == 0:
                pioneer.receive(draw.randbytes(9), now)
            case 5 if number % 5 == 0:
                pioneer.hang_up(now)
            case 6 if number % 5 == 0:
                pioneer.count_silence(700 * NS_PER_MS, now)
        now += draw.choice((7, 30, 100, 100, 100, 230, 700)) * NS_PER_MS
        pioneer.advance_to(now)
        yield " ".join([f"{now} due {pioneer.next_deadline()}", *(frame.hex() for frame in pioneer.take_output())])
        yield said((pioneer.state, pioneer.stats, pioneer.exit_code, body.state, events))
        events.clear()


def plain(draw: random.Random) -> Iterator[str]:
    for profile, model in zip(Profile, ("p2dx", "p2at8", "p3dx-sh"), strict=True):
        yield from life(draw, model, ControllerSettings(profile=profile, seed=1), 80, 6)


def erring(draw: random.Random) -> Iterator[str]:
    for profile, model in zip(Profile, ("p2de", "peoplebot-sh", "p3at"), strict=True):
        chosen = ControllerSettings(
            profile=profile, errors=REALISTIC, baud=draw.choice((9600, 19200)), seed=2, battery_decivolts=118,
            sonar_per_sip=SonarPerSip.ALL, rear_sonar=True, watchdog_ns=600 * NS_PER_MS,
        )  # fmt: skip
        yield from life(draw, model, chosen, 32, 11)


def simulated(draw: random.Random) -> Iterator[str]:
    chosen = replace(ControllerSettings.for_client("aria"), laser=LASER, lenient=True)
    for model in ("p3dx", "amigo-sh"):
        yield from life(draw, model, chosen, 32, 11)


def crowded(draw: random.Random) -> Iterator[str]:
    """Yield lives among things that are run into, of robots with bumpers and stalls."""
    for model, world in (("p3at-sh", "maze"), ("powerbot", "office"), ("amigo", "arena")):
        chosen = ControllerSettings(seed=5, sonar_per_sip=SonarPerSip.ALL)
        yield from life(draw, model, chosen, 40, 5, world)


def bumped(draw: random.Random) -> Iterator[str]:
    """Yield what a pressed bumper does to each way, by each policy; and a test of the battery that a fault ends."""
    parameters = load_parameters("p3at-sh")
    for policy in range(4):
        for side in ("front", "rear"):
            for speed in (200, 0, -200):
                body = make_body("kinematic", load_world("room"), parameters)
                pioneer = Pioneer(parameters=parameters, body=body, settings=ControllerSettings())
                opens = ((0, None), (1, None), (2, None), (C.OPEN, None), (C.ENABLE, 1))
                for number, value in (*opens, (C.BUMPSTALL, policy), (C.VEL, speed)):
                    pioneer.receive(Command(number, value).to_frame().to_bytes(), 0)
                pioneer.advance_to(250 * NS_PER_MS)
                pioneer.do(f"fault bumper {side} 3", 250 * NS_PER_MS)
                for now_ms in (260, 271, 300, 480):
                    pioneer.advance_to(now_ms * NS_PER_MS)
                    yield said((policy, side, speed, now_ms, pioneer.state, pioneer.next_deadline()))
                yield b"".join(pioneer.take_output())[-40:].hex()
                until = pioneer._context.bumper_watch.stalled_until
                yield said([until, *(stalls(pioneer._context, body.state, until + by) for by in (-1, 0, 1))])
    for number, value in ((C.BATTEST, 110), (C.PULSE, None)):
        for words in ("fault low-battery 10.5", "clear low-battery", "fault low-battery 11"):
            pioneer.receive(Command(number, value).to_frame().to_bytes(), 480 * NS_PER_MS)
            yield said((pioneer.state.injected, tried(pioneer.do, words, 480 * NS_PER_MS), pioneer.state.injected))
            yield said(pioneer.state.battery_v)


def _note(events: list[str], now: int, what: str, detail: str) -> None:
    events.append(f"{now} {what} {detail}")


def kinds(draw: random.Random) -> Iterator[str]:
    """Yield what becomes of each command with each kind of argument, whether it is its own or not."""
    for model, profile in (("p2dx", Profile.P2OS), ("p3at-sh", Profile.ARCOS)):
        events: list[str] = []
        parameters, body = load_parameters(model), make_body("kinematic", load_world("room"), load_parameters(model))
        chosen = ControllerSettings(profile=profile, laser=LASER, lenient=model == "p2dx")
        pioneer = Pioneer(
            parameters=parameters, body=body, settings=chosen,
            on_event=partial(_note, events),
        )  # fmt: skip
        now = 0
        for number in sorted({*BY_NUMBER} - {*ENDS}):
            for argument in (None, 5, -1, b"", b"ab", b"\1\3\x80"):
                if not pioneer.state.open:
                    for each in (0, 1, 2, C.OPEN):
                        pioneer.receive(Command(each).to_frame().to_bytes(), now)
                pioneer.receive(Command(number, argument).to_frame().to_bytes(), now)
                now += draw.choice((0, 5, 30)) * NS_PER_MS
                pioneer.advance_to(now)
                sent = b"".join(frame for frame in pioneer.take_output())
                yield said((number, argument, events, sent.hex(), pioneer.state, pioneer.stats))
                events.clear()
        for size in (1, 2, 39, 40, 41, 42, 43, 60):
            pioneer.receive(Command(C.SAY, bytes(range(1, size + 1))).to_frame().to_bytes(), now)
            pioneer.advance_to(now)
            yield said((size, events))
            events.clear()


def tables(draw: random.Random) -> Iterator[str]:  # noqa: C901, PLR0912 - a table after the other
    """Yield FLASH, settings, faults and inputs at the ends of what each may be."""
    p2dx = load_parameters("p2dx")
    yield said((RANGES, DEFAULTS, FlashParameters().baud(), ControllerSettings()))
    for name, limits in [*RANGES.items(), ("nme", (0, 1)), ("subclass", (0, 1))]:
        for value in (limits[0] - 1, limits[0], limits[1], limits[1] + 1, True, 1.5, "2"):
            yield tried(lambda name=name, value=value: FlashParameters().with_values({name: value}).values)
    for text in ("Wilma", "a" * 300, "é", ""):
        yield tried(lambda text=text: FlashParameters().with_values({"name": text, "serial": text}).text("name"))
    with TemporaryDirectory() as folder:
        path = Path(folder, "f.toml")
        for text in ("[flash]", '[flash]\nname = "W"\nsipcycle = 50', "[flash]\n[other]", "[other]", "x = 1",
                     "flash = 1", "[flash]\nnme = 1", "[flash]\n\nsipcycle = 0", "[[flash]]", "[flash"):  # fmt: skip
            path.write_text(text)
            yield tried(load_flash, path).replace(folder, "")
        yield tried(load_flash, Path(folder, "none")).replace(folder, "")
    for model in ("p2dx", "p3at-sh", "amigo", "powerbot"):
        parameters = load_parameters(model)
        flash = FlashParameters().with_values({"sipcycle": 50, "watchdog": 900, "name": "W", "hostbaud": 2})
        yield said(flash.for_model(parameters))
        for profile in Profile:
            yield said(flash.config(parameters, profile))
        yield said([ControllerSettings(profile=profile).family_of(parameters) for profile in (None, Profile.AROS)])
    given: list[dict[str, Any]] = [
        {}, {"client": "aria"}, {"client": "x"}, {"client": "aria", "firmware": Profile.AROS, "lenient": False,
        "rear_sonar": False},
        {"firmware": Profile.P2OS, "lenient": True, "laser": LASER, "all_sonar": True, "rear_sonar": True,
        "baud": 9600},
        {"client": "aria", "laser": LASER, "baud": 1}, {"flash": flash}, {"errors": REALISTIC, "client": "aria",
        "flash": flash},
    ]  # fmt: skip
    for options in given:
        yield tried(ControllerSettings.of, **options)
    for key, values in {
        "sip_period_ns": (999_999, 1_000_000, LONGEST_SIP_PERIOD_MS * NS_PER_MS, LONGEST_SIP_PERIOD_MS * NS_PER_MS + 1),
        "battery_decivolts": (-1, 0, 255, 256), "baud": (None, 9600, 9601),
    }.items():  # fmt: skip
        yield said(
            [tried(lambda key=key, value=value: getattr(ControllerSettings(**{key: value}), key)) for value in values]
        )
    texts = ["sonar-stuck 1 0", "sonar-stuck 8 100", "sonar-stuck 9 1", "sonar-stuck 0 1", "sonar-stuck 1 100.1",
    "sonar-stuck 1 -0.1",
             "sonar-noisy 2 0.5", "sonar-dead 3", "sonar-dead 3 1", "wheel-blocked left", "wheel-blocked front",
             "line-noise 0.5",
             "line-noise 0.51", "low-battery 25.5", "low-battery 25.6", "bumper rear 7", "bumper rear 8",
             "bumper left 1", "", "x",
             "sonar-ded 3", "reboot now", "sonar-stuck 1.5 1", "sonar-stuck +1 1"]  # fmt: skip
    for text in texts:
        yield said([tried(read_fault, text, sonar=8, complete=complete) for complete in (True, False)])
        yield tried(lambda text=text: read_fault(text, sonar=8).text)
    words = {"X": ("0", "1023", "1024"), "BUTTON": ("0", "1", "2"), "PORT": ("0", "1", "9", "10"), "RAW": ("0",
    "1023", "1024"),
             "BYTE": ("0", "255", "256"), "ON_OFF": ("on", "off", "1")}  # fmt: skip
    body = make_body("kinematic", load_world("room"), p2dx)
    pioneer = Pioneer(parameters=p2dx, body=body, settings=ControllerSettings())
    for name, (needed, _) in INPUTS.items():
        for number in range(4):
            several = [words["X" if word == "Y" else word] for word in needed]
            each = [one[number % len(one)] for one in several]
            yield f"{name} {each} {tried(pioneer.do, ' '.join([name, *each]), number)}"
    for rate, is_loose in ((0.0, False), (0.05, False), (0.5, True), (0.0, True)):
        faults, stream = Faults(bit_error_rate=rate, is_loose=is_loose), RandomSource(4)
        yield said([faults.corrupt(bytes(range(90)), stream, to_robot=way).hex() for way in (True, False, True)])
        yield said(faults.corrupts_line)
        yield said((faults.gap_in, faults.gap_out))
    for angle in (-9.0, -math.pi, -math.pi / 2, 0.0, 1e-3, math.pi - 1e-3, math.pi, 7.0):
        yield said([raw_angle(angle, counts) for counts in (4096, 360)])
    reckoning = DeadReckoning(wheel_diameter_m=0.165, track_mm=330, left_wheel=1.01, right_wheel=0.99, track=1.02)
    yield said(vars(DeadReckoning(wheel_diameter_m=0.2, track_mm=400)))
    for bearing in (-1.58, -1.57, -1.0, -0.1, 0.0, 0.1, 0.7, 1.57, 1.58, 3.0):
        yield said([_touched(segments, bearing) for segments in (0, 1, 5, 7)])
    yield said([_middle(segments) for segments in (0, 1, 5, 6)])
    left = right = 0.0
    for number in range(12):
        left, right = left + draw.choice((0.0, 0.3, -0.1)), right + draw.choice((0.0, 0.2))
        reckoning.follow([free_wheels(left, right)] * 2)
        if number % 5 == 4:
            reckoning.set_origin()
            reckoning.drift(0.01)
        yield said((vars(reckoning), reckoning.heading_rad, reckoning.zero_rad, reckoning.raw_position(485_000)))


def ramps(draw: random.Random) -> Iterator[str]:  # noqa: C901, PLR0912 - a table of acts
    """Yield set-points step by step, of speeds, wheels and goals, with what changes them on the way."""
    for model, dt_ns in (("p2dx", 5 * NS_PER_MS), ("p3at-sh", NS_PER_MS // 2), ("amigo", 20 * NS_PER_MS)):
        parameters = load_parameters(model)
        motion = Motion(MotionLimits.of(parameters), track_mm=parameters.track_mm, dt_ns=dt_ns)
        travel = heading = 0
        for number in range(160):
            value, other = draw.choice((0, 1, 100, -250, 400, 9999)), draw.choice((0, -1, 30, -90, 200, 9999))
            match draw.randrange(18):
                case 0 | 1:
                    motion.set_velocity(value)
                case 2 | 3:
                    motion.set_rotation(other)
                case 4:
                    motion.set_wheels(value, other)
                case 5:
                    motion.set_wheels_as_turn(value, other)
                case 6:
                    motion.move_to(travel + draw.choice((0, 1_999_999, 2_000_000, -2_000_001, 40_000_000, -90_000_000)))
                case 7:
                    motion.turn_to(
                        heading + draw.choice((0, 499_999, 500_001, -500_000, 40_000_000, 180_000_000, -200_000_000))
                    )
                case 8:
                    draw.choice((motion.stop, motion.stop, motion.stop_now, motion.ramp_from_zero))()
                case 9:
                    motion.power(on=draw.random() < 0.5)
                case 10:
                    draw.choice((motion.hold, motion.release))()
                case 11:
                    changes = (motion.limits.with_max_velocity, motion.limits.with_max_rotation,
                               motion.limits.with_acceleration, motion.limits.with_rotational_acceleration)  # fmt: skip
                    motion.limits = draw.choice(changes)(draw.choice((300, -200, 0, 50, 9999)) if number < 120 else 100)
                case 12:
                    motion.restore(motion.snapshot())
                case 13 if not motion.has_goal:
                    yield said(motion.ramp(draw.choice((0, 1, 7))))
            if number % 12 == 0:
                motion.power(on=True)
                motion.release()
            seen: list[object] = []
            for _ in range(draw.choice((1, 2, 9))):
                left, right = motion.step(travel, heading)
                travel += round((left + right) / 2 * dt_ns)
                heading += round((right - left) / parameters.track_mm * 180 / math.pi * dt_ns)
                seen.append(said((motion.wheels_mps, motion._first, motion._second, motion.is_steady)))
            yield said((seen, motion.mode, motion.setpoints, motion.has_goal, motion.heading_goal_udeg, motion.limits))


TRACES: dict[str, Trace] = {
    each.__name__: each for each in (plain, erring, simulated, crowded, bumped, kinds, tables, ramps)
}
TRACES["declared"] = declared_of("p2os.pioneer.controller")
test_what_was_approved_is_shown = judge_of(__file__, TRACES)
