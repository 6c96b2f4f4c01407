"""The server as a browser meets it, on loopback: the page, its headers, the stream; and who is turned away."""

import http.client
import json
import socket
from collections.abc import Iterator

import pytest

pytest.importorskip("uvicorn")
websockets = pytest.importorskip("websockets.sync.client")

from websockets.exceptions import ConnectionClosed, InvalidStatus  # noqa: E402
from websockets.sync.client import ClientConnection  # noqa: E402

from p2os.view.frames import ViewFrame  # noqa: E402
from p2os.view.header import ChannelHeader, PageHeader  # noqa: E402
from p2os.view.live import StillRecording  # noqa: E402
from p2os.view.recording import ViewRecording  # noqa: E402
from p2os.view.server import app  # noqa: E402
from p2os.view.server.page_session import LARGEST_REQUEST_BYTES  # noqa: E402
from p2os.view.server.serving import ViewServer, serving  # noqa: E402
from simbase.errors import UsageError  # noqa: E402

#: A bound on waits; reached only when something is broken.
LIMIT_S = 20.0


def shown() -> ViewRecording:
    found = ViewRecording(PageHeader(title="<script>alert(1)</script>", end_ns=9))
    track = found.add(ChannelHeader(name="<img src=x onerror=alert(1)>", kind="text"))
    track.append(1, 0, "</script><script>alert(2)</script>")
    return found


@pytest.fixture(scope="module")
def server() -> Iterator[ViewServer]:
    with serving(StillRecording(shown())) as made:
        yield made


def token_of(server: ViewServer) -> str:
    return server.url.partition("#token=")[2]


def stream(server: ViewServer, token: str | None = None, origin: str | None = None):
    token = token_of(server) if token is None else token
    return websockets.connect(
        f"ws://127.0.0.1:{server.port}/stream", subprotocols=["p2os.view.1", f"token.{token}"], origin=origin,
        open_timeout=LIMIT_S, close_timeout=LIMIT_S, max_size=None, proxy=None,
    )  # fmt: skip


def got(server: ViewServer, path: str, method: str = "GET", **headers: str) -> tuple[int, dict[str, str], str]:
    link = http.client.HTTPConnection("127.0.0.1", server.port, timeout=LIMIT_S)
    try:
        link.request(method, path, headers=headers)
        answer = link.getresponse()
        return answer.status, {name.lower(): value for name, value in answer.getheaders()}, answer.read().decode()
    finally:
        link.close()


def test_the_page_and_its_bundle_are_served_without_anything_of_the_recording(server: ViewServer) -> None:
    for path, kind in (("/", "text/html"), ("/bundle/page.js", "text/javascript"), ("/bundle/page.css", "text/css")):
        status, headers, text = got(server, path)
        assert (status, headers["content-type"].partition(";")[0]) == (200, kind)
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["referrer-policy"] == "no-referrer"
        assert "frame-ancestors 'none'" in headers["content-security-policy"]
        assert "unsafe" not in headers["content-security-policy"]
        assert "alert(" not in text.replace("window.alert(", "") or path != "/"
        assert token_of(server) not in text
    assert "server" not in got(server, "/")[1]


@pytest.mark.parametrize(
    "path", ["/bundle/index.html", "/bundle/../page.py", "/bundle/%2e%2e/page.py", "/x", "/stream"]
)
def test_nothing_else_is_there(path: str, server: ViewServer) -> None:
    assert got(server, path)[0] in {404, 403}


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE"])
def test_nothing_can_be_written(method: str, server: ViewServer) -> None:
    assert got(server, "/", method)[0] == 405


def test_a_request_for_another_host_or_of_another_site_is_refused(server: ViewServer) -> None:
    assert got(server, "/", Host="evil.example")[0] == 403
    assert got(server, "/", Origin="http://evil.example")[0] == 403
    for origin in ("http://evil.example", "null"):
        with pytest.raises(InvalidStatus) as caught, stream(server, origin=origin):
            pass
        assert caught.value.response.status_code == 403


def test_who_has_the_token_gets_what_it_asks_for(server: ViewServer) -> None:
    with stream(server, origin=f"http://127.0.0.1:{server.port}") as page:
        assert page.subprotocol == "p2os.view.1"
        header = json.loads(page.recv(LIMIT_S))["header"]
        assert header["title"] == "<script>alert(1)</script>"
        page.send(json.dumps({"want": [0], "to_ns": 9, "id": 5}))
        frame = ViewFrame.from_bytes(page.recv(LIMIT_S))
        assert frame.columns[2] == ["</script><script>alert(2)</script>"]
        assert json.loads(page.recv(LIMIT_S)) == {"done": 5}


