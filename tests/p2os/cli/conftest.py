"""A virtual Pioneer served over TCP in the background, for the verbs that talk to a robot."""

import contextlib
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from p2os import Robot
from p2os.cli import main as cli
from p2os.cli.held_robot import RobotWatch
from p2os.pioneer.controller import ControllerSettings
from p2os.pioneer.serve import served_pioneer
from p2os.protocol.times import CYCLE_NS
from p2os.transport.virtual_clock import VirtualClock
from p2os.transport.wall_clock import Clock, wall_clock
from tests.p2os.client.served_robot import QUICK_CYCLE_NS

sys.path.insert(0, str(Path(__file__).parents[1] / "client"))  # `ServedRobot`, whose wheels can be looked at


@dataclass
class Served:
    """A robot that lives in a thread until the test is over."""

    url: str
    events: list[str] = field(default_factory=list)

    @property
    def text(self) -> str:
        return "\n".join(self.events)


@contextlib.contextmanager
def serving(clock: Clock = wall_clock) -> Iterator[Served]:
    served = Served("")

    def tell(_now: int, what: str, detail: str) -> None:
        served.events.append(f"{what}: {detail}")

    settings = ControllerSettings(sip_period_ns=CYCLE_NS if isinstance(clock, VirtualClock) else QUICK_CYCLE_NS)
    with served_pioneer(body="kinematic", settings=settings, on_event=tell, clock=clock) as served.url:
        yield served


@pytest.fixture
def served() -> Iterator[Served]:
    """A 2-DX in a room on a free TCP port."""
    with serving() as served:
        yield served


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> VirtualClock:
    """A virtual clock, in place of the real one of the verbs in this process that hold a `Robot`."""
    clock = VirtualClock()
    for made in (Robot, RobotWatch):
        monkeypatch.setitem(made.__init__.__kwdefaults__, "clock", clock)  # type: ignore[misc]
    return clock


@pytest.fixture
def fast(clock: VirtualClock) -> Iterator[Served]:
    """A 2-DX in a room, on a clock that jumps where all wait."""
    with serving(clock) as served:
        yield served


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch) -> Callable[..., int]:
    """The command line, with help that is as wide on every terminal."""
    monkeypatch.setenv("COLUMNS", "100")
    return lambda *words: cli.run([str(word) for word in words])
