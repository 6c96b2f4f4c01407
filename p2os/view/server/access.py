"""Who may look: told from the headers of a request, and from the token of a link.

A page of any site may send requests to this machine, and open a WebSocket to it; a name that its owner points to
127.0.0.1 makes it the same site (DNS rebinding). So the Host must be an address, `localhost` or a name that the user
gave, and an Origin that is stated must be this server's own. Whoever wants data has the token, too.

Source: RFC 6455 10.2; RFC 6454 7; RFC 9110 7.2.
"""

import hmac
import secrets
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from ipaddress import ip_address
from urllib.parse import urlsplit

#: Bytes of a token; 43 letters.
TOKEN_BYTES = 32
#: What a page names beside the protocol when it opens its stream: this, and the token.
TOKEN_PREFIX = "token."  # noqa: S105 - no password
SUBPROTOCOL = "p2os.view.1"


class PageRole(Enum):
    """What a page's link lets it do."""

    #: Look on.
    WATCH = "watch"
    #: Control the run, too.
    CONTROL = "control"


def new_token() -> str:
    """Return a token that nobody can guess."""
    return secrets.token_urlsafe(TOKEN_BYTES)


@dataclass(frozen=True, slots=True, kw_only=True)
class PageAccess:
    """Who may look at one server.

    Args:
        token: Of links that let a page control what it shows.
        watch_token: Of links for looking on; empty: there are none.
        names: Names beside `localhost` by which the user reaches it.
    """

    token: str
    watch_token: str = ""
    names: frozenset[str] = frozenset()

    def refusal(self, headers: Iterable[tuple[bytes, bytes]]) -> str:
        """Return why a request is refused, from its header; empty where it is not."""
        hosts = [value.decode("latin-1").lower() for name, value in headers if name.lower() == b"host"]
        origins = [value.decode("latin-1").lower() for name, value in headers if name.lower() == b"origin"]
        if len(hosts) != 1 or not self._is_known(hosts[0]):
            return "Host is neither an address nor a name of this server"
        if any(origin != f"http://{hosts[0]}" for origin in origins):
            return "Origin is another site"
        return ""

    def _is_known(self, host: str) -> bool:
        try:
            parts = urlsplit(f"//{host}")
            name, _ = parts.hostname or "", parts.port
        except ValueError:
            return False
        if parts.path or parts.query or parts.fragment or "@" in host:
            return False
        return name == "localhost" or name in self.names or _is_address(name)

    def role(self, protocols: Iterable[str]) -> "PageRole | None":
        """Return what a page may that names these beside the protocol: one token and no other; None: nothing."""
        given = [one.removeprefix(TOKEN_PREFIX) for one in protocols if one.startswith(TOKEN_PREFIX)]
        if len(given) != 1:
            return None
        may_control = hmac.compare_digest(given[0].encode(), self.token.encode())
        may_look = hmac.compare_digest(given[0].encode(), self.watch_token.encode()) and bool(self.watch_token)
        if may_control:
            return PageRole.CONTROL
        return PageRole.WATCH if may_look else None


def _is_address(name: str) -> bool:
    try:
        ip_address(name)
    except ValueError:
        return False
    return True
