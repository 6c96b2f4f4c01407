"""A robot at a port on a page: what `--view` of the verbs does that hold one, and `p2os view URL`."""

import contextlib
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

from p2os.cli.captures.shown_page import shown
from p2os.cli.held_robot import held, say_what_is_beyond
from p2os.cli.robots.driven_page import PageDriver
from p2os.cli.robots.page_stop import STOPPED_FROM_PAGE, PageStop
from p2os.client import Robot
from p2os.transport import Transport, open_url
from p2os.transport.wall_clock import wall_clock
from p2os.view.header import HandsOffer
from p2os.view.live import RunControl
from p2os.view.targets import ViewTarget
from p2os.view.watched_line import WatchedConversation

#: chosen: how often is looked whether the robot is still there.
_LOOK_S = 1.0


@contextlib.contextmanager
def opened_for(
    url: str, robot: str, *, is_viewed: bool, is_opened: bool, stop: PageStop | None = None
) -> Iterator[Callable[[str], Transport]]:
    """Yield what opens a robot's line, which a page watches where it is viewed, and from where it may be stopped.

    Raises:
        UsageError, MissingDependencyError: As of `shown`.
    """
    if not is_viewed:
        yield open_url
        return
    watched = WatchedConversation(url, robot, wall_clock)
    if stop is not None:
        _offer(watched, STOPPED_FROM_PAGE, stop)
    with shown(watched.source, is_opened=is_opened):
        try:
            yield partial(_watched, watched)
        finally:
            watched.source.end()


def watched_target(named: str) -> ViewTarget:
    """Return a robot at a URL, watched without being moved."""
    watched = WatchedConversation(named, "", wall_clock)

    def run() -> None:
        try:
            with held(Robot(named, auto_enable=False, opener=partial(_watched, watched))) as client:
                while True:
                    client.sleep(_LOOK_S)
        finally:
            watched.source.end()

    return ViewTarget(source=watched.source, run=run, driven=partial(_driven_target, named))


def _driven_target(named: str, most_mps: float, most_dps: float) -> ViewTarget:
    """Return a robot at a URL that its page drives, no faster than this."""
    watched = WatchedConversation(named, "", wall_clock)
    driver = PageDriver(most_mps, most_dps)
    _offer(watched, HandsOffer(is_real=True, most_mps=most_mps, most_dps=most_dps), driver)

    def run() -> None:
        try:
            with held(Robot(named, opener=partial(_watched, watched)), moves=True) as client:
                say_what_is_beyond(client.limits, speed_mps=most_mps, rate_radps=math.radians(most_dps))
                driver.drive(client)
        finally:
            watched.source.end()

    return ViewTarget(source=watched.source, run=run)


def _offer(watched: WatchedConversation, hands: HandsOffer, control: RunControl) -> None:
    """Let a page do something to the robot that it watches."""
    recording = watched.source.recording
    recording.header = replace(recording.header, hands=hands)
    watched.source.control = control


def _watched(conversation: WatchedConversation, url: str) -> Transport:
    return conversation.watched(open_url(url))
