"""What the first bytes of a connection tell, and sockets that let no web browser through."""

import errno
import logging
import select
import socket
from collections.abc import Iterator
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from simbase.listening import LOGGER, METHODS, OPENINGS, FirstBytes, WebClientError, listen_tcp

#: What browsers and their like send, with something behind it.
REQUESTS = tuple(opening + b"x\r\n" for opening in OPENINGS)


def test_the_openings_are_those_of_browsers() -> None:
    """RFC 9110 9.3, RFC 5789; RFC 9113 3.4; RFC 8446 5.1."""
    methods = b"GET HEAD POST PUT DELETE CONNECT OPTIONS TRACE PATCH".split()
    records = {bytes((22, 3, minor)) for minor in range(1, 5)}
    assert set(OPENINGS) == {method + b" " for method in methods} | {b"PRI *"} | records


def passed(pieces: list[bytes]) -> bytes | None:
    """Return what is passed on of a whole connection, or None where it is refused."""
    first, found = FirstBytes(), b""
    try:
        for piece in pieces:
            found += first.take(piece)
    except WebClientError:
        assert found == b"", "something was passed on before it was refused"
        return None
    return found + first.end()


def cut(data: bytes, places: list[int]) -> list[bytes]:
    ends = [0, *sorted(place % (len(data) + 1) for place in places), len(data)]
    return [data[start:end] for start, end in pairwise(ends)]


def test_every_opening_is_refused_split_at_every_byte() -> None:
    for request in REQUESTS:
        for place in range(len(request)):
            assert passed([request[:place], request[place:]]) is None, (request, place)
        assert passed([bytes((byte,)) for byte in request]) is None, request


def test_an_opening_is_refused_with_its_last_byte_and_not_before() -> None:
    for opening in OPENINGS:
        first = FirstBytes()
        assert first.take(opening[:-1]) == b""
        with pytest.raises(WebClientError, match="begins with"):
            first.take(opening[-1:])
        with pytest.raises(WebClientError):
            first.take(b"\xfa\xfb")


def test_a_first_byte_that_begins_no_opening_is_passed_on_at_once() -> None:
    waiting = {byte for byte in range(256) if FirstBytes().take(bytes((byte,))) == b""}
    assert waiting == {opening[0] for opening in OPENINGS}
    assert waiting == {*b"GHPDCOT", 0x16}


@pytest.mark.parametrize("begins", ["\xfa\xfb", "+", "$", "\x03", "place", "reset", "\r\n"])
def test_our_own_protocols_begin_with_no_byte_that_waits(begins: str) -> None:
    assert FirstBytes().take(begins.encode("latin-1")[:1]) != b""


@pytest.mark.parametrize("word", [*METHODS, "GETS", "PRI", "get ", "PRI  *", "\x16\x03\x00", "\x16\x03\x05"])
def test_what_only_looks_like_an_opening_is_passed_on_whole(word: str) -> None:
    data = word.encode("latin-1")
    assert passed([data[:1], data[1:]]) == data
    assert passed([data, b"\n"]) == data + b"\n"


BEGINNINGS = st.sampled_from([*OPENINGS, *(opening[:-1] for opening in OPENINGS), b""])


@given(BEGINNINGS, st.binary(max_size=20), st.lists(st.integers(0, 40)))
def test_all_arrives_in_order_or_nothing(begins: bytes, rest: bytes, places: list[int]) -> None:
    data = begins + rest
    is_browser = any(data.startswith(opening) for opening in OPENINGS)
    assert passed(cut(data, places)) == (None if is_browser else data)


# Sockets -----------------------------------------------------------------------------


@pytest.fixture
def ends() -> Iterator[tuple[socket.socket, socket.socket]]:
    """Yield a client and what accepted it, a socket that waits."""
    with (
        listen_tcp("127.0.0.1", 0) as listener,
        socket.create_connection(listener.getsockname(), timeout=10) as client,
    ):
        near, address = listener.accept()
        assert address == client.getsockname()
        near.settimeout(10)
        with near:
            yield client, near


def test_a_socket_that_waits_does_not_wait_for_more_than_it_has(ends: tuple[socket.socket, socket.socket]) -> None:
    client, near = ends
    client.sendall(b"PU")
    with pytest.raises(BlockingIOError) as caught:
        near.recv(10)
    assert caught.value.errno == errno.EAGAIN
    with pytest.raises(BlockingIOError):
        near.recv(10, socket.MSG_PEEK)
    client.sendall(b"SH")
    assert b"".join(near.recv(size) for size in (1, 100, 100)) == b"PUSH", "a short read loses nothing"
    client.sendall(b"GET /")
    assert near.recv(5, socket.MSG_PEEK) == b"GET /"
    assert near.recv(100) == b"GET /", "only the beginning of a connection is looked at"


def test_a_read_that_has_room_for_more_than_an_opening_leaves_nothing_behind_that_select_does_not_show(
    ends: tuple[socket.socket, socket.socket],
) -> None:
    client, near = ends
    client.sendall(b"OPTIONS")
    with pytest.raises(BlockingIOError):
        near.recv(16)
    client.sendall(b"_" * 16)
    assert near.recv(16) == b"OPTIONS" + b"_" * 9
    assert select.select([near], [], [], 0)[0] == [near]
    assert near.recv(16) == b"_" * 7


@pytest.mark.parametrize("last", [b"P", b"OPTIONS", b"\x16\x03"])
def test_first_bytes_that_stay_alone_arrive_before_the_end(
    ends: tuple[socket.socket, socket.socket], last: bytes
) -> None:
    client, near = ends
    client.sendall(last)
    with pytest.raises(BlockingIOError):
        near.recv(10)
    client.shutdown(socket.SHUT_WR)
    assert (near.recv(100), near.recv(100)) == (last, b"")


def test_a_buffer_gets_what_is_passed_on_and_no_more(ends: tuple[socket.socket, socket.socket]) -> None:
    client, near = ends
    client.sendall(b"P")
    buffer = bytearray(2)
    with pytest.raises(BlockingIOError):
        near.recv_into(buffer)
    client.sendall(b"LAY")
    got = [bytes(buffer[: near.recv_into(buffer)]) for _ in range(2)]
    assert got == [b"PL", b"AY"]


def test_a_refusal_is_logged_with_both_ends_and_shuts_the_connection_down(
    ends: tuple[socket.socket, socket.socket], caplog: pytest.LogCaptureFixture
) -> None:
    client, near = ends
    client.sendall(b"POST / HTTP/1.1\r\n\r\n\xfa\xfb")
    caplog.set_level(logging.WARNING, LOGGER)
    with pytest.raises(WebClientError):
        near.recv(100)
    (record,) = caplog.records
    theirs, ours = client.getsockname()[1], client.getpeername()[1]
    assert record.getMessage() == (
        f"connection of 127.0.0.1:{theirs} to 127.0.0.1:{ours} refused: it begins with an HTTP request, 'POST '; "
        "a web page cannot use this port"
    )
    for _ in range(2):
        with pytest.raises(WebClientError):
            near.recv(100)
    assert client.recv(10) == b""
    assert len(caplog.records) == 1


def test_a_port_that_is_taken_or_none_is_an_error_that_leaves_nothing_open() -> None:
    with listen_tcp("127.0.0.1", 0, backlog=1) as listener, pytest.raises(OSError, match="in use"):
        listen_tcp("127.0.0.1", listener.getsockname()[1])
    with pytest.raises(OverflowError):
        listen_tcp("127.0.0.1", 70_000)
