"""Where an outside body answers: `tcp:HOST:PORT` or `unix:PATH`, with options after a `?`.

`timeout=N` is how many seconds an answer may take (10); `anywhere` allows a host that is not this machine: the
protocol has neither a password nor a cipher.
"""

import ipaddress
from dataclasses import dataclass
from typing import Self

from simbase.errors import UsageError, shown

#: chosen: the longest that a simulator thinks about a thousand steps.
DEFAULT_TIMEOUT_S = 10.0
LONGEST_TIMEOUT_S = 86_400.0
_SCHEMES = ("tcp:", "unix:")
_HINT = "use tcp:127.0.0.1:PORT or unix:PATH, and ?timeout=SECONDS where it is slow"


@dataclass(frozen=True, slots=True, kw_only=True)
class Address:
    """A socket: a host and a port, or a path (the host is then empty)."""

    text: str
    host: str
    port: int
    path: str
    timeout_s: float

    @classmethod
    def of(cls, text: str) -> Self:
        """Return the address that a text names; nothing is opened.

        Raises:
            UsageError: It names none, or another machine without `anywhere`.
        """
        place, _, options = text.partition("?")
        scheme, _, rest = place.partition(":")
        timeout_s, anywhere = _options(text, options)
        if scheme == "unix":
            if not rest or len(rest.encode()) > 107 or "\0" in rest:  # the system's limit of a socket's path
                raise UsageError(f"{shown(text)} names no socket: a path of at most 107 bytes", hint=_HINT)
            return cls(text=text, host="", port=0, path=rest, timeout_s=timeout_s)
        host, colon, port = rest.rpartition(":")
        host = host.removeprefix("[").removesuffix("]")
        if not colon or not host or not (port.isascii() and port.isdigit() and 0 < int(port[:6]) <= 0xFFFF):
            raise UsageError(f"{shown(text)} names no host and port of an outside body", hint=_HINT)
        if not anywhere and not _is_this_machine(host):
            raise UsageError(
                f"the outside body {shown(text)} is not on this machine, and the protocol has no password",
                hint=f"if you trust the network: {place}?anywhere",
            )
        return cls(text=text, host=host, port=int(port), path="", timeout_s=timeout_s)


def is_address(name: str) -> bool:
    """Tell whether the name of a body is the address of one."""
    return name.startswith(_SCHEMES)


def _options(text: str, options: str) -> tuple[float, bool]:
    timeout_s, anywhere = DEFAULT_TIMEOUT_S, False
    for option in options.split("&") if options else ():
        key, _, value = option.partition("=")
        if option == "anywhere":
            anywhere = True
        elif key == "timeout" and (seconds := _seconds(value)) is not None:
            timeout_s = seconds
        else:
            raise UsageError(f"{shown(text)}: there is no option {shown(option)}", hint="timeout=SECONDS, anywhere")
    return timeout_s, anywhere


def _seconds(text: str) -> float | None:
    try:
        seconds = float(text)
    except ValueError:
        return None
    return seconds if 0 < seconds <= LONGEST_TIMEOUT_S else None


def _is_this_machine(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
