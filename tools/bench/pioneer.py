"""Print what virtual Pioneers cost: many in virtual time, and one and many served in real time.

Run it on an idle machine. Usage: python tools/bench/pioneer.py [ROBOTS [BODY]]
"""

import json
import math
import os
import select
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

from p2os.pioneer.body.factory import make_scene
from p2os.pioneer.controller import Pioneer
from p2os.pioneer.serve import served_pioneer
from p2os.pioneer.serve.multi_robot_world import MultiRobotWorld
from p2os.pioneer.world import parse_world
from p2os.pioneer.world.model import Pose
from p2os.protocol.commands import Command
from p2os.protocol.commands import CommandNumber as C
from p2os.robots.parameters import load_parameters
from p2os.transport import open_url
from simbase.timing import NS_PER_MS, NS_PER_S

ROBOTS = int(sys.argv[1]) if len(sys.argv) > 1 else 64
ENGINE = sys.argv[2] if len(sys.argv) > 2 else "kinematic"
#: Robot seconds of the first figure, seconds of the others.
LIVED_S, WATCHED_S = 10, 5
#: How they stand: so many in a row, so far from each other.
ROW, PITCH_M = math.isqrt(ROBOTS - 1) + 1, 2.0


def command(number: int, argument: int | None = None) -> bytes:
    """Return a command's bytes."""
    return Command(number, argument).to_frame().to_bytes()


def hall() -> str:
    """Return an empty hall with room for all of them, 2 m apart, as a world file."""
    half = PITCH_M * (ROW + 1) / 2
    corners = ((-half, -half), (half, -half), (half, half), (-half, half))
    walls = "".join(
        f'[[wall]]\nname = "{number}"\nfrom_m = {list(begin)}\nto_m = {list(end)}\nfixed = true\n'
        for number, (begin, end) in enumerate(zip(corners, (*corners[1:], corners[0]), strict=True))
    )
    return f'name = "hall"\nextent_m = [-{half}, -{half}, {half}, {half}]\n{walls}'


HALL = hall()


def places(robots: int) -> list[Pose]:
    """Return where so many robots stand in the hall, in rows."""
    rows = (divmod(number, ROW) for number in range(robots))
    return [Pose(*(PITCH_M * (place - (ROW - 1) / 2) for place in row), 0.0) for row in rows]


def many_robots(engine: str) -> None:
    """Print how much of one core many turning robots take in real time, in one world and each in its own."""
    parameters, world = load_parameters("p2dx"), parse_world(HALL, "hall")
    for is_shared in (False, True):
        poses = places(ROBOTS)
        groups = [poses] if is_shared else [[pose] for pose in poses]
        scenes = [make_scene(engine, world, [parameters] * len(group)) for group in groups]
        for scene, group in zip(scenes, groups, strict=True):
            scene.reset(group, 0)
        made = [Pioneer(parameters=parameters, body=body) for scene in scenes for body in scene.bodies]
        multi_robot_world = MultiRobotWorld(made, scenes[0]) if is_shared else None
        for robot in made:
            for data in (*map(command, (0, 1, 2, 1)), command(C.ENABLE, 1), command(C.RVEL, 20)):
                robot.receive(data, 0)
        begin = time.process_time()
        for at in range(100 * NS_PER_MS, LIVED_S * NS_PER_S + 1, 100 * NS_PER_MS):
            for number, robot in enumerate(made):
                if multi_robot_world is not None:
                    multi_robot_world.bring(number, at)
                robot.receive(command(C.PULSE), at)
                robot.take_output()
        used = 100 * (time.process_time() - begin) / LIVED_S
        where = "in one world" if is_shared else "each in its own world"
        print(f"{ROBOTS} robots turning, {engine}, {where}: {used:.0f} % of one core in real time (goal: < 100)")


