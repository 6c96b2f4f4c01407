"""Both ends of a line joined: every wire, every deadline, every way to leave."""

import pickle
from collections.abc import Callable
from random import Random

import pytest
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from p2os.errors import LocalProtocolError
from p2os.protocol.commands import Command, CommandNumber, enable, stop, vel
from p2os.protocol.config_packet import ConfigPacket
from p2os.protocol.connection import (
    Closed,
    CommandReceived,
    ConfigReceived,
    ConnectFailed,
    Connection,
    ConnectionLost,
    ConnectionRole,
    ConnectionSettings,
    ConnectionState,
    Event,
    FrameIgnored,
    NoiseReceived,
    Opened,
    PacketReceived,
    SipReceived,
    Synchronised,
    WatchdogExpired,
    WatchdogRevived,
)
from p2os.protocol.frames import Decoder, Frame
from p2os.protocol.packets import Identity, RawPacket
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import StandardSip
from simbase.timing import NS_PER_MS, NS_PER_S
from tests.tools.each_row import each_row

MS = NS_PER_MS
WILMA = Identity("Wilma", "Pioneer", "p2dx")
SIP = StandardSip(raw_x=7)


def server() -> Connection:
    return Connection(ConnectionRole.SERVER, identity=WILMA)


def client(**times: int) -> Connection:
    return Connection(ConnectionRole.CLIENT, settings=ConnectionSettings(**times))


def events(end: Connection) -> list[Event]:
    found = []
    while (event := end.next_event()) is not None:
        found.append(event)
    return found


def sent(end: Connection) -> list[Command]:
    """What a client has just put on the wire, as commands."""
    return [Command.from_frame(Frame.from_bytes(data)) for data in end.take_output()]


def feed(end: Connection, now: int, *messages: Command | Frame) -> None:
    for message in messages:
        frame = message if isinstance(message, Frame) else message.to_frame()
        end.receive(frame.to_bytes(), now)


def opened_server(now: int = 0) -> Connection:
    end = server()
    feed(end, now, Command(0), Command(1), Command(2), Command(CommandNumber.OPEN, 1))
    assert end.is_open
    events(end), end.take_output()
    return end


def opened_client(**times: int) -> tuple[Connection, int]:
    """Return a client that has just sent OPEN, and when."""
    end = client(**times)
    end.connect(0)
    for frame in (Frame(b"\0"), Frame(b"\1"), WILMA.to_frame()):
        feed(end, 0, frame)
    now = end.settings.open_delay_ns
    end.advance_to(now)
    assert end.is_open
    events(end), end.take_output()
    return end, now


Wire = Callable[[bytes, Random], list[bytes]]
WIRES: dict[str, Wire] = {
    "perfect": lambda data, _: [data],
    "byte by byte": lambda data, _: [data[i : i + 1] for i in range(len(data))],
    "with junk before": lambda data, random_source: [bytes(random_source.randrange(256) for _ in range(3)) + data],
    "lossy": lambda data, random_source: [] if random_source.random() < 0.2 else [data],
    "garbling": lambda data, random_source: (
        [bytes((data[0] ^ 1,)) + data[1:]] if random_source.random() < 0.2 else [data]
    ),
}


@each_row("name", WIRES)
@each_row("seed", range(5))
def test_a_session_opens_over_any_wire_or_fails_by_name(name: str, seed: int) -> None:
    wire, random_source = WIRES[name], Random(seed)
    here, there = client(), server()
    here.connect(0)
    reported: list[Event] = []
    now = 0
    while now < 20 * NS_PER_S and not any(isinstance(event, Opened | ConnectFailed) for event in reported):
        now += 10 * MS
        for near, far in ((here, there), (there, here)):
            near.advance_to(now)
            for data in near.take_output():
                for part in wire(data, random_source):
                    far.receive(part, now)
        reported += events(here)
    assert any(isinstance(event, Opened | ConnectFailed) for event in reported)
    if name in {"perfect", "byte by byte", "with junk before"}:
        assert Synchronised(WILMA) in reported
        assert here.is_open
    assert pickle.dumps(here.snapshot())


