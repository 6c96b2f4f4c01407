"""What each experiment finds in a run made by hand: every figure whole, with its bound's formula, as it is kept.

The runs are not quite right: pins come late, a speed is off, a thing is seen twice; so figures are met and missed.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import pytest

from adapter_sim.pinout import load_pinout
from p2os.protocol.commands import rvel, vel
from p2os.protocol.sip import SonarReading, StandardSip
from robot_bench.events.kinds import Contact, Fault, Note, Packet, Pose
from robot_bench.experiments.validation import experiments
from robot_bench.experiments.validation.encoders import (
    count_figures,
    encoder_figures,
    slip_figures,
    sparse_figures,
    wrap_figure,
)
from robot_bench.experiments.validation.experiments import EXPERIMENTS, ExperimentTrial
from robot_bench.experiments.validation.figures import Figure, Finding
from robot_bench.experiments.validation.motors import motor_figures
from robot_bench.experiments.validation.nominal import Nominal
from robot_bench.experiments.validation.sensors import (
    only_while_seen_figures,
    reading_figures,
    sensor_figures,
    things_before,
)
from robot_bench.experiments.validation.silence import silence_figures
from robot_bench.recording.run_record import RunRecord
from robot_bench.scenario.goals.judging import Judgement
from robot_bench.scenario.scenario import Scenario
from robot_bench.wires.edges import Edges
from tests.robot_bench.recording.kept_lines import is_as_kept
from tests.robot_bench.recording.records import S, motor_pins

MS = S // 1000
Pair = tuple[int, int]
#: What is asked, and for how long: straight, round, across and too long.
WANTED: Sequence[tuple[Pair, float]] = (((3, 3), 2.0), ((-4, -4), 3.0), ((3, -4), 2.0), ((2, 2), 1.0), ((0, 0), 3.0))
MODES = ("adapter", "direct", "port")


def nominal_of(mode: str, experiment: str = "motors") -> tuple[Nominal, Scenario]:
    """What is expected of an experiment's scenario in a mode."""
    one = EXPERIMENTS[experiment]
    scenario = one.load_at_port() if mode == "port" else one.load().with_options(mode=mode)
    return Nominal(scenario, at_port=mode == "port"), scenario


