"""Every verb that moves a robot, one of its calls failing: no wheel turns without STOP on a line that still carries.

The line is `Cable` of tools/surveys/measure_stops.py: as a serial cable, it does not tell the robot that a program
has ended. So where the call was the process's last, the robot's own watchdog stops it.
"""

import contextlib
import os
import pty
import random
import signal
import subprocess
import threading
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import pytest

from p2os.capture import Direction, capture_of, write_recording
from p2os.protocol.commands import Command, CommandNumber
from simbase.timing import NS_PER_MS
from tests.p2os.cli.driven import is_raw
from tests.robot_bench.firmware.hurried import hurried
from tests.tools.forked_python import forked_p2os
from tests.whole.failing_calls import (
    SOUND,
    Ended,
    FailedCall,
    Kind,
    Outcome,
    command,
    counted,
    library,
    page_in,
    run_verb,
    swept,
)
from tools.surveys.measure_stops import Cable, ServedRobot

#: The robot's watchdog, and its longest ramp from these speeds.
STANDING_S = 2.6
LIMIT_S = 40.0
#: How a verb ends that was interrupted.
INTERRUPTED = 130
SEED = 39
#: How many calls of a kind `make soak` tries of each verb: all, but of sockets, of which `run` makes 1300.
DRAWN = 200
#: The clock is real, and the machine does other things: what is wrong three times is.
TRIES, AT_ONCE = 3, 4
IDENTITY = bytes.fromhex("fafb18025669727475616c0050696f6e6565720070326478002a13")
#: What sets wheels in motion where its argument is not 0.
MOTION = frozenset({
    CommandNumber.VEL, CommandNumber.VEL2, CommandNumber.RVEL, CommandNumber.MOVE, CommandNumber.HEAD,
    CommandNumber.DHEAD, CommandNumber.ROTATE,
})  # fmt: skip
STOPS = frozenset({CommandNumber.STOP, CommandNumber.E_STOP, CommandNumber.CLOSE})


@dataclass(frozen=True, slots=True)
class Mover:
    """A verb that moves a robot; {url} is the robot's."""

    words: str
    #: A key is held for so long, and then q.
    keys_s: float = 0.0
    #: Another program's client, at {listen}; when it has ended the verb is interrupted, which is its end.
    client: str = ""
    #: What looks at what it leaves in its folder, the file named.
    left: tuple[str, str] = ("", "")


MOVERS = {
    "drive": Mover("drive {url} --vel 0.1m/s --for 600ms"),
    "way": Mover("drive {url} --forward 6cm --vel 0.1m/s"),
    "send": Mover("send {url} VEL 200 --wait 400ms"),
    "replay": Mover("replay drive.jsonl {url} --as client --yes"),
    "teleop": Mover("teleop {url} --vel 0.1m/s", keys_s=0.5),
    "sniff": Mover("sniff {url} --listen tcp:127.0.0.1:0 --quiet --out s.jsonl --for 30s",
                   client="drive {listen} --vel 0.1m/s --for 500ms", left=("s.jsonl", "decode s.jsonl")),
    "run": Mover("run dodge --firmware {firmware} --port {url} --yes --duration 2s --out o --force",
                 left=("o", "report o")),
    "record": Mover("record {url} --for 300ms --out r.jsonl --pcap r.pcap", left=("r.jsonl", "decode r.jsonl")),
}  # fmt: skip


#: What turns no motor on.
STANDING = frozenset({"send", "record"})
#: Early and late calls of each kind that verbs which move make.
SAMPLE = [
    FailedCall(kind, number, outcome)
    for kind, numbers in (
        (Kind.OPEN, (2,)),
        (Kind.READ, (2,)),
        (Kind.WRITE, (1,)),
        (Kind.MALLOC, (3,)),
        (Kind.SOCKET, (9, 60)),
    )
    for number in numbers
    for outcome in (Outcome.FAIL, Outcome.END)
]


