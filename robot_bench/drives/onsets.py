"""When motion answers a command: the onset of a change of speed, between samples.

Speeds come in samples (50 ms in a trace, 100 ms in packets) and change in ramps. Where two samples lie on one ramp, the
line through them is followed back to the speed before it; else the onset lies somewhere before the first sample that
differs, and the middle of that gap is taken.

Invariant: an onset is never before the command that it answers, nor after the sample that shows it.
"""

from dataclasses import dataclass

import numpy as np

from robot_bench.drives.drive import Drive, Floats, Steps

#: chosen: a speed that differs by more has begun to change, m/s: above the wire's grain of 1 mm/s.
CHANGED_MPS = 0.005
#: chosen: later than this a motion answers something else, seconds.
LONGEST_S = 1.0
#: Commands that set speeds.
SPEED_COMMANDS = ("VEL", "RVEL", "VEL2")


@dataclass(frozen=True, slots=True)
class CommandResponse:
    """A command and when the wheels answered it, seconds."""

    command_s: float
    onset_s: float

    @property
    def latency_s(self) -> float:
        """Seconds from one to the other."""
        return self.onset_s - self.command_s


def answers(drive: Drive, *, told: bool = False) -> list[CommandResponse]:
    """Return each command that changes a set speed with the wheels' answer to it, where there is one.

    Args:
        drive: Has commands and the rims' speeds.
        told: By the packets' speeds, also where the body's own are known.
    """
    left, right = (drive.told_left_mps, drive.told_right_mps) if told else (drive.left_mps, drive.right_mps)
    if left is None or right is None or not len(left.t_s):
        return []
    times = sorted(at for name in SPEED_COMMANDS if name in drive.commands for at in changes(drive.commands[name]))
    # Commands of one cycle (VEL and RVEL) are one; what is told meanwhile again changes nothing.
    firsts = [at for place, at in enumerate(times) if place == 0 or at - times[place - 1] > _TOGETHER_S]
    found = []
    for place, at in enumerate(firsts):
        until = min(at + LONGEST_S, firsts[place + 1] if place + 1 < len(firsts) else np.inf)
        onsets = [onset for side in (left, right) if (onset := onset_after(side, at, until)) is not None]
        if onsets:
            found.append(CommandResponse(at, min(onsets)))
    return found


#: chosen: VEL and RVEL of one decision follow each other on the line within this, seconds.
_TOGETHER_S = 0.03


def changes(steps: Steps) -> list[float]:
    """Return when a value becomes another, the first time included if it is not 0."""
    before = np.concatenate(([0.0], steps.values[:-1]))
    return [float(at) for at in steps.t_s[steps.values != before]]


def onset_after(speed: Steps, at_s: float, until_s: float) -> float | None:
    """Return when a speed leaves what it was at a time, None where it keeps until `until_s`, or was not steady."""
    place = int(np.searchsorted(speed.t_s, at_s, side="right"))
    if place < 2 or place >= len(speed.t_s):
        return None
    was, values, times = speed.values[place - 1], speed.values, speed.t_s
    if abs(values[place - 2] - was) > CHANGED_MPS:
        return None  # still on its way somewhere
    while place < len(times) and times[place] <= until_s:
        if abs(values[place] - was) > CHANGED_MPS:
            return _followed_back(times, values, place, float(was), at_s)
        place += 1
    return None


def _followed_back(times: Floats, values: Floats, place: int, was: float, at_s: float) -> float:
    earliest, shown = max(float(times[place - 1]), at_s), float(times[place])
    if place + 1 < len(times):
        rate = (values[place + 1] - values[place]) / (times[place + 1] - times[place])
        left = values[place] - was
        if rate * left > 0 and abs(values[place + 1] - was) > abs(left) + CHANGED_MPS:
            return float(min(max(shown - left / rate, at_s), shown))
    return (earliest + shown) / 2
