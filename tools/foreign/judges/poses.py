"""A client says where every model that it knows is, with the packets of every family of firmware.

The robot is served here, so that its own count is known. The client drives it and prints poses; each has to lie on the
robot's way, where it was when it was printed or shortly before: a wrong factor of a model's distances or turns is a
pose beside it. Of the sonar, it has to have as many as the model.
"""

import math
import os
import queue
import re
import subprocess
import threading
import time
from collections import deque
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

from p2os.pioneer.controller.settings import ControllerSettings
from p2os.pioneer.serve.fleet import open_hosts
from p2os.pioneer.serve.fleet_order import FleetOrder, RobotOrder, make_fleet
from p2os.pioneer.serve.host import Host
from p2os.protocol.profiles import Profile
from p2os.robots.parameters import RobotParameters, known_robots, load_parameters
from p2os.transport import TcpUrl, parse_url
from tools.foreign.isolation import kill_tree
from tools.foreign.judges.drives import free_port
from tools.foreign.row import RowError, RowPlace, matching

#: chosen: a client that has not driven so far by then never will, s of the clock.
LONGEST_S = 40.0
#: A pose that is printed is at most so old: two packets, and what a busy machine adds, s.
OLDEST_S = 1.0
#: So far from the robot's way a pose may be, m, beside a share of its length; and so much may its heading be off, rad.
WAY_M, HEADING_RAD = 0.005, math.radians(1.5)
#: So far it has to come, and to turn, until a pose is judged for the last time, m and rad: on a curve of 50° a metre a
#: distance that is 2.5 % off is 1.5° off its place, wherever on the way it is taken to be.
LEAST_WAY_M, LEAST_TURN_RAD = 1.2, math.radians(45)
#: chosen: so many faults are named, the first ones; what is the matter with one model is so with each family.
MOST_NAMED = 9
#: chosen: so many cells at a time.
TOGETHER = 4
_LOOK_S = 0.02


@dataclass(frozen=True, kw_only=True)
class Poses:
    """Lets a client drive models and say where they are.

    Args:
        program: What has to be there, as of `Drives`.
        knows: Files of the client's source that its models are read from, a pattern of the cache.
        model: Expression for a model's name in such a file, with a group; empty: the files are called as models are.
        commands: What is started, as of `Drives`; {model} is the model too. The last one prints.
        pose: Expression for what it prints, with groups x, y and th.
        metres: Of one of its units of x and y.
        radians: Of one of its units of th.
        sonar: Expression for one sonar in what it prints; empty: it prints none.
        files: Written into the scratch folder before, as of `Drives`.
        environment: Variables.
        share: Of the way's length, that a pose may be beside it.
        client: Whose simulator the robot is, as of `p2os serve --for`; None: it is a robot.
        without: Models that it knows but cannot drive, and why.
        only: Models that are driven; empty: all that it knows.
    """

    program: str
    knows: str
    commands: tuple[tuple[str, ...], ...]
    pose: str
    model: str = ""
    metres: float = 1.0
    radians: float = 1.0
    sonar: str = ""
    files: tuple[tuple[str, str], ...] = ()
    environment: tuple[tuple[str, str], ...] = ()
    share: float = 0.01
    client: str | None = None
    without: tuple[tuple[str, str], ...] = ()
    only: tuple[str, ...] = ()

    @property
    def needs(self) -> tuple[str, ...]:
        """The client and its list of models."""
        return self.program, self.knows

    def run(self, place: RowPlace) -> str:
        """Return how many cells there were, and how far off the poses were at worst."""
        models = self.models(place.cache)
        cells = [(model, family) for model in models for family in Profile]
        with ThreadPoolExecutor(TOGETHER) as pool:
            results = list(pool.map(lambda cell: self._cell(*cell, place), cells))
        if failed := [result for result in results if result.fault]:
            named = "; ".join(f"{one.model} {one.family.value}: {one.fault}" for one in failed[:MOST_NAMED])
            raise RowError(f"{len(failed)} of {len(cells)} failed: {named}")
        worst_mm = 1000 * max(result.off_m for result in results)
        worst_deg = math.degrees(max(result.off_rad for result in results))
        counted = f", {sum(result.sonar for result in results)} sonar counted" if self.sonar else ""
        return (
            f"{len(models)} models with the packets of {', '.join(family.value for family in Profile)}: "
            f"{len(cells)} drives, poses {worst_mm:.0f} mm and {worst_deg:.1f}° off at worst{counted}"
        )

    def models(self, cache: Path) -> list[str]:
        """Return the models that are driven: those that both the client and this project know."""
        files = matching(self.knows, cache)
        if self.model:
            names = {name for file in files for name in re.findall(self.model, file.read_text(errors="replace"))}
        else:
            names = {file.stem for file in files}
        names -= {name for name, _ in self.without}
        return [name for name in known_robots() if name in names and name in (self.only or names)]

    def _cell(self, model: str, family: Profile, place: RowPlace) -> "Cell":
        scratch = place.scratch / f"{model}-{family.value}"
        scratch.mkdir()
        try:
            return self._drive(model, family, replace(place, scratch=scratch))
        except RowError as failure:
            return Cell(model=model, family=family, fault=str(failure))

    def _drive(self, model: str, family: Profile, place: RowPlace) -> "Cell":
        parameters = load_parameters(model)
        settings = ControllerSettings.of(client=self.client, firmware=family)
        order = FleetOrder(
            robots=(RobotOrder(port="tcp:127.0.0.1:0", model=model, settings=settings),), world="room", body="kinematic"
        )
        (host,) = open_hosts(order, make_fleet(order), events=[None])
        way = CountedWay(host)
        said: queue.SimpleQueue[str] = queue.SimpleQueue()
        processes: list[subprocess.Popen[str]] = []
        try:
            for process in self._started(model, host, place):
                processes.append(process)
                way.go_on(_LOOK_S)
            threading.Thread(target=_hear, args=(processes[-1], said), daemon=True).start()
            return self._judged(model, family, parameters, way, said)
        finally:
            for process in processes:
                kill_tree(process.pid)
                process.wait()
            host.close()

    def _judged(
        self,
        model: str,
        family: Profile,
        parameters: RobotParameters,
        way: "CountedWay",
        said: "queue.SimpleQueue[str]",
    ) -> "Cell":
        end, off_m, off_rad, sonar = time.monotonic() + LONGEST_S, 0.0, 0.0, 0
        poses = 0
        while time.monotonic() < end:
            way.go_on(_LOOK_S)
            if said.empty():
                continue
            line = said.get()
            sonar = max(sonar, len(re.findall(self.sonar, line))) if self.sonar else 0
            found = re.search(self.pose, line)
            if found is None:
                if poses and way.has_come_far and sonar >= parameters.sonar_fitted * bool(self.sonar):
                    return Cell(model=model, family=family, off_m=off_m, off_rad=off_rad, sonar=sonar)
                continue
            x, y, th = (float(found[name]) for name in ("x", "y", "th"))
            here_m, here_rad = way.off(x * self.metres, y * self.metres, th * self.radians)
            off_m, off_rad = max(off_m, here_m), max(off_rad, here_rad)
            if here_m > WAY_M + self.share * way.length_m or here_rad > HEADING_RAD:
                raise RowError(f"{found[0]!r} is {1000 * here_m:.0f} mm and {math.degrees(here_rad):.1f}° off the way")
            poses += way.has_come_far
            if poses and not self.sonar:
                return Cell(model=model, family=family, off_m=off_m, off_rad=off_rad)
        raise RowError(
            f"after {LONGEST_S:g} s {poses} poses far enough, {way.length_m:.2f} m, "
            f"{sonar} of {parameters.sonar_fitted} sonar"
        )

    def _started(self, model: str, host: Host, place: RowPlace) -> Iterator["subprocess.Popen[str]"]:
        """Start the client's programs."""
        parsed = parse_url(host.listener.description)
        values = {"url": host.listener.description, "model": model, "free": str(free_port())}
        values["program"] = str(place.path(self.program)) if "/" in self.program else self.program
        if isinstance(parsed, TcpUrl):
            values |= {"host": parsed.host, "port": str(parsed.port)}
        for name, text in self.files:
            (place.scratch / name).write_text(place.filled(text, **values))
        environment = {**os.environ, **{name: place.filled(text, **values) for name, text in self.environment}}
        for words in self.commands:
            yield subprocess.Popen(
                [place.filled(word, **values) for word in words], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT, text=True, errors="replace", start_new_session=True, cwd=place.scratch,
                env=environment,
            )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Cell:
    """What became of a model with a family of firmware."""

    model: str
    family: Profile
    fault: str = ""
    off_m: float = 0.0
    off_rad: float = 0.0
    sonar: int = 0


