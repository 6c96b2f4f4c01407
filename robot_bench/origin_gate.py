"""Viewers of a WebSocket server, let in by the Origin that their browser states.

A page of any site may open a WebSocket to this machine and read what it is sent; only the server can refuse, by the
header Origin, which no page can choose. Foxglove's library does not look at it: so this stands before the library's
server, at the address that viewers are told, and passes on the bytes of those that may look.

Let in are programs without Origin (no browser), viewers that are served from this machine or opened as a file of it
(desktop programs are), those of `ORIGINS`, and what the user names.

Source: RFC 6455 10.2; RFC 6454 7 (a page that has none states "null").
"""

import asyncio
import contextlib
import logging
import re
import threading
from collections.abc import Collection
from ipaddress import ip_address
from urllib.parse import urlsplit

from simbase.listening import LOGGER

#: Viewers that are pages of the web, and the programs of this machine (Electron opens its pages as files).
ORIGINS = frozenset({"https://app.foxglove.dev", "file://"})

#: chosen: a browser's header has less than 2 KB.
MOST_HEADER_BYTES = 16_384
#: chosen: a browser sends its header at once.
HEADER_S = 10.0
#: chosen: what a viewer was sent last reaches it within a moment.
LEAVING_S = 1.0
_PIECE_BYTES = 65_536
_ORIGIN = re.compile(rb"\r\norigin:[ \t]*([^\r\n]*?)[ \t]*(?=\r\n)", re.IGNORECASE)


def may_look(head: bytes, allowed: Collection[str] = ()) -> bool:
    """Tell whether who sent the header of a request may look; `allowed` are origins beside those of this module."""
    stated = [origin.decode("latin-1").lower() for origin in _ORIGIN.findall(head)]
    known = {*ORIGINS, *(origin.lower().rstrip("/") for origin in allowed)}
    return all(origin in known or _is_of_this_machine(origin) for origin in stated)


class OriginGate:
    """Listens for viewers, in a thread of its own.

    Args:
        host: Where it binds.
        port: 0 takes a free one; `port` says which.
        server: Host and port of the server behind.
        allowed: Origins beside those of this module.

    Raises:
        OSError: It cannot bind.
    """

    def __init__(self, host: str, port: int, server: tuple[str, int], allowed: Collection[str] = ()) -> None:
        self._server, self._allowed = server, allowed
        self._loop = asyncio.new_event_loop()
        try:
            self._listener = self._loop.run_until_complete(
                asyncio.start_server(self._let_in, host, port, limit=MOST_HEADER_BYTES)
            )
            self.port: int = self._listener.sockets[0].getsockname()[1]
        except BaseException:
            self._loop.close()
            raise
        self._thread = threading.Thread(target=self._loop.run_forever, name="p2os-viewers", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Let viewers have what the server has sent, and end."""
        asyncio.run_coroutine_threadsafe(self._end(), self._loop).result()
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    async def _end(self) -> None:
        self._listener.close()
        viewers = asyncio.all_tasks() - {asyncio.current_task()}
        if viewers:
            await asyncio.wait(viewers, timeout=LEAVING_S)
        for viewer in viewers:
            viewer.cancel()
        await asyncio.gather(*viewers, return_exceptions=True)

    async def _let_in(self, viewer: asyncio.StreamReader, to_viewer: asyncio.StreamWriter) -> None:
        try:
            with contextlib.suppress(OSError, asyncio.IncompleteReadError, asyncio.LimitOverrunError):
                await self._serve(viewer, to_viewer)
        finally:
            to_viewer.close()

    async def _serve(self, viewer: asyncio.StreamReader, to_viewer: asyncio.StreamWriter) -> None:
        head = await asyncio.wait_for(viewer.readuntil(b"\r\n\r\n"), HEADER_S)
        if not may_look(head, self._allowed):
            stated = ", ".join(repr(origin.decode("latin-1")) for origin in _ORIGIN.findall(head))
            logging.getLogger(LOGGER).warning("viewer refused: Origin %s (--foxglove-origin lets it in)", stated)
            to_viewer.write(b"HTTP/1.1 403 Forbidden\r\nContent-Length: 0\r\nConnection: close\r\n\r\n")
            await to_viewer.drain()
            return
        server, to_server = await asyncio.open_connection(*self._server)
        try:
            to_server.write(head)
            # Either end may leave first, and the other is told so.
            await asyncio.gather(_carry(viewer, to_server), _carry(server, to_viewer))
        finally:
            to_server.close()


async def _carry(source: asyncio.StreamReader, target: asyncio.StreamWriter) -> None:
    """Pass bytes on until their source ends; then end the target, too."""
    with contextlib.suppress(OSError):
        while data := await source.read(_PIECE_BYTES):
            target.write(data)
            await target.drain()
    with contextlib.suppress(OSError):
        target.write_eof()


def _is_of_this_machine(origin: str) -> bool:
    try:
        host = urlsplit(origin).hostname or ""
    except ValueError:  # no address
        return False
    if host == "localhost":
        return True
    try:
        return ip_address(host).is_loopback
    except ValueError:  # a name
        return False
