"""The link: finding a robot, losing it, finding it again; in virtual time."""

from itertools import pairwise

import pytest

from p2os.client.link import PACKETS_THAT_PROVE_A_RATE, TRY_LIMIT_NS, search_plan
from p2os.client.notices import (
    BaudKept,
    BaudRaised,
    ConfigurationKnown,
    Connected,
    GaveUp,
    LinkLost,
    LinkLostError,
    ReconnectPlanned,
)
from p2os.client.outbox import Outbox, Send, SetBaud
from p2os.client.robot_state import RobotState
from p2os.client.settings import SEARCHED_BAUDS, ClientSettings
from p2os.protocol.commands import Command, CommandNumber, enable, rvel, stop, vel
from p2os.protocol.frames import Decoder, Frame
from simbase.timing import NS_PER_S
from tests.p2os.client.client_rig import MS, WIRES, Link, Rig, S, new_pioneer
from tests.tools.each_row import each_row

STOPS = [stop(), vel(0), rvel(0)]
CLOSE = Command(CommandNumber.CLOSE)
SYNC0 = Command(0)


def test_a_session_opens_at_the_floor_of_the_protocol() -> None:
    rig = Rig().connect()
    (connected,) = rig.notices(Connected)
    # SYNC1, SYNC2 and OPEN each leave 5 ms after the one before; the first packet follows OPEN by a cycle of 100 ms.
    assert connected.took_ns == 3 * 5 * MS + 100 * MS
    assert connected.identity.subclass == "p2dx"
    assert rig.core.config is not None
    assert rig.notices(ConfigurationKnown)


