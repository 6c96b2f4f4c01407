"""Byte lines of every kind keep one contract; each kind is lost and refused in its own way."""

import errno
import os
import select
import socket
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import serial

from p2os.errors import TransportError
from p2os.transport import HungUpError, Listener, Loops, Transport, listen_url, open_url, sockets
from p2os.transport.serial_port import SerialListener, SerialTransport, list_serial_ports
from p2os.transport.sockets import BACKLOG_BYTES, SocketTransport
from p2os.transport.url import SerialUrl
from p2os.transport.waiting import LONGEST_CLOSING_NS, MOST_CLOSING, ClosingLines, WakeUp, wait_readable
from simbase.errors import UsageError
from simbase.listening import GuardedListener

#: A bound on every wait of these tests; reached only when something is broken.
TIMEOUT_S = 30.0

pytestmark = pytest.mark.skipif(os.name != "posix", reason="pseudo-terminals and descriptors are Unix's")


def wait_for(condition: Callable[[], object]) -> object:
    end = time.monotonic() + TIMEOUT_S
    while time.monotonic() < end:
        if result := condition():
            return result
        time.sleep(0.001)
    pytest.fail("it never happened")


def read_all(transport: Transport, count: int) -> bytes:
    data = b""
    end = time.monotonic() + TIMEOUT_S
    while len(data) < count and time.monotonic() < end:
        data += transport.read()
    return data


class Line:
    """A listener, and the two ends of a line through it."""

    def __init__(self, listener: Listener, near: Transport, far: Transport) -> None:
        self.listener, self.near, self.far = listener, near, far

    def close(self) -> None:
        for part in (self.near, self.far, self.listener):
            part.close()
            part.close()  # closing twice is harmless


def make_line(url: str, tmp_path: Path) -> Line:
    loops = Loops()
    listener = listen_url(url.replace("@", str(tmp_path / "robot")), loops=loops)
    far = open_url(listener.description, loops=loops)
    near = wait_for(listener.accept)
    return Line(listener, near, far)  # type: ignore[arg-type]


@pytest.fixture(params=["tcp:127.0.0.1:0", "tcp:[::1]:0", "pty:", "pty:@", "loop:robot"])
def line(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Line]:
    if "::1" in request.param and not ipv6_works():
        pytest.skip("no IPv6 here")
    made = make_line(request.param, tmp_path)
    yield made
    made.close()


def ipv6_works() -> bool:
    try:
        with socket.socket(socket.AF_INET6) as probe:
            probe.bind(("::1", 0))
    except OSError:
        return False
    return True


def test_bytes_of_every_value_cross_both_ways_unchanged(line: Line) -> None:
    every = bytes(range(256)) * 4
    line.near.write(every)
    assert read_all(line.far, len(every)) == every
    line.far.write(every)
    assert read_all(line.near, len(every)) == every


def test_reading_an_idle_line_returns_nothing_at_once(line: Line) -> None:
    start = time.monotonic()
    assert line.near.read() == b""
    assert line.far.read() == b""
    assert time.monotonic() - start < TIMEOUT_S


def test_a_descriptor_tells_when_bytes_have_come(line: Line) -> None:
    assert select.select([line.near.fileno()], [], [], 0)[0] == []
    line.far.write(b"x")
    assert select.select([line.near.fileno()], [], [], TIMEOUT_S)[0] == [line.near.fileno()]


def test_a_far_end_that_closes_hangs_up_after_its_last_byte(line: Line) -> None:
    line.far.write(b"bye")
    line.far.close()

    def hung_up() -> bool:
        try:
            received.append(line.near.read())
        except HungUpError:
            return True
        return False

    received: list[bytes] = []
    wait_for(hung_up)
    assert b"".join(received) == b"bye"


@pytest.mark.parametrize("unread", [1, 100_000])
def test_the_last_bytes_arrive_though_those_of_the_far_side_were_never_read(tmp_path: Path, unread: int) -> None:
    line = make_line("tcp:127.0.0.1:0", tmp_path)
    line.near.write(bytes(unread))
    wait_for(lambda: select.select([line.far.fileno()], [], [], 0)[0])
    line.far.write(b"stop")
    line.far.close()
    line.near.write(b"a packet that is due")  # by a reset, this would fail
    assert read_all(line.near, 4) == b"stop"
    line.close()


