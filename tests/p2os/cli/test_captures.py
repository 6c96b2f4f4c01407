"""The verbs that sit on lines: sniff, record and replay against a served robot."""

import contextlib
import json
import logging
import socket
import subprocess
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from p2os.capture import Chunk, Direction, capture_of, read_capture, read_file, write_recording
from p2os.capture.replay import Replay
from p2os.cli.captures.capture_files import RecordingFile, Sinks
from p2os.cli.captures.record import record_session
from p2os.cli.captures.replay import motions_of, play
from p2os.cli.captures.sniff import TapBridge
from p2os.errors import RemoteProtocolError, RunFailedError, TransportError
from p2os.pioneer.controller import ControllerSettings
from p2os.pioneer.serve import served_pioneer
from p2os.protocol.commands import Command, CommandNumber
from p2os.protocol.packets import Identity
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import StandardSip
from p2os.robots.parameters import load_parameters
from p2os.transport import HungUpError, Loops, listen_url, open_url, waiting
from p2os.transport.ports import RefusedPeerError
from simbase.command_line import refused_connections
from simbase.errors import FileError
from simbase.listening import LOGGER
from simbase.timing import NS_PER_MS, NS_PER_S
from tests.tools.forked_python import forked_python

TO, FROM = Direction.TO_ROBOT, Direction.FROM_ROBOT
TIMEOUT_S = 60.0
Run = Callable[..., int]
Capture = pytest.CaptureFixture[str]
STOP_FIRST = b"".join(
    command.to_frame().to_bytes()
    for command in (Command(CommandNumber.STOP), Command(CommandNumber.VEL, 0), Command(CommandNumber.CLOSE))
)


@pytest.mark.parametrize("option", ["--out", "--pcap"])
@pytest.mark.parametrize("verb", [["record"], ["sniff", "--listen", "tcp:127.0.0.1:0"]], ids=["record", "sniff"])
def test_a_recording_is_overwritten_by_force_alone(
    verb: list[str], option: str, run: Run, tmp_path: Path, capsys: Capture
) -> None:
    out = tmp_path / "floor"
    out.write_bytes(b"what a robot said last week")
    words = [*verb, "tcp:127.0.0.1:1", "--out", tmp_path / "new.jsonl", option, out]
    assert run(*words) == 2
    assert capsys.readouterr().err.startswith(f"p2os: {out} is there already\nhint: another name, or --force")
    assert run(*words, "--force") == 1, "no robot is there; it was tried"
    assert out.read_bytes() == b"what a robot said last week"


def test_a_robot_is_recorded_and_left_closed(served: object, run: Run, tmp_path: Path, capsys: Capture) -> None:
    out, pcap = tmp_path / "floor.jsonl", tmp_path / "floor.pcap"
    assert run("record", served.url, "--for", "300ms", "--out", out, "--pcap", pcap) == 0
    captured = capsys.readouterr()
    assert captured.out == f"{out}\n"
    assert " SIPs in " in captured.err
    capture = read_file(out)
    assert capture.note == f"p2os record {served.url}"
    assert capture.bytes_of(TO).endswith(Command(CommandNumber.CLOSE).to_frame().to_bytes())
    for direction in (TO, FROM):
        assert read_capture(pcap.read_bytes()).bytes_of(direction) == capture.bytes_of(direction)


