"""A client's core and a virtual Pioneer on one imagined line, in virtual time.

The line can be slow, split, lose, garble and be pulled; the robot can be served
over TCP (it hangs up when the line closes) or stand at a serial port's end, at
its own baud rate. Nothing reads a clock.
"""

import heapq
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from random import Random

from p2os.client.core import RobotCore
from p2os.client.notices import LinkLost, Notice
from p2os.client.outbox import CloseLine, OpenLine, Send, SetBaud
from p2os.client.robot_state import Link, RobotState
from p2os.client.settings import ClientSettings
from p2os.pioneer.body.factory import make_body
from p2os.pioneer.controller import ControllerSettings, Pioneer
from p2os.pioneer.world import load_world
from p2os.protocol.commands import Command
from p2os.protocol.frames import Frame
from p2os.robots.parameters import RobotParameters, load_parameters
from simbase.timing import NS_PER_MS, NS_PER_S
from tests.p2os.perfect_body import PerfectBody

MS, S = NS_PER_MS, NS_PER_S
#: bytes and random source → pieces that arrive, each with its delay.
Wire = Callable[[bytes, Random], list[tuple[int, bytes]]]


def _flip(data: bytes, random_source: Random) -> bytes:
    place = random_source.randrange(len(data))
    return data[:place] + bytes((data[place] ^ 1 << random_source.randrange(8),)) + data[place + 1 :]


WIRES: dict[str, Wire] = {
    "perfect": lambda data, _: [(0, data)],
    "byte by byte": lambda data, _: [(index * MS, data[index : index + 1]) for index in range(len(data))],
    "late": lambda data, random_source: [(random_source.randrange(0, 60) * MS, data)],
    "lossy": lambda data, random_source: [] if random_source.random() < 0.1 else [(0, data)],
    "garbling": lambda data, random_source: [(0, _flip(data, random_source) if random_source.random() < 0.1 else data)],
}


@cache
def parameters(model: str = "p2dx") -> RobotParameters:
    return load_parameters(model)


def new_pioneer(model: str = "p2dx", **settings: object) -> Pioneer:
    """Return a robot in a room, with walls."""
    world = load_world("arena", seed=0) if settings.pop("crowded", False) else load_world("room")
    body = make_body("kinematic", world, parameters(model))
    body.reset(world.start, 0)
    return Pioneer(parameters=parameters(model), body=body, settings=ControllerSettings(**settings))  # type: ignore[arg-type]


def free_pioneer(model: str = "p2dx", **settings: object) -> Pioneer:
    """Return a robot with nothing in its way; its controller moves it in steps of a twentieth of a packet's cycle."""
    body = PerfectBody(dt_ns=5 * MS)
    return Pioneer(parameters=parameters(model), body=body, settings=ControllerSettings(**settings))  # type: ignore[arg-type]


