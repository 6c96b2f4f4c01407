"""Safety of the adapter under any sequence of pins, noise and cut cables.

The machine joins the adapter with a robot over a line of 9600 baud and does
whatever hypothesis thinks of; the invariants are read off the wire and the pins.
"""

import random
from dataclasses import replace

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from adapter_sim import Adapter, AdapterSettings
from adapter_sim.pins import released_codes
from p2os.pioneer.body.factory import make_body
from p2os.pioneer.controller import Pioneer
from p2os.pioneer.world import load_world
from p2os.protocol.commands import Command
from p2os.protocol.frames import Frame
from tests.adapter_sim.conftest import MS, PARAMETERS, FakeRobot, Rig

#: Four steps of 62.5 mm/s; (3 + 4) steps over 357 mm.
FASTEST_MM_S, FASTEST_DEG_S = 250, 70
STEPS = st.integers(-4, 3)


class WatchedRig(Rig):
    """Checks every frame that leaves the adapter, at the instant it leaves."""

    fastest = (FASTEST_MM_S, FASTEST_DEG_S)

    def __init__(self, robot: object, kind: type = Adapter) -> None:
        super().__init__(AdapterSettings(threshold_um=600_000), robot, kind=kind)
        self.last_sip = 0
        self.sips = 0
        self.checked = 0
        self.checked_events = 0
        self.commanded = (0, 0)
        self.commanded_at = 0
        self.pair_at = -(10**12)
        #: Whether p2dx_con has been seen low since the last loss.
        self.allowed = True
        #: The encoders' codes, at first those of wires that nobody drives; None: the outputs were undefined, and codes
        #: go on after that where they were.
        self.codes: tuple[int, int] | None = released_codes(self.adapter.pinout)

    def run(self, until: int) -> None:
        while self.now < until:
            super().run(min(until, self.adapter.next_deadline() or until, self.now + 5 * MS))
            self.check()

    def check(self) -> None:
        sips = self.adapter.status.sips
        if sips != self.sips:
            self.sips, self.last_sip = sips, self.now
        for at, what, _ in self.events[self.checked_events :]:
            if what in {"lost", "implausible"}:
                self.allowed = False
                first = [name for _, name, _ in self.sent(at)][:3]
                assert first == ["STOP", "VEL", "RVEL"], (what, first)
            elif what == "connecting":
                self.allowed = True
        self.checked_events = len(self.events)
        for at, data in self.to_robot.log[self.checked :]:
            command = Command.from_frame(Frame.from_bytes(data))
            self._check_frame(at, command.name, command.argument)
        self.checked = len(self.to_robot.log)
        if self.commanded != (0, 0) and self.adapter.state not in {"reset", "booting"}:
            assert self.now - self.last_sip <= 350 * MS
        codes = (self.pins.code("encoder1"), self.pins.code("encoder2")) if self.pins.outputs else self.codes
        if codes is not None and None not in self.pins.outputs.values():
            for before, after in zip(self.codes or codes, codes, strict=True):
                assert (after - before) % 8 in {0, 1, 7}
            self.codes = codes
        else:
            self.codes = None

    def _check_frame(self, at: int, name: str, argument: object) -> None:
        if name == "STOP":
            self.commanded = (0, 0)
        elif name == "VEL":
            assert abs(argument) <= self.fastest[0]
            if argument:
                assert self.allowed, "moves after a loss without p2dx_con given anew"
                assert at - self.last_sip < 350 * MS, "moves without a SIP"
            self.commanded = (argument, self.commanded[1])
            self.commanded_at = at
        elif name == "RVEL":
            assert abs(argument) <= self.fastest[1]
            self.commanded = (self.commanded[0], argument)
            if self.adapter.state == "driving":
                assert at - self.pair_at >= 25 * MS
                self.pair_at = at


