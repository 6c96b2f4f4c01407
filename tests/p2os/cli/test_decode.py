"""`p2os decode` as a person meets it: golden lines, JSON, explanations, bad input."""

import io
import json
import sys
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import pytest

from p2os.capture.chunks import Chunk, Direction
from p2os.capture.formats.pcap import file_header, record
from p2os.capture.formats.recording import chunk_line
from p2os.cli.main import run
from p2os.protocol.packets import Identity
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import StandardSip
from p2os.robots.parameters import load_parameters

Capture = pytest.CaptureFixture[str]
GOLDEN = Path(__file__).resolve().parent.parent.parent / "golden" / "captures"
VEL = "fafb060b3bc800d33b"

ARIA_BEGINS = """\
  0.067125 s  > SYNC0
  0.132528 s  < SYNC0
  0.202822 s  > SYNC1
  0.232591 s  < SYNC1
  0.302849 s  > SYNC2
  0.332762 s  < IDENTITY  name AMRISim, class Pioneer, subclass p2de
  0.423860 s  > OPEN 1
  0.425813 s  > CONFIG 1
"""

EXPLAINED = """\
> VEL 200 mm/s
    0  fa fb                    header
    2  06                       count: 6 bytes follow, checksum included
    3  0b                       command: 11, VEL: Translational speed, + forward.
    4  3b                       argument type: integer, to be taken as it is
    5  c8 00                    argument: 200 mm/s, low byte first
    7  d3 3b                    checksum: 0xD33B, high byte first; right
"""


def test_a_capture_is_shown_line_by_line(capsys: Capture) -> None:
    assert run(["decode", str(GOLDEN / "aria_p2de.jsonl")]) == 0
    captured = capsys.readouterr()
    assert captured.out.startswith(ARIA_BEGINS)
    assert captured.err == "521 packets in 33.680 s, none damaged\n"


def test_hex_is_explained_byte_by_byte(capsys: Capture) -> None:
    assert run(["decode", "--explain", *[VEL[place : place + 2] for place in range(0, len(VEL), 2)]]) == 0
    assert capsys.readouterr().out == EXPLAINED


def test_json_is_one_object_a_packet(capsys: Capture, tmp_path: Path) -> None:
    (tmp_path / "talk").write_text(f"> {VEL}\n< fafb03000001\n")
    assert run(["decode", str(tmp_path / "talk"), "--json"]) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    assert [json.loads(line) for line in captured.out.splitlines()] == [
        {"t": 0.0, "dir": "c2r", "type": 11, "name": "VEL", "fields": {"argument": 200, "unit": "mm/s"}, "valid": True},
        {"t": 0.0, "dir": "r2c", "type": None, "name": "bad checksum", "valid": False,
         "fields": {"bytes": "fa fb 03 00 00 01", "problem": "checksum: 0x0000 expected, got 0x0001"}},
    ]  # fmt: skip


def test_stdin_is_read(monkeypatch: pytest.MonkeyPatch, capsys: Capture) -> None:
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(bytes.fromhex(VEL))))
    assert run(["decode", "-", "--dir", "c2r"]) == 0
    assert capsys.readouterr().out == "> VEL 200 mm/s\n"


SYNC2_ANSWER = Identity("Fritz", "Pioneer", "p3dx-sh").to_frame().to_bytes()
SIP_SENT = StandardSip(raw_x=1000).to_frame(Profile.ARCOS).to_bytes()
#: The robot's side of a conversation, as a pipe may bring it.
KINDS = {
    "raw": lambda chunk: chunk.data,
    "hex": lambda chunk: f"< {chunk.data.hex(' ')}\n".encode(),
    "recording": lambda chunk: chunk_line(chunk).encode(),
    "pcap": lambda chunk: (b"" if chunk.at_ns else file_header()) + record(chunk),
}


