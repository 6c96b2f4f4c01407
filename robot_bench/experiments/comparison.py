"""Two drives compared: how they were brought together, how far they are apart, where they part.

Invariant: the figures of errors are those of the two trajectories that `comparison.ours` and `theirs` hold, and of
nothing else, so that any program that reads them written as TUM files finds the same.
"""

from dataclasses import dataclass

import numpy as np

from robot_bench.drives.drive import Drive, Floats, Trajectory
from robot_bench.drives.latency_budget import quantiles
from robot_bench.drives.onsets import answers
from robot_bench.events.codec import Json
from robot_bench.events.selection import select
from robot_bench.experiments.alignment import (
    first_motion_s,
    first_pose,
    least_squares_pose,
    on_common_times,
    shift_by_speeds,
)
from robot_bench.experiments.parting import SignalParting, motion_parts_s, origin, parts
from robot_bench.experiments.trajectory_errors import Statistics, absolute_errors, relative_errors
from simbase.errors import UsageError
from simbase.timing import NS_PER_S

#: How trajectories are laid over one another.
ALIGNMENTS = {"first": first_pose, "least-squares": least_squares_pose}
NONE = "none"
#: What `--at` takes for any recording, beside the words of events: the first motion, the speeds all along, the clocks.
MOVES, SPEEDS, CLOCKS = "moves", "speeds", "clocks"


@dataclass(frozen=True, slots=True, kw_only=True)
class How:
    """How two drives are compared.

    Args:
        poses: Whose of each: `auto`, `truth` or `odometry`, of the first and of the second.
        align: In space: `first`, `least-squares` or `none`.
        at: What is at one time in both: an event in words, `moves`, `speeds` or `clocks`; empty: the clocks of two runs
            in virtual time, which begin together, and else the speeds.
        shift_s: The shift in time; None: as `at` says.
        step_s: Length of the steps of the relative error, seconds.
    """

    poses: tuple[str, str] = ("auto", "auto")
    align: str = "first"
    at: str = ""
    shift_s: float | None = None
    step_s: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Comparison:
    """What came of it."""

    one: Drive
    other: Drive
    how: How
    shift_s: float
    pose: tuple[float, float, float]
    #: At the same times, in the same place.
    ours: Trajectory
    theirs: Trajectory
    step: int
    ape_m: Statistics
    ape_rad: Statistics
    rpe_m: Statistics
    rpe_rad: Statistics
    speed_mps: Statistics
    turn_radps: Statistics
    latency_s: tuple[Floats, Floats]
    parts: list[SignalParting]

    @property
    def origin(self) -> tuple[SignalParting, float] | None:
        """Where the difference came from, and when; None where the drives do not part."""
        return origin(self.parts)

    @property
    def step_s(self) -> float:
        """Length of a step of the relative error, seconds, in the median."""
        return float(np.median(np.diff(self.ours.t_s)) * self.step)

    def as_plain(self) -> Json:
        """Return it for JSON; lengths in metres, angles in radians, times in seconds."""
        came = self.origin
        return {
            "reference": self.one.name,
            "other": self.other.name,
            "shift_s": self.shift_s,
            "align": self.how.align,
            "moved": dict(zip(("x_m", "y_m", "turn_rad"), self.pose, strict=True)),
            "poses": len(self.ours),
            "from_s": float(self.ours.t_s[0]),
            "to_s": float(self.ours.t_s[-1]),
            "path_m": [self.ours.path_m, self.theirs.path_m],
            "ape_translation_m": self.ape_m.as_plain(),
            "ape_rotation_rad": self.ape_rad.as_plain(),
            "rpe_step_poses": self.step,
            "rpe_translation_m": self.rpe_m.as_plain(),
            "rpe_rotation_rad": self.rpe_rad.as_plain(),
            "speed_difference_mps": self.speed_mps.as_plain(),
            "turn_rate_difference_radps": self.turn_radps.as_plain(),
            "command_to_motion_s": [quantiles(found) for found in self.latency_s],
            "signals": [
                {
                    "signal": part.signal, "stage": part.bound.stage, "unit": part.bound.unit, "bound": part.bound.most,
                    "rms": part.rms, "largest": part.largest, "largest_at_s": part.largest_s,
                    "parts_at_s": part.parts_s,
                }
                for part in self.parts
            ],
            "motion_parts_at_s": motion_parts_s(self.parts),
            "came_from": None if came is None else {"stage": came[0].bound.stage, "signal": came[0].signal,
                                                    "at_s": came[1]},
        }  # fmt: skip


def compare(one: Drive, other: Drive, how: How | None = None) -> Comparison:
    """Compare a drive with a reference.

    Raises:
        UsageError: They cannot be brought together.
        FileError: One has no such poses.
    """
    how = how or How()
    whole = one.poses(how.poses[0]), other.poses(how.poses[1])
    shift = _shift(one, other, *whole, how)
    ours, theirs = on_common_times(whole[0], whole[1].later(shift))
    pose = (0.0, 0.0, 0.0) if how.align == NONE else ALIGNMENTS[how.align](ours, theirs)
    theirs = theirs.moved(pose)
    step = max(1, round(how.step_s / float(np.median(np.diff(ours.t_s)))))
    absolute, relative = absolute_errors(ours, theirs), relative_errors(ours, theirs, step)
    (_, speed, turn), (_, their_speed, their_turn) = ours.speeds(), theirs.speeds()
    latencies = [np.array([answer.latency_s for answer in answers(drive)]) for drive in (one, other)]
    return Comparison(
        one=one, other=other, how=how, shift_s=shift, pose=pose, ours=ours, theirs=theirs, step=step,
        ape_m=Statistics.of(absolute.translation_m), ape_rad=Statistics.of(absolute.rotation_rad),
        rpe_m=Statistics.of(relative.translation_m), rpe_rad=Statistics.of(relative.rotation_rad),
        speed_mps=Statistics.of(np.abs(their_speed - speed)), turn_radps=Statistics.of(np.abs(their_turn - turn)),
        latency_s=(latencies[0], latencies[1]),
        parts=parts(one, other, shift, ours, theirs),
    )  # fmt: skip


def _shift(one: Drive, other: Drive, ours: Trajectory, theirs: Trajectory, how: How) -> float:
    if how.shift_s is not None:
        return how.shift_s
    are_runs = one.truth is ours and other.truth is theirs and bool(one.meta and other.meta)
    if how.at == CLOCKS or (not how.at and are_runs):
        return 0.0
    if how.at in {"", SPEEDS}:
        return shift_by_speeds(ours, theirs)
    if how.at == MOVES:
        return first_motion_s(ours) - first_motion_s(theirs)
    return event_s(one, how.at) - event_s(other, how.at)


def event_s(drive: Drive, words: str) -> float:
    """Return when the first event happens that a line of words means, seconds.

    Raises:
        UsageError: The words mean nothing, it never happens, or the drive has no events.
    """
    selector = select(words)
    if drive.events is None:
        raise UsageError(f"{drive.name} has no events", hint=f"--at {MOVES}, or --shift")
    for event in drive.events:
        if isinstance(event, selector.kinds) and selector.takes(event):
            return event.t / NS_PER_S
    raise UsageError(f"{words!r} never happens in {drive.name}", hint=f"--at {MOVES}")
