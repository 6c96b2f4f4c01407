"""A mapper and a planner of others drive a virtual robot through a world by ROS 2, and are held to the world's truth.

The robot is served here, in real time, so that its true pose and its contacts are known; `p2os ros` makes it a node;
the programs of others are nodes of their own beside it. A goal counts where the robot itself stands within the
tolerance of it when the navigator says so, and the map by where the world's things really are.
"""

import contextlib
import json
import math
import os
import queue
import random
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from p2os.pioneer.controller.settings import ControllerSettings
from p2os.pioneer.devices.laser import read_laser
from p2os.pioneer.sensor_errors import load_sensor_errors
from p2os.pioneer.serve.fleet import open_hosts
from p2os.pioneer.serve.fleet_order import FleetOrder, RobotOrder, make_fleet
from p2os.pioneer.serve.host import Host
from p2os.pioneer.serve.orders import carry_out
from p2os.pioneer.world import load_world
from p2os.pioneer.world.geometry import Footprint
from tools.foreign.isolation import nothing_left
from tools.foreign.judges.map_truth import share_found, share_near
from tools.foreign.nodes.driving import Grid
from tools.foreign.row import RowError, RowPlace

NODES = Path(__file__).resolve().parents[1] / "nodes"
#: chosen: domains that neither ROS nor a user's robot is likely to have.
DOMAINS = range(60, 100)
#: chosen: so long without a goal reached or given up, and something is dead, s of the clock.
SILENCE_S = 200.0
LASER = "lms2xx"
#: An occupied cell and a thing that are so near to each other are one, m.
NEAR_M = 0.10
#: chosen: the robot's turns end so often to look at what the nodes say, s.
_LOOK_S = 0.02


@dataclass(frozen=True, kw_only=True)
class Navigates:
    """Lets nodes of others map a world and drive a robot to goals in it.

    Args:
        python: A Python with rclpy, of the cache.
        programs: What the nodes load, files of the cache.
        libraries: Folders of the cache for LD_LIBRARY_PATH.
        commands: Arguments of that Python, one command behind the other beside `p2os ros`. {nodes} is our folder of
            nodes, {goals} the goals as JSON, {map} a file that the last leaves, an occupancy grid as NumPy has it. The
            last says `reached N`, `gave up N`, and `done`.
        goals: m, in the world's frame, which is that of the map: the robot begins at 0, 0, and looks along x.
        world: Which one.
        without: Things that are taken out of it.
        errors: The robot's sensors', as of `p2os serve --errors`.
        tolerance_m: The robot itself is so near to a goal that counts.
        least_near: The least share of occupied cells that are near to a thing.
        least_found: The least share of the outlines that are found.
    """

    python: str
    programs: tuple[str, ...]
    libraries: tuple[str, ...]
    commands: tuple[tuple[str, ...], ...]
    goals: tuple[tuple[float, float], ...]
    world: str = "office"
    without: tuple[str, ...] = ()
    errors: str = "realistic"
    tolerance_m: float = 0.25
    least_near: float = 0.95
    least_found: float = 0.90

    @property
    def needs(self) -> tuple[str, ...]:
        """Python and what the nodes load."""
        return (self.python, *self.programs)

    def run(self, place: RowPlace) -> str:
        """Return what was reached, and how true the map is."""
        host = served(self.world, self.errors, self.without)
        journey = Journey(host, self.goals, self.tolerance_m)
        try:
            with self._nodes(host, place) as (said, processes):
                journey.follow(said, processes)
        finally:
            host.close()
        if journey.faults():
            raise RowError(f"{journey.text()}: {', '.join(journey.faults())}")
        near, found = self._judged(place.scratch / "map.npz")
        summary = (
            f"{journey.text()}; map: {near:.1%} of the occupied cells within {NEAR_M:g} m of what stands there, "
            f"{found:.1%} of the outlines found"
        )
        if near < self.least_near or found < self.least_found:
            raise RowError(f"{summary}, less than {self.least_near:.0%} and {self.least_found:.0%}")
        return summary

    def _judged(self, file: Path) -> tuple[float, float]:
        if not file.is_file():
            raise RowError("the navigator left no map")
        with np.load(file) as kept:
            grid = Grid(kept["cells"], *map(float, kept["corner"]), float(kept["size"]))
        things = standing(self.world, self.without)
        return share_near(grid, things, NEAR_M), share_found(grid, things, NEAR_M)

    @contextlib.contextmanager
    def _nodes(
        self, host: Host, place: RowPlace
    ) -> Iterator[tuple["queue.SimpleQueue[str]", list["subprocess.Popen[str]"]]]:
        """Start `p2os ros` and the nodes; give what the last of them says, line by line."""
        domain = str(random.SystemRandom().choice(DOMAINS))
        (place.scratch / "goals.json").write_text(json.dumps(self.goals))
        python = str(place.path(self.python))
        values = {
            "nodes": str(NODES), "goals": str(place.scratch / "goals.json"), "map": str(place.scratch / "map.npz"),
        }  # fmt: skip
        words = [sys.executable, "-m", "p2os", "ros", host.listener.description, "--laser", LASER, "--domain", domain]
        commands = [words, *([python, *(place.filled(word, **values) for word in one)] for one in self.commands)]
        theirs = {
            **os.environ, "ROS_DOMAIN_ID": domain, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "ROS_HOME": str(place.scratch), "OMP_NUM_THREADS": "1", "PYTHONUNBUFFERED": "1",
            "LD_LIBRARY_PATH": ":".join(str(place.path(one)) for one in self.libraries),
        }  # fmt: skip
        said: queue.SimpleQueue[str] = queue.SimpleQueue()
        with nothing_left():
            processes = [_started(one, os.environ if one is words else theirs) for one in commands]
            threading.Thread(target=_hear, args=(processes[-1], said), daemon=True).start()
            yield said, processes