@dataclass
class Rig:
    """Both ends, and the line between."""

    settings: ClientSettings = field(default_factory=ClientSettings)
    wire: str = "perfect"
    seed: int = 0
    #: None: TCP. Else the rate of the client's port at opening.
    baud: int | None = None
    robot_baud: int = 9600
    pioneer: Pioneer = field(default_factory=free_pioneer)
    now: int = 0

    def __post_init__(self) -> None:
        self.core = RobotCore(self.settings)
        self.random_source = Random(self.seed)
        self.is_plugged = True
        #: A cut line of which neither end is told: a half-open TCP peer, a loose wire.
        self.is_cut = False
        self.is_open = False
        self.line_baud: int | None = None
        self.sent: list[tuple[int, Command]] = []
        self.news: list[RobotState | Notice] = []
        #: How long each search took.
        self.searches_ns: list[int] = []
        self._searching_since: int | None = None
        #: How many commands had been sent at each loss.
        self.losses: list[int] = []
        self._on_the_way: list[tuple[int, int, bool, bytes]] = []
        self._last: dict[bool, int] = {}
        self._count = 0

    # What a test does -----------------------------------------------------------------

    def connect(self) -> "Rig":
        self.core.connect(self.now)
        self.until(lambda: self.core.is_ready)
        return self

    def run(self, seconds: float) -> None:
        self._go(self.now + round(seconds * S), lambda: False)

    def until(self, is_so: Callable[[], bool], within_s: float = 60) -> None:
        def looked() -> bool:
            if self.core._mover.has_goal:  # a program that waits for one makes calls
                self.core.touch(self.now)
            return is_so()

        self._go(self.now + round(within_s * S), looked)
        assert is_so(), f"not within {within_s} s: {self.core.link}, {self.notices()[-5:]}"

    def living(self, seconds: float) -> None:
        """Run, as a program that makes calls."""
        end = self.now + round(seconds * S)
        while self.now < end:
            self.core.touch(self.now)
            self._go(min(end, self.now + 200 * MS), lambda: False)

    def pull(self) -> None:
        """Pull the plug: the system tells at once."""
        self.is_plugged = False
        self._on_the_way.clear()
        if self.is_open:
            self.is_open = False
            self.core.line_lost("the line vanished", self.now)
            if self.baud is None:
                self.pioneer.hang_up(self.now)
        self._exchange()

    def plug(self) -> None:
        self.is_plugged = True

    def reboot(self) -> None:
        """Switch the robot off and on: it forgets its session and stands."""
        self.pioneer.hang_up(self.now)
        self.robot_baud = 9600
        self._exchange()

    def commands(self, since: int = 0) -> list[Command]:
        return [command for at, command in self.sent if at >= since]

    def notices(self, kind: type | None = None) -> list[Notice]:
        found = [item for item in self.news if not isinstance(item, RobotState)]
        return found if kind is None else [item for item in found if isinstance(item, kind)]

    @property
    def states(self) -> list[RobotState]:
        return [item for item in self.news if isinstance(item, RobotState)]

    @property
    def wheels(self) -> tuple[float, float]:
        """What the robot's controller wants of its wheels now, m/s."""
        state = self.pioneer.state
        return state.left_setpoint_mps, state.right_setpoint_mps

    # The line -------------------------------------------------------------------------

    def _go(self, end: int, is_so: Callable[[], bool]) -> None:
        self._exchange()
        while not is_so() and self.now < end:
            due = [self.core.next_deadline(), self.pioneer.next_deadline(), end]
            due += [self._on_the_way[0][0]] if self._on_the_way else []
            self.now = max(self.now, min(at for at in due if at is not None))
            self._exchange()

    def _exchange(self) -> None:
        """Bring everything to `now`."""
        while self._on_the_way and self._on_the_way[0][0] <= self.now:
            _, _, to_robot, data = heapq.heappop(self._on_the_way)
            if to_robot:
                self.pioneer.receive(data, self.now)
            elif self.is_open:
                self.core.receive(data, self.now)
        self.pioneer.advance_to(self.now)
        for data in self.pioneer.take_output():
            self._carry(data, to_robot=False)
        self.core.advance_to(self.now)
        self._collect()
        while (action := self.core.take_action(self.now)) is not None:
            self._do(action)
            self.core.advance_to(self.now)
            self._collect()

    def _collect(self) -> None:
        if self.core.link is Link.SEARCHING or self.core.link is Link.STARTING:
            self._searching_since = self.now if self._searching_since is None else self._searching_since
        elif self._searching_since is not None:
            self.searches_ns.append(self.now - self._searching_since)
            self._searching_since = None
        self.losses += [len(self.sent) for item in self.core.news if isinstance(item, LinkLost)]
        self.news += self.core.news
        self.core.news.clear()

    def _do(self, action: object) -> None:
        match action:
            case OpenLine() if self.is_plugged:
                self.is_open, self.line_baud = True, self.baud
                self.core.line_opened(self.now, self.baud)
            case OpenLine():
                self.core.line_failed("cannot open the line: no such port", None, self.now)
            case CloseLine():
                self.is_open = False
                if self.baud is None and self.is_plugged and not self.is_cut:
                    self._deliver_last()
                    self.pioneer.hang_up(self.now)
            case SetBaud():
                self.line_baud = action.baud
            case Send():
                assert self.is_open, "a frame on a closed line"
                self.sent.append((self.now, Command.from_frame(Frame.from_bytes(action.data))))
                self._carry(action.data, to_robot=True)

    def _deliver_last(self) -> None:
        """Bring what a TCP connection still carries to the robot: it comes before the end of the line."""
        while self._on_the_way:
            _, _, to_robot, data = heapq.heappop(self._on_the_way)
            if to_robot:
                self.pioneer.receive(data, self.now)

    def _carry(self, data: bytes, *, to_robot: bool) -> None:
        if self.is_cut or not self.is_plugged:
            return
        if self.baud is not None and self.line_baud != self.robot_baud:
            data = bytes(self.random_source.randrange(256) for _ in data)
        for delay, piece in WIRES[self.wire](data, self.random_source):
            at = self._last[to_robot] = max(self._last.get(to_robot, 0), self.now + delay)
            self._count += 1
            heapq.heappush(self._on_the_way, (at, self._count, to_robot, piece))


__all__ = ["MS", "WIRES", "Link", "Rig", "S", "free_pioneer", "new_pioneer"]