def test_a_recorded_session_is_sniffed_while_it_is_replayed(
    served: object, run: Run, tmp_path: Path, capsys: Capture
) -> None:
    sync = [Command(number).to_frame().to_bytes() for number in range(3)]
    talk = [(0, TO, sync[0]), (1, FROM, sync[0]), (2, TO, sync[1]), (3, FROM, sync[1]), (4, TO, sync[2]),
            (5, FROM, bytes.fromhex("fafb0802000000000200")), (6, TO, sync[1]),
            (300_000_000, TO, Command(CommandNumber.ENABLE, 1).to_frame().to_bytes())]  # fmt: skip
    recording, received = tmp_path / "talk.jsonl", tmp_path / "received.jsonl"
    recording.write_text(write_recording(capture_of(talk)))
    listener = listen_url("tcp:127.0.0.1:0")
    bridge_url, chunks, reported = listener.description, [], []
    bridge = TapBridge(listener, open_url(served.url), lambda: open_url(served.url),
                    on_chunk=chunks.append, on_event=reported.append)  # fmt: skip
    thread = threading.Thread(target=lambda: bridge.run(lambda: bridge.sessions == 2))
    thread.start()
    assert run("replay", recording, bridge_url, "--as", "client", "--speed", "3") == 0
    assert run("replay", recording, bridge_url, "--as", "client", "--speed", "3") == 0
    thread.join(TIMEOUT_S)
    assert not thread.is_alive()
    assert capsys.readouterr().err.endswith("5 frames sent\n")
    spoken = b"".join(chunk.data for chunk in chunks if chunk.direction is TO)
    session = b"".join(data for _, direction, data in talk if direction is TO) + STOP_FIRST
    assert spoken == session * 2
    assert sum(text.startswith("client gone") for text in reported) == 2
    received.write_text(write_recording(capture_of([(chunk.at_ns, chunk.direction, chunk.data) for chunk in chunks])))
    assert run("decode", received, "--only", "IDENTITY,ENABLE,damaged") == 0
    assert capsys.readouterr().out.count("IDENTITY  name Virtual") == 2