def test_the_server_echoes_in_order_and_says_who_it_is_once() -> None:
    end = server()
    feed(end, 0, Command(0), Command(1), Command(2))
    assert end.take_output() == [Frame(b"\0").to_bytes(), Frame(b"\1").to_bytes(), WILMA.to_frame().to_bytes()]
    assert events(end) == [Synchronised(WILMA)]
    assert end.state is ConnectionState.SYNCED


@pytest.mark.parametrize("number", [1, 2, 11])
def test_out_of_order_gets_no_answer_and_is_counted(number: int) -> None:
    end = server()
    feed(end, 0, Command(number))
    assert end.take_output() == []
    assert end.stats.frames_ignored == 1
    assert end.state is ConnectionState.CLOSED


@pytest.mark.parametrize("before", [0, 1, 2, 3])
def test_sync0_restarts_at_any_time_before_open(before: int) -> None:
    end = server()
    feed(end, 0, *(Command(n) for n in range(before)))
    end.take_output()
    feed(end, 0, Command(0))
    assert end.take_output() == [Frame(b"\0").to_bytes()]
    assert end.state is ConnectionState.SYNC0


@pytest.mark.parametrize("repeated", [0, 1, 2])
def test_a_sync_whose_echo_was_lost_is_answered_again(repeated: int) -> None:
    end = server()
    feed(end, 0, *(Command(n) for n in range(repeated + 1)))
    first = end.take_output()[-1]
    feed(end, 0, Command(repeated))
    assert end.take_output() == [first]


@pytest.mark.parametrize("close", [Command(2), Command(2, 1)])
def test_open_and_close_may_carry_an_integer(close: Command) -> None:
    end = opened_server()
    feed(end, 0, close)
    assert events(end) == [Closed()]
    assert end.state is ConnectionState.CLOSED
    feed(end, 0, enable(True))
    assert events(end) == []


def test_close_ends_a_handshake_half_way_too() -> None:
    end = server()
    feed(end, 0, Command(0), Command(1), Command(2, 1))
    assert end.state is ConnectionState.CLOSED


def test_while_open_every_number_is_a_command() -> None:
    end = opened_server()
    feed(end, 0, Command(0), Command(1, 1), vel(200))
    assert events(end) == [CommandReceived(Command(0)), CommandReceived(Command(1, 1)), CommandReceived(vel(200))]


def test_the_watchdog_bites_at_its_tick_and_not_one_before() -> None:
    end = opened_server(5)
    assert end.next_deadline() == 5 + 2 * NS_PER_S
    end.advance_to(5 + 2 * NS_PER_S - 1)
    assert events(end) == []
    end.advance_to(5 + 2 * NS_PER_S)
    assert events(end) == [WatchdogExpired()]
    assert end.next_deadline() is None
    end.advance_to(9 * NS_PER_S)
    assert events(end) == []
    feed(end, 9 * NS_PER_S, Command(0))
    assert events(end) == [WatchdogRevived(), CommandReceived(Command(0))]
    assert end.stats.watchdog_stops == 1


def test_silence_outside_of_the_time_counts_for_the_watchdog() -> None:
    end = opened_server()
    end.count_silence(NS_PER_S, 0)
    end.advance_to(NS_PER_S - 1)
    assert events(end) == []
    end.advance_to(NS_PER_S)
    assert events(end) == [WatchdogExpired()]
    other = opened_server()
    other.count_silence(3600 * NS_PER_S, 5)
    assert other.next_deadline() == 5, "never before now"
    with pytest.raises(LocalProtocolError, match="only the server's end"):
        client().count_silence(1, 0)


def test_noise_does_not_feed_the_watchdog() -> None:
    end = opened_server()
    end.receive(b"WMS2\r", 2 * NS_PER_S - 1)
    assert isinstance(events(end)[0], NoiseReceived)
    end.advance_to(2 * NS_PER_S)
    assert WatchdogExpired() in events(end)


def test_each_end_refuses_what_is_the_others() -> None:
    with pytest.raises(LocalProtocolError, match="server cannot connect"):
        server().connect(0)
    with pytest.raises(LocalProtocolError, match="server cannot disconnect"):
        server().disconnect(0)
    with pytest.raises(LocalProtocolError, match="not open"):
        client().send(stop(), 0)
    end, now = opened_client()
    with pytest.raises(LocalProtocolError, match="is open"):
        end.connect(now)
    with pytest.raises(LocalProtocolError, match="must be positive"):
        ConnectionSettings(sync_attempts=0)


