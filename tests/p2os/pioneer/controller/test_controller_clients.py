"""The virtual robot against clients: captured ones, hostile lines, and this project's own Connection."""

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

from p2os.protocol.commands import Command, enable, rvel, stop, vel, vel2
from p2os.protocol.commands import CommandNumber as C
from p2os.protocol.connection import (
    ConfigReceived,
    Connection,
    ConnectionRole,
    ConnectionState,
    Opened,
    SipReceived,
    Synchronised,
)
from simbase.timing import NS_PER_MS, NS_PER_S

MakeRobot = Callable[..., Any]
Capture = list[tuple[float, bytes]]


def replay(robot: Any, capture: Capture) -> list[tuple[int, list[int]]]:
    """Say what a captured client said when it said it; returns (ns, kinds of packets) each 10 ms."""
    heard = []
    for at, data in capture:
        while robot.now + 10 * NS_PER_MS <= at * NS_PER_S:
            robot.run(10)
            heard.append((robot.now, [frame.kind for frame in robot.frames()]))
        robot.run(max(at * 1000 - robot.now / NS_PER_MS, 0))
        robot.send(data)
        heard.append((robot.now, [frame.kind for frame in robot.frames()]))
    return heard


def test_aria_connects_drives_and_leaves(make_robot: MakeRobot, aria: Capture) -> None:
    robot = make_robot(model="p2de", dt_ns=10 * NS_PER_MS)
    heard = replay(robot, aria)
    kinds = [kind for _, frames in heard for kind in frames]
    assert kinds[:4] == [0, 1, 2, 0x20], "each sync and CONFIG are answered at once"
    assert kinds.count(0x32) > 10
    assert kinds.count(0x33) > 100, "the robot moved"
    assert robot.reported()[0] == "synchronised"
    assert robot.reported()[-1] == "closed"
    assert "watchdog expired" not in robot.reported(), "whatever ARIA sends feeds the watchdog"
    ignored = {detail for _, what, detail in robot.events if what == "command ignored"}
    assert ignored == {"BATTERYINFO: unknown"}
    assert not robot.pioneer.state.motors_enabled


def test_player_connects_drives_and_leaves(make_robot: MakeRobot, player: Capture) -> None:
    robot = make_robot(model="p2de", dt_ns=10 * NS_PER_MS)
    heard = replay(robot, player)
    kinds = [kind for _, frames in heard for kind in frames]
    assert kinds[:3] == [0, 1, 2]
    assert 0x33 in kinds
    assert robot.pioneer.state.open, "this capture ends with the connection, not with CLOSE"
    assert robot.pioneer.state.ignored_commands == 0
    # Player reads one packet after each command: one has to come within a cycle and a half.
    opened = next(now for now, what, _ in robot.events if what == "opened")
    for at, _ in player[:-1]:
        due = round(at * NS_PER_S)
        if due > opened:
            assert any(due <= now <= due + 150 * NS_PER_MS and kinds for now, kinds in heard)


@pytest.mark.parametrize("name", ["aria", "player"])
def test_a_conversation_cut_anywhere_leaves_the_robot_free_for_the_next(
    make_robot: MakeRobot, name: str, request: pytest.FixtureRequest
) -> None:
    talk = b"".join(data for _, data in request.getfixturevalue(name))
    for cut in range(120):
        robot = make_robot()
        robot.send(talk[:cut])
        robot.pioneer.hang_up(robot.now)
        robot.frames()
        robot.open(motors=False)
        assert robot.pioneer.state.open, f"cut after {cut} bytes"


def test_bytes_one_by_one_mean_the_same_as_in_a_lump(make_robot: MakeRobot, aria: Capture) -> None:
    lump, drop = make_robot(), make_robot()
    talk = b"".join(data for _, data in aria[:-1])  # all but CLOSE
    lump.send(talk)
    for byte in talk:
        drop.send(bytes([byte]))
    assert lump.events == drop.events
    assert lump.pioneer.take_output() == drop.pioneer.take_output()
    assert lump.pioneer.state == drop.pioneer.state


