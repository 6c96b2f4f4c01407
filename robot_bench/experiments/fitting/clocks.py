"""Measured poses that run on another clock than the packets: brought onto the packets' own.

A camera's clock begins when it likes. Packets come late by less than half a second; where the speeds of odometry and
measured poses agree best at any other shift, the clocks are two, and a delay cannot be told from the shift between
them: the poses are moved until odometry and measurement agree, and what has a delay in it is named and not given.
"""

from collections.abc import Sequence
from dataclasses import replace

from robot_bench.drives.drive import Drive
from robot_bench.experiments.alignment import shift_by_speeds
from robot_bench.experiments.fitting.least_squares import Fit
from simbase.errors import UsageError

#: chosen: how late packets come that are on the clock of the poses, seconds.
LEAST_LATE_S, MOST_LATE_S = -0.1, 0.5
#: What cannot be told from a shift of clocks.
DELAYS = ("packet_delay_s", "sonar_delay_s")


def on_one_clock(drives: Sequence[Drive]) -> tuple[list[Drive], str]:
    """Return drives whose measured poses are on the packets' clock, and why delays are not seen; empty where they are.

    A drive without odometry, without measured poses, or without motion is as it was.
    """
    found, moved = [], list[str]()
    for drive in drives:
        shift = _shift_s(drive)
        if LEAST_LATE_S <= shift <= MOST_LATE_S or drive.truth is None:
            found.append(drive)
            continue
        found.append(replace(drive, truth=drive.truth.later(shift)))
        moved.append(f"{drive.name} by {shift:.2f} s")
    return found, f"the measured poses run on another clock: {', '.join(moved)}" if moved else ""


def without_delays(fit: Fit, why: str) -> Fit:
    """Return a fit whose delays are unseen for a reason; as it was for none."""
    if not why:
        return fit
    estimates = {name: one for name, one in fit.estimates.items() if name not in DELAYS}
    delays = [name for name in DELAYS if name in fit.estimates]
    return replace(fit, estimates=estimates, unseen=fit.unseen | dict.fromkeys(delays, why))


def _shift_s(drive: Drive) -> float:
    """Return how much later than its measured poses a drive's odometry is, seconds; 0 where that cannot be told."""
    if drive.truth is None or drive.odometry is None:
        return 0.0
    try:
        return -shift_by_speeds(drive.truth, drive.odometry)
    except UsageError:
        return 0.0
