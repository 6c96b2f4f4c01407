"""The Wireshark dissector: its tables are ours, and tshark shows what we show."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from p2os.capture import Direction, capture_of, frame_chunks, read_file, write_pcap
from p2os.capture.dissector import install, script
from p2os.cli.main import run
from p2os.protocol.commands import CommandNumber
from p2os.protocol.packets import PACKET_NAMES, SonarReading, StandardSip, packet_frame
from p2os.protocol.profiles import Profile
from simbase.errors import FileError
from tests.p2os.capture.network_files import network_file, segment

GOLDEN = Path(__file__).resolve().parents[2] / "golden" / "captures" / "aria_p2de.jsonl"
TSHARK = shutil.which("tshark")
needs_tshark = pytest.mark.skipif(
    TSHARK is None, reason="tshark is not installed: the Wireshark dissector is NOT tested"
)


def shown(capture: Path, *fields: str) -> list[list[str]]:
    """Return what tshark reads out of a capture with the dissector."""
    asked = [word for field in fields for word in ("-e", field)]
    lua = capture.with_suffix(".lua")
    lua.write_text(script(), encoding="utf-8")
    done = subprocess.run(
        [str(TSHARK), "-n", "-X", f"lua_script:{lua}", "-r", str(capture), "-T", "fields", *asked],
        capture_output=True, text=True, timeout=60, check=True,
    )  # fmt: skip
    assert "Lua" not in done.stderr
    return [line.split("\t") for line in done.stdout.splitlines()]


def lua_table(name: str) -> dict[int, str]:
    body = re.search(rf"local {name} = {{(.*?)\n}}", script(), re.DOTALL)
    assert body is not None
    return {int(number, 0): word for number, word in re.findall(r'\[(\w+)\] = "([^"]+)"', body[1])}


def test_the_dissector_knows_the_same_names() -> None:
    assert lua_table("commands") == {int(number): number.name for number in CommandNumber}
    assert lua_table("packets") == dict(PACKET_NAMES)


@needs_tshark
def test_tshark_shows_a_capture_of_ours(tmp_path: Path) -> None:
    capture = read_file(GOLDEN)
    pieces = list(frame_chunks(capture.chunks))
    last = [(chunk.at_ns, chunk.direction, chunk.data) for chunk in pieces[-1:]]
    broken = capture_of([*last, (last[0][0] + 5, Direction.TO_ROBOT, bytes.fromhex("fafb060b3bc800d300"))])
    pieces += list(frame_chunks(broken.chunks[1:]))
    path = tmp_path / "talk.pcap"
    path.write_bytes(write_pcap(pieces, base_ns=1_700_000_000_000_000_000))
    rows = shown(path, "p2os.direction", "p2os.command", "p2os.packet", "p2os.argument", "p2os.sip.x", "p2os.bad")
    assert len(rows) == len(pieces)
    for row, piece in zip(rows[:-1], pieces, strict=False):
        direction, command, packet, _, x, bad = row
        kind, to_robot = piece.data[3], piece.direction is Direction.TO_ROBOT
        assert (direction, bad) in {("0" if to_robot else "1", word) for word in ("0", "False")}
        assert (command, packet) == ((str(kind), "") if to_robot else ("", f"0x{kind:02x}"))
        if kind == 0x32 and not to_robot:
            assert int(x) == int.from_bytes(piece.data[4:6], "little")
    assert rows[-1][5] in {"1", "True"}
    assert [row[3] for row in rows if row[1] == "5"] == ["300", "-300"]


def conversation(path: Path, sent: list[tuple[int, int, bytes]]) -> Path:
    """Write TCP segments of (source port, target port, bytes), cut at 50 bytes; return the path."""
    packets, sequences = [], {(source, target): 1 for source, target, _ in sent}
    for source, target, stream in sent:
        for start in range(0, len(stream), 50):
            data = stream[start : start + 50]
            packets.append(segment(source, target, sequences[source, target], data))
            sequences[source, target] += len(data)
    path.write_bytes(network_file(packets, 101, b""))
    return path


@needs_tshark
def test_tshark_finds_frames_on_any_port_and_the_robot_is_who_answers(tmp_path: Path) -> None:
    pieces = frame_chunks(read_file(GOLDEN).chunks)
    chunks = [(chunk.direction, chunk.data) for chunk in pieces][:12]
    sent: list[tuple[int, int, bytes]] = []
    conversations = ((8101, 41000), (40000, 8101), (45555, 45001))  # robot and client, one behind the other
    for robot, client in conversations:
        ends = {Direction.TO_ROBOT: (client, robot), Direction.FROM_ROBOT: (robot, client)}
        sent += [(*ends[direction], data) for direction, data in chunks if direction]
    rows = shown(
        conversation(tmp_path / "tcp.pcap", sent),
        "p2os.packet", "p2os.command", "_ws.col.Protocol", "tcp.srcport", "tcp.dstport",
    )  # fmt: skip
    for ports in conversations:
        ours = [row for row in rows if {row[3], row[4]} == set(map(str, ports))]
        kinds = [kind for row in ours for kind in row[0].split(",") if kind]
        assert kinds == [f"0x{data[3]:02x}" for direction, data in chunks if direction is Direction.FROM_ROBOT], ports
        commands = [kind for row in ours for kind in row[1].split(",") if kind]
        assert commands == [str(data[3]) for direction, data in chunks if direction is Direction.TO_ROBOT], ports
    assert {row[2] for row in rows} <= {"P2OS", "TCP"}


@needs_tshark
def test_tshark_shows_every_field_of_a_sip_and_its_tail(tmp_path: Path) -> None:
    sip = StandardSip(
        raw_x=0x8123, raw_y=40000, raw_heading=-5, raw_left_velocity=-120, raw_right_velocity=340, raw_battery=121,
        stall_left=True, rear_bumpers=5, front_bumpers=9, raw_control=-7, raw_flags=513, raw_compass=90,
        sonar=(SonarReading(3, 700),), analog_port=4, gripper_state=6, raw_analog=77, digital_in=12, digital_out=13,
        tail=(126, -1, -300, 2, 0, -128, 80, 123456, 9),
    )  # fmt: skip
    path = conversation(tmp_path / "sip.pcap", [(45555, 45001, packet_frame(sip, Profile.P2OS).to_bytes())])
    names = ("x", "y", "heading", "left", "right", "battery", "stall_left", "stall_right", "flags", "gripper",
             "digital_in", "digital_out", "sonar", "flags3", "fault_flags", "lateral_velocity", "rear_bumpers",
             "front_bumpers", "control", "compass", "analog_port", "analog", "battery_x10",
             "charge_state", "rotation_velocity", "temperature", "state_of_charge", "controller_time_us")  # fmt: skip
    row = shown(path, *(f"p2os.sip.{name}" for name in names))[-1]
    assert row.pop(12) == "3: 700"
    truth = {"True": 1, "False": 0}
    assert [truth[cell] if cell in truth else int(cell, 0) for cell in row] == [
        0x8123, 40000, -5, -120, 340, 121, 1, 0, 513, 6, 12, 13, 9, 2, 0, 5, 9, -7, 90, 4, 77, 126, -1, -300, -128, 80,
        123456,
    ]  # fmt: skip


def test_the_dissector_is_put_where_wireshark_looks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    assert run(["sniff", "--install-dissector"]) == 0
    target = tmp_path / ".local/lib/wireshark/plugins/p2os.lua"
    assert capsys.readouterr().out == f"installed {target}\n"
    assert target.read_text(encoding="utf-8") == script()
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match="cannot write"):
        install(tmp_path / "file")