@dataclass(kw_only=True)
class MadeRun:
    """A robot whose wheels go at their ramps to what the pins say, and are reported by packets each 100 ms."""

    nominal: Nominal
    legs: Sequence[tuple[Pair, float]]
    begins_s: float = 1.0
    late_s: float = 0.06
    #: By which part the rims are too fast, and a ramp is too steep.
    fast: float = 1.002
    steep: float = 1.004
    seen: Sequence[tuple[str, float, float]] = ()
    readings: Sequence[tuple[float, int, int]] = ()
    fault: tuple[float, float] | None = None
    rest_s: float = 1.0

    def record(self) -> RunRecord:
        steps = list(self._steps())
        poses = [self._pose(t, *row) for t, *row in steps if t % (50 * MS) == 0]
        last = steps[-1][0]
        changes = [(0.0, 0, 0)]
        at = self.begins_s
        for pair, seconds in self.legs:
            changes.append((at, *pair))
            at += seconds
        pins = motor_pins(*changes)
        pins |= dict(self._encoders(steps))
        for wire in (f"DD{n}" for n in range(1, 9)):
            edges = sorted((round(t * S), level) for net, begin, end in self.seen if net == wire
                           for t, level in ((begin, 1), (end, 0)))  # fmt: skip
            pins[wire] = Edges([(0, 0), *edges])
        lines = [(round((t + 0.004) * S), f"codes: {left} {right} at {left * 7} {right * 9}\n".encode())
                 for t, left, right in changes[1:]]  # fmt: skip
        faults = [] if self.fault is None else [
            Fault(t=round(self.fault[0] * S), op="inject", words="link-down"),
            Fault(t=round(self.fault[1] * S), op="clear", words="link-down"),
        ]  # fmt: skip
        return RunRecord(
            meta={"scenario": "mine"}, is_cut=False, poses=poses, pins=pins, wire=sorted(self._packets(poses, changes),
            key=lambda packet: packet.t), usart=lines, last_ns=last, faults=faults,
            events=[Note(t=200 * MS, who="adapter", what="driving")],
        )  # fmt: skip

    def _steps(self) -> Iterator[tuple[int, float, float, float, float, float, float, float]]:
        """Each 10 ms: time, both rims' mm/s, ways in mm, x, y, heading."""
        pairs = [(self.begins_s, (0, 0)), *self.legs]
        ends, at = [], 0.0
        for seconds, pair in ((pairs[0][0], (0, 0)), *((seconds, pair) for pair, seconds in self.legs)):
            at += seconds
            ends.append((at + self.late_s, pair))
        speeds, ways, x, y, heading = [0.0, 0.0], [0.0, 0.0], 0.0, 0.0, 0.0
        for n in range(round((at + self.rest_s) * 100) + 1):
            pair = next((pair for end, pair in ends if n / 100 < end), ends[-1][1])
            wanted = [rim * self.fast for rim in self.nominal.rims_mm_s(pair)]
            rates = self.nominal.ramp_mm_s2 * self.steep, self.nominal.turn_ramp_mm_s2 * self.steep
            for place, rim in enumerate(wanted):
                rate = rates[wanted[0] * wanted[1] < 0] / 100 if rates[0] else math.inf
                speeds[place] += max(-rate, min(rate, rim - speeds[place]))
                ways[place] += speeds[place] / 100
            yield n * 10 * MS, *speeds, *ways, x, y, heading
            heading += (speeds[1] - speeds[0]) / self.nominal.track_mm / 100
            x += sum(speeds) / 200 * math.cos(heading)
            y += sum(speeds) / 200 * math.sin(heading)

    def _angles(self, *ways: float) -> list[float]:
        return [way / self.nominal.encoder_step_mm / 8 * math.tau for way in ways]

    def _pose(
        self, t: int, left: float, right: float, left_mm: float, right_mm: float, x: float, y: float, heading: float
    ) -> Pose:
        angles = self._angles(left_mm, right_mm)
        return Pose(
            t=t, x=round(x * 1000), y=round(y * 1000), z=0, heading=round(heading * 1e6), pitch=0,
            left=round(left * 1000), right=round(right * 1000), left_angle=round(angles[0] * 1e6),
            right_angle=round(angles[1] * 1e6), collisions=0,
        )  # fmt: skip

    def _encoders(self, steps: Sequence[tuple[int, Any, Any, Any, Any, Any, Any, Any]]) -> Iterator[tuple[str, Edges]]:
        """What both encoders show, a period of theirs late."""
        late = round(self.nominal.encoder_period_s * S)
        for side, place in (("encoder1", 3), ("encoder2", 4)):
            wires = load_pinout().value(side).wires
            edges = [Edges([(0, 0)]) for _ in wires]
            code = 0
            for row in steps:
                step = math.floor(self._angles(row[place])[0] / math.tau * 8)
                code += (step > code) - (step < code)
                for bit, track in enumerate(edges):
                    if track[-1][1] != code >> bit & 1:
                        track.append(row[0] + late, code >> bit & 1)
            yield from zip(wires, edges, strict=True)

    def _packets(self, poses: Sequence[Pose], changes: Sequence[tuple[float, int, int]]) -> Iterator[Packet]:
        for t, *pair in changes[1:]:
            forward, turn = self.nominal.speeds((pair[0], pair[1]))
            for late_s, command in ((0.05, vel(round(forward))), (0.06, rvel(round(turn)))):
                data = command.to_frame().to_bytes()
                yield Packet(t=round((t + late_s) * S), direction="c2r", data=data)
        yield Packet(t=5 * MS, direction="c2r", data=b"\xfa\xfb\x00")
        readings = list(self.readings)
        for pose in poses[::2]:
            here = [reading for reading in readings if reading[0] * S <= pose.t]
            readings = readings[len(here) :]
            sip = StandardSip(
                raw_x=round(pose.x_m * 1000 / self.nominal._distance_mm) % 32768,
                raw_y=round(pose.y_m * 1000 / self.nominal._distance_mm) % 32768,
                raw_heading=round(pose.heading_rad / math.tau * 4096) % 4096, raw_left_velocity=pose.left // 1000,
                raw_right_velocity=pose.right // 1000, stall_left=3.0 < pose.t / S < 3.3,
                sonar=tuple(SonarReading(number, raw) for _, number, raw in here),
            )  # fmt: skip
            yield Packet(t=pose.t + 40 * MS, direction="r2c", data=sip.to_frame(self.nominal._profile).to_bytes())