def test_every_kind_of_message_can_be_sent() -> None:
    there = opened_server()
    for message in (SIP, ConfigPacket(subclass="p2dx"), RawPacket(0x90, b"\1"), Frame(b"\x91")):
        there.send(message, 1)
    here, now = opened_client()
    for data in there.take_output():
        here.receive(data, now)
    kinds = [SipReceived, ConfigReceived, PacketReceived, PacketReceived]
    assert [type(event) for event in events(here)] == kinds
    here.send(vel(3), now)
    assert sent(here) == [vel(3)]
    feed(here, now, Frame(b"\x32\0"), Frame(b"\2"))
    assert events(here) == [PacketReceived(RawPacket(0x32, b"\0")), PacketReceived(RawPacket(2))]
    assert here.stats.malformed == 1


def test_a_sync_is_sent_again_at_its_timeout_and_given_up_after_the_attempts() -> None:
    end = client(sync_attempts=2)
    end.connect(0)
    assert sent(end) == [Command(0)]
    end.advance_to(NS_PER_S - 1)
    assert sent(end) == []
    end.advance_to(NS_PER_S)
    assert sent(end) == [Command(0)]
    end.advance_to(2 * NS_PER_S)
    assert events(end) == [ConnectFailed("no answer to 2 SYNC0")]
    assert end.state is ConnectionState.FAILED
    assert end.next_deadline() is None
    end.connect(3 * NS_PER_S)
    assert sent(end) == [Command(0)]


def test_a_late_echo_is_no_news() -> None:
    end = client()
    end.connect(0)
    feed(end, 0, Frame(b"\0"), Frame(b"\0"), Frame(b"\x02"), Frame(b"\x77"))
    assert end.state is ConnectionState.SYNC1
    assert end.stats.frames_ignored == 3
    assert events(end) == [FrameIgnored(Frame(b"\x77"))], "a sync out of its turn is no news, a stranger is"
    feed(end, 0, Frame(b"\1"), Frame(b"\2"))
    assert end.state is ConnectionState.SYNC2
    end.advance_to(0)
    feed(end, 1, WILMA.to_frame(), Frame(b"\0"))
    assert end.state is ConnectionState.SYNCED


def test_a_robot_that_still_streams_is_stopped_before_it_is_closed() -> None:
    end = client()
    end.connect(0)
    end.take_output()
    feed(end, 50, SIP.to_frame(end.settings.profile))
    assert sent(end) == [stop(), vel(0), Command(CommandNumber.CLOSE)]
    feed(end, 60, SIP.to_frame(end.settings.profile))
    end.advance_to(50 + 200 * MS - 1)
    assert sent(end) == []
    end.advance_to(50 + 200 * MS)
    assert sent(end) == [Command(0)]


def test_a_robot_that_never_stops_streaming_is_given_up() -> None:
    end, now = client(sync_attempts=2), 0
    end.connect(now)
    for _ in range(4):
        now += 250 * MS
        feed(end, now, SIP.to_frame(end.settings.profile))
        end.advance_to(now + 200 * MS)
    assert any(isinstance(event, ConnectFailed) for event in events(end))


def test_a_robot_that_streams_after_the_last_attempt_is_given_up_at_once_and_not_one_before() -> None:
    end = client(sync_attempts=2)
    end.connect(0)
    feed(end, 1, SIP.to_frame(end.settings.profile))
    assert (end.state, end.next_deadline()) == (ConnectionState.RECOVERING, 1 + 200 * MS)
    end.advance_to(1 + 200 * MS)
    end.take_output()
    feed(end, 1 + 201 * MS, SIP.to_frame(end.settings.profile))
    assert sent(end) == [stop(), vel(0), Command(CommandNumber.CLOSE)], "stopped before it is given up"
    assert (end.state, end.next_deadline()) == (ConnectionState.FAILED, None)
    assert events(end) == [ConnectFailed("no answer to 2 SYNC0")]


def test_a_reset_notice_while_synchronising_begins_anew() -> None:
    end = client()
    end.connect(0)
    feed(end, 0, Frame(b"\0"))
    end.take_output()
    feed(end, 1, Frame(b"\xff"))
    assert sent(end) == [Command(0)]