class LivePipe(io.RawIOBase):
    """Standard input that brings a piece a read, and looks what was shown before each further one."""

    def __init__(self, pieces: list[bytes], look: Callable[[], None]) -> None:
        self._pieces, self._look, self._read = iter(pieces), look, 0

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: bytearray) -> int:
        if self._read:
            self._look()
        self._read += 1
        piece = next(self._pieces, b"")
        buffer[: len(piece)] = piece
        return len(piece)


class PipedScreen(io.StringIO):
    """Standard output into a pipe: what was not flushed nobody sees."""

    seen = ""

    def flush(self) -> None:
        self.seen = self.getvalue()


@pytest.mark.parametrize("options", [[], ["--json"], ["--explain"], ["--only", "identity,sip"], ["--robot", "p3dx-sh"]])
@pytest.mark.parametrize("kind", KINDS)
def test_each_packet_is_shown_while_its_pipe_stays_open(
    kind: str, options: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    frames = [SIP_SENT, SYNC2_ANSWER, SIP_SENT]
    chunks = [Chunk(at_ns=n * 1_000_000, direction=Direction.FROM_ROBOT, data=data) for n, data in enumerate(frames)]
    screen, shown = PipedScreen(), list[int]()
    monkeypatch.setattr(sys, "stdout", screen)
    pipe = LivePipe([KINDS[kind](chunk) for chunk in chunks], lambda: shown.append(screen.seen.count("SIP")))
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BufferedReader(pipe)))
    assert run(["decode", "-", "--dir", "r2c", *options]) == 0
    is_sip_seen = [after > before for before, after in pairwise([0, *shown])]
    assert is_sip_seen == [True, False, True]


def test_units_are_those_of_the_robot_once_it_has_said_who_it_is(
    monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(SIP_SENT + SYNC2_ANSWER + SIP_SENT)))
    assert run(["decode", "-", "--json", "--only", "SIP"]) == 0
    first, last = (json.loads(line)["fields"]["x_m"] for line in capsys.readouterr().out.splitlines())
    assert (first, last) == tuple(load_parameters(robot).distance_conv_mm for robot in ("p2dx", "p3dx-sh"))


def test_only_what_is_asked_for_is_shown(capsys: Capture) -> None:
    path = str(GOLDEN / "aria_p2de.jsonl")
    assert run(["decode", path, "--only", "identity, damaged"]) == 0
    captured = capsys.readouterr()
    assert captured.out == ARIA_BEGINS.splitlines(keepends=True)[5]
    assert captured.err.startswith("1 packet in")


def test_robot_and_profile_choose_units_and_layout(capsys: Capture) -> None:
    sip = "fafb1b33a604000000049600fa007d00000004030000000000000000 40b7".replace(" ", "")
    x = {}
    for robot in ("p2dx", "p3dx"):
        assert run(["decode", sip, "--robot", robot, "--profile", "AROS", "--json"]) == 0
        fields = json.loads(capsys.readouterr().out)["fields"]
        x[robot] = fields["x_m"]
        assert fields["flags"] == 3
    assert x == {"p2dx": 0.9996, "p3dx": 0.57715}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["nowhere.bin"], "p2os: 'nowhere.bin' is no file and no hex text"),
        (["fafb0"], "p2os: line 1: an odd number of hex digits"),
        ([VEL, "--dir", "up"], "p2os: --dir 'up' is none of auto, c2r, r2c"),
        ([VEL, "--json", "--explain"], "p2os: --json and --explain exclude each other"),
        ([VEL, "--robot", "nobody"], "p2os: "),
        ([VEL, "--profile", "PSOS"], "p2os: "),
        ([], "p2os: Missing argument"),
    ],
)
def test_bad_input_is_one_line_and_a_hint(words: list[str], said: str, capsys: Capture) -> None:
    assert run(["decode", *words]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    lines = captured.err.splitlines()
    assert lines[0].startswith(said)
    assert len(lines) <= 2
    assert "Traceback" not in captured.err