def test_the_next_client_is_served_after_the_first_has_left(line: Line, tmp_path: Path) -> None:
    if line.listener.description.startswith("loop:"):
        pytest.skip("a loop is opened through its Loops")
    line.far.close()
    line.near.close()
    line.far = open_url(line.listener.description)
    line.near = wait_for(line.listener.accept)  # type: ignore[assignment]
    line.far.write(b"again")
    assert read_all(line.near, 5) == b"again"


def test_a_line_has_a_speed_only_where_there_is_one(line: Line) -> None:
    line.near.set_baud(38400)
    line.far.set_baud(38400)
    line.far.write(b"x")
    assert read_all(line.near, 1) == b"x"


def test_nobody_has_come_until_somebody_has() -> None:
    for url in ("tcp:127.0.0.1:0", "pty:", "loop:x"):
        listener = listen_url(url, loops=Loops())
        assert listener.accept() is None
        listener.close()


# Sockets -----------------------------------------------------------------------------


def test_a_tcp_port_that_is_taken_is_an_error_with_a_hint() -> None:
    first = listen_url("tcp:127.0.0.1:0")
    with pytest.raises(TransportError, match=r"cannot listen on tcp:127\.0\.0\.1:.*in use") as caught:
        listen_url(first.description)
    assert "another port" in str(caught.value.hint)
    first.close()


def test_a_tcp_port_where_nobody_listens_is_an_error_with_a_hint() -> None:
    first = listen_url("tcp:127.0.0.1:0")
    first.close()
    with pytest.raises(TransportError, match="refused") as caught:
        open_url(first.description)
    assert "p2os serve" in str(caught.value.hint)


def test_a_host_without_address_is_an_error() -> None:
    with pytest.raises(TransportError, match="cannot connect"):
        open_url("tcp:no.such.host.invalid:1")


def test_a_client_that_stops_reading_is_an_error_before_memory_runs_out() -> None:
    near, far = socket.socketpair()
    transport = SocketTransport(near, "loop:test")

    def flood() -> None:
        for _ in range(1000):
            transport.write(bytes(BACKLOG_BYTES))

    with pytest.raises(TransportError, match="stopped reading"):
        flood()
    far.close()
    with pytest.raises(HungUpError):
        transport.write(b"x")
    transport.close()


@pytest.mark.parametrize("end", ["near", "far"])
def test_a_tcp_peer_that_vanishes_is_noticed_within_ten_seconds(tmp_path: Path, end: str) -> None:
    """Nothing here can make a peer vanish; the system is asked what it will do."""
    line = make_line("tcp:127.0.0.1:0", tmp_path)
    with socket.socket(fileno=os.dup(getattr(line, end).fileno())) as asked:
        assert asked.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE)
        if hasattr(socket, "TCP_USER_TIMEOUT"):  # else other systems' names and defaults hold
            idle, every, probes, unconfirmed_ms = (
                asked.getsockopt(socket.IPPROTO_TCP, option)
                for option in (socket.TCP_KEEPIDLE, socket.TCP_KEEPINTVL, socket.TCP_KEEPCNT, socket.TCP_USER_TIMEOUT)
            )
            assert idle + every * probes <= 10
            assert unconfirmed_ms <= 10_000
    line.close()


