"""Devices, the sonar ring and what errs, each driven by itself over all that it can be told, as approved."""

import random
from collections.abc import Iterator, Sequence
from dataclasses import fields
from pathlib import Path
from tempfile import TemporaryDirectory

from p2os.pioneer.devices.aux_ports import AuxPort
from p2os.pioneer.devices.battery import CAPACITY_C, Battery
from p2os.pioneer.devices.fitted import Devices
from p2os.pioneer.devices.gripper import CARRY, LIFT_NS, MOVES, PADDLES_NS, PRESSURE, Travel, VirtualGripper
from p2os.pioneer.devices.heading_sensors import Compass, CompassMode, Gyro
from p2os.pioneer.devices.joystick import Joystick
from p2os.pioneer.devices.laser import LASERS, Laser, LaserModel, read_laser
from p2os.pioneer.devices.pins import Pins
from p2os.pioneer.random_source import RandomSource
from p2os.pioneer.sensor_errors import RANGES, SETS, SensorErrors, SonarErrors, load_sensor_errors, parse_sensor_errors
from p2os.pioneer.sonar.cross_talk import KEPT_NS, SOUND_MPS, PingTable
from p2os.pioneer.sonar.errors import measure_ranges
from p2os.pioneer.sonar.ring import cones, eyes, reading
from p2os.pioneer.sonar.schedule import SonarSchedule, raw_range
from p2os.protocol.profiles import Profile
from p2os.robots.parameters import load_parameters
from simbase.timing import NS_PER_MS, NS_PER_S
from tests.tools.suite.approved import Trace, judge_of, said, tried
from tests.tools.suite.declared import declared_of

AROUND = (-1, 0, 1)


