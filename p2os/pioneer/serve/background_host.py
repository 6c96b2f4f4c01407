"""A host in a background thread of a program: a virtual robot to try a client out, and for its tests.

    with served_pioneer(world="room") as served:
        with Robot(served) as robot:
            robot.drive(0.5)
        served.reset()

It is `p2os serve` in a thread: real time, one client at a time; with a `VirtualClock` as
fast as the machine is.
"""

import contextlib
import queue
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from pathlib import Path
from typing import Self

from p2os.pioneer.body.factory import BEST
from p2os.pioneer.controller import ControllerSettings
from p2os.pioneer.controller.flash import load_flash
from p2os.pioneer.devices.laser import read_laser
from p2os.pioneer.sensor_errors import load_sensor_errors
from p2os.pioneer.serve.fleet import open_hosts
from p2os.pioneer.serve.fleet_order import FleetOrder, RobotOrder, make_fleet, read_aux
from p2os.pioneer.serve.host import IDLE_WAIT_S, Host
from p2os.pioneer.serve.orders import carry_out
from p2os.pioneer.world.model import Pose
from p2os.protocol.profiles import Profile
from p2os.transport.waiting import Waits, WakeUp, waits_of
from p2os.transport.wall_clock import Clock, wall_clock
from simbase.errors import P2osError, UsageError, nearest, shown
from simbase.timing import NS_PER_S, Nanos

#: chosen: the host looks up at once; on a busy machine it may take longer.
ENDING_S = 30.0
#: chosen: how often a thread that waits for an answer looks whether it has come, if nobody tells it.
PATIENCE_S = 1.0
#: chosen: how often a program that ends serving looks whether that is done.
LOOK_S = 0.002


class ServedPioneer(str):
    """The URL of a robot that is served in the background, and orders to it.

    It is a text, so that it stands wherever a URL is wanted; `served_pioneer` makes it.
    """

    __slots__ = ("_orders", "body", "clock")

    #: Which body it has: `kinematic`, `bullet` or `mujoco`.
    body: str
    #: The robot's clock: that of its client too, where it is a `VirtualClock`.
    clock: Clock
    _orders: "_Orders"

    def __new__(cls, url: str, body: str, orders: "_Orders", clock: Clock = wall_clock) -> Self:
        """Return the handle of a robot that takes its orders from `orders`."""
        made = super().__new__(cls, url)
        made.body, made._orders, made.clock = body, orders, clock
        return made

    def reset(self) -> None:
        """Put the robot back at its start, as just switched on, and what could be pushed in its place.

        The session of a client ends, its connection stays: half a second later the robot says packet 0xFF and waits
        for SYNC0.

        Raises:
            P2osError: It is served no more.
        """
        self.order("reset")

    def order(self, words: str) -> list[str]:
        """Execute an order of `p2os serve`'s operator, and return the answer's lines.

        Raises:
            UsageError: The words mean nothing; `help` returns what there is.
            WorldError: There is no such thing, or it is part of the building.
            P2osError: It is served no more.
        """
        return self._orders.give(words)


class _Orders:
    """Orders on their way from a program's threads to the robot's, which serves and carries them out."""

    def __init__(self, host: Host, waits: Waits) -> None:
        self._host, self._waits = host, waits
        self._waiting: queue.SimpleQueue[tuple[str, Future[list[str]]]] = queue.SimpleQueue()
        self._wake_up = WakeUp()
        self._changed = threading.Condition()
        self._is_over = self._has_ended = False

    def give(self, words: str) -> list[str]:
        """Wait until an order is carried out."""
        answer: Future[list[str]] = Future()
        self._waiting.put((words, answer))
        self._wake_up.ring()
        with self._changed:
            while not (answer.done() or self._is_over or self._has_ended):
                self._waits.wait_for_change(self._changed, PATIENCE_S)
        if answer.done():
            return answer.result()
        raise P2osError("the virtual robot is served no more")

    def end(self) -> None:
        """End serving.

        Raises:
            P2osError: The thread does not end.
        """
        self._is_over = True
        self._wake_up.ring()
        ends_s = time.monotonic() + ENDING_S
        while not self._has_ended and time.monotonic() < ends_s:
            self._waits.look(LOOK_S)
        if not self._has_ended:
            raise P2osError("the virtual robot's thread does not end")
        self._wake_up.close()

    def serve(self) -> None:
        """Serve the robot until that is to end: what its thread does."""
        host = self._host
        try:
            while not self._is_over:
                self._carry_out()
                host.turn(IDLE_WAIT_S, woken_by=(self._wake_up.fileno(),))
                self._wake_up.clear()
        finally:
            host.close()
            with self._changed:
                self._has_ended = True
                self._changed.notify_all()

    def _carry_out(self) -> None:
        while not self._waiting.empty():
            words, answer = self._waiting.get()
            try:
                answer.set_result(carry_out([self._host], words))
            except P2osError as error:
                answer.set_exception(error)
            with self._changed:
                self._changed.notify_all()


