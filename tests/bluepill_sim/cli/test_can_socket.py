"""A board's CAN on a bus of this machine: frames as datagrams both ways, hostile datagrams, closing; on loopback."""

import socket
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bluepill_sim.__main__ import run
from bluepill_sim.cli import can_socket
from bluepill_sim.cli.can_socket import (
    MOST_PEERS,
    MOST_WAITING,
    CanSocket,
    CanSocketError,
    candump_line,
    from_datagram,
    join_can,
    to_datagram,
)
from bluepill_sim.parts import CanFrame, CanNetwork, CanNode
from tests.bluepill_sim.machine import Machine

HELLO = CanFrame(identifier=0x123, data=b"hello")
DATAGRAM = struct.pack("=IB3x8s", 0x123, 5, b"hello")
#: A hundred frames' time: everything that waits has gone over.
LATER_NS = 100 * 300_000


@st.composite
def frames(draw: st.DrawFn) -> CanFrame:
    is_extended, is_remote = draw(st.booleans()), draw(st.booleans())
    return CanFrame(
        identifier=draw(st.integers(0, (1 << (29 if is_extended else 11)) - 1)),
        data=b"" if is_remote else draw(st.binary(max_size=8)),
        is_extended=is_extended,
        is_remote=is_remote,
        remote_bytes=draw(st.integers(0, 8)) if is_remote else 0,
    )


def peer_of(bus: CanSocket) -> socket.socket:
    """Another program, which has said that it is there."""
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.settimeout(5)
    made.connect(("127.0.0.1", bus.port))
    made.send(b"")
    return made


def end(network: CanNetwork) -> None:
    """Let all frames go over."""
    network.advance_to(network.now_ns + LATER_NS)


@pytest.fixture
def network() -> CanNetwork:
    return CanNetwork()


@pytest.fixture
def bus(network: CanNetwork) -> Iterator[CanSocket]:
    with CanSocket("udp:127.0.0.1:0", network) as made:
        yield made


@pytest.fixture
def node(network: CanNetwork) -> CanNode:
    made = CanNode()
    network.join(made)
    return made


@given(frames())
def test_a_frame_is_the_same_after_its_datagram(frame: CanFrame) -> None:
    assert from_datagram(to_datagram(frame)) == frame


@given(st.binary(max_size=32))
def test_any_bytes_are_a_frame_or_a_value_error(data: bytes) -> None:
    try:
        frame = from_datagram(data)
    except ValueError:
        return
    assert from_datagram(to_datagram(frame)) == frame


def test_the_datagram_is_that_of_socketcan() -> None:
    assert to_datagram(HELLO) == DATAGRAM
    remote = CanFrame(identifier=0x1ABCDEF0, is_extended=True, is_remote=True, remote_bytes=8)
    assert to_datagram(remote) == struct.pack("=IB3x8s", 0xDABCDEF0, 8, b"")


@pytest.mark.parametrize(
    "data",
    [
        DATAGRAM[:-1],
        DATAGRAM + b"\0",
        b"\0",
        struct.pack("=IB3x8s", 0x123, 9, b""),
        struct.pack("=IB3x8s", 0x800, 0, b""),
        struct.pack("=IB3x8s", 0x123 | 1 << 29, 8, b""),
        struct.pack("=IB3x8s", 0x123 | 1 << 30, 9, b""),
        bytes(65_000),
    ],
)
def test_a_datagram_that_is_no_frame_is_counted_and_nothing_else(
    bus: CanSocket, network: CanNetwork, node: CanNode, data: bytes
) -> None:
    with peer_of(bus) as peer, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        bus.carry()
        stranger.sendto(data, ("127.0.0.1", bus.port))
        stranger.settimeout(0.01)
        peer.send(DATAGRAM)
        bus.carry()
        end(network)
        assert (bus.refused, bus.received, [frame for _, frame in node.received]) == (1, 1, [HELLO])
        node.send(HELLO)
        end(network)
        assert peer.recv(99) == DATAGRAM
        with pytest.raises(TimeoutError):  # it has not become one of the programs that are sent to
            stranger.recv(99)


