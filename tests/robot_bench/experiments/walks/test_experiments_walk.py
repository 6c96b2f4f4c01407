"""Drives read, aligned, compared, answered and varied: each step on the way to the last figure, at random."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from unittest import mock

import numpy as np

from robot_bench.drives.drive import Drive, Steps, Trajectory, heading_of, number_of, steps_of, wrapped
from robot_bench.drives.metrics import metrics
from robot_bench.drives.onsets import answers, changes, onset_after
from robot_bench.events.kinds import Pose, Text
from robot_bench.experiments import alignment, drive_files, parting, trajectory_errors
from robot_bench.experiments.aria_logs import is_aria_log, read_aria_log
from robot_bench.experiments.comparison import How, compare
from robot_bench.experiments.drive_files import is_recording, read_drive, write_tum
from robot_bench.experiments.sensitivity import ParameterEffect, SampleDesign, outcome_names, outcomes_of, read_range
from robot_bench.scenario.loading import load_scenario
from tests.robot_bench.experiments.walks.drawn_drives import (
    P2DX,
    of_drive,
    of_steps,
    of_way,
    shown,
    steps_drawn,
    way_of,
)
from tests.robot_bench.firmware.hurried import hurried
from tests.tools.suite.approved import Trace, judge_of, said, tried
from tests.tools.suite.declared import declared_of


def trajectories(draw: Random) -> Iterator[str]:
    """Cut, turn and look up ways, and lay one over another."""
    for round_ in range(6):
        one = way_of(draw)
        shift, pose = draw.uniform(-0.6, 0.6), (draw.uniform(-1, 1), draw.uniform(-1, 1), draw.uniform(-3, 3))
        other = one.moved(pose).later(shift)
        other = replace(other, x_m=other.x_m + np.linspace(0, 0.03, len(other)))
        yield f"{round_} {of_way(one)} {said(one.path_m)} {' '.join(map(shown, one.speeds()))}"
        yield of_way(other)
        yield of_way(one.at(np.array([-1.0, 0.51, 0.52, 9.0])))
        first, last = float(one.t_s[3]), float(one.t_s[-4])
        yield f"{len(one.between(first, last))} {len(one.between(first + 1e-9, last - 1e-9))}"
        yield tried(alignment.shift_by_speeds, one, other)
        yield said([tried(alignment.first_motion_s, each) for each in (one, other)])
        back = other.later(-shift)
        for place in (alignment.first_pose, alignment.least_squares_pose):
            found = place(one, back)
            yield f"{said(found)} {of_way(back.moved(found))}"
        yield said([float(alignment._difference(one, other, by)) for by in (0.0, -shift, -shift + 0.1, 50.0, -50.0)])
        for step in (0, 1, 7, len(one) - 1, len(one), len(one) + 1):
            yield tried(lambda o=one, b=back, s=step: shown(trajectory_errors.relative_errors(o, b, s).rotation_rad))
        errors = trajectory_errors.absolute_errors(one, back), trajectory_errors.relative_errors(one, back, 5)
        for each in errors:
            yield " ".join(map(shown, (each.t_s, each.translation_m, each.rotation_rad)))
            yield said(trajectory_errors.Statistics.of(each.translation_m).as_plain())
    still = Trajectory.of_rows([(0.1 * n, 1.0, 2.0, 0.0) for n in range(8)])
    for speed in (0.0049, 0.0051):
        slow = Trajectory.of_rows([(0.1 * n, speed * 0.1 * n, 0.0, 0.0) for n in range(8)])
        turning = Trajectory.of_rows([(0.1 * n, 0.0, 0.0, speed * 0.1 * n) for n in range(8)])
        yield said([tried(alignment.first_motion_s, slow), tried(alignment.first_motion_s, turning)])
        for doubled in (slow, replace(turning, heading_rad=2 * turning.heading_rad)):
            yield tried(alignment.shift_by_speeds, way_of(draw), doubled)[:40]
    yield tried(alignment.least_squares_pose, still, still)
    yield tried(alignment.first_motion_s, still)
    for later in (-0.9, 0.0, 0.35, 1.0, 9.0):
        long = Trajectory.of_rows([(0.1 * n, 0.1 * n, 0.0, 0.0) for n in range(16)])
        yield tried(lambda by=later, one=long: [of_way(each) for each in alignment.on_common_times(one, one.later(by))])
    for rows in ([], [(0.0, 1.0, 2.0, 3.0)], [(0.0, 1.0, 2.0, 3.0)] * 2, [(1.0, 0.0, 0.0, 3.1), (0.5, 0.0, 0.0, -3.1)]):
        yield tried(lambda r=rows: of_way(Trajectory.of_rows(r)))
    yield tried(Trajectory, np.array([1.0, 1.0]), np.zeros(2), np.zeros(2), np.zeros(2))
    yield shown(wrapped(np.array([0.0, 3.1, 3.2, -3.1, -3.2, 7.0, -7.0])))
    yield said([heading_of(*(draw.uniform(-1, 1) for _ in range(4))) for _ in range(4)])
    yield said([tried(number_of, text, "mine.csv", 7) for text in ("1", " -2.5e3 ", "", "nan", "inf", "x" * 90)])


def onsets(draw: Random) -> Iterator[str]:
    """Answer commands by speeds that change soon, late, in ramps, before they are steady, or not at all."""
    for _ in range(14):
        sides = []
        for _ in range(2):
            speed, target, rows = 0.0, 0.0, list[tuple[float, float]]()
            for step in range(90):
                if draw.random() < 0.08:
                    target = draw.choice((0.0, 0.3, -0.2, 0.0051, 0.005))
                speed += float(np.clip(target - speed, *draw.choice(((-0.03, 0.03), (-0.03, 0.03), (-1.0, 1.0)))))
                rows.append((0.05 * step, round(speed, 6)))
            sides.append(steps_of(rows))
        commands = {name: steps_drawn(draw, (0.0, 100.0, 200.0)) for name in draw.sample(("VEL", "RVEL", "VEL2"), 2)}
        drive = Drive(name="d", parameters=P2DX, odometry=way_of(draw), left_mps=sides[0], right_mps=sides[1],
                      reported_left_mps=sides[1], reported_right_mps=sides[0], commands=commands)  # fmt: skip
        yield said([(name, changes(one)) for name, one in commands.items()])
        yield said([(one.command_s, one.onset_s, one.latency_s) for one in answers(drive)])
        yield said([(one.command_s, one.onset_s) for one in answers(drive, reported=True)])
        yield said([onset_after(sides[0], at, at + 1.0) for at in (-1.0, 0.0, 0.05, 0.1, 1.0, 2.0, 2.7, 4.4, 9.0)])
        yield said({key: value for key, value in metrics(drive).as_plain().items() if value is not None})
        yield shown(sides[0].at(np.array([-1.0, 0.0, 0.049, 0.05, 99.0])))
        yield of_steps(sides[0].later(0.25))
    t_s = np.arange(5.0)
    for values in ((0, 0, 0.005, 0, 0), (0, 0.005, 0, 0, 1), (0.005, 0, 0, 0, 1), (0, 0, 0, 0, 1), (0, 0, 0, 1, 1.005),
                   (0, 0, 0, 1, 1.006), (0, 0, 1, 0, 0), (1, 1, 1, 0.5, 0), (0, 0, 0, 0, -0.006)):  # fmt: skip
        steps = Steps(t_s, np.array(values, dtype=np.float64))
        yield f"{values} {said([onset_after(steps, at, until) for at in (0.9, 1.0, 1.5, 2.0) for until in (3.0, 4.0)])}"
    bare = Drive(name="d", parameters=P2DX)
    yield said([answers(bare), tried(lambda: bare.body), *(tried(bare.poses, w) for w in ("auto", "truth", "other"))])
    yield said([tried(lambda w=w: of_way(replace(bare, odometry=way_of(draw)).poses(w))) for w in ("auto", "truth")])


def partings(draw: Random) -> Iterator[str]:
    """Lay signals over one another that part for a while, for too short a while, or never, and say where it began."""
    for round_ in range(10):
        one, other = (
            Drive(
                name=name, parameters=P2DX, truth=way_of(draw, steps=90),
                sensors={n: steps_drawn(draw, (0.0, 1.0)) for n in (1, 2)},
                sonar_m={n: steps_drawn(draw, (1.0, 1.14, 1.16)) for n in (0, 3)},
                motors={1: steps_drawn(draw, (0.0, 1.0, -2.0), 3)},
                commands={"VEL": steps_drawn(draw, (0.0, 200.0), 3)},
                left_mps=steps_drawn(draw, (0.0, 0.2)), right_mps=steps_drawn(draw, (0.0, 0.2)), meta={"x": 1},
                events=[Text(t=10**9 * (round_ + 1), data=b"go"),
                        Pose(t=10**9 * (round_ + 2), x=1, y=1, z=0, heading=0, pitch=0, left=0, right=0, left_angle=0,
                             right_angle=0, collisions=0)],
            )
            for name in ("one", "other")
        )  # fmt: skip
        if round_ % 2:
            other = replace(other, truth=one.body.moved((0.3, 0.1, 0.2)).later(0.2), sensors={1: one.sensors[1]})
        if round_ % 3 == 0:
            other = replace(other, motors=one.motors, commands=one.commands, sonar_m={})
        ours, theirs = one.body, other.body.at(one.body.t_s)
        rows = parting.parts(one, other, draw.choice((0.0, 0.1)), ours, theirs)
        for row in rows:
            yield f"{row.bound} {said(row)}"
        yield said([parting.motion_parts_s(rows), parting.origin(rows), parting.origin(rows[:2]), parting.origin([])])
        for how in (How(), How(align="least-squares", at="moves", step_s=0.1), How(align="none", at="clocks"),
                    How(at="speeds"), How(shift_s=0.4, step_s=0.0), How(at="text go", poses=("truth", "auto")),
                    How(poses=("auto", "odometry")), How(at="text never"), How(at="what is this")):  # fmt: skip
            yield tried(lambda h=how, a=one, b=other: compare(a, b, h).as_plain())[:6000]
        found = compare(one, other)
        yield said([found.step_s, found.shift_s, found.pose, found.origin])
    yield tried(compare, replace(one, events=None), other, How(at="text go"))


CSV = "t_s,x_m,y_m,heading_deg,left_mps,right_mps,sonar_m_0,sonar_m_3{more}\n"
CSV_ROWS = """0,0,0,0,0,0,1.5,
0.1,0.02,0,10,0.2,0.21,,0.7

