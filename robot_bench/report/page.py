"""The self-contained HTML page of a run: data, style and script in one file.

No library and no network: the page opens from a file, in a mail or as a CI
artefact. All drawing happens in `page.js` from the JSON built here.
"""

import html
import json
from importlib.resources import files
from string import Template
from typing import cast

from p2os.timing import NS_PER_S
from robot_bench.recording.run_record import Json, RunRecord
from robot_bench.recording.signals import grouped, motor_steps
from robot_bench.recording.summary import figures, verdict
from robot_bench.report.packets import describe

#: Speed of one motor step where a trace does not hold it: the adapter's default, m/s.
DEFAULT_STEP_MPS = 0.0625
#: Height of one pin's row and of a group's title in page.js, pixels.
PIN_ROW_PX = 17
GROUP_PX = 22
AXIS_PX = 26


def render_page(record: RunRecord) -> str:
    """Return the report of a run as one HTML document."""
    source = files("robot_bench.report")
    result = verdict(record)
    data = json.dumps(page_data(record), separators=(",", ":")).replace("</", "<\\/")
    nets = grouped(sorted(record.pins))
    return Template(source.joinpath("page.html").read_text(encoding="utf-8")).substitute(
        title=html.escape(f"{record.meta.get('scenario', 'run')} · {result}"),
        heading=html.escape(str(record.meta.get("scenario", "run"))),
        verdict=html.escape(result),
        verdict_class=html.escape(result.split()[0]),
        lead=html.escape(_lead(record.meta)),
        figures="".join(f"<tr><td>{html.escape(k)}</td><td>{html.escape(v)}</td></tr>" for k, v in figures(record)),
        goals=_goals(record.end),
        pins_height=AXIS_PX + sum(GROUP_PX + PIN_ROW_PX * len(names) for _, names in nets),
        footer=html.escape(_footer(record)),
        style=source.joinpath("page.css").read_text(encoding="utf-8"),
        script=source.joinpath("page.js").read_text(encoding="utf-8"),
        data=data,
    )


def page_data(record: RunRecord) -> Json:
    """Return what the page's script draws: seconds, metres, radians and m/s."""
    world = cast("Json", record.meta.get("world") or {})
    step = float(cast("float", record.meta.get("step_mps") or DEFAULT_STEP_MPS))
    return {
        "duration": _seconds(max(record.last_ns, 1)),
        "threshold": record.meta.get("threshold_m") or 0.0,
        "world": {
            "obstacles": [_obstacle(item) for item in cast("list[Json]", world.get("obstacles") or [])],
            "extent": world.get("extent") or [-3, -3, 3, 3],
        },
        "robot": _robot(cast("Json", record.meta.get("robot") or {})),
        "changes": [_obstacle({**item, "t": _seconds(cast("int", item["t"]))}) for item in record.obstacles],
        "poses": [
            [_seconds(p.t), p.x / 1e6, p.y / 1e6, p.heading / 1e6, p.left / 1e6, p.right / 1e6] for p in record.poses
        ],
        "sonar": [[_seconds(t), *(mm / 1000 for mm in ranges)] for t, ranges in record.sonar],
        "nearest": [[_seconds(t), min(ranges) / 1000] for t, ranges in record.sonar if ranges],
        "motors": [
            [[_seconds(t), value * step] for t, value in motor_steps(record.pins, motor)] or [[0, 0]]
            for motor in (1, 2)
        ],
        "pins": [
            [title, [[net, [[_seconds(t), level] for t, level in record.pins[net]]] for net in nets]]
            for title, nets in grouped(sorted(record.pins))
        ],
        "events": [[_seconds(e.t), e.who, e.what, e.detail] for e in record.events],
        "usart": [[_seconds(t), text] for t, text in record.usart_lines()],
        "packets": [
            [_seconds(chunk.t), chunk.direction, name, text, chunk.data.hex(" ")]
            for chunk in record.wire
            for name, text in describe(chunk)
        ],
    }


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
    items += [f"<li>{html.escape(text)}</li>" for text in failures]
    goals = f'<ul class="goals">{"".join(items)}</ul>' if items else ""
    blocks = cast("list[str]", end.get("last_blocks") or [])
    if not blocks:
        return goals
    text = html.escape("\n".join(blocks))
    return f"{goals}<details><summary>What ran last, by cycle</summary><pre>{text}</pre></details>"


def _footer(record: RunRecord) -> str:
    digest = record.end.get("trace_sha256")
    note = str(record.meta.get("note") or "")
    parts = [
        f"trace sha256 {digest}" if digest else "the run was cut: no trace hash",
        f"firmware sha256 {record.meta.get('firmware_sha256', '?')}",
        note,
    ]
    return " · ".join(part for part in parts if part)