def test_frames_go_out_and_come_in_with_their_times(network: CanNetwork, node: CanNode) -> None:
    reported: list[tuple[int, bool, CanFrame]] = []
    answer = CanFrame(identifier=0x7, data=b"\x01")
    with CanSocket("udp:127.0.0.1:0", network, lambda *row: reported.append(row)) as bus, peer_of(bus) as peer:
        bus.carry()
        node.send(HELLO, at_ns=1000)
        end(network)
        assert peer.recv(99) == DATAGRAM
        peer.send(to_datagram(answer))
        bus.carry()
        end(network)
        ends = [at_ns for at_ns, _, _ in reported]
        assert [row[1:] for row in reported] == [(True, HELLO), (False, answer)]
        assert node.received == [(ends[1], answer)]
        assert 1000 + 44 * 2000 < ends[0] < ends[1]
        assert (bus.sent, bus.received) == (1, 1)
        assert bus.describe().endswith("1 frames out, 1 in")


@pytest.mark.parametrize("kind", ["udp", "unix"])
def test_three_programs_on_one_address_hear_each_other(kind: str, tmp_path: Path) -> None:
    networks, nodes = [CanNetwork() for _ in range(3)], [CanNode() for _ in range(3)]
    for network, node in zip(networks, nodes, strict=True):
        network.join(node)
    where = f"unix:{tmp_path / 'can'}" if kind == "unix" else "udp:127.0.0.1:0"
    with CanSocket(where, networks[0]) as first:
        where = where if kind == "unix" else f"udp:127.0.0.1:{first.port}"
        with CanSocket(where, networks[1]) as second, CanSocket(where, networks[2]) as third:
            first.carry()
            for number, network in enumerate(networks):
                nodes[number].send(CanFrame(identifier=number))
                end(network)
                for bus, one in zip((first, second, third), networks, strict=True):
                    bus.carry()
                    end(one)
            second.carry()
            end(networks[1])
            assert [bus.dropped + bus.refused for bus in (first, second, third)] == [0, 0, 0]
    heard = [sorted(frame.identifier for _, frame in node.received) for node in nodes]
    assert heard == [[1, 2], [0, 2], [0, 1]]
    assert not (tmp_path / "can").exists()


