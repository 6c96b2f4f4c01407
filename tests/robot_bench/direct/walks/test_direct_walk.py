"""Robots on wires driven at random: bridges, encoders, drive trains, motors and sensors, and what their files say."""

import math
import tomllib
from collections.abc import Iterator
from dataclasses import replace
from random import Random
from typing import Any

from adapter_sim.codec import BitOrder
from adapter_sim.settings import MotorCommand
from bluepill_sim.fabric.subscriptions import Wave
from p2os.pioneer.body.factory import make_body
from p2os.pioneer.world import load_world
from p2os.pioneer.world.model import Obstacle
from p2os.robots.parameters import load_parameters
from p2os.toml_file import TomlSource
from p2os.toml_schema import TablePlace
from robot_bench.direct import DirectRobot, DistanceSensors, JointMotor, WheelEncoder
from robot_bench.direct.differential.analog import DischargingBattery, volts_at
from robot_bench.direct.differential.bridge import HBridge, Shares
from robot_bench.direct.differential.description import GP2Y0A21, BridgeDescription, BridgeKind, Off
from robot_bench.direct.differential.drive_train import DriveTrain, no_load_radps
from robot_bench.direct.differential.quadrature import Quadrature
from robot_bench.direct.differential.robot import DifferentialRobot
from robot_bench.direct.differential.robot_file import TABLES, load_differential
from robot_bench.direct.senses import WorldSenses
from robot_bench.wires.nets import Net, Strength, WaveDrive
from tests.robot_bench.direct.robots import ROVER, kinetic_j, rover
from tests.robot_bench.direct.test_differential import MS, Rig
from tests.robot_bench.direct.test_direct import nets, set_value
from tests.tools.suite.approved import judge_of, said, tried
from tests.tools.suite.declared import declared_of

PP = Strength.PUSH_PULL
HOUR = 3_600_000 * MS


def exact(*values: float) -> str:
    """Return numbers to more digits than `said` gives: these are the same on each machine."""
    return " ".join(f"{value:.12g}" for value in values)


