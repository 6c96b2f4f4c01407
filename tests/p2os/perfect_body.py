"""A body without physics: its wheels do what they are told, and nothing is in its way."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from p2os.pioneer.body.contract import BodyState, Turned
from p2os.pioneer.sonar.ring import Cone
from simbase.state import Stateful
from simbase.timing import NS_PER_MS

STANDING = Turned(0.0, 0.0)


@dataclass
class PerfectBody(Stateful):
    """Wheels that do what they are told, and sonar that read what the test says."""

    STATE = ("wheels", "speeds_mps", "stands", "range_m", "steps", "blocked")

    dt_ns: int = NS_PER_MS
    radius_m: float = 0.0825
    wheels: Turned = STANDING
    speeds_mps: tuple[float, float] = (0.0, 0.0)
    #: Where it stands, without its wheels.
    stands: BodyState = field(default_factory=BodyState)
    range_m: dict[int, float] = field(default_factory=dict)
    steps: int = 0
    #: Something holds both wheels.
    blocked: bool = False
    asked: list[tuple[int, ...]] = field(default_factory=list)

    @property
    def state(self) -> BodyState:
        """All of it, made when it is asked for: it moves in steps of a millisecond."""
        wheels, (left_mps, right_mps) = self.wheels, self.speeds_mps
        return replace(self.stands, **wheels._asdict(), left_speed_mps=left_mps, right_speed_mps=right_mps)

    @state.setter
    def state(self, state: BodyState) -> None:
        self.stands, self.speeds_mps = state, (state.left_speed_mps, state.right_speed_mps)
        self.wheels = Turned(state.left_angle_rad, state.right_angle_rad, state.stalled_left, state.stalled_right)

    def put_back(self) -> None:
        self.state = BodyState()

    def who_stands_at_start(self) -> str | None:
        return None

    def stand_at(self, x_m: float, y_m: float, heading_rad: float) -> None:
        self.stands = replace(self.stands, x_m=x_m, y_m=y_m, heading_rad=heading_rad)

    def scan(self, fan: Cone, longest_m: float) -> list[float]:
        return [min(1.0 + ray / 1000, longest_m) for ray in range(len(fan.headings_rad))]

    def step(self, left_mps: float, right_mps: float) -> Turned:
        self.steps += 1
        if self.blocked:
            left_mps = right_mps = 0.0
        turn = self.dt_ns / 1e9 / self.radius_m
        left_rad, right_rad, stalled_left, stalled_right = self.wheels
        self.speeds_mps = left_mps, right_mps
        self.wheels = Turned(left_rad + left_mps * turn, right_rad + right_mps * turn, stalled_left, stalled_right)
        return self.wheels

    def hold(self, left_mps: float, right_mps: float, steps: int) -> list[Turned]:
        return [self.step(left_mps, right_mps) for _ in range(steps)]

    def ramp(self, setpoints: Sequence[tuple[float, float]]) -> list[Turned]:
        return [self.step(*asked) for asked in setpoints]

    def stall(self, *, left: bool, right: bool) -> None:
        self.wheels = self.wheels._replace(stalled_left=left, stalled_right=right)

    def ranges(self, numbers: Sequence[int]) -> list[float]:
        self.asked.append(tuple(numbers))
        return [self.range_m.get(number, 5.0) for number in numbers]