def test_a_client_that_asks_and_closes_in_one_breath_gets_no_answer(robot: Any) -> None:
    robot.open()
    robot.send(b"".join(Command(number).to_frame().to_bytes() for number in (C.CONFIG, C.CLOSE)))
    assert robot.frames() == []
    assert not robot.pioneer.state.open


@given(noise=st.lists(st.binary(max_size=40), max_size=20), gap_ms=st.integers(0, 300))
@settings(max_examples=30)
def test_noise_never_moves_raises_or_opens(make_robot: MakeRobot, noise: list[bytes], gap_ms: int) -> None:
    robot = make_robot()
    for data in noise:
        robot.send(data.replace(b"\xfa\xfb", b"\xfa"))
        robot.run(gap_ms)
    assert not robot.pioneer.state.open
    assert robot.body.state.left_angle_rad == robot.body.state.right_angle_rad == 0
    robot.run(300)  # the decoder gives up a stalled frame after 250 ms
    robot.frames()
    robot.open(motors=False)
    assert robot.pioneer.state.open


# The robot and this project's own client -----------------------------------------------


class Couple:
    """A client's Connection and a robot on one line that the test can cut or spoil."""

    def __init__(self, robot: Any) -> None:
        self.robot = robot
        self.client = Connection(ConnectionRole.CLIENT)
        self.heard: list[object] = []
        self.line_is_up = True
        self.spoil_next = False

    def exchange(self) -> None:
        """Carry every byte that waits, both ways, until none does."""
        while True:
            while (event := self.client.next_event()) is not None:
                self.heard.append(event)
            to_robot, to_client = self.client.take_output(), self.robot.pioneer.take_output()
            if not to_robot and not to_client:
                return
            for data in to_robot if self.line_is_up else []:
                self.robot.send(self._carried(data))
            for data in to_client if self.line_is_up else []:
                self.client.receive(self._carried(data), self.robot.now)

    def run(self, milliseconds: int) -> None:
        self.exchange()
        end = self.robot.now + milliseconds * NS_PER_MS
        while self.robot.now < end:
            due = [at for at in (self.client.next_deadline(), self.robot.pioneer.next_deadline()) if at is not None]
            now = min([end, *(max(at, self.robot.now) for at in due)])
            self.robot.now = now
            self.client.advance_to(now)
            self.robot.pioneer.advance_to(now)
            self.exchange()

    def _carried(self, data: bytes) -> bytes:
        if not self.spoil_next:
            return data
        self.spoil_next = False
        return data[:-1] + bytes([data[-1] ^ 0x55])


def test_our_client_opens_drives_asks_and_leaves(make_robot: MakeRobot) -> None:
    couple = Couple(make_robot())
    couple.client.connect(0)
    couple.run(400)
    assert [type(event) for event in couple.heard][:2] == [Synchronised, Opened]
    couple.client.send(Command(C.CONFIG), couple.robot.now)
    couple.client.send(enable(True), couple.robot.now)
    couple.client.send(vel(200), couple.robot.now)
    couple.run(3000)
    assert any(isinstance(event, ConfigReceived) for event in couple.heard)
    assert couple.robot.body.state.left_speed_mps == 0.2, "PULSE keeps it moving"
    packets = [event.sip for event in couple.heard if isinstance(event, SipReceived)]
    assert packets[-1].raw_left_velocity == 200
    couple.client.disconnect(couple.robot.now)
    couple.run(10)
    assert not couple.robot.pioneer.state.open
    assert couple.robot.body.state.left_speed_mps == 0


def test_a_client_that_finds_the_robot_streaming_stops_it_first(make_robot: MakeRobot) -> None:
    couple = Couple(make_robot())
    couple.robot.open()
    couple.robot.say(C.VEL, 300)
    couple.robot.run(1000)
    couple.robot.frames()
    couple.client.connect(couple.robot.now)
    couple.run(1500)
    assert couple.client.state is ConnectionState.OPEN
    assert couple.robot.body.state.left_speed_mps == 0
    assert couple.robot.reported().count("opened") == 2


