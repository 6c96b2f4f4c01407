"""The self-contained HTML page of a run: data, style and script in one file.

No library and no network: the page opens from a file, in a mail or as a CI
artefact. All drawing happens in `page.js` from the JSON built here.
"""

import html
import json
from collections.abc import Mapping, Sequence
from importlib.resources import files
from string import Template
from typing import cast

from robot_bench.events.codec import Json
from robot_bench.events.kinds import WorldChange
from robot_bench.recording.run_record import RunRecord
from robot_bench.recording.signals import grouped, levels_and_duties, motor_steps, pin_labels
from robot_bench.recording.summary import EXPLAINED, MEASURED, figures, verdict
from robot_bench.report.packets import describe
from robot_bench.report.plan import plan
from robot_bench.report.thinning import ends, extremes, pulses
from simbase.timing import NS_PER_S

#: chosen: of all rows of the page none makes it larger than 2 MB; what a list may take, in characters.
LIST_BYTES, WIRE_BYTES = 120_000, 500_000
#: What a row costs besides its text; a packet's name and meaning.
ROW_BYTES, PACKET_BYTES = 24, 130
PIN_BUCKETS = 500
MOST_MOVES = 2000
MOST_HITS = 500
#: What the state log calls a contact.
_COLLISION = "collision"


def render_page(record: RunRecord, drawn: Json) -> str:
    """Return the report of a run as one HTML document; `drawn` is what `page_data` returned."""
    source = files("robot_bench.report")
    result = verdict(record)
    data = json.dumps(drawn, separators=(",", ":")).replace("</", "<\\/")
    return Template(source.joinpath("page.html").read_text(encoding="utf-8")).substitute(
        title=html.escape(f"{record.meta.get('scenario', 'run')} · {result}"),
        heading=html.escape(str(record.meta.get("scenario", "run"))),
        verdict=html.escape(result),
        verdict_class=html.escape(result.split()[0].strip(",")),
        lead=html.escape(_lead(record.meta)),
        figures="".join(f"<tr><td>{html.escape(k)}</td><td>{html.escape(v)}</td></tr>" for k, v in figures(record)),
        goals=_goals(record.end),
        measured=_measured(record.end),
        measures=_measures(record),
        parts=_parts(record.end),
        left_out=_left_out(cast("list[str]", drawn["left_out"])),
        footer=html.escape(_footer(record)),
        style=source.joinpath("page.css").read_text(encoding="utf-8"),
        script=source.joinpath("page.js").read_text(encoding="utf-8"),
        data=data,
    )


def page_data(record: RunRecord) -> Json:
    """Return what the page's script draws: seconds, metres, radians and m/s; of a long run as much as can be seen."""
    left_out: list[str] = []
    world = cast("Json", record.meta.get("world") or {})
    obstacles = [_obstacle(item) for item in cast("list[Json]", world.get("obstacles") or [])]
    changes, poses = _changes(record, left_out), _poses(record, left_out)
    hits = [(_seconds(hit.t), hit.x_m, hit.y_m, hit.what) for hit in record.contacts[:MOST_HITS]]
    extent = cast("list[float]", world.get("extent") or [-3, -3, 3, 3])
    duration = max(_seconds(record.last_ns), 1e-6)
    return {
        "title": f"{record.meta.get('scenario', 'run')} in {world.get('name', '?')}: {verdict(record)}",
        "duration": duration,
        "threshold": record.meta.get("threshold_m") or 0.0,
        "obstacles": obstacles,
        "plan": plan(extent=extent, poses=poses, obstacles=obstacles, changes=changes, hits=hits, duration_s=duration),
        "robot": _robot(cast("Json", record.meta.get("robot") or {})),
        "changes": changes,
        "poses": poses,
        "sonar": _sonar(record, left_out),
        "motors": [_motor(record, motor, record.step_mps) for motor in (1, 2)],
        "pins": _pins(record, left_out),
        "hits": hits,
        "events": _events(record, left_out),
        "usart": _usart(record, left_out),
        "packets": _packets(record, left_out),
        "left_out": left_out,
    }


def _changes(record: RunRecord, left_out: list[str]) -> list[Json]:
    """Return the changes of the world; of what walks or is pushed on and on, the last place in each bucket of time."""
    moves = [change.name for change in record.changes if change.op == "move"]
    names = {change.name for change in record.changes}
    width = 0 if len(moves) <= MOST_MOVES else record.last_ns * len(names) / MOST_MOVES
    kept: dict[object, WorldChange] = {}
    for number, change in enumerate(record.changes):
        kept[(change.name, int(change.t / width)) if width and change.op == "move" else number] = change
    _note(left_out, "moves of things", len(kept), len(record.changes), "in each")
    ordered = sorted(kept.values(), key=lambda change: change.t)
    return [_obstacle({"op": item.op, "name": item.name, **item.fields, "t": _seconds(item.t)}) for item in ordered]


