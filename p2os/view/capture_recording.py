"""A recorded conversation as a recording of the page: its packets, and what a robot's packets say of itself.

Where the robot is follows from its odometry, over any number of wraps; that is what it believes, not the truth. Its
sonar are those that its model has; each keeps its last reading.

Invariant: the capture alone decides what is shown.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import cast

from p2os.capture import Chunk, Direction, ListingRow, open_file
from p2os.protocol.frames import CHECKSUM_BYTES, PREFIX_BYTES, Frame
from p2os.protocol.odometry import Odometry
from p2os.protocol.sip import StandardSip
from p2os.robots.parameters import RobotParameters
from p2os.view.frames import LaterText
from p2os.view.header import ChannelHeader, PageCell, PageHeader, PageSection, PageTable, RobotHeader, SensorPlace
from p2os.view.packet_rows import PacketRows
from p2os.view.recording import ChannelTrack, ViewRecording
from simbase.timing import Nanos

_INFO, _WARNING = 1, 2
#: Field of a SIP → name, unit, group of the channel of samples that it is shown as.
_SAMPLES: Mapping[str, tuple[str, str, str]] = {
    "left_mps": ("left", "m/s", "wheels"), "right_mps": ("right", "m/s", "wheels"),
    "battery_v": ("battery", "V", "battery"),
}  # fmt: skip
#: Field of a SIP → what it is called when it comes.
_EVENTS: Mapping[str, str] = {
    "stall_left": "left wheel stalled", "stall_right": "right wheel stalled", "front_bumpers": "front bumpers",
    "rear_bumpers": "rear bumpers",
}  # fmt: skip


def open_recording(path: Path) -> ViewRecording:
    """Return what a file of a capture holds.

    Raises:
        FileError: It cannot be read, or holds no capture.
    """
    capture = open_file(path)
    rows = CaptureTracks(ViewRecording(PageHeader(title=path.name, lead=capture.note)))
    rows.take(capture.chunks)
    return rows.recording


class CaptureTracks:
    """Adds what goes over a P2OS line to a recording.

    Args:
        recording: Where channels are added.
        robot: Model or file; empty: what the robot says.
        source: The robot's name among several; empty: the only one.
        has_odometry: Whether pose and wheels are taken out of the packets; False where the truth is known.
    """

    def __init__(
        self, recording: ViewRecording, robot: str = "", source: str = "", *, has_odometry: bool = True
    ) -> None:
        self.recording, self._source, self._has_odometry = recording, source, has_odometry
        self._packets = PacketRows(robot)
        self._odometry: Odometry | None = None
        self._parameters: RobotParameters | None = None
        self._ranges_m: list[float] = []
        self._tracks: dict[str, ChannelTrack] = {}
        self._counts = {"packets": 0, "damaged": 0}
        self._was: dict[str, object] = {}

    def take(self, chunks: Iterable[Chunk]) -> None:
        """Take all of a conversation, to its end."""
        now: Nanos = 0
        for chunk in chunks:
            now = chunk.at_ns
            self.take_chunk(chunk)
        for row, listed in self._packets.finish(now):
            self._add(row[0], row[1:], listed)
        table = PageTable(rows=[[PageCell(text=name), PageCell(text=str(count), is_number=True)]
                                for name, count in self._counts.items()])  # fmt: skip
        self.recording.header = replace(
            self.recording.header, end_ns=max(now, 1), sections=[PageSection(title="Figures", blocks=[table])]
        )

    def take_chunk(self, chunk: Chunk) -> None:
        """Take what has come, of a conversation that goes on."""
        for row, listed in self._packets.take(chunk):
            self._add(row[0], row[1:], listed)

    def _add(self, t: Nanos, cells: tuple[int, bytes, str, LaterText, LaterText, int], listed: ListingRow) -> None:
        self._track(ChannelHeader(name="P2OS", kind="packets", group="packets")).append(t, *cells)
        self._counts["damaged" if cells[-1] else "packets"] += 1
        if cells[-1]:
            self._event(t, _WARNING, "line", listed.name, listed.problem)
        elif listed.direction is Direction.FROM_ROBOT and listed.is_sip:
            self._sip(t, listed)
        elif listed.direction is not Direction.FROM_ROBOT and listed.name in {"OPEN", "CLOSE", "ENABLE", "E_STOP"}:
            self._event(t, _INFO, "client", listed.name, str(cells[3]))

    def _sip(self, t: Nanos, listed: ListingRow) -> None:
        reading = self._packets.reading.reading
        if self._parameters is not reading.parameters:
            self._begin(reading.parameters)
        assert self._odometry is not None  # noqa: S101 - `_begin` has made it
        payload = listed.data[PREFIX_BYTES:-CHECKSUM_BYTES]
        at = self._odometry
        at.update(StandardSip.from_frame(Frame(payload), reading.profile))
        if self._has_odometry:
            self._track(_POSE).append(t, at.x_m, at.y_m, 0.0, at.heading_rad, 0.0)
        for field, (name, unit, group) in _SAMPLES.items():
            if group == "wheels" and not self._has_odometry:
                continue
            value = cast("float", listed.fields[field])
            self._track(ChannelHeader(name=name, kind="samples", unit=unit, group=group)).append(t, value)
        for field, what in _EVENTS.items():
            now = listed.fields[field]
            # What a robot begins with is no event: without bumpers their bits are set.
            if now and now != self._was.get(field, now):
                detail = f"0b{now:07b}" if field.endswith("bumpers") else ""
                self._event(t, _WARNING, "robot", what, detail)
            self._was[field] = now
        self._sonar(t, cast("Mapping[str, float]", listed.fields["sonar_m"]))

    def _begin(self, parameters: RobotParameters) -> None:
        """Take a robot's units, and its outline where it is the first."""
        self._parameters, self._odometry = parameters, Odometry(parameters)
        # The first robot's: a channel keeps its width.
        self._ranges_m = self._ranges_m or [math.nan] * parameters.sonar_fitted
        header = self.recording.header
        body = parameters.body
        robot = RobotHeader(
            name=self._source, model=parameters.subclass, front_m=body.hull_front_m, rear_m=body.hull_rear_m,
            width_m=body.hull_width_m,
        )  # fmt: skip
        if all(one.name != self._source for one in header.robots):
            self.recording.header = replace(header, robots=(*header.robots, robot))

    def _sonar(self, t: Nanos, readings: Mapping[str, float]) -> None:
        """Add the ranges where one is new."""
        assert self._parameters is not None  # noqa: S101 - a SIP has come
        known = {int(number): value for number, value in readings.items() if int(number) < len(self._ranges_m)}
        if not known:
            return
        for number, value in known.items():
            self._ranges_m[number] = value if value < self._parameters.sonar_range_m else math.nan
        sonar = self._tracks.get("ranges:sonar") or self._track(_sonar_header(self._parameters))
        sonar.append(t, self._ranges_m[: sonar.header.width])
        nearest = min((value for value in self._ranges_m if not math.isnan(value)), default=math.nan)
        self._track(_NEAREST).append(t, nearest)

    def _event(self, t: Nanos, severity: int, who: str, what: str, detail: str) -> None:
        events = self._tracks.get("events") or self.recording.shared(_EVENT)
        self._tracks["events"] = events
        events.append(t, severity, f"{self._source} {who}".lstrip(), what, detail, math.nan, math.nan)

    def _track(self, header: ChannelHeader) -> ChannelTrack:
        key = f"{header.kind}:{header.name}"
        if key not in self._tracks:
            self._tracks[key] = self.recording.add(replace(header, source=self._source))
        return self._tracks[key]


_POSE = ChannelHeader(name="pose", kind="pose", group="robot", doc="odometry: what the robot believes")
_EVENT = ChannelHeader(name="events", kind="events")
_NEAREST = ChannelHeader(
    name="nearest echo", kind="samples", unit="m", group="sonar", doc="of all sonar", is_stepped=True
)


def _sonar_header(parameters: RobotParameters) -> ChannelHeader:
    fitted = parameters.sonar[: parameters.sonar_fitted]
    return ChannelHeader(
        name="sonar", kind="ranges", unit="m", group="robot", width=parameters.sonar_fitted,
        sensors=[
            SensorPlace(name=f"sonar {number}", x_m=one.x_mm / 1000, y_m=one.y_mm / 1000,
                        bearing_rad=math.radians(one.heading_deg))
            for number, one in enumerate(fitted, start=1)
        ],
        cone_rad=math.radians(parameters.sonar_cone_deg), range_m=parameters.sonar_range_m,
    )  # fmt: skip
