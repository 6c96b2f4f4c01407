"""Print what virtual Pioneers cost: many in virtual time, and one served in real time.

Run it on an idle machine. Usage: python tools/bench_pioneer.py [ROBOTS]
"""

import statistics
import sys
import time
from itertools import pairwise

from p2os.commands import Command
from p2os.commands import CommandNumber as C
from p2os.parameters import load_parameters
from p2os.pioneer.body import make_body
from p2os.pioneer.controller import Pioneer
from p2os.pioneer.served import served_pioneer
from p2os.pioneer.world import load_world
from p2os.timing import NS_PER_MS, NS_PER_S
from p2os.transport import open_url

ROBOTS = int(sys.argv[1]) if len(sys.argv) > 1 else 64
#: Robot seconds of the first figure, seconds of the others.
LIVED_S, WATCHED_S = 10, 5


def command(number: int, argument: int | None = None) -> bytes:
    """Return a command's bytes."""
    return Command(number, argument).to_frame().to_bytes()


def many_robots() -> None:
    """Print how much of one core many driving robots take in real time."""
    parameters, world = load_parameters("p2dx"), load_world("room")
    robots = [Pioneer(parameters=parameters, body=make_body("kinematic", world, parameters)) for _ in range(ROBOTS)]
    for robot in robots:
        for data in (*map(command, (0, 1, 2, 1)), command(C.ENABLE, 1), command(C.RVEL, 20)):
            robot.receive(data, 0)
    begin = time.process_time()
    for at in range(100 * NS_PER_MS, LIVED_S * NS_PER_S + 1, 100 * NS_PER_MS):
        for robot in robots:
            robot.receive(command(C.PULSE), at)
            robot.take_output()
    used = time.process_time() - begin
    print(f"{ROBOTS} robots turning, kinematic: {100 * used / LIVED_S:.0f} % of one core in real time (goal: < 100)")


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


many_robots()
one_served()