class Journey:
    """What a robot does from goal to goal, by its body's own account.

    Args:
        host: Whose robot it is.
        goals: Where it is to go.
        tolerance_m: How near.
    """

    def __init__(self, host: Host, goals: Sequence[tuple[float, float]], tolerance_m: float) -> None:
        self._host, self._goals, self._tolerance_m = host, goals, tolerance_m
        #: Of each goal that was said to be reached, how far from it the robot was, m.
        self.off_m: dict[int, float] = {}
        self.given_up: list[int] = []
        self.way_m = self.took_s = 0.0

    def follow(self, said: "queue.SimpleQueue[str]", processes: Sequence["subprocess.Popen[str]"]) -> None:
        """Run the robot until the navigator is done.

        Raises:
            RowError: A node ended, or nothing was said for long.
        """
        began = heard_at = time.monotonic()
        last = self._host.pioneer.body.state
        while True:
            self._host.turn(_LOOK_S)
            here = self._host.pioneer.body.state
            self.way_m += math.hypot(here.x_m - last.x_m, here.y_m - last.y_m)
            last, self.took_s = here, time.monotonic() - began
            if time.monotonic() > heard_at + SILENCE_S:
                raise RowError(f"{self.text()}: nothing more for {SILENCE_S:g} s, at {here.x_m:.2f}, {here.y_m:.2f} m")
            if not said.empty():
                heard_at = time.monotonic()
                if self.hear(said.get()):
                    return
            elif codes := [code for process in processes if (code := process.poll()) is not None]:
                raise RowError(f"{self.text()}: a node ended with code {codes[0]}")

    def hear(self, line: str) -> bool:
        """Take what the navigator says; tell whether it is done."""
        what, _, number = line.rpartition(" ")
        if what == "reached":
            (x, y), body = self._goals[int(number) - 1], self._host.pioneer.body.state
            self.off_m[int(number)] = math.hypot(x - body.x_m, y - body.y_m)
        elif what == "gave up":
            self.given_up.append(int(number))
        return line == "done"

    def faults(self) -> list[str]:
        """Return what is not as it must be."""
        found = [f"goal {number} given up" for number in self.given_up]
        missed = set(range(1, len(self._goals) + 1)) - set(self.off_m) - set(self.given_up)
        found += [f"goal {number} never reached" for number in sorted(missed)]
        found += [f"{off:.2f} m off goal {number}" for number, off in self.off_m.items() if off > self._tolerance_m]
        if touched := self._host.pioneer.body.state.collisions:
            found.append(f"{touched} contacts")
        return found

    def text(self) -> str:
        """Return how it went so far."""
        worst = max(self.off_m.values(), default=math.nan)
        return (
            f"{len(self.off_m)} of {len(self._goals)} goals, {worst:.2f} m off at worst, "
            f"{self._host.pioneer.body.state.collisions} contacts, {self.way_m:.0f} m in {self.took_s:.0f} s"
        )


def served(world: str, errors: str, without: Sequence[str]) -> Host:
    """Return a robot with a laser, on a port of its own, in a world less some things."""
    settings = ControllerSettings.of(laser=read_laser(LASER), errors=load_sensor_errors(errors))
    order = FleetOrder(
        robots=(RobotOrder(port="tcp:127.0.0.1:0", settings=settings),), world=world, body="kinematic", seed=1
    )
    (host,) = open_hosts(order, make_fleet(order), events=[None])
    for name in without:
        carry_out([host], f"remove {name}")
    return host


def standing(world: str, without: Sequence[str]) -> list[Footprint]:
    """Return what a laser on the robot meets in a world less some things."""
    high_m = 0.2
    return [
        Footprint(one)
        for one in load_world(world, seed=1).obstacles
        if one.name not in without and one.stands_in(high_m, high_m + 0.01)
    ]


def _started(words: Sequence[str], environment: Mapping[str, str]) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        words, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True, start_new_session=True,
        env=dict(environment),
    )  # fmt: skip


def _hear(process: "subprocess.Popen[str]", said: "queue.SimpleQueue[str]") -> None:
    for line in process.stdout or ():
        print(line, end="")
        said.put(line.strip())
