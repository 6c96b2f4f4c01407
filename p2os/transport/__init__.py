"""Byte lines behind one function: `open_url("serial:… | tcp:… | pty: | loop:…")`.

Nothing here knows of frames or robots, and nothing below the I/O layer imports it.
"""

from p2os.transport.loops import Loops
from p2os.transport.ports import HungUpError, Listener, RefusedPeerError, Transport
from p2os.transport.url import LoopUrl, PortUrl, PtyUrl, SerialUrl, TcpUrl, parse_url
from simbase.errors import UsageError

__all__ = [
    "HungUpError",
    "Listener",
    "LoopUrl",
    "Loops",
    "PortUrl",
    "PtyUrl",
    "RefusedPeerError",
    "SerialUrl",
    "TcpUrl",
    "Transport",
    "listen_url",
    "open_url",
    "parse_url",
]


def open_url(text: str, *, loops: Loops | None = None) -> Transport:
    """Open a line to a peer that is there.

    `tcp:` connects; `serial:` opens a port; `pty:/dev/pts/5` opens a terminal that
    somebody made, and `pty:` makes one whose path stands in the description.

    Args:
        text: the URL.
        loops: the lines that `loop:NAME` may name.

    Raises:
        UsageError: the text is no URL.
        TransportError: the line cannot be opened; the hint says what to try.
    """
    url = parse_url(text)
    if isinstance(url, TcpUrl):
        from p2os.transport.sockets import connect_tcp

        return connect_tcp(url)
    if isinstance(url, LoopUrl):
        return _loops(loops, text).connect(url.name)
    if isinstance(url, PtyUrl) and not url.path:
        from p2os.transport.pseudo_terminal import open_pty

        return open_pty(url)
    from p2os.transport.serial_port import open_serial

    return open_serial(SerialUrl(path=url.path) if isinstance(url, PtyUrl) else url)


def listen_url(text: str, *, loops: Loops | None = None) -> Listener:
    """Wait for peers at a place: the serving side of `open_url`.

    `tcp:` listens (port 0: any free one); `pty:` makes a terminal, and
    `pty:/path` a link to it; on `serial:` the one peer is always there.

    Args:
        text: the URL.
        loops: the lines that `loop:NAME` may name.

    Raises:
        UsageError: the text is no URL.
        TransportError: the place is taken or cannot be opened.
    """
    url = parse_url(text)
    if isinstance(url, TcpUrl):
        from p2os.transport.sockets import TcpListener

        return TcpListener(url)
    if isinstance(url, LoopUrl):
        return _loops(loops, text).listen(url.name)
    if isinstance(url, PtyUrl):
        from p2os.transport.pseudo_terminal import PtyListener

        return PtyListener(url)
    from p2os.transport.serial_port import SerialListener

    return SerialListener(url)


def _loops(loops: Loops | None, text: str) -> Loops:
    if loops is None:
        raise UsageError(f"{text} exists only inside one program", hint="use pty: or tcp:127.0.0.1:8101")
    return loops