def lines_of(found: Sequence[Finding]) -> Iterator[str]:
    for one in found:
        if isinstance(one, Figure):
            value = f"{one.measured:.6g} of {one.expected:.6g} {one.unit} +- {one.uncertainty:.3g}"
            yield f"  {one.group}: {one.what}: {value}"
            yield f"    {one.bound.name} {one.bound.value:.6g}: {one.bound.formula}; worst of {one.count} {one.at}"
        else:
            yield f"  {one}"


def is_kept(name: str, *found: Sequence[Finding]) -> bool:
    lines = [line for part in found for line in ("--", *lines_of(part))]
    return is_as_kept(lines, f"findings_{name}")


@pytest.mark.parametrize("mode", MODES)
def test_what_motors_and_encoders_are_found_to_do(mode: str) -> None:
    nominal, scenario = nominal_of(mode)
    run = MadeRun(nominal=nominal, legs=WANTED, late_s=0.0 if mode == "direct" else 0.06)
    record = run.record()
    late = replace(run, late_s=0.2, fast=1.05, steep=1.2, legs=[*WANTED[:2], ((3, 3), 2.5), ((1, 1), 0.1)]).record()
    bare = replace(record, poses=[], wire=[])
    family = scenario.controller.family_of(scenario.parameters)
    assert is_kept(
        f"motors_{mode}", motor_figures(record, nominal, WANTED), motor_figures(late, nominal, WANTED),
        motor_figures(bare, nominal, WANTED), encoder_figures(record, nominal), count_figures(record),
        encoder_figures(replace(record, poses=record.poses[:30]), nominal), sparse_figures(record, nominal),
        slip_figures(late, nominal, "kinematic"), slip_figures(late, nominal, "physical"), [wrap_figure(late, family)],
        motor_figures(RunRecord(), nominal, WANTED), encoder_figures(RunRecord(), nominal), count_figures(RunRecord()),
        motor_figures(RunRecord(pins=motor_pins((0, 0, 0), (2, 0, 0))), nominal, WANTED),
    )  # fmt: skip


def test_what_a_wheel_is_found_to_do_that_turns_more_than_half_a_turn_between_two_samples() -> None:
    for mode in ("adapter", "direct"):
        nominal, _ = nominal_of(mode, "sparse")
        run = MadeRun(nominal=nominal, legs=[((4, 4), 1.0), ((-4, -4), 1.0)], late_s=0.0)
        assert is_kept(f"sparse_{mode}", sparse_figures(run.record(), nominal))


SEEN = [("DD1", 4.6, 6.1), ("DD2", 7.2, 8.3), ("DD2", 7.8, 7.9), ("DD8", 30.0, 31.0)]


