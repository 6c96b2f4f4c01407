"""Holds the datagram sockets of a library to one address, where the library binds them to every one.

Cyclone DDS 11.0 binds what it receives by to 0.0.0.0, whichever network it is told to use (ddsi_udp.c, `RECV_UC` and
`RECV_MC`), and no setting changes that. What is sent to any address of this machine would reach it.

Theory of operation. A socket that is open already may be given a filter, by any user: for each datagram the kernel
runs a program of a few instructions on it, before it queues it. This one lets through what was sent to the address, as
for a socket that is bound to it, or to a multicast group; of groups the kernel gives those that the socket joined
itself, on the network where it joined them (IP_MULTICAST_ALL is off). The rest is counted as dropped (/proc/net/udp).

A datagram that comes between the socket's first moment and its filter, some milliseconds, gets through. Who opens the
library so has no reader then: nothing is taken, and whoever was heard in that time is heard no more.

Linux only: elsewhere nothing is done.

Source: linux/filter.h, packet(7), ip(7).
"""

import contextlib
import ctypes
import os
import socket
import stat
import struct
import sys
from collections.abc import Callable
from ipaddress import IPv4Address
from typing import TypeVar

ANY = IPv4Address(0)
FDS = "/proc/self/fd"
#: asm-generic/socket.h and linux/in.h; Python's `socket` has no names for them.
SO_ATTACH_FILTER, IP_MULTICAST_ALL = 26, 49
#: Where the network's header begins, seen from a program on a datagram; the destination in it (RFC 791).
NET_OFFSET, DESTINATION = 0xFFF0_0000, 16
MULTICAST_FIRST, MULTICAST_END = 0xE000_0000, 0xF000_0000
LOAD_WORD, JUMP_EQUAL, JUMP_AT_LEAST, RETURN = 0x20, 0x15, 0x35, 0x06
_INSTRUCTION = struct.Struct("=HBBI")

Opened = TypeVar("Opened")


def opened_on(address: str, opens: Callable[[], Opened]) -> Opened:
    """Open something; what UDP sockets it has opened meanwhile take only what is sent to one address of theirs.

    Args:
        address: An IPv4 address of this machine; anything else: the address that the others of these sockets have.
        opens: Opens them; no other thread may open UDP sockets meanwhile.

    Raises:
        OSError: The kernel takes no filter.
    """
    before = _sockets()
    made = opens()
    with contextlib.ExitStack() as left:
        opened = [number for inode, number in _sockets().items() if inode not in before]
        new = [left.enter_context(one) for one in map(_udp_socket, opened) if one is not None]
        bound = [(one, IPv4Address(one.getsockname()[0])) for one in new]
        own = _own(address, [at for _, at in bound if at != ANY])
        for one, at in bound:
            if at == ANY and own is not None:
                hold(one, own)
    return made


def hold(line: socket.socket, address: IPv4Address) -> None:
    """Let a UDP socket that is bound to every address take what is sent to one, and to the groups that it has joined.

    Raises:
        OSError: The kernel takes no filter.
    """
    program = b"".join(_INSTRUCTION.pack(*row) for row in filter_of(address))
    held = ctypes.create_string_buffer(program, len(program))
    # struct sock_fprog: a count, and a pointer after the padding that it wants.
    line.setsockopt(
        socket.SOL_SOCKET, SO_ATTACH_FILTER,
        struct.pack("@HP", len(program) // _INSTRUCTION.size, ctypes.addressof(held)),
    )  # fmt: skip
    line.setsockopt(socket.IPPROTO_IP, IP_MULTICAST_ALL, 0)


def filter_of(address: IPv4Address) -> tuple[tuple[int, int, int, int], ...]:
    """Return the program: operation, how many instructions to skip if so and if not, and its number."""
    return (
        (LOAD_WORD, 0, 0, NET_OFFSET + DESTINATION),
        (JUMP_EQUAL, 3, 0, int(address)),
        (JUMP_AT_LEAST, 0, 1, MULTICAST_FIRST),
        (JUMP_AT_LEAST, 0, 1, MULTICAST_END),
        (RETURN, 0, 0, 0),
        (RETURN, 0, 0, 0xFFFF_FFFF),
    )


def _own(address: str, others: list[IPv4Address]) -> IPv4Address | None:
    try:
        return IPv4Address(address)
    except ValueError:  # the name of a network
        return others[0] if others else None


def _sockets() -> dict[int, int]:
    """Return this process's sockets: the kernel's number of each, and a descriptor."""
    found: dict[int, int] = {}
    if sys.platform == "linux":
        for name in os.listdir(FDS):  # noqa: PTH208 - texts are all that is wanted
            with contextlib.suppress(OSError):  # the listing's own is closed
                status = os.fstat(int(name))
                if stat.S_ISSOCK(status.st_mode):
                    found[status.st_ino] = int(name)
    return found


def _udp_socket(descriptor: int) -> socket.socket | None:
    """Return a second descriptor of a socket that is one of UDP over IPv4, else None."""
    line = socket.socket(fileno=os.dup(descriptor))
    if (line.family, line.type) == (socket.AF_INET, socket.SOCK_DGRAM):
        return line
    line.close()
    return None
