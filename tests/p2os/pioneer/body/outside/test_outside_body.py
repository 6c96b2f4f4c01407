"""A body behind the protocol is the body itself; one that is lost, silent or lies ends in one line."""

import math
import struct
from collections.abc import Callable
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from p2os.errors import P2osError, RemoteProtocolError, TransportError, WorldError
from p2os.pioneer.body.factory import body_class, make_body, make_scene
from p2os.pioneer.body.outside.body import MOST_STEPS, Ability
from p2os.pioneer.body.outside.messages import LONGEST_FRAME, AskRanges, AskRays, Hello, Request, Step, Welcome, encode
from p2os.pioneer.sonar.ring import cones
from p2os.pioneer.world.loader import load_world
from p2os.pioneer.world.model import Obstacle, Pose, Walk
from p2os.robots.parameters import load_parameters
from simbase.errors import UsageError
from tests.p2os.pioneer.body.outside.served import Answering, Last, Served, frame, served, serving
from tests.tools.each_row import each_row

P2DX, ROOM = load_parameters("p2dx"), load_world("room")
FAN = cones(P2DX)[3]
RIM = st.sampled_from([0.0, 0.0, 0.3, -0.2, 0.5])
LEGS = st.lists(st.tuples(RIM, RIM, st.integers(1, 700), st.booleans()), min_size=1, max_size=6)


def reported(body) -> tuple[object, ...]:
    return body.state, body.ranges(range(8)), body.take_hits(), body.take_moved(), body.clearance()


@settings(max_examples=8)
@given(LEGS)
def test_a_body_behind_the_protocol_is_the_body_itself(legs) -> None:
    cart = Obstacle(name="cart", x_m=1.0, y_m=0.3, length_m=0.3, width_m=0.3, mass_kg=2.0)
    with served() as (address, _):
        bodies = [make_body(name, ROOM, P2DX) for name in (address, "kinematic")]
        for body in bodies:
            body.place(cart)
        for left, right, steps, looks in legs:
            for body in bodies:
                for _ in range(steps):
                    wheels = body.step(left, right)
            if looks:
                assert reported(bodies[0]) == reported(bodies[1])
                assert wheels.left_angle_rad == bodies[0].state.left_angle_rad
        for body in bodies:
            body.move("cart", 2.0, 1.0, 0.5)
            body.put_back()
        assert reported(bodies[0]) == reported(bodies[1])
        for body in bodies:
            body.remove("cart")
            body.stand_at(0.5, 0.5, 1.0)
            body.step(0.2, 0.1)
        assert reported(bodies[0]) == reported(bodies[1])
        assert bodies[0].scan(FAN, 8.0) == bodies[1].scan(FAN, 8.0)


def test_what_is_read_does_not_depend_on_when_it_is_read() -> None:
    walk = Walk(points_m=((1.0, -1.0), (1.0, 1.0)), speed_mps=1.0)
    found = []
    for every in (1, 7, 10, 600):
        with served() as (address, _):
            body = make_body(address, ROOM, P2DX)
            body.place(Obstacle(name="cat", x_m=0, y_m=0, radius_m=0.1, walk=walk))
            for number in range(1205):  # what walks was moved last 5 steps before
                body.step(0.4, 0.35)
                if number % every == 0:
                    body.clearance()
            found.append((body.state, body.ranges(range(8)), body.take_moved()))
    assert found[0][2]
    assert all(one == found[0] for one in found)


def test_steps_between_two_looks_go_out_together_up_to_a_second() -> None:
    with served() as (address, servers):
        body = make_body(address, ROOM, P2DX)
        wheels = [body.step(0.1, 0.1) for _ in range(2 * MOST_STEPS + 5)]
        assert servers[0].steps_asked == [MOST_STEPS] * 2
        assert wheels[-1].left_angle_rad == body.state.left_angle_rad
        assert wheels[0].left_angle_rad < wheels[1].left_angle_rad
        assert servers[0].steps_asked == [MOST_STEPS] * 2 + [5]


def test_a_state_that_is_put_back_in_another_connection_goes_on_alike() -> None:
    with served() as (address, servers):
        one, other = (make_body(address, ROOM, P2DX) for _ in range(2))
        one.place(Obstacle(name="box", x_m=1.2, y_m=0, length_m=0.2, width_m=0.2))
        for _ in range(900):
            one.step(0.4, 0.4)
        other.step(0.1, 0.1)
        other.restore(one.snapshot())
        assert len(servers) == 2
        for body in (one, other):
            for _ in range(3000):
                body.step(0.4, 0.4)
        assert one.state.collisions == 1
        assert reported(one) == reported(other)