@pytest.mark.parametrize("mode", MODES)
def test_what_sensors_are_found_to_show(mode: str) -> None:
    nominal, scenario = nominal_of("adapter" if mode == "port" else mode, "sensors")
    at_port = Nominal(scenario, at_port=mode == "port")
    windows = [(number, begin / S, end / S) for number, spans in sorted(
        things_before(scenario).items()) for begin, end in spans]  # fmt: skip
    good = [(f"DD{number}", begin + 0.15, end + 0.12) for number, begin, end in windows]
    bad = [*good[1:4], (good[4][0], windows[4][1] + 0.9, windows[4][2] + 0.2), ("DD1", 40.0, 40.5)]
    readings = [(begin + 0.1, number - 1, 440) for number, begin, _ in windows] + [(3.5, 2, 3000), (3.6, 9, 100)]
    legs = [((2, 2), 0.5), ((0, 0), 1.0)]
    lines = []
    for seen in (good, bad, []):
        run = MadeRun(nominal=nominal, legs=legs, begins_s=windows[0][1] + 0.18, seen=seen, rest_s=14.0,
                      readings=sorted(readings))  # fmt: skip
        record = run.record()
        lines += [
            sensor_figures(record, at_port, scenario), reading_figures(record, scenario),
            only_while_seen_figures(record, at_port),
        ]  # fmt: skip
    silent = replace(record, wire=[])
    lines += [reading_figures(silent, scenario), reading_figures(replace(record, events=[]), scenario),
              sensor_figures(record, at_port, replace(scenario, changes=()))]  # fmt: skip
    assert is_kept(f"sensors_{mode}", *lines)


def test_what_a_silent_line_is_found_to_do() -> None:
    nominal, _ = nominal_of("adapter", "silence")
    all_high = [(f"DD{n}", 3.05 + nominal.liveness_s + n / 1000, 9.0) for n in range(1, 9)]
    run = MadeRun(nominal=nominal, legs=[((3, 3), 3.1), ((0, 0), 1.0)], seen=all_high, fault=(3.0, 7.0), rest_s=4.0)
    record = run.record()
    lines = [silence_figures(record, nominal), silence_figures(replace(record, faults=[]), nominal),
             silence_figures(replace(run, seen=all_high[1:], legs=[((3, 3), 9.0)]).record(), nominal),
             silence_figures(replace(record, poses=[]), nominal)]  # fmt: skip
    assert is_kept("silence", *lines)


def test_what_a_drive_is_found_to_do() -> None:
    nominal, scenario = nominal_of("adapter", "dodge")
    record = MadeRun(nominal=nominal, legs=WANTED[:2]).record()
    hit = replace(record, contacts=[Contact(t=S, what="'box'", x_m=1.0, y_m=0.5)],
                  poses=[*record.poses[:-1], replace(record.poses[-1], collisions=2)])  # fmt: skip
    lines = []
    for one, judgement in ((record, Judgement(["a"], [], [])), (hit, Judgement([], ["b: x", "c: y" * 99], []))):
        trial = ExperimentTrial(record=one, nominal=nominal, scenario=scenario, judgement=judgement)
        lines += [experiments.drive_figures(trial), experiments._drive_at_port(trial), experiments._long_drive(trial)]
    nothing = replace(trial, record=RunRecord())
    lines += [experiments.drive_figures(nothing), experiments._drive_at_port(nothing)]
    assert is_kept("drive", *lines)


def test_what_is_expected_of_each_pair_of_codes() -> None:
    lines = []
    for experiment, modes in (("motors", MODES), ("capped", ("adapter",)), ("sparse", ("adapter", "direct"))):
        for mode in modes:
            nominal, _ = nominal_of(mode, experiment)
            delays = nominal.to_command, nominal.to_motion, nominal.to_distance_pin, nominal.encoder_lag(400.0)
            lines += [f"{experiment} {mode}{nominal.suffix}", *map(str, delays), str(nominal.to_free_line(9))]
            lines += [str(nominal.encoder_bound(300.0)), str(nominal.encoder_packet_bound), str(nominal.walk_ns(2.1))]
            for pair in ((3, 3), (-4, 3), (1, 0), (0, 0), (4, -4)):
                shown = [f"{value:.6g}" for value in (*nominal.speeds(pair), *nominal.rims_mm_s(pair))]
                bounds = [*nominal.rounding_bounds(pair), nominal.speed_bound(pair), nominal.way_bound(pair, 90.0, 0.5)]
                lines += [f"{pair} {shown}", *(f"  {one.name} {one.value:.6g} {one.formula}" for one in bounds)]
    assert is_as_kept(lines, "findings_nominal")
