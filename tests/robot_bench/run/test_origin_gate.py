"""Who may look at a running bench: viewers by the Origin that their browser states, and nobody else's page."""

import asyncio
import contextlib
import logging
import socket
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field

import pytest

from p2os.cli.main import run
from robot_bench.origin_gate import OriginGate, may_look
from simbase.listening import LOGGER
from tests.tools.each_row import each_row

LIMIT_S = 30.0

LET_IN = (
    None, "https://app.foxglove.dev", "HTTPS://APP.FOXGLOVE.DEV", "file://", "http://localhost:8080", "http://localhost",
    "http://127.0.0.1:5173", "http://127.1.2.3", "http://[::1]:8080", "https://viewer.example:8443",
)  # fmt: skip
REFUSED = (
    "https://evil.example", "null", "", "http://127.0.0.1.evil.example", "http://localhost.evil.example",
    "https://app.foxglove.dev.evil.example", "http://app.foxglove.dev", "https://app.foxglove.dev:8443",
    "http://192.168.0.2", "http://0.0.0.0:8765", "http://[", "file://evil.example", "https://viewer.example",
    "http://localhost@evil.example", "localhost",
)  # fmt: skip


def request(origin: str | None, name: str = "Origin") -> bytes:
    stated = "" if origin is None else f"{name}: {origin}\r\n"
    return f"GET / HTTP/1.1\r\nHost: 127.0.0.1:8765\r\n{stated}Upgrade: websocket\r\n\r\n".encode()


@each_row("origin", LET_IN)
def test_viewers_are_let_in(origin: str | None) -> None:
    for name in ("Origin", "origin", "ORIGIN"):
        assert may_look(request(origin, name), ["https://viewer.example:8443/"])


@each_row("origin", REFUSED)
def test_pages_of_the_web_are_not(origin: str) -> None:
    for name in ("Origin", "origin", "ORIGIN"):
        assert not may_look(request(origin, name), ["https://viewer.example:8443"])


def test_of_two_origins_both_have_to_be_known() -> None:
    head = request("http://localhost").replace(b"Upgrade", b"oRIGIN:https://evil.example\r\nUpgrade")
    assert not may_look(head)
    assert may_look(head, ["https://evil.example"])


@dataclass
class Gated:
    """A gate, and what the server behind it got."""

    gate: OriginGate
    got: list[bytes] = field(default_factory=list)

    def connect(self) -> socket.socket:
        return socket.create_connection(("127.0.0.1", self.gate.port), timeout=LIMIT_S)


@pytest.fixture
def gated() -> Iterator[Gated]:
    """Yield a gate before a server that greets, and answers in upper case until it reads `bye`."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        made = Gated(OriginGate("127.0.0.1", 0, server.getsockname()[:2]))

        def serve() -> None:
            with contextlib.suppress(OSError):
                while True:
                    line, _ = server.accept()
                    with line:
                        line.sendall(b"HELLO ")
                        while data := line.recv(4096):
                            made.got.append(data)
                            line.sendall(data.upper())
                            if data.endswith(b"bye"):
                                break

        threading.Thread(target=serve, daemon=True).start()
        yield made
        made.gate.close()
        server.shutdown(socket.SHUT_RDWR)


def read_all(line: socket.socket) -> bytes:
    found = b""
    with contextlib.suppress(ConnectionResetError):
        while data := line.recv(4096):
            found += data
    return found


@pytest.mark.parametrize("place", [1, 30, 60])
def test_a_viewer_meets_the_server_and_both_may_leave_first(gated: Gated, place: int) -> None:
    head = request("http://localhost:8080")
    with gated.connect() as line:
        line.sendall(head[:place])
        line.sendall(head[place:] + b"more")
        line.shutdown(socket.SHUT_WR)
        assert read_all(line) == b"HELLO " + head.upper() + b"MORE"
    with gated.connect() as line:
        line.sendall(head + b"bye")
        assert read_all(line).endswith(b"BYE")


def test_a_page_gets_a_403_and_the_server_never_hears_of_it(gated: Gated, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.WARNING, LOGGER)
    with gated.connect() as line:
        line.sendall(request("https://evil.example"))
        assert read_all(line).startswith(b"HTTP/1.1 403 ")
    assert gated.got == []
    assert [record.getMessage() for record in caplog.records] == [
        "viewer refused: Origin 'https://evil.example' (--foxglove-origin lets it in)"
    ]


@pytest.mark.parametrize("sent", [b"\x16\x03\x01" + bytes(20), b"GET / HTTP/1.1\r\n", b"GET /" + b"a" * 40_000])
def test_what_is_no_header_is_closed(gated: Gated, sent: bytes) -> None:
    with gated.connect() as line:
        with contextlib.suppress(ConnectionError):
            line.sendall(sent)
            line.shutdown(socket.SHUT_WR)
        assert read_all(line) == b""
    assert gated.got == []


def test_a_taken_port_is_an_error_and_a_gate_closes_with_its_viewers(gated: Gated) -> None:
    with pytest.raises(OSError, match="in use"):
        OriginGate("127.0.0.1", gated.gate.port, ("127.0.0.1", 1))
    with gated.connect() as line:
        line.sendall(request(None))
        assert line.recv(6) == b"HELLO "
        other = OriginGate("127.0.0.1", 0, ("127.0.0.1", 1))
        other.close()
        with pytest.raises(OSError, match="refused"):
            socket.create_connection(("127.0.0.1", other.port), timeout=LIMIT_S)


@pytest.mark.parametrize(("origin", "is_let_in"), [("https://evil.example", False), ("http://localhost:8080", True)])
def test_the_scene_is_shown_to_viewers_only(origin: str, is_let_in: bool) -> None:
    pytest.importorskip("foxglove")
    websockets = pytest.importorskip("websockets")
    from robot_bench.live import LiveScene

    scene = LiveScene({}, port=0)

    async def look() -> str:
        async with websockets.connect(scene.url, subprotocols=["foxglove.sdk.v1"], origin=origin) as line:
            return str(await asyncio.wait_for(line.recv(), LIMIT_S))

    try:
        if is_let_in:
            assert '"serverInfo"' in asyncio.run(look())
        else:
            with pytest.raises(websockets.InvalidStatus, match="403"):
                asyncio.run(look())
    finally:
        scene.close()


def test_an_origin_without_a_viewer_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["run", "motors", "--foxglove-origin", "https://viewer.example"]) == 2
    assert capsys.readouterr().err == "p2os: --foxglove-origin goes with --foxglove only\nhint: add --foxglove\n"