def test_a_tcp_peer_that_confirms_nothing_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A window that stays shut is the one silence that a loopback can show."""
    if not hasattr(socket, "TCP_USER_TIMEOUT"):
        pytest.skip("this system has no such option")
    monkeypatch.setitem(sockets.KEEPALIVE, "TCP_USER_TIMEOUT", 200)
    listener = listen_url("tcp:127.0.0.1:0")
    with socket.create_connection(("127.0.0.1", int(listener.description.rpartition(":")[2]))) as silent:
        near = wait_for(listener.accept)
        assert isinstance(near, SocketTransport)

        def given_up() -> bool:
            try:
                near.write(bytes(BACKLOG_BYTES))
            except HungUpError as error:
                return "timed out" in str(error)
            except TransportError:  # it has stopped reading; this is about what the system does
                near._unsent = b""
            return False

        wait_for(given_up)
        assert silent.fileno() >= 0
        near.close()
    listener.close()


class Standing:
    """A clock that stands until it is told."""

    now = 0

    def __call__(self) -> int:
        return self.now


def refused(tmp_path: Path, reason: str, said: bytes = b"") -> tuple[Line, ClosingLines, Standing]:
    line, clock = make_line("tcp:127.0.0.1:0", tmp_path), Standing()
    line.far.write(said)
    leaving = ClosingLines(clock)
    leaving.add(line.near, reason)
    return line, leaving, clock


def test_a_peer_that_is_refused_reads_why_though_it_had_spoken(tmp_path: Path) -> None:
    line, leaving, _ = refused(tmp_path, "busy: somebody is here", said=bytes(1000))

    def hung_up() -> str:
        line.far.write(b"more")
        try:
            line.far.read()
        except HungUpError as error:
            return str(error)
        return ""

    assert str(wait_for(hung_up)).endswith("closed the connection: busy: somebody is here")
    assert len(leaving) == 1
    line.far.close()

    def left() -> bool:
        leaving.poll()
        return not leaving

    wait_for(left)
    line.listener.close()


def test_a_peer_that_does_not_leave_is_closed_in_time(tmp_path: Path) -> None:
    line, leaving, clock = refused(tmp_path, "busy")
    clock.now = LONGEST_CLOSING_NS - 1
    leaving.poll()
    assert len(leaving) == 1
    clock.now += 1
    leaving.poll()
    assert not leaving
    line.close()


def test_a_terminal_cannot_be_told_and_is_let_go_at_once() -> None:
    leaving, line = ClosingLines(Standing()), open_url("pty:")
    leaving.add(line, "busy")
    assert not leaving
    assert line.fileno() == -1


def test_no_more_than_a_few_are_leaving_at_once() -> None:
    leaving, far = ClosingLines(Standing()), []
    for _ in range(MOST_CLOSING + 3):
        one, other = socket.socketpair()
        far.append(other)
        leaving.add(SocketTransport(one, "loop:x"), "busy")
    assert len(leaving) == MOST_CLOSING
    leaving.close()
    assert not leaving
    for each in far:
        each.close()


@pytest.mark.parametrize("said", [b"busy", b"busy\x07\r\n", b"b\xfcsy\r\n", b"one\r\ntwo\r\n", b"x" * 200 + b"\r\n"])
def test_what_is_no_line_of_text_is_no_reason(said: bytes) -> None:
    near, far = socket.socketpair()
    transport = SocketTransport(near, "loop:x")
    far.sendall(said)
    far.close()
    with pytest.raises(HungUpError) as caught:
        read_all(transport, 1000)
    assert str(caught.value) == "loop:x closed the connection"
    transport.close()


def test_a_reason_is_shown_too_where_writing_fails_first() -> None:
    near, far = socket.socketpair()
    transport = SocketTransport(near, "loop:x")
    far.sendall(b"busy: somebody is here\r\n")
    far.close()
    with pytest.raises(HungUpError, match="busy: somebody is here"):
        transport.write(b"x")
    transport.close()


def test_bytes_that_a_socket_does_not_take_go_first_next_time() -> None:
    near, far = socket.socketpair()
    near.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
    transport, reader = SocketTransport(near, "a"), SocketTransport(far, "b")
    sent = os.urandom(30_000)
    transport.write(sent)
    received = b""
    end = time.monotonic() + TIMEOUT_S
    while len(received) < len(sent) and time.monotonic() < end:
        received += reader.read()
        transport.write(b"")
    assert received == sent
    transport.close()
    reader.close()


class FailingOnce(socket.socket):
    """A socket whose next call of a name the system refuses."""

    def __init__(self, of: socket.socket, name: str) -> None:
        super().__init__(of.family, of.type, of.proto, fileno=of.detach())
        self._name = name

    def _fail(self, name: str) -> None:
        if name == self._name:
            self._name = ""
            raise OSError(errno.ENOBUFS, os.strerror(errno.ENOBUFS))

    def setsockopt(self, *option: int) -> None:  # type: ignore[override]  # as far as it is used
        self._fail("setsockopt")
        super().setsockopt(*option)

    def shutdown(self, how: int) -> None:
        self._fail("shutdown")
        super().shutdown(how)

    def recv(self, bufsize: int, flags: int = 0, /) -> bytes:
        self._fail("recv")
        return super().recv(bufsize, flags)


@pytest.mark.parametrize("name", ["setsockopt", "shutdown"])
def test_a_socket_that_refuses_one_call_carries_all_bytes_to_the_end(name: str) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listening:
        client = FailingOnce(socket.create_connection(listening.getsockname()), name)
        far = listening.accept()[0]
    with far:
        far.sendall(b"unread")
        line = SocketTransport(client, "tcp:it")
        assert select.select([client], [], [], 5)[0]
        line.write(b"stop")
        line.close()
        assert far.recv(100) == b"stop"  # a reset may come before it has been read
        assert far.recv(100) == b""


def test_a_port_that_cannot_be_asked_for_is_an_error_and_given_back(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[GuardedListener] = []

    def refuse(listening: GuardedListener) -> None:
        made.append(listening)
        raise OSError(errno.ENOBUFS, os.strerror(errno.ENOBUFS))

    monkeypatch.setattr(GuardedListener, "getsockname", refuse)
    with pytest.raises(TransportError, match=r"cannot listen on tcp:127.0.0.1:0: no buffer space available"):
        listen_url("tcp:127.0.0.1:0")
    assert made[0].fileno() == -1


def test_a_wake_up_that_cannot_be_cleared_stays_readable(monkeypatch: pytest.MonkeyPatch) -> None:
    wake_up = WakeUp()
    monkeypatch.setattr(wake_up, "_read", FailingOnce(wake_up._read, "recv"))
    wake_up._read.setblocking(False)
    wake_up.ring()
    wake_up.clear()
    assert wait_readable([wake_up.fileno()], 0)
    wake_up.clear()
    assert not wait_readable([wake_up.fileno()], 0)
    wake_up.close()


def test_a_reset_connection_is_a_hang_up() -> None:
    listener = listen_url("tcp:127.0.0.1:0")
    client = socket.create_connection(("127.0.0.1", int(listener.description.rpartition(":")[2])))
    near = wait_for(listener.accept)
    client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
    client.close()

    def lost() -> bool:
        try:
            near.read()  # type: ignore[attr-defined]
        except HungUpError as error:  # a robot that has a client closes at once: the second one wonders why
            return bool(error.hint)
        return False

    wait_for(lost)
    near.close()  # type: ignore[attr-defined]
    listener.close()


# Loops -------------------------------------------------------------------------------


def test_a_loop_needs_its_loops() -> None:
    for function in (open_url, listen_url):
        with pytest.raises(UsageError, match="only inside one program"):
            function("loop:x")


def test_a_loop_name_is_taken_until_its_listener_closes() -> None:
    loops = Loops()
    with pytest.raises(TransportError, match="nobody listens"):
        open_url("loop:x", loops=loops)
    first = loops.listen("x")
    with pytest.raises(TransportError, match="the name is taken"):
        loops.listen("x")
    left_waiting = loops.connect("x")
    first.close()
    with pytest.raises(HungUpError):
        left_waiting.read()
    loops.listen("x").close()


def test_two_programs_in_one_process_do_not_meet() -> None:
    here, there = Loops(), Loops()
    listener = here.listen("x")
    with pytest.raises(TransportError):
        there.connect("x")
    listener.close()


# Pseudo-terminals --------------------------------------------------------------------


def test_a_terminal_link_is_made_and_removed(tmp_path: Path) -> None:
    link = tmp_path / "robot"
    listener = listen_url(f"pty:{link}")
    assert link.is_symlink()
    assert listener.description == f"pty:{link}"
    listener.close()
    assert not link.is_symlink()


def test_a_link_left_by_a_killed_program_is_replaced(tmp_path: Path) -> None:
    link = tmp_path / "robot"
    link.symlink_to(tmp_path / "gone")
    listener = listen_url(f"pty:{link}")
    assert link.exists()
    listener.close()


def test_a_link_left_is_replaced_where_its_terminal_has_the_same_number_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import pty

    link, numbered, make = tmp_path / "robot", tmp_path / "5", pty.openpty
    link.symlink_to(numbered)

    def openpty() -> tuple[int, int]:
        numbered.touch()
        return make()

    monkeypatch.setattr(pty, "openpty", openpty)
    listener = listen_url(f"pty:{link}")
    assert link.resolve() != numbered
    listener.close()


def test_a_client_makes_no_terminal_where_none_is(tmp_path: Path) -> None:
    link = tmp_path / "robot"
    for _ in range(2):
        with pytest.raises(TransportError, match="no such port"):
            open_url(f"pty:{link}")
        assert not link.exists()
        if not link.is_symlink():
            link.symlink_to(tmp_path / "gone")


def test_a_file_in_the_way_of_a_link_is_kept(tmp_path: Path) -> None:
    precious = tmp_path / "robot"
    precious.write_text("precious")
    with pytest.raises(TransportError, match="something is already there") as caught:
        listen_url(f"pty:{precious}")
    assert caught.value.hint == "choose another path"
    assert precious.read_text() == "precious"
    with pytest.raises(TransportError, match="cannot make the link"):
        listen_url(f"pty:{tmp_path / 'no' / 'such' / 'folder'}")


def test_a_terminal_echoes_nothing_to_a_client_that_sets_nothing() -> None:
    listener = listen_url("pty:")
    path = listener.description.removeprefix("pty:")
    for _ in range(2):  # again after the last client has left
        client = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        near = wait_for(listener.accept)
        near.write(b"\xfa\xfb\n\r\x03\x04")  # type: ignore[attr-defined]
        wait_for(lambda client=client: select.select([client], [], [], 0)[0])
        assert os.read(client, 100) == b"\xfa\xfb\n\r\x03\x04"
        assert near.read() == b""  # type: ignore[attr-defined]
        os.close(client)
    listener.close()


def test_a_terminal_loses_what_nobody_reads_but_never_waits() -> None:
    listener = listen_url("pty:")
    far = open_url(listener.description)
    near = wait_for(listener.accept)
    start = time.monotonic()
    for _ in range(200):
        near.write(bytes(1000))  # type: ignore[attr-defined]
    assert time.monotonic() - start < TIMEOUT_S
    far.close()
    listener.close()


def test_an_open_pty_without_a_path_is_a_terminal_for_somebody_else() -> None:
    near = open_url("pty:")
    far = serial.Serial(near.description.removeprefix("pty:"), timeout=TIMEOUT_S)
    near.write(b"hello")
    assert far.read(5) == b"hello"
    far.close()
    near.close()


# Serial ports ------------------------------------------------------------------------


def test_a_missing_serial_port_is_an_error_with_a_hint() -> None:
    with pytest.raises(TransportError, match="cannot open /dev/ttyNONE9: no such port") as caught:
        open_url("serial:/dev/ttyNONE9")
    assert "p2os ports" in str(caught.value.hint)


def test_a_serial_port_in_use_is_an_error_with_a_hint() -> None:
    listener = listen_url("pty:")
    url = f"serial:{listener.description.removeprefix('pty:')}"
    first = open_url(url)
    with pytest.raises(TransportError, match="in use") as caught:
        open_url(url)
    assert "another program" in str(caught.value.hint)
    first.close()
    listener.close()


def test_a_file_that_is_no_port_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(TransportError, match="cannot open"):
        open_url(f"serial:{tmp_path / 'file'}")


def test_a_serial_port_that_vanishes_is_a_hang_up() -> None:
    listener = listen_url("pty:")
    port = open_url(f"serial:{listener.description.removeprefix('pty:')}?baud=38400")
    listener.close()

    def use() -> None:
        for _ in range(100):
            port.read()
            port.write(b"x")

    with pytest.raises(HungUpError, match="vanished"):
        use()
    port.close()


def test_serving_on_a_serial_port_waits_for_one_that_was_unplugged(tmp_path: Path) -> None:
    link = tmp_path / "robot"
    cable = listen_url(f"pty:{link}")
    listener = SerialListener(SerialUrl(path=str(link)))
    assert listener.fileno() is None
    near = listener.accept()
    assert near is not None
    near.close()
    cable.close()
    assert listener.accept() is None
    cable = listen_url(f"pty:{link}")
    again = listener.accept()
    assert again is not None
    again.close()
    listener.close()
    cable.close()


def test_a_serial_port_nobody_took_is_given_back() -> None:
    cable = listen_url("pty:")
    url = f"serial:{cable.description.removeprefix('pty:')}"
    listen_url(url).close()
    open_url(url).close()
    cable.close()


class StuckPort:
    """A pyserial port that takes nothing and has no descriptor."""

    def write(self, _data: bytes) -> None:
        raise serial.SerialTimeoutException


def test_a_stuck_serial_port_and_one_without_descriptor_say_so() -> None:
    port = SerialTransport(StuckPort(), "serial:COM3")  # type: ignore[arg-type]
    with pytest.raises(TransportError, match="takes no more bytes"):
        port.write(b"x")
    with pytest.raises(TransportError, match="cannot be waited for"):
        port.fileno()


def test_the_ports_of_this_machine_are_urls() -> None:
    for port in list_serial_ports():
        assert port["url"].startswith("serial:")
