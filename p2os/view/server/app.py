"""The server's routes: the page and its bundle, which have no secrets, and the stream, which needs the token.

Each answer has the headers that keep a browser from using it for anything else. A page is written to only while it
reads: a send that waits holds up that page alone, and ends its connection after `SLOWEST_SEND_S`.
"""

import asyncio
import contextlib
import logging
from collections.abc import Awaitable, Callable, Iterable, Mapping

from starlette.applications import Starlette
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect

from p2os.view.live import ShownSource
from p2os.view.page import SCENE, SCRIPT, STYLE, bundled, filled
from p2os.view.server.access import SUBPROTOCOL, PageAccess, PageRole
from p2os.view.server.page_session import FloodError, PageSession, RequestError
from simbase.listening import LOGGER

#: chosen: new rows reach a page so often; well below what an eye sees as a delay.
NEWS_S = 1 / 20
#: chosen: a page that takes nothing for so long is gone.
SLOWEST_SEND_S = 30.0
#: chosen: pages at a time.
MOST_PAGES = 16
#: Close codes of the stream.
NO_REQUEST, WRONG_TOKEN, FLOOD, TOO_MANY, ENDED = 4400, 4401, 4408, 4429, 1001
_TYPES = {SCRIPT: "text/javascript", SCENE: "text/javascript", STYLE: "text/css"}
#: Of every answer; `connect-src` names the stream, which `'self'` does not in every browser.
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; connect-src 'self' {stream}; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
HEADERS: Mapping[str, str] = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-store",
}


class ViewApp:
    """The application of one server.

    Args:
        source: What it shows.
        access: Who may look.
    """

    def __init__(self, source: ShownSource, access: PageAccess) -> None:
        self._source, self._access = source, access
        self._pages = 0
        routes = [
            Route("/", self._page),
            *(Route(f"/bundle/{name}", self._bundled(name)) for name in _TYPES),
            WebSocketRoute("/stream", self._stream),
        ]
        self._app: ASGIApp = Starlette(routes=routes)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve a request that may look; refuse any other."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        why = self._access.refusal(scope["headers"])
        if not why:
            await self._app(scope, receive, send)
            return
        logging.getLogger(LOGGER).warning("refused: %s", why)
        if scope["type"] == "websocket":
            await WebSocket(scope, receive, send).close()  # before it is accepted: HTTP 403
        else:
            await _plain(f"refused: {why}\n", 403)(scope, receive, send)

    async def _page(self, request: object) -> Response:
        host = next(value.decode("latin-1") for name, value in request.scope["headers"] if name == b"host")  # type: ignore[attr-defined]  # Starlette's own
        text = filled({
            "title": "p2os",
            "style": '<link rel="stylesheet" href="/bundle/page.css">',
            "script": '<script src="/bundle/page.js"></script>',
        })  # fmt: skip
        return _with_headers(Response(text, media_type="text/html"), host)

    def _bundled(self, name: str) -> Callable[[object], Awaitable[Response]]:
        async def answer(_request: object) -> Response:
            return _with_headers(Response(bundled(name), media_type=_TYPES[name]))

        return answer

    async def _stream(self, socket: WebSocket) -> None:
        protocols = list(socket.scope.get("subprotocols") or ())
        await socket.accept(SUBPROTOCOL if SUBPROTOCOL in protocols else None)
        role = self._access.role(protocols)
        if SUBPROTOCOL not in protocols or role is None:
            logging.getLogger(LOGGER).warning("a page was refused: its token is not that of this server")
            await socket.close(WRONG_TOKEN, "this link's token is not that of this server")
            return
        if self._pages >= MOST_PAGES:
            await socket.close(TOO_MANY, f"{MOST_PAGES} pages look already")
            return
        self._pages += 1
        session = PageSession(self._source, may_control=role is PageRole.CONTROL)
        try:
            await _PageConnection(socket, session).run()
        finally:
            session.close()
            self._pages -= 1


class _PageConnection:
    """The stream of one page."""

    def __init__(self, socket: WebSocket, session: PageSession) -> None:
        self._socket, self._session = socket, session
        # Frames of one answer follow one another.
        self._turn = asyncio.Lock()

    async def run(self) -> None:
        """Answer and tell until the page leaves, or must."""
        tasks = [asyncio.create_task(self._answer()), asyncio.create_task(self._tell())]
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                await task
        except RequestError as error:
            with contextlib.suppress(RuntimeError, WebSocketDisconnect):
                await self._socket.close(FLOOD if isinstance(error, FloodError) else NO_REQUEST, str(error))
        except (WebSocketDisconnect, TimeoutError):
            pass
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    async def _answer(self) -> None:
        clock = asyncio.get_running_loop().time
        while True:
            message = await self._socket.receive()
            if message["type"] == "websocket.disconnect":
                return
            text = message.get("text")
            if text is None:
                raise RequestError("a request is text")
            async with self._turn:
                await self._send(self._session.receive(text, clock()))

    async def _tell(self) -> None:
        while True:
            async with self._turn:
                await self._send(self._session.news())
            await asyncio.sleep(NEWS_S)

    async def _send(self, messages: Iterable[str | bytes | memoryview]) -> None:
        for message in messages:
            async with asyncio.timeout(SLOWEST_SEND_S):
                if isinstance(message, str):
                    await self._socket.send_text(message)
                else:
                    await self._socket.send_bytes(bytes(message))


def _plain(text: str, status: int) -> Response:
    return _with_headers(PlainTextResponse(text, status))


def _with_headers(response: Response, host: str = "") -> Response:
    response.headers.update(HEADERS)
    response.headers["Content-Security-Policy"] = POLICY.format(stream=f"ws://{host}" if host else "")
    return response
