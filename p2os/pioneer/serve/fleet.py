"""Many hosts in one thread: each runs when it is due, and one wait serves them all.

Invariant: a host that has nothing due and nothing to read costs a comparison a round.
"""

from collections.abc import Callable, Sequence

from p2os.pioneer.controller.controller import EventCallback
from p2os.pioneer.serve.aux_endpoint import AuxEndpoint
from p2os.pioneer.serve.control_line import ControlLine
from p2os.pioneer.serve.fleet_order import FleetOrder, MadeFleet
from p2os.pioneer.serve.host import IDLE_WAIT_S, Host
from p2os.pioneer.serve.robot_time import RobotTime
from p2os.transport import Listener, listen_url
from p2os.transport.waiting import wait_readable
from p2os.transport.wall_clock import Clock, wall_clock
from simbase.timing import NS_PER_S


def open_hosts(
    order: FleetOrder,
    made: MadeFleet,
    *,
    events: Sequence[EventCallback | None],
    speed: float = 1.0,
    clock: Clock = wall_clock,
    listens: Sequence[Callable[[str], Listener]] = (),
) -> list[Host]:
    """Return a host for each robot of a fleet, listening at its port.

    Args:
        order: What was made.
        made: Its robots.
        events: Who is told what each of them does.
        speed: Robot seconds a second of the clock.
        clock: Nanoseconds; never goes back.
        listens: What makes the place of each from its URL; empty: `listen_url`.

    Raises:
        TransportError: A port is taken or cannot be had; none is kept open then.
    """
    shared_time = RobotTime(clock, speed)
    hosts: list[Host] = []
    try:
        for number, (robot, pioneer) in enumerate(zip(order.robots, made.robots, strict=True)):
            pioneer.on_event = events[number]
            hosts.append(
                Host(
                    pioneer, (listens[number] if listens else listen_url)(robot.port),
                    on_event=events[number], clock=clock, speed=speed,
                    shared=None if made.multi_robot_world is None else (shared_time, made.multi_robot_world, number),
                    paced=not robot.port.startswith("serial:"), sync_limit_ns=robot.sync_limit_ns,
                )
            )  # fmt: skip
            for port, url in robot.aux:  # one by one: each is given back if the next cannot be had
                hosts[-1].aux += (AuxEndpoint(port, listen_url(url)),)
    except BaseException:
        for host in hosts:
            host.close()
        raise
    return hosts


class Fleet:
    """Serves many robots.

    Args:
        hosts: One a robot.
        control: Where an operator gives orders, or None.
        ticks: What is called, and how often, in seconds.
    """

    def __init__(
        self,
        hosts: Sequence[Host],
        *,
        control: ControlLine | None = None,
        ticks: Sequence[tuple[float, Callable[[], None]]] = (),
    ) -> None:
        self.hosts = tuple(hosts)
        self.control = control
        self._ticks = tuple(ticks)
        self._next_ticks_s = [_now_s() + period_s for period_s, _ in self._ticks]
        #: When each is due next, by the clock, and the descriptors that it waits for.
        self._due_s = [0.0] * len(self.hosts)
        self._descriptors: list[list[int]] = [[] for _ in self.hosts]

    def run(self, *, until: Callable[[], bool] = lambda: False) -> None:
        """Serve until `until` is true or an exception (Ctrl-C) ends it; then close every client's line."""
        try:
            while not until():
                self.turn(IDLE_WAIT_S)
        finally:
            for host in self.hosts:
                host.close()
            if self.control is not None:
                self.control.close()

    def turn(self, longest_wait_s: float) -> None:
        """Run every host that is due, wait for the next deadline or bytes, and read where there are some."""
        now_s = _now_s()
        for index, host in enumerate(self.hosts):
            if self._due_s[index] <= now_s:
                host.run_due()
                self._schedule(index)
        for number, (period_s, call) in enumerate(self._ticks):
            if now_s >= self._next_ticks_s[number]:
                self._next_ticks_s[number] = now_s + period_s
                call()
        wait_s = min(*self._due_s, *self._next_ticks_s, now_s + longest_wait_s) - _now_s()
        ready = self._wait(wait_s)
        now_s = _now_s()
        for index, host in enumerate(self.hosts):
            is_due = self._due_s[index] <= now_s  # it runs in the next turn: scheduling it here would put that off
            if is_due or not ready.isdisjoint(self._descriptors[index]):
                host.read_lines()
                if not is_due:
                    self._schedule(index)
        if self.control is not None and self.control.serve(self.hosts):
            self._due_s = [0.0] * len(self.hosts)

    def _schedule(self, index: int) -> None:
        host = self.hosts[index]
        self._due_s[index] = _now_s() + host.wait_s()
        self._descriptors[index] = host.descriptors()

    def _wait(self, wait_s: float) -> set[int]:
        descriptors = [descriptor for found in self._descriptors for descriptor in found]
        if self.control is not None:
            descriptors += self.control.descriptors()
            wait_s = min(wait_s, self.control.poll_s or wait_s)
        return wait_readable(descriptors, wait_s)


def _now_s() -> float:
    return wall_clock() / NS_PER_S