def test_a_pulse_is_sent_when_nothing_else_was() -> None:
    end, now = opened_client(liveness_ns=10 * NS_PER_S, first_packet_ns=10 * NS_PER_S)
    end.advance_to(now + 500 * MS - 1)
    assert sent(end) == []
    end.advance_to(now + 500 * MS)
    assert sent(end) == [Command(0)]
    end.send(vel(1), now + 700 * MS)
    end.take_output()
    end.advance_to(now + 1200 * MS - 1)
    assert sent(end) == []
    end.advance_to(now + 1200 * MS)
    assert sent(end) == [Command(0)]


def test_silence_is_a_loss_and_stop_is_the_first_frame_out() -> None:
    end, now = opened_client(pulse_ns=5 * NS_PER_S)
    feed(end, now + 1, SIP.to_frame(end.settings.profile))
    events(end)
    end.advance_to(now + 1 + 350 * MS - 1)
    assert (events(end), sent(end)) == ([], [])
    end.advance_to(now + 1 + 350 * MS)
    assert events(end) == [ConnectionLost("no packet for 350 ms")]
    assert sent(end) == [stop(), vel(0)]
    assert end.state is ConnectionState.LOST
    end.connect(now + NS_PER_S)
    assert sent(end) == [stop(), vel(0), Command(CommandNumber.CLOSE)]
    end.advance_to(now + NS_PER_S + 200 * MS)
    assert sent(end) == [Command(0)]


def test_open_is_sent_again_where_no_packet_follows_it_and_no_more_often_than_asked() -> None:
    end, now = opened_client(open_attempts=2)
    end.advance_to(now + 300 * MS - 1)
    assert sent(end) == []
    end.advance_to(now + 300 * MS)
    assert sent(end) == [Command(CommandNumber.OPEN)]
    end.advance_to(now + 700 * MS)
    assert sent(end) == []


def test_an_echo_is_late_before_the_first_packet_and_a_restart_after_it() -> None:
    end, now = opened_client()
    feed(end, now, Frame(b"\1"))
    assert end.is_open
    assert end.stats.frames_ignored == 1
    feed(end, now, SIP.to_frame(end.settings.profile), Frame(b"\0"))
    assert events(end)[-1] == ConnectionLost("the robot was restarted")


@pytest.mark.parametrize("number", [0, 1, 2])
def test_an_echo_that_carries_data_is_a_packet_and_no_restart(number: int) -> None:
    end, now = opened_client()
    feed(end, now, SIP.to_frame(end.settings.profile), Frame(bytes([number, 7])))
    assert events(end)[-1] == PacketReceived(RawPacket(number, b"\7"))
    assert end.is_open


def test_open_is_due_again_at_its_time_out_and_at_no_other() -> None:
    end, now = opened_client(open_attempts=2)
    assert end.next_deadline() == now + 300 * MS, "before the first PULSE"
    end.advance_to(now + 300 * MS)
    assert sent(end) == [Command(CommandNumber.OPEN)]
    assert end.next_deadline() == now + 800 * MS, "the PULSE after it, for there is no third"
    other, now = opened_client(open_attempts=2)
    feed(other, now + 1, SIP.to_frame(other.settings.profile))
    assert other.next_deadline() == now + 1 + 350 * MS, "a packet has come: no OPEN any more"


def test_both_ends_can_change_the_family_of_their_packets() -> None:
    for end in (client(), server()):
        end.set_profile(Profile.ARCOS)
        assert end.settings.profile is Profile.ARCOS


def test_a_reset_notice_while_open_is_a_loss() -> None:
    end, now = opened_client()
    feed(end, now, Frame(b"\xfe"))
    assert events(end) == [ConnectionLost("the robot's controller was reset")]


def test_leaving_stops_the_robot_first() -> None:
    end, now = opened_client()
    end.disconnect(now)
    assert sent(end) == [stop(), vel(0), enable(False), Command(CommandNumber.CLOSE)]
    assert events(end) == [Closed()]
    end.disconnect(now)
    assert sent(end) == []


