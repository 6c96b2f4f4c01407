"""Any program against a robot whose flags lie: their word is replaced at random, in packets that are sound otherwise.

Such a robot need not drive. But whatever the program did last, it is told to stand within 2.1 s of the last call, and
its wheels stand within 3.5 s after it.
"""

from random import Random

from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from p2os.client.goals import DriveAxis, Goal, TurnAxis
from p2os.client.notices import LinkLostError, MotorsDisabledError
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
RAW = (
    Command(C.VEL, 200), Command(C.RVEL, -20), Command(C.MOVE, 2000), Command(C.ROTATE, 15), Command(C.HEAD, 90),
    Command(C.DHEAD, -60), Command(C.DCHEAD, 40), Command(C.VEL2, 5 << 8 | 10), Command(C.ENABLE, 1),
    Command(C.ENABLE, 0), Command(C.PTUPOS, 1 << 8 | 151), Command(C.VEL, 0), Command(C.RVEL, 0), Command(C.E_STOP),
    Command(C.PULSE), Command(C.SETO),
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
    def is_told_to_move(self) -> bool:
        """Whether what the robot has taken so far moves it: its own set-points, not the client's account of them."""
        _, first, first_goal, second, second_goal = self.pioneer._context.motion.setpoints
        is_asked = bool(first or second) or first_goal is not None or second_goal is not None
        return is_asked and self.pioneer.state.motors_enabled


class Story(RuleBasedStateMachine):
    """One program, one robot that lies."""

    @initialize(
        model=st.sampled_from(known_robots()), profile=st.sampled_from([None, *Profile]), seed=st.integers(0, 9999),
        lie=st.sampled_from(LIES),
    )  # fmt: skip
    def begin(self, model: str, profile: Profile | None, seed: int, lie: str) -> None:
        self.rig = LyingRig(seed=seed, pioneer=free_pioneer(model, profile=profile))
        self.rig.connect()
        self.rig.lie = lie
        self.draw = Random(seed)
        motion = self.rig.pioneer.parameters.motion
        # From there it stands within the limit by its own ramp.
        self.top_mps = min(motion.max_velocity_mm_s, 3 * motion.decel_mm_s2) / 1000
        self.called_at = self.rig.now
        self.goal: Goal | None = None

    def call(self, what: str, *words: object) -> object:
        """Make a call as a program does: it counts for the deadman whatever comes of it."""
        self.called_at = self.rig.now
        self.rig.core.touch(self.rig.now)
        try:
            return getattr(self.rig.core, what)(*words, self.rig.now)
        except (LinkLostError, MotorsDisabledError):
            return None
        finally:
            self.rig.run(0)

    @rule(share=st.floats(-1, 1), turn=st.floats(-1, 1))
    def it_holds_a_speed(self, share: float, turn: float) -> None:
        self.call("set_velocity", share * self.top_mps, turn)

    @rule(way=st.one_of(st.builds(DriveAxis, st.floats(-3, 3)), st.builds(TurnAxis, st.floats(-7, 7))))
    def it_has_a_goal(self, way: DriveAxis | TurnAxis) -> None:
        begun = self.call("begin_goal", way, None, self.top_mps if isinstance(way, DriveAxis) else None)
        self.goal = begun if isinstance(begun, Goal) else self.goal

    @rule()
    def it_gives_up_waiting(self) -> None:
        if self.goal is not None:
            self.call("cancel_goal", self.goal)

    @rule(command=st.sampled_from(RAW))
    def it_says_something_raw(self, command: Command) -> None:
        self.call("send", command)

    @rule(on=st.booleans())
    def it_switches_the_motors(self, on: bool) -> None:
        self.call("enable", on)

    @rule()
    def it_stops(self) -> None:
        self.call("stop")

    @rule(lie=st.sampled_from(LIES))
    def the_flags_lie_otherwise(self, lie: str) -> None:
        self.rig.lie = lie

    @rule(milliseconds=st.integers(0, 1500))
    def time_passes(self, milliseconds: int) -> None:
        self.go(milliseconds)

    @rule()
    def it_falls_silent(self) -> None:
        self.go(2200)
        self.go(3600)

    def go(self, milliseconds: int) -> None:
        """Let time pass without a call; look at each limit when it is reached."""
        ends = self.rig.now + milliseconds * MS
        for due in (self.called_at + STOP_WITHIN_NS, self.called_at + STOP_WITHIN_NS + STAND_WITHIN_NS, ends):
            if self.rig.now < due <= ends:
                self.rig.run((due - self.rig.now) / S)
                self.it_is_told_to_stand_and_stands()

    @invariant()
    def it_is_told_to_stand_and_stands(self) -> None:
        if not hasattr(self, "rig"):
            return
        assert self.rig.core.link is Link.OPEN
        silent_ns = self.rig.now - self.called_at
        if silent_ns >= STOP_WITHIN_NS:
            assert not self.rig.is_told_to_move, self.rig.sent[-12:]
        if silent_ns >= STOP_WITHIN_NS + STAND_WITHIN_NS:
            assert self.rig.wheels == (0.0, 0.0)


Story.TestCase.settings = hypothesis_settings(max_examples=30, stateful_step_count=20)
TestStory = Story.TestCase
