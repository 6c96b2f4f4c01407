"""Until when a failure could still be avoided: the latest time at which stopping the motors avoids it.

The run is repeated, and saved each half second. From a time on all wires of the motors are held low, which is the code
for a standing wheel, whatever the firmware commands; if the goal that was missed
is not missed until `WATCHED_NS` after it was, the failure was still avoidable then. The latest such time is found by
halving: first among the saved states, then in steps of 50 ms between two of them. Where stopping at the very
beginning does not avoid it, there is none; of a goal that asks for motion that is so.

Invariant: the run without the stop is the very run that failed.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

from adapter_sim.pinout import WireRole, load_pinout
from p2os.errors import ScenarioError
from robot_bench.bench import Bench, run_of
from robot_bench.campaign.trial import Trial, bench_of, unpacked
from robot_bench.scenario.hands.actions import Action
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

#: chosen: how often the run is saved.
SAVED_EACH_NS: Nanos = 500 * NS_PER_MS
#: How exactly the time is found: the poses that goals are judged by.
STEP_NS: Nanos = 50 * NS_PER_MS
#: chosen: what stands as long after the failure has avoided it.
WATCHED_NS: Nanos = 2 * NS_PER_S


@dataclass(frozen=True, slots=True, kw_only=True)
class LastMoment:
    """When a failure was still avoidable."""

    #: The goal that was missed, as a sentence of what was wrong.
    failure: str
    failed_ns: Nanos
    #: None: stopping never avoids it.
    avoidable_ns: Nanos | None
    #: Where the robot was then: metres, degrees.
    place: tuple[float, float, float] | None
    #: What the firmware had printed last.
    printed: str

    @property
    def words(self) -> str:
        """A sentence for a person."""
        at = f"{self.failed_ns / NS_PER_S:.2f} s"
        if self.avoidable_ns is None or self.place is None:
            return f"missed at {at}; stopping the motors never avoids it"
        x_m, y_m, heading_deg = self.place
        return (
            f"missed at {at}; until {self.avoidable_ns / NS_PER_S:.2f} s, at x {x_m:.2f} m, y {y_m:.2f} m, heading "
            f"{heading_deg:.0f}°, stopping the motors avoids it"
        )


def last_moment(trial: Trial, look: Callable[[], None] = lambda: None) -> LastMoment | None:
    """Return until when the first failure of a trial's run was avoidable; None where no goal is missed in the run.

    Args:
        trial: It failed.
        look: Called between slices.

    Raises:
        ScenarioError: It has several robots, or one on own pins, whose wires need not stop it when they are low.
    """
    with unpacked(trial.files) as folder:
        scenario = trial.scenario(folder)
        if scenario.robots or scenario.own_robot is not None:
            raise ScenarioError("the last moment is found for a Pioneer alone in its world")
        bench = bench_of(scenario)
        bench.on_slice = lambda _now: look()
        return _Search(bench).find()


class _Search:
    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        self._saved: list[tuple[Nanos, object]] = []
        self._failed_ns: Nanos = 0
        #: The place of the goal that was missed.
        self._goal = 0

    def find(self) -> LastMoment | None:
        bench = self._bench
        goal = self._run_to_failure()
        if goal is None:
            return None
        low, high = 0, len(self._saved)  # avoidable at low, if at all; not at high
        if not self._is_avoided(0, self._saved[0][0]):
            return LastMoment(
                failure=goal, failed_ns=self._failed_ns, avoidable_ns=None, place=None, printed=_last_line(bench)
            )
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (middle, high) if self._is_avoided(middle, self._saved[middle][0]) else (low, middle)
        begin = self._saved[low][0]
        end = self._saved[high][0] if high < len(self._saved) else self._failed_ns
        first, last = 0, max((end - begin) // STEP_NS, 1)
        while last - first > 1:
            middle = (first + last) // 2
            is_avoided = self._is_avoided(low, begin + middle * STEP_NS)
            first, last = (middle, last) if is_avoided else (first, middle)
        at = begin + first * STEP_NS
        bench.restore(self._saved[low][1])
        bench.run_until(at)
        pose = bench.pose
        return LastMoment(
            failure=goal, failed_ns=self._failed_ns, avoidable_ns=at,
            place=(round(pose.x_m, 3), round(pose.y_m, 3), round(math.degrees(pose.heading_rad), 1)),
            printed=_last_line(bench),
        )  # fmt: skip

    def _run_to_failure(self) -> str | None:
        """Run until a goal is missed, saving states on the way; return what was wrong with it."""
        bench = self._bench
        while bench.now < bench.end:
            self._saved.append((bench.now, bench.snapshot()))
            target = bench.now // SAVED_EACH_NS * SAVED_EACH_NS + SAVED_EACH_NS
            while bench.now < min(target, bench.end):
                bench.run_until(min(bench.now // STEP_NS * STEP_NS + STEP_NS, bench.end))
                for self._goal, words in run_of(bench).goals.missed.items():
                    self._failed_ns = bench.now
                    return words
        return None

    def _is_avoided(self, number: int, at: Nanos) -> bool:
        """Tell whether stopping at a time avoids what failed; the run goes on from a saved state."""
        bench = self._bench
        bench.restore(self._saved[number][1])
        bench.run_until(at)
        run_of(bench).hands.add(
            *(Action(at=bench.now, do="set_pin", place=wire, level=False) for wire in _motor_wires()), now=bench.now
        )
        bench.run_until(min(self._failed_ns + WATCHED_NS, bench.end))
        return self._goal not in run_of(bench).goals.missed


def _motor_wires() -> list[str]:
    return [wire.name for wire in load_pinout().with_role(WireRole.MOTOR)]


def _last_line(bench: Bench) -> str:
    return run_of(bench).recorder.last_line
