"""What the PNG plots of a run are drawn from: seconds, metres, radians and m/s; of a long run as much as can be seen.

The page draws the run's channels (`robot_bench.view`); the plan with its labels is for pictures that stand still.
"""

from collections.abc import Sequence
from typing import cast

from p2os.view.detail import changes, curve_of
from robot_bench.events.codec import Json
from robot_bench.events.kinds import WorldChange
from robot_bench.recording.run_record import RunRecord
from robot_bench.recording.signals import grouped, levels_and_duties, motor_steps, pin_labels
from robot_bench.recording.summary import verdict
from robot_bench.report.plan import plan
from simbase.timing import NS_PER_S

#: chosen: one a pixel of the plots.
PIXELS = 1200
#: chosen: what a plot of some hundred pixels shows.
PIN_PIXELS = 500
MOST_MOVES = 2000
MOST_HITS = 500


def drawn_of(record: RunRecord) -> Json:
    """Return what the plots draw."""
    world = cast("Json", record.meta.get("world") or {})
    obstacles = [_obstacle(item) for item in cast("list[Json]", world.get("obstacles") or [])]
    changes, poses = _changes(record), _poses(record)
    hits = [(_seconds(hit.t), hit.x_m, hit.y_m, hit.what) for hit in record.contacts[:MOST_HITS]]
    extent = cast("list[float]", world.get("extent") or [-3, -3, 3, 3])
    duration = max(_seconds(record.last_ns), 1e-6)
    return {
        "title": f"{record.meta.get('scenario', 'run')} in {world.get('name', '?')}: {verdict(record)}",
        "duration": duration,
        "obstacles": obstacles,
        "plan": plan(extent=extent, poses=poses, obstacles=obstacles, changes=changes, hits=hits, duration_s=duration),
        "robot": _robot(cast("Json", record.meta.get("robot") or {})),
        "changes": changes,
        "poses": poses,
        "motors": [_motor(record, motor, record.step_mps) for motor in (1, 2)],
        "pins": _pins(record),
        "hits": hits,
    }


def _changes(record: RunRecord) -> list[Json]:
    """Return the changes of the world; of what walks or is pushed on and on, the last place in each bucket of time."""
    moves = [change.name for change in record.changes if change.op == "move"]
    names = {change.name for change in record.changes}
    width = 0 if len(moves) <= MOST_MOVES else record.last_ns * len(names) / MOST_MOVES
    kept: dict[object, WorldChange] = {}
    for number, change in enumerate(record.changes):
        kept[(change.name, int(change.t / width)) if width and change.op == "move" else number] = change
    ordered = sorted(kept.values(), key=lambda change: change.t)
    return [_obstacle({"op": item.op, "name": item.name, **item.fields, "t": _seconds(item.t)}) for item in ordered]


def _poses(record: RunRecord) -> list[list[float]]:
    poses = record.poses
    columns = [[getattr(pose, name) for pose in poses] for name in ("x", "y", "left", "right")]
    kept = [poses[n] for n in curve_of([pose.t for pose in poses], columns, PIXELS)]
    return [[_seconds(p.t), *(round(value / 1e6, 4) for value in (p.x, p.y, p.heading, p.left, p.right))] for p in kept]


def _motor(record: RunRecord, motor: int, step: float) -> list[list[float]]:
    steps = motor_steps(record.pins, motor)
    kept = [steps[n] for n in curve_of(steps.times, [steps.values], PIXELS)]
    return [[_seconds(t), value * step] for t, value in kept]


def _pins(record: RunRecord) -> list[Json | list[object]]:
    kept = {net: _drawn(record, net) for net in record.pins}
    pins = cast("dict[str, str]", record.meta.get("pins") or {})
    labels = {net: f"{pin} {net}" for net, pin in pins.items()} | pin_labels()
    return [
        [title, [[labels.get(net, net), [[_seconds(t), level] for t, level in kept[net]]] for net in nets]]
        for title, nets in grouped(sorted(record.pins))
    ]


def _drawn(record: RunRecord, net: str) -> Sequence[tuple[int, float]]:
    """Return what is drawn of a net: its edges, and while it shows a wave its duty as a part of the level."""
    edges = record.pins[net]
    if net not in record.waves:
        return [edges[row] for row, _ in changes(edges.times, 0, len(edges), PIN_PIXELS)]
    rows = levels_and_duties(record, net)
    return [rows[n] for n in curve_of([t for t, _ in rows], [[value for _, value in rows]], PIN_PIXELS)]


def _seconds(ns: int) -> float:
    return round(ns / NS_PER_S, 6)


def _obstacle(item: Json) -> Json:
    """Return an obstacle with the two marks that the plots colour by."""
    kind = str(item.get("kind", ""))
    return {**item, "wall": kind in {"wall", "rail"}, "floor": kind in {"floor", "ramp"}}


def _robot(robot: Json) -> Json:
    return {
        "front": robot.get("front_m", 0.18),
        "rear": robot.get("rear_m", 0.26),
        "width": robot.get("width_m", 0.38),
    }