def gripper(draw: random.Random) -> Iterator[str]:
    yield said([VirtualGripper(), Devices().gripper, Travel(5)])
    for kind in (0, 1, 2):
        one, devices, now = VirtualGripper(kind=kind), Devices(), 0
        devices.gripper = one
        for number in [*range(19), *draw.choices([*MOVES, PRESSURE, CARRY], k=40)]:
            one.value = draw.choice((-3, 0, 1, 2, 150, 200, 300))
            one.has_thing = draw.random() < 0.3
            one.command(number, now)
            ends = (1, one.value * 20 * NS_PER_MS, PADDLES_NS // 2, PADDLES_NS, LIFT_NS)
            for wait in sorted({end + by for end in ends for by in AROUND if end + by > 0}):
                yield said(
                    (now + wait, int(one.state(now + wait)), one.lift.moving(now + wait), one.paddles.at(now + wait))
                )
            now += draw.choice((10, 200, 700, 1500, 3000)) * NS_PER_MS
            yield said((one, one.packet(now), devices.digital_in(now)))


def laser_texts() -> Iterator[str]:
    for text in (
        *LASERS, "LMS2XX", "lms", "180deg,1deg,8m", "180deg,1deg", "180deg,1deg,8m,1", "x,1deg,8m", "360deg,1deg,8m",
        "361deg,1deg,8m", "364deg,1deg,8m", "10deg,0.01deg,8m", "10deg,0.004deg,8m", "270deg,0.25deg,65.535m",
        "272deg,0.25deg,8m", "2deg,1deg,65.54m", "2deg,1deg,0m", "0deg,1deg,1m", "3deg,1deg,1m", "1deg,180deg,1m",
    ):  # fmt: skip
        yield tried(read_laser, text)


def lasers(draw: random.Random) -> Iterator[str]:
    yield from laser_texts()
    for start, end, step in ((-181, 0, 1), (-180, 180, 100), (-180, 181, 100), (5, 5, 1), (6, 5, 1), (0, 1, 101)):
        yield tried(
            lambda s=start, e=end, c=step: LaserModel(start_deg=s, end_deg=e, step_cdeg=c, range_m=1.0).readings
        )
    yield said([Laser(), Laser.of(None), Laser.of(None).range_m, Laser.of(None).is_fitted])
    for name, model in LASERS.items():
        yield said((name, model, model.readings))
        one = Laser.of(model)
        yield said((one, one.range_m, one.is_fitted))
        for ask, value in (
            ("set_start", -200), ("set_start", -180), ("set_start", -7), ("set_end", 200), ("set_end", 8),
            ("set_step", 0), ("set_step", -1), ("set_step", 1), ("set_step", 70), ("set_end", -20), ("set_end", 179),
            ("set_start", -180), ("set_step", 20),
        ):  # fmt: skip
            getattr(one, ask)(value)
            cone = one.fan(150, -20)
            yield said((ask, value, one, len(cone.headings_rad), cone.x_m, cone.y_m))
            yield said((cone.headings_rad[-3:], cone.directions[:2]))
        one.set_start(-1)
        for count in (0, 1, 31, 32, 33, 65):
            one.mode, one.has_jumped = draw.choice((1, 2)), draw.random() < 0.6
            pose = draw.uniform(-40000, 40000), 32768.0, draw.choice((-32769.0, 359.6))
            yield said((one.packets([0.0004 + number / 7 for number in range(count)], pose), one.has_jumped))


def headings(draw: random.Random) -> Iterator[str]:
    one = Compass()
    yield said((one, one.is_due(0), one.is_due(-1), [*CompassMode]))
    for value in range(9):
        for one in (Compass(), Compass(mode=CompassMode.CONTINUOUS), Compass(is_fitted=False)):
            one.command(value)
            one.read(draw.uniform(-7, 7), draw.uniform(-1, 1), draw.choice((0.0, 3.0)), 5 * NS_PER_S)
            yield said((one, one.raw_compass, one.packet(), [one.is_due(5200 * NS_PER_MS + by) for by in AROUND]))
    for heading in (0.0, 1.0, 1.01, 2.99, 3.0, 358.9, 359.0, 359.94, 359.96):
        one = Compass(mode=CompassMode.IN_SIP, heading_deg=heading)
        yield said((heading, one.raw_compass, one.packet()))
    for fitted in (True, False):
        gyro = Gyro(is_fitted=fitted)
        yield said(gyro)
        for on, now in ((False, 1), (True, 2), (True, 3), (False, 4), (True, 5)):
            gyro.switch(on=on, now=now)
            for turn in (0.0, 0.1, -0.1, 20.0, -20.0):
                gyro.sample(turn, draw.choice((0.0, 0.6, -2.0)))
            yield said(gyro)
        yield said(gyro.take_packet())
        for number in range(43):
            gyro.sample(number / 50, 0.0)
        yield said((gyro.take_packet(), gyro))


def pins(draw: random.Random) -> Iterator[str]:
    one, now = Pins(), 0
    yield said((one, one.output(-1), one.output(0)))
    for _ in range(60):
        port = draw.randrange(-1, 11)
        match draw.randrange(5):
            case 0:
                one.kick(draw.choice((-5, 0, 1, 30)), now)
            case 1:
                one.drive(draw.randrange(256), draw.randrange(256))
            case 2:
                one.select(port)
            case 3:
                one.set_analog(min(max(port, 1), 9), draw.choice((-1, 0, 1, 3, 4, 1023, 1024)))
            case _:
                one.set_servo(port, draw.randrange(300))
        now += draw.choice((0, 1, 15)) * NS_PER_MS
        seen = {"digital_in": draw.randrange(256), "front": draw.randrange(32), "rear": draw.randrange(64)}
        packet = one.packet(
            **seen, infrared=draw.randrange(4), decivolts=draw.choice((0, 99, 123, 199, 200, 255)), now=now
        )
        yield said((one, packet, one.raw_analog, [one.output(max(one.kicked_until, 0) + by) for by in AROUND]))


def batteries(draw: random.Random) -> Iterator[str]:
    for volts in (11.0, 11.1, 11.2, 12.0, 12.9, 13.0):
        one, now = Battery.resting_at(volts, draw.choice((0.0, 0.15))), 0
        for _ in range(12):
            now += draw.choice((1, 3600, 7200)) * NS_PER_S
            one.is_charging = draw.random() < 0.4
            one.pretended_decivolts = draw.choice((None, None, None, -1, 0, 97, 255, 256))
            one.look(now, motors_on=draw.random() < 0.5, rims_mps=draw.uniform(0, 3), stalled=draw.randrange(3))
            yield said((one, one.volts, one.decivolts, one.state_of_charge))
    yield said((Battery(), CAPACITY_C))


def ports(draw: random.Random) -> Iterator[str]:
    yield said(Devices())
    one = AuxPort(2)
    for number in range(70):
        match number % 4:
            case 0:
                one.receive(draw.randbytes(draw.choice((0, 1, 9, 120, 256, 257))))
            case 1:
                one.request(draw.choice((-1, 0, 1, 2, len(one.waiting), len(one.waiting) + 1, 199, 200, 201)))
            case 2:
                one.send(draw.randbytes(draw.choice((0, 3, 255, 256, 257))))
            case _:
                yield said((one.take_answer() if one.has_answer else None, one.take_outgoing().hex()[-20:]))
        yield said((one.has_answer, one.wanted, len(one.waiting), len(one.outgoing), one.waiting.hex()[:20], one.baud))
    stick = Joystick()
    for x, y in ((512, 512), (0, 1023), (1023, 0), (513, 511)):
        stick.x, stick.y = x, y
        yield said((stick, stick.packet(), stick.speeds(400, 100), stick.speeds(1, 1)))


def schedules(draw: random.Random) -> Iterator[str]:  # noqa: C901 - a table of acts
    for name in ("p2dx", "p3at-sh"):
        for profile in Profile:
            robot = load_parameters(name)
            yield said([raw_range(metres, robot, profile) for metres in (0.0, 0.1, 4.99, 5.0, 5.01, 99.0)])
    for fitted, per_cycle in ((0, 2), (1, 2), (8, 2), (8, None), (16, 4), (17, 2), (32, 3)):
        one, now = SonarSchedule(fitted, pings_per_cycle=per_cycle, cycle_ns=100 * NS_PER_MS), 0
        yield said((one.order, one.arrays, one.fitted_arrays, one.is_on))
        for number in range(50):
            match draw.randrange(9):
                case 0:
                    one.start_cycle(now)
                case 1:
                    one.switch(on=draw.random() < 0.6, now=now, array=draw.choice((None, 1, 2, 3, 4, 5)))
                case 2:
                    one.poll([draw.randrange(-1, fitted + 2) for _ in range(draw.randrange(5))], now)
                case 3:
                    one.set_interval(draw.choice((10, 25, 40, 50, 99, 100, 101, 300)) * NS_PER_MS, now)
                case 4:
                    yield said(one.take_readings())
                case 5 if number % 3 == 0:
                    one.restore(one.snapshot())
                case _:
                    ping = one.next_ping()
                    if ping is not None:
                        now = max(now, ping.at)
                        one.take_ping([(which, draw.randrange(9)) for which in ping.numbers])
            now += draw.choice((0, 10, 25, 50)) * NS_PER_MS
            yield said((now, one.next_ping(), one.order, one.arrays, one.is_on, one.snapshot()))


class Heard:
    """A body whose sonar stand so far from those of another; None: they do not see each other."""

    def __init__(self, far_m: float | None) -> None:
        self.far_m = far_m

    def sees(self, number: int, _other: object, its_number: int) -> float | None:
        return None if self.far_m is None or number == its_number else self.far_m + number / 10


def pings(draw: random.Random) -> Iterator[str]:
    table, now = PingTable([Heard(1.0), Heard(3.5), Heard(None)]), 0
    ears = [table.ears_of(robot) for robot in range(3)]
    for _ in range(60):
        robot = draw.randrange(3)
        yield said((now, robot, ears[robot](draw.sample(range(4), 2), now), table.snapshot()))
        now += draw.choice((0, round(1.0 / SOUND_MPS * NS_PER_S), 2 * NS_PER_MS, 11 * NS_PER_MS, KEPT_NS, KEPT_NS + 1))
    table.enter_world([Heard(2.0)] * 3)
    yield said((table.snapshot(), ears[0]([1], now), ears[1]([2], now + NS_PER_MS), ears[2]([3], now - 1)))


class Echo:
    """A ray that meets something."""

    def __init__(self, range_m: float, cosine: float) -> None:
        self.range_m, self.cosine = range_m, cosine


class Walls:
    """A body whose sonar meet walls at odd angles."""

    def ranges(self, numbers: Sequence[int]) -> Sequence[float]:
        return [(0.0, 0.1, 0.15, 2.0, 4.99, 5.0, 5.01, float("inf"))[number] for number in numbers]

    def echoes(self, numbers: Sequence[int]) -> Sequence[Sequence[Echo]]:
        return [
            [Echo(true_m, 1.0 - ray / 10) for ray, true_m in enumerate((true, true / 2))]
            for true in self.ranges(numbers)
        ]


def ranges(draw: random.Random) -> Iterator[str]:
    robot, body, eight = load_parameters("p2dx"), Walls(), range(8)
    heard = [None, 0.05, 0.1, 1.0, 6.0, None, 4.0, 3.0]
    faults = {1: ("stuck", 2.5), 2: ("noisy", 0.3), 3: ("dead", 0.0), 4: ("stuck", 9.0), 5: ("other", 1.0)}
    for errors in (
        SonarErrors(), SonarErrors(noise_m=0.1), SonarErrors(noise_part=0.1), SonarErrors(dropout=0.5),
        SonarErrors(crosstalk=0.5), SonarErrors(specular_deg=25.0), SonarErrors(specular_deg=26.0),
        SETS["realistic"].sonar, SonarErrors(specular_deg=0.0),
        SonarErrors(noise_m=0.05, noise_part=0.02, dropout=1.0, crosstalk=1.0),
    ):  # fmt: skip
        for said_faults, others in (({}, None), (faults, None), ({}, heard), (faults, heard)):
            source = RandomSource(5)
            for _ in range(3):
                yield said(measure_ranges(body, eight, robot, errors, said_faults, source, others))
    for name in ("p2dx", "amigo-sh", "peoplebot-sh", "p3atiw-sh"):
        one = load_parameters(name)
        yield said((cones(one), eyes(one), [reading(range_m, one) for range_m in (0.0, 0.1, 1.0, 5.0, 9.0)]))


def errors(draw: random.Random) -> Iterator[str]:
    """Give each key its bounds, and what lies next to them."""
    yield said((SETS, SensorErrors()))
    for section in fields(SensorErrors):
        for name in [key.name for key in fields(getattr(SETS["ideal"], section.name))]:
            least, most = RANGES[name]
            for value in (least, most, least - 0.001, most + 0.001, (least + most) / 3):
                for base in SETS:
                    yield tried(parse_sensor_errors, {"based_on": base, section.name: {name: value}}, "here")
    with TemporaryDirectory() as made:
        path = Path(made, "e.toml")
        for text in (
            "",
            'based_on = "realistic"\n[sonar]\nnoise_m = 2\n',
            "based_on = 1",
            "[sonar]\nx = 1",
            "[sonar",
            "[a]",
        ):
            path.write_text(text)
            yield tried(load_sensor_errors, str(path)).replace(made, "…")
        path.rename(Path(made, "e"))
        for name in (f"{made}/e", f"{made}/e.toml", "ideal", "realistc", "realistic", made):
            yield tried(load_sensor_errors, name).replace(made, "…")


TRACES: dict[str, Trace] = {
    each.__name__: each
    for each in (gripper, lasers, headings, pins, batteries, ports, schedules, pings, ranges, errors)
}
TRACES["declared"] = declared_of("p2os.pioneer", "p2os.pioneer.devices", "p2os.pioneer.sonar")
test_what_was_approved_is_shown = judge_of(__file__, TRACES)