def test_more_frames_than_can_wait_are_dropped_and_counted(bus: CanSocket, network: CanNetwork, node: CanNode) -> None:
    with peer_of(bus) as peer:
        for _ in range(MOST_WAITING // 128 + 1):
            for _ in range(128):
                peer.send(DATAGRAM)
            bus.carry()
        assert (bus.node.waiting, bus.dropped) == (MOST_WAITING, 128)
        network.advance_to(network.now_ns + (MOST_WAITING + 1) * 300_000)
        assert len(node.received) == MOST_WAITING


def test_of_too_many_programs_the_longest_silent_is_left_out(
    bus: CanSocket, network: CanNetwork, node: CanNode
) -> None:
    peers = [peer_of(bus) for _ in range(MOST_PEERS)]
    peers[0].send(b"")
    bus.carry()
    peers.append(peer_of(bus))
    bus.carry()
    node.send(HELLO)
    end(network)
    for number, peer in enumerate(peers):
        peer.settimeout(0.01 if number == 1 else 5)
        if number == 1:
            with pytest.raises(TimeoutError):
                peer.recv(99)
        else:
            assert peer.recv(99) == DATAGRAM
        peer.close()


def test_after_closing_the_bus_goes_on_and_nothing_goes_out(network: CanNetwork, node: CanNode) -> None:
    bus = CanSocket("udp:127.0.0.1:0", network)
    with peer_of(bus):
        bus.carry()
        bus.close()
        bus.close()
        node.send(HELLO)
        end(network)
        bus.carry()
    assert (bus.sent, bus.dropped, node.waiting, node.errors) == (0, 0, 0, 0)


def test_who_has_the_address_may_end_before_the_others(network: CanNetwork, node: CanNode) -> None:
    with CanSocket("udp:127.0.0.1:0", CanNetwork()) as first:
        second = CanSocket(f"udp:127.0.0.1:{first.port}", network)
    with second:
        for _ in range(2):
            node.send(HELLO)
            end(network)
            second.carry()
        assert second.sent + second.dropped == 2
        assert node.waiting == 0


@pytest.mark.parametrize(
    ("where", "words"),
    [
        ("udp:0.0.0.0:1", "reaches beyond this machine"),
        ("udp:192.0.2.1:29536", "reaches beyond this machine"),
        ("udp:127.0.0.1:65536", "is no address"),
        ("udp:example:1", "is no address"),
        ("udp:", "is no address"),
        ("tcp:127.0.0.1:1", "no such bus"),
        ("unix:", "no such bus"),
        ("unix:/nowhere/at/all", "cannot join unix:/nowhere/at/all: No such file or directory"),
        ("unix:" + 200 * "x", "cannot join"),
        ("no-such-can", "cannot join the CAN interface 'no-such-can'"),
        ("", "cannot join the CAN interface ''"),
        (40 * "x", "cannot join the CAN interface"),
    ],
)
def test_a_bus_that_cannot_be_joined_is_one_line_with_a_hint(network: CanNetwork, where: str, words: str) -> None:
    with pytest.raises(CanSocketError, match=words) as caught:
        CanSocket(where, network)
    assert caught.value.hint
    assert caught.value.exit_code == 2


def test_without_socketcan_it_says_what_else_there_is(network: CanNetwork, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(can_socket, "socket", SimpleNamespace(socket=socket.socket))
    with pytest.raises(CanSocketError, match="this system has no SocketCAN") as caught:
        CanSocket("vcan0", network)
    assert "udp:" in str(caught.value.hint)


def test_beyond_this_machine_only_where_it_is_asked_for(network: CanNetwork) -> None:
    with CanSocket("udp-open:0.0.0.0:0", network) as bus:
        assert bus.port


def test_a_path_left_by_a_program_that_died_is_told(network: CanNetwork, tmp_path: Path) -> None:
    path = tmp_path / "can"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as left:
        left.bind(str(path))
    with pytest.raises(CanSocketError, match="nobody has it any more") as caught:
        CanSocket(f"unix:{path}", network)
    assert "rm " in str(caught.value.hint)
    assert path.exists()


def test_a_port_that_nobody_has_any_more_is_no_file_to_remove() -> None:
    """Linux reports the refusal of a datagram at the next call: here at the first one that sends."""

    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def refused(_data: bytes) -> int:
        raise ConnectionRefusedError

    class Refused:
        connect = made.connect
        send = staticmethod(refused)

    with made, pytest.raises(CanSocketError, match=r"^cannot join 127\.0\.0\.1:5: nobody has it any more") as caught:
        CanSocket._join(Refused(), ("127.0.0.1", 5))  # type: ignore[arg-type]  # what is called of a socket
    assert caught.value.hint == "try again, or take another port"


def test_a_log_has_the_lines_of_candump() -> None:
    extended = CanFrame(identifier=0x12, data=b"\x01\xab", is_extended=True)
    remote = CanFrame(identifier=0x7FF, is_remote=True, remote_bytes=4)
    assert candump_line(1_234_567_999, extended, "vcan0", is_sent=True) == ("(0000000001.234567) vcan0 00000012#01AB T")
    assert candump_line(999, remote, "can0", is_sent=False) == "(0000000000.000000) can0 7FF#R4 R"


def test_the_verb_answers_programs_of_this_machine_and_logs(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, watchdog: None
) -> None:
    """The board does not use its CAN: the node of the talker, on the same network, is what answers."""
    ((_, program),) = Machine("loop: b loop\n", {}).image.segments
    firmware, log, path = tmp_path / "loop.bin", tmp_path / "log", tmp_path / "bus"
    firmware.write_bytes(program)
    real: Callable[..., list[CanSocket]] = join_can
    heard: list[bytes] = []

    def joined(*words: object) -> list[CanSocket]:
        made = real(*words)
        far = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        far.bind(str(tmp_path / "far"))
        far.settimeout(5)
        far.sendto(DATAGRAM, str(path))
        made[0].on_close.callback(lambda: (heard.append(far.recv(99)), far.close()))
        return made

    monkeypatch.setattr("bluepill_sim.cli.run.join_can", joined)
    words = ["--for", "10ms", "--attach", "can-node,on=CAN,period_ms=0", "--can", f"unix:{path}", "--can-log", str(log)]
    assert run(["run", str(firmware), *words]) == 0
    assert heard == [to_datagram(CanFrame(identifier=0x124, data=b"hello"))]
    assert f"can: unix:{path}: 1 frames out, 1 in" in capfd.readouterr().err
    assert [line.split()[1:] for line in log.read_text().splitlines()] == [
        ["can0", "123#68656C6C6F", "R"],
        ["can0", "124#68656C6C6F", "T"],
    ]


def test_a_log_without_a_bus_is_refused(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    firmware = tmp_path / "loop.bin"
    ((_, program),) = Machine("loop: b loop\n", {}).image.segments
    firmware.write_bytes(program)
    assert run(["run", str(firmware), "--can-log", str(tmp_path / "log")]) == 2
    assert "--can-log without --can" in capfd.readouterr().err
