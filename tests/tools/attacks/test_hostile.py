"""The judge of what a hostile neighbour may do: its P2OS, the kernel's tables, each fault that it has to name."""

import contextlib
import os
import random
import socket
import sys
from collections.abc import Iterator
from ipaddress import IPv4Address
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2os.protocol.commands import Command, CommandNumber
from p2os.protocol.frames import sound_frames
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import StandardSip
from p2os.transport.one_address import hold
from tools.hostile import kernel, packets
from tools.hostile.attacks import ATTACKS
from tools.hostile.judgement import AttackOutcome, outcomes
from tools.hostile.robots import ROBOTS, faults_of

ANY = "0.0.0.0"  # noqa: S104 - that it is seen is what is tested
OWN = str(Path(sys.executable).with_name("p2os"))
#: Attacks that need no time of their own.
QUICK_S = 0.3


@given(st.sampled_from(CommandNumber), st.one_of(st.none(), st.integers(-32767, 32767)))
def test_its_packets_are_those_of_the_protocol(number: CommandNumber, argument: int | None) -> None:
    found = packets.command(number, argument)
    assert [*sound_frames(found)] == [*packets.OutsidersReader().take(found)]
    with contextlib.suppress(ValueError):  # a command of ours that takes another kind of argument
        assert found == Command(number, argument).to_frame().to_bytes()


@given(st.lists(st.binary(min_size=1, max_size=60), max_size=6), st.binary(max_size=8), st.integers(1, 9))
def test_packets_are_found_however_they_come(payloads: list[bytes], noise: bytes, size: int) -> None:
    stream = noise.replace(b"\xfa", b"") + b"".join(map(packets.packet, payloads))
    reader = packets.OutsidersReader()
    assert [one for at in range(0, len(stream), size) for one in reader.take(stream[at : at + size])] == payloads


@given(st.integers(-2000, 2000), st.integers(-2000, 2000))
def test_what_a_robot_says_of_its_wheels_is_read(left: int, right: int) -> None:
    payload = StandardSip(raw_left_velocity=left, raw_right_velocity=right).to_frame(Profile.P2OS).payload
    motion = packets.motion_of(payload)
    assert motion is not None
    assert (motion.left_mmps, motion.right_mmps, motion.turns) == (left, right, (left, right) != (0, 0))


@pytest.mark.parametrize(
    ("number", "argument", "moving"),
    [(11, 1, True), (11, 0, False), (11, -1, True), (29, None, False), (4, 1, False), (0, None, False)],
)
def test_a_command_to_move_is_one_with_an_argument_that_is_not_zero(
    number: int, argument: int | None, moving: bool
) -> None:
    (payload,) = packets.OutsidersReader().take(packets.command(number, argument))
    assert packets.moves(payload) is moving


@pytest.mark.parametrize(("host", "is_off"), [("127.0.0.1", False), ("127.0.0.2", False), (ANY, True)])
@pytest.mark.parametrize("kind", [socket.SOCK_STREAM, socket.SOCK_DGRAM])
def test_a_socket_that_others_reach_is_seen_in_the_kernels_tables(host: str, is_off: bool, kind: int) -> None:
    with socket.socket(socket.AF_INET, kind) as own:
        own.bind((host, 0))
        if kind == socket.SOCK_STREAM:
            own.listen()
        port = own.getsockname()[1]
        assert port in {each.port for each in kernel.sockets_of(os.getpid())}
        assert (port in {each.port for each in kernel.off_loopback(os.getpid())}) is is_off


def test_a_process_may_end_while_its_family_is_looked_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Going(type(tmp_path)):  # type: ignore[misc]  # what a path is here
        def glob(self, pattern: str) -> Iterator[Path]:
            if pattern.startswith("8/"):
                raise FileNotFoundError(2, "No such file or directory", f"/proc/{pattern}")
            yield from super().glob(pattern)

    page_kb = os.sysconf("SC_PAGESIZE") // 1024
    for pid, children in ((7, "8 9"), (8, ""), (9, "")):
        (tmp_path / f"{pid}/task/{pid}").mkdir(parents=True)
        (tmp_path / f"{pid}/task/{pid}/children").write_text(children)
        (tmp_path / f"{pid}/statm").write_text(f"{pid} {10 * pid} 0")
    (tmp_path / "8/statm").unlink()
    monkeypatch.setattr(kernel, "PROC", Going(tmp_path))
    assert kernel.memory_kb(7) == (70 + 90) * page_kb


def test_a_socket_whose_datagrams_the_kernel_drops_is_not_reached() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own:
        own.bind((ANY, 0))
        hold(own, IPv4Address("127.0.0.1"))
        assert own.getsockname()[1] not in {each.port for each in kernel.off_loopback(os.getpid())}


@pytest.fixture
def obeying(tmp_path: Path) -> str:
    program = tmp_path / "p2os"
    server = Path(__file__).with_name("obeying_server.py")
    program.write_text(f'#!/bin/sh\nexec {sys.executable} {server} "$@"\n')
    program.chmod(0o755)
    return str(program)


def faults(p2os: str, target: str, attack: str) -> list[AttackOutcome]:
    return [each for each in outcomes(p2os, [target], [attack], lasts_s=QUICK_S, seed=0) if each.phase == "free"]


@pytest.mark.parametrize(
    ("style", "attack", "named"),
    [
        ("obeys", "post", "wheels at 0.300 0.300 m/s"),
        ("everywhere", "garbage", "is reached from other machines"),
        ("keeps", "garbage", "its memory grew by"),
        ("fails", "garbage", "it printed 'Traceback'"),
        ("deaf", "close", "gets no session"),
    ],
)
def test_what_a_served_robot_does_wrong_is_named(
    obeying: str, monkeypatch: pytest.MonkeyPatch, style: str, attack: str, named: str
) -> None:
    monkeypatch.setenv("OBEYING", style)
    monkeypatch.setattr("tools.hostile.watched.LIMIT_S", 1.0)
    (outcome,) = faults(obeying, "serve", attack)
    assert any(named in each for each in outcome.faults), outcome.faults


@pytest.mark.slow
@pytest.mark.parametrize(("target", "attack"), [("serve", "post"), ("sniff", "flood"), ("mcu-debug", "post")])
def test_verbs_hold(target: str, attack: str) -> None:
    found = [*outcomes(OWN, [target], [attack], lasts_s=QUICK_S, seed=0)]
    assert found
    assert [each for each in found if each.faults or each.skipped] == []


@pytest.mark.slow
def test_a_verb_whose_robot_is_cut_off_says_so() -> None:
    assert [*faults_of(OWN, "info", "cut", random.Random(1))] == []


@pytest.mark.soak
@pytest.mark.parametrize("target", ["fleet", "ros-zenoh", "ros-dds", "run-gdb", "run-foxglove", "mcu-can"])
def test_all_verbs_hold(target: str) -> None:
    found = [*outcomes(OWN, [target], [*ATTACKS], lasts_s=1.0, seed=0)]
    assert [each for each in found if each.faults] == []
    assert [each for each in found if not each.skipped], "nothing was tried"


@pytest.mark.soak
@pytest.mark.parametrize("verb", ["info", "monitor", "drive", "ros"])
def test_verbs_whose_robot_is_hostile_end_as_they_should(verb: str) -> None:
    assert [*outcomes(OWN, [verb], [*ROBOTS], lasts_s=1.0, seed=0)]