class Machine(RuleBasedStateMachine):
    """Whatever a client and a bad line do, the robot keeps its safety rules."""

    make: MakeRobot

    @initialize()
    def begin(self) -> None:
        self.couple = Couple(self.make(dt_ns=20 * NS_PER_MS))
        self.robot = self.couple.robot
        self.silent_since = 0

    @precondition(lambda self: self.couple.client.state.value in {"closed", "lost", "failed"})
    @rule()
    def connect(self) -> None:
        self.couple.client.connect(self.robot.now)
        self.couple.run(500)

    @rule()
    def disconnect(self) -> None:
        self.couple.client.disconnect(self.robot.now)
        self.couple.exchange()
        if self.couple.line_is_up and not self.couple.spoil_next and self.couple.client.stats.wire.bad_checksums == 0:
            assert not self.robot.pioneer.state.motors_enabled or not self.robot.pioneer.state.open

    @precondition(lambda self: self.couple.client.is_open)
    @rule(
        command=st.sampled_from([enable(True), enable(False), stop(), Command(C.E_STOP), Command(C.SETO)])
        | st.builds(vel, st.integers(-800, 800))
        | st.builds(rvel, st.integers(-200, 200))
        | st.builds(vel2, st.integers(-128, 127), st.integers(-128, 127))
        | st.builds(Command, st.sampled_from([C.MOVE, C.HEAD, C.DHEAD, C.DCHEAD, C.SETA, C.SETRA, C.SETV, C.SETRV]),
                    st.integers(-400, 400))
        | st.builds(Command, st.integers(3, 255), st.none() | st.integers(-32768, 32767) | st.binary(max_size=20))
    )  # fmt: skip
    def command(self, command: Command) -> None:
        self.couple.client.send(command, self.robot.now)
        self.couple.exchange()

    @rule(milliseconds=st.integers(1, 700))
    def wait(self, milliseconds: int) -> None:
        self.couple.run(milliseconds)

    @rule(up=st.booleans())
    def cut(self, up: bool) -> None:
        self.couple.line_is_up = up

    @rule()
    def spoil(self) -> None:
        self.couple.spoil_next = True

    @rule()
    def hang_up(self) -> None:
        self.robot.pioneer.hang_up(self.robot.now)
        state = self.robot.pioneer.state
        assert (state.open, state.left_setpoint_mps, state.right_setpoint_mps) == (False, 0, 0)

    @rule()
    def long_silence(self) -> None:
        """After the watchdog and the slowest ramp the robot stands, whatever was set."""
        self.couple.line_is_up = False
        self.robot.say(C.SETA, -300)
        self.robot.say(C.SETRA, -100)
        self.couple.run(2000 + 3000 + 5100)
        state = self.robot.pioneer.state
        assert (state.left_setpoint_mps, state.right_setpoint_mps) == (0, 0)
        assert state.watchdog_expired == state.open

    @invariant()
    def a_closed_robot_and_one_without_power_stand(self) -> None:
        state = self.robot.pioneer.state
        if not state.open or not state.motors_enabled:
            assert (state.left_setpoint_mps, state.right_setpoint_mps) == (0, 0)
        assert state.open or not state.motors_enabled
        assert state.open == (self.robot.pioneer.next_deadline() is not None) or not state.open

    @invariant()
    def wheels_stay_within_the_robots_limits(self) -> None:
        state = self.robot.pioneer.state
        assert abs(state.left_setpoint_mps + state.right_setpoint_mps) / 2 <= 2.2
        assert abs(state.left_setpoint_mps) <= 2.2 + 500 * 0.00312


def test_the_robot_keeps_its_safety_rules(make_robot: MakeRobot) -> None:
    class WithRobot(Machine):
        make = staticmethod(make_robot)

    run_state_machine_as_test(WithRobot, settings=settings(max_examples=15, stateful_step_count=25))
