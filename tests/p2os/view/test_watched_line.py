"""A line that a page watches: its bytes pass as they are, and each is seen once."""

from hypothesis import given
from hypothesis import strategies as st

from p2os import Robot, VirtualClock, served_pioneer
from p2os.capture import Direction
from p2os.transport import Loops, open_url
from p2os.view.watched_line import WatchedConversation, WatchedLine


@given(st.lists(st.tuples(st.booleans(), st.binary(max_size=9)), max_size=12))
def test_each_byte_passes_and_is_seen_once(steps: list[tuple[bool, bytes]]) -> None:
    loops, seen = Loops(), list[tuple[Direction, bytes]]()
    listener = loops.listen("x")
    line = WatchedLine(loops.connect("x"), lambda direction, data: seen.append((direction, data)))
    far = listener.accept()
    assert far is not None
    sent, got = b"", b""
    for is_sent, data in steps:
        if is_sent:
            line.write(data)
            sent += data
        else:
            far.write(data)
            got += data
            assert line.read() == data
    assert far.read() == sent
    assert b"".join(data for direction, data in seen if direction is Direction.TO_ROBOT) == sent
    assert b"".join(data for direction, data in seen if direction is Direction.FROM_ROBOT) == got
    assert all(data for _, data in seen)


def test_a_drive_that_is_watched_shows_where_the_robot_believes_to_be() -> None:
    clock = VirtualClock()
    with served_pioneer(body="kinematic", clock=clock) as url:
        watched = WatchedConversation(url, "", clock)
        with Robot(url, clock=clock, opener=lambda where: watched.watched(open_url(where))) as robot:
            robot.drive(0.5)
            x_m = robot.state.pose.x_m
        watched.source.end()
    watched.source.update()
    tracks = {track.header.name: track for track in watched.source.recording.tracks}
    assert abs(x_m - 0.5) < 0.02
    assert any(abs(float(x) - x_m) < 1e-6 for x in tracks["pose"].column("x_m"))
    assert tracks["P2OS"].column("name")[-1] == "CLOSE"
    assert sum(tracks["P2OS"].column("is_bad")) == 0  # type: ignore[arg-type]  # numbers
    assert watched.source.recording.header.is_live is False
