"""Every model that is served is driven by every client of ours, whichever firmware's packets it sends; and stops.

A cell: a model, the firmware that it is served with (None: what `p2os serve` sends by itself), a client. In each the
robot drives, and then its program falls silent: STOP leaves within 2.1 s of the last call, and the wheels stand within
3.5 s of it. All on one virtual clock.
"""

import asyncio
import contextlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import pytest

from p2os import Robot
from p2os.cli import main as cli
from p2os.cli.held_robot import RobotWatch
from p2os.cli.robots import ros
from p2os.client.aio import Robot as AsyncRobot
from p2os.pioneer.controller import ControllerSettings, Pioneer
from p2os.pioneer.serve.fleet import open_hosts
from p2os.pioneer.serve.fleet_order import FleetOrder, RobotOrder, make_fleet
from p2os.protocol.commands import Command, CommandNumber
from p2os.protocol.frames import Decoder, Frame
from p2os.protocol.profiles import Profile, profiles_of
from p2os.robots.model import FIRMWARE
from p2os.robots.parameters import known_robots, load_parameters
from p2os.ros.robot_node import RobotNode
from p2os.ros.transport import Received
from p2os.transport.virtual_clock import VirtualClock
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos
from tests.p2os.ros.test_node_loop import OPTIONS, Network, twist

#: From a program's last call to STOP, and from STOP to a stand.
STOP_WITHIN_NS, STAND_WITHIN_NS = 2100 * NS_PER_MS, 3500 * NS_PER_MS
#: How far and how fast a robot drives: 0.3 m/s is within the limits of all.
WAY_M, SPEED_MPS = 0.3, 0.3
#: Longer than both together.
SILENCE_S = 6.0

Cell = tuple[str, Profile | None]
CELLS: list[Cell] = [(model, profile) for model in known_robots() for profile in (None, *Profile)]
#: One a family and one a disagreement of name and packets, both ways.
SAMPLE: list[Cell] = [("p2dx", None), ("p3dx", None), ("p3dx-sh", None), ("p3dx-sh", Profile.P2OS),
                      ("amigo", Profile.P2OS), ("p2at", Profile.ARCOS), ("seekur", Profile.AROS)]  # fmt: skip


@dataclass
class Served:
    """A robot that is served as `p2os serve` does it, and what came to it."""

    pioneer: Pioneer
    clock: VirtualClock
    url: str = ""
    said: list[tuple[Nanos, Command]] = field(default_factory=list)
    #: When its wheels last turned.
    moved_at: Nanos = 0
    _decoder: Decoder = field(default_factory=Decoder)

    def __post_init__(self) -> None:
        receive, advance_to = self.pioneer.receive, self.pioneer.advance_to

        def received(data: bytes, now: Nanos) -> None:
            self._decoder.receive(data, now)
            while (item := self._decoder.next_item()) is not None:
                if isinstance(item, Frame):
                    self.said.append((self.clock(), Command.from_frame(item)))
            receive(data, now)

        def advanced(limit: Nanos) -> object:
            reached = advance_to(limit)
            if self.wheels_mps != (0.0, 0.0):
                self.moved_at = self.clock()
            return reached

        self.pioneer.receive, self.pioneer.advance_to = received, advanced  # type: ignore[method-assign,assignment]  # listens

    @property
    def wheels_mps(self) -> tuple[float, float]:
        state = self.pioneer.state
        return state.left_setpoint_mps, state.right_setpoint_mps

    @property
    def way_m(self) -> float:
        """How far it has come, as its body has it."""
        start, state = self._start, self.pioneer.body.state
        return ((state.x_m - start[0]) ** 2 + (state.y_m - start[1]) ** 2) ** 0.5

    def begin(self) -> None:
        state = self.pioneer.body.state
        self._start = state.x_m, state.y_m

    def check_stop(self, called_at: Nanos) -> None:
        """Hold what was said after a program's last call against the limits, after its silence."""
        stops = [at for at, command in self.said if command.number == CommandNumber.STOP and at >= called_at]
        assert stops, "no STOP"
        assert stops[0] - called_at <= STOP_WITHIN_NS, f"STOP {(stops[0] - called_at) / NS_PER_S} s after the last call"
        assert self.wheels_mps == (0.0, 0.0), "it still drives"
        assert self.moved_at - stops[0] <= STAND_WITHIN_NS, f"it stood {(self.moved_at - stops[0]) / NS_PER_S} s later"


@contextlib.contextmanager
def serving(model: str, profile: Profile | None) -> Iterator[Served]:
    import threading

    clock = VirtualClock()
    order = FleetOrder(
        robots=(RobotOrder(port="tcp:127.0.0.1:0", model=model, settings=ControllerSettings.of(firmware=profile)),),
        body="kinematic",
    )  # fmt: skip
    made = make_fleet(order)
    served = Served(made.robots[0], clock)
    (host,) = open_hosts(order, made, events=[None], clock=clock)
    served.url, is_over = host.listener.description, threading.Event()

    def serve() -> None:
        while not is_over.is_set():
            host.turn(0.02)
        host.close()

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    clock.add(thread)
    served.begin()
    try:
        yield served
    finally:
        is_over.set()
        clock.until(lambda: not thread.is_alive())


