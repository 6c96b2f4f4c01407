"""UDP sockets that take only what is sent to one address, though they are bound to every one."""

import contextlib
import os
import socket
import sys
from collections.abc import Iterator
from ipaddress import IPv4Address
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2os.transport.one_address import DESTINATION, NET_OFFSET, filter_of, hold, opened_on

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="filters of sockets are Linux's")

LOOPBACK, OTHER = "127.0.0.1", "127.0.0.2"


@contextlib.contextmanager
def bound_to_all() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
        line.bind(("", 0))
        line.setblocking(False)
        yield line


@pytest.mark.parametrize("address", [LOOPBACK, OTHER])
def test_a_held_socket_takes_what_is_sent_to_its_address_alone(address: str) -> None:
    with bound_to_all() as line, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        hold(line, IPv4Address(address))
        port = line.getsockname()[1]
        for to in (LOOPBACK, OTHER, "127.0.0.3", LOOPBACK):
            sender.sendto(to.encode(), (to, port))
        taken = []
        with contextlib.suppress(BlockingIOError):
            while True:
                taken.append(line.recv(100).decode())
    assert taken == [to for to in (LOOPBACK, OTHER, LOOPBACK) if to == address]


def test_only_what_was_opened_meanwhile_and_is_bound_to_every_address_is_held() -> None:
    with contextlib.ExitStack() as left:
        earlier = left.enter_context(bound_to_all())

        def opens() -> tuple[socket.socket, socket.socket]:
            named = left.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            named.bind((OTHER, 0))
            left.enter_context(socket.socket(socket.AF_INET, socket.SOCK_STREAM)).bind(("", 0))
            os.close(os.open(os.devnull, os.O_RDONLY))
            return named, left.enter_context(bound_to_all())

        _, wild = opened_on("eth7", opens)  # a name: the address of the other socket counts
        sender = left.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        for line in (earlier, wild):
            sender.sendto(b"no", (LOOPBACK, line.getsockname()[1]))
            sender.sendto(b"yes", (OTHER, line.getsockname()[1]))
        assert earlier.recv(9) == b"no"
        assert wild.recv(9) == b"yes"


@given(address=st.ip_addresses(v=4), destination=st.ip_addresses(v=4) | st.sampled_from(["own"]))
def test_the_filter_passes_its_address_and_multicast(address: Any, destination: Any) -> None:
    to = address if destination == "own" else destination
    assert run(filter_of(address), int(to)) == (to == address or to.is_multicast)


@pytest.mark.parametrize(
    ("to", "passes"),
    [("223.255.255.255", False), ("224.0.0.0", True), ("239.255.255.255", True), ("240.0.0.0", False),
     ("127.0.0.0", False), ("127.0.0.1", True), ("255.255.255.255", False)],
)  # fmt: skip
def test_the_filters_bounds(to: str, passes: bool) -> None:
    assert run(filter_of(IPv4Address(LOOPBACK)), int(IPv4Address(to))) is passes


def run(program: tuple[tuple[int, int, int, int], ...], destination: int) -> bool:
    """Execute a filter as the kernel does (linux/filter.h)."""
    place = held = 0
    while True:
        operation, if_so, if_not, number = program[place]
        place += 1
        match operation:
            case 0x20:
                assert number == NET_OFFSET + DESTINATION
                held = destination
            case 0x15:
                place += if_so if held == number else if_not
            case 0x35:
                place += if_so if held >= number else if_not
            case 0x06:
                return number > 0
