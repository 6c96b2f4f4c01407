"""What a DDS node takes from the network: datagrams to its own address, by the kernel's tables and by whom it knows."""

import contextlib
import re
import socket
import struct
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

import pytest

from p2os.errors import TransportError
from p2os.ros.transport import NodeOptions, RosTransport
from p2os.ros.transports import open_transport
from p2os.transport import one_address
from tests.p2os.client.served_robot import until

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="filters of sockets are Linux's")

LOOPBACK, OTHER = "127.0.0.1", "127.0.0.2"
#: Little endian parameter list (DDSI-RTPS 2.5, 10.2); the participant writer of SPDP (9.3.1.5); ids of parameters.
PL_CDR_LE, SPDP_READER, SPDP_WRITER = b"\0\3\0\0", b"\0\1\0\xc7", b"\0\1\0\xc2"
VERSION, VENDOR, GUID, BUILTIN, LEASE, DEFAULT_UNICAST, META_UNICAST = 0x15, 0x16, 0x50, 0x58, 0x02, 0x31, 0x32


@dataclass(frozen=True)
class Row:
    """A socket of this process in /proc/net/udp."""

    address: str
    port: int
    drops: int


def own_sockets() -> list[Row]:
    own = set()
    for one in Path("/proc/self/fd").iterdir():
        with contextlib.suppress(OSError):
            own |= set(re.findall(r"socket:\[(\d+)\]", str(one.readlink())))
    rows = [line.split() for line in Path("/proc/net/udp").read_text().splitlines()[1:]]
    found = [(*row[1].split(":"), row[12]) for row in rows if row[9] in own]
    return [Row(socket.inet_ntoa(bytes.fromhex(at)[::-1]), int(port, 16), int(drops)) for at, port, drops in found]


def parameter(number: int, data: bytes) -> bytes:
    return struct.pack("<HH", number, len(data)) + data


def announcement(name: bytes) -> bytes:
    """Return the RTPS message by which a participant makes itself known; `name` is its GUID's first twelve bytes."""
    locator = struct.pack("<iI12x4s", 1, 7411, socket.inet_aton(LOOPBACK))
    parameters = b"".join((
        parameter(VERSION, b"\2\5\0\0"), parameter(VENDOR, b"\1\x0f\0\0"), parameter(GUID, name + b"\0\0\1\xc1"),
        parameter(BUILTIN, struct.pack("<I", 0xC3F)), parameter(LEASE, struct.pack("<iI", 100, 0)),
        parameter(DEFAULT_UNICAST, locator), parameter(META_UNICAST, locator), struct.pack("<HH", 1, 0),
    ))  # fmt: skip
    data = struct.pack("<HH", 0, 16) + SPDP_READER + SPDP_WRITER + struct.pack("<iI", 0, 1) + PL_CDR_LE + parameters
    return b"RTPS\2\5\1\x0f" + name + struct.pack("<BBH", 0x15, 0x05, len(data)) + data


@pytest.fixture
def node(domain: int, namespace: str) -> Iterator[RosTransport]:
    pytest.importorskip("cyclonedds", reason="the extra ros is not installed")
    with contextlib.closing(open_transport("dds", NodeOptions(domain=domain, namespace=namespace))) as opened:
        yield opened


def known(node: Any) -> Callable[[bytes], bool]:
    """Return what tells whether a participant is known to a node."""
    from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsParticipant

    reader = BuiltinDataReader(node._participant, BuiltinTopicDcpsParticipant)
    found: set[bytes] = set()

    def look(name: bytes) -> bool:
        found.update(sample.key.bytes[:12] for sample in reader.take(100))
        return name in found

    return look


def test_a_participant_is_found_at_the_nodes_own_address_and_at_no_other(node: RosTransport) -> None:
    random, is_known = Random(5), known(node)
    stranger, neighbour = b"\1\x0f" + random.randbytes(10), b"\1\x0f" + random.randbytes(10)
    ports = {row.port for row in own_sockets() if row.address == "0.0.0.0"}  # noqa: S104  # as the library binds
    assert len(ports) == 2, "what it discovers by, and what it takes data by"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
        for port in ports:
            line.sendto(announcement(stranger), (OTHER, port))
        for port in ports:
            line.sendto(announcement(neighbour), (LOOPBACK, port))
    until(lambda: is_known(neighbour), "the neighbour")
    assert not is_known(stranger)


def addresses() -> list[str]:
    """Return addresses of this machine that a node at 127.0.0.1 must not be reached at."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line, contextlib.suppress(OSError):
        line.connect(("192.0.2.1", 9))  # nothing is sent
        return [OTHER, line.getsockname()[0]]
    return [OTHER]


def test_the_kernel_drops_what_is_sent_to_another_address_of_this_machine(node: RosTransport) -> None:
    del node
    before = {row.port: row.drops for row in own_sockets() if row.address == "0.0.0.0"}  # noqa: S104
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
        for address in addresses():
            for port in before:
                line.sendto(b"RTPS" + bytes(16), (address, port))
    dropped = {row.port: row.drops - before[row.port] for row in own_sockets() if row.port in before}
    assert dropped == dict.fromkeys(before, len(addresses()))


def test_a_kernel_that_takes_no_filter_is_an_error_of_one_line(monkeypatch: pytest.MonkeyPatch, domain: int) -> None:
    pytest.importorskip("cyclonedds", reason="the extra ros is not installed")
    monkeypatch.setattr(one_address, "SO_ATTACH_FILTER", 9999)
    with pytest.raises(TransportError, match=r"no DDS on 127\.0\.0\.1 alone: Protocol not available"):
        open_transport("dds", NodeOptions(domain=domain + 101))