def by_robot(served: Served, _patch: pytest.MonkeyPatch) -> None:
    """Drive, then hold a speed and fall silent."""
    with Robot(served.url, clock=served.clock) as robot:
        robot.drive(WAY_M)
        assert served.way_m == pytest.approx(WAY_M, abs=0.03)
        robot.set_velocity(SPEED_MPS)
        called_at = served.clock()
        served.clock.sleep(SILENCE_S)
        assert served.way_m > WAY_M + 0.2
        served.check_stop(called_at)


def by_asyncio_robot(served: Served, _patch: pytest.MonkeyPatch) -> None:
    async def drive() -> None:
        async with AsyncRobot(served.url, clock=served.clock) as robot:
            await robot.drive(WAY_M)
            assert served.way_m == pytest.approx(WAY_M, abs=0.03)
            robot.set_velocity(SPEED_MPS)
            called_at = served.clock()
            await asyncio.sleep(SILENCE_S)
            assert served.way_m > WAY_M + 0.2
            served.check_stop(called_at)

    with asyncio.Runner(loop_factory=served.clock.event_loop) as runner:
        runner.run(drive())


def by_drive(served: Served, patch: pytest.MonkeyPatch) -> None:
    """Drive a way, then hold a speed for a time; each ends standing."""
    for made in (Robot, RobotWatch):
        patch.setitem(made.__init__.__kwdefaults__, "clock", served.clock)  # type: ignore[misc]
    assert cli.run(["drive", served.url, "--forward", f"{WAY_M}m"]) == 0
    assert served.way_m == pytest.approx(WAY_M, abs=0.03)
    began = served.clock()
    assert cli.run(["drive", served.url, "--vel", f"{SPEED_MPS}m/s", "--for", "2s"]) == 0
    moving = [
        at for at, command in served.said if command.number == CommandNumber.VEL and command.argument and at > began
    ]
    served.clock.sleep(SILENCE_S)
    assert served.way_m > WAY_M + 0.2
    served.check_stop(moving[-1])


@dataclass
class Publisher(Network):
    """cmd_vel ten times a second for three seconds; then nobody asks any more."""

    clock: VirtualClock = field(default_factory=VirtualClock)
    ends_at: Nanos = 0

    def take(self, timeout_s: float) -> list[Received]:
        self.clock.sleep(min(timeout_s, 0.1))
        return [twist(SPEED_MPS)] if self.clock() < self.ends_at else []


def by_ros(served: Served, patch: pytest.MonkeyPatch) -> None:
    clock = served.clock
    patch.setattr(ros, "wall_clock", clock)
    with Robot(served.url, clock=clock, deadman_s=1.0) as robot:
        network = Publisher(clock=clock, ends_at=clock() + 3 * NS_PER_S)
        node = RobotNode(robot.parameters, OPTIONS, deadman_ns=ros.DEADMAN_NS)
        called_at, ends_at = network.ends_at, network.ends_at + round(SILENCE_S * NS_PER_S)
        ros.NodeLoop(robot, network, node).run(lambda: clock() >= ends_at)
        assert served.way_m > WAY_M
        served.check_stop(called_at)


CLIENTS: dict[str, Callable[[Served, pytest.MonkeyPatch], None]] = {
    "robot": by_robot, "asyncio": by_asyncio_robot, "drive": by_drive, "ros": by_ros,
}  # fmt: skip


def named(cell: Cell) -> str:
    return f"{cell[0]}-{'default' if cell[1] is None else cell[1].value}"


def tried(cell: Cell, client: str, patch: pytest.MonkeyPatch) -> None:
    with serving(*cell) as served:
        CLIENTS[client](served, patch)


@pytest.mark.parametrize("client", CLIENTS)
@pytest.mark.parametrize("cell", SAMPLE, ids=named)
def test_a_served_model_drives_and_stops(cell: Cell, client: str, monkeypatch: pytest.MonkeyPatch) -> None:
    tried(cell, client, monkeypatch)


@pytest.mark.soak
@pytest.mark.parametrize("client", CLIENTS)
@pytest.mark.parametrize("cell", CELLS, ids=named)
def test_every_model_drives_and_stops(cell: Cell, client: str, monkeypatch: pytest.MonkeyPatch) -> None:
    tried(cell, client, monkeypatch)


def test_the_families_of_the_models_are_those_of_the_protocol() -> None:
    assert tuple(profile.value for profile in Profile) == FIRMWARE
    assert {profiles_of(load_parameters(model)) for model in known_robots()} == {(profile,) for profile in Profile}