def test_what_it_cannot_is_said_in_one_line() -> None:
    with served(abilities=Ability(0)) as (address, _):
        body = make_body(address, ROOM, P2DX)
        for call in (body.snapshot, lambda: body.restore(None)):
            with pytest.raises(UsageError, match=r"kinematic, served at unix:\S+ cannot save its state"):
                call()
        for call in (lambda: body.echoes([0]), lambda: body.scan(FAN, 1.0)):
            with pytest.raises(UsageError, match="casts no rays"):
                call()
        assert body.steps_within(1.0, 1.0) == 0
        assert body.state == make_body("kinematic", ROOM, P2DX).state
        with pytest.raises(UsageError, match="one robot, not 2"):
            make_scene(address, ROOM, [P2DX] * 2)
        with pytest.raises(WorldError, match="is inside"):
            body.stand_at(ROOM.extent[0], ROOM.extent[1], 0.0)


# Addresses ----------------------------------------------------------------------------------


@each_row(
    ("text", "what"),
    [
        ("tcp:127.0.0.1", "names no host and port"),
        ("tcp:127.0.0.1:0", "names no host and port"),
        ("tcp:127.0.0.1:65536", "names no host and port"),
        ("tcp::9000", "names no host and port"),
        ("tcp:127.0.0.1:x", "names no host and port"),
        ("tcp:10.0.0.5:9000", "not on this machine"),
        ("tcp:0.0.0.0:9000", "not on this machine"),
        ("tcp:robot.local:9000?timeout=3", "not on this machine"),
        ("unix:", "names no socket"),
        ("unix:" + "x" * 108, "names no socket"),
        ("unix:a?timeout=0", "no option 'timeout=0'"),
        ("unix:a?timeout=nan", "no option"),
        ("unix:a?secure", "no option 'secure'"),
    ],
)
def test_an_address_that_cannot_be_is_refused(text: str, what: str) -> None:
    with pytest.raises(UsageError, match=what):
        body_class(text)


@pytest.mark.parametrize(
    "text", ["tcp:127.0.0.1:1", "tcp:127.9.9.9:65535", "tcp:[::1]:9000", "tcp:localhost:9", "tcp:10.0.0.5:9?anywhere",
             "unix:" + "x" * 107, "unix:a?timeout=0.5", "tcp:a.b:9?timeout=3&anywhere"],
)  # fmt: skip
def test_an_address_is_looked_at_and_not_opened(text: str) -> None:
    body_class(text)


def test_an_address_where_nobody_answers_says_what_to_start(tmp_path) -> None:
    with pytest.raises(TransportError, match=r"cannot reach the outside body unix:.*No such file") as failed:
        make_body(f"unix:{tmp_path.name}-none", ROOM, P2DX)
    assert "start the program" in str(failed.value.hint)


# A far end that lies --------------------------------------------------------------------------


def lying(what: type[Request], data: Callable[[bytes], bytes | None]) -> Callable[[], Answering]:
    """A far end that answers one type of request otherwise."""

    def make() -> Answering:
        honest = Served("kinematic", Ability(7))

        def answer(request: Request) -> bytes | None:
            out = honest(request)
            return data(out) if isinstance(request, what) and out is not None else out

        return answer

    return make


def fails(make: Callable[[], Answering], waits_s: float | None = None) -> P2osError:
    """Return the error of a body that such a far end is; it stays in that error.

    Args:
        make: The far end.
        waits_s: How long the body waits for an answer once it is made: until then the far end answers, however late.
    """
    with serving(make) as address:
        body = make_body(address, ROOM, P2DX)
        for _ in range(5):
            body.step(0.1, 0.1)
        if waits_s is not None:
            line = body.scene.line
            line._address = replace(line._address, timeout_s=waits_s)
        with pytest.raises(P2osError) as first:
            (body.ranges([0, 1]), body.echoes([0]))
        for again in (lambda: body.ranges([0]), lambda: body.place(Obstacle(name="a", x_m=0, y_m=0, radius_m=1))):
            with pytest.raises(P2osError) as later:
                again()
            assert later.value is first.value
        return first.value


def patched(offset: int, data: bytes) -> Callable[[bytes], bytes]:
    return lambda out: out[: 5 + offset] + data + out[5 + offset + len(data) :]


NAN = struct.pack("<d", math.nan)


