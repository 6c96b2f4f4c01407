"""Rows, names, fields and explanations of captured bytes, sound and damaged."""

import itertools
import json
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from p2os.capture import (
    Capture,
    Direction,
    FollowedReading,
    ListingRow,
    Reading,
    capture_of,
    explain,
    frame_chunks,
    read_file,
    rows_of,
)
from p2os.capture.describe import plain
from p2os.capture.explain import lines_of
from p2os.capture.listing import guess_direction, line_of, summary_of
from p2os.protocol.commands import Command, CommandNumber
from p2os.protocol.frames import Frame
from p2os.protocol.packets import Identity, RawPacket
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import StandardSip
from p2os.robots.parameters import load_parameters
from simbase.timing import NS_PER_MS, NS_PER_S

GOLDEN = Path(__file__).resolve().parents[2] / "golden"
VECTORS = json.loads((GOLDEN / "p2os_vectors.json").read_text())
TO, FROM = Direction.TO_ROBOT, Direction.FROM_ROBOT
P2OS = Reading(profile=Profile.P2OS, parameters=load_parameters("p2dx"))
ARCOS = Reading(profile=Profile.ARCOS, parameters=load_parameters("p3dx"))
VEL = bytes.fromhex("fafb060b3bc800d33b")
STOP = bytes.fromhex("fafb031d001d")


def said(*data: bytes, direction: Direction | None = TO) -> Capture:
    return capture_of([(place * NS_PER_MS, direction, item) for place, item in enumerate(data)])


def rows(capture: Capture, reading: Reading = P2OS) -> list[ListingRow]:
    return list(rows_of(capture, reading))


def assert_partition(row: ListingRow, reading: Reading) -> None:
    parts = explain(row, reading)
    assert b"".join(part.data for part in parts) == row.data
    assert [part.offset for part in parts] == [
        sum(len(part.data) for part in parts[:place]) for place in range(len(parts))
    ]
    assert lines_of(parts)


@pytest.mark.parametrize("reading", [P2OS, ARCOS], ids=["P2OS", "ARCOS"])
def test_every_vector_is_listed_and_explained_to_the_last_byte(reading: Reading) -> None:
    for vector, direction in itertools.product(VECTORS, (TO, FROM, None)):
        data = bytes.fromhex(str(vector["hex"]))
        found = rows(said(data, direction=direction), reading)
        if vector["valid"]:
            (row,) = found
            assert row.valid
            assert row.data == data
            if direction is None:
                assert row.direction in {None, TO if "command" in vector["decoded"] else FROM}  # type: ignore[operator]
        for row in found:
            assert_partition(row, reading)
            json.dumps(row.as_plain())
            assert line_of(row)


@pytest.mark.parametrize("name", ["aria_p2de", "player_p2de"])
def test_captured_sessions_are_listed_without_a_damaged_frame(name: str) -> None:
    capture = read_file(GOLDEN / "captures" / f"{name}.jsonl")
    found = rows(capture, ARCOS)
    assert all(row.valid for row in found)
    assert [row.name for row in found[:6]] == ["SYNC0", "SYNC0", "SYNC1", "SYNC1", "SYNC2", "IDENTITY"]
    assert b"".join(row.data for row in found if row.direction is TO) == capture.bytes_of(TO)
    names = {row.name for row in found}
    assert {"OPEN", "SIP", "PULSE"} <= names
    assert not any("command" in name or "packet" in name for name in names)
    for row in found[:60]:
        assert_partition(row, ARCOS)


@given(st.lists(st.binary(max_size=60), max_size=5), st.sampled_from([TO, FROM, None]))
@example([b"\xfa\xfb\xff\xfa\xfb\x06\x0b\x3b\xfa", VEL], TO)
def test_no_bytes_break_the_listing_and_none_are_lost(pieces: list[bytes], direction: Direction | None) -> None:
    capture = said(*pieces, direction=direction)
    assert b"".join(chunk.data for chunk in frame_chunks(capture.chunks)) == b"".join(pieces)
    for row in rows(capture):
        assert row.valid is (row.kind is not None)
        assert_partition(row, P2OS)


@pytest.mark.parametrize("place", range(len(VEL)))
def test_a_frame_with_one_wrong_byte_is_shown_as_damaged_and_hides_nothing(place: int) -> None:
    broken = VEL[:place] + bytes((VEL[place] ^ 0xFF,)) + VEL[place + 1 :]
    found = rows(said(broken, STOP))
    assert [row.name for row in found if row.valid] == ["STOP"]
    assert any(not row.valid for row in found)
    assert all(line_of(row).count("!!") == (not row.valid) for row in found)
    assert not any(row.name == "noise" and row.data in broken[3:] and place >= 3 for row in found), "shown twice"


