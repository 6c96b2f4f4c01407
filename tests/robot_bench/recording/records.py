"""Run records made by hand, for goals and exports."""

from collections.abc import Iterator

from robot_bench.events.kinds import Event, PinEdge, Pose, Text
from robot_bench.recording.run_record import RunRecord
from robot_bench.wires.edges import Edges

S = 10**9


def pose(t: int = 0, x: int = 0, y: int = 0, *, left: int = 0, la: int = 0, ra: int = 0, collisions: int = 0,
         work: int | None = None) -> Pose:  # fmt: skip
    return Pose(
        t=t, x=x, y=y, z=0, heading=0, pitch=0, left=left, right=0, left_angle=la, right_angle=ra,
        collisions=collisions, work=work,
    )  # fmt: skip


def text(*lines: tuple[float, str]) -> list[tuple[int, bytes]]:
    return [(round(at * S), (line + "\n").encode()) for at, line in lines]


def motor_pins(*steps: tuple[float, int, int], skew_ns: int = 0) -> dict[str, Edges]:
    """Edges of both motors' pins for (seconds, left value, right value); the right ones come later by the skew."""
    pins: dict[str, Edges] = {}
    for motor in (1, 2):
        for bit in range(3):
            edges = Edges()
            for at, *values in steps:
                level = values[motor - 1] >> bit & 1
                if not edges or edges[-1][1] != level:
                    edges.append(round(at * S) + (skew_ns if motor == 2 and at else 0), level)
            pins[f"motor{motor}_comm{bit + 1}"] = edges
    return pins


def record(**fields: object) -> RunRecord:
    return RunRecord(meta={"scenario": "mine"}, is_cut=False, **fields)  # type: ignore[arg-type]


def events_in(run: RunRecord) -> Iterator[Event]:
    """Yield what a record holds as its subscribers would have got it."""
    edges = [PinEdge(t=t, wire=net, level=bool(v)) for net, track in run.pins.items() for t, v in track]
    texts = [Text(t=t, data=data) for t, data in run.usart]
    ranked = (edges, texts, run.changes, run.contacts, run.poses)
    yield from sorted((event for kind in ranked for event in kind), key=lambda event: event.t)