class CountedWay:
    """Where a robot counts that it was, lately.

    Args:
        host: Whose robot.
    """

    def __init__(self, host: Host) -> None:
        self._host = host
        #: (s, m, m, rad), the newest last.
        self._places: deque[tuple[float, float, float, float]] = deque([(time.monotonic(), 0.0, 0.0, 0.0)])
        self.length_m = self._turned_rad = 0.0

    def go_on(self, seconds: float) -> None:
        """Let the robot run for a while."""
        self._host.turn(seconds)
        state, now = self._host.pioneer.state, time.monotonic()
        x, y, heading = state.x_mm / 1000, state.y_mm / 1000, state.heading_rad
        _, old_x, old_y, old_heading = self._places[-1]
        self.length_m += math.hypot(x - old_x, y - old_y)
        self._turned_rad += abs(math.remainder(heading - old_heading, math.tau))
        self._places.append((now, x, y, heading))
        while self._places[0][0] < now - OLDEST_S:
            self._places.popleft()

    @property
    def has_come_far(self) -> bool:
        """Tell whether a factor would show by now."""
        return self.length_m >= LEAST_WAY_M and self._turned_rad >= LEAST_TURN_RAD

    def off(self, x: float, y: float, heading: float) -> tuple[float, float]:
        """Return how far a pose is from the nearest of where the robot was within `OLDEST_S`, m and rad."""
        places = [place[1:] for place in self._places]
        return min(_off(x, y, heading, *pair) for pair in pairwise((*places, places[-1])))


def _off(
    x: float, y: float, heading: float, begin: tuple[float, float, float], end: tuple[float, float, float]
) -> tuple[float, float]:
    """Return how far a pose is from a piece of a way, m, and from its heading there, rad."""
    dx, dy = end[0] - begin[0], end[1] - begin[1]
    turned, length2 = math.remainder(end[2] - begin[2], math.tau), dx * dx + dy * dy
    if length2:
        share = ((x - begin[0]) * dx + (y - begin[1]) * dy) / length2
    else:  # it stood, or turned on the spot
        share = math.remainder(heading - begin[2], math.tau) / turned if turned else 0.0
    share = max(0.0, min(1.0, share))
    off_rad = math.remainder(heading - begin[2] - share * turned, math.tau)
    return math.hypot(x - begin[0] - share * dx, y - begin[1] - share * dy), abs(off_rad)


def _hear(process: "subprocess.Popen[str]", said: "queue.SimpleQueue[str]") -> None:
    for line in process.stdout or ():
        said.put(line)
