"""The text that names a line: `serial:PATH[?baud=N]`, `tcp:HOST:PORT`, `pty:[PATH]`, `loop:NAME`.

Reading a URL opens nothing and needs no operating system: `serial:COM3` is read
everywhere (it is untried on Windows).
"""

import difflib
import os
import re
from collections.abc import Callable
from dataclasses import dataclass

from p2os.protocol.bauds import DEFAULT_BAUD
from simbase.errors import UsageError, shown

#: The port on which simulated Pioneers have always listened; ARIA tries it first.
DEFAULT_TCP_PORT = 8101
LOOPBACK = "127.0.0.1"
#: Where the first served robot is found when nothing else is given.
DEFAULT_URL = f"tcp:{LOOPBACK}:{DEFAULT_TCP_PORT}"

#: "10.0.0.5:8101", "robot.local:8101"; a word alone may be anything.
_HOST_AND_PORT = re.compile(r"[\w.-]+:\d{1,5}|\d{1,3}(?:\.\d{1,3}){3}|localhost")
_COM_PORT = re.compile(r"COM\d+", re.IGNORECASE)
#: What is no host, and no line of ours either.
_OTHER_SCHEMES = frozenset({
    "udp", "http", "https", "ws", "wss", "telnet", "ssh", "unix", "file", "usb", "can", "rfc2217", "socket", "spy",
})  # fmt: skip
_HINT = "use serial:/dev/ttyUSB0?baud=9600, serial:COM3, tcp:127.0.0.1:8101 or pty:"


@dataclass(frozen=True, slots=True, kw_only=True)
class SerialUrl:
    """A serial port by the operating system's name for it."""

    path: str
    baud: int = DEFAULT_BAUD

    def __str__(self) -> str:
        return f"serial:{self.path}?baud={self.baud}"


@dataclass(frozen=True, slots=True, kw_only=True)
class TcpUrl:
    """A TCP host and port; port 0 lets the system choose when listening."""

    host: str = LOOPBACK
    port: int = DEFAULT_TCP_PORT

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"tcp:{host}:{self.port}"


@dataclass(frozen=True, slots=True, kw_only=True)
class PtyUrl:
    """A pseudo-terminal; the path is empty to make a new one."""

    path: str = ""

    def __str__(self) -> str:
        return f"pty:{self.path}"


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopUrl:
    """A named line inside this process."""

    name: str

    def __str__(self) -> str:
        return f"loop:{self.name}"


PortUrl = SerialUrl | TcpUrl | PtyUrl | LoopUrl


def parse_url(text: str) -> PortUrl:
    """Return what a URL names.

    Raises:
        UsageError: it is no text, or no URL of the four kinds; the hint shows those that are.
    """
    if not isinstance(text, str):
        meant = _meant(os.fsdecode(text)) if isinstance(text, os.PathLike) else ""
        raise UsageError(
            f"{shown(text)} is no text with a port URL", hint=f"did you mean {meant!r}?" if meant else _HINT
        )
    scheme, colon, rest = text.partition(":")
    reader = _READERS.get(scheme) if colon else None
    if reader is None:
        meant = _meant(text)
        raise UsageError(f"{shown(text)} is not a port URL", hint=f"did you mean {meant}?" if meant else _HINT)
    return reader(text, rest)


def _meant(text: str) -> str:
    """Return the URL that somebody meant who left the scheme out or misspelt it; empty where nobody can tell."""
    if text.startswith("/") or _COM_PORT.fullmatch(text):
        return f"serial:{text}"
    scheme, colon, rest = text.partition(":")
    if scheme.lower() in _OTHER_SCHEMES:
        return ""
    near = difflib.get_close_matches(scheme.lower(), _READERS, n=1) if colon else []
    meant = f"{near[0]}:{rest}" if near else f"tcp:{text}" if _HOST_AND_PORT.fullmatch(text) else ""
    if not meant:
        return ""
    try:
        parse_url(meant)
    except UsageError:
        return ""  # wrong in more than its scheme
    return meant


def _serial(text: str, rest: str) -> SerialUrl:
    path, question, query = rest.partition("?")
    if not path:
        raise UsageError(f"{text!r} names no serial port", hint="p2os ports")
    if not question:
        return SerialUrl(path=path)
    key, _, value = query.partition("=")
    if key != "baud":
        raise UsageError(f"{text!r} has an unknown option {key!r}", hint=f"serial:{path}?baud=9600")
    return SerialUrl(path=path, baud=_number(text, "baud", value, 1, 4_000_000))


def _tcp(text: str, rest: str) -> TcpUrl:
    host, colon, port = rest.rpartition(":") if not rest.endswith("]") else (rest, "", "")
    if not colon:
        host, port = rest, ""
    if host.startswith("[") and host.endswith("]"):
        host = host[1:-1]
    if "[" in host or "]" in host:
        raise UsageError(f"{text!r}: {host!r} is no host", hint="tcp:[::1]:8101")
    if "/" in host:
        raise UsageError(f"{text!r}: {host!r} is no host", hint=f"tcp:{LOOPBACK}:{DEFAULT_TCP_PORT}, without slashes")
    host = host or LOOPBACK
    if not port:
        return TcpUrl(host=host)
    return TcpUrl(host=host, port=_number(text, "port", port, 0, 65_535))


def _pty(_text: str, rest: str) -> PtyUrl:
    return PtyUrl(path=rest)


def _loop(text: str, rest: str) -> LoopUrl:
    if not rest:
        raise UsageError(f"{text!r} has no name", hint="loop:robot")
    return LoopUrl(name=rest)


def _number(text: str, what: str, value: str, lowest: int, highest: int) -> int:
    if not (value.isascii() and value.isdigit()) or not lowest <= int(value) <= highest:
        raise UsageError(f"{text!r}: {what} {value!r} is not a whole number from {lowest} to {highest}", hint=_HINT)
    return int(value)


_READERS: dict[str, Callable[[str, str], PortUrl]] = {"serial": _serial, "tcp": _tcp, "pty": _pty, "loop": _loop}
