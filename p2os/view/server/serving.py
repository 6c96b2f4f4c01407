"""A server on loopback, in a thread of its own, and the link that opens its page.

It binds before it tells its address, so that the link works once it is known.
"""

import contextlib
import socket
import threading
from collections.abc import Iterator
from ipaddress import ip_address

import uvicorn

from p2os.view.live import ShownSource
from p2os.view.server.access import PageAccess, new_token
from p2os.view.server.app import ViewApp
from p2os.view.server.page_session import LARGEST_REQUEST_BYTES
from simbase.errors import UsageError

HOST = "127.0.0.1"
#: chosen: connections at a time, the pages' own and their requests for the bundle.
MOST_CONNECTIONS = 64
#: chosen: who is being sent something when the server ends has so long, seconds.
LEAVING_S = 1
#: chosen: a header of a browser has less.
MOST_HEADER_BYTES = 16_384
_STARTING_S = 10.0


class ViewServer:
    """Serves a recording.

    Args:
        source: What it shows.
        host: Where it binds.
        port: 0 takes a free one.

    Raises:
        UsageError: It cannot bind there.
    """

    def __init__(self, source: ShownSource, host: str = HOST, port: int = 0) -> None:
        self._socket = _bound(host, port)
        self.port: int = self._socket.getsockname()[1]
        names = frozenset() if _is_address(host) else frozenset({host.lower()})
        access = PageAccess(token=new_token(), watch_token=new_token() if source.control else "", names=names)
        shown = f"[{host}]" if ":" in host else host
        #: What a browser opens; the token stands behind `#`, which no browser sends.
        self.url = f"http://{shown}:{self.port}/#token={access.token}"
        #: One for looking on; empty where nothing can be controlled.
        self.watch_url = f"http://{shown}:{self.port}/#token={access.watch_token}" if access.watch_token else ""
        config = uvicorn.Config(
            ViewApp(source, access), lifespan="off", log_config=None, access_log=False, server_header=False,
            proxy_headers=False, ws="websockets-sansio", ws_max_size=LARGEST_REQUEST_BYTES, ws_max_queue=4,
            ws_per_message_deflate=False, limit_concurrency=MOST_CONNECTIONS, timeout_graceful_shutdown=LEAVING_S,
            h11_max_incomplete_event_size=MOST_HEADER_BYTES, http="h11", loop="asyncio",
        )  # fmt: skip
        self._server = uvicorn.Server(config)
        self._thread = threading.Thread(target=self._run, name="p2os-view", daemon=True)
        self._is_started = threading.Event()

    def _run(self) -> None:
        self._server.run(sockets=[self._socket])

    def start(self) -> None:
        """Begin to serve."""
        self._thread.start()

    def close(self) -> None:
        """End: pages are told, connections closed."""
        self._server.should_exit = True
        if self._thread.ident is not None:
            self._thread.join(LEAVING_S + _STARTING_S)
        self._socket.close()

    def wait(self) -> None:
        """Wait until it ends; an interrupt is raised here."""
        while self._thread.is_alive():
            self._thread.join(1.0)


@contextlib.contextmanager
def serving(
    source: ShownSource, host: str = HOST, port: int = 0
) -> Iterator[ViewServer]:  # fmt: skip
    """Serve a recording for a block.

    Raises:
        UsageError: It cannot bind there.
    """
    server = ViewServer(source, host, port)
    server.start()
    try:
        yield server
    finally:
        server.close()


def _bound(host: str, port: int) -> socket.socket:
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        found = socket.socket(family, socket.SOCK_STREAM)
        try:
            found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            found.bind((host, port))
            found.listen(MOST_CONNECTIONS)
        except BaseException:
            found.close()
            raise
    except OSError as error:
        hint = "another port, or 0 for a free one"
        raise UsageError(f"cannot serve at {host}:{port}: {error.strerror or error}", hint=hint) from error
    return found


def _is_address(host: str) -> bool:
    try:
        ip_address(host)
    except ValueError:
        return False
    return True
