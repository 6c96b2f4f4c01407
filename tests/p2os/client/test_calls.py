"""Each call that does not wait, as the command that it becomes on the wire."""

import math
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from p2os.client.calls import GripperAction, Result, RobotCalls
from p2os.client.core import RobotCore
from p2os.client.goals import DriveAxis, TurnAxis
from p2os.errors import LocalProtocolError
from p2os.protocol.commands import Command
from p2os.protocol.commands import CommandNumber as C
from simbase.errors import UsageError
from simbase.timing import Nanos
from tests.p2os.client.client_rig import Rig


class Calls(RobotCalls):
    """The calls on a rig in virtual time."""

    def __init__(self, rig: Rig) -> None:
        self.rig = rig

    def _run(self, call: Callable[[RobotCore, Nanos], Result]) -> Result:
        return call(self.rig.core, self.rig.now)


@pytest.fixture(scope="module")
def calls() -> Calls:
    return Calls(Rig().connect())


def said_by(calls: Calls, call: Callable[[Calls], object]) -> list[Command]:
    calls.rig.run(0.2)
    before = len(calls.rig.sent)
    call(calls)
    calls.rig.run(0.1)
    return [command for command in calls.rig.commands()[before:] if command.number not in {C.PULSE, C.VEL, C.RVEL}]


TABLE: list[tuple[Callable[[Calls], object], list[Command]]] = [
    (lambda robot: robot.stop(), [Command(C.STOP)]),
    (lambda robot: robot.emergency_stop(), [Command(C.E_STOP), Command(C.STOP)]),
    (lambda robot: robot.disable(), [Command(C.ENABLE, 0)]),  # nothing moves: test_mover.py has one that does
    (lambda robot: robot.set_sonar(), [Command(C.SONAR, 1)]),
    (lambda robot: robot.set_sonar(on=False), [Command(C.SONAR, 0)]),
    (lambda robot: robot.set_sonar_order([0, 0, 7]), [Command(C.POLLING, b"\x01\x01\x08")]),
    (lambda robot: robot.set_digital(0x0F, 0x05), [Command(C.DIGOUT, 0x0F05)]),
    (lambda robot: robot.set_digital(0xFF, 0x55), [Command(C.DIGOUT, 0xFF55 - 0x10000)]),
    (lambda robot: robot.select_analog(3), [Command(C.ADSEL, 3)]),
    (lambda robot: robot.request_io(), [Command(C.IOREQUEST, 1)]),
    (lambda robot: robot.request_io(always=True), [Command(C.IOREQUEST, 2)]),
    (lambda robot: robot.request_encoders(), [Command(C.ENCODER, 1)]),
    (lambda robot: robot.request_encoders(always=True), [Command(C.ENCODER, 2)]),
    (lambda robot: robot.say([(0.5, 60), (5.1, 0)]), [Command(C.SAY, bytes((25, 60, 255, 0)))]),
    (lambda robot: robot.play_sound(7), [Command(C.SOUND, 7)]),
    (lambda robot: robot.set_buzzer(on=False), [Command(C.SOUNDTOG, 0)]),
    (lambda robot: robot.send(C.SETO), [Command(C.SETO)]),
    (lambda robot: robot.send(Command(C.CONFIG)), [Command(C.CONFIG)]),
    (lambda robot: robot.gripper.open(), [Command(C.GRIPPER, 1)]),
    (lambda robot: robot.gripper.close(), [Command(C.GRIPPER, 2)]),
    (lambda robot: robot.gripper.stop(), [Command(C.GRIPPER, 15)]),
    (lambda robot: robot.gripper.lift_up(), [Command(C.GRIPPER, 4)]),
    (lambda robot: robot.gripper.lift_down(), [Command(C.GRIPPER, 5)]),
    (lambda robot: robot.gripper.store(), [Command(C.GRIPPER, 7)]),
    (lambda robot: robot.gripper.deploy(), [Command(C.GRIPPER, 8)]),
    (lambda robot: robot.gripper.act(GripperAction.LIFT_STOP), [Command(C.GRIPPER, 6)]),
    (lambda robot: robot.gripper.set_pressure(9), [Command(C.GRIPPERVAL, 9), Command(C.GRIPPER, 16)]),
    (lambda robot: robot.gripper.carry(-5), [Command(C.GRIPPERVAL, -5), Command(C.GRIPPER, 17)]),
    (lambda robot: robot.gripper.request(), [Command(C.GRIPREQUEST, 1)]),
    (lambda robot: robot.gripper.request(always=True), [Command(C.GRIPREQUEST, 2)]),
]  # fmt: skip


