"""A host in a background thread of a program: a virtual robot to try a client out, and for its tests.

    with served_pioneer(world="room") as url:
        with Robot(url) as robot:
            robot.drive(0.5)

It is `p2os serve` in a thread: real time, one client at a time.
"""

import contextlib
import threading
from collections.abc import Callable, Iterator

from p2os.pioneer.body.factory import make_body
from p2os.pioneer.controller import ControllerSettings, Pioneer
from p2os.pioneer.serve.host import Host
from p2os.pioneer.world import load_world
from p2os.robots.parameters import load_parameters
from p2os.transport import listen_url
from simbase.errors import P2osError
from simbase.timing import Nanos

#: chosen: the host looks up twice a second; on a busy machine it may take longer.
ENDING_S = 30.0


@contextlib.contextmanager
def served_pioneer(
    *,
    url: str = "tcp:127.0.0.1:0",
    robot: str = "p2dx",
    world: str = "room",
    body: str = "kinematic",
    seed: int = 0,
    settings: ControllerSettings | None = None,
    on_event: Callable[[Nanos, str, str], None] | None = None,
) -> Iterator[str]:
    """Serve a virtual robot while the block runs, and give the URL that clients connect to.

    Args:
        url: Where to listen; port 0 takes any free one, `pty:PATH` is a serial port.
        robot: Model, or a file of parameters.
        world: World, or a file of one.
        body: `kinematic`, `bullet` or `mujoco`.
        seed: Of everything random.
        settings: How the robot's firmware behaves.
        on_event: Called with (nanoseconds, what, detail) from the robot's thread.

    Raises:
        P2osError: There is no such robot, world or body, or the place is taken.
    """
    parameters, place = load_parameters(robot), load_world(world, seed=seed)
    physical = make_body(body, place, parameters)
    physical.reset(place.start, seed)
    pioneer = Pioneer(parameters=parameters, body=physical, settings=settings, on_event=on_event)
    listener = listen_url(url)
    host = Host(pioneer, listener, on_event=on_event)
    over = threading.Event()
    thread = threading.Thread(target=lambda: host.run(until=over.is_set), name="p2os-pioneer", daemon=True)
    thread.start()
    try:
        yield listener.description
    finally:
        over.set()
        thread.join(ENDING_S)
        if thread.is_alive():
            raise P2osError("the virtual robot's thread does not end")