@dataclass(frozen=True, slots=True)
class Trial:
    """What came of a verb."""

    ended: Ended
    moved: bool
    #: Seconds from the process's end until the wheels stood; None: they turn still.
    stood_s: float | None
    #: What was left, looked at; None: nothing was.
    left: Ended | None
    #: Whether STOP, or CLOSE, came after the last command that moves, if any did.
    was_stopped: bool


def recorded_drive(folder: Path) -> None:
    """Write a recording that drives for 600 ms."""
    opening = [Command(0), Command(1), Command(2)]
    talk = []
    for place, (sent, got) in enumerate(
        zip(opening, [*(one.to_frame().to_bytes() for one in opening[:2]), IDENTITY], strict=True)
    ):
        talk.append((place * NS_PER_MS, Direction.TO_ROBOT, sent.to_frame().to_bytes()))
        talk.append((place * NS_PER_MS + 500, Direction.FROM_ROBOT, got))
    for at_ms, one in ((10, Command(1)), (11, Command(4, 1)), (12, Command(11, 100)), (600, Command(0))):
        talk.append((at_ms * NS_PER_MS, Direction.TO_ROBOT, one.to_frame().to_bytes()))
    (folder / "drive.jsonl").write_text(write_recording(capture_of(talk)), encoding="utf-8")


def tried(path: str, folder: Path, mover: Mover, call: FailedCall) -> Trial:
    """Let a verb move a robot in a folder, with this call failing."""
    folder.mkdir()
    (folder / "tmp").mkdir()
    recorded_drive(folder)
    robot = ServedRobot()
    cable = Cable(robot.url)
    try:
        page = page_in(folder / "tmp")
        words = mover.words.format(url=cable.url, firmware=hurried("dodge")).split()
        ended = _run(command(path, page, call, *words), folder, mover, page)
        at = time.monotonic()
        while robot.is_moving and time.monotonic() < at + STANDING_S + 1:
            time.sleep(0.005)
        stood = None if robot.is_moving else max(0.0, robot.speeds[-1][0] - at)
        commands = [each for _, each in cable.frames]
        moving = [n for n, each in enumerate(commands) if each.number in MOTION and each.argument]
        was_stopped = not moving or any(each.number in STOPS for each in commands[moving[-1] + 1 :])
        name, verb = mover.left
        left = run_verb(path, folder, SOUND, *verb.split()) if name and (folder / name).exists() else None
        return Trial(ended, len(robot.speeds) > 1, stood, left, was_stopped)
    finally:
        cable.close()
        robot.close()


def _run(words: list[str], folder: Path, mover: Mover, page: Path) -> Ended:
    keyboard = inside = -1
    if mover.keys_s:
        keyboard, inside = pty.openpty()
    err = folder / "tmp" / "err"
    with err.open("wb") as said:
        process = subprocess.Popen(
            words, cwd=folder, stdin=inside if mover.keys_s else subprocess.DEVNULL,
            stdout=inside if mover.keys_s else subprocess.PIPE, stderr=said, start_new_session=True,
        )  # fmt: skip
    others = []
    try:
        if mover.keys_s:
            os.close(inside)
            threading.Thread(target=_press, args=(keyboard, process, mover.keys_s), daemon=True).start()
        if mover.client:
            url = _listens_at(err, process)
            if url:
                client = forked_p2os(*mover.client.format(listen=url).split())
                others.append(subprocess.Popen(client, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))
                others[-1].wait(LIMIT_S)
                process.send_signal(signal.SIGINT)
        out, _ = process.communicate(timeout=LIMIT_S)
        code = 0 if others and process.returncode == INTERRUPTED else process.returncode
        return Ended(code, (out or b"").decode(errors="replace"), err.read_text(errors="replace"), *counted(page))
    finally:
        for each in (process, *others):
            if each.poll() is None:
                each.kill()
            each.wait()
        if mover.keys_s:
            os.close(keyboard)


