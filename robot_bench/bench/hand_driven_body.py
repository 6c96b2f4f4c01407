"""A robot's body whose wheels a hand may turn, whatever the robot's motors are told.

It stands between who drives the robot and its body. While nobody drives by hand, both talk to each other as if it were
not there: its `step`, `hold` and `ramp` are the body's own.

Invariant: a body that was never driven by hand makes the steps that it makes alone.
"""

from collections.abc import Callable, Sequence
from typing import Any, cast

from p2os.pioneer.body.contract import BodyState, RobotBody, Wheels
from simbase.errors import UsageError

#: chosen: more than any motor of a small robot gives; what has masses is turned by no more, Nm.
HAND_NM = 20.0


class HandDrivenBody:
    """A body that a hand may drive.

    Args:
        inner: The body. One that shares its world is stepped with the others, with `rims` in place of its set-points.
        track_m: From wheel to wheel.
    """

    def __init__(self, inner: RobotBody, track_m: float) -> None:
        self._inner, self._track_m = inner, track_m
        #: Nanoseconds of a step.
        self.dt_ns = inner.dt_ns
        #: Rim speeds that a hand wants, left and right, m/s; None: nobody drives.
        self._rims: tuple[float, float] | None = None
        self._is_powered = inner.is_powered
        self.step: Callable[[float, float], Wheels]
        self.hold: Callable[[float, float, int], Sequence[Wheels]]
        self.ramp: Callable[[Sequence[tuple[float, float]]], Sequence[Wheels]]
        self.steps_within: Callable[[float, float], int]
        if hasattr(inner, "limit_torques"):
            #: What a robot whose motors have torques tells the body before each step.
            self.limit_torques: Callable[[float, float], None] = self._limit_torques
        self._meet()

    def drive_by_hand(self, speeds: tuple[float, float] | None) -> None:
        """Turn the wheels so from now on, m/s ahead and rad/s counter-clockwise; None lets go."""
        self._rims = None
        if speeds is not None:
            turn = speeds[1] * self._track_m / 2
            self._rims = speeds[0] - turn, speeds[0] + turn
        self._meet()

    # As a body.

    @property
    def rims(self) -> tuple[float, float] | None:
        """The rim speeds that a hand wants, left and right, m/s, whatever set-points say; None: nobody drives."""
        return self._rims

    @property
    def is_powered(self) -> bool:
        """Whether its motors have power."""
        return self._is_powered

    @is_powered.setter
    def is_powered(self, is_powered: bool) -> None:
        self._is_powered = is_powered
        self._inner.is_powered = is_powered or self._rims is not None

    @property
    def state(self) -> BodyState:
        """The state after the last step."""
        return self._inner.state

    def snapshot(self) -> object:
        """Return all that decides the future."""
        return self._inner.snapshot(), self._rims, self._is_powered

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned."""
        inner, self._rims, self._is_powered = cast("tuple[object, tuple[float, float] | None, bool]", snapshot)
        self._meet()
        self._inner.restore(inner)

    def __getattr__(self, name: str) -> Any:
        """Return what is the body's own; methods are looked for once."""
        if name == "_inner":
            raise AttributeError(name)
        found = getattr(self._inner, name)
        if callable(found):
            self.__dict__[name] = found
        return found

    def _meet(self) -> None:
        """Let steps be the body's own, or as a hand wants."""
        inner, rims = self._inner, self._rims
        if rims is None:
            self.step, self.hold, self.ramp = inner.step, inner.hold, inner.ramp
            self.steps_within = inner.steps_within
        else:
            self.step, self.hold, self.ramp = self._step, self._hold, self._ramp
            self.steps_within = self._steps_within
        inner.is_powered = self._is_powered or rims is not None

    def _step(self, left_mps: float, right_mps: float) -> Wheels:
        return self._hold(left_mps, right_mps, 1)[0]

    def _hold(self, _left_mps: float, _right_mps: float, steps: int) -> Sequence[Wheels]:
        left_mps, right_mps = self._rims or (0.0, 0.0)
        return self._inner.hold(left_mps, right_mps, steps)

    def _limit_torques(self, left_nm: float, right_nm: float) -> None:
        limits = (left_nm, right_nm) if self._rims is None else (HAND_NM, HAND_NM)
        self._inner.limit_torques(*limits)  # type: ignore[attr-defined]  # an engine's, looked at when this was made

    def _ramp(self, setpoints: Sequence[tuple[float, float]]) -> Sequence[Wheels]:
        return self._hold(0.0, 0.0, len(setpoints))

    def _steps_within(self, turn_rad: float, rim_mps: float) -> int:
        return self._inner.steps_within(turn_rad, max(rim_mps, *map(abs, self._rims or ())))


def hand_driven(body: RobotBody) -> HandDrivenBody:
    """Return what a hand drives a body by.

    Raises:
        UsageError: It is a robot that is there.
    """
    if not isinstance(body, HandDrivenBody):
        raise UsageError("a robot at a port is not driven by hand in a run", hint="p2os teleop URL")
    return body
