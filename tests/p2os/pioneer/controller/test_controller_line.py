"""The line's speed: what fits goes, extras are dropped, the period stretches, and nothing ever queues."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2os.pioneer.serve.paced_line import LUMP, PacedLine
from p2os.protocol.commands import CommandNumber as C
from p2os.protocol.profiles import Profile
from simbase.timing import NS_PER_MS, NS_PER_S

MakeRobot = Callable[..., Any]
#: One character, 8N1, at 9600 bit/s.
CHARACTER_NS = 10 * NS_PER_S // 9600


def sip_times(robot: Any, milliseconds: int) -> list[int]:
    """Return when standard packets are handed to the line, in ms."""
    found: list[int] = []
    robot.frames()
    for _ in range(milliseconds):
        robot.run(1)
        if any(frame.kind in {0x32, 0x33} for frame in robot.frames()):
            found.append(robot.now // NS_PER_MS)
    return found


def gaps(times: list[int]) -> set[int]:
    return {later - earlier for earlier, later in pairwise(times)}


def test_a_line_that_keeps_up_carries_a_packet_a_cycle_and_reports_its_load(make_robot: MakeRobot) -> None:
    robot = make_robot(baud=9600).open()
    robot.run(500)
    assert gaps(sip_times(robot, 1000)) == {100}
    # 36 bytes with two readings: 37.5 ms of 100.
    assert robot.pioneer.state.line_load_percent == 38
    assert robot.pioneer.state.packets_dropped == 0


def test_extra_packets_that_do_not_fit_are_dropped_and_the_cycle_stays(make_robot: MakeRobot) -> None:
    robot = make_robot(baud=9600, profile=Profile.ARCOS, model="p3dx", sonar_per_sip=all_sonar()).open()
    for number in (C.IOREQUEST, C.ENCODER, C.GRIPREQUEST, C.JOYREQUEST):
        robot.say(number, 2)
    robot.run(2000)
    robot.frames()
    for _ in range(20):
        robot.run(100)
        size = sum(len(frame.to_bytes()) for frame in robot.frames())
        assert size * CHARACTER_NS <= 110 * NS_PER_MS, "a cycle's bytes and one packet of grace at most"
    assert robot.pioneer.state.packets_dropped > 20
    load = robot.pioneer.state.line_load_percent
    assert load is not None
    assert 80 < load <= 100


def all_sonar() -> Any:
    from p2os.pioneer.controller import SonarPerSip

    return SonarPerSip.ALL


def test_a_packet_longer_than_its_cycle_stretches_it(make_robot: MakeRobot) -> None:
    robot = make_robot(baud=9600, sip_period_ns=20 * NS_PER_MS, profile=Profile.ARCOS, sonar_per_sip=all_sonar()).open()
    robot.run(500)
    size = len(robot.sip().to_frame(Profile.ARCOS).to_bytes())
    times = sip_times(robot, 2000)
    mean = (times[-1] - times[0]) / (len(times) - 1)
    assert mean == pytest.approx(size * CHARACTER_NS / NS_PER_MS, abs=1)
    assert robot.pioneer.state.line_load_percent == 100


def test_a_flood_of_questions_is_answered_within_a_small_buffer(make_robot: MakeRobot) -> None:
    robot = make_robot(baud=9600).open()
    for _ in range(500):
        robot.say(C.CONFIG)
    assert robot.pioneer.state.packets_dropped > 480
    robot.run(3000)
    frames = robot.frames()
    assert sum(frame.kind == 0x20 for frame in frames) <= 9
    assert sum(frame.kind == 0x32 for frame in frames) > 10, "packets go on between the answers"


def test_hostbaud_changes_the_speed_until_the_client_closes(make_robot: MakeRobot) -> None:
    robot = make_robot(baud=9600, profile=Profile.ARCOS).open()
    robot.say(C.HOSTBAUD, 2)
    assert robot.pioneer.baud == 38400
    robot.say(C.HOSTBAUD, 77)
    assert robot.pioneer.baud == 38400
    robot.run(1500)
    load = robot.pioneer.state.line_load_percent
    assert load is not None
    assert load < 20
    robot.say(C.CLOSE)
    assert robot.pioneer.baud == 9600


@given(
    st.lists(st.tuples(st.integers(0, 50), st.binary(min_size=1, max_size=60)), max_size=20),
    st.sampled_from([9600, 38400, 115200]),
)
def test_a_paced_line_loses_and_hastens_nothing(puts: list[tuple[int, bytes]], baud: int) -> None:
    line, now, sent, heard = PacedLine(baud), 0, b"", []
    for milliseconds, data in puts:
        now += milliseconds * NS_PER_MS
        heard += line.take(now)
        line.put(data, now)
        sent += data
    end = line.free_at
    heard += line.take(end)
    assert b"".join(lump for _, lump in heard) == sent
    assert line.waiting == 0
    assert line.next_deadline() is None
    character_ns = 10 * NS_PER_S / baud
    for (earlier, _), (later, lump) in pairwise(heard):
        assert len(lump) <= LUMP
        assert later - earlier >= len(lump) * character_ns - 1


def test_a_paced_line_delivers_at_the_last_characters_time_and_follows_another_speed() -> None:
    line = PacedLine(9600)
    line.put(b"x" * 96, 0)
    assert line.free_at == 100 * NS_PER_MS, "96 characters in 100 ms"
    line.set_baud(19200)
    line.put(b"y" * 96, 0)
    assert line.free_at == 150 * NS_PER_MS
    assert line.take_all() == b"x" * 96 + b"y" * 96
    assert line.waiting == 0