def _poses(record: RunRecord, left_out: list[str]) -> list[list[float]]:
    poses = record.poses
    columns = [[getattr(pose, name) for pose in poses] for name in ("x", "y", "left", "right")]
    kept = [poses[n] for n in extremes([pose.t for pose in poses], columns)]
    _note(left_out, "poses", len(kept), len(poses), "the least and greatest of each")
    return [[_seconds(p.t), *(round(value / 1e6, 4) for value in (p.x, p.y, p.heading, p.left, p.right))] for p in kept]


def _sonar(record: RunRecord, left_out: list[str]) -> list[list[float]]:
    """Return the ranges as recorded: millimetres."""
    rows = [row for row in record.sonar if row[1]]
    kept = [rows[n] for n in extremes([t for t, _ in rows], [[min(ranges) for _, ranges in rows]])]
    _note(left_out, "sonar", len(kept), len(rows), "the least and greatest of each")
    return [[_seconds(t), *ranges] for t, ranges in kept]


def _motor(record: RunRecord, motor: int, step: float) -> list[list[float]]:
    steps = motor_steps(record.pins, motor)
    kept = [steps[n] for n in extremes(steps.times, [steps.values])]
    return [[_seconds(t), value * step] for t, value in kept]


def _pins(record: RunRecord, left_out: list[str]) -> list[Json | list[object]]:
    kept = {net: _drawn(record, net) for net in record.pins}
    _note(left_out, "pins", _total(kept), _total(record.pins), "edges: the first two and the last of each")
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
        return pulses(edges, buckets=PIN_BUCKETS)
    rows = levels_and_duties(record, net)
    return [rows[n] for n in extremes([t for t, _ in rows], [[value for _, value in rows]], buckets=PIN_BUCKETS)]


def _events(record: RunRecord, left_out: list[str]) -> list[list[object]]:
    """Return the state log: its beginning, its end, and every collision of those shown on the map."""
    events = [(e.t, e.who, e.what, e.detail) for e in record.events]
    events += [(fault.t, "fault", fault.op, fault.words) for fault in record.faults]
    events += [(hit.t, "body", _COLLISION, hit.place) for hit in record.contacts]
    events.sort(key=lambda event: event[0])
    head, tail = ends([len(who) + len(what) + len(detail) + ROW_BYTES for _, who, what, detail in events], LIST_BYTES)
    shown = {*range(head), *range(len(events) - tail, len(events))}
    shown |= set([n for n, event in enumerate(events) if event[2] == _COLLISION][:MOST_HITS])
    _note(left_out, "state log", len(shown), len(events), "lines, from the beginning and the end")
    return [[_seconds(t), *words] for n, (t, *words) in enumerate(events) if n in shown]


def _usart(record: RunRecord, left_out: list[str]) -> list[list[object]]:
    lines = record.usart_lines()
    head, tail = ends([len(text) + ROW_BYTES for _, text in lines], LIST_BYTES)
    _note(left_out, "lines of text", head + tail, len(lines), "from the beginning and the end (usart.txt has all)")
    gap = _gap(len(lines) - head - tail, "lines: usart.txt has all", lines[head - 1][0] if head else 0)
    return [
        *([_seconds(t), text] for t, text in lines[:head]), *gap,
        *([_seconds(t), text] for t, text in lines[len(lines) - tail :]),
    ]  # fmt: skip


def _packets(record: RunRecord, left_out: list[str]) -> Json:
    """Return the packets as rows of time and the index of a kind, and each kind once: direction, name, meaning, bytes.

    Most commands and idle packets are said again and again.
    """
    wire = record.wire
    head, tail = ends([2 * len(chunk.data) + PACKET_BYTES for chunk in wire], WIRE_BYTES)
    _note(left_out, "packets", head + tail, len(wire), "from the beginning and the end (wire.jsonl has all)")
    kinds: dict[tuple[str, str, str, str], int] = {}
    rows: list[list[object]] = []
    for number in (*range(head), *range(len(wire) - tail, len(wire))):
        chunk = wire[number]
        if number == len(wire) - tail:
            rows += _gap(len(wire) - head - tail, "packets: wire.jsonl has all", wire[head - 1].t)
        for name, text in describe(chunk):
            kind = (chunk.direction, name, text, chunk.data.hex())
            rows.append([_seconds(chunk.t), kinds.setdefault(kind, len(kinds))])
    return {"rows": rows, "kinds": list(kinds)}


def _gap(count: int, where: str, t: int) -> list[list[object]]:
    """Return the row that stands for what a list leaves out after time t; none where it leaves out nothing."""
    return [[_seconds(t), f"… {count} {where}", "gap"]] if count else []


