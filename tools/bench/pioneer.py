"""Print what virtual Pioneers cost: many in virtual time, and one served in real time.

Run it on an idle machine. Usage: python tools/bench/pioneer.py [ROBOTS [BODY]]
"""

import math
import statistics
import sys
import time
from itertools import pairwise

from p2os.pioneer.body.factory import make_scene
from p2os.pioneer.controller import Pioneer
from p2os.pioneer.serve import served_pioneer
from p2os.pioneer.serve.multi_robot_world import MultiRobotWorld
from p2os.pioneer.world import World, parse_world
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


def hall() -> World:
    """Return an empty hall with room for all of them, 2 m apart."""
    half = PITCH_M * (ROW + 1) / 2
    corners = ((-half, -half), (half, -half), (half, half), (-half, half))
    walls = "".join(
        f'[[wall]]\nname = "{number}"\nfrom_m = {list(begin)}\nto_m = {list(end)}\nfixed = true\n'
        for number, (begin, end) in enumerate(zip(corners, (*corners[1:], corners[0]), strict=True))
    )
    return parse_world(f'name = "hall"\nextent_m = [-{half}, -{half}, {half}, {half}]\n{walls}', "hall")


def many_robots(engine: str) -> None:
    """Print how much of one core many turning robots take in real time, in one world and each in its own."""
    parameters, world = load_parameters("p2dx"), hall()
    for is_shared in (False, True):
        places = [divmod(number, ROW) for number in range(ROBOTS)]
        poses = [Pose(*(PITCH_M * (place - (ROW - 1) / 2) for place in row), 0.0) for row in places]
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


many_robots(ENGINE)
one_served()
