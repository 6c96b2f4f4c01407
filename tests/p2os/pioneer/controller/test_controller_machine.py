"""The controller as a state machine: whatever a client and the world do, in any order, it keeps its promises."""

import pickle
from typing import Any

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from p2os.pioneer.controller import ControllerSettings
from p2os.pioneer.controller.sender import MOST_ANSWERS
from p2os.pioneer.sensor_errors import REALISTIC
from p2os.protocol.commands import CommandNumber as C
from p2os.protocol.profiles import Profile
from p2os.robots.parameters import load_parameters
from simbase.timing import NS_PER_MS, NS_PER_S
from tests.p2os.conftest import Robot, context_of

P2DX = load_parameters("p2dx")
FAULTS = ("line-noise 0.001", "loose-connector", "stop-button", "wheel-blocked left", "sonar-noisy 2 0.1")
WATCHDOG_MS = 500


class Controller(RuleBasedStateMachine):
    """A robot, a client that says anything, and what must hold after each step."""

    @initialize(profile=st.sampled_from(Profile), baud=st.sampled_from([None, 9600, 115200]))
    def switch_on(self, profile: Profile, baud: int | None) -> None:
        chosen = ControllerSettings(
            profile=profile, baud=baud, errors=REALISTIC, watchdog_ns=WATCHDOG_MS * NS_PER_MS, seed=1
        )
        self.robot: Any = Robot(P2DX, chosen, dt_ns=10 * NS_PER_MS)
        self.twin: Any = Robot(P2DX, chosen, dt_ns=10 * NS_PER_MS)
        self.said_at = 0

    def say(self, number: int, argument: int | bytes | None = None) -> None:
        self.robot.say(number, argument)
        self.said_at = self.robot.now

    @rule(number=st.sampled_from([0, 1, 2]))
    def sync(self, number: int) -> None:
        self.say(number)

    @rule()
    def handshake(self) -> None:
        for number in (0, 1, 2, C.OPEN):
            self.say(number)
        self.say(C.ENABLE, 1)

    @rule(number=st.sampled_from([C.VEL, C.RVEL, C.VEL2, C.MOVE, C.DHEAD, C.HEAD]), value=st.integers(-700, 700))
    def drive(self, number: int, value: int) -> None:
        self.say(number, value)

    @rule(number=st.integers(3, 255), value=st.one_of(st.none(), st.integers(-32767, 65535), st.binary(max_size=20)))
    def command(self, number: int, value: int | bytes | None) -> None:
        self.say(number, value)

    @rule(data=st.binary(max_size=60))
    def noise(self, data: bytes) -> None:
        self.robot.send(data)

    @rule(milliseconds=st.integers(0, 1500))
    def wait(self, milliseconds: int) -> None:
        self.robot.run(milliseconds)

    @rule(words=st.sampled_from(FAULTS), first=st.sampled_from(["fault", "clear"]))
    def inject_or_clear(self, words: str, first: str) -> None:
        self.robot.pioneer.do(f"{first} {words}", self.robot.now)

    @rule()
    def reboot(self) -> None:
        self.robot.pioneer.do("fault reboot", self.robot.now)

    @rule()
    def hang_up(self) -> None:
        self.robot.pioneer.hang_up(self.robot.now)
        assert self.robot.pioneer.state.left_setpoint_mps == self.robot.pioneer.state.right_setpoint_mps == 0

    @precondition(lambda self: not context_of(self.robot.pioneer)["faults"].corrupts_line)
    @rule()
    def close_and_find_it_standing(self) -> None:
        self.say(C.CLOSE)
        self.robot.run(0)
        state = self.robot.pioneer.state
        if not state.open:
            assert not state.motors_enabled
            assert state.left_setpoint_mps == state.right_setpoint_mps == 0

    @rule(milliseconds=st.integers(1, 800))
    def a_twin_restored_from_a_snapshot_says_the_same(self, milliseconds: int) -> None:
        self.robot.pioneer.take_output()
        self.twin.pioneer.restore(pickle.loads(pickle.dumps(self.robot.pioneer.snapshot())))  # noqa: S301 - our own
        self.twin.now = self.robot.now
        for robot in (self.robot, self.twin):
            robot.run(milliseconds)
        assert self.robot.pioneer.take_output() == self.twin.pioneer.take_output()
        assert self.robot.pioneer.state == self.twin.pioneer.state

    @invariant()
    def nothing_piles_up(self) -> None:
        assert len(self.robot.pioneer.snapshot()["_sender"]["_answers"]) <= MOST_ANSWERS

    @invariant()
    def wheels_turn_only_with_power_and_within_the_ceiling(self) -> None:
        state = self.robot.pioneer.state
        fastest = max(abs(state.left_setpoint_mps), abs(state.right_setpoint_mps))
        if not state.motors_enabled:
            assert fastest == 0
        assert fastest <= 2.2 + 500 * 0.0178, "top speed and top rotation of the robot file"

    @invariant()
    def the_watchdog_bites_only_in_a_session(self) -> None:
        state = self.robot.pioneer.state
        assert state.open or not state.watchdog_expired

    @invariant()
    def time_goes_on(self) -> None:
        due = self.robot.pioneer.next_deadline()
        assert due is None or due >= self.robot.now - 10 * NS_PER_S


TestController = Controller.TestCase
TestController.settings = settings(max_examples=40, stateful_step_count=25)
