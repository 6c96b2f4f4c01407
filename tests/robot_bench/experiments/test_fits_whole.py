"""What every fit makes of one short drive, to four digits, as it is kept; and what such a drive is made of."""

import hashlib
import random
from collections.abc import Iterator

import numpy as np

from p2os.capture import write_recording
from p2os.pioneer.world import load_world
from p2os.pioneer.world.model import Pose
from p2os.robots.parameters import load_parameters
from robot_bench.drives.drive import Drive, Trajectory
from robot_bench.experiments.fitting import examples
from robot_bench.experiments.fitting.least_squares import Estimate, Fit
from robot_bench.experiments.fitting.ramps import fit_ramps
from robot_bench.experiments.fitting.robot_files import errors_text, robot_text
from robot_bench.experiments.fitting.sonar import fit_sonar, walls_of
from robot_bench.experiments.fitting.umbmark import umbmark
from robot_bench.experiments.fitting.wheels import fit_wheels
from tests.robot_bench.experiments.synthetic_robots import WALLS, Planted, drive
from tests.robot_bench.recording.kept_lines import is_as_kept

P2DX = load_parameters("p2dx")


def lines_of(name: str, found: Fit) -> Iterator[str]:
    yield f"{name}: {found.count} residuals of {found.residual:.3g}"
    for key, one in found.estimates.items():
        yield f"  {key} {' '.join(f'{value:.4g}' for value in one.as_plain().values() if isinstance(value, float))}"
    yield from (f"  {key}: {why}" for key, why in found.unseen.items())


def test_what_fits_make_of_a_drive() -> None:
    source = random.Random(12)
    robot = Planted.drawn(source)
    driven = drive(P2DX, robot, source, 30.0)
    fits = {"wheels": fit_wheels([driven]), "ramps": fit_ramps([driven]), "sonar": fit_sonar([driven], WALLS)}
    lines = [line for name, found in fits.items() for line in lines_of(name, found)]
    assert is_as_kept(lines, "fits_of_a_drive")


def square_of(clockwise: bool, off: float, steps: int = 200) -> Drive:
    """A square of 2 m whose robot believes it to be closed, and which ends beside."""
    side = np.repeat([0, 1, 2, 3], steps // 4)
    heading = np.where(clockwise, -1, 1) * side * np.pi / 2
    ahead = 8.0 / steps
    x, y = (np.concatenate(([0.0], np.cumsum(ahead * along(heading)))) for along in (np.cos, np.sin))
    headings = np.concatenate((heading, heading[-1:]))
    t = np.arange(steps + 1) * 0.1
    truth = Trajectory(t, x + off * t / t[-1], y - 2 * off * t / t[-1], headings + 0.3)
    return Drive(name=f"square{off:g}", parameters=P2DX, odometry=Trajectory(t, x, y, headings), truth=truth)


def test_what_squares_come_to() -> None:
    found = umbmark([square_of(True, 0.05), square_of(True, 0.07), square_of(False, -0.02), square_of(False, -0.03)])
    plain = {name: getattr(found, name).as_plain() for name in ("before", "formulas", "least_squares")}
    rows = [(run.name, run.is_clockwise, *error) for run, error in
            zip(found.squares, found.errors(found.formulas), strict=True)]  # fmt: skip
    lines = [
        *lines_of("squares", found.fit),
        *(f"{name} {[f'{value:.5g}' for value in values.values()]}" for name, values in plain.items()),
        *(f"{name} {is_clockwise} {x:.5g} {y:.5g}" for name, is_clockwise, x, y in rows),
    ]
    assert is_as_kept(lines, "fits_of_squares")


def test_what_an_example_is_made_of() -> None:
    lines = []
    for seed, noise in ((1, True), (2, False)):
        robot = examples.planted(seed, noise=noise)
        lines += [*robot.texts.values(), str(robot.errors), str(examples.wandering(seed, 9.0))]
        stages = [*examples.wandering(seed, 2.0), *examples.square(clockwise=noise, side_mm=100)[:2]]
        found = examples.record(robot, load_world("room") if noise else examples.empty_world(), stages, seed=seed,
                                camera=noise, start=None if noise else Pose(1.0, 2.0, 0.5))  # fmt: skip
        text = write_recording(found.capture)
        lines += [f"{len(found.capture.chunks)} chunks {hashlib.sha256(text.encode()).hexdigest()[:16]}"]
        lines += [" ".join(f"{value:.5g}" for value in pose) for pose in found.poses[::40]]
    lines += [
        str(examples.square(clockwise=True)),
        str(examples.empty_world()),
        f"{len(walls_of(load_world('room'), P2DX))}",
    ]
    lines += [" ".join(f"{value:.5g}" for value in row) for row in walls_of(load_world("arena"), P2DX)[::9]]
    assert is_as_kept("\n".join(lines).splitlines(), "fits_examples")


def test_what_is_written_of_a_fit() -> None:
    names = ("track_mm", "accel_mm_s2", "rot_decel_deg_s2", "cone_deg", "left_wheel", "right_wheel", "noise_m",
             "command_delay_s", "turn_gain")  # fmt: skip
    found = {name: Estimate(name=name, value=n + 1.23456, low=n + 1.0, high=n + 1.5) for n, name in enumerate(names)}
    lines = []
    for kept in (found, {"left_wheel": found["left_wheel"], "noise_m": found["noise_m"]}, {}):
        lines += robot_text("p2dx", P2DX, kept).split("\n") + errors_text(P2DX, kept).split("\n")
    assert is_as_kept(lines, "fits_written")