def test_a_robot_that_answers_no_config_is_asked_three_times_and_not_again(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Rig()
    monkeypatch.setattr(rig.core._supervisor, "_take_configuration", lambda *_: None)
    rig.connect()
    rig.run(3)
    asked = [at for at, command in rig.sent if command.number == CommandNumber.CONFIG]
    assert len(asked) == 3
    assert {later - earlier for earlier, later in pairwise(asked)} == {300 * MS}
    assert rig.core.config is None


@pytest.mark.parametrize("baud", [9600, 115200])
def test_stop_goes_before_the_first_sync0_and_before_each_repeated_one(baud: int) -> None:
    rig = Rig(baud=baud)
    rig.is_cut = True
    rig.core.connect(0)
    rig.until(lambda: rig.core.link is Link.FAILED)
    sent = rig.commands()
    for place, command in enumerate(sent):
        if command == SYNC0:
            assert sent[place - 3 : place] == STOPS
    assert sent.count(SYNC0) == 11


def test_a_fresh_line_without_a_rate_is_listened_to_and_then_gets_sync0_alone() -> None:
    rig = Rig()
    rig.is_cut = True
    rig.core.connect(0)
    rig.run(0.249)
    assert rig.commands() == []
    rig.until(lambda: rig.core.link is Link.FAILED)
    assert set(rig.commands()) == {SYNC0}
    assert rig.sent[0] == (250 * MS, SYNC0)
    assert rig.commands().count(SYNC0) == 8


def test_a_byte_on_a_fresh_line_is_reason_enough_to_stop_first() -> None:
    rig = Rig()
    rig.core.connect(0)
    rig.run(0.1)
    rig.core.receive(b"\xfa", rig.now)
    rig.run(0.02)
    assert rig.commands()[:4] == [*STOPS, SYNC0]
    rig.until(lambda: rig.core.is_ready)


def test_a_robot_that_another_client_left_moving_never_hears_sync0_before_stop() -> None:
    first = Rig().connect()
    first.core.set_velocity(0.3, 0.0, first.now)
    first.living(1)
    second = Rig(pioneer=first.pioneer, now=first.now)
    second.pioneer.hang_up = lambda _now: None  # type: ignore[method-assign]  # behind a serial-to-TCP box
    second.connect()
    assert second.commands()[:2] == [stop(), vel(0)]
    second.run(3)
    assert second.wheels == (0.0, 0.0)


class TakesAnyFrameForASync:
    """AMRISim's handshake: the first frame of a line is echoed and counted on from; only SYNC0 leads anywhere."""

    def __init__(self) -> None:
        self.inner = new_pioneer()
        self.state = self.inner.state
        self.lines = 0
        self.decoder = Decoder()
        self.is_stuck: bool | None = None
        self.echo: list[bytes] = []

    def receive(self, data: bytes, now: int) -> None:
        if self.is_stuck is None:
            self.decoder.receive(data, now)
            first = self.decoder.next_item()
            assert isinstance(first, Frame)
            self.is_stuck = first.kind != 0
            self.echo += [Frame(bytes((first.kind,))).to_bytes()] if self.is_stuck else []
        if not self.is_stuck:
            self.inner.receive(data, now)

    def hang_up(self, now: int) -> None:
        self.inner.hang_up(now)
        self.lines += 1
        self.decoder, self.is_stuck = Decoder(), None

    def take_output(self) -> list[bytes]:
        echo, self.echo = self.echo, []
        return echo + self.inner.take_output()

    def __getattr__(self, name: str) -> object:
        return getattr(self.inner, name)


def test_a_peer_that_takes_stop_for_a_sync_is_opened_at_first_and_after_a_loss() -> None:
    peer = TakesAnyFrameForASync()
    rig = Rig(pioneer=peer).connect()  # type: ignore[arg-type]
    assert peer.lines == 0
    lost_at = rig.now
    rig.pull()
    rig.plug()
    rig.until(lambda: rig.core.is_ready, within_s=2)
    after = [command for command in rig.commands(lost_at) if command.number != CommandNumber.CONFIG]
    assert after[:3] == STOPS, "after a loss STOP goes first, whoever the peer may be"
    assert after[3:] == [SYNC0, Command(1), CLOSE, Command(1)], "SYNC0, SYNC1, SYNC2 and OPEN, on a new line"
    assert peer.lines == 2, "pulled, and opened anew when STOP was echoed"


def test_a_peer_that_echoes_stop_for_ever_is_a_named_failure() -> None:
    peer = TakesAnyFrameForASync()
    rig = Rig(pioneer=peer).connect()  # type: ignore[arg-type]
    peer.is_stuck = True
    rig.is_cut = True
    rig.run(1.5)
    rig.is_cut = False
    echo = Frame(bytes((CommandNumber.STOP,))).to_bytes()
    peer.receive = lambda _data, _now: peer.echo.append(echo)  # type: ignore[method-assign]
    rig.run(30)
    assert ReconnectPlanned(3, 1000 * MS) in rig.notices(ReconnectPlanned)
    assert rig.core.link is not Link.OPEN


@each_row("wire", WIRES)
@each_row("seed", range(4))
@each_row("baud", [None, 9600])
def test_a_session_opens_over_any_wire_or_fails_by_name(wire: str, seed: int, baud: int | None) -> None:
    rig = Rig(wire=wire, seed=seed, baud=baud)
    rig.core.connect(0)
    rig.until(lambda: bool(rig.notices(Connected) or rig.notices(GaveUp)), within_s=21)
    if wire not in {"lossy", "garbling"}:
        assert rig.notices(Connected)


@pytest.mark.parametrize("robot_baud", [19200, 38400, 57600, 115200])
def test_a_robot_at_another_rate_is_found(robot_baud: int) -> None:
    rig = Rig(baud=9600, robot_baud=robot_baud).connect()
    assert rig.core.baud == robot_baud
    assert rig.notices(Connected)[0].baud == robot_baud
    assert rig.now < 3 * S


def test_a_robot_that_streams_at_another_rate_is_stopped_closed_and_opened() -> None:
    first = Rig(baud=38400, robot_baud=38400).connect()
    first.core.set_velocity(0.3, 0.0, first.now)
    first.living(1)
    second = Rig(baud=9600, robot_baud=38400, pioneer=first.pioneer, now=first.now)
    second.connect()
    assert second.core.baud == 38400
    sent = second.commands()
    at = sent.index(CLOSE)
    assert sent[at - 2 : at] == [stop(), vel(0)]
    second.run(3)
    assert second.wheels == (0.0, 0.0)


def test_a_known_rate_is_tried_between_all_others_and_the_plan_fits_its_limit() -> None:
    plan = search_plan(38400, (9600, 38400, 9600, 19200), ClientSettings(), is_known=True)
    assert [step.baud for step in plan] == [38400, 9600, 38400, 19200, 38400] * 2
    longest = search_plan(9600, SEARCHED_BAUDS, ClientSettings(), is_known=True)
    assert sum(step.wait_ns * step.attempts for step in longest) < TRY_LIMIT_NS


def test_a_silent_line_is_a_named_failure() -> None:
    rig = Rig(baud=9600)
    rig.is_cut = True
    rig.core.connect(0)
    rig.until(lambda: rig.core.link is Link.FAILED, within_s=9)
    (failure,) = rig.notices(GaveUp)
    assert failure.reason == "no answer at 9600, 38400, 115200, 19200, 57600 baud"
    assert not rig.is_open


def test_a_line_of_noise_is_a_named_failure() -> None:
    rig = Rig()
    rig.core.connect(0)
    rig.run(0)
    rig.is_cut = True
    for _ in range(100):
        if rig.is_open:
            rig.core.receive(b"login: \r\n", rig.now)
        rig.run(0.1)
    assert rig.notices(GaveUp)[0].reason == "only noise"


def test_a_line_that_cannot_be_opened_fails_at_once() -> None:
    rig = Rig()
    rig.is_plugged = False
    rig.core.connect(0)
    rig.run(0)
    assert rig.notices() == [GaveUp("cannot open the line: no such port")]


def test_silence_is_a_loss_after_a_second_and_the_robot_is_looked_for() -> None:
    rig = Rig().connect()
    rig.core.set_velocity(0.3, 0.0, rig.now)
    rig.living(1)
    cut_at = rig.now
    rig.is_cut = True
    rig.living(1.1)
    assert rig.notices(LinkLost) == [LinkLost("no packet for 1000 ms")]
    assert rig.notices(ReconnectPlanned)[0].wait_ns == 250 * MS
    after = [command for at, command in rig.sent if at >= cut_at + NS_PER_S - 100 * MS]
    assert after[-2:] == [stop(), vel(0)]
    rig.is_cut = False
    rig.until(lambda: rig.core.link is Link.OPEN)
    lost = rig.commands(cut_at + NS_PER_S)
    assert vel(300) not in lost
    rig.living(3)
    assert rig.wheels == (0.0, 0.0)


def test_after_a_loss_the_first_motion_call_raises_and_the_second_moves() -> None:
    rig = Rig().connect()
    rig.core.set_velocity(0.3, 0.0, rig.now)
    rig.living(1)
    rig.pull()
    with pytest.raises(LinkLostError, match="no robot is connected"):
        rig.core.stop(rig.now)
    rig.plug()
    rig.until(lambda: rig.core.is_ready)
    with pytest.raises(LinkLostError, match="the link was lost and is back: the line vanished"):
        rig.core.set_velocity(0.3, 0.0, rig.now)
    rig.living(1)
    assert rig.wheels == (0.0, 0.0)
    rig.core.set_velocity(0.3, 0.0, rig.now)
    rig.living(1.5)
    assert rig.wheels == (0.3, 0.3)


def test_the_wait_between_tries_doubles_up_to_five_seconds() -> None:
    rig = Rig().connect()
    rig.pull()
    rig.run(60)
    waits = [notice.wait_ns for notice in rig.notices(ReconnectPlanned)]
    assert waits[:6] == [250 * MS, 500 * MS, 1000 * MS, 2000 * MS, 4000 * MS, 5000 * MS]
    assert max(waits) == 5 * S
    rig.plug()
    rig.until(lambda: rig.core.link is Link.OPEN, within_s=6)
    rig.pull()
    assert rig.notices(ReconnectPlanned)[-1].wait_ns == 250 * MS


def test_without_reconnect_a_loss_is_the_end() -> None:
    rig = Rig(settings=ClientSettings(reconnect=False)).connect()
    rig.pull()
    rig.run(10)
    assert rig.core.link is Link.FAILED
    assert rig.notices(GaveUp) == [GaveUp("the line vanished")]
    rig.plug()
    rig.connect()
    assert rig.core.link is Link.OPEN


def test_a_robot_that_reboots_is_noticed_by_its_echo_and_opened_anew() -> None:
    rig = Rig(baud=9600).connect()
    rig.core.set_velocity(0.3, 0.0, rig.now)
    rig.living(1)
    rig.reboot()
    rig.until(lambda: bool(rig.notices(LinkLost)), within_s=1.5)
    rig.until(lambda: rig.core.link is Link.OPEN)
    rig.living(3)
    assert rig.wheels == (0.0, 0.0)


def test_a_robot_that_reboots_while_idle_is_not_kept_alive_by_its_echoes() -> None:
    rig = Rig(baud=9600).connect()
    rig.run(2)
    rig.reboot()
    rig.until(lambda: rig.notices(LinkLost) == [LinkLost("the robot was restarted")], within_s=1)


def test_the_rate_is_raised_where_the_robot_asks_for_it() -> None:
    rig = Rig(baud=9600)
    offer_raise(rig, obeys=True)
    rig.connect()
    rig.until(lambda: rig.core.baud == 38400, within_s=1)
    assert rig.line_baud == 38400
    before = len(rig.news)
    rig.until(lambda: bool(rig.notices(BaudRaised)), within_s=1)
    heard = [type(each) for each in rig.news[before:]]
    assert heard[: heard.index(BaudRaised)].count(RobotState) == PACKETS_THAT_PROVE_A_RATE - 1, "it is the second's"
    rig.run(1)
    assert rig.notices(BaudRaised) == [BaudRaised(38400)]
    assert rig.core.baud == 38400
    assert Command(CommandNumber.HOSTBAUD, 2) in rig.commands()
    rig.run(5)
    assert rig.core.link is Link.OPEN
    rig.core.close(rig.now)
    rig.run(1)
    rig.robot_baud = 9600
    begun, sent = rig.now, len(rig.sent)
    rig.connect()
    assert rig.now - begun < S, "after CLOSE the robot is back at its own rate, and looked for there"
    assert rig.commands()[sent:].count(SYNC0) == 1, "at once"


def test_a_change_of_rate_that_a_loss_has_cut_short_is_none_of_the_next_session() -> None:
    rig = Rig(baud=9600)
    offer_raise(rig, obeys=True)
    rig.connect()
    rig.until(lambda: rig.core.baud == 38400, within_s=1)
    rig.pull()
    rig.until(lambda: rig.core.link is Link.WAITING, within_s=5)
    assert rig.core._supervisor._raise_due() is None, "a deadline that is over would be due for ever"
    rig.robot_baud = 9600
    rig.plug()
    rig.until(lambda: rig.core.link is Link.OPEN and rig.core.is_ready)
    assert len(rig.notices(Connected)) == 2
    assert rig.notices(BaudKept) == []


def test_a_rate_that_the_robot_does_not_take_is_left_again() -> None:
    rig = Rig(baud=9600)
    offer_raise(rig, obeys=False)
    rig.connect()
    rig.run(3)
    assert rig.notices(BaudKept) == [BaudKept(9600, 38400)]
    assert rig.core.baud == 9600
    assert rig.core.link is Link.OPEN
    assert rig.notices(LinkLost) == []


def test_a_robot_left_at_the_raised_rate_is_found_there_after_a_loss() -> None:
    rig = Rig(baud=9600)
    offer_raise(rig, obeys=True)
    rig.connect()
    rig.run(1)
    rig.pull()
    rig.plug()
    begun = rig.now
    rig.until(lambda: rig.core.link is Link.OPEN)
    assert rig.core.baud == 38400
    assert rig.now - begun < S


def offer_raise(rig: Rig, *, obeys: bool) -> None:
    """Let the robot's CONFIGpac ask for a higher rate, and HOSTBAUD act on the line or not."""
    send = rig.pioneer._connection.send

    def with_autobaud(message: object, now: int) -> None:
        if type(message).__name__ == "ConfigPacket":
            message = type(message)(**{**{name: getattr(message, name) for name in message.__slots__},
                                       "autobaud": 2, "fields_sent": 42})  # fmt: skip
        send(message, now)  # type: ignore[arg-type]

    rig.pioneer._connection.send = with_autobaud  # type: ignore[method-assign]
    carry = rig._carry

    def watching(data: bytes, *, to_robot: bool) -> None:
        carry(data, to_robot=to_robot)
        if obeys and to_robot and data == Command(CommandNumber.HOSTBAUD, 2).to_frame().to_bytes():
            rig.robot_baud = 38400

    rig._carry = watching  # type: ignore[method-assign]


def test_closing_stops_the_robot_whatever_is_under_way() -> None:
    rig = Rig().connect()
    rig.core.set_velocity(0.3, 0.0, rig.now)
    rig.living(1)
    before = len(rig.sent)
    rig.core.close(rig.now)
    rig.run(1)
    assert rig.commands()[before:] == [stop(), vel(0), enable(False), CLOSE]
    assert rig.core.link is Link.CLOSED
    assert not rig.is_open
    rig.core.close(rig.now)
    assert rig.core.is_quiet


@each_row("at_ms", range(0, 160, 10))
def test_closing_during_the_handshake_leaves_a_closed_robot(at_ms: int) -> None:
    rig = Rig()
    rig.core.connect(0)
    rig.run(at_ms / 1000)
    rig.core.close(rig.now)
    rig.run(1)
    assert not rig.is_open
    assert not rig.pioneer.state.open
    assert not rig.pioneer.state.motors_enabled


def test_two_rigs_with_one_seed_say_the_same() -> None:
    def story() -> list[object]:
        rig = Rig(wire="lossy", seed=7, pioneer=new_pioneer())
        rig.core.connect(0)
        rig.run(30)
        return rig.sent

    assert story() == story()


def test_what_goes_first_waits_for_a_change_of_the_line_and_for_the_robots_spacing() -> None:
    outbox = Outbox(5 * MS)
    outbox.send([b"one", b"two"])
    assert outbox.take(0) == Send(b"one")
    outbox.send_first([b"first", b"second"])
    assert outbox.take(5 * MS - 1) is None
    assert [outbox.take(at * MS) for at in (5, 10)] == [Send(b"first"), Send(b"second")]
    outbox.put(SetBaud(38400))
    outbox.send([b"pulse"])
    outbox.send_first([b"stop"], is_still=True)
    left = [outbox.take(S + at * S) for at in range(4)]
    assert left == [Send(b"two"), SetBaud(38400), Send(b"stop"), Send(b"pulse")]


@pytest.mark.parametrize(("baud", "free_ms"), [(9600, 10), (115200, 5), (None, 5)])
def test_a_frame_leaves_when_the_bits_of_the_one_before_are_through(baud: int | None, free_ms: int) -> None:
    outbox = Outbox(5 * MS)
    outbox.baud = baud
    outbox.send([bytes(12) if baud == 115200 else bytes(9), b"two"])
    assert outbox.take(0) is not None
    due = outbox.next_deadline()
    assert due is not None
    assert due == pytest.approx(free_ms * MS, rel=0.07)
    assert outbox.take(due - 1) is None
    assert outbox.take(due) == Send(b"two")