@pytest.mark.parametrize("size", range(1, len(VEL)))
def test_a_frame_cut_anywhere_is_reported(size: int) -> None:
    (row,) = rows(said(VEL[:size]))
    assert not row.valid
    if size >= 3:
        assert (row.name, row.problem) == ("cut off", f"{size} of 9 bytes came")


def test_a_frame_that_pauses_is_given_up_where_it_stood_in_time() -> None:
    capture = capture_of([(0, TO, VEL[:5]), (NS_PER_S, FROM, STOP), (2 * NS_PER_S, TO, STOP)])
    assert [(row.name, row.at_ns) for row in rows(capture)] == [
        ("cut off", NS_PER_S), ("packet 0x1D", NS_PER_S), ("STOP", 2 * NS_PER_S),
    ]  # fmt: skip


def test_numbers_0_to_2_are_named_by_where_the_session_stands() -> None:
    sync = [Command(number).to_frame().to_bytes() for number in range(3)]
    identity = bytes.fromhex("fafb160257696c6d610050696f6e65657200703264780 0c18e".replace(" ", ""))
    sip = next(bytes.fromhex(vector["hex"]) for vector in VECTORS if vector["name"] == "sip_p2dx_capture")
    spoken = [(TO, sync[0]), (FROM, sync[0]), (TO, sync[2]), (FROM, identity), (TO, sync[0]), (TO, sync[1]),
              (FROM, sip), (TO, sync[0]), (TO, sync[2]), (FROM, sip), (TO, sync[0])]  # fmt: skip
    late = [(TO, sync[1]), (FROM, sip), (TO, sync[0]), (FROM, RawPacket(0xFF).to_frame().to_bytes()), (TO, sync[0])]
    capture = capture_of([(place * NS_PER_MS, *item) for place, item in enumerate(spoken)])
    assert [row.name for row in rows(capture)] == [
        "SYNC0", "SYNC0", "SYNC2", "IDENTITY", "SYNC0", "OPEN", "SIP", "PULSE", "CLOSE", "SIP", "SYNC0",
    ]  # fmt: skip
    capture = capture_of([(place * NS_PER_MS, *item) for place, item in enumerate(late)])
    assert [row.name for row in rows(capture)] == ["SYNC1", "SIP", "PULSE", "RESET", "SYNC0"]


@pytest.mark.parametrize(
    ("frame", "direction"),
    [
        (Command(CommandNumber.VEL2, -5).to_frame(), TO), (Command(CommandNumber.HOSTBAUD, 2).to_frame(), TO),
        (Command(0).to_frame(), None), (Command(CommandNumber.SAY, b"\1\2").to_frame(), TO), (Frame(b"\x07\x3b"), TO),
        (RawPacket(0x90, bytes(8)).to_frame(), FROM), (Frame(b"\x02A\0B\0C\0"), FROM), (Frame(b"\x2a\x2b\x01a\0"), TO),
        (Frame(b"\x32" + bytes(18) + b"\x05" + bytes(5)), FROM),
    ],
)  # fmt: skip
def test_who_spoke_is_guessed_by_the_frame_s_shape(frame: Frame, direction: Direction | None) -> None:
    assert guess_direction(frame.payload) is direction


def test_lines_name_units_and_directions() -> None:
    sip = next(bytes.fromhex(vector["hex"]) for vector in VECTORS if vector["name"] == "sip_left_stall_only")
    tty = Command(CommandNumber.TTY2, b"RS\r").to_frame().to_bytes()
    vel2 = Command(CommandNumber.VEL2, -246).to_frame().to_bytes()
    found = rows(capture_of([(0, FROM, sip), (1500, TO, tty), (2000, TO, vel2), (3000, FROM, b"\0" * 30)]))
    assert [line_of(row) for row in found] == [
        "  0.000000 s  < SIP  x 0.000 m, y 0.000 m, heading 0.0 deg, wheels 0.000 0.000 m/s, 12.5 V, stalled left",
        '  0.000002 s  > TTY2 "RS." (52 53 0d)',
        "  0.000002 s  > VEL2  right 10, left -1, each x 20 mm/s",
        "  0.000003 s  < !! noise: 30 bytes outside any frame: " + "00 " * 23 + "00 … (30 bytes)",
    ]
    assert line_of(found[1], has_time=False).startswith("> TTY2")
    assert summary_of(4, 1, 0.000003) == "3 packets in 0.000 s, 1 damaged"
    assert summary_of(1, 0, 0) == "1 packet, none damaged"


