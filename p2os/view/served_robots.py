"""Robots that are served, for a page: where they are in their world, what is said on their lines, what happens to them.

Their places are the truth, sampled; their sonar is what their packets say.

Invariant: who watches decides nothing.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from p2os.capture import Chunk, Direction
from p2os.pioneer.body.contract import BodyState
from p2os.pioneer.world.model import World
from p2os.robots.parameters import RobotParameters
from p2os.view.capture_recording import CaptureTracks
from p2os.view.header import ChannelHeader, PageHeader, RobotHeader
from p2os.view.live import LiveRecording
from p2os.view.recording import ChannelTrack, ViewRecording
from p2os.view.world_plan import world_of
from simbase.timing import Nanos


@dataclass(frozen=True, slots=True)
class _Robot:
    """The channels of one robot."""

    packets: CaptureTracks
    pose: ChannelTrack
    left: ChannelTrack
    right: ChannelTrack


class ServedRobots:
    """Hands over what happens to robots that are served.

    Args:
        title: Of the page.
        world: Where they are.
        robots: The parameters of each.
    """

    def __init__(self, title: str, world: World, robots: Sequence[RobotParameters]) -> None:
        names = [f"robot {number}" if len(robots) > 1 else "" for number in range(1, len(robots) + 1)]
        recording = ViewRecording(
            PageHeader(
                title=title, world=world_of(world.to_plain()),
                robots=[_header(name, one) for name, one in zip(names, robots, strict=True)],
            )
        )  # fmt: skip
        self._events = recording.shared(ChannelHeader(name="events", kind="events"))
        self._names, self._robots = names, [_channels(recording, name) for name in names]
        #: What a server shows: what is offered adds itself.
        self.source: LiveRecording[Callable[[], None]] = LiveRecording(recording, lambda add: add())

    def sample(self, number: int, state: BodyState, now: Nanos) -> None:
        """Take where a robot is, counted from 0."""
        self.source.offer(partial(_add_state, self._robots[number], state, now), now)

    def bytes_of(self, number: int, direction: Direction, data: bytes, now: Nanos) -> None:
        """Take what goes over its line."""
        chunk = Chunk(at_ns=now, direction=direction, data=data)
        self.source.offer(partial(self._robots[number].packets.take_chunk, chunk), now)

    def event(self, number: int, now: Nanos, what: str, detail: str) -> None:
        """Take what happened to it."""
        who = self._names[number] or "robot"
        self.source.offer(partial(self._events.append, now, 1, who, what, detail, math.nan, math.nan), now)


def _channels(recording: ViewRecording, name: str) -> _Robot:
    def added(channel: str, **about: str) -> ChannelTrack:
        return recording.add(ChannelHeader(name=channel, source=name, **about))  # type: ignore[arg-type]  # texts alone

    return _Robot(
        packets=CaptureTracks(recording, "", name, has_odometry=False),
        pose=added("pose", kind="pose", group="robot"),
        left=added("left", kind="samples", unit="m/s", group="wheels", doc="speed at the rim"),
        right=added("right", kind="samples", unit="m/s", group="wheels", doc="speed at the rim"),
    )


def _add_state(robot: _Robot, state: BodyState, now: Nanos) -> None:
    robot.pose.append(now, state.x_m, state.y_m, state.z_m, state.heading_rad, state.pitch_rad)
    robot.left.append(now, state.left_speed_mps)
    robot.right.append(now, state.right_speed_mps)


def _header(name: str, parameters: RobotParameters) -> RobotHeader:
    body = parameters.body
    return RobotHeader(
        name=name, model=parameters.subclass, front_m=body.hull_front_m, rear_m=body.hull_rear_m,
        width_m=body.hull_width_m,
    )  # fmt: skip
