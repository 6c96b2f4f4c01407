"""The virtual robot against what Soar, the ROS driver, p2os-arduino and ARIA with a gyro said to it."""

from collections.abc import Callable, Sequence
from typing import Any

import pytest

from p2os.protocol.commands import Command
from p2os.protocol.commands import CommandNumber as C
from p2os.protocol.frames import Decoder, Frame
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import SIP_KINDS, StandardSip
from simbase.timing import NS_PER_MS, NS_PER_S

MakeRobot = Callable[..., Any]
Said = Sequence[tuple[float, bytes]]
Captured = Callable[[str], Said]
Heard = list[tuple[int, Frame]]

#: Client → firmware and model that it was made for.
CLIENTS = {
    "soar_p3dx": (Profile.ARCOS, "p3dx"),
    "ros_p2dx": (Profile.P2OS, "p2dx"),
    "arduino_p2dx": (Profile.P2OS, "p2dx"),
}
#: Each waits for one packet after a command before it goes on (`SendReceive` of player's family).
ONE_PACKET_A_COMMAND = ("ros_p2dx", "arduino_p2dx")
#: How long Soar waits for what it asked for.
SOAR_WAITS_NS = 1 * NS_PER_S


def converse(robot: Any, said: Said) -> Heard:
    """Say it all when it was said; returns (ns, frame) of what the robot answers."""
    heard: Heard = []

    def live_to(at: int) -> None:
        while (due := robot.pioneer.next_deadline()) is not None and due <= at:
            robot.run((due - robot.now) / NS_PER_MS)
            heard.extend((robot.now, frame) for frame in robot.frames())
        robot.run((at - robot.now) / NS_PER_MS)

    for at, data in said:
        live_to(round(at * NS_PER_S))
        robot.send(data)
        heard.extend((robot.now, frame) for frame in robot.frames())
    return heard


def commands(said: Said) -> list[tuple[int, Command]]:
    """Return when each command was given."""
    decoder, found = Decoder(), []
    for at, data in said:
        decoder.receive(data, 0)
        while (item := decoder.next_item()) is not None:
            assert isinstance(item, Frame)
            found.append((round(at * NS_PER_S), Command.from_frame(item)))
    return found


def when(said: Said, number: C, argument: int | None) -> int:
    """Return when a command was given first."""
    return next(at for at, command in commands(said) if (command.number, command.argument) == (number, argument))


@pytest.mark.parametrize("name", CLIENTS)
def test_a_captured_client_connects_drives_and_leaves(make_robot: MakeRobot, captured: Captured, name: str) -> None:
    profile, model = CLIENTS[name]
    robot = make_robot(model=model, profile=profile)
    heard = converse(robot, captured(name))
    kinds = [frame.kind for _, frame in heard]
    assert kinds[:3] == [0, 1, 2]
    assert kinds.count(0x33) > 20, "the robot moved"
    assert "watchdog expired" not in robot.reported(), "what it says keeps the robot awake"
    assert robot.reported()[-1] == "closed"
    assert robot.pioneer.state.ignored_commands == 0
    assert not robot.pioneer.state.motors_enabled
    converse(robot, [(robot.now / NS_PER_S + at, data) for at, data in captured(name)])
    assert robot.reported().count("opened") == 2, "it may come again at once"


@pytest.mark.parametrize("name", ONE_PACKET_A_COMMAND)
def test_a_packet_follows_every_command_within_a_cycle(make_robot: MakeRobot, captured: Captured, name: str) -> None:
    profile, model = CLIENTS[name]
    robot = make_robot(model=model, profile=profile)
    said = captured(name)
    packets = [at for at, frame in converse(robot, said) if frame.kind in SIP_KINDS]
    opened = next(now for now, what, _ in robot.events if what == "opened")
    closed = next(now for now, what, _ in robot.events if what == "closed")
    for at, _ in commands(said):
        if opened < at < closed - 100 * NS_PER_MS:
            assert any(at < packet <= at + 100 * NS_PER_MS for packet in packets), f"none after {at} ns"


def test_soar_finds_sonar_pins_and_configuration_in_time(make_robot: MakeRobot, captured: Captured) -> None:
    said = captured("soar_p3dx")
    heard = converse(make_robot(model="p3dx", profile=Profile.ARCOS), said)
    for number, argument, kind in ((C.IOREQUEST, 2, 0xF0), (C.CONFIG, None, 0x20), (C.ENCODER, 1, 0x90)):
        asked = when(said, number, argument)
        assert any(frame.kind == kind and asked <= at <= asked + SOAR_WAITS_NS for at, frame in heard), number
    packets = [(at, StandardSip.from_frame(frame, Profile.ARCOS)) for at, frame in heard if frame.kind in SIP_KINDS]
    assert all(len(sip.tail) >= 3 for _, sip in packets), "battery, charge and turning speed, or Soar drops it"
    asked = when(said, C.SONAR, 1)
    assert any(sip.raw_flags & 2 and asked <= at <= asked + SOAR_WAITS_NS for at, sip in packets)


def test_soars_pins_turn_as_it_says_though_it_sends_them_as_a_large_positive_number(
    make_robot: MakeRobot, captured: Captured
) -> None:
    robot = make_robot(model="p3dx", profile=Profile.ARCOS)
    heard = converse(robot, [row for row in captured("soar_p3dx") if row[0] < 12.0])
    last = [frame for _, frame in heard if frame.kind in SIP_KINDS][-1]
    assert StandardSip.from_frame(last, Profile.ARCOS).digital_out == 0x54


def test_aria_with_a_gyro_is_silent_for_three_seconds_and_drives_after_them(
    make_robot: MakeRobot, captured: Captured
) -> None:
    """It waits for the gyro to settle and says nothing meanwhile: the watchdog bites, and lets go again."""
    robot = make_robot(model="p3dx", profile=Profile.ARCOS)
    heard = converse(robot, captured("aria_p3dx_gyro"))
    reported = robot.reported()
    assert reported.index("watchdog expired") < reported.index("watchdog revived") < reported.index("motors")
    assert sum(frame.kind == 0x98 for _, frame in heard) > 40, "gyro packets while it waits"
    assert any(frame.kind == 0x33 for _, frame in heard)