def _listens_at(err: Path, process: "subprocess.Popen[bytes]") -> str:
    while True:
        is_over = process.poll() is not None
        for line in err.read_text(errors="replace").splitlines():
            if line.startswith("listening on "):
                return line.split()[2]
        if is_over:
            return ""
        time.sleep(0.01)


def _press(keyboard: int, process: "subprocess.Popen[bytes]", held_s: float) -> None:
    """Hold a key once the program reads keys, then end it; take what it shows."""
    begun = time.monotonic()
    os.set_blocking(keyboard, False)
    held_until = None
    while process.poll() is None and time.monotonic() < begun + LIMIT_S:
        try:
            with contextlib.suppress(BlockingIOError):
                os.read(keyboard, 65536)
            if held_until is None and is_raw(keyboard):
                held_until = time.monotonic() + held_s
            if held_until is not None:
                os.write(keyboard, b"w" if time.monotonic() < held_until else b"q")
        except OSError:  # nobody has the other end
            return
        time.sleep(0.05)


def wrong(trial: Trial, call: FailedCall) -> list[str]:
    """Return what must not be."""
    found, ended = [], trial.ended
    if trial.stood_s is None or trial.stood_s > STANDING_S:
        found.append("the wheels turn on")
    if (left := trial.left) is not None:
        found += [f"afterwards: {each}: {left.err}" for each in left.wrong()]
    if (ended.was_killed and call.outcome is Outcome.END) or ended.was_killed_by_others:
        return found
    found += ended.wrong()
    if not trial.was_stopped:
        found.append("no STOP")
    return found


def each_tried(path: str, folder: Path, rows: Sequence[tuple[str, FailedCall]]) -> list[str]:
    """Try rows of a mover and a call, several at a time; return what was wrong each time that it was tried."""

    def problems(row: tuple[int, tuple[str, FailedCall]]) -> list[str]:
        place, (name, call) = row
        found: list[str] = []
        for again in range(TRIES):
            trial = tried(path, folder / f"{place}-{again}", MOVERS[name], call)
            found = [
                f"{name} {call} {trial.ended.failed}: {each}: {trial.ended.err[-300:]}" for each in wrong(trial, call)
            ]
            if not found:
                break
        return found

    with ThreadPoolExecutor(AT_ONCE) as pool:
        return [problem for found in pool.map(problems, enumerate(rows)) for problem in found]


def sound(path: str, folder: Path, name: str) -> Ended:
    """Return how a mover ends where no call fails; it has moved the robot, but for `STANDING`."""
    trial = tried(path, folder / name, MOVERS[name], SOUND)
    assert trial.moved or name in STANDING, trial.ended.err
    assert not wrong(trial, SOUND)
    return trial.ended


@pytest.mark.slow
def test_a_robot_stands_after_a_call_that_fails(tmp_path: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    path, chooser = library(tmp_path_factory), random.Random(SEED)
    drive = sound(path, tmp_path, "drive")
    rows = [
        ("drive", FailedCall(Kind.SOCKET, drive.counts[Kind.SOCKET] // 2, outcome)) for outcome in Outcome if outcome
    ]
    rows += [("replay", FailedCall(Kind.SOCKET, 4, Outcome.FAIL))]
    rows += chooser.sample([(name, call) for name in MOVERS for call in SAMPLE], 6)
    assert not each_tried(path, tmp_path, rows)


@pytest.mark.soak
@pytest.mark.parametrize("name", MOVERS)
def test_a_robot_stands_after_every_call_that_fails(
    name: str, tmp_path: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = library(tmp_path_factory)
    calls = swept(name, sound(path, tmp_path, name), random.Random(f"{SEED} {name}"), DRAWN)
    found = each_tried(path, tmp_path, [(name, call) for call in calls])
    assert not found, "\n\n".join(found)