@pytest.mark.parametrize("row", range(len(TABLE)))
def test_each_call_is_its_command(calls: Calls, row: int) -> None:
    call, expected = TABLE[row]
    assert said_by(calls, call) == expected


def test_limits_are_set_in_the_robots_units_and_known_from_then_on(calls: Calls) -> None:
    sent = said_by(
        calls,
        lambda robot: robot.set_limits(
            forward_mps=0.5, turn_radps=1.0, accel_mps2=0.4, decel_mps2=0.3, turn_accel_radps2=2.0,
            turn_decel_radps2=3.0,
        ),
    )  # fmt: skip
    assert sent == [Command(C.SETV, 500), Command(C.SETRV, 57), Command(C.SETA, 400), Command(C.SETA, -300),
                    Command(C.SETRA, 115), Command(C.SETRA, -172)]  # fmt: skip
    assert calls.limits.forward_mps == 0.5
    assert calls.limits.turn_radps == pytest.approx(math.radians(57))
    assert calls.limits.decel_mps2 == 0.3
    assert said_by(calls, lambda robot: robot.set_limits(accel_mps2=0.0006)) == [Command(C.SETA, 1)]
    calls.set_velocity(2.0, -9.0)
    calls.rig.living(0.2)
    assert Command(C.VEL, 500) in calls.rig.commands()
    assert Command(C.RVEL, -57) in calls.rig.commands()
    calls.stop()


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda robot: robot.set_digital(256, 0), "outputs are eight bits"),
        (lambda robot: robot.set_digital(0, -1), "outputs are eight bits"),
        (lambda robot: robot.say([(6.0, 60)]), "at most 5.1 s"),
        (lambda robot: robot.say([(1.0, 256)]), "tones 0 to 255"),
        (lambda robot: robot.say([(1.0, 60)] * 21), "21 notes: SAY takes at most 20"),
        (lambda robot: robot.set_limits(forward_mps=0.0), "a limit of 0.0 is not positive"),
        (lambda robot: robot.set_limits(accel_mps2=math.inf), "not positive"),
        (lambda robot: robot.set_limits(decel_mps2=0.0005), "a limit of 0.0005 is 0 in whole mm/s2"),
        (lambda robot: robot.set_limits(turn_radps=0.5 / math.degrees(1)), "is 0 in whole deg/s, which"),
        (lambda robot: robot.set_limits(forward_mps=0.5, turn_accel_radps2=-1.0), "a limit of -1.0 is not positive"),
        (lambda robot: robot.set_limits(forward_mps=0.5, accel_mps2=99.0), "99000"),
        (lambda robot: robot.set_velocity(math.nan), "is no speed"),
    ],
)
def test_a_value_that_the_robot_cannot_take_is_refused_by_name(
    calls: Calls, call: Callable[[Calls], object], text: str
) -> None:
    before = len(calls.rig.sent)
    with pytest.raises((UsageError, LocalProtocolError), match=text):
        call(calls)
    assert len(calls.rig.sent) == before


@settings(max_examples=50)
@given(
    number=st.integers(0, 255),
    argument=st.one_of(st.none(), st.integers(-65535, 65535), st.binary(max_size=199)),
)
def test_any_command_leaves_as_it_is(number: int, argument: int | bytes | None) -> None:
    rig = Rig().connect()
    Calls(rig).send(number, argument)
    rig.run(0.01)
    assert Command(number, argument) in rig.commands()


@pytest.mark.parametrize(
    ("call", "wants"),
    [
        (lambda robot: robot.set_velocity("0.2m/s"), "set_velocity takes m/s as a number, not '0.2m/s'"),
        (lambda robot: robot.set_velocity(0.1, "9deg/s"), "set_velocity takes rad/s as a number, not '9deg/s'"),
        (lambda robot: robot.set_pose("1m"), "set_pose takes metres as a number, not '1m'"),
        (lambda robot: robot.set_limits(forward_mps="1m/s"), "set_limits takes SI units as a number, not '1m/s'"),
        (lambda _: DriveAxis("1m"), "drive takes metres as a number, not '1m'"),  # type: ignore[arg-type]  # on purpose
        (lambda _: TurnAxis("90deg"), "turn takes radians as a number, not '90deg'"),  # type: ignore[arg-type]  # as above
    ],
)
def test_a_text_in_place_of_a_number_is_refused_with_the_unit_that_is_taken(
    calls: Calls, call: Callable[[Calls], object], wants: str
) -> None:
    with pytest.raises(UsageError) as caught:
        call(calls)
    assert str(caught.value) == wants
