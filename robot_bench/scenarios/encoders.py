"""The goal of `encoders.toml`: what that program prints (`left=… right=…`) are the turns of the wheels.

A kind of goal as any package may offer one: its entry point stands under `robot_bench.goals`.
"""

import math
import re

from adapter_sim.pinout import load_pinout
from p2os.toml_schema import Key, Table
from robot_bench.events.kinds import Event, Pose, Text
from robot_bench.scenario.goals.text import Printed
from robot_bench.scenario.goals.watch import GoalKind, GoalOutcome, number, seconds
from simbase.timing import Nanos

_COUNTS = re.compile(r"left=(-?\d+) right=(-?\d+)")


class EncoderCounts(Printed):
    """The counts that are printed equal the wheels' turns at the nearest pose."""

    STATE = ("_pending", "_pose", "_has_counts", "_wrong")
    kinds = (Text, Pose)

    def __init__(self, table: Table) -> None:
        super().__init__()
        self._allowed = int(number(table, "steps", 1))
        self._positions = 1 << len(load_pinout().value("encoder1").wires)
        #: Counts that wait for the pose after them: ns, left, right.
        self._pending: list[tuple[Nanos, int, int]] = []
        self._pose: Pose | None = None
        self._has_counts = False
        self._wrong = ""

    def feed(self, event: Event) -> GoalOutcome | None:
        if isinstance(event, Pose):
            return self._compare(event)
        line = self.read(event) if isinstance(event, Text) else None
        if line is not None and isinstance(event, Text) and event.data.endswith(b"\n") and (m := _COUNTS.search(line)):
            self._has_counts = True
            self._pending.append((event.t, int(m[1]), int(m[2])))
        return None

    def finish(self, end: Nanos) -> GoalOutcome:
        if self._pose is not None:
            self._compare(self._pose)
        if not self._has_counts or self._pose is None:
            return GoalOutcome(met=False, says=f"no counts were printed; {self.last}")
        return GoalOutcome(met=not self._wrong, says=self._wrong)

    def _compare(self, pose: Pose) -> GoalOutcome | None:
        before, self._pose = self._pose, pose
        pending, self._pending = self._pending, []
        for at, *counts in pending:
            near = before if before is not None and at - before.t <= pose.t - at else pose
            for side, printed, angle in zip(
                ("left", "right"), counts, (near.left_angle, near.right_angle), strict=True
            ):
                turned = math.floor(angle * 1e-6 / math.tau * self._positions)
                if abs(printed - turned) > self._allowed and not self._wrong:
                    self._wrong = (
                        f"{side} was printed as {printed} at {seconds(at)}, the wheel had turned {turned} steps"
                    )
                    return GoalOutcome(met=False, says=self._wrong)
        return None


GOAL = GoalKind(
    keys=(Key(name="steps", kind="whole", least=0, most=1_000_000),),
    wanted=lambda table: f"counts the wheels' turns to {table.get('steps', 1)} step",
    watch=EncoderCounts, needs_world=True, is_scripted=True,
)  # fmt: skip