def test_values_become_what_json_can_hold() -> None:
    assert plain({"a": (1, 2.00000001, b"\x01", Profile.AROS, None, float("inf")), 3: {"b": True}}) == {
        "a": [1, 2.0, "01", "AROS", None, None], "3": {"b": True},
    }  # fmt: skip
    assert plain(RawPacket(1, b"\2")) == {"kind": 1, "data": "02"}
    assert plain(object).startswith("<class")  # type: ignore[union-attr]


# A reading that is followed ------------------------------------------------------------

SHORT, TAILED = StandardSip().to_frame(Profile.P2OS), StandardSip(tail=(1,)).to_frame(Profile.ARCOS)
SYNC2_WITHOUT_DATA = Frame(b"\x02")


def identity(subclass: str) -> Frame:
    return Identity("Fritz", "Pioneer", subclass).to_frame()


def followed(*packets: Frame, robot: str = "", profile: Profile | None = None) -> FollowedReading:
    reading = FollowedReading(robot, profile)
    for packet in packets:
        reading.take(packet.payload)
    return reading


@pytest.mark.parametrize(("packets", "model", "profile", "is_settled"), [
    ((), "p2dx", Profile.P2OS, False),
    ((SYNC2_WITHOUT_DATA,), "p2dx", Profile.P2OS, False),
    ((SHORT,), "p2dx", Profile.P2OS, False),
    ((TAILED,), "p2dx", Profile.ARCOS, False),
    ((identity("p3dx-sh"),), "p3dx-sh", Profile.P2OS, False),
    ((identity("P3DX-SH"), TAILED), "p3dx-sh", Profile.ARCOS, True),
    ((TAILED, identity("p3dx-sh")), "p3dx-sh", Profile.ARCOS, False),
    ((identity("p3dx-sh"), TAILED, SHORT), "p3dx-sh", Profile.ARCOS, True),
    ((identity("p3dx-sh"), TAILED, identity("p2at"), SHORT), "p2at", Profile.P2OS, True),
    ((identity("nobody"), SHORT), "p2dx", Profile.P2OS, True),
    ((identity(""), SHORT), "p2dx", Profile.P2OS, True),
])  # fmt: skip
def test_a_reading_follows_what_the_robot_says(
    packets: tuple[Frame, ...], model: str, profile: Profile, is_settled: bool
) -> None:
    found = followed(*packets)
    assert found.reading == Reading(profile=profile, parameters=load_parameters(model))
    assert found.is_settled is is_settled


def test_what_is_given_stays() -> None:
    packets = (identity("p3dx-sh"), TAILED)
    assert followed(*packets, robot="p2at").reading == Reading(
        profile=Profile.ARCOS, parameters=load_parameters("p2at")
    )
    assert followed(*packets, profile=Profile.AROS).reading == Reading(
        profile=Profile.AROS, parameters=load_parameters("p3dx-sh")
    )
    assert followed(robot="p2at", profile=Profile.AROS).is_settled


@given(st.binary(min_size=1, max_size=200))
def test_any_payload_can_be_followed(payload: bytes) -> None:
    followed(Frame(payload), Frame(bytes([2]) + payload[1:]), Frame(bytes([0x32]) + payload[1:]))


@pytest.mark.parametrize("direction", [FROM, None])
def test_a_listing_changes_its_units_with_the_packet_that_tells_the_robot(direction: Direction | None) -> None:
    sip = StandardSip(raw_x=1000).to_frame(Profile.P2OS)
    said_first = said(*(frame.to_bytes() for frame in (sip, identity("p3dx-sh"), sip)), direction=direction)
    metres = [row.fields["x_m"] for row in rows_of(said_first, FollowedReading()) if row.name == "SIP"]
    assert metres == [load_parameters(model).distance_conv_mm for model in ("p2dx", "p3dx-sh")]


def test_an_argument_of_a_command_that_no_table_has_is_a_number() -> None:
    (row,) = rows(said(Command(16, -7).to_frame().to_bytes()))
    assert any("-7, low byte first" in line for line in lines_of(explain(row, P2OS)))
