"""A body without physics: its wheels do what they are told, and nothing is in its way."""

from collections.abc import Sequence
from dataclasses import replace

from p2os.pioneer.body.contract import BodyState, Turned
from p2os.pioneer.sonar.ring import Cone
from simbase.state import Stateful
from simbase.timing import NS_PER_MS


class PerfectBody(Stateful):
    """Wheels that do what they are told, and sonar that read what the test says."""

    STATE = ("state", "range_m", "steps", "blocked")
    radius_m = 0.0825

    def __init__(self, dt_ns: int = NS_PER_MS) -> None:
        self.dt_ns = dt_ns
        self.state = BodyState()
        self.range_m: dict[int, float] = {}
        self.steps = 0
        #: Something holds both wheels.
        self.blocked = False
        self.asked: list[tuple[int, ...]] = []

    @property
    def state(self) -> BodyState:
        """What the last step has left; a step itself moves only the wheels."""
        (left, right), (left_mps, right_mps) = self._angles, self._speeds
        return replace(
            self._state, left_angle_rad=left, right_angle_rad=right, left_speed_mps=left_mps, right_speed_mps=right_mps
        )

    @state.setter
    def state(self, state: BodyState) -> None:
        self._state, self._stalled = state, (state.stalled_left, state.stalled_right)
        self._angles = state.left_angle_rad, state.right_angle_rad
        self._speeds = state.left_speed_mps, state.right_speed_mps

    def put_back(self) -> None:
        self.state = BodyState()

    def who_stands_at_start(self) -> str | None:
        return None

    def stand_at(self, x_m: float, y_m: float, heading_rad: float) -> None:
        self.state = replace(self.state, x_m=x_m, y_m=y_m, heading_rad=heading_rad)

    def scan(self, fan: Cone, longest_m: float) -> list[float]:
        return [min(1.0 + ray / 1000, longest_m) for ray in range(len(fan.headings_rad))]

    def step(self, left_mps: float, right_mps: float) -> Turned:
        self.steps += 1
        if self.blocked:
            left_mps = right_mps = 0.0
        turn, (left, right) = self.dt_ns / 1e9 / self.radius_m, self._angles
        self._speeds = left_mps, right_mps
        self._angles = left, right = left + left_mps * turn, right + right_mps * turn
        return Turned(left, right, *self._stalled)

    def hold(self, left_mps: float, right_mps: float, steps: int) -> list[Turned]:
        return [self.step(left_mps, right_mps) for _ in range(steps)]

    def ramp(self, setpoints: Sequence[tuple[float, float]]) -> list[Turned]:
        return [self.step(*asked) for asked in setpoints]

    def stall(self, *, left: bool, right: bool) -> None:
        self.state = replace(self.state, stalled_left=left, stalled_right=right)

    def ranges(self, numbers: Sequence[int]) -> list[float]:
        self.asked.append(tuple(numbers))
        return [self.range_m.get(number, 5.0) for number in numbers]