def one_served() -> None:
    """Print what a served robot costs while nobody is there, and how even its packets come."""
    with served_pioneer(body="kinematic") as url:
        begin = time.process_time()
        time.sleep(WATCHED_S)
        print(f"one served robot, no client: {100 * (time.process_time() - begin) / WATCHED_S:.2f} % of one core")
        line = open_url(url)
        for number in (0, 1, 2, 1):
            line.write(command(number))
            time.sleep(0.05)
        line.write(command(C.ENABLE, 1) + command(C.RVEL, 20))
        arrivals: list[float] = []
        used, end = time.process_time(), time.monotonic() + WATCHED_S
        while time.monotonic() < end:
            if line.read():
                arrivals.append(time.monotonic())
                line.write(command(C.PULSE))
            time.sleep(0.0005)
        used = time.process_time() - used
        line.close()
    gaps = [1000 * (later - earlier) for earlier, later in pairwise(arrivals[1:])]
    print(f"packets min/median/max {min(gaps):.1f}/{statistics.median(gaps):.1f}/{max(gaps):.1f} ms apart", end="; ")
    print(f"{100 * used / WATCHED_S:.1f} % of one core, this client's polling included")


def many_served(robots: int, engine: str, *, turning: bool) -> None:
    """Print how even the packets of robots of one world come, served by a process that has one core to itself."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "hall.toml").write_text(HALL)
        order = f'world = "hall.toml"\nbody = "{engine}"\n' + "".join(
            f'[[robot]]\nport = "tcp:127.0.0.1:0"\nat = [{pose.x_m}, {pose.y_m}, 0]\n' for pose in places(robots)
        )
        (folder / "fleet.toml").write_text(order)
        words = [sys.executable, "-m", "p2os", "serve", "--fleet", str(folder / "fleet.toml"), "--json"]
        cores = sorted(os.sched_getaffinity(0))
        with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
            os.sched_setaffinity(process.pid, cores[-1:])
            try:
                urls = [json.loads(process.stdout.readline())["url"] for _ in range(robots)] if process.stdout else []
                os.sched_setaffinity(0, cores[:-1] or cores)
                gaps, used = watched(urls, process.pid, turning=turning)
            finally:
                os.sched_setaffinity(0, cores)
                process.terminate()
    even = sum(abs(gap - 100) <= 10 for gap in gaps) / len(gaps)
    what = f"{robots} {engine} robots served in one world, {'turning' if turning else 'motors off'}"
    print(f"{what}: {even:.1%} of {len(gaps)} packets came 100 +- 10 ms after the one before,", end=" ")
    print(f"{min(gaps):.0f} to {max(gaps):.0f} ms; the server takes {used:.0f} % of its core", flush=True)


def watched(urls: Sequence[str], server: int, *, turning: bool) -> tuple[list[float], float]:
    """Return the milliseconds between packets of each robot, and the share of a core that their server took, %."""
    lines = {socket.create_connection(url.removeprefix("tcp:").rsplit(":", 1), 10): list[float]() for url in urls}
    for number in (0, 1, 2, 1):
        for line in lines:
            line.sendall(command(number))
        time.sleep(1.0)
    for line in lines:
        line.sendall(command(C.ENABLE, 1) + command(C.RVEL, 20) if turning else command(C.PULSE))
    time.sleep(2.0)
    begin, used = time.monotonic(), cpu_s(server)
    fed = begin
    while (now := time.monotonic()) < begin + WATCHED_S:
        for line in select.select(list(lines), [], [], 0.01)[0]:
            line.recv(4096)
            lines[line].append(time.monotonic())
        if now > fed + 0.5:
            fed = now
            for line in lines:
                line.sendall(command(C.PULSE))
    share = 100 * (cpu_s(server) - used) / (time.monotonic() - begin)
    for line in lines:
        line.close()
    return [1000 * (later - earlier) for came in lines.values() for earlier, later in pairwise(came[1:])], share


def cpu_s(pid: int) -> float:
    """Return the processor time of a process, seconds."""
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    many_robots(ENGINE)
    one_served()
    if hasattr(os, "sched_setaffinity"):
        for number in sorted({ROBOTS // 4, ROBOTS // 2, ROBOTS} - {0}):
            many_served(number, ENGINE, turning=True)
        many_served(ROBOTS, ENGINE, turning=False)
