"""A body without physics: its wheels do what they are told, and nothing is in its way."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from p2os.pioneer.body.contract import BodyState, Turned
from p2os.pioneer.sonar.ring import Cone
from simbase.state import Stateful
from simbase.timing import NS_PER_MS


@dataclass
class PerfectBody(Stateful):
    """Wheels that do what they are told, and sonar that read what the test says."""

    STATE = ("state", "range_m", "steps", "blocked")

    dt_ns: int = NS_PER_MS
    radius_m: float = 0.0825
    state: BodyState = field(default_factory=BodyState)
    range_m: dict[int, float] = field(default_factory=dict)
    steps: int = 0
    #: Something holds both wheels.
    blocked: bool = False
    asked: list[tuple[int, ...]] = field(default_factory=list)

    def put_back(self) -> None:
        self.state = BodyState()

    def who_stands_at_start(self) -> str | None:
        return None

    def stand_at(self, x_m: float, y_m: float, heading_rad: float) -> None:
        self.state = replace(self.state, x_m=x_m, y_m=y_m, heading_rad=heading_rad)

    def scan(self, fan: Cone, longest_m: float) -> list[float]:
        return [min(1.0 + ray / 1000, longest_m) for ray in range(len(fan.headings_rad))]

    def step(self, left_mps: float, right_mps: float) -> BodyState:
        self.ramp([(left_mps, right_mps)])
        return self.state

    def hold(self, left_mps: float, right_mps: float, steps: int) -> list[Turned]:
        return self.ramp([(left_mps, right_mps)] * steps)

    def ramp(self, setpoints: Sequence[tuple[float, float]]) -> list[Turned]:
        self.steps += len(setpoints)
        if self.blocked:
            setpoints = [(0.0, 0.0)] * len(setpoints)
        state, turn, made = self.state, self.dt_ns / 1e9 / self.radius_m, []
        left_rad, right_rad = state.left_angle_rad, state.right_angle_rad
        for left_mps, right_mps in setpoints:
            left_rad += left_mps * turn
            right_rad += right_mps * turn
            made.append(Turned(left_rad, right_rad, state.stalled_left, state.stalled_right))
        if setpoints:
            left_mps, right_mps = setpoints[-1]
            self.state = replace(
                state, left_angle_rad=left_rad, right_angle_rad=right_rad, left_speed_mps=left_mps,
                right_speed_mps=right_mps,
            )  # fmt: skip
        return made

    def stall(self, *, left: bool, right: bool) -> None:
        self.state = replace(self.state, stalled_left=left, stalled_right=right)

    def ranges(self, numbers: Sequence[int]) -> list[float]:
        self.asked.append(tuple(numbers))
        return [self.range_m.get(number, 5.0) for number in numbers]
