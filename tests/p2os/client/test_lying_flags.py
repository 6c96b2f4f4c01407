"""Any program against a robot whose flags lie: their word is replaced at random, in packets that are sound otherwise.

Such a robot need not drive. But whatever the program did last, it is told to stand within 2.1 s of the last call, and
its wheels stand within 3.5 s after it.
"""

import contextlib
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from p2os.client.core import RobotCore
from p2os.client.goals import DriveAxis, TurnAxis
from p2os.client.notices import MotorsDisabledError
from p2os.protocol.commands import Command
from p2os.protocol.commands import CommandNumber as C
from p2os.protocol.frames import PREFIX_BYTES, Frame
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import SIP_KINDS
from p2os.robots.parameters import known_robots
from tests.p2os.client.client_rig import MS, Link, Rig, S, free_pioneer

#: Where the flags stand in a SIP's payload, type byte included.
FLAGS_AT = 16
STOP_WITHIN_NS, STAND_WITHIN_NS = 2100 * MS, 3500 * MS
#: What is done to the word: left alone, anything, motors off, motors on and off.
LIES = ("true", "random", "off", "flicker")
MOVES = (
    Command(C.VEL, 200), Command(C.RVEL, -20), Command(C.MOVE, 2000), Command(C.ROTATE, 15), Command(C.HEAD, 179),
    Command(C.VEL2, 5 << 8 | 10),
)  # fmt: skip
OTHERS = (
    Command(C.ENABLE, 1), Command(C.ENABLE, 0), Command(C.PTUPOS, 1 << 8 | 151), Command(C.VEL, 0), Command(C.RVEL, 0),
    Command(C.E_STOP), Command(C.SETO),
)  # fmt: skip


class LyingRig(Rig):
    """A rig whose robot's flags are replaced on the way."""

    lie = "true"
    _count_of_sips = 0

    def _carry(self, data: bytes, *, to_robot: bool) -> None:
        if not to_robot and data[PREFIX_BYTES] in SIP_KINDS and self.lie != "true":
            payload = bytearray(Frame.from_bytes(data).payload)
            self._count_of_sips += 1
            word = {"random": self.random_source.randrange(1 << 16), "off": 0, "flicker": self._count_of_sips & 1}
            payload[FLAGS_AT : FLAGS_AT + 2] = word[self.lie].to_bytes(2, "little")
            data = Frame(bytes(payload)).to_bytes()
        super()._carry(data, to_robot=to_robot)

    @property
    def is_commanded_to_move(self) -> bool:
        """Whether what the robot has taken so far moves it: its own set-points, not the client's account of them."""
        _, first, first_goal, second, second_goal = self.pioneer._context.motion.setpoints
        is_asked = bool(first or second) or first_goal is not None or second_goal is not None
        return is_asked and self.pioneer.state.motors_enabled


#: A call of a program.
Act = Callable[[RobotCore, int], object]
#: m/s that every model stands from within the limit, by its own ramp; the gentlest slows down by 0.3 m/s2.
TOP_MPS = 1.0


def speed(forward_mps: float, turn_radps: float) -> Act:
    return lambda core, now: core.set_velocity(forward_mps, turn_radps, now)


def goal(axis: DriveAxis | TurnAxis) -> Act:
    top = TOP_MPS if isinstance(axis, DriveAxis) else None
    return lambda core, now: core.begin_goal(axis, None, top, now)


def cancelled(core: RobotCore, now: int) -> None:
    if core._mover._goal is not None:
        core.cancel_goal(core._mover._goal, now)


def raw(command: Command) -> Act:
    return lambda core, now: core.send(command, now)


ACTS: st.SearchStrategy[Act] = st.one_of(
    st.builds(speed, st.floats(-TOP_MPS, TOP_MPS), st.floats(-1, 1)),
    st.builds(goal, st.one_of(st.builds(DriveAxis, st.floats(-3, 3)), st.builds(TurnAxis, st.floats(-7, 7)))),
    st.builds(raw, st.sampled_from(MOVES)), st.builds(raw, st.sampled_from(OTHERS)),
    st.sampled_from([
        lambda core, now: core.enable(True, now), lambda core, now: core.enable(False, now),
        lambda core, now: core.stop(now), cancelled,
    ]),
)  # fmt: skip
#: What a program does, what the flags do from then on, and for how many milliseconds nothing happens then.
STORIES = st.lists(st.tuples(ACTS, st.sampled_from(LIES), st.sampled_from([0, 3, 30, 300, 900, 1500])), max_size=4)


def reported(model: str, profile: Profile | None, seed: int, story: list[tuple[Act, str, int]]) -> None:
    """Tell a story, and hold its end against the limits."""
    rig = LyingRig(seed=seed, pioneer=free_pioneer(model, profile=profile)).connect()
    rig.core.enable(True, rig.now)
    rig.run(0.3)
    called_at = rig.now
    for act, lie, milliseconds in story:
        rig.lie = lie
        called_at = rig.now
        rig.core.touch(rig.now)
        with contextlib.suppress(MotorsDisabledError):  # it was a call all the same
            act(rig.core, rig.now)
        rig.run(milliseconds / 1000)
    assert rig.core.link is Link.OPEN
    rig.run((called_at + STOP_WITHIN_NS - rig.now) / S)
    assert not rig.is_commanded_to_move, rig.sent[-12:]
    rig.run(STAND_WITHIN_NS / S)
    assert rig.wheels == (0.0, 0.0)


WHOLE = given(
    model=st.sampled_from(known_robots()), profile=st.sampled_from([None, *Profile]), seed=st.integers(0, 9999),
    story=STORIES,
)  # fmt: skip


@pytest.mark.slow
@hypothesis_settings(max_examples=60)
@WHOLE
def test_a_robot_whose_flags_lie_is_told_to_stand_and_stands(
    model: str, profile: Profile | None, seed: int, story: list[tuple[Act, str, int]]
) -> None:
    reported(model, profile, seed, story)


@pytest.mark.soak
@hypothesis_settings(max_examples=3000)
@WHOLE
def test_any_robot_whose_flags_lie_is_told_to_stand_and_stands(
    model: str, profile: Profile | None, seed: int, story: list[tuple[Act, str, int]]
) -> None:
    reported(model, profile, seed, story)
