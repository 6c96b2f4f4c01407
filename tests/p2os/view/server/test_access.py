"""Who may look: by Host, Origin and token."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2os.view.server.access import PageAccess, PageRole, new_token

TOKEN = new_token()
ACCESS = PageAccess(token=TOKEN)


def headers(host: str | None, *origins: str) -> list[tuple[bytes, bytes]]:
    found = [] if host is None else [(b"host", host.encode())]
    return found + [(b"origin", origin.encode()) for origin in origins]


@pytest.mark.parametrize(
    "host", ["127.0.0.1:8000", "127.0.0.1", "localhost:80", "LOCALHOST:80", "[::1]:9", "10.0.0.7:1"]
)
def test_an_address_or_this_machine_by_name_is_let_in_with_its_own_origin_or_none(host: str) -> None:
    assert ACCESS.refusal(headers(host)) == ""
    assert ACCESS.refusal(headers(host, f"http://{host}")) == ""


@pytest.mark.parametrize(
    "host",
    [
        None, "", "evil.example", "evil.example:8000", "127.0.0.1.evil.example", "localhost.evil.example",
        "127.0.0.1:8000@evil.example", "evil.example#127.0.0.1", "127.0.0.1/..", "127.0.0.1:port", "[::1", "127.1:1",
        "lab-pc:8000",
    ],
)  # fmt: skip
def test_any_other_host_is_refused(host: str | None) -> None:
    assert ACCESS.refusal(headers(host)).startswith("Host")


def test_a_name_that_the_user_gave_is_let_in() -> None:
    access = PageAccess(token=TOKEN, names=frozenset({"lab-pc"}))
    assert access.refusal(headers("Lab-PC:8000", "http://lab-pc:8000")) == ""
    assert access.refusal(headers("evil:8000")) != ""


def test_two_hosts_are_one_too_many() -> None:
    assert ACCESS.refusal([*headers("127.0.0.1:1"), *headers("127.0.0.1:1")]) != ""


@pytest.mark.parametrize(
    "origin",
    [
        "null", "", "http://evil.example", "https://127.0.0.1:8000", "http://127.0.0.1:8001", "http://127.0.0.1",
        "http://localhost:8000", "file://", "http://127.0.0.1:8000.evil.example",
    ],
)  # fmt: skip
def test_another_origin_is_refused(origin: str) -> None:
    assert ACCESS.refusal(headers("127.0.0.1:8000", origin)).startswith("Origin")
    assert ACCESS.refusal(headers("127.0.0.1:8000", "http://127.0.0.1:8000", origin)).startswith("Origin")


def test_the_token_alone_admits() -> None:
    assert ACCESS.role(["p2os.view.1", f"token.{TOKEN}"]) is PageRole.CONTROL
    for protocols in (
        [], ["p2os.view.1"], ["token."], [TOKEN], [f"token.{TOKEN}x"], [f"token.{TOKEN[:-1]}"],
        [f"token.{TOKEN.swapcase()}"],
        [f"token.{TOKEN}", "token.x"], ["token.x", f"token.{TOKEN}"], ["token.ü"],
    ):  # fmt: skip
        assert ACCESS.role(protocols) is None, protocols


def test_the_token_for_looking_on_lets_look_on_alone() -> None:
    access = PageAccess(token=TOKEN, watch_token="w" * 43)
    assert access.role([f"token.{'w' * 43}"]) is PageRole.WATCH
    assert access.role([f"token.{TOKEN}"]) is PageRole.CONTROL
    assert access.role([f"token.{TOKEN}", f"token.{'w' * 43}"]) is None
    assert access.role(["token."]) is None
    assert ACCESS.role(["token."]) is None, "there is none"


@given(st.lists(st.text(max_size=60), max_size=3))
def test_nothing_else_admits(protocols: list[str]) -> None:
    assert ACCESS.role(protocols) is None
    assert ACCESS.role([f"token.{one}" for one in protocols]) is None


def test_no_token_comes_twice() -> None:
    tokens = {new_token() for _ in range(100)}
    assert len(tokens) == 100
    assert min(map(len, tokens)) == 43
