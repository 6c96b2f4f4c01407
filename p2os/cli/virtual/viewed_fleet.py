"""Served robots on a page: what `--view` of `p2os serve` does."""

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from p2os.capture import Direction
from p2os.cli.captures.shown_page import shown
from p2os.event_log import EventCallback
from p2os.pioneer.serve.fleet_order import FleetOrder, MadeFleet
from p2os.pioneer.serve.host import Host
from p2os.pioneer.world import load_world
from p2os.transport import Listener, listen_url
from p2os.view.served_robots import ServedRobots
from p2os.view.watched_line import WatchedListener
from simbase.timing import Nanos

#: chosen: as often as a run's trace has poses.
SAMPLE_S = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class Viewing:
    """What a fleet is opened with; without a page it is as ever."""

    events: Sequence[EventCallback]
    listens: Sequence[Callable[[str], Listener]] = ()
    ticks: Sequence[tuple[float, Callable[[], None]]] = ()


@contextlib.contextmanager
def viewing(
    order: FleetOrder, made: MadeFleet, events: Sequence[EventCallback], hosts: Callable[[], Sequence[Host]], *,
    is_viewed: bool, is_opened: bool,
) -> Iterator[Viewing]:  # fmt: skip
    """Yield what a fleet is opened with, and serve its page for the block where it is viewed.

    Args:
        order: What was made.
        made: Its robots.
        events: Who is told what each of them does.
        hosts: Returns the hosts, once they are open.
        is_viewed: Whether there is a page.
        is_opened: Whether a browser is opened.

    Raises:
        UsageError, MissingDependencyError: As of `shown`.
    """
    if not is_viewed:
        yield Viewing(events=events)
        return
    parameters = [pioneer.parameters for pioneer in made.robots]
    robots = ServedRobots(f"serve {order.world}", load_world(order.world, seed=order.seed), parameters)

    def now(number: int) -> Nanos:
        opened = hosts()
        return opened[number].now if number < len(opened) else 0

    def on_bytes(number: int, direction: Direction, data: bytes) -> None:
        robots.bytes_of(number, direction, data, now(number))

    def listen(number: int, url: str) -> Listener:
        return WatchedListener(listen_url(url), partial(on_bytes, number))

    def on_event(number: int, at: Nanos, what: str, detail: str) -> None:
        events[number](at, what, detail)
        robots.event(number, at, what, detail)

    def sample() -> None:
        for number, host in enumerate(hosts()):
            robots.sample(number, host.pioneer.body.state, host.now)

    numbers = range(len(made.robots))
    with shown(robots.source, is_opened=is_opened):
        try:
            yield Viewing(
                events=[partial(on_event, number) for number in numbers],
                listens=[partial(listen, number) for number in numbers],
                ticks=[(SAMPLE_S, sample)],
            )
        finally:
            robots.source.end()