def test_sniff_shows_and_records_one_client(served: object, run: Run, tmp_path: Path, capsys: Capture) -> None:
    pty, out = tmp_path / "robot", tmp_path / "talk.jsonl"
    results: list[int] = []
    words = (
        "sniff",
        served.url,
        "--listen",
        f"pty:{pty}",
        "--once",
        "--json",
        "--out",
        out,
        "--pcap",
        tmp_path / "t.pcap",
    )
    thread = threading.Thread(target=lambda: results.append(run(*words)))
    thread.start()
    watchdog = threading.Event()
    for _ in range(600):
        if pty.is_symlink() or watchdog.wait(TIMEOUT_S / 600):
            break
    record_session(open_url(f"pty:{pty}"), lambda _chunk: None, lasts_ns=NS_PER_S // 5)
    thread.join(TIMEOUT_S)
    assert results == [0]
    rows = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [row["name"] for row in rows[:6]] == ["SYNC0", "SYNC0", "SYNC1", "SYNC1", "SYNC2", "IDENTITY"]
    assert read_file(out).bytes_of(TO) == read_file(tmp_path / "t.pcap").bytes_of(TO)


@pytest.mark.parametrize(("options", "model"), [([], "p3dx-sh"), (["--robot", "p2at"], "p2at")])
def test_sniff_shows_lengths_in_the_units_of_the_robot_that_answers(
    options: list[str], model: str, run: Run, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    robot = [Identity("Fritz", "Pioneer", "p3dx-sh").to_frame(), StandardSip(raw_x=1000).to_frame(Profile.P2OS)]

    def run_bridge(bridge: TapBridge, _until: Callable[[], bool]) -> None:
        for at_ns, frame in enumerate(robot):
            bridge._on_chunk(Chunk(at_ns=at_ns, direction=FROM, data=frame.to_bytes()))

    monkeypatch.setattr(TapBridge, "run", run_bridge)
    with socket.create_server(("127.0.0.1", 0)) as there:
        url = f"tcp:127.0.0.1:{there.getsockname()[1]}"
        assert run("sniff", url, "--listen", "tcp:127.0.0.1:0", "--json", *options) == 0
    sip = json.loads(capsys.readouterr().out.splitlines()[1])
    assert sip["fields"]["x_m"] == pytest.approx(load_parameters(model).distance_conv_mm, abs=1e-6)


class Line:
    """A line that a test plays the far side of."""

    description = "tcp:nowhere"

    def __init__(self, *says: bytes | BaseException) -> None:
        self.says, self.received = list(says), b""
        self.near, self.far = Loops(), None

    def read(self) -> bytes:
        said = self.says.pop(0) if self.says else b""
        if isinstance(said, BaseException):
            raise said
        return said

    def write(self, data: bytes) -> None:
        self.received += data

    def fileno(self) -> int:
        raise TransportError("cannot be waited for")

    def close(self) -> None:
        self.received += b"closed"


class Clock:
    """A clock that runs as fast as it is read."""

    def __init__(self, step_ns: int = 20_000_000) -> None:
        self.now, self.step_ns = 0, step_ns

    def __call__(self) -> int:
        self.now += self.step_ns
        return self.now


@pytest.fixture
def no_waiting(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(waiting, "BLIND_POLL_S", 0)


@pytest.mark.usefixtures("no_waiting")
def test_a_silent_line_is_no_robot() -> None:
    line = Line()
    with pytest.raises(RemoteProtocolError, match="no robot on tcp:nowhere"):
        record_session(line, lambda _chunk: None, clock=Clock())
    recording = capture_of([(0, TO, Command(0).to_frame().to_bytes()), (1, FROM, Command(0).to_frame().to_bytes()),
                            (2, TO, Command(1).to_frame().to_bytes())])  # fmt: skip
    with pytest.raises(RemoteProtocolError, match="does not give an answer to a SYNC"):
        play(Replay(recording, TO), line, TO, clock=Clock())


@pytest.mark.usefixtures("no_waiting")
def test_a_replay_that_is_interrupted_or_loses_its_line_stops_the_robot() -> None:
    sip = bytes.fromhex("fafb1b32000000000000000000007d00000000000000000000000000327d")
    drive = capture_of(
        [(0, TO, Command(11, 200).to_frame().to_bytes()), (NS_PER_S, TO, Command(0).to_frame().to_bytes())]
    )
    for error in (KeyboardInterrupt(), HungUpError("gone")):
        line = Line(b"", sip, error)
        with pytest.raises(type(error)):
            play(Replay(drive, TO), line, TO, clock=Clock())
        assert line.received == Command(11, 200).to_frame().to_bytes() + STOP_FIRST
    assert motions_of(drive) == 1


def test_a_bridge_follows_a_change_of_speed_and_stops_the_robot_when_it_ends() -> None:
    loops, reported, chunks, bauds = Loops(), [], [], []
    robot_end = loops.listen("robot")
    bridge = TapBridge(loops.listen("client"), loops.connect("robot"), lambda: loops.connect("robot"),
                    on_chunk=chunks.append, on_event=reported.append, clock=Clock())  # fmt: skip
    robot, client = robot_end.accept(), loops.connect("client")
    bridge.turn()
    bridge._robot.set_baud = bauds.append
    robot.write(bytes.fromhex("fafb1b32000000000000000000007d00000000000000000000000000327d"))
    client.write(Command(CommandNumber.HOSTBAUD, 2).to_frame().to_bytes())
    for _ in range(2):
        bridge.turn()
    assert bauds == [38400]
    assert client.read()[:4] == b"\xfa\xfb\x1b\x32"
    bridge.close()
    assert robot.read().endswith(STOP_FIRST)
    assert reported[-2:] == ["the session was open: sent STOP, VEL 0 and CLOSE", "client gone: the bridge ends"]
    assert chunks[-1].data == STOP_FIRST


SIP = bytes.fromhex("fafb1b32000000000000000000007d00000000000000000000000000327d")
VEL_200 = Command(CommandNumber.VEL, 200).to_frame().to_bytes()


class Joined:
    """A bridge between a client and a robot whose session is open, on a clock that a test sets."""

    def __init__(self, on_chunk: Callable[[Chunk], None] = lambda _chunk: None) -> None:
        loops, self.now, self.reported = Loops(), 0, []
        robots = loops.listen("robot")
        self.bridge = TapBridge(
            loops.listen("client"), loops.connect("robot"), lambda: loops.connect("robot"),
            on_chunk=on_chunk, on_event=self.reported.append, clock=lambda: self.now,
        )  # fmt: skip
        self.robot, self.client = robots.accept(), loops.connect("client")
        self.bridge.turn()
        self.robot.write(SIP)
        self.bridge.turn()


def test_after_a_pause_a_bridge_stops_the_robot_and_passes_nothing_on_that_has_waited() -> None:
    joined = Joined()
    joined.client.write(VEL_200)
    joined.now += 3_200_000_000
    joined.bridge.turn()
    assert joined.robot.read() == STOP_FIRST
    assert joined.reported[-1] == "client gone: the bridge paused for 3.0 s"
    assert joined.client.read() == SIP
    with pytest.raises(HungUpError):
        joined.client.read()


@pytest.mark.parametrize(("pause_ns", "passes"), [(550_000_000, True), (550_000_001, False)])
def test_a_pause_before_a_bridge_reads_is_one_too(pause_ns: int, passes: bool) -> None:
    joined = Joined()
    client = joined.bridge._client
    read = client.read

    def read_late() -> bytes:
        joined.now += pause_ns  # stopped behind the look at the clock, while bytes pile up
        return read()

    client.read = read_late
    joined.client.write(VEL_200)
    joined.bridge.turn()
    assert joined.robot.read() == (VEL_200 if passes else STOP_FIRST)
    assert joined.reported[1:] == ([] if passes else ["the session was open: sent STOP, VEL 0 and CLOSE",
                                                  "client gone: the bridge paused for 0.4 s"])  # fmt: skip


def test_a_pause_of_a_third_of_a_second_is_borne_and_one_without_a_session_harms_nobody() -> None:
    joined = Joined()
    joined.client.write(VEL_200)
    joined.now += 549_000_000  # the wait ends after 200 ms, and 350 ms more are no gap
    joined.bridge.turn()
    assert joined.robot.read() == VEL_200
    joined.client.write(STOP_FIRST)
    joined.bridge.turn()
    joined.now += 10 * NS_PER_S
    joined.bridge.turn()
    assert joined.robot.read() == STOP_FIRST
    assert len(joined.reported) == 1


def test_a_bridge_passes_on_before_it_shows_and_sends_the_closing_frames_when_showing_fails() -> None:
    seen: list[bytes] = []

    def fail(chunk: Chunk) -> None:
        if chunk.data == VEL_200:
            seen.append(joined.robot.read())
            raise FileError("cannot write talk.jsonl: no space left on device")
        if seen:
            raise BrokenPipeError

    joined = Joined(fail)
    joined.client.write(VEL_200)
    with pytest.raises(BrokenPipeError):
        joined.bridge.run(lambda: False)
    assert seen == [VEL_200]
    assert joined.robot.read() == STOP_FIRST
    assert joined.client.read() == SIP
    with pytest.raises(HungUpError):
        joined.client.read()


def test_a_bridge_says_that_stop_was_sent_where_the_line_has_taken_it() -> None:
    chunks: list[Chunk] = []
    joined = Joined(chunks.append)
    joined.robot.close()
    joined.bridge.turn()
    assert joined.reported[-2] == "the session was open, and no STOP can be sent: the robot's watchdog stops it"
    assert [chunk.data for chunk in chunks] == [SIP]


def test_a_bridge_knows_of_a_client_what_that_one_has_sent() -> None:
    """The first is gone before the line follows it to another speed, the second has no session, the third none left."""
    loops, reported, stops, now = Loops(), [], [], 0
    robots = loops.listen("robot")
    bridge = TapBridge(
        loops.listen("client"), loops.connect("robot"), lambda: loops.connect("robot"),
        on_chunk=lambda _chunk: None, on_event=reported.append, clock=lambda: now,
    )  # fmt: skip
    for sent in (VEL_200 + Command(CommandNumber.HOSTBAUD, 2).to_frame().to_bytes(), b"", VEL_200 + STOP_FIRST):
        client = loops.connect("client")
        bridge.turn()
        robot = robots.accept()
        for data in (b"", sent):
            now += 30 * NS_PER_MS
            robot.write(b"" if data or not sent else SIP)
            client.write(data)
            bridge.turn()
        client.close()
        bridge.turn()
        stops.append(b"")
        with contextlib.suppress(HungUpError):
            stops[-1] = robot.read().removeprefix(sent)
    assert stops == [STOP_FIRST, b"", b""]
    assert [line for line in reported if "client " not in line] == ["the session was open: sent STOP, VEL 0 and CLOSE"]
    assert not [line for line in reported if "switches the line" in line]


@pytest.mark.usefixtures("no_waiting")
@pytest.mark.parametrize("breaks", [False, True])
def test_a_recording_has_what_the_line_took_and_nothing_else(breaks: bool) -> None:
    """Also at its end: what closes the session, or nothing where the line is gone."""
    syncs = [Command(number).to_frame().to_bytes() for number in (0, 1)]
    identity = Identity("Fritz", "Pioneer", "p3dx-sh").to_frame().to_bytes()
    answers = [*syncs, identity, *[b""] * 20, SIP]
    line = Line(*answers, HungUpError("gone") if breaks else KeyboardInterrupt())
    take = line.write

    def write(data: bytes) -> None:
        if breaks and not line.says:
            raise HungUpError("gone")
        take(data)

    line.write = write  # type: ignore[method-assign]
    chunks: list[Chunk] = []
    with pytest.raises((HungUpError, KeyboardInterrupt)):
        record_session(line, chunks.append, clock=Clock())
    assert b"".join(chunk.data for chunk in chunks if chunk.direction is TO) == line.received
    assert line.received.endswith(Command(CommandNumber.CLOSE).to_frame().to_bytes()) is not breaks
    assert b"".join(chunk.data for chunk in chunks if chunk.direction is FROM) == b"".join(answers)


@pytest.mark.usefixtures("no_waiting")
def test_a_replay_that_has_paused_stops_the_robot() -> None:
    drive = capture_of([(0, TO, VEL_200), (60 * NS_PER_S, TO, Command(0).to_frame().to_bytes())])
    line, now = Line(b"", SIP), [0]

    def read() -> bytes:
        now[0] += 20_000_000 if line.says else 500_000_000  # a wait is 100 ms at most
        return Line.read(line)

    line.read = read  # type: ignore[method-assign]
    with pytest.raises(RunFailedError, match=r"paused for 0\.4 s"):
        play(Replay(drive, TO), line, TO, clock=lambda: now[0])
    assert line.received == VEL_200 + STOP_FIRST


@pytest.mark.usefixtures("no_waiting")
@pytest.mark.parametrize(("silence_ms", "goes_on"), [(1000, True), (1001, False)])
def test_a_replay_to_a_robot_that_has_fallen_silent_stops_it_and_ends(silence_ms: int, goes_on: bool) -> None:
    drive = capture_of([(0, TO, VEL_200), (1_100_000_000, TO, Command(0).to_frame().to_bytes())])
    line, now = Line(SIP), [0]

    def read() -> bytes:
        if line.says:
            return Line.read(line)
        now[0] = min(now[0] + 90_000_000, silence_ms * 1_000_000)
        if now[0] == silence_ms * 1_000_000 and goes_on:
            now[0] = 1_100_000_000
            return SIP
        return b""

    line.read = read  # type: ignore[method-assign]
    if goes_on:
        play(Replay(drive, TO), line, TO, clock=lambda: now[0])
    else:
        with pytest.raises(RemoteProtocolError, match=r"no packet for 1\.0 s"):
            play(Replay(drive, TO), line, TO, clock=lambda: now[0])
    assert line.received.endswith(STOP_FIRST)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no full disk at hand")
@pytest.mark.parametrize("option", ["--out", "--pcap"])
@pytest.mark.parametrize("verb", ["record", "sniff"])
def test_a_disk_that_is_full_from_the_start_is_one_line(
    verb: str, option: str, served: object, run: Run, tmp_path: Path, capsys: Capture
) -> None:
    more = ["--listen", "tcp:127.0.0.1:0"] if verb == "sniff" else []
    more += [] if option == "--out" or verb == "sniff" else ["--out", tmp_path / "floor.jsonl"]
    assert run(verb, served.url, *more, option, "/dev/full") == 1
    err = capsys.readouterr().err
    assert [line for line in err.splitlines() if line.startswith(("p2os:", "hint:"))] == [
        "p2os: cannot write /dev/full: no space left on device"
    ]


LIMITED = """
import resource, sys
from p2os.cli.main import main
sys.dont_write_bytecode = True  # Python would leave cut files in the cache
resource.setrlimit(resource.RLIMIT_FSIZE, (1_500, 1_500))
main(sys.argv[1:])
"""


@pytest.mark.parametrize(("verb", "option"), [("record", "--pcap"), ("sniff", "--out")])
def test_a_disk_that_fills_up_is_one_line_and_what_was_written_can_be_read(
    verb: str, option: str, tmp_path: Path
) -> None:
    often = ControllerSettings(sip_period_ns=20 * NS_PER_MS)  # the disk is full of twenty packets
    with served_pioneer(body="kinematic", settings=often) as url:
        fill_a_disk(verb, option, url, tmp_path)


def fill_a_disk(verb: str, option: str, url: str, tmp_path: Path) -> None:
    full = tmp_path / ("floor.jsonl" if option == "--out" else "floor.pcap")
    other = ["--out", "/dev/null"] if (verb, option) == ("record", "--pcap") else []
    more = ["--listen", "tcp:127.0.0.1:0", "--quiet"] if verb == "sniff" else ["--for", "20s"]
    with subprocess.Popen(
        [forked_python(), "-c", LIMITED, verb, url, *more, *other, option, str(full)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path,
    ) as process:  # fmt: skip
        try:
            assert process.stderr is not None
            said = process.stderr.readline()
            if verb == "sniff":
                with contextlib.suppress(RemoteProtocolError, TransportError):
                    record_session(open_url(said.split()[2]), lambda _chunk: None, lasts_ns=20 * NS_PER_S)
            said += process.communicate(timeout=30)[1]
        finally:
            process.kill()
    assert process.returncode == 1, said
    lines = [line for line in said.splitlines() if line.startswith(("p2os:", "hint:", "Traceback"))]
    assert lines == [
        f"p2os: cannot write {full}: file too large",
        f"hint: what it held before is whole: p2os decode {full}",
    ]
    assert "session was open: sent STOP" in said or verb == "record"
    assert 1_000 < full.stat().st_size <= 1_500
    capture = read_file(full)
    assert len(capture.bytes_of(FROM)) > 200
    if option == "--out":
        assert full.read_text().endswith("}\n")


def test_what_one_file_refuses_the_others_still_take(tmp_path: Path) -> None:
    class Refusing:
        def take(self, _chunk: Chunk) -> None:
            raise RunFailedError("full")

        def close(self) -> None: ...

    kept = RecordingFile(tmp_path / "kept.jsonl")
    both = Sinks([Refusing(), kept])
    with pytest.raises(RunFailedError, match="full"):
        both.take(Chunk(at_ns=0, direction=TO, data=b"x"))
    both.close()
    assert read_file(tmp_path / "kept.jsonl").bytes_of(TO) == b"x"


def test_a_bridge_whose_robot_is_gone_refuses_its_client() -> None:
    loops, reported = Loops(), []
    robots = loops.listen("robot")
    bridge = TapBridge(loops.listen("client"), loops.connect("robot"), lambda: loops.connect("robot"),
                    on_chunk=lambda _chunk: None, on_event=reported.append)  # fmt: skip
    robots.accept().close()
    robots.close()
    client = loops.connect("client")
    bridge.turn()
    assert reported == ["client refused: cannot connect to loop:robot: nobody listens"]
    with pytest.raises(HungUpError):
        client.read()
    bridge.close()


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (["record", "tcp:127.0.0.1:1"], 1, "p2os: cannot connect to tcp:127.0.0.1:1"),
        (["record", "tcp:x", "--for", "10"], 2, "p2os: --for '10' has no unit: more than 0, in ns"),
        (["record", "tcp:x", "--for", "0s"], 2, "p2os: --for '0s' is out of range: more than 0"),
        (["sniff"], 2, "p2os: Invalid value for URL: name the robot's URL"),
        (["sniff", "nowhere"], 2, "p2os: 'nowhere' is not a port URL"),
        (["sniff", "tcp:127.0.0.1:1", "--for", "x"], 2, "p2os: --for 'x' is no time: more than 0"),
        (["replay", "gone.jsonl", "tcp:x"], 2, "p2os: cannot read gone.jsonl"),
        (["replay", "FILE", "tcp:127.0.0.1:1", "--as", "client"], 1, "p2os: cannot connect"),
        (["replay", "FILE", "serial:/dev/ttyUSB99", "--as", "client"], 2, "p2os: the recording holds 1 motion"),
        (["replay", "FILE", "pty:"], 2, "p2os: FILE holds nothing that a robot sent"),
        (["replay", "FILE", "tcp:x", "--speed", "0"], 2, "p2os: --speed '0' is out of range: 0.01 to 100"),
        (["replay", "FILE", "tcp:x", "--as", "dog"], 2, "p2os: --as 'dog' is not one of 'robot', 'client'"),
    ],
)  # fmt: skip
def test_bad_input_is_one_line_and_a_hint(
    words: list[str], code: int, said: str, run: Run, tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    drive = capture_of([(0, TO, Command(11, 200).to_frame().to_bytes())])
    Path("FILE").write_text(write_recording(drive))
    assert run(*words) == code
    captured = capsys.readouterr()
    assert captured.err.startswith(said)
    assert captured.err.count("\n") <= 2
    assert captured.out == ""


def test_a_capture_file_that_cannot_be_written_is_named(served: object, run: Run, capsys: Capture) -> None:
    assert run("record", served.url, "--out", "/nowhere/floor.jsonl", "--for", "1s") == 2
    assert capsys.readouterr().err == (
        "p2os: cannot write /nowhere/floor.jsonl: no such file or directory\n"
        "hint: give a file in a folder that exists\n"
    )


@pytest.mark.usefixtures("no_waiting")
@pytest.mark.parametrize(("said", "code", "reported"), [
    (Command(2).to_frame().to_bytes(), 0, "the client closed the session after 1 of 2 frames\n"),
    (b"", 1, "p2os: after 1 of 2 frames: gone\n"),
])  # fmt: skip
def test_a_client_that_closes_its_session_and_goes_is_no_error(
    run: Run, tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch, said: bytes, code: int, reported: str
) -> None:
    recording = tmp_path / "talk.jsonl"
    sync = Command(0).to_frame().to_bytes()
    talk = [(0, TO, sync), (1, FROM, sync), (100 * NS_PER_S, FROM, SIP)]
    recording.write_text(write_recording(capture_of(talk)))
    line = Line(sync, said, HungUpError("gone"))
    monkeypatch.setattr("p2os.cli.captures.replay._first", lambda _listener: line)
    assert run("replay", recording, "tcp:127.0.0.1:0") == code
    assert reported in capsys.readouterr().err


@pytest.mark.usefixtures("no_waiting")
def test_a_replay_begins_anew_for_the_client_that_comes_after_a_web_page(
    run: Run, tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    recording = tmp_path / "talk.jsonl"
    sync = Command(0).to_frame().to_bytes()
    talk = [(0, TO, sync), (1, FROM, sync), (100 * NS_PER_S, FROM, SIP)]
    recording.write_text(write_recording(capture_of(talk)))
    client = Line(sync, Command(2).to_frame().to_bytes(), HungUpError("gone"))
    lines = iter([Line(RefusedPeerError("a page")), client])
    monkeypatch.setattr("p2os.cli.captures.replay._first", lambda _listener: next(lines))
    assert run("replay", recording, "tcp:127.0.0.1:0") == 0
    assert capsys.readouterr().err.endswith("Ctrl-C ends\nthe client closed the session after 1 of 2 frames\n")
    assert client.received == sync + b"closed"


def test_of_refused_connections_some_lines_a_second_are_shown(capsys: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = 100.0
    monkeypatch.setattr(refused_connections.time, "monotonic", lambda: now_s)
    log = logging.getLogger(LOGGER)
    with refused_connections.shown_refusals("p2os"):
        for number in range(refused_connections.MOST_A_SECOND + 2):
            log.warning("refused %s", number)
        now_s = 100.999
        log.warning("still the same second")
        now_s = 101.0
        log.warning("the next")
    log.warning("nobody shows it")
    shown = [f"p2os: refused {number}" for number in range(refused_connections.MOST_A_SECOND)]
    assert capsys.readouterr().err.splitlines() == [*shown, "p2os: 3 connections more were refused", "p2os: the next"]