0.3,0.06,-0.01,-170,0.2,0.19,1.4,0.6
0.3,0.07,0,190,,,1,
"""
PACKET_ROWS = """0,0,0,0,0,0,1.5,,r2c,SIP
0.1,0.02,0,3.1,0.2,0.21,,0.7,r2c,SIP
0.3,0.06,-0.01,-3.1,0.2,0.19,1.4,0.6,r2c,SIP
"""
ARIA = """;Time,X,Y,Th,encX,encY,encTh,LeftV,RightV,CmdVel,CmdRotVel,CmdHead
1.0,5,6,7,0,0,0,0,0,200,na,na
; more
1.1,5,6,7,20,-3,-90,190,210,na,-10,45
"""
SCANS = """LaserOdometryLog
#
logTime: 0.5
velocities: 200.00 10.00 0.00
robot: 0 0 0.00
time: 1.0
robot: 100 0 2.50 9
"""


def files(draw: Random) -> Iterator[str]:
    """Read drives from tables and logs: whole, with a field otherwise, and with lines too many or too few."""
    texts: dict[str, str] = {
        "a.csv": CSV.format(more="") + CSV_ROWS,
        "packets.csv": CSV.format(more=",dir,type").replace("deg", "rad") + PACKET_ROWS,
        "b.tum": "# t x y z qx qy qz qw\n0 1 2 0 0 0 0 1\n0.5 1.1 2.2 0 0 0 0.5 0.8\n\n0.9 1.3 2 0 0.1 0.2 0.3 0.9\n",
        "aria.log": ARIA,
        "tabs.log": (";Time\tX\tY\tTh\n" + "1.0\t5\t6\t7:\n;Time\tX\tY\tTh\tCmdVel2\n" + "2.0\t50\t60\t70\t3\n"),
        "scans.2d": SCANS,
        "a.mine": "",
    }
    plugged = SimpleNamespace(
        knows=lambda path: path.suffix == ".mine",
        read=lambda path, parameters: Drive(name=path.name, parameters=parameters, odometry=way_of(Random(1))),
    )
    with (
        TemporaryDirectory(prefix="p2os-test-") as name,
        mock.patch.object(drive_files, "installed_points", lambda group: {"mine": group}),
        mock.patch.object(drive_files, "loaded", lambda point: {drive_files.READERS: plugged}[point]),
    ):
        folder = Path(name)
        for file, text in texts.items():
            path = folder / file
            path.write_text(text, encoding="utf-8")
            drive = read_drive(path, robot=draw.choice(("", "p3dx")))
            yield from of_drive(drive)
            write_tum(drive.body, folder / "out.tum")
            written = [float(word) for word in (folder / "out.tum").read_text(encoding="utf-8").split()]
            yield f"{is_recording(path)} {shown(written)}"
            rows = text.splitlines(keepends=True)
            for place, row in enumerate(rows):
                fields = row.split(",") if "," in row else row.split()
                changed = draw.randrange(len(fields) or 1)
                fields = ["x" if number == changed else one for number, one in enumerate(fields)]
                others = ((), (row, row), (row[:-2] + "\n",), (",".join(fields).rstrip("\n") + "\n",))
                for other in others:
                    path.write_text("".join((*rows[:place], *other, *rows[place + 1 :])), encoding="utf-8")
                    found = tried(lambda p=path: said([*of_drive(read_drive(p))]))
                    yield f"{file} {place} {found}".replace(name, "HERE")
        yield said([tried(read_drive, folder / each).replace(name, "HERE") for each in ("gone", ".")])
        yield said([is_recording(folder / each) for each in ("gone", ".")])
    for line in (";Time", "; TIME\tX", "laser odometry log", "LaserOdometryLog 3", "Time", ""):
        yield said([is_aria_log(line), tried(read_aria_log, "mine", [line], P2DX)])
    for columns in ("x,y,th,leftV", "rightV,x,y,th", "x,y,th,leftV,rightV", "x,y,th,encX,encY,encTh", "x,y", "x,y,th"):
        rows = [f"{second},{','.join(str(second * 100 + n) for n, _ in enumerate(columns.split(',')))}\n"
                for second in range(3)]  # fmt: skip
        lines = [f";Time,{columns}\n", *rows]
        yield f"{columns} {tried(lambda lines=lines: said([*of_drive(read_aria_log('mine', lines, P2DX))]))}"


def ranges(draw: Random) -> Iterator[str]:
    """Read ranges, sample them, and find effects of made-up outcomes."""
    for text in ("a=1..4", " a.b = -2 .. +3 ", "a=0.5..1", "a=2..1", "a=1..1", "a=1..", "=1..2", "a=x..2", "a=1..inf",
                 "a=1..2..3", ""):  # fmt: skip
        yield f"{text} {tried(read_range, text)}"
    three = (read_range("a=1..4"), read_range("b=0.5..2"), read_range("c=-3..3"))
    for steps, trajectories_, samples in ((0, 0, 0), (1, 0, 0), (2, 0, 0), (5, 2, 0), (0, 3, 4), (3, 0, -1), (3, 0, 6)):
        design = tried(SampleDesign, ranges=three, steps=steps, trajectories=trajectories_, seed=4, samples=samples)
        yield design
        if "Error" in design:
            continue
        made = SampleDesign(ranges=three, steps=steps, trajectories=trajectories_, seed=4, samples=samples)
        points = made.points()
        yield said([len(points), points[:9], [made.settings(point) for point in points[-2:]]])
        if not samples:
            yield said([one.as_plain() for one in made.effects(lambda p: p[0] ** 2 - p[1] + p[0] * p[2])])
            yield said([(one.spread, one.size) for one in made.effects(lambda p: p[0] + 2 * p[1])])
    for alone in ((), (1.0, 3.0)):
        for mu_star in (None, 5.0):
            effect = ParameterEffect(key="k", alone=alone, mu=None, mu_star=mu_star, mu_star_conf=None, sigma=None)
            yield said([effect.size, replace(effect, ST=0.0).size, effect.spread])
    found: list[Mapping[str, float]] = [{"goal 1 a": 1.0, "path_m": 2.0, "x": 1.0}, {"goal 1 a": 2.0, "path_m": 3.0}]
    for wanted in ([], ["path_m"], ["x"], ["goal 1 a"]):
        yield said([tried(outcome_names, found, wanted), tried(outcome_names, [{"path_m": 1.0}], wanted)])


def outcomes(_draw: Random) -> Iterator[str]:
    """Run short scenarios for what they come to: with goals that have a margin, and that have none."""
    looks: list[int] = []
    dodge = load_scenario("dodge", firmware=hurried("dodge", 1)).with_options(
        mode="direct", body="kinematic", duration_s=0.6)  # fmt: skip
    for scenario in (dodge, replace(dodge, goals=()), load_scenario("two-dodge")):
        yield tried(outcomes_of, scenario, looks.append)
        yield said(looks[-1:])
        looks.clear()


TRACES: dict[str, Trace] = {
    "outcomes": outcomes,
    "trajectories": trajectories, "onsets": onsets, "partings": partings, "files": files,
    "declared": declared_of("robot_bench.drives", "robot_bench.experiments"), "ranges": ranges,
}  # fmt: skip
test_what_experiments_make_of_drives_is_what_was_approved = judge_of(__file__, TRACES)
