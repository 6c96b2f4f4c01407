"""Recorded conversations played again, in virtual time; and what a tap sends at the end."""

import zlib
from collections.abc import Iterator
from pathlib import Path
from random import Random

import pytest

from p2os.capture import Direction, capture_of, frame_chunks, read_file
from p2os.capture.replay import Replay
from p2os.capture.tap import Tap
from p2os.protocol.commands import Command, CommandNumber
from p2os.protocol.connection import Connection, ConnectionRole, ConnectionState, SipReceived
from simbase.timing import NS_PER_MS, NS_PER_S
from tests.tools.suite.golden import kept_in

GOLDEN = Path(__file__).resolve().parents[2] / "golden" / "captures"
TO, FROM = Direction.TO_ROBOT, Direction.FROM_ROBOT
#: AMRISim sent one SIP whose sonar count promises more readings than it holds.
ONE_UNSOUND = 1
ARIA = read_file(GOLDEN / "aria_p2de.jsonl")


def command(number: int, argument: int | None = None) -> bytes:
    return Command(number, argument).to_frame().to_bytes()


@pytest.mark.parametrize("step_ms", [1, 7, 50])
def test_a_client_connects_to_a_recorded_robot_and_hears_all_its_packets(step_ms: int) -> None:
    robot, client = Replay(ARIA, FROM), Connection(ConnectionRole.CLIENT)
    robot.start(0)
    now, sips, synchronised = 700 * NS_PER_MS, [], []
    client.connect(now)
    while robot.frames_left and now < 60 * NS_PER_S:
        for data in client.take_output():
            robot.receive(data, now)
        robot.advance_to(now)
        for data in robot.take_output():
            client.receive(data, now)
        client.advance_to(now)
        while (event := client.next_event()) is not None:
            sips += [event.sip] if isinstance(event, SipReceived) else []
            synchronised += [event.identity.subclass] if hasattr(event, "identity") else []
        now += step_ms * NS_PER_MS
    assert synchronised == ["p2de"]
    assert robot.frames_left == 0
    assert client.state is ConnectionState.OPEN
    recorded = [piece for piece in frame_chunks(ARIA.chunks) if piece.direction is FROM]
    assert len(sips) == sum(piece.data[3] in {0x32, 0x33} for piece in recorded) - ONE_UNSOUND


def test_a_recorded_client_waits_for_the_robot_s_answers_and_keeps_its_pace_afterwards() -> None:
    talk = capture_of([
        (0, TO, command(0)), (10, FROM, command(0)), (20, TO, command(1)), (25, FROM, command(1)),
        (100, TO, command(11, 200)), (150, TO, command(29)),
    ])  # fmt: skip
    client = Replay(talk, TO, speed=0.5)
    client.start(1000)
    client.advance_to(1000)
    assert client.take_output() == [command(0)]
    client.advance_to(1500)
    assert client.take_output() == []
    assert (client.awaited, client.next_deadline()) == ("an answer to a SYNC", None)
    assert client.waited(1600) == 1600 - 1040
    client.receive(command(0), 1700)
    client.advance_to(1700)
    assert (client.take_output(), client.waited(1700)) == ([command(1)], 0)
    client.receive(command(1), 1701)
    assert (client.awaited, client.next_deadline()) == ("", 1700 + 160)
    client.advance_to(1859)
    assert client.take_output() == []
    client.advance_to(1860)
    assert client.take_output() == [command(11, 200)]
    client.advance_to(10_000)
    assert client.take_output() == [command(29)]
    assert (client.frames_left, client.awaited, client.next_deadline()) == (0, "", None)


def test_a_recorded_robot_says_what_it_waits_for() -> None:
    robot = Replay(ARIA, FROM)
    robot.start(5)
    robot.advance_to(NS_PER_S)
    assert (robot.take_output(), robot.awaited) == ([], "SYNC0")


def test_an_empty_capture_has_nothing_to_play() -> None:
    replay = Replay(capture_of([]), TO)
    replay.start(0)
    assert (replay.frames_left, replay.next_deadline(), replay.awaited) == (0, None, "")


def test_a_tap_has_closing_frames_only_for_a_robot_whose_session_is_open() -> None:
    tap, closing = Tap(), []
    for chunk in ARIA.chunks:
        assert tap.observe(chunk.direction or TO, chunk.data, chunk.at_ns).data == chunk.data
        closing.append(tap.closing_frames())
    stop_first = command(CommandNumber.STOP) + command(CommandNumber.VEL, 0) + command(CommandNumber.CLOSE)
    assert set(closing) == {b"", stop_first}
    assert (closing[0], closing[len(closing) // 2], closing[-1]) == (b"", stop_first, b"")


def test_a_tap_that_has_not_seen_the_beginning_has_closing_frames_for_a_robot_that_was_told_to_move() -> None:
    tap = Tap()
    tap.observe(TO, command(CommandNumber.VEL, 200), 0)
    assert tap.closing_frames()
    tap.observe(TO, command(CommandNumber.CLOSE), 1)
    assert tap.closing_frames() == b""


@pytest.mark.parametrize(("code", "baud"), [(0, 9600), (2, 38400), (4, 115200), (9, None)])
def test_a_tap_sees_a_change_of_speed(code: int, baud: int | None) -> None:
    tap = Tap()
    tap.observe(TO, command(CommandNumber.HOSTBAUD, code), 0)
    assert tap.new_baud == baud


def replayed(name: str, role: Direction, speed: float) -> Iterator[str]:
    """Yield what goes out of one side of a recording, while the other side says its own, late and now and then not."""
    capture, draw = read_file(GOLDEN / f"{name}.jsonl"), Random(f"{name} {role} {speed}")
    replay, now = Replay(capture, role, speed=speed), 3 * NS_PER_S
    heard = [piece.data for piece in frame_chunks(capture.chunks) if piece.direction is not role]
    yield f"{name} {role.name} {speed}: {replay.frames_left} frames"
    replay.start(now)
    for number in range(70):
        if heard and number > 2 and draw.random() < 0.6:
            replay.receive(heard.pop(0), now)
        due, awaited, waited = replay.next_deadline(), replay.awaited, replay.waited(now)
        replay.advance_to(now)
        sent = replay.take_output()
        shown = f"{len(sent)} {zlib.crc32(b''.join(sent)):08x}"
        yield f"{now} {due} {awaited!r} {waited} {shown} {replay.frames_left} {replay.is_closed}"
        if not replay.frames_left:
            return
        later = draw.choice((0, 1, 100 * NS_PER_MS))
        now = max(now, due + draw.choice((-1, 0, 1))) if due is not None and draw.random() < 0.7 else now + later


def test_what_is_played_of_recordings_is_what_was_read_and_kept() -> None:
    names = ("player_p2de", "soar_p3dx", "ros_p2dx")
    several = [(name, role, speed) for name in names for role in (TO, FROM) for speed in (1.0, 0.5, 3.0)]
    lines = [line for each in several for line in replayed(*each)]
    assert kept_in("formats")(lines, "replays")