class AdapterMachine(RuleBasedStateMachine):
    """The adapter and a server's Connection."""

    #: The model, or its twin.
    kind: type = Adapter

    def make_robot(self) -> object:
        return FakeRobot()

    @initialize()
    def power(self) -> None:
        self.rig = WatchedRig(self.make_robot(), self.kind)
        self.rig.pins.set("p2dx_con", True, 0)
        self.rig.ms(900)

    @rule(left=STEPS, right=STEPS)
    def command(self, left: int, right: int) -> None:
        self.rig.pins.motors(left, right, self.rig.now + 1)

    @rule(span_ms=st.sampled_from([3, 20, 60, 150, 340, 360, 700]))
    def wait(self, span_ms: int) -> None:
        self.rig.ms(span_ms)

    @rule(high=st.booleans())
    def connect_wire(self, high: bool) -> None:
        self.rig.pins.set("p2dx_con", high, self.rig.now + 1)

    @rule(span_ms=st.sampled_from([3, 8]))
    def glitch_connect(self, span_ms: int) -> None:
        level = self.rig.pins.read("p2dx_con", self.rig.now)
        self.rig.pins.set("p2dx_con", not level, self.rig.now + 1)
        self.rig.pins.set("p2dx_con", level, self.rig.now + span_ms * MS)

    @rule(span_ms=st.sampled_from([1, 50]))
    def reset(self, span_ms: int) -> None:
        self.rig.pins.set("rst", True, self.rig.now + 1)
        self.rig.ms(span_ms)
        self.rig.pins.set("rst", False, self.rig.now + 1)
        self.rig.ms(2)

    @rule(to_robot=st.booleans(), to_adapter=st.booleans())
    def cut(self, to_robot: bool, to_adapter: bool) -> None:
        self.rig.to_robot.cut, self.rig.to_adapter.cut = to_robot, to_adapter

    @rule(seed=st.integers(0, 2**16), share=st.sampled_from([0.0, 0.05, 0.5]))
    def noise(self, seed: int, share: float) -> None:
        random_source = random.Random(seed)

        def damage(frame: bytes) -> bytes:
            if random_source.random() >= share:
                return frame
            place = random_source.randrange(len(frame))
            return random_source.choice(
                [b"", frame[:place], frame[:place] + bytes((random_source.randrange(256),)) + frame[place + 1 :]]
            )

        self.rig.to_robot.damage = self.rig.to_adapter.damage = damage

    @rule(data=st.binary(max_size=20))
    def garbage(self, data: bytes) -> None:
        self.rig.adapter.receive(data, self.rig.now)

    @invariant()
    def outputs_are_safe_while_nothing_is_known(self) -> None:
        if self.rig.adapter.state in {"idle", "connecting", "closing", "lost"}:
            assert self.rig.pins.distances() == "11111111"
        if self.rig.adapter.state in {"reset", "booting"}:
            assert set(self.rig.pins.outputs.values()) <= {None}

    @invariant()
    def unchanged_speeds_are_refreshed(self) -> None:
        rig = self.rig
        if rig.adapter.state == "driving":
            driven_at = max(at for at, what, _ in rig.events if what == "driving")
            assert rig.now - max(rig.commanded_at, driven_at) <= 200 * MS


class DeafRobotMachine(AdapterMachine):
    """The same with a robot that may stop obeying, stall, or be moved by hand."""

    @rule(obeys=st.booleans(), stalls=st.booleans(), raw_x=st.integers(0, 0x7FFF))
    def misbehave(self, obeys: bool, stalls: bool, raw_x: int) -> None:
        robot = self.rig.robot
        robot.obeys = obeys
        robot.sip = replace(robot.sip, stall_left=stalls, raw_x=raw_x)

    @precondition(lambda self: self.kind is Adapter)
    @invariant()
    def nobody_drives_a_deaf_robot_for_long(self) -> None:
        rig = self.rig
        if rig.adapter.state == "driving":
            assert rig.now <= rig.adapter._driver.plausibility.ends_at