@pytest.mark.parametrize("make", [lambda: opened_client()[0], opened_server])
def test_a_restored_end_goes_on_as_the_first(make: Callable[[], Connection]) -> None:
    first = make()
    first.receive(b"\xfa\xfb\x06", 100 * MS)
    second = Connection(first.role, identity=WILMA)
    second.restore(pickle.loads(pickle.dumps(first.snapshot())))  # noqa: S301  # our own bytes
    for end in (first, second):
        end.advance_to(3 * NS_PER_S)
        feed(end, 3 * NS_PER_S, Command(0))
    assert first.take_output() == second.take_output()
    assert events(first) == events(second)
    assert (first.state, first.stats) == (second.state, second.stats)


class Pair(RuleBasedStateMachine):
    """Client and server on one line, with any timing, any loss, any request."""

    @initialize()
    def begin(self) -> None:
        self.now = 0
        self.ends = {ConnectionRole.CLIENT: client(), ConnectionRole.SERVER: server()}
        self.decoder = Decoder()
        self.last_to_robot: list[Command] = []
        self.is_lost = False

    @rule(
        milliseconds=st.integers(0, 900),
        loses=st.sampled_from([(), (ConnectionRole.CLIENT,), (ConnectionRole.SERVER,)]),
    )
    def time_passes(self, milliseconds: int, loses: tuple[ConnectionRole, ...]) -> None:
        self.now += milliseconds * MS
        for near, far in (
            (ConnectionRole.CLIENT, ConnectionRole.SERVER),
            (ConnectionRole.SERVER, ConnectionRole.CLIENT),
        ):
            self.ends[near].advance_to(self.now)
            self.exchange(near, far, loses)

    def exchange(self, near: ConnectionRole, far: ConnectionRole, loses: tuple[ConnectionRole, ...]) -> None:
        is_lost_now = any(isinstance(event, ConnectionLost) for event in events(self.ends[near]))
        frames = self.ends[near].take_output()
        if near is ConnectionRole.CLIENT:
            commands = [Command.from_frame(Frame.from_bytes(data)) for data in frames]
            if is_lost_now:
                # What was due before the loss went out before it.
                commands = commands[commands.index(stop()) :]
                assert commands[1] == vel(0)
            elif self.is_lost and commands:
                assert commands[0] == stop(), "after a loss the first frame out is STOP"
            self.is_lost = is_lost_now or (self.is_lost and not commands)
        for data in frames:
            if near not in loses:
                self.ends[far].receive(data, self.now)

    @rule()
    def client_connects(self) -> None:
        if self.ends[ConnectionRole.CLIENT].state in {
            ConnectionState.CLOSED,
            ConnectionState.LOST,
            ConnectionState.FAILED,
        }:
            self.ends[ConnectionRole.CLIENT].connect(self.now)

    @rule()
    def client_leaves(self) -> None:
        self.ends[ConnectionRole.CLIENT].disconnect(self.now)

    @rule(speed=st.integers(-300, 300))
    def client_drives(self, speed: int) -> None:
        if self.ends[ConnectionRole.CLIENT].is_open:
            self.ends[ConnectionRole.CLIENT].send(vel(speed), self.now)

    @rule()
    def robot_reports(self) -> None:
        if self.ends[ConnectionRole.SERVER].is_open:
            self.ends[ConnectionRole.SERVER].send(SIP, self.now)

    @rule(junk=st.binary(max_size=20), role=st.sampled_from(ConnectionRole))
    def the_line_hums(self, junk: bytes, role: ConnectionRole) -> None:
        self.ends[role].receive(junk, self.now)

    @invariant()
    def deadlines_lie_ahead(self) -> None:
        for end in self.ends.values():
            end.advance_to(self.now)
            due = end.next_deadline()
            assert due is None or due > self.now


Pair.TestCase.settings = hypothesis_settings(max_examples=60, stateful_step_count=40)
TestPair = Pair.TestCase


def test_an_end_begins_with_nothing_counted() -> None:
    for end in (client(), server()):
        counted = [name for name in end.stats.__slots__ if name != "wire"]
        assert [name for name in counted if getattr(end.stats, name) != 0] == []
        assert [name for name in end.stats.wire.__slots__ if getattr(end.stats.wire, name) != 0] == []


def test_a_packet_of_which_nothing_is_said_stands_at_the_origin() -> None:
    sip = StandardSip()
    assert (sip.raw_x, sip.raw_y, sip.raw_heading, sip.raw_left_velocity, sip.raw_right_velocity) == (0, 0, 0, 0, 0)