@pytest.mark.parametrize("token", ["", "x", "x" * 43])
def test_a_wrong_token_gets_nothing(token: str, server: ViewServer) -> None:
    with stream(server, token) as page, pytest.raises(ConnectionClosed) as caught:
        page.recv(LIMIT_S)
    assert caught.value.rcvd is not None
    assert caught.value.rcvd.code == app.WRONG_TOKEN


def test_a_stream_without_the_protocol_gets_nothing(server: ViewServer) -> None:
    with (
        websockets.connect(f"ws://127.0.0.1:{server.port}/stream", proxy=None) as page,
        pytest.raises(ConnectionClosed) as caught,
    ):
        page.recv(LIMIT_S)
    assert caught.value.rcvd is not None
    assert caught.value.rcvd.code == app.WRONG_TOKEN


@pytest.mark.parametrize(
    ("sent", "code"),
    [("{", app.NO_REQUEST), (b"\0", app.NO_REQUEST), ('{"want": 1}', app.NO_REQUEST),
     ("x" * (LARGEST_REQUEST_BYTES + 1), 1009)],
)  # fmt: skip
def test_what_is_no_request_ends_its_own_stream_alone(sent: str | bytes, code: int, server: ViewServer) -> None:
    with stream(server) as other, stream(server) as page:
        page.recv(LIMIT_S)
        page.send(sent)
        with pytest.raises(ConnectionClosed) as caught:
            page.recv(LIMIT_S)
        assert caught.value.rcvd is not None
        assert caught.value.rcvd.code == code
        assert "header" in json.loads(other.recv(LIMIT_S))
        other.send('{"want": [], "id": 1}')
        assert json.loads(other.recv(LIMIT_S)) == {"done": 1}


def test_a_flood_ends_its_own_stream(server: ViewServer) -> None:
    with stream(server) as page:
        page.recv(LIMIT_S)
        with pytest.raises(ConnectionClosed) as caught:
            _flood(page)
    assert caught.value.rcvd is not None
    assert caught.value.rcvd.code == app.FLOOD
    with stream(server) as page:
        assert "header" in json.loads(page.recv(LIMIT_S))


def _flood(page: ClientConnection) -> None:
    for _ in range(1000):
        page.send('{"want": []}')
    while True:
        page.recv(LIMIT_S)


def test_one_page_more_than_may_look_is_turned_away(server: ViewServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(app, "MOST_PAGES", 1)
    with stream(server) as first:
        first.recv(LIMIT_S)
        with stream(server) as second, pytest.raises(ConnectionClosed) as caught:
            second.recv(LIMIT_S)
    assert caught.value.rcvd is not None
    assert caught.value.rcvd.code == app.TOO_MANY


def test_it_binds_to_loopback_and_a_port_that_is_taken_is_named(server: ViewServer) -> None:
    assert server.url.startswith(f"http://127.0.0.1:{server.port}/#token=")
    with pytest.raises(UsageError, match=f"cannot serve at 127.0.0.1:{server.port}"):
        ViewServer(StillRecording(shown()), port=server.port)


def test_a_server_that_ends_tells_its_pages_and_frees_its_port() -> None:
    with serving(StillRecording(shown())) as made, stream(made) as page:
        page.recv(LIMIT_S)
        made.close()
        with pytest.raises(ConnectionClosed):
            page.recv(LIMIT_S)
    with pytest.raises(OSError, match="refused"):
        socket.create_connection(("127.0.0.1", made.port), timeout=LIMIT_S)


def test_nonsense_on_the_port_is_answered_and_the_server_goes_on(server: ViewServer) -> None:
    for data in (b"\xfa\xfb\x03\0\0\0", b"\0" * 100_000, b"GET / HTTP/1.1\r\n" + b"x: " + b"y" * 100_000):
        with socket.create_connection(("127.0.0.1", server.port), timeout=LIMIT_S) as link:
            try:
                link.sendall(data)
                link.shutdown(socket.SHUT_WR)
                assert link.recv(100)[:12] in {b"HTTP/1.1 400", b""}
            except ConnectionError:
                pass
    assert got(server, "/")[0] == 200
