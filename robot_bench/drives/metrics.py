"""Figures of one drive: way, time, smoothness, clearance, energy, goals, and the latency budget of its loop.

Smoothness, of the speed v of the middle between the wheels at times a step h apart (50 ms in a trace), with jerk
j_k = (v_(k+1) - 2 v_k + v_(k-1)) / h²:

    mean square jerk  = mean of j_k², m²/s⁶
    log dimensionless jerk = -ln( T³/v_max² · sum of j_k² · h ), with the span T (Balasubramanian and others, IEEE
        Transactions on Biomedical Engineering 59, 2012): greater is smoother, whatever the speed and the span.

Invariant: a figure that a recording does not tell is None, never 0.
"""

from dataclasses import dataclass

import numpy as np

from robot_bench.drives.drive import Drive, Floats
from robot_bench.drives.latency_budget import STEPS, WHOLE, LatencyBudget, latency_budget, quantiles
from robot_bench.events.codec import Json
from robot_bench.events.kinds import Clearance, Contact, Pose, Verdict
from simbase.timing import NS_PER_S

#: chosen: slower is a stand, m/s; as the events `robot moves` and `robot stops` have it.
STILL_MPS = 0.005
#: Figure → what it is, unit, decimals.
SHOWN: dict[str, tuple[str, str, int]] = {
    "span_s": ("time", "s", 1),
    "path_m": ("way", "m", 2),
    "turned_deg": ("turned", "deg", 0),
    "mean_mps": ("mean speed", "m/s", 3),
    "max_mps": ("top speed", "m/s", 3),
    "standing_share": ("standing, of the time", "", 3),
    "mean_square_jerk_m2_s6": ("mean square jerk", "m²/s⁶", 3),
    "log_dimensionless_jerk": ("log dimensionless jerk", "", 2),
    "max_rim_mps2": ("a rim's greatest acceleration", "m/s²", 2),
    "clearance_m": ("least clearance", "m", 3),
    "contacts": ("contacts", "", 0),
    "energy_j": ("work at the rims", "J", 1),
    "energy_j_per_m": ("work a metre", "J/m", 2),
    "time_to_goal_s": ("all goals met at", "s", 2),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Metrics:
    """Of one drive. Lengths in metres, times in seconds; None where the recording does not tell it."""

    name: str
    span_s: float
    path_m: float
    turned_deg: float
    mean_mps: float
    max_mps: float
    standing_share: float
    mean_square_jerk_m2_s6: float | None
    log_dimensionless_jerk: float | None
    max_rim_mps2: float | None
    clearance_m: float | None
    contacts: int | None
    energy_j: float | None
    energy_j_per_m: float | None
    #: What each goal came to: name, whether it was met, when; None twice where the run left it open.
    goals: tuple[tuple[str, bool | None, float | None], ...]
    latency: LatencyBudget

    @property
    def time_to_goal_s(self) -> float | None:
        """When the last of all goals was met; None where one was missed or left open, or there are none."""
        times = [at for _, met, at in self.goals if met and at is not None]
        return max(times) if times and len(times) == len(self.goals) else None

    def as_plain(self) -> Json:
        """Return it for JSON."""
        names = [name for name in self.__slots__ if name not in {"goals", "latency"}]
        return {
            **{name: getattr(self, name) for name in names},
            "time_to_goal_s": self.time_to_goal_s,
            "goals": [{"goal": goal, "met": met, "at_s": at} for goal, met, at in self.goals],
            "latency_s": {name: quantiles(self.latency.of(name)) for name in (*STEPS, WHOLE)},
        }


def metrics(drive: Drive) -> Metrics:
    """Measure a drive.

    Raises:
        FileError: It has no poses.
    """
    way = drive.body
    at, speed, turn = way.speeds()
    span, path = float(way.t_s[-1] - way.t_s[0]), way.path_m
    events = drive.events or []
    jerk, smoothness = _smoothness(at, speed)
    poses = [event for event in events if isinstance(event, Pose)]
    energy = None if not poses or poses[-1].work is None else poses[-1].work / 1e6
    clearances = [event.um / 1e6 for event in events if isinstance(event, Clearance)]
    return Metrics(
        name=drive.name, span_s=span, path_m=path, turned_deg=float(np.degrees(np.abs(np.diff(way.heading_rad)).sum())),
        mean_mps=path / span, max_mps=float(np.abs(speed).max()),
        standing_share=float(np.mean((np.abs(speed) < STILL_MPS) & (np.abs(turn) < 2 * STILL_MPS))),
        mean_square_jerk_m2_s6=jerk, log_dimensionless_jerk=smoothness, max_rim_mps2=_rims(drive),
        clearance_m=min(clearances) if clearances else None,
        contacts=sum(isinstance(event, Contact) for event in events) if drive.truth is not None and events else None,
        energy_j=energy, energy_j_per_m=energy / path if energy is not None and path > 0 else None,
        goals=(
            *((one.goal, one.met, one.t / NS_PER_S) for one in events if isinstance(one, Verdict)),
            *((goal, None, None) for goal in drive.open_goals),
        ),
        latency=latency_budget(drive),
    )  # fmt: skip


def _smoothness(times: Floats, speed: Floats) -> tuple[float | None, float | None]:
    """Return mean square jerk and log dimensionless jerk of a speed, brought to equal steps."""
    if len(times) < 3:
        return None, None
    step = float(np.median(np.diff(times)))
    grid = np.arange(times[0], times[-1] + step / 2, step)
    jerk = np.diff(np.interp(grid, times, speed), 2) / step**2
    square, top = float(np.mean(jerk**2)), float(np.abs(speed).max())
    span = float(grid[-1] - grid[0])
    total = span**3 / top**2 * float((jerk**2).sum()) * step if top > 0 else 0.0
    return square, -float(np.log(total)) if total > 0 else None


def _rims(drive: Drive) -> float | None:
    """Return how fast a rim changed its speed at most, from sample to sample, m/s²."""
    found = [
        float(np.abs(np.diff(side.values) / np.diff(side.t_s)).max())
        for side in (drive.left_mps, drive.right_mps) if side is not None and len(side.t_s) > 1
    ]  # fmt: skip
    return max(found, default=None)