def bridges(draw: Random) -> Iterator[str]:
    """Go through spans of each kind of bridge, its pins driven by levels and waves of many kinds, for hours."""
    for kind in BridgeKind:
        for off, dead_us in ((Off.BRAKE, 0.0), (Off.COAST, 0.0), (Off.BRAKE, 0.7), (Off.COAST, 100.0)):
            pins = [Net(name) for name in kind.pins]
            made = HBridge(pins, BridgeDescription(kind=kind, off=off, dead_time_us=dead_us))
            yield f"{kind} {off} {dead_us}"
            begin = 0
            for step in range(24):
                begin += draw.choice((0, 0, 0, HOUR)) if step % 6 == 5 else 0
                end, at = begin + draw.choice((MS, MS, 125_000, 36_000)), begin
                for pin in draw.sample(pins, draw.choice((0, 0, 1, 1, 2))):
                    for _ in range(draw.choice((1, 1, 2))):
                        at = min(end - 1, at + draw.choice((0, 1, 999, 10_000, 400_000)))
                        if draw.random() < 0.4:
                            pin.drive("chip", draw.random() < 0.6, PP, at)
                            continue
                        hz = draw.choice((72_000_000, 8_000_000, 7_000_000, 1_000_000_000))
                        period = draw.choice((2, 900, 3600, 65_536, 65_536 * 65_536))
                        high = draw.choice((1, period // 4 or 1, period // 2, period - 1))
                        if period > 800:
                            wave = Wave(at, draw.randrange(period), period, high, hz)
                            pin.wave_from("chip", WaveDrive(wave, PP.codes), at)
                yield f"{begin} {end - begin}: {exact(*made.shares(begin, end))} {made._is_steady}"
                begin = end


def encoders(draw: Random) -> Iterator[str]:
    """Turn wheels by hardly anything and by many lines, both ways, in short spans and long ones."""
    for per_turn in (4.0, 1632.0, 2 * math.pi, 999.5):
        a, b = Net("a"), Net("b")
        encoder, angle, begin = Quadrature(a, b, per_turn), 0.0, 0
        encoder.start()
        for step in range(24):
            span = draw.choice((1, 3, 1000, MS, MS))
            edge = 2 * math.pi / per_turn
            angle += draw.choice((0.0, 0.5 * edge, -0.5 * edge, edge, -edge, draw.uniform(-20, 20) * edge, -90 * edge))
            angle = round(angle / edge) * edge if step % 5 == 4 else angle
            encoder.turn_to(angle, begin, span)
            begin += span
            found = [(at - begin, level) for net in (a, b) for at, level in net.edges_until(begin)]
            rows = f"{len(found)} {sum((n + 1) * -at + level for n, (at, level) in enumerate(found))}"
            yield f"{exact(angle, encoder._angle)} room {encoder.struct.room}: {found if len(found) < 9 else rows}"


def trains(draw: Random) -> Iterator[str]:
    """Step two motors with volts, brakes and friction of all sizes, alone and with a body that goes its own way."""
    parts: tuple[dict[str, dict[str, object]], ...] = (
        {}, {"motor": {"friction_nm": 0.0, "damping_nm_s": 0.0}}, {"motor": {"friction_nm": 0.02}},
        {"bridge": {"drop_v": 1.5}},
    )  # fmt: skip
    for changes in parts:
        train, cell = DriveTrain(rover(**changes), 1e-3), DischargingBattery(rover().battery)
        yield exact(train.struct.own, train.struct.other)
        for _ in range(60):
            left, right = (Shares(*draw.choice((
                (0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (0.3, 0.1, 0.6), (0.02, 0, 0), (0, 0.05, 0.9)
            ))) for _ in range(2))  # fmt: skip
            if draw.random() < 0.2:
                train.left_radps = draw.choice((0.0, 0.001, 3.0, -20.0))
            source, ohm, idle = draw.choice((7.4, 0.5, 0.0)), draw.choice((0.0, 0.3)), draw.choice((0.0, 0.1, 30.0))
            volts = train.supply_v(left, right, source, ohm, idle)
            aims = [value for aim in train.aims(left, right, volts) for value in aim]
            if draw.random() < 0.3:
                made = train.take(left, right, volts, draw.uniform(-9, 9), draw.uniform(-9, 9))
            else:
                made = train.step(left, right, volts)
            cell.give(draw.choice((0.0, 3.0, -1.0)), draw.choice((1.0, 900.0)))
            yield exact(volts, *aims, *made, *train.currents_a, train.left_radps, train.right_radps, kinetic_j(train),
                        cell.used_ah, cell.source_v)  # fmt: skip


def robots(draw: Random) -> Iterator[str]:
    """Drive rovers among things: alone, stepped with others, and with a body that takes torques."""
    parts: tuple[tuple[str, dict[str, dict[str, object]]], ...] = (
        ("alone", {}), ("others", {"bridge": {"drop_v": 1.2}}), ("torques", {}),
        ("torques others", {"motor": {"friction_nm": 0.0, "damping_nm_s": 0.0}}),
        ("alone", {"bridge": {"off": Off.COAST}, "battery": {"capacity_ah": 0.0008, "charge": 0.5}}),
    )  # fmt: skip
    for how, changes in parts:
        rig = Rig(rover(**changes))
        torques: list[tuple[float, float]] = []
        if "torques" in how:
            rig.body.limit_torques = lambda *both: torques.append(both)  # type: ignore[attr-defined]  # noqa: B023
            rig.robot = DifferentialRobot(rover(**changes), rig.body, rig.harness, rig.pins.__getitem__)
        rig.robot.is_stepped_by_others = "others" in how
        events: list[object] = []
        rig.robot.on_event = lambda *row: events.append(row)  # noqa: B023
        rig.robot.on_ranges = lambda at, metres: events.append((at, *metres))  # noqa: B023
        rig.body.place(Obstacle(name="wall", x_m=0.3, y_m=0.05, length_m=0.1, width_m=0.4, height_m=0.3))
        yield f"{how} {changes}"
        for step in range(40):
            now = step * 20 * MS
            if step % 4 == 0:
                for side in ("left", "right"):
                    rig.drive(side, draw.choice((1.0, 1.0, 0.7, 0.2, 0.0, -0.4, -1.0)), now)
            if step == 30:
                rig.robot.restore(rig.robot.snapshot())
            for at in range(now + MS, now + 21 * MS, MS):
                if rig.robot.is_stepped_by_others:
                    asked = rig.robot.next_setpoints()
                    rig.robot.take_step(rig.body.step(*asked))
                rig.robot.advance_to(at)
            state, train, cell = rig.body.state, rig.robot.train, rig.robot.cell
            shown = [state.x_m, state.y_m, state.heading_rad, train.left_radps, train.right_radps, *train.currents_a,
                     kinetic_j(train), cell.volts, 1e3 * cell.used_ah, *rig.robot.next_setpoints()]  # fmt: skip
            levels = "".join(str(int(net.level(now + 20 * MS))) for net in rig.harness)
            edges = [len(rig.harness[f"{side}_{one}"].edges_until(now + 20 * MS)) for side in ("left", "right")
                     for one in "ab"]  # fmt: skip
            pins = {name: (pin.volts, pin.times) for name, pin in rig.pins.items()}
            yield f"{said(shown)} {levels} {edges} {said(pins)} {rig.robot.next_deadline()} {said(torques[-1:])}"
            yield said(events)
            events.clear()


def pioneers(draw: Random) -> Iterator[str]:
    """Drive a Pioneer whose motors and sensors hang on wires, by bits and by duty, among things."""
    for width, command, order, ramp in (
        (3, MotorCommand.BITS, BitOrder.COMM3_MSB, 300_000), (4, MotorCommand.BITS, BitOrder.COMM1_MSB, None),
        (2, MotorCommand.DUTY, BitOrder.COMM3_MSB, 1_000_000),
    ):  # fmt: skip
        world = load_world("room")
        body = make_body("kinematic", world, load_parameters("p2dx"))
        body.reset(world.start, 0)
        sides = [nets(width), nets(width)]
        shown = [nets(width), nets(3), nets(8)]
        motors = [
            JointMotor(one, step_um_per_s=62_500, ramp_um_per_s2=ramp, dt_ns=body.dt_ns, bit_order=order,
                       command=command)
            for one in sides
        ]  # fmt: skip
        sensors = DistanceSensors(shown[2], threshold_um=1_500_000, period_ns=50 * MS)
        robot = DirectRobot(
            body, left=motors[0], right=motors[1], encoders=(WheelEncoder(shown[0]), WheelEncoder(shown[1])),
            sensors=sensors, sonar_numbers=range(8), encoder_period_ns=5 * MS,
        )  # fmt: skip
        events: list[object] = []
        robot.on_event = lambda *row: events.append(row)  # noqa: B023
        sensors.on_sample = lambda at, metres: events.append((at, *metres))  # noqa: B023
        now = 0
        yield f"{width} {command} {order} {ramp}"
        for step in range(60):
            if step % 6 == 0:
                for place, side in enumerate(sides):
                    if command is MotorCommand.BITS:
                        set_value(side, draw.choice((3, 3, 2, 0, -1, -4)), now)
                        continue
                    side[1].drive("chip", draw.random() < 0.3, PP, now)
                    wave = Wave(now, 0, 3600, draw.choice((1, 900, 3000, 3599)), 72_000_000)
                    if draw.random() < 0.8:
                        side[0].wave_from("chip", WaveDrive(wave, PP.codes), now)
                    else:
                        side[0].drive("chip", place == 0, PP, now)
            if step == 40:
                robot.restore(robot.snapshot())
            now = max(now, robot.next_deadline() if step % 3 else now + draw.choice((1, MS, 30 * MS)))
            robot.advance_to(now)
            levels = " ".join("".join(str(int(net.level(now))) for net in one) for one in shown)
            reported = [(one.speed_um_per_s, one.asked, one.value(now), one.fastest_um_per_s(7), one.is_steady)
                    for one in motors]  # fmt: skip
            margins = [one.margin_rad(body.state.left_angle_rad) for one in (robot._left_encoder, robot._right_encoder)]
            state = body.state
            yield f"{now} {levels} {reported} {said(margins)} {said([state.x_m, state.y_m, state.heading_rad])}"
            yield f"{robot.next_deadline()} {said(robot.next_setpoints())} {said(events)}"
            events.clear()


def senses(draw: Random) -> Iterator[str]:
    """Look at a body that speeds up, turns and stands as parts on the board do."""
    body = make_body("kinematic", load_world("arena"), load_parameters("p2dx"))
    made, steps = 0, 0

    def bring_to(at: int) -> None:
        nonlocal made
        while (made + 1) * body.dt_ns <= at:
            body.step(0.3 if made % 9 < 5 else -0.1, 0.1 + 0.05 * (made % 4))
            made += 1

    sensed = WorldSenses(body, bring_to)
    for _ in range(12):
        steps += draw.randint(0, 3)
        sensed.advance_to(steps * body.dt_ns + draw.choice((0, 1, body.dt_ns - 1)))
        yield f"{sensed.next_deadline()} {said(sensed.motion())}"
        place = (draw.uniform(-1, 1), draw.uniform(-1, 1), draw.uniform(-3, 3))
        yield said(sensed.range_m(*place, cone_rad=draw.choice((0.0, 0.3)), longest_m=2.0))


def files_read(draw: Random, whole: str) -> Iterator[str]:
    """Read a file as it is, and with each number larger, none, below 0, and far too large."""
    changes: list[tuple[str, ...]] = [()]
    for table, section in tomllib.loads(whole).items():
        for one in section if isinstance(section, list) else [section]:
            if isinstance(one, dict) and table != "pins":
                changes += [(table, key) for key in one]
    for change in changes:
        for factor in (1.5, 0.0, -1.0, 1e6):
            read: dict[str, Any] = tomllib.loads(whole)
            pins = {name: str(pin) for name, pin in read["pins"].items()}
            if change:
                section = read[change[0]]
                row = section[-1] if isinstance(section, list) else section
                value = row[change[1]]
                row[change[1]] = value * factor if isinstance(value, float | int) else draw.choice(("x", 3, [[1, 2]]))
            robot = tried(load_differential, read, TablePlace(TomlSource("rover.toml")), pins)
            yield f"{change} {factor} {robot[:3000]}"
            if not change:
                break


def descriptions(draw: Random) -> Iterator[str]:
    """Read the rover's file, with each number moved, and say what its keys are."""
    for name, keys in TABLES.items():
        yield from (f"{name} {said(key)}" for key in keys)
    whole = ROVER.read_text(encoding="utf-8")
    yield said([exact(volts_at(GP2Y0A21, cm / 100)) for cm in (-1, 0, 1, 7, 8, 33, 79, 80, 81)])
    cell = DischargingBattery(rover().battery)
    for amperes in (0.5, 3.0, -8.0, 900.0, 1.0):
        cell.give(amperes, 60.0)
        yield exact(cell.used_ah, cell.source_v)
    yield from files_read(draw, whole)
    for kind in BridgeKind:
        robot_ = rover(bridge={"kind": kind}, encoder={"on": draw.choice(("motor", "wheel"))})
        yield f"{said(robot_.signals)} {said(robot_.parameters)}"
        yield exact(robot_.encoder.edges_per_turn(robot_.motor), no_load_radps(robot_), robot_.battery.divider)
    yield said(replace(rover(), distances=()).parameters.sonar_range_m)


TRACES = {
    "bridges": bridges, "encoders": encoders, "robots": robots, "pioneers": pioneers, "senses": senses,
    "descriptions": descriptions, "trains": trains,
    "declared": declared_of("robot_bench.direct", "robot_bench.direct.differential"),
}  # fmt: skip
test_what_robots_on_wires_do_is_what_was_approved = judge_of(__file__, TRACES)
