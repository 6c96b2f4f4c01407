"""The page of a comparison: both ways in one plan, speeds and differences over time, and where they part.

The page itself is `p2os.view.page`.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, cast

from p2os.view.header import ChannelHeader, PageHeader, PageSection, PageText, RobotHeader
from p2os.view.page import page_of
from p2os.view.recording import ViewRecording
from p2os.view.world_plan import world_of
from robot_bench.drives.drive import Drive, Floats, Trajectory
from robot_bench.experiments.comparison import Comparison
from robot_bench.experiments.parting import motion_parts_s
from robot_bench.view.run_tracks import WARNING
from simbase.timing import NS_PER_S


def comparison_page(found: Comparison, lines: Iterable[str]) -> str:
    """Return it as one HTML document; `lines` are what a terminal is shown of it."""
    start_ns = min(0, _ns(found.ours.t_s[0]))
    world = cast("Mapping[str, Any]", found.one.meta.get("world") or {})
    listing = PageText(text="\n".join(lines), is_listing=True)
    names = names_of(found)
    recording = ViewRecording(
        PageHeader(
            title=f"{found.other.name} compared with {found.one.name}", start_ns=start_ns,
            end_ns=max(_ns(found.ours.t_s[-1]), start_ns + 1), world=world_of(world) if world else None,
            robots=[_robot(name, drive) for name, drive in zip(names, (found.one, found.other), strict=True)],
            sections=[PageSection(title="How far they are apart", blocks=[listing])],
        )
    )  # fmt: skip
    for name, way in zip(names, (found.ours, found.theirs), strict=True):
        _add_way(recording, name, way)
    _add_differences(recording, found)
    if (came := found.origin) is not None:
        part, begin_s = came
        what = "parts" if motion_parts_s(found.parts) is not None else "differs"
        events = recording.add(ChannelHeader(name="events", kind="events"))
        events.append(_ns(begin_s), WARNING, part.bound.stage, what, part.signal, math.nan, math.nan)
    return page_of(recording)


def names_of(found: Comparison) -> tuple[str, str]:
    """Return what the two are called, with whose poses they are where the names alone do not tell them apart."""
    one, other = found.one.name, found.other.name
    if one == other or found.how.poses[0] != found.how.poses[1]:
        one, other = f"{one} ({found.how.poses[0]})", f"{other} ({found.how.poses[1]})"
    return (one, other) if one != other else (f"{one}, A", f"{other}, B")


def _add_way(recording: ViewRecording, name: str, way: Trajectory) -> None:
    pose = recording.add(ChannelHeader(name="pose", kind="pose", group="robot", source=name))
    for t, x, y, heading in zip(way.t_s, way.x_m, way.y_m, way.heading_rad, strict=True):
        pose.append(_ns(t), float(x), float(y), 0.0, float(heading), 0.0)
    at, speed, _ = way.speeds()
    _samples(recording, "speed", "m/s", at, speed, source=name)


def _add_differences(recording: ViewRecording, found: Comparison) -> None:
    ours, theirs = found.ours, found.theirs
    apart = [math.hypot(a - b, c - d) for a, b, c, d in zip(theirs.x_m, ours.x_m, theirs.y_m, ours.y_m, strict=True)]
    _samples(recording, "apart", "m", ours.t_s, apart)
    turned = [math.degrees(b - a) for a, b in zip(ours.heading_rad, theirs.heading_rad, strict=True)]
    _samples(recording, "heading differs", "deg", ours.t_s, turned)


def _samples(
    recording: ViewRecording,
    name: str,
    unit: str,
    times_s: Floats,
    values: Floats | Sequence[float],
    source: str = "",
) -> None:
    track = recording.add(ChannelHeader(name=name, kind="samples", unit=unit, group=name, source=source))
    for t, value in zip(times_s, values, strict=True):
        track.append(_ns(t), float(value))


def _robot(name: str, drive: Drive) -> RobotHeader:
    body = drive.parameters.body
    return RobotHeader(
        name=name, model=str(drive.parameters.subclass), front_m=body.hull_front_m, rear_m=body.hull_rear_m,
        width_m=body.hull_width_m,
    )  # fmt: skip


def _ns(seconds: float) -> int:
    return round(float(seconds) * NS_PER_S)