class PioneerMachine(AdapterMachine):
    """The same with the virtual robot and its exact body."""

    def make_robot(self) -> object:
        return Pioneer(parameters=PARAMETERS, body=make_body("kinematic", load_world("room"), PARAMETERS))

    @precondition(lambda self: self.rig.adapter.state == "lost" and not self.rig.to_robot.cut)
    @rule()
    def a_lost_robot_comes_to_a_stand(self) -> None:
        self.rig.to_robot.damage = lambda frame: frame
        # Three repetitions of the stop sequence, or the robot's own watchdog of 2 s; 250 mm/s at 300 mm/s².
        self.rig.ms(3_500)
        state = self.rig.robot.state
        if self.rig.adapter.state == "lost":
            assert (state.left_setpoint_mps, state.right_setpoint_mps) == (0, 0)


for machine, examples in ((AdapterMachine, 30), (DeafRobotMachine, 30), (PioneerMachine, 8)):
    machine.TestCase.settings = settings(
        max_examples=examples,
        stateful_step_count=25,
        suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
    )

TestAdapter = AdapterMachine.TestCase
TestDeafRobot = pytest.mark.slow(DeafRobotMachine.TestCase)
TestPioneer = PioneerMachine.TestCase


def pioneer_rig() -> Rig:
    rig = Rig(robot=Pioneer(parameters=PARAMETERS, body=make_body("kinematic", load_world("room"), PARAMETERS)))
    rig.connect()
    return rig


def counts_of_body(rig: Rig) -> tuple[int, int]:
    """Return the encoder steps that the body's wheels have made, as the firmware would count them."""
    state = rig.robot.body.state
    eighth = 2 * 3.141592653589793 / 8
    return int(state.left_angle_rad // eighth), int(state.right_angle_rad // eighth)


@pytest.mark.parametrize("seed", [1, 2])
def test_counts_on_the_pins_equal_the_bodys_wheels_to_one_step(seed: int) -> None:
    rig, random_source = pioneer_rig(), random.Random(seed)
    shown, codes = list(rig.adapter.status.counts_shown), [rig.pins.code(name) for name in ("encoder1", "encoder2")]
    first = tuple(shown)
    for step in range(42):
        steps = [0, 0] if step >= 40 else [random_source.choice([-2, -1, 0, 1, 2]) for _ in range(2)]
        rig.pins.motors(*steps, rig.now)
        for _ in range(100):
            rig.ms(10)  # a program that polls at 100 Hz
            for side, name in enumerate(("encoder1", "encoder2")):
                code = rig.pins.code(name)
                shown[side] += (code - codes[side] + 4) % 8 - 4
                codes[side] = code
    assert tuple(shown) == rig.adapter.status.counts_shown
    for mine, began, true in zip(shown, first, counts_of_body(rig), strict=True):
        assert abs(mine - began - true) <= 1
    assert rig.adapter.state == "driving"


def test_a_moving_robot_is_plausible_through_every_change_of_speed() -> None:
    rig = pioneer_rig()
    for left, right in ((3, 3), (-4, -4), (3, -4), (-4, 3), (0, 0), (1, 2), (0, 3)):
        rig.pins.motors(left, right, rig.now)
        rig.ms(2_500)
        assert rig.adapter.state == "driving", rig.events[-1]


def test_a_cut_line_leaves_the_robot_to_its_own_watchdog() -> None:
    rig = pioneer_rig()
    rig.pins.motors(2, 2, rig.now)
    rig.ms(1_500)
    cut_at = rig.now
    rig.to_robot.cut = rig.to_adapter.cut = True
    rig.run(cut_at + 1_790 * MS)
    assert rig.robot.state.left_setpoint_mps == pytest.approx(0.125)
    # Its watchdog bites 2 s after the last frame, at most 200 ms + 19 ms old; 125 mm/s at 300 mm/s² are 0.42 s.
    rig.run(cut_at + 2_500 * MS)
    assert rig.robot.state.left_setpoint_mps == 0
    assert rig.adapter.state == "lost"
    # The cable is back, p2dx_con is given anew: the robot is stopped before anything revives it.
    rig.to_robot.cut = rig.to_adapter.cut = False
    rig.pins.set("p2dx_con", False, rig.now)
    rig.ms(50)
    rig.pins.motors(0, 0, rig.now)
    rig.pins.set("p2dx_con", True, rig.now)
    for _ in range(20):
        rig.ms(50)
        assert rig.robot.state.left_setpoint_mps == 0