@contextlib.contextmanager
def served_pioneer(
    *,
    url: str = "tcp:127.0.0.1:0",
    robot: str = "p2dx",
    world: str = "room",
    body: str = BEST,
    seed: int = 0,
    firmware: Profile | str | None = None,
    for_client: str | None = None,
    lenient: bool | None = None,
    laser: str | None = None,
    all_sonar: bool = False,
    rear_sonar: bool | None = None,
    flash: str | Path | None = None,
    errors: str = "ideal",
    baud: int | None = None,
    at: tuple[float, ...] | None = None,
    faults: Sequence[str] = (),
    aux: Sequence[str] = (),
    worlds: str | Path | None = None,
    speed: float = 1.0,
    sync_limit_s: float | None = None,
    settings: ControllerSettings | None = None,
    on_event: Callable[[Nanos, str, str], None] | None = None,
    clock: Clock = wall_clock,
) -> Iterator[ServedPioneer]:
    """Serve a virtual robot while the block runs, and give the URL that clients connect to.

    Args:
        url: Where to listen; port 0 takes any free one, `pty:PATH` is a serial port.
        robot: Model, or a file of parameters.
        world: World, or a file of one.
        body: `kinematic`, `bullet`, `mujoco`, or `best`: the best that is installed.
        seed: Of everything random.
        firmware: Whose packets it sends: P2OS, AROS or ARCOS; None: those of the model's own firmware.
        for_client: What a client library expects of a simulator: `aria`.
        lenient: Answer syncs in any order, and execute any family's and a simulator's commands.
        laser: A simulated one: MODEL, or FIELD,STEP,RANGE.
        all_sonar: Send every sonar in every packet.
        rear_sonar: Fit the rear ring too, where it is an option of the model.
        flash: A file with the robot's FLASH.
        errors: Of the sensors: `ideal`, `realistic`, or a file.
        baud: Speed of the line, bit/s: bytes take that time; None: none.
        at: Where it begins: metres, metres, and radians if not 0; None: where the world has its start.
        faults: What is injected from the start, in the words of `p2os serve --fault`.
        aux: What hangs at its AUX ports: `1=pty:/tmp/aux1`.
        worlds: Folder whose files clients may load as worlds; None: only what ships.
        speed: Robot seconds a second.
        sync_limit_s: A client without an open session for so long is let go; None: never.
        settings: How the robot's firmware behaves, in place of all from `firmware` to `baud`.
        on_event: Called with (nanoseconds, what, detail) from the robot's thread.
        clock: Nanoseconds; never goes back. That of the client's too, where it is a `VirtualClock`.

    Raises:
        P2osError: There is no such robot, world or body, the place is taken, or an option means nothing.
    """
    named = {
        "client": for_client, "firmware": _family(firmware), "lenient": lenient,
        "laser": None if laser is None else read_laser(laser), "all_sonar": all_sonar or None,
        "rear_sonar": rear_sonar, "flash": None if flash is None else load_flash(Path(flash)),
        "errors": None if errors == "ideal" else load_sensor_errors(errors), "baud": baud,
    }  # fmt: skip
    options = {name: value for name, value in named.items() if value is not None}
    if settings is not None and options:
        raise UsageError(f"settings beside {', '.join(options)}", hint="ControllerSettings has all of them")
    order = FleetOrder(
        robots=(
            RobotOrder(
                port=url, model=robot, at=None if at is None else Pose(*(*at, 0.0)[:3]),
                settings=settings or ControllerSettings.of(**options),  # type: ignore[arg-type]  # as the names say
                faults=tuple(faults), aux=tuple(map(read_aux, aux)),
                sync_limit_ns=None if sync_limit_s is None else round(sync_limit_s * NS_PER_S),
            ),
        ),
        world=world, body=body, seed=seed, worlds=None if worlds is None else Path(worlds),
    )  # fmt: skip
    made = make_fleet(order)
    (host,) = open_hosts(order, made, events=[on_event], speed=speed, clock=clock)
    waits = waits_of(clock)
    orders = _Orders(host, waits)
    thread = threading.Thread(target=orders.serve, name="p2os-pioneer", daemon=True)
    thread.start()
    waits.add(thread)
    try:
        yield ServedPioneer(host.listener.description, made.body, orders, clock)
    finally:
        orders.end()


def _family(name: Profile | str | None) -> Profile | None:
    """Return the family of firmware that a name says.

    Raises:
        UsageError: There is none of the name.
    """
    if name is None or isinstance(name, Profile):
        return name
    names = [profile.value for profile in Profile]
    if name.upper() not in names:
        raise UsageError(f"no firmware {shown(name)}", hint=nearest(name.upper(), names))
    return Profile(name.upper())
