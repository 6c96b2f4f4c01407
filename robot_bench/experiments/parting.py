"""Where two drives part, and where it came from: sensor, firmware, wire or motion.

Each signal of both is laid over the other; it parts where it differs by more than its bound for longer than its pause.
Where the motion parts, it came from what differed when it did, or until `REACH_S` before: of that the first, for a
difference that comes later along the chain follows from it. What differed before and agreed again, as pins before an
adapter is connected, led to nothing. Signals that part within `TOGETHER_S` of the first count as one, and of these the
one that stands first in the chain is the cause.

Not seen: what has no signal in both recordings, as the ground under the wheels.
"""

from dataclasses import dataclass

import numpy as np

from robot_bench.drives.drive import Drive, Floats, Steps, Trajectory, wrapped

#: chosen: a change goes through the whole chain within this, seconds: the adapter's period and two of the robot's.
TOGETHER_S = 0.3
#: chosen: a program answers a sensor within this, and a ramp becomes a difference of speed, seconds.
REACH_S = 1.0
#: chosen: seconds between the times at which signals are looked at.
LOOK_S = 0.01
CHAIN = ("sensor", "firmware", "wire", "motion")


@dataclass(frozen=True, slots=True)
class SignalTolerance:
    """A signal may differ by so much, and by more for no longer than `pause_s`."""

    stage: str
    unit: str
    most: float
    pause_s: float


#: chosen: sonar by its beam's grain and the 100 ms of a reading; pins and commands by the periods of who reads them;
#: motion by what a person sees on a plan.
BOUNDS = {
    "sensor pin": SignalTolerance("sensor", "", 0.5, 0.25),
    "sonar": SignalTolerance("sensor", "m", 0.15, 0.5),
    "motor pins": SignalTolerance("firmware", "steps", 0.5, 0.25),
    "command": SignalTolerance("wire", "", 0.5, 0.25),
    "speed": SignalTolerance("motion", "m/s", 0.05, 0.25),
    "turn rate": SignalTolerance("motion", "rad/s", 0.2, 0.25),
    "position": SignalTolerance("motion", "m", 0.05, 0.0),
    "heading": SignalTolerance("motion", "rad", 0.05, 0.0),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class SignalParting:
    """A signal that both drives have, and where it parts: None where it never does."""

    signal: str
    kind: str
    #: In the bound's unit: the root of the mean square of the difference, the largest one, and when.
    rms: float
    largest: float
    largest_s: float
    parts_s: float | None
    ours: float = 0.0
    theirs: float = 0.0
    #: From when until when it differed, every time that it lasted.
    spans: tuple[tuple[float, float], ...] = ()

    @property
    def bound(self) -> SignalTolerance:
        """What it was judged by."""
        return BOUNDS[self.kind]


def parts(one: Drive, other: Drive, shift_s: float, ours: Trajectory, theirs: Trajectory) -> list[SignalParting]:
    """Return every signal that both have, the first to part first, then those that never do.

    Args:
        one: The reference.
        other: The other one.
        shift_s: By how much the other's times are later in the reference's.
        ours: The reference's poses.
        theirs: The other's at the same times and in the same place.
    """
    grid = np.arange(ours.t_s[0], ours.t_s[-1], LOOK_S)

    def held(name: str, kind: str, a: Steps | None, b: Steps | None) -> SignalParting | None:
        if a is None or b is None or not len(a.t_s) or not len(b.t_s):
            return None
        return _part(name, kind, grid, a.at(grid), b.later(shift_s).at(grid))

    found = [held(f"sensor {n}", "sensor pin", one.sensors[n], other.sensors.get(n)) for n in one.sensors]
    found += [held(f"sonar {n + 1}", "sonar", one.sonar_m[n], other.sonar_m.get(n)) for n in sorted(one.sonar_m)]
    found += [held(f"motor {n}", "motor pins", one.motors[n], other.motors.get(n)) for n in one.motors]
    found += [
        held(f"command {name}", "command", one.commands[name], other.commands.get(name))
        for name in ("VEL", "RVEL", "VEL2") if name in one.commands
    ]  # fmt: skip
    at, speed, turn = ours.speeds()
    _, their_speed, their_turn = theirs.speeds()
    moved: list[tuple[str, Floats, Floats, Floats]] = [
        ("speed", at, speed, their_speed), ("turn rate", at, turn, their_turn),
        ("heading", ours.t_s, ours.heading_rad, theirs.heading_rad),
    ]  # fmt: skip
    found += [_part(name, name, times, a, b) for name, times, a, b in moved]
    apart = np.hypot(theirs.x_m - ours.x_m, theirs.y_m - ours.y_m)
    found.append(_part("position", "position", ours.t_s, np.zeros_like(apart), apart))
    rows = [part for part in found if part is not None]
    return sorted(rows, key=lambda part: np.inf if part.parts_s is None else part.parts_s)


def motion_parts_s(rows: list[SignalParting]) -> float | None:
    """Return when the motion parts; None where it does not."""
    return min((row.parts_s for row in rows if row.bound.stage == CHAIN[-1] and row.parts_s is not None), default=None)


def origin(rows: list[SignalParting]) -> tuple[SignalParting, float] | None:
    """Return where the difference came from and when: of the motion's where that parts, else of what parted first."""
    at = motion_parts_s(rows)
    found = [
        (begin, row) for row in rows for begin, end in row.spans
        if at is None or (begin <= at and end >= at - REACH_S)
    ]  # fmt: skip
    if not found:
        return None
    first = min(begin for begin, _ in found)
    together = [pair for pair in found if pair[0] <= first + TOGETHER_S]
    begin, row = min(together, key=lambda pair: (CHAIN.index(pair[1].bound.stage), pair[0]))
    return row, begin


def _part(name: str, kind: str, times: Floats, ours: Floats, theirs: Floats) -> SignalParting | None:
    known = ~(np.isnan(ours) | np.isnan(theirs))
    if known.sum() < 2:
        return None
    times, ours, theirs = times[known], ours[known], theirs[known]
    difference = np.abs(wrapped(ours - theirs) if kind == "heading" else ours - theirs)
    bound, largest = BOUNDS[kind], int(np.argmax(difference))
    rms = float(np.sqrt(np.mean(difference**2)))
    spans = _lasting(times, difference > bound.most, bound.pause_s)
    most = float(difference[largest]), float(times[largest])
    if not spans:
        return SignalParting(name, kind, rms, *most, None)
    place = spans[0][0]
    return SignalParting(
        name, kind, rms, *most, float(times[place]), float(ours[place]), float(theirs[place]),
        tuple((float(times[begin]), float(times[last])) for begin, last in spans),
    )  # fmt: skip


def _lasting(
    times: Floats, apart: "np.ndarray[tuple[int], np.dtype[np.bool_]]", pause_s: float
) -> list[tuple[int, int]]:
    """Return the first and last place of each time for which it is so for longer than a pause."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], apart, [False])).astype(np.int8)))
    pairs = zip(edges[::2].tolist(), (edges[1::2] - 1).tolist(), strict=True)
    return [(first, last) for first, last in pairs if times[last] - times[first] >= pause_s]
