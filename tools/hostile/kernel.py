"""What the kernel says of a process and its children: sockets, memory."""

import contextlib
import ctypes
import os
import socket
from dataclasses import dataclass
from ipaddress import ip_address
from pathlib import Path

PROC = Path("/proc")
#: State of a TCP socket that waits for connections (include/net/tcp_states.h), and of a UDP socket with no peer.
LISTENING, UNCONNECTED = 0x0A, 0x07
#: System calls of x86-64, aarch64 and most others (asm-generic/unistd.h) that Python has no name for.
PIDFD_GETFD = 438
SO_GET_FILTER = 26
TABLES = {"tcp": LISTENING, "tcp6": LISTENING, "udp": UNCONNECTED, "udp6": UNCONNECTED}


@dataclass(frozen=True)
class OpenSocket:
    """A socket on which a process takes what comes from anyone."""

    protocol: str
    host: str
    port: int
    inode: int

    @property
    def is_tcp(self) -> bool:
        """Whether it takes connections."""
        return self.protocol.startswith("tcp")

    def __str__(self) -> str:
        return f"{self.protocol} {self.host}:{self.port}"


def _family(pid: int) -> list[int]:
    """Return a process and all that descend from it."""
    found = [pid]
    for each in found:
        with contextlib.suppress(OSError):  # it may end while its folder is read
            for task in PROC.glob(f"{each}/task/*/children"):
                with contextlib.suppress(OSError):
                    found += map(int, task.read_text().split())
    return found


def _host(text: str) -> str:
    """Return an address of /proc/net, words of it in the machine's order."""
    words = bytes.fromhex(text)
    return str(ip_address(b"".join(words[at : at + 4][::-1] for at in range(0, len(words), 4))))


def _inodes(pid: int) -> dict[int, int]:
    """Return the inodes of a process's sockets, each with its descriptor."""
    found = {}
    for link in PROC.glob(f"{pid}/fd/*"):
        with contextlib.suppress(OSError):
            target = str(link.readlink())
            if target.startswith("socket:["):
                found[int(target[8:-1])] = int(link.name)
    return found


def sockets_of(pid: int) -> list[OpenSocket]:
    """Return the sockets on which a process or its children take what comes, as the kernel lists them."""
    inodes = {inode for each in _family(pid) for inode in _inodes(each)}
    found = []
    for name, state in TABLES.items():
        for line in (PROC / str(pid) / "net" / name).read_text().splitlines()[1:]:
            words = line.split()
            host, _, port = words[1].partition(":")
            if int(words[3], 16) == state and int(words[9]) in inodes:
                found.append(OpenSocket(name, _host(host), int(port, 16), int(words[9])))
    return found


def has_filter(pid: int, inode: int) -> bool:
    """Tell whether the kernel runs a filter over what comes to a process's socket.

    It is asked of a copy of the descriptor, which needs the right to trace the process (as its parent has).
    """
    libc = ctypes.CDLL(None, use_errno=True)
    for each in _family(pid):
        descriptor = _inodes(each).get(inode)
        if descriptor is None:
            continue
        handle = os.pidfd_open(each)
        try:
            copy = libc.syscall(PIDFD_GETFD, handle, descriptor, 0)
        finally:
            os.close(handle)
        if copy < 0:
            raise OSError(ctypes.get_errno(), "pidfd_getfd")
        with socket.socket(fileno=copy) as own:
            instructions = ctypes.create_string_buffer(8 * 4096)
            length = ctypes.c_uint(4096)
            if libc.getsockopt(own.fileno(), socket.SOL_SOCKET, SO_GET_FILTER, instructions, ctypes.byref(length)):
                raise OSError(ctypes.get_errno(), "SO_GET_FILTER")
            return length.value > 0
    return False


def off_loopback(pid: int) -> list[OpenSocket]:
    """Return the sockets that take what comes from other machines: not bound to loopback, and without a filter."""
    return [each for each in sockets_of(pid) if not ip_address(each.host).is_loopback and not _is_filtered(pid, each)]


def _is_filtered(pid: int, taken: OpenSocket) -> bool:
    return not taken.is_tcp and has_filter(pid, taken.inode)


def memory_kb(pid: int) -> int:
    """Return what a process and its children have in memory, kB; what has gone has nothing."""
    total = 0
    for each in _family(pid):
        with contextlib.suppress(OSError):
            total += int((PROC / str(each) / "statm").read_text().split()[1]) * os.sysconf("SC_PAGESIZE") // 1024
    return total