def _note(left_out: list[str], what: str, shown: int, there: int, how: str) -> None:
    """Add a line where not all of something is shown."""
    if shown < there:
        left_out.append(f"{what}: {shown} of {there}, {how}{' bucket of time' if how.endswith('each') else ''}")


def _total(pins: Mapping[str, Sequence[object]]) -> int:
    return sum(map(len, pins.values()))


def _seconds(ns: int) -> float:
    return round(ns / NS_PER_S, 6)


def _obstacle(item: Json) -> Json:
    """Return an obstacle with the two marks that the page colours by."""
    kind = str(item.get("kind", ""))
    return {**item, "wall": kind in {"wall", "rail"}, "floor": kind in {"floor", "ramp"}}


def _robot(robot: Json) -> Json:
    return {
        "front": robot.get("front_m", 0.18),
        "rear": robot.get("rear_m", 0.26),
        "width": robot.get("width_m", 0.38),
        "cone": robot.get("sonar_cone_rad", 0.52),
        "sonar": robot.get("sonar", []),
    }


def _lead(meta: Json) -> str:
    """Return the sentence under the title: what was run, on what, in what."""
    world = cast("Json", meta.get("world") or {})
    path = {"direct": "wired straight to the body", "adapter": "through adapter and P2OS"}.get(
        str(meta.get("mode")), ""
    )
    parts = [
        f"firmware {meta.get('firmware', '?')}",
        f"world {world.get('name', '?')}",
        f"{meta.get('body', '?')} body",
        path,
        f"seed {meta.get('seed', '?')}",
    ]
    return " · ".join(part for part in parts if part)


def _goals(end: Json) -> str:
    """Return the goals as a list, those missed with their reason; then what a program with a fault ran last."""
    failures = cast("list[str]", end.get("failures") or [])
    met = cast("list[str]", end.get("goals_met") or [])
    items = [f'<li class="passed">{html.escape(text)}</li>' for text in met]
    items += [
        f'<li class="open">{html.escape(text)}</li>' for text in cast("list[str]", end.get("goals_not_judged") or [])
    ]
    items += [f"<li>{html.escape(text)}</li>" for text in failures]
    goals = f'<ul class="goals">{"".join(items)}</ul>' if items else ""
    if end.get(EXPLAINED):
        goals += f'<p class="why">{html.escape(str(end[EXPLAINED]))}</p>'
    blocks = cast("list[str]", end.get("last_blocks") or [])
    if not blocks:
        return goals
    text = html.escape("\n".join(blocks))
    return f"{goals}<details><summary>What ran last, by cycle</summary><pre>{text}</pre></details>"


def _measured(end: Json) -> str:
    """Return a section for coverage and one for the profile, where the run measured them."""
    found = []
    for key in MEASURED:
        facts = cast("Json", end.get(key) or {})
        if facts:
            files = cast("list[str]", facts["files"])
            links = " · ".join(f'<a href="{html.escape(name)}">{html.escape(name)}</a>' for name in files)
            table = html.escape("\n".join(cast("list[str]", facts["table"])))
            found.append(f"<section><h2>{key.title()} <small>{links}</small></h2><pre>{table}</pre></section>")
    return "\n  ".join(found)


def _parts(end: Json) -> str:
    """Return a section of what was plugged into the board; empty where nothing was."""
    rows = cast("list[dict[str, str]]", end.get("parts") or [])
    if not rows:
        return ""
    items = []
    for row in rows:
        name = html.escape(row["name"])
        png = f'<br><img alt="{name}" src="data:image/png;base64,{html.escape(row["png"])}">' if "png" in row else ""
        items.append(f"<tr><td>{name}</td><td>{html.escape(row['words'])}{png}</td></tr>")
    return f"<section><h2>Parts</h2><table>{''.join(items)}</table></section>"


def _measures(record: RunRecord) -> str:
    """Return the section of the run's figures; empty where NumPy is not installed."""
    try:
        from robot_bench.report.measures import measures_section
    except ModuleNotFoundError:
        return ""
    return measures_section(record)


def _left_out(lines: list[str]) -> str:
    """Return what a page of a long run does not show; nothing where it shows all."""
    if not lines:
        return ""
    items = "".join(f"<li>{html.escape(line)}</li>" for line in lines)
    return (
        f'<details class="left-out" open><summary>A long run: this page shows a part of what was recorded; '
        f"trace.jsonl holds all</summary><ul>{items}</ul></details>"
    )


def _footer(record: RunRecord) -> str:
    digest = record.end.get("trace_sha256")
    note = str(record.meta.get("note") or "")
    parts = [
        f"trace sha256 {digest}" if digest else "the run was cut: no trace hash",
        f"firmware sha256 {record.meta.get('firmware_sha256', '?')}",
        note,
    ]
    return " · ".join(part for part in parts if part)