@pytest.mark.parametrize(
    ("what", "data", "says"),
    [
        (Step, lambda _: struct.pack("<IB", LONGEST_FRAME + 1, 0x89), "a frame of 67108865 bytes"),
        (Step, lambda _: struct.pack("<IB", 0, 0x89), "a frame of 0 bytes"),
        (Step, lambda out: frame(0x8A, out[5:]), "type 0x8A, where 0x89 belongs"),
        (Step, lambda out: frame(0x89, out[5:] + b"\0"), "what has 1 bytes too many, to Step"),
        (Step, lambda out: frame(0x89, out[5:-1]), "what ends"),
        (Step, patched(4, NAN), "has nan where a number"),
        (Step, patched(4 + 5 * 17, NAN), "has nan where a number"),
        (Step, patched(0, struct.pack("<I", 2**32 - 1)), "bytes early"),
        (Step, lambda out: frame(0x89, struct.pack("<I", 4) + out[9 : 9 + 4 * 17] + out[9 + 5 * 17 :]), "by 4 steps"),
        (Step, lambda out: frame(0x89, out[5:-2] + struct.pack("<HH4s3d", 1, 4, b"moon", 0, 0, 0)), "'moon' has moved"),
        (Step, lambda _: frame(0xFF, struct.pack("<H2s", 2, b"no")), "refuses Step: no"),
        (Step, lambda _: frame(0xFF, struct.pack("<H2s", 2, b"\xff\xff")), "no UTF-8"),
        (AskRanges, lambda _: frame(0x8A, struct.pack("<Hd", 1, 1.0)), "by 1 ranges, where 2"),
        (AskRanges, patched(2, struct.pack("<d", -0.1)), "of 0 m or more"),
        (AskRanges, patched(2, NAN), "has nan"),
        (AskRays, lambda _: frame(0x8B, struct.pack("<I", 0)), "by 0 rays, where 9"),
        (AskRays, patched(12, struct.pack("<d", 1.5)), "a distance and a cosine"),
    ],
)
def test_an_answer_that_cannot_be_is_refused_in_one_line(what, data, says: str) -> None:
    error = fails(lying(what, data))
    assert isinstance(error, RemoteProtocolError)
    assert says in str(error)
    assert "\n" not in str(error)
    assert error.exit_code == 1


def test_a_far_end_that_hangs_up_or_is_silent_is_lost() -> None:
    assert "is lost: it has closed the line" in str(fails(lying(Step, lambda _: None)))
    assert "did not answer within 0.02 s" in str(fails(lying(Step, lambda _: b""), 0.02))
    says = pytest.raises(TransportError, match=r"did not answer within 0\.02 s")
    with serving(lying(Hello, lambda _: b"")) as address, says:
        make_body(f"{address}?timeout=0.02", ROOM, P2DX)


def test_an_answer_that_is_cut_at_any_byte_is_lost() -> None:
    answers = list[bytes]()

    def without_end(out: bytes) -> bytes:
        answers.append(out)
        return out[:-1]

    def waits_in_vain(error: P2osError) -> bool:
        return "did not answer within 0.01 s" in str(error)

    assert waits_in_vain(fails(lying(Step, without_end), 0.01))
    whole = len(answers[0])
    for size in (1, 4, 5, 6, whole // 2):  # and then nothing comes
        assert waits_in_vain(fails(lying(Step, lambda out, size=size: out[:size]), 0.01))
    for size in (*range(12), *range(12, whole, 9), whole - 1):  # and then the line ends
        assert "it has closed the line" in str(fails(lying(Step, lambda out, size=size: Last(out[:size])))), size


def test_another_version_is_refused() -> None:
    newer = encode(Welcome(2, 0, "new", ""), 0x81)
    says = pytest.raises(RemoteProtocolError, match="speaks version 2 of the protocol, expected 1")
    with serving(lambda: lambda _: newer) as address, says:
        make_body(address, ROOM, P2DX)


def test_abilities_that_nobody_knows_change_nothing() -> None:
    with served(abilities=0x8000) as (address, _):
        assert make_body(address, ROOM, P2DX).steps_within(1.0, 1.0) == 0


def test_a_reset_begins_in_the_world_as_it_was_made() -> None:
    with served() as (address, _):
        body, exact = make_body(address, ROOM, P2DX), make_body("kinematic", ROOM, P2DX)
        body.place(Obstacle(name="box", x_m=1.2, y_m=0, length_m=0.2, width_m=0.2))
        body.step(0.3, 0.3)
        pose = Pose(0.2, 0.1, 0.3)
        assert body.reset(pose, 5) == exact.reset(pose, 5)
        assert reported(body) == reported(exact)
